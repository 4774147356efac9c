//! Multivariate Granger causality.

use ndarray::{Array2, Array3, s};

use super::{
    autoregression::{Autoregression, Criterion, complete_rows},
    fdr::{Fdr, fdr_bh},
    result::PcmciResult,
};
use crate::{
    numeric::{beta::f_sf, student_t::two_sided_p_value},
    types::{Control, DataFrame, Error, LinkMark, Result, SampleCount, Samples},
};

with_defaults! {
    /// Settings of [`run_granger`].
    ///
    /// ```
    /// use roscausal_discovery::methods::{Criterion, GrangerSettings};
    ///
    /// // As many lags as BIC finds worth their coefficients, 5 at most.
    /// let settings = GrangerSettings { tau_max: 5, choose_lags: Some(Criterion::Bic), ..GrangerSettings::default() };
    /// assert_eq!(settings.tau_min, 1);
    /// ```
    #[derive(Clone, Debug)]
    pub struct GrangerSettings {
        /// Smallest lag, at least 1. Default 1.
        pub tau_min: usize = 1,
        /// Largest lag. Default 1.
        pub tau_max: usize = 1,
        /// Chooses the largest lag by this score, up to `tau_max`; `None`: `tau_max` itself.
        pub choose_lags: Option<Criterion> = None,
        /// Significance level of a pair. Default 0.05.
        pub alpha_level: f64 = 0.05,
        /// Correction of the p-values of pairs for their number.
        pub fdr: Fdr = Fdr::None,
        /// Variables that may be causes only.
        pub exogenous: Vec<usize> = Vec::new(),
    }
}

/// What [`run_granger`] finds. Matrices are `[cause][effect]` or `[cause][effect][lag 0..=tau_max]`; lags outside the regression
/// have 0 and p-value 1.
#[derive(Clone, Debug)]
pub struct GrangerResult {
    /// The links: `val_matrix` has the coefficients between variables scaled to deviation 1.
    pub links: PcmciResult,
    /// The largest lag of the regression.
    pub lags: usize,
    /// F of the test that all coefficients of a pair are 0.
    pub f_matrix: Array2<f64>,
    /// P-value of that test, before a correction.
    pub fp_matrix: Array2<f64>,
    /// Coefficients, in the units of the data.
    pub coef: Array3<f64>,
    /// t of each coefficient.
    pub t_matrix: Array3<f64>,
    /// Two-sided p-value of each t.
    pub p_matrix: Array3<f64>,
    /// Residual sum of squares of each variable.
    pub rss: Vec<f64>,
    /// Degrees of freedom of F: of a pair, and of the residuals.
    pub df: (usize, usize),
    /// Scores of the regression: AIC, BIC and HQIC.
    pub criteria: [f64; 3],
}

/// Multivariate Granger causality: does the past of X help to foretell Y beyond the past of everything else?
///
/// 1. For each variable one regression on a constant and lags `tau_min..=tau_max` of all variables. A sample in which anything
///    is missing is left out.
/// 2. For each pair the F test that the cause's coefficients vanish, with `(p, n - N p - 1)` degrees of freedom for `p` lags of
///    `N` variables. It decides.
/// 3. For each lag of a pair that passed, the t test of its coefficient: the links are the lags at the level, or the strongest
///    one if none is.
///
/// It assumes that dependence is linear, that effects follow later than they cause, and that nothing that drives two variables
/// is hidden: then "helps to foretell" means "causes". Take it as the baseline to compare with, and with few variables and many
/// samples. Variables that others determine, such as a copy, have no link, and a remark says so.
///
/// Source: Granger 1969, Econometrica 37:424; Geweke 1984, JASA 79:907 (conditional on further variables).
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, LinkMark, methods::{GrangerSettings, run_granger}};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let mut values = ndarray::Array2::zeros((300, 2));
/// # for t in 1..300 {
/// #     values[[t, 0]] = noise(2 * t);
/// #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
/// # }
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let result = run_granger(&data, &GrangerSettings { tau_max: 2, ..GrangerSettings::default() }, &Control::default())?;
/// assert_eq!(result.links.graph[[0, 1, 1]], LinkMark::Forward);
/// assert!(result.fp_matrix[[0, 1]] < 1e-6 && result.fp_matrix[[1, 0]] > 0.05);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Settings that do not match, fewer complete samples than coefficients, or cancellation.
pub fn run_granger(data: &DataFrame, settings: &GrangerSettings, control: &Control) -> Result<GrangerResult> {
    settings.check()?;
    let lags = settings.lags(data, control)?;
    let rows = complete_rows(data, lags, control)?;
    let of_data = Samples::new(data, lags).len();
    let regression = Autoregression::new(rows, settings.tau_min..=lags, true)?;
    let mut result = tested(&regression, settings, lags);
    result.links.n_samples = of_data;
    result.links.all_rest_on(&regression.rows, settings.tau_min);
    // What other columns determine has no coefficient of its own, and no test.
    for (_, cause) in regression.causes.iter().enumerate().filter(|(k, _)| regression.fit.is_undetermined(*k))
    {
        let untested = Some(SampleCount { used: 0, lost: 0 });
        result.links.samples.slice_mut(s![cause.var, .., cause.lag]).fill(untested);
    }
    result.links.remarks = remarks(data, &regression);
    decide(&mut result, &regression, settings);
    control.count(result.links.n_tests);
    Ok(result)
}

