//! The adapter trait: everything that a node may ask of a middleware.
//!
//! It is small and synchronous. It leaves out logging (nodes use the `tracing` facade, and a backend forwards to
//! `/rosout`) and TF (`/tf` and `/tf_static` are ordinary topics). [`crate::loopback`] implements it within one
//! process; ROS 1 and ROS 2 implement it in crates of their own. Every implementation must pass [`crate::conformance`].

use std::{
    collections::BTreeMap,
    sync::{Arc, LazyLock},
    time::{Duration, Instant},
};

use roscausal_msgs::{Service, Wires, dynamic::Wire};

use crate::{
    Error, Message, Result, Time,
    params::{ParamSpec, Params, TakeParams, Value, nearest},
};

/// Whether `text` is one part of a ROS graph name: letters, digits and `_`, not starting with a digit.
pub fn is_token(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Whether `text` is a graph name: parts separated by single `/`, absolute, relative or `~private`.
pub fn is_graph_name(text: &str) -> bool {
    let bare = text.strip_prefix("~/").or_else(|| text.strip_prefix(['~', '/'])).unwrap_or(text);
    bare.split('/').all(is_token)
}

/// Quality of service of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Qos {
    /// Only current subscribers receive messages. At most this many wait in a queue (`queue_size`). ROS 2:
    /// volatile; publishers reliable, subscribers best effort.
    Volatile(usize),
    /// The last message is kept for late joiners. ROS 1: latched. ROS 2: reliable, transient local, depth 1.
    Latched,
}

/// The type of a topic's messages, as it is known where they come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawType {
    /// `package/Name`.
    pub type_name: String,
    /// Its text and those of the types that it uses; empty if the definition does not come with the messages.
    pub definition: String,
    /// How its messages are written.
    pub wire: Wire,
}

/// A message of any type, as bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raw {
    /// Its type.
    pub kind: Arc<RawType>,
    /// The message as it came.
    pub bytes: Vec<u8>,
}

/// A topic's publisher; dropping it unregisters it.
pub trait Publish<M: Message>: Send + 'static {
    /// Sends a message to all subscribers. Never blocks on a slow subscriber.
    ///
    /// # Errors
    /// If the middleware refuses the message (too large, session lost).
    fn publish(&self, message: &M) -> Result<()>;

    /// The number of connected subscribers.
    fn subscriber_count(&self) -> usize;
}

/// Takes an answer, or why there is none.
type Answer<R> = Box<dyn FnOnce(std::result::Result<R, String>) + Send>;

/// What a service owes its caller: one answer, now or later, from any thread. Dropped without one, it tells the caller
/// that the node ends.
pub struct Reply<R> {
    answer: Option<Answer<R>>,
}

impl<R> Reply<R> {
    /// The reply that hands its answer, or why there is none, to `answer`.
    pub fn new(answer: impl FnOnce(std::result::Result<R, String>) + Send + 'static) -> Self {
        Self { answer: Some(Box::new(answer)) }
    }

    /// Sends the answer. A caller that has gone does not get it.
    pub fn send(mut self, response: R) {
        if let Some(answer) = self.answer.take() {
            answer(Ok(response));
        }
    }
}

impl<R> Drop for Reply<R> {
    fn drop(&mut self) {
        if let Some(answer) = self.answer.take() {
            answer(Err("the node ends".to_owned()));
        }
    }
}

impl<R> std::fmt::Debug for Reply<R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Reply")
    }
}

/// What is called with each message of a topic, on a thread of the middleware.
pub trait On<M>: FnMut(M) + Send + 'static {}

impl<M, F: FnMut(M) + Send + 'static> On<M> for F {}

/// What is called with each question to a service, on a thread of the middleware.
pub trait Answers<S: Service>: FnMut(S::Request, Reply<S::Response>) + Send + 'static {}

impl<S: Service, F: FnMut(S::Request, Reply<S::Response>) + Send + 'static> Answers<S> for F {}

/// The middleware's view of an inbox.
pub trait Consumer: Send + Sync {
    /// Makes a waiting node check the clock and the shutdown flag again.
    fn wake(&self);

    /// Lets the node act on the time `now`. Blocks until the node has handled everything and waits for something
    /// later. Returns at once if the inbox is gone, belongs to the calling thread, or is [detached](crate::inbox::Inbox::detached).
    fn wait_idle(&self, now: Time);

    /// Lets the node act on the time `now`. Returns whether it has handled everything and waits for something
    /// later, so that it need not be polled. For nodes that run as tasks of their middleware.
    fn is_idle(&self, now: Time) -> bool;

    /// The time that the node waits for; [`Time::MAX`] if it waits for events only. `None` while it works, and if
    /// nobody has to wait for it.
    fn deadline(&self) -> Option<Time>;
}

