//! The roles of a recording's topics: as the user says, or found by their types.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use clap::Args as ClapArgs;
use roscausal_core::{
    Error, Result, Time, nodes,
    params::{Value, instead},
    people::{Reader, Tracker},
    signal::{Definitions, Signal, Signals},
};
use roscausal_recording::{Recording, Topic};

use crate::{carried::carried, flags, nodes::RECORDING, travel};

use super::{
    choose::{Chooser, STATES, is_nobody},
    clocks::{ClockChoice, Clocks},
    coverage, persons,
    robots::{self, Space},
    roles::{BASES, HUMAN_GOAL, PEOPLE, ROBOT_GOAL, ROBOT_ODOM, ROBOT_POSE, ROS4HRI_FRAMES, Role, VELOCITY},
};

/// Flags that only recordings have.
pub(crate) const FLAGS: &str =
    "robot robot-odom robot-pose robot-goal people human-goal signal clock person ts-length param";
/// The value that means "the pose in the odometry".
const FROM_ODOMETRY: &str = "odom";
/// The value of `--people` that means "the other robots".
const OTHER_ROBOTS: &str = "robots";
/// The value of `--person` that means "only signals".
const NOBODY: &str = "nobody";
/// How long a signal's last value counts, as in the data node. Seconds.
const SIGNAL_MAX_AGE_S: f64 = 2.0;
/// Odometry is taken instead of a topic of poses if it knows the robot for this much more of the time.
const CLEARLY_MORE: f64 = 0.1;
/// Topic of the poses taken from odometry.
pub(crate) const ODOMETRY_POSE: &str = "/roscausal_replay/odometry_pose";

/// Topic of the interventions, unless `data.context_topic` is another.
const INTERVENTIONS: &str = "/hri/interventions";

/// Which topics of a recording play which role.
#[derive(ClapArgs, Clone, Debug, Default)]
#[command(next_help_heading = "Recordings")]
pub(crate) struct InputArgs {
    /// Recording of several robots: which one, by its namespace (`tb3_0` for /tb3_0/odom). The others may be the people
    /// (`--people robots`).
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
    /// Recording: topic of the robot's odometry. Default for this and the next four: found by type and name.
    #[arg(long, value_name = "TOPIC")]
    robot_odom: Option<String>,
    /// Recording: topic of the robot's pose; `odom`: the pose in the odometry, transformed to the map frame by TF. Default: what
    /// knows the robot for more of the time.
    #[arg(long, value_name = "TOPIC")]
    robot_pose: Option<String>,
    /// Recording: topic of the robot's goal, or `none`.
    #[arg(long, value_name = "TOPIC")]
    robot_goal: Option<String>,
    /// Recording: topics of people of any known type (docs/people.md), separated by commas; `ros4hri`: its TF frames;
    /// `tf:actor_*`: TF frames of this name, with the id for `*`; `robots`: the other robots. Of any message by expressions:
    /// '/tracks.list[*] -> id=track, x=pose.x, y=pose.y'.
    #[arg(long, value_name = "TOPIC", value_delimiter = ',', help_heading = "People")]
    people: Vec<String>,
    /// Recording: topic of the person's goal, or `none`.
    #[arg(long, value_name = "TOPIC", help_heading = "People")]
    human_goal: Option<String>,
    /// Recording: a number of any topic as a variable, such as `v_cmd = /cmd_vel.linear.x`; may be given several times
    /// (docs/signals.md). Where a recording has no robot or no people, signals are all that is read.
    #[arg(long = "signal", value_name = "NAME = EXPRESSION")]
    signals: Vec<String>,
    /// Recording: which time counts: that of the messages' `header`, or that of their `recording`, for all topics or for one, such as
    /// `/people=recording`. Default: header.
    #[arg(long, value_name = "CLOCK", value_delimiter = ',')]
    clock: Vec<String>,
    /// Recording: who is analysed: an id or a name, `1,2`, `nearest:N`, `all` or `nobody` (only signals). Default: the person nearest
    /// to the robot.
    #[arg(long, value_name = "WHO", help_heading = "People")]
    person: Option<String>,
    /// Step between samples, seconds: of a recording's batches; a table is resampled to it (--resample).
    #[arg(long, value_name = "SECONDS", help_heading = "Data")]
    pub(crate) dt: Option<f64>,
    /// Recording: length of a batch, seconds; 0: until the end. Several batches are recordings of one system. Default: as
    /// recorded, otherwise 0 (replay: 150).
    #[arg(long, value_name = "SECONDS")]
    ts_length: Option<f64>,
    /// Recording: a parameter of the node robot, human or data (docs/parameters.md), such as `data.safe_dist=4`;
    /// may be given several times.
    #[arg(long = "param", value_name = "NODE.NAME=VALUE")]
    pub(crate) params: Vec<String>,
    /// Use no settings from files: neither those that came with the data (in a recording, `FILE.roscausal.toml`, `roscausal.toml`
    /// and a batch's .json beside it) nor your own.
    #[arg(long)]
    pub(crate) ignore_settings: bool,
}

