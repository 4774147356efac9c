//! L-BFGS-B: minimisation within bounds by a limited-memory quasi-Newton method (Byrd, Lu, Nocedal and Zhu 1995,
//! with the projected subspace step of Morales and Nocedal 2011), for a handful of variables.
//!
//! A Gaussian process likelihood has several maxima, and the path decides which one is found. So the iterates follow the
//! published method step by step, with the line search and the stopping rules of its authors' program. One iteration:
//!
//! 1. the generalised Cauchy point: the first minimum of the quadratic model along the projected gradient;
//! 2. the minimum of the model over the variables that are free there, projected into the box;
//! 3. a line search towards it ([`super::line_search`]);
//! 4. the pair (step, change of the gradient) updates the model's matrix.
//!
//! For few variables the quasi-Newton matrix is held dense: it is the matrix of the papers' compact representation, made of
//! the same at most [`M`] pairs.
//!
//! The minimiser is a state that is asked where it wants the function and told what it is there. So a search can be copied
//! and continued on a model of the function. No library offers that: `argmin` has L-BFGS without bounds, the crate `lbfgsb` wraps
//! C code around a callback. And another line search would end in other maxima.
//!
//! ```ignore
//! let mut search = Minimizer::new([0.0; 2], bounds, Tolerances::default());
//! while let Some(x) = search.wants {
//!     let (value, gradient) = f(x);
//!     search.tell(value, gradient);
//! }
//! let minimum = search.best();
//! ```

use super::line_search::{LineSearch, Step};

/// Pairs of steps and gradient differences that are remembered.
const M: usize = 10;
/// Evaluations that one line search may take.
const MAX_LINE_EVALUATIONS: usize = 20;

with_defaults! {
    /// When to stop.
    #[derive(Clone, Copy, Debug)]
    pub(super) struct Tolerances {
        /// Relative decrease of the function in one iteration: `(f_k - f_k+1) / max(|f_k|, |f_k+1|, 1)`.
        pub(super) relative_decrease: f64 = 1e7 * f64::EPSILON,
        /// Largest component of the projected gradient.
        pub(super) projected_gradient: f64 = 1e-5,
        /// Iterations.
        pub(super) max_iterations: usize = 15_000,
    }
}

/// A place with the function and its gradient there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point<const N: usize> {
    /// Where.
    pub(super) x: [f64; N],
    /// The function there.
    pub(super) value: f64,
    /// Its gradient there.
    pub(super) gradient: [f64; N],
}

/// A box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds<const N: usize> {
    /// Smallest values allowed, finite.
    pub(super) lower: [f64; N],
    /// Largest values allowed, finite.
    pub(super) upper: [f64; N],
}

/// A minimisation under way.
#[derive(Clone, Debug)]
pub(super) struct Minimizer<const N: usize> {
    bounds: Bounds<N>,
    tolerances: Tolerances,
    memory: Memory<N>,
    /// The last iterate; `None` before the start is known.
    at: Option<Point<N>>,
    line: Option<Line<N>>,
    /// Where the function is wanted next; `None` at the end.
    pub(super) wants: Option<[f64; N]>,
    iterations: usize,
}

/// A line search under way.
#[derive(Clone, Debug)]
struct Line<const N: usize> {
    target: [f64; N],
    direction: [f64; N],
    search: LineSearch,
    evaluations: usize,
}

impl<const N: usize> Minimizer<N> {
    /// A search within `bounds` from `start`.
    pub(super) fn new(start: [f64; N], bounds: Bounds<N>, tolerances: Tolerances) -> Self {
        let wants = Some(bounds.clamp(start));
        Self { bounds, tolerances, memory: Memory::new(), at: None, line: None, wants, iterations: 0 }
    }

    /// The last iterate, which is the best place so far; `None` before the first value.
    pub(super) fn best(&self) -> Option<Point<N>> {
        self.at
    }

    /// The second derivatives that the quasi-Newton matrix has; `None` before it has any.
    pub(super) fn curvatures(&self) -> Option<[f64; N]> {
        (!self.memory.pairs.is_empty()).then(|| std::array::from_fn(|i| self.memory.matrix[i][i]))
    }

    /// Takes the function and its gradient at the place that was wanted.
    pub(super) fn tell(&mut self, value: f64, gradient: [f64; N]) {
        let Some(x) = self.wants.take() else { return };
        let point = Point { x, value, gradient };
        let (Some(at), Some(mut line)) = (self.at, self.line.take()) else {
            self.at = Some(point);
            return self.iterate(point);
        };
        match line.search.next(value, dot(&gradient, &line.direction)) {
            Step::Done => self.accept(at, point),
            Step::Try(length) if line.evaluations < MAX_LINE_EVALUATIONS => {
                line.evaluations += 1;
                let x = if length == 1.0 {
                    line.target
                } else {
                    self.bounds.clamp(std::array::from_fn(|i| at.x[i] + length * line.direction[i]))
                };
                self.wants = Some(x);
                self.line = Some(line);
            }
            // A search that fails from the steepest descent direction ends it; from another one the memory is misleading and
            // is emptied.
            Step::Try(_) | Step::Failed if self.memory.pairs.is_empty() => {}
            Step::Try(_) | Step::Failed => {
                self.memory = Memory::new();
                self.iterate(at);
            }
        }
    }

