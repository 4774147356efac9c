//! A small buffer of coordinate frames, filled from `/tf` and `/tf_static`.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use roscausal_msgs::{
    Time,
    geometry_msgs::{Point, Pose, Pose2D, Transform, Vector3},
    tf2_msgs::TFMessage,
};

/// Transforms that are this much older than the newest are dropped. Seconds.
const KEEP_S: f64 = 10.0;
/// A transform is used for this long before its first and after its last stamp. Seconds.
const EXTRAPOLATE_S: f64 = 0.2;
/// If stamps go back by more than this, the clock has jumped. A smaller step is a message out of order. Seconds.
const JUMP_S: f64 = 1.0;
/// Most frames, and most transforms of one frame, that are kept.
const MOST: usize = 4096;
/// Longest chain of frames; a longer one is a loop.
const DEEPEST: usize = 64;

/// The known frames, each with its parent and its recent poses in it.
#[derive(Debug, Default)]
pub struct TfBuffer {
    frames: BTreeMap<String, Frame>,
}

#[derive(Debug, Default)]
struct Frame {
    parent: String,
    fixed: bool,
    places: VecDeque<(Time, Isometry3<f64>)>,
}

impl TfBuffer {
    /// Adds the transforms of a message from `/tf`, or from `/tf_static` (`fixed`).
    pub fn insert(&mut self, message: &TFMessage, fixed: bool) {
        for transform in &message.transforms {
            let Some(place) = isometry(&transform.transform) else { continue };
            let (stamp, child) = (transform.header.stamp, clean(&transform.child_frame_id));
            if !self.frames.contains_key(child) && self.frames.len() >= MOST {
                continue;
            }
            let frame = self.frames.entry(child.to_owned()).or_default();
            let parent = clean(&transform.header.frame_id);
            let jumped = frame.places.back().is_some_and(|(last, _)| last.secs_since(stamp) > JUMP_S);
            if frame.parent != parent || frame.fixed != fixed || fixed || jumped {
                *frame = Frame { parent: parent.to_owned(), fixed, ..Frame::default() };
            }
            let at = frame.places.partition_point(|(earlier, _)| *earlier < stamp);
            if frame.places.get(at).is_none_or(|(same, _)| *same != stamp) {
                frame.places.insert(at, (stamp, place));
            }
            let newest = frame.places.back().map_or(stamp, |(newest, _)| *newest);
            while frame.places.len() > MOST
                || frame.places.front().is_some_and(|(first, _)| newest.secs_since(*first) > KEEP_S)
            {
                frame.places.pop_front();
            }
        }
    }

    /// The pose of frame `source` in frame `target` at `stamp`; stamp 0 means the latest.
    ///
    /// # Errors
    /// One sentence: which frame is missing, or for which time.
    pub fn lookup(&self, target: &str, source: &str, stamp: Time) -> Result<Isometry3<f64>, String> {
        let (target, source) = (clean(target), clean(source));
        if target == source {
            return Ok(Isometry3::identity());
        }
        let (source_root, from_source) = self.to_root(source, stamp)?;
        let (target_root, from_target) = self.to_root(target, stamp)?;
        if source_root != target_root {
            return Err(format!(
                "frames '{source}' and '{target}' are not connected (roots '{source_root}' and '{target_root}'); check \
                 /tf and /tf_static"
            ));
        }
        Ok(from_target.inverse() * from_source)
    }

    /// Whether [`TfBuffer::lookup`] at `stamp` may succeed once more transforms have arrived: the frames are not
    /// connected yet, or the last transform of one is older than `stamp`.
    pub fn may_come(&self, target: &str, source: &str, stamp: Time) -> bool {
        let (target, source) = (clean(target), clean(source));
        if target == source || stamp == Time::ZERO {
            return false;
        }
        let (source_root, source_last) = self.last(source);
        let (target_root, target_last) = self.last(target);
        source_root != target_root || source_last.into_iter().chain(target_last).any(|last| last < stamp)
    }

    /// The frame that moves `frame`: itself, or the first one above it that is not fixed.
    pub fn moving<'a>(&'a self, frame: &'a str) -> Option<&'a str> {
        let mut at = clean(frame);
        for _ in 0..DEEPEST {
            let known = self.frames.get(at)?;
            if !known.fixed {
                return Some(at);
            }
            at = &known.parent;
        }
        None
    }

    /// Drops everything that is not fixed: the clock jumped.
    pub fn restart(&mut self) {
        self.frames.retain(|_, frame| frame.fixed);
    }

