//! Log messages: to stderr in the format of ROS, and to `/rosout`, where `rqt_console` and recordings find them.

use std::fmt::{Debug, Write as _};
use std::sync::{Arc, Mutex};
use std::{cell::Cell, io::Write as _, time::SystemTime};

pub use tracing_subscriber::filter::{LevelFilter, Targets};

use roscausal_core::visible;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, SubscriberExt};
use tracing_subscriber::{Layer, util::SubscriberInitExt};

use crate::lock;

/// One log message.
#[derive(Clone, Debug)]
pub struct Record {
    /// Severity of the message.
    pub level: Level,
    /// The message with its fields.
    pub text: String,
    /// Source file that logged it.
    pub file: String,
    /// Module that logged it.
    pub function: String,
    /// Line in the file.
    pub line: u32,
}

type Forward = Arc<dyn Fn(Record) + Send + Sync>;

/// The destination of log messages. Cheap to clone.
#[derive(Clone, Default)]
pub struct Console {
    logger: Arc<Mutex<String>>,
    rosout: Arc<Mutex<Option<Forward>>>,
}

thread_local! {
    /// This thread is sending a message. What it logs meanwhile goes to the terminal only.
    static BUSY: Cell<bool> = const { Cell::new(false) };
}

impl Console {
    /// Becomes the log of the process, for everything that passes the filter.
    pub fn install(filter: Targets) -> Self {
        let console = Self::default();
        // In tests, a second log in one process changes nothing.
        let _ = tracing_subscriber::registry().with(console.clone().with_filter(filter)).try_init();
        console
    }

    /// Logs under this name, such as `ns.robot`.
    pub fn name(&self, logger: &str) {
        *lock(&self.logger) = logger.to_owned();
    }

    /// Also sends each message to `to`.
    pub fn forward(&self, to: impl Fn(Record) + Send + Sync + 'static) {
        *lock(&self.rosout) = Some(Arc::new(to));
    }
}

impl<S: Subscriber> Layer<S> for Console {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut text = Text::default();
        event.record(&mut text);
        // Whoever reads it, here or on /rosout, sits at a terminal.
        let text = visible::message(&text.0);
        let metadata = event.metadata();
        let level = *metadata.level();
        let since_epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let stamp = format!("{}.{:09}", since_epoch.as_secs(), since_epoch.subsec_nanos());
        let line = format!("[{level}] [{stamp}] [{}]: {}\n", lock(&self.logger), text);
        // A closed stderr is no reason to stop.
        let _ = std::io::stderr().write_all(line.as_bytes());
        if BUSY.replace(true) {
            return;
        }
        let rosout = lock(&self.rosout).clone();
        if let Some(rosout) = rosout {
            rosout(Record {
                level,
                text,
                file: metadata.file().unwrap_or_default().to_owned(),
                function: metadata.target().to_owned(),
                line: metadata.line().unwrap_or_default(),
            });
        }
        BUSY.set(false);
    }
}

/// The message of an event, followed by its other fields as `name=value`.
#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        // Writing into a String cannot fail.
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name if name.starts_with("log.") => Ok(()),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_logged_while_a_message_is_sent_is_not_sent() {
        let sent = Arc::new(Mutex::new(Vec::new()));
        let (console, own) = (Console::default(), sent.clone());
        console.forward(move |record| {
            tracing::warn!("from within");
            lock(&own).push((record.level, record.text));
        });
        let log = tracing_subscriber::registry().with(console);
        tracing::subscriber::with_default(log, || {
            tracing::info!(topic = "/odom", "first");
            tracing::error!("second");
        });
        let first = (Level::INFO, "first topic=\"/odom\"".to_owned());
        assert_eq!(*lock(&sent), [first, (Level::ERROR, "second".to_owned())]);
    }
}
