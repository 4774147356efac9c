//! ROS 1 backend: ROS-Causal's [`Middleware`] on a ROS master, over rosrust.
//!
//! rosrust implements the wire protocol (TCPROS, the node's XML-RPC server). This crate adds what rosrust leaves
//! open: deadlines for every call, sockets that send at once, registration after a restart of the master,
//! unregistration on every way out, simulated time that may start late, stop or jump back, a count of lost messages,
//! and a decoder that survives any bytes.

mod feed;
mod master;
mod nodelay;
mod pace;
mod program;
mod service;
mod session;
mod subscription;
mod wire;

use std::sync::{Arc, Mutex, Weak, atomic::Ordering};
use std::{collections::BTreeMap, time::Duration};

use roscausal_core::middleware::{Answers, Middleware, On, Publish, Qos, Raw, is_graph_name};
use roscausal_core::params::{ParamSpec, Value};
use roscausal_core::{Error, Message, Result, Time, inbox::Consumer};
use roscausal_msgs::{Service, rosgraph_msgs::Clock};
use roscausal_ros::{Console, in_time, lock};

pub use service::Server;
pub use subscription::Subscription;

use crate::feed::Feed;
use crate::master::{Master, Role};
use crate::session::{Session, reason};
use crate::subscription::{Handler, Listener};
use crate::wire::{ANY, AnyWire, Wire};

/// Time-out for calls of rosrust that a healthy master answers in milliseconds.
pub(crate) const PATIENCE: Duration = Duration::from_secs(3);
/// Least messages that a latched publisher keeps for slow connections.
const LATCHED_QUEUE: usize = 10;
/// Messages of any type that may wait.
const LISTEN_QUEUE: usize = 1000;

/// A node on a ROS master. Cheap to clone; all clones are the same node.
#[derive(Clone)]
pub struct Ros1 {
    session: Arc<Session>,
}

impl Ros1 {
    /// Joins the master at `__master:=` or `ROS_MASTER_URI` under this name (or that of `__name:=`), with the
    /// remappings and parameters of the command line. While no master answers, it waits as long as `keep_waiting`
    /// returns true, and logs what it waits for.
    ///
    /// # Errors
    /// No master, or an illegal name or argument.
    pub fn connect(name: &str, keep_waiting: &dyn Fn() -> bool) -> Result<Self> {
        let this = Self { session: Session::connect(name, keep_waiting)? };
        // rosrust's own simulated clock is not used: its waits never end if /clock stops or jumps back.
        if this.session.clock.is_simulated() {
            let session = Arc::downgrade(&this.session);
            let tick = move |message: Clock| {
                if let Some(session) = session.upgrade() {
                    session.clock.tick(message.clock);
                    session.life.wake();
                }
            };
            let _ = this.session.clock_subscription.set(this.subscribe("/clock", Qos::Volatile(1), tick)?);
        }
        Ok(this)
    }

    /// Also sends log messages to `/rosout`, for as long as the node lives.
    ///
    /// # Errors
    /// If the topic cannot be created.
    pub fn log_with(&self, console: &Console) -> Result<()> {
        console.name(&self.node_name());
        let _ = self.session.rosout.set(self.advertise("/rosout", Qos::Volatile(100))?);
        let session = Arc::downgrade(&self.session);
        console.forward(move |record| {
            if let Some(session) = session.upgrade() {
                session.log(record);
            }
        });
        Ok(())
    }

    /// Unregisters everything, so that no dead entry of this node stays on the master. Dropping the last clone does
    /// the same; this method is for ways out on which nothing is dropped.
    pub fn close(&self) {
        self.session.close();
    }

    fn topic(&self, name: &str) -> Result<String> {
        // rosrust itself accepts more
        let resolved = if is_graph_name(name) { self.session.resolve(name) } else { None };
        let reason = "not a legal name: letters, digits and '_' between single '/', beginning with a letter";
        resolved.ok_or_else(|| Error::Topic { topic: name.to_owned(), reason: reason.to_owned() })
    }

    /// Subscribes with rosrust's handler.
    fn take_part<T: rosrust::Message, H: rosrust::SubscriptionHandler<T>>(
        &self,
        topic: &str,
        queue: usize,
        feed: Arc<Feed>,
        type_name: String,
        handler: H,
    ) -> Result<Subscription> {
        let name = feed.topic.clone();
        self.session.add_feed(&feed);
        let id = self.session.membership.keep(Role::Subscriber, &name, type_name);
        let slot = Arc::new(Mutex::new(None));
        let (session, topic) = (self.session.clone(), topic.to_owned());
        let (own_feed, own_slot) = (feed.clone(), slot.clone());
        let work = move || {
            let subscriber = session.ros.subscribe_with::<T, _>(&topic, queue, handler);
            let mut slot = lock(&own_slot);
            *slot =
                subscriber.map(|it| own_feed.gate.is_open().then_some(it)).map_err(|error| reason(&error))?;
            Ok(())
        };
        match in_time(PATIENCE, work) {
            Some(Ok(())) => {}
            Some(Err(reason)) => {
                self.session.membership.forget(id);
                return Err(Error::Topic { topic: name, reason });
            }
            None => tracing::warn!("topic '{name}': a publisher does not answer; messages come when it does"),
        }
        Ok(Subscription { membership: Arc::downgrade(&self.session.membership), feed, id, slot })
    }

    fn service_name(&self, name: &str) -> Result<String> {
        self.topic(name).map_err(|error| match error {
            Error::Topic { topic, reason } => Error::Service { service: topic, reason },
            other => other,
        })
    }

