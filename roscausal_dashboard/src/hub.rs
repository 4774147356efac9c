//! Passes events from the node to the browsers.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Arc, Mutex, MutexGuard, mpsc::SyncSender},
};

use roscausal_core::{gate::lock, nodes::SceneOptions};
use roscausal_discovery::Model;
use tokio::sync::broadcast;

use crate::{ahead::Ahead, asked::Asked, history::History};

/// Frames that a browser may fall behind before it is dropped. It reconnects by itself and gets everything again.
const BEHIND: usize = 256;
/// Models and messages kept for later browsers, of each kind.
const KEPT: usize = 200;
/// Evidence kept for later browsers: it is much larger.
const KEPT_LARGE: usize = 20;

/// One event for the page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Frame {
    /// `scene`, `walls`, `status`, `model`, `summary`, `evidence`, `change`, `prediction`, `explanation`, `message` or `ended`.
    pub(crate) kind: &'static str,
    /// JSON without line breaks.
    pub(crate) data: Arc<str>,
}

/// Which frames a later browser gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// The last frame of its kind.
    Last,
    /// All frames of its kind, up to the newest [`KEPT`].
    All,
    /// The newest [`KEPT_LARGE`] frames of its kind.
    Few,
}

/// Sends frames from the node to any number of browsers. Never blocks.
#[derive(Clone)]
pub(crate) struct Hub {
    frames: broadcast::Sender<Frame>,
    kept: Arc<Mutex<Kept>>,
    history: Arc<Mutex<History>>,
    ahead: Arc<Mutex<Ahead>>,
    /// The newest models by their number, which are drawn for who asks.
    models: Arc<Mutex<BTreeMap<u64, Model>>>,
    /// Where readers' questions go; `None`: there is nobody who answers.
    questions: Arc<Mutex<Option<SyncSender<Asked>>>>,
}

#[derive(Default)]
struct Kept {
    last: BTreeMap<&'static str, Frame>,
    all: BTreeMap<&'static str, VecDeque<Frame>>,
}

impl Hub {
    pub(crate) fn new() -> Self {
        let history = Arc::new(Mutex::new(History::new(SceneOptions::default())));
        Self {
            frames: broadcast::channel(BEHIND).0,
            kept: Arc::default(),
            history,
            ahead: Arc::default(),
            models: Arc::default(),
            questions: Arc::default(),
        }
    }

    /// Sends a frame to all browsers, and keeps it for later ones.
    pub(crate) fn send(&self, frame: Frame, keep: Keep) {
        let mut kept = lock(&self.kept);
        if keep == Keep::Last {
            kept.last.insert(frame.kind, frame.clone());
        } else {
            let frames = kept.all.entry(frame.kind).or_default();
            frames.push_back(frame.clone());
            if frames.len() > if keep == Keep::Few { KEPT_LARGE } else { KEPT } {
                frames.pop_front();
            }
        }
        // Under the lock, so that a new browser gets it exactly once. It is no error if there is no browser.
        let _ = self.frames.send(frame);
    }

    /// The run so far. Held only for a moment: the node waits for it.
    pub(crate) fn history(&self) -> MutexGuard<'_, History> {
        lock(&self.history)
    }

    /// What may come. Held only for a moment, as the history.
    pub(crate) fn ahead(&self) -> MutexGuard<'_, Ahead> {
        lock(&self.ahead)
    }

    /// Keeps a model to be drawn.
    pub(crate) fn keep_model(&self, number: u64, model: Model) {
        let mut models = lock(&self.models);
        models.insert(number, model);
        if models.len() > KEPT {
            models.pop_first();
        }
    }

    /// A model.
    pub(crate) fn model(&self, number: u64) -> Option<Model> {
        lock(&self.models).get(&number).cloned()
    }

    /// Who answers readers' questions from now on.
    pub(crate) fn ask_at(&self, questions: Option<SyncSender<Asked>>) {
        *lock(&self.questions) = questions;
    }

    /// Passes a question on. Returns whether somebody will answer it.
    pub(crate) fn ask(&self, asked: Asked) -> bool {
        lock(&self.questions).as_ref().is_some_and(|questions| questions.try_send(asked).is_ok())
    }

    /// What a new browser gets first, and the stream of what follows.
    pub(crate) fn join(&self) -> (Vec<Frame>, broadcast::Receiver<Frame>) {
        let kept = lock(&self.kept);
        let first = kept.last.values().chain(kept.all.values().flatten()).cloned().collect();
        (first, self.frames.subscribe())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(kind: &'static str, data: &str) -> Frame {
        Frame { kind, data: data.into() }
    }

    #[test]
    fn a_late_browser_gets_the_last_scene_and_all_models() {
        let hub = Hub::new();
        for n in ["1", "2"] {
            hub.send(frame("scene", n), Keep::Last);
            hub.send(frame("model", n), Keep::All);
        }
        let (first, mut frames) = hub.join();
        assert_eq!(first, [frame("scene", "2"), frame("model", "1"), frame("model", "2")]);
        hub.send(frame("scene", "3"), Keep::Last);
        assert_eq!(frames.try_recv().ok(), Some(frame("scene", "3")));
        assert!(frames.try_recv().is_err());
    }

    #[test]
    fn memory_is_bounded_whoever_reads() {
        let hub = Hub::new();
        let (_, mut slow) = hub.join();
        (0..10_000).for_each(|n| hub.send(frame("model", &n.to_string()), Keep::All));
        assert_eq!(hub.join().0.len(), KEPT);
        assert!(matches!(slow.try_recv(), Err(broadcast::error::TryRecvError::Lagged(_))));
    }
}
