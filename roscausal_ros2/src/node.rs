//! A node on a ROS 2 network.

use std::{
    collections::HashMap,
    net::{IpAddr, Ipv4Addr},
    sync::{
        Arc, Mutex, OnceLock, Weak,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use ros2_client::{
    Context, MessageTypeName, Name, NodeName, NodeOptions, entities_info::ParticipantEntitiesInfo,
};
use roscausal_core::{
    Error, Message, Result, Time,
    inbox::Consumer,
    middleware::{Middleware, Qos},
    params::{ParamSpec, Value},
};
use roscausal_msgs::rosgraph_msgs;
use roscausal_ros::{Clock, Life, lock, steady};
use rustdds::{DomainParticipantBuilder, RTPSEntity, Topic, TopicKind};
use tracing::{debug, error};

use crate::{
    args::{Args, Network},
    farewell,
    graph::{Graph, published_topics},
    names::Names,
    parameters::{Parameters, USE_SIM_TIME, ros2_name},
    services::{self, ParameterEvents},
    spinner::Spinner,
    topics::{self, Ros2Publisher, Ros2Subscription, Writer},
};

/// One node on a ROS 2 network. Cheap to clone; the clones are one node, which leaves the graph with the last.
#[derive(Clone)]
pub struct Ros2 {
    inner: Arc<Inner>,
}

pub(crate) struct Inner {
    pub(crate) names: Names,
    network: Network,
    pub(crate) graph: Arc<Graph>,
    pub(crate) spinner: Spinner,
    pub(crate) parameters: Arc<Parameters>,
    pub(crate) parameter_events: ParameterEvents,
    /// What it sends may be encrypted.
    pub(crate) secured: bool,
    /// `None` once the node has left the graph.
    session: Mutex<Option<Session>>,
    /// Type of each topic that this node uses.
    types: Mutex<HashMap<String, String>>,
    pub(crate) clock: Clock,
    life: Life,
    clock_subscription: Mutex<Option<Ros2Subscription>>,
    announcer: Mutex<Option<Writer<ParticipantEntitiesInfo>>>,
    leaving: Mutex<()>,
    failed: AtomicBool,
}

/// The library's handles, in the order in which they are dropped.
pub(crate) struct Session {
    pub(crate) node: ros2_client::Node,
    pub(crate) context: Context,
}

/// Between two looks at the clock; and how long after its start a node announces itself once more.
const WATCH_PERIOD: Duration = Duration::from_secs(1);
/// How long a node that leaves waits for the others to hear of it.
const FAREWELL: Duration = Duration::from_millis(150);

fn middleware(what: &str, reason: impl std::fmt::Display) -> Error {
    Error::Middleware(format!("{what}: {reason}"))
}

impl Ros2 {
    /// Joins the graph as one node.
    ///
    /// # Errors
    /// When the network cannot be used, or `use_sim_time` was given something else than a boolean.
    pub fn start(args: &Args) -> Result<Self> {
        let mut builder = DomainParticipantBuilder::new(args.network.domain_id);
        if args.network.localhost_only {
            builder = builder.with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)]);
        }
        let domain = format!("cannot join DDS domain {}", args.network.domain_id);
        builder = secured(builder, args);
        let participant = builder.build().map_err(|error| match &args.enclave {
            Some(enclave) => Error::file(enclave.folder(), format!("{domain} with this enclave: {error}")),
            None => middleware(&domain, error),
        })?;
        let context =
            Context::from_domain_participant(participant).map_err(|error| middleware(&domain, error))?;
        let names = args.names.clone();
        let name =
            NodeName::new(names.namespace(), names.node()).map_err(|error| middleware("node name", error))?;
        // Its parameter store knows no descriptions and its /rosout history grows for ever: both are ours.
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let mut node =
            context.new_node(name, options).map_err(|error| middleware("cannot make the node", error))?;
        let parameters = Arc::new(Parameters::new(args.overrides.clone()));
        let parameter_events = ParameterEvents::new(&context, &mut node)?;
        let owner = Arc::new(OnceLock::new());
        let spinner = Spinner::start(fail_on_panic(owner.clone()));
        let spinner = spinner.map_err(|error| middleware("cannot start a thread", error))?;
        let inner = Arc::new(Inner {
            graph: Arc::default(),
            spinner,
            names,
            network: args.network,
            parameters,
            parameter_events,
            secured: args.enclave.is_some(),
            session: Mutex::new(Some(Session { node, context: context.clone() })),
            types: Mutex::default(),
            clock: Clock::default(),
            life: Life::default(),
            clock_subscription: Mutex::default(),
            announcer: Mutex::default(),
            leaving: Mutex::default(),
            failed: AtomicBool::new(false),
        });
        let _ = owner.set(Arc::downgrade(&inner));
        let graph = inner.graph.clone();
        inner.spinner.spawn("discovery".into(), move || async move { graph.watch(context).await });
        services::serve(&inner)?;
        let this = Self { inner };
        let sim_time = this.param(&USE_SIM_TIME)? == Some(Value::Bool(true));
        this.inner.use_sim_time(sim_time)?;
        this.watch();
        Ok(this)
    }

    /// Leaves the graph at once, whatever the node is still doing; publishing then fails.
    pub fn leave(&self) {
        self.inner.leave();
    }

    /// Ends the node as failed: what it stands on has broken.
    pub fn fail(&self, reason: &str) {
        self.inner.fail(reason);
    }

    /// True when the node ends because something broke, so that whoever started it should start it again.
    pub fn failed(&self) -> bool {
        self.inner.failed.load(Ordering::SeqCst)
    }

    pub(crate) fn inner(&self) -> &Arc<Inner> {
        &self.inner
    }

    /// Announces the node again once it has started, then looks after the clock until it has left.
    fn watch(&self) {
        let inner = Arc::downgrade(&self.inner);
        let mut announced = false;
        let watch = move || loop {
            thread::sleep(WATCH_PERIOD);
            let Some(node) = inner.upgrade().filter(|node| node.life.goes_on()) else { return };
            if !std::mem::replace(&mut announced, true)
                && let Err(error) = node.announce_again()
            {
                debug!("{error}");
            }
            node.clock.watch();
        };
        // Without that thread only these are missing.
        let _ = thread::Builder::new().name("ros2 watch".into()).spawn(watch);
    }
}

