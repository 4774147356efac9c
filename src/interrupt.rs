//! Ctrl-C and SIGTERM: a request to end cleanly, and an end within a second where nothing is at stake.

use std::{
    path::PathBuf,
    process::exit,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use roscausal_core::{Error, Result};
use roscausal_discovery::lock;

/// Exit code of a command that Ctrl-C ended: 128 and the number of the signal, as shells count.
pub(crate) const CODE: u8 = 130;
/// What is said where a recording is kept.
const RECORDED: &str = "what is recorded is kept (again: end at once)";
/// How long a command has to end by itself.
const PATIENCE: Duration = Duration::from_millis(600);
/// Time between two looks whether something is still at stake.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// Whether the user wants the command to end.
#[derive(Clone)]
pub(crate) struct Interrupt {
    flag: Arc<AtomicBool>,
    state: Arc<Mutex<State>>,
}

struct State {
    /// What to say when the command ends.
    words: &'static str,
    /// Whether an end at once loses something.
    at_stake: bool,
    /// What is done on the way out.
    last: Vec<Box<dyn FnOnce() + Send>>,
}

impl Interrupt {
    /// Turns the first Ctrl-C (or SIGTERM) into a request to end. Where nothing is at stake the process ends soon after
    /// it, whatever it computes. The second one ends the process at once.
    pub(crate) fn on_ctrl_c() -> Self {
        let this = Self::on(Arc::new(AtomicBool::new(false)));
        let asked = this.clone();
        let caught = ctrlc::set_handler(move || {
            if asked.flag.swap(true, Ordering::SeqCst) {
                asked.leave();
            }
            tell!("ending; {}", asked.with(|state| state.words));
            let watch = asked.clone();
            thread::spawn(move || watch.end_soon());
        });
        if let Err(error) = caught {
            tracing::warn!("Ctrl-C will end without saving: {error}");
        }
        this
    }

    /// A wish that another program tells by `flag`.
    pub(crate) fn on(flag: Arc<AtomicBool>) -> Self {
        let state = State { words: RECORDED, at_stake: true, last: Vec::new() };
        Self { state: Arc::new(Mutex::new(state)), flag }
    }

    /// Whether the command has to end.
    pub(crate) fn is_set(&self) -> bool {
        self.flag.load(Ordering::SeqCst)
    }

    /// Ends what goes on as soon as the user wants it.
    ///
    /// # Errors
    /// The user wants the command to end.
    pub(crate) fn check(&self) -> Result<()> {
        if self.is_set() { Err(Error::Cancelled("by the user".into())) } else { Ok(()) }
    }

    /// The flag itself, for whatever can be cancelled.
    pub(crate) fn flag(&self) -> Arc<AtomicBool> {
        self.flag.clone()
    }

    /// From now on an end at once loses nothing: all that counts is on disk, or there is no result yet. `words` say so.
    pub(crate) fn nothing_at_stake(&self, words: &'static str) {
        self.with(|state| (state.words, state.at_stake) = (words, false));
    }

    /// From now on something is recorded, as at the beginning.
    pub(crate) fn recording(&self) {
        self.with(|state| (state.words, state.at_stake) = (RECORDED, true));
    }

    /// From now on files are written: they are completed first.
    pub(crate) fn writing(&self) {
        self.with(|state| (state.words, state.at_stake) = ("the files are completed first", true));
    }

    /// A folder that an end at once removes, although other threads may still write into it.
    pub(crate) fn remove_at_end(&self, folder: PathBuf) {
        self.do_at_end(move || {
            for _ in 0..50 {
                if std::fs::remove_dir_all(&folder).is_ok() || !folder.exists() {
                    return;
                }
                thread::sleep(LOOK_AGAIN);
            }
        });
    }

    /// What an end at once does first; soon done.
    pub(crate) fn do_at_end(&self, last: impl FnOnce() + Send + 'static) {
        self.with(|state| state.last.push(Box::new(last)));
    }

    fn with<T>(&self, f: impl FnOnce(&mut State) -> T) -> T {
        f(&mut lock(&self.state))
    }

    /// Ends the process once nothing is at stake, if it has not ended by itself.
    fn end_soon(&self) {
        thread::sleep(PATIENCE);
        while self.with(|state| state.at_stake) {
            thread::sleep(LOOK_AGAIN);
        }
        self.leave();
    }

    fn leave(&self) -> ! {
        self.with(|state| std::mem::take(&mut state.last)).into_iter().for_each(|last| last());
        exit(CODE.into());
    }
}
