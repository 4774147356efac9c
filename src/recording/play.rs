//! Plays a recording on a lockstep bus, in the time of the recording.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::{Arc, Mutex},
};

use roscausal_core::{
    Result, Time,
    gate::lock,
    loopback::{Loopback, LoopbackNode, LoopbackPublisher, LoopbackSubscription},
    middleware::{Middleware, Publish, Qos, Raw, RawType},
    signal::Definitions,
};
use roscausal_msgs::{
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus},
    geometry_msgs::PoseStamped,
    nav_msgs::Odometry,
    rosgraph_msgs::Clock,
};
use roscausal_recording::{Player, Record, Recording, Topic};

use super::{
    clocks::{self, Clocks, Stamps},
    inputs::{Inputs, ODOMETRY_POSE},
    order::{InOrder, Lead},
};

/// A longer hole in a recording is shortened.
const LONGEST_HOLE_NS: i64 = 3600 * 1_000_000_000;
/// To this length.
const AFTER_HOLE_NS: i64 = 1_000_000_000;
/// What the human node calls its list of names, in diagnostics.
const NAMES: &str = "numbers of names";
type Troubles = Arc<Mutex<BTreeMap<String, String>>>;

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
    /// Which number stands for which name of a person: `1 = anna`.
    names: Arc<Mutex<String>>,
}

/// Whether this topic carries the time of a simulation.
pub(super) fn is_clock(topic: &Topic) -> bool {
    topic.name == "/clock" && topic.type_name == "rosgraph_msgs/Clock" && topic.known_type().is_some()
}

/// The time at which a recording begins: by its own clock if it has one, otherwise by its recorder's.
pub(super) fn start(path: &Path, recording: &Recording) -> Result<Time> {
    let span = recording.span().map_or(Time::ZERO, |(start, _)| start);
    let Some(clock) = recording.topics().iter().position(is_clock) else { return Ok(span) };
    let mut clocks = Recording::open(path)?;
    clocks.select(is_clock);
    let first =
        clocks.next().and_then(|record| recording.topics()[clock].decode::<Clock>(&record.bytes).ok());
    Ok(first.map_or(span, |first| first.clock))
}

impl<'a> Play<'a> {
    /// Advertises the chosen topics. Call it before the nodes start, so that they begin at its time.
    pub(crate) fn new(bus: &Loopback, recording: &'a mut Recording, inputs: &'a Inputs) -> Result<Self> {
        let node = bus.node("replay");
        let clock = recording.topics().iter().position(is_clock);
        let player = Player::new(&node, recording, |topic| inputs.plays(topic))?;
        let pose = match &inputs.pose_of {
            Some(topic) => Some((topic.clone(), node.advertise(ODOMETRY_POSE, Qos::Volatile(100))?)),
            None => None,
        };
        let raw = |topic: &Topic| {
            let kind = topic.raw_type().filter(|_| inputs.plays_bytes(topic))?;
            Some((topic.playable(), Arc::new(kind)))
        };
        let raw = recording.topics().iter().map(raw).collect();
        let definitions = Definitions::of("");
        let stamps =
            |topic: &Topic| Stamps::of(topic, &definitions).filter(|_| inputs.clock.by_recording(topic));
        let stamps: Vec<Option<Stamps>> = recording.topics().iter().map(stamps).collect();
        recording.select(|topic| inputs.plays(topic) || is_clock(topic) || inputs.plays_bytes(topic));
        let played = Played::default();
        let (troubles, names) = (played.troubles.clone(), played.names.clone());
        let diagnostics = node.subscribe("/diagnostics", Qos::Volatile(10), move |m: DiagnosticArray| {
            let told = m.status.iter().flat_map(|status| &status.values).find(|pair| pair.key == NAMES);
            if let Some(told) = told.filter(|told| !told.value.is_empty()) {
                lock(&names).clone_from(&told.value);
            }
            let mut troubles = lock(&troubles);
            for status in m.status.into_iter().filter(|status| status.level != DiagnosticStatus::OK) {
                troubles.insert(status.name, status.message);
            }
        })?;
        // Nodes that act ten times a second act at the same moments in every replay, and in a run whose clock began
        // at 0.
        let start = Time { nanosec: 0, ..inputs.start };
        bus.advance_to(start);
        Ok(Self {
            bus: bus.clone(),
            recording: InOrder::new(recording, Lead::default()),
            player,
            pose,
            raw,
            stamps,
            clocks: &inputs.clocks,
            clock,
            now: start,
            last: start,
            played,
            _diagnostics: diagnostics,
            node,
        })
    }