impl InputArgs {
    /// The same flags, with a parameter more.
    pub(crate) fn with_param(&self, param: Option<String>) -> Self {
        let mut with = self.clone();
        with.params.extend(param);
        with
    }

    /// The first of these flags that was given, for tables of trajectories.
    pub(crate) fn given_besides_params(&self) -> Option<String> {
        Self { params: Vec::new(), ..self.clone() }.given()
    }

    /// The first of [`FLAGS`] that was given, for input that is not a recording.
    pub(crate) fn given(&self) -> Option<String> {
        let given = [
            self.robot.is_some(),
            self.robot_odom.is_some(),
            self.robot_pose.is_some(),
            self.robot_goal.is_some(),
            !self.people.is_empty(),
            self.human_goal.is_some(),
            !self.signals.is_empty(),
            !self.clock.is_empty(),
            self.person.is_some(),
            self.ts_length.is_some(),
            !self.params.is_empty(),
        ];
        FLAGS.split(' ').zip(given).find(|(_, given)| *given).map(|(flag, _)| format!("--{flag}"))
    }
}

/// What is played, to which nodes, with which parameters.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    /// Names of the topics played.
    pub(crate) topics: Vec<String>,
    /// The nodes that take part.
    pub(crate) nodes: &'static [&'static str],
    /// Node, parameter, value.
    pub(crate) params: Vec<(String, String, Value)>,
    /// The odometry whose pose is published as well, on [`ODOMETRY_POSE`].
    pub(crate) pose_of: Option<String>,
    /// Topics that are read as bytes: those of signals, and people of any type.
    pub(crate) raw_topics: Vec<String>,
    /// The types that were chosen of topics: a name may have been recorded with several.
    kinds: BTreeMap<String, String>,
    /// Topics of goals.
    goals: Vec<String>,
    /// Whose states are played, as if its nodes were in no namespace.
    states_of: Space,
    /// Whose stamps are replaced by the time of recording.
    pub(crate) clock: ClockChoice,
    /// Mistaken stamps.
    pub(crate) clocks: Clocks,
    /// Topic of the transforms.
    tf: String,
    /// When it begins.
    pub(crate) start: Time,
    /// One line for each role: what was chosen.
    pub(crate) chosen: Vec<String>,
}