/// A node's connection to its middleware. Cheap to clone; all clones are the same node.
pub trait Middleware: Clone + Send + Sync + 'static {
    /// The result of [`Middleware::advertise`].
    type Publisher<M: Message>: Publish<M>;
    /// The result of [`Middleware::subscribe`]. Dropping it unsubscribes; no callback runs afterwards.
    type Subscription: Send + 'static;
    /// The result of [`Middleware::serve`]. Dropping it ends the service; no callback runs afterwards.
    type Server: Send + 'static;

    /// The node's full name, such as `/roscausal_data`.
    fn node_name(&self) -> String;

    /// Registers a publisher. Names are ROS graph names: absolute, relative to the namespace, or `~private`.
    ///
    /// # Errors
    /// An illegal name, a topic that already has another type, or a middleware that is gone.
    fn advertise<M: Message>(&self, topic: &str, qos: Qos) -> Result<Self::Publisher<M>>;

    /// Registers a callback for each message. It runs on a thread of the middleware and must return at once (it
    /// sends into an [`crate::inbox::Inbox`]).
    ///
    /// # Errors
    /// As [`Middleware::advertise`].
    fn subscribe<M: Message>(
        &self,
        topic: &str,
        qos: Qos,
        callback: impl On<M>,
    ) -> Result<Self::Subscription>;

    /// Registers a callback for each message of a topic of any type, as bytes with their definition. The type is that of
    /// the topic's publishers, whenever they appear.
    ///
    /// # Errors
    /// As [`Middleware::advertise`], and a middleware that cannot: the default.
    fn listen(&self, topic: &str, _callback: impl On<Raw>) -> Result<Self::Subscription> {
        let reason = "this middleware does not carry messages of any type: record the topic ('rosbag record', 'ros2 bag \
                      record') and read the recording with --signal";
        Err(Error::Topic { topic: topic.to_owned(), reason: reason.to_owned() })
    }

    /// Offers a service. Its callback runs on a thread of the middleware for each question and must return at once: it
    /// sends question and [`Reply`] into an [`crate::inbox::Inbox`]. Several questions may be open at the same time.
    ///
    /// # Errors
    /// An illegal name, a service that another node or this one offers already (where the middleware can tell), or a
    /// middleware that is gone.
    fn serve<S: Service>(&self, name: &str, callback: impl Answers<S>) -> Result<Self::Server>;

    /// Asks a service and waits for its answer; never longer than `patience`, which includes the wait for the service
    /// to appear. Not for callbacks and not for nodes of a lockstep bus, which the answer would wait for.
    ///
    /// # Errors
    /// No such service in time, one of another type, one that gives no answer, or a middleware that is gone.
    fn call<S: Service>(&self, name: &str, request: &S::Request, patience: Duration) -> Result<S::Response>;

    /// The current value of a parameter; `None` if nobody set it. Declares the parameter if the middleware requires
    /// that.
    ///
    /// # Errors
    /// If the parameter server cannot be reached.
    fn param(&self, spec: &ParamSpec) -> Result<Option<Value>>;

    /// Names of this node's private parameters that somebody has set. They serve to warn about names that the node
    /// does not have. Empty if the middleware cannot list them, or warns itself.
    fn params_set(&self) -> Vec<String> {
        Vec::new()
    }

    /// Sets a parameter for other nodes (absolute name) or for this one (private name).
    ///
    /// # Errors
    /// If the parameter server cannot be reached.
    fn set_param(&self, name: &str, value: Value) -> Result<()>;

    /// Has `take` decide on every change of this node's parameters while it runs; `now` is what they are. A change that is refused
    /// leaves all as it was. Middlewares whose parameters nobody can set with a reply, such as ROS 1, never ask.
    fn on_params(&self, now: &Params, take: TakeParams) {
        let _ = (now, take);
    }

    /// The time on the clock in use: the system clock, or `/clock` with `use_sim_time`.
    fn now(&self) -> Time;

    /// Time since a fixed moment in the past, on a clock that never stops, jumps or is simulated. For what costs
    /// real time, such as a budget. No recording and no result may depend on it.
    fn steady(&self) -> Duration {
        static START: LazyLock<Instant> = LazyLock::new(Instant::now);
        START.elapsed()
    }

    /// False once the node has to end.
    fn is_ok(&self) -> bool;

    /// Asks the node to end: [`Middleware::is_ok`] becomes false, and its inboxes wake up.
    fn shutdown(&self);

    /// Registers a consumer to wake when a simulated clock moves or the node has to end.
    fn attach(&self, consumer: Arc<dyn Consumer>);

    /// Whether nodes act on a new time only when told to, one after the other ([`Consumer::wait_idle`]). Otherwise
    /// they read the clock themselves.
    fn is_lockstep(&self) -> bool {
        false
    }

    /// Whether this node is a future that its middleware polls, on a thread shared with others. It may then wait
    /// only in [`crate::inbox::Inbox::awaited`].
    fn is_task(&self) -> bool {
        false
    }

    /// Whose message types it carries where the ROS versions differ (markers); [`Wires::Both`]: either.
    fn wires(&self) -> Wires {
        Wires::Both
    }

    /// `(topic, package/Name)` of the known topics, for hints such as "topics of that type: ...".
    fn topics(&self) -> Vec<(String, String)>;

    /// Messages lost on the way to this node's subscriptions, by topic, if the middleware can tell.
    fn lost(&self) -> Vec<(String, u64)> {
        Vec::new()
    }
}

