//! Plays a recording on a lockstep bus, in the time of the recording.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::{Arc, Mutex},
};

use roscausal_core::{
    Result, Time,
    batch::OFTEN_TO_HOLD,
    gate::lock,
    loopback::{Loopback, LoopbackNode, LoopbackPublisher, LoopbackSubscription},
    middleware::{Middleware, Publish, Qos, Raw, RawType},
    nodes::labels,
    signal::Definitions,
};
use roscausal_msgs::{
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
    geometry_msgs::PoseStamped,
    nav_msgs::Odometry,
    rosgraph_msgs::Clock,
    tf2_msgs::TFMessage,
};
use roscausal_recording::{Player, Record, Recording, Topic};

use super::{
    clocks::{Clocks, is_clock},
    inputs::{Inputs, ODOMETRY_POSE},
    order::InOrder,
    stamps::Stamps,
};

/// After this time within a hole of a recording, nothing happens until its end.
const AFTER_HOLE_NS: i64 = 60 * 1_000_000_000;
/// A longer hole, of a month, is shortened to that.
const LONGEST_HOLE_NS: i64 = 30 * 86_400 * 1_000_000_000;
/// With fewer sightings for each row, rows are closer than sightings, of which a few may be lost.
const ENOUGH: f64 = 0.85;
/// Rows that are more uneven make links at lag 0 in a recording of 1200 rows (`roscausal_core/examples/sightings.rs`). Steps.
const UNEVEN: f64 = 0.05;
/// A longer time without messages of a topic is reported. Seconds.
const SILENT_S: f64 = 5.0;
/// What of the nodes' diagnostics is kept.
const SAID: [&str; 5] = [labels::NAMES, labels::CHANGED, labels::PER_ROW, labels::AHEAD, labels::FOLLOWS];
/// By node: what was lost, and its last complaint.
type Troubles = Arc<Mutex<BTreeMap<String, [String; 2]>>>;

/// What this status of a node says of messages that were left out, or that did not come.
fn lost(status: &DiagnosticStatus) -> String {
    let number = |pair: &KeyValue| pair.value.parse::<f64>().unwrap_or(0.0);
    let sent = status.values.iter().find(|pair| pair.key == "sent").map_or(0.0, number);
    let is_loss = |pair: &&KeyValue| match pair.key.strip_prefix(labels::SILENCE) {
        Some(topic) => number(pair) >= SILENT_S && !topic.contains("roscausal/"),
        None if [labels::JUMPS, labels::LEAPS].contains(&pair.key.as_str()) => number(pair) > 0.0,
        // Of others a few are no matter.
        None => labels::LOST.contains(&pair.key.as_str()) && 100.0 * number(pair) > sent,
    };
    let lost = status.values.iter().filter(is_loss).map(|pair| format!("{}: {}", pair.key, pair.value));
    lost.collect::<Vec<_>>().join(", ")
}

/// A recording that is ready to be played. The bus's clock stands at its beginning.
pub(crate) struct Play<'a> {
    bus: Loopback,
    recording: InOrder<'a>,
    player: Player,
    /// Topic and publisher of the poses taken from odometry.
    pose: Option<(String, LoopbackPublisher<PoseStamped>)>,
    /// By topic of the recording: name and type of those that are published as bytes.
    raw: Vec<Option<(String, Arc<RawType>)>>,
    /// By topic: where the stamps are that are replaced by the time of recording.
    stamps: Vec<Option<Stamps>>,
    clocks: &'a Clocks,
    /// Transforms that are true at all times, by topic; published before anything else.
    fixed: Vec<(LoopbackPublisher<TFMessage>, TFMessage)>,

    /// The recording's own clock; it sets the time if there is one.
    clock: Option<usize>,
    now: Time,
    last: Time,
    played: Played,
    _diagnostics: LoopbackSubscription,
    node: LoopbackNode,
}

/// The result of playing a recording.
#[derive(Debug, Default)]
pub(crate) struct Played {
    /// Messages played.
    pub(crate) messages: u64,
    /// For each topic: how many of its messages could not be read, and why the first one could not.
    unreadable: BTreeMap<String, (u64, String)>,
    losses: Vec<String>,
    troubles: Troubles,
    /// What the nodes say of people and their sightings, in the order of [`SAID`].
    people: Arc<Mutex<[String; 5]>>,
}

