//! The registry of message types: for code that learns a type only at run time.

use crate::{
    Action, CausalLink, CausalModel, CausalModelInfo, Contribution, CostTerm, Definition, Features, Forecast,
    HumanState, Humans, Intervention, Limit, Message, ModelChange, ModelChanges, Outlook, Prediction,
    RobotState, actionlib_msgs as actionlib, diagnostic_msgs as diagnostic, geometry_msgs as geometry,
    hri_msgs as hri, move_base_msgs as move_base, nav_msgs as nav, pedsim_msgs as pedsim,
    people_msgs as people, rosgraph_msgs as rosgraph, sensor_msgs as sensor,
    spencer_tracking_msgs as spencer, std_msgs as std_, tf2_msgs as tf2, visualization_msgs as visualization,
};

/// An operation on a message type that is known only at run time; see [`visit`].
pub trait TypeVisitor {
    /// The result of the operation.
    type Output;

    /// Runs the operation with `M`.
    fn visit<M: Message>(self) -> Self::Output;
}

macro_rules! registry {
    ($($message:ty),* $(,)?) => {
        /// All message types of this crate, for backends and recordings. A name occurs twice if its fields differ
        /// between the ROS versions ([`Definition::wires`]), or if two md5 sums are in use for it (pedsim's
        /// agents).
        pub fn types() -> Vec<&'static Definition> {
            vec![$(<$message as Message>::definition()),*]
        }

        /// Calls `visitor` with the type of a definition; `None` if this crate does not have it.
        pub fn visit<V: TypeVisitor>(definition: &Definition, visitor: V) -> Option<V::Output> {
            $(if std::ptr::eq(<$message as Message>::definition(), definition) {
                return Some(visitor.visit::<$message>());
            })*
            None
        }
    };
}

registry![
    RobotState,
    HumanState,
    Humans,
    CausalModel,
    CausalLink,
    CausalModelInfo,
    ModelChange,
    ModelChanges,
    Features,
    Intervention,
    Action,
    Forecast,
    CostTerm,
    Limit,
    Outlook,
    Contribution,
    Prediction,
    std_::Header,
    std_::String,
    std_::Bool,
    std_::Float64,
    std_::ColorRGBA,
    std_::MultiArrayDimension,
    std_::MultiArrayLayout,
    std_::Int32MultiArray,
    std_::Float32MultiArray,
    geometry::Point,
    geometry::Point32,
    geometry::Vector3,
    geometry::Quaternion,
    geometry::Pose,
    geometry::Pose2D,
    geometry::PoseStamped,
    geometry::PoseArray,
    geometry::PoseWithCovariance,
    geometry::PoseWithCovarianceStamped,
    geometry::Transform,
    geometry::TransformStamped,
    geometry::Twist,
    geometry::TwistStamped,
    geometry::TwistWithCovariance,
    nav::Odometry,
    nav::Path,
    tf2::TFMessage,
    actionlib::GoalID,
    move_base::MoveBaseGoal,
    move_base::MoveBaseActionGoal,
    pedsim::AgentForce,
    pedsim::AgentState,
    pedsim::AgentStates,
    pedsim::AgentStateWithGoal,
    pedsim::AgentStatesWithGoal,
    pedsim::LineObstacle,
    pedsim::LineObstacles,
    pedsim::TrackedPerson,
    pedsim::TrackedPersons,
    pedsim::Waypoint,
    pedsim::Waypoints,
    spencer::TrackedPerson,
    spencer::TrackedPersons,
    hri::IdsList,
    people::Person,
    people::People,
    sensor::Image,
    sensor::CompressedImage,
    rosgraph::Clock,
    rosgraph::Log,
    diagnostic::KeyValue,
    diagnostic::DiagnosticStatus,
    diagnostic::DiagnosticArray,
    visualization::Marker,
    visualization::MarkerArray,
    visualization::UVCoordinate,
    visualization::MeshFile,
    visualization::Ros2Marker,
    visualization::Ros2MarkerArray,
];
