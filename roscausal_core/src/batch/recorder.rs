//! From states to batches: rows at a fixed step of sensor time.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use roscausal_msgs::{
    Humans, RobotState, Time,
    geometry_msgs::{Point, Pose2D, Twist},
};

use super::{
    fresh::FreshRow,
    journal::{Entry, Header, Log, Sample, Subject},
    recording::{EndedBy, Recording},
    select::Select,
    signal_track::SignalTrack,
    tracks::{AHEAD_NS, Sampling, Taken, Track, Values},
};
use crate::{ensure, signal::How, state::scene::speed};

mod rows;

/// How much later than others a message may arrive and still be used. Seconds.
const LATENESS_S: f64 = 0.5;
/// If stamps go back by more than this, the clock has jumped.
const JUMP_BACK_NS: i64 = 1_000_000_000;
/// If stamps go ahead by more than this, the clock has jumped.
const JUMP_AHEAD_NS: i64 = 60_000_000_000;
/// Most people who are followed at a time and recorded in one batch.
const MOST_PEOPLE: usize = 512;
/// A batch without `ts_length` ends after this many rows.
const MOST_ROWS: usize = 1_000_000;
/// Larger stamps (73 years) are invalid: sums and differences of stamps must not overflow.
const FARTHEST_NS: u64 = 1 << 61;
/// Fewer rows in which both move say nothing of whether the robot follows.
const FEWEST_MOVING: u64 = 100;
/// Most columns of interventions.
const MOST_CONTEXT: usize = 64;

/// How to record.
#[derive(Clone, Debug, PartialEq)]
pub struct RecorderConfig {
    /// Step between rows, seconds.
    pub dt_s: f64,
    /// Length of a batch in seconds; `None`: until the end.
    pub ts_length_s: Option<f64>,
    /// Two samples farther apart than this are a gap, and the rows between them are empty; a held sample may be as old. Seconds.
    pub max_gap_s: f64,
    /// What rows hold of the samples around them.
    pub sampling: Sampling,
    /// The people to record.
    pub select: Select,
}

impl RecorderConfig {
    fn rows_per_batch(&self) -> usize {
        match self.ts_length_s {
            Some(length) => ((length / self.dt_s).round() as usize).clamp(1, MOST_ROWS),
            None => MOST_ROWS,
        }
    }
}

/// Counters for the diagnostics.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecorderCounts {
    /// Rows recorded.
    pub rows: u64,
    /// Steps skipped because robot and person were not yet there together.
    pub waited: u64,
    /// Samples whose stamp had already been recorded.
    pub duplicates: u64,
    /// Samples too late for their row.
    pub late: u64,
    /// Messages in another frame than the robot's.
    pub foreign_frame: u64,
    /// Samples dropped because too many were waiting or too many people were there.
    pub crowded: u64,
    /// How often the clock jumped.
    pub jumps: u64,
}

/// Makes batches from states.
///
/// Row `k` of all batches lies at `k * dt` of sensor time. A row is written once every message that matters to it
/// must have arrived: when the newest stamp is `max_gap` (at least 0.5 s) and 0.5 s later. So the batches depend on the messages
/// alone. A batch begins with the first row in which the robot and a selected person are there; where nobody is to be
/// recorded, with the first that has the robot or a signal, and the arrival of signals counts as a stamp.
#[derive(Debug)]
pub struct Recorder {
    config: RecorderConfig,
    dt_ns: i64,
    max_gap_ns: i64,
    rows_per_batch: usize,
    /// The length of the batches after the open one, if it is to be another.
    next_length: Option<Option<f64>>,
    robot: Track,
    people: BTreeMap<u32, Track>,
    others: BTreeMap<String, Track>,
    /// For each column of interventions: what is imposed, and from which stamp on.
    context: BTreeMap<String, VecDeque<(i64, Vec<f64>)>>,
    signals: Vec<SignalTrack>,
    /// Arrival of the newest signal. It drives the rows where nobody is to be recorded.
    newest_signal: Option<i64>,
    frame: Option<String>,
    newest_robot: Option<i64>,
    newest_people: Option<i64>,
    next_row: Option<i64>,
    open: Option<Recording>,
    votes: BTreeMap<u32, u64>,
    done: Vec<(Recording, Option<u64>)>,
    log: Option<Log>,
    /// The rows since the last [`Recorder::take_rows`]; `None`: nobody wants them.
    fresh: Option<Vec<FreshRow>>,
    seen: BTreeSet<u32>,
    /// Cells of people, and the sums of their intervals and of how far they are uneven or reach ahead; nanoseconds.
    spacing: (f64, [f64; 2]),
    /// How much later than its time the last row with people was seen; nanoseconds.
    last_late: Option<i64>,
    /// Cells of people in which they and the robot move, and those in which it follows them.
    following: [u64; 2],
    counts: RecorderCounts,
}

