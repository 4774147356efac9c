//! The ROS master as this node sees it: each question has a deadline.

use std::{collections::BTreeMap, time::Duration};

use dxr::{TryFromValue, Value as Xml};
use roscausal_core::params::Value;

use crate::xmlrpc::{CallError, call, decode, encode};

/// How long one question may take.
const PATIENCE: Duration = Duration::from_secs(2);

/// Nodes that subscribe, by topic.
pub(crate) type Subscribers = BTreeMap<String, Vec<String>>;

/// What a node has registered for a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Publisher,
    Subscriber,
}

/// A master, asked in the name of one node.
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
    fn ask<T: TryFromValue>(&self, method: &str, more: &[&str]) -> Result<T, CallError> {
        let texts = std::iter::once(self.node.as_str()).chain(more.iter().copied());
        let params = texts.map(|text| Xml::String(text.to_owned())).collect();
        call(&self.uri, method, params, PATIENCE)
    }

    /// Whether a master answers there.
    pub(crate) fn probe(&self) -> Result<(), CallError> {
        self.ask::<Xml>("getPid", &[]).map(drop)
    }

    /// The URI that is registered for this node's name.
    pub(crate) fn registered_uri(&self) -> Result<String, CallError> {
        self.ask("lookupNode", &[&self.node])
    }

    /// Registers for a topic, and tells the node's own server about the publishers that are there already.
    pub(crate) fn register(&self, role: Role, topic: &str, type_name: &str) -> Result<(), CallError> {
        let method = match role {
            Role::Publisher => "registerPublisher",
            Role::Subscriber => "registerSubscriber",
        };
        let known: Vec<String> = self.ask(method, &[topic, type_name, &self.node_uri])?;
        if role == Role::Subscriber && !known.is_empty() {
            let publishers = Xml::Array(known.into_iter().map(Xml::String).collect());
            let update = vec![Xml::String("/master".to_owned()), Xml::String(topic.to_owned()), publishers];
            call::<Xml>(&self.node_uri, "publisherUpdate", update, PATIENCE)?;
        }
        Ok(())
    }

    /// Takes a registration back.
    pub(crate) fn unregister(&self, role: Role, topic: &str) -> Result<(), CallError> {
        let method = match role {
            Role::Publisher => "unregisterPublisher",
            Role::Subscriber => "unregisterSubscriber",
        };
        self.ask::<Xml>(method, &[topic, &self.node_uri]).map(drop)
    }

    /// Takes back the wish to hear of parameter changes, which rosrust registers.
    pub(crate) fn forget_params(&self) -> Result<(), CallError> {
        self.ask::<Xml>("unsubscribeParam", &[&self.node_uri, "/"]).map(drop)
    }

    /// A parameter's value; `None` when it is not set.
    pub(crate) fn param(&self, name: &str) -> Result<Option<Value>, CallError> {
        match self.ask("getParam", &[name]) {
            Ok(value) => decode(value).map(Some).map_err(CallError::Refused),
            Err(CallError::Refused(reason)) if reason.contains("is not set") => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Sets a parameter.
    pub(crate) fn set_param(&self, name: &str, value: &Value) -> Result<(), CallError> {
        let value = encode(value).map_err(CallError::Refused)?;
        let params = vec![Xml::String(self.node.clone()), Xml::String(name.to_owned()), value];
        call::<Xml>(&self.uri, "setParam", params, PATIENCE).map(drop)
    }

    /// The names of all parameters.
    pub(crate) fn param_names(&self) -> Result<Vec<String>, CallError> {
        self.ask("getParamNames", &[])
    }

    /// `(topic, type)` of all topics that have a publisher.
    pub(crate) fn published_topics(&self) -> Result<Vec<(String, String)>, CallError> {
        self.ask("getPublishedTopics", &[""])
    }

    /// The nodes that subscribe, by topic.
    pub(crate) fn subscribers(&self) -> Result<Subscribers, CallError> {
        let state: (Xml, Vec<(String, Vec<String>)>, Xml) = self.ask("getSystemState", &[])?;
        Ok(state.1.into_iter().collect())
    }
}
