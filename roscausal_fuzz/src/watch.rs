//! Ends the process when a decoder does not end.

use std::{
    path::Path,
    process,
    sync::{Arc, Mutex, PoisonError, Weak},
    thread,
    time::{Duration, Instant},
};

/// An input that takes as long takes for ever.
const ENDLESS: Duration = Duration::from_secs(600);
const LOOK_AGAIN: Duration = Duration::from_secs(1);

/// The input that is being decoded, and since when.
type Present = Mutex<Option<(Instant, Vec<u8>)>>;

/// A thread that looks at the input that is being decoded. It ends when this is dropped.
pub(crate) struct Watch(Arc<Present>);

impl Watch {
    pub(crate) fn start(corpus: &Path) -> Self {
        let present = Arc::new(Present::default());
        let (seen, corpus) = (Arc::downgrade(&present), corpus.to_owned());
        thread::spawn(move || look(&seen, &corpus));
        Self(present)
    }

    pub(crate) fn begin(&self, input: &[u8]) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((Instant::now(), input.to_vec()));
    }

    pub(crate) fn end(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

fn look(seen: &Weak<Present>, corpus: &Path) {
    while let Some(present) = seen.upgrade() {
        let present = present.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some((_, input)) = present.filter(|(since, _)| since.elapsed() > ENDLESS) {
            let path = crate::keep(corpus, &input);
            eprintln!("finding: {}, which does not end", path.display());
            process::abort();
        }
        thread::sleep(LOOK_AGAIN);
    }
}
