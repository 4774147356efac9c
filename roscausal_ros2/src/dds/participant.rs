//! A node's participant on a DDS domain.

use std::any::{Any, TypeId};
use std::collections::{HashMap, HashSet};
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Mutex, Weak};
use std::thread;
use std::time::{Duration, Instant};

use ros2_client::{
    Context, MessageTypeName, Name, NodeName, NodeOptions, entities_info::ParticipantEntitiesInfo,
};
use roscausal_core::{Error, Message, Result, gate::lock, middleware::Qos};
use rustdds::{DomainParticipantBuilder, GUID, RTPSEntity, Topic};

use super::graph::{Graph, published_topics};
use super::qos::{self, Side};
use super::{farewell, spinner::Spinner, watchdog};
use crate::rcl::{Enclave, Names, Network};

/// A node's participant. It leaves the domain when it is dropped, or when it is told to.
pub(crate) struct Participant {
    /// The node's name, and what its remaps make of others.
    pub(crate) names: Names,
    network: Network,
    /// Whether what it sends may be encrypted.
    pub(super) secured: bool,
    pub(super) graph: Arc<Graph>,
    pub(super) spinner: Spinner,
    /// `None` once it has left.
    session: Arc<Mutex<Option<Session>>>,
    /// Type of each topic that the node uses.
    types: Mutex<HashMap<String, String>>,
    /// The services that the node offers.
    pub(super) services: Mutex<HashSet<String>>,
    pub(super) askers: Askers,
    pub(super) announcer: Mutex<Option<Announcer>>,
    leaving: Mutex<()>,
}

/// Sends the endpoints of a node through its own publisher.
type Announcer = Box<dyn FnMut(&Participant, ParticipantEntitiesInfo) + Send>;

/// The handles of the library, in the order in which they are dropped.
pub(super) struct Session {
    pub(super) node: ros2_client::Node,
    pub(super) context: Context,
}

/// Name and type of a service.
type Key = (String, TypeId);
/// An asker of services of some type.
type Idle = Box<dyn Any + Send>;

/// The clients that no question uses, and the services that have been seen.
#[derive(Default)]
pub(super) struct Askers {
    pub(super) idle: Mutex<HashMap<Key, Vec<Idle>>>,
    pub(super) seen: Mutex<HashMap<GUID, Instant>>,
}

/// How long a node that leaves waits for the others to notice.
const FAREWELL: Duration = Duration::from_millis(150);

pub(super) fn middleware(what: &str, reason: impl std::fmt::Display) -> Error {
    Error::Middleware(format!("{what}: {reason}"))
}

