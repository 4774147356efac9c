//! How much of a recording each way to know the robot's place covers.

use std::{
    collections::{BTreeSet, VecDeque},
    path::Path,
};

use roscausal_core::{Result, Time, state::tf::TfBuffer};
use roscausal_msgs::{
    geometry_msgs::{PoseStamped, PoseWithCovarianceStamped},
    nav_msgs::Odometry,
    std_msgs::Header,
    tf2_msgs::TFMessage,
};
use roscausal_recording::{Record, Recording, Topic};

use super::clocks::is_tf;

/// Between places farther apart than this the robot is not known; the data node's `max_gap`. Seconds.
const MAX_GAP_S: f64 = 0.5;
/// A longer time without a message is a hole, in which nothing is recorded. Seconds.
const HOLE_S: f64 = 60.0;
/// A stamp that is farther back is of another run. Seconds.
const BACK_S: f64 = 1.0;
/// How long a place waits for its transform, as in the robot node. Seconds.
const TF_WAIT_S: f64 = 0.5;
/// Messages of `/tf` that are looked at for frames.
const LOOKED_AT: usize = 2000;

/// Whether this is the topic of transforms, or that of the fixed ones.
fn is_tf_of(topic: &Topic, tf: &str) -> bool {
    let name = topic.name.trim_start_matches('/');
    name.strip_suffix("_static").unwrap_or(name) == tf.trim_start_matches('/') && is_tf(topic)
}

/// A recording of which only these topics are read, and all its topics.
fn opened(path: &Path, wanted: impl Fn(&Topic) -> bool) -> Result<(Recording, Vec<Topic>)> {
    let mut recording = Recording::open(path)?;
    let topics = recording.topics().to_vec();
    recording.select(wanted);
    Ok((recording, topics))
}

/// Shares of the time, from 0 to 1, in which the robot is known: by the topic of poses, and by odometry, brought to the map by TF. Reads
/// the whole recording.
///
/// # Errors
/// A recording that cannot be opened.
pub(crate) fn measure(path: &Path, pose: &str, odometry: &str, map: &str, tf: &str) -> Result<[f64; 2]> {
    let wanted = |topic: &Topic| topic.name == pose || topic.name == odometry || is_tf_of(topic, tf);
    let (mut recording, topics) = opened(path, wanted)?;
    let known = |max_gap_s| Known { max_gap_s, last: None, seconds: 0.0 };
    let (mut by_pose, mut by_odometry, mut whole) = (known(MAX_GAP_S), known(MAX_GAP_S), known(HOLE_S));
    let mut settle = |transforms: &TfBuffer, (is_pose, stamp, frame): (bool, Time, String)| {
        let frame = if frame.is_empty() { map } else { &frame };
        if transforms.lookup(map, frame, stamp).is_ok() {
            if is_pose { by_pose.at(stamp) } else { by_odometry.at(stamp) }
        }
    };
    let (mut waiting, mut transforms) = (VecDeque::new(), TfBuffer::default());
    for record in recording.by_ref() {
        let topic = &topics[record.topic];
        if is_tf_of(topic, tf) {
            if let Ok(message) = topic.decode::<TFMessage>(&record.bytes) {
                transforms.insert(&message, topic.name.ends_with("tf_static"));
            }
            continue;
        }
        let Some(Header { stamp, frame_id }) = header(topic, &record) else { continue };
        whole.at(stamp);
        let last = whole.last.unwrap_or(stamp);
        waiting.push_back((topic.name == pose, stamp, frame_id));
        let is_settled = |(_, stamp, _): &mut (bool, Time, String)| last.secs_since(*stamp) > TF_WAIT_S;
        while let Some(place) = waiting.pop_front_if(is_settled) {
            settle(&transforms, place);
        }
    }
    waiting.into_iter().for_each(|place| settle(&transforms, place));
    let length = whole.seconds.max(1e-9);
    Ok([by_pose, by_odometry].map(|known| known.seconds / length))
}

/// Stamp and frame of a pose or of odometry. A stamp of 0 is the time of the recording.
fn header(topic: &Topic, record: &Record) -> Option<Header> {
    let bytes = &record.bytes;
    let header = match topic.type_name.as_str() {
        "nav_msgs/Odometry" => topic.decode::<Odometry>(bytes).ok()?.header,
        "geometry_msgs/PoseStamped" => topic.decode::<PoseStamped>(bytes).ok()?.header,
        _ => topic.decode::<PoseWithCovarianceStamped>(bytes).ok()?.header,
    };
    let stamp = if header.stamp == Time::ZERO { record.stamp } else { header.stamp };
    Some(Header { stamp, ..header })
}

/// The time in which something is known: the steps between its stamps that are not gaps.
struct Known {
    max_gap_s: f64,
    last: Option<Time>,
    seconds: f64,
}

impl Known {
    fn at(&mut self, stamp: Time) {
        let step = self.last.map_or(0.0, |last| stamp.secs_since(last));
        // One out of order adds nothing; in another run, all begins anew.
        if (0.0..=self.max_gap_s).contains(&step) {
            self.seconds += step;
        }
        if !(-BACK_S..0.0).contains(&step) {
            self.last = Some(stamp);
        }
    }
}

/// The frame of the first message of a topic of poses or odometry.
///
/// # Errors
/// A recording that cannot be opened.
pub(crate) fn frame_of(path: &Path, name: &str) -> Result<Option<String>> {
    let (mut recording, topics) = opened(path, |topic| topic.name == name)?;
    let headers = recording.by_ref().map(|record| header(&topics[record.topic], &record));
    Ok(headers.take(LOOKED_AT).flatten().next().map(|header| header.frame_id))
}

/// Whether the transforms of a recording have this frame.
///
/// # Errors
/// A recording that cannot be opened.
pub(crate) fn has_frame(path: &Path, tf: &str, frame: &str) -> Result<bool> {
    let (mut recording, topics) = opened(path, |topic| is_tf_of(topic, tf))?;
    let is_it = |name: &str| name.trim_start_matches('/') == frame;
    Ok(recording.by_ref().any(|record| {
        let message = topics[record.topic].decode::<TFMessage>(&record.bytes).unwrap_or_default();
        message.transforms.iter().any(|t| is_it(&t.header.frame_id) || is_it(&t.child_frame_id))
    }))
}

/// The frames in the first transforms of a recording.
///
/// # Errors
/// A recording that cannot be opened.
pub(crate) fn frames(path: &Path, tf: &str) -> Result<BTreeSet<String>> {
    let (mut recording, topics) = opened(path, |topic| is_tf_of(topic, tf))?;
    let mut frames = BTreeSet::new();
    for record in recording.by_ref().take(LOOKED_AT) {
        let Ok(message) = topics[record.topic].decode::<TFMessage>(&record.bytes) else { continue };
        for transform in message.transforms {
            for frame in [&transform.header.frame_id, &transform.child_frame_id] {
                frames.insert(frame.trim_start_matches('/').to_owned());
            }
        }
    }
    Ok(frames)
}
