//! Reads people from a topic's messages by the row of their type.

use std::{collections::BTreeSet, sync::Arc};

use roscausal_msgs::{
    Fault, Time,
    dynamic::{Found, Path, Query, Rows, Schema, Wire},
    geometry_msgs::{Point, Pose, Quaternion},
    std_msgs::Header,
};

use super::{
    layouts::{self, Keep, Layout},
    tracker::{Entries, Entry, Tracker},
};
use crate::{
    batch::expression::Expression,
    ensure,
    middleware::{Raw, RawType},
    signal::Definitions,
    state::{
        human::{Sighting, id_of_number, walking},
        identity::Who,
    },
};

/// Longest name of a class that is told.
const LONGEST_CLASS: usize = 40;
/// Most classes that are remembered to be told.
const MOST_CLASSES: usize = 8;

/// The people in a message.
#[derive(Debug, Default)]
pub struct Seen {
    /// The stamp of its header; 0 if it has none.
    pub stamp: Time,
    /// The people, and what the tracker tells of who they are.
    pub people: Vec<(Who, Sighting)>,
}

/// Reads the messages of one topic.
#[derive(Debug, Default)]
pub struct Reader {
    tracker: Tracker,
    /// Words for people, in lower case.
    classes: Vec<String>,
    definitions: Arc<Definitions>,
    kind: Option<Arc<RawType>>,
    bound: Option<Bound>,
    trouble: Option<String>,
    unreadable: u64,
    taken: u64,
    others: BTreeSet<String>,
}

/// A row of the table, bound to a definition.
#[derive(Debug)]
struct Bound {
    schema: Schema,
    wire: Wire,
    /// Whether a message is one person.
    is_one: bool,
    keep: Keep,
    /// What is computed of a row: it stands behind the columns that are read.
    computed: Vec<Expression>,
    frame: Option<Query>,
    rows: Rows,
    columns: Columns,
}

/// The places of the columns in a row.
#[derive(Debug, Default)]
struct Columns {
    id: Option<usize>,
    /// x, y, z.
    place: [Option<usize>; 3],
    /// x, y, z, w.
    orientation: Option<[usize; 4]>,
    yaw: Option<usize>,
    /// x, y.
    velocity: Option<[usize; 2]>,
    goal: Option<[usize; 2]>,
    frame: Option<usize>,
    stamp: Option<usize>,
    class: Option<usize>,
    action: Option<usize>,
    only: Option<usize>,
}

impl Reader {
    /// A reader of a tracker's messages, whatever their type turns out to be. `classes` are the words for people, such as
    /// `person`, where a tracker also sees other things.
    pub fn new(tracker: impl Into<Tracker>, classes: &[String], definitions: Arc<Definitions>) -> Self {
        Self {
            tracker: tracker.into(),
            classes: classes.iter().map(|word| word.trim().to_lowercase()).collect(),
            definitions,
            ..Self::default()
        }
    }

    /// Checks that people can be read from messages of this type.
    ///
    /// # Errors
    /// A type that is not in the table, or whose definition has no people.
    pub fn check(&self, kind: &RawType) -> Result<(), String> {
        Bound::new(kind, &self.definitions, self.tracker.entries.as_ref()).map(|_| ())
    }

    /// The people in a message.
    pub fn read(&mut self, message: &Raw) -> Seen {
        if self.kind.as_ref() != Some(&message.kind) {
            let bound = Bound::new(&message.kind, &self.definitions, self.tracker.entries.as_ref());
            if let Err(reason) = &bound {
                tracing::error!("people on {}: {reason}", self.tracker.topic);
                self.trouble = Some(format!("people on {}: {reason}", self.tracker.topic));
            }
            self.kind = Some(message.kind.clone());
            self.bound = bound.ok();
        }
        let Some(bound) = &self.bound else { return Seen::default() };
        match bound.read(&message.bytes) {
            Ok((header, rows)) => self.people(header, &rows),
            Err(fault) => {
                self.unreadable += 1;
                if self.unreadable.is_power_of_two() {
                    let (topic, count) = (&self.tracker.topic, self.unreadable);
                    tracing::warn!("{topic}: message {count} that cannot be read: {fault}");
                }
                Seen::default()
            }
        }
    }

