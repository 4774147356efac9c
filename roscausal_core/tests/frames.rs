//! `source_frame` of the robot and the human node, from the parameter to the published state.

#![allow(clippy::expect_used, reason = "a test may panic: that is how it fails")]

use std::sync::mpsc::channel;

use roscausal_core::{
    Time,
    loopback::Loopback,
    middleware::{Middleware, Publish, Qos},
    nodes,
    params::Value,
};
use roscausal_msgs::{
    Humans, RobotState,
    geometry_msgs::{Pose, PoseArray, PoseStamped, TransformStamped, TwistStamped},
    nav_msgs::{Odometry, Path},
    std_msgs::Header,
    tf2_msgs::TFMessage,
};

const NOW: f64 = 100.0;

fn text(text: &str) -> Value {
    Value::Str(text.to_owned())
}

fn header(frame: &str) -> Header {
    Header { stamp: Time::from_secs_f64(NOW), frame_id: frame.into() }
}

/// `/tf` says that `base_link` is 5 m along x of `map`.
fn tell_where_base_link_is(bus: &Loopback) {
    tell_where(bus, "base_link", "/tf", Qos::Volatile(10));
}

/// A topic of transforms says that `frame` is 5 m along x of `map`.
fn tell_where(bus: &Loopback, frame: &str, topic: &str, qos: Qos) {
    let tf = bus.node("localisation").advertise::<TFMessage>(topic, qos).expect("advertises");
    let mut transform =
        TransformStamped { header: header("map"), child_frame_id: frame.into(), ..Default::default() };
    transform.transform.translation.x = 5.0;
    tf.publish(&TFMessage { transforms: vec![transform] }).expect("publishes");
    bus.settle();
}

fn set(bus: &Loopback, node: &str, params: &[(&str, &str)]) {
    for (name, value) in params {
        bus.set_node_param(node, name, text(value));
    }
}

#[test]
fn without_a_pose_topic_the_robot_is_where_its_frame_is() {
    let bus = Loopback::lockstep();
    bus.set_node_param("robot", "pose_topic", text(""));
    bus.set_node_param("robot", "source_frame", text("base_link"));
    bus.advance_to(Time::from_secs_f64(NOW));
    let robot = bus.start_task("robot", async |mw| nodes::run_task("robot", &mw).await);
    let (listener, (send, states)) = (bus.node("listener"), channel());
    let take = move |state: RobotState| send.send(state).unwrap_or_default();
    let _states = listener.subscribe("/roscausal/robot", Qos::Volatile(10), take).expect("subscribes");
    tell_where_base_link_is(&bus);
    let odometry = listener
        .advertise::<Odometry>("/mobile_base_controller/odom", Qos::Volatile(10))
        .expect("advertises");
    let mut message = Odometry { header: header("odom"), ..Odometry::default() };
    message.twist.twist.linear.x = 0.5;
    odometry.publish(&message).expect("publishes");
    bus.settle();
    let state = states.try_recv().expect("a state");
    assert_eq!((state.header.frame_id.as_str(), state.pose2d.x, state.twist.linear.x), ("map", 5.0, 0.5));
    bus.shutdown();
    robot.end().expect("no panic").expect("ends well");
}

#[test]
fn a_robot_of_nav2_has_its_pose_from_odometry_and_tf_and_its_goal_from_the_end_of_the_plan() {
    let bus = Loopback::lockstep();
    let params = [
        ("odom_topic", "/tb3_0/odom"),
        ("pose_topic", "/tb3_0/odom"),
        ("pose_type", "Odometry"),
        ("goal_topic", "/tb3_0/plan"),
        ("goal_type", "Path"),
        ("tf_topic", "/tb3_0/tf"),
    ];
    set(&bus, "robot", &params);
    bus.advance_to(Time::from_secs_f64(NOW));
    let robot = bus.start_task("robot", async |mw| nodes::run_task("robot", &mw).await);
    let (driver, (send, states)) = (bus.node("driver"), channel());
    let take = move |state: RobotState| send.send(state).unwrap_or_default();
    let _states = driver.subscribe("/roscausal/robot", Qos::Volatile(10), take).expect("subscribes");
    tell_where(&bus, "odom", "/tb3_0/tf_static", Qos::Latched);
    let plan = driver.advertise::<Path>("/tb3_0/plan", Qos::Volatile(10)).expect("advertises");
    let at = |x: f64| {
        let mut pose = PoseStamped::default();
        pose.pose.position.x = x;
        pose
    };
    plan.publish(&Path { header: header("map"), poses: vec![at(1.0), at(2.0), at(9.0)] }).expect("publishes");
    // A plan that failed has no end, and changes nothing.
    plan.publish(&Path { header: header("map"), poses: Vec::new() }).expect("publishes");
    let odometry = driver.advertise::<Odometry>("/tb3_0/odom", Qos::Volatile(10)).expect("advertises");
    let mut message = Odometry { header: header("odom"), ..Odometry::default() };
    (message.pose.pose.position.x, message.twist.twist.linear.x) = (1.5, 0.4);
    odometry.publish(&message).expect("publishes");
    bus.settle();
    let state = states.try_recv().expect("a state");
    assert_eq!((state.pose2d.x, state.twist.linear.x, state.goal.x), (6.5, 0.4, 9.0));
    bus.shutdown();
    robot.end().expect("no panic").expect("ends well");
}

