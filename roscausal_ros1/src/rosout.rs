//! Logs go to `/rosout` too, where `rqt_console` and `rosbag` find them.

use std::{
    cell::Cell,
    fmt::{Debug, Write as _},
    sync::{Arc, Mutex, PoisonError, Weak},
};

use roscausal_msgs::{rosgraph_msgs::Log, std_msgs::Header};
use tracing::{
    Event, Level, Subscriber,
    field::{Field, Visit},
};
use tracing_subscriber::{Layer, layer::Context};

use crate::session::Session;

/// A `tracing` layer that publishes on `/rosout` once a node is attached.
#[derive(Clone, Default)]
pub struct Rosout {
    session: Arc<Mutex<Option<Weak<Session>>>>,
}

thread_local! {
    /// Publishing may log; that line stays on the terminal.
    static BUSY: Cell<bool> = const { Cell::new(false) };
}

impl Rosout {
    /// Publishes from now on in the name of this node.
    pub fn attach(&self, node: &crate::Ros1) {
        *self.session.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::downgrade(&node.session));
    }
}

impl<S: Subscriber> Layer<S> for Rosout {
    fn on_event(&self, event: &Event<'_>, _context: Context<'_, S>) {
        if BUSY.replace(true) {
            return;
        }
        let session = self.session.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(session) = session.and_then(|session| session.upgrade()) {
            let mut text = Text::default();
            event.record(&mut text);
            let meta = event.metadata();
            let level = match *meta.level() {
                Level::ERROR => Log::ERROR,
                Level::WARN => Log::WARN,
                Level::INFO => Log::INFO,
                _ => Log::DEBUG,
            };
            session.log(Log {
                header: Header { stamp: session.clock.now(), frame_id: String::new() },
                level,
                name: session.master.node.clone(),
                msg: text.message + &text.fields,
                file: meta.file().unwrap_or_default().to_owned(),
                function: meta.target().to_owned(),
                line: meta.line().unwrap_or_default(),
                topics: session.published(),
            });
        }
        BUSY.set(false);
    }
}

#[derive(Default)]
struct Text {
    message: String,
    fields: String,
}

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        // writing into a String cannot fail
        let _ = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name if name.starts_with("log.") => Ok(()),
            name => write!(self.fields, " {name}={value:?}"),
        };
    }
}