impl Participant {
    /// Joins the domain as one node. `on_panic` gets the name of a task that panicked; it runs on the thread that
    /// reads all input. `on_hang` is called if the library no longer answers, so that every call of this
    /// participant may block for ever.
    ///
    /// # Errors
    /// If the network or the enclave cannot be used.
    /// When the network, or the enclave, cannot be used.
    pub(crate) fn join(
        names: &Names,
        network: Network,
        enclave: Option<&Enclave>,
        on_panic: impl Fn(String) + Send + 'static,
        on_hang: impl FnOnce() + Send + 'static,
    ) -> Result<Arc<Self>> {
        let mut builder = DomainParticipantBuilder::new(network.domain_id);
        if network.localhost_only {
            builder = builder.with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)]);
        }
        let domain = format!("cannot join DDS domain {}", network.domain_id);
        let participant = secured(builder, enclave).build().map_err(|error| match enclave {
            Some(enclave) => Error::file(&enclave.folder, format!("{domain} with this enclave: {error}")),
            None => middleware(&domain, error),
        })?;
        let context =
            Context::from_domain_participant(participant).map_err(|error| middleware(&domain, error))?;
        let name =
            NodeName::new(names.namespace(), names.node()).map_err(|error| middleware("node name", error))?;
        // Its parameter store has no descriptions, and its /rosout history grows without bound.
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let node =
            context.new_node(name, options).map_err(|error| middleware("cannot make the node", error))?;
        let spinner = Spinner::start(on_panic).map_err(|error| middleware("cannot start a thread", error))?;
        let this = Self {
            names: names.clone(),
            network,
            secured: enclave.is_some(),
            graph: Arc::default(),
            spinner,
            session: Arc::new(Mutex::new(Some(Session { node, context: context.clone() }))),
            types: Mutex::default(),
            services: Mutex::default(),
            askers: Askers::default(),
            announcer: Mutex::default(),
            leaving: Mutex::default(),
        };
        let graph = this.graph.clone();
        this.spinner.spawn("discovery".into(), move || async move { graph.watch(context).await });
        let session = Arc::downgrade(&this.session);
        watchdog::watch(move || answers(&session), watchdog::PATIENCE, on_hang);
        Ok(Arc::new(this))
    }

    /// Runs `work` with the handles of the library.
    ///
    /// # Errors
    /// If the node has left the graph.
    pub(super) fn session<T>(&self, work: impl FnOnce(&mut Session) -> T) -> Result<T> {
        let mut session = lock(&self.session);
        session.as_mut().map(work).ok_or_else(|| Error::Middleware("the node has left the graph".into()))
    }

    /// `(topic, package/Name)` of the topics that have a publisher, in order; none once the node has left.
    pub(crate) fn topics(&self) -> Vec<(String, String)> {
        self.session(|session| published_topics(&session.context)).unwrap_or_default()
    }

    /// Whether a publisher may be replaced by a new one. With security it may not, because the library then allows
    /// one publisher per topic and node. A late joiner may then get earlier messages, too.
    pub(super) fn renews(&self) -> bool {
        !self.secured
    }

    /// The DDS topic behind an absolute name. Refuses a second type for the same name.
    pub(super) fn topic<M: Message>(&self, name: &str, qos: Qos) -> Result<Topic> {
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
        let profile = qos::profile(qos, Side::Publisher);
        let topic = self.session(|session| session.node.create_topic(&dds_name, kind, &profile))?;
        topic.map_err(|error| fail(error.to_string()))
    }

    /// Tells others the current endpoints of this node, if it announces itself.
    pub(super) fn announce(&self) {
        let mut announcer = lock(&self.announcer);
        let Some(announcer) = announcer.as_mut() else { return };
        if let Ok(info) = self.session(|session| session.context.participant_entities_info()) {
            announcer(self, info);
        }
    }

    /// Leaves the domain at once. A second caller waits for the first, because a program that ended meanwhile would
    /// stay listed.
    pub(crate) fn leave(&self) {
        let _leaving = lock(&self.leaving);
        self.spinner.stop();
        lock(&self.askers.idle).clear();
        let session = lock(&self.session).take();
        if let Some(Session { node, context }) = session {
            drop(node);
            let mut announcer = lock(&self.announcer).take();
            if let Some(announcer) = &mut announcer {
                announcer(self, context.participant_entities_info());
            }
            // A node that is just discovering this one must learn that the node has gone before its participant
            // goes. Otherwise it lists the node for ever.
            thread::sleep(FAREWELL);
            let participant = context.domain_participant().guid().to_bytes();
            drop((announcer, context));
            farewell::send(participant, self.network);
        }
    }
}

impl Drop for Participant {
    fn drop(&mut self) {
        self.leave();
    }
}

/// Asks the library for something that needs its locks. False once the node has left.
fn answers(session: &Weak<Mutex<Option<Session>>>) -> bool {
    let Some(session) = session.upgrade() else { return false };
    let session = lock(&session);
    let Some(session) = session.as_ref() else { return false };
    session.context.domain_participant().discovered_topics();
    true
}

/// With the files of the enclave, if the node has one.
#[cfg(feature = "security")]
fn secured(builder: DomainParticipantBuilder, enclave: Option<&Enclave>) -> DomainParticipantBuilder {
    let Some(enclave) = enclave else { return builder };
    // The keys of SROS2 have no password.
    let files =
        rustdds::DomainParticipantSecurityConfigFiles::with_ros_default_names(&enclave.folder, String::new());
    builder.builtin_security(files)
}

/// Without DDS Security there is never an enclave.
#[cfg(not(feature = "security"))]
fn secured(builder: DomainParticipantBuilder, _enclave: Option<&Enclave>) -> DomainParticipantBuilder {
    builder
}
