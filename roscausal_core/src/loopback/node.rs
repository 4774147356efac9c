//! A node on the loopback bus: the implementation of `Middleware`, and a node that runs as a task.

use std::{
    sync::{
        Arc, Mutex, Weak,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use roscausal_msgs::Service;

use super::{
    Bus, Loopback, LoopbackPublisher, LoopbackServer, LoopbackSubscription, Member, services, task::Task,
    topics,
};
use crate::{
    Error, Message, Result, Time,
    gate::lock,
    middleware::{Answers, Consumer, Middleware, On, Qos, Raw, is_token, namespace_of},
    params::{ParamSpec, Params, TakeParams, Value},
};

/// One node's connection to a [`Loopback`].
#[derive(Clone)]
pub struct LoopbackNode {
    bus: Arc<Bus>,
    name: Arc<str>,
    alive: Arc<AtomicBool>,
    /// The task that polls it, if it runs as a task.
    task: Option<Weak<Task>>,
}

impl LoopbackNode {
    pub(super) fn new(bus: Arc<Bus>, name: &str) -> Self {
        let name = format!("/{}", name.trim_matches('/')).into();
        Self { bus, name, alive: Arc::new(AtomicBool::new(true)), task: None }
    }

    /// The same node, run by `task`.
    pub(super) fn run_by(self, task: &Arc<Task>) -> Self {
        Self { task: Some(Arc::downgrade(task)), ..self }
    }

    pub(super) fn alive(&self) -> Weak<AtomicBool> {
        Arc::downgrade(&self.alive)
    }

    /// The bus this node is on.
    pub fn bus(&self) -> Loopback {
        Loopback { bus: self.bus.clone() }
    }

    fn resolve(&self, topic: &str) -> Result<String> {
        let name = match topic.strip_prefix('~') {
            Some(private) => format!("{}/{}", self.name, private.strip_prefix('/').unwrap_or(private)),
            None if topic.starts_with('/') => topic.to_owned(),
            None => format!("{}/{topic}", namespace_of(&self.name)),
        };
        if name.split('/').skip(1).all(is_token) {
            return Ok(name);
        }
        let reason =
            "not a legal name: use letters, digits, '_' and single '/', no digit after a '/'".to_owned();
        Err(Error::Topic { topic: topic.to_owned(), reason })
    }

    /// Sends a message of any type to those who listen for bytes ([`Middleware::listen`]).
    ///
    /// # Errors
    /// An illegal name.
    pub fn publish_raw(&self, topic: &str, message: Raw) -> Result<()> {
        topics::publish_raw(&self.bus, &self.resolve(topic)?, message);
        Ok(())
    }

    fn param_key(&self, name: &str) -> String {
        if name.starts_with('/') { name.to_owned() } else { format!("{}/{name}", self.name) }
    }
}

impl Middleware for LoopbackNode {
    type Publisher<M: Message> = LoopbackPublisher<M>;
    type Subscription = LoopbackSubscription;
    type Server = LoopbackServer;

    fn node_name(&self) -> String {
        self.name.to_string()
    }

    fn advertise<M: Message>(&self, topic: &str, qos: Qos) -> Result<Self::Publisher<M>> {
        LoopbackPublisher::new(&self.bus, self.resolve(topic)?, qos)
    }

    fn subscribe<M: Message>(&self, topic: &str, _: Qos, callback: impl On<M>) -> Result<Self::Subscription> {
        LoopbackSubscription::new(&self.bus, self.resolve(topic)?, callback)
    }

    fn listen(&self, topic: &str, callback: impl On<Raw>) -> Result<Self::Subscription> {
        Ok(LoopbackSubscription::listen(&self.bus, self.resolve(topic)?, callback))
    }

    fn serve<S: Service>(&self, name: &str, callback: impl Answers<S>) -> Result<LoopbackServer> {
        LoopbackServer::new::<S>(&self.bus, self.resolve(name)?, callback)
    }

    fn call<S: Service>(&self, name: &str, request: &S::Request, patience: Duration) -> Result<S::Response> {
        services::call::<S>(&self.bus, self.resolve(name)?, request, patience)
    }

    fn param(&self, spec: &ParamSpec) -> Result<Option<Value>> {
        Ok(self.bus.lock().params.get(&self.param_key(spec.name)).cloned())
    }

    fn params_set(&self) -> Vec<String> {
        let prefix = format!("{}/", self.name);
        let state = self.bus.lock();
        let own = state.params.keys().filter_map(|name| name.strip_prefix(&prefix));
        own.map(str::to_owned).collect()
    }

    fn set_param(&self, name: &str, value: Value) -> Result<()> {
        self.bus.lock().params.insert(self.param_key(name), value);
        Ok(())
    }

    fn on_params(&self, now: &Params, take: TakeParams) {
        self.bus.lock().watched.insert(self.name.to_string(), (now.clone(), Arc::from(take)));
    }

    fn now(&self) -> Time {
        self.bus.now()
    }

    fn is_ok(&self) -> bool {
        self.alive.load(Ordering::SeqCst)
    }

    fn shutdown(&self) {
        self.bus.end(&self.alive);
    }

    fn attach(&self, consumer: Arc<dyn Consumer>) {
        let (alive, consumer) = (self.alive.clone(), Arc::downgrade(&consumer));
        Arc::make_mut(&mut self.bus.lock().members).push(Member { alive, consumer, task: self.task.clone() });
    }

    fn is_lockstep(&self) -> bool {
        self.bus.lockstep
    }

    fn is_task(&self) -> bool {
        self.task.is_some()
    }

    fn topics(&self) -> Vec<(String, String)> {
        let state = self.bus.lock();
        let published = state.topics.iter().filter(|(_, topic)| topic.publishers > 0);
        published.map(|(name, topic)| (name.clone(), topic.type_name.clone())).collect()
    }
}

/// A node started by [`super::Loopback::start_task`].
pub struct LoopbackTask<T> {
    node: LoopbackNode,
    task: Arc<Task>,
    result: Arc<Mutex<Option<T>>>,
}

impl<T: Send + 'static> LoopbackTask<T> {
    pub(super) fn new(
        node: LoopbackNode,
        task: Arc<Task>,
        run: impl Future<Output = T> + Send + 'static,
    ) -> Self {
        let result = Arc::new(Mutex::new(None));
        let its_own = result.clone();
        *lock(&task.future) = Some(Box::pin(async move {
            let ended = run.await;
            *lock(&its_own) = Some(ended);
        }));
        Self { node, task, result }
    }

    pub(super) fn poll(&self) {
        self.task.poll();
    }

    /// Whether the node has ended.
    pub fn is_finished(&self) -> bool {
        lock(&self.task.future).is_none()
    }

    /// Asks the node to end, delivers its last messages, and returns its result.
    ///
    /// # Errors
    /// The panic of the node.
    pub fn end(self) -> thread::Result<T> {
        self.node.shutdown();
        self.node.bus().settle();
        if let Some(panic) = lock(&self.task.panic).take() {
            return Err(panic);
        }
        let result = lock(&self.result).take();
        result.ok_or_else(|| Box::new("the node did not end: it waits for more than its inbox") as _)
    }
}
