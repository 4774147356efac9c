//! Errors that name the place and the way out.

use std::fmt::Display;

use super::{
    names::instead,
    words::{Named, spelled_out},
};

/// Largest lag of an analysis: more would take memory for pairs and lags that nobody reads.
pub(crate) const MOST_LAG: usize = 100_000;

/// What went wrong, where, and what to do about it: each message is one sentence for the user.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter's value is not allowed.
    #[error("parameter '{name}': {}", plain(reason))]
    Param {
        /// Id of the setting, or name of the argument.
        name: String,
        /// What is wrong, with the allowed values; settings are [`Named`].
        reason: String,
    },
    /// The data does not allow the requested analysis.
    #[error("{}", plain(.0))]
    Data(String),
    /// The work was cancelled or ran out of its time budget.
    #[error("cancelled: {}", plain(.0))]
    Cancelled(String),
}

/// A sentence with the ids of its settings.
fn plain(sentence: &str) -> String {
    spelled_out(sentence, str::to_owned)
}

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Refuses that for which something does not hold.
///
/// # Errors
/// It does not.
#[doc(hidden)]
pub fn ensure<E>(holds: bool, fault: impl FnOnce() -> E) -> std::result::Result<(), E> {
    if holds { Ok(()) } else { Err(fault()) }
}

impl Error {
    /// The [`Error::Param`] of a word that is none of those `allowed`; it names the nearest one.
    pub fn unknown(name: &str, value: &str, allowed: &[&str]) -> Self {
        Self::param(name, format!("'{value}' is unknown; {}", instead(allowed, value, "allowed:")))
    }

    /// Refuses a largest lag below the smallest one, or above [`MOST_LAG`].
    pub(crate) fn check_lags(tau_min: usize, tau_max: usize) -> Result<()> {
        Self::ensure(tau_max >= tau_min, "tau_max", || {
            format!("{tau_max} is below {} {tau_min}", Named("tau_min"))
        })?;
        Self::ensure(tau_max <= MOST_LAG, "tau_max", || {
            format!("{tau_max} is above {MOST_LAG}; give a smaller lag, or take a longer step between rows")
        })
    }

    /// Refuses a setting for which something does not hold.
    ///
    /// # Errors
    /// It does not.
    pub fn ensure<R: Display>(holds: bool, name: &str, reason: impl FnOnce() -> R) -> Result<()> {
        ensure(holds, || Self::param(name, reason()))
    }

    /// Refuses data for which something does not hold.
    ///
    /// # Errors
    /// It does not.
    pub fn ensure_data<R: Display>(holds: bool, reason: impl FnOnce() -> R) -> Result<()> {
        ensure(holds, || Self::Data(reason().to_string()))
    }

    /// An [`Error::Param`] from any displayable reason.
    pub fn param(name: impl Into<String>, reason: impl Display) -> Self {
        Self::Param { name: name.into(), reason: reason.to_string() }
    }
}
