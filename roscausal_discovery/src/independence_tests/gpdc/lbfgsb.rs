//! L-BFGS-B: minimisation within bounds by a limited-memory quasi-Newton method (Byrd, Lu, Nocedal and Zhu 1995,
//! with the projected subspace step of Morales and Nocedal 2011), for a handful of variables.
//!
//! A Gaussian process likelihood has several maxima, and which one is found depends on the path. The iterates
//! here follow the published method step by step, so they take the path that other faithful implementations
//! take. For few variables the quasi-Newton matrix is held dense: it is the same matrix as the compact
//! representation of the papers, built from the same at most `M` pairs.

use std::cell::RefCell;

use super::line_search::{LineSearch, Step};

/// Pairs of steps and gradient differences that are remembered.
const M: usize = 10;
/// Evaluations that one line search may take.
const MAX_LINE_EVALUATIONS: usize = 20;
/// How far off a gradient may be, as a share of the one that is foretold.
const ERROR_SHARE: f64 = 0.06;
/// Share of the decrease at which to stop that the last step may be expected to leave to gain, if it is taken unseen; and
/// share of that which the error of a gradient may leave, however small the gradient is.
const UNSEEN: f64 = 0.15;
const LEAST_ERROR: f64 = 0.05;
/// Gain up to which a step is foretold: further away another step than the quasi-Newton one may lead to another minimum.
const NEAR: f64 = 0.01;
/// Share of its gain that a foretold step may leave.
const TRUSTED: f64 = 0.05;

/// What is foretold of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foretold<const N: usize> {
    /// Its end.
    pub(super) target: [f64; N],
    /// What it gains.
    pub(super) gain: f64,
    /// What it is expected to leave to gain.
    pub(super) left: f64,
    /// Largest component of the gradient that is to be expected at its end.
    pub(super) steepness: f64,
    /// The least second derivative there.
    pub(super) curvature: f64,
}

impl<const N: usize> Foretold<N> {
    /// The step to the minimum `target` of a quadratic function.
    fn by_quadratic(at: &Point<N>, target: [f64; N]) -> Self {
        let step: [f64; N] = std::array::from_fn(|i| target[i] - at.x[i]);
        Self {
            target,
            gain: -0.5 * dot(&at.gradient, &step),
            left: f64::INFINITY,
            steepness: f64::INFINITY,
            curvature: 0.0,
        }
    }
}

/// How exact a gradient is to be that is foretold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exactness {
    /// How far off it may be.
    pub(super) error: f64,
    /// How far off one may be however small it is.
    pub(super) least: f64,
}

impl Exactness {
    /// That for a gradient whose largest component is `steepness`.
    fn of(steepness: f64, least: f64) -> Self {
        Self { error: (ERROR_SHARE * steepness).max(least), least }
    }

    /// The error that a gradient may have which has turned out to be as small as that.
    pub(super) fn after(&self, steepness: f64) -> f64 {
        Self::of(steepness, self.least).error
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerances {
    /// Relative decrease of the function in one iteration: `(f_k - f_k+1) / max(|f_k|, |f_k+1|, 1)`.
    pub(super) relative_decrease: f64,
    /// Largest component of the projected gradient.
    pub(super) projected_gradient: f64,
    /// Iterations.
    pub(super) max_iterations: usize,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self { relative_decrease: 1e7 * f64::EPSILON, projected_gradient: 1e-5, max_iterations: 15_000 }
    }
}

/// A point that was evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point<const N: usize> {
    /// Where.
    pub(super) x: [f64; N],
    /// The function there.
    pub(super) value: f64,
    /// Its gradient there.
    pub(super) gradient: [f64; N],
    /// How far off the value may be.
    pub(super) uncertainty: f64,
    /// How far off the gradient may be.
    pub(super) errors: [f64; N],
    /// Its second derivative there by the last variable, if known.
    pub(super) curvature: Option<f64>,
}

impl<const N: usize> Point<N> {
    /// Largest component of the gradient.
    fn steepness(&self) -> f64 {
        self.gradient.iter().fold(0.0, |largest, g| g.abs().max(largest))
    }

