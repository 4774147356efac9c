//! One node's life on a master: joining, staying registered, leaving without a ghost.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Condvar, Mutex, OnceLock, PoisonError, Weak,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

use roscausal_core::{Error, Result, middleware::Publish, params::Value};
use roscausal_msgs::{rosgraph_msgs::Log, std_msgs::Header};
use roscausal_ros::{Clock, Life, console::Record, lock};
use rosrust::api::{Ros, resolve};
use tracing::Level;

use crate::{
    Publisher, Subscription,
    master::{Master, Role, Subscribers},
    subscription::Feed,
};

/// How long rosrust may take for what a healthy master answers in milliseconds.
pub(crate) const PATIENCE: Duration = Duration::from_secs(3);
/// Between two looks at the master.
const WATCH_PERIOD: Duration = Duration::from_secs(1);

/// A registration that must outlive a restart of the master.
struct Registration {
    id: u64,
    role: Role,
    topic: String,
    type_name: String,
    feed: Option<Arc<Feed>>,
}

/// What the clones of a [`crate::Ros1`] share.
pub(crate) struct Session {
    /// Never dropped: its threads outlive it in any case, and its drop would ask the master without deadline.
    pub(crate) ros: &'static Ros,
    pub(crate) master: Master,
    pub(crate) clock: Clock,
    pub(crate) life: Life,
    next_id: AtomicU64,
    registrations: Mutex<Vec<Registration>>,
    pub(crate) rosout: OnceLock<Publisher<Log>>,
    pub(crate) clock_subscription: OnceLock<Subscription>,
    /// Who subscribes to what, as the master said at that time; `None` once a master was lost, because others
    /// than us do not register again.
    subscribers: Mutex<Option<(Option<Instant>, Subscribers)>>,
    /// The master does not answer; asking it again is the watchdog's part.
    lost: AtomicBool,
    /// Set and told once it has closed.
    closed: Arc<(Mutex<bool>, Condvar)>,
}

/// rosrust's error with its causes, as one line.
pub(crate) fn reason(error: &rosrust::error::Error) -> String {
    error.iter().map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

/// Runs what may block for ever (rosrust asks masters and nodes without deadline) beside this thread. `None`
/// when it is not done in time; its result is then dropped whenever it comes.
pub(crate) fn in_time<T: Send + 'static>(
    patience: Duration,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    let (sender, receiver) = mpsc::channel();
    let work = move || {
        // a panic inside rosrust drops the sender, which reads as "not done"
        let _ = catch_unwind(AssertUnwindSafe(|| sender.send(work())));
    };
    thread::Builder::new().name("ros1-worker".to_owned()).spawn(work).ok()?;
    receiver.recv_timeout(patience).ok()
}

impl Session {
    /// Joins the master named by `__master:=` or `ROS_MASTER_URI`, and waits for it as long as `keep_waiting`.
    pub(crate) fn connect(name: &str, keep_waiting: &dyn Fn() -> bool) -> Result<Arc<Self>> {
        let uri = resolve::master();
        let asking = Master { uri: uri.clone(), node: format!("/{name}"), node_uri: String::new() };
        wait_for(&asking, keep_waiting)?;
        let simulated =
            match asking.param("/use_sim_time").map_err(|error| Error::Middleware(error.to_string()))? {
                Some(Value::Bool(simulated)) => simulated,
                Some(Value::Str(text)) => text.eq_ignore_ascii_case("true"),
                _ => false,
            };
        let own_name = name.to_owned();
        let ros = in_time(2 * PATIENCE, move || Ros::new(&own_name).map_err(|error| reason(&error)));
        let ros = ros.unwrap_or_else(|| Err("no answer in time from a node or the master".to_owned()));
        let ros = ros
            .map_err(|reason| Error::Middleware(format!("cannot join the ROS master at {uri}: {reason}")))?;
        let ros: &'static Ros = Box::leak(Box::new(ros));
        let master = Master { uri, node: ros.name().to_owned(), node_uri: ros.uri().to_owned() };
        let session = Arc::new(Self {
            ros,
            master,
            clock: Clock::default(),
            life: Life::default(),
            next_id: AtomicU64::new(0),
            registrations: Mutex::default(),
            rosout: OnceLock::new(),
            clock_subscription: OnceLock::new(),
            subscribers: Mutex::new(Some((None, Subscribers::new()))),
            lost: AtomicBool::new(false),
            closed: Arc::default(),
        });
        session.clock.simulate(simulated);
        let (weak, closed) = (Arc::downgrade(&session), session.closed.clone());
        let watchdog = thread::Builder::new().name("ros1-watchdog".to_owned());
        watchdog
            .spawn(move || watch(&weak, &closed))
            .map_err(|error| Error::Middleware(format!("no thread for the watchdog: {error}")))?;
        Ok(session)
    }

