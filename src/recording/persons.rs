//! People by name: `--person anna`, and signals of the topics that a tracker has for each person (ROS4HRI):
//! `engaged = /humans/persons/{person}/engagement_status.level`.

use std::{collections::BTreeSet, sync::Arc};

use roscausal_core::{
    Error, Result,
    batch::Select,
    middleware::Raw,
    params::instead,
    people::{Reader, Tracker},
    signal::Definitions,
    state::identity::{Names, Who},
};
use roscausal_discovery::Named;
use roscausal_msgs::{
    geometry_msgs::TransformStamped, hri_msgs::IdsList, std_msgs::String as Text, tf2_msgs::TFMessage,
};
use roscausal_recording::{Recording, Topic};

use super::choose::Chooser;

/// What stands for the person's name in a signal, and for the names of their body and their face.
const PLACES: [&str; 3] = ["{person}", "{body}", "{face}"];

/// `--person` in numbers, as the nodes take it, and the names that must get these numbers.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Chosen {
    pub(super) select: String,
    pub(super) names: Vec<String>,
}

/// Who is meant by `--person`: what the nodes understand stays, names become the numbers that the human node will give them.
pub(super) fn chosen(who: &str) -> Chosen {
    if who.parse::<Select>().is_ok() || who.starts_with("nearest:") {
        return Chosen { select: who.to_owned(), names: Vec::new() };
    }
    let (mut numbers, mut given) = (Names::default(), Vec::new());
    let number = |word: &str| match word.parse::<u32>() {
        Ok(number) => number.to_string(),
        Err(_) => {
            given.push(word.to_owned());
            numbers.number(word).to_string()
        }
    };
    let select: Vec<String> =
        who.split(',').map(str::trim).filter(|word| !word.is_empty()).map(number).collect();
    Chosen { select: select.join(","), names: given }
}

/// A signal with the name of the person in the place of `{person}`, and those of their body and face (REP-155 gives each an id of
/// its own, which `/humans/persons/NAME/body_id` tells) in theirs.
///
/// # Errors
/// `--person` does not name one person.
pub(super) fn named(signal: &str, who: Option<&str>, chooser: &Chooser<'_>) -> Result<String> {
    if !PLACES.iter().any(|place| signal.contains(place)) {
        return Ok(signal.to_owned());
    }
    let is_one = |who: &&str| !who.contains([',', ':']) && !["all", "nobody"].contains(who);
    let Some(who) = who.filter(is_one) else {
        let (places, flag) = (PLACES.join(", "), Named("person"));
        let reason = format!("'{signal}': {places} stand for one person; name them, such as {flag} anna");
        return Err(Error::param("signal", reason));
    };
    let mut text = signal.replace(PLACES[0], who);
    for (place, part) in [(PLACES[1], "body"), (PLACES[2], "face")] {
        if text.contains(place) {
            let id = id_of(chooser, who, part)?.unwrap_or_else(|| who.to_owned());
            text = text.replace(place, &id);
        }
    }
    Ok(text)
}

/// The id of a person's body or face, as the recording first tells it.
fn id_of(chooser: &Chooser<'_>, person: &str, part: &str) -> Result<Option<String>> {
    let name = format!("/humans/persons/{person}/{part}_id");
    let topics = chooser.recording.topics();
    let is_it = |topic: &Topic| topic.name == name && topic.type_name == "std_msgs/String";
    if !topics.iter().any(is_it) {
        return Ok(None);
    }
    let mut recording = Recording::open(chooser.path)?;
    recording.select(is_it);
    let texts =
        recording.by_ref().filter_map(|record| topics[record.topic].decode::<Text>(&record.bytes).ok());
    Ok(texts.map(|text| text.data).find(|id| !id.is_empty()))
}