    /// What the function gains up to `to`. Where the values are too uncertain to tell, the gradients at both ends tell it:
    /// exactly where the function is quadratic (as in the line searches of Hager and Zhang 2005, section 2).
    fn rise(&self, to: &Self) -> f64 {
        let rise = to.value - self.value;
        if rise.abs() > self.uncertainty + to.uncertainty {
            return rise;
        }
        (0..N).map(|i| 0.5 * (self.gradient[i] + to.gradient[i]) * (to.x[i] - self.x[i])).sum()
    }
}

/// A box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds<const N: usize> {
    /// Smallest values allowed, finite.
    pub(super) lower: [f64; N],
    /// Largest values allowed, finite.
    pub(super) upper: [f64; N],
}

/// Minimises `f` within `bounds` from `start`; returns the best point. Near the end the steps are those that `foretell` makes
/// of the points evaluated so far and the second derivatives that the quasi-Newton matrix has.
///
/// # Errors
/// Whatever `f` fails with.
pub(super) fn minimize<const N: usize, E>(
    mut f: impl FnMut([f64; N], Option<Exactness>) -> Result<Point<N>, E>,
    foretell: impl Fn(&[Point<N>], [f64; N]) -> Option<Foretold<N>>,
    start: [f64; N],
    bounds: &Bounds<N>,
    tolerances: &Tolerances,
) -> Result<Point<N>, E> {
    let trail = RefCell::new(Vec::new());
    let mut evaluate = |x: [f64; N], exactness: Option<Exactness>| {
        let point = f(x, exactness)?;
        trail.borrow_mut().push(point);
        Ok(point)
    };
    let mut at = evaluate(bounds.clamp(start), None)?;
    let mut memory = Memory::new();
    let mut first = true;
    let mut iteration = 0;
    while iteration < tolerances.max_iterations
        && bounds.projected_gradient(&at) > tolerances.projected_gradient
    {
        let Some(target) = bounds.subspace_minimum(&at, &memory) else {
            if memory.pairs.is_empty() {
                return Ok(at);
            }
            memory = Memory::new();
            continue;
        };
        let scale = at.value.abs().max(1.0);
        let enough = tolerances.relative_decrease * scale;
        let mut step = Foretold::by_quadratic(&at, target);
        if !memory.pairs.is_empty() {
            let scales = std::array::from_fn(|i| memory.matrix[i][i]);
            let trusted = |step: &Foretold<N>| {
                step.gain <= NEAR
                    && step.left <= TRUSTED * step.gain
                    && bounds.clamp(step.target) == step.target
            };
            step = foretell(&trail.borrow(), scales).filter(trusted).unwrap_or(step);
            let leaves_nothing = step.left <= UNSEEN * enough;
            if step.gain >= 0.0 && (step.gain <= enough || leaves_nothing) {
                // The step gains less than would be asked of it, or leaves nothing to gain: it is taken unseen.
                return Ok(Point { x: step.target, value: at.value - step.gain, ..at });
            }
        }
        let smallest = trail.borrow().iter().map(Point::steepness).fold(step.steepness, f64::min);
        // Such an error leaves a share of what may be left.
        let least = (2.0 * LEAST_ERROR * UNSEEN * enough * step.curvature).sqrt();
        let exactness = step.left.is_finite().then(|| Exactness::of(smallest, least));
        let next = match line_minimum(&mut evaluate, &at, &step, exactness, bounds, first)? {
            Some(next) => next,
            // A failed search from the steepest descent direction ends it; from another one the memory is
            // misleading and is emptied.
            None if memory.pairs.is_empty() => return Ok(at),
            None => {
                memory = Memory::new();
                continue;
            }
        };
        first = false;
        iteration += 1;
        let scale = at.value.abs().max(next.value.abs()).max(1.0);
        let enough = tolerances.relative_decrease * scale;
        let converged =
            bounds.projected_gradient(&next) <= tolerances.projected_gradient || -at.rise(&next) <= enough;
        memory.remember(&at, &next);
        at = next;
        if converged {
            break;
        }
    }
    Ok(at)
}

