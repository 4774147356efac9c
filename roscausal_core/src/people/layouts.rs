//! The table of trackers: where each message type has the id, the place and the velocity of a person.
//!
//! Several paths in one cell are spellings of different versions of a package; the first that a definition has is read.

/// Where a message type has what.
#[derive(Debug)]
pub(super) struct Layout {
    /// `package/Name`; all of one form.
    pub(super) types: &'static [&'static str],
    /// The array of people; empty: the message is one person, and its topic tells who it is.
    pub(super) people: &'static [&'static str],
    /// Number, text or bytes that tell one person from another.
    pub(super) id: &'static [&'static str],
    /// Pose or position.
    pub(super) place: &'static [&'static str],
    /// Velocity, in the frame of the message.
    pub(super) velocity: &'static [&'static str],
    /// Where the person walks to: pose or position.
    pub(super) goal: &'static [&'static str],
    /// Frame and stamp of this person, before those of the message.
    pub(super) header: &'static [&'static str],
    /// What kind of thing it is.
    pub(super) class: &'static [&'static str],
    /// Which kinds of thing are people.
    pub(super) keep: Keep,
    /// A number that is 0 where the entry shows something, and not where it takes something away.
    pub(super) action: &'static [&'static str],
}

/// Which entries of a message are people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keep {
    /// All.
    All,
    /// Those whose class is one of the names that the user gives.
    Named,
    /// Those whose class has this number.
    Number(u8),
}

const PLAIN: Layout = Layout {
    types: &[],
    people: &[],
    id: &[],
    place: &[],
    velocity: &[],
    goal: &[],
    header: &[],
    class: &[],
    keep: Keep::All,
    action: &[],
};

/// A row for each form: its types, and what their definitions have.
macro_rules! layouts {
    ($([$($type:literal),+] $($key:ident: $value:expr),+;)+) => {
        const LAYOUTS: &[Layout] = &[$(Layout { types: &[$($type),+], $($key: $value,)+ ..PLAIN }),+];
    };
}

layouts! {
    ["vision_msgs/Detection3DArray"] people: &["detections"], id: &["id", "tracking_id"],
        place: &["bbox.center"], header: &["header"],
        class: &["results[0].hypothesis.class_id", "results[0].id"], keep: Keep::Named;
    ["yolo_msgs/DetectionArray", "yolov8_msgs/DetectionArray"] people: &["detections"], id: &["id"],
        place: &["bbox3d.center"], header: &["bbox3d"], class: &["class_name"], keep: Keep::Named;
    ["depthai_ros_msgs/SpatialDetectionArray"] people: &["detections"], id: &["tracking_id"],
        place: &["position"], class: &["results[0].class_id", "results[0].id"], keep: Keep::Named;
    // Its label_id is the id of the track.
    ["zed_msgs/ObjectsStamped", "zed_interfaces/ObjectsStamped"] people: &["objects"], id: &["label_id"],
        place: &["position"], velocity: &["velocity"], class: &["label"], keep: Keep::Named;
    ["leg_tracker/PersonArray", "leg_tracker_msgs/PersonArray"] people: &["people"], id: &["id"],
        place: &["pose"];
    ["people_msgs/PositionMeasurementArray"] people: &["people"], id: &["object_id"], place: &["pos"],
        header: &["header"];
    ["people_msgs/People", "people_msgs/PersonArray", "people_msgs/PeopleStamped"] people: &["people", "persons"],
        id: &["name", "id"], place: &["position", "pose", "pos"], velocity: &["velocity", "twist"];
    ["hunav_msgs/Agents"] people: &["agents"], id: &["id"], place: &["position"], velocity: &["velocity"],
        goal: &["goals[0]"], class: &["type"], keep: Keep::Number(1);
    ["derived_object_msgs/ObjectArray"] people: &["objects"], id: &["id"], place: &["pose"],
        velocity: &["twist"], header: &["header"], class: &["classification"], keep: Keep::Number(4);
    ["visualization_msgs/MarkerArray"] people: &["markers"], id: &["id"], place: &["pose"],
        header: &["header"], class: &["ns"], keep: Keep::Named, action: &["action"];
    ["nav2_dynamic_msgs/ObstacleArray"] people: &["obstacles"], id: &["uuid.uuid", "id"],
        place: &["position"], velocity: &["velocity"];
    ["social_nav_msgs/Pedestrians"] people: &["pedestrians"], id: &["identifier"], place: &["pose"],
        velocity: &["velocity"];
    ["social_nav_msgs/PedestriansWithCovariance"] people: &["pedestrians"], id: &["pedestrian.identifier"],
        place: &["pedestrian.pose"], velocity: &["pedestrian.velocity"];
    ["pedsim_msgs/AgentStates"] people: &["agent_states"], id: &["id"], place: &["pose"],
        velocity: &["twist"];
    ["spencer_tracking_msgs/TrackedPersons", "pedsim_msgs/TrackedPersons"] people: &["tracks"],
        id: &["track_id"], place: &["pose.pose"], velocity: &["twist.twist"];
    ["geometry_msgs/PoseArray"] people: &["poses"], place: &[""];
    ["geometry_msgs/PoseStamped"] place: &["pose"];
    ["geometry_msgs/PointStamped"] place: &["point"];
    ["geometry_msgs/PoseWithCovarianceStamped"] place: &["pose.pose"];
    // Its velocity is in the person's own frame, so it follows from the places.
    ["nav_msgs/Odometry"] place: &["pose.pose"];
    ["geometry_msgs/TransformStamped"] place: &["transform.translation"];
}

/// The row of a type.
pub(super) fn row(type_name: &str) -> Option<&'static Layout> {
    LAYOUTS.iter().find(|layout| layout.types.contains(&type_name))
}

/// Whether people are read from this type: `Some(true)` from its name alone, `Some(false)` only if the user names the topic,
/// since the type has many meanings.
pub fn layout(type_name: &str) -> Option<bool> {
    let row = row(type_name)?;
    let has_many_meanings = row.people.is_empty() || type_name == "visualization_msgs/MarkerArray";
    Some(!has_many_meanings)
}

/// The types that people are read from.
pub fn types() -> impl Iterator<Item = &'static str> {
    LAYOUTS.iter().flat_map(|layout| layout.types.iter().copied())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use roscausal_msgs::dynamic::Path;

    use super::*;

    #[test]
    fn every_path_of_the_table_is_one_and_no_type_is_there_twice() {
        let mut seen = BTreeSet::new();
        for layout in LAYOUTS {
            assert!(layout.types.iter().all(|name| seen.insert(name)), "{:?}", layout.types);
            let all = [
                layout.people, layout.id, layout.place, layout.velocity, layout.goal, layout.header,
                layout.class,
            ];
            for text in all.iter().flat_map(|paths| paths.iter()).filter(|text| !text.is_empty()) {
                assert!(text.parse::<Path>().is_ok(), "{text}");
            }
        }
    }
}
