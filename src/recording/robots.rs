//! Several robots in one recording, told apart by their namespaces: `/tb3_0/odom`, `/tb3_1/odom`.

use std::collections::BTreeSet;

use roscausal_core::{Error, Result, params::instead};
use roscausal_recording::Topic;

/// The type of odometry.
pub(super) const ODOMETRY: &str = "nav_msgs/Odometry";
/// The type of poses from a localisation.
pub(super) const LOCALISED: &str = "geometry_msgs/PoseWithCovarianceStamped";

/// Where the topics of the robot are looked for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) enum Space {
    /// Everywhere.
    #[default]
    Any,
    /// In this namespace, as the user says.
    Chosen(String),
    /// In this namespace, because its odometry is there; where it has none of a type, everywhere.
    Found(String),
}

impl Space {
    fn path(&self) -> Option<&str> {
        match self {
            Self::Any => None,
            Self::Chosen(path) | Self::Found(path) => Some(path),
        }
    }

    /// A topic's name as seen from within the namespace: `/odom` for `/tb3_0/odom`.
    pub(super) fn within<'a>(&self, topic: &'a str) -> &'a str {
        let rest = self.path().and_then(|path| topic.strip_prefix(path));
        rest.filter(|rest| rest.starts_with('/')).unwrap_or(topic)
    }

    /// The full name of a name within the namespace.
    pub(super) fn inside(&self, name: &str) -> Option<String> {
        self.path().map(|path| format!("{path}/{}", name.trim_start_matches('/')))
    }

    /// The full name of a topic that is in the namespace, if there is one.
    pub(super) fn full(&self, topic: &str) -> String {
        self.inside(topic).unwrap_or_else(|| topic.to_owned())
    }

    /// The name of the frame of this robot, as fleets call it: `tb3_0/base_link`.
    pub(super) fn frame(&self, frame: &str) -> Option<String> {
        let name = self.path()?.rsplit('/').next()?;
        Some(format!("{name}/{frame}"))
    }

    /// Those of these topics that are the robot's.
    pub(super) fn narrowed<'a>(&self, topics: Vec<&'a Topic>) -> Vec<&'a Topic> {
        let own = || topics.iter().copied().filter(|topic| self.within(&topic.name) != topic.name).collect();
        match self {
            Self::Any => topics,
            Self::Chosen(_) => own(),
            Self::Found(_) => Some(own()).filter(|own: &Vec<&Topic>| !own.is_empty()).unwrap_or(topics),
        }
    }
}

/// A robot in a namespace.
#[derive(Debug)]
pub(super) struct Robot<'a> {
    /// What tells it from the others.
    pub(super) name: String,
    /// Its namespace.
    pub(super) path: String,
    /// Its odometry and poses.
    pub(super) topics: Vec<&'a Topic>,
}

impl Robot<'_> {
    /// Whether the user means this one.
    pub(super) fn is_called(&self, name: &str) -> bool {
        let plain = name.trim_matches('/');
        self.name == plain || self.path.trim_matches('/') == plain
    }
}

/// The robots that these topics are of. Their names are the first part in which the namespaces differ: of `/robots/a/odom` and
/// `/robots/b/odom` they are `a` and `b`.
pub(super) fn of(topics: Vec<&Topic>) -> Vec<Robot<'_>> {
    let spaces: Vec<Vec<&str>> = topics.iter().map(|topic| namespace(&topic.name)).collect();
    let named = || spaces.iter().filter(|space| !space.is_empty());
    let shortest = named().map(Vec::len).min().unwrap_or(0);
    let is_shared =
        |place: &usize| named().zip(named().skip(1)).all(|(one, next)| one[*place] == next[*place]);
    let shared = (0..shortest).take_while(is_shared).count();
    let place = if shared == shortest { 0 } else { shared };
    let mut robots: Vec<Robot<'_>> = Vec::new();
    for (topic, space) in topics.into_iter().zip(&spaces) {
        let Some(name) = space.get(place) else { continue };
        let path = format!("/{}", space[..=place].join("/"));
        match robots.iter_mut().find(|robot| robot.path == path) {
            Some(robot) => robot.topics.push(topic),
            None => robots.push(Robot { name: (*name).to_owned(), path, topics: vec![topic] }),
        }
    }
    robots.sort_by(|a, b| a.path.cmp(&b.path));
    robots
}

