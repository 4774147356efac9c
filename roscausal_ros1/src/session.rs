//! A node's life on a master: joining, watching the master, leaving without a dead entry.

use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, OnceLock, Weak};
use std::{thread, time::Duration};

use roscausal_core::{Error, Result, middleware::Publish};
use roscausal_msgs::{rosgraph_msgs::Log, std_msgs::Header};
use roscausal_ros::{Clock, Life, console::Record, in_time, lock};
use rosrust::api::{Ros, resolve};
use tracing::Level;

use crate::feed::{Feed, look_for_mismatches};
use crate::master::{Master, Membership};
use crate::{PATIENCE, Publisher, Subscription, nodelay};

/// Time between two checks of the master.
const WATCH_PERIOD: Duration = Duration::from_secs(1);

/// What the clones of a [`crate::Ros1`] share.
pub(crate) struct Session {
    /// Never dropped: its threads outlive it anyway, and its drop would call the master without a deadline.
    pub(crate) ros: &'static Ros,
    pub(crate) membership: Arc<Membership>,
    pub(crate) clock: Clock,
    pub(crate) life: Life,
    feeds: Mutex<Vec<Weak<Feed>>>,
    pub(crate) rosout: OnceLock<Publisher<Log>>,
    pub(crate) clock_subscription: OnceLock<Subscription>,
    /// The watchdog runs while this exists; `None` once the session has closed.
    watched: Mutex<Option<Sender<()>>>,
}

/// rosrust's error with its causes, as one line.
pub(crate) fn reason(error: &rosrust::error::Error) -> String {
    error.iter().map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

impl Session {
    /// Joins the master named by `__master:=` or `ROS_MASTER_URI`. Waits for it as long as `keep_waiting` returns
    /// true.
    pub(crate) fn connect(name: &str, keep_waiting: &dyn Fn() -> bool) -> Result<Arc<Self>> {
        let uri = resolve::master();
        let asking = Master { uri: uri.clone(), node: format!("/{name}"), node_uri: String::new() };
        asking.wait(keep_waiting)?;
        let simulated = asking.uses_sim_time()?;
        let own_name = name.to_owned();
        let ros = in_time(2 * PATIENCE, move || Ros::new(&own_name).map_err(|error| reason(&error)));
        let ros = ros.unwrap_or_else(|| Err("no answer in time from a node or the master".to_owned()));
        let ros = ros
            .map_err(|reason| Error::Middleware(format!("cannot join the ROS master at {uri}: {reason}")))?;
        let ros: &'static Ros = Box::leak(Box::new(ros));
        let (watched, running) = mpsc::channel();
        let session = Arc::new(Self {
            ros,
            membership: Arc::new(Membership::new(Master {
                uri,
                node: ros.name().to_owned(),
                node_uri: ros.uri().to_owned(),
            })),
            clock: Clock::default(),
            life: Life::default(),
            feeds: Mutex::default(),
            rosout: OnceLock::new(),
            clock_subscription: OnceLock::new(),
            watched: Mutex::new(Some(watched)),
        });
        session.clock.simulate(simulated);
        let weak = Arc::downgrade(&session);
        let watchdog = thread::Builder::new().name("ros1-watchdog".to_owned());
        watchdog
            .spawn(move || watch(&weak, &running))
            .map_err(|error| Error::Middleware(format!("no thread for the watchdog: {error}")))?;
        Ok(session)
    }

    /// The absolute name that a graph name stands for, after remappings.
    pub(crate) fn resolve(&self, name: &str) -> Option<String> {
        self.ros.param(name).map(|param| param.name().to_owned())
    }

    pub(crate) fn add_feed(&self, feed: &Arc<Feed>) {
        lock(&self.feeds).push(Arc::downgrade(feed));
    }

    /// The state of all subscriptions.
    pub(crate) fn feeds(&self) -> Vec<Arc<Feed>> {
        let mut feeds = lock(&self.feeds);
        feeds.retain(|feed| feed.upgrade().is_some_and(|feed| feed.gate.is_open()));
        feeds.iter().filter_map(Weak::upgrade).collect()
    }

    /// False once the node has to end, and when another node took its name or `rosnode kill` was called.
    pub(crate) fn is_ok(&self) -> bool {
        self.life.goes_on() && self.ros.is_ok()
    }

    /// Publishes on `/rosout`. A line that cannot go there is on the terminal anyway.
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
            name: self.membership.node().to_owned(),
            msg: record.text,
            file: record.file,
            function: record.function,
            line: record.line,
            topics: self.membership.published(),
        };
        let _ = self.rosout.get().map(|rosout| rosout.publish(&message));
    }

    /// Unregisters everything, once.
    pub(crate) fn close(&self) {
        self.life.end();
        if lock(&self.watched).take().is_some() {
            self.membership.leave();
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.close();
    }
}

/// Checks the master every second until the session closes.
fn watch(session: &Weak<Session>, running: &Receiver<()>) {
    for round in 1_u64.. {
        if running.recv_timeout(WATCH_PERIOD) != Err(RecvTimeoutError::Timeout) {
            return;
        }
        let Some(session) = session.upgrade() else { return };
        if !session.is_ok() || !session.membership.renew() {
            session.life.end();
            continue;
        }
        nodelay::send_at_once();
        session.clock.watch();
        if round % 5 == 0 {
            look_for_mismatches(&session.feeds(), &session.membership);
        }
    }
}
