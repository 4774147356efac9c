//! `std_msgs`.

use serde::{Deserialize, Serialize};

use crate::Time;

/// `std_msgs/Header` without `seq`, which only the ROS 1 wire format has.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Time of acquisition.
    pub stamp: Time,
    /// Frame of the data.
    pub frame_id: std::string::String,
}
message!("std_msgs" Header uses []);

/// `std_msgs/String`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct String {
    /// The text.
    pub data: std::string::String,
}
message!("std_msgs" String uses []);

/// `std_msgs/Bool`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bool {
    /// The value.
    pub data: bool,
}
message!("std_msgs" Bool uses []);

/// `std_msgs/Float64`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Float64 {
    /// The value.
    pub data: f64,
}
message!("std_msgs" Float64 uses []);

/// `std_msgs/ColorRGBA`: each channel from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColorRGBA {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
    /// Opacity; 0 is invisible.
    pub a: f32,
}
message!("std_msgs" ColorRGBA uses []);

/// `std_msgs/MultiArrayDimension`: one axis.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MultiArrayDimension {
    /// The axis's name.
    pub label: std::string::String,
    /// Its length.
    pub size: u32,
    /// Elements in this axis and all inner ones: this size times those of the axes after it.
    pub stride: u32,
}
message!("std_msgs" MultiArrayDimension uses []);

/// `std_msgs/MultiArrayLayout`: the axes, outermost first.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MultiArrayLayout {
    /// The axes.
    pub dim: Vec<MultiArrayDimension>,
    /// Elements before the array's first.
    pub data_offset: u32,
}
message!("std_msgs" MultiArrayLayout uses [MultiArrayDimension]);

/// `std_msgs/Int32MultiArray`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Int32MultiArray {
    /// The axes.
    pub layout: MultiArrayLayout,
    /// The elements, row-major.
    pub data: Vec<i32>,
}
message!("std_msgs" Int32MultiArray uses [MultiArrayLayout]);

/// `std_msgs/Float32MultiArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Float32MultiArray {
    /// The axes.
    pub layout: MultiArrayLayout,
    /// The elements, row-major.
    pub data: Vec<f32>,
}
message!("std_msgs" Float32MultiArray uses [MultiArrayLayout]);