impl Inputs {
    /// Chooses topics by `args`, and otherwise by type and name.
    pub(crate) fn choose(recording: &Recording, path: &Path, args: &InputArgs) -> Result<Self> {
        let mut inputs = Self {
            nodes: &RECORDING,
            clock: ClockChoice::parse(&args.clock)?,
            tf: "/tf".to_owned(),
            start: recording.span().map_or(Time::ZERO, |(start, _)| start),
            ..Self::default()
        };
        let mut chooser = Chooser::of(recording, path)?;
        if let Some(name) = &args.robot {
            chooser.robot = chooser.named_robot(name)?;
        }
        inputs.take_signals(&chooser, args)?;
        if inputs.has_only_signals(&chooser, args) {
            inputs.nodes = &["data"];
            inputs.set("data", "sel_agent", NOBODY);
            inputs.chosen.push("only signals are read, no robot and no people".into());
        } else if args.robot_odom.is_none() && args.people.is_empty() && chooser.has_only_states() {
            inputs.nodes = &["data"];
            inputs.states_of = chooser.robot.clone();
            inputs.topics = STATES.map(|(name, _)| chooser.robot.full(name)).to_vec();
            inputs.chosen.push(format!("states: {}", inputs.topics.join(" and ")));
        } else {
            inputs.take_robot(&mut chooser, args)?;
            inputs.take_people(&chooser, args)?;
        }
        inputs.take_interventions(&chooser, args);
        if !args.ignore_settings {
            inputs.set_carried(path)?;
        }
        inputs.set_params(args)?;
        if let Some(topic) = inputs.clock.unknown(recording.topics()) {
            return Err(Error::param("clock", format!("there is no topic {topic} in {}", path.display())));
        }
        inputs.clocks = Clocks::measure(path, |topic| inputs.is_timed(topic), &inputs.clock)?;
        inputs.start = inputs.clocks.start.unwrap_or(inputs.start);
        Ok(inputs)
    }

    /// Checks the signals against the recording's definitions.
    fn take_signals(&mut self, chooser: &Chooser<'_>, args: &InputArgs) -> Result<()> {
        if args.signals.is_empty() {
            return Ok(());
        }
        let max_age = args.params.iter().rev().find_map(|text| text.strip_prefix("data.signal_max_age="));
        let max_age = max_age.and_then(|text| text.parse().ok()).unwrap_or(SIGNAL_MAX_AGE_S);
        let msg_path = args.params.iter().rev().find_map(|text| text.strip_prefix("data.msg_path="));
        let texts = args.signals.iter().map(|text| {
            persons::named(text, args.person.as_deref(), chooser)
                .map(|text| chooser.with_playable_names(&text))
        });
        let texts: Vec<String> = texts.collect::<Result<_>>()?;
        let parsed = Signal::parse_all(&texts, max_age, "signal")?;
        let signals = Signals::new(parsed, Definitions::of(msg_path.unwrap_or_default()));
        for name in signals.topics() {
            // Of several types under one name, the first that has the fields.
            let (mut fits, mut fault) = (None, None);
            for topic in chooser.any_topics(&name)? {
                let kind = topic.raw_type().ok_or_else(|| Error::Topic {
                    topic: name.clone(),
                    reason: "its messages are in an encoding that is not ROS's".into(),
                });
                let checked = kind.and_then(|kind| {
                    signals.check(&name, &kind).map_err(|reason| Error::param("signal", reason))
                });
                match checked {
                    Ok(()) => fits = fits.or(Some(topic)),
                    Err(error) => fault = fault.or(Some(error)),
                }
            }
            match (fits, fault) {
                (Some(topic), _) => {
                    self.chosen.push(format!("signals of {name} ({})", topic.type_name));
                    self.take_bytes(&topic);
                }
                (None, fault) => return fault.map_or(Ok(()), Err),
            }
        }
        let texts = texts.into_iter().map(Value::Str).collect();
        self.params.push(("data".into(), "signals".into(), Value::List(texts)));
        Ok(())
    }

    /// Whether signals are all that is to be read: as asked for, or because there is nothing else.
    fn has_only_signals(&self, chooser: &Chooser<'_>, args: &InputArgs) -> bool {
        let named = args.robot.is_some()
            || args.robot_odom.is_some()
            || args.robot_pose.is_some()
            || !args.people.is_empty();
        let nobody = args.person.as_deref() == Some(NOBODY);
        let has_people = chooser.people_candidates().into_iter().any(|topic| !is_nobody(topic))
            || !chooser.ros4hri().is_empty();
        let has_states = chooser.has_only_states();
        nobody
            || (!self.raw_topics.is_empty() && !named && !has_people && !has_states && args.person.is_none())
    }

