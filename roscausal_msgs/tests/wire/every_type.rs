//! A macro that runs a check for every message type.

/// Calls `$check::<M>($args)` for every message type.
macro_rules! for_every_type {
    ($check:ident $args:tt) => {
        for_every_type!(@ $check $args
            RobotState
            HumanState
            Humans
            CausalModel
            CausalLink
            CausalModelInfo
            ModelChange
            ModelChanges
            Features
            Intervention
            Action
            Forecast
            CostTerm
            Limit
            Outlook
            Contribution
            Prediction
            std_msgs::Header
            std_msgs::String
            std_msgs::Bool
            std_msgs::Float64
            std_msgs::ColorRGBA
            std_msgs::MultiArrayDimension
            std_msgs::MultiArrayLayout
            std_msgs::Int32MultiArray
            std_msgs::Float32MultiArray
            geometry_msgs::Point
            geometry_msgs::Point32
            geometry_msgs::Vector3
            geometry_msgs::Quaternion
            geometry_msgs::Pose
            geometry_msgs::Pose2D
            geometry_msgs::PoseStamped
            geometry_msgs::PoseArray
            geometry_msgs::PoseWithCovariance
            geometry_msgs::PoseWithCovarianceStamped
            geometry_msgs::Transform
            geometry_msgs::TransformStamped
            geometry_msgs::Twist
            geometry_msgs::TwistStamped
            geometry_msgs::TwistWithCovariance
            nav2_msgs::CostmapFilterInfo
            nav2_msgs::SpeedLimit
            nav_msgs::MapMetaData
            nav_msgs::OccupancyGrid
            nav_msgs::Odometry
            nav_msgs::Path
            tf2_msgs::TFMessage
            actionlib_msgs::GoalID
            dynamic_reconfigure::BoolParameter
            dynamic_reconfigure::Config
            dynamic_reconfigure::DoubleParameter
            dynamic_reconfigure::GroupState
            dynamic_reconfigure::IntParameter
            dynamic_reconfigure::StrParameter
            move_base_msgs::MoveBaseGoal
            move_base_msgs::MoveBaseActionGoal
            pedsim_msgs::AgentForce
            pedsim_msgs::AgentState
            pedsim_msgs::AgentStates
            pedsim_msgs::AgentStateWithGoal
            pedsim_msgs::AgentStatesWithGoal
            pedsim_msgs::LineObstacle
            pedsim_msgs::LineObstacles
            pedsim_msgs::TrackedPerson
            pedsim_msgs::TrackedPersons
            pedsim_msgs::Waypoint
            pedsim_msgs::Waypoints
            spencer_tracking_msgs::TrackedPerson
            spencer_tracking_msgs::TrackedPersons
            hri_msgs::IdsList
            people_msgs::Person
            people_msgs::People
            sensor_msgs::Image
            sensor_msgs::CompressedImage
            rosgraph_msgs::Clock
            rosgraph_msgs::Log
            diagnostic_msgs::KeyValue
            diagnostic_msgs::DiagnosticStatus
            diagnostic_msgs::DiagnosticArray
            visualization_msgs::Marker
            visualization_msgs::MarkerArray
            visualization_msgs::UVCoordinate
            visualization_msgs::MeshFile
            visualization_msgs::Ros2Marker
            visualization_msgs::Ros2MarkerArray
        )
    };
    (@ $check:ident $args:tt $($($message:ident)::+)*) => {{
        let mut checked = vec![$(<$($message)::+ as Message>::type_name()),*];
        let mut known: Vec<_> = types().iter().map(|d| d.type_name()).collect();
        checked.sort();
        known.sort();
        assert_eq!(checked, known);
        $($check::<$($message)::+> $args;)*
    }};
}