/// Searches along a step from `at` for a point with enough decrease.
fn line_minimum<const N: usize, E>(
    evaluate: &mut impl FnMut([f64; N], Option<Exactness>) -> Result<Point<N>, E>,
    at: &Point<N>,
    step: &Foretold<N>,
    exactness: Option<Exactness>,
    bounds: &Bounds<N>,
    first: bool,
) -> Result<Option<Point<N>>, E> {
    let direction: [f64; N] = std::array::from_fn(|i| step.target[i] - at.x[i]);
    let slope = dot(&at.gradient, &direction);
    if slope >= 0.0 || !slope.is_finite() {
        return Ok(None);
    }
    let longest = if first { 1.0 } else { bounds.longest_step(&at.x, &direction) };
    let mut search = LineSearch::new(at.value, slope, 1.0, longest);
    // Both bounds of every variable are finite: the first step is 1 as well, not 1/|gradient|.
    let mut length = 1.0;
    for _ in 0..MAX_LINE_EVALUATIONS {
        let (x, exactness) = if length == 1.0 {
            (step.target, exactness)
        } else {
            (bounds.clamp(std::array::from_fn(|i| at.x[i] + length * direction[i])), None)
        };
        let point = evaluate(x, exactness)?;
        match search.next(at.value + at.rise(&point), dot(&point.gradient, &direction)) {
            Step::Try(next) => length = next,
            Step::Done => return Ok(Some(point)),
            Step::Failed => return Ok(None),
        }
    }
    Ok(None)
}

/// The quasi-Newton matrix and the pairs it is made of.
struct Memory<const N: usize> {
    /// Step, gradient difference.
    pairs: Vec<([f64; N], [f64; N])>,
    matrix: [[f64; N]; N],
}

impl<const N: usize> Memory<N> {
    fn new() -> Self {
        Self { pairs: Vec::new(), matrix: scaled_identity(1.0) }
    }

    fn remember(&mut self, old: &Point<N>, new: &Point<N>) {
        let step: [f64; N] = std::array::from_fn(|i| new.x[i] - old.x[i]);
        let change: [f64; N] = std::array::from_fn(|i| new.gradient[i] - old.gradient[i]);
        let curvature = dot(&step, &change);
        if curvature <= f64::EPSILON * -dot(&old.gradient, &step) {
            return;
        }
        if self.pairs.len() == M {
            self.pairs.remove(0);
        }
        self.pairs.push((step, change));
        self.matrix = scaled_identity(dot(&change, &change) / curvature);
        for (s, y) in &self.pairs {
            update(&mut self.matrix, s, y);
        }
        let positive = |i: usize| self.matrix[i][i] > 0.0 && self.matrix[i].iter().all(|v| v.is_finite());
        if !(0..N).all(positive) {
            *self = Self::new();
        }
    }
}

/// The BFGS update of `matrix` by one pair.
fn update<const N: usize>(matrix: &mut [[f64; N]; N], step: &[f64; N], change: &[f64; N]) {
    let product = times(matrix, step);
    let (curvature, old_curvature) = (dot(step, change), dot(step, &product));
    for i in 0..N {
        for j in 0..N {
            matrix[i][j] += change[i] * change[j] / curvature - product[i] * product[j] / old_curvature;
        }
    }
}

impl<const N: usize> Bounds<N> {
    fn clamp(&self, x: [f64; N]) -> [f64; N] {
        std::array::from_fn(|i| x[i].clamp(self.lower[i], self.upper[i]))
    }

    /// Largest component of the projected gradient.
    fn projected_gradient(&self, at: &Point<N>) -> f64 {
        let component = |i: usize| {
            let (x, g) = (at.x[i], at.gradient[i]);
            if g < 0.0 { g.max(x - self.upper[i]) } else { g.min(x - self.lower[i]) }.abs()
        };
        (0..N).map(component).fold(0.0, f64::max)
    }

