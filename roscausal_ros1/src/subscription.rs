//! Subscriptions: who sends, how many messages were lost, and why none arrive.

use std::{
    collections::HashMap,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex, Weak,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use roscausal_core::{
    Message,
    gate::Gate,
    middleware::{Raw, RawType},
};
use roscausal_msgs::dynamic;
use roscausal_ros::{in_time, lock};

use crate::{
    pace::Pace,
    session::{PATIENCE, Session},
    wire::{ANY, AnyWire, Wire},
};

/// State of one subscription.
pub(crate) struct Feed {
    pub(crate) topic: String,
    type_name: String,
    md5: &'static str,
    since: Instant,
    /// A publisher has accepted the connection.
    connected: AtomicBool,
    /// The mismatch has been logged.
    told: AtomicBool,
    /// Messages that never arrived, counted by the gaps in `header.seq`.
    pub(crate) lost: AtomicU64,
    /// Closed when the subscription is dropped.
    gate: Gate,
}

impl Feed {
    pub(crate) fn new<M: Message>(topic: String) -> Arc<Self> {
        Arc::new(Self {
            topic,
            type_name: M::type_name(),
            md5: M::ros1_md5(),
            since: Instant::now(),
            connected: AtomicBool::new(false),
            told: AtomicBool::new(false),
            lost: AtomicU64::new(0),
            gate: Gate::default(),
        })
    }

    /// The state of a subscription to messages of any type.
    pub(crate) fn of_any_type(topic: String) -> Arc<Self> {
        Arc::new(Self {
            topic,
            type_name: ANY.to_owned(),
            md5: ANY,
            since: Instant::now(),
            connected: AtomicBool::new(false),
            told: AtomicBool::new(false),
            lost: AtomicU64::new(0),
            gate: Gate::default(),
        })
    }

    /// False once the subscription is dropped.
    pub(crate) fn is_open(&self) -> bool {
        self.gate.is_open()
    }
}

/// rosrust's side of a subscription.
pub(crate) struct Handler<F> {
    pub(crate) feed: Arc<Feed>,
    pub(crate) callback: F,
    last_seq: HashMap<String, u32>,
    bad: u64,
}

impl<F> Handler<F> {
    pub(crate) fn new(feed: Arc<Feed>, callback: F) -> Self {
        Self { feed, callback, last_seq: HashMap::new(), bad: 0 }
    }

    /// Gaps count as lost messages. A number that goes back means that the publisher restarted.
    fn count(&mut self, seq: u32, caller: &str) {
        let Some(last) = self.last_seq.get_mut(caller) else {
            self.last_seq.insert(caller.to_owned(), seq);
            return;
        };
        if seq > *last {
            self.feed.lost.fetch_add(u64::from(seq - *last - 1), Ordering::Relaxed);
        }
        *last = seq;
    }
}

impl<M: Message, F: FnMut(M) + Send + 'static> rosrust::SubscriptionHandler<Wire<M>> for Handler<F> {
    fn connection(&mut self, headers: HashMap<String, String>) {
        self.feed.connected.store(true, Ordering::Relaxed);
        // a publisher that reconnects numbers its messages from the start
        if let Some(caller) = headers.get("callerid") {
            self.last_seq.remove(caller);
        }
    }

    fn message(&mut self, wire: Wire<M>, caller: &str) {
        let feed = self.feed.clone();
        let topic = &feed.topic;
        let message = match wire.body {
            Ok(message) => message,
            Err(reason) => {
                self.bad += 1;
                if self.bad.is_power_of_two() {
                    let count = self.bad;
                    tracing::error!(
                        "topic '{topic}': message {count} from {caller} that is no {}: {reason}",
                        M::type_name()
                    );
                }
                return;
            }
        };
        if let Some(seq) = wire.seq {
            self.count(seq, caller);
        }
        feed.gate.pass(|| {
            if catch_unwind(AssertUnwindSafe(|| (self.callback)(message))).is_err() {
                tracing::error!("topic '{topic}': the callback panicked; the subscription goes on");
            }
        });
    }
}

