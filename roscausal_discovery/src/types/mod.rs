//! The vocabulary of causal discovery: what every test and every method speaks of. Nothing here knows a test or a method.

#[macro_use]
mod variants;

mod common;
mod complete_rows;
mod components;
mod cond_ind_test;
mod control;
mod dataframe;
mod error;
mod knowledge;
mod links;
mod lock;
mod marks;
pub mod names;
mod node;
mod samples;
pub mod text;
mod vectors;
pub mod visible;
mod words;

pub use common::same_value;
pub(crate) use common::{add_new, unique};
pub(crate) use complete_rows::CompleteRows;
pub(crate) use components::Components;
pub use components::{VectorNames, vectors_of};
pub use cond_ind_test::{CondIndTest, Dummy, PreparedTest, SampleCount, TestResult};
pub use control::{Control, Progress, Stop};
pub use dataframe::{DataFrame, MaskType};
pub use error::{Error, Result, ensure};
pub use knowledge::{Known, LinkRule};
pub use links::{Assumption, LinkAssumptions};
#[doc(hidden)]
pub use lock::lock;
pub use marks::{LinkEnd, LinkMark};
pub use node::Node;
pub use samples::{LaggedArrays, Samples};
#[doc(hidden)]
pub use words::time_in_words;
pub use words::{Named, spelled_out};
