//! Detects a deadlock of the DDS library.
//!
//! RustDDS 0.15.1 takes two of its locks in opposite orders. When a handshake ends, its discovery thread holds the
//! security plugins and wants the list of participants (`validate_remote_participant_permissions`). Its event loop
//! holds that list and wants the plugins (`update_participant`). Both only read the list, so both could continue.
//! But if a third thread waits to add an endpoint of this node to the list, readers wait behind it, and none of the
//! three can continue.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::{thread, time::Duration};

/// Time between an answer and the next question.
const PERIOD: Duration = Duration::from_secs(1);
/// How long to wait for an answer; it is waited for twice.
pub(crate) const PATIENCE: Duration = Duration::from_secs(4);

/// Asks from time to time until `ask` returns that there is nothing left to ask. If there is no answer, `on_hang`
/// is called once.
pub(crate) fn watch(
    ask: impl Fn() -> bool + Send + 'static,
    patience: Duration,
    on_hang: impl FnOnce() + Send + 'static,
) {
    let (answer, answers) = mpsc::channel();
    let question = move || {
        while ask() && answer.send(()).is_ok() {
            thread::sleep(PERIOD);
        }
    };
    let wait = move || {
        let mut silent = false;
        loop {
            match answers.recv_timeout(patience) {
                Ok(()) => silent = false,
                Err(RecvTimeoutError::Disconnected) => return,
                // A process that was stopped for a while finds its time-out expired. The second wait covers that.
                Err(RecvTimeoutError::Timeout) if !silent => silent = true,
                Err(RecvTimeoutError::Timeout) => return on_hang(),
            }
        }
    };
    // Without these threads nobody detects a deadlock.
    let _ = thread::Builder::new().name("dds question".into()).spawn(question);
    let _ = thread::Builder::new().name("dds watchdog".into()).spawn(wait);
}

#[cfg(test)]
mod tests {
    use std::sync::{
        Arc, Mutex,
        atomic::{AtomicU32, Ordering},
    };

    use super::*;

    #[test]
    fn who_gives_no_answer_is_told_of_once() {
        let (locked, hung) = (Arc::new(Mutex::new(())), mpsc::channel());
        let held = locked.lock().unwrap();
        let asked = locked.clone();
        watch(move || asked.lock().is_ok(), Duration::from_millis(20), move || hung.0.send(()).unwrap());
        hung.1.recv().unwrap();
        drop(held);
        // the sender was dropped after its only call
        assert!(hung.1.recv().is_err());
    }

    #[test]
    fn who_answers_to_the_end_is_not() {
        let (asked, hung) = (AtomicU32::new(0), mpsc::channel());
        let ask = move || asked.fetch_add(1, Ordering::SeqCst) < 2;
        watch(ask, PATIENCE, move || hung.0.send(()).unwrap());
        assert!(hung.1.recv().is_err());
    }
}
