//! Where the nodes saw the robot and people while a recording was played: what to say where they never were there together.

use std::{
    fmt,
    sync::{Arc, Mutex},
};

use roscausal_core::{
    Result, Time,
    gate::lock,
    loopback::{Loopback, LoopbackSubscription},
    middleware::{Middleware, Qos},
};
use roscausal_msgs::{Humans, RobotState, geometry_msgs::Pose2D};

/// Nobody walks so far from the robot that it matters. Metres.
const FAR_M: f64 = 100.0;

/// The times and places of the robot, or of people.
#[derive(Clone, Copy, Debug, Default)]
struct Track {
    span: Option<(Time, Time)>,
    /// Smallest and largest coordinate, of x and y alike; metres.
    places: Option<(f64, f64)>,
}

impl Track {
    fn add(&mut self, stamp: Time, at: &Pose2D) {
        self.span = Some(self.span.map_or((stamp, stamp), |(a, b)| (a.min(stamp), b.max(stamp))));
        for value in [at.x, at.y].into_iter().filter(|value| value.is_finite()) {
            self.places = Some(self.places.map_or((value, value), |(a, b)| (a.min(value), b.max(value))));
        }
    }
}

/// What was seen so far.
pub(crate) struct Seen {
    tracks: Arc<Mutex<[Track; 2]>>,
    _subscriptions: [LoopbackSubscription; 2],
}

impl Seen {
    pub(crate) fn on(bus: &Loopback) -> Result<Self> {
        let node = bus.node("seen");
        let tracks = Arc::new(Mutex::new([Track::default(); 2]));
        let (robot, people) = (tracks.clone(), tracks.clone());
        let robot = node.subscribe("/roscausal/robot", Qos::Volatile(100), move |m: RobotState| {
            lock(&robot)[0].add(m.header.stamp, &m.pose2d);
        })?;
        let people = node.subscribe("/roscausal/humans", Qos::Volatile(100), move |m: Humans| {
            m.humans.iter().for_each(|person| lock(&people)[1].add(person.header.stamp, &person.pose2d));
        })?;
        Ok(Self { tracks, _subscriptions: [robot, people] })
    }

    /// What is odd about their places, if anything is.
    pub(crate) fn remark(&self) -> Option<String> {
        let [robot, people] = lock(&self.tracks).map(|track| track.places);
        let size = |(a, b): (f64, f64)| a.abs().max(b.abs());
        let (robot, people) = (robot?, people?);
        (size(people) > FAR_M && size(people) > 50.0 * size(robot)).then(|| {
            let both = coordinates(robot, people);
            format!("{both}: people seem to be in millimetres, centimetres or another frame; ROS has metres, so convert them first")
        })
    }
}

fn coordinates(robot: (f64, f64), people: (f64, f64)) -> String {
    format!(
        "the robot's coordinates are {:.1} to {:.1} m, those of people {:.1} to {:.1} m",
        robot.0, robot.1, people.0, people.1
    )
}

impl fmt::Display for Seen {
    /// Which of them was missing, when, or where they were.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [robot, people] = *lock(&self.tracks);
        let ((from, to), (first, last)) = match (robot.span, people.span) {
            (Some(robot), Some(people)) => (robot, people),
            (Some(_), None) => return f.write_str("the robot was seen, but never a person"),
            (None, Some(_)) => return f.write_str("people were seen, but never the robot"),
            (None, None) => return f.write_str("neither the robot nor a person was seen"),
        };
        if first > to {
            return write!(f, "the robot is there until {:.1} s before people are", first.secs_since(to));
        }
        if from > last {
            return write!(f, "people are there until {:.1} s before the robot is", from.secs_since(last));
        }
        match (self.remark(), robot.places.zip(people.places)) {
            (Some(remark), _) => f.write_str(&remark),
            (None, Some((robot, people))) => f.write_str(&coordinates(robot, people)),
            (None, None) => f.write_str("the places of the robot or of people are not known"),
        }
    }
}
