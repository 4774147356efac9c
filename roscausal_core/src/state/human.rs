//! From people's topics and goals to `Humans`.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::{Isometry3, Point3, Vector3};
use roscausal_msgs::{
    HumanState, Humans, Time,
    geometry_msgs::{Point, Pose, Pose2D, Twist},
    std_msgs::Header,
    tf2_msgs::TFMessage,
};

use super::{
    identity::{Gates, Identities, Who},
    motion::{Motion, SLOWEST_HEADING},
    robot::{TF_WAIT_S, Trouble, unknown},
    scene::speed,
    tf::{TfBuffer, planar_pose},
};

pub use super::identity::id_of_number;

/// The most sightings that wait for a transform.
const MOST_WAITING: usize = 5000;
/// People without identity, unless the user says otherwise.
const GATES: Gates = Gates { metres: 0.8, keep_s: 1.0, rejoin_s: 0.0 };

/// A topic may be this late beside others; farther behind, it has another clock, or the clock has jumped. Seconds.
const LATEST_S: f64 = 10.0;

/// Most goals that are remembered.
const MOST_GOALS: usize = 4096;

/// One sighting of a person, from any tracker.
#[derive(Clone, Debug, Default)]
pub struct Sighting {
    /// The tracker's id, where it gives a number.
    pub id: u32,
    /// Stamp and frame.
    pub header: Header,
    /// The pose.
    pub pose: Pose,
    /// The velocity, in the frame of the header; `None`: it follows from the change of position.
    pub twist: Option<Twist>,
    /// The goal, if the tracker knows it.
    pub goal: Option<Point>,
}

/// The people in one message.
#[derive(Debug)]
struct Message {
    stamp: Time,
    people: Vec<(Who, Sighting)>,
}

/// Somebody's place in the target frame.
struct Placed {
    who: Who,
    sighting: Sighting,
    pose: Pose2D,
}

/// The people who are there now.
#[derive(Debug, Default)]
pub struct PeopleTracker {
    target_frame: String,
    /// Frame of people whose topic names none.
    source_frame: String,
    timeout_s: f64,
    people: BTreeMap<u32, HumanState>,
    /// How fast those are whose tracker does not tell.
    motions: BTreeMap<u32, Motion>,
    /// Standard deviation of a place, metres.
    noise_m: f64,
    /// Who is who.
    pub identities: Identities,
    /// The goal that was given for the person whom the node is about.
    goal: Option<Point>,
    /// Goals that were given, by person.
    goals: BTreeMap<u32, Point>,
    newest: Time,
    /// The last stamp of each topic.
    last_of: BTreeMap<usize, Time>,
    /// Sightings of the last message that are older than what is known of the same people.
    older: Vec<HumanState>,
    /// Messages that wait for a transform, how many people are in them, and the stamp of the newest that no longer waits.
    waiting: VecDeque<Message>,
    people_waiting: usize,
    placed: Time,
    /// Sightings left out because no transform came in time.
    pub without_transform: u64,
    /// Sightings left out because they hold NaN or infinity.
    pub not_finite: u64,
    /// Sightings out of order without a velocity; they are left out.
    pub late: u64,
    /// Sightings left out because their topic is later beside others than people are kept.
    pub too_late: u64,
    /// Sightings left out because the person was already seen at that stamp: the first one counts.
    pub repeated: u64,
    /// Frames of people and map.
    pub tf: TfBuffer,
    /// Why the last sighting was left out, if it was.
    pub trouble: Option<String>,
}

impl PeopleTracker {
    /// People in `target_frame`; people whose topic names no frame are taken to be in `source_frame`. A person is kept for
    /// `timeout_s` after the last sighting, then removed.
    pub fn new(target_frame: &str, source_frame: &str, timeout_s: f64) -> Self {
        Self {
            target_frame: target_frame.trim_start_matches('/').to_owned(),
            source_frame: source_frame.to_owned(),
            timeout_s,
            identities: Identities::new(GATES),
            ..Self::default()
        }
    }

    /// The same, telling people apart within `gates`, with places that are off by `noise_m` (standard deviation; 0: exact).
    #[must_use]
    pub fn with(self, gates: Gates, noise_m: f64) -> Self {
        Self { identities: Identities::new(gates), noise_m, ..self }
    }

