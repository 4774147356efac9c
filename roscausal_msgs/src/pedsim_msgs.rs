//! `pedsim_msgs`, from the pedestrian simulator pedsim_ros.

use serde::{Deserialize, Serialize};

use crate::{
    Duration,
    geometry_msgs::{Point, Pose, PoseWithCovariance, Twist, TwistWithCovariance, Vector3},
    std_msgs::Header,
};

/// `pedsim_msgs/AgentForce`: the forces of the social force model on one agent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgentForce {
    /// Towards the goal.
    pub desired_force: Vector3,
    /// From obstacles.
    pub obstacle_force: Vector3,
    /// From other agents.
    pub social_force: Vector3,
    /// Keeps a group together.
    pub group_coherence_force: Vector3,
    /// Keeps a group's members in each other's view.
    pub group_gaze_force: Vector3,
    /// Keeps a group's members apart.
    pub group_repulsion_force: Vector3,
    /// Noise.
    pub random_force: Vector3,
}
message!("pedsim_msgs" AgentForce uses [Vector3]);

/// `pedsim_msgs/AgentState`, as in pedsim_ros.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgentState {
    /// Time and frame.
    pub header: Header,
    /// The agent's id.
    pub id: u64,
    /// 0 and 1: ordinary people, 2: a robot, 3: slow or standing people.
    pub r#type: u16,
    /// Such as `individual_moving`.
    pub social_state: String,
    /// Pose.
    pub pose: Pose,
    /// Velocity in the header's frame.
    pub twist: Twist,
    /// Forces.
    pub forces: AgentForce,
}
message!("pedsim_msgs" AgentState uses [Header, Pose, Twist, AgentForce]);

/// `pedsim_msgs/AgentStates`, as in pedsim_ros.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgentStates {
    /// Time and frame.
    pub header: Header,
    /// All agents.
    pub agent_states: Vec<AgentState>,
}
message!("pedsim_msgs" AgentStates uses [Header, AgentState]);

/// `pedsim_msgs/AgentState` with a goal, as ROS-Causal_HRISim changed it. Its md5 differs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgentStateWithGoal {
    /// Time and frame.
    pub header: Header,
    /// The agent's id.
    pub id: u64,
    /// 0 and 1: ordinary people, 2: a robot, 3: slow or standing people.
    pub r#type: u16,
    /// Such as `individual_moving`.
    pub social_state: String,
    /// Pose.
    pub pose: Pose,
    /// Velocity in the header's frame.
    pub twist: Twist,
    /// Forces.
    pub forces: AgentForce,
    /// The agent's goal.
    pub goal: Point,
}
message!("pedsim_msgs" AgentStateWithGoal as "pedsim_msgs/hrisim/AgentState" "AgentState" on Ros1
    uses [Header, Pose, Twist, AgentForce, Point]);

/// `pedsim_msgs/AgentStates`, as ROS-Causal_HRISim changed it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgentStatesWithGoal {
    /// Time and frame.
    pub header: Header,
    /// All agents.
    pub agent_states: Vec<AgentStateWithGoal>,
}
message!("pedsim_msgs" AgentStatesWithGoal as "pedsim_msgs/hrisim/AgentStates" "AgentStates" on Ros1
    uses [Header, AgentStateWithGoal]);

/// `pedsim_msgs/LineObstacle`: a wall.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LineObstacle {
    /// One end.
    pub start: Point,
    /// The other end.
    pub end: Point,
}
message!("pedsim_msgs" LineObstacle uses [Point]);

/// `pedsim_msgs/LineObstacles`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LineObstacles {
    /// Time and frame.
    pub header: Header,
    /// The walls.
    pub obstacles: Vec<LineObstacle>,
}
message!("pedsim_msgs" LineObstacles uses [Header, LineObstacle]);

/// `pedsim_msgs/TrackedPerson`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackedPerson {
    /// The id of the track; it stays the same for the life of the track.
    pub track_id: u64,
    /// Whether the person is currently hidden.
    pub is_occluded: bool,
    /// Whether a detection currently belongs to the track.
    pub is_matched: bool,
    /// The id of that detection.
    pub detection_id: u64,
    /// The track's age.
    pub age: Duration,
    /// Pose; z and orientation may not be set.
    pub pose: PoseWithCovariance,
    /// Velocity in the header's frame; z and rotations may not be set.
    pub twist: TwistWithCovariance,
}
message!("pedsim_msgs" TrackedPerson uses [PoseWithCovariance, TwistWithCovariance]);

/// `pedsim_msgs/TrackedPersons`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackedPersons {
    /// Time and frame.
    pub header: Header,
    /// All people tracked now.
    pub tracks: Vec<TrackedPerson>,
}
message!("pedsim_msgs" TrackedPersons uses [Header, TrackedPerson]);

/// `pedsim_msgs/Waypoint`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Waypoint {
    /// Its name.
    pub name: String,
    /// 0 simple, 1 source, 2 sink.
    pub behavior: i8,
    /// Centre.
    pub position: Point,
    /// Metres.
    pub radius: f32,
}
message!("pedsim_msgs" Waypoint uses [Point]);

/// `pedsim_msgs/Waypoints`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Waypoints {
    /// Time and frame.
    pub header: Header,
    /// The waypoints.
    pub waypoints: Vec<Waypoint>,
}
message!("pedsim_msgs" Waypoints uses [Header, Waypoint]);
