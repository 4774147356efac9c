//! The robot node: from odometry, pose, goal and TF to `/roscausal/robot`.

use roscausal_msgs::{
    RobotState, Wires,
    geometry_msgs::{Point, Pose, PoseStamped, PoseWithCovarianceStamped, TwistStamped},
    move_base_msgs::MoveBaseActionGoal,
    nav_msgs::{Odometry, Path},
    std_msgs::Header,
    tf2_msgs::TFMessage,
};

use super::{health::Health, in_namespace, labels, to_its_end};
use crate::{
    Error, Result,
    inbox::{Inbox, Next},
    middleware::{Middleware, Publish, Qos},
    param_specs,
    params::{Allowed, ParamSpec, Params, Value},
    state::robot::RobotTracker,
};

enum Event {
    Odometry(usize, Box<Odometry>),
    Pose(usize, Header, Pose),
    Goal(Header, Point),
    Tf(TFMessage, bool),
}

/// Where the usual robot of ROS 2, with Nav2, differs from ROS-Causal's, whose defaults hold elsewhere. Its pose is its place in TF:
/// `/amcl_pose` comes only now and then. Its goal is the end of the plan: goals of the action NavigateToPose are on no topic.
const NAV2: [(&str, &str); 5] = [
    ("odom_topic", "/odom"),
    ("pose_topic", ""),
    ("source_frame", "base_link"),
    ("goal_topic", "/plan"),
    ("goal_type", "Path"),
];

/// Names, defaults, allowed values and descriptions of the robot node's parameters, on a middleware of these wires.
pub(super) fn specs(wires: Wires) -> Vec<ParamSpec> {
    let usual = |mut spec: ParamSpec| {
        let of_ros2 = NAV2.iter().find(|(name, _)| wires == Wires::Ros2 && *name == spec.name);
        if let Some((_, value)) = of_ros2 {
            spec.default = Value::Str((*value).to_owned());
        }
        spec
    };
    of_ros_causal().into_iter().map(usual).collect()
}

fn of_ros_causal() -> Vec<ParamSpec> {
    use Allowed::{Any, OneOf, Range};
    let text = |text: &str| Value::Str(text.to_owned());
    param_specs! {
        of_data "odom_topic" = text("/mobile_base_controller/odom"), Any,
            "odometry of the base; empty: none, the speed follows from the poses";
        of_data "odom_type" = text("Odometry"), OneOf(&["Odometry", "TwistStamped"]),
            "type of odom_topic; TwistStamped: a measured velocity alone";
        of_data "pose_topic" = text("/robot_pose"), Any,
            "the localised pose; empty: the place of source_frame in TF at each odometry message";
        of_data "pose_type" = text("PoseWithCovarianceStamped"), OneOf(&["PoseWithCovarianceStamped", "PoseStamped", "Odometry"]),
            "type of pose_topic; Odometry: the pose in the odometry, brought to target_frame by TF";
        of_data "goal_topic" = text("/move_base/goal"), Any, "the goal; empty: none";
        of_data "goal_type" = text("MoveBaseActionGoal"), OneOf(&["MoveBaseActionGoal", "PoseStamped", "Path"]),
            "type of goal_topic; PoseStamped for /move_base_simple/goal and /goal_pose; Path: the end of a plan, such as Nav2's /plan, \
             which has the goals of NavigateToPose, too";
        of_data "robot" = text(""), Any, "name of the robot, the namespace of its topics; empty: none";
        of_data "source_frame" = text("base_footprint"), Any, "frame of the robot, used without pose_topic";
        of_data "target_frame" = text("map"), Any, "frame of the published state";
        of_data "tf_topic" = text("/tf"), Any,
            "transforms; those that are fixed come on the same name with _static; a robot in a namespace may have /NAME/tf";
        "queue_size" = Value::Int(10), Range(1.0, 10000.0), "most messages that wait for a partner";
        of_data "slop" = Value::Double(0.1), Range(0.0, 10.0), "most seconds between a pose and its odometry";
    }
}

/// The robot node. It runs until the middleware ends.
///
/// # Errors
/// A parameter that is not allowed, or a topic that cannot be used.
pub fn robot<M: Middleware>(mw: &M) -> Result<()> {
    to_its_end(robot_task(mw))
}

