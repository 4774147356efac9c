//! A library that has locked itself up is noticed.
//!
//! RustDDS 0.15.1 takes two of its locks in opposite orders. When a handshake ends its discovery thread holds the security
//! plugins and asks for the list of participants (`validate_remote_participant_permissions`); its event loop holds that list
//! and asks for the plugins (`update_participant`). Both would get by, since both only read the list; but while a third
//! thread waits to enter an endpoint of this node there, readers wait behind it, and none of the three ever goes on.

use std::{
    sync::mpsc::{self, RecvTimeoutError},
    thread,
    time::Duration,
};

/// Between an answer and the next question.
const PERIOD: Duration = Duration::from_secs(1);
/// How long one waits for an answer, twice.
pub(crate) const PATIENCE: Duration = Duration::from_secs(4);

/// Asks from time to time, until `ask` says that there is nothing left to ask; `on_hang` is called once, when it gives
/// no answer.
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
                // A process that was stopped for a while finds its time run out: the second wait is after that.
                Err(RecvTimeoutError::Timeout) if !silent => silent = true,
                Err(RecvTimeoutError::Timeout) => return on_hang(),
            }
        }
    };
    // Without these threads nobody notices.
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
        // the sender went with the only call
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
