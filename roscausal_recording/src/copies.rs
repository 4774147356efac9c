//! Files of one folder that hold the same messages: what `rosbag reindex` and `rosbag fix` leave beside the bag (`walk.orig.bag`),
//! and a recording that was converted to another format.

use std::{
    iter::Peekable,
    path::{Path, PathBuf},
};

use roscausal_core::{Message, Time};
use roscausal_msgs::{TypeVisitor, cdr, visit};

use crate::{
    formats::open_file,
    laps::BACK_S,
    recording::Recording,
    source::Source,
    topic::{Encoding, Record, Topic},
};

/// A file of which this share of the messages is in another one is a copy of it.
const SAME: f64 = 0.9;
/// After this many messages, files that are not copies are told.
const SOON: u64 = 1000;

/// The files that are copies of others, by their index: up to which time, the latest of all for whole ones, and a sentence.
pub(crate) fn left_out(files: &[(PathBuf, Box<dyn Source>)]) -> Vec<(usize, Time, String)> {
    let mut found: Vec<(usize, Time, String)> = Vec::new();
    for (first, (path, source)) in files.iter().enumerate() {
        for (second, (other_path, other)) in files.iter().enumerate().skip(first + 1) {
            let gone =
                |index: usize| found.iter().any(|(copy, until, _)| (*copy, *until) == (index, Time::MAX));
            if gone(first) || gone(second) || !may_be_copies(source.as_ref(), other.as_ref()) {
                continue;
            }
            let spans = source.span().zip(other.span()).unwrap_or_default();
            let Some((is_first, until)) = is_first_a_copy(path, other_path, spans) else { continue };
            let (index, copy, of) =
                if is_first { (first, path, other_path) } else { (second, other_path, path) };
            let name = of.file_name().unwrap_or_default().to_string_lossy();
            let what = match until == Time::MAX {
                true => format!("it holds the messages of {name}, so it is left out"),
                false => format!("its first messages are the last ones of {name}, and count once"),
            };
            found.push((index, until, format!("{}: {what}", copy.display())));
        }
    }
    found
}

/// Whether they share topics, and most of the time of the shorter one or more than a moment. Parts of one recording follow each other.
fn may_be_copies(a: &dyn Source, b: &dyn Source) -> bool {
    let (Some((a_start, a_end)), Some((b_start, b_end))) = (a.span(), b.span()) else { return false };
    let shared = a_end.min(b_end).secs_since(a_start.max(b_start));
    let shorter = a_end.secs_since(a_start).min(b_end.secs_since(b_start));
    let same = |topic: &Topic| b.topics().iter().any(|other| is_same(topic, other));
    let may_overlap = shared > BACK_S && a.laps() == 1 && b.laps() == 1;
    (may_overlap || (shared >= 0.0 && shared >= 0.5 * shorter)) && a.topics().iter().any(same)
}

/// Whether two files have the topic. Converters may put a slash before its name.
fn is_same(a: &Topic, b: &Topic) -> bool {
    a.name.trim_start_matches('/') == b.name.trim_start_matches('/') && a.type_name == b.type_name
}

/// If one of two files is a copy of the other, or of a part of it: whether it is the first. It is the one with fewer messages; of equal
/// ones `x.orig.bag`, then the second. If the later one only begins with what the earlier one ends with, it is a copy up to that end.
fn is_first_a_copy(first: &Path, second: &Path, (a_span, b_span): (Span, Span)) -> Option<(bool, Time)> {
    let mut a = Messages::of(first)?;
    let mut b = Messages::of(second)?;
    let (is_later, end) = (a_span.0 > b_span.0, a_span.1.min(b_span.1));
    let (mut shared, mut counted, mut overlapping) = (0, [0, 0], 0);
    while let Some(stamp) = a.next_stamp().into_iter().chain(b.next_stamp()).min() {
        let (ours, theirs) = (a.at(stamp), b.at(stamp));
        counted[0] += ours.len() as u64;
        counted[1] += theirs.len() as u64;
        let of_later = if is_later { ours.len() } else { theirs.len() };
        overlapping += if stamp <= end { of_later as u64 } else { 0 };
        shared += shared_of(&a.topics, &ours, &b.topics, theirs);
        let least = counted[0].min(counted[1]);
        let both_go_on = a.next_stamp().is_some() && b.next_stamp().is_some();
        if both_go_on && least > SOON && (shared as f64) < 0.5 * least as f64 {
            return None;
        }
        // What one file has alone adds nothing to what they share.
        if !both_go_on && (shared as f64) < SAME * least as f64 {
            break;
        }
    }
    if (shared as f64) < SAME * counted[0].min(counted[1]) as f64 || shared == 0 {
        return (shared > 0 && shared == overlapping).then_some((is_later, end));
    }
    let is_original = first.to_string_lossy().contains(".orig.");
    Some((counted[0] < counted[1] || (counted[0] == counted[1] && is_original), Time::MAX))
}

/// First and last time of recording.
type Span = (Time, Time);

/// The messages of a file, moment by moment.
struct Messages {
    topics: Vec<Topic>,
    records: Peekable<Recording>,
}

impl Messages {
    fn of(path: &Path) -> Option<Self> {
        let recording = Recording::of(path, open_file(path, &mut Vec::new()).ok()?, Vec::new());
        Some(Self { topics: recording.topics().to_vec(), records: recording.peekable() })
    }

    fn next_stamp(&mut self) -> Option<Time> {
        self.records.peek().map(|record| record.stamp)
    }

    /// All messages that were recorded at this time.
    fn at(&mut self, stamp: Time) -> Vec<Record> {
        std::iter::from_fn(|| self.records.next_if(|record| record.stamp == stamp)).collect()
    }
}

/// How many of `ours` are among `theirs`, each once.
fn shared_of(our_topics: &[Topic], ours: &[Record], their_topics: &[Topic], mut theirs: Vec<Record>) -> u64 {
    let mut shared = 0;
    for record in ours {
        let topic = &our_topics[record.topic];
        let is_it = |other: &Record| {
            let of = &their_topics[other.topic];
            is_same(topic, of) && holds_the_same(topic, &record.bytes, of, &other.bytes)
        };
        if let Some(place) = theirs.iter().position(is_it) {
            theirs.swap_remove(place);
            shared += 1;
        }
    }
    shared
}

/// Whether two messages of one type are equal. Where formats differ, messages of a type that is not known count as equal.
fn holds_the_same(topic: &Topic, bytes: &[u8], other: &Topic, other_bytes: &[u8]) -> bool {
    if bytes == other_bytes {
        return true;
    }
    let in_cdr = |topic: &Topic, bytes: &[u8]| {
        topic.known_type().and_then(|known| visit(known, InCdr { topic, bytes })).flatten()
    };
    match (in_cdr(topic, bytes), in_cdr(other, other_bytes)) {
        (Some(a), Some(b)) => a == b,
        _ => topic.encoding != other.encoding && !matches!(topic.encoding, Encoding::Other(_)),
    }
}

/// A message as ROS 2 writes it, whatever it was read from.
struct InCdr<'a> {
    topic: &'a Topic,
    bytes: &'a [u8],
}

impl TypeVisitor for InCdr<'_> {
    type Output = Option<Vec<u8>>;

    fn visit<M: Message>(self) -> Self::Output {
        cdr::to_bytes(&self.topic.decode::<M>(self.bytes).ok()?).ok()
    }
}