impl Recorder {
    /// A recorder that has received nothing.
    pub fn new(config: RecorderConfig) -> Self {
        let dt_ns = nanos(config.dt_s).max(1);
        Self {
            dt_ns,
            max_gap_ns: nanos(config.max_gap_s).max(dt_ns),
            rows_per_batch: config.rows_per_batch(),
            next_length: None,
            config,
            robot: Track::default(),
            people: BTreeMap::new(),
            others: BTreeMap::new(),
            context: BTreeMap::new(),
            signals: Vec::new(),
            newest_signal: None,
            frame: None,
            newest_robot: None,
            newest_people: None,
            next_row: None,
            open: None,
            votes: BTreeMap::new(),
            done: Vec::new(),
            log: None,
            fresh: None,
            seen: BTreeSet::new(),
            spacing: (0.0, [0.0; 2]),
            last_late: None,
            following: [0; 2],
            counts: RecorderCounts::default(),
        }
    }

    /// Makes the recorder also report what to journal. Journals are numbered from `first` on.
    #[must_use]
    pub fn with_journal(mut self, first: u64) -> Self {
        self.log = Some(Log::new(first, self.dt_ns));
        self
    }

    /// Makes the recorder also hand out each row at once ([`Recorder::take_rows`]).
    #[must_use]
    pub fn with_fresh_rows(mut self) -> Self {
        self.fresh = Some(Vec::new());
        self
    }

    /// Makes the recorder also record signals: for each its name, and what rows hold.
    #[must_use]
    pub fn with_signals(mut self, signals: &[(String, How)]) -> Self {
        self.signals = signals.iter().map(|(name, how)| SignalTrack::new(name, *how)).collect();
        self
    }

    /// Adds a value of the signal with this number. It arrived `now`.
    pub fn signal(&mut self, number: usize, stamp: Time, value: f64, now: Time) {
        let (stamp, now) = (stamp.as_nanos(), now.as_nanos());
        if self.is_driven_by_signals() {
            if jumps(self.newest_signal, now) {
                self.counts.jumps += 1;
                self.restart(EndedBy::ClockJump);
            }
            self.newest_signal = self.newest_signal.max(Some(now));
            self.next_row.get_or_insert(now.div_euclid(self.dt_ns) * self.dt_ns);
        }
        let Ok(subject) = u32::try_from(number) else { return };
        let values = Values { x: value, ..Values::UNKNOWN };
        let taken = self.insert(Sample { of: Subject::Signal(subject), stamp_ns: stamp, values });
        self.count(taken);
        if self.is_driven_by_signals() {
            self.advance(false);
        }
    }

    /// Whether rows wait for signals, because nobody is to be recorded.
    fn is_driven_by_signals(&self) -> bool {
        self.config.select == Select::Nobody
    }

    /// Whether a stamp is of another time than all others so far. No row is written for the time between.
    fn is_far(&self, stamp: i64) -> bool {
        self.newest().is_some_and(|newest| stamp.abs_diff(newest) > JUMP_AHEAD_NS.unsigned_abs())
    }

    /// The newest stamp that rows wait for.
    fn newest(&self) -> Option<i64> {
        self.newest_robot.max(self.newest_people).max(self.newest_signal)
    }

