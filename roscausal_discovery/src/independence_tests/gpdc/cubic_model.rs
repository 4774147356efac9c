//! What is left of a minimisation in two variables, foretold by a cubic model of the function about the last point.
//!
//! The model's second and third derivatives are fitted to the gradients and curvatures at the points before, each as
//! exact as the terms that the model lacks and the function's own errors let it be, with a wide prior: a Bayesian linear
//! regression (Hennig and Kiefel 2013 read quasi-Newton methods so). So the model knows how far off it may be.

use super::lbfgsb::{Foretold, Point, solve};

/// Points further away tell nothing.
const FAR: f64 = 1.0;
/// Points that are looked at.
const MOST: usize = 6;
/// Longest step that is foretold.
const LONGEST: f64 = 0.5;
/// Error of a curvature, as a share.
const CURVATURE_ERROR: f64 = 0.002;
/// Third and fourth derivatives by logarithms are about as large as the second.
const THIRD: f64 = 1.0;
const FOURTH: f64 = 1.0;
/// Mixed second derivative, as a share of the geometric mean of the pure ones.
const MIXED: f64 = 0.5;

/// Coefficients: `f_00, f_01, f_11, f_000, f_001, f_011, f_111`.
const TERMS: usize = 7;
type Row = [f64; TERMS];

/// The next step from the last point of `trail`; `None` where the model has no minimum near. `scales`: what the second
/// derivatives may be.
pub(super) fn foretell(trail: &[Point<2>], scales: [f64; 2]) -> Option<Foretold<2>> {
    let (at, before) = trail.split_last()?;
    let first = Model::fit(at, before, scales)?;
    // Once more, with what has turned out of the scales.
    let scale = |term: usize, given: f64| if first.mean[term] > 0.0 { first.mean[term] } else { given };
    let model = Model::fit(at, before, [scale(0, scales[0]), scale(2, scales[1])])?;
    model.minimum(at)
}

struct Model {
    scales: [f64; 2],
    /// Information matrix of the coefficients, and their mean.
    information: [Row; TERMS],
    mean: Row,
}

impl Model {
    fn fit(at: &Point<2>, before: &[Point<2>], scales: [f64; 2]) -> Option<Self> {
        let [p, q] = scales;
        let mixed = MIXED * (p * q).sqrt();
        let third = |k: i32| THIRD * p.powf(1.0 - f64::from(k) / 3.0) * q.powf(f64::from(k) / 3.0);
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
        let offset = |point: &Point<2>| [point.x[0] - at.x[0], point.x[1] - at.x[1]];
        let near = before.iter().rev().filter(|point| {
            let far = length(offset(point));
            far <= FAR && far > 0.0 && point.value.is_finite()
        });
        for point in near.take(MOST) {
            let d = offset(point);
            let rows = gradient_rows(d);
            let lacking = lacking(d, scales);
            for i in 0..2 {
                let deviation = lacking[i].hypot(at.errors[i]).hypot(point.errors[i]);
                learn(rows[i], point.gradient[i] - at.gradient[i], deviation);
            }
            if let Some(curvature) = point.curvature {
                let deviation = CURVATURE_ERROR * curvature.abs() + 0.5 * FOURTH * q * length(d).powi(2);
                learn([0.0, 0.0, 1.0, 0.0, 0.0, d[0], d[1]], curvature, deviation);
            }
        }
        let mean = solve(&information, &sums, &[true; TERMS])?;
        Some(Self { scales, information, mean })
    }