/// With the enclave's files, when the node has an enclave.
#[cfg(feature = "security")]
fn secured(builder: DomainParticipantBuilder, args: &Args) -> DomainParticipantBuilder {
    let Some(enclave) = &args.enclave else { return builder };
    // SROS2's keys have no password.
    let files = rustdds::DomainParticipantSecurityConfigFiles::with_ros_default_names(
        enclave.folder(),
        String::new(),
    );
    builder.builtin_security(files)
}

/// Without DDS Security no enclave is ever found.
#[cfg(not(feature = "security"))]
fn secured(builder: DomainParticipantBuilder, _args: &Args) -> DomainParticipantBuilder {
    builder
}

fn fail_on_panic(owner: Arc<OnceLock<Weak<Inner>>>) -> impl Fn(String) + Send + 'static {
    move |task| {
        if let Some(inner) = owner.get().and_then(Weak::upgrade) {
            inner.fail(&format!("the handling of {task} broke off"));
        }
    }
}

impl Inner {
    /// Does something with the library's handles.
    ///
    /// # Errors
    /// When the node has left the graph.
    pub(crate) fn session<T>(&self, work: impl FnOnce(&mut Session) -> T) -> Result<T> {
        let mut session = lock(&self.session);
        session.as_mut().map(work).ok_or_else(|| Error::Middleware("the node has left the graph".into()))
    }

    /// Whether a publisher may be made anew: the library's security knows one of each topic and node. There, who comes
    /// late may get what was sent before the last message, too.
    pub(crate) fn renews(&self) -> bool {
        !self.secured
    }

    /// The DDS topic behind an absolute name; refuses a second type for the same name.
    pub(crate) fn topic<M: Message>(&self, name: &str, qos: Qos) -> Result<Topic> {
        let wanted = M::type_name();
        let reason = {
            let mut types = lock(&self.types);
            let known = types.entry(name.to_owned()).or_insert_with(|| wanted.clone());
            (*known != wanted).then(|| format!("it carries {known}, not {wanted}; check the topic's name"))
        };
        let fail = |reason| Error::Topic { topic: name.to_owned(), reason };
        if let Some(reason) = reason {
            return Err(fail(reason));
        }
        let dds_name = Name::parse(name).map_err(|error| fail(error.to_string()))?;
        let kind = MessageTypeName::new(M::PACKAGE, M::NAME);
        let profile = topics::profile(qos, topics::Side::Publisher);
        let topic = self.session(|session| session.node.create_topic(&dds_name, kind, &profile))?;
        topic.map_err(|error| fail(error.to_string()))
    }

    /// Announces the node's name and endpoints through a publisher of its own as well. The library's is the first
    /// endpoint that others discover; when several nodes start at once, Fast DDS sometimes never matches it, and
    /// the node is not listed by whoever was there before.
    ///
    /// The library's security knows one publisher of each topic and node: there it stays at the library's.
    fn announce_again(&self) -> Result<()> {
        if self.secured {
            return Ok(());
        }
        use ros2_client::builtin_topics::ros_discovery::{QOS_PUB, TOPIC_NAME, TYPE_NAME};
        let (name, kind) = (TOPIC_NAME.to_owned(), TYPE_NAME.to_owned());
        let topic = self.session(|session| {
            session.context.domain_participant().create_topic(name, kind, &QOS_PUB, TopicKind::NoKey)
        })?;
        let topic = topic.map_err(|error| middleware("announcement", error))?;
        let profile = topics::profile(Qos::Latched, topics::Side::Publisher);
        let writer = Writer::new(self, topic, profile, usize::MAX)?;
        *lock(&self.announcer) = Some(writer);
        self.announce();
        Ok(())
    }

