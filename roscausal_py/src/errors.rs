//! The engine's errors as Python's exceptions. The sentences are the engine's; settings have their names of Python.

use pyo3::{PyErr, create_exception, exceptions::PyValueError};
use roscausal_core::visible;
use roscausal_discovery::{settings::setting, spelled_out};

create_exception!(
    roscausal,
    DataError,
    PyValueError,
    "The data do not allow the analysis, or a file cannot be read; the message says where and what to do.\n\nExample:\n\n\
     >>> import numpy, roscausal as rc\n>>> try:\n...     rc.discover(numpy.zeros((3, 2)))\n... except rc.DataError as error:\n\
     ...     print(type(error).__name__)\nDataError\n"
);
create_exception!(
    roscausal,
    SettingError,
    PyValueError,
    "A setting's name or value is not allowed; the message names it and what is allowed.\n\nExample:\n\n\
     >>> import numpy, roscausal as rc\n>>> try:\n...     rc.discover(numpy.zeros((9, 2)), alpha=2)\n... except rc.SettingError as error:\n\
     ...     print(error)\nsetting 'alpha': 2 is not a level; give a number between 0 and 1, such as 0.05\n"
);
create_exception!(
    roscausal,
    Cancelled,
    PyValueError,
    "The analysis was cancelled before its end.\n\nExample:\n\n>>> import roscausal as rc\n>>> issubclass(rc.Cancelled, ValueError)\nTrue\n"
);

/// A setting as Python calls it. An id is the name in Python; an argument of the command has `_` for `-`.
pub(crate) fn named(id: &str) -> String {
    setting(id).map_or_else(|| id.trim_start_matches('-').replace('-', "_"), |setting| setting.id.to_owned())
}

/// An engine's error as an exception.
pub(crate) fn raised(error: roscausal_discovery::Error) -> PyErr {
    raised_by_program(error.into())
}

/// A program's error as an exception.
pub(crate) fn raised_by_program(error: roscausal_core::Error) -> PyErr {
    use roscausal_core::Error;
    match error {
        Error::Param { name, reason } => {
            let sentence = format!("setting '{}': {}", named(&name), spelled_out(&reason, named));
            SettingError::new_err(visible::message(&sentence))
        }
        Error::Cancelled(reason) => Cancelled::new_err(visible::message(&format!("cancelled: {reason}"))),
        other => DataError::new_err(visible::message(&spelled_out(&format!("{other:#}"), named))),
    }
}