/// rosrust's side of a subscription to messages of any type.
pub(crate) struct Listener<F> {
    feed: Arc<Feed>,
    callback: F,
    /// By publisher: what it says that it sends.
    kinds: HashMap<String, Arc<RawType>>,
    pace: Pace,
}

impl<F> Listener<F> {
    pub(crate) fn new(feed: Arc<Feed>, callback: F) -> Self {
        Self { feed, callback, kinds: HashMap::new(), pace: Pace::new(Instant::now()) }
    }
}

impl<F: FnMut(Raw) + Send + 'static> rosrust::SubscriptionHandler<AnyWire> for Listener<F> {
    fn connection(&mut self, headers: HashMap<String, String>) {
        self.feed.connected.store(true, Ordering::Relaxed);
        let of = |name: &str| headers.get(name).cloned().unwrap_or_default();
        let kind = RawType {
            type_name: of("type"),
            definition: of("message_definition"),
            wire: dynamic::Wire::Ros1,
        };
        // Publishers of one type share it, so that what is bound to it stays bound.
        let kind =
            self.kinds.values().find(|known| ***known == kind).cloned().unwrap_or_else(|| Arc::new(kind));
        self.kinds.insert(of("callerid"), kind);
    }

    fn message(&mut self, wire: AnyWire, caller: &str) {
        let feed = self.feed.clone();
        let Some(kind) = self.kinds.get(caller).cloned() else { return };
        feed.gate.pass(|| {
            let message = Raw { kind, bytes: wire.0 };
            if catch_unwind(AssertUnwindSafe(|| (self.callback)(message))).is_err() {
                tracing::error!("topic '{}': the callback panicked; the subscription goes on", feed.topic);
            }
        });
        if let Some(time) = self.pace.rest(Instant::now()) {
            thread::sleep(time);
        }
    }
}

/// A subscription of a [`crate::Ros1`]. Dropping it unsubscribes.
pub struct Subscription {
    pub(crate) session: Weak<Session>,
    pub(crate) feed: Arc<Feed>,
    pub(crate) id: u64,
    /// Filled once the publishers known to the master have answered, unless the subscription was dropped meanwhile.
    pub(crate) slot: Arc<Mutex<Option<rosrust::Subscriber>>>,
}

impl Drop for Subscription {
    fn drop(&mut self) {
        self.feed.gate.close();
        let subscriber = lock(&self.slot).take();
        in_time(PATIENCE, move || drop(subscriber));
        if let Some(session) = self.session.upgrade() {
            session.membership.forget(self.id);
        }
    }
}

/// Logs once for each subscription why nothing can arrive: another type, or another definition of the type.
pub(crate) fn look_for_mismatches(session: &Session) {
    let silent = |feed: &&Arc<Feed>| {
        !feed.connected.load(Ordering::Relaxed)
            && !feed.told.load(Ordering::Relaxed)
            && feed.type_name != ANY
            && feed.since.elapsed() > Duration::from_secs(3)
    };
    let feeds = session.feeds();
    let feeds: Vec<_> = feeds.iter().filter(silent).collect();
    if feeds.is_empty() {
        return;
    }
    let published = session.membership.topics();
    for feed in feeds {
        let Some((topic, kind)) = published.iter().find(|(topic, _)| *topic == feed.topic) else { continue };
        let (own, md5) = (&feed.type_name, feed.md5);
        if kind != own {
            tracing::error!(
                "topic '{topic}': it carries {kind}, not {own}; check the topic's name or the publisher"
            );
        } else {
            tracing::error!(
                "topic '{topic}': its publisher does not take our connection; perhaps its {own} is another one than \
                 ours (md5 {md5}): compare `rosmsg md5 {own}` where it runs"
            );
        }
        feed.told.store(true, Ordering::Relaxed);
    }
}
