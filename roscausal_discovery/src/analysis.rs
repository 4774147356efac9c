//! One analysis, from settings to model. The commands and the discovery node all enter here.

use crate::{
    evidence::{Evidence, Known},
    ground::{CondIndTest, Control, DataFrame, Error, LinkAssumptions, Result, Samples, names},
    independence_tests::{self, GpSearch, Significance},
    methods::{
        DynotearsSettings, Fdr, FpcmciResult, FpcmciSettings, GrangerSettings, LpcmciSettings, Method,
        PcmciPlusSettings, PcmciResult, PcmciSettings, Reads, Status, VarlingamSettings,
        get_lagged_dependencies, run_bivci, run_dynotears, run_fpcmci, run_fullci, run_granger, run_lpcmci,
        run_pcmci, run_pcmciplus, run_varlingam,
    },
    model::{self, Matrices, Model},
    transfer_entropy::TeEstimator,
};

/// Level of the condition selection.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PcAlpha {
    /// The method's own default ([`MethodInfo::pc_alpha`](crate::methods::MethodInfo::pc_alpha)).
    #[default]
    Default,
    /// A fixed level, in (0, 1).
    Fixed(f64),
    /// Chosen by a model-selection score.
    ByScore,
}

/// What to analyse, and how. Plain data; [`Settings::check`] says whether it is valid.
///
/// ```
/// use roscausal_discovery::{PcAlpha, Settings, methods::Method};
///
/// let settings = Settings { method: Method::Pcmciplus, tau_min: 0, tau_max: 3, ..Settings::default() };
/// assert!(settings.check().is_ok());
/// // The method's own level of the condition selection.
/// assert_eq!((settings.pc_alpha, settings.level_of_pc()), (PcAlpha::Default, Some(0.01)));
/// let error = Settings { tau_min: 5, ..settings }.check().unwrap_err();
/// assert!(error.to_string().contains("tau-max"));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The method.
    pub method: Method,
    /// Name of an independence test ([`independence_tests::names`]).
    pub cond_ind_test: String,
    /// Significance level of a link, in (0, 1).
    pub alpha: f64,
    /// Level of the condition selection.
    pub pc_alpha: PcAlpha,
    /// Smallest lag, in steps.
    pub tau_min: usize,
    /// Largest lag, in steps.
    pub tau_max: usize,
    /// Level of the transfer-entropy filter; `None`: `alpha`.
    pub f_alpha: Option<f64>,
    /// Estimator of the transfer-entropy filter.
    pub te_estimator: TeEstimator,
    /// Whether F-PCMCI drops variables that depend on their own past only.
    pub neglect_only_autodep: bool,
    /// Correction for many tests.
    pub fdr: Fdr,
    /// Variables that may be causes only: no link points to them.
    pub exogenous: Vec<String>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// How GPDC searches for the maximum of a likelihood.
    pub gp_search: GpSearch,
    /// GPDC's searches from random places, of which the best counts.
    pub gp_restarts: usize,
    /// Memory in bytes that a test may take; `None`: no limit.
    pub max_memory: Option<usize>,
    /// Which links may exist; `None`: all.
    pub link_assumptions: Option<LinkAssumptions>,
    /// Largest condition set of the condition selection; `None`: no limit.
    pub max_conds: Option<usize>,
    /// How a test value becomes a p-value; `None`: the test's own way.
    pub significance: Option<Significance>,
    /// Surrogates of a shuffle test, or size of a null distribution; `None`: the test's own number.
    pub shuffles: Option<usize>,
    /// What only PCMCI+ has.
    pub pcmciplus: PcmciPlusSettings,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::Fpcmci,
            cond_ind_test: "gpdc".into(),
            alpha: 0.05,
            pc_alpha: PcAlpha::Default,
            tau_min: 1,
            tau_max: 1,
            f_alpha: None,
            te_estimator: TeEstimator::Auto,
            neglect_only_autodep: true,
            fdr: Fdr::None,
            exogenous: Vec::new(),
            seed: 42,
            gp_search: GpSearch::Default,
            gp_restarts: 0,
            max_memory: None,
            link_assumptions: None,
            max_conds: None,
            significance: None,
            shuffles: None,
            pcmciplus: PcmciPlusSettings::default(),
        }
    }
}

impl Settings {
    /// Checks the settings on their own, without data.
    ///
    /// # Errors
    /// The first invalid setting: its name, its value, and what is allowed.
    pub fn check(&self) -> Result<()> {
        independence_tests::by_name(&self.cond_ind_test, &self.test_settings())?;
        self.check_numbers()
    }

