//! The clocks of a recording: how far the stamps of each topic are from the time at which its messages came. Messages with mistaken
//! stamps are found here, and clocks that are not the same.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet, BinaryHeap},
    path::Path,
    sync::Arc,
};

use roscausal_core::{Error, Result, Time, signal::Definitions};
use roscausal_msgs::{geometry_msgs::TransformStamped, rosgraph_msgs::Clock, tf2_msgs::TFMessage};
use roscausal_recording::{Recording, Stepped, Steps, Tick, Topic};

use super::{
    order::{Intervals, Lead, TopicLead},
    stamps::{ONE_CLOCK_S, Stamps, number},
};

/// A stamp may be this far from where those around it put it. Seconds.
const CLOSE_S: f64 = 1.0;
/// Stamps this far ahead of the time of recording are of another clock, if others have that time: no delay makes that. Transforms
/// are often dated ahead. Seconds.
const AHEAD_S: f64 = 0.25;
const TF_AHEAD_S: f64 = 2.0;
/// Stamps that are farther behind the time of recording are late or of another clock. Where all are behind by the same, give or take
/// `AHEAD_S`, nothing tells which. Seconds.
const BEHIND_S: f64 = 1.0;
/// Parts of a recording whose offsets are compared.
const PARTS: usize = 10;
/// So many stamps must follow each other after a jump of the clock; fewer are mistakes. `/clock` may come seldom.
const CONFIRMED: usize = 50;
const CLOCK_CONFIRMED: usize = 5;
/// If more than this share of a topic's stamps are mistaken, none of them is right or wrong.
const MOST_MISTAKEN: f64 = 0.1;
/// Fewer messages say nothing of a clock: one that was kept for the recorder is older than the recording.
const ENOUGH: u64 = 20;
/// Offsets that are kept of a topic, and frames that are fixed; messages of a topic that may be stamped ahead.
const MOST_KEPT: usize = 4096;
const MOST_AHEAD: u64 = 100_000;

/// Stamp minus time of recording, of one topic.
#[derive(Default)]
pub(crate) struct Offsets {
    /// Some of the offsets, evenly chosen. Seconds.
    kept: Vec<f64>,
    least_s: f64,
    every: u64,
    count: u64,
    last: Option<Tick>,
    /// From the last but one stamp to the last one, seconds.
    step_s: f64,
    same: u64,
    steps: Option<Steps>,
    /// The half of the messages that are most ahead: by how many nanoseconds, the number, and whether the step to the next stamp is much
    /// shorter than the one before.
    ahead: BinaryHeap<Reverse<(i64, u64, bool)>>,
}

/// What the offsets of a topic come to.
#[derive(Clone, Debug, Default)]
pub(crate) struct Offset {
    /// Seconds.
    pub(crate) median_s: f64,
    /// Between the 5th and the 95th of 100, seconds.
    pub(crate) spread_s: f64,
    /// Between the medians of ten parts of the recording, seconds.
    wander_s: f64,
    /// The least one, seconds; 0 at the most.
    least_s: f64,
    /// Messages with a stamp.
    pub(crate) count: u64,
    /// Those of them that have the stamp of the one before, or hardly a later one.
    same: u64,
    /// Mistaken stamps and jumps.
    pub(crate) stepped: Stepped,
    /// Three in four offsets are less, seconds.
    high_s: f64,
    /// Those most ahead, in their order.
    ahead: Vec<(i64, u64, bool)>,
}

impl Offset {
    /// Median, spread and number of jumps as texts.
    pub(crate) fn texts(&self) -> [String; 3] {
        let short = |value: f64| match (1e3 * value).round() / 1e3 {
            // Not -0.000.
            0.0 => "0.000".to_owned(),
            value if value.abs() >= 1e5 => format!("{value:.3e}"),
            value => format!("{value:.3}"),
        };
        let jumps = self.stepped.mistakes.len() as u64 + self.jumps();
        [short(self.median_s), short(self.spread_s), jumps.to_string()]
    }

    /// How often the clock jumped for good.
    fn jumps(&self) -> u64 {
        self.stepped.back.len() as u64 + self.stepped.ahead
    }

    /// Whether all its stamps go on with the time of recording.
    fn is_steady(&self) -> bool {
        self.jumps() == 0 && self.stepped.mistakes.is_empty() && self.wander_s < CLOSE_S / 4.0
    }
}