    /// Longest multiple of `direction` that stays inside.
    fn longest_step(&self, x: &[f64; N], direction: &[f64; N]) -> f64 {
        let mut longest = 1e10_f64;
        for i in 0..N {
            let room = if direction[i] < 0.0 { self.lower[i] - x[i] } else { self.upper[i] - x[i] };
            if direction[i] < 0.0 && room >= 0.0 || direction[i] > 0.0 && room <= 0.0 {
                longest = 0.0;
            } else if direction[i] != 0.0 && (direction[i] * longest).abs() > room.abs() {
                longest = room / direction[i];
            }
        }
        longest
    }

    /// First minimum of the quadratic model along the projected gradient path (Byrd et al. 1995, section 4):
    /// the point, and for each variable whether it is free there.
    fn cauchy_point(&self, at: &Point<N>, memory: &Memory<N>) -> ([f64; N], [bool; N]) {
        let (x, g) = (&at.x, &at.gradient);
        let breakpoint = |i: usize| match g[i] {
            slope if slope < 0.0 => (x[i] - self.upper[i]) / slope,
            slope if slope > 0.0 => (x[i] - self.lower[i]) / slope,
            _ => f64::INFINITY,
        };
        let breaks: [f64; N] = std::array::from_fn(breakpoint);
        let mut direction: [f64; N] = std::array::from_fn(|i| if breaks[i] > 0.0 { -g[i] } else { 0.0 });
        let mut free: [bool; N] = std::array::from_fn(|i| breaks[i] > 0.0 || g[i] == 0.0);
        let mut order: Vec<usize> = (0..N).filter(|&i| direction[i] != 0.0).collect();
        order.sort_by(|&a, &b| breaks[a].total_cmp(&breaks[b]));
        let mut moved = [0.0; N];
        let mut slope = -dot(&direction, &direction);
        let mut curvature = dot(&direction, &times(&memory.matrix, &direction));
        let least_curvature = f64::EPSILON * curvature;
        let mut passed = 0.0;
        let mut to_minimum = -slope / curvature;
        for (k, &i) in order.iter().enumerate() {
            let length = breaks[i] - passed;
            if to_minimum < length {
                break;
            }
            (0..N).for_each(|j| moved[j] += length * direction[j]);
            passed = breaks[i];
            moved[i] = if direction[i] > 0.0 { self.upper[i] } else { self.lower[i] } - x[i];
            direction[i] = 0.0;
            free[i] = false;
            if k + 1 == order.len() {
                to_minimum = 0.0;
                break;
            }
            let model_gradient = times(&memory.matrix, &moved);
            slope = dot(g, &direction) + dot(&model_gradient, &direction);
            curvature = dot(&direction, &times(&memory.matrix, &direction)).max(least_curvature);
            to_minimum = -slope / curvature;
        }
        let to_minimum = to_minimum.max(0.0);
        let point = std::array::from_fn(|i| {
            let end = moved[i] + to_minimum * direction[i];
            if end == self.upper[i] - x[i] {
                self.upper[i]
            } else if end == self.lower[i] - x[i] {
                self.lower[i]
            } else {
                x[i] + end
            }
        });
        (point, free)
    }

    /// The Cauchy point, moved to the minimum of the model over the variables that are free there. `None` when
    /// the model is not convex.
    fn subspace_minimum(&self, at: &Point<N>, memory: &Memory<N>) -> Option<[f64; N]> {
        let (cauchy, free) = self.cauchy_point(at, memory);
        if memory.pairs.is_empty() || !free.contains(&true) {
            return Some(cauchy);
        }
        let moved: [f64; N] = std::array::from_fn(|i| cauchy[i] - at.x[i]);
        let product = times(&memory.matrix, &moved);
        let residual: [f64; N] =
            std::array::from_fn(|i| if free[i] { -(at.gradient[i] + product[i]) } else { 0.0 });
        let newton = solve(&memory.matrix, &residual, &free)?;
        let projected = self.clamp(std::array::from_fn(|i| cauchy[i] + newton[i]));
        let inside = (0..N).all(|i| projected[i] == cauchy[i] + newton[i]);
        let whole: [f64; N] = std::array::from_fn(|i| projected[i] - at.x[i]);
        if inside || dot(&whole, &at.gradient) <= 0.0 {
            return Some(projected);
        }
        // The projection is no descent direction: cut the step at the first bound instead.
        let cut = self.longest_step(&cauchy, &newton).min(1.0);
        Some(self.clamp(std::array::from_fn(|i| cauchy[i] + cut * newton[i])))
    }
}

