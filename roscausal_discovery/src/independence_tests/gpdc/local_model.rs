//! A cubic model of a function of two variables about a place, fitted to what is known near it, which knows its own error.
//!
//! The second and third derivatives are fitted to the gradients and curvatures at the places around. Each counts as exactly
//! as it was computed and as the terms that the model leaves out allow, with a wide prior: a Bayesian linear regression
//! (Hennig and Kiefel 2013 read quasi-Newton methods so). The posterior variance says how far off a predicted gradient may
//! be.

use super::lbfgsb::{Point, solve};

/// A place where the function was evaluated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// The function and its gradient there.
    pub(super) point: Point<2>,
    /// Errors of the gradient.
    pub(super) errors: [f64; 2],
    /// The second derivative by the second variable, if known.
    pub(super) curvature: Option<f64>,
}

/// Places further away tell nothing.
const FAR: f64 = 1.0;
/// Places that are looked at.
const MOST: usize = 6;
/// Error of a curvature, as a fraction.
const CURVATURE_ERROR: f64 = 0.002;
/// Third and fourth derivatives by logarithms are about as large as the second.
const THIRD: f64 = 3.0;
const FOURTH: f64 = 30.0;
/// Mixed second derivative, as a fraction of the geometric mean of the pure ones.
const MIXED: f64 = 0.5;

/// Coefficients: `f_00, f_01, f_11, f_000, f_001, f_011, f_111`.
const TERMS: usize = 7;
type Row = [f64; TERMS];

/// The model.
pub(super) struct CubicModel {
    at: Seen,
    scales: [f64; 2],
    /// Information matrix of the coefficients, and their mean.
    information: [Row; TERMS],
    mean: Row,
}

/// What the model says of a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Predicted {
    pub(super) value: f64,
    pub(super) gradient: [f64; 2],
    /// Standard deviations of the gradient.
    pub(super) deviations: [f64; 2],
    /// What the minimum of the model is below this place, about.
    pub(super) above_minimum: f64,
    /// What a minimum of the model here is expected to leave to gain, by the error of the gradient.
    pub(super) left: f64,
    /// The least second derivative in any direction.
    pub(super) curvature: f64,
    /// Standard deviation of that.
    pub(super) curvature_deviation: f64,
}

impl CubicModel {
    /// The model about the last place of `trail`; `None` where the fit is singular. `scales`: what the second derivatives may
    /// be.
    pub(super) fn new(trail: &[Seen], scales: [f64; 2]) -> Option<Self> {
        let (at, before) = trail.split_last()?;
        let first = Self::fit(at, before, scales)?;
        // Once more, with the scales that have come out.
        let scale = |term: usize, given: f64| if first.mean[term] > 0.0 { first.mean[term] } else { given };
        Self::fit(at, before, [scale(0, scales[0]), scale(2, scales[1])])
    }

