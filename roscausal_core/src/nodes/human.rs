//! The human node: from people's topics and goals to `/roscausal/humans` and `/roscausal/human`.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use roscausal_msgs::{
    HumanState, Humans, RobotState, Time,
    geometry_msgs::{Point, Pose, Pose2D, PoseArray, PoseStamped, Quaternion, Twist},
    hri_msgs, pedsim_msgs, people_msgs, spencer_tracking_msgs,
    std_msgs::Header,
    tf2_msgs::TFMessage,
};

use super::{health::Health, in_namespace, labels, to_its_end};
use crate::{
    Error, Result,
    batch::Select,
    inbox::{Inbox, Next},
    middleware::{Middleware, Publish, Qos, Raw},
    param_specs,
    params::{Allowed, ParamSpec, Params, Value},
    people::{Reader, Tracker},
    signal::Definitions,
    state::{
        human::{PeopleTracker, Sighting, id_of_number, walking},
        identity::{Gates, Who},
    },
};

/// If stamps of a frame go back by more than this, the clock has jumped. Seconds.
const JUMP_S: f64 = 1.0;
/// Topics of ROS4HRI (REP-155): who is tracked, and the beginning of the names of their frames, the better first.
const ROS4HRI: [(&str, &str); 2] =
    [("/humans/persons/tracked", "person_"), ("/humans/bodies/tracked", "body_")];
/// Seconds between two reads of the goal parameter.
const GOAL_EVERY_S: f64 = 1.0;

/// When people were seen, and who.
type Seen = (Time, Vec<(Who, Sighting)>);