    fn take_robot(&mut self, chooser: &mut Chooser<'_>, args: &InputArgs) -> Result<()> {
        let odometry = chooser.one(&ROBOT_ODOM, args.robot_odom.as_deref())?;
        if let (Space::Any, Some(odometry)) = (&chooser.robot, &odometry)
            && let Some(path) = robots::path_of(&odometry.name)
        {
            chooser.robot = Space::Found(path);
        }
        let chooser = &*chooser;
        let pose = match args.robot_pose.as_deref() {
            Some(FROM_ODOMETRY) => None,
            named => chooser.optional(&ROBOT_POSE, named)?,
        };
        let of_robot = odometry.as_ref().or(pose.as_ref());
        self.take_tf(&of_robot.map_or("/tf".into(), |topic| chooser.tf_of(&topic.name)));
        match (odometry, pose) {
            (Some(odometry), Some(pose)) if odometry.type_name == VELOCITY => {
                self.take(&ROBOT_ODOM, &odometry);
                self.take(&ROBOT_POSE, &pose);
                self.take_target(chooser, args, &pose.name)?;
            }
            (Some(odometry), None) if odometry.type_name == VELOCITY => {
                self.take(&ROBOT_ODOM, &odometry);
                let (base, map) = self.frames(chooser)?;
                self.chosen.push(format!("robot pose: the place of {base} in {map} by TF"));
            }
            (Some(odometry), pose) => {
                self.take(&ROBOT_ODOM, &odometry);
                let known = pose.as_ref().map(|pose| pose.name.clone());
                self.take_pose(chooser, args, &odometry, pose)?;
                let place = known.filter(|_| self.pose_of.is_none()).unwrap_or(odometry.name);
                self.take_target(chooser, args, &place)?;
            }
            (None, Some(pose)) => {
                self.set("robot", "odom_topic", "");
                self.chosen.push("robot odometry: none, the speed follows from the poses".into());
                self.take(&ROBOT_POSE, &pose);
                self.take_target(chooser, args, &pose.name)?;
            }
            // The robot's place in TF, where nothing else tells it.
            (None, None) => {
                let (base, map) = self.frames(chooser)?;
                self.set("robot", "odom_topic", "");
                self.chosen.push(format!(
                    "robot: the place of {base} in {map} by TF; its speed follows from it (no odometry and no pose in the recording)"
                ));
            }
        }
        self.take_goal(chooser, &ROBOT_GOAL, args.robot_goal.as_deref())
    }

    /// The robot's pose where there is odometry: the topic that was named, otherwise what knows the robot for more of the time.
    fn take_pose(
        &mut self,
        chooser: &Chooser<'_>,
        args: &InputArgs,
        odometry: &Topic,
        pose: Option<Topic>,
    ) -> Result<()> {
        let by_tf = format!("the pose in {}, brought to the map by TF", odometry.name);
        let mut why = String::new();
        if let Some(pose) = pose {
            if args.robot_pose.is_some() {
                self.take(&ROBOT_POSE, &pose);
                return Ok(());
            }
            let known =
                coverage::measure(chooser.path, &pose.name, &odometry.name, &target_frame(args), &self.tf)?;
            let [by_pose, by_odometry] = known.map(|share| format!("{:.0} % of the time", 100.0 * share));
            if known[1] <= known[0] + CLEARLY_MORE {
                self.take(&ROBOT_POSE, &pose);
                if let Some(line) = self.chosen.last_mut() {
                    *line += &format!("; it knows the robot in {by_pose}; {by_tf}: in {by_odometry}");
                }
                return Ok(());
            }
            let Topic { name, type_name, .. } = pose;
            why = format!(": it knows the robot in {by_odometry}, {name} ({type_name}) in {by_pose}");
        }
        self.set("robot", "pose_topic", ODOMETRY_POSE);
        self.set("robot", "pose_type", "PoseStamped");
        self.chosen.push(format!("robot pose: {by_tf}{why}"));
        self.pose_of = Some(odometry.name.clone());
        Ok(())
    }