impl Offsets {
    /// Adds the stamp of the message with this number, which came at `came`.
    pub(crate) fn add(&mut self, number: u64, stamp: Time, came: Time) {
        self.every = self.every.max(1);
        let offset_s = stamp.secs_since(came);
        self.least_s = self.least_s.min(offset_s);
        if self.count.is_multiple_of(self.every) {
            self.kept.push(offset_s);
        }
        if self.kept.len() > MOST_KEPT {
            self.kept = self.kept.iter().copied().step_by(2).collect();
            self.every *= 2;
        }
        self.count += 1;
        let next = Tick { number, stamp, came };
        if let Some(last) = self.last.replace(next) {
            let step_s = stamp.secs_since(last.stamp);
            let before_s = std::mem::replace(&mut self.step_s, step_s);
            let is_tiny = (0.0..1e-3).contains(&step_s) && 20.0 * step_s < came.secs_since(last.came);
            self.same += u64::from(step_s == 0.0 || is_tiny);
            let ahead = last.stamp.as_nanos() - last.came.as_nanos();
            self.ahead.push(Reverse((ahead, last.number, step_s < before_s / 4.0)));
            if self.ahead.len() as u64 > (self.count / 2 + ENOUGH).min(MOST_AHEAD) {
                self.ahead.pop();
            }
        }
        self.steps.get_or_insert_with(|| Steps::new(CONFIRMED, follows)).add(next);
    }

    /// The result; `None` without any stamp.
    pub(crate) fn finish(mut self) -> Option<Offset> {
        let median = |part: &mut [f64]| *part.select_nth_unstable_by(part.len() / 2, f64::total_cmp).1;
        let length = self.kept.len().div_ceil(PARTS).max(2);
        let parts = self.kept.chunks_mut(length);
        let (low, high) =
            parts.map(median).fold((f64::MAX, f64::MIN), |(low, high), at| (low.min(at), high.max(at)));
        self.kept.sort_by(f64::total_cmp);
        let at =
            |share: f64| self.kept.get((share * (self.kept.len() as f64 - 1.0)).round() as usize).copied();
        let (median_s, spread_s, high_s) = (at(0.5)?, at(0.95)? - at(0.05)?, at(0.75)?);
        let Self { least_s, count, same, .. } = self;
        let stepped = self.steps?.finish();
        let mut ahead: Vec<_> = self.ahead.into_iter().map(|Reverse(message)| message).collect();
        ahead.sort_unstable_by_key(|message| message.1);
        let wander_s = high - low;
        Some(Offset { median_s, spread_s, wander_s, least_s, count, same, stepped, high_s, ahead })
    }
}

/// Whether the second of two messages may be by the clock of the first.
fn follows(a: Tick, b: Tick) -> bool {
    let (step, passed) = (b.stamp.secs_since(a.stamp), b.came.secs_since(a.came));
    (step - passed).abs() <= CLOSE_S || (step >= 0.0 && step <= passed + CLOSE_S)
}

/// Whose stamps are replaced by the time of recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ClockChoice {
    all: bool,
    by_topic: BTreeMap<String, bool>,
}

impl ClockChoice {
    /// `recording` or `header`, for all topics or as `TOPIC=recording`.
    ///
    /// # Errors
    /// Anything else.
    pub(super) fn parse(texts: &[String]) -> Result<Self> {
        let mut choice = Self::default();
        for text in texts {
            let (topic, clock) = text.split_once('=').map_or((None, text.as_str()), |(t, c)| (Some(t), c));
            let by_recording = match clock.trim() {
                "recording" => true,
                "header" => false,
                _ => {
                    let reason = format!("'{text}' is neither 'recording' nor 'header', nor TOPIC=recording");
                    return Err(Error::param("clock", reason));
                }
            };
            match topic {
                Some(topic) => drop(choice.by_topic.insert(topic.trim().to_owned(), by_recording)),
                None => choice.all = by_recording,
            }
        }
        Ok(choice)
    }

    /// Whether this topic's stamps are replaced.
    pub(super) fn by_recording(&self, topic: &Topic) -> bool {
        let own = self.by_topic.iter().find(|(name, _)| topic.is_named(name));
        own.map_or(self.all, |(_, by_recording)| *by_recording)
    }

    /// A topic that is named, but not in the recording.
    pub(super) fn unknown(&self, topics: &[Topic]) -> Option<&str> {
        let is_there = |name: &&String| topics.iter().any(|topic| topic.is_named(name));
        self.by_topic.keys().find(|name| !is_there(name)).map(String::as_str)
    }
}