impl<'a> Play<'a> {
    /// Advertises the chosen topics. Call it before the nodes start, so that they begin at its time.
    pub(crate) fn new(bus: &Loopback, recording: &'a mut Recording, inputs: &'a Inputs) -> Result<Self> {
        let node = bus.node("replay");
        let clock = recording.topics().iter().position(is_clock);
        let player = Player::new(&node, recording, |topic| inputs.played_as(topic))?;
        let pose = match &inputs.pose_of {
            Some(topic) => Some((topic.clone(), node.advertise(ODOMETRY_POSE, Qos::Volatile(100))?)),
            None => None,
        };
        let raw = |topic: &Topic| {
            Some((topic.playable(), Arc::new(topic.raw_type().filter(|_| inputs.plays_bytes(topic))?)))
        };
        let raw = recording.topics().iter().map(raw).collect();
        let definitions = Definitions::of("");
        let stamps =
            |topic: &Topic| Stamps::of(topic, &definitions).filter(|_| inputs.clock.by_recording(topic));
        let stamps: Vec<Option<Stamps>> = recording.topics().iter().map(stamps).collect();
        recording.select(|topic| inputs.plays(topic) || is_clock(topic) || inputs.plays_bytes(topic));
        let played = Played::default();
        let (troubles, people) = (played.troubles.clone(), played.people.clone());
        let diagnostics = node.subscribe("/diagnostics", Qos::Volatile(10), move |m: DiagnosticArray| {
            for pair in
                m.status.iter().flat_map(|status| &status.values).filter(|pair| !pair.value.is_empty())
            {
                if let Some(place) = SAID.iter().position(|key| pair.key == *key) {
                    lock(&people)[place].clone_from(&pair.value);
                }
            }
            for status in m.status {
                let mut troubles = lock(&troubles);
                let known = troubles.entry(status.name.clone()).or_default();
                known[0] = lost(&status);
                if status.level != DiagnosticStatus::OK {
                    known[1] = status.message;
                }
            }
        })?;
        // Nodes that act ten times a second act at the same moments in every replay, and in a run whose clock began
        // at 0.
        let start = Time { nanosec: 0, ..inputs.start };
        bus.advance_to(start);
        Ok(Self {
            bus: bus.clone(),
            recording: InOrder::new(recording),
            player,
            pose,
            raw,
            stamps,
            clocks: &inputs.clocks,
            fixed: Vec::new(),
            clock,
            now: start,
            last: start,
            played,
            _diagnostics: diagnostics,
            node,
        })
    }

    /// Plays messages when they were due, not when they came; slow transforms ahead, and those that are fixed at the beginning.
    pub(crate) fn in_order_of_stamps(mut self) -> Result<Self> {
        for (topic, transforms) in &self.clocks.fixed {
            let publisher = self.node.advertise(topic, Qos::Latched)?;
            self.fixed.push((publisher, TFMessage { transforms: transforms.values().cloned().collect() }));
        }
        self.recording = self.recording.with(&self.clocks.lead);
        Ok(self)
    }

    /// Plays everything. `each` gets the progress (0 to 1) and the time of the bus, and ends the playing by
    /// returning false. `numbers`: how many messages of each topic were read before.
    pub(crate) fn run(
        mut self,
        numbers: &mut Vec<u64>,
        mut each: impl FnMut(f64, Time) -> bool,
    ) -> Result<Played> {
        let mut seen = -1.0;
        let topics = self.recording.recording.topics().to_vec();
        numbers.resize(topics.len(), 0);
        for (publisher, message) in &self.fixed {
            publisher.publish(message)?;
            self.bus.settle();
        }
        while let Some((mut record, number)) = self.recording.next(numbers) {
            let topic = &topics[record.topic];
            if self.clocks.leaves_out(record.topic, number) {
                // It is counted.
            } else if Some(record.topic) == self.clock {
                if let Ok(clock) = topic.decode::<Clock>(&record.bytes) {
                    self.advance(clock.clock);
                }
            } else {
                // The time of recording may be the mistake.
                if self.clock.is_none() {
                    self.advance(record.stamp);
                }
                if let Some(Some(stamps)) = self.stamps.get(record.topic) {
                    let stamp = if self.clock.is_some() { self.now } else { record.stamp };
                    stamps.set(&mut record.bytes, stamp);
                }
                self.publish(topic, &record);
                self.bus.settle();
            }
            self.played.messages += 1;
            let progress = self.recording.recording.progress();
            if (progress != seen || self.played.messages.is_multiple_of(64)) && !each(progress, self.now) {
                break;
            }
            seen = progress;
        }
        // What the nodes counted last is in their next reports, which come once a second.
        self.bus.advance_to(self.now.plus_secs(1.0));
        self.played.losses = self.recording.recording.losses().to_vec();
        Ok(self.played)
    }

