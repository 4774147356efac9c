//! Pictures as SVG and PNG: the summary graph and the time series graph of a model, the series of a batch, and
//! curves of figures over settings.
//!
//! The layout depends on the names only, so a variable keeps its place from model to model.

mod curves;
mod dag;
mod raster;
mod series;
mod svg;
mod tsdag;

pub use curves::{Curve, Panel, curves};
pub use dag::dag;
pub use raster::{Image, rasterise};
pub use series::series;
pub use tsdag::tsdag;
