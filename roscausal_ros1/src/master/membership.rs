//! The registrations of one node with its master, for as long as the node lives.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use roscausal_core::{Error, Result, ensure, gate::lock};

use super::client::{Master, Role, Subscribers};
use super::xmlrpc::CallError;

/// How long the master's list of subscribers is reused.
const BELIEVED: Duration = Duration::from_secs(1);

/// A registration that must survive a restart of the master.
#[derive(Clone)]
struct Registration {
    id: u64,
    role: Role,
    topic: String,
    /// The topic's type, or the service's address.
    what: String,
}

/// The membership of a node. Its owner calls [`Membership::renew`] every second, and [`Membership::leave`] at the
/// end.
pub(crate) struct Membership {
    master: Master,
    next_id: AtomicU64,
    registrations: Mutex<Vec<Registration>>,
    /// The subscribers by topic, and when the master listed them. `None` once a master was lost, because other
    /// nodes do not register again.
    subscribers: Mutex<Option<(Option<Instant>, Subscribers)>>,
    /// The master does not answer. Only [`Membership::renew`] calls it again.
    lost: AtomicBool,
}

impl Membership {
    /// The membership of the node that this master belongs to. Nothing is registered yet.
    pub(crate) fn new(master: Master) -> Self {
        Self {
            master,
            next_id: AtomicU64::new(0),
            registrations: Mutex::default(),
            subscribers: Mutex::new(Some((None, Subscribers::new()))),
            lost: AtomicBool::new(false),
        }
    }

    /// The node's full name.
    pub(crate) fn node(&self) -> &str {
        &self.master.node
    }

    /// The host name by which others reach this node.
    pub(crate) fn host(&self) -> &str {
        let address = self.master.node_uri.strip_prefix("http://").unwrap_or(&self.master.node_uri);
        address.trim_end_matches('/').rsplit_once(':').map_or(address, |(host, _)| host)
    }

    /// The master.
    ///
    /// # Errors
    /// If it is known not to answer: a node must not block on each call.
    pub(crate) fn master(&self) -> Result<&Master> {
        let fault = || Error::Middleware(format!("the ROS master at {} does not answer", self.master.uri));
        ensure(!self.lost.load(Ordering::SeqCst), fault)?;
        Ok(&self.master)
    }

    /// Remembers a registration that the node's client library has made. The returned number is for
    /// [`Membership::forget`].
    pub(crate) fn keep(&self, role: Role, topic: &str, what: String) -> u64 {
        let id = self.next_id.fetch_add(1, Ordering::Relaxed);
        lock(&self.registrations).push(Registration { id, role, topic: topic.to_owned(), what });
        id
    }

    /// Ends a registration. The client library has already unregistered the topic, even if another handle of this
    /// node still uses it. In that case the topic is registered again.
    pub(crate) fn forget(&self, id: u64) {
        let mut registrations = lock(&self.registrations);
        let Some(index) = registrations.iter().position(|registration| registration.id == id) else { return };
        let gone = registrations.swap_remove(index);
        let still = registrations.iter().any(|other| other.role == gone.role && other.topic == gone.topic);
        drop(registrations);
        if still && let Err(error) = self.master.register(gone.role, &gone.topic, &gone.what) {
            tracing::warn!("cannot register {} again: {error}", gone.topic);
        }
    }

    /// Topics this node publishes.
    pub(crate) fn published(&self) -> Vec<String> {
        let registrations = lock(&self.registrations);
        registrations.iter().filter(|r| r.role == Role::Publisher).map(|r| r.topic.clone()).collect()
    }

    /// `(topic, type)` of all topics that have a publisher; none if the master does not answer.
    pub(crate) fn topics(&self) -> Vec<(String, String)> {
        self.master().ok().and_then(|master| master.published_topics().ok()).unwrap_or_default()
    }

    /// The nodes that subscribe to a topic, as of at most a second ago; `None` if the master cannot tell.
    pub(crate) fn subscribers(&self, topic: &str) -> Option<Vec<String>> {
        let mut known = lock(&self.subscribers);
        let (asked, subscribers) = known.as_mut()?;
        if asked.is_none_or(|asked| asked.elapsed() > BELIEVED) {
            *subscribers = self.master().ok()?.subscribers().ok()?;
            *asked = Some(Instant::now());
        }
        Some(subscribers.get(topic).cloned().unwrap_or_default())
    }

    /// Checks whether the master still knows the node, and registers everything again if not. Returns `false` if
    /// another node has taken this node's name; this node then has to end.
    pub(crate) fn renew(&self) -> bool {
        match self.master.registered_uri() {
            Ok(uri) if uri == self.master.node_uri => {
                if self.lost.swap(false, Ordering::SeqCst) {
                    tracing::info!("the ROS master at {} answers again", self.master.uri);
                }
            }
            Ok(uri) => {
                tracing::error!("another node named {} has registered ({uri}): this one ends", self.node());
                return false;
            }
            Err(CallError::Refused(_)) => {
                self.lost.store(false, Ordering::SeqCst);
                tracing::warn!("the ROS master at {} was restarted: registering again", self.master.uri);
                self.register_again();
            }
            Err(error) if !self.lost.swap(true, Ordering::SeqCst) => {
                tracing::warn!(
                    "lost the ROS master ({error}); connections stay, the node goes on and registers again"
                );
            }
            Err(_) => {}
        }
        true
    }

    fn register_again(&self) {
        *lock(&self.subscribers) = None;
        let all = lock(&self.registrations).clone();
        for Registration { role, topic, what, .. } in all {
            if let Err(error) = self.master.register(role, &topic, &what) {
                tracing::warn!("cannot register {topic} with the new master: {error}");
            }
        }
    }

    /// Removes all registrations, so that no dead entry stays on the master.
    pub(crate) fn leave(&self) {
        let mut all = lock(&self.registrations).clone();
        // the log is unregistered last
        all.sort_by_key(|one| one.topic == "/rosout");
        let done = all.iter().try_for_each(|one| self.master.unregister(one.role, &one.topic, &one.what));
        if let Err(error) = done.and_then(|()| self.master.forget_params()) {
            tracing::debug!("could not unregister: {error}");
        }
    }
}