    fn people(&mut self, header: Header, rows: &[Vec<Found>]) -> Seen {
        let mut seen = Seen { stamp: header.stamp, people: Vec::new() };
        let mut numbers = BTreeSet::new();
        let Some(bound) = &self.bound else { return seen };
        let columns = &bound.columns;
        for row in rows {
            if columns.action.is_some_and(|action| number(row, action) != 0.0)
                || columns.only.is_some_and(|only| number(row, only) == 0.0)
            {
                continue;
            }
            if let Err(class) = columns.is_person(row, bound.keep, &self.classes) {
                if self.others.len() < MOST_CLASSES {
                    self.others.insert(class.chars().take(LONGEST_CLASS).collect());
                }
                continue;
            }
            let mut sighting = columns.sighting(row, &header);
            if seen.stamp == Time::ZERO {
                seen.stamp = sighting.header.stamp;
            }
            let who = if bound.is_one && columns.id.is_none() {
                Who::Name(name_of_topic(&self.tracker.topic).to_owned())
            } else {
                columns.who(row)
            };
            if let Who::Number(number) = who {
                sighting.id = number;
                // Several markers may show one person.
                if !numbers.insert(number) {
                    continue;
                }
            }
            seen.people.push((who, sighting));
        }
        self.taken += seen.people.len() as u64;
        seen
    }

    /// What keeps people from being read, if anything does.
    pub fn trouble(&self) -> Option<String> {
        let only_others = || {
            let seen: Vec<&str> = self.others.iter().map(String::as_str).collect();
            let (topic, classes, seen) = (&self.tracker.topic, self.classes.join(", "), seen.join(", "));
            format!("{topic} has had nobody of the classes {classes} (people_classes), only: {seen}")
        };
        let nobody = self.taken == 0 && !self.others.is_empty();
        self.trouble.clone().or_else(|| nobody.then(only_others))
    }

    /// Messages that could not be read.
    pub fn unreadable(&self) -> u64 {
        self.unreadable
    }
}

/// Who a topic with one person is about: the part of its name that has a number, otherwise the one before the last.
/// `/person_1/pose` is `person_1`, `/humans/anna/pose` is `anna`.
fn name_of_topic(topic: &str) -> &str {
    let parts: Vec<&str> = topic.split('/').filter(|part| !part.is_empty()).collect();
    let numbered = parts.iter().find(|part| part.contains(|c: char| c.is_ascii_digit()));
    let before_last = parts.len().checked_sub(2).and_then(|place| parts.get(place));
    numbered.or(before_last).or(parts.first()).copied().unwrap_or(topic)
}

impl Bound {
    fn new(kind: &RawType, definitions: &Definitions, entries: Option<&Entries>) -> Result<Self, String> {
        if let Some(entries) = entries {
            return Self::described(kind, definitions.schema(kind)?, entries);
        }
        let layout = layouts::row(&kind.type_name).ok_or_else(|| {
            let types: Vec<&str> = layouts::types().collect();
            let (name, types) = (&kind.type_name, types.join(", "));
            format!("{name} is not a type that people are read from; those are {types}")
        })?;
        let schema = definitions.schema(kind)?;
        let array = match layout.people {
            [] => None,
            paths => {
                let found = paths.iter().map(|path| path_of(path)).find(|path| schema.count(path).is_ok());
                Some(found.ok_or_else(|| format!("{} has no list '{}'", kind.type_name, paths[0]))?)
            }
        };
        let mut binder = Binder { schema: &schema, array: array.as_ref(), paths: Vec::new() };
        let columns = binder.columns(layout);
        ensure(!columns.place[..2].contains(&None), || {
            format!("{} has no place '{}'", kind.type_name, layout.place.join("' or '"))
        })?;
        let rows = schema.rows(array.as_ref(), &binder.paths).map_err(|error| error.to_string())?;
        let (wire, frame) = (kind.wire, frame_of(&schema));
        let (is_one, keep, computed) = (layout.people.is_empty(), layout.keep, Vec::new());
        Ok(Self { schema, wire, is_one, keep, computed, frame, rows, columns })
    }

    /// The same where a user says what is where.
    fn described(kind: &RawType, schema: Schema, entries: &Entries) -> Result<Self, String> {
        let mut names: Vec<String> = entries.fields.iter().map(|(_, field)| field.clone()).collect();
        for (_, text) in &entries.numbers {
            names.extend(Expression::names_in(text)?);
        }
        let paths = names.iter().map(|name| name.parse()).collect::<Result<Vec<Path>, _>>()?;
        let rows = schema.rows(entries.list.as_ref(), &paths).map_err(|error| error.to_string())?;
        let field = |role: &str| entries.fields.iter().position(|(known, _)| *known == role);
        let place = |role: &str| entries.numbers.iter().position(|(known, _)| *known == role);
        let computed = |role: &str| place(role).map(|place| names.len() + place);
        let pair = |x, y| computed(x).zip(computed(y)).map(|(x, y)| [x, y]);
        let columns = Columns {
            id: field("id"),
            frame: field("frame"),
            stamp: field("stamp"),
            place: [computed("x"), computed("y"), computed("z")],
            yaw: computed("yaw"),
            velocity: pair("vx", "vy"),
            goal: pair("gx", "gy"),
            only: computed("only"),
            ..Columns::default()
        };
        let texts = entries.numbers.iter().map(|(_, text)| Expression::of_columns(text, &names));
        let computed = texts.collect::<Result<Vec<_>, _>>()?;
        let (wire, frame) = (kind.wire, frame_of(&schema));
        let (is_one, keep) = (entries.list.is_none(), Keep::All);
        Ok(Self { schema, wire, is_one, keep, computed, frame, rows, columns })
    }