/// What playing has to know of the clocks of a recording.
#[derive(Debug, Default)]
pub(crate) struct Clocks {
    /// By topic: the numbers of its messages that are left out.
    mistakes: Vec<BTreeSet<u64>>,
    /// One sentence each.
    pub(crate) notes: Vec<String>,
    /// How far topics are played ahead where there are no waits.
    pub(super) lead: Lead,
    /// When the recording begins: by its own clock if it has one, otherwise where its first times are mistakes.
    pub(super) start: Option<Time>,
    /// Transforms that never change, by topic and frame; of several for a frame the first.
    pub(super) fixed: BTreeMap<String, BTreeMap<String, TransformStamped>>,
}

/// Whether this topic carries transforms, which bear the stamps of what they were computed from.
pub(crate) fn is_tf(topic: &Topic) -> bool {
    topic.type_name == "tf2_msgs/TFMessage"
}

/// Whether this topic carries the time of a simulation.
pub(super) fn is_clock(topic: &Topic) -> bool {
    topic.name == "/clock" && topic.type_name == "rosgraph_msgs/Clock" && topic.known_type().is_some()
}

impl Clocks {
    /// Reads the stamps of the topics that `wanted` accepts.
    ///
    /// # Errors
    /// A recording that cannot be opened, or topics whose clocks differ.
    pub(super) fn measure(
        path: &Path,
        wanted: impl Fn(&Topic) -> bool,
        choice: &ClockChoice,
    ) -> Result<Self> {
        let mut recording = Recording::open(path)?;
        let topics = recording.topics().to_vec();
        let definitions = Arc::new(Definitions::of(""));
        let is_measured = |topic: &Topic| wanted(topic) && !is_tf(topic) && !is_clock(topic);
        let has_clock = topics.iter().any(is_clock);
        let stamps_of = |topic: &Topic| Stamps::of(topic, &definitions).filter(|_| is_measured(topic));
        let stamps: Vec<Option<Stamps>> = topics.iter().map(stamps_of).collect();
        let is_fixed = |topic: &Topic| wanted(topic) && is_tf(topic) && topic.name.ends_with("_static");
        let moves = |topic: &Topic| wanted(topic) && is_tf(topic) && !topic.latched && !is_fixed(topic);
        recording.select(|topic| is_measured(topic) || is_clock(topic) || moves(topic) || is_fixed(topic));
        let mut fixed: BTreeMap<String, BTreeMap<String, TransformStamped>> = BTreeMap::new();
        let mut intervals: BTreeMap<usize, Intervals> = BTreeMap::new();
        let mut offsets: Vec<Offsets> = topics.iter().map(|_| Offsets::default()).collect();
        let mut numbers = vec![0; topics.len()];
        let (mut now, mut last): (Option<Time>, Option<Tick>) = (None, None);
        let mut first: Vec<(usize, u64, Time)> = Vec::new();
        let mut clock = Steps::new(CLOCK_CONFIRMED, follows);
        for record in recording.by_ref() {
            let topic = &topics[record.topic];
            if is_clock(topic) {
                let number = number(&mut numbers, &record);
                let Ok(Clock { clock: stamp }) = topic.decode::<Clock>(&record.bytes) else { continue };
                let next = Tick { number, stamp, came: record.stamp };
                // What differs from the one before may be a mistake.
                now = last.replace(next).is_none_or(|before| follows(before, next)).then_some(stamp);
                clock.add(next);
                first.extend((number < ENOUGH).then_some((record.topic, number, stamp)));
                continue;
            }
            if is_fixed(topic) {
                let transforms = topic.decode::<TFMessage>(&record.bytes).unwrap_or_default().transforms;
                let known = fixed.entry(topic.playable()).or_default();
                for transform in transforms {
                    if known.len() < MOST_KEPT {
                        known.entry(transform.child_frame_id.clone()).or_insert(transform);
                    }
                }
                continue;
            }
            let number = number(&mut numbers, &record);
            let is_early = !has_clock && number < ENOUGH;
            first.extend(is_early.then_some((record.topic, number, record.stamp)));
            let stamp = if moves(topic) {
                let message = topic.decode::<TFMessage>(&record.bytes).unwrap_or_default();
                intervals.entry(record.topic).or_default().add(&message);
                message.transforms.first().map(|one| one.header.stamp).filter(|stamp| *stamp != Time::ZERO)
            } else {
                stamps[record.topic].as_ref().and_then(|stamps| stamps.first(&record.bytes))
            };
            // Before the first message of a clock its time is not known.
            let came = if has_clock { now } else { Some(record.stamp) };
            if let (Some(stamp), Some(came)) = (stamp, came) {
                let stamp = if choice.by_recording(topic) { came } else { stamp };
                offsets[record.topic].add(number, stamp, came);
            }
        }
        let mut measured: Vec<Option<Offset>> = offsets.into_iter().map(Offsets::finish).collect();
        let base_s = add_early(&topics, &mut measured);
        let mut clocks = Self { fixed, notes: check(path, &topics, &measured)?, ..Self::default() };
        // Stamps may be ahead of a clock that comes seldom; what is not behind it is not late.
        let base_s = if has_clock { base_s.min(0.0) } else { base_s };
        let lead = |(topic, (offset, stamps)): (usize, (&Option<Offset>, Option<Stamps>))| {
            // Those that are replaced are as the time of recording, whatever the others are.
            let own = !choice.by_recording(&topics[topic]);
            let offset = offset.as_ref().filter(|_| own);
            let offsets_s = offset.map_or([base_s; 2], |of| [of.median_s, of.least_s.min(of.median_s)]);
            let ahead_s = intervals.get(&topic).map_or(0.0, Intervals::lead);
            TopicLead { offsets_s, ahead_s, stamps: stamps.filter(|_| own) }
        };
        let of_topics = measured.iter().zip(stamps).enumerate().map(lead).collect();
        clocks.lead = Lead { clock: topics.iter().position(is_clock), base_s, topics: of_topics };
        let clock = clock.finish();
        for ((topic, offset), sent) in topics.iter().zip(measured).zip(numbers) {
            // Transforms of several publishers come with delays of their own.
            let mut offset = offset.filter(|_| !is_tf(topic)).unwrap_or_default();
            if is_clock(topic) && clock.mistakes.len() as f64 <= MOST_MISTAKEN * sent as f64 {
                offset = Offset { count: sent, stepped: clock.clone(), ..Offset::default() };
            }
            let Offset { count, stepped: Stepped { mistakes, .. }, .. } = offset;
            let (file, name, wrong) = (path.display(), &topic.name, mistakes.len());
            if wrong as f64 / count.max(1) as f64 > MOST_MISTAKEN {
                let reason = format!(
                    "{wrong} of {count} messages of {name} are stamped far from those around them or from the time of recording, too many to leave them out; --clock \
                     {name}=recording uses the time at which they were recorded instead"
                );
                return Err(Error::file(path, reason));
            }
            if wrong > 0 {
                clocks.notes.push(format!(
                    "{file}: {wrong} of {count} messages of {name} are stamped more than {CLOSE_S} s from those around them, or {AHEAD_S} s ahead \
                     of the time of recording, and are left out"
                ));
            }
            clocks.mistakes.push(mistakes.into_iter().collect());
        }
        let right = first.iter().position(|(topic, number, _)| !clocks.leaves_out(*topic, *number));
        clocks.start = right.filter(|place| has_clock || *place > 0).map(|place| first[place].2);
        Ok(clocks)
    }

