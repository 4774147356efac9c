//! From topics to states: what the messages of sensors and trackers mean. Nothing here subscribes or publishes.

mod goals;
pub mod human;
pub mod identity;
pub mod motion;
pub mod robot;
pub mod scene;
pub mod sync;
pub mod tf;