    /// The batches that the samples of a journal make. The last one may be short.
    pub(super) fn replay(header: &Header, samples: &[Sample]) -> Result<Vec<Recording>, String> {
        let allowed = |v: f64| (0.001..=60.0).contains(&v);
        if !allowed(header.dt_s)
            || !allowed(header.max_gap_s)
            || header.ts_length_s.is_some_and(|v| v.is_nan() || v < header.dt_s)
            || header.next_row_ns.unsigned_abs() > FARTHEST_NS
        {
            return Err("its header has a length or time that cannot be".into());
        }
        let mut recorder = Self::new(RecorderConfig {
            dt_s: header.dt_s,
            ts_length_s: header.ts_length_s,
            max_gap_s: header.max_gap_s,
            sampling: header.sampling,
            select: header.sel_agent.parse()?,
        });
        recorder = recorder.with_signals(&header.signals);
        recorder.frame = Some(header.frame.clone());
        recorder.next_row = Some(header.next_row_ns);
        for sample in samples {
            let newest = recorder.newest().unwrap_or(header.next_row_ns);
            let beyond = newest.saturating_add(JUMP_AHEAD_NS);
            if sample.stamp_ns > beyond || sample.stamp_ns.unsigned_abs() > FARTHEST_NS {
                // Not written by a recorder. What came before may be right.
                break;
            }
            let newest = match sample.of {
                Subject::Robot => Some(&mut recorder.newest_robot),
                Subject::Person(_) => Some(&mut recorder.newest_people),
                Subject::Signal(_) if recorder.config.select == Select::Nobody => {
                    Some(&mut recorder.newest_signal)
                }
                Subject::Signal(_) => None,
            };
            if let Some(newest) = newest {
                *newest = (*newest).max(Some(sample.stamp_ns));
            }
            recorder.insert(*sample);
            // What a journal begins with is there before its first row is made.
            if recorder.newest() >= Some(header.next_row_ns) {
                recorder.advance(false);
            }
        }
        recorder.advance(true);
        recorder.close(EndedBy::Recovery);
        Ok(recorder.take_batches())
    }

    /// Adds a state of the robot. `now` replaces a stamp of 0.
    pub fn robot(&mut self, state: &RobotState, now: Time) {
        let stamp = stamp_ns(state.header.stamp, now);
        if self.frame.as_ref().is_some_and(|frame| *frame != state.header.frame_id) {
            self.restart(EndedBy::FrameChange);
        }
        if jumps(self.newest_robot, stamp) || self.is_far(stamp) {
            self.counts.jumps += 1;
            self.restart(EndedBy::ClockJump);
        }
        self.frame.get_or_insert_with(|| state.header.frame_id.clone());
        self.newest_robot = self.newest_robot.max(Some(stamp));
        // Messages a little older than the first may still arrive.
        let first = (stamp - self.max_gap_ns - nanos(LATENESS_S)).div_euclid(self.dt_ns) * self.dt_ns;
        self.next_row.get_or_insert(first);
        if self.in_time(stamp) {
            let values = values(&state.pose2d, &state.twist, &state.goal);
            let taken = self.insert(Sample { of: Subject::Robot, stamp_ns: stamp, values });
            self.count(taken);
        }
        self.advance(false);
    }

    /// Adds a state of another robot. `now` replaces a stamp of 0. Rows wait for the robot and the people only.
    pub fn other_robot(&mut self, name: &str, state: &RobotState, now: Time) {
        if self.frame.as_ref().is_some_and(|frame| *frame != state.header.frame_id) {
            self.counts.foreign_frame += 1;
            return;
        }
        let stamp = stamp_ns(state.header.stamp, now);
        if self.in_time(stamp) {
            let track = self.others.entry(name.to_owned()).or_default();
            match track.insert(stamp, values(&state.pose2d, &state.twist, &state.goal)) {
                Taken::Duplicate => {}
                taken => self.count(taken),
            }
        }
    }

