//! Recordings in and out.
//!
//! [`Recording`] reads what others recorded: ROS 1 bags, MCAP files (of either ROS version), ROS 2's `.db3`
//! files, and folders of them. Its messages come in the order of their recording times, with their bytes;
//! [`Topic::decode`] makes messages of them. What is damaged or cut short is used as far as it is whole;
//! [`Recording::losses`] says what was lost.
//!
//! [`McapWriter`] writes what `ros2 bag` and Foxglove open. [`Player`] and [`Recorder`] connect either to a
//! [`roscausal_core::middleware::Middleware`].

mod bag;
mod chunk;
mod db3;
mod file;
mod folder;
mod mcap_file;
mod mcap_record;
mod play;
mod record;
mod recording;
mod source;
mod topic;
mod write;

pub use play::{Player, replay};
pub use record::Recorder;
pub use recording::Recording;
pub use topic::{Encoding, Record, Topic};
pub use write::McapWriter;
