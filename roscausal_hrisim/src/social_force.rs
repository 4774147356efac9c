//! The social force model: Helbing and Molnar 1995; Moussaid et al. 2009 (interaction), 2010 (groups).
//!
//! Forces are accelerations in m/s2. The force on a pedestrian is `F_des + 5.1 F_soc + 10 F_obs + F_group`.

use crate::geometry::{Vec2, wrap};

/// Weight of [`social`] in the sum.
pub const SOCIAL_WEIGHT: f64 = 5.1;
/// Weight of [`obstacle`] in the sum.
pub const OBSTACLE_WEIGHT: f64 = 10.0;
/// Neighbours farther away than this have no effect, metres.
pub const NEIGHBOUR_RANGE: f64 = 10.0;
/// Relaxation time of the desired velocity, seconds.
pub const RELAXATION: f64 = 0.5;
/// The distance to a robot counts as this fraction of itself.
pub const ROBOT_DISTANCE_FACTOR: f64 = 0.2;

/// Forces below `exp(-30)` m/s2 (1e-13) count as zero.
const NEGLIGIBLE: f64 = 30.0;
const LAMBDA: f64 = 2.0;
const GAMMA: f64 = 0.35;
const N_PRIME: f64 = 3.0;
const N: f64 = 2.0;
const OBSTACLE_RADIUS: f64 = 0.35;
const OBSTACLE_RANGE: f64 = 0.2;
const GAZE_WEIGHT: f64 = 3.0;
const COHERENCE_WEIGHT: f64 = 2.0;
const REPULSION_WEIGHT: f64 = 1.0;
const REPULSION_DISTANCE: f64 = 0.5;

/// Pull towards walking at `v_max` in the direction `towards` (length 1, or 0 to stand).
pub fn desired(v_max: f64, towards: Vec2, velocity: Vec2) -> Vec2 {
    (towards * v_max - velocity) * (1.0 / RELAXATION)
}

/// Push from one neighbour. `offset` is the neighbour's position minus one's own, `v_rel` one's own velocity minus
/// the neighbour's, `distance_factor` 1 or [`ROBOT_DISTANCE_FACTOR`].
///
/// With the interaction direction `t = 2 v_rel + offset/|offset|`, `B = 0.35 |t|`, `theta` the angle from `t` to
/// the neighbour and `n` the left normal of `t`: `-exp(-d/B - (3 B theta)^2) t/|t| - sign(theta) exp(-d/B - (2 B
/// theta)^2) n`. Exactly ahead (`theta` = 0) counts as left, so two people who meet both keep to the right.
pub fn social(offset: Vec2, v_rel: Vec2, distance_factor: f64) -> Vec2 {
    let distance = offset.norm();
    let direction = if distance > 0.0 { offset * (1.0 / distance) } else { Vec2::new(1.0, 0.0) };
    let interaction = v_rel * LAMBDA + direction;
    let length = interaction.norm();
    if length < 1e-12 {
        return Vec2::ZERO;
    }
    let b = GAMMA * length;
    let decay = distance * distance_factor / b;
    if decay > NEGLIGIBLE {
        return Vec2::ZERO;
    }
    let t = interaction * (1.0 / length);
    let (cross, dot) = (t.cross(direction), t.dot(direction));
    // theta >= 1 - cos(theta), which avoids the arc tangent for most pairs.
    if (N * b * (1.0 - dot)).powi(2) + decay > NEGLIGIBLE {
        return Vec2::ZERO;
    }
    let theta = libm::atan2(cross, dot);
    let slowing = libm::exp(-decay - (N_PRIME * b * theta).powi(2));
    let turning = libm::exp(-decay - (N * b * theta).powi(2));
    let side = if theta < 0.0 { -1.0 } else { 1.0 };
    t * -slowing + t.left() * (-side * turning)
}

/// Push away from the nearest point of the nearest wall: `exp(-(d - 0.35)/0.2)`.
pub fn obstacle(position: Vec2, nearest: Vec2) -> Vec2 {
    let away = position - nearest;
    away.unit() * libm::exp(-(away.norm() - OBSTACLE_RADIUS) / OBSTACLE_RANGE)
}