/// Where the people of a recording come from.
pub(super) enum Source<'a> {
    /// Messages of these topics.
    Topics(&'a [Tracker]),
    /// Frames on this topic of transforms whose names begin and end so.
    Frames(&'a str, Vec<(String, String)>),
}

/// Checks that everybody who is named is there.
///
/// # Errors
/// Somebody who is not: with the names of those who are.
pub(super) fn check(chooser: &Chooser<'_>, names: &[String], source: &Source<'_>) -> Result<()> {
    let mut missing: BTreeSet<&str> = names.iter().map(String::as_str).collect();
    let mut there = BTreeSet::new();
    let mut recording = Recording::open(chooser.path)?;
    let topics = recording.topics().to_vec();
    let is_wanted = |topic: &Topic| match source {
        Source::Topics(of) => of.iter().any(|one| one.topic == topic.name),
        Source::Frames(tf, _) => {
            topic.type_name == "hri_msgs/IdsList" || topic.name.trim_end_matches("_static") == *tf
        }
    };
    recording.select(is_wanted);
    let definitions = Arc::new(Definitions::of(""));
    let classes = ["person", "people", "pedestrian", "human", "0"].map(str::to_owned);
    let reader = |topic: &Topic| {
        let kind = topic.raw_type().filter(|_| is_wanted(topic)).map(Arc::new)?;
        let trackers = if let Source::Topics(all) = source { *all } else { &[] };
        let tracker = trackers.iter().find(|one| one.topic == topic.name).cloned().unwrap_or_default();
        Some((kind, Reader::new(tracker, &classes, definitions.clone())))
    };
    let mut readers: Vec<_> = topics.iter().map(reader).collect();
    for record in recording.by_ref() {
        let topic = &topics[record.topic];
        let found: Vec<String> = match source {
            Source::Topics(_) => {
                let Some((kind, reader)) = &mut readers[record.topic] else { continue };
                let seen = reader.read(&Raw { kind: kind.clone(), bytes: record.bytes });
                let name = |(who, _)| if let Who::Name(name) = who { Some(name) } else { None };
                seen.people.into_iter().filter_map(name).collect()
            }
            Source::Frames(..) if topic.type_name == "hri_msgs/IdsList" => {
                topic.decode::<IdsList>(&record.bytes).map_or_else(|_| Vec::new(), |list| list.ids)
            }
            Source::Frames(_, forms) => {
                let Ok(message) = topic.decode::<TFMessage>(&record.bytes) else { continue };
                let name = |transform: &TransformStamped| {
                    let frame = transform.child_frame_id.trim_start_matches('/');
                    let within = |(start, end): &(String, String)| {
                        frame.strip_prefix(start.as_str())?.strip_suffix(end.as_str())
                    };
                    forms.iter().find_map(within).map(str::to_owned)
                };
                message.transforms.iter().filter_map(name).collect()
            }
        };
        missing.retain(|name| found.iter().all(|known| known != name));
        if missing.is_empty() {
            return Ok(());
        }
        there.extend(found);
    }
    let Some(name) = missing.first() else { return Ok(()) };
    let all: Vec<&str> = there.iter().map(String::as_str).take(MOST_TOLD).collect();
    let reported = match all.is_empty() {
        true => "nobody in it has a name; choose by number, nearest:N or all".to_owned(),
        false => instead(&all, name, "people in it:"),
    };
    Err(Error::param("person", format!("there is nobody called '{name}'; {reported}")))
}

/// Most names that are told.
const MOST_TOLD: usize = 20;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_the_numbers_that_the_node_gives_them() {
        let of = |who: &str| {
            let Chosen { select, names } = chosen(who);
            (select, names.join(","))
        };
        let pair = |select: &str, names: &str| (select.to_owned(), names.to_owned());
        for who in ["3", "3,7", "all", "nobody", "nearest:2", "nearest:x"] {
            assert_eq!(of(who), pair(who, ""), "{who}");
        }
        assert_eq!(of("anna"), pair("1", "anna"));
        assert_eq!(of("anna, berta"), pair("1,2", "anna,berta"));
        assert_eq!(of("person_12,anna"), pair("12,1", "person_12,anna"));
    }
}
