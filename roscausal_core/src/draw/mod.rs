//! Pictures of a model: the summary graph, the time-series graph and the batch's series, as SVG and PNG;
//! curves of figures over settings.
//!
//! The layout depends on the names only, so a variable stays in its place from model to model.

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
pub use svg::escaped;
pub use tsdag::tsdag;