/// The robot node as a task.
pub(super) async fn robot_task<M: Middleware>(mw: &M) -> Result<()> {
    let params = Params::read(mw, &specs(mw.wires()))?;
    let mut health = Health::new(mw)?;
    let inbox = Inbox::new(mw, 1000);
    let robot = params.text("robot");
    let state_topic = in_namespace("robot", &robot, "roscausal/robot")?;
    let publisher = mw.advertise::<RobotState>(&state_topic, Qos::Volatile(100))?;

    let odometry = |topic: String| {
        let topic = in_namespace("robot", &robot, &topic)?;
        let input = (topic.as_str(), true);
        match params.text("odom_type") == "TwistStamped" {
            true => health.hear(mw, &inbox, input, |of, m| Event::Odometry(of, Box::new(of_twist(m)))),
            false => health.hear(mw, &inbox, input, |of, m| Event::Odometry(of, Box::new(m))),
        }
    };
    let _odometry = params.text_if_set("odom_topic").map(odometry).transpose()?;
    let pose = |topic: String| {
        let topic = in_namespace("robot", &robot, &topic)?;
        let input = (topic.as_str(), true);
        match params.text("pose_type").as_str() {
            "Odometry" => {
                health.hear(mw, &inbox, input, |of, m: Odometry| Event::Pose(of, m.header, m.pose.pose))
            }
            "PoseStamped" => {
                health.hear(mw, &inbox, input, |of, m: PoseStamped| Event::Pose(of, m.header, m.pose))
            }
            _ => {
                let pose = |of, m: PoseWithCovarianceStamped| Event::Pose(of, m.header, m.pose.pose);
                health.hear(mw, &inbox, input, pose)
            }
        }
    };
    let _pose = params.text_if_set("pose_topic").map(pose).transpose()?;
    let goal = |topic: String| {
        let (topic, qos) = (in_namespace("robot", &robot, &topic)?, Qos::Volatile(10));
        match params.text("goal_type").as_str() {
            "PoseStamped" => {
                inbox.subscribe(mw, &topic, qos, |m: PoseStamped| Event::Goal(m.header, m.pose.position))
            }
            "Path" => {
                let send = inbox.sender();
                mw.subscribe(&topic, qos, move |m: Path| {
                    // The poses of a plan may have headers of their own; those of Nav2 and move_base are in the plan's frame.
                    if let Some(end) = m.poses.last() {
                        send.send(Event::Goal(m.header, end.pose.position));
                    }
                })
            }
            _ => inbox.subscribe(mw, &topic, qos, |m: MoveBaseActionGoal| {
                let target = m.goal.target_pose;
                Event::Goal(target.header, target.pose.position)
            }),
        }
    };
    let _goal = params.text_if_set("goal_topic").map(goal).transpose()?;
    let tf = params.text_if_set("tf_topic").unwrap_or_else(|| "/tf".to_owned());
    let _tf = inbox.subscribe(mw, &tf, Qos::Volatile(100), |m| Event::Tf(m, false))?;
    let _tf_static = inbox.subscribe(mw, &format!("{tf}_static"), Qos::Latched, |m| Event::Tf(m, true))?;

    let mut tracker =
        RobotTracker::new(&params.text("target_frame"), params.count("queue_size"), params.double("slop"));
    if params.text_if_set("pose_topic").is_none() {
        let no_frame = || Error::param("source_frame", "it is empty, and so is pose_topic; give one of them");
        tracker = tracker.with_pose_of_frame(&params.text_if_set("source_frame").ok_or_else(no_frame)?);
    }
    if params.text_if_set("odom_topic").is_none() {
        tracker = tracker.without_odometry();
    }
    loop {
        let states = match inbox.awaited(mw, Some(health.next)).await {
            Next::Shutdown => return Ok(()),
            Next::Deadline => Vec::new(),
            Next::Event(Event::Tf(message, fixed)) => tracker.transforms(&message, fixed),
            Next::Event(Event::Goal(header, goal)) => {
                tracker.goal(header, goal, mw.now());
                Vec::new()
            }
            Next::Event(Event::Odometry(input, message)) => {
                health.heard(input, mw.now());
                tracker.odometry(*message, mw.now())
            }
            Next::Event(Event::Pose(input, header, pose)) => {
                health.heard(input, mw.now());
                tracker.pose(header, pose, mw.now())
            }
        };
        for state in &states {
            publisher.publish(state)?;
            health.sent();
        }
        let figures = || {
            [
                (labels::UNPAIRED, tracker.pairing.unpaired.to_string()),
                (labels::LATE, tracker.pairing.late.to_string()),
                ("twice at one stamp", tracker.pairing.repeated.to_string()),
                (labels::UNSTAMPED, tracker.unstamped.to_string()),
                (labels::NO_TRANSFORM, tracker.without_transform.to_string()),
                (labels::NOT_FINITE, tracker.not_finite.to_string()),
                (labels::JUMPS, tracker.jumps.to_string()),
                ("dropped", inbox.dropped().to_string()),
            ]
        };
        health.report(mw, figures, tracker.trouble.as_deref());
    }
}

/// A velocity as odometry without a place.
fn of_twist(message: TwistStamped) -> Odometry {
    let mut odometry = Odometry { header: message.header, ..Odometry::default() };
    odometry.twist.twist = message.twist;
    odometry
}
