//! Publishes one step of a simulation, like a robot, its localisation and a people tracker.

use roscausal_core::{
    Result, Time,
    middleware::{Middleware, Publish, Qos},
    params::Value,
};
use roscausal_msgs::{
    geometry_msgs::{
        Point, Pose, PoseStamped, PoseWithCovariance, PoseWithCovarianceStamped, Quaternion, Transform,
        TransformStamped, Twist, TwistWithCovariance, Vector3,
    },
    move_base_msgs::MoveBaseActionGoal,
    nav_msgs::Odometry,
    pedsim_msgs::{AgentState, AgentStates, LineObstacle, LineObstacles, TrackedPerson, TrackedPersons},
    std_msgs::{Float64, Header, String as Text},
    tf2_msgs::TFMessage,
};

use super::sensors::{Measured, Sensors};
use crate::{
    Simulation,
    day::{Day, Leg},
    geometry::{Vec2, wrap},
    robot::Robot,
    simulation::Context,
};

/// Goals, walls and interventions are published when they change, and repeated at this interval, seconds.
const REPEAT: f64 = 1.0;
/// Steps between two messages of a working day's topics: 1 s.
const EVERY: u64 = 25;
/// Queue of the ordinary topics.
const DEPTH: usize = 50;
/// The paper's `obs_size` and `safe_dist` for `/hri/risk`, metres.
const RISK: (f64, f64) = (2.0, 5.0);

/// The publishers of one simulation on one middleware.
pub struct Publisher<M: Middleware> {
    mw: M,
    sensors: Sensors,
    robots: Vec<RobotTopics<M>>,
    persons: M::Publisher<TrackedPersons>,
    agents: M::Publisher<AgentStates>,
    walls: M::Publisher<LineObstacles>,
    human_goals: Vec<(M::Publisher<PoseStamped>, String)>,
    all_goals: M::Publisher<TrackedPersons>,
    risk: M::Publisher<Float64>,
    tf: M::Publisher<TFMessage>,
    interventions: M::Publisher<Text>,
    day: Option<DayTopics<M>>,
    /// What was last published on the topics that report changes, and when.
    reported: Option<Reported>,
    /// Whether the goal parameters cannot be set at present.
    without_params: bool,
}

struct RobotTopics<M: Middleware> {
    odom: M::Publisher<Odometry>,
    pose: M::Publisher<PoseWithCovarianceStamped>,
    /// `None` on ROS 2, which lacks this type.
    action_goal: Option<M::Publisher<MoveBaseActionGoal>>,
    goal: M::Publisher<PoseStamped>,
    odom_frame: String,
    base_frame: String,
    name: String,
}

#[derive(Clone, Debug, PartialEq)]
struct Reported {
    since: Time,
    human_goals: Vec<Vec2>,
    crowd_goals: Vec<Vec2>,
    robot_goals: Vec<(Vec2, u64)>,
    context: Vec<Context>,
}

impl<M: Middleware> Publisher<M> {
    /// Advertises everything that `simulation` needs.
    ///
    /// # Errors
    /// A topic that the middleware refuses.
    pub fn new(mw: &M, simulation: &Simulation) -> Result<Self> {
        let noise = simulation.scenario().noise.clone();
        let robots = simulation.robots.iter().map(|robot| RobotTopics::new(mw, &robot.name));
        let human_goals = simulation.people.iter().enumerate().map(|(index, person)| {
            let suffix = if index == 0 { String::new() } else { format!("_{}", person.id) };
            let name = format!("/hri/human_goal{suffix}");
            Ok((mw.advertise(&name, Qos::Latched)?, name))
        });
        Ok(Self {
            mw: mw.clone(),
            sensors: Sensors::new(noise, simulation.seed()),
            robots: robots.collect::<Result<_>>()?,
            persons: mw.advertise("/ped/control/teleop_persons", Qos::Volatile(DEPTH))?,
            agents: mw.advertise("/pedsim_simulator/simulated_agents", Qos::Volatile(DEPTH))?,
            walls: mw.advertise("/pedsim_simulator/simulated_walls", Qos::Latched)?,
            human_goals: human_goals.collect::<Result<_>>()?,
            all_goals: mw.advertise("/hri/human_goals", Qos::Latched)?,
            risk: mw.advertise("/hri/risk", Qos::Volatile(DEPTH))?,
            tf: mw.advertise("/tf", Qos::Volatile(DEPTH))?,
            interventions: mw.advertise("/hri/interventions", Qos::Latched)?,
            day: simulation.day.as_ref().map(|day| DayTopics::new(mw, day)).transpose()?,
            reported: None,
            without_params: false,
        })
    }

