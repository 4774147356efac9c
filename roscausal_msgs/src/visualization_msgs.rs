//! `visualization_msgs`. ROS 2's `Marker` has textures and embedded meshes, which ROS 1's lacks, so there are two
//! types.

include!(concat!(env!("OUT_DIR"), "/visualization_msgs.rs"));

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

impl From<MarkerArray> for Ros2MarkerArray {
    fn from(array: MarkerArray) -> Self {
        Self { markers: array.markers.into_iter().map(Ros2Marker::from).collect() }
    }
}