    /// The frame of all states where nothing knows a map: that of the robot's places.
    fn take_target(&mut self, chooser: &Chooser<'_>, args: &InputArgs, place: &str) -> Result<()> {
        let mut set = args.params.iter().filter_map(|text| text.split_once('='));
        let is_named = set.any(|(name, _)| name.ends_with(".target_frame"));
        let frame = coverage::frame_of(chooser.path, place)?.unwrap_or_default();
        let frame = frame.trim_start_matches('/');
        let map = target_frame(args);
        if is_named || frame.is_empty() || frame == map || coverage::has_frame(chooser.path, &self.tf, &map)?
        {
            return Ok(());
        }
        ["robot", "human"].iter().for_each(|node| self.set(node, "target_frame", frame));
        self.chosen
            .push(format!("all places in the frame {frame} of {place}: no transform leads to a frame {map}"));
        Ok(())
    }

    /// Plays the transforms on this topic, and has them listened to.
    fn take_tf(&mut self, tf: &str) {
        self.topics.extend([tf.to_owned(), format!("{tf}_static")]);
        if tf != "/tf" {
            self.set("robot", "tf_topic", tf);
            self.set("human", "tf_topic", tf);
            self.chosen.push(format!("transforms: {tf} and {tf}_static"));
        }
        tf.clone_into(&mut self.tf);
    }

    /// Takes the robot's frame as its pose. Returns its name and that of the map.
    fn frames(&mut self, chooser: &Chooser<'_>) -> Result<(String, String)> {
        let frames = coverage::frames(chooser.path, &self.tf)?;
        // A fleet's frames bear the robots' names.
        let known = |names: &[&str]| {
            let spellings = |name: &&str| [chooser.robot.frame(name), Some((*name).to_owned())];
            names.iter().flat_map(spellings).flatten().find(|name| frames.contains(name))
        };
        let (base, map) = known(&BASES).zip(known(&["map", "odom"])).ok_or_else(|| {
            let robots = robots::framed(&frames, &BASES);
            if robots.is_empty() { chooser.nothing(&ROBOT_ODOM) } else { chooser.several_frames(&robots) }
        })?;
        self.set("robot", "pose_topic", "");
        self.set("robot", "source_frame", &base);
        self.set("robot", "target_frame", &map);
        self.set("human", "target_frame", &map);
        Ok((base, map))
    }

    fn take_people(&mut self, chooser: &Chooser<'_>, args: &InputArgs) -> Result<()> {
        for name in ["auto_people_topic", "teleop_people_topic", "people_topic"] {
            self.set("human", name, "");
        }
        let frames = |name: &String| match name.as_str() {
            "ros4hri" => Some(String::new()),
            name => name.strip_prefix("tf:").map(str::to_owned),
        };
        if let [only] = args.people.as_slice()
            && let Some(pattern) = frames(only)
        {
            self.take_people_frames(chooser, &pattern, args)?;
        } else {
            let mut named = Tracker::all(&args.people.join(","))
                .map_err(|reason| Error::Data(format!("--people: {reason}")))?;
            if let Some(place) = named.iter().position(|tracker| tracker.topic == OTHER_ROBOTS) {
                let others = chooser.other_robots(&self.topics, self.tf == "/tf")?;
                named.splice(place..=place, others.iter().map(|topic| topic.as_str().into()));
            }
            let topics = chooser.people(&named, &self.tf)?;
            if topics.is_empty() {
                self.take_people_frames(chooser, "", args)?;
            } else {
                named.resize_with(topics.len(), Tracker::default);
                for (tracker, topic) in named.iter_mut().zip(&topics) {
                    tracker.topic.clone_from(&topic.name);
                }
                self.take_people_topics(&topics, &named, args)?;
                check_names(chooser, args, &persons::Source::Topics(&named))?;
            }
        }
        self.take_goal(chooser, &HUMAN_GOAL, args.human_goal.as_deref())
    }

