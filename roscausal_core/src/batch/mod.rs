//! Batches: tables of samples in files, from recording to analysis.

pub mod header;
pub mod pool;
pub mod table;

pub use table::Table;
