//! From odometry, pose and goal to `RobotState`.

use std::collections::VecDeque;

use roscausal_msgs::{
    RobotState, Time,
    geometry_msgs::{Point, Pose, Pose2D},
    nav_msgs::Odometry,
    std_msgs::Header,
    tf2_msgs::TFMessage,
};

use super::{
    goals::{Goal, Goals},
    sync::Pairing,
    tf::{TfBuffer, planar_pose},
};
use crate::grammar::wrap;

/// How long a pose waits for its transform, in seconds of stamps.
pub(super) const TF_WAIT_S: f64 = 0.5;
/// Most poses that wait for a transform.
const MOST_WAITING: usize = 1000;
/// If stamps go back by more than this, the clock has jumped. Seconds.
const JUMP_S: f64 = 1.0;
/// Without odometry, the speed is that over at least the first and at most the second of these. Seconds.
const SPEED_OVER_S: (f64, f64) = (0.1, 1.0);

/// The robot's state from its topics: one state for each pose that has odometry close to it in time.
#[derive(Debug, Default)]
pub struct RobotTracker {
    target_frame: String,
    /// The robot's own frame, when its place in TF is the pose.
    pose_frame: Option<String>,
    /// Poses and odometry, with what was left out of them.
    pub(crate) pairing: Pairing<(Header, Pose), Odometry>,
    goals: Goals,
    /// Pairs that wait for a transform, in order.
    waiting: VecDeque<(Header, Pose, Odometry)>,
    newest: Option<Time>,
    /// Without odometry: the last poses, which tell the speed.
    past: Option<VecDeque<(Time, Pose2D)>>,
    tf: TfBuffer,
    /// Pairs left out, or with an unknown goal, because no transform came in time.
    pub without_transform: u64,
    /// Pairs left out because they hold NaN or infinity.
    pub not_finite: u64,
    /// Messages without a stamp; they get the time of arrival.
    pub unstamped: u64,
    /// How often the clock jumped back.
    pub jumps: u64,
    /// Why the last pose gave no state, if it gave none.
    pub trouble: Option<String>,
}

impl RobotTracker {
    /// States in `target_frame` from poses and odometry at most `slop_s` apart.
    pub fn new(target_frame: &str, queue_size: usize, slop_s: f64) -> Self {
        Self {
            target_frame: target_frame.trim_start_matches('/').to_owned(),
            pairing: Pairing::new(queue_size, slop_s),
            ..Self::default()
        }
    }

    /// The same tracker, for a robot that no topic tells the pose of: the pose of each odometry message is the place of
    /// the robot's frame in TF at that time.
    #[must_use]
    pub fn with_pose_of_frame(mut self, frame: &str) -> Self {
        self.pose_frame = Some(frame.to_owned());
        self
    }

    /// The same tracker, for a robot without odometry: each pose makes a state, and its speed follows from the poses before. If
    /// the pose is that of a frame, each transform that moves the frame makes one.
    #[must_use]
    pub fn without_odometry(mut self) -> Self {
        self.past = Some(VecDeque::new());
        self
    }

    /// Adds odometry and returns the states that it completes. `now` replaces a stamp of 0, here and below.
    pub fn odometry(&mut self, mut message: Odometry, now: Time) -> Vec<RobotState> {
        let stamp = self.stamp(message.header.stamp, now);
        message.header.stamp = stamp;
        let pairs = match &self.pose_frame {
            None => self.pairing.push_b(stamp, message),
            Some(frame) => {
                let header = Header { stamp, frame_id: frame.clone() };
                self.pairing.push_both(stamp, (header, Pose::default()), message)
            }
        };
        self.pairs(pairs)
    }

    /// Adds a pose and returns the states that it completes.
    pub fn pose(&mut self, mut header: Header, pose: Pose, now: Time) -> Vec<RobotState> {
        header.stamp = self.stamp(header.stamp, now);
        let stamp = header.stamp;
        if let Some(past) = &self.past {
            let waiting = self.waiting.back().map(|(header, ..)| header.stamp);
            let last = waiting.max(past.back().map(|(stamp, _)| *stamp)).filter(|last| *last >= stamp);
            if let Some(last) = last {
                return self.pairing.leave_out(last > stamp);
            }
            return self.pairs(vec![((header, pose), Odometry::default())]);
        }
        let pairs = self.pairing.push_a(stamp, (header, pose));
        self.pairs(pairs)
    }