    /// People who are TF frames.
    /// Without a pattern: those on the lists of ROS4HRI; without a list, all of the same names.
    fn take_people_frames(&mut self, chooser: &Chooser<'_>, pattern: &str, args: &InputArgs) -> Result<()> {
        let lists: Vec<String> = chooser.ros4hri().into_iter().map(|topic| topic.name.clone()).collect();
        let unlisted = match pattern.is_empty() && lists.is_empty() {
            true => format!("{}*", chooser.people_frames(&self.tf)?.unwrap_or(ROS4HRI_FRAMES[0])),
            false => String::new(),
        };
        self.chosen.push(match (pattern, lists.is_empty()) {
            ("", true) => format!("people: all TF frames {unlisted}, since no topic says who is tracked"),
            ("", false) => format!("people: TF frames of those on {} (ROS4HRI)", lists.join(" and ")),
            (pattern, _) => format!("people: TF frames {pattern}"),
        });
        let pattern = if unlisted.is_empty() { pattern } else { &unlisted };
        self.set("human", "people_type", "ros4hri");
        self.set("human", "people_frames", pattern);
        self.topics.extend(lists);
        let forms = match pattern {
            "" => ROS4HRI_FRAMES.map(|start| (start.to_owned(), String::new())).to_vec(),
            pattern => {
                let (start, end) = pattern.split_once('*').unwrap_or((pattern, ""));
                vec![(start.trim_start_matches('/').to_owned(), end.to_owned())]
            }
        };
        check_names(chooser, args, &persons::Source::Frames(&self.tf, forms))
    }

    /// People on topics: each under its own parameter where the nodes have one, otherwise read by their definitions.
    fn take_people_topics(&mut self, topics: &[Topic], trackers: &[Tracker], args: &InputArgs) -> Result<()> {
        let mut params: Vec<_> =
            topics.iter().filter_map(Chooser::people_kind).map(|kind| kind.topic_param).collect();
        params.sort_unstable();
        params.dedup();
        if params.len() == topics.len() && !trackers.iter().any(Tracker::is_described) {
            topics.iter().for_each(|topic| self.take(&PEOPLE, topic));
            return Ok(());
        }
        let msg_path = args.params.iter().rev().find_map(|text| text.strip_prefix("human.msg_path="));
        let definitions = Arc::new(Definitions::of(msg_path.unwrap_or_default()));
        for (topic, tracker) in topics.iter().zip(trackers) {
            let fail = |reason: String| Error::Topic { topic: topic.name.clone(), reason };
            let kind = topic
                .raw_type()
                .ok_or_else(|| fail("its messages are in an encoding that is not ROS's".into()))?;
            Reader::new(tracker.clone(), &[], definitions.clone()).check(&kind).map_err(fail)?;
            let Tracker { topic: name, rest, .. } = tracker;
            self.chosen.push(format!("{}: {name}{rest} ({})", PEOPLE.what, topic.type_name));
            self.take_bytes(topic);
        }
        let spelled = |(topic, tracker): (&Topic, &Tracker)| topic.playable() + &tracker.rest;
        let names: Vec<String> = topics.iter().zip(trackers).map(spelled).collect();
        self.set("human", "people_type", "auto");
        self.set("human", "people_topic", &names.join(","));
        Ok(())
    }

