//! VARLiNGAM: linear effects, oriented at lag 0 by noise that is not Gaussian.

mod checks;
mod dependence;
mod entropy;
mod lasso;
mod order;

use ndarray::Array3;
use rayon::prelude::*;

use super::{
    autoregression::{Autoregression, Criterion, complete_rows, without_rounding},
    result::PcmciResult,
};
use crate::{
    numeric::{
        least_squares::{Compressed, LeastSquares},
        rows::units,
        student_t::two_sided_p_value,
    },
    types::{CompleteRows, Control, DataFrame, Error, LinkMark, Node, Result},
};
use lasso::Products;

with_defaults! {
    /// Settings of [`run_varlingam`].
    ///
    /// ```
    /// use roscausal_discovery::methods::VarlingamSettings;
    ///
    /// // Without a past it is DirectLiNGAM.
    /// let direct = VarlingamSettings { tau_max: 0, ..VarlingamSettings::default() };
    /// assert!(direct.prune && direct.centre);
    /// ```
    #[derive(Clone, Debug)]
    pub struct VarlingamSettings {
        /// Largest lag; 0 is DirectLiNGAM. Default 1.
        pub tau_max: usize = 1,
        /// Chooses the largest lag by this score, up to `tau_max`; `None`: `tau_max` itself.
        pub choose_lags: Option<Criterion> = None,
        /// Whether an adaptive lasso takes out the coefficients that are not needed. Default true.
        pub prune: bool = true,
        /// Whether the mean of each variable over all recordings is taken off first. Default true; the reference does not.
        pub centre: bool = true,
        /// Significance level of a link. Default 0.05.
        pub alpha_level: f64 = 0.05,
        /// Variables that may be causes only.
        pub exogenous: Vec<usize> = Vec::new(),
        /// Whether the residuals are checked for what the method assumes; the remarks say what they fail. Default true.
        pub check_residuals: bool = true,
    }
}

/// What [`run_varlingam`] finds.
#[derive(Clone, Debug)]
pub struct VarlingamResult {
    /// The links: `val_matrix` has the coefficients between variables scaled to deviation 1.
    pub links: PcmciResult,
    /// The largest lag.
    pub lags: usize,
    /// The variables from first cause to last effect at lag 0.
    pub causal_order: Vec<usize>,
    /// How clear each choice of the order was, from 0 (a tie) to 1.
    pub order_margins: Vec<f64>,
    /// Coefficients `[cause][effect][lag 0..=lags]`, in the units of the data.
    pub adjacency: Array3<f64>,
    /// Coefficients of the regression on the past alone, `[cause][effect][lag 0..=lags]`; 0 at lag 0.
    pub ar_coefs: Array3<f64>,
}

/// VARLiNGAM: a linear model of past and present whose direction at lag 0 follows from the shape of the noise.
///
/// 1. Each variable is regressed on the past of all (`tau_max` lags, or as many as a score finds worth it).
/// 2. The residuals are put into a causal order: a cause is independent of what it leaves of its effect (DirectLiNGAM).
/// 3. Each variable is regressed on those before it and on the past, with an adaptive lasso that keeps what is needed.
///
/// It assumes linear effects, noise that is not Gaussian (of one variable at most), no hidden common causes and no cycle within
/// a sample. Take it where PCMCI+ leaves links at lag 0 without a direction and the variables are far from Gaussian, as robot
/// data often are. A p-value is that of the last regression's t test; it takes the order as known. The remarks say where
/// residuals look Gaussian or depend on each other: then do not believe the directions.
///
/// Sources: Hyvärinen, Zhang, Shimizu and Hoyer 2010, JMLR 11:1709; Shimizu et al. 2011, JMLR 12:1225.
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, LinkMark, methods::{VarlingamSettings, run_varlingam}};
///
/// // `b` follows `a` at once; the noise is uniform.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let values = ndarray::Array2::from_shape_fn((400, 2), |(t, k)| noise(2 * t) + if k == 1 { noise(2 * t + 1) } else { 0.0 });
/// let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let result = run_varlingam(&data, &VarlingamSettings::default(), &Control::default())?;
/// assert_eq!(result.causal_order, [0, 1]);
/// assert_eq!(result.links.graph[[0, 1, 0]], LinkMark::Forward);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Fewer complete samples than coefficients, variables that determine each other, or cancellation.
pub fn run_varlingam(
    data: &DataFrame,
    settings: &VarlingamSettings,
    control: &Control,
) -> Result<VarlingamResult> {
    // In units in which squares neither overflow nor vanish.
    let units = units(data);
    let mut scaled = data.scaled(&units);
    if settings.centre {
        scaled = without_means(&scaled);
    }
    let data = &scaled;
    let lags = lags(data, settings, control)?;
    let of_past = Autoregression::new(complete_rows(data, lags, control)?, 1..=lags, false)?;
    // The present of all variables, then the past.
    let present = (0..data.n_vars()).map(|var| Node::new(var, 0));
    let nodes: Vec<Node> = present.chain(of_past.causes.iter().copied()).collect();
    let frame = Compressed::new(&nodes.iter().map(|&node| of_past.rows.column(node)).collect::<Vec<_>>());
    determined(data, &frame)?;
    let left = of_past.residuals();
    let order = order::causal_order(&left, &settings.exogenous, control)?;
    let model = Model::new(&of_past, (&nodes, &frame), &left, &order.variables, settings);
    let mut links = model.links(&of_past, lags, settings);
    if settings.check_residuals && !control.silent {
        links.remarks =
            checks::remarks(data.var_names(), &model.residuals(&of_past.rows), &order.margins, &links);
    }
    control.count(1);
    let in_datas_units = |mut coefficients: Array3<f64>| {
        for ((cause, effect, _), value) in coefficients.indexed_iter_mut() {
            *value *= units[cause] / units[effect];
        }
        coefficients
    };
    Ok(VarlingamResult {
        links,
        lags,
        causal_order: order.variables,
        order_margins: order.margins,
        adjacency: in_datas_units(model.adjacency),
        ar_coefs: in_datas_units(of_past.coefficients(lags)),
    })
}

