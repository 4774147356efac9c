//! People of any message, by expressions: `/tracks.list[*] -> id=track, x=pose.x, y=pose.y, vx=twist.linear.x, vy=twist.linear.y`.
//!
//! 1. Before the arrow stand the topic and the field of its messages that lists people; without a field a message is one person, whom
//!    the topic names.
//! 2. Behind it stands what an entry has. `x` and `y` (needed), `z`, `vx` and `vy`, `yaw`, `gx` and `gy` (the goal), and `only` (entries
//!    in which it is 0 are not people) are expressions over the entry's fields, as those of a table: `x=place.x * 1 mm`. `id`, `frame`
//!    and `stamp` are fields. A field with an index stands in quotes: `only="scores[0]" > 0.5`.

use roscausal_msgs::dynamic::Path;

use crate::{
    batch::expression::{Expression, Moment},
    ensure,
    middleware::is_token,
};

/// What is computed of an entry.
const NUMBERS: [&str; 9] = ["x", "y", "z", "vx", "vy", "yaw", "gx", "gy", "only"];
/// What is read of it as it is.
const FIELDS: [&str; 3] = ["id", "frame", "stamp"];

/// A topic of people, and where its messages have what, if the user says it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tracker {
    /// The topic.
    pub topic: String,
    /// What stands behind it, as written.
    pub rest: String,
    pub(super) entries: Option<Entries>,
}

/// Where a message has its people, and what of each is what.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Entries {
    pub(super) list: Option<Path>,
    pub(super) fields: Vec<(&'static str, String)>,
    pub(super) numbers: Vec<(&'static str, String)>,
}

impl From<&str> for Tracker {
    /// A topic whose type says where it has what.
    fn from(topic: &str) -> Self {
        Self { topic: topic.to_owned(), ..Self::default() }
    }
}

impl Tracker {
    /// The trackers of a list. What follows a comma belongs to the one before if that has an arrow, unless a topic begins there.
    ///
    /// # Errors
    /// What is wrong, and where.
    pub fn all(list: &str) -> Result<Vec<Self>, String> {
        let mut texts: Vec<String> = Vec::new();
        for part in list.split(',') {
            match texts.last_mut().filter(|open| open.contains("->") && !part.trim_start().starts_with('/')) {
                Some(open) => *open = format!("{open},{part}"),
                None => texts.push(part.trim().to_owned()),
            }
        }
        texts.iter().filter(|text| !text.is_empty()).map(|text| Self::parse(text)).collect()
    }

    fn parse(text: &str) -> Result<Self, String> {
        let Some((source, roles)) = text.split_once("->") else { return Ok(Self::from(text)) };
        let fault = |reason: &str| format!("'{text}': {reason}");
        let (topic, list) = source.trim().split_once('.').unwrap_or((source.trim(), ""));
        let list = list.trim_end_matches("[*]").trim_end_matches("[]");
        let list = Some(list).filter(|list| !list.is_empty()).map(str::parse).transpose();
        let list = list.map_err(|reason: String| fault(&reason))?;
        let mut entries = Entries { list, ..Entries::default() };
        let role = |part: &str| {
            let (name, value) = part.split_once('=')?;
            let name = NUMBERS.into_iter().chain(FIELDS).find(|role| *role == name.trim())?;
            (!value.starts_with('=')).then(|| (name, value.trim().to_owned()))
        };
        let mut given: Vec<(&'static str, String)> = Vec::new();
        for part in roles.split(',') {
            match (role(part), given.last_mut()) {
                (Some(one), _) => given.push(one),
                // A comma within an expression.
                (None, Some((_, open))) if open.matches('(').count() > open.matches(')').count() => {
                    *open = format!("{open},{part}");
                }
                _ => {
                    let known = NUMBERS.into_iter().chain(FIELDS).collect::<Vec<_>>().join(", ");
                    return Err(fault(&format!(
                        "'{}' is not ROLE=FIELD, such as x=pose.x; roles: {known}",
                        part.trim()
                    )));
                }
            }
        }
        for (role, value) in given {
            let kind = if FIELDS.contains(&role) { &mut entries.fields } else { &mut entries.numbers };
            ensure(kind.iter().all(|(known, _)| *known != role), || {
                fault(&format!("{role} is there twice"))
            })?;
            kind.push((role, value));
        }
        let has = |role: &str| entries.numbers.iter().any(|(known, _)| *known == role);
        let pairs = [("x", "y"), ("y", "x"), ("vx", "vy"), ("vy", "vx"), ("gx", "gy"), ("gy", "gx")];
        if let Some((_, missing)) = pairs.into_iter().find(|(one, other)| has(one) && !has(other)) {
            return Err(fault(&format!("{missing} is missing")));
        }
        ensure(has("x") && topic.starts_with('/') && topic.split('/').skip(1).all(is_token), || {
            fault("write /topic.list[*] -> id=FIELD, x=FIELD, y=FIELD (docs/people.md)")
        })?;
        for (_, value) in &entries.numbers {
            Expression::names_in(value).map_err(|reason| fault(&reason))?;
        }
        let rest = text[topic.len()..].to_owned();
        Ok(Self { topic: topic.to_owned(), rest, entries: Some(entries) })
    }

    /// Whether the user says where its messages have what.
    pub fn is_described(&self) -> bool {
        self.entries.is_some()
    }
}

/// The numbers of an entry, for expressions over them.
pub(super) struct Entry<'a>(pub(super) &'a dyn Fn(usize) -> f64);

impl Moment for Entry<'_> {
    fn cell(&self, column: usize) -> f64 {
        (self.0)(column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_cut_where_a_topic_begins_and_not_within_an_arrow_s_roles() {
        let all = Tracker::all("/a, /b.list[*] -> id=n, x=min(p.x, p.y), y=p.y * 1 mm, /c -> x=x, y=y")
            .expect("three");
        assert_eq!(all.iter().map(|of| of.topic.as_str()).collect::<Vec<_>>(), ["/a", "/b", "/c"]);
        let [plain, of_list, one] = &all[..] else { panic!("{all:?}") };
        assert!(!plain.is_described() && one.entries.as_ref().is_some_and(|of| of.list.is_none()));
        let of_list = of_list.entries.as_ref().expect("described");
        assert_eq!(of_list.numbers[0], ("x", "min(p.x, p.y)".to_owned()));
        assert_eq!(of_list.list, "list".parse().ok());
        assert_eq!(Tracker::all("").expect("nobody"), []);
    }

    #[test]
    fn what_is_wrong_is_one_sentence() {
        for (text, says) in [
            ("/a -> x=p.x", "y is missing"),
            ("/a -> id=n", "x=FIELD, y=FIELD"),
            ("a -> x=x, y=y", "write /topic.list[*]"),
            ("/a -> x=x, y=y, vx=v", "vy is missing"),
            ("/a -> x=x, y=y, x=z", "x is there twice"),
            ("/a -> x=x, y=y, speed=v", "'speed=v' is not ROLE=FIELD"),
            ("/a.b[*].c.[ -> x=x, y=y", "is not a path"),
            ("/a -> x=x +, y=y", "is missing"),
            ("/a ->", "is not ROLE=FIELD"),
        ] {
            let reported = Tracker::all(text).expect_err(text);
            assert!(reported.contains(says), "{text}: {reported}");
        }
    }
}
