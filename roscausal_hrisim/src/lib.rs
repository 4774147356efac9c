//! Human-robot interaction simulator: a robot, people who react to it, pedestrians, walls. It is headless, seeded,
//! and faster than real time.
//!
//! [`Simulation`] is the world without clock, input or output: a [`Scenario`] and a seed, stepped at 25 Hz.
//! [`node`] publishes it on any middleware.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod collision;
pub mod day;
pub mod geometry;
pub mod intervention;
mod navigator;
mod neighbours;
pub mod node;
pub mod pedestrian;
pub mod person;
pub mod picture;
mod plans;
mod ranges;
pub mod rng;
pub mod robot;
pub mod scenario;
pub mod simulation;
pub mod social_force;
pub mod statistics;
pub mod teleop;
pub mod world;

pub use intervention::Intervention;
pub use scenario::Scenario;
pub use simulation::Simulation;