    fn param_name(&self, name: &str) -> Result<String> {
        let graph_name = if name.starts_with(['/', '~']) { name.to_owned() } else { format!("~{name}") };
        self.session.resolve(&graph_name).ok_or_else(|| Error::param(name, "not a legal name"))
    }
}

impl Middleware for Ros1 {
    type Publisher<M: Message> = Publisher<M>;
    type Subscription = Subscription;
    type Server = Server;

    fn node_name(&self) -> String {
        self.session.membership.node().to_owned()
    }

    fn advertise<M: Message>(&self, topic: &str, qos: Qos) -> Result<Publisher<M>> {
        let name = self.topic(topic)?;
        let id = self.session.membership.keep(Role::Publisher, &name, M::type_name());
        let (session, topic) = (self.session.clone(), topic.to_owned());
        let queue = if let Qos::Volatile(depth) = qos { depth.max(1) } else { LATCHED_QUEUE };
        let work = move || session.ros.publish::<Wire<M>>(&topic, queue).map_err(|error| reason(&error));
        let publisher =
            in_time(PATIENCE, work).unwrap_or_else(|| Err("the ROS master does not answer".to_owned()));
        match publisher {
            Ok(mut publisher) => {
                publisher.set_latching(qos == Qos::Latched);
                nodelay::send_at_once();
                let session = Arc::downgrade(&self.session);
                Ok(Publisher { session, topic: name, id, publisher: Some(publisher) })
            }
            Err(reason) => {
                self.session.membership.forget(id);
                Err(Error::Topic { topic: name, reason })
            }
        }
    }

    fn subscribe<M: Message>(&self, topic: &str, qos: Qos, callback: impl On<M>) -> Result<Subscription> {
        let queue = if let Qos::Volatile(depth) = qos { depth.max(1) } else { LATCHED_QUEUE };
        let feed = Feed::new::<M>(self.topic(topic)?);
        let handler = Handler::new(feed.clone(), callback);
        self.take_part::<Wire<M>, _>(topic, queue, feed, M::type_name(), handler)
    }

    fn listen(&self, topic: &str, callback: impl On<Raw>) -> Result<Subscription> {
        let feed = Feed::of_any_type(self.topic(topic)?);
        let handler = Listener::new(feed.clone(), callback);
        self.take_part::<AnyWire, _>(topic, LISTEN_QUEUE, feed, ANY.to_owned(), handler)
    }

    fn serve<S: Service>(&self, name: &str, callback: impl Answers<S>) -> Result<Server> {
        service::serve::<S>(&self.session, self.service_name(name)?, callback)
    }

    fn call<S: Service>(&self, name: &str, request: &S::Request, patience: Duration) -> Result<S::Response> {
        service::call::<S>(&self.session, &self.service_name(name)?, request, patience)
    }

    fn param(&self, spec: &ParamSpec) -> Result<Option<Value>> {
        let name = self.param_name(spec.name)?;
        self.session.membership.master()?.param(&name)
    }

    fn params_set(&self) -> Vec<String> {
        let names = self.session.membership.master().map(Master::private_params);
        names.unwrap_or_default().into_iter().collect()
    }

    fn set_param(&self, name: &str, value: Value) -> Result<()> {
        let name = self.param_name(name)?;
        self.session.membership.master()?.set_param(&name, &value)
    }

    fn now(&self) -> Time {
        self.session.clock.now()
    }

    fn is_ok(&self) -> bool {
        self.session.is_ok()
    }

    fn shutdown(&self) {
        self.session.life.end();
    }

    fn attach(&self, consumer: Arc<dyn Consumer>) {
        self.session.life.attach(&consumer);
    }

    fn wires(&self) -> roscausal_msgs::Wires {
        roscausal_msgs::Wires::Ros1
    }

    fn topics(&self) -> Vec<(String, String)> {
        self.session.membership.topics()
    }

    /// Counted by the gaps in `header.seq`.
    fn lost(&self) -> Vec<(String, u64)> {
        let mut lost = BTreeMap::<String, u64>::new();
        for feed in self.session.feeds() {
            *lost.entry(feed.topic.clone()).or_default() += feed.lost.load(Ordering::Relaxed);
        }
        lost.into_iter().collect()
    }
}

/// A publisher of a [`Ros1`]. Dropping it unregisters the topic.
pub struct Publisher<M: Message> {
    session: Weak<Session>,
    topic: String,
    id: u64,
    publisher: Option<rosrust::Publisher<Wire<M>>>,
}

impl<M: Message> Publish<M> for Publisher<M> {
    fn publish(&self, message: &M) -> Result<()> {
        let Some(publisher) = &self.publisher else { return Ok(()) };
        publisher
            .send(Wire::new(message.clone()))
            .map_err(|error| Error::Topic { topic: self.topic.clone(), reason: reason(&error) })
    }

    fn subscriber_count(&self) -> usize {
        let mut connected =
            self.publisher.as_ref().map(rosrust::Publisher::subscriber_names).unwrap_or_default();
        // rosrust notices that a subscriber has gone only when it sends a later message
        if !connected.is_empty()
            && let Some(session) = self.session.upgrade()
            && let Some(registered) = session.membership.subscribers(&self.topic)
        {
            connected.retain(|name| registered.contains(name));
        }
        connected.len()
    }
}

impl<M: Message> Drop for Publisher<M> {
    fn drop(&mut self) {
        let publisher = self.publisher.take();
        in_time(PATIENCE, move || drop(publisher));
        if let Some(session) = self.session.upgrade() {
            session.membership.forget(self.id);
        }
    }
}
