//! Ctrl-C and SIGTERM as a flag that everything checks.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

/// Whether the user wants the command to end.
#[derive(Clone)]
pub(crate) struct Interrupt {
    flag: Arc<AtomicBool>,
}

impl Interrupt {
    /// Turns the first Ctrl-C (or SIGTERM) into a request to end cleanly. The second one ends the process at once.
    pub(crate) fn on_ctrl_c() -> Self {
        let flag = Arc::new(AtomicBool::new(false));
        let wish = flag.clone();
        let caught = ctrlc::set_handler(move || {
            if wish.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
            crate::terminal::tell!("ending; what is recorded is kept (again: end at once)");
        });
        if let Err(error) = caught {
            tracing::warn!("Ctrl-C will end without saving: {error}");
        }
        Self { flag }
    }

    /// A wish that another program tells by `flag`.
    pub(crate) fn on(flag: Arc<AtomicBool>) -> Self {
        Self { flag }
    }

    /// Whether the command has to end.
    pub(crate) fn is_set(&self) -> bool {
        self.flag.load(Ordering::SeqCst)
    }

    /// The flag itself, for whatever can be cancelled.
    pub(crate) fn flag(&self) -> Arc<AtomicBool> {
        self.flag.clone()
    }
}