    /// Adds the people of a message, whose ids follow from who they are and where in the target frame. They wait for their
    /// transforms if those are late.
    pub fn message(&mut self, stamp: Time, people: Vec<(Who, Sighting)>) {
        self.heard(stamp);
        self.people_waiting += people.len();
        self.waiting.push_back(Message { stamp, people });
        while self.people_waiting > MOST_WAITING
            && let Some(oldest) = self.waiting.pop_front()
        {
            self.people_waiting -= oldest.people.len();
            self.without_transform += oldest.people.len() as u64;
        }
    }

    /// Adds transforms (`fixed`: from `/tf_static`). Sightings may have waited for them.
    pub fn transforms(&mut self, message: &TFMessage, fixed: bool) {
        self.tf.insert(message, fixed);
    }

    /// The people after the oldest message that need not wait any longer; `None` if there is none. So no sighting is passed over:
    /// one that is older than what is known of the person is there once, with its own stamp. `about` as in [`Self::people`].
    pub fn next(&mut self, about: impl FnOnce(&[HumanState]) -> Option<u32>) -> Option<Humans> {
        self.advance().then(|| self.there(about))
    }

    /// Takes in the oldest message that need not wait any longer; false if there is none.
    fn advance(&mut self) -> bool {
        self.older.clear();
        let Some(Message { stamp, people }) = self.waiting.front() else { return false };
        let waited = self.newest.secs_since(*stamp);
        let may_come = |(_, Sighting { header, .. }): &(Who, Sighting)| {
            self.tf.may_come(&self.target_frame, self.frame(header), header.stamp)
        };
        if waited < TF_WAIT_S && people.iter().any(may_come) {
            return false;
        }
        let Some(Message { stamp, people }) = self.waiting.pop_front() else { return false };
        self.people_waiting -= people.len();
        self.placed = self.placed.max(stamp);
        self.place(stamp, people);
        true
    }

    fn frame<'a>(&'a self, header: &'a Header) -> &'a str {
        if header.frame_id.is_empty() { &self.source_frame } else { &header.frame_id }
    }

    /// Whether a message of this topic, with so many people, is left out: beside other topics it is later than people are kept. A clock that
    /// jumps back does so within a topic.
    pub fn is_late(&mut self, topic: usize, stamp: Time, people: usize) -> bool {
        let back = self.last_of.insert(topic, stamp).map_or(0.0, |last| last.secs_since(stamp));
        let behind = self.newest.secs_since(stamp);
        let is_late = back <= self.timeout_s && behind > self.timeout_s && behind < LATEST_S;
        self.too_late += if is_late { people as u64 } else { 0 };
        is_late
    }

    /// Notes a message from a tracker, whoever is in it. With `stamp`, people who are no longer seen age.
    pub fn heard(&mut self, stamp: Time) {
        if self.newest.secs_since(stamp) > self.timeout_s {
            // Time jumped back: a recording restarted. The people from before are not there now.
            self.people.clear();
            self.motions.clear();
            self.waiting.clear();
            self.people_waiting = 0;
            self.tf.restart();
            (self.newest, self.placed) = (stamp, stamp);
        }
        self.newest = self.newest.max(stamp);
    }

    /// Sets the goal of the person whom the node is about. Not finite: unknown.
    pub fn goal(&mut self, goal: Point) {
        self.goal = Some(goal);
    }

    /// Sets the goal of one person. Not finite: unknown. Goals of people who are gone are forgotten once there are
    /// many.
    pub fn goal_of(&mut self, id: u32, goal: Point) {
        if self.goals.len() >= MOST_GOALS && !self.goals.contains_key(&id) {
            let people = &self.people;
            self.goals.retain(|id, _| people.contains_key(id));
        }
        if self.goals.len() < MOST_GOALS || self.goals.contains_key(&id) {
            self.goals.insert(id, goal);
        }
    }

    /// Everybody who was seen lately, in ascending order of id, with the stamp of the newest message. `about` picks
    /// the person whose goal was given from outside; a goal from the tracker itself takes precedence.
    pub fn people(&mut self, about: impl FnOnce(&[HumanState]) -> Option<u32>) -> Humans {
        while self.advance() {}
        self.there(about)
    }