    /// Adds interventions: the JSON text `{"stamp": s, "context": {column: [value]}}` says what is imposed from now
    /// on. An empty list means that nothing is imposed. `now` replaces a missing stamp.
    ///
    /// # Errors
    /// A text that is not of this form; it changes nothing.
    pub fn context(&mut self, text: &str, now: Time) -> Result<(), String> {
        #[derive(serde::Deserialize)]
        struct Reported {
            stamp: Option<f64>,
            context: BTreeMap<String, Vec<f64>>,
        }
        let reported: Reported =
            serde_json::from_str(text).map_err(|e| format!("no context of interventions: {e}"))?;
        let legal = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
        let is_name = |name: &String| name.starts_with("do_") && name.chars().all(legal);
        if let Some(name) = reported.context.keys().find(|name| !is_name(name)) {
            return Err(format!("'{name}' is not a column of context; such as do_robot_speed"));
        }
        let stamp =
            reported.stamp.filter(|stamp| stamp.is_finite()).map_or(now, Time::from_secs_f64).as_nanos();
        for (name, value) in reported.context {
            ensure(self.context.contains_key(&name) || self.context.len() < MOST_CONTEXT, || {
                format!("more than {MOST_CONTEXT} columns of context")
            })?;
            let changes = self.context.entry(name).or_default();
            if changes.back().is_none_or(|(last, before)| *last <= stamp && *before != value) {
                changes.push_back((stamp, value));
            }
        }
        Ok(())
    }

    /// Adds the people. `now` replaces a stamp of 0. A person whose stamp has not changed was kept by the tracker,
    /// not seen again.
    pub fn humans(&mut self, humans: &Humans, now: Time) {
        let stamp = stamp_ns(humans.header.stamp, now);
        if let Some(frame) = &self.frame
            && *frame != humans.header.frame_id
        {
            self.counts.foreign_frame += 1;
            return;
        }
        if jumps(self.newest_people, stamp) || self.is_far(stamp) {
            self.counts.jumps += 1;
            self.restart(EndedBy::ClockJump);
        }
        self.newest_people = self.newest_people.max(Some(stamp));
        for person in &humans.humans {
            if self.seen.len() < MOST_PEOPLE && self.seen.insert(person.id) {
                tracing::info!("person {} is there", person.id);
            }
            let stamp = stamp_ns(person.header.stamp, now);
            if !self.config.select.admits(person.id) {
                continue;
            }
            if !self.people.contains_key(&person.id) && self.people.len() >= MOST_PEOPLE {
                self.counts.crowded += 1;
                continue;
            }
            if stamp < self.newest_people.unwrap_or(stamp) && !self.people.contains_key(&person.id) {
                continue;
            }
            if self.in_time(stamp) {
                let values = values(&person.pose2d, &person.twist, &person.goal);
                match self.insert(Sample { of: Subject::Person(person.id), stamp_ns: stamp, values }) {
                    Taken::Duplicate => {}
                    taken => self.count(taken),
                }
            }
        }
        self.advance(false);
    }

    /// Ends the open batch with the rows that there are, because the node ends.
    pub fn finish(&mut self) {
        self.advance(true);
        self.close(EndedBy::NodeEnd);
    }

    /// The finished batches, oldest first.
    pub fn take_batches(&mut self) -> Vec<Recording> {
        self.take_numbered_batches().into_iter().map(|(batch, _)| batch).collect()
    }

    /// The finished batches, each with the number of its journal.
    pub fn take_numbered_batches(&mut self) -> Vec<(Recording, Option<u64>)> {
        std::mem::take(&mut self.done)
    }