/// The forces that keep a group together. `others` are the positions of its other members, `heading` the walking
/// direction in radians.
///
/// Gaze (3.0): walk slower in proportion to the head turn that brings the centre of the others within 90 degrees.
/// Coherence (2.0): towards the group's centre if it is farther than `(n - 1)/2` m. Repulsion (1.0): away from each
/// member nearer than 0.5 m.
pub fn group(position: Vec2, velocity: Vec2, heading: f64, others: &[Vec2]) -> Vec2 {
    if others.is_empty() {
        return Vec2::ZERO;
    }
    let sum = others.iter().fold(Vec2::ZERO, |sum, other| sum + *other);
    let others_centre = sum * (1.0 / others.len() as f64);
    let centre = (sum + position) * (1.0 / (others.len() + 1) as f64);

    let aside = wrap((others_centre - position).angle() - heading).abs();
    let head_turn = (aside - std::f64::consts::FRAC_PI_2).max(0.0);
    let gaze = velocity * (-GAZE_WEIGHT * head_turn);

    let to_centre = centre - position;
    let apart = to_centre.norm() > others.len() as f64 / 2.0;
    let coherence = if apart { to_centre.unit() * COHERENCE_WEIGHT } else { Vec2::ZERO };

    let near = others.iter().map(|other| position - *other).filter(|away| away.norm() < REPULSION_DISTANCE);
    let repulsion = near.fold(Vec2::ZERO, |sum, away| sum + away.unit() * REPULSION_WEIGHT);
    gaze + coherence + repulsion
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(actual: Vec2, x: f64, y: f64) {
        assert!((actual - Vec2::new(x, y)).norm() < 1e-9, "{actual:?} is not ({x}, {y})");
    }

    #[test]
    fn desired_force_removes_the_difference_within_half_a_second() {
        assert_near(desired(1.2, Vec2::new(0.0, 1.0), Vec2::new(0.5, 0.2)), -1.0, 2.0);
    }

    #[test]
    fn social_force_equals_the_formula_by_hand() {
        // At rest, neighbour 1 m ahead: t = (1, 0), B = 0.35, theta = 0:
        // -exp(-1/0.35) (1, 0) - exp(-1/0.35) (0, 1), exp(-2.857142857) = 0.0574326193.
        assert_near(social(Vec2::new(1.0, 0.0), Vec2::ZERO, 1.0), -0.057_432_619_3, -0.057_432_619_3);
        // Closing at 1 m/s along x, neighbour 2 m away along y: t = (2, 1), |t| = 2.236067977,
        // B = 0.782623792, theta = atan2(2, 1) = 1.107148718; d/B = 2.555506259;
        // slowing: (3 B theta)^2 = 6.757103; turning: (2 B theta)^2 = 3.003157.
        let b = 0.35 * 5f64.sqrt();
        let theta = 2f64.atan();
        let slowing = (-2.0 / b - (3.0 * b * theta).powi(2)).exp();
        let turning = (-2.0 / b - (2.0 * b * theta).powi(2)).exp();
        let (tx, ty) = (2.0 / 5f64.sqrt(), 1.0 / 5f64.sqrt());
        let force = social(Vec2::new(0.0, 2.0), Vec2::new(1.0, 0.0), 1.0);
        assert_near(force, -slowing * tx + turning * ty, -slowing * ty - turning * tx);
        assert!((slowing - 9.02787e-5).abs() < 1e-9 && (turning - 3.853925e-3).abs() < 1e-8);
        assert!(force.x > 0.0 && force.y < 0.0, "turns away from a neighbour on the left");
    }

    #[test]
    fn a_robots_distance_counts_as_a_fifth() {
        let near = social(Vec2::new(0.5, 0.1), Vec2::new(0.3, 0.0), 1.0);
        let robot = social(Vec2::new(2.5, 0.5), Vec2::new(0.3, 0.0), ROBOT_DISTANCE_FACTOR);
        assert_near(robot, near.x, near.y);
    }

    #[test]
    fn social_force_is_finite_everywhere() {
        for offset in [Vec2::ZERO, Vec2::new(1e-300, 0.0), Vec2::new(1.0, 0.0), Vec2::new(1e9, 0.0)] {
            for v_rel in [Vec2::ZERO, Vec2::new(-0.5, 0.0), Vec2::new(3.0, 0.0)] {
                assert!(social(offset, v_rel, 1.0).is_finite());
            }
        }
    }

    #[test]
    fn obstacle_force_is_one_at_the_body_radius_and_falls_by_e_every_fifth_of_a_metre() {
        assert_near(obstacle(Vec2::new(0.35, 0.0), Vec2::ZERO), 1.0, 0.0);
        assert_near(obstacle(Vec2::new(0.0, 0.55), Vec2::ZERO), 0.0, (-1f64).exp());
    }

    #[test]
    fn group_forces_equal_the_formulas_by_hand() {
        // One companion 3 m behind: head turn pi/2, speed 1: gaze -3 pi/2; centre 1.5 m behind > 0.5: -2.
        let force = group(Vec2::ZERO, Vec2::new(1.0, 0.0), 0.0, &[Vec2::new(-3.0, 0.0)]);
        assert_near(force, -3.0 * std::f64::consts::FRAC_PI_2 - 2.0, 0.0);
        // Beside, 0.4 m: within sight, near the centre, pushed away.
        assert_near(group(Vec2::ZERO, Vec2::new(1.0, 0.0), 0.0, &[Vec2::new(0.0, 0.4)]), 0.0, -1.0);
        assert_near(group(Vec2::ZERO, Vec2::new(1.0, 0.0), 0.0, &[]), 0.0, 0.0);
    }
}