    /// Advances the bus's clock as far as the recording's has advanced: never back, and over no hole longer than a month.
    fn advance(&mut self, stamp: Time) {
        let step = stamp.as_nanos() - std::mem::replace(&mut self.last, stamp).as_nanos();
        let after = |step: i64| Time::from_nanos(self.now.as_nanos().saturating_add(step));
        let begin = after(step.clamp(0, AFTER_HOLE_NS));
        let now = if step > LONGEST_HOLE_NS { begin } else { after(step.max(0)) };
        self.now = now;
        self.bus.advance_to(begin);
        if now > begin {
            self.bus.skip_to(now);
        }
    }

    /// Publishes one message. A message that cannot be read is counted.
    fn publish(&mut self, topic: &Topic, record: &Record) {
        let mut published = match self.raw.get(record.topic) {
            Some(Some((name, kind))) => {
                self.node.publish_raw(name, Raw { kind: kind.clone(), bytes: record.bytes.clone() })
            }
            _ => self.player.publish(topic, record),
        };
        if let (Ok(()), Some((name, publisher))) = (&published, &self.pose)
            && *name == topic.name
        {
            published = topic.decode::<Odometry>(&record.bytes).and_then(|odometry| {
                publisher.publish(&PoseStamped { header: odometry.header, pose: odometry.pose.pose })
            });
        }
        if let Err(error) = published {
            let first = || (0, error.to_string());
            self.played.unreadable.entry(topic.name.clone()).or_insert_with(first).0 += 1;
        }
    }
}

/// What rows that are close, compared with sightings, mean for links at lag 0.
fn of_rows((per_row, uneven): (f64, f64)) -> Option<String> {
    let (per_row, uneven) = (per_row / 100.0, uneven / 1000.0);
    if per_row > 0.0 && per_row < ENOUGH {
        let times = 1.0 / per_row;
        return Some(format!(
            "there are {times:.1} rows for each sighting of a person, and what lies between sightings makes links at lag 0; a step (--dt) {times:.1} \
             times as long has one for each row"
        ));
    }
    (uneven > UNEVEN && per_row * OFTEN_TO_HOLD < 1.0).then(|| {
        format!(
            "rows are made at sightings, whose moments are uneven by {:.0} % of a step, so a link at lag 0 between a person and the robot may be \
             false; with a step (--dt) {:.1} times as long, rows hold the newest sighting instead",
            100.0 * uneven,
            1.0 / (OFTEN_TO_HOLD * per_row.max(1.0))
        )
    })
}

impl Played {
    /// Reports on stderr what was lost.
    pub(crate) fn tell(&self, path: &Path) {
        let [names, changed, per_row, ahead, follows] = lock(&self.people).clone();
        let file = path.display();
        if !names.is_empty() {
            tell!("{file}: people: {names}");
        }
        if !changed.is_empty() {
            tell!(
                "note: {file}: a new number of a person began where another had ended within 2 s ({changed}): probably the same person; \
                 --param human.rejoin_time=2 joins them"
            );
        }
        if let Some(remark) = per_row.parse().ok().zip(ahead.parse().ok()).and_then(of_rows) {
            tell!("note: {file}: {remark}");
        }
        if follows.parse::<f64>().is_ok_and(|share| share >= 50.0) {
            tell!(
                "note: {file}: the robot follows people in {follows} % of the rows in which both move: their distance is then a sum of both \
                 speeds, and a link from it to a speed may be there without a cause; where their tracker tells places only, --param data.sampling=hold \
                 gives fewer such links"
            );
        }
        self.losses.iter().for_each(|loss| tell!("note: {loss}"));
        for (node, [lost, trouble]) in lock(&self.troubles).iter().filter(|(_, [lost, _])| !lost.is_empty()) {
            let why = lost.contains(labels::NO_TRANSFORM) && !trouble.is_empty();
            let why = if why { format!(" ({trouble})") } else { String::new() };
            tell!("note: {file}: {node} node: {lost}{why}");
        }
        for (topic, (count, first)) in &self.unreadable {
            tell!("note: {file}: {count} messages of {topic} cannot be read, the first: {first}");
        }
    }

    /// What was `seen`, and the last complaints of the nodes, in one line.
    pub(crate) fn troubles(&self, seen: String) -> String {
        let troubles = lock(&self.troubles);
        let of_nodes = troubles.iter().filter(|(_, [_, what])| !what.is_empty());
        let of_nodes = of_nodes.map(|(node, [_, what])| format!("{node}: {what}"));
        std::iter::once(seen).chain(of_nodes).collect::<Vec<_>>().join("; ")
    }
}