    fn minimum(&self, at: &Point<2>) -> Option<Foretold<2>> {
        let mut d = [0.0; 2];
        for _ in 0..8 {
            let rows = gradient_rows(d);
            let rest = [0, 1].map(|i| -at.gradient[i] - product(&rows[i], &self.mean));
            let step = solve(&self.hessian(d), &rest, &[true; 2])?;
            d = [d[0] + step[0], d[1] + step[1]];
            if length(d) > LONGEST {
                return None;
            }
        }
        let hessian = self.hessian(d);
        let rows = gradient_rows(d);
        let mut variances = [[0.0; 2]; 2];
        let solved = [0, 1].map(|i| solve(&self.information, &rows[i], &[true; TERMS]));
        let lacking = lacking(d, self.scales);
        for i in 0..2 {
            for (j, solved) in solved.iter().enumerate() {
                variances[i][j] = product(&rows[i], solved.as_ref()?);
            }
            variances[i][i] += lacking[i] * lacking[i] + at.errors[i] * at.errors[i];
        }
        let determinant = hessian[0][0] * hessian[1][1] - hessian[0][1] * hessian[0][1];
        if hessian[0][0] <= 0.0 || determinant <= 0.0 {
            // Not a minimum: what the step leaves would come out below nothing.
            return None;
        }
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
        let gain = -(at.gradient[0] * d[0] + at.gradient[1] * d[1] + 0.5 * squares + cubes / 6.0);
        let target = [at.x[0] + d[0], at.x[1] + d[1]];
        let curvature = determinant / hessian[0][0].max(hessian[1][1]);
        let steepness = variances[0][0].max(variances[1][1]).sqrt();
        (gain >= 0.0 && left.is_finite()).then_some(Foretold { target, gain, left, steepness, curvature })
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

/// What the model may lack of the gradient at an offset: fourth derivatives.
fn lacking(d: [f64; 2], [p, q]: [f64; 2]) -> [f64; 2] {
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

    /// A function with third derivatives of its own about a minimum, seen without error.
    fn seen([a, b]: [f64; 2], minimum: [f64; 2], [p, q]: [f64; 2], bend: [f64; 2]) -> Point<2> {
        let [u, v] = [a - minimum[0], b - minimum[1]];
        let mixed = 0.3 * (p * q).sqrt();
        let value = 0.5 * p * u * u
            + mixed * u * v
            + 0.5 * q * v * v
            + bend[0] * u.powi(3) / 6.0
            + bend[1] * v.powi(3) / 6.0;
        let gradient = [p * u + mixed * v + 0.5 * bend[0] * u * u, mixed * u + q * v + 0.5 * bend[1] * v * v];
        let curvature = Some(q + bend[1] * v);
        Point { x: [a, b], value, gradient, uncertainty: 0.0, errors: [1e-9; 2], curvature }
    }

    proptest! {
        #[test]
        fn the_minimum_is_foretold_and_so_is_what_the_step_leaves(
            p in 2.0f64..50.0, ratio in 1.0f64..30.0, bends in prop::array::uniform2(-1.0f64..1.0),
            places in prop::array::uniform4(prop::array::uniform2(-0.15f64..0.15)),
        ) {
            let (minimum, scales) = ([1.0, -0.5], [p, p * ratio]);
            let bend = [bends[0] * scales[0], bends[1] * scales[1]];
            let look = |offset: [f64; 2]| seen([minimum[0] + offset[0], minimum[1] + offset[1]], minimum, scales, bend);
            let trail: Vec<_> = places.map(look).to_vec();
            // The scales are those of a poor quasi-Newton matrix.
            if let Some(step) = foretell(&trail, [3.0 * scales[0], scales[1]]) {
                let left = seen(step.target, minimum, scales, bend).value;
                let start = trail[3].value;
                prop_assert!(left <= 10.0 * step.left + 1e-9 * start, "{left:e} of {start:e}: {step:?}");
                prop_assert!((step.gain - (start - left)).abs() <= 10.0 * step.left + 0.5 * start, "{left:e} of {start:e}: {step:?}");
            }
        }
    }

    #[test]
    fn a_few_points_foretell_the_minimum() {
        let look = |place| seen(place, [0.0, 0.0], [5.0, 100.0], [4.0, -80.0]);
        let trail = [[0.3, 0.05], [0.15, -0.03], [0.06, 0.01]].map(look);
        let step = foretell(&trail, [20.0, 100.0]).unwrap();
        assert!(look(step.target).value < 1e-3 * trail[2].value, "{step:?}");
        assert!(step.left < 0.05 * step.gain, "{step:?}");
    }

    #[test]
    fn from_one_point_nothing_is_trusted() {
        let alone = [seen([0.2, 0.1], [0.0, 0.0], [5.0, 100.0], [0.0; 2])];
        assert!(foretell(&alone, [5.0, 100.0]).is_none_or(|step| step.left > 0.1 * step.gain));
        assert!(foretell(&[], [1.0, 1.0]).is_none());
    }
}
