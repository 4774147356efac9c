//! The native module of the Python package `roscausal`: arrays and plain settings in, a model's JSON or arrays out.
//!
//! | file | what is in it |
//! |---|---|
//! | `frame` | numpy's arrays as a data frame |
//! | `settings` | settings as JSON, read into the engine's |
//! | `watched` | an analysis on a thread of its own: signals, progress, time budget |
//! | `user_test` | an independence test that is a Python object |
//! | `discover` | from settings to a model |
//! | `run` | the methods one by one, with the reference's words |
//! | `rolling` | a model per window |
//! | `reasoning` | questions to a structural model |
//! | `looks` | a model as text, graph file or picture |
//! | `program` | recordings, the demo, the command |
//! | `errors` | the engine's errors as Python's exceptions |
//!
//! Users see the Python files beside this module; nothing here is public.

mod discover;
mod errors;
mod frame;
mod looks;
mod program;
mod reasoning;
mod rolling;
mod run;
mod settings;
mod user_test;
mod watched;

/// The native half of `roscausal`; use the package instead.
#[pyo3::pymodule(gil_used = false)]
mod _native {
    #[pymodule_export]
    use crate::{
        discover::{discover, words},
        errors::{Cancelled, DataError, SettingError},
        frame::Frame,
        looks::{export, pdf, picture, series, visible},
        program::{command, demo, messages, read, version},
        reasoning::Structural,
        rolling::roll,
        run::{fdr_bh, run, run_test},
    };
}
