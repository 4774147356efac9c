//! The robot node: from odometry, pose, goal and TF to `/roscausal/robot`.

use roscausal_msgs::{
    RobotState,
    geometry_msgs::{Point, Pose, PoseStamped, PoseWithCovarianceStamped},
    move_base_msgs::MoveBaseActionGoal,
    nav_msgs::Odometry,
    std_msgs::Header,
    tf2_msgs::TFMessage,
};

use super::{health::Health, in_namespace, to_its_end};
use crate::{
    Error, Result,
    inbox::{Inbox, Next},
    middleware::{Middleware, Publish, Qos},
    params::{Allowed, ParamSpec, Params, Value},
    state::robot::RobotTracker,
};

enum Event {
    Odometry(usize, Box<Odometry>),
    Pose(usize, Header, Pose),
    Goal(Header, Point),
    Tf(TFMessage, bool),
}

/// Names, defaults, allowed values and descriptions of the robot node's parameters.
pub(super) fn specs() -> Vec<ParamSpec> {
    use Allowed::{Any, OneOf, Range};
    let text = |text: &str| Value::Str(text.to_owned());
    vec![
        ParamSpec::new(
            "odom_topic",
            text("/mobile_base_controller/odom"),
            Any,
            "nav_msgs/Odometry of the base; empty: none, the speed follows from the poses",
        ),
        ParamSpec::new(
            "pose_topic",
            text("/robot_pose"),
            Any,
            "the localised pose; empty: the place of source_frame in TF at each odometry message",
        ),
        ParamSpec::new(
            "pose_type",
            text("PoseWithCovarianceStamped"),
            OneOf(&["PoseWithCovarianceStamped", "PoseStamped"]),
            "type of pose_topic",
        ),
        ParamSpec::new("goal_topic", text("/move_base/goal"), Any, "the goal; empty: none"),
        ParamSpec::new(
            "goal_type",
            text("MoveBaseActionGoal"),
            OneOf(&["MoveBaseActionGoal", "PoseStamped"]),
            "type of goal_topic; PoseStamped for /move_base_simple/goal and /goal_pose",
        ),
        ParamSpec::new("robot", text(""), Any, "name of the robot, the namespace of its topics; empty: none"),
        ParamSpec::new(
            "source_frame",
            text("base_footprint"),
            Any,
            "frame of the robot, used without pose_topic",
        ),
        ParamSpec::new("target_frame", text("map"), Any, "frame of the published state"),
        ParamSpec::new(
            "queue_size",
            Value::Int(10),
            Range(1.0, 10000.0),
            "most messages that wait for a partner",
        ),
        ParamSpec::new(
            "slop",
            Value::Double(0.1),
            Range(0.0, 10.0),
            "most seconds between a pose and its odometry",
        ),
    ]
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
    let params = Params::read(mw, &specs())?;
    let mut health = Health::new(mw)?;
    let inbox = Inbox::new(mw, 1000);
    let robot = params.text("robot");
    let state_topic = in_namespace("robot", &robot, "/roscausal/robot")?;
    let publisher = mw.advertise::<RobotState>(&state_topic, Qos::Volatile(100))?;

    let qos = Qos::Volatile(100);
    let _odometry = match params.text_if_set("odom_topic") {
        Some(topic) => {
            let topic = in_namespace("robot", &robot, &topic)?;
            let (send, input) = (inbox.sender(), health.input::<Odometry>(&topic, true));
            let take = move |m: Odometry| send.send(Event::Odometry(input, Box::new(m)));
            Some(mw.subscribe(&topic, qos, take)?)
        }
        None => None,
    };
    let _pose = subscribe_pose(mw, &params, &inbox, &mut health)?;
    let _goal = subscribe_goal(mw, &params, &inbox)?;
    let send = inbox.sender();
    let _tf = mw.subscribe("/tf", qos, move |m: TFMessage| send.send(Event::Tf(m, false)))?;
    let send = inbox.sender();
    let _tf_static =
        mw.subscribe("/tf_static", Qos::Latched, move |m: TFMessage| send.send(Event::Tf(m, true)))?;

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
        let states = match inbox.awaited(mw, Some(health.due())).await {
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
                ("poses without odometry", tracker.unpaired().to_string()),
                ("out of order or twice", tracker.late().to_string()),
                ("without stamp", tracker.unstamped.to_string()),
                ("no transform in time", tracker.without_transform.to_string()),
                ("clock jumps back", tracker.jumps.to_string()),
                ("dropped", inbox.dropped().to_string()),
            ]
        };
        health.report(mw, figures, tracker.trouble.as_deref());
    }
}

/// Without a `pose_topic` there is no subscription.
fn subscribe_pose<M: Middleware>(
    mw: &M,
    params: &Params,
    inbox: &Inbox<Event>,
    health: &mut Health<M>,
) -> Result<Option<M::Subscription>> {
    let Some(topic) = params.text_if_set("pose_topic") else { return Ok(None) };
    let topic = in_namespace("robot", &params.text("robot"), &topic)?;
    let (qos, send) = (Qos::Volatile(100), inbox.sender());
    let subscription = if params.text("pose_type") == "PoseStamped" {
        let input = health.input::<PoseStamped>(&topic, true);
        mw.subscribe(&topic, qos, move |m: PoseStamped| send.send(Event::Pose(input, m.header, m.pose)))
    } else {
        let input = health.input::<PoseWithCovarianceStamped>(&topic, true);
        mw.subscribe(&topic, qos, move |m: PoseWithCovarianceStamped| {
            send.send(Event::Pose(input, m.header, m.pose.pose));
        })
    };
    subscription.map(Some)
}

fn subscribe_goal<M: Middleware>(
    mw: &M,
    params: &Params,
    inbox: &Inbox<Event>,
) -> Result<Option<M::Subscription>> {
    let Some(topic) = params.text_if_set("goal_topic") else { return Ok(None) };
    let topic = in_namespace("robot", &params.text("robot"), &topic)?;
    let send = inbox.sender();
    let subscription = if params.text("goal_type") == "PoseStamped" {
        mw.subscribe(&topic, Qos::Volatile(10), move |m: PoseStamped| {
            send.send(Event::Goal(m.header, m.pose.position))
        })
    } else {
        mw.subscribe(&topic, Qos::Volatile(10), move |m: MoveBaseActionGoal| {
            let target = m.goal.target_pose;
            send.send(Event::Goal(target.header, target.pose.position));
        })
    };
    subscription.map(Some)
}
