//! A node's view of the others: which endpoints match its publishers and subscriptions, and why others do not.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::{Mutex, MutexGuard, Weak};

use futures::StreamExt;
use ros2_client::{Context, Gid};
use roscausal_core::gate::lock;
use rustdds::{DomainParticipantStatusEvent as Event, GUID, StatusEvented};
use tracing::{debug, warn};

use super::qos::described;

/// A latched publisher whose last message may wait for a subscriber.
pub(crate) trait Latched: Send + Sync {
    /// A subscriber has come.
    fn hand_over(&self);
}

/// The endpoints of one node and their matches. [`Graph::watch`] keeps them up to date.
#[derive(Default)]
pub(crate) struct Graph {
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// DDS topic and type of this node's own endpoints.
    own: HashMap<GUID, (String, String)>,
    /// Matched remote endpoints of each of our endpoints.
    matched: HashMap<GUID, HashSet<GUID>>,
    /// The latched publishers, with their DDS topics.
    latched: Vec<(String, Weak<dyn Latched>)>,
    /// What has been logged already, so that it is logged once.
    stated: HashSet<String>,
}

impl Graph {
    fn lock(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }

    /// Adds an endpoint of this node.
    pub(crate) fn add(&self, guid: GUID, dds_topic: &str, dds_type: &str) {
        self.lock().own.insert(guid, (dds_topic.to_owned(), dds_type.to_owned()));
    }

    /// Removes an endpoint of this node.
    pub(crate) fn remove(&self, guid: GUID) {
        let mut state = self.lock();
        state.own.remove(&guid);
        state.matched.remove(&guid);
    }

    /// Adds a latched publisher of this node, which will be notified of subscribers.
    pub(crate) fn add_latched(&self, dds_topic: String, publisher: Weak<dyn Latched>) {
        let mut state = self.lock();
        state.latched.retain(|(_, publisher)| publisher.strong_count() > 0);
        state.latched.push((dds_topic, publisher));
    }

    /// Number of remote endpoints that match this endpoint of ours.
    pub(crate) fn matched(&self, guid: GUID) -> usize {
        self.lock().matched.get(&guid).map_or(0, HashSet::len)
    }

    /// Follows discovery until the participant ends.
    pub(crate) async fn watch(&self, context: Context) {
        let listener = context.domain_participant().status_listener();
        // The listener alone must not keep the context alive longer than this task.
        drop(context);
        let mut events = listener.as_async_status_stream();
        while let Some(event) = events.next().await {
            self.take(event);
        }
    }

    fn take(&self, event: Event) {
        let mut state = self.lock();
        match event {
            Event::RemoteReaderMatched { local_writer: own, remote_reader: other } => {
                state.matched.entry(own).or_default().insert(other);
                let topic = state.own.get(&own).map(|(topic, _)| topic.clone());
                let latched = state.latched.iter().filter(|(of, _)| Some(of) == topic.as_ref());
                let latched: Vec<_> = latched.filter_map(|(_, publisher)| publisher.upgrade()).collect();
                drop(state);
                latched.iter().for_each(|publisher| publisher.hand_over());
            }
            Event::RemoteWriterMatched { local_reader: own, remote_writer: other } => {
                state.matched.entry(own).or_default().insert(other);
            }
            Event::ReaderLost { guid, .. } | Event::WriterLost { guid, .. } => {
                state.matched.values_mut().for_each(|others| others.retain(|other| *other != guid));
            }
            Event::ParticipantLost { id, .. } => {
                state.matched.values_mut().for_each(|others| others.retain(|other| other.prefix != id));
            }
            Event::RemoteReaderQosIncompatible { local_writer: own, requested_qos, offered_qos, .. }
            | Event::RemoteWriterQosIncompatible { local_reader: own, requested_qos, offered_qos, .. } => {
                let (offered, requested) = (described(&offered_qos), described(&requested_qos));
                if let Some((topic, _)) = state.own.get(&own) {
                    let text = format!(
                        "topic '{}': incompatible QoS, so nothing passes between this node and another: the \
                         publisher offers {offered}, the subscriber requests {requested}",
                        ros_name(topic).unwrap_or_else(|| topic.clone())
                    );
                    say_once(&mut state, text);
                }
            }
            Event::ReaderDetected { reader: other } | Event::WriterDetected { writer: other } => {
                let clash = |(topic, kind): &&(String, String)| {
                    *topic == other.topic_name && *kind != other.type_name
                };
                if let Some((topic, kind)) = state.own.values().find(clash)
                    && let (Some(name), Some(own), Some(others)) =
                        (ros_name(topic), ros_type(kind), ros_type(&other.type_name))
                {
                    let text = format!(
                        "topic '{name}': another node uses it for {others}, this one for {own}, so nothing passes \
                         between them; check the topic's name, or remap it with -r {name}:=/other"
                    );
                    say_once(&mut state, text);
                }
            }
            other => debug!("discovery: {other:?}"),
        }
    }
}

fn say_once(state: &mut State, text: String) {
    if state.stated.insert(text.clone()) {
        warn!("{text}");
    }
}

/// `(topic, package/Name)` of the topics that have a publisher, in order.
pub(crate) fn published_topics(context: &Context) -> Vec<(String, String)> {
    let writers = context.domain_participant().discovered_writers();
    let topics = writers.iter().filter_map(|writer| {
        let data = &writer.publication_topic_data;
        Some((ros_name(&data.topic_name)?, ros_type(&data.type_name)?))
    });
    topics.collect::<BTreeSet<_>>().into_iter().collect()
}

/// DDS type that another node's publisher sends; `None` if the publisher is unknown or gone.
pub(crate) fn sent_type(context: &Context, publisher: Gid) -> Option<String> {
    let writers = context.domain_participant().discovered_writers();
    let writer =
        writers.into_iter().find(|writer| Gid::from(writer.writer_proxy.remote_writer_guid) == publisher)?;
    Some(writer.publication_topic_data.type_name)
}

/// `/chatter` from `rt/chatter`; `None` if it is not a ROS topic.
fn ros_name(dds_topic: &str) -> Option<String> {
    dds_topic.strip_prefix("rt/").map(|name| format!("/{name}"))
}

/// `std_msgs/String` from `std_msgs::msg::dds_::String_`, and `nav2_msgs/action/NavigateToPose_FeedbackMessage` of an action; `None` if
/// it is not a ROS message.
fn ros_type(dds_type: &str) -> Option<String> {
    let plain = |name: &str| name.strip_suffix('_').map(str::to_owned);
    if let Some((package, name)) = dds_type.split_once("::action::dds_::") {
        return Some(format!("{package}/action/{}", plain(name)?));
    }
    let (package, name) = dds_type.split_once("::msg::dds_::")?;
    Some(format!("{package}/{}", plain(name)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dds_names_turn_into_ros_names() {
        assert_eq!(ros_name("rt/a/b").unwrap(), "/a/b");
        assert_eq!(ros_name("rq/a/b"), None);
        assert_eq!(ros_type("std_msgs::msg::dds_::String_").unwrap(), "std_msgs/String");
        assert_eq!(
            ros_type("nav2_msgs::action::dds_::NavigateToPose_FeedbackMessage_").unwrap(),
            "nav2_msgs/action/NavigateToPose_FeedbackMessage"
        );
        assert_eq!(ros_type("rcl_interfaces::srv::dds_::GetParameters_Request_"), None);
    }
}
