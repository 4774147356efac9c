//! People from messages of any tracker: what a type calls its people, their ids, places and velocities.
//!
//! `layouts` is the table: one row per message type. [`Reader`] binds the row of a type to the definition that comes with
//! its messages and reads [`Seen`] people from them, of either wire format. A tracker that is not in the table needs a row
//! there, and nothing else; or a user says where its messages have what ([`Tracker`]).

mod layouts;
mod read;
mod tracker;

pub use layouts::{layout, types};
pub use read::{Reader, Seen};
pub use tracker::Tracker;
