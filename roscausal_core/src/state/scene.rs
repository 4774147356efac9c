//! The scene from above: robot, people, and the risk of the selected person.

use roscausal_msgs::{HumanState, RobotState, geometry_msgs::Point};

use crate::batch::risk::{Body, RiskModel, risk_exponent};

/// The triangle from a person to the robot, widened by `obs_size`. A person whose position one second ahead lies in
/// it is on collision course.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RiskCone {
    /// The person's position, then the two corners beside the robot. Metres, in the frame of the states.
    pub corners: [Point; 3],
    /// The person's position one second ahead.
    pub ahead: Point,
    /// The person is on collision course.
    pub collision: bool,
    /// The risk, `exp` of the exponent in [`risk_exponent`].
    pub risk: f64,
    /// Metres between person and robot.
    pub distance: f64,
}

impl RiskCone {
    /// The cone of `person` towards `robot`; `None` if a position is unknown or both are the same.
    pub fn new(person: &HumanState, robot: &RobotState, obs_size: f64, safe_dist: f64) -> Option<Self> {
        let (a, b) = (body_of_person(person), body_of_robot(robot));
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let distance = libm::hypot(dx, dy);
        if !(distance.is_finite() && distance > 0.0) {
            return None;
        }
        let (nx, ny) = (-dy / distance * obs_size, dx / distance * obs_size);
        let point = |x: f64, y: f64| Point { x, y, z: 0.0 };
        let exponent = |model: RiskModel| risk_exponent(&a, &b, model, obs_size, safe_dist);
        let risk = libm::exp(exponent(RiskModel::V1_1));
        Some(Self {
            corners: [point(a.x, a.y), point(b.x + nx, b.y + ny), point(b.x - nx, b.y - ny)],
            ahead: point(a.x + a.vx, a.y + a.vy),
            // In this version the exponent is positive exactly on collision course.
            collision: exponent(RiskModel::V1_0) > 0.0,
            risk,
            distance,
        })
    }
}

/// Planar speed of a twist, metres per second.
pub fn speed(twist: &roscausal_msgs::geometry_msgs::Twist) -> f64 {
    libm::hypot(twist.linear.x, twist.linear.y)
}

fn body_of_person(person: &HumanState) -> Body {
    let v = speed(&person.twist);
    Body::heading(person.pose2d.x, person.pose2d.y, person.pose2d.theta, if v.is_nan() { 0.0 } else { v })
}

fn body_of_robot(robot: &RobotState) -> Body {
    Body::heading(robot.pose2d.x, robot.pose2d.y, robot.pose2d.theta, speed(&robot.twist))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn states(person_x: f64, v: f64) -> (HumanState, RobotState) {
        let mut person = HumanState { id: 1000, ..HumanState::default() };
        person.pose2d.x = person_x;
        person.twist.linear.x = v;
        let mut robot = RobotState::default();
        robot.pose2d.x = 4.0;
        (person, robot)
    }

    #[test]
    fn the_cone_is_as_wide_as_the_obstacle_at_the_robot() {
        let (person, robot) = states(0.0, 1.0);
        let cone = RiskCone::new(&person, &robot, 2.0, 5.0).expect("both are known");
        assert_eq!(cone.corners.map(|corner| (corner.x, corner.y)), [(0.0, 0.0), (4.0, 2.0), (4.0, -2.0)]);
        assert!(cone.collision && cone.risk > 1.0);
        assert_eq!((cone.ahead.x, cone.distance), (1.0, 4.0));
    }

    #[test]
    fn a_person_at_rest_is_on_no_course_and_one_at_the_robots_place_has_no_cone() {
        let (person, robot) = states(0.0, 0.0);
        assert!(!RiskCone::new(&person, &robot, 2.0, 5.0).expect("both are known").collision);
        let (person, robot) = states(4.0, 0.0);
        assert_eq!(RiskCone::new(&person, &robot, 2.0, 5.0), None);
        let (person, robot) = states(f64::NAN, 1.0);
        assert_eq!(RiskCone::new(&person, &robot, 2.0, 5.0), None);
    }
}