impl GrangerSettings {
    fn check(&self) -> Result<()> {
        let reason = "0: Granger causality knows the past only; give at least 1";
        Error::ensure(self.tau_min > 0, "tau_min", || reason)?;
        Error::check_lags(self.tau_min, self.tau_max)
    }

    /// The largest lag: `tau_max`, or the one with the least score, all on the samples of `tau_max`.
    fn lags(&self, data: &DataFrame, control: &Control) -> Result<usize> {
        let Some(criterion) = self.choose_lags else { return Ok(self.tau_max) };
        let rows = complete_rows(data, self.tau_max, control)?;
        let mut best = (f64::INFINITY, self.tau_min);
        for lags in self.tau_min..=self.tau_max {
            control.check()?;
            let score = Autoregression::new(rows.clone(), self.tau_min..=lags, true)?.score(criterion);
            if score < best.0 {
                best = (score, lags);
            }
        }
        Ok(best.1)
    }
}

/// All tests of the regression; the links are still to be decided.
fn tested(regression: &Autoregression, settings: &GrangerSettings, lags: usize) -> GrangerResult {
    let (fit, n) = (&regression.fit, regression.rows.n_vars);
    let lags_of_pair = lags + 1 - settings.tau_min;
    let shape = (n, n, settings.tau_max + 1);
    let scores =
        [Criterion::Aic, Criterion::Bic, Criterion::Hqic].map(|criterion| regression.score(criterion));
    let mut result = GrangerResult {
        links: PcmciResult::untested(n, settings.tau_max, regression.rows.len()),
        lags,
        f_matrix: Array2::zeros((n, n)),
        fp_matrix: Array2::ones((n, n)),
        coef: Array3::zeros(shape),
        t_matrix: Array3::zeros(shape),
        p_matrix: Array3::ones(shape),
        rss: (0..n).map(|target| fit.rss(target)).collect(),
        df: (lags_of_pair, fit.dof()),
        criteria: scores,
    };
    for (k, cause) in regression.causes.iter().enumerate() {
        for effect in 0..n {
            let at = [cause.var, effect, cause.lag];
            result.coef[at] = fit.coefficient(effect, k);
            result.t_matrix[at] = fit.t(effect, k);
            result.p_matrix[at] = two_sided_p_value(result.t_matrix[at], fit.dof());
            result.links.val_matrix[at] = fit.standardized(effect, k);
        }
    }
    for cause in 0..n {
        let columns: Vec<usize> =
            (settings.tau_min..=lags).filter_map(|lag| regression.column(cause, lag)).collect();
        for (effect, f) in fit.f(&columns).into_iter().enumerate() {
            result.f_matrix[[cause, effect]] = f;
            result.fp_matrix[[cause, effect]] = f_sf(f, lags_of_pair, fit.dof());
        }
    }
    result
}