    /// Publishes the state of `simulation`, measured at `stamp`.
    ///
    /// # Errors
    /// A message that the middleware refuses.
    pub fn publish_step(&mut self, simulation: &Simulation, stamp: Time) -> Result<()> {
        let mut transforms = Vec::new();
        for (robot, topics) in simulation.robots.iter().zip(&self.robots) {
            transforms.extend(topics.publish(robot, self.sensors.robot(robot), stamp)?);
        }
        self.tf.publish(&TFMessage { transforms })?;
        self.publish_people(simulation, stamp)?;
        if let (Some(day), Some(topics)) = (&simulation.day, &mut self.day)
            && simulation.steps().is_multiple_of(EVERY)
        {
            topics.publish(simulation, day)?;
        }
        self.tell_changes(simulation, stamp)
    }

    fn publish_people(&mut self, simulation: &Simulation, stamp: Time) -> Result<()> {
        let header = header(stamp, "map");
        let tracks = simulation.people.iter().map(|person| {
            let measured = self.sensors.person(person);
            TrackedPerson {
                track_id: u64::from(person.id),
                is_matched: true,
                detection_id: u64::from(person.id),
                pose: PoseWithCovariance { pose: pose(measured), ..Default::default() },
                twist: TwistWithCovariance { twist: planar_twist(measured), ..Default::default() },
                ..Default::default()
            }
        });
        self.persons.publish(&TrackedPersons { header: header.clone(), tracks: tracks.collect() })?;
        let agent_states = simulation.crowd.members.iter().map(|walker| {
            let measured = self.sensors.pedestrian(walker);
            AgentState {
                header: header.clone(),
                id: u64::from(walker.id),
                social_state: "individual_moving".to_owned(),
                pose: pose(measured),
                twist: planar_twist(measured),
                ..Default::default()
            }
        });
        self.agents.publish(&AgentStates { agent_states: agent_states.collect(), header })?;
        if let Some(person) = simulation.people.first() {
            self.risk.publish(&Float64 { data: simulation.risk(person, RISK.0, RISK.1) })?;
        }
        Ok(())
    }

    /// Publishes goals, walls and interventions when they change, and once a second.
    fn tell_changes(&mut self, simulation: &Simulation, stamp: Time) -> Result<()> {
        let is_recent = |reported: &&Reported| (0.0..REPEAT).contains(&stamp.secs_since(reported.since));
        let before = self.reported.as_ref().filter(is_recent);
        let now = Reported {
            since: before.map_or(stamp, |reported| reported.since),
            human_goals: simulation.people.iter().map(|person| person.goal).collect(),
            crowd_goals: simulation.crowd.members.iter().map(|member| member.goal).collect(),
            robot_goals: simulation.robots.iter().map(|robot| (robot.goal(), robot.legs_done)).collect(),
            context: simulation.context(),
        };
        if before.is_none_or(|reported| reported.human_goals != now.human_goals) {
            for (goal, (topic, name)) in now.human_goals.iter().zip(&self.human_goals) {
                topic.publish(&PoseStamped { header: header(stamp, "map"), pose: pose_at(*goal) })?;
                let place = Value::List(vec![Value::Double(goal.x), Value::Double(goal.y)]);
                let set = self.mw.set_param(name, place);
                // A master that is down is no reason to stop. The next goal, or the next second, tries again.
                if let (Err(error), false) = (&set, self.without_params) {
                    tracing::warn!("{name} is told as a topic only, not as a parameter: {error}");
                }
                self.without_params = set.is_err();
            }
        }
        let told_goals = |reported: &Reported| {
            reported.human_goals == now.human_goals && reported.crowd_goals == now.crowd_goals
        };
        if !before.is_some_and(told_goals) {
            let people = simulation.people.iter().map(|person| (person.id, person.goal));
            let crowd = simulation.crowd.members.iter().map(|member| (member.id, member.goal));
            let track = |(id, goal): (u32, Vec2)| TrackedPerson {
                track_id: u64::from(id),
                pose: PoseWithCovariance { pose: pose_at(goal), ..Default::default() },
                ..Default::default()
            };
            let tracks = people.chain(crowd).map(track).collect();
            self.all_goals.publish(&TrackedPersons { header: header(stamp, "map"), tracks })?;
        }
        if before.is_none_or(|reported| reported.robot_goals != now.robot_goals) {
            for ((goal, leg), topics) in now.robot_goals.iter().zip(&self.robots) {
                topics.publish_goal(*goal, *leg, stamp)?;
            }
        }
        if before.is_none_or(|reported| reported.context != now.context) {
            self.interventions
                .publish(&Text { data: context_json(stamp, simulation.time(), &now.context) })?;
        }
        if before.is_none() {
            let point = |p: Vec2| Point { x: p.x, y: p.y, z: 0.0 };
            let wall = |w: &crate::geometry::Segment| LineObstacle { start: point(w.a), end: point(w.b) };
            let obstacles = simulation.world().walls().iter().map(wall).collect();
            self.walls.publish(&LineObstacles { header: header(stamp, "map"), obstacles })?;
        }
        self.reported = Some(now);
        Ok(())
    }
}

