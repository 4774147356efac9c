//! `tf2_msgs`.

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::TransformStamped;

/// `tf2_msgs/TFMessage`: the messages on `/tf` and `/tf_static`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TFMessage {
    /// The transforms.
    pub transforms: Vec<TransformStamped>,
}
message!("tf2_msgs" TFMessage uses [TransformStamped]);
