//! Two robots with three people: each robot's nodes are in a namespace of their own, and what they publish is about that robot.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use std::{collections::BTreeSet, sync::mpsc};

use roscausal_core::{
    Time,
    loopback::Loopback,
    middleware::{Middleware, Publish, Qos},
    nodes,
    params::Value,
};
use roscausal_msgs::{
    HumanState, RobotState,
    geometry_msgs::PoseWithCovarianceStamped,
    nav_msgs::Odometry,
    pedsim_msgs::{TrackedPerson, TrackedPersons},
    std_msgs::Header,
};

#[test]
fn each_of_two_robots_has_its_own_person_and_place() {
    let bus = Loopback::lockstep();
    let world = bus.node("world");
    let mut running = Vec::new();
    let mut heard = Vec::new();
    for (robot, person) in [("r1", 1), ("r2", 2)] {
        for kind in ["robot", "human"] {
            let name = format!("{robot}/{kind}");
            if kind == "human" {
                bus.set_node_param(&name, "sel_agent", Value::Str(person.to_string()));
            }
            running.push(bus.start_task(&name, async move |mw| nodes::run_task(kind, &mw).await));
        }
        let ((tell_id, ids), (tell_place, places)) = (mpsc::channel(), mpsc::channel());
        let human = world
            .subscribe(&format!("/{robot}/roscausal/human"), Qos::Volatile(100), move |m: HumanState| {
                tell_id.send(m.id).unwrap_or_default();
            })
            .expect("subscribes");
        let state = world
            .subscribe(&format!("/{robot}/roscausal/robot"), Qos::Volatile(100), move |m: RobotState| {
                tell_place.send(m.pose2d.x.round() as i64).unwrap_or_default();
            })
            .expect("subscribes");
        heard.push((ids, places, human, state));
    }
    let people = world.advertise("/ped/control/teleop_persons", Qos::Volatile(10)).expect("advertises");
    let bodies = ["r1", "r2"].map(|robot| {
        let at = |topic: &str| format!("/{robot}/{topic}");
        (
            world
                .advertise::<Odometry>(&at("mobile_base_controller/odom"), Qos::Volatile(10))
                .expect("advertises"),
            world
                .advertise::<PoseWithCovarianceStamped>(&at("robot_pose"), Qos::Volatile(10))
                .expect("advertises"),
        )
    });
    // Person 2 leaves after two seconds; the others stay.
    for t in 0..50 {
        let header =
            Header { stamp: Time::from_secs_f64(100.0 + 0.1 * f64::from(t)), frame_id: "map".into() };
        bus.advance_to(header.stamp);
        for (number, (odometry, pose)) in bodies.iter().enumerate() {
            let mut place = PoseWithCovarianceStamped { header: header.clone(), ..Default::default() };
            place.pose.pose.position.x = 10.0 * number as f64;
            place.pose.pose.orientation.w = 1.0;
            odometry.publish(&Odometry { header: header.clone(), ..Odometry::default() }).expect("publishes");
            pose.publish(&place).expect("publishes");
        }
        let track = |id: u64| TrackedPerson { track_id: id, ..TrackedPerson::default() };
        let there = [1, 2, 3].into_iter().filter(|id| *id != 2 || t < 20);
        people.publish(&TrackedPersons { header, tracks: there.map(track).collect() }).expect("publishes");
        bus.settle();
    }
    let topics: BTreeSet<String> = world.topics().into_iter().map(|(topic, _)| topic).collect();
    bus.shutdown();
    running.into_iter().for_each(|node| node.end().expect("no panic").expect("ends well"));
    for (number, (ids, places, _human, _state)) in heard.into_iter().enumerate() {
        let ids: Vec<u32> = ids.try_iter().collect();
        assert!(ids.len() > 10 && ids.iter().all(|id| *id == number as u32 + 1), "{ids:?}");
        let places: Vec<i64> = places.try_iter().collect();
        assert!(places.len() > 10 && places.iter().all(|x| *x == 10 * number as i64), "{places:?}");
    }
    assert!(topics.iter().all(|topic| !topic.starts_with("/roscausal/")), "{topics:?}");
}