    /// Checks everything but the name of the test.
    fn check_numbers(&self) -> Result<()> {
        level("alpha", self.alpha)?;
        if let PcAlpha::Fixed(alpha) = self.pc_alpha {
            level("pc-alpha", alpha)?;
        }
        self.f_alpha.map_or(Ok(()), |alpha| level("f-alpha", alpha))?;
        if self.tau_max < self.tau_min {
            let reason = format!(
                "{} is below tau-min {}; lags run from tau-min to tau-max",
                self.tau_max, self.tau_min
            );
            return Err(Error::param("tau-max", reason));
        }
        let info = self.method.info();
        if self.method == Method::Lpcmci {
            self.check_lpcmci()?;
        } else if self.tau_max == 0 && !info.models_lag_zero {
            return Err(Error::param("tau-max", "0 leaves no past; give at least 1"));
        }
        if self.tau_min == 0 && !info.lag_zero {
            let what = if self.method.reads(Reads::FAlpha) { "the transfer-entropy filter of " } else { "" };
            let reason =
                format!("0: {what}{} knows the past only; give 1, or use {}", self.method, Method::Pcmciplus);
            return Err(Error::param("tau-min", reason));
        }
        if self.tau_min > 0 && info.models_lag_zero {
            let reason =
                format!("{}: {} models lag 0 too; give 0, or leave it out", self.tau_min, self.method);
            return Err(Error::param("tau-min", reason));
        }
        if self.fdr != Fdr::None && !info.asks_test && self.method != Method::Granger {
            return Err(Error::param(
                "fdr",
                format!("{} tests no links one by one; choose none", self.method),
            ));
        }
        Ok(())
    }

    /// LPCMCI has one level, no correction, and works on data without time, too.
    fn check_lpcmci(&self) -> Result<()> {
        if self.pc_alpha == PcAlpha::ByScore {
            return Err(Error::param(
                "pc-alpha",
                "lpcmci has no score that chooses a level; give one, such as 0.05",
            ));
        }
        if self.fdr != Fdr::None {
            let reason = "a p-value of lpcmci is the largest of many tests and is not corrected; choose none";
            return Err(Error::param("fdr", reason));
        }
        Ok(())
    }

    fn lpcmci(&self, data: &DataFrame) -> LpcmciSettings {
        let of_name = |name| names::position(data.var_names(), name);
        let context: Vec<usize> = self.exogenous.iter().filter_map(|name| of_name(name)).collect();
        let all = LinkAssumptions::all_with_hidden_causes(data.n_vars(), self.tau_min, self.tau_max);
        let usual = LpcmciSettings::default();
        LpcmciSettings {
            tau_min: self.tau_min,
            tau_max: self.tau_max,
            pc_alpha: self.level_of_pc().unwrap_or(usual.pc_alpha),
            link_assumptions: (!context.is_empty()).then(|| all.exogenous(&context)),
            ..usual
        }
    }

    /// A model that holds the settings and no result yet.
    pub fn blank_model(&self) -> Model {
        Model {
            schema: model::SCHEMA.to_owned(),
            status: "complete".to_owned(),
            method: self.method.name().to_owned(),
            cond_ind_test: if self.method.info().asks_test {
                self.cond_ind_test.clone()
            } else {
                "none".to_owned()
            },
            alpha: self.alpha,
            pc_alpha: self.level_of_pc(),
            f_alpha: self.method.reads(Reads::FAlpha).then_some(self.f_alpha.unwrap_or(self.alpha)),
            fdr: self.fdr.name().to_owned(),
            tau_min: self.tau_min,
            tau_max: self.tau_max,
            dt: None,
            n_samples: 0,
            n_recordings: 1,
            seed: self.seed,
            run_time_s: None,
            features: Vec::new(),
            dropped: Vec::new(),
            links: Vec::new(),
            graph: Vec::new(),
            val_matrix: Vec::new(),
            p_matrix: Vec::new(),
            causal_structure: Vec::new(),
            val: Vec::new(),
            pval: Vec::new(),
            warnings: Vec::new(),
            about_data: None,
        }
    }

    /// The level of the condition selection; `None` if a score chooses it.
    pub fn level_of_pc(&self) -> Option<f64> {
        match self.pc_alpha {
            PcAlpha::Fixed(alpha) => Some(alpha),
            PcAlpha::ByScore => None,
            PcAlpha::Default => Some(self.method.info().pc_alpha),
        }
    }