    /// What was imposed during the recording, if a topic tells it: by its name alone, since many topics hold texts.
    fn take_interventions(&mut self, chooser: &Chooser<'_>, args: &InputArgs) {
        let named = args.params.iter().find_map(|text| text.strip_prefix("data.context_topic="));
        let name = named.unwrap_or(INTERVENTIONS);
        if chooser.recording.topics().iter().any(|topic| topic.name == name) {
            self.chosen.push(format!("interventions: {name}"));
            self.topics.push(name.to_owned());
        }
    }

    fn take(&mut self, role: &Role, topic: &Topic) {
        self.chosen.push(format!("{}: {} ({})", role.what, topic.name, topic.type_name));
        self.topics.push(topic.name.clone());
        self.kinds.insert(topic.name.clone(), topic.type_name.clone());
        if [ROBOT_GOAL.flag, HUMAN_GOAL.flag].contains(&role.flag) {
            self.goals.push(topic.name.clone());
        }
        let Some(kind) = role.kind(&topic.type_name) else { return };
        self.set(role.node, kind.topic_param, &topic.playable());
        kind.also.iter().for_each(|(name, value)| self.set(role.node, name, value));
    }

    /// Reads a topic as bytes.
    fn take_bytes(&mut self, topic: &Topic) {
        self.raw_topics.push(topic.name.clone());
        self.kinds.entry(topic.name.clone()).or_insert_with(|| topic.type_name.clone());
    }

    /// The name under which a topic is played, if it is played under its type.
    pub(crate) fn played_as(&self, topic: &Topic) -> Option<String> {
        self.plays(topic).then(|| self.states_of.within(&topic.playable()).to_owned())
    }

    /// Whether a topic is played under its type.
    pub(crate) fn plays(&self, topic: &Topic) -> bool {
        self.topics.contains(&topic.name) && self.is_of_chosen_type(topic) && topic.known_type().is_some()
    }

    /// Whether a topic is played as bytes. What is published under its type reaches those who listen to bytes from there.
    pub(crate) fn plays_bytes(&self, topic: &Topic) -> bool {
        self.raw_topics.contains(&topic.name) && self.is_of_chosen_type(topic) && !self.plays(topic)
    }

    /// Whether the stamps of a topic are those of rows. A goal may be older than its message.
    fn is_timed(&self, topic: &Topic) -> bool {
        (self.plays(topic) || self.plays_bytes(topic)) && !self.goals.contains(&topic.name)
    }

    fn is_of_chosen_type(&self, topic: &Topic) -> bool {
        self.kinds.get(&topic.name).is_none_or(|kind| *kind == topic.type_name)
    }

    fn take_goal(&mut self, chooser: &Chooser<'_>, role: &Role, named: Option<&str>) -> Result<()> {
        if let Some(goal) = chooser.optional(role, named)? {
            self.take(role, &goal);
        } else {
            self.set(role.node, "goal_topic", "");
            self.chosen.push(format!("{}: none ({} names one)", role.what, role.flag));
        }
        Ok(())
    }

    fn set(&mut self, node: &str, name: &str, value: &str) {
        self.params.push((node.to_owned(), name.to_owned(), Value::Str(value.to_owned())));
    }

    /// Sets the parameters that the recording was made with, as far as data may decide them.
    fn set_carried(&mut self, path: &Path) -> Result<()> {
        let mut reported = Vec::new();
        let carried = carried(path)?;
        for (name, value) in carried.used {
            // Signals are asked for by --signal.
            let of_nodes = |node: &str| RECORDING.contains(&node);
            if name == "data.signals" || !name.split_once('.').is_some_and(|(node, _)| of_nodes(node)) {
                continue;
            }
            let (node, param, value) = parse(&format!("{name}={value}")).map_err(|error| {
                let reason = format!("a setting that it carries: {error}; --ignore-settings leaves them out");
                Error::file(path, reason)
            })?;
            self.set(&node, &param, &value);
            reported.push(format!("{name}={value}"));
        }
        if !reported.is_empty() {
            self.chosen
                .push(format!("recorded with {}; used unless flags say otherwise", reported.join(" ")));
        }
        if let Some(sentence) = travel::sentence(path, &carried.left_out) {
            tell!("{sentence}");
        }
        Ok(())
    }

