//! The roles of a recording's topics, the types that can fill them, and the parameters that they set.

/// A role that a topic fills.
#[derive(Debug)]
pub(crate) struct Role {
    /// The flag that names the topic.
    pub(crate) flag: &'static str,
    /// Its description.
    pub(crate) what: &'static str,
    /// The node that listens.
    pub(crate) node: &'static str,
    /// The types that can fill it.
    pub(crate) kinds: &'static [Kind],
    /// Names that are taken by default, the best first.
    pub(crate) usual: &'static [&'static str],
}

/// One type that can fill a role.
#[derive(Debug)]
pub(crate) struct Kind {
    /// The type as `package/Name`.
    pub(crate) type_name: &'static str,
    /// The parameter that takes the topic's name.
    pub(crate) topic_param: &'static str,
    /// Parameters that go with it.
    pub(crate) also: &'static [Param],
}

/// A parameter of the node and its value.
type Param = (&'static str, &'static str);

impl Role {
    /// The role's entry for a type.
    pub(crate) fn kind(&self, type_name: &str) -> Option<&'static Kind> {
        self.kinds.iter().find(|kind| kind.type_name == type_name)
    }
}

const fn kind(type_name: &'static str, topic_param: &'static str, also: &'static [Param]) -> Kind {
    Kind { type_name, topic_param, also }
}

/// Frames of a robot's base, the best first.
pub(crate) const BASES: [&str; 3] = ["base_footprint", "base_link", "base"];

/// Types with many meanings: such a topic is taken only by its name.
pub(crate) const CHOSEN_BY_NAME: [&str; 3] =
    ["geometry_msgs/PoseStamped", "geometry_msgs/TwistStamped", "nav_msgs/Path"];

/// Words in the last part of the names of PoseArrays that are not people, such as AMCL's `/particlecloud`.
pub(crate) const NOT_PEOPLE: [&str; 7] =
    ["particle", "waypoint", "path", "plan", "goal", "grasp", "landmark"];

/// Odometry that tells a velocity alone.
pub(crate) const VELOCITY: &str = "geometry_msgs/TwistStamped";

pub(crate) const ROBOT_ODOM: Role = Role {
    flag: "--robot-odom",
    what: "robot odometry",
    node: "robot",
    kinds: &[
        kind("nav_msgs/Odometry", "odom_topic", &[("odom_type", "Odometry")]),
        kind(VELOCITY, "odom_topic", &[("odom_type", "TwistStamped")]),
    ],
    usual: &["/mobile_base_controller/odom", "/odom"],
};

pub(crate) const ROBOT_POSE: Role = Role {
    flag: "--robot-pose",
    what: "robot pose",
    node: "robot",
    kinds: &[
        kind(
            "geometry_msgs/PoseWithCovarianceStamped",
            "pose_topic",
            &[("pose_type", "PoseWithCovarianceStamped")],
        ),
        kind("geometry_msgs/PoseStamped", "pose_topic", &[("pose_type", "PoseStamped")]),
    ],
    usual: &["/robot_pose", "/amcl_pose"],
};

pub(crate) const ROBOT_GOAL: Role = Role {
    flag: "--robot-goal",
    what: "robot goal",
    node: "robot",
    kinds: &[
        kind("move_base_msgs/MoveBaseActionGoal", "goal_topic", &[("goal_type", "MoveBaseActionGoal")]),
        kind("geometry_msgs/PoseStamped", "goal_topic", &[("goal_type", "PoseStamped")]),
        kind("nav_msgs/Path", "goal_topic", &[("goal_type", "Path")]),
    ],
    usual: &["/move_base/goal", "/goal_pose", "/move_base_simple/goal", "/plan"],
};

pub(crate) const PEOPLE: Role = Role {
    flag: "--people",
    what: "people",
    node: "human",
    kinds: &[
        kind("pedsim_msgs/AgentStates", "auto_people_topic", &[]),
        kind("pedsim_msgs/TrackedPersons", "teleop_people_topic", &[]),
        kind(
            "spencer_tracking_msgs/TrackedPersons",
            "people_topic",
            &[("people_type", "spencer_tracking_msgs/TrackedPersons")],
        ),
        kind("people_msgs/People", "people_topic", &[("people_type", "people_msgs/People")]),
        kind("geometry_msgs/PoseArray", "people_topic", &[("people_type", "geometry_msgs/PoseArray")]),
    ],
    usual: &["/pedsim_simulator/simulated_agents", "/ped/control/teleop_persons"],
};

/// Topics that tell who is tracked (REP-155); the people themselves are TF frames.
pub(crate) const ROS4HRI: [&str; 2] = ["/humans/persons/tracked", "/humans/bodies/tracked"];
/// Beginnings of the names of those frames.
pub(crate) const ROS4HRI_FRAMES: [&str; 2] = ["person_", "body_"];

pub(crate) const HUMAN_GOAL: Role = Role {
    flag: "--human-goal",
    what: "person's goal",
    node: "human",
    kinds: &[kind("geometry_msgs/PoseStamped", "goal_topic", &[])],
    usual: &["/hri/human_goal"],
};
