//! Odometry, pose and goal to `RobotState`.

use roscausal_msgs::{
    RobotState, Time,
    geometry_msgs::{Point, Pose},
    nav_msgs::Odometry,
    std_msgs::Header,
};

use super::{sync::Pairing, tf::TfBuffer};

/// The robot as its topics tell: a state for each pose that has odometry near it in time.
#[derive(Debug)]
pub struct RobotTracker {
    target_frame: String,
    pairing: Pairing<(Header, Pose), Odometry>,
    goal: Option<(Header, Point)>,
    /// Frames of robot and map.
    pub tf: TfBuffer,
    /// Why the last pose gave no state, if it gave none.
    pub trouble: Option<String>,
}

impl RobotTracker {
    /// States in `target_frame` from poses and odometry at most `slop_s` apart.
    pub fn new(target_frame: &str, queue_size: usize, slop_s: f64) -> Self {
        Self {
            target_frame: target_frame.trim_start_matches('/').to_owned(),
            pairing: Pairing::new(queue_size, slop_s),
            goal: None,
            tf: TfBuffer::default(),
            trouble: None,
        }
    }

    /// Takes odometry; the states that it completes.
    pub fn odometry(&mut self, message: Odometry) -> Vec<RobotState> {
        let stamp = message.header.stamp;
        let pairs = self.pairing.push_b(stamp, message);
        self.states(pairs)
    }

    /// Takes a pose; the states that it completes.
    pub fn pose(&mut self, header: Header, pose: Pose) -> Vec<RobotState> {
        let stamp = header.stamp;
        let pairs = self.pairing.push_a(stamp, (header, pose));
        self.states(pairs)
    }

    /// Takes a goal, which holds until the next one.
    pub fn goal(&mut self, header: Header, goal: Point) {
        self.goal = Some((header, goal));
    }

    /// Poses that found no odometry near them.
    pub fn unpaired(&self) -> u64 {
        self.pairing.unpaired
    }

    fn states(&mut self, pairs: Vec<((Header, Pose), Odometry)>) -> Vec<RobotState> {
        let mut states = Vec::new();
        for ((header, pose), odometry) in pairs {
            match self.state(&header, &pose, &odometry) {
                Ok(state) => {
                    self.trouble = None;
                    states.push(state);
                }
                Err(trouble) => self.trouble = Some(trouble),
            }
        }
        states
    }

    fn state(&self, header: &Header, pose: &Pose, odometry: &Odometry) -> Result<RobotState, String> {
        let frame = if header.frame_id.is_empty() { &self.target_frame } else { &header.frame_id };
        let pose2d = self.tf.pose_in(&self.target_frame, frame, pose, header.stamp)?;
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
            return Err(format!(
                "{name} is {number} at {:.3} s; no state was made of it",
                header.stamp.as_secs_f64()
            ));
        }
        let goal = match &self.goal {
            None => unknown(),
            Some((header, goal)) => self.in_target(header, goal)?,
        };
        Ok(RobotState {
            header: Header { stamp: header.stamp, frame_id: self.target_frame.clone() },
            pose2d,
            twist: odometry.twist.twist,
            goal,
        })
    }

    fn in_target(&self, header: &Header, point: &Point) -> Result<Point, String> {
        if header.frame_id.is_empty() {
            return Ok(*point);
        }
        // A goal is fixed in its frame: its place now is what counts.
        self.tf.point_in(&self.target_frame, &header.frame_id, point, Time::ZERO)
    }
}

/// A place that is not known.
pub fn unknown() -> Point {
    Point { x: f64::NAN, y: f64::NAN, z: f64::NAN }
}

#[cfg(test)]
mod tests {
    use roscausal_msgs::geometry_msgs::Quaternion;

    use super::*;

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
        assert!(robot.pose(header(1.0, "map"), pose(3.0)).is_empty());
        let states = robot.odometry(odometry(1.05, 0.4));
        assert_eq!(states[0].header, header(1.0, "map"));
        assert_eq!((states[0].pose2d.x, states[0].twist.linear.x), (3.0, 0.4));
        assert!((states[0].pose2d.theta - 0.5).abs() < 1e-12);
        assert!(states[0].goal.x.is_nan());
    }

    #[test]
    fn what_is_no_number_gives_no_state_and_is_told() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        robot.pose(header(1.0, "map"), pose(3.0));
        assert!(robot.odometry(odometry(1.0, f64::NAN)).is_empty());
        assert!(robot.trouble.as_deref().is_some_and(|why| why.contains("odometry's linear.x is NaN")));
        robot.pose(header(2.0, "map"), pose(3.0));
        assert_eq!(robot.odometry(odometry(2.0, 0.4)).len(), 1);
        assert_eq!(robot.trouble, None);
    }

    #[test]
    fn the_last_goal_holds() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        robot.goal(header(0.0, ""), Point { x: 7.0, y: 8.0, z: 0.0 });
        robot.pose(header(1.0, "map"), pose(3.0));
        assert_eq!(robot.odometry(odometry(1.0, 0.4))[0].goal.x, 7.0);
    }

    #[test]
    fn a_pose_in_an_unknown_frame_or_of_nan_is_told_and_skipped() {
        let mut robot = RobotTracker::new("map", 10, 0.1);
        robot.pose(header(1.0, "moon"), pose(3.0));
        assert!(robot.odometry(odometry(1.0, 0.4)).is_empty());
        assert!(robot.trouble.as_ref().is_some_and(|t| t.contains("moon")));
        robot.pose(header(2.0, "map"), pose(f64::NAN));
        assert!(robot.odometry(odometry(2.0, 0.4)).is_empty());
        assert!(robot.trouble.as_ref().is_some_and(|t| t.contains("NaN")));
    }
}