    /// What this parameter was set to, by the recording or the user: the last counts.
    fn value(&self, node: &str, name: &str) -> Option<&Value> {
        self.params.iter().rev().find(|(of, param, _)| of == node && param == name).map(|(.., value)| value)
    }

    /// Whether this parameter was set, by the recording or the user.
    pub(crate) fn sets(&self, node: &str, name: &str) -> bool {
        self.value(node, name).is_some()
    }

    /// Whether the recording is cut into batches of a length.
    pub(crate) fn is_cut(&self) -> bool {
        self.value("data", "ts_length").and_then(Value::as_double).is_some_and(|length| length > 0.0)
    }

    /// Whether batches are not post-processed.
    pub(crate) fn is_raw(&self) -> bool {
        self.value("data", "postprocess") == Some(&Value::Str("none".into()))
    }

    fn set_params(&mut self, args: &InputArgs) -> Result<()> {
        if self.nodes == ["data"]
            && self.sets("data", "sel_agent")
            && args.person.as_deref().is_none_or(|who| who == NOBODY)
        {
            // Only signals.
        } else if let Some(person) = &args.person {
            let persons::Chosen { select, names } = persons::chosen(person);
            if !names.is_empty() {
                self.set("human", "people_names", &names.join(","));
            }
            self.set("human", "sel_agent", &select);
            self.set("data", "sel_agent", &select);
        } else if !self.sets("data", "sel_agent")
            && !args.params.iter().any(|text| text.starts_with("data.sel_agent="))
        {
            self.set("data", "sel_agent", "nearest:1");
            self.chosen.push("person: the nearest to the robot (--person names one)".into());
        }
        for (name, value) in [("dt", args.dt), ("ts_length", args.ts_length)] {
            self.params.extend(value.map(|value| ("data".into(), name.into(), Value::Double(value))));
        }
        for text in &args.params {
            let (node, name, value) = parse(text)?;
            self.set(&node, &name, &value);
        }
        Ok(())
    }
}

/// Checks that those whom `--person` names are there.
fn check_names(chooser: &Chooser<'_>, args: &InputArgs, source: &persons::Source<'_>) -> Result<()> {
    let names = args.person.as_deref().map_or_else(Vec::new, |who| persons::chosen(who).names);
    if names.is_empty() { Ok(()) } else { persons::check(chooser, &names, source) }
}

/// The frame of the states, as the user says.
fn target_frame(args: &InputArgs) -> String {
    let named = args.params.iter().find_map(|text| text.strip_prefix("robot.target_frame="));
    named.unwrap_or("map").to_owned()
}

/// `NODE.NAME=VALUE`, checked against the node's own table.
pub(crate) fn parse(text: &str) -> Result<(String, String, String)> {
    let fault = |reason: String| Error::param("param", reason);
    let split = text.split_once('=').and_then(|(name, value)| Some((name.split_once('.')?, value)));
    let Some(((node, name), value)) = split else {
        return Err(fault(format!("'{text}' is not NODE.NAME=VALUE, such as data.safe_dist=4")));
    };
    let specs = nodes::parameters(node)?;
    let names: Vec<&str> = specs.iter().map(|spec| spec.name).collect();
    let Some(spec) = specs.iter().find(|spec| spec.name == name) else {
        let names = instead(&names, name, "it has:");
        return Err(fault(format!("node {node} has no parameter '{name}'; {names}")));
    };
    if let Some(flag) = flags::of_setting(node, name) {
        return Err(fault(format!("{node}.{name} is not a parameter of a recording; --{flag} sets it")));
    }
    spec.checked(Value::Str(value.to_owned()))?;
    Ok((node.to_owned(), name.to_owned(), value.to_owned()))
}
