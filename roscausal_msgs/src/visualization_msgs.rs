//! `visualization_msgs`. ROS 2's `Marker` has textures and embedded meshes, which ROS 1's lacks, so there are two
//! types.

use serde::{Deserialize, Serialize};

use crate::{
    Duration,
    geometry_msgs::{Point, Pose, Vector3},
    sensor_msgs::CompressedImage,
    std_msgs::{ColorRGBA, Header},
};

/// `visualization_msgs/Marker` of ROS 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    /// Time and frame; a zero stamp means "now".
    pub header: Header,
    /// Namespace of the id.
    pub ns: String,
    /// Id within the namespace. A marker with the same id replaces the previous one.
    pub id: i32,
    /// Shape: one of the constants.
    pub r#type: i32,
    /// What to do: one of the constants.
    pub action: i32,
    /// Pose of the shape.
    pub pose: Pose,
    /// Metres along each axis of the shape.
    pub scale: Vector3,
    /// Colour; opacity 0 is invisible.
    pub color: ColorRGBA,
    /// Whether it moves with its frame.
    pub lifetime: Duration,
    /// Moves with its frame.
    pub frame_locked: bool,
    /// Points of lines and lists.
    pub points: Vec<Point>,
    /// A colour for each point, or none.
    pub colors: Vec<ColorRGBA>,
    /// Text of text shapes.
    pub text: String,
    /// URI of a mesh.
    pub mesh_resource: String,
    /// Whether to use the colours of the mesh.
    pub mesh_use_embedded_materials: bool,
}
message!("visualization_msgs" Marker on Ros1 uses [Header, Pose, Vector3, ColorRGBA, Point]);

impl Marker {
    /// An arrow.
    pub const ARROW: i32 = 0;
    /// A box.
    pub const CUBE: i32 = 1;
    /// A sphere.
    pub const SPHERE: i32 = 2;
    /// A cylinder.
    pub const CYLINDER: i32 = 3;
    /// A line through the points.
    pub const LINE_STRIP: i32 = 4;
    /// A line for each pair of points.
    pub const LINE_LIST: i32 = 5;
    /// A box at each point.
    pub const CUBE_LIST: i32 = 6;
    /// A sphere at each point.
    pub const SPHERE_LIST: i32 = 7;
    /// A dot at each point.
    pub const POINTS: i32 = 8;
    /// Text that faces the viewer.
    pub const TEXT_VIEW_FACING: i32 = 9;
    /// A mesh.
    pub const MESH_RESOURCE: i32 = 10;
    /// A triangle for each three points.
    pub const TRIANGLE_LIST: i32 = 11;
    /// Add the marker, or replace the one with the same id.
    pub const ADD: i32 = 0;
    /// Remove the marker with this id.
    pub const DELETE: i32 = 2;
    /// Remove all markers.
    pub const DELETEALL: i32 = 3;
}

/// `visualization_msgs/MarkerArray` of ROS 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    /// The markers.
    pub markers: Vec<Marker>,
}
message!("visualization_msgs" MarkerArray on Ros1 uses [Marker]);

/// `visualization_msgs/UVCoordinate` (ROS 2 only): a position in a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UVCoordinate {
    /// Along the width, 0 to 1.
    pub u: f32,
    /// Along the height, 0 to 1.
    pub v: f32,
}
message!("visualization_msgs" UVCoordinate on Ros2 uses []);

/// `visualization_msgs/MeshFile` (ROS 2 only).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshFile {
    /// File name. Its extension tells the format.
    pub filename: String,
    /// The file's bytes.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}
message!("visualization_msgs" MeshFile on Ros2 uses []);

/// `visualization_msgs/Marker` of ROS 2. Made from a [`Marker`], it leaves the fields that ROS 1 lacks empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ros2Marker {
    /// Time and frame; a zero stamp means "now".
    pub header: Header,
    /// Namespace of the id.
    pub ns: String,
    /// Id within the namespace. A marker with the same id replaces the previous one.
    pub id: i32,
    /// Shape: one of the constants.
    pub r#type: i32,
    /// What to do: one of the constants.
    pub action: i32,
    /// Pose of the shape.
    pub pose: Pose,
    /// Metres along each axis of the shape.
    pub scale: Vector3,
    /// Colour; opacity 0 is invisible.
    pub color: ColorRGBA,
    /// How long it is shown; 0 means for ever.
    pub lifetime: Duration,
    /// Whether it moves with its frame.
    pub frame_locked: bool,
    /// Points of lines and lists.
    pub points: Vec<Point>,
    /// A colour for each point, or none.
    pub colors: Vec<ColorRGBA>,
    /// URI of a texture.
    pub texture_resource: String,
    /// A texture.
    pub texture: CompressedImage,
    /// Texture coordinates of each point.
    pub uv_coordinates: Vec<UVCoordinate>,
    /// Text of text shapes.
    pub text: String,
    /// URI of a mesh.
    pub mesh_resource: String,
    /// An embedded mesh.
    pub mesh_file: MeshFile,
    /// Whether to use the colours of the mesh.
    pub mesh_use_embedded_materials: bool,
}
message!("visualization_msgs" Ros2Marker as "visualization_msgs/ros2/Marker" "Marker" on Ros2
    uses [Header, Pose, Vector3, ColorRGBA, Point, CompressedImage, UVCoordinate, MeshFile]);

impl From<Marker> for Ros2Marker {
    fn from(marker: Marker) -> Self {
        Self {
            header: marker.header,
            ns: marker.ns,
            id: marker.id,
            r#type: marker.r#type,
            action: marker.action,
            pose: marker.pose,
            scale: marker.scale,
            color: marker.color,
            lifetime: marker.lifetime,
            frame_locked: marker.frame_locked,
            points: marker.points,
            colors: marker.colors,
            text: marker.text,
            mesh_resource: marker.mesh_resource,
            mesh_use_embedded_materials: marker.mesh_use_embedded_materials,
            ..Self::default()
        }
    }
}

/// `visualization_msgs/MarkerArray` of ROS 2.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ros2MarkerArray {
    /// The markers.
    pub markers: Vec<Ros2Marker>,
}
message!("visualization_msgs" Ros2MarkerArray as "visualization_msgs/ros2/MarkerArray" "MarkerArray" on Ros2
    uses [Ros2Marker]);

impl From<MarkerArray> for Ros2MarkerArray {
    fn from(array: MarkerArray) -> Self {
        Self { markers: array.markers.into_iter().map(Ros2Marker::from).collect() }
    }
}
