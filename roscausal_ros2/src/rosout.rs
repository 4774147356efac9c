//! Log messages on `/rosout`.

use std::sync::{Arc, Mutex};

use ros2_client::{
    Log, QosProfile,
    qos::{Durability, History, WhenFull},
};
use roscausal_core::Result;
use roscausal_ros::Console;
use tracing::Level;

use crate::{Ros2, topics::Writer};

/// `/rosout` keeps at most this many messages for late joiners.
const HISTORY: usize = 200;

impl Ros2 {
    /// Sends what is logged to `/rosout` as well, for as long as the node lives.
    ///
    /// # Errors
    /// When the topic cannot be made.
    pub fn log_with(&self, console: &Console) -> Result<()> {
        let inner = self.inner();
        let topic = inner.session(|session| session.context.get_rosout_topic())?;
        let profile = QosProfile::publisher_default()
            .reliability_reliable(WhenFull::Fail)
            .durability(Durability::TransientLocal)
            .history(History::KeepLast { depth: HISTORY });
        let writer = Mutex::new(Writer::new(inner, topic, profile, HISTORY)?);
        let name = inner.names.logger();
        let node = Arc::downgrade(inner);
        console.forward(move |record| {
            // What another thread logs while a message is being sent is not sent: it might wait for itself.
            let (Some(node), Ok(mut writer)) = (node.upgrade(), writer.try_lock()) else { return };
            let now = node.clock.now();
            let log = Log {
                stamp: ros2_client::builtin_interfaces::Time::new(now.sec, now.nanosec),
                level: match record.level {
                    Level::ERROR => Log::ERROR,
                    Level::WARN => Log::WARN,
                    Level::INFO => Log::INFO,
                    Level::DEBUG | Level::TRACE => Log::DEBUG,
                },
                name: name.clone(),
                msg: record.text,
                file: record.file,
                function: record.function,
                line: record.line,
            };
            let _ = writer.write(&node, log);
        });
        Ok(())
    }
}