    /// The root above a frame, and the oldest of the last stamps on the way to it.
    fn last<'a>(&'a self, name: &'a str) -> (&'a str, Option<Time>) {
        let (mut at, mut oldest) = (name, None);
        for _ in 0..DEEPEST {
            let Some(frame) = self.frames.get(at) else { break };
            let last = frame.places.back().map(|(stamp, _)| *stamp).filter(|_| !frame.fixed);
            oldest = oldest.into_iter().chain(last).min();
            at = &frame.parent;
        }
        (at, oldest)
    }

    /// Transforms a point from frame `source` to frame `target`.
    ///
    /// # Errors
    /// As [`TfBuffer::lookup`].
    pub fn point_in(&self, target: &str, source: &str, point: &Point, stamp: Time) -> Result<Point, String> {
        let place = self.lookup(target, source, stamp)?;
        let point = place * nalgebra::Point3::new(point.x, point.y, point.z);
        Ok(Point { x: point.x, y: point.y, z: point.z })
    }

    /// Names of the frames that start with `prefix`, each with the stamp of its newest pose.
    pub fn frames_with_prefix(&self, prefix: &str) -> Vec<(String, Time)> {
        let stamp = |frame: &Frame| frame.places.back().map(|(stamp, _)| *stamp);
        let named = self.frames.iter().filter(|(name, _)| name.starts_with(prefix));
        named.filter_map(|(name, frame)| Some((name.clone(), stamp(frame)?))).collect()
    }

    fn to_root<'a>(&'a self, name: &'a str, stamp: Time) -> Result<(&'a str, Isometry3<f64>), String> {
        let mut place = Isometry3::identity();
        let mut at = name;
        for _ in 0..DEEPEST {
            let Some(frame) = self.frames.get(at) else { return Ok((at, place)) };
            place = frame.at(at, stamp)? * place;
            at = &frame.parent;
        }
        Err(format!("the frames above '{name}' form a loop; check /tf"))
    }
}

impl Frame {
    fn at(&self, name: &str, stamp: Time) -> Result<Isometry3<f64>, String> {
        let (Some((first, oldest)), Some((last, newest))) = (self.places.front(), self.places.back()) else {
            return Err(format!("frame '{name}' has no transform yet"));
        };
        if self.fixed || stamp == Time::ZERO {
            return Ok(*newest);
        }
        if stamp <= *first || stamp >= *last {
            let (near, place) = if stamp <= *first { (first, oldest) } else { (last, newest) };
            let away = near.secs_since(stamp).abs();
            let late = || format!("the nearest transform of frame '{name}' is {away:.2} s away");
            return if away <= EXTRAPOLATE_S { Ok(*place) } else { Err(late()) };
        }
        let after = self.places.partition_point(|(s, _)| *s <= stamp);
        let ((t0, p0), (t1, p1)) = (&self.places[after - 1], &self.places[after]);
        let share = stamp.secs_since(*t0) / t1.secs_since(*t0);
        let translation = p0.translation.vector.lerp(&p1.translation.vector, share);
        let rotation = p0.rotation.try_slerp(&p1.rotation, share, 1e-9).unwrap_or(p0.rotation);
        Ok(Isometry3::from_parts(translation.into(), rotation))
    }
}

/// A pose given in a frame that is at `place`, as a planar pose.
///
/// # Errors
/// A pose that is not finite.
pub fn planar_pose(place: &Isometry3<f64>, pose: &Pose) -> Result<Pose2D, String> {
    let Point { x, y, z } = pose.position;
    let inner = Transform { translation: Vector3 { x, y, z }, rotation: pose.orientation };
    let inner = isometry(&inner).ok_or("the pose holds NaN or infinity")?;
    Ok(planar(&(place * inner)))
}

/// Planar part of a pose: position and yaw.
pub fn planar(place: &Isometry3<f64>) -> Pose2D {
    let (_, _, yaw) = place.rotation.euler_angles();
    Pose2D { x: place.translation.x, y: place.translation.y, theta: yaw }
}

fn isometry(transform: &Transform) -> Option<Isometry3<f64>> {
    let (t, r) = (&transform.translation, &transform.rotation);
    if ![t.x, t.y, t.z, r.x, r.y, r.z, r.w].iter().all(|v| v.is_finite()) {
        return None;
    }
    let quaternion = Quaternion::new(r.w, r.x, r.y, r.z);
    // An orientation that was never filled in is a zero quaternion; it counts as no rotation.
    let rotation = UnitQuaternion::try_new(quaternion, 1e-9).unwrap_or_else(UnitQuaternion::identity);
    Some(Isometry3::from_parts(Translation3::new(t.x, t.y, t.z), rotation))
}