    /// Whether the message with this number of its topic is left out.
    pub(super) fn leaves_out(&self, topic: usize, number: u64) -> bool {
        self.mistakes.get(topic).is_some_and(|mistakes| mistakes.contains(&number))
    }
}

/// Adds to the mistakes of each topic the few in a row that are stamped ahead of the time of recording: no delay makes that. Returns the
/// offset of the topic that came earliest, seconds: all may be off by the same.
pub(crate) fn add_early(topics: &[Topic], measured: &mut [Option<Offset>]) -> f64 {
    // Transforms of several publishers come with delays of their own.
    let known = topics.iter().zip(measured).filter(|(topic, _)| !is_tf(topic));
    let known: Vec<&mut Offset> = known.filter_map(|(_, offset)| offset.as_mut()).collect();
    let enough = known.iter().filter(|of| of.count >= ENOUGH);
    let base_s = enough.map(|of| of.high_s).reduce(f64::max).unwrap_or(0.0);
    for Offset { high_s, ahead, stepped: Stepped { mistakes, .. }, .. } in known {
        let limit_s = base_s.max(*high_s) + AHEAD_S;
        ahead.retain(|(ahead, ..)| *ahead as f64 * 1e-9 > limit_s);
        // Where stamps go on evenly, it is the other clock that was set or comes seldom; after it was set back, others are in between.
        let runs = ahead.chunk_by(|a, b| a.1 + 2 >= b.1);
        let few = runs.filter(|run| run.len() < CONFIRMED && run.last().is_some_and(|last| last.2));
        mistakes.extend(few.flatten().map(|message| message.1));
        mistakes.sort_unstable();
        mistakes.dedup();
    }
    base_s
}