/// Marks the links: lags at the level of pairs at the level.
fn decide(result: &mut GrangerResult, regression: &Autoregression, settings: &GrangerSettings) {
    let n = regression.rows.n_vars;
    let tested = |effect: &usize| !settings.exogenous.contains(effect);
    let of_pairs = result.fp_matrix.clone().insert_axis(ndarray::Axis(2));
    let wanted = Array3::from_shape_fn(of_pairs.dim(), |(_, effect, _)| tested(&effect));
    let deciding = match settings.fdr {
        Fdr::None => of_pairs,
        Fdr::Bh | Fdr::BhLagged => fdr_bh(&of_pairs, &wanted),
    };
    for effect in (0..n).filter(tested) {
        for cause in 0..n {
            result.links.n_tests += 1;
            let (of_pair, lags) = (deciding[[cause, effect, 0]], settings.tau_min..=result.lags);
            let p = |lag: usize| result.p_matrix[[cause, effect, lag]];
            let strongest = lags.clone().min_by(|&a, &b| p(a).total_cmp(&p(b)));
            for lag in lags {
                let at = [cause, effect, lag];
                let is_link = of_pair <= settings.alpha_level
                    && (p(lag) <= settings.alpha_level || Some(lag) == strongest);
                // Of a pair that did not pass, the test of the pair says why there is no link.
                result.links.p_matrix[at] = if is_link { p(lag) } else { p(lag).max(of_pair) };
                if is_link {
                    result.links.graph[at] = LinkMark::Forward;
                }
            }
        }
    }
    // What has no test has no value either.
    for effect in (0..n).filter(|effect| !tested(effect)) {
        result.links.val_matrix.slice_mut(ndarray::s![.., effect, ..]).fill(0.0);
        result.links.samples.slice_mut(ndarray::s![.., effect, ..]).fill(None);
    }
}

fn remarks(data: &DataFrame, regression: &Autoregression) -> Vec<String> {
    let vars = regression.undetermined();
    if vars.is_empty() {
        return Vec::new();
    }
    vec![format!(
        "{} determine each other, so no regression can tell them apart and none of them is shown as a cause; leave all but one \
         of them out",
        data.listed(vars)
    )]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Rng;

    /// `b` follows `a` one step later, `c` is noise.
    fn chain(n: usize, seed: u64) -> DataFrame {
        let mut rng = Rng::new(seed);
        let mut values = Array2::from_shape_simple_fn((n, 3), || rng.unit() - 0.5);
        for t in 1..n {
            values[[t, 1]] += 0.8 * values[[t - 1, 0]];
        }
        DataFrame::new(vec![values], ["a", "b", "c"].map(str::to_owned).to_vec()).unwrap()
    }

    fn run(data: &DataFrame, settings: &GrangerSettings) -> GrangerResult {
        run_granger(data, settings, &Control::default()).unwrap()
    }

    #[test]
    fn the_right_number_of_lags_is_chosen() {
        let settings =
            GrangerSettings { tau_max: 5, choose_lags: Some(Criterion::Bic), ..GrangerSettings::default() };
        let result = run(&chain(400, 3), &settings);
        assert_eq!((result.lags, result.links.graph.dim()), (1, (3, 3, 6)));
        assert_eq!(result.links.graph[[0, 1, 1]], LinkMark::Forward);
    }

    #[test]
    fn nothing_points_to_an_exogenous_variable() {
        let settings = GrangerSettings { exogenous: vec![1], ..GrangerSettings::default() };
        let result = run(&chain(200, 5), &settings);
        assert!(result.links.graph.iter().all(|mark| !mark.is_link()), "{:?}", result.links.graph);
    }

    #[test]
    fn copies_are_named_and_are_no_causes() {
        let data = chain(200, 7);
        let twice = data.select(&[0, 0, 1, 2]);
        let result = run(&twice, &GrangerSettings::default());
        assert!(
            result.links.remarks[0].starts_with("a, a determine each other"),
            "{:?}",
            result.links.remarks
        );
        assert!(!result.links.graph[[0, 2, 1]].is_link() && !result.links.graph[[1, 2, 1]].is_link());
        assert!(result.links.samples[[0, 2, 1]].is_some_and(|samples| samples.used == 0), "it is not tested");
    }

    #[test]
    fn a_correction_never_adds_a_link() {
        let data = chain(120, 11);
        let plain = run(&data, &GrangerSettings { tau_max: 3, ..GrangerSettings::default() });
        let fewer = run(&data, &GrangerSettings { tau_max: 3, fdr: Fdr::Bh, ..GrangerSettings::default() });
        for (at, mark) in fewer.links.graph.indexed_iter() {
            assert!(!mark.is_link() || plain.links.graph[at].is_link());
        }
        assert!(fewer.links.graph[[0, 1, 1]].is_link());
    }

    #[test]
    fn too_few_samples_are_one_sentence() {
        let settings = GrangerSettings { tau_max: 4, ..GrangerSettings::default() };
        let error = run_granger(&chain(15, 1), &settings, &Control::default()).unwrap_err().to_string();
        assert!(error.contains("11 complete samples are too few for 13 coefficients"), "{error}");
        let settings = GrangerSettings { tau_min: 0, ..GrangerSettings::default() };
        assert!(run_granger(&chain(50, 1), &settings, &Control::default()).is_err());
    }
}
