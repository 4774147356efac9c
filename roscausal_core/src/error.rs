//! Errors that name the place and the way out.

use std::{io::Write, path::PathBuf};

use roscausal_discovery::visible;

/// What went wrong, where, and what to do about it: each message is one sentence for the user.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A parameter's value is not allowed.
    #[error("parameter '{name}': {reason}")]
    Param {
        /// Parameter name as the user wrote it.
        name: String,
        /// What is wrong, with the allowed values.
        reason: String,
    },
    /// A topic cannot be used.
    #[error("topic '{topic}': {reason}")]
    Topic {
        /// Resolved topic name.
        topic: String,
        /// What is wrong.
        reason: String,
    },
    /// A service cannot be offered, or gives no answer.
    #[error("service '{service}': {reason}")]
    Service {
        /// Resolved service name.
        service: String,
        /// What is wrong.
        reason: String,
    },
    /// The middleware itself fails.
    #[error("middleware: {0}")]
    Middleware(String),
    /// A file cannot be read, written or understood.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong, with line and column where there are any.
        reason: String,
    },
    /// The data does not allow the requested analysis.
    #[error("{0}")]
    Data(String),
    /// The work was cancelled or ran out of its time budget.
    #[error("cancelled: {0}")]
    Cancelled(String),
}

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl From<roscausal_discovery::Error> for Error {
    fn from(error: roscausal_discovery::Error) -> Self {
        use roscausal_discovery::Error as Of;
        match error {
            Of::Param { name, reason } => Self::Param { name, reason },
            Of::Data(reason) => Self::Data(reason),
            Of::Cancelled(reason) => Self::Cancelled(reason),
        }
    }
}

impl Error {
    /// An [`Error::File`] from any displayable reason.
    pub fn file(path: impl Into<PathBuf>, reason: impl std::fmt::Display) -> Self {
        Self::File { path: path.into(), reason: reason.to_string() }
    }

    /// An [`Error::Param`] from any displayable reason.
    pub fn param(name: impl Into<String>, reason: impl std::fmt::Display) -> Self {
        Self::Param { name: name.into(), reason: reason.to_string() }
    }
}

/// From now on, the message of a panic obeys the rules of [`visible`]; a backtrace, where one is wanted, is Rust's own.
pub fn spell_out_panics() {
    if std::env::var_os("RUST_BACKTRACE").is_none() {
        std::panic::set_hook(Box::new(|panic| {
            let _ = writeln!(std::io::stderr(), "{}", visible::lines(&panic.to_string()));
        }));
    }
}
