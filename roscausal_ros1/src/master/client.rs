//! Calls to the ROS master, each with a deadline.

use std::collections::{BTreeMap, BTreeSet};
use std::thread;
use std::time::{Duration, Instant};

use dxr::{TryFromValue, Value as Xml};
use roscausal_core::{Error, Result, ensure, params::Value};

use super::xmlrpc::{CallError, call, decode, encode};

/// Time-out of one call.
const PATIENCE: Duration = Duration::from_secs(2);

/// Time between two log lines while waiting for the master.
const REMINDER: Duration = Duration::from_secs(10);

/// Nodes that subscribe, by topic.
pub(crate) type Subscribers = BTreeMap<String, Vec<String>>;

type Answer<T> = std::result::Result<T, CallError>;

/// A node's role on a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// It sends.
    Publisher,
    /// It receives.
    Subscriber,
    /// It answers.
    Service,
}

/// A master, as seen by one node.
#[derive(Clone, Debug)]
pub(crate) struct Master {
    /// `http://host:port/` of the master.
    pub(crate) uri: String,
    /// Full name of the node.
    pub(crate) node: String,
    /// URI of the node's own XML-RPC server.
    pub(crate) node_uri: String,
}

impl Master {
    fn ask<T: TryFromValue>(&self, method: &str, more: &[&str]) -> Answer<T> {
        let texts = std::iter::once(self.node.as_str()).chain(more.iter().copied());
        call(&self.uri, method, texts.map(|text| Xml::String(text.to_owned())).collect(), PATIENCE)
    }

    /// Waits for a master that answers, as long as `keep_waiting` returns true, and logs what it waits for.
    ///
    /// # Errors
    /// No master.
    pub(crate) fn wait(&self, keep_waiting: &dyn Fn() -> bool) -> Result<()> {
        let mut reported: Option<Instant> = None;
        while let Err(error) = self.ask::<Xml>("getPid", &[]) {
            ensure(keep_waiting(), || Error::Middleware(format!("no ROS master: {error}")))?;
            if reported.is_none_or(|reported| reported.elapsed() > REMINDER) {
                reported = Some(Instant::now());
                tracing::warn!("waiting for the ROS master ({error}); start roscore, or set ROS_MASTER_URI");
            }
            thread::sleep(Duration::from_millis(200));
        }
        Ok(())
    }

    /// The URI that is registered for this node's name.
    pub(crate) fn registered_uri(&self) -> Answer<String> {
        self.ask("lookupNode", &[&self.node])
    }

    /// Registers for a topic, and tells the node's own server about the existing publishers; or registers a service.
    /// `what` is the topic's type or the service's address.
    pub(crate) fn register(&self, role: Role, topic: &str, what: &str) -> Answer<()> {
        let method = match role {
            Role::Publisher => "registerPublisher",
            Role::Subscriber => "registerSubscriber",
            Role::Service => {
                return self.ask::<Xml>("registerService", &[topic, what, &self.node_uri]).map(drop);
            }
        };
        let known: Vec<String> = self.ask(method, &[topic, what, &self.node_uri])?;
        if role == Role::Subscriber && !known.is_empty() {
            let publishers = Xml::Array(known.into_iter().map(Xml::String).collect());
            let update = vec![Xml::String("/master".to_owned()), Xml::String(topic.to_owned()), publishers];
            call::<Xml>(&self.node_uri, "publisherUpdate", update, PATIENCE)?;
        }
        Ok(())
    }

    /// Removes a registration; `what` as in [`Master::register`].
    pub(crate) fn unregister(&self, role: Role, topic: &str, what: &str) -> Answer<()> {
        let (method, uri) = match role {
            Role::Publisher => ("unregisterPublisher", self.node_uri.as_str()),
            Role::Subscriber => ("unregisterSubscriber", self.node_uri.as_str()),
            Role::Service => ("unregisterService", what),
        };
        self.ask::<Xml>(method, &[topic, uri]).map(drop)
    }

    /// The address (`rosrpc://host:port`) of a service.
    pub(crate) fn lookup_service(&self, service: &str) -> Answer<String> {
        self.ask("lookupService", &[service])
    }

    /// Unsubscribes from parameter changes, for which rosrust registers.
    pub(crate) fn forget_params(&self) -> Answer<()> {
        self.ask::<Xml>("unsubscribeParam", &[&self.node_uri, "/"]).map(drop)
    }

    /// The value of a parameter by its full name; `None` if it is not set.
    ///
    /// # Errors
    /// No answer, or a value of an unsupported kind.
    pub(crate) fn param(&self, name: &str) -> Result<Option<Value>> {
        let value = match self.ask("getParam", &[name]) {
            Err(CallError::Refused(reason)) if reason.contains("is not set") => return Ok(None),
            answer => answer.and_then(|value| decode(value).map_err(CallError::Refused)),
        };
        value.map(Some).map_err(|error| Error::param(name, error))
    }

    /// Sets a parameter by its full name.
    ///
    /// # Errors
    /// No answer, or a value that ROS 1 parameters cannot hold.
    pub(crate) fn set_param(&self, name: &str, value: &Value) -> Result<()> {
        let set = || {
            let value = encode(value).map_err(CallError::Refused)?;
            let params = vec![Xml::String(self.node.clone()), Xml::String(name.to_owned()), value];
            call::<Xml>(&self.uri, "setParam", params, PATIENCE).map(drop)
        };
        set().map_err(|error| Error::param(name, error))
    }

    /// Names of the node's private parameters that somebody has set; none if the master does not answer.
    pub(crate) fn private_params(&self) -> BTreeSet<String> {
        let own = format!("{}/", self.node);
        let all: Vec<String> = self.ask("getParamNames", &[]).unwrap_or_default();
        // A dictionary appears once for each of its keys.
        let names = all.iter().filter_map(|name| name.strip_prefix(&own)?.split('/').next());
        names.map(str::to_owned).collect()
    }

    /// Whether nodes take their time from `/clock`.
    ///
    /// # Errors
    /// No answer.
    pub(crate) fn uses_sim_time(&self) -> Result<bool> {
        let set = self.param("/use_sim_time").map_err(|error| Error::Middleware(error.to_string()))?;
        Ok(match set {
            Some(Value::Bool(simulated)) => simulated,
            Some(Value::Str(text)) => text.eq_ignore_ascii_case("true"),
            _ => false,
        })
    }

    /// `(topic, type)` of all topics that have a publisher.
    pub(crate) fn published_topics(&self) -> Answer<Vec<(String, String)>> {
        self.ask("getPublishedTopics", &[""])
    }

    /// The nodes that subscribe, by topic.
    pub(crate) fn subscribers(&self) -> Answer<Subscribers> {
        let state: (Xml, Vec<(String, Vec<String>)>, Xml) = self.ask("getSystemState", &[])?;
        Ok(state.1.into_iter().collect())
    }
}
