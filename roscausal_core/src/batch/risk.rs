//! The paper's risk of collision (Castri et al., ROS-Causal, HRI 2024).

/// Distances below this count as this, because bodies are not points. Metres.
const NEAREST: f64 = 0.1;

/// Position and velocity of a person or robot, in metres and seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Body {
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Metres per second.
    pub vx: f64,
    /// Metres per second.
    pub vy: f64,
}

impl Body {
    /// A body that moves with speed `v` in the direction `theta`. A body at rest needs no heading.
    pub fn heading(x: f64, y: f64, theta: f64, v: f64) -> Self {
        let (vx, vy) = if v == 0.0 { (0.0, 0.0) } else { (v * libm::cos(theta), v * libm::sin(theta)) };
        Self { x, y, vx, vy }
    }

    /// Metres per second.
    pub fn speed(&self) -> f64 {
        libm::hypot(self.vx, self.vy)
    }
}

/// The versions of the risk. They differ in how the person's own speed `v` counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RiskModel {
    /// As in the paper: `v`.
    Paper,
    /// As in release 1.0: `v`, but only on collision course.
    V1_0,
    /// As in release 1.1: `v / 10`.
    #[default]
    V1_1,
}

roscausal_discovery::words!(RiskModel, "risk_model": Paper "paper", V1_0 "v1_0", V1_1 "v1_1");

/// The exponent of the risk that `a` collides with `b`. It is finite for finite bodies, and NaN where a place or the speed of
/// `a` is unknown: nothing is known of a risk to or from somebody who is not there.
///
/// `a` is on collision course if two things hold: its position one second ahead, P, lies in the triangle from `a`
/// to `b` widened by `obs_size`, and `b` is nearer than `safe_dist`. The exponent then contains the relative speed
/// divided by the distance, and the distance of P to the nearer side of the triangle.
pub fn risk_exponent(a: &Body, b: &Body, model: RiskModel, obs_size: f64, safe_dist: f64) -> f64 {
    let v = a.speed();
    if ![a.x, a.y, b.x, b.y, v].iter().all(|value| value.is_finite()) {
        return f64::NAN;
    }
    let course = collision_course(a, b, obs_size, safe_dist);
    let own = match model {
        RiskModel::Paper => v,
        RiskModel::V1_0 if course.is_none() => 0.0,
        RiskModel::V1_0 => v,
        RiskModel::V1_1 => v / 10.0,
    };
    own + course.unwrap_or(0.0)
}

/// `|V_rel| / d + steer` on collision course, otherwise `None`.
fn collision_course(a: &Body, b: &Body, obs_size: f64, safe_dist: f64) -> Option<f64> {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let d = libm::hypot(dx, dy);
    if d == 0.0 || d >= safe_dist {
        return None;
    }
    let along = (a.vx * dx + a.vy * dy) / d;
    let lateral = ((a.vx * dy - a.vy * dx) / d).abs();
    if !(along > 0.0 && along < d && lateral < obs_size * along / d) {
        return None;
    }
    // Distance of P from the line through `a` and the corner of the triangle beside `b`.
    let steer = (obs_size * along - d * lateral) / libm::hypot(d, obs_size);
    let relative = libm::hypot(b.vx - a.vx, b.vy - a.vy);
    Some(relative / d.max(NEAREST) + steer)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBS: f64 = 2.0;
    const SAFE: f64 = 5.0;

    fn exponent(a: Body, b: Body, model: RiskModel) -> f64 {
        risk_exponent(&a, &b, model, OBS, SAFE)
    }

    #[test]
    fn the_risk_head_on_is_the_one_computed_by_hand() {
        // d = 4, along = 1, lateral = 0, |V_rel| = 1.5, steer = 2 * 1 / sqrt(20).
        let (a, b) = (Body::heading(0.0, 0.0, 0.0, 1.0), Body { x: 4.0, vx: -0.5, ..Body::default() });
        let course = 1.5 / 4.0 + 2.0 / 20f64.sqrt();
        assert!((exponent(a, b, RiskModel::V1_1) - (0.1 + course)).abs() < 1e-12);
        assert!((exponent(a, b, RiskModel::Paper) - (1.0 + course)).abs() < 1e-12);
        assert!((exponent(a, b, RiskModel::V1_0) - (1.0 + course)).abs() < 1e-12);
    }

    #[test]
    fn the_risk_beside_the_middle_is_the_one_computed_by_hand() {
        // A walks along (0.8, 0.2) to a robot at rest at (2, 0): along 0.8, lateral 0.2 < 2 * 0.8 / 2.
        let (a, b) = (Body { vx: 0.8, vy: 0.2, ..Body::default() }, Body { x: 2.0, ..Body::default() });
        let expected = 0.68f64.sqrt() / 10.0 + 0.68f64.sqrt() / 2.0 + (2.0 * 0.8 - 2.0 * 0.2) / 8f64.sqrt();
        assert!((exponent(a, b, RiskModel::V1_1) - expected).abs() < 1e-12);
    }

    #[test]
    fn off_the_course_only_the_own_speed_counts() {
        let a = Body::heading(0.0, 0.0, 0.0, 1.0);
        let behind = Body { x: -3.0, ..Body::default() };
        let far = Body { x: 5.0, ..Body::default() };
        let beside = Body { x: 1.0, y: 4.0, ..Body::default() };
        for b in [behind, far, beside] {
            assert_eq!(exponent(a, b, RiskModel::V1_1), 0.1);
            assert_eq!(exponent(a, b, RiskModel::V1_0), 0.0);
        }
    }

    #[test]
    fn nobody_and_no_robot_have_no_risk() {
        let (here, gone) =
            (Body { vx: 1.0, ..Body::default() }, Body::heading(f64::NAN, f64::NAN, f64::NAN, f64::NAN));
        let unknown_speed = Body { vx: f64::NAN, ..Body::default() };
        for model in [RiskModel::Paper, RiskModel::V1_0, RiskModel::V1_1] {
            for (a, b) in [(here, gone), (gone, here), (unknown_speed, Body { x: 2.0, ..here })] {
                assert!(exponent(a, b, model).is_nan(), "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn equal_places_and_bodies_at_rest_have_a_finite_risk() {
        let rest = Body::default();
        assert_eq!(exponent(rest, rest, RiskModel::Paper), 0.0);
        let near = Body { x: 1e-9, vx: 3.0, ..Body::default() };
        let creeping = Body { vx: 1e-10, ..Body::default() };
        assert!(exponent(creeping, near, RiskModel::Paper).exp().is_finite());
        assert_eq!(Body::heading(1.0, 2.0, f64::NAN, 0.0).speed(), 0.0);
    }
}