    /// Adds a goal. It applies to states from its stamp on, until the next goal.
    pub fn goal(&mut self, header: Header, point: Point, now: Time) {
        self.goals.give(header.stamp, now, Goal { frame: header.frame_id, point });
    }

    /// Adds transforms (`fixed`: from `/tf_static`) and returns the states that waited for them.
    pub fn transforms(&mut self, message: &TFMessage, fixed: bool) -> Vec<RobotState> {
        self.tf.insert(message, fixed);
        let mut states = self.states();
        if let Some(frame) = self.pose_frame.clone().filter(|_| self.past.is_some() && !fixed) {
            let Some(moving) = self.tf.moving(&frame).map(str::to_owned) else { return states };
            let moved = |child: &str| child.trim_start_matches('/') == moving;
            for transform in message.transforms.iter().filter(|transform| moved(&transform.child_frame_id)) {
                let header = Header { stamp: transform.header.stamp, frame_id: frame.clone() };
                states.extend(self.pose(header, Pose::default(), transform.header.stamp));
            }
        }
        states
    }

    /// The stamp, or `now` if there is none. A clock that jumped back restarts everything.
    fn stamp(&mut self, stamp: Time, now: Time) -> Time {
        let is_unstamped = stamp == Time::ZERO;
        self.unstamped += u64::from(is_unstamped);
        let stamp = if is_unstamped { now } else { stamp };
        if self.newest.is_some_and(|newest| newest.secs_since(stamp) > JUMP_S) {
            self.jumps += 1;
            self.newest = None;
            self.pairing.clear();
            self.waiting.clear();
            self.tf.restart();
            self.past.iter_mut().for_each(VecDeque::clear);
            self.goals.restart();
        }
        self.newest = self.newest.max(Some(stamp));
        stamp
    }

    fn pairs(&mut self, pairs: Vec<((Header, Pose), Odometry)>) -> Vec<RobotState> {
        self.waiting.extend(pairs.into_iter().map(|((header, pose), odometry)| (header, pose, odometry)));
        while self.waiting.len() > MOST_WAITING {
            self.waiting.pop_front();
            self.without_transform += 1;
        }
        self.states()
    }

    /// The states whose transforms are there, in order. A pose that waits too long is left out.
    fn states(&mut self) -> Vec<RobotState> {
        let mut states = Vec::new();
        while let Some((header, pose, odometry)) = self.waiting.front() {
            let waited = self.newest.map_or(0.0, |newest| newest.secs_since(header.stamp));
            if self.tf.may_come(&self.target_frame, self.frame(header), header.stamp) && waited < TF_WAIT_S {
                break;
            }
            match self.state(header, pose, odometry) {
                Ok(mut state) => {
                    let goal = self.goals.at(state.header.stamp).map(|goal| self.in_target(goal));
                    self.trouble = None;
                    match goal.transpose() {
                        Ok(goal) => state.goal = goal.unwrap_or_else(unknown),
                        Err(reason) => {
                            self.trouble = Some(format!("the goal: {reason}"));
                            self.without_transform += 1;
                        }
                    }
                    states.extend(self.with_speed(state));
                }
                Err(trouble) => {
                    self.trouble = Some(trouble.counted(&mut self.without_transform, &mut self.not_finite));
                }
            }
            self.waiting.pop_front();
        }
        states
    }

    fn frame<'a>(&'a self, header: &'a Header) -> &'a str {
        if header.frame_id.is_empty() { &self.target_frame } else { &header.frame_id }
    }

    /// The state without its goal.
    fn state(&self, header: &Header, pose: &Pose, odometry: &Odometry) -> Result<RobotState, Trouble> {
        let place = self.tf.lookup(&self.target_frame, self.frame(header), header.stamp);
        let pose2d = planar_pose(&place.map_err(Trouble::Transform)?, pose).map_err(Trouble::Number)?;
        let twist = &odometry.twist.twist;
        let numbers = [
            ("the pose's x", pose2d.x),
            ("the pose's y", pose2d.y),
            ("the pose's heading", pose2d.theta),
            ("odometry's linear.x", twist.linear.x),
            ("odometry's linear.y", twist.linear.y),
            ("odometry's angular.z", twist.angular.z),
        ];
        if let Some((name, number)) = numbers.iter().find(|(_, number)| !number.is_finite()) {
            let at = header.stamp.as_secs_f64();
            return Err(Trouble::Number(format!("{name} is {number} at {at:.3} s; no state was made of it")));
        }
        let header = Header { stamp: header.stamp, frame_id: self.target_frame.clone() };
        Ok(RobotState { header, pose2d, twist: odometry.twist.twist, goal: unknown() })
    }

