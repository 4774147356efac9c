//! The node: its start, and the middleware trait.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, Weak};
use std::{thread, time::Duration};

use roscausal_core::middleware::{Answers, Middleware, On, Qos, Raw};
use roscausal_core::params::{ParamSpec, Params, TakeParams, Value};
use roscausal_core::{Message, Result, Time, inbox::Consumer};
use roscausal_msgs::Service;
use roscausal_ros::{Clock, Life};
use tracing::{debug, error};

use crate::dds::{Participant, Publisher, Server, Subscription};
use crate::rcl::{Parameters, USE_SIM_TIME, ros2_name};
use crate::{args::Args, inner::Inner, services};

/// A node on a ROS 2 network. Cheap to clone; all clones are the same node. It leaves the graph when the last clone
/// is dropped.
#[derive(Clone)]
pub struct Ros2 {
    pub(crate) inner: Arc<Inner>,
}

/// The message for a DDS library that does not answer.
pub(crate) const HANGS: &str = "the DDS library hangs";
/// Time between two checks of the clock. Also the time after its start at which a node announces itself again.
const WATCH_PERIOD: Duration = Duration::from_secs(1);

impl Ros2 {
    /// Joins the graph.
    ///
    /// # Errors
    /// If the network cannot be used, or `use_sim_time` is not a boolean.
    pub fn start(args: &Args) -> Result<Self> {
        Self::start_watched(args, || error!("{HANGS}"))
    }

    /// Like [`Ros2::start`], but `on_hang` is called if the DDS library deadlocks. That may happen while the node
    /// is still starting. Then this function never returns, and no other call to the node may.
    ///
    /// # Errors
    /// As [`Ros2::start`].
    pub fn start_watched(args: &Args, on_hang: impl FnOnce() + Send + 'static) -> Result<Self> {
        let owner = Arc::new(OnceLock::<Weak<Inner>>::new());
        let its_owner = owner.clone();
        let on_panic = move |task: String| {
            if let Some(inner) = its_owner.get().and_then(Weak::upgrade) {
                inner.fail(&format!("the handling of {task} broke off"));
            }
        };
        let enclave = args.enclave.as_ref();
        let participant = Participant::join(&args.names, args.network, enclave, on_panic, on_hang)?;
        let inner = Arc::new(Inner {
            parameter_events: Mutex::new(participant.parameter_events()?),
            participant,
            parameters: Parameters::new(args.overrides.clone()),
            clock: Clock::default(),
            life: Life::default(),
            clock_subscription: Mutex::default(),
            failed: AtomicBool::new(false),
        });
        let _ = owner.set(Arc::downgrade(&inner));
        services::serve(&inner)?;
        let this = Self { inner };
        this.inner.use_sim_time(this.param(&USE_SIM_TIME)? == Some(Value::Bool(true)))?;
        this.watch();
        Ok(this)
    }

    /// Leaves the graph at once, whatever the node is doing. Publishing then fails.
    pub fn leave(&self) {
        self.inner.leave();
    }

    /// Ends the node as failed, because the library under it has failed.
    pub fn fail(&self, reason: &str) {
        self.inner.fail(reason);
    }

    /// Whether the node ends because something failed, so that it should be started again.
    pub fn failed(&self) -> bool {
        self.inner.failed.load(Ordering::SeqCst)
    }

    /// Announces the node again shortly after its start, then watches the clock until the node has left.
    fn watch(&self) {
        let inner = Arc::downgrade(&self.inner);
        let mut announced = false;
        let watch = move || loop {
            thread::sleep(WATCH_PERIOD);
            let Some(node) = inner.upgrade().filter(|node| node.life.goes_on()) else { return };
            if !std::mem::replace(&mut announced, true)
                && let Err(error) = node.participant.announce_again()
            {
                debug!("{error}");
            }
            node.clock.watch();
        };
        // Without that thread only these two are missing.
        let _ = thread::Builder::new().name("ros2 watch".into()).spawn(watch);
    }
}

impl Middleware for Ros2 {
    type Publisher<M: Message> = Publisher<M>;
    type Subscription = Subscription;
    type Server = Server;

    fn node_name(&self) -> String {
        self.inner.participant.names.full_name()
    }

    fn advertise<M: Message>(&self, topic: &str, qos: Qos) -> Result<Self::Publisher<M>> {
        self.inner.participant.advertise(topic, qos)
    }

    fn subscribe<M: Message>(&self, topic: &str, qos: Qos, callback: impl On<M>) -> Result<Subscription> {
        self.inner.participant.subscribe(topic, qos, callback)
    }

    fn listen(&self, topic: &str, callback: impl On<Raw>) -> Result<Subscription> {
        self.inner.participant.listen(topic, callback)
    }

    fn serve<S: Service>(&self, name: &str, callback: impl Answers<S>) -> Result<Server> {
        self.inner.participant.serve::<S>(name, callback)
    }

    fn call<S: Service>(&self, name: &str, request: &S::Request, patience: Duration) -> Result<S::Response> {
        self.inner.participant.call::<S>(name, request, patience)
    }

    fn param(&self, spec: &ParamSpec) -> Result<Option<Value>> {
        let (value, new) = self.inner.parameters.declare(spec)?;
        if new {
            self.inner.announce(&[&ros2_name(spec.name)], true);
        }
        Ok(value)
    }

    fn params_set(&self) -> Vec<String> {
        self.inner.parameters.given()
    }

    fn set_param(&self, name: &str, value: Value) -> Result<()> {
        self.inner.parameters.put(name, value);
        self.inner.announce(&[&ros2_name(name)], false);
        Ok(())
    }

    fn on_params(&self, now: &Params, take: TakeParams) {
        self.inner.parameters.watch(now, take);
    }

    fn now(&self) -> Time {
        self.inner.clock.now()
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
        self.inner.participant.topics()
    }
}