impl Params {
    /// Reads and checks every parameter of `specs`. A parameter that is not set has its default. In a namespace the robot is the one
    /// of that name, and the usual folders are its own (`Params::in_namespace`).
    ///
    /// # Errors
    /// The first parameter that is not allowed, or a parameter server that cannot be reached.
    pub fn read<M: Middleware>(mw: &M, specs: &[ParamSpec]) -> Result<Self> {
        let mut values = BTreeMap::new();
        for spec in specs {
            let value = match mw.param(spec)? {
                Some(value) => spec.checked(value)?,
                None => spec.default.clone(),
            };
            values.insert(spec.name, value);
        }
        for (name, near) in unknown(&mw.params_set(), specs) {
            let hint = near.map_or(String::new(), |near| format!("; did you mean '{near}'?"));
            tracing::warn!("{}: there is no parameter '{name}'{hint}", mw.node_name());
        }
        Ok(Self { values }.in_namespace(namespace_of(&mw.node_name()), specs))
    }

    /// What follows from the node's namespace where nothing is set: with several robots each has its own topics, batches and model.
    fn in_namespace(mut self, namespace: &str, specs: &[ParamSpec]) -> Self {
        let name = namespace.trim_start_matches('/');
        for spec in specs.iter().filter(|_| !name.is_empty()) {
            let Value::Str(default) = &spec.default else { continue };
            let its_own = match (spec.name, default.strip_prefix("~/roscausal/")) {
                ("robot", _) => name.to_owned(),
                (_, Some(folder)) => format!("~/roscausal/{name}/{folder}"),
                _ => continue,
            };
            if let Some(value) = self.values.get_mut(spec.name).filter(|value| **value == spec.default) {
                *value = Value::Str(its_own);
            }
        }
        self
    }
}

/// The namespace of a node with this full name, such as `/r1`; empty: the root.
pub fn namespace_of(node: &str) -> &str {
    node.rfind('/').map_or("", |end| &node[..end])
}

/// The names that no specification has, each with the nearest existing name.
fn unknown<'a>(set: &'a [String], specs: &[ParamSpec]) -> Vec<(&'a str, Option<String>)> {
    let names: Vec<&str> = specs.iter().map(|spec| spec.name).collect();
    let known = |name: &&String| names.contains(&name.as_str()) || name.as_str() == "use_sim_time";
    let near = |name: &str| nearest(&names, name).map(str::to_owned);
    set.iter().filter(|name| !known(name)).map(|name| (name.as_str(), near(name))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{loopback::Loopback, params::Allowed};

    #[test]
    fn a_node_in_a_namespace_is_of_the_robot_of_that_name_and_has_its_own_folders() {
        let specs = ["robot", "data_dir", "frame"].map(|name| {
            let default = if name == "data_dir" { "~/roscausal/data_pool" } else { "" };
            ParamSpec::new(name, Value::Str(default.into()), Allowed::Any, "")
        });
        let of = |node: &str, set: &[(&str, &str)]| {
            let bus = Loopback::lockstep();
            set.iter().for_each(|(name, value)| bus.set_node_param(node, name, Value::Str((*value).into())));
            let params = Params::read(&bus.node(node), &specs).expect("are allowed");
            [params.text("robot"), params.text("data_dir"), params.text("frame")]
        };
        assert_eq!(of("data", &[]), ["", "~/roscausal/data_pool", ""]);
        assert_eq!(of("r1/data", &[]), ["r1", "~/roscausal/r1/data_pool", ""]);
        assert_eq!(of("r1/data", &[("robot", "r2"), ("data_dir", "/x")]), ["r2", "/x", ""]);
        assert_eq!((namespace_of("/a/b/data"), namespace_of("/data")), ("/a/b", ""));
    }

    #[test]
    fn a_parameter_that_no_node_has_is_told_with_the_nearest_that_there_is() {
        let bus = Loopback::lockstep();
        for name in ["dt", "safe_dits", "use_sim_time"] {
            bus.set_node_param("data", name, Value::Double(1.0));
        }
        bus.set_node_param("database", "x", Value::Double(1.0));
        let specs = ["dt", "safe_dist", "obs_size"]
            .map(|name| ParamSpec::new(name, Value::Double(0.1), Allowed::Any, ""));
        let set = bus.node("data").params_set();
        assert_eq!(unknown(&set, &specs), [("safe_dits", Some("safe_dist".into()))]);
    }
}