/// The data without the mean of each variable over all recordings.
fn without_means(data: &DataFrame) -> DataFrame {
    let mean = |var: usize| {
        let values = data.recordings().iter().flat_map(|r| r.column(var).to_vec()).filter(|v| !v.is_nan());
        let (sum, n) = values.fold((0.0, 0_usize), |(sum, n), v| (sum + v, n + 1));
        if n > 0 { sum / n as f64 } else { 0.0 }
    };
    let means: Vec<f64> = (0..data.n_vars()).map(mean).collect();
    data.shifted(&means)
}

/// The number of lags: `tau_max`, or the one with the least score, each on its own samples.
fn lags(data: &DataFrame, settings: &VarlingamSettings, control: &Control) -> Result<usize> {
    let Some(criterion) = settings.choose_lags.filter(|_| settings.tau_max > 0) else {
        return Ok(settings.tau_max);
    };
    let mut best = (f64::INFINITY, settings.tau_max);
    for lags in 1..=settings.tau_max {
        let rows = complete_rows(data, lags, control)?;
        let score = Autoregression::new(rows, 1..=lags, false)?.score(criterion);
        if score < best.0 {
            best = (score, lags);
        }
    }
    Ok(best.1)
}

/// Refuses variables that others determine: no order of them is right.
fn determined(data: &DataFrame, frame: &Compressed) -> Result<()> {
    let present: Vec<&[f64]> = (0..data.n_vars()).map(|var| frame.column(var)).collect();
    let together = LeastSquares::new(&present, &[], false);
    let names = data.listed((0..data.n_vars()).filter(|&var| together.is_undetermined(var)));
    Error::ensure_data(names.is_empty(), || {
        format!("{names} determine each other, so they have no causal order; leave all but one of them out")
    })
}

/// The regressions that make the model, in the order of the variables.
struct Model {
    adjacency: Array3<f64>,
    standardized: Array3<f64>,
    p_values: Array3<f64>,
}

/// What one variable is regressed on, and with what coefficients.
struct Equation {
    effect: usize,
    /// Cause, coefficient, coefficient between scaled variables, p-value.
    terms: Vec<(Node, f64, f64, f64)>,
}

impl Equation {
    /// The least squares on `causes`, with a constant; the frame has the columns by lag, then variable.
    fn fit(frame: &Compressed, n_vars: usize, effect: usize, causes: &[Node]) -> Self {
        let columns: Vec<usize> = causes.iter().map(|cause| cause.lag * n_vars + cause.var).collect();
        let fit = frame.regress(effect, &columns);
        let term = |(k, &cause): (usize, &Node)| {
            (cause, fit.coefficient(0, k), fit.standardized(0, k), two_sided_p_value(fit.t(0, k), fit.dof()))
        };
        Self { effect, terms: causes.iter().enumerate().map(term).collect() }
    }
}