    /// The prediction at `x`; `None` where the model is not convex.
    pub(super) fn predict(&self, x: [f64; 2]) -> Option<Predicted> {
        let at = &self.at;
        let d = [0, 1].map(|i| x[i] - at.point.x[i]);
        let rows = gradient_rows(d);
        let mut variances = [[0.0; 2]; 2];
        let solved = [0, 1].map(|i| solve(&self.information, &rows[i], &[true; TERMS]));
        let neglected = neglected(d, self.scales);
        for i in 0..2 {
            for (j, solved) in solved.iter().enumerate() {
                variances[i][j] = product(&rows[i], solved.as_ref()?);
            }
            variances[i][i] += neglected[i] * neglected[i] + at.errors[i] * at.errors[i];
        }
        let hessian = self.hessian(d);
        let determinant = hessian[0][0] * hessian[1][1] - hessian[0][1] * hessian[0][1];
        if hessian[0][0] <= 0.0 || determinant <= 0.0 {
            return None;
        }
        // The direction of the least second derivative, and the row that gives it from the coefficients.
        let middle = 0.5 * (hessian[0][0] + hessian[1][1]);
        let curvature = determinant / (middle + (middle * middle - determinant).max(0.0).sqrt());
        let angle = 0.5 * libm::atan2(2.0 * hessian[0][1], hessian[0][0] - hessian[1][1]);
        let (v, u) = (libm::cos(angle), -libm::sin(angle));
        let (a, b, c) = (u * u, 2.0 * u * v, v * v);
        let row = [a, b, c, a * d[0], a * d[1] + b * d[0], b * d[1] + c * d[0], c * d[1]];
        let curvature_deviation = product(&row, &solve(&self.information, &row, &[true; TERMS])?).sqrt();
        let left = 0.5
            * (variances[0][0] * hessian[1][1] + variances[1][1] * hessian[0][0]
                - 2.0 * variances[0][1] * hessian[0][1])
            / determinant;
        let [_, _, _, t0, t1, t2, t3] = self.mean;
        let cubes = t0 * d[0].powi(3)
            + 3.0 * t1 * d[0] * d[0] * d[1]
            + 3.0 * t2 * d[0] * d[1] * d[1]
            + t3 * d[1].powi(3);
        let flat = self.hessian([0.0; 2]);
        let squares = flat[0][0] * d[0] * d[0] + 2.0 * flat[0][1] * d[0] * d[1] + flat[1][1] * d[1] * d[1];
        let slope = at.point.gradient[0] * d[0] + at.point.gradient[1] * d[1];
        let gradient = [0, 1].map(|i| at.point.gradient[i] + product(&rows[i], &self.mean));
        let quadratic = |a: [f64; 2]| {
            0.5 * (a[0] * a[0] * hessian[1][1] + a[1] * a[1] * hessian[0][0]
                - 2.0 * a[0] * a[1] * hessian[0][1])
                / determinant
        };
        Some(Predicted {
            above_minimum: quadratic(gradient),
            value: at.point.value + slope + 0.5 * squares + cubes / 6.0,
            gradient,
            deviations: [0, 1].map(|i| variances[i][i].sqrt()),
            left,
            curvature,
            curvature_deviation,
        })
    }

    fn fit(at: &Seen, before: &[Seen], scales: [f64; 2]) -> Option<Self> {
        let [p, q] = scales;
        let mixed = MIXED * (p * q).sqrt();
        let third =
            |k: i32| THIRD * libm::pow(p, 1.0 - f64::from(k) / 3.0) * libm::pow(q, f64::from(k) / 3.0);
        let deviations = [3.0 * p, mixed, 3.0 * q, third(0), third(1), third(2), third(3)];
        let mut information = [[0.0; TERMS]; TERMS];
        let mut sums = [0.0; TERMS];
        for (term, deviation) in deviations.into_iter().enumerate() {
            information[term][term] = 1.0 / (deviation * deviation);
        }
        sums[0] = p * information[0][0];
        sums[2] = q * information[2][2];
        let mut learn = |row: Row, value: f64, deviation: f64| {
            let weight = 1.0 / (deviation * deviation);
            for i in 0..TERMS {
                sums[i] += weight * row[i] * value;
                (0..TERMS).for_each(|j| information[i][j] += weight * row[i] * row[j]);
            }
        };
        if let Some(curvature) = at.curvature {
            learn([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0], curvature, CURVATURE_ERROR * curvature.abs());
        }
        let offset = |seen: &Seen| [0, 1].map(|i| seen.point.x[i] - at.point.x[i]);
        let near = before.iter().rev().filter(|seen| {
            let far = length(offset(seen));
            far <= FAR && far > 0.0 && seen.point.value.is_finite()
        });
        for seen in near.take(MOST) {
            let d = offset(seen);
            let rows = gradient_rows(d);
            let neglected = neglected(d, scales);
            for i in 0..2 {
                let deviation = libm::hypot(libm::hypot(neglected[i], at.errors[i]), seen.errors[i]);
                learn(rows[i], seen.point.gradient[i] - at.point.gradient[i], deviation);
            }
            if let Some(curvature) = seen.curvature {
                let deviation = CURVATURE_ERROR * curvature.abs() + 0.5 * FOURTH * q * length(d).powi(2);
                learn([0.0, 0.0, 1.0, 0.0, 0.0, d[0], d[1]], curvature, deviation);
            }
        }
        let mean = solve(&information, &sums, &[true; TERMS])?;
        Some(Self { at: *at, scales, information, mean })
    }

    /// Second derivatives at an offset.
    fn hessian(&self, d: [f64; 2]) -> [[f64; 2]; 2] {
        let [a, b, c, t0, t1, t2, t3] = self.mean;
        let mixed = b + t1 * d[0] + t2 * d[1];
        [[a + t0 * d[0] + t1 * d[1], mixed], [mixed, c + t2 * d[0] + t3 * d[1]]]
    }
}