    fn there(&mut self, about: impl FnOnce(&[HumanState]) -> Option<u32>) -> Humans {
        let (newest, timeout) = (self.newest(), self.timeout_s);
        self.people.retain(|_, person| newest.secs_since(person.header.stamp) <= timeout);
        let people = &self.people;
        self.motions.retain(|id, _| people.contains_key(id));
        let mut humans: Vec<HumanState> = self.people.values().cloned().collect();
        for older in self.older.drain(..) {
            if let Some(person) = humans.iter_mut().find(|person| person.id == older.id) {
                *person = older;
            }
        }
        for person in humans.iter_mut().filter(|person| !is_known(&person.goal)) {
            if let Some(goal) = self.goals.get(&person.id).filter(|goal| is_known(goal)) {
                person.goal = *goal;
            }
        }
        let about = about(&humans);
        let person = humans.iter_mut().find(|person| Some(person.id) == about && !is_known(&person.goal));
        if let (Some(person), Some(goal)) = (person, self.goal.filter(is_known)) {
            person.goal = goal;
        }
        Humans { header: Header { stamp: newest, frame_id: self.target_frame.clone() }, humans }
    }

    /// The time up to which the people are known; 0 before the first message.
    pub fn newest(&self) -> Time {
        if self.waiting.is_empty() { self.newest } else { self.placed }
    }

    /// Brings the people of a message to the target frame, finds out who they are, and takes them in.
    fn place(&mut self, stamp: Time, people: Vec<(Who, Sighting)>) {
        let mut placed = Vec::with_capacity(people.len());
        let mut trouble = None;
        for (who, mut sighting) in people {
            match self.in_target(&mut sighting) {
                Ok(pose) => placed.push(Placed { who, sighting, pose }),
                Err(why) => {
                    let reason = why.counted(&mut self.without_transform, &mut self.not_finite);
                    let name = match &who {
                        Who::Number(number) => format!("person {number}"),
                        Who::Name(name) => format!("person '{name}'"),
                        Who::Unknown => "a person".to_owned(),
                    };
                    trouble = Some(format!("{name}: {reason}"));
                }
            }
        }
        self.trouble = trouble;
        let at = |person: &Placed| (person.who.clone(), Point { x: person.pose.x, y: person.pose.y, z: 0.0 });
        let ids = self.identities.ids(stamp, &placed.iter().map(at).collect::<Vec<_>>());
        for (id, Placed { sighting, pose, .. }) in ids.into_iter().zip(placed) {
            self.take(id, sighting, pose);
        }
    }

    /// Somebody's pose in the target frame; velocity and goal are brought there, too.
    fn in_target(&self, sighting: &mut Sighting) -> Result<Pose2D, Trouble> {
        let stamp = sighting.header.stamp;
        let place = self.tf.lookup(&self.target_frame, self.frame(&sighting.header), stamp);
        let place = place.map_err(Trouble::Transform)?;
        // What is in that frame already stays as it is, also where parts of it are NaN.
        if place != Isometry3::identity() {
            if let Some(twist) = &mut sighting.twist {
                let v = &mut twist.linear;
                let turned = place.rotation * Vector3::new(v.x, v.y, if v.z.is_finite() { v.z } else { 0.0 });
                (v.x, v.y, v.z) = (turned.x, turned.y, turned.z);
            }
            if let Some(goal) = &mut sighting.goal {
                let moved =
                    place * Point3::new(goal.x, goal.y, if goal.z.is_finite() { goal.z } else { 0.0 });
                (goal.x, goal.y, goal.z) = (moved.x, moved.y, moved.z);
            }
        }
        planar_pose(&place, &sighting.pose).map_err(Trouble::Number)
    }

    fn take(&mut self, id: u32, sighting: Sighting, mut pose2d: Pose2D) {
        let stamp = sighting.header.stamp;
        let known = self.people.get(&id).map(|known| known.header.stamp);
        if known == Some(stamp) {
            self.repeated += 1;
            return;
        }
        let is_older = known.is_some_and(|known| known > stamp);
        if is_older && sighting.twist.is_none() {
            // The filter of velocities does not go back.
            self.late += 1;
            return;
        }
        let mut twist = sighting.twist;
        // A NaN would say that the velocity is not known either.
        twist.iter_mut().filter(|twist| twist.angular.z.is_nan()).for_each(|twist| twist.angular.z = 0.0);
        let twist = twist.unwrap_or_else(|| {
            let twist = self.velocity(id, stamp, [pose2d.x, pose2d.y]);
            if speed(&twist) > SLOWEST_HEADING {
                pose2d.theta = libm::atan2(twist.linear.y, twist.linear.x);
            }
            twist
        });
        let header = Header { stamp, frame_id: self.target_frame.clone() };
        let goal = sighting.goal.unwrap_or_else(unknown);
        let state = HumanState { header, id, pose2d, twist, goal };
        if is_older {
            self.older.push(state);
        } else {
            self.people.insert(id, state);
        }
    }

