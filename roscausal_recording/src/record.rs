//! Recording what is published on a middleware.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex},
};

use roscausal_core::{
    Error, Message, Result,
    gate::lock,
    middleware::{Middleware, Qos},
};
use roscausal_msgs::{
    Definition, TypeVisitor, types, visit,
    visualization_msgs::{Marker, MarkerArray, Ros2Marker, Ros2MarkerArray},
};

use crate::McapWriter;

/// Writes what is published on a middleware into an MCAP file. Each message is recorded at the time on the
/// middleware's clock when it arrived.
pub struct Recorder<M: Middleware> {
    mw: M,
    written: Arc<Mutex<Written>>,
    subscriptions: BTreeMap<(String, String), Option<M::Subscription>>,
}

struct Written {
    writer: Option<McapWriter>,
    /// The first error. Nothing is written after it.
    error: Option<Error>,
}

/// Messages of a topic that may wait.
const QUEUE: usize = 1000;

impl<M: Middleware> Recorder<M> {
    /// A recorder without any subscription.
    pub fn new(mw: &M, writer: McapWriter) -> Self {
        let written = Arc::new(Mutex::new(Written { writer: Some(writer), error: None }));
        Self { mw: mw.clone(), written, subscriptions: BTreeMap::new() }
    }

    /// Subscribes to every topic that is published now and not recorded yet. Call it again as topics appear. A
    /// topic of unknown type is left out with a warning.
    ///
    /// # Errors
    /// A topic that the middleware refuses.
    pub fn watch(&mut self) -> Result<()> {
        for (topic, type_name) in self.mw.topics() {
            if self.subscriptions.contains_key(&(topic.clone(), type_name.clone())) {
                continue;
            }
            let known = types().into_iter().find(|known| known.type_name() == type_name);
            let subscription = match known {
                Some(known) => Some(self.subscribe(&topic, known)?),
                None => {
                    tracing::warn!("topic '{topic}' is not recorded: its type {type_name} is unknown");
                    None
                }
            };
            self.subscriptions.insert((topic, type_name), subscription);
        }
        Ok(())
    }

    /// Records a topic, including latched messages. It need not be published yet.
    ///
    /// # Errors
    /// A topic that the middleware refuses, or a type that `roscausal_msgs` does not have.
    pub fn record(&mut self, topic: &str, definition: &'static Definition) -> Result<()> {
        let subscription = self.subscribe(topic, definition)?;
        self.subscriptions.insert((topic.to_owned(), definition.type_name()), Some(subscription));
        Ok(())
    }

    /// Ends the recording. Returns the number of messages in it.
    ///
    /// # Errors
    /// The first error of writing, at which the recording ended.
    pub fn finish(self) -> Result<u64> {
        drop(self.subscriptions);
        let mut written = lock(&self.written);
        if let Some(error) = written.error.take() {
            return Err(error);
        }
        let Some(writer) = written.writer.take() else { return Ok(0) };
        let messages = writer.messages();
        writer.finish().map(|()| messages)
    }

    fn subscribe(&self, topic: &str, definition: &'static Definition) -> Result<M::Subscription> {
        let listen = Listen { mw: &self.mw, topic, written: &self.written };
        let unknown = || Error::Topic {
            topic: topic.to_owned(),
            reason: format!("its type {} is unknown", definition.type_name()),
        };
        // ROS 2's markers have more fields, and the file has ROS 2's types.
        if std::ptr::eq(definition, Marker::definition()) {
            return listen.to::<Marker, Ros2Marker>();
        }
        if std::ptr::eq(definition, MarkerArray::definition()) {
            return listen.to::<MarkerArray, Ros2MarkerArray>();
        }
        visit(definition, listen).unwrap_or_else(|| Err(unknown()))
    }
}

struct Listen<'a, M> {
    mw: &'a M,
    topic: &'a str,
    written: &'a Arc<Mutex<Written>>,
}

impl<M: Middleware> Listen<'_, M> {
    /// Subscribes to `T` and writes it as `W`.
    fn to<T: Message, W: Message + From<T>>(self) -> Result<M::Subscription> {
        let (clock, topic, written) = (self.mw.clone(), self.topic.to_owned(), self.written.clone());
        // In ROS 2 a latched subscription receives nothing from a volatile publisher. The latched topics are few
        // and known by name.
        let latched = LATCHED.contains(&self.topic.rsplit('/').next().unwrap_or_default());
        let qos = if latched { Qos::Latched } else { Qos::Volatile(QUEUE) };
        self.mw.subscribe(self.topic, qos, move |message: T| {
            let now = clock.now();
            let mut written = lock(&written);
            let Some(writer) = &mut written.writer else { return };
            if let Err(error) = writer.write(&topic, now, &W::from(message)) {
                tracing::error!("recording ends: {error}");
                written.error.get_or_insert(error);
                written.writer = None;
            }
        })
    }
}

/// Last parts of the names of latched topics.
const LATCHED: [&str; 9] = [
    "tf_static", "causal_model", "causal_model_info", "causal_evidence", "model_changes", "structural_model",
    "dag", "tsdag", "robot_description",
];

impl<M: Middleware> TypeVisitor for Listen<'_, M> {
    type Output = Result<M::Subscription>;

    fn visit<T: Message>(self) -> Self::Output {
        self.to::<T, T>()
    }
}