    /// The rows recorded since the last call, oldest first.
    pub fn take_rows(&mut self) -> Vec<FreshRow> {
        self.fresh.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// What is to be journalled since the last call.
    pub fn take_journal(&mut self) -> Vec<Entry> {
        self.log.as_mut().map_or_else(Vec::new, Log::take)
    }

    /// The length of batches from the next one on, in seconds; `None`: until the end. A batch that was to go on until the end gets it
    /// at once, as no other would follow.
    pub fn set_length(&mut self, length_s: Option<f64>) {
        self.next_length = Some(length_s);
        if self.open.is_none() || self.config.ts_length_s.is_none() {
            self.take_length();
        }
    }

    fn take_length(&mut self) {
        if let Some(length_s) = self.next_length.take() {
            self.config.ts_length_s = length_s;
            self.rows_per_batch = self.config.rows_per_batch();
        }
    }

    /// Rows of the open batch, and how many it will have (`None`: until the end).
    pub fn progress(&self) -> (usize, Option<usize>) {
        let total = self.config.ts_length_s.map(|_| self.rows_per_batch);
        (self.open.as_ref().map_or(0, Recording::n_rows), total)
    }

    /// The counters so far.
    pub fn counts(&self) -> &RecorderCounts {
        &self.counts
    }

    /// Sightings of a person for each row, and how far the moments of rows are from even or what they hold reaches ahead of them, to later
    /// sightings, as a share of the step; `None` before the first row of a person.
    pub fn spacing(&self) -> Option<[f64; 2]> {
        let (cells, [interval, ahead]) = self.spacing;
        let step = cells * self.dt_ns as f64;
        (cells > 0.0).then(|| [step / interval, ahead / step])
    }

    /// In how many of 100 rows in which a person and the robot move it follows them; 0 after few.
    pub fn follows(&self) -> u64 {
        let [moving, following] = self.following;
        if moving < FEWEST_MOVING { 0 } else { 100 * following / moving }
    }

    /// Why nothing is recorded, if nothing is.
    pub fn trouble(&self) -> Option<String> {
        if self.open.is_some() || self.newest_robot.is_none() || self.newest_people.is_none() {
            return None;
        }
        let ids: Vec<String> = self.seen.iter().take(10).map(u32::to_string).collect();
        match &self.config.select {
            _ if ids.is_empty() => {
                Some("nobody has been seen yet; recording begins with the first person".to_owned())
            }
            Select::Ids(wanted) if wanted.is_disjoint(&self.seen) => Some(format!(
                "nobody of sel_agent has been seen; people seen: {}; set sel_agent to one of them, to all or to nearest:1",
                ids.join(", ")
            )),
            _ if self.counts.foreign_frame > 0 => Some(
                "people are in another frame than the robot; set target_frame alike in both nodes".to_owned(),
            ),
            _ => None,
        }
    }

    fn in_time(&mut self, stamp: i64) -> bool {
        let in_time = self.next_row.is_none_or(|next| stamp >= next - self.max_gap_ns);
        self.counts.late += u64::from(!in_time);
        in_time
    }

    fn count(&mut self, taken: Taken) {
        match taken {
            Taken::Yes => {}
            Taken::Duplicate => self.counts.duplicates += 1,
            Taken::Crowded => self.counts.crowded += 1,
        }
    }

    /// Writes the rows that can no longer change; with `all`, all rows up to the newest stamp.
    fn advance(&mut self, all: bool) {
        let (Some(newest), Some(mut row)) = (self.newest(), self.next_row) else {
            // People without a robot: only the recent past may matter once the robot appears.
            if let Some(newest) = self.newest_people {
                self.forget_before(newest - self.max_gap_ns - nanos(LATENESS_S));
            }
            return;
        };
        let end = if all { newest } else { newest - self.max_gap_ns.max(AHEAD_NS) - nanos(LATENESS_S) };
        while row <= end {
            self.record(row);
            row = row.saturating_add(self.dt_ns);
        }
        self.next_row = Some(row);
        self.forget_before(row);
        if self.open.is_none() && (!self.may_begin() || self.log.as_ref().is_some_and(Log::is_idle_and_large))
        {
            self.log.iter_mut().for_each(Log::abandon);
        }
    }

    /// Adds a sample to its track, and to the journal once there may be something to record.
    fn insert(&mut self, sample: Sample) -> Taken {
        let taken = match sample.of {
            Subject::Robot => self.robot.insert(sample.stamp_ns, sample.values),
            Subject::Person(id) => {
                let track = self.people.entry(id).or_insert_with(Track::of_person);
                track.insert(sample.stamp_ns, sample.values)
            }
            Subject::Signal(number) => {
                let track = self.signals.get_mut(number as usize);
                let crowded = track.is_some_and(|track| track.insert(sample.stamp_ns, sample.values.x));
                if crowded { Taken::Crowded } else { Taken::Yes }
            }
        };
        // Late for a row that is made, it may still serve the next one.
        let is_late = self.next_row.is_some_and(|next| sample.stamp_ns < next - self.dt_ns);
        let is_of_signal = matches!(sample.of, Subject::Signal(_));
        self.counts.late += u64::from(taken == Taken::Yes && is_late && !is_of_signal);
        if let Some(log) = &mut self.log {
            if log.number().is_some() {
                if taken != Taken::Duplicate {
                    log.sample(sample);
                }
            } else if self.may_begin()
                && let Some(next_row) = self.next_row
            {
                self.begin_journal(next_row);
            }
        }
        taken
    }

    /// Whether there is anything that a batch can begin with.
    fn may_begin(&self) -> bool {
        match self.config.select {
            Select::Nobody => {
                !self.robot.is_empty() || self.signals.iter().any(|track| track.values().next().is_some())
            }
            _ => !self.robot.is_empty() && !self.people.is_empty(),
        }
    }

    /// Begins a journal of the samples that rows from `next_row` on depend on.
    fn begin_journal(&mut self, next_row: i64) {
        let header = Header {
            number: 0,
            dt_s: self.config.dt_s,
            ts_length_s: self.config.ts_length_s,
            max_gap_s: self.config.max_gap_s,
            sampling: self.config.sampling,
            sel_agent: self.config.select.to_string(),
            frame: self.frame.clone().unwrap_or_default(),
            next_row_ns: next_row,
            signals: self.signals.iter().map(|track| (track.name.clone(), track.how)).collect(),
        };
        let Some(log) = &mut self.log else { return };
        log.begin(header);
        let people = self.people.iter().map(|(id, track)| (Subject::Person(*id), track));
        let mut samples: Vec<Sample> = Vec::new();
        for (of, track) in std::iter::once((Subject::Robot, &self.robot)).chain(people) {
            samples.extend(track.remembered().map(|(stamp_ns, values)| Sample { of, stamp_ns, values }));
        }
        for (number, track) in (0..).zip(&self.signals) {
            let of = Subject::Signal(number);
            let sample = |&(stamp_ns, x)| Sample { of, stamp_ns, values: Values { x, ..Values::UNKNOWN } };
            samples.extend(track.values().map(sample));
        }
        // In order of time: else rows are made before all samples are there.
        samples.sort_by_key(|sample| sample.stamp_ns);
        samples.into_iter().for_each(|sample| log.sample(sample));
        log.begun();
    }

    fn forget_before(&mut self, row: i64) {
        // A row may be made at a moment a little before its time.
        let (row, max_gap) = (row.saturating_sub(self.dt_ns / 2), self.max_gap_ns);
        self.robot.forget_before(row, max_gap);
        self.people.retain(|_, track| track.forget_before(row, max_gap));
        self.others.retain(|_, track| track.forget_before(row, max_gap));
        let dt = self.dt_ns;
        self.signals.iter_mut().for_each(|track| track.forget_before(row, dt));
        for changes in self.context.values_mut() {
            while changes.get(1).is_some_and(|(stamp, _)| *stamp <= row) {
                changes.pop_front();
            }
        }
    }

    /// Ends the open batch with the rows that there are and drops the rest. Recording continues with what arrives
    /// later.
    pub fn restart(&mut self, reason: EndedBy) {
        tracing::warn!("{reason}: the batch ends here, the next one starts anew");
        self.advance(true);
        self.close(reason);
        self.robot = Track::default();
        self.people.clear();
        self.others.clear();
        self.context.clear();
        self.signals.iter_mut().for_each(SignalTrack::clear);
        (self.frame, self.newest_robot, self.newest_people) = (None, None, None);
        (self.newest_signal, self.next_row) = (None, None);
    }
}

pub(super) fn values(pose: &Pose2D, twist: &Twist, goal: &Point) -> Values {
    let finite = |v: f64| if v.is_finite() { v } else { f64::NAN };
    Values {
        gx: finite(goal.x),
        gy: finite(goal.y),
        x: finite(pose.x),
        y: finite(pose.y),
        theta: finite(pose.theta),
        v: finite(speed(twist)),
        omega: finite(twist.angular.z),
    }
}

fn stamp_ns(stamp: Time, now: Time) -> i64 {
    if stamp == Time::ZERO { now.as_nanos() } else { stamp.as_nanos() }
}

fn jumps(newest: Option<i64>, stamp: i64) -> bool {
    newest.is_some_and(|newest| stamp < newest - JUMP_BACK_NS || stamp > newest + JUMP_AHEAD_NS)
}

fn nanos(secs: f64) -> i64 {
    (secs * 1e9).round() as i64
}

#[cfg(test)]
#[path = "recorder_tests.rs"]
mod tests;
