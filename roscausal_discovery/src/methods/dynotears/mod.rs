//! DYNOTEARS: a sparse linear model without cycles, by continuous optimisation.

mod acyclic;
mod minimise;

use ndarray::{Array2, Array3};

use super::{autoregression::complete_rows, result::PcmciResult};
use crate::{
    numeric::rows::{dot, moments, standardized},
    types::{CompleteRows, Control, DataFrame, Error, LinkMark, Named, Node, Result},
};
use acyclic::cycles;
use minimise::minimise;

/// Largest pull on a weight at the end of a round.
const TOLERANCE: f64 = 1e-5;

with_defaults! {
    /// Settings of [`run_dynotears`].
    ///
    /// ```
    /// use roscausal_discovery::methods::DynotearsSettings;
    ///
    /// // Without a past it is NOTEARS.
    /// let notears = DynotearsSettings { tau_max: 0, ..DynotearsSettings::default() };
    /// assert!(notears.standardise);
    /// ```
    #[derive(Clone, Debug)]
    pub struct DynotearsSettings {
        /// Largest lag; 0 is NOTEARS. Default 1.
        pub tau_max: usize = 1,
        /// Price of a weight at lag 0. Default 0.1; 0.05 finds more.
        pub lambda_w: f64 = 0.1,
        /// Price of a lagged weight. Default 0.1.
        pub lambda_a: f64 = 0.1,
        /// Rounds of the augmented Lagrangian. Default 100.
        pub max_iterations: usize = 100,
        /// How near to acyclic the weights at lag 0 must be. Default 1e-8.
        pub h_tolerance: f64 = 1e-8,
        /// A smaller weight is not a link. Default 0.05.
        pub threshold: f64 = 0.05,
        /// Whether each variable is scaled to mean 0 and deviation 1 first. Default true; the reference does not.
        pub standardise: bool = true,
        /// Links that are held at 0: cause, effect, lag.
        pub excluded: Vec<(usize, usize, usize)> = Vec::new(),
        /// Variables that may be causes only.
        pub exogenous: Vec<usize> = Vec::new(),
    }
}

/// What [`run_dynotears`] finds.
#[derive(Clone, Debug)]
pub struct DynotearsResult {
    /// The links: `val_matrix` has the weights, `p_matrix` 0 for a link and 1 elsewhere, because the method has no p-values.
    pub links: PcmciResult,
    /// Weights at lag 0, `[cause][effect]`, before threshold and leftover cycles are taken off.
    pub w: Array2<f64>,
    /// Lagged weights, `[cause][effect][lag 0..=tau_max]`, before the threshold; 0 at lag 0.
    pub a: Array3<f64>,
    /// What was minimised: half the mean square of what is left, plus the prices of the weights.
    pub objective: f64,
    /// How far the weights at lag 0 are from acyclic.
    pub h: f64,
}

/// DYNOTEARS: of all linear models without a cycle at lag 0, one that fits well with few and small weights.
///
/// `x(t) = x(t) W + sum over lags x(t - lag) A_lag + noise`. Minimised is half the mean square of the noise plus
/// `lambda_w |W| + lambda_a |A|`, while `h(W) = tr exp(W * W) - N` must be 0 (an augmented Lagrangian: the price of a cycle rises
/// from round to round). Everything follows from products of the columns, so a round takes as long for many samples as for few.
///
/// It assumes linear effects and no hidden common causes. Its directions at lag 0 follow the scales of the variables: what
/// varies more counts as later ("varsortability": Reisach, Seiler and Weichwald 2021). So variables are scaled first, and then
/// little speaks for one direction. It has no p-values. Take it to compare with others' results; for answers take
/// [`run_pcmciplus`](super::run_pcmciplus).
///
/// Sources: Pamfil et al. 2020, "DYNOTEARS: structure learning from time-series data"; Zheng et al. 2018 (NOTEARS).
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, methods::{DynotearsSettings, run_dynotears}};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let mut values = ndarray::Array2::zeros((300, 2));
/// # for t in 1..300 {
/// #     values[[t, 0]] = noise(2 * t);
/// #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
/// # }
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let result = run_dynotears(&data, &DynotearsSettings::default(), &Control::default())?;
/// assert!(result.a[[0, 1, 1]] > 0.3 && result.a[[1, 0, 1]].abs() < 0.05);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Settings out of their range, no complete sample, or cancellation.
pub fn run_dynotears(
    data: &DataFrame,
    settings: &DynotearsSettings,
    control: &Control,
) -> Result<DynotearsResult> {
    settings.check(data.n_vars())?;
    let rows = complete_rows(data, settings.tau_max, control)?;
    Error::ensure_data(rows.len() >= 2, || {
        format!("{} complete samples are too few: record longer, or lower {}", rows.len(), Named("tau_max"))
    })?;
    let problem = Problem::new(&rows, settings);
    let mut result = problem.result(&problem.solve(settings, control)?, &rows, settings);
    result.links.remarks = remarks(&rows, &result, settings);
    control.count(1);
    Ok(result)
}

