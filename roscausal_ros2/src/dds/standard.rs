//! The topics on which every ROS 2 node publishes: `/rosout` and `/parameter_events`.

use ros2_client::{
    Log, QosProfile,
    parameters::raw::ParameterEvent,
    qos::{Durability, History, WhenFull},
};
use roscausal_core::Result;

use super::{Participant, Writer};

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
}

fn reliable(depth: usize) -> QosProfile {
    QosProfile::publisher_default().reliability_reliable(WhenFull::Fail).history(History::KeepLast { depth })
}