    /// Tells others of this node's endpoints of now, if it announces itself.
    pub(crate) fn announce(&self) {
        let mut announcer = lock(&self.announcer);
        let Some(announcer) = announcer.as_mut() else { return };
        if let Ok(info) = self.session(|session| session.context.participant_entities_info()) {
            // One that is not taken is followed by the next.
            let _ = announcer.write(self, info);
        }
    }

    fn use_sim_time(self: &Arc<Self>, on: bool) -> Result<()> {
        self.clock.simulate(on);
        let mut subscription = lock(&self.clock_subscription);
        if !on {
            *subscription = None;
        } else if subscription.is_none() {
            let inner = Arc::downgrade(self);
            let tick = move |message: rosgraph_msgs::Clock| {
                if let Some(inner) = inner.upgrade() {
                    inner.clock.tick(message.clock);
                    inner.life.wake();
                }
            };
            *subscription = Some(topics::subscribe(self, "/clock", Qos::Volatile(10), tick)?);
        }
        Ok(())
    }

    /// Called for each parameter set from outside.
    pub(crate) fn parameter_set(self: &Arc<Self>, name: &str, value: &Value) {
        if name == USE_SIM_TIME.name
            && let Err(error) = self.use_sim_time(*value == Value::Bool(true))
        {
            error!("{error}");
        }
    }

    fn fail(&self, reason: &str) {
        error!("{reason}; the node ends, to be started again");
        self.failed.store(true, Ordering::SeqCst);
        self.life.end();
    }

    fn leave(&self) {
        // Whoever comes second waits for the first: a program that ended meanwhile would stay listed.
        let _leaving = lock(&self.leaving);
        self.life.end();
        drop(lock(&self.clock_subscription).take());
        self.spinner.stop();
        let session = lock(&self.session).take();
        if let Some(Session { node, context }) = session {
            drop(node);
            let mut announcer = lock(&self.announcer).take();
            if let Some(announcer) = &mut announcer {
                let _ = announcer.write(self, context.participant_entities_info());
            }
            // Whoever is just discovering this node must hear that it has gone before its participant does, or
            // lists it for ever.
            thread::sleep(FAREWELL);
            let participant = context.domain_participant().guid().to_bytes();
            drop((announcer, context));
            farewell::send(participant, self.network);
        }
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        self.leave();
    }
}

impl Middleware for Ros2 {
    type Publisher<M: Message> = Ros2Publisher<M>;
    type Subscription = Ros2Subscription;

    fn node_name(&self) -> String {
        self.inner.names.full_name()
    }

    fn advertise<M: Message>(&self, topic: &str, qos: Qos) -> Result<Self::Publisher<M>> {
        Ros2Publisher::new(&self.inner, topic, qos)
    }

    fn subscribe<M: Message>(
        &self,
        topic: &str,
        qos: Qos,
        callback: impl FnMut(M) + Send + 'static,
    ) -> Result<Self::Subscription> {
        topics::subscribe(&self.inner, topic, qos, callback)
    }

    fn param(&self, spec: &ParamSpec) -> Result<Option<Value>> {
        let (value, new) = self.inner.parameters.declare(spec)?;
        if new {
            self.inner.parameter_events.announce(&self.inner, &[&ros2_name(spec.name)], true);
        }
        Ok(value)
    }

    fn params_set(&self) -> Vec<String> {
        self.inner.parameters.given()
    }

    fn set_param(&self, name: &str, value: Value) -> Result<()> {
        self.inner.parameters.put(name, value);
        self.inner.parameter_events.announce(&self.inner, &[&ros2_name(name)], false);
        Ok(())
    }

    fn now(&self) -> Time {
        self.inner.clock.now()
    }

    fn steady(&self) -> Duration {
        steady()
    }

    fn is_ok(&self) -> bool {
        self.inner.life.goes_on()
    }

    fn shutdown(&self) {
        self.inner.life.end();
    }

    fn attach(&self, consumer: Arc<dyn Consumer>) {
        self.inner.life.attach(&consumer);
    }

    fn wires(&self) -> roscausal_msgs::Wires {
        roscausal_msgs::Wires::Ros2
    }

    fn topics(&self) -> Vec<(String, String)> {
        self.inner.session(|session| published_topics(&session.context)).unwrap_or_default()
    }
}