    /// The state with the speed that follows from the poses before, where no odometry tells it; `None` for the first pose.
    fn with_speed(&mut self, mut state: RobotState) -> Option<RobotState> {
        let Some(past) = &mut self.past else { return Some(state) };
        let (stamp, here) = (state.header.stamp, state.pose2d);
        while past.front().is_some_and(|(first, _)| stamp.secs_since(*first) > SPEED_OVER_S.1) {
            past.pop_front();
        }
        // Over a longer step the noise of the poses counts less.
        let far = past.iter().rev().find(|(before, _)| stamp.secs_since(*before) >= SPEED_OVER_S.0 - 1e-9);
        let before = far.or(past.front()).copied();
        past.push_back((stamp, here));
        let (before, there) = before?;
        let dt = stamp.secs_since(before);
        let (dx, dy) = ((here.x - there.x) / dt, (here.y - there.y) / dt);
        let (sin, cos) = libm::sincos(here.theta);
        state.twist.linear.x = cos * dx + sin * dy;
        state.twist.linear.y = cos * dy - sin * dx;
        let turned = here.theta - there.theta;
        state.twist.angular.z = wrap(turned) / dt;
        Some(state)
    }

    fn in_target(&self, goal: &Goal) -> Result<Point, String> {
        if goal.frame.is_empty() {
            return Ok(goal.point);
        }
        // A goal is fixed in its frame, so the latest transform counts.
        self.tf.point_in(&self.target_frame, &goal.frame, &goal.point, Time::ZERO)
    }
}

/// Why there is no state.
pub(super) enum Trouble {
    /// A frame is not there, or not for that time.
    Transform(String),
    /// A number is not finite.
    Number(String),
}

impl Trouble {
    /// Counts it as one of these; returns the reason.
    pub(super) fn counted(self, without_transform: &mut u64, not_finite: &mut u64) -> String {
        let (count, reason) = match self {
            Self::Transform(reason) => (without_transform, reason),
            Self::Number(reason) => (not_finite, reason),
        };
        *count += 1;
        reason
    }
}

/// An unknown position.
pub fn unknown() -> Point {
    Point { x: f64::NAN, y: f64::NAN, z: f64::NAN }
}

#[cfg(test)]
mod tests {
    use roscausal_msgs::geometry_msgs::Quaternion;

    use super::*;

    const NOW: Time = Time { sec: 1, nanosec: 0 };

    fn header(secs: f64, frame: &str) -> Header {
        Header { stamp: Time::from_secs_f64(secs), frame_id: frame.into() }
    }

    fn odometry(secs: f64, v: f64) -> Odometry {
        let mut odometry = Odometry { header: header(secs, "odom"), ..Odometry::default() };
        odometry.twist.twist.linear.x = v;
        odometry
    }

    fn pose(x: f64) -> Pose {
        Pose { position: Point { x, y: 2.0, z: 0.0 }, orientation: Quaternion::from_yaw(0.5) }
    }

