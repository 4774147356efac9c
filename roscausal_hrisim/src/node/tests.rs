//! Tests of the simulator node: topics, commands, clock, interventions.

use std::sync::{Arc, Mutex};

use roscausal_core::params::{Allowed, ParamSpec, Value};
use roscausal_msgs::{
    geometry_msgs::{PoseStamped, PoseWithCovarianceStamped, Twist},
    move_base_msgs::MoveBaseActionGoal,
    nav_msgs::Odometry,
    pedsim_msgs::{AgentStates, LineObstacles, TrackedPersons},
    std_msgs::{Float64, String as Text},
    tf2_msgs::TFMessage,
};

use super::*;
use crate::Scenario;

type Seen<T> = Arc<Mutex<Vec<T>>>;

fn listen<T: roscausal_core::Message, M: Middleware>(mw: &M, topic: &str) -> (Seen<T>, M::Subscription) {
    let seen: Seen<T> = Arc::default();
    let sink = seen.clone();
    let handle = mw.subscribe(topic, Qos::Volatile(10), move |message: T| sink.lock().unwrap().push(message));
    (seen, handle.unwrap())
}

fn short(name: &str, duration: f64) -> Scenario {
    Scenario { duration, ..Scenario::named(name).unwrap() }
}

#[test]
fn every_topic_carries_what_is_true_within_its_noise() {
    let bus = Loopback::lockstep();
    let node = bus.node("listener");
    let (odom, _a) = listen::<Odometry, _>(&node, "/mobile_base_controller/odom");
    let (poses, _b) = listen::<PoseWithCovarianceStamped, _>(&node, "/robot_pose");
    let (goals, _c) = listen::<MoveBaseActionGoal, _>(&node, "/move_base/goal");
    let (people, _d) = listen::<TrackedPersons, _>(&node, "/ped/control/teleop_persons");
    let (human_goals, _e) = listen::<PoseStamped, _>(&node, "/hri/human_goal");
    let (walls, _f) = listen::<LineObstacles, _>(&node, "/pedsim_simulator/simulated_walls");
    let (tf, _g) = listen::<TFMessage, _>(&node, "/tf");
    let (risk, _h) = listen::<Float64, _>(&node, "/hri/risk");
    let mut simulation = Simulation::new(&short("thor", 20.0), 1).unwrap();
    run_lockstep(&bus, &mut simulation, 1, |_| true).unwrap();

    let (person, robot) = (&simulation.people[0], &simulation.robots[0]);
    let people = people.lock().unwrap();
    assert_eq!(people.len(), 500);
    let track = &people.last().unwrap().tracks[0];
    assert_eq!((track.track_id, people[0].header.frame_id.as_str()), (1000, "map"));
    assert!((track.pose.pose.position.x - person.position.x).abs() < 0.25);
    let speed = track.twist.twist.linear.x.hypot(track.twist.twist.linear.y);
    assert!((speed - person.v).abs() < 0.15);
    let pose = poses.lock().unwrap().last().unwrap().pose.pose;
    assert!((pose.position.y - robot.position.y).abs() < 0.05);

    // map -> odom -> base_footprint gives the robot's pose, and the odometry agrees.
    let tf = tf.lock().unwrap();
    let transforms = &tf.last().unwrap().transforms;
    let (first, second) = (transforms[0].transform, transforms[1].transform);
    assert_eq!(transforms[1].child_frame_id, "base_footprint");
    let turn = first.rotation.yaw();
    let x = first.translation.x + turn.cos() * second.translation.x - turn.sin() * second.translation.y;
    let y = first.translation.y + turn.sin() * second.translation.x + turn.cos() * second.translation.y;
    assert!((x - pose.position.x).abs() < 1e-9 && (y - pose.position.y).abs() < 1e-9);
    let odom = odom.lock().unwrap();
    assert_eq!(odom.last().unwrap().pose.pose.position.x, second.translation.x);
    assert!((odom.last().unwrap().twist.twist.linear.x - robot.v).abs() < 0.03);

    let goal = goals.lock().unwrap().last().unwrap().goal.target_pose.clone();
    assert_eq!((goal.header.frame_id.as_str(), goal.pose.position.x), ("map", robot.goal().x));
    assert_eq!(human_goals.lock().unwrap().last().unwrap().pose.position.x, person.goal.x);
    assert_eq!(walls.lock().unwrap()[0].obstacles.len(), 4);
    assert!(risk.lock().unwrap().iter().all(|risk| risk.data >= 1.0 && risk.data.is_finite()));
    let spec = ParamSpec::new("/hri/human_goal", Value::List(vec![]), Allowed::Any, "");
    let goal = Value::List(vec![Value::Double(person.goal.x), Value::Double(person.goal.y)]);
    assert_eq!(node.param(&spec).unwrap(), Some(goal));
}

