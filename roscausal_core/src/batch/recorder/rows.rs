//! One row of a batch, and the batch's end.

use std::collections::{BTreeMap, BTreeSet};

use roscausal_msgs::Time;

use super::{MOST_PEOPLE, Recorder};
use crate::batch::{
    fresh::fresh_row,
    journal::Log,
    recording::{EndedBy, Recording},
    select::Select,
    tracks::{Sampling, Track, Values},
};

/// From [`FEW_ROWS`] on a person's rows have room for so many at once, an hour at 0.1 s: where all people's grow together, each leaves a
/// hole in memory.
const ROWS_AHEAD: usize = 40_000;

/// So many rows a batch has before it is believed to become a long one.
const FEW_ROWS: usize = 1000;

impl Recorder {
    /// Writes the row at this stamp, in nanoseconds, to the open batch, or opens one if there is anything to begin with.
    pub(super) fn record(&mut self, row: i64) {
        let tracks = self.people.values_mut().chain(self.others.values_mut()).chain([&mut self.robot]);
        tracks.for_each(|track| track.settle(row, self.max_gap_ns));
        let moments = self.moments(row);
        let moment = mean(moments.values().flatten()).unwrap_or(row);
        let max_gap = self.max_gap_ns;
        let sampling = match self.config.sampling {
            // What is held of one is older than what lies on a line of another.
            Sampling::Auto if self.people.values().any(|track| track.is_seldom(self.dt_ns)) => {
                Sampling::Linear
            }
            sampling => sampling,
        };
        let at = |track: &Track, moment| track.row(moment, self.dt_ns, max_gap, sampling);
        let of = |track: &Track| at(track, moment);
        let robot = of(&self.robot);
        let person = |(id, track): (&u32, &Track)| {
            let moment = moments.get(id).copied().unwrap_or(Some(moment))?;
            Some((*id, at(track, moment)?))
        };
        let people: Vec<(u32, Values)> = self.people.iter().filter_map(person).collect();
        let other = |(name, track): (&String, &Track)| (name.clone(), of(track).unwrap_or(Values::UNKNOWN));
        let others: Vec<(String, Values)> = self.others.iter().map(other).collect();
        let signals: Vec<f64> =
            self.signals.iter().map(|track| track.at(moment, self.dt_ns, max_gap)).collect();
        let begins = match self.config.select {
            Select::Nobody => robot.is_some() || signals.iter().any(|value| !value.is_nan()),
            _ => robot.is_some() && !people.is_empty(),
        };
        if self.open.is_none() && !begins {
            self.counts.waited += 1;
            return;
        }
        if self.log.as_ref().is_some_and(|log| log.number().is_none()) {
            self.begin_journal(row);
        }
        let open = self.open.get_or_insert_with(|| Recording {
            start: Time::from_nanos(row),
            dt_ns: self.dt_ns,
            frame: self.frame.clone().unwrap_or_default(),
            signals: self.signals.iter().map(|track| (track.name.clone(), Vec::new())).collect(),
            ..Recording::default()
        });
        let late = moment - row;
        let before = if people.is_empty() { None } else { self.last_late.replace(late) };
        let uneven = before.map_or(0, |before| late.abs_diff(before)) as f64;
        for track in people.iter().filter_map(|(id, _)| self.people.get(id)) {
            let Some([interval, ahead]) = track.spacing(moment) else { continue };
            let (cells, [intervals, all_ahead]) = &mut self.spacing;
            *cells += 1.0;
            *intervals += interval;
            *all_ahead += if track.holds(self.dt_ns, sampling) { 0.0 } else { ahead + uneven };
        }
        let follows = people.iter().filter_map(|(_, person)| robot.as_ref()?.follows(person));
        for is_following in follows {
            self.following[0] += 1;
            self.following[1] += u64::from(is_following);
        }
        let n_rows = open.robot.len();
        open.robot.push(robot.unwrap_or(Values::UNKNOWN));
        for (id, values) in &people {
            if open.people.contains_key(id) || open.people.len() < MOST_PEOPLE {
                let rows = open.people.entry(*id).or_default();
                if n_rows >= FEW_ROWS {
                    rows.reserve_exact(self.rows_per_batch.min(ROWS_AHEAD).saturating_sub(rows.len()));
                }
                rows.resize(n_rows, Values::UNKNOWN);
                rows.push(*values);
            } else {
                self.counts.crowded += 1;
            }
        }
        for (name, values) in others {
            let rows = open.others.entry(name).or_default();
            rows.resize(n_rows, Values::UNKNOWN);
            rows.push(values);
        }
        for ((_, rows), value) in open.signals.iter_mut().zip(signals) {
            rows.push(value);
        }
        for (name, changes) in &self.context {
            let imposed = changes.iter().rev().find(|(stamp, _)| *stamp <= row);
            let rows = open.context.entry(name.clone()).or_default();
            rows.resize(n_rows, Vec::new());
            rows.push(imposed.map_or(Vec::new(), |(_, value)| value.clone()));
        }
        let nearest = nearest(&self.config.select, robot, &people);
        for id in nearest.iter().flat_map(|(_, ids)| ids) {
            *self.votes.entry(*id).or_default() += 1;
        }
        if let Some(fresh) = &mut self.fresh {
            fresh.push(fresh_row(open, nearest.as_ref()));
        }
        self.counts.rows += 1;
        if n_rows + 1 >= self.rows_per_batch {
            self.close(self.config.ts_length_s.map_or(EndedBy::MostRows, |_| EndedBy::TsLength));
        }
    }