    /// The message's header, and its rows.
    fn read(&self, bytes: &[u8]) -> Result<(Header, Vec<Vec<Found>>), Fault> {
        let stamp = self.schema.stamp(self.wire, bytes)?.unwrap_or(Time::ZERO);
        let frame = match &self.frame {
            Some(query) => query.read(&self.schema, self.wire, bytes)?,
            None => Found::Numbers(Vec::new()),
        };
        let frame_id = if let Found::Text(frame) = frame { frame } else { String::new() };
        let mut rows = self.rows.read(&self.schema, self.wire, bytes)?;
        for row in &mut rows {
            let cell = |column: usize| number(row, column);
            let of_row: Vec<f64> = self.computed.iter().map(|of| of.value(&Entry(&cell))).collect();
            row.extend(of_row.into_iter().map(|value| Found::Numbers(vec![value])));
        }
        Ok((Header { stamp, frame_id }, rows))
    }
}

/// The frame of a message's header, if it has one.
fn frame_of(schema: &Schema) -> Option<Query> {
    schema.query(&path_of("header.frame_id")).ok()
}

/// Collects the columns that a definition has.
struct Binder<'a> {
    schema: &'a Schema,
    array: Option<&'a Path>,
    paths: Vec<Path>,
}

fn path_of(text: &str) -> Path {
    // The texts are those of the table, which a test parses.
    text.parse().unwrap_or_default()
}

/// A path with another one, or an index, behind it.
fn behind(base: &str, rest: &str) -> String {
    if base.is_empty() || rest.is_empty() || rest.starts_with('[') {
        format!("{base}{rest}")
    } else {
        format!("{base}.{rest}")
    }
}

impl Binder<'_> {
    fn column(&mut self, text: &str) -> Option<usize> {
        let path = path_of(text);
        self.schema.rows(self.array, std::slice::from_ref(&path)).ok()?;
        self.paths.push(path);
        Some(self.paths.len() - 1)
    }

    /// The first form that there is, of the first base that has one.
    fn first<const N: usize>(&mut self, bases: &[&str], forms: &[[&str; N]]) -> Option<([usize; N], String)> {
        for base in bases {
            for form in forms {
                let columns: Option<Vec<usize>> =
                    form.iter().map(|part| self.column(&behind(base, part))).collect();
                if let Some(columns) = columns.and_then(|columns| columns.try_into().ok()) {
                    return Some((columns, (*base).to_owned()));
                }
            }
        }
        None
    }

    fn columns(&mut self, layout: &Layout) -> Columns {
        const FLAT: [[&str; 2]; 3] = [["position.x", "position.y"], ["x", "y"], ["[0]", "[1]"]];
        let mut columns = Columns::default();
        if let Some(([x, y], base)) = self.first(layout.place, &FLAT) {
            let z = self.first(&[&base], &[["position.z"], ["z"], ["[2]"]]);
            columns.place = [Some(x), Some(y), z.map(|([z], _)| z)];
            let parts = ["orientation.x", "orientation.y", "orientation.z", "orientation.w"];
            columns.orientation = self.first(&[&base], &[parts]).map(|(parts, _)| parts);
            columns.yaw = self.first(&[&base], &[["theta"]]).map(|([yaw], _)| yaw);
        }
        let of_velocity = [["linear.x", "linear.y"], ["x", "y"], ["[0]", "[1]"]];
        columns.velocity = self.first(layout.velocity, &of_velocity).map(|found| found.0);
        columns.goal = self.first(layout.goal, &FLAT).map(|found| found.0);
        columns.frame = self.first(layout.header, &[["frame_id"]]).map(|([frame], _)| frame);
        columns.stamp = self.first(layout.header, &[["stamp"]]).map(|([stamp], _)| stamp);
        columns.id = self.first(layout.id, &[[""]]).map(|([id], _)| id);
        columns.action = self.first(layout.action, &[[""]]).map(|([action], _)| action);
        columns.class = self.first(layout.class, &[[""]]).map(|([class], _)| class);
        columns
    }
}