impl DynotearsSettings {
    fn check(&self, n_vars: usize) -> Result<()> {
        let numbers = [
            ("lambda_w", self.lambda_w),
            ("lambda_a", self.lambda_a),
            ("threshold", self.threshold),
            ("h_tolerance", self.h_tolerance),
        ];
        if let Some((name, value)) =
            numbers.into_iter().find(|(_, value)| !(*value >= 0.0 && value.is_finite()))
        {
            return Err(Error::param(name, format!("{value} is not a number of 0 or more")));
        }
        let wrong =
            |link: &&(usize, usize, usize)| link.0 >= n_vars || link.1 >= n_vars || link.2 > self.tau_max;
        let Some((cause, effect, lag)) = self.excluded.iter().find(wrong) else { return Ok(()) };
        let (last, most) = (n_vars - 1, self.tau_max);
        let reason =
            format!("link {cause} -> {effect} at lag {lag}: variables are 0 to {last}, lags 0 to {most}");
        Err(Error::param("excluded", reason))
    }
}

/// The least squares by products. Weights stand by lag, cause and effect: the first `n * n` are those at lag 0.
struct Problem {
    n: usize,
    /// Rows of weights: causes at all lags.
    size: usize,
    /// Mean products of the columns at all lags, `size x size`.
    products: Vec<f64>,
    /// Price of each weight; infinite for one that is held at 0.
    penalty: Vec<f64>,
}

impl Problem {
    fn new(rows: &CompleteRows, settings: &DynotearsSettings) -> Self {
        let n = rows.n_vars;
        let size = n * (settings.tau_max + 1);
        let node = |row: usize| Node::new(row % n, row / n);
        let columns: Vec<Vec<f64>> = (0..size)
            .map(|row| {
                if settings.standardise {
                    standardized(rows.column(node(row)))
                } else {
                    rows.column(node(row)).to_vec()
                }
            })
            .collect();
        let mut products = vec![0.0; size * size];
        for i in 0..size {
            for j in 0..=i {
                let product = dot(&columns[i], &columns[j]) / rows.len() as f64;
                products[i * size + j] = product;
                products[j * size + i] = product;
            }
        }
        let price = |at: usize| {
            let (cause, effect) = (node(at / n), at % n);
            let held = settings.excluded.contains(&(cause.var, effect, cause.lag))
                || settings.exogenous.contains(&effect);
            match (held || cause == Node::new(effect, 0), cause.lag) {
                (true, _) => f64::INFINITY,
                (false, 0) => settings.lambda_w,
                (false, _) => settings.lambda_a,
            }
        };
        Self { n, size, products, penalty: (0..size * n).map(price).collect() }
    }

    /// Half the mean square of what the weights leave, and its gradient.
    fn misfit(&self, weights: &[f64]) -> (f64, Vec<f64>) {
        let (n, size) = (self.n, self.size);
        let mut gradient = vec![0.0; size * n];
        for (row, out) in self.products.chunks_exact(size).zip(gradient.chunks_exact_mut(n)) {
            for (product, of) in row.iter().zip(weights.chunks_exact(n)) {
                out.iter_mut().zip(of).for_each(|(o, w)| *o += product * w);
            }
        }
        // Half of w' G w - 2 w' g + g_0; the gradient is G w - g.
        let mut value: f64 = (0..n).map(|j| 0.5 * self.products[j * size + j]).sum();
        for (row, out) in gradient.chunks_exact_mut(n).enumerate() {
            for (j, slope) in out.iter_mut().enumerate() {
                let with_target = self.products[row * size + j];
                value += weights[row * n + j] * (0.5 * *slope - with_target);
                *slope -= with_target;
            }
        }
        (value, gradient)
    }