    /// How fast somebody is whose tracker does not tell. One sighting does not tell it either. Where noise is filtered, the turning rate is
    /// NaN, which marks the velocity as filtered for the recorder.
    fn velocity(&mut self, id: u32, stamp: Time, place: [f64; 2]) -> Twist {
        let known = self.people.contains_key(&id);
        let velocity = match self.motions.get_mut(&id).filter(|_| known) {
            Some(motion) => motion.seen(stamp, place),
            None => {
                self.motions.insert(id, Motion::new(stamp, place, self.noise_m));
                None
            }
        };
        let mut twist = walking(velocity.unwrap_or([f64::NAN; 2]));
        if self.noise_m > 0.0 {
            twist.angular.z = f64::NAN;
        }
        twist
    }
}

fn is_known(goal: &Point) -> bool {
    goal.x.is_finite() && goal.y.is_finite()
}

/// A velocity on the floor.
pub(crate) fn walking([x, y]: [f64; 2]) -> Twist {
    let mut twist = Twist::default();
    (twist.linear.x, twist.linear.y) = (x, y);
    twist
}

#[cfg(test)]
mod tests {
    use super::*;

    impl PeopleTracker {
        /// Adds a sighting of somebody whose number is known. It waits for its transform if that is late.
        fn sighting(&mut self, sighting: Sighting) {
            self.message(sighting.header.stamp, vec![(Who::Number(sighting.id), sighting)]);
            while self.advance() {}
        }
    }

    fn seen(id: u32, secs: f64, x: f64) -> Sighting {
        let header = Header { stamp: Time::from_secs_f64(secs), frame_id: "map".into() };
        let mut sighting = Sighting { id, header, ..Sighting::default() };
        sighting.pose.position.x = x;
        sighting
    }

    fn first(people: &[HumanState]) -> Option<u32> {
        people.first().map(|person| person.id)
    }

    fn ids(people: &Humans) -> Vec<u32> {
        people.humans.iter().map(|person| person.id).collect()
    }

    #[test]
    fn people_come_and_go() {
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        assert!(tracker.people(first).humans.is_empty());
        tracker.sighting(seen(7, 0.0, 1.0));
        tracker.sighting(seen(3, 0.5, 1.0));
        assert_eq!(ids(&tracker.people(first)), [3, 7]);
        tracker.sighting(seen(3, 1.4, 1.0));
        assert_eq!(ids(&tracker.people(first)), [3]);
    }

    #[test]
    fn an_unknown_goal_is_nan_and_never_the_persons_place() {
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        tracker.sighting(seen(1, 0.0, 4.0));
        assert!(tracker.people(first).humans[0].goal.x.is_nan());
        tracker.goal(Point { x: 9.0, y: 1.0, z: 0.0 });
        assert_eq!(tracker.people(first).humans[0].goal.x, 9.0);
        tracker.sighting(Sighting { goal: Some(Point { x: 5.0, y: 1.0, z: 0.0 }), ..seen(1, 0.1, 4.0) });
        assert_eq!(tracker.people(first).humans[0].goal.x, 5.0);
    }

    #[test]
    fn the_goal_of_one_person_is_not_everybodys() {
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        tracker.goal(Point { x: 9.0, y: 1.0, z: 0.0 });
        tracker.sighting(seen(1, 0.0, 4.0));
        tracker.sighting(seen(1000, 0.0, 4.0));
        let people = tracker.people(|_| Some(1000)).humans;
        assert!(people[0].goal.x.is_nan() && people[1].goal.x == 9.0);
    }

