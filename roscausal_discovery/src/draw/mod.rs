//! Pictures as SVG, PNG and PDF: the summary graph and the time series graph of a model, the series of a batch, fan charts of what
//! may come, and curves of figures over settings.
//!
//! Up to nine variables stand in places that depend on their number and order only, so a variable stays in its place from
//! model to model.
//! With the feature `png`, `rasterise` makes pixels of a picture; with the feature `pdf`, `pdf` makes a file for print.
//!
//! ```
//! use roscausal_discovery::{Control, DataFrame, Settings, analyse, draw, methods::Method};
//!
//! # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
//! # let mut values = ndarray::Array2::zeros((300, 2));
//! # for t in 1..300 {
//! #     values[[t, 0]] = noise(2 * t);
//! #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
//! # }
//! # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
//! let settings = Settings { method: Method::Pcmci, cond_ind_test: "parcorr".into(), ..Settings::default() };
//! let model = analyse(&data, &settings, &Control::default())?;
//! assert!(draw::dag(&model).starts_with("<svg") && draw::tsdag(&model).contains("t−1"));
//! # Ok::<(), roscausal_discovery::Error>(())
//! ```

mod arrows;
mod axis;
mod circle;
mod curves;
mod dag;
mod evidence;
mod fans;
mod layout;
mod matrix;
mod maybe;
#[cfg(feature = "pdf")]
mod pdf;
mod point;
#[cfg(feature = "png")]
mod raster;
mod series;
mod strip;
mod svg;
mod tsdag;

pub use curves::{Curve, Panel, curves};
pub use dag::{dag, dag_and_matrix};
pub use evidence::{lag_function, residual_scatter, scatter};
pub use fans::{Candidate, Fan, FanChart, fans};
pub use matrix::matrix;
#[cfg(feature = "pdf")]
pub use pdf::pdf;
#[cfg(feature = "png")]
pub use raster::{Image, rasterise};
pub use series::series;
pub use strip::{Strip, StripPoint, Strips, strips};
pub use svg::{escaped, fitted};
pub use tsdag::tsdag;
