//! Reasoning on a causal model of time series: what will happen, what if, had I, why, and which action is best.
//!
//! Discovery says which variable drives which. This crate makes that graph ready for questions: it fits an equation for each variable
//! ([`StructuralModel`]), and answers with intervals, with what the answer rests on, and with a refusal where the data do not reach.
//!
//! | question | function | answer |
//! |---|---|---|
//! | what will happen? | [`answer::predict`] | a fan for each variable |
//! | what if I slow down? Which action is best? | [`answer::what_if`] | a fan for each action, ranked by cost, within limits |
//! | what would have happened, had I stopped? | [`answer::what_if`] with `counterfactual` | the same rows again |
//! | why did the person slow down? | [`answer::explain`] | each variable's part in the change |
//! | how strongly does one drive the other? | [`answer::effect`] | total, direct and mediated effect by lag |
//!
//! ```
//! use ndarray::Array2;
//! use roscausal_discovery::DataFrame;
//! use roscausal_reasoning::{
//!     Settings, StructuralModel, default_intervention_targets,
//!     answer::{Status, what_if},
//!     model::graph_of_json,
//!     question::{Situation, WhatIf, parse_action},
//! };
//!
//! // The distance `d` shrinks with the robot's speed `r_v` of the step before.
//! let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
//! let mut rows = Array2::zeros((400, 2));
//! for t in 1..400 {
//!     rows[[t, 0]] = 0.5 * rows[[t - 1, 0]] + noise(2 * t);
//!     rows[[t, 1]] = 0.6 * rows[[t - 1, 1]] - 0.4 * rows[[t - 1, 0]] + 0.2 * noise(2 * t + 1);
//! }
//! let data = DataFrame::new(vec![rows.clone()], vec!["r_v".into(), "d".into()])?;
//! let (graph, _) = graph_of_json(
//!     r#"{"links": [{"cause": "r_v", "effect": "r_v", "lag": 1}, {"cause": "d", "effect": "d", "lag": 1},
//!                   {"cause": "r_v", "effect": "d", "lag": 1}]}"#,
//!     &[],
//! )?;
//! let model = StructuralModel::fit(&data, &graph, &Settings::default(), &default_intervention_targets())?;
//!
//! let question = WhatIf { actions: vec![parse_action("stop: r_v=0").unwrap()], horizon: 5, ..WhatIf::default() };
//! let answer = what_if(&model, &Situation::newest(rows.view()), &question);
//! assert_eq!((answer.status, answer.outlooks[0].supported_steps), (Status::Ok, 5));
//!
//! // Far beyond what was seen nothing is answered.
//! let question = WhatIf { actions: vec![parse_action("race: r_v=9").unwrap()], ..question };
//! assert_eq!(what_if(&model, &Situation::newest(rows.view()), &question).status, Status::NotSupported);
//! # Ok::<(), roscausal_discovery::Error>(())
//! ```
//!
//! # The way of an answer
//!
//! 1. [`graph`]: parents of each variable, an order within a moment, the orientations of links without a direction.
//! 2. [`model`]: an equation for each variable (a line, or a line and a Gaussian process), the joint noise of each moment, refits on
//!    bootstraps that carry the uncertainty of the parameters, and the support of the data.
//! 3. [`quality`]: skill and calibrated intervals, on rows that the model has not seen.
//! 4. [`answer`]: paths under the actions (the g-formula), or the observed noise again; numbers, sentences, caveats.
//!
//! Random numbers come from seeds: the same seed gives the same bytes, whatever the number of threads. Nothing here knows a file or
//! a clock.

#![warn(missing_docs)]
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod answer;
pub mod effects;
pub mod explain;
pub mod graph;
pub mod linear;
pub mod model;
pub mod quality;
pub mod question;
mod random;
pub mod route;
mod samples;
mod simulate;

pub use model::{Facts, Settings, StructuralModel};
pub use samples::{ActsOn, Samples, default_intervention_targets};
pub use simulate::Stop;

/// The README's example runs, too.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