    #[test]
    fn a_state_has_the_sensors_stamp_and_no_goal_is_nan() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        assert!(robot.pose(header(1.0, "map"), pose(3.0), NOW).is_empty());
        let states = robot.odometry(odometry(1.05, 0.4), NOW);
        assert_eq!(states[0].header, header(1.0, "map"));
        assert_eq!((states[0].pose2d.x, states[0].twist.linear.x), (3.0, 0.4));
        assert!((states[0].pose2d.theta - 0.5).abs() < 1e-12);
        assert!(states[0].goal.x.is_nan());
    }

    #[test]
    fn what_is_no_number_gives_no_state_and_is_told() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        robot.pose(header(1.0, "map"), pose(3.0), NOW);
        assert!(robot.odometry(odometry(1.0, f64::NAN), NOW).is_empty());
        assert!(robot.trouble.as_deref().is_some_and(|why| why.contains("odometry's linear.x is NaN")));
        robot.pose(header(2.0, "map"), pose(3.0), NOW);
        assert_eq!(robot.odometry(odometry(2.0, 0.4), NOW).len(), 1);
        assert_eq!(robot.trouble, None);
    }

    #[test]
    fn the_last_goal_holds() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        robot.goal(header(0.0, ""), Point { x: 7.0, y: 8.0, z: 0.0 }, NOW);
        robot.pose(header(1.0, "map"), pose(3.0), NOW);
        assert_eq!(robot.odometry(odometry(1.0, 0.4), NOW)[0].goal.x, 7.0);
    }

    #[test]
    fn a_goal_in_an_unknown_frame_is_unknown_and_told() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        robot.goal(header(0.0, "moon"), Point { x: 7.0, y: 8.0, z: 0.0 }, NOW);
        robot.pose(header(1.0, "map"), pose(3.0), NOW);
        let state = robot.odometry(odometry(1.0, 0.4), NOW).remove(0);
        assert!(state.goal.x.is_nan() && state.pose2d.x == 3.0);
        assert!(robot.trouble.is_some_and(|t| t.starts_with("the goal: ") && t.contains("moon")));
    }

    #[test]
    fn a_pose_in_an_unknown_frame_or_of_nan_is_told_and_skipped() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        robot.pose(header(1.0, "moon"), pose(3.0), NOW);
        assert!(robot.odometry(odometry(1.0, 0.4), NOW).is_empty());
        // Its frame may still come; half a second later nothing waits any more.
        robot.pose(header(1.5, "moon"), pose(3.0), NOW);
        assert!(robot.trouble.as_ref().is_some_and(|t| t.contains("moon")));
        robot.pose(header(2.0, "map"), pose(f64::NAN), NOW);
        assert!(robot.odometry(odometry(2.0, 0.4), NOW).is_empty());
        assert!(robot.trouble.as_ref().is_some_and(|t| t.contains("NaN")));
        assert_eq!(robot.without_transform, 1, "only the first one lacked a transform");
    }

    fn place(secs: f64, x: f64) -> TFMessage {
        let mut transform = roscausal_msgs::geometry_msgs::TransformStamped {
            header: header(secs, "map"),
            child_frame_id: "odom".into(),
            ..Default::default()
        };
        transform.transform.translation.x = x;
        transform.transform.rotation.w = 1.0;
        TFMessage { transforms: vec![transform] }
    }

    #[test]
    fn a_pose_waits_for_a_transform_that_is_late() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        robot.transforms(&place(0.9, 1.0), false);
        robot.pose(header(1.0, "odom"), pose(3.0), NOW);
        assert!(robot.odometry(odometry(1.0, 0.4), NOW).is_empty());
        let states = robot.transforms(&place(1.1, 3.0), false);
        assert!((states[0].pose2d.x - 5.0).abs() < 1e-6, "{}", states[0].pose2d.x);
        assert_eq!(robot.without_transform, 0);
    }

    #[test]
    fn a_pose_whose_transform_never_comes_is_left_out_and_told() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        robot.transforms(&place(0.5, 1.0), false);
        for step in 0..20 {
            let t = 1.0 + 0.1 * f64::from(step);
            robot.pose(header(t, "odom"), pose(3.0), NOW);
            assert!(robot.odometry(odometry(t, 0.4), NOW).is_empty());
        }
        assert!(robot.without_transform >= 14, "{}", robot.without_transform);
        assert!(robot.trouble.as_deref().is_some_and(|why| why.contains("transform of frame 'odom' is")));
    }

    #[test]
    fn without_a_pose_topic_the_pose_is_the_place_of_the_robots_frame() {
        let mut robot = RobotTracker::new("map", 10, 0.1).with_pose_of_frame("odom");
        assert!(robot.transforms(&place(1.0, 3.0), false).is_empty());
        assert_eq!(robot.odometry(odometry(1.0, 0.4), NOW)[0].pose2d.x, 3.0);
        // The transform is late: the state waits for it.
        assert!(robot.odometry(odometry(1.1, 0.5), NOW).is_empty());
        let states = robot.transforms(&place(1.2, 5.0), false);
        assert_eq!((states.len(), states[0].twist.linear.x), (1, 0.5));
        assert!((states[0].pose2d.x - 4.0).abs() < 1e-9);
        assert!(robot.odometry(odometry(1.1, 0.5), NOW).is_empty(), "twice");
        assert_eq!((robot.pairing.repeated, robot.without_transform), (1, 0));
    }

    #[test]
    fn without_odometry_the_speed_follows_from_the_poses() {
        let mut robot = RobotTracker::new("map", 10, 0.1).without_odometry();
        // 0.5 m/s ahead and 0.2 rad/s to the left, at 20 Hz.
        let mut states = Vec::new();
        for step in 0..40 {
            let t = 0.05 * f64::from(step);
            let position =
                Point { x: 0.5 / 0.2 * (0.2 * t).sin(), y: 0.5 / 0.2 * (1.0 - (0.2 * t).cos()), z: 0.0 };
            let pose = Pose { position, orientation: Quaternion::from_yaw(0.2 * t) };
            states.extend(robot.pose(header(1.0 + t, "map"), pose, NOW));
            assert!(robot.pose(header(1.0 + t, "map"), pose, NOW).is_empty(), "twice");
        }
        assert_eq!((states.len(), robot.pairing.repeated), (39, 40), "the first pose tells no speed");
        for state in &states {
            assert!((state.twist.linear.x - 0.5).abs() < 1e-3 && state.twist.linear.y.abs() < 0.01);
            assert!((state.twist.angular.z - 0.2).abs() < 1e-9);
        }
        assert!(robot.pose(header(9.0, "map"), pose(3.0), NOW).is_empty(), "no speed over a pause");
    }

    #[test]
    fn with_tf_alone_each_transform_that_moves_the_robots_frame_makes_a_state() {
        let mut robot = RobotTracker::new("map", 10, 0.1).with_pose_of_frame("base").without_odometry();
        let mut fixed = place(0.0, 0.0);
        (fixed.transforms[0].header.frame_id, fixed.transforms[0].child_frame_id) =
            ("odom".into(), "base".into());
        robot.transforms(&fixed, true);
        let states: Vec<RobotState> = (0..5)
            .flat_map(|i| robot.transforms(&place(1.0 + 0.1 * f64::from(i), 0.1 * f64::from(i)), false))
            .collect();
        assert_eq!(states.len(), 4);
        assert!(states.iter().all(|state| (state.twist.linear.x - 1.0).abs() < 1e-6));
    }

    #[test]
    fn a_stamp_of_0_is_the_time_of_arrival() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        let now = Time::from_secs_f64(7.0);
        robot.pose(header(0.0, "map"), pose(3.0), now);
        let states = robot.odometry(odometry(0.0, 0.4), now);
        assert_eq!((states[0].header.stamp, robot.unstamped), (now, 2));
    }

    #[test]
    fn a_goal_holds_from_its_stamp_on_whenever_it_arrives() {
        let (mut robot, now) = (RobotTracker::new("map", 10, 0.1), Time::from_secs_f64(9.0));
        let to = |x| Point { x, y: 0.0, z: 0.0 };
        robot.goal(header(5.0, ""), to(5.0), now);
        robot.goal(header(2.0, ""), to(2.0), now);
        let mut goal_at = |t: f64| {
            robot.pose(header(t, "map"), pose(3.0), now);
            robot.odometry(odometry(t, 0.4), now)[0].goal.x
        };
        assert!(goal_at(1.0).is_nan());
        assert_eq!((goal_at(3.0), goal_at(5.0), goal_at(6.0)), (2.0, 5.0, 5.0));
    }

    #[test]
    fn duplicates_and_messages_out_of_order_make_no_state() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        let mut states = Vec::new();
        for t in [1.0, 1.0, 1.2, 1.1, 1.3] {
            states.extend(robot.pose(header(t, "map"), pose(3.0), NOW));
            states.extend(robot.odometry(odometry(t, 0.4), NOW));
        }
        let stamps: Vec<f64> = states.iter().map(|state| state.header.stamp.as_secs_f64()).collect();
        assert_eq!(stamps, [1.0, 1.2, 1.3]);
        assert_eq!((robot.pairing.late, robot.pairing.repeated), (2, 2));
    }

    #[test]
    fn a_recording_that_starts_again_makes_states_again() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        robot.goal(header(50.0, ""), Point { x: 7.0, y: 8.0, z: 0.0 }, Time::from_secs_f64(60.0));
        for t in [60.0, 1.0] {
            robot.pose(header(t, "map"), pose(3.0), NOW);
            let states = robot.odometry(odometry(t, 0.4), NOW);
            assert_eq!((states.len(), states[0].goal.x), (1, 7.0), "the last goal is in force at {t}");
        }
        assert_eq!(robot.jumps, 1);
    }
}