/// What the gradient changes by at an offset, by the coefficients.
fn gradient_rows([u, v]: [f64; 2]) -> [Row; 2] {
    [[u, v, 0.0, 0.5 * u * u, u * v, 0.5 * v * v, 0.0], [0.0, u, v, 0.0, 0.5 * u * u, u * v, 0.5 * v * v]]
}

/// What the model neglects of the gradient at an offset: fourth derivatives.
fn neglected(d: [f64; 2], [p, q]: [f64; 2]) -> [f64; 2] {
    let [u, v] = d.map(f64::abs);
    let mixed = MIXED * (p * q).sqrt();
    [(p * u + mixed * v), (mixed * u + q * v)].map(|change| FOURTH / 6.0 * change * length(d).powi(2))
}

/// Largest component of an offset.
fn length([u, v]: [f64; 2]) -> f64 {
    u.abs().max(v.abs())
}

fn product(a: &Row, b: &Row) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A function with third derivatives of its own about a minimum at (1, -0.5), seen without error.
    fn seen([u, v]: [f64; 2], [p, q]: [f64; 2], bend: [f64; 2]) -> Seen {
        let mixed = 0.3 * (p * q).sqrt();
        let value = 0.5 * p * u * u
            + mixed * u * v
            + 0.5 * q * v * v
            + bend[0] * u.powi(3) / 6.0
            + bend[1] * v.powi(3) / 6.0;
        let gradient = [p * u + mixed * v + 0.5 * bend[0] * u * u, mixed * u + q * v + 0.5 * bend[1] * v * v];
        let point = Point { x: [u + 1.0, v - 0.5], value, gradient };
        Seen { point, errors: [1e-9; 2], curvature: Some(q + bend[1] * v) }
    }

    proptest! {
        #[test]
        fn a_prediction_is_off_by_no_more_than_it_says(
            p in 2.0f64..50.0, ratio in 1.0f64..30.0, bends in prop::array::uniform2(-1.0f64..1.0),
            places in prop::array::uniform5(prop::array::uniform2(-0.15f64..0.15)),
        ) {
            let scales = [p, p * ratio];
            let bend = [bends[0] * scales[0], bends[1] * scales[1]];
            let [asked, known @ ..] = places;
            let trail: Vec<_> = known.iter().map(|&place| seen(place, scales, bend)).collect();
            // The scales are those of a poor quasi-Newton matrix.
            let model = CubicModel::new(&trail, [3.0 * scales[0], scales[1]]).unwrap();
            let exact = seen(asked, scales, bend).point;
            if let Some(predicted) = model.predict(exact.x) {
                for i in 0..2 {
                    let off = (predicted.gradient[i] - exact.gradient[i]).abs();
                    prop_assert!(off <= 5.0 * predicted.deviations[i] + 1e-9, "{off:e} {predicted:?}");
                }
            }
        }
    }

    #[test]
    fn a_few_places_tell_the_minimum_and_its_curvature() {
        let look = |place| seen(place, [5.0, 100.0], [4.0, -80.0]);
        let trail = [[0.03, 0.005], [0.015, -0.003], [0.006, 0.001], [0.001, 0.0005]].map(look);
        let model = CubicModel::new(&trail, [20.0, 100.0]).unwrap();
        let minimum = model.predict([1.0, -0.5]).unwrap();
        assert!(minimum.left < 1e-6 && minimum.above_minimum < 1e-6, "{minimum:?}");
        assert!(minimum.curvature > 4.0 * minimum.curvature_deviation, "{minimum:?}");
        assert!((minimum.curvature - 4.52).abs() < 0.2, "{minimum:?}");
    }

    #[test]
    fn from_one_place_no_curvature_is_certain() {
        let alone = [seen([0.2, 0.1], [5.0, 100.0], [0.0; 2])];
        let model = CubicModel::new(&alone, [5.0, 100.0]).unwrap();
        let there = model.predict([1.0, -0.5]);
        assert!(there.is_none_or(|there| there.curvature < 4.0 * there.curvature_deviation));
        assert!(CubicModel::new(&[], [1.0, 1.0]).is_none());
    }
}
