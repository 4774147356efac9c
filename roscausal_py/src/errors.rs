//! The engine's errors as Python's exceptions. The sentences are the engine's, with Python's names of the settings.

use pyo3::{PyErr, create_exception, exceptions::PyValueError};
use roscausal_core::visible;

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

/// The command's spelling of a setting, and Python's.
const DASHED: [(&str, &str); 18] = [
    ("tau-max", "tau_max"),
    ("tau-min", "tau_min"),
    ("pc-alpha", "pc_alpha"),
    ("f-alpha", "f_alpha"),
    ("te-estimator", "te_estimator"),
    ("gp-search", "gp_search"),
    ("acts-on", "acts_on"),
    ("gp-restarts", "gp_restarts"),
    ("time-budget", "time_budget"),
    ("max-memory", "max_memory"),
    ("null-dist", "null_dist"),
    ("max-conds", "max_conds"),
    ("max-sets", "max_sets"),
    ("extra-conditions", "extra_conditions"),
    ("setting 'vector'", "setting 'vectors'"),
    ("robot-odom", "robot_odom"),
    ("several-people", "several_people"),
    ("human-goal", "human_goal"),
];

/// A sentence with Python's names.
pub(crate) fn in_pythons_words(sentence: &str) -> String {
    let flags = visible::message(sentence).replace("--", "");
    DASHED.iter().fold(flags, |text, (theirs, ours)| text.replace(theirs, ours))
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
            SettingError::new_err(in_pythons_words(&format!("setting '{name}': {reason}")))
        }
        Error::Cancelled(reason) => Cancelled::new_err(visible::message(&format!("cancelled: {reason}"))),
        other => DataError::new_err(in_pythons_words(&other.to_string())),
    }
}