/// ROS 1 names may start with `/`.
fn clean(frame: &str) -> &str {
    frame.trim_start_matches('/')
}

#[cfg(test)]
mod tests {
    use roscausal_msgs::{
        geometry_msgs::{Quaternion, TransformStamped, Vector3},
        std_msgs::Header,
    };

    use super::*;

    fn message(parent: &str, child: &str, secs: f64, x: f64, yaw: f64) -> TFMessage {
        let header = Header { stamp: Time::from_secs_f64(secs), frame_id: parent.into() };
        let transform =
            Transform { translation: Vector3 { x, y: 0.0, z: 0.0 }, rotation: Quaternion::from_yaw(yaw) };
        TFMessage { transforms: vec![TransformStamped { header, child_frame_id: child.into(), transform }] }
    }

    #[test]
    fn a_chain_of_frames_is_interpolated_in_time() {
        let mut tf = TfBuffer::default();
        tf.insert(&message("map", "odom", 0.0, 10.0, std::f64::consts::FRAC_PI_2), true);
        tf.insert(&message("odom", "base", 1.0, 0.0, 0.0), false);
        tf.insert(&message("odom", "base", 2.0, 2.0, 1.0), false);
        let pose = planar(&tf.lookup("map", "/base", Time::from_secs_f64(1.5)).expect("connected"));
        assert!((pose.x - 10.0).abs() < 1e-9 && (pose.y - 1.0).abs() < 1e-9);
        assert!((pose.theta - (std::f64::consts::FRAC_PI_2 + 0.5)).abs() < 1e-9);
    }

    #[test]
    fn a_missing_frame_or_time_is_named() {
        let mut tf = TfBuffer::default();
        tf.insert(&message("map", "base", 1.0, 0.0, 0.0), false);
        assert!(tf.lookup("odom", "base", Time::ZERO).expect_err("unconnected").contains("'odom'"));
        assert!(tf.lookup("map", "base", Time::from_secs_f64(9.0)).expect_err("too late").contains("8.00 s"));
    }

    #[test]
    fn transforms_out_of_order_find_their_place_and_a_jump_back_starts_anew() {
        let mut tf = TfBuffer::default();
        let x = |tf: &TfBuffer, t| tf.lookup("map", "base", Time::from_secs_f64(t)).map(|p| p.translation.x);
        [5.0, 5.4, 5.2].into_iter().for_each(|t| tf.insert(&message("map", "base", t, t, 0.0), false));
        assert!((x(&tf, 5.1).expect("is there") - 5.1).abs() < 1e-9);
        assert!((x(&tf, 5.3).expect("is there") - 5.3).abs() < 1e-9);
        tf.insert(&message("map", "base", 1.0, 1.0, 0.0), false);
        assert!(x(&tf, 5.1).is_err() && x(&tf, 1.0).is_ok());
    }

    #[test]
    fn what_may_still_come_is_told_from_what_is_too_old() {
        let mut tf = TfBuffer::default();
        let waits = |tf: &TfBuffer, t| tf.may_come("map", "base", Time::from_secs_f64(t));
        assert!(waits(&tf, 1.0));
        tf.insert(&message("map", "odom", 0.0, 0.0, 0.0), true);
        tf.insert(&message("odom", "base", 1.0, 0.0, 0.0), false);
        assert!(waits(&tf, 1.1) && !waits(&tf, 1.0) && !waits(&tf, 0.5));
        assert!(!tf.may_come("map", "odom", Time::from_secs_f64(9.0)), "a fixed one is there for all times");
    }

    #[test]
    fn transforms_cost_bounded_memory() {
        let mut tf = TfBuffer::default();
        for i in 0..6000 {
            tf.insert(&message("map", &format!("frame_{i}"), 1.0, 0.0, 0.0), false);
            tf.insert(&message("map", "frame_1", 1.0 + 1e-6 * f64::from(i), 0.0, 0.0), false);
        }
        assert!(tf.frames.len() <= MOST && tf.frames["frame_1"].places.len() <= MOST);
    }

    #[test]
    fn a_loop_of_frames_is_told() {
        let mut tf = TfBuffer::default();
        tf.insert(&message("a", "b", 1.0, 0.0, 0.0), true);
        tf.insert(&message("b", "a", 1.0, 0.0, 0.0), true);
        assert!(tf.lookup("map", "a", Time::ZERO).expect_err("loop").contains("loop"));
    }
}
