//! People's topics and goals to `Humans`.

use std::collections::BTreeMap;

use roscausal_msgs::{
    HumanState, Humans, Time,
    geometry_msgs::{Point, Pose, Twist},
    std_msgs::Header,
};

use super::{robot::unknown, tf::TfBuffer};

/// One sighting of a person, whatever the tracker.
#[derive(Clone, Debug, Default)]
pub struct Sighting {
    /// The tracker's number.
    pub id: u32,
    /// Stamp and frame.
    pub header: Header,
    /// Where.
    pub pose: Pose,
    /// How fast, in the frame of the header; `None`: from the change of place.
    pub twist: Option<Twist>,
    /// Where to, if the tracker knows.
    pub goal: Option<Point>,
}

/// The people that are there now.
#[derive(Debug)]
pub struct PeopleTracker {
    target_frame: String,
    timeout_s: f64,
    people: BTreeMap<u32, HumanState>,
    /// Goals told from outside: of one person, or of whoever has none.
    goals: BTreeMap<u32, Point>,
    goal_of_all: Option<Point>,
    newest: Time,
    /// Frames of people and map.
    pub tf: TfBuffer,
    /// Why the last sighting was left out, if it was.
    pub trouble: Option<String>,
}

impl PeopleTracker {
    /// People in `target_frame`; one is held for `timeout_s` after the last sighting, then is gone.
    pub fn new(target_frame: &str, timeout_s: f64) -> Self {
        Self {
            target_frame: target_frame.trim_start_matches('/').to_owned(),
            timeout_s,
            people: BTreeMap::new(),
            goals: BTreeMap::new(),
            goal_of_all: None,
            newest: Time::ZERO,
            tf: TfBuffer::default(),
            trouble: None,
        }
    }

    /// Takes a sighting.
    pub fn sighting(&mut self, sighting: Sighting) {
        self.trouble = self.place(sighting).err();
    }

    /// Sets where a person is going (`None`: everybody whose goal is not known otherwise).
    pub fn goal(&mut self, id: Option<u32>, goal: Point) {
        match id {
            Some(id) => {
                self.goals.insert(id, goal);
            }
            None => self.goal_of_all = Some(goal),
        }
    }

    /// Everybody seen lately, in ascending order of id, with the stamp of the newest sighting.
    pub fn people(&mut self) -> Humans {
        let (newest, timeout) = (self.newest, self.timeout_s);
        self.people.retain(|_, person| newest.secs_since(person.header.stamp) <= timeout);
        let with_goal = |person: &HumanState| {
            let known = [self.goals.get(&person.id), Some(&person.goal), self.goal_of_all.as_ref()];
            let goal = known.into_iter().flatten().find(|goal| goal.x.is_finite() && goal.y.is_finite());
            HumanState { goal: goal.cloned().unwrap_or_else(unknown), ..person.clone() }
        };
        Humans {
            header: Header { stamp: newest, frame_id: self.target_frame.clone() },
            humans: self.people.values().map(with_goal).collect(),
        }
    }

    /// Stamp of the newest sighting; 0 before the first.
    pub fn newest(&self) -> Time {
        self.newest
    }

    fn place(&mut self, sighting: Sighting) -> Result<(), String> {
        let Sighting { id, header, pose, twist, goal } = sighting;
        if header.stamp < self.newest && self.newest.secs_since(header.stamp) > self.timeout_s {
            // Time jumped back: a recording that starts again. Who was there then is not there now.
            self.people.clear();
            self.newest = header.stamp;
        }
        let frame = if header.frame_id.is_empty() { &self.target_frame } else { &header.frame_id };
        let pose2d = self.tf.pose_in(&self.target_frame, frame, &pose, header.stamp);
        let mut pose2d = pose2d.map_err(|trouble| format!("person {id}: {trouble}"))?;
        let before = self.people.get(&id).filter(|before| before.header.stamp < header.stamp);
        let twist = match (twist, before) {
            (Some(twist), _) => twist,
            (None, Some(before)) => {
                let dt = header.stamp.secs_since(before.header.stamp);
                let mut twist = Twist::default();
                twist.linear.x = (pose2d.x - before.pose2d.x) / dt;
                twist.linear.y = (pose2d.y - before.pose2d.y) / dt;
                if twist.linear.x.hypot(twist.linear.y) > 0.05 {
                    pose2d.theta = twist.linear.y.atan2(twist.linear.x);
                }
                twist
            }
            (None, None) => Twist::default(),
        };
        if self.people.get(&id).is_some_and(|known| known.header.stamp > header.stamp) {
            return Ok(());
        }
        self.newest = self.newest.max(header.stamp);
        let header = Header { stamp: header.stamp, frame_id: self.target_frame.clone() };
        let goal = goal.unwrap_or_else(unknown);
        self.people.insert(id, HumanState { header, id, pose2d, twist, goal });
        Ok(())
    }
}