    fn test_settings(&self) -> independence_tests::TestSettings {
        independence_tests::TestSettings {
            seed: self.seed,
            gp_search: self.gp_search,
            gp_restarts: self.gp_restarts,
            max_memory: self.max_memory,
            significance: self.significance,
            sig_samples: self.shuffles,
            ..Default::default()
        }
    }

    /// The exogenous variables by their place.
    fn context(&self, data: &DataFrame) -> Vec<usize> {
        self.exogenous.iter().filter_map(|name| names::position(data.var_names(), name)).collect()
    }

    fn granger(&self, data: &DataFrame) -> GrangerSettings {
        GrangerSettings {
            tau_min: self.tau_min,
            tau_max: self.tau_max,
            choose_lags: None,
            alpha_level: self.alpha,
            fdr: self.fdr,
            exogenous: self.context(data),
        }
    }

    fn varlingam(&self, data: &DataFrame) -> VarlingamSettings {
        VarlingamSettings {
            tau_max: self.tau_max,
            alpha_level: self.alpha,
            exogenous: self.context(data),
            ..VarlingamSettings::default()
        }
    }

    fn dynotears(&self, data: &DataFrame) -> DynotearsSettings {
        DynotearsSettings {
            tau_max: self.tau_max,
            exogenous: self.context(data),
            ..DynotearsSettings::default()
        }
    }

    fn pcmci(&self, data: &DataFrame) -> PcmciSettings {
        let context = self.context(data);
        let given = self.link_assumptions.clone();
        let restricted = given.is_some() || !context.is_empty();
        let all = || LinkAssumptions::all(data.n_vars(), self.tau_min, self.tau_max);
        let links = given.unwrap_or_else(all).exogenous(&context);
        PcmciSettings {
            tau_min: self.tau_min,
            tau_max: self.tau_max,
            pc_alpha: self.level_of_pc().into_iter().collect(),
            alpha_level: self.alpha,
            fdr: self.fdr,
            link_assumptions: restricted.then_some(links),
            max_conds_dim: self.max_conds,
            ..PcmciSettings::default()
        }
    }

    /// Checks that the data can be analysed with these settings at all.
    fn check_data(&self, data: &DataFrame) -> Result<()> {
        if data.n_vars() < 2 {
            return Err(Error::Data(format!(
                "there is only one variable, '{}'; a cause and an effect need at least two columns (the time does not \
                 count)",
                data.var_names()[0]
            )));
        }
        let unknown = self.exogenous.iter().find(|name| names::position(data.var_names(), name).is_none());
        match unknown {
            Some(name) => {
                let all = data.var_names().join(", ");
                Err(Error::param("exogenous", format!("there is no variable '{name}'; variables: {all}")))
            }
            None => Ok(()),
        }
    }
}

fn level(name: &str, value: f64) -> Result<()> {
    if value > 0.0 && value < 1.0 {
        return Ok(());
    }
    Err(Error::param(name, format!("{value} is not a level; give a number between 0 and 1, such as 0.05")))
}

/// Analyses `data` with `settings` under `control`: from data to model in one call.
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, Settings, analyse};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let mut values = ndarray::Array2::zeros((150, 2));
/// # for t in 1..150 {
/// #     values[[t, 0]] = noise(2 * t);
/// #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
/// # }
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// // F-PCMCI with GPDC at lag 1.
/// let model = analyse(&data, &Settings::default(), &Control::default())?;
/// assert_eq!((model.features.len(), model.links.len()), (2, 1));
/// assert!(model.to_json().contains("\"cause\": \"a\""));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Invalid settings, unsuitable data, or cancellation. Running out of time is not an error: the model's status says
/// so.
pub fn analyse(data: &DataFrame, settings: &Settings, control: &Control) -> Result<Model> {
    Ok(run(data, settings, control, false)?.0)
}

/// As [`analyse`], and keeps what stands behind each link. The model is the same.
///
/// # Errors
/// As [`analyse`].
pub fn analyse_with_evidence(
    data: &DataFrame,
    settings: &Settings,
    control: &Control,
) -> Result<(Model, Evidence)> {
    let (model, evidence) = run(data, settings, control, true)?;
    Ok((model, evidence.unwrap_or_default()))
}

fn run(
    data: &DataFrame,
    settings: &Settings,
    control: &Control,
    keep: bool,
) -> Result<(Model, Option<Evidence>)> {
    let test = independence_tests::by_name(&settings.cond_ind_test, &settings.test_settings())?;
    analysed(data, test.as_ref(), settings, control, keep)
}