    /// When those are seen nearest to the row at this stamp whose sightings make rows, if they are. All else in the row is of that moment too
    /// (people are seen together, mostly), so that nobody's values are ahead of another's.
    fn moments(&self, row: i64) -> BTreeMap<u32, Option<i64>> {
        let makes_rows = |track: &Track| track.makes_rows(self.dt_ns, self.config.sampling);
        let people = self.people.iter().filter(|(_, track)| makes_rows(track));
        people.map(|(id, track)| (*id, track.nearest(row, self.dt_ns))).collect()
    }

    /// Ends the open batch: the nearest people are chosen, and empty rows at its end are left out.
    pub(super) fn close(&mut self, ended_by: EndedBy) {
        let votes = std::mem::take(&mut self.votes);
        let Some(mut batch) = self.open.take() else {
            self.log.iter_mut().for_each(Log::abandon);
            return;
        };
        if let Select::Nearest(number) = self.config.select {
            let mut by_votes: Vec<(u64, u32)> = votes.iter().map(|(id, votes)| (*votes, *id)).collect();
            by_votes.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
            let kept: BTreeSet<u32> = by_votes.iter().take(number).map(|(_, id)| *id).collect();
            batch.people.retain(|id, _| kept.contains(id));
        }
        let n_rows = batch.robot.len();
        let full = n_rows >= self.rows_per_batch;
        if !full {
            let known = |rows: &Vec<Values>| {
                rows.iter().rposition(|values| values.to_array().iter().any(|v| v.is_finite()))
            };
            let last = batch.people.values().map(known).max().flatten().max(known(&batch.robot));
            let heard = |rows: &Vec<f64>| rows.iter().rposition(|value| !value.is_nan());
            let last = match self.config.select {
                Select::Nobody => last.max(batch.signals.iter().filter_map(|(_, rows)| heard(rows)).max()),
                _ => last,
            };
            batch.robot.truncate(last.map_or(0, |last| last + 1));
        }
        let n_rows = batch.robot.len();
        batch.people.values_mut().for_each(|rows| rows.resize(n_rows, Values::UNKNOWN));
        batch.others.values_mut().for_each(|rows| rows.resize(n_rows, Values::UNKNOWN));
        batch.context.values_mut().for_each(|rows| rows.resize(n_rows, Vec::new()));
        batch.signals.iter_mut().for_each(|(_, rows)| rows.truncate(n_rows));
        let to_the_end = self.config.ts_length_s.is_none() && ended_by == EndedBy::NodeEnd;
        batch.complete = full || to_the_end;
        batch.ended_by = Some(ended_by);
        batch.length_s = Some(self.config.ts_length_s.unwrap_or(0.0));
        if n_rows > 0 {
            let number = self.log.as_mut().and_then(Log::end);
            self.done.push((batch, number));
        } else {
            self.log.iter_mut().for_each(Log::abandon);
        }
        self.take_length();
    }
}

/// The mean of stamps, if there is any.
fn mean<'a>(stamps: impl Iterator<Item = &'a i64>) -> Option<i64> {
    let (sum, count) = stamps.fold((0, 0), |(sum, count), stamp| (sum + i128::from(*stamp), count + 1));
    (count > 0).then(|| (sum / count) as i64)
}

/// Where the nearest people are to be recorded: how many, and who they are in this row.
fn nearest(
    select: &Select,
    robot: Option<Values>,
    people: &[(u32, Values)],
) -> Option<(usize, BTreeSet<u32>)> {
    let (Select::Nearest(number), Some(robot)) = (select, robot) else { return None };
    let distance = |values: &Values| libm::hypot(values.x - robot.x, values.y - robot.y);
    let mut near: Vec<(f64, u32)> = people.iter().map(|(id, values)| (distance(values), *id)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    Some((*number, near.into_iter().take(*number).map(|(_, id)| id).collect()))
}