/// A number for a person whom the tracker names by text: the digits at its end, else one made from the text.
pub fn id_of(name: &str) -> u32 {
    let digits: String = name.chars().rev().take_while(char::is_ascii_digit).collect();
    let number: String = digits.chars().rev().collect();
    number.parse().unwrap_or_else(|_| {
        // FNV-1a, kept clear of the small numbers that trackers use.
        name.bytes().fold(0x811c_9dc5_u32, |h, b| (h ^ u32::from(b)).wrapping_mul(0x0100_0193)) | 0x8000_0000
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(id: u32, secs: f64, x: f64) -> Sighting {
        let header = Header { stamp: Time::from_secs_f64(secs), frame_id: "map".into() };
        let mut sighting = Sighting { id, header, ..Sighting::default() };
        sighting.pose.position.x = x;
        sighting
    }

    fn ids(people: &Humans) -> Vec<u32> {
        people.humans.iter().map(|person| person.id).collect()
    }

    #[test]
    fn people_come_and_go() {
        let mut tracker = PeopleTracker::new("map", 1.0);
        assert!(tracker.people().humans.is_empty());
        tracker.sighting(seen(7, 0.0, 1.0));
        tracker.sighting(seen(3, 0.5, 1.0));
        assert_eq!(ids(&tracker.people()), [3, 7]);
        tracker.sighting(seen(3, 1.4, 1.0));
        assert_eq!(ids(&tracker.people()), [3]);
    }

    #[test]
    fn an_unknown_goal_is_nan_and_never_the_persons_place() {
        let mut tracker = PeopleTracker::new("map", 1.0);
        tracker.sighting(seen(1, 0.0, 4.0));
        assert!(tracker.people().humans[0].goal.x.is_nan());
        tracker.goal(None, Point { x: 9.0, y: 1.0, z: 0.0 });
        assert_eq!(tracker.people().humans[0].goal.x, 9.0);
        tracker.goal(Some(1), Point { x: 5.0, y: 1.0, z: 0.0 });
        assert_eq!(tracker.people().humans[0].goal.x, 5.0);
    }

    #[test]
    fn without_a_twist_speed_and_heading_come_from_the_change_of_place() {
        let mut tracker = PeopleTracker::new("map", 1.0);
        tracker.sighting(seen(1, 0.0, 4.0));
        tracker.sighting(seen(1, 0.5, 3.5));
        let person = tracker.people().humans.remove(0);
        assert!((person.twist.linear.x + 1.0).abs() < 1e-9);
        assert!((person.pose2d.theta.abs() - std::f64::consts::PI).abs() < 1e-9);
    }

    #[test]
    fn a_recording_that_starts_again_starts_with_nobody() {
        let mut tracker = PeopleTracker::new("map", 1.0);
        tracker.sighting(seen(1, 100.0, 4.0));
        tracker.sighting(seen(2, 1.0, 4.0));
        assert_eq!(ids(&tracker.people()), [2]);
    }

    #[test]
    fn names_become_stable_numbers() {
        assert_eq!(id_of("person_12"), 12);
        assert_eq!(id_of("anna"), id_of("anna"));
        assert_ne!(id_of("anna"), id_of("berta"));
    }
}