fn number(row: &[Found], column: usize) -> f64 {
    match row.get(column) {
        Some(Found::Numbers(numbers)) => numbers.first().copied().unwrap_or(f64::NAN),
        _ => f64::NAN,
    }
}

impl Columns {
    /// Whether a row is a person; otherwise what it is.
    fn is_person(&self, row: &[Found], keep: Keep, words: &[String]) -> Result<(), String> {
        let Some(class) = self.class.and_then(|class| row.get(class)) else { return Ok(()) };
        match (keep, class) {
            (Keep::All, _) => Ok(()),
            (Keep::Number(person), Found::Numbers(numbers)) => match numbers.first() {
                Some(number) if *number == f64::from(person) => Ok(()),
                _ => Err(format!("{numbers:?}")),
            },
            (Keep::Named, Found::Text(text)) if text.is_empty() || is_named(text, words) => Ok(()),
            (_, Found::Text(text)) => Err(text.clone()),
            (Keep::Named, Found::Numbers(numbers)) => match numbers.first() {
                // Who says nothing of what it sees sees people.
                None => Ok(()),
                Some(class) if is_named(&class.to_string(), words) => Ok(()),
                Some(class) => Err(class.to_string()),
            },
        }
    }

    /// What a tracker tells of who it is. A negative number and an empty name are its words for "not tracked".
    fn who(&self, row: &[Found]) -> Who {
        match self.id.and_then(|id| row.get(id)) {
            Some(Found::Text(text)) if !text.trim().is_empty() => Who::Name(text.trim().to_owned()),
            Some(Found::Numbers(numbers)) => match numbers.as_slice() {
                // 64-bit ids of some trackers are larger than a double tells apart; those are never that old.
                [id] if *id >= 0.0 => Who::Number(id_of_number(*id as u64)),
                bytes if bytes.len() > 1 && bytes.iter().any(|byte| *byte != 0.0) => {
                    Who::Name(bytes.iter().map(|byte| format!("{:02x}", *byte as u8)).collect())
                }
                _ => Who::Unknown,
            },
            _ => Who::Unknown,
        }
    }

    /// The sighting in a row; its place may be NaN.
    fn sighting(&self, row: &[Found], header: &Header) -> Sighting {
        let at = |column: Option<usize>| column.map_or(f64::NAN, |column| number(row, column));
        let [x, y, z] = self.place;
        let position = Point { x: at(x), y: at(y), z: if z.is_some() { at(z) } else { 0.0 } };
        let velocity = self.velocity.map(|parts| parts.map(|part| number(row, part)));
        let velocity = velocity.filter(|parts| parts.iter().all(|part| part.is_finite()));
        let twist = velocity.map(walking);
        let heading = self.yaw.map(|yaw| number(row, yaw)).filter(|yaw| yaw.is_finite());
        let heading = heading.or_else(|| velocity.map(|[x, y]| libm::atan2(y, x)));
        let orientation = match self.orientation {
            Some(parts) => {
                let [x, y, z, w] = parts.map(|part| number(row, part));
                Quaternion { x, y, z, w }
            }
            None => Quaternion::from_yaw(heading.unwrap_or(0.0)),
        };
        let goal = self.goal.map(|parts| parts.map(|part| number(row, part)));
        let goal = goal.filter(|parts| parts.iter().all(|part| part.is_finite()));
        let mut header = header.clone();
        if let Some(Found::Text(frame)) = self.frame.and_then(|frame| row.get(frame))
            && !frame.is_empty()
        {
            header.frame_id.clone_from(frame);
        }
        if header.stamp == Time::ZERO && self.stamp.is_some() {
            header.stamp = Time::from_secs_f64(at(self.stamp));
        }
        let goal = goal.map(|[x, y]| Point { x, y, z: 0.0 });
        Sighting { id: 0, header, pose: Pose { position, orientation }, twist, goal }
    }
}

/// Whether a class or namespace is one of these words, alone or as a part: `Person`, `tracked_people`, `persons_3`.
fn is_named(class: &str, words: &[String]) -> bool {
    let class = class.to_lowercase();
    let is_word = |part: &str| {
        let one = part.strip_suffix('s').unwrap_or(part);
        words.iter().any(|word| word == part || word == one)
    };
    let is_text = class.contains(|c: char| c.is_ascii_alphabetic());
    is_word(&class)
        || (is_text
            && class.split(|c: char| !c.is_ascii_alphabetic()).any(|part| !part.is_empty() && is_word(part)))
}