    #[test]
    fn people_go_when_the_tracker_sees_nobody_any_more() {
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        tracker.sighting(seen(7, 0.0, 1.0));
        tracker.heard(Time::from_secs_f64(0.9));
        assert_eq!(ids(&tracker.people(first)), [7]);
        tracker.heard(Time::from_secs_f64(1.1));
        assert!(tracker.people(first).humans.is_empty());
    }

    #[test]
    fn without_a_twist_speed_and_heading_come_from_the_change_of_place() {
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        tracker.sighting(seen(1, 0.0, 4.0));
        assert!(tracker.people(first).humans[0].twist.linear.x.is_nan());
        tracker.sighting(seen(1, 0.5, 3.5));
        let person = tracker.people(first).humans.remove(0);
        assert!((person.twist.linear.x + 1.0).abs() < 1e-9);
        assert!((person.pose2d.theta.abs() - std::f64::consts::PI).abs() < 1e-9);
    }

    #[test]
    fn no_sighting_is_passed_over_and_the_first_of_a_stamp_counts() {
        let walking = |secs: f64, x: f64| Sighting { twist: Some(Twist::default()), ..seen(1, secs, x) };
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        for (secs, x) in [(1.0, 1.0), (1.04, 2.0), (1.04, 9.0), (1.02, 1.5), (1.06, 3.0)] {
            let sighting = walking(secs, x);
            tracker.message(sighting.header.stamp, vec![(Who::Number(1), sighting)]);
        }
        let mut reported = Vec::new();
        while let Some(people) = tracker.next(first) {
            let person = &people.humans[0];
            reported.push((person.header.stamp, person.pose2d.x));
        }
        let at = Time::from_secs_f64;
        let expected = [(1.0, 1.0), (1.04, 2.0), (1.04, 2.0), (1.02, 1.5), (1.06, 3.0)];
        assert_eq!(reported, expected.map(|(secs, x)| (at(secs), x)));
        assert_eq!(tracker.repeated, 1);
        assert_eq!(tracker.people(first).humans[0].pose2d.x, 3.0);
    }

    #[test]
    fn velocities_and_goals_are_brought_to_the_map_like_places() {
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        let mut camera = roscausal_msgs::geometry_msgs::TransformStamped {
            header: Header { stamp: Time::from_secs_f64(1.0), frame_id: "map".into() },
            child_frame_id: "camera".into(),
            ..Default::default()
        };
        camera.transform.translation.x = 10.0;
        camera.transform.rotation =
            roscausal_msgs::geometry_msgs::Quaternion::from_yaw(std::f64::consts::FRAC_PI_2);
        tracker.transforms(&TFMessage { transforms: vec![camera] }, true);
        let mut sighting = seen(1, 1.0, 2.0);
        sighting.header.frame_id = "camera".into();
        let mut twist = Twist::default();
        (twist.linear.x, twist.linear.z) = (0.5, f64::NAN);
        (sighting.twist, sighting.goal) = (Some(twist), Some(Point { x: 4.0, y: 0.0, z: 0.0 }));
        tracker.sighting(sighting);
        let person = tracker.people(first).humans.remove(0);
        assert!((person.pose2d.x - 10.0).abs() < 1e-9 && (person.pose2d.y - 2.0).abs() < 1e-9, "{person:?}");
        assert!(
            person.twist.linear.x.abs() < 1e-9 && (person.twist.linear.y - 0.5).abs() < 1e-9,
            "{person:?}"
        );
        assert!((person.goal.x - 10.0).abs() < 1e-9 && (person.goal.y - 4.0).abs() < 1e-9, "{person:?}");
    }

    #[test]
    fn people_without_ids_are_told_apart_in_the_map_however_the_camera_turns() {
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        for step in 0..20_u32 {
            let (secs, yaw) = (1.0 + 0.1 * f64::from(step), 0.3 * f64::from(step));
            let header = Header { stamp: Time::from_secs_f64(secs), frame_id: "map".into() };
            let mut camera = roscausal_msgs::geometry_msgs::TransformStamped {
                header: header.clone(),
                child_frame_id: "camera".into(),
                ..Default::default()
            };
            camera.transform.rotation = roscausal_msgs::geometry_msgs::Quaternion::from_yaw(yaw);
            tracker.transforms(&TFMessage { transforms: vec![camera] }, false);
            // Two who stand, 5 m in front of the camera and behind it, in turn first in the list.
            let mut people: Vec<(Who, Sighting)> = [5.0, -5.0]
                .into_iter()
                .map(|x: f64| {
                    let mut sighting = seen(0, secs, x * yaw.cos());
                    sighting.pose.position.y = -x * yaw.sin();
                    sighting.header.frame_id = "camera".into();
                    (Who::Unknown, sighting)
                })
                .collect();
            people.rotate_left((step % 2) as usize);
            tracker.message(header.stamp, people);
            let places: Vec<f64> = tracker.people(first).humans.iter().map(|p| p.pose2d.x.round()).collect();
            assert_eq!(places, [5.0, -5.0], "step {step}");
        }
    }