/// Solves the rows and columns of `matrix` that are `free` by Cholesky; zero elsewhere.
pub(super) fn solve<const N: usize>(
    matrix: &[[f64; N]; N],
    rhs: &[f64; N],
    free: &[bool; N],
) -> Option<[f64; N]> {
    let index: Vec<usize> = (0..N).filter(|&i| free[i]).collect();
    let mut factor = [[0.0; N]; N];
    let mut x = [0.0; N];
    for (a, &i) in index.iter().enumerate() {
        for (b, &j) in index[..=a].iter().enumerate() {
            let rest = matrix[i][j] - (0..b).map(|k| factor[a][k] * factor[b][k]).sum::<f64>();
            if a != b {
                factor[a][b] = rest / factor[b][b];
            } else if rest > 0.0 {
                factor[a][a] = rest.sqrt();
            } else {
                return None;
            }
        }
        x[i] = (rhs[i] - (0..a).map(|k| factor[a][k] * x[index[k]]).sum::<f64>()) / factor[a][a];
    }
    for (a, &i) in index.iter().enumerate().rev() {
        x[i] = (x[i] - (a + 1..index.len()).map(|k| factor[k][a] * x[index[k]]).sum::<f64>()) / factor[a][a];
    }
    Some(x)
}

fn scaled_identity<const N: usize>(scale: f64) -> [[f64; N]; N] {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { scale } else { 0.0 }))
}

fn times<const N: usize>(matrix: &[[f64; N]; N], x: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| dot(&matrix[i], x))
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rosenbrock([a, b]: [f64; 2], _: Option<Exactness>) -> Result<Point<2>, ()> {
        let (u, v) = (b - a * a, 1.0 - a);
        let gradient = [-400.0 * a * u - 2.0 * v, 200.0 * u];
        Ok(Point {
            x: [a, b],
            value: 100.0 * u * u + v * v,
            gradient,
            uncertainty: 0.0,
            errors: [0.0; 2],
            curvature: None,
        })
    }

    fn nothing(_: &[Point<2>], _: [f64; 2]) -> Option<Foretold<2>> {
        None
    }

    #[test]
    fn the_minimum_inside_is_found() {
        let bounds = Bounds { lower: [-5.0; 2], upper: [5.0; 2] };
        let tight = Tolerances { relative_decrease: 0.0, projected_gradient: 1e-9, max_iterations: 500 };
        let end = minimize(rosenbrock, nothing, [-1.2, 1.0], &bounds, &tight).unwrap();
        assert!(end.x.iter().all(|x| (x - 1.0).abs() < 1e-8), "{end:?}");
    }

    #[test]
    fn a_minimum_on_the_bound_stays_on_it() {
        let bounds = Bounds { lower: [-2.0, -2.0], upper: [0.5, 2.0] };
        let end = minimize(rosenbrock, nothing, [-1.0, 1.5], &bounds, &Tolerances::default()).unwrap();
        assert_eq!(end.x[0], 0.5);
        assert!((end.x[1] - 0.25).abs() < 1e-5, "{end:?}");
    }

    #[test]
    fn every_trial_is_within_bounds() {
        let bounds = Bounds { lower: [-1.5, -0.5], upper: [1.5, 3.0] };
        let inside = |x: [f64; 2]| (0..2).all(|i| (bounds.lower[i]..=bounds.upper[i]).contains(&x[i]));
        let watched = |x: [f64; 2], exactness| if inside(x) { rosenbrock(x, exactness) } else { Err(()) };
        for start in [[-1.5, -0.5], [1.5, 3.0], [0.0, 0.0], [-1.2, 1.0]] {
            assert!(minimize(watched, nothing, start, &bounds, &Tolerances::default()).is_ok());
        }
    }
}
