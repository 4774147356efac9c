//! Reading and writing recordings.
//!
//! [`Recording`] reads ROS 1 bags, MCAP files (of either ROS version), ROS 2's `.db3` files, what rosbag2 compressed of
//! these (by file or by message), and folders of them.
//! It returns messages as bytes, in the order of their recording times; [`Topic::decode`] decodes them. Damaged or
//! truncated files are used as far as they are intact, and [`Recording::losses`] says what was lost.
//!
//! [`McapWriter`] writes files that `ros2 bag` and Foxglove open. [`Player`] and [`Recorder`] connect reading and
//! writing to a [`roscausal_core::middleware::Middleware`].

mod bag;
mod chunk;
mod copies;
mod db3;
mod file;
mod folder;
mod formats;
mod laps;
mod mcap_file;
mod mcap_record;
mod metadata;
mod packed;
mod play;
mod record;
mod recording;
mod settings;
mod source;
mod steps;
mod topic;
mod write;

pub use folder::{folders_in, is_named_so, recordings_in};
pub use play::Player;
pub use record::Recorder;
pub use recording::Recording;
pub use settings::settings;
pub use steps::{Stepped, Steps, Tick};
pub use topic::{Encoding, Record, Topic};
pub use write::McapWriter;
