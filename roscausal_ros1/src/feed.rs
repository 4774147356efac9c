//! The state of subscriptions: who sends, how many messages were lost, and why none arrive.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use roscausal_core::{Message, gate::Gate};

use crate::{master::Membership, wire::ANY};

/// State of one subscription.
pub(crate) struct Feed {
    pub(crate) topic: String,
    type_name: String,
    md5: &'static str,
    since: Instant,
    /// A publisher has accepted the connection.
    pub(crate) connected: AtomicBool,
    /// The mismatch has been logged.
    reported: AtomicBool,
    /// Messages that never arrived, counted by the gaps in `header.seq`.
    pub(crate) lost: AtomicU64,
    /// Closed when the subscription is dropped.
    pub(crate) gate: Gate,
}

impl Feed {
    pub(crate) fn new<M: Message>(topic: String) -> Arc<Self> {
        Self::of_type(topic, M::type_name(), M::ros1_md5())
    }

    /// The state of a subscription to messages of any type.
    pub(crate) fn of_any_type(topic: String) -> Arc<Self> {
        Self::of_type(topic, ANY.to_owned(), ANY)
    }

    fn of_type(topic: String, type_name: String, md5: &'static str) -> Arc<Self> {
        Arc::new(Self {
            topic,
            type_name,
            md5,
            since: Instant::now(),
            connected: AtomicBool::new(false),
            reported: AtomicBool::new(false),
            lost: AtomicU64::new(0),
            gate: Gate::default(),
        })
    }
}

/// Logs once for each subscription why nothing can arrive: another type, or another definition of the type.
pub(crate) fn look_for_mismatches(feeds: &[Arc<Feed>], membership: &Membership) {
    let silent = |feed: &&Arc<Feed>| {
        !feed.connected.load(Ordering::Relaxed)
            && !feed.reported.load(Ordering::Relaxed)
            && feed.type_name != ANY
            && feed.since.elapsed() > Duration::from_secs(3)
    };
    let feeds: Vec<_> = feeds.iter().filter(silent).collect();
    if feeds.is_empty() {
        return;
    }
    let published = membership.topics();
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
        feed.reported.store(true, Ordering::Relaxed);
    }
}