    /// The absolute name that a graph name stands for, after remappings.
    pub(crate) fn resolve(&self, name: &str) -> Option<String> {
        self.ros.param(name).map(|param| param.name().to_owned())
    }

    pub(crate) fn register(
        &self,
        role: Role,
        topic: &str,
        type_name: String,
        feed: Option<Arc<Feed>>,
    ) -> u64 {
        let id = self.next_id.fetch_add(1, Ordering::Relaxed);
        lock(&self.registrations).push(Registration { id, role, topic: topic.to_owned(), type_name, feed });
        id
    }

    /// Ends a registration. rosrust has by then unregistered the topic even when another handle of this node
    /// still uses it, so that one is registered again.
    pub(crate) fn forget(&self, id: u64) {
        let mut registrations = lock(&self.registrations);
        let Some(index) = registrations.iter().position(|registration| registration.id == id) else { return };
        let gone = registrations.swap_remove(index);
        let still = registrations.iter().any(|other| other.role == gone.role && other.topic == gone.topic);
        drop(registrations);
        if still && let Err(error) = self.master.register(gone.role, &gone.topic, &gone.type_name) {
            tracing::warn!("cannot register {} again: {error}", gone.topic);
        }
    }

    /// Topics this node publishes.
    pub(crate) fn published(&self) -> Vec<String> {
        let registrations = lock(&self.registrations);
        registrations.iter().filter(|r| r.role == Role::Publisher).map(|r| r.topic.clone()).collect()
    }

    /// What the subscriptions know of themselves.
    pub(crate) fn feeds(&self) -> Vec<Arc<Feed>> {
        lock(&self.registrations).iter().filter_map(|registration| registration.feed.clone()).collect()
    }

    /// The master to ask, unless it is known not to answer: a node must not stand still for each question.
    pub(crate) fn answering_master(&self) -> Result<&Master> {
        if self.lost.load(Ordering::SeqCst) {
            return Err(Error::Middleware(format!("the ROS master at {} does not answer", self.master.uri)));
        }
        Ok(&self.master)
    }

    /// The nodes registered as subscribers of a topic, at most a second ago; `None` when the master cannot tell.
    pub(crate) fn subscribers(&self, topic: &str) -> Option<Vec<String>> {
        let mut known = lock(&self.subscribers);
        let (asked, subscribers) = known.as_mut()?;
        if asked.is_none_or(|asked| asked.elapsed() > WATCH_PERIOD) {
            *subscribers = self.answering_master().ok()?.subscribers().ok()?;
            *asked = Some(Instant::now());
        }
        Some(subscribers.get(topic).cloned().unwrap_or_default())
    }

    /// False once the node is to end, and when another took this node's name or `rosnode kill` asked.
    pub(crate) fn is_ok(&self) -> bool {
        self.life.goes_on() && self.ros.is_ok()
    }

