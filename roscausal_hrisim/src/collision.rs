//! When two moving bodies are on collision course, and how risky that is. It is the paper's post-processing; the
//! scripted person uses it as their perception, and the node publishes it as `/hri/risk`.

use crate::geometry::Vec2;

/// A person (A) and what they may collide with (B): positions and velocities in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Position of the person.
    pub position: Vec2,
    /// Velocity of the person.
    pub velocity: Vec2,
    /// Position of the other.
    pub other_position: Vec2,
    /// Velocity of the other.
    pub other_velocity: Vec2,
}

impl Approach {
    /// The distance, and the components of the person's velocity along and across the line to the other.
    fn parts(&self) -> (f64, f64, f64) {
        let offset = self.other_position - self.position;
        let towards = offset.unit();
        (offset.norm(), self.velocity.dot(towards), self.velocity.cross(towards))
    }

    /// Whether the person's position one second ahead lies in the triangle from them to the other, widened by
    /// `size`, and the other is nearer than `safe_distance`.
    pub fn is_collision_course(&self, size: f64, safe_distance: f64) -> bool {
        let (distance, along, across) = self.parts();
        let within = distance > 0.0 && along > 0.0 && along < distance;
        within && distance < safe_distance && across.abs() < size * along / distance
    }

    /// Risk of collision `exp(w + [collision course] (|V_rel|/d + steer))`. `steer` is the distance of the person's
    /// position one second ahead from the nearer side of the triangle.
    pub fn risk(&self, own_weight: f64, size: f64, safe_distance: f64) -> f64 {
        let mut exponent = own_weight;
        if self.is_collision_course(size, safe_distance) {
            let (distance, along, across) = self.parts();
            let relative = (self.other_velocity - self.velocity).norm();
            let to_side =
                (size * along - across.abs() * distance) / (size * size + distance * distance).sqrt();
            exponent += relative / distance + to_side;
        }
        libm::exp(exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ahead(distance: f64, velocity: Vec2) -> Approach {
        let other_position = Vec2::new(distance, 0.0);
        Approach { position: Vec2::ZERO, velocity, other_position, other_velocity: Vec2::new(-0.5, 0.0) }
    }

    #[test]
    fn collision_course_is_the_widened_triangle() {
        assert!(ahead(4.0, Vec2::new(1.0, 0.0)).is_collision_course(2.0, 5.0));
        assert!(!ahead(5.5, Vec2::new(1.0, 0.0)).is_collision_course(2.0, 5.0), "too far");
        assert!(!ahead(4.0, Vec2::new(-1.0, 0.0)).is_collision_course(2.0, 5.0), "walks away");
        assert!(ahead(4.0, Vec2::new(1.0, 0.49)).is_collision_course(2.0, 5.0));
        assert!(!ahead(4.0, Vec2::new(1.0, 0.51)).is_collision_course(2.0, 5.0));
        assert!(!ahead(0.0, Vec2::new(1.0, 0.0)).is_collision_course(2.0, 5.0));
        assert!(!ahead(4.0, Vec2::ZERO).is_collision_course(2.0, 5.0));
    }

    #[test]
    fn risk_equals_the_formula_by_hand() {
        // d = 4, P = (1, 0): |V_rel| = 1.5, side through (0, 0) and (4, 2): distance 2/sqrt(20).
        let expected = (0.1 + 1.5 / 4.0 + 2.0 / 20f64.sqrt()).exp();
        assert!((ahead(4.0, Vec2::new(1.0, 0.0)).risk(0.1, 2.0, 5.0) - expected).abs() < 1e-12);
        assert_eq!(ahead(4.0, Vec2::new(-1.0, 0.0)).risk(0.1, 2.0, 5.0), 0.1f64.exp());
    }
}
