//! Batches: tables of samples in files, from recording to analysis.

pub(crate) mod expression;
pub mod fresh;
pub mod header;
mod id;
pub mod joint;
pub mod journal;
pub mod pool;
pub mod postprocess;
mod range;
pub mod recorder;
mod recording;
pub mod risk;
pub mod script;
mod select;
mod signal_track;
pub mod table;
mod tracks;
pub mod trajectories;
pub mod writer;

pub use id::IdFormat;
pub use recording::{Column, EndedBy, Gap, Imposed, Recording};
pub use select::Select;
pub use table::Table;
pub use tracks::{Field, OFTEN_TO_HOLD, Sampling, Values};