/// Analyses `data` as [`analyse`] does, with a test of your own instead of the one that the settings name.
///
/// # Errors
/// As [`analyse`], and those of the test.
pub fn analyse_with(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &Settings,
    control: &Control,
) -> Result<Model> {
    let settings = Settings { cond_ind_test: test.name().to_owned(), ..settings.clone() };
    Ok(analysed(data, test, &settings, control, false)?.0)
}

fn analysed(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &Settings,
    control: &Control,
    keep: bool,
) -> Result<(Model, Option<Evidence>)> {
    settings.check_numbers()?;
    settings.check_data(data)?;
    let pcmci = settings.pcmci(data);
    let remarks = remarks_on_levels(data, test);
    let result = match settings.method {
        Method::Fpcmci => {
            let (mut model, evidence) = filtered(data, test, settings, pcmci, control, keep)?;
            model.warnings.extend(remarks);
            return Ok((model, evidence));
        }
        Method::Pcmci => run_pcmci(data, test, &pcmci, control),
        Method::Pcmciplus => run_pcmciplus(data, test, &pcmci, &settings.pcmciplus, control),
        Method::Fullci => run_fullci(data, test, &pcmci, control),
        Method::Bivci => run_bivci(data, test, &pcmci, control),
        Method::Lagdep => get_lagged_dependencies(data, test, &pcmci, control),
        Method::Granger => run_granger(data, &settings.granger(data), control).map(|found| found.links),
        Method::Varlingam => run_varlingam(data, &settings.varlingam(data), control).map(|found| found.links),
        Method::Dynotears => run_dynotears(data, &settings.dynotears(data), control).map(|found| found.links),
        Method::Lpcmci => run_lpcmci(data, test, &settings.lpcmci(data), control).map(|found| found.result),
    }?;
    control.tell(result.effort.as_deref());
    let blank = Model { n_recordings: data.recordings().len(), ..settings.blank_model() };
    let mut model = with_result(blank, data.var_names().to_vec(), result.clone());
    model.warnings.extend(remarks);
    let evidence = keep.then(|| Evidence::gather(data, data, &model, settings.method, &Known::of(&result)));
    Ok((model, evidence))
}

/// Variables that a test of categories cannot judge, because almost every sample is a category of its own.
fn remarks_on_levels(data: &DataFrame, test: &dyn CondIndTest) -> Vec<String> {
    if test.name() != "gsquared" {
        return Vec::new();
    }
    let remark = |var: usize| {
        let values = data.recordings().iter().flat_map(|recording| recording.column(var).to_vec());
        let values: Vec<u64> = values.filter(|v| v.is_finite()).map(|v| (v + 0.0).to_bits()).collect();
        let levels = values.iter().collect::<std::collections::HashSet<_>>().len();
        let few = values.len() < FEWEST_OF_A_LEVEL * levels;
        few.then(|| {
            format!(
                "'{}' has {levels} different values in {} samples: gsquared is for categories and takes each value for one, so its \
                 result on it means nothing; make categories of it, or take a test for numbers such as parcorr or gpdc",
                data.var_names()[var],
                values.len()
            )
        })
    };
    (0..data.n_vars()).filter_map(remark).collect()
}

/// Samples of a category that the G test needs on average (McDonald 2014, "Small numbers").
const FEWEST_OF_A_LEVEL: usize = 5;

/// F-PCMCI: the model keeps the variables that have a link; the others are listed as dropped.
fn filtered(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &Settings,
    pcmci: PcmciSettings,
    control: &Control,
    keep: bool,
) -> Result<(Model, Option<Evidence>)> {
    let n_samples = Samples::new(data, 2 * settings.tau_max).len();
    let settings_of_method = FpcmciSettings {
        te_estimator: settings.te_estimator,
        f_alpha: settings.f_alpha.unwrap_or(settings.alpha),
        neglect_only_autodep: settings.neglect_only_autodep,
        seed: settings.seed,
        pcmci,
    };
    let result = run_fpcmci(data, test, &settings_of_method, control)?;
    let remarks = remarks_on_filter(settings.te_estimator, test, &result);
    let name = |&var: &usize| data.var_names()[var].clone();
    let features: Vec<String> = result.features.iter().map(name).collect();
    let others = (0..data.n_vars()).filter(|var| !result.features.contains(var));
    let dropped = others.map(|var| name(&var)).collect();
    let n_recordings = data.recordings().len();
    let blank = Model { n_samples, n_recordings, dropped, ..settings.blank_model() };
    let mut evidence = None;
    let mut model = match result.pcmci {
        Some(found) => {
            let place = |var: &usize| result.selected.iter().position(|selected| selected == var);
            control.tell(found.effort.as_deref());
            let places: Vec<usize> = result.features.iter().filter_map(place).collect();
            let model = with_result(blank, features, found.on_features(&places));
            evidence = keep.then(|| {
                let tested = data.select(&result.selected);
                Evidence::gather(data, &tested, &model, settings.method, &Known::of(&found))
            });
            model
        }
        None => blank,
    };
    model.warnings.extend(remarks);
    if let Status::Partial(how_far) = result.status {
        model.status = format!("partial: {how_far}");
    }
    Ok((model, evidence))
}