impl Model {
    /// From the regression on the past, the nodes and their columns in a frame, what the past leaves of each variable, and the
    /// causal order.
    fn new(
        of_past: &Autoregression,
        (nodes, frame): (&[Node], &Compressed),
        left: &[Vec<f64>],
        order: &[usize],
        settings: &VarlingamSettings,
    ) -> Self {
        let n = of_past.rows.n_vars;
        let lags = of_past.causes.len() / n.max(1);
        let shape = (n, n, lags + 1);
        let mut model = Self {
            adjacency: Array3::zeros(shape),
            standardized: Array3::zeros(shape),
            p_values: Array3::ones(shape),
        };
        // Chosen among the present and the past as they are, or among what the past leaves of the present.
        let products = if settings.prune {
            Products::new(frame)
        } else {
            Products::new(&Compressed::new(&left.iter().map(Vec::as_slice).collect::<Vec<_>>()))
        };
        let equation = |place: usize| {
            let effect = order[place];
            if settings.exogenous.contains(&effect) {
                return Equation { effect, terms: Vec::new() };
            }
            let mut candidates = order[..place].to_vec();
            if settings.prune {
                candidates.extend(n..nodes.len());
            }
            let found = lasso::support(&products, effect, &candidates, of_past.rows.len());
            let mut causes: Vec<Node> = found.iter().map(|&k| nodes[k]).collect();
            if !settings.prune {
                causes.extend(&of_past.causes);
            }
            Equation::fit(frame, n, effect, &causes)
        };
        let equations: Vec<Equation> = (0..n).into_par_iter().map(equation).collect();
        for Equation { effect, terms } in &equations {
            for &(cause, coefficient, standardized, p_value) in terms {
                let at = [cause.var, *effect, cause.lag];
                model.adjacency[at] = coefficient;
                model.standardized[at] = standardized;
                model.p_values[at] = p_value;
            }
        }
        if !settings.prune {
            model.take_residuals(of_past, left, &equations, lags);
        }
        model
    }

    /// Without pruning: the coefficients at lag 0 are those between residuals of the past, and `B_tau = (I - B_0) M_tau`.
    fn take_residuals(
        &mut self,
        of_past: &Autoregression,
        residuals: &[Vec<f64>],
        equations: &[Equation],
        lags: usize,
    ) {
        for Equation { effect, terms } in equations {
            let causes: Vec<usize> =
                terms.iter().filter(|term| term.0.lag == 0).map(|term| term.0.var).collect();
            let columns: Vec<&[f64]> = causes.iter().map(|&cause| residuals[cause].as_slice()).collect();
            let fit = LeastSquares::new(&columns, &[&residuals[*effect]], true);
            for (k, &cause) in causes.iter().enumerate() {
                self.adjacency[[cause, *effect, 0]] = fit.coefficient(0, k);
            }
        }
        let (past, n) = (of_past.coefficients(lags), self.adjacency.dim().0);
        for Equation { effect, terms } in equations.iter().filter(|equation| !equation.terms.is_empty()) {
            for (cause, lag) in terms.iter().map(|term| (term.0.var, term.0.lag)).filter(|(_, lag)| *lag > 0)
            {
                let through: f64 =
                    (0..n).map(|k| self.adjacency[[k, *effect, 0]] * past[[cause, k, lag]]).sum();
                self.adjacency[[cause, *effect, lag]] = past[[cause, *effect, lag]] - through;
            }
        }
    }