    /// Plays messages when they were due, not when they came, and slow transforms ahead.
    pub(crate) fn in_order_of_stamps(mut self, clocks: &Clocks) -> Self {
        self.recording = self.recording.with(clocks.lead.clone());
        self
    }

    /// Plays everything. `each` gets the progress (0 to 1) and the time of the bus, and ends the playing by
    /// returning false. `numbers`: how many messages of each topic were read before.
    pub(crate) fn run(
        mut self,
        numbers: &mut Vec<u64>,
        mut each: impl FnMut(f64, Time) -> bool,
    ) -> Result<Played> {
        let mut seen = -1.0;
        let topics = self.recording.recording().topics().to_vec();
        numbers.resize(topics.len(), 0);
        while let Some(mut record) = self.recording.next() {
            let topic = &topics[record.topic];
            let number = clocks::number(numbers, &record);
            if Some(record.topic) == self.clock {
                if let Ok(clock) = topic.decode::<Clock>(&record.bytes) {
                    self.advance(clock.clock);
                }
            } else {
                if self.clock.is_none() {
                    self.advance(record.stamp);
                }
                if !self.clocks.leaves_out(record.topic, number) {
                    if let Some(Some(stamps)) = self.stamps.get(record.topic) {
                        stamps.set(
                            &mut record.bytes,
                            if self.clock.is_some() { self.now } else { record.stamp },
                        );
                    }
                    self.publish(topic, &record);
                    self.bus.settle();
                }
            }
            self.played.messages += 1;
            let progress = self.recording.recording().progress();
            if (progress != seen || self.played.messages.is_multiple_of(64)) && !each(progress, self.now) {
                break;
            }
            seen = progress;
        }
        self.played.losses = self.recording.recording().losses().to_vec();
        Ok(self.played)
    }

    /// Advances the bus's clock as far as the recording's has advanced: never back, and over no hole longer than an
    /// hour.
    fn advance(&mut self, stamp: Time) {
        let step = stamp.as_nanos() - std::mem::replace(&mut self.last, stamp).as_nanos();
        if step > 0 {
            let step = if step > LONGEST_HOLE_NS { AFTER_HOLE_NS } else { step };
            self.now = Time::from_nanos(self.now.as_nanos().saturating_add(step));
        }
        self.bus.advance_to(self.now);
    }

    /// Publishes one message. A message that cannot be read is counted.
    fn publish(&mut self, topic: &Topic, record: &Record) {
        let mut published = match self.raw.get(record.topic) {
            Some(Some((name, kind))) => {
                let message = Raw { kind: kind.clone(), bytes: record.bytes.clone() };
                self.node.publish_raw(name, message)
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

impl Played {
    /// Reports on stderr what was lost.
    pub(crate) fn tell(&self, path: &Path) {
        let names = lock(&self.names);
        if !names.is_empty() {
            crate::terminal::tell!("{}: people: {names}", path.display());
        }
        for loss in &self.losses {
            crate::terminal::tell!("note: {loss}");
        }
        for (topic, (count, first)) in &self.unreadable {
            crate::terminal::tell!(
                "note: {}: {count} messages of {topic} cannot be read, the first: {first}",
                path.display()
            );
        }
    }

    /// What was `seen`, and the last complaints of the nodes, in one line.
    pub(crate) fn troubles(&self, seen: &str) -> String {
        let troubles = lock(&self.troubles);
        let of_nodes = troubles.iter().map(|(node, what)| format!("{node}: {what}"));
        let seen = Some(seen.to_owned()).filter(|seen| !seen.is_empty());
        let lines: Vec<String> = seen.into_iter().chain(of_nodes).collect();
        if lines.is_empty() { "no node complained".to_owned() } else { lines.join("; ") }
    }
}
