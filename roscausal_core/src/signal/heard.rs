//! From messages to the values of signals.

use std::sync::Arc;

use roscausal_msgs::{
    Time,
    dynamic::{Schema, Wire},
};

use super::{
    Definitions, Signal,
    bind::{Bound, Scope},
};
use crate::middleware::{Raw, RawType};

/// A stamp farther from the arrival of its message than this is of another clock, and the arrival counts. Seconds.
const OTHER_CLOCK_S: f64 = 10.0;

/// A value of a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The place of the signal in the list.
    pub signal: usize,
    /// The stamp of the message's header, or its arrival.
    pub stamp: Time,
    /// NaN if the message has none.
    pub value: f64,
}

/// Signals, and the definitions that their topics turned out to have.
#[derive(Debug, Default)]
pub struct Signals {
    signals: Vec<Signal>,
    topics: Vec<Topic>,
    definitions: Definitions,
    trouble: Option<String>,
    unreadable: u64,
}

/// How a topic's messages are read: definition, layout, and the signals in them with their places.
type Bindings = (Schema, Wire, Vec<(usize, Bound)>);

#[derive(Debug)]
struct Topic {
    name: String,
    kind: Option<Arc<RawType>>,
    /// `None`: its messages cannot be used.
    bound: Option<Bindings>,
}

impl Signals {
    /// Signals of which no message has come yet.
    pub fn new(signals: Vec<Signal>, definitions: Definitions) -> Self {
        let mut topics: Vec<Topic> = Vec::new();
        for signal in &signals {
            if !topics.iter().any(|topic| topic.name == signal.topic) {
                topics.push(Topic { name: signal.topic.clone(), kind: None, bound: None });
            }
        }
        Self { signals, topics, definitions, ..Self::default() }
    }

    /// The signals.
    pub fn signals(&self) -> &[Signal] {
        &self.signals
    }

    /// The topics that they read, each once.
    pub fn topics(&self) -> Vec<String> {
        self.topics.iter().map(|topic| topic.name.clone()).collect()
    }

    /// Checks the signals of a topic against a definition.
    ///
    /// # Errors
    /// The first signal that does not fit, or a definition that cannot be used.
    pub fn check(&self, topic: &str, kind: &RawType) -> Result<(), String> {
        self.bind(topic, kind).map(|_| ())
    }

    fn bind(&self, topic: &str, kind: &RawType) -> Result<Bindings, String> {
        let schema = self.definitions.schema(kind).map_err(|reason| format!("{topic}: {reason}"))?;
        let of_topic = self.signals.iter().enumerate().filter(|(_, signal)| signal.topic == topic);
        let bind = |(place, signal): (usize, &Signal)| {
            Ok((place, signal.bind(&schema).map_err(|reason| format!("{}: {reason}", signal.name))?))
        };
        let bound: Vec<(usize, Bound)> = of_topic.map(bind).collect::<Result<_, String>>()?;
        Ok((schema, kind.wire, bound))
    }

    /// The values in a message of the topic at this place of [`Signals::topics`], which arrived `now`.
    pub fn heard(&mut self, topic: usize, message: &Raw, now: Time) -> Vec<Reading> {
        let Some(known) = self.topics.get(topic) else { return Vec::new() };
        if known.kind.as_ref() != Some(&message.kind) {
            let bound = self.bind(&known.name, &message.kind);
            if let Err(reason) = &bound {
                tracing::error!("signals: {reason}");
                self.trouble = Some(reason.clone());
            }
            self.topics[topic].kind = Some(message.kind.clone());
            self.topics[topic].bound = bound.ok();
        }
        let Topic { name, bound: Some((schema, wire, bound)), .. } = &mut self.topics[topic] else {
            return Vec::new();
        };
        let read = read(schema, *wire, bound, &message.bytes, now);
        read.unwrap_or_else(|fault| {
            self.unreadable += 1;
            if self.unreadable.is_power_of_two() {
                tracing::warn!("signals: message {} of {name} that cannot be read: {fault}", self.unreadable);
            }
            Vec::new()
        })
    }

    /// What keeps a signal from being read, if anything does.
    pub fn trouble(&self) -> Option<&str> {
        self.trouble.as_deref()
    }

    /// Messages that could not be read.
    pub fn unreadable(&self) -> u64 {
        self.unreadable
    }
}

fn read(
    schema: &Schema,
    wire: Wire,
    bound: &mut [(usize, Bound)],
    bytes: &[u8],
    arrived: Time,
) -> Result<Vec<Reading>, roscausal_msgs::Fault> {
    let header = schema.stamp(wire, bytes)?.filter(|stamp| *stamp != Time::ZERO);
    let stamp = header.filter(|stamp| stamp.secs_since(arrived).abs() <= OTHER_CLOCK_S).unwrap_or(arrived);
    let scope = Scope { schema, wire, bytes, header, stamp, arrived };
    let mut readings = Vec::with_capacity(bound.len());
    for (signal, bound) in bound {
        if let Some(value) = bound.value(&scope)? {
            readings.push(Reading { signal: *signal, stamp, value });
        }
    }
    Ok(readings)
}