#[test]
fn a_velocity_alone_is_odometry_where_tf_tells_the_pose() {
    let bus = Loopback::lockstep();
    let params = [
        ("odom_topic", "/odometry/velocity"),
        ("odom_type", "TwistStamped"),
        ("pose_topic", ""),
        ("source_frame", "base_link"),
    ];
    set(&bus, "robot", &params);
    bus.advance_to(Time::from_secs_f64(NOW));
    let robot = bus.start_task("robot", async |mw| nodes::run_task("robot", &mw).await);
    let (listener, (send, states)) = (bus.node("listener"), channel());
    let take = move |state: RobotState| send.send(state).unwrap_or_default();
    let _states = listener.subscribe("/roscausal/robot", Qos::Volatile(10), take).expect("subscribes");
    tell_where_base_link_is(&bus);
    let velocity =
        listener.advertise::<TwistStamped>("/odometry/velocity", Qos::Volatile(10)).expect("advertises");
    let mut message = TwistStamped { header: header("base_link"), ..TwistStamped::default() };
    message.twist.linear.x = 0.7;
    velocity.publish(&message).expect("publishes");
    bus.settle();
    let state = states.try_recv().expect("a state");
    assert_eq!((state.pose2d.x, state.twist.linear.x), (5.0, 0.7));
    bus.shutdown();
    robot.end().expect("no panic").expect("ends well");
}

#[test]
fn a_robot_with_neither_pose_topic_nor_frame_is_refused() {
    let bus = Loopback::lockstep();
    bus.set_node_param("robot", "pose_topic", text(""));
    bus.set_node_param("robot", "source_frame", text(""));
    let robot = bus.start_task("robot", async |mw| nodes::run_task("robot", &mw).await);
    let error = robot.end().expect("no panic").expect_err("no pose").to_string();
    assert!(error.contains("'source_frame'") && error.contains("pose_topic"), "{error}");
}

#[test]
fn people_whose_topic_names_no_frame_are_seen_from_the_source_frame() {
    let bus = Loopback::lockstep();
    let params = [
        ("people_topic", "/people"),
        ("people_type", "geometry_msgs/PoseArray"),
        ("source_frame", "base_link"),
    ];
    set(&bus, "human", &params);
    bus.advance_to(Time::from_secs_f64(NOW));
    let human = bus.start_task("human", async |mw| nodes::run_task("human", &mw).await);
    let (listener, (send, states)) = (bus.node("listener"), channel());
    let take = move |people: Humans| send.send(people).unwrap_or_default();
    let _states = listener.subscribe("/roscausal/humans", Qos::Volatile(10), take).expect("subscribes");
    tell_where_base_link_is(&bus);
    let tracker = listener.advertise::<PoseArray>("/people", Qos::Volatile(10)).expect("advertises");
    let mut pose = Pose::default();
    pose.position.x = 2.0;
    tracker.publish(&PoseArray { header: header(""), poses: vec![pose] }).expect("publishes");
    bus.advance_to(Time::from_secs_f64(NOW + 0.5));
    let people = states.try_recv().expect("people");
    assert_eq!((people.header.frame_id.as_str(), people.humans[0].pose2d.x), ("map", 7.0));
    bus.shutdown();
    human.end().expect("no panic").expect("ends well");
}