#[cfg(test)]
mod tests {
    use roscausal_msgs::{
        Message, ros1,
        visualization_msgs::{Marker, MarkerArray},
    };

    use super::*;

    fn reader(topic: &str) -> Reader {
        let classes = ["person", "people", "pedestrian", "human", "0"].map(str::to_owned);
        Reader::new(topic, &classes, Arc::default())
    }

    fn raw(type_name: &str, definition: &str, bytes: Vec<u8>) -> Raw {
        let kind = RawType { type_name: type_name.into(), definition: definition.into(), wire: Wire::Ros1 };
        Raw { kind: Arc::new(kind), bytes }
    }

    #[test]
    fn markers_are_people_by_their_namespace_each_once_and_not_those_that_are_taken_away() {
        let marker = |ns: &str, id: i32, x: f64, action: i32| {
            let mut marker = Marker { ns: ns.into(), id, action, ..Marker::default() };
            marker.pose.position.x = x;
            marker.header.frame_id = "laser".into();
            marker
        };
        let markers = vec![
            marker("tracked_people", 4, 1.0, 0),
            marker("walls", 5, 2.0, 0),
            marker("people_names", 4, 1.0, 0),
            marker("Person", 6, 3.0, 0),
            marker("people", 7, 0.0, 2),
        ];
        let bytes = ros1::to_bytes(&MarkerArray { markers }, 0).expect("encodes");
        let seen = reader("/markers").read(&raw(
            "visualization_msgs/MarkerArray",
            MarkerArray::ros1_definition(),
            bytes,
        ));
        let found: Vec<(u32, f64, &str)> = seen
            .people
            .iter()
            .map(|(_, person)| (person.id, person.pose.position.x, person.header.frame_id.as_str()))
            .collect();
        assert_eq!(found, [(4, 1.0, "laser"), (6, 3.0, "laser")]);
    }

    #[test]
    fn a_class_is_a_word_for_people_alone_or_as_a_part() {
        let words = ["person", "people", "0"].map(str::to_owned);
        for class in ["person", "Person", "PERSON", "persons", "tracked_people", "person_3", "0"] {
            assert!(is_named(class, &words), "{class}");
        }
        for class in ["chair", "10", "personal_computer", "", "robot_0"] {
            assert!(!is_named(class, &words), "{class}");
        }
    }

    #[test]
    fn the_topic_of_one_person_says_who_she_is() {
        for (topic, name) in [
            ("/person_1/pose", "person_1"),
            ("/humans/anna/pose", "anna"),
            ("/mocap/human3/pose", "human3"),
            ("/leader_pose", "leader_pose"),
            ("/", "/"),
        ] {
            assert_eq!(name_of_topic(topic), name);
        }
    }

    #[test]
    fn a_tracker_that_has_only_seen_things_says_which() {
        let definition = "std_msgs/Header header\nzed_msgs/Object[] objects\n===\nMSG: zed_msgs/Object\nstring label\n\
                          int16 label_id\nfloat32[3] position\n===\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id";
        let mut bytes = vec![0; 12];
        bytes.extend([3, 0, 0, 0]);
        bytes.extend(b"map");
        bytes.extend([1, 0, 0, 0, 3, 0, 0, 0]);
        bytes.extend(b"Car");
        bytes.extend([7, 0]);
        bytes.extend([0; 12]);
        let mut reader = reader("/zed/objects");
        let message = raw("zed_msgs/ObjectsStamped", definition, bytes.clone());
        assert!(reader.read(&message).people.is_empty());
        let trouble = reader.trouble().expect("it says so");
        assert!(trouble.contains("people_classes") && trouble.contains("Car"), "{trouble}");
        // Any bytes that are cut off are no message, and no panic.
        for cut in 0..bytes.len() {
            let cut = Raw { kind: message.kind.clone(), bytes: bytes[..cut].to_vec() };
            assert!(reader.read(&cut).people.is_empty());
        }
        assert_eq!(reader.unreadable(), bytes.len() as u64);
    }

    #[test]
    fn a_type_without_people_is_refused_with_those_that_have_them() {
        let mut reader = reader("/scan");
        let seen = reader.read(&raw("sensor_msgs/LaserScan", "float32[] ranges", vec![0; 4]));
        assert!(seen.people.is_empty());
        let trouble = reader.trouble().expect("it says so");
        assert!(trouble.contains("/scan") && trouble.contains("vision_msgs/Detection3DArray"), "{trouble}");
    }
}
