//! Which topic of a recording fills a role: the one that is named, otherwise by type and name.

use std::path::Path;

use roscausal_core::{
    Error, Result,
    params::{instead, nearest},
    people::{self, Tracker},
};
use roscausal_discovery::Named;
use roscausal_recording::{Recording, Topic};

use super::{
    coverage,
    robots::{self, LOCALISED, ODOMETRY, Robot, Space},
    roles::{BASES, CHOSEN_BY_NAME, Kind, NOT_PEOPLE, PEOPLE, ROBOT_ODOM, ROS4HRI, ROS4HRI_FRAMES, Role},
};

/// The value that means "no such topic".
const NONE: &str = "none";

/// States that ROS-Causal itself recorded.
pub(super) const STATES: [(&str, &str); 2] =
    [("/roscausal/robot", "roscausal_msgs/RobotState"), ("/roscausal/humans", "roscausal_msgs/Humans")];

/// The topics of a recording, to choose from.
pub(super) struct Chooser<'a> {
    pub(super) recording: &'a Recording,
    pub(super) path: &'a Path,
    /// Whose topics count for the roles of the robot.
    pub(super) robot: Space,
}

impl<'a> Chooser<'a> {
    /// The topics of a recording.
    ///
    /// # Errors
    /// It has none.
    pub(super) fn of(recording: &'a Recording, path: &'a Path) -> Result<Self> {
        if recording.topics().is_empty() {
            let losses = losses(path);
            return Err(Error::file(path, format!("it holds no messages; was it broken off?{losses}")));
        }
        Ok(Self { recording, path, robot: Space::Any })
    }
}

