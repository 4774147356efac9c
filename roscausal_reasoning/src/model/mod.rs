//! The structural model: equations on a graph, their noise, and how sure they are.

mod bends;
mod directed;
pub(crate) mod equation;
mod file;
mod graph_file;
mod structural;
mod support;
mod system;

pub use directed::{Directed, Settings, Summary};
pub use equation::{Equation, Equations};
pub use file::SCHEMA;
pub use graph_file::graph_of_json;
pub use structural::{Facts, Member, StructuralModel};
pub use support::{NEIGHBOURS, Support};
pub use system::{Schedule, System};
