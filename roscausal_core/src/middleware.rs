//! The adapter trait: all that a node may ask of a middleware.
//!
//! Small and synchronous. Not in it: logging (the `tracing` facade; a backend forwards to `/rosout`) and TF
//! (`/tf` and `/tf_static` are ordinary topics). [`crate::loopback`] implements it in process; ROS 1 and
//! ROS 2 implement it in crates of their own. [`crate::laws`] is what every implementation must pass.

use std::{sync::Arc, time::Duration};

use roscausal_msgs::Wires;

use crate::{
    Message, Result, Time,
    inbox::Consumer,
    params::{ParamSpec, Value},
};

/// Whether this may stand between two `/` of a ROS graph name: letters, digits and `_`, no digit first.
pub fn is_token(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Whether this is a graph name: tokens between single `/`, absolute, relative or `~private`.
pub fn is_graph_name(text: &str) -> bool {
    let bare = text.strip_prefix("~/").or_else(|| text.strip_prefix(['~', '/'])).unwrap_or(text);
    bare.split('/').all(is_token)
}

/// How much a topic keeps, for whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Qos {
    /// Only those subscribed now receive; at most this many wait in a queue (`queue_size`).
    /// ROS 2: volatile, publishers reliable, subscribers best effort.
    Volatile(usize),
    /// The last message is kept for late joiners. ROS 1: latched; ROS 2: reliable, transient local, depth 1.
    Latched,
}

/// A topic's publisher; dropping it unregisters it.
pub trait Publish<M: Message>: Send + 'static {
    /// Sends one message to everyone subscribed. Never blocks on a slow subscriber.
    ///
    /// # Errors
    /// When the middleware refuses the message (too large, session lost).
    fn publish(&self, message: &M) -> Result<()>;

    /// How many subscribers are connected now.
    fn subscriber_count(&self) -> usize;
}

/// One node's connection to its middleware. Cheap to clone; the clones are one node.
pub trait Middleware: Clone + Send + Sync + 'static {
    /// What [`Middleware::advertise`] gives.
    type Publisher<M: Message>: Publish<M>;
    /// What [`Middleware::subscribe`] gives; dropping it unsubscribes, and no callback runs afterwards.
    type Subscription: Send + 'static;

    /// The node's full name, such as `/roscausal_data`.
    fn node_name(&self) -> String;

    /// Registers a publisher. Names are ROS graph names: absolute, relative to the namespace, or `~private`.
    ///
    /// # Errors
    /// An illegal name, a topic that already has another type, or a middleware that is gone.
    fn advertise<M: Message>(&self, topic: &str, qos: Qos) -> Result<Self::Publisher<M>>;

    /// Registers a callback for each message; it runs on a thread of the middleware and must return at once
    /// (send into an [`crate::inbox::Inbox`]).
    ///
    /// # Errors
    /// As [`Middleware::advertise`].
    fn subscribe<M: Message>(
        &self,
        topic: &str,
        qos: Qos,
        callback: impl FnMut(M) + Send + 'static,
    ) -> Result<Self::Subscription>;

    /// The value set for a parameter, `None` when nobody set it. Declares it where the middleware wants that.
    /// Asked again, it tells the value of now.
    ///
    /// # Errors
    /// When the parameter server cannot be reached.
    fn param(&self, spec: &ParamSpec) -> Result<Option<Value>>;

    /// Names of this node's private parameters that somebody has set, for a warning about those that no node has. Empty
    /// where the middleware cannot tell, or warns itself.
    fn params_set(&self) -> Vec<String> {
        Vec::new()
    }

    /// Sets a parameter for other nodes to read (absolute name) or for this one (private name).
    ///
    /// # Errors
    /// When the parameter server cannot be reached.
    fn set_param(&self, name: &str, value: Value) -> Result<()>;

    /// Time of the clock in use: the system's, or `/clock` with `use_sim_time`.
    fn now(&self) -> Time;

    /// Time since some moment in the past by a clock that neither stops nor jumps and is never simulated: for what
    /// costs real time, such as a budget. Nothing that is recorded or found may depend on it.
    fn steady(&self) -> Duration;

    /// False once the node is to end.
    fn is_ok(&self) -> bool;

    /// Asks the node to end: [`Middleware::is_ok`] becomes false and its inboxes wake.
    fn shutdown(&self);

    /// Names a consumer to be woken when a simulated clock moves or the node is to end.
    fn attach(&self, consumer: Arc<dyn Consumer>);

    /// True when nodes act on a new time only when they are told to, one after the other
    /// ([`Consumer::wait_idle`]); false when they read the clock themselves.
    fn is_lockstep(&self) -> bool {
        false
    }

    /// True when this node is a future that its middleware polls, on a thread that it shares with others: it
    /// waits in [`crate::inbox::Inbox::awaited`] alone.
    fn is_task(&self) -> bool {
        false
    }

    /// Whose types it carries, where the ROS versions differ (markers); [`Wires::Both`]: anybody's.
    fn wires(&self) -> Wires {
        Wires::Both
    }

    /// `(topic, package/Name)` of the topics known now, for hints such as "topics of that type: ...".
    fn topics(&self) -> Vec<(String, String)>;

    /// Messages lost so far on the way to this node's subscriptions, by topic, where the middleware can tell.
    fn lost(&self) -> Vec<(String, u64)> {
        Vec::new()
    }
}
