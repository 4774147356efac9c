//! The markers node: robot, people, goals and the risk cone for RViz and Foxglove, on `/roscausal/markers`.

use roscausal_msgs::{
    Duration, Humans, RobotState, Wires,
    geometry_msgs::{Point, Pose, Pose2D, Quaternion, Vector3},
    std_msgs::{ColorRGBA, Header},
    visualization_msgs::{Marker, MarkerArray, Ros2MarkerArray},
};

use super::{health::Health, scene_params::SceneOptions, to_its_end};
use crate::{
    Result,
    inbox::{Inbox, Next},
    middleware::{Middleware, Publish, Qos},
    params::Params,
};

const TOPIC: &str = "roscausal/markers";
/// A marker that is not repeated for this long disappears.
const LIFETIME: Duration = Duration { sec: 0, nanosec: 500_000_000 };
/// Least seconds between two messages.
const PERIOD_S: f64 = 0.09;

const ROBOT: [f32; 4] = [0.11, 0.31, 0.85, 1.0];
const CHOSEN: [f32; 4] = [0.06, 0.46, 0.43, 1.0];
const OTHER: [f32; 4] = [0.45, 0.5, 0.57, 1.0];
const GOAL: [f32; 4] = [0.49, 0.23, 0.93, 0.9];
const CONE: [f32; 4] = [0.96, 0.62, 0.04, 0.25];
const COLLISION: [f32; 4] = [0.76, 0.15, 0.11, 0.4];
const TEXT: [f32; 4] = [0.9, 0.9, 0.9, 1.0];

enum Event {
    Robot(usize, RobotState),
    Humans(usize, Humans),
}

/// The topic with the type that the middleware carries.
enum Output<M: Middleware> {
    Ros1(M::Publisher<MarkerArray>),
    Ros2(M::Publisher<Ros2MarkerArray>),
}

/// The markers node. It runs until the middleware ends.
///
/// # Errors
/// A parameter that is not allowed, or a topic that cannot be used.
pub fn markers<M: Middleware>(mw: &M) -> Result<()> {
    to_its_end(markers_task(mw))
}

/// The markers node as a task.
pub(super) async fn markers_task<M: Middleware>(mw: &M) -> Result<()> {
    let options = SceneOptions::read(&Params::read(mw, &SceneOptions::specs())?)?;
    let mut health = Health::new(mw)?;
    let inbox = Inbox::new(mw, 1000);
    let output: Output<M> = match mw.wires() {
        Wires::Ros2 => Output::Ros2(mw.advertise(TOPIC, Qos::Volatile(10))?),
        _ => Output::Ros1(mw.advertise(TOPIC, Qos::Volatile(10))?),
    };
    let robot_topic = options.robot_topic()?;
    let _robot = health.hear(mw, &inbox, (&robot_topic, false), Event::Robot)?;
    let _humans = health.hear(mw, &inbox, ("roscausal/humans", true), Event::Humans)?;

    let mut robot: Option<RobotState> = None;
    let mut due = mw.now();
    loop {
        match inbox.awaited(mw, Some(health.next)).await {
            Next::Shutdown => return Ok(()),
            Next::Deadline => {}
            Next::Event(Event::Robot(input, state)) => {
                health.heard(input, mw.now());
                robot = Some(state);
            }
            Next::Event(Event::Humans(input, humans)) => {
                health.heard(input, mw.now());
                let now = mw.now();
                due = due.min(now.plus_secs(PERIOD_S));
                if now >= due {
                    due = now.plus_secs(PERIOD_S);
                    let array = picture(robot.as_ref(), &humans, &options);
                    match &output {
                        Output::Ros1(publisher) => publisher.publish(&array)?,
                        Output::Ros2(publisher) => publisher.publish(&array.into())?,
                    }
                    health.sent();
                }
            }
        }
        health.report(mw, || [("dropped", inbox.dropped().to_string())], None);
    }
}

/// The scene as markers. What is unknown is left out.
fn picture(robot: Option<&RobotState>, humans: &Humans, options: &SceneOptions) -> MarkerArray {
    let chosen = options.person(&humans.humans, robot);
    let mut pen = Pen { header: humans.header.clone(), markers: Vec::new() };
    for person in &humans.humans {
        let is_chosen = chosen.as_ref().is_some_and(|chosen| chosen.id == person.id);
        let id = person.id as i32;
        let colour = if is_chosen { CHOSEN } else { OTHER };
        pen.solid("people", id, Marker::CYLINDER, &person.pose2d, [0.5, 0.5, 1.7], colour);
        pen.name(id, &person.pose2d);
        if is_chosen {
            pen.goal("person_goal", &person.pose2d, &person.goal);
        }
    }
    let Some(robot) = robot else { return MarkerArray { markers: pen.markers } };
    pen.solid("robot", 0, Marker::CUBE, &robot.pose2d, [0.65, 0.55, 0.4], ROBOT);
    pen.goal("robot_goal", &robot.pose2d, &robot.goal);
    if let Some(cone) = chosen.and_then(|person| options.cone(&person, robot)) {
        let colour = if cone.collision { COLLISION } else { CONE };
        let floor = cone.corners.map(|corner| Point { z: 0.02, ..corner });
        let unit = Vector3 { x: 1.0, y: 1.0, z: 1.0 };
        pen.lines("risk_cone", Marker::TRIANGLE_LIST, floor.to_vec(), unit, colour);
        let [apex, left, right] = floor;
        let [r, g, b, _] = colour;
        let thin = Vector3 { x: 0.03, ..Vector3::default() };
        pen.lines("risk_cone_edge", Marker::LINE_STRIP, vec![apex, left, right, apex], thin, [r, g, b, 1.0]);
    }
    MarkerArray { markers: pen.markers }
}