    fn links(&self, of_past: &Autoregression, lags: usize, settings: &VarlingamSettings) -> PcmciResult {
        let n = of_past.rows.n_vars;
        let rows = &of_past.rows;
        let mut links = PcmciResult::untested(n, settings.tau_max, rows.len() + rows.n_lost);
        links.all_rest_on(rows, 0);
        links.n_tests = n * (n * lags + n - 1);
        for (at, &p) in self.p_values.indexed_iter() {
            let at = <[usize; 3]>::from(at);
            links.val_matrix[at] = self.standardized[at];
            links.p_matrix[at] = p;
            if self.adjacency[at] != 0.0 && p <= settings.alpha_level {
                links.graph[at] = LinkMark::Forward;
            }
        }
        // A link at lag 0 is read from both ends.
        for (cause, effect) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            if links.graph[[cause, effect, 0]] == LinkMark::Forward {
                links.graph[[effect, cause, 0]] = LinkMark::Backward;
                links.copy([cause, effect, 0], [effect, cause, 0]);
            }
        }
        links
    }

    /// What the model leaves of each variable.
    fn residuals(&self, rows: &CompleteRows) -> Vec<Vec<f64>> {
        let of = |effect: usize| {
            let mut left = rows.column(Node::new(effect, 0)).to_vec();
            for ((cause, _, lag), &b) in
                self.adjacency.indexed_iter().filter(|((_, to, _), b)| *to == effect && **b != 0.0)
            {
                left.iter_mut().zip(rows.column(Node::new(cause, lag))).for_each(|(v, x)| *v -= b * x);
            }
            without_rounding(&mut left, rows.column(Node::new(effect, 0)));
            left
        };
        (0..rows.n_vars).into_par_iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::{normal::normal_quantile, random::Rng};

    /// `c` follows `b`, `b` follows `a` at once and its own past; uniform or Gaussian noise.
    fn chain(n: usize, gaussian: bool, seed: u64) -> DataFrame {
        let mut rng = Rng::new(seed);
        let mut noise = || {
            let u = rng.unit().clamp(1e-12, 1.0 - 1e-12);
            if gaussian { normal_quantile(u) } else { 3.4 * (u - 0.5) }
        };
        let mut values = ndarray::Array2::from_shape_simple_fn((n, 3), &mut noise);
        for t in 1..n {
            values[[t, 1]] += 0.8 * values[[t, 0]] + 0.4 * values[[t - 1, 1]];
            values[[t, 2]] += 0.8 * values[[t, 1]];
        }
        DataFrame::new(vec![values], ["a", "b", "c"].map(str::to_owned).to_vec()).unwrap()
    }

    fn run(data: &DataFrame, settings: &VarlingamSettings) -> VarlingamResult {
        run_varlingam(data, settings, &Control::default()).unwrap()
    }

    #[test]
    fn a_chain_at_lag_0_is_found_with_its_directions() {
        let result = run(&chain(600, false, 3), &VarlingamSettings::default());
        assert_eq!(result.causal_order, [0, 1, 2]);
        let found: Vec<_> =
            result.links.graph.indexed_iter().filter(|(_, m)| **m == LinkMark::Forward).collect();
        let places: Vec<_> = found.iter().map(|(at, _)| *at).collect();
        assert_eq!(places, [(0, 1, 0), (1, 1, 1), (1, 2, 0)]);
        assert!(result.links.remarks.is_empty(), "{:?}", result.links.remarks);
        assert!((result.adjacency[[0, 1, 0]] - 0.8).abs() < 0.1);
    }

    #[test]
    fn gaussian_noise_is_said_to_leave_the_order_open() {
        let result = run(&chain(600, true, 3), &VarlingamSettings::default());
        let stated = result.links.remarks.join(" ");
        assert!(stated.contains("Gaussian"), "{stated}");
    }

    #[test]
    fn a_hidden_common_cause_is_said_to_leave_dependent_residuals() {
        let data = chain(1500, false, 5).select(&[1, 2]);
        let mut values = data.recordings()[0].clone();
        let mut rng = Rng::new(9);
        for mut row in values.rows_mut() {
            let hidden = 8.0 * (rng.unit() - 0.5);
            row[0] += hidden * hidden * hidden.signum();
            row[1] += hidden;
        }
        let data = DataFrame::new(vec![values], data.var_names().to_vec()).unwrap();
        let stated = run(&data, &VarlingamSettings::default()).links.remarks.join(" ");
        assert!(stated.contains("depend on each other"), "{stated}");
    }

    #[test]
    fn the_names_and_places_of_variables_do_not_matter() {
        let data = chain(500, false, 11);
        let (a, b) = (
            run(&data, &VarlingamSettings::default()),
            run(&data.select(&[2, 0, 1]), &VarlingamSettings::default()),
        );
        let new = |var: usize| [1, 2, 0][var];
        for ((i, j, lag), value) in a.adjacency.indexed_iter() {
            assert!((value - b.adjacency[[new(i), new(j), lag]]).abs() < 1e-9);
        }
    }

    #[test]
    fn nothing_points_to_an_exogenous_variable() {
        let settings = VarlingamSettings { exogenous: vec![2], ..VarlingamSettings::default() };
        let result = run(&chain(500, false, 11), &settings);
        assert_eq!(result.causal_order[0], 2);
        assert!((0..3).all(|i| result.links.graph[[i, 2, 0]] != LinkMark::Forward
            && !result.links.graph[[i, 2, 1]].is_link()));
    }

    #[test]
    fn copies_are_refused_by_name() {
        let twice = chain(300, false, 1).select(&[0, 0, 1]);
        let error = run_varlingam(&twice, &VarlingamSettings::default(), &Control::default()).unwrap_err();
        assert!(error.to_string().starts_with("a, a determine each other"), "{error}");
    }
}