    /// Ends a line search at `next`: stops, or goes on from there.
    fn accept(&mut self, at: Point<N>, next: Point<N>) {
        self.iterations += 1;
        self.at = Some(next);
        let scale = at.value.abs().max(next.value.abs()).max(1.0);
        if self.bounds.projected_gradient(&next) <= self.tolerances.projected_gradient
            || at.value - next.value <= self.tolerances.relative_decrease * scale
        {
            return;
        }
        self.memory.remember(&at, &next);
        self.iterate(next);
    }

    /// Begins an iteration from `at`, unless the end is reached.
    fn iterate(&mut self, at: Point<N>) {
        if self.iterations >= self.tolerances.max_iterations
            || self.bounds.projected_gradient(&at) <= self.tolerances.projected_gradient
        {
            return;
        }
        loop {
            if let Some(line) = self.line_towards_minimum(&at) {
                self.wants = Some(line.target);
                self.line = Some(line);
                return;
            }
            if self.memory.pairs.is_empty() {
                return;
            }
            self.memory = Memory::new();
        }
    }

    /// The line search to the minimum of the model; `None` where that is not a descent.
    fn line_towards_minimum(&self, at: &Point<N>) -> Option<Line<N>> {
        let target = self.bounds.subspace_minimum(at, &self.memory)?;
        let direction: [f64; N] = std::array::from_fn(|i| target[i] - at.x[i]);
        let slope = dot(&at.gradient, &direction);
        if slope >= 0.0 || !slope.is_finite() {
            return None;
        }
        let longest = if self.iterations == 0 { 1.0 } else { self.bounds.longest_step(&at.x, &direction) };
        // Both bounds of every variable are finite: the first step of all is 1 as well, not 1/|gradient|.
        Some(Line {
            target,
            direction,
            search: LineSearch::new(at.value, slope, 1.0, longest),
            evaluations: 1,
        })
    }
}

/// The quasi-Newton matrix and the pairs it is made of.
#[derive(Clone, Debug)]
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
        // The projection is not a descent direction: cut the step at the first bound instead.
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

    fn rosenbrock([a, b]: [f64; 2]) -> (f64, [f64; 2]) {
        let (u, v) = (b - a * a, 1.0 - a);
        (100.0 * u * u + v * v, [-400.0 * a * u - 2.0 * v, 200.0 * u])
    }

    /// The minimum that a search ends in, each place that it asks for shown to `watch`.
    fn minimize(
        start: [f64; 2],
        bounds: Bounds<2>,
        tolerances: Tolerances,
        watch: impl Fn([f64; 2]),
    ) -> Point<2> {
        let mut search = Minimizer::new(start, bounds, tolerances);
        while let Some(x) = search.wants {
            watch(x);
            let (value, gradient) = rosenbrock(x);
            search.tell(value, gradient);
        }
        search.best().unwrap()
    }

    #[test]
    fn the_minimum_inside_is_found() {
        let bounds = Bounds { lower: [-5.0; 2], upper: [5.0; 2] };
        let tight = Tolerances { relative_decrease: 0.0, projected_gradient: 1e-9, max_iterations: 500 };
        let end = minimize([-1.2, 1.0], bounds, tight, |_| {});
        assert!(end.x.iter().all(|x| (x - 1.0).abs() < 1e-8), "{end:?}");
    }

    #[test]
    fn a_minimum_on_the_bound_stays_on_it() {
        let bounds = Bounds { lower: [-2.0, -2.0], upper: [0.5, 2.0] };
        let end = minimize([-1.0, 1.5], bounds, Tolerances::default(), |_| {});
        assert_eq!(end.x[0], 0.5);
        assert!((end.x[1] - 0.25).abs() < 1e-5, "{end:?}");
    }

    #[test]
    fn every_trial_is_within_bounds() {
        let bounds = Bounds { lower: [-1.5, -0.5], upper: [1.5, 3.0] };
        let inside = |x: [f64; 2]| {
            assert!((0..2).all(|i| (bounds.lower[i]..=bounds.upper[i]).contains(&x[i])), "{x:?}");
        };
        for start in [[-1.5, -0.5], [1.5, 3.0], [0.0, 0.0], [-1.2, 1.0]] {
            minimize(start, bounds, Tolerances::default(), inside);
        }
    }
}