    /// The augmented Lagrangian: from the last accepted weights, the price of a cycle rises until a round takes at least three
    /// quarters of what is left of `h`.
    fn solve(&self, settings: &DynotearsSettings, control: &Control) -> Result<Vec<f64>> {
        let squares = self.n * self.n;
        let mut weights = vec![0.0; self.size * self.n];
        let (mut rho, mut alpha, mut h) = (1.0_f64, 0.0, f64::INFINITY);
        for _ in 0..settings.max_iterations {
            let mut next = (weights.clone(), h);
            while rho < 1e20 {
                control.check()?;
                let found = minimise(&weights, &self.penalty, TOLERANCE, |weights| {
                    let (mut value, mut gradient) = self.misfit(weights);
                    let (h, slope) = cycles(&weights[..squares], self.n);
                    value += 0.5 * rho * h * h + alpha * h;
                    gradient.iter_mut().zip(slope).for_each(|(g, s)| *g += (rho * h + alpha) * s);
                    (value, gradient)
                });
                let new = cycles(&found[..squares], self.n).0;
                next = (found, new);
                if new <= 0.25 * h {
                    break;
                }
                rho *= 10.0;
            }
            (weights, h) = next;
            alpha += rho * h;
            if h <= settings.h_tolerance || rho >= 1e20 {
                break;
            }
        }
        Ok(weights)
    }

    fn result(&self, weights: &[f64], rows: &CompleteRows, settings: &DynotearsSettings) -> DynotearsResult {
        let (n, lags) = (self.n, settings.tau_max);
        let weight = |cause: usize, effect: usize, lag: usize| weights[(lag * n + cause) * n + effect];
        let w = Array2::from_shape_fn((n, n), |(i, j)| weight(i, j, 0));
        let a = Array3::from_shape_fn(
            (n, n, lags + 1),
            |(i, j, lag)| if lag > 0 { weight(i, j, lag) } else { 0.0 },
        );
        let price: f64 =
            weights.iter().zip(&self.penalty).filter(|(w, _)| **w != 0.0).map(|(w, p)| w.abs() * p).sum();
        let mut links = PcmciResult::untested(n, lags, rows.len() + rows.n_lost);
        links.all_rest_on(rows, 0);
        let kept = without_cycles(&w, settings.threshold);
        for ((cause, effect, lag), mark) in links.graph.indexed_iter_mut() {
            let at = [cause, effect, lag];
            let (value, mirrored) = match lag {
                0 => (kept[[cause, effect]], kept[[effect, cause]]),
                _ => (a[at], 0.0),
            };
            links.val_matrix[at] = if value != 0.0 { value } else { mirrored };
            if value.abs() >= settings.threshold && value != 0.0 {
                *mark = LinkMark::Forward;
            } else if mirrored != 0.0 {
                *mark = LinkMark::Backward;
            }
            links.p_matrix[at] = if mark.is_link() { 0.0 } else { 1.0 };
        }
        let h = cycles(&weights[..n * n], n).0;
        DynotearsResult { links, w, a, objective: self.misfit(weights).0 + price, h }
    }
}

/// The weights of at least `threshold`, the largest first as long as they make no cycle.
fn without_cycles(w: &Array2<f64>, threshold: f64) -> Array2<f64> {
    let n = w.nrows();
    let mut order: Vec<((usize, usize), f64)> =
        w.indexed_iter().map(|(at, v)| (at, *v)).filter(|(_, v)| *v != 0.0 && v.abs() >= threshold).collect();
    order.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
    let mut kept = Array2::zeros((n, n));
    // Whether one variable drives another, perhaps through others.
    let mut drives = Array2::from_shape_fn((n, n), |(i, j)| i == j);
    for ((cause, effect), weight) in order {
        if drives[[effect, cause]] {
            continue;
        }
        kept[[cause, effect]] = weight;
        for i in 0..n {
            (0..n).for_each(|j| drives[[i, j]] |= drives[[i, cause]] && drives[[effect, j]]);
        }
    }
    kept
}

