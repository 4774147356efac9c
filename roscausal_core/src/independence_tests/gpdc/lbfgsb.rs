//! L-BFGS-B: minimisation within bounds by a limited-memory quasi-Newton method (Byrd, Lu, Nocedal and Zhu 1995,
//! with the projected subspace step of Morales and Nocedal 2011), for a handful of variables.
//!
//! A Gaussian process likelihood has several maxima, and which one is found depends on the path. The iterates
//! here follow the published method step by step, so they take the path that other faithful implementations
//! take. For few variables the quasi-Newton matrix is held dense: it is the same matrix as the compact
//! representation of the papers, built from the same at most `M` pairs.

use super::line_search::{LineSearch, Step};

/// Pairs of steps and gradient differences that are remembered.
const M: usize = 10;
/// Evaluations that one line search may take.
const MAX_LINE_EVALUATIONS: usize = 20;

/// Share of the decrease at which to stop that a step taken unseen may leave to gain. What it leaves is foretold well
/// only near the minimum: where the step itself gains no more than so many times that decrease, and no component of the
/// gradient is more than this share of what it was (in a valley one of them stays).
const UNSEEN: f64 = 0.3;
const NEAR: f64 = 30.0;
const FALLEN: f64 = 0.7;

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
}

impl<const N: usize> Point<N> {
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

/// Minimises `f` (value, gradient, and how far off the value may be) within `bounds` from `start`; returns the best point.
///
/// # Errors
/// Whatever `f` fails with.
pub(super) fn minimize<const N: usize, E>(
    mut f: impl FnMut([f64; N]) -> Result<(f64, [f64; N], f64), E>,
    start: [f64; N],
    bounds: &Bounds<N>,
    tolerances: &Tolerances,
) -> Result<Point<N>, E> {
    let mut evaluate =
        |x: [f64; N]| f(x).map(|(value, gradient, uncertainty)| Point { x, value, gradient, uncertainty });
    let mut at = evaluate(bounds.clamp(start))?;
    let mut memory = Memory::new();
    let mut first = true;
    let mut iteration = 0;
    let mut gain_before = 0.0;
    let mut gradient_before = [0.0; N];
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
        let step: [f64; N] = std::array::from_fn(|i| target[i] - at.x[i]);
        let gain = -0.5 * dot(&at.gradient, &step);
        let scale = at.value.abs().max(1.0);
        let enough = tolerances.relative_decrease * scale;
        // Steps gain less and less, and faster and faster so: what the one after this would gain.
        let gain_after = if gain < gain_before { gain * gain / gain_before } else { gain };
        gain_before = gain;
        let fallen = (0..N).all(|i| at.gradient[i].abs() <= FALLEN * f64::abs(gradient_before[i]));
        let leaves_nothing = fallen && gain <= NEAR * enough && gain_after <= UNSEEN * enough;
        if !memory.pairs.is_empty() && gain >= 0.0 && (gain <= enough || leaves_nothing) {
            // The step gains less than would be asked of it, or leaves nothing to gain: it is taken unseen.
            return Ok(Point { x: target, value: at.value - gain, ..at });
        }
        let next = match line_minimum(&mut evaluate, &at, target, bounds, first)? {
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
        gradient_before = at.gradient;
        at = next;
        if converged {
            break;
        }
    }
    Ok(at)
}

/// Searches the segment from `at` towards `target` for a point with enough decrease.
fn line_minimum<const N: usize, E>(
    evaluate: &mut impl FnMut([f64; N]) -> Result<Point<N>, E>,
    at: &Point<N>,
    target: [f64; N],
    bounds: &Bounds<N>,
    first: bool,
) -> Result<Option<Point<N>>, E> {
    let direction: [f64; N] = std::array::from_fn(|i| target[i] - at.x[i]);
    let slope = dot(&at.gradient, &direction);
    if slope >= 0.0 || !slope.is_finite() {
        return Ok(None);
    }
    let longest = if first { 1.0 } else { bounds.longest_step(&at.x, &direction) };
    let mut search = LineSearch::new(at.value, slope, 1.0, longest);
    // Both bounds of every variable are finite: the first step is 1 as well, not 1/|gradient|.
    let mut length = 1.0;
    for _ in 0..MAX_LINE_EVALUATIONS {
        let x = if length == 1.0 {
            target
        } else {
            bounds.clamp(std::array::from_fn(|i| at.x[i] + length * direction[i]))
        };
        let point = evaluate(x)?;
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
fn solve<const N: usize>(matrix: &[[f64; N]; N], rhs: &[f64; N], free: &[bool; N]) -> Option<[f64; N]> {
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

    fn rosenbrock([a, b]: [f64; 2]) -> Result<(f64, [f64; 2], f64), ()> {
        let (u, v) = (b - a * a, 1.0 - a);
        Ok((100.0 * u * u + v * v, [-400.0 * a * u - 2.0 * v, 200.0 * u], 0.0))
    }

    #[test]
    fn the_minimum_inside_is_found() {
        let bounds = Bounds { lower: [-5.0; 2], upper: [5.0; 2] };
        let tight = Tolerances { relative_decrease: 0.0, projected_gradient: 1e-9, max_iterations: 500 };
        let end = minimize(rosenbrock, [-1.2, 1.0], &bounds, &tight).unwrap();
        assert!(end.x.iter().all(|x| (x - 1.0).abs() < 1e-8), "{end:?}");
    }

    #[test]
    fn a_minimum_on_the_bound_stays_on_it() {
        let bounds = Bounds { lower: [-2.0, -2.0], upper: [0.5, 2.0] };
        let end = minimize(rosenbrock, [-1.0, 1.5], &bounds, &Tolerances::default()).unwrap();
        assert_eq!(end.x[0], 0.5);
        assert!((end.x[1] - 0.25).abs() < 1e-5, "{end:?}");
    }

    #[test]
    fn every_trial_is_within_bounds() {
        let bounds = Bounds { lower: [-1.5, -0.5], upper: [1.5, 3.0] };
        let inside = |x: [f64; 2]| (0..2).all(|i| (bounds.lower[i]..=bounds.upper[i]).contains(&x[i]));
        let watched = |x: [f64; 2]| if inside(x) { rosenbrock(x) } else { Err(()) };
        for start in [[-1.5, -0.5], [1.5, 3.0], [0.0, 0.0], [-1.2, 1.0]] {
            assert!(minimize(watched, start, &bounds, &Tolerances::default()).is_ok());
        }
    }
}
