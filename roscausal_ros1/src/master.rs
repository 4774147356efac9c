//! The ROS master as this node sees it: each question has a deadline.

use std::{collections::BTreeMap, time::Duration};

use roscausal_core::params::Value;

use crate::xmlrpc::{CallError, call};

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
    fn ask(&self, method: &str, more: &[&str]) -> Result<Value, CallError> {
        let mut params = vec![Value::Str(self.node.clone())];
        params.extend(more.iter().map(|text| Value::Str((*text).to_owned())));
        call(&self.uri, method, &params, PATIENCE)
    }

    /// Whether a master answers there.
    pub(crate) fn probe(&self) -> Result<(), CallError> {
        self.ask("getPid", &[]).map(drop)
    }

    /// The URI that is registered for this node's name.
    pub(crate) fn registered_uri(&self) -> Result<String, CallError> {
        match self.ask("lookupNode", &[&self.node])? {
            Value::Str(uri) => Ok(uri),
            other => Err(CallError::Refused(format!("lookupNode gave {other:?}"))),
        }
    }

    /// Registers for a topic, and tells the node's own server about the publishers that are there already.
    pub(crate) fn register(&self, role: Role, topic: &str, type_name: &str) -> Result<(), CallError> {
        let method = match role {
            Role::Publisher => "registerPublisher",
            Role::Subscriber => "registerSubscriber",
        };
        let known = self.ask(method, &[topic, type_name, &self.node_uri])?;
        if role == Role::Subscriber && !matches!(&known, Value::List(uris) if uris.is_empty()) {
            let update = [Value::Str("/master".to_owned()), Value::Str(topic.to_owned()), known];
            call(&self.node_uri, "publisherUpdate", &update, PATIENCE)?;
        }
        Ok(())
    }

    /// Takes a registration back.
    pub(crate) fn unregister(&self, role: Role, topic: &str) -> Result<(), CallError> {
        let method = match role {
            Role::Publisher => "unregisterPublisher",
            Role::Subscriber => "unregisterSubscriber",
        };
        self.ask(method, &[topic, &self.node_uri]).map(drop)
    }

    /// Takes back the wish to hear of parameter changes, which rosrust registers.
    pub(crate) fn forget_params(&self) -> Result<(), CallError> {
        self.ask("unsubscribeParam", &[&self.node_uri, "/"]).map(drop)
    }

    /// A parameter's value; `None` when it is not set.
    pub(crate) fn param(&self, name: &str) -> Result<Option<Value>, CallError> {
        match self.ask("getParam", &[name]) {
            Ok(value) => Ok(Some(value)),
            Err(CallError::Refused(reason)) if reason.contains("is not set") => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Sets a parameter.
    pub(crate) fn set_param(&self, name: &str, value: Value) -> Result<(), CallError> {
        let params = [Value::Str(self.node.clone()), Value::Str(name.to_owned()), value];
        call(&self.uri, "setParam", &params, PATIENCE).map(drop)
    }

    /// The names of all parameters.
    pub(crate) fn param_names(&self) -> Result<Vec<String>, CallError> {
        let Value::List(names) = self.ask("getParamNames", &[])? else { return Ok(Vec::new()) };
        Ok(names
            .into_iter()
            .filter_map(|name| if let Value::Str(name) = name { Some(name) } else { None })
            .collect())
    }

    /// `(topic, type)` of all topics that have a publisher.
    pub(crate) fn published_topics(&self) -> Result<Vec<(String, String)>, CallError> {
        let Value::List(topics) = self.ask("getPublishedTopics", &[""])? else { return Ok(Vec::new()) };
        let pair = |value: Value| match value {
            Value::List(pair) => match pair.as_slice() {
                [Value::Str(topic), Value::Str(kind)] => Some((topic.clone(), kind.clone())),
                _ => None,
            },
            _ => None,
        };
        Ok(topics.into_iter().filter_map(pair).collect())
    }

    /// The nodes that subscribe, by topic.
    pub(crate) fn subscribers(&self) -> Result<Subscribers, CallError> {
        let Value::List(state) = self.ask("getSystemState", &[])? else { return Ok(Subscribers::new()) };
        let Some(Value::List(topics)) = state.into_iter().nth(1) else { return Ok(Subscribers::new()) };
        let text = |value: Value| if let Value::Str(text) = value { Some(text) } else { None };
        let entry = |value: Value| match value {
            Value::List(mut entry) => match (entry.pop(), entry.pop().and_then(text)) {
                (Some(Value::List(nodes)), Some(topic)) => {
                    Some((topic, nodes.into_iter().filter_map(text).collect()))
                }
                _ => None,
            },
            _ => None,
        };
        Ok(topics.into_iter().filter_map(entry).collect())
    }
}