/// The parts of a topic's name but the last.
fn namespace(topic: &str) -> Vec<&str> {
    let mut parts: Vec<&str> = topic.split('/').filter(|part| !part.is_empty()).collect();
    parts.pop();
    parts
}

/// The namespace of a topic as a path, if it has one.
pub(super) fn path_of(topic: &str) -> Option<String> {
    let parts = namespace(topic);
    (!parts.is_empty()).then(|| format!("/{}", parts.join("/")))
}

/// The robots whose base is among these frames under a name of its own: `tb3_0/base_link`.
pub(super) fn framed(frames: &BTreeSet<String>, bases: &[&str]) -> Vec<String> {
    let robot = |frame: &String| {
        let (robot, base) = frame.rsplit_once('/')?;
        bases.contains(&base).then(|| robot.to_owned())
    };
    let robots: BTreeSet<String> = frames.iter().filter_map(robot).collect();
    robots.into_iter().collect()
}

/// The namespace of the robot that the user names. `framed`: those whose frames or states tell of them.
///
/// # Errors
/// A robot that is not there.
pub(super) fn named(name: &str, robots: &[Robot<'_>], framed: &[String]) -> Result<Space> {
    let plain = name.trim_matches('/');
    if let Some(robot) = robots.iter().find(|robot| robot.is_called(name)) {
        return Ok(Space::Chosen(robot.path.clone()));
    }
    if framed.iter().any(|robot| robot == plain) {
        return Ok(Space::Chosen(format!("/{plain}")));
    }
    let is_new = |name: &&String| robots.iter().all(|robot| robot.name != **name);
    let all = robots.iter().map(|robot| &robot.name).chain(framed.iter().filter(is_new));
    let all: Vec<&str> = all.map(String::as_str).collect();
    let reason = match all.is_empty() {
        true => format!("no robot in it has a namespace, so there is none called '{name}'; leave it out"),
        false => format!("there is no robot '{name}'; {}", instead(&all, plain, "robots in it:")),
    };
    Err(Error::param("robot", reason))
}

#[cfg(test)]
mod tests {
    use roscausal_recording::Encoding;

    use super::*;

    fn found(topics: &[&str]) -> Vec<(String, String)> {
        let topics: Vec<Topic> = topics
            .iter()
            .map(|name| Topic {
                name: (*name).to_owned(),
                type_name: ODOMETRY.to_owned(),
                encoding: Encoding::Cdr,
                md5: None,
                definition: "".into(),
                latched: false,
                messages: None,
            })
            .collect();
        of(topics.iter().collect()).into_iter().map(|robot| (robot.name, robot.path)).collect()
    }

    fn pair(name: &str, path: &str) -> (String, String) {
        (name.to_owned(), path.to_owned())
    }

    #[test]
    fn robots_are_told_apart_by_the_first_part_in_which_their_namespaces_differ() {
        assert_eq!(found(&["/odom", "/odometry"]), []);
        assert_eq!(found(&["/tb3_0/odom"]), [pair("tb3_0", "/tb3_0")]);
        let both = [pair("a", "/a"), pair("b", "/b")];
        assert_eq!(found(&["/b/odom", "/a/base/odom", "/a/filtered", "/odom"]), both);
        let deep = [pair("a", "/robots/a"), pair("b", "/robots/b")];
        assert_eq!(found(&["/robots/a/odom", "/robots/b/odom"]), deep);
    }

    #[test]
    fn a_robot_that_is_not_there_is_refused_with_those_that_are() {
        let reported =
            |name: &str, framed: &[String]| named(name, &[], framed).map_err(|error| error.to_string());
        assert_eq!(reported("a", &["a".to_owned()]), Ok(Space::Chosen("/a".to_owned())));
        let error = reported("tb3_1", &["tb3_0".to_owned()]).expect_err("is not there");
        assert!(error.contains("did you mean 'tb3_0'"), "{error}");
        assert!(reported("x", &[]).is_err_and(|error| error.contains("leave it out")));
    }

    #[test]
    fn names_are_seen_from_within_the_namespace() {
        let space = Space::Chosen("/tb3_0".to_owned());
        assert_eq!((space.within("/tb3_0/odom"), space.within("/tb3_01/odom")), ("/odom", "/tb3_01/odom"));
        assert_eq!(space.frame("base_link").as_deref(), Some("tb3_0/base_link"));
        assert_eq!(Space::Any.inside("odom"), None);
    }
}
