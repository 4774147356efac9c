//! Subscriptions: what arrives reaches the callbacks.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, Weak, atomic::Ordering};
use std::{collections::HashMap, thread, time::Instant};

use roscausal_core::Message;
use roscausal_core::middleware::{Raw, RawType};
use roscausal_msgs::dynamic;
use roscausal_ros::{in_time, lock};

use crate::wire::{AnyWire, Wire};
use crate::{PATIENCE, feed::Feed, master::Membership, pace::Pace};

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
    pub(crate) membership: Weak<Membership>,
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
        if let Some(membership) = self.membership.upgrade() {
            membership.forget(self.id);
        }
    }
}