impl Chooser<'_> {
    /// The readable topics of a role's types; of a role of the robot, those of its namespace.
    pub(super) fn candidates(&self, role: &Role) -> Vec<&Topic> {
        let all = self.of_role(role).collect();
        if role.node == "robot" { self.robot.narrowed(all) } else { all }
    }

    /// The readable topics of a role's types.
    fn of_role(&self, role: &Role) -> impl Iterator<Item = &Topic> {
        let fits =
            move |topic: &&Topic| role.kind(&topic.type_name).is_some() && topic.known_type().is_some();
        self.recording.topics().iter().filter(fits)
    }

    /// The first usual name that one of these topics has, within the robot's namespace if it is a role of the robot.
    fn usual<'t>(&self, role: &Role, candidates: &[&'t Topic]) -> Option<&'t Topic> {
        let short = |topic: &Topic| match role.node {
            "robot" => self.robot.within(&topic.name).to_owned(),
            _ => topic.name.clone(),
        };
        role.usual.iter().find_map(|usual| candidates.iter().find(|topic| short(topic) == *usual).copied())
    }

    /// The robots in namespaces, by their odometry and poses.
    pub(super) fn robots(&self) -> Vec<Robot<'_>> {
        let tells = |topic: &&Topic| {
            [ODOMETRY, LOCALISED].contains(&topic.type_name.as_str()) && topic.known_type().is_some()
        };
        robots::of(self.recording.topics().iter().filter(tells).collect())
    }

    /// The namespace of the robot that the user names.
    pub(super) fn named_robot(&self, name: &str) -> Result<Space> {
        let robots = self.robots();
        let known = robots.iter().any(|robot| robot.is_called(name));
        let mut others =
            if known { Vec::new() } else { robots::framed(&coverage::frames(self.path, "/tf")?, &BASES) };
        let with_state =
            |topic: &Topic| Some(topic.name.strip_suffix(STATES[0].0)?.trim_matches('/').to_owned());
        others.extend(self.recording.topics().iter().filter_map(with_state).filter(|name| !name.is_empty()));
        robots::named(name, &robots, &others)
    }

    /// A topic for each of the robots that are not the one with the topics `own`: its odometry, if `transforms` of all are heard,
    /// otherwise its pose.
    pub(super) fn other_robots(&self, own: &[String], transforms: bool) -> Result<Vec<String>> {
        let robots = self.robots();
        let others =
            robots.iter().filter(|robot| robot.topics.iter().all(|topic| !own.contains(&topic.name)));
        let wanted = if transforms { ODOMETRY } else { LOCALISED };
        let topic = |robot: &Robot<'_>| {
            let best = robot.topics.iter().find(|topic| topic.type_name == wanted);
            best.or(robot.topics.first()).map(|topic| topic.name.clone())
        };
        let topics: Vec<String> = others.filter_map(topic).collect();
        if topics.is_empty() {
            let reason = "robots: there is no other robot in a namespace of its own; name the topics of those who move";
            return Err(Error::file(self.path, format!("{} {reason}", Named("people"))));
        }
        Ok(topics)
    }

    /// The error where several robots are TF frames.
    pub(super) fn several_frames(&self, robots: &[String]) -> Error {
        let (robots, way) = (robots.join(", "), format!("{} NAME chooses one", Named("robot")));
        let what = format!("TF has the robots {robots}, and no topic tells which one is meant; {way}");
        Error::file(self.path, what)
    }

    /// The topics of a signal, whatever their type: one, or one for each type of messages under the name.
    pub(super) fn any_topics(&self, name: &str) -> Result<Vec<Topic>> {
        let topics = self.recording.topics();
        let found: Vec<Topic> = topics.iter().filter(|topic| topic.is_named(name)).cloned().collect();
        if !found.is_empty() {
            return Ok(found);
        }
        let names: Vec<&str> = topics.iter().map(|topic| topic.name.as_str()).collect();
        let reason = format!("there is no topic {name}; {}", instead(&names, name, "topics in it:"));
        Err(Error::file(self.path, reason))
    }

    /// An expression in which topics have names that it can be written with: `/a_b.x` for `/a-b.x`.
    pub(super) fn with_playable_names(&self, expression: &str) -> String {
        let mut text = expression.to_owned();
        let mut names: Vec<&Topic> = self.recording.topics().iter().collect();
        // `/a-b/c` before `/a-b`.
        names.sort_by_key(|topic| std::cmp::Reverse(topic.name.len()));
        for topic in names.into_iter().filter(|topic| topic.name.starts_with('/')) {
            let playable = topic.playable();
            if playable != topic.name {
                text = text.replace(&topic.name, &playable);
            }
        }
        text
    }

    fn named(&self, role: &Role, name: &str) -> Result<Topic> {
        let inside = self.robot.inside(name).filter(|_| role.node == "robot");
        let is_inside = |topic: &&Topic| inside.as_ref() == Some(&topic.name);
        let found = self.of_role(role).find(|topic| topic.is_named(name));
        let found = found.or_else(|| self.of_role(role).find(is_inside));
        let reason = || format!("there is no topic {name} that can be {}", role.what);
        found.cloned().ok_or_else(|| self.fault(role, &reason()))
    }

    /// The topic of a role: the one that was named, or the one with a usual name, or the only one.
    pub(super) fn one(&self, role: &Role, named: Option<&str>) -> Result<Option<Topic>> {
        if let Some(name) = named {
            return self.named(role, name).map(Some);
        }
        let mut candidates = self.candidates(role);
        candidates.retain(|topic| !is_nobody(topic) && !CHOSEN_BY_NAME.contains(&topic.type_name.as_str()));
        match (self.usual(role, &candidates), candidates.as_slice()) {
            (Some(usual), _) => Ok(Some(usual.clone())),
            (None, [only]) => Ok(Some((*only).clone())),
            (None, []) => Ok(None),
            (None, _) => {
                let (robots, flag) = (self.robots(), Named("robot"));
                let names = robots.iter().map(|robot| robot.name.as_str()).collect::<Vec<_>>().join(", ");
                let way = match robots.len() > 1 && role.node == "robot" {
                    true => format!(", of the robots {names} ({flag} NAME chooses one)"),
                    false => String::new(),
                };
                Err(self.fault(role, &format!("several topics can be {}{way}", role.what)))
            }
        }
    }

    /// Like [`Chooser::one`], but it does not guess among several topics. Types with many meanings are chosen by
    /// name only.
    pub(super) fn optional(&self, role: &Role, named: Option<&str>) -> Result<Option<Topic>> {
        if named == Some(NONE) {
            return Ok(None);
        }
        if let Some(name) = named {
            return self.named(role, name).map(Some);
        }
        let mut candidates = self.candidates(role);
        // Nav2 has a /goal_pose that nobody publishes when goals come by its action.
        candidates.retain(|topic| topic.messages != Some(0));
        let usual = self.usual(role, &candidates);
        candidates.retain(|topic| !CHOSEN_BY_NAME.contains(&topic.type_name.as_str()));
        let only = if let [only] = candidates.as_slice() { Some(*only) } else { None };
        Ok(usual.or(only).cloned())
    }

    /// The topics that are named, or found by their types; none where people are TF frames.
    pub(super) fn people(&self, named: &[Tracker], tf: &str) -> Result<Vec<Topic>> {
        if !named.is_empty() {
            return named.iter().map(|tracker| self.named_people(tracker)).collect();
        }
        // The simulator has two, and the live node listens to both.
        let mut candidates = self.people_candidates();
        let is_usual = |topic: &&Topic| PEOPLE.usual.contains(&topic.name.as_str());
        let usual: Vec<Topic> = candidates.iter().copied().filter(is_usual).cloned().collect();
        if !usual.is_empty() {
            return Ok(usual);
        }
        candidates.retain(|topic| !is_nobody(topic));
        match candidates.as_slice() {
            [only] => Ok(vec![(*only).clone()]),
            [] if !self.ros4hri().is_empty() || self.people_frames(tf)?.is_some() => Ok(Vec::new()),
            [] => Err(self.nothing(&PEOPLE)),
            _ => Err(self.fault(&PEOPLE, "several topics can be people")),
        }
    }

    fn named_people(&self, tracker: &Tracker) -> Result<Topic> {
        let name = &tracker.topic;
        let same = |topic: &&Topic| topic.is_named(name);
        let readable = |topic: &&Topic| {
            let is_known = Self::people_kind(topic).is_some() || people::layout(&topic.type_name).is_some();
            is_known || tracker.is_described() && topic.raw_type().is_some()
        };
        let found = self.recording.topics().iter().filter(same).find(readable);
        found.cloned().ok_or_else(|| {
            let all: Vec<&str> =
                self.recording.topics().iter().filter(readable).map(|topic| topic.name.as_str()).collect();
            let near = nearest(&all, name).map_or(String::new(), |near| format!("; did you mean {near}?"));
            self.fault(&PEOPLE, &format!("there is no topic {name} that can be {}{near}", PEOPLE.what))
        })
    }

    /// The parameter of the human node for a topic of people.
    pub(super) fn people_kind(topic: &Topic) -> Option<&'static Kind> {
        PEOPLE.kind(&topic.type_name).filter(|_| topic.known_type().is_some())
    }

    /// The topics whose type alone says that they are people.
    pub(super) fn people_candidates(&self) -> Vec<&Topic> {
        let fits = |topic: &&Topic| {
            Self::people_kind(topic).is_some()
                || (people::layout(&topic.type_name) == Some(true) && topic.raw_type().is_some())
        };
        self.recording.topics().iter().filter(fits).collect()
    }

    /// The topics that tell whom ROS4HRI tracks.
    pub(super) fn ros4hri(&self) -> Vec<&Topic> {
        let is_list = |topic: &&Topic| {
            topic.type_name == "hri_msgs/IdsList"
                && ROS4HRI.contains(&topic.name.as_str())
                && topic.known_type().is_some()
        };
        self.recording.topics().iter().filter(is_list).collect()
    }

    /// The beginning of the names of people's frames, the better first, if there are such frames.
    pub(super) fn people_frames(&self, tf: &str) -> Result<Option<&'static str>> {
        let frames = coverage::frames(self.path, tf)?;
        Ok(ROS4HRI_FRAMES.into_iter().find(|start| frames.iter().any(|frame| frame.starts_with(start))))
    }

    pub(super) fn has_only_states(&self) -> bool {
        let topics = || self.recording.topics().iter().filter(|topic| topic.known_type().is_some());
        let there = |(name, kind)| {
            topics().any(|topic| topic.name == self.robot.full(name) && topic.type_name == kind)
        };
        self.one(&ROBOT_ODOM, None).is_ok_and(|topic| topic.is_none()) && STATES.into_iter().all(there)
    }

    /// The topic of transforms of the robot with this topic: that of its namespace, if there is one and no other.
    pub(super) fn tf_of(&self, topic: &str) -> String {
        let has = |name: &str| self.recording.topics().iter().any(|topic| topic.name == name);
        let mut space = topic;
        while let Some((above, _)) = space.rsplit_once('/') {
            let name = format!("{above}/tf");
            if has(&name) {
                return name;
            }
            space = above;
        }
        "/tf".to_owned()
    }

    pub(super) fn nothing(&self, role: &Role) -> Error {
        self.fault(role, &format!("nothing in it can be {}", role.what))
    }

    /// An error: the fault, what the role needs, and what there is.
    fn fault(&self, role: &Role, reason: &str) -> Error {
        let is_people = role.flag == PEOPLE.flag;
        let types: Vec<&str> = role.kinds.iter().map(|Kind { type_name, .. }| *type_name).collect();
        let types = match is_people {
            true => "people of any tracker, such as vision_msgs/Detection3DArray, people_msgs/People or geometry_msgs/PoseArray \
                     (docs/people.md has all types)"
                .to_owned(),
            false => format!("type {}", types.join(" or ")),
        };
        let candidates = if is_people { self.people_candidates() } else { self.candidates(role) };
        let describe = |topic: &Topic| format!("{} ({})", topic.name, topic.type_name);
        let takes = format!("{reason}; {} takes a topic of {types}", Named(role.flag));
        if candidates.is_empty() {
            let all: Vec<String> = self.recording.topics().iter().map(describe).collect();
            let (all, signal) = (all.join(", "), Named("signal"));
            let reason = format!(
                "{takes}; topics in it: {all}; {signal} 'v = /topic.field' reads any number of any topic (roscausal topics --signals \
                 lists them)"
            );
            return Error::file(self.path, reason);
        }
        let list: Vec<String> = candidates.into_iter().map(describe).collect();
        Error::file(self.path, format!("{takes}; of these types: {}", list.join(", ")))
    }
}

/// What of a recording could not be read, as the end of a sentence about it.
fn losses(path: &Path) -> String {
    let Ok(mut recording) = Recording::open(path) else { return String::new() };
    recording.by_ref().for_each(drop);
    recording.losses().iter().map(|loss| format!(" ({loss})")).collect()
}

/// Whether a topic of poses is by its name not one of people.
pub(super) fn is_nobody(topic: &Topic) -> bool {
    let last = topic.name.rsplit('/').next().unwrap_or_default().to_lowercase();
    topic.type_name == "geometry_msgs/PoseArray" && NOT_PEOPLE.iter().any(|word| last.contains(word))
}
