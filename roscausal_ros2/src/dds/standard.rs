//! The topics on which every ROS 2 node publishes: `/rosout`, `/parameter_events`, and its own name and endpoints.

use ros2_client::builtin_topics::ros_discovery::{QOS_PUB, TOPIC_NAME, TYPE_NAME};
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{Log, QosProfile, parameters::raw::ParameterEvent};
use roscausal_core::{Result, gate::lock, middleware::Qos};
use rustdds::TopicKind;

use super::qos::{self, Side};
use super::{Participant, Writer, participant::middleware};

/// `/rosout` keeps at most this many messages for late joiners.
const LOG_HISTORY: usize = 200;
/// As many changes wait for a subscriber that is behind, as in rcl.
const EVENT_HISTORY: usize = 1000;

impl Participant {
    /// The publisher on `/rosout`.
    ///
    /// # Errors
    /// When the topic cannot be made, or the node has left.
    pub(crate) fn rosout(&self) -> Result<Writer<Log>> {
        let topic = self.session(|session| session.context.get_rosout_topic())?;
        let profile = reliable(LOG_HISTORY).durability(Durability::TransientLocal);
        Writer::new(self, topic, profile, LOG_HISTORY)
    }

    /// The publisher on `/parameter_events`.
    ///
    /// # Errors
    /// As [`Participant::rosout`].
    pub(crate) fn parameter_events(&self) -> Result<Writer<ParameterEvent>> {
        let topic = self.session(|session| session.context.get_parameter_events_topic())?;
        Writer::new(self, topic, reliable(EVENT_HISTORY), usize::MAX)
    }

    /// Announces the node's name and endpoints through a publisher of its own as well. The library's own publisher
    /// is the first endpoint that others discover. If several nodes start at once, Fast DDS sometimes never matches
    /// it. Then nodes that were there before do not list this node.
    ///
    /// With security the library allows one publisher per topic and node, so only its own is used.
    ///
    /// # Errors
    /// If the publisher cannot be created.
    pub(crate) fn announce_again(&self) -> Result<()> {
        if self.secured {
            return Ok(());
        }
        let (name, kind) = (TOPIC_NAME.to_owned(), TYPE_NAME.to_owned());
        let topic = self.session(|session| {
            session.context.domain_participant().create_topic(name, kind, &QOS_PUB, TopicKind::NoKey)
        })?;
        let topic = topic.map_err(|error| middleware("announcement", error))?;
        let mut writer = Writer::new(self, topic, qos::profile(Qos::Latched, Side::Publisher), usize::MAX)?;
        *lock(&self.announcer) = Some(Box::new(move |participant, info| {
            // If one is not accepted, the next one follows.
            let _ = writer.write(participant, info);
        }));
        self.announce();
        Ok(())
    }
}

fn reliable(depth: usize) -> QosProfile {
    QosProfile::publisher_default().reliability_reliable(WhenFull::Fail).history(History::KeepLast { depth })
}
