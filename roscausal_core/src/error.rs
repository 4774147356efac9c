//! Errors that name the place and the way out.

use std::{fmt, io::Write, path::PathBuf};

use roscausal_discovery::{ensure, settings::setting, spelled_out, visible};

/// What went wrong, where, and what to do about it: each message is one sentence for the user.
/// `{}` writes settings as the nodes' parameters are called, `{:#}` leaves them for [`spelled_out`].
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// A parameter's value is not allowed.
    Param {
        /// Parameter name as the user wrote it.
        name: String,
        /// What is wrong, with the allowed values.
        reason: String,
    },
    /// A topic cannot be used.
    Topic {
        /// Resolved topic name.
        topic: String,
        /// What is wrong.
        reason: String,
    },
    /// A service cannot be offered, or gives no answer.
    Service {
        /// Resolved service name.
        service: String,
        /// What is wrong.
        reason: String,
    },
    /// The middleware itself fails.
    Middleware(String),
    /// A file cannot be read, written or understood.
    File {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong, with line and column where there are any.
        reason: String,
    },
    /// The data does not allow the requested analysis.
    Data(String),
    /// The work was cancelled or ran out of its time budget.
    Cancelled(String),
}

/// A setting as the nodes' parameters are called.
pub(crate) fn parameter(name: &str) -> String {
    setting(name).map_or(name, |setting| setting.param).to_owned()
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sentence = match self {
            Self::Param { name, reason } => format!("parameter '{}': {reason}", parameter(name)),
            Self::Topic { topic, reason } => format!("topic '{topic}': {reason}"),
            Self::Service { service, reason } => format!("service '{service}': {reason}"),
            Self::Middleware(reason) => format!("middleware: {reason}"),
            Self::File { path, reason } => format!("{}: {reason}", path.display()),
            Self::Data(reason) => reason.clone(),
            Self::Cancelled(reason) => format!("cancelled: {reason}"),
        };
        if f.alternate() { f.write_str(&sentence) } else { f.write_str(&spelled_out(&sentence, parameter)) }
    }
}

impl std::error::Error for Error {}

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl From<roscausal_discovery::Error> for Error {
    fn from(error: roscausal_discovery::Error) -> Self {
        use roscausal_discovery::Error as Of;
        match error {
            Of::Param { name, reason } => Self::Param { name, reason },
            Of::Data(reason) => Self::Data(reason),
            Of::Cancelled(reason) => Self::Cancelled(reason),
            other => Self::Data(other.to_string()),
        }
    }
}

impl Error {
    /// An [`Error::File`] from any displayable reason.
    pub fn file(path: impl Into<PathBuf>, reason: impl std::fmt::Display) -> Self {
        Self::File { path: path.into(), reason: reason.to_string() }
    }

    /// An error of the engine; what is wrong with rules about links is in the file of these, if there is one.
    pub fn of_rules(error: roscausal_discovery::Error, file: Option<impl Into<PathBuf>>) -> Self {
        match (Self::from(error), file) {
            (Self::Data(reason), Some(file)) => Self::file(file, reason),
            (error, _) => error,
        }
    }

    /// Refuses a parameter for which something does not hold.
    ///
    /// # Errors
    /// It does not.
    pub fn ensure<R: fmt::Display>(holds: bool, name: &str, reason: impl FnOnce() -> R) -> Result<()> {
        ensure(holds, || Self::param(name, reason()))
    }

    /// Refuses data for which something does not hold.
    ///
    /// # Errors
    /// It does not.
    pub fn ensure_data<R: fmt::Display>(holds: bool, reason: impl FnOnce() -> R) -> Result<()> {
        ensure(holds, || Self::Data(reason().to_string()))
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
