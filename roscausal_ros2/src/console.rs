//! Log messages: to stderr as ROS 2 prints them, and to `/rosout`.

use std::{
    fmt::Write as _,
    io::Write as _,
    sync::{Arc, Mutex, Weak},
    time::SystemTime,
};

use ros2_client::{
    Log, QosProfile,
    qos::{Durability, History, WhenFull},
};
use roscausal_core::Result;
use tracing::{
    Event, Level, Subscriber,
    field::{Field, Visit},
    level_filters::LevelFilter,
};
use tracing_subscriber::{
    Layer,
    filter::Targets,
    layer::{Context, SubscriberExt},
    util::SubscriberInitExt,
};

use crate::{
    Ros2,
    node::{Inner, lock},
    topics::Writer,
};

/// `/rosout` keeps at most this many messages for late joiners.
const ROSOUT_HISTORY: usize = 200;

/// Where log messages go. Cheap to clone.
#[derive(Clone)]
pub struct Console {
    logger: Arc<Mutex<String>>,
    rosout: Arc<Mutex<Option<Rosout>>>,
}

struct Rosout {
    node: Weak<Inner>,
    writer: Writer<Log>,
}

impl Console {
    /// Becomes the process's log: this project's messages from `level` on, the libraries' only when grave.
    pub fn install(level: LevelFilter) -> Self {
        let console = Self { logger: Arc::default(), rosout: Arc::default() };
        let filter = Targets::new()
            .with_default(LevelFilter::WARN)
            .with_target("roscausal", level)
            // Both report as errors what is ordinary on a network.
            .with_target("rustdds", LevelFilter::OFF)
            .with_target("ros2_client", LevelFilter::OFF);
        // A second log in one process (tests) changes nothing.
        let _ = tracing_subscriber::registry().with(console.clone().with_filter(filter)).try_init();
        console
    }

    /// Prints under this logger's name, such as `ns.robot`.
    pub fn name(&self, logger: &str) {
        *lock(&self.logger) = logger.to_owned();
    }

    /// Sends to `/rosout` as well, for as long as the node lives.
    ///
    /// # Errors
    /// When the topic cannot be made.
    pub fn forward(&self, node: &Ros2) -> Result<()> {
        let topic = node.inner().session(|session| session.context.get_rosout_topic())?;
        let profile = QosProfile::publisher_default()
            .reliability_reliable(WhenFull::Fail)
            .durability(Durability::TransientLocal)
            .history(History::KeepLast { depth: ROSOUT_HISTORY });
        let writer = Writer::new(node.inner(), topic, profile, ROSOUT_HISTORY)?;
        *lock(&self.rosout) = Some(Rosout { node: Arc::downgrade(node.inner()), writer });
        Ok(())
    }
}

impl<S: Subscriber> Layer<S> for Console {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut text = Text::default();
        event.record(&mut text);
        let metadata = event.metadata();
        let (word, level) = match *metadata.level() {
            Level::ERROR => ("ERROR", Log::ERROR),
            Level::WARN => ("WARN", Log::WARN),
            Level::INFO => ("INFO", Log::INFO),
            Level::DEBUG | Level::TRACE => ("DEBUG", Log::DEBUG),
        };
        let logger = lock(&self.logger).clone();
        let since_epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let stamp = format!("{}.{:09}", since_epoch.as_secs(), since_epoch.subsec_nanos());
        // A closed stderr is no reason to stop.
        let _ = writeln!(std::io::stderr(), "[{word}] [{stamp}] [{logger}]: {}", text.0);
        // What happens while a message is being sent is not sent: it would wait for itself.
        let Ok(mut rosout) = self.rosout.try_lock() else { return };
        let Some(Rosout { node, writer }) = rosout.as_mut() else { return };
        let Some(node) = node.upgrade() else { return };
        let now = node.now();
        let log = Log {
            stamp: ros2_client::builtin_interfaces::Time::new(now.sec, now.nanosec),
            level,
            name: logger,
            msg: text.0,
            file: metadata.file().unwrap_or_default().to_owned(),
            function: metadata.target().to_owned(),
            line: metadata.line().unwrap_or_default(),
        };
        let _ = writer.write(&node, log);
    }
}

/// An event's message, and its other fields behind it as `name=value`.
#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        // Writing into a String cannot fail.
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name if name.starts_with("log.") => Ok(()),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}