struct Pen {
    header: Header,
    markers: Vec<Marker>,
}

impl Pen {
    fn marker(&self, ns: &str, id: i32, kind: i32, colour: [f32; 4]) -> Marker {
        let [r, g, b, a] = colour;
        Marker {
            header: self.header.clone(),
            ns: ns.to_owned(),
            id,
            r#type: kind,
            action: Marker::ADD,
            pose: Pose { orientation: Quaternion::from_yaw(0.0), ..Pose::default() },
            color: ColorRGBA { r, g, b, a },
            lifetime: LIFETIME,
            ..Marker::default()
        }
    }

    /// A body that stands on the floor.
    fn solid(&mut self, ns: &str, id: i32, kind: i32, at: &Pose2D, size: [f64; 3], colour: [f32; 4]) {
        if !(at.x.is_finite() && at.y.is_finite()) {
            return;
        }
        let mut marker = self.marker(ns, id, kind, colour);
        let theta = if at.theta.is_finite() { at.theta } else { 0.0 };
        let [x, y, z] = size;
        let position = Point { x: at.x, y: at.y, z: z / 2.0 };
        marker.pose = Pose { position, orientation: Quaternion::from_yaw(theta) };
        marker.scale = Vector3 { x, y, z };
        self.markers.push(marker);
    }

    fn name(&mut self, id: i32, at: &Pose2D) {
        let mut marker = self.marker("names", id, Marker::TEXT_VIEW_FACING, TEXT);
        marker.pose.position = Point { x: at.x, y: at.y, z: 2.0 };
        marker.scale.z = 0.35;
        marker.text = (id as u32).to_string();
        self.markers.push(marker);
    }

    /// A goal, and a line to it.
    fn goal(&mut self, ns: &str, from: &Pose2D, goal: &Point) {
        if !(goal.x.is_finite() && goal.y.is_finite()) {
            return;
        }
        let place = Pose2D { x: goal.x, y: goal.y, theta: 0.0 };
        self.solid(ns, 0, Marker::CYLINDER, &place, [0.5, 0.5, 0.05], GOAL);
        let ends = [(from.x, from.y), (goal.x, goal.y)].map(|(x, y)| Point { x, y, z: 0.03 });
        let thin = Vector3 { x: 0.04, ..Vector3::default() };
        self.lines(&format!("{ns}_line"), Marker::LINE_STRIP, ends.to_vec(), thin, GOAL);
    }

    fn lines(&mut self, ns: &str, kind: i32, points: Vec<Point>, scale: Vector3, colour: [f32; 4]) {
        let mut marker = self.marker(ns, 0, kind, colour);
        (marker.points, marker.scale) = (points, scale);
        self.markers.push(marker);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;
    use roscausal_msgs::HumanState;

    use crate::{Time, batch::Select, loopback::Loopback};

    fn header(secs: f64) -> Header {
        Header { stamp: Time::from_secs_f64(secs), frame_id: "map".into() }
    }

    fn humans(secs: f64) -> Humans {
        let person = |id: u32, x: f64| {
            let mut person = HumanState { header: header(secs), id, ..HumanState::default() };
            person.pose2d.x = x;
            person.goal = Point { x: f64::NAN, y: f64::NAN, z: 0.0 };
            person
        };
        let mut people = vec![person(7, 5.0), person(1000, 1.0)];
        people[1].goal = Point { x: 8.0, y: 1.0, z: 0.0 };
        Humans { header: header(secs), humans: people }
    }

    fn kinds(array: &MarkerArray) -> Vec<&str> {
        array.markers.iter().map(|marker| marker.ns.as_str()).collect()
    }

    #[test]
    fn the_scene_has_people_goals_lines_and_the_cone_in_the_frame_of_the_states() {
        let bus = Loopback::lockstep();
        let thread = bus.start("markers", |mw| markers(&mw)).expect("starts");
        let test = bus.node("test");
        let seen = Arc::new(Mutex::new(Vec::new()));
        let sink = seen.clone();
        let _heard = test
            .subscribe(TOPIC, Qos::Volatile(10), move |m: MarkerArray| sink.lock().expect("a lock").push(m))
            .expect("subscribes");
        let robots = test.advertise("/roscausal/robot", Qos::Volatile(10)).expect("advertises");
        let people = test.advertise("/roscausal/humans", Qos::Volatile(10)).expect("advertises");
        let goal = Point { x: f64::NAN, y: f64::NAN, z: 0.0 };
        robots
            .publish(&RobotState { header: header(1.0), goal, ..RobotState::default() })
            .expect("publishes");
        people.publish(&humans(1.0)).expect("publishes");
        // The next one comes too soon to be shown.
        people.publish(&humans(1.01)).expect("publishes");
        bus.settle();
        bus.shutdown();
        thread.join().expect("no panic").expect("no error");
        let seen = seen.lock().expect("a lock");
        assert_eq!(seen.len(), 1);
        let expected = [
            "people", "names", "people", "names", "person_goal", "person_goal_line", "robot", "risk_cone",
            "risk_cone_edge",
        ];
        assert_eq!(kinds(&seen[0]), expected);
        assert!(seen[0].markers.iter().all(|marker| marker.header == header(1.0)));
        assert_eq!(seen[0].markers[7].points.len(), 3);
    }

    #[test]
    fn without_a_robot_there_are_the_people() {
        let humans = humans(1.0);
        let agents = Select::Ids([77, 78].into());
        let array = picture(None, &humans, &SceneOptions { agents, ..SceneOptions::default() });
        assert_eq!(kinds(&array), ["people", "names", "people", "names"]);
        let ros2 = Ros2MarkerArray::from(array);
        assert!(ros2.markers.iter().all(|marker| marker.color.a > 0.0 && marker.lifetime == LIFETIME));
    }
}