/// What a reader must know: there are no p-values, and scales matter.
fn remarks(rows: &CompleteRows, result: &DynotearsResult, settings: &DynotearsSettings) -> Vec<String> {
    let mut stated = vec![format!(
        "dynotears has no p-values: a link is a weight of at least {}, and p_value 0 says no more than that",
        settings.threshold
    )];
    let deviations = (0..rows.n_vars).map(|var| moments(rows.column(Node::new(var, 0))).1);
    let (least, most) = (deviations.filter(|deviation| *deviation > 0.0))
        .fold((f64::INFINITY, 0.0_f64), |(least, most), v| (least.min(v), most.max(v)));
    if !settings.standardise && most > 1.5 * least {
        stated.push(
            "the directions at lag 0 follow the scales of the variables, which differ here: standardise them, or do not believe \
             the directions"
                .into(),
        );
    } else if (0..rows.n_vars).any(|i| (0..rows.n_vars).any(|j| result.links.graph[[i, j, 0]].is_link())) {
        stated.push("on variables of equal scale little speaks for one direction at lag 0; hold them against pcmciplus".into());
    }
    if result.h > settings.h_tolerance {
        stated.push(format!(
            "the search ended with a cycle at lag 0 ({:.1e}); its weakest links are taken out",
            result.h
        ));
    }
    stated
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Rng;

    fn chain(n: usize, seed: u64) -> DataFrame {
        let mut rng = Rng::new(seed);
        let mut values = Array2::from_shape_simple_fn((n, 3), || rng.unit() - 0.5);
        for t in 1..n {
            values[[t, 1]] += 0.8 * values[[t - 1, 0]];
            values[[t, 2]] += 0.9 * values[[t, 1]];
        }
        DataFrame::new(vec![values], ["a", "b", "c"].map(str::to_owned).to_vec()).unwrap()
    }

    fn run(settings: &DynotearsSettings) -> DynotearsResult {
        run_dynotears(&chain(500, 3), settings, &Control::default()).unwrap()
    }

    #[test]
    fn lagged_links_are_found_and_lag_0_has_no_cycle() {
        let result = run(&DynotearsSettings::default());
        assert_eq!(result.links.graph[[0, 1, 1]], LinkMark::Forward);
        assert!(result.links.graph[[1, 2, 0]].is_link() && result.h <= 1e-8);
        assert!(result.links.remarks[0].contains("no p-values"));
    }

    #[test]
    fn a_held_link_stays_0() {
        let settings = DynotearsSettings {
            excluded: vec![(0, 1, 1)],
            exogenous: vec![2],
            ..DynotearsSettings::default()
        };
        let result = run(&settings);
        assert_eq!(result.a[[0, 1, 1]], 0.0);
        assert!((0..3).all(|i| result.w[[i, 2]] == 0.0 && result.a[[i, 2, 1]] == 0.0));
    }

    #[test]
    fn a_higher_price_leaves_less_weight() {
        let total = |lambda: f64| {
            let settings =
                DynotearsSettings { lambda_w: lambda, lambda_a: lambda, ..DynotearsSettings::default() };
            let result = run(&settings);
            result.w.iter().chain(&result.a).map(|v| v.abs()).sum::<f64>()
        };
        assert!(total(0.02) > total(0.1) && total(0.1) > total(0.4) && total(2.0) == 0.0);
    }

    #[test]
    fn different_scales_are_warned_of_when_they_are_kept() {
        let data = chain(300, 5);
        let mut values = data.recordings()[0].clone();
        values.column_mut(2).mapv_inplace(|v| 100.0 * v);
        let data = DataFrame::new(vec![values], data.var_names().to_vec()).unwrap();
        let settings = DynotearsSettings { standardise: false, ..DynotearsSettings::default() };
        let result = run_dynotears(&data, &settings, &Control::default()).unwrap();
        assert!(result.links.remarks.iter().any(|stated| stated.contains("scales")));
    }

    #[test]
    fn the_weakest_link_of_a_cycle_is_left_out() {
        let w = ndarray::array![[0.0, 0.5, 0.0], [0.2, 0.0, 0.6], [0.1, 0.0, 0.0]];
        let kept = without_cycles(&w, 0.05);
        assert_eq!(kept, ndarray::array![[0.0, 0.5, 0.0], [0.0, 0.0, 0.6], [0.0, 0.0, 0.0]]);
    }

    #[test]
    fn a_negative_price_and_no_samples_are_one_sentence() {
        let settings = DynotearsSettings { lambda_w: -1.0, ..DynotearsSettings::default() };
        assert!(run_dynotears(&chain(50, 1), &settings, &Control::default()).is_err());
        let settings = DynotearsSettings { tau_max: 60, ..DynotearsSettings::default() };
        let error = run_dynotears(&chain(50, 1), &settings, &Control::default()).unwrap_err().to_string();
        assert!(error.contains("has 50 samples; tau_max = 60"), "{error}");
    }
}