/// Checks that stamps are of one clock that goes on with the time of recording. Returns what may be wrong with them.
fn check(path: &Path, topics: &[Topic], measured: &[Option<Offset>]) -> Result<Vec<String>> {
    let known = topics.iter().zip(measured).filter_map(|(topic, offset)| Some((topic, offset.as_ref()?)));
    let known: Vec<(&Topic, &Offset)> = known.filter(|(_, offset)| offset.count >= ENOUGH).collect();
    let by = |a: &&(&Topic, &Offset), b: &&(&Topic, &Offset)| a.1.median_s.total_cmp(&b.1.median_s);
    let (Some(least), Some(most)) = (known.iter().min_by(by), known.iter().max_by(by)) else {
        return Ok(Vec::new());
    };
    let apart = most.1.median_s - least.1.median_s;
    if apart > ONE_CLOCK_S {
        // The one that is farther from the time of recording.
        let odd = if most.1.median_s.abs() > least.1.median_s.abs() { most.0 } else { least.0 };
        let (a, b, odd) = (&least.0.name, &most.0.name, &odd.name);
        let [apart, of_a, of_b] = [apart, least.1.median_s, most.1.median_s].map(seconds);
        let reason = format!(
            "the clocks of {a} and {b} differ by {apart}: their stamps are {of_a} and {of_b} from the time of recording; --clock recording \
             uses that time instead of all stamps, --clock {odd}=recording of those of one topic"
        );
        return Err(Error::file(path, reason));
    }
    let (mut notes, file) = (Vec::new(), path.display());
    for (topic, offset) in &known {
        let other = |has: &dyn Fn(&Offset) -> bool| {
            known.iter().find(|(of, offset)| of != topic && !is_tf(of) && has(offset)).map(|(of, _)| &of.name)
        };
        let (name, steady) = (&topic.name, other(&|of| of.is_steady()).filter(|_| !is_tf(topic)));
        let instead = format!("--clock {name}=recording uses that time instead of its stamps");
        if let (1.., Some(steady)) = (offset.jumps(), steady) {
            let reason = format!(
                "the clock of {name} jumps against the time of recording, that of {steady} does not; {instead}"
            );
            return Err(Error::file(path, reason));
        }
        if let (true, Some(steady)) = (offset.wander_s > CLOSE_S, steady) {
            notes.push(format!(
                "{file}: the stamps of {name} move by {} against the time of recording, those of {steady} do not: they came late, or \
                 their clock was set or is fast or slow; {instead}",
                seconds(offset.wander_s)
            ));
        }
        let most_ahead = if is_tf(topic) { TF_AHEAD_S } else { AHEAD_S };
        let off = match offset.median_s {
            off if off > most_ahead => {
                Some(("ahead of", "so it has another clock, by which the others are too late"))
            }
            off if off < -BEHIND_S && offset.spread_s < AHEAD_S => {
                Some(("behind", "so all of it came late, which is believed, or it has another clock"))
            }
            _ => None,
        };
        let is_exact = |of: &Offset| of.median_s.abs() < AHEAD_S / 2.0;
        let exact = other(&is_exact);
        if let Some(((off, why), exact)) = off.zip(exact) {
            notes.push(format!(
                "{file}: the stamps of {name} are {:.2} s {off} the time of recording, those of {exact} are not, {why}; {instead}",
                offset.median_s.abs()
            ));
        }
        let rest = known.iter().filter(|(of, _)| of != topic && !is_tf(of)).map(|(_, of)| of.median_s);
        let ahead_s = offset.median_s - rest.reduce(f64::max).unwrap_or(f64::MAX);
        if exact.is_none() && !is_exact(offset) && !is_tf(topic) && ahead_s > BEHIND_S {
            notes.push(format!(
                "{file}: against the time of recording, the stamps of {name} are {ahead_s:.2} s ahead of all others: it has another clock, \
                 or the others came late; --clock recording uses that time instead of all stamps"
            ));
        }
        if 2 * offset.same > offset.count && !is_tf(topic) {
            notes.push(format!(
                "{file}: {} of {} messages of {name} have the stamp of the one before, or hardly a later one, and only the first of a \
                 stamp counts; {instead}",
                offset.same, offset.count
            ));
        }
    }
    Ok(notes)
}