enum Event {
    People(usize, Seen),
    /// A message of any type, by the number of its reader.
    Any(usize, Raw),
    /// The ids that ROS4HRI tracks now, and the beginning of their frames' names.
    Tracked(usize, Time, &'static str, Vec<String>),
    Goal(Point),
    /// Goals, by person.
    Goals(Vec<(u32, Point)>),
    Robot(Pose2D),
    Tf(TFMessage, bool),
}

/// Names, defaults, allowed values and descriptions of the human node's parameters.
pub(super) fn specs() -> Vec<ParamSpec> {
    use Allowed::{Any, OneOf, Range};
    let text = |text: &str| Value::Str(text.to_owned());
    param_specs! {
        of_data "auto_people_topic" = text("/pedsim_simulator/simulated_agents"), Any,
            "pedsim_msgs/AgentStates; empty: none";
        of_data "teleop_people_topic" = text("/ped/control/teleop_persons"), Any,
            "pedsim_msgs/TrackedPersons; empty: none";
        of_data "people_topic" = text(""), Any,
            "people from another tracker, of type people_type; several topics separated by commas (auto only); of any message by \
             expressions, /tracks.list[*] -> id=track, x=pose.x, y=pose.y (docs/people.md); empty: none";
        of_data "people_type" = text("auto"),
            OneOf(&["auto", "spencer_tracking_msgs/TrackedPersons", "people_msgs/People", "geometry_msgs/PoseArray", "ros4hri"]),
            "type of people_topic; auto: any type that people are read from (docs/people.md), found by itself; ros4hri: TF frames \
             people_frames instead of people_topic, of those on /humans/persons/tracked, otherwise /humans/bodies/tracked";
        of_data "people_frames" = text(""), Any,
            "ros4hri: names of people's TF frames, * for the id, such as actor_*; empty: as REP-155, person_* or body_* of those on \
             the lists";
        of_data "people_classes" = text("person,people,pedestrian,human,0"), Any,
            "auto: classes of detections, and namespaces of markers, that are people (0: people among COCO's numbers)";
        of_data "people_names" = text(""), Any,
            "names of people, separated by commas, who get their numbers before all others: the number in the name, otherwise the \
             smallest free one";
        "msg_path" = text(""), Any,
            "auto on ROS 2: folders with .msg files, separated by :; then AMENT_PREFIX_PATH";
        "goal_param" = text("/hri/human_goal"), Any, "parameter with the goal [x, y]; empty: none";
        of_data "goal_topic" = text("/hri/human_goal"), Any, "geometry_msgs/PoseStamped goal; empty: none";
        of_data "goals_topic" = text("/hri/human_goals"), Any,
            "pedsim_msgs/TrackedPersons whose poses are the people's goals; empty: none";
        of_data "robot" = text(""), Any, "name of the robot that nearest:N refers to, and that has only its own person; empty: none";
        of_data "source_frame" = text("base_footprint"), Any,
            "frame of people whose topic names none; empty: target_frame";
        of_data "target_frame" = text("map"), Any, "frame of the published states";
        of_data "tf_topic" = text("/tf"), Any,
            "transforms; those that are fixed come on the same name with _static";
        of_data "sel_agent" = text("1000"), Any,
            "person on /roscausal/human; if absent, the first person, or nobody if robot is set";
        of_data "person_timeout" = Value::Double(1.0), Range(0.05, 60.0),
            "seconds for which a person is kept after the last sighting";
        of_data "join_gate" = Value::Double(0.8), Range(0.0, 10.0),
            "people without identity (PoseArray): a sighting within this many metres of a track, and 2 m per second since, belongs to it";
        of_data "rejoin_time" = Value::Double(0.0), Range(0.0, 60.0),
            "seconds: a new id within join_gate of somebody who was lost for at most this long is theirs; 0: never";
        of_data "position_noise" = Value::Double(0.05), Range(0.0, 5.0),
            "trackers without velocities: noise of their positions, metres, for the filter that gives velocities at once; 0: differences, for rows, too";
    }
}

/// The human node. It runs until the middleware ends.
///
/// # Errors
/// A parameter that is not allowed, or a topic that cannot be used.
pub fn human<M: Middleware>(mw: &M) -> Result<()> {
    to_its_end(human_task(mw))
}

/// The human node as a task.
pub(super) async fn human_task<M: Middleware>(mw: &M) -> Result<()> {
    let params = Params::read(mw, &specs())?;
    let mut health = Health::new(mw)?;
    let inbox = Inbox::new(mw, 1000);
    let everybody = mw.advertise::<Humans>("roscausal/humans", Qos::Volatile(100))?;
    let selected = mw.advertise::<HumanState>("roscausal/human", Qos::Volatile(100))?;
    let mut readers = Vec::new();
    let _inputs = subscribe_people(mw, &params, &inbox, &mut health, &mut readers)?;
    let goal = |m: PoseStamped| Event::Goal(m.pose.position);
    let goals = |topic: String| inbox.subscribe(mw, &topic, Qos::Volatile(10), goal);
    let _goal = params.text_if_set("goal_topic").map(goals).transpose()?;
    let tf = params.text_if_set("tf_topic").unwrap_or_else(|| "/tf".to_owned());
    let _tf = inbox.subscribe(mw, &tf, Qos::Volatile(100), |m| Event::Tf(m, false))?;
    let _tf_static = inbox.subscribe(mw, &format!("{tf}_static"), Qos::Latched, |m| Event::Tf(m, true))?;

    let ros4hri = params.text("people_type") == "ros4hri";
    let select: Select =
        params.text("sel_agent").parse().map_err(|reason| Error::param("sel_agent", reason))?;
    let goals = |m: pedsim_msgs::TrackedPersons| {
        let goal = |t: pedsim_msgs::TrackedPerson| (t.track_id as u32, t.pose.pose.position);
        Event::Goals(m.tracks.into_iter().map(goal).collect())
    };
    let goals = |topic: String| inbox.subscribe(mw, &topic, Qos::Latched, goals);
    let _goals = params.text_if_set("goals_topic").map(goals).transpose()?;
    let robot_name = params.text("robot");
    let by_robot = matches!(select, Select::Nearest(_)).then(|| {
        let topic = in_namespace("robot", &robot_name, "roscausal/robot")?;
        inbox.subscribe(mw, &topic, Qos::Volatile(10), |m: RobotState| Event::Robot(m.pose2d))
    });
    let _by_robot = by_robot.transpose()?;
    let mut robot: Option<Pose2D> = None;
    let goal_param = params.text_if_set("goal_param").map(goal_spec);
    let target_frame = params.text("target_frame");
    let source_frame = params.text_if_set("source_frame").unwrap_or_else(|| target_frame.clone());
    let timeout = params.double("person_timeout");
    let gates =
        Gates { metres: params.double("join_gate"), keep_s: timeout, rejoin_s: params.double("rejoin_time") };
    let mut tracker = PeopleTracker::new(&target_frame, &source_frame, timeout)
        .with(gates, params.double("position_noise"));
    for name in params.text("people_names").split(',').map(str::trim).filter(|name| !name.is_empty()) {
        tracker.identities.names.number(name);
    }
    let mut frames = Frames::new(&params.text("people_frames"));
    let (mut goal_due, mut published, mut unstamped) = (mw.now(), Time::ZERO, 0_u64);
    loop {
        let due = if goal_param.is_some() { goal_due.min(health.next) } else { health.next };
        match inbox.awaited(mw, Some(due)).await {
            Next::Shutdown => return Ok(()),
            Next::Event(Event::People(input, (stamp, people))) => {
                health.heard(input, mw.now());
                unstamped += u64::from(stamp == Time::ZERO);
                take(&mut tracker, input, stamp, people, mw.now());
            }
            Next::Event(Event::Any(place, message)) => {
                let (input, reader): &mut (usize, Reader) = &mut readers[place];
                health.heard(*input, mw.now());
                let seen = reader.read(&message);
                unstamped += u64::from(seen.stamp == Time::ZERO);
                take(&mut tracker, *input, seen.stamp, seen.people, mw.now());
            }
            Next::Event(Event::Tracked(input, stamp, prefix, ids)) => {
                health.heard(input, mw.now());
                let stamp = if stamp == Time::ZERO { mw.now() } else { stamp };
                if !tracker.is_late(input, stamp, 0) {
                    tracker.heard(stamp);
                }
                frames.tracked(prefix, ids);
            }
            Next::Event(Event::Goal(goal)) => tracker.goal(goal),
            Next::Event(Event::Goals(goals)) => {
                goals.into_iter().for_each(|(id, goal)| tracker.goal_of(id, goal))
            }
            Next::Event(Event::Robot(pose)) => robot = Some(pose),
            Next::Event(Event::Tf(message, is_fixed)) => tracker.transforms(&message, is_fixed),
            Next::Deadline => {}
        }
        let now = mw.now();
        // A clock that jumped back must not silence the node.
        goal_due = goal_due.min(now.plus_secs(GOAL_EVERY_S));
        if let Some(spec) = goal_param.as_ref().filter(|_| now >= goal_due) {
            goal_due = now.plus_secs(GOAL_EVERY_S);
            // A parameter server that is down must not end the node.
            if let Some(goal) = mw.param(spec).ok().flatten().and_then(|value| point(&value)) {
                tracker.goal(goal);
            }
        }
        if ros4hri {
            frames.take(&mut tracker, timeout);
        }
        // Of several robots each has its own person: nobody takes the place of one who is not there.
        let first = |people: &[HumanState]| select.one(people, robot.as_ref(), robot_name.is_empty());
        let about = |people: &[HumanState]| first(people).map(|person| person.id);
        // Every sighting is published, and that nobody is seen any more.
        let aged = |tracker: &mut PeopleTracker, published| {
            (tracker.newest() != published).then(|| tracker.people(about))
        };
        while let Some(people) = tracker.next(about).or_else(|| aged(&mut tracker, published)) {
            published = tracker.newest();
            if let Some(person) = first(&people.humans) {
                selected.publish(&person)?;
            }
            everybody.publish(&people)?;
            health.sent();
        }
        let unreadable = || readers.iter().map(|(_, reader)| reader.unreadable()).sum::<u64>();
        let figures = || {
            [
                (labels::LATE, tracker.late.to_string()),
                (labels::NO_TRANSFORM, tracker.without_transform.to_string()),
                (labels::NOT_FINITE, tracker.not_finite.to_string()),
                (labels::TOO_LATE, tracker.too_late.to_string()),
                (labels::UNSTAMPED, unstamped.to_string()),
                ("seen twice at one stamp", tracker.repeated.to_string()),
                (labels::NAMES, tracker.identities.names.reported()),
                (labels::CHANGED, tracker.identities.changed()),
                (labels::LEAPS, tracker.identities.leaps.to_string()),
                (labels::UNREADABLE, unreadable().to_string()),
                ("dropped", inbox.dropped().to_string()),
            ]
        };
        let unread = || readers.iter().find_map(|(_, reader)| reader.trouble());
        let unlisted = || ros4hri.then(|| frames.trouble()).flatten();
        health.report(mw, figures, tracker.trouble.clone().or_else(unread).or_else(unlisted).as_deref());
    }
}

/// Hands the people of a message to the tracker. What has no stamp counts as seen now.
fn take(tracker: &mut PeopleTracker, topic: usize, stamp: Time, mut people: Vec<(Who, Sighting)>, now: Time) {
    let stamped = |stamp: Time| if stamp == Time::ZERO { now } else { stamp };
    people.iter_mut().for_each(|(_, sighting)| sighting.header.stamp = stamped(sighting.header.stamp));
    if !tracker.is_late(topic, stamped(stamp), people.len()) {
        tracker.message(stamped(stamp), people);
    }
}

fn subscribe_people<M: Middleware>(
    mw: &M,
    params: &Params,
    inbox: &Inbox<Event>,
    health: &mut Health<M>,
    readers: &mut Vec<(usize, Reader)>,
) -> Result<Vec<M::Subscription>> {
    let mut subscriptions = Vec::new();
    if let Some(topic) = params.text_if_set("auto_people_topic") {
        let people = |input, m| Event::People(input, of_agents(m));
        subscriptions.push(health.hear(mw, inbox, (&topic, false), people)?);
    }
    if let Some(topic) = params.text_if_set("teleop_people_topic") {
        let people = |input, m: pedsim_msgs::TrackedPersons| {
            let tracks = m.tracks.into_iter().map(|t| (t.track_id, t.pose.pose, t.twist.twist));
            Event::People(input, of_tracks(m.header, tracks))
        };
        subscriptions.push(health.hear(mw, inbox, (&topic, false), people)?);
    }
    if params.text("people_type") == "ros4hri" {
        for (topic, prefix) in ROS4HRI {
            let ids = move |input, m: hri_msgs::IdsList| Event::Tracked(input, m.header.stamp, prefix, m.ids);
            subscriptions.push(health.hear(mw, inbox, (topic, false), ids)?);
        }
    }
    let Some(topic) = params.text_if_set("people_topic") else { return Ok(subscriptions) };
    if params.text("people_type") == "auto" {
        let classes: Vec<String> = params.text("people_classes").split(',').map(str::to_owned).collect();
        let definitions = Arc::new(Definitions::of(&params.text("msg_path")));
        for tracker in Tracker::all(&topic).map_err(|reason| Error::param("people_topic", reason))? {
            let (send, place, topic) = (inbox.sender(), readers.len(), tracker.topic.clone());
            let input = health.add(&topic, String::new(), true);
            readers.push((input, Reader::new(tracker, &classes, definitions.clone())));
            subscriptions.push(mw.listen(&topic, move |message| send.send(Event::Any(place, message)))?);
        }
        return Ok(subscriptions);
    }
    let topic = (topic.as_str(), true);
    subscriptions.push(match params.text("people_type").as_str() {
        "spencer_tracking_msgs/TrackedPersons" => {
            let people = |input, m: spencer_tracking_msgs::TrackedPersons| {
                let tracks = m.tracks.into_iter().map(|t| (t.track_id, t.pose.pose, t.twist.twist));
                Event::People(input, of_tracks(m.header, tracks))
            };
            health.hear(mw, inbox, topic, people)?
        }
        "people_msgs/People" => health.hear(mw, inbox, topic, |of, m| Event::People(of, of_people(m)))?,
        "geometry_msgs/PoseArray" => health.hear(mw, inbox, topic, |of, m| Event::People(of, of_poses(m)))?,
        _ => return Ok(subscriptions),
    });
    Ok(subscriptions)
}

fn of_agents(message: pedsim_msgs::AgentStates) -> Seen {
    let agents = message.agent_states.into_iter().map(|agent| (agent.id, agent.pose, agent.twist));
    of_tracks(message.header, agents)
}

fn of_tracks(header: Header, tracks: impl Iterator<Item = (u64, Pose, Twist)>) -> Seen {
    let sighting = |(id, pose, twist)| {
        let (id, twist) = (id_of_number(id), Some(twist));
        (Who::Number(id), Sighting { id, header: header.clone(), pose, twist, goal: None })
    };
    (header.stamp, tracks.map(sighting).collect())
}

fn of_people(message: people_msgs::People) -> Seen {
    let header = message.header;
    let sighting = |person: people_msgs::Person| {
        // What is not a number is not known, and who has no name is told apart by place.
        let velocity = Some([person.velocity.x, person.velocity.y]);
        let velocity = velocity.filter(|[x, y]| x.is_finite() && y.is_finite());
        let yaw = velocity.map_or(0.0, |[x, y]| libm::atan2(y, x));
        let pose = Pose { position: person.position, orientation: Quaternion::from_yaw(yaw) };
        let twist = velocity.map(walking);
        let who = if person.name.trim().is_empty() { Who::Unknown } else { Who::Name(person.name) };
        (who, Sighting { id: 0, header: header.clone(), pose, twist, goal: None })
    };
    (header.stamp, message.people.into_iter().map(sighting).collect())
}

/// Poses have no identity.
fn of_poses(message: PoseArray) -> Seen {
    let header = message.header;
    let sighting = |pose| (Who::Unknown, Sighting { header: header.clone(), pose, ..Sighting::default() });
    (header.stamp, message.poses.into_iter().map(sighting).collect())
}

/// People who are TF frames: ROS4HRI's, or those of a pattern.
struct Frames {
    /// Beginning and end of the names, if the user gave a pattern.
    pattern: Option<(String, String)>,
    /// Those who are tracked, until the next list, by the beginning of their frames' names.
    tracked: BTreeMap<&'static str, BTreeSet<String>>,
    /// The last stamp of each frame that was taken for a sighting.
    taken: BTreeMap<String, Time>,
}

impl Frames {
    fn new(pattern: &str) -> Self {
        let split = |pattern: &str| {
            let (start, end) = pattern.split_once('*').unwrap_or((pattern, ""));
            (start.trim_start_matches('/').to_owned(), end.to_owned())
        };
        Self {
            pattern: Some(pattern.trim()).filter(|text| !text.is_empty()).map(split),
            tracked: BTreeMap::new(),
            taken: BTreeMap::new(),
        }
    }