/// What a user should know about F-PCMCI's filter.
fn remarks_on_filter(estimator: TeEstimator, test: &dyn CondIndTest, result: &FpcmciResult) -> Vec<String> {
    let mut remarks = Vec::new();
    if estimator == TeEstimator::Gaussian && !test.is_linear() {
        remarks.push(format!(
            "the gaussian filter passes linear dependence only, so links that only {} sees may be missing; the te-estimator \
             auto passes them too",
            test.name()
        ));
    }
    if result.filter.is_some() && result.selected.is_empty() {
        remarks.push(
            "the filter lets nothing through: at this level no variable informs another, so no link was tested; the method \
             pcmci tests all"
                .into(),
        );
    }
    remarks
}

fn with_result(blank: Model, features: Vec<String>, result: PcmciResult) -> Model {
    let n = features.len();
    let matrices = Matrices {
        graph: nested(n, blank.tau_max, |at| result.graph[at].symbol().to_owned()),
        val_matrix: nested(n, blank.tau_max, |at| result.val_matrix[at]),
        p_matrix: nested(n, blank.tau_max, |at| result.deciding_p()[at]),
        n_lost: nested(n, blank.tau_max, |at| result.n_lost[at]),
    };
    let mut model = blank.with_matrices(features, matrices);
    model.n_samples = result.n_samples;
    model.warnings.extend(result.remarks);
    if let Status::Partial(how_far) = result.status {
        model.status = format!("partial: {how_far}");
    }
    model
}

fn nested<T>(n: usize, tau_max: usize, at: impl Fn([usize; 3]) -> T) -> Vec<Vec<Vec<T>>> {
    let lags = |i, j| (0..=tau_max).map(|lag| at([i, j, lag])).collect();
    (0..n).map(|i| (0..n).map(|j| lags(i, j)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `b` follows `a` one step later.
    fn pair() -> DataFrame {
        let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
        let mut values = ndarray::Array2::zeros((300, 2));
        for t in 1..300 {
            values[[t, 0]] = noise(2 * t);
            values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
        }
        DataFrame::new(vec![values], vec!["a".into(), "b".into()]).unwrap()
    }

    fn settings(method: Method) -> Settings {
        Settings { method, tau_min: method.info().tau_min, ..Settings::default() }
    }

    #[test]
    fn every_method_finds_the_link_and_names_its_test() {
        for method in Method::all().filter(|method| *method != Method::Lagdep) {
            let of_method = Settings { cond_ind_test: "parcorr".into(), ..settings(method) };
            let model = analyse(&pair(), &of_method, &Control::default()).unwrap();
            let found =
                model.links.iter().any(|link| link.cause == "a" && link.effect == "b" && link.lag == 1);
            assert!(found, "{method}: {:?}", model.links);
            let test = if method.info().asks_test { "parcorr" } else { "none" };
            assert_eq!(model.cond_ind_test, test, "{method}");
        }
    }

    #[test]
    fn lag_0_alone_is_for_methods_that_model_it() {
        for method in Method::all() {
            let alone = Settings { tau_max: 0, tau_min: 0, ..settings(method) };
            assert_eq!(alone.check().is_ok(), method.info().models_lag_zero, "{method}");
            if alone.check().is_ok() {
                let model = analyse(&pair(), &alone, &Control::default()).unwrap();
                assert_eq!(model.graph[0][1].len(), 1, "{method}");
            }
        }
        let error = Settings { tau_min: 1, ..settings(Method::Varlingam) }.check().unwrap_err().to_string();
        assert!(error.contains("models lag 0 too"), "{error}");
    }
}