    #[test]
    fn a_recording_that_starts_again_starts_with_nobody() {
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        tracker.sighting(seen(1, 100.0, 4.0));
        tracker.sighting(seen(2, 1.0, 4.0));
        assert_eq!(ids(&tracker.people(first)), [2]);
    }

    #[test]
    fn a_tracker_that_is_late_beside_another_is_no_jump_of_the_clock() {
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        let hear = |tracker: &mut PeopleTracker, topic: usize, secs: f64| {
            let sighting = seen(topic as u32, secs, 4.0);
            if !tracker.is_late(topic, sighting.header.stamp, 1) {
                tracker.sighting(sighting);
            }
        };
        for step in 0..50 {
            let secs = 100.0 + 0.1 * f64::from(step);
            hear(&mut tracker, 1, secs);
            hear(&mut tracker, 2, secs - 2.0);
        }
        assert_eq!((ids(&tracker.people(first)), tracker.too_late), (vec![1], 50));
        // A recording that starts again does so in each of them.
        hear(&mut tracker, 2, 1.0);
        hear(&mut tracker, 1, 1.0);
        assert_eq!((ids(&tracker.people(first)), tracker.too_late), (vec![1, 2], 50));
    }

    #[test]
    fn a_person_waits_for_a_transform_that_is_late_and_is_left_out_when_it_never_comes() {
        let place = |secs: f64, x: f64| {
            let header = Header { stamp: Time::from_secs_f64(secs), frame_id: "map".into() };
            let mut transform = roscausal_msgs::geometry_msgs::TransformStamped {
                header,
                child_frame_id: "camera".into(),
                ..Default::default()
            };
            transform.transform.translation.x = x;
            TFMessage { transforms: vec![transform] }
        };
        let by_camera = |secs: f64| {
            let mut sighting = seen(3, secs, 1.0);
            sighting.header.frame_id = "camera".into();
            sighting
        };
        let mut tracker = PeopleTracker::new("map", "map", 1.0);
        tracker.transforms(&place(0.9, 1.0), false);
        tracker.sighting(by_camera(1.0));
        assert!(tracker.people(first).humans.is_empty());
        tracker.transforms(&place(1.1, 3.0), false);
        let people = tracker.people(first);
        assert!((people.humans[0].pose2d.x - 3.0).abs() < 1e-6 && people.humans[0].header == people.header);
        (2..20).for_each(|t| tracker.sighting(by_camera(f64::from(t))));
        assert_eq!(tracker.without_transform, 17);
        assert!(tracker.trouble.as_deref().is_some_and(|why| why.contains("'camera'")));
    }

    #[test]
    fn people_whose_topic_names_no_frame_are_in_the_source_frame() {
        let mut tracker = PeopleTracker::new("map", "base_footprint", 1.0);
        let header = Header { stamp: Time::from_secs_f64(1.0), frame_id: "map".into() };
        let mut base = roscausal_msgs::geometry_msgs::TransformStamped {
            header,
            child_frame_id: "base_footprint".into(),
            ..Default::default()
        };
        base.transform.translation.x = 5.0;
        tracker.transforms(&TFMessage { transforms: vec![base] }, false);
        let mut frameless = seen(3, 1.0, 2.0);
        frameless.header.frame_id.clear();
        tracker.sighting(frameless);
        assert!((tracker.people(first).humans[0].pose2d.x - 7.0).abs() < 1e-9);
        // A topic that names a frame is believed.
        tracker.sighting(seen(3, 1.05, 2.0));
        assert!((tracker.people(first).humans[0].pose2d.x - 2.0).abs() < 1e-9);
    }
}