    fn tracked(&mut self, prefix: &'static str, ids: Vec<String>) {
        self.tracked.insert(prefix, ids.into_iter().collect());
    }

    /// What keeps everybody from being seen: nobody says who is tracked.
    fn trouble(&self) -> Option<String> {
        let [(persons, start), (bodies, _)] = ROS4HRI;
        (self.pattern.is_none() && self.tracked.is_empty()).then(|| {
            format!(
                "nobody says who is tracked, on {persons} or {bodies}; the parameter people_frames: '{start}*' takes all such frames"
            )
        })
    }

    /// Hands the frames that moved since the last call to the tracker, unless they are older than `timeout_s`. Persons count before
    /// bodies. Without a pattern only those on a list count: a frame outlives the person, and who is not on the list is not tracked.
    fn take(&mut self, tracker: &mut PeopleTracker, timeout_s: f64) {
        let kinds: Vec<(&str, &str)> = match &self.pattern {
            Some((start, end)) => vec![(start, end)],
            None => ROS4HRI.map(|(_, start)| (start, "")).to_vec(),
        };
        let recent = tracker.newest().plus_secs(-timeout_s);
        for (start, end) in kinds {
            let listed = self.tracked.get(start);
            let counts = |id: &str| self.pattern.is_some() || listed.is_some_and(|ids| ids.contains(id));
            let any = listed.is_some_and(|ids| !ids.is_empty());
            let mut moved: BTreeMap<Time, Vec<(Who, Sighting)>> = BTreeMap::new();
            for (name, stamp) in tracker.tf.frames_with_prefix(start) {
                let id = name.strip_prefix(start).and_then(|rest| rest.strip_suffix(end));
                let Some(id) = id.filter(|id| !id.is_empty() && counts(id)) else { continue };
                let who = Who::Name(id.to_owned());
                let is_new = match self.taken.get(&name) {
                    // The clock may have jumped back.
                    Some(last) => (stamp > *last && stamp >= recent) || last.secs_since(stamp) > JUMP_S,
                    None => stamp >= recent,
                };
                if is_new {
                    self.taken.insert(name.clone(), stamp);
                    let header = Header { stamp, frame_id: name };
                    moved.entry(stamp).or_default().push((who, Sighting { header, ..Sighting::default() }));
                }
            }
            moved.into_iter().for_each(|(stamp, people)| tracker.message(stamp, people));
            if any {
                return;
            }
        }
    }
}

/// The goal parameter, under the name that the user gave.
fn goal_spec(name: String) -> ParamSpec {
    // One small string per run of a node. The specification needs a name that lives as long as the program.
    let description = "the person's goal [x, y] in the target frame";
    ParamSpec::new(name.leak(), Value::List(Vec::new()), Allowed::Any, description).live()
}

fn point(value: &Value) -> Option<Point> {
    let Value::List(values) = value else { return None };
    match (values.first()?.as_double(), values.get(1)?.as_double()) {
        (Some(x), Some(y)) => Some(Point { x, y, z: 0.0 }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_without_a_name_are_not_one_person_and_a_velocity_of_nan_is_none() {
        let person = |name: &str| people_msgs::Person { name: name.into(), ..Default::default() };
        let mut people = vec![person("anna"), person(""), person(" ")];
        people[1].velocity.x = f64::NAN;
        let (_, seen) = of_people(people_msgs::People { people, ..Default::default() });
        let who: Vec<&Who> = seen.iter().map(|(who, _)| who).collect();
        assert_eq!(who, [&Who::Name("anna".into()), &Who::Unknown, &Who::Unknown]);
        let has_velocity: Vec<bool> = seen.iter().map(|(_, sighting)| sighting.twist.is_some()).collect();
        assert_eq!(has_velocity, [true, false, true]);
        assert!(seen.iter().all(|(_, sighting)| sighting.pose.orientation.w.is_finite()));
    }
}