    /// Publishes on `/rosout`; a line that cannot go there is on the terminal.
    pub(crate) fn log(&self, record: Record) {
        let level = match record.level {
            Level::ERROR => Log::ERROR,
            Level::WARN => Log::WARN,
            Level::INFO => Log::INFO,
            _ => Log::DEBUG,
        };
        let message = Log {
            header: Header { stamp: self.clock.now(), frame_id: String::new() },
            level,
            name: self.master.node.clone(),
            msg: record.text,
            file: record.file,
            function: record.function,
            line: record.line,
            topics: self.published(),
        };
        let _ = self.rosout.get().map(|rosout| rosout.publish(&message));
    }

    /// Takes every registration back: no ghost stays on the master.
    pub(crate) fn close(&self) {
        self.life.end();
        if std::mem::replace(&mut *lock(&self.closed.0), true) {
            return;
        }
        self.closed.1.notify_all();
        let mut topics: Vec<_> =
            lock(&self.registrations).iter().map(|r| (r.role, r.topic.clone())).collect();
        // the log is the last to go
        topics.sort_by_key(|(_, topic)| topic == "/rosout");
        let done = topics.iter().try_for_each(|(role, topic)| self.master.unregister(*role, topic));
        if let Err(error) = done.and_then(|()| self.master.forget_params()) {
            tracing::debug!("could not unregister: {error}");
        }
    }

    /// Registers everything with a master that does not know this node.
    fn register_again(&self) {
        *lock(&self.subscribers) = None;
        let registrations = lock(&self.registrations);
        let all: Vec<_> =
            registrations.iter().map(|r| (r.role, r.topic.clone(), r.type_name.clone())).collect();
        drop(registrations);
        for (role, topic, type_name) in all {
            if let Err(error) = self.master.register(role, &topic, &type_name) {
                tracing::warn!("cannot register {topic} with the new master: {error}");
            }
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.close();
    }
}

/// Waits for a master that answers, and says so.
fn wait_for(master: &Master, keep_waiting: &dyn Fn() -> bool) -> Result<()> {
    let mut told: Option<Instant> = None;
    while let Err(error) = master.probe() {
        if !keep_waiting() {
            return Err(Error::Middleware(format!("no ROS master: {error}")));
        }
        if told.is_none_or(|told| told.elapsed() > Duration::from_secs(10)) {
            told = Some(Instant::now());
            tracing::warn!("waiting for the ROS master ({error}); start roscore, or set ROS_MASTER_URI");
        }
        thread::sleep(Duration::from_millis(200));
    }
    Ok(())
}

/// Looks after the master each second until the session closes.
fn watch(session: &Weak<Session>, closed: &(Mutex<bool>, Condvar)) {
    for round in 1_u64.. {
        let waited = closed.1.wait_timeout_while(lock(&closed.0), WATCH_PERIOD, |closed| !*closed);
        if *waited.unwrap_or_else(PoisonError::into_inner).0 {
            return;
        }
        let Some(session) = session.upgrade() else { return };
        if !session.is_ok() {
            session.life.end();
            continue;
        }
        match session.master.registered_uri() {
            Ok(uri) if uri == session.master.node_uri => {
                if session.lost.swap(false, Ordering::SeqCst) {
                    tracing::info!("the ROS master at {} answers again", session.master.uri);
                }
            }
            Ok(uri) => {
                tracing::error!(
                    "another node named {} has registered ({uri}): this one ends",
                    session.master.node
                );
                session.life.end();
            }
            Err(crate::xmlrpc::CallError::Refused(_)) => {
                session.lost.store(false, Ordering::SeqCst);
                tracing::warn!("the ROS master at {} was restarted: registering again", session.master.uri);
                session.register_again();
            }
            Err(error) if !session.lost.swap(true, Ordering::SeqCst) => {
                tracing::warn!(
                    "lost the ROS master ({error}); connections stay, the node goes on and registers again"
                );
            }
            Err(_) => {}
        }
        session.clock.watch();
        if round % 5 == 0 && !session.lost.load(Ordering::SeqCst) {
            crate::subscription::look_for_mismatches(&session);
        }
    }
}
