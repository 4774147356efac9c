//! `sensor_msgs`.

use serde::{Deserialize, Serialize};

use crate::std_msgs::Header;

/// `sensor_msgs/Image`: raw pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Image {
    /// Time and frame.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Such as `rgb8`.
    pub encoding: String,
    /// 1 if numbers of more than one byte are big endian.
    pub is_bigendian: u8,
    /// Bytes per row.
    pub step: u32,
    /// `step * height` bytes.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}
message!("sensor_msgs" Image uses [Header]);

/// `sensor_msgs/CompressedImage`: an image file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompressedImage {
    /// Time and frame.
    pub header: Header,
    /// `png` or `jpeg`.
    pub format: String,
    /// The file's bytes.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}
message!("sensor_msgs" CompressedImage uses [Header]);