/// The topics of a working day.
struct DayTopics<M: Middleware> {
    /// `/people_counter/PLACE`, in the order of the map.
    counters: Vec<M::Publisher<Float64>>,
    /// `/robot_at/PLACE`: 1 where the robot is, 0 elsewhere.
    robot_at: Vec<M::Publisher<Float64>>,
    /// `/hour`, `/battery` (percent), `/load` (0 or 1).
    numbers: [M::Publisher<Float64>; 3],
    /// `/hri/leg`: the way on which somebody has to decide, as JSON; `{}` if there is none.
    leg: M::Publisher<Text>,
    asked: Option<Leg>,
}

impl<M: Middleware> DayTopics<M> {
    fn new(mw: &M, day: &Day) -> Result<Self> {
        let at_places = |topic: &str| -> Result<Vec<M::Publisher<Float64>>> {
            let names = day.map.places.iter().map(|place| format!("/{topic}/{}", place.name));
            names.map(|name| mw.advertise(&name, Qos::Volatile(DEPTH))).collect()
        };
        let number = |topic: &str| mw.advertise(topic, Qos::Volatile(DEPTH));
        let leg: M::Publisher<Text> = mw.advertise("/hri/leg", Qos::Latched)?;
        leg.publish(&Text { data: "{}".into() })?;
        Ok(Self {
            counters: at_places("people_counter")?,
            robot_at: at_places("robot_at")?,
            numbers: [number("/hour")?, number("/battery")?, number("/load")?],
            leg,
            asked: None,
        })
    }

    fn publish(&mut self, simulation: &Simulation, day: &Day) -> Result<()> {
        let at = simulation.robots.first().and_then(|robot| day.counted_at(robot.position));
        for (place, count) in day.counts(&simulation.crowd).into_iter().enumerate() {
            self.counters[place].publish(&Float64 { data: f64::from(count) })?;
            self.robot_at[place].publish(&Float64 { data: f64::from(at == Some(place)) })?;
        }
        let load = f64::from(day.porter.is_loaded());
        for (topic, data) in self.numbers.iter().zip([day.clock(simulation.time()), day.porter.charge, load])
        {
            topic.publish(&Float64 { data })?;
        }
        let leg = day.porter.open_leg();
        if self.asked.as_ref() != leg {
            let name = |place: usize| &day.map.places[place].name;
            let text = leg.map(|leg| {
                serde_json::json!({
                    "from": name(leg.from), "to": name(leg.to), "loaded": leg.loaded, "allowed": leg.allowed,
                    "wait": (leg.latest - simulation.time()).max(0.0), "hour": day.clock(simulation.time()),
                })
            });
            self.leg.publish(&Text { data: text.unwrap_or_else(|| serde_json::json!({})).to_string() })?;
            self.asked = leg.cloned();
        }
        Ok(())
    }
}

impl<M: Middleware> RobotTopics<M> {
    fn new(mw: &M, name: &str) -> Result<Self> {
        let space = if name.is_empty() { String::new() } else { format!("/{name}") };
        let frame = if name.is_empty() { String::new() } else { format!("{name}/") };
        let at = |topic: &str| format!("{space}{topic}");
        Ok(Self {
            odom: mw.advertise(&at("/mobile_base_controller/odom"), Qos::Volatile(DEPTH))?,
            pose: mw.advertise(&at("/robot_pose"), Qos::Volatile(DEPTH))?,
            action_goal: optional(mw.advertise(&at("/move_base/goal"), Qos::Latched)),
            goal: mw.advertise(&at("/goal_pose"), Qos::Latched)?,
            odom_frame: format!("{frame}odom"),
            base_frame: format!("{frame}base_footprint"),
            name: name.to_owned(),
        })
    }