fn seconds(value: f64) -> String {
    if value.abs() >= 1e5 { format!("{value:.3e} s") } else { format!("{value:.1} s") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(name: &str) -> Topic {
        Topic {
            name: name.into(),
            type_name: String::new(),
            encoding: roscausal_recording::Encoding::Cdr,
            md5: None,
            definition: "".into(),
            latched: false,
            messages: None,
        }
    }

    #[test]
    fn a_clock_is_chosen_for_all_topics_or_for_one() {
        let parse = |texts: &[&str]| {
            ClockChoice::parse(&texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>())
        };
        let choice = parse(&["recording", "/odom=header"]).expect("parses");
        assert!(choice.by_recording(&topic("/people")) && !choice.by_recording(&topic("odom")));
        assert_eq!(choice.unknown(&[topic("/people")]), Some("/odom"));
        assert!(parse(&["wall"]).is_err_and(|error| error.to_string().contains("'recording' nor 'header'")));
    }

    #[test]
    fn offsets_have_a_median_and_a_spread_and_late_messages_are_no_mistakes() {
        let at = |seconds: f64| Time::from_secs_f64(1000.0 + seconds);
        let of = |stamp: &dyn Fn(u64) -> f64, came: &dyn Fn(u64) -> f64, count: u64| {
            let mut offsets = Offsets::default();
            (0..count).for_each(|number| offsets.add(number, at(stamp(number)), at(came(number))));
            offsets.finish().expect("has stamps")
        };
        let step = |number: u64| 0.04 * number as f64;
        let late = of(&step, &|number| step(number) + 1.2 + 0.01 * (number % 3) as f64, 100_000);
        assert!((late.median_s + 1.21).abs() < 1e-6 && (late.spread_s - 0.02).abs() < 1e-6, "{late:?}");
        assert_eq!(late.stepped, Stepped::default());
        // Nothing came for 20 s, then all of it at once.
        let held = |number: u64| if (100..600).contains(&number) { step(600) } else { step(number) };
        assert_eq!(of(&step, &held, 1000).stepped, Stepped::default());
        let glitch = |number: u64| step(number) + if number % 150 == 20 { 3e8 } else { 0.0 };
        assert_eq!(of(&glitch, &step, 600).stepped.mistakes, [20, 170, 320, 470]);
        let early = |number: u64| step(number) - if number == 77 { 30.0 } else { 0.0 };
        assert_eq!(of(&early, &step, 600).stepped.mistakes, [77]);
    }

    #[test]
    fn single_stamps_that_are_a_little_ahead_are_mistakes_where_no_delay_explains_them() {
        let at = |seconds: f64| Time::from_secs_f64(1000.0 + seconds);
        let of = |stamp: &dyn Fn(u64) -> f64, came: &dyn Fn(u64) -> f64| {
            let mut offsets = Offsets::default();
            (0..600).for_each(|number| offsets.add(number, at(stamp(number)), at(came(number))));
            offsets.finish()
        };
        let step = |number: u64| 0.04 * number as f64;
        let mistakes = |stamp: &dyn Fn(u64) -> f64, came: &dyn Fn(u64) -> f64| {
            // Another topic has the time of recording.
            let mut measured = [of(stamp, came), of(&step, &step)];
            add_early(&[topic("/people"), topic("/odom")], &mut measured);
            measured[0].take().map(|offset| offset.stepped.mistakes.len())
        };
        let few = |number: u64| if number % 40 == 20 { 0.8 } else { 0.0 };
        assert_eq!(mistakes(&|number| step(number) + few(number), &step), Some(15));
        let seldom = |number: u64| step(25 * number);
        assert_eq!(mistakes(&|number| seldom(number) + few(number), &seldom), Some(15));
        // The other clock comes seldom, or was set; or most messages came late.
        assert_eq!(mistakes(&step, &|number| step(number).floor()), Some(0));
        for from in [10, 500, 570] {
            let set = |number: u64| step(number) - if number > from { 0.8 } else { 0.0 };
            assert_eq!(mistakes(&step, &set), Some(0), "{from}");
        }
        assert_eq!(mistakes(&step, &|number| step(number) + 0.8 - few(number)), Some(0));
        // The recorder's times are uneven.
        assert_eq!(mistakes(&step, &|number| step(number) + 0.1 * (number * 7 % 10) as f64 - 0.5), Some(0));
    }
}