#[test]
fn noise_is_seeded_and_never_changes_what_is_true() {
    let run = |noise| {
        let bus = Loopback::lockstep();
        let (people, _handle) =
            listen::<TrackedPersons, _>(&bus.node("listener"), "/ped/control/teleop_persons");
        let mut simulation = Simulation::new(&Scenario { noise, ..short("thor", 4.0) }, 5).unwrap();
        run_lockstep(&bus, &mut simulation, 1, |_| true).unwrap();
        let seen = std::mem::take(&mut *people.lock().unwrap());
        (seen, simulation.people[0].position)
    };
    let noisy = run(crate::scenario::Noise::default());
    assert_eq!(noisy, run(crate::scenario::Noise::default()));
    let clean = run(crate::scenario::Noise::NONE);
    assert_eq!(clean.1, noisy.1);
    assert_ne!(clean.0, noisy.0);
    assert_eq!(clean.0.last().unwrap().tracks[0].pose.pose.position.x, clean.1.x);
}

#[test]
fn robots_have_namespaces_and_pedestrians_their_topic() {
    let bus = Loopback::lockstep();
    let node = bus.node("listener");
    let (agents, _a) = listen::<AgentStates, _>(&node, "/pedsim_simulator/simulated_agents");
    let (odom, _b) = listen::<Odometry, _>(&node, "/robot2/mobile_base_controller/odom");
    let mut simulation = Simulation::new(&short("crowd", 1.0), 1).unwrap();
    run_lockstep(&bus, &mut simulation, 5, |_| true).unwrap();
    assert_eq!(agents.lock().unwrap().len(), 5);
    assert_eq!(agents.lock().unwrap()[0].agent_states.len(), 20);
    assert_eq!(odom.lock().unwrap()[0].child_frame_id, "robot2/base_footprint");
}

#[test]
fn interventions_are_published_when_they_change() {
    let bus = Loopback::lockstep();
    let (texts, _handle) = listen::<Text, _>(&bus.node("listener"), "/hri/interventions");
    let scenario =
        Scenario { interventions: vec!["robot.speed=0.2@0.5..0.8".parse().unwrap()], ..short("thor", 0.9) };
    let mut simulation = Simulation::new(&scenario, 1).unwrap();
    run_lockstep(&bus, &mut simulation, 1, |_| true).unwrap();
    let seen: Vec<String> = texts.lock().unwrap().iter().map(|text| text.data.clone()).collect();
    assert_eq!(seen.len(), 3, "{seen:?}");
    assert!(
        seen[0].contains("\"do_robot_speed\":[]") && seen[1].contains("\"do_robot_speed\":[0.2]"),
        "{seen:?}"
    );
    assert!(!seen[2].contains("[0.2]"));
}

#[test]
fn a_live_node_keeps_its_pace_and_obeys_commands() {
    let bus = Loopback::live(|| Time::ZERO);
    let node = bus.node("hrisim");
    let user = bus.node("user");
    let (clock, _a) = listen::<Clock, _>(&user, "/clock");
    let options = Options { pace: Pace::Times(20.0), clock: true, every: 5 };
    let simulation = Simulation::new(&short("thor", 8.0), 1).unwrap();
    let begin = Instant::now();
    let thread = std::thread::spawn(move || hrisim(&node, simulation, &options));
    let drive = user.advertise::<Twist>("/ped/control/cmd_vel", Qos::Volatile(10)).unwrap();
    let control = user.advertise::<Text>("/hri/control", Qos::Volatile(10)).unwrap();
    while clock.lock().unwrap().len() < 50 {
        std::thread::yield_now();
    }
    let mut twist = Twist::default();
    twist.linear.x = 0.3;
    drive.publish(&twist).unwrap();
    control.publish(&Text { data: "pause".into() }).unwrap();
    std::thread::sleep(Duration::from_millis(60));
    let paused_at = clock.lock().unwrap().len();
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(clock.lock().unwrap().len(), paused_at, "time stands still");
    control.publish(&Text { data: "resume".into() }).unwrap();
    let simulation = thread.join().unwrap().unwrap();
    assert!((0.5..5.0).contains(&begin.elapsed().as_secs_f64()), "{:?}", begin.elapsed());
    assert_eq!(clock.lock().unwrap().len(), 200);
    assert!(clock.lock().unwrap().windows(2).all(|pair| pair[0].clock < pair[1].clock));
    assert!((simulation.people[0].v - 0.3).abs() < 1e-9);
}

#[test]
fn a_speed_without_a_clock_is_refused() {
    let bus = Loopback::live(|| Time::ZERO);
    let run =
        |options| hrisim(&bus.node("hrisim"), Simulation::new(&short("thor", 1.0), 1).unwrap(), &options);
    let base = Options::default();
    assert!(run(Options { pace: Pace::Max, ..base.clone() }).unwrap_err().to_string().contains("/clock"));
    assert!(run(Options { pace: Pace::Times(f64::NAN), clock: true, ..base.clone() }).is_err());
    assert!(run(Options { every: 0, ..base }).is_err());
}