    /// Publishes odometry and pose. Returns the transforms to them.
    fn publish(&self, robot: &Robot, measured: Measured, stamp: Time) -> Result<[TransformStamped; 2]> {
        // The odometry frame begins where the robot started.
        let (origin, turn) = robot.start;
        let offset = measured.position - origin;
        let (cos, sin) = (libm::cos(turn), libm::sin(turn));
        let in_odom = Measured {
            position: Vec2::new(cos * offset.x + sin * offset.y, cos * offset.y - sin * offset.x),
            theta: wrap(measured.theta - turn),
            ..measured
        };
        let forward = Twist {
            linear: Vector3 { x: measured.v, y: 0.0, z: 0.0 },
            angular: Vector3 { x: 0.0, y: 0.0, z: measured.omega },
        };
        self.odom.publish(&Odometry {
            header: header(stamp, &self.odom_frame),
            child_frame_id: self.base_frame.clone(),
            pose: PoseWithCovariance { pose: pose(in_odom), ..Default::default() },
            twist: TwistWithCovariance { twist: forward, ..Default::default() },
        })?;
        self.pose.publish(&PoseWithCovarianceStamped {
            header: header(stamp, "map"),
            pose: PoseWithCovariance { pose: pose(measured), ..Default::default() },
        })?;
        Ok([
            transform(stamp, "map", &self.odom_frame, origin, turn),
            transform(stamp, &self.odom_frame, &self.base_frame, in_odom.position, in_odom.theta),
        ])
    }

    fn publish_goal(&self, goal: Vec2, leg: u64, stamp: Time) -> Result<()> {
        let target = PoseStamped { header: header(stamp, "map"), pose: pose_at(goal) };
        self.goal.publish(&target)?;
        if let Some(topic) = &self.action_goal {
            let mut message = MoveBaseActionGoal { header: header(stamp, ""), ..Default::default() };
            message.goal_id.stamp = stamp;
            message.goal_id.id = format!("hrisim-{}-{leg}", self.name);
            message.goal.target_pose = target;
            topic.publish(&message)?;
        }
        Ok(())
    }
}

/// A publisher that this middleware may not support.
fn optional<T>(publisher: Result<T>) -> Option<T> {
    publisher.inspect_err(|reason| tracing::debug!("not published: {reason}")).ok()
}

fn header(stamp: Time, frame: &str) -> Header {
    Header { stamp, frame_id: frame.to_owned() }
}

fn pose(measured: Measured) -> Pose {
    Pose {
        position: Point { x: measured.position.x, y: measured.position.y, z: 0.0 },
        orientation: Quaternion::from_yaw(measured.theta),
    }
}

fn pose_at(p: Vec2) -> Pose {
    Pose { position: Point { x: p.x, y: p.y, z: 0.0 }, orientation: Quaternion::default() }
}

/// Velocity in the map frame, as trackers publish it.
fn planar_twist(measured: Measured) -> Twist {
    let velocity = Vec2::polar(measured.v, measured.theta);
    Twist {
        linear: Vector3 { x: velocity.x, y: velocity.y, z: 0.0 },
        angular: Vector3 { x: 0.0, y: 0.0, z: measured.omega },
    }
}

fn transform(stamp: Time, parent: &str, child: &str, at: Vec2, turn: f64) -> TransformStamped {
    TransformStamped {
        header: header(stamp, parent),
        child_frame_id: child.to_owned(),
        transform: Transform {
            translation: Vector3 { x: at.x, y: at.y, z: 0.0 },
            rotation: Quaternion::from_yaw(turn),
        },
    }
}

/// `{"stamp": 61.2, "time": 61.2, "context": {"do_robot_speed": [0.2]}}`. An empty list means that nothing is
/// imposed.
fn context_json(stamp: Time, time: f64, context: &[Context]) -> String {
    let columns: serde_json::Map<String, serde_json::Value> =
        context.iter().map(|column| (column.name.clone(), column.value.clone().into())).collect();
    serde_json::json!({ "stamp": stamp.as_secs_f64(), "time": time, "context": columns }).to_string()
}
