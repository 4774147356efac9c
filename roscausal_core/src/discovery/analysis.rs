//! One analysis from settings to model: the door through which commands and the discovery node come in.

use super::{Control, DataFrame, Model, model};
use crate::{Error, Result, batch::header, independence_tests};

/// Methods by the names users choose them by.
const METHODS: [&str; 6] = ["fpcmci", "pcmci", "pcmciplus", "fullci", "bivci", "lagdep"];
/// Estimators of the transfer-entropy filter.
const ESTIMATORS: [&str; 2] = ["gaussian", "kraskov"];
/// Corrections for many tests.
const CORRECTIONS: [&str; 2] = ["none", "fdr_bh"];

/// What to analyse, and how. Plain data; [`Settings::check`] says whether it makes sense.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// One of `fpcmci`, `pcmci`, `pcmciplus`, `fullci`, `bivci`, `lagdep`.
    pub method: String,
    /// Name of an independence test ([`independence_tests::names`]).
    pub cond_ind_test: String,
    /// Significance level of a link, in (0, 1).
    pub alpha: f64,
    /// Level of the condition selection, in (0, 1); `None`: chosen per variable by a score.
    pub pc_alpha: Option<f64>,
    /// Smallest lag, in steps.
    pub tau_min: usize,
    /// Largest lag, in steps.
    pub tau_max: usize,
    /// Level of the transfer-entropy filter; `None`: `alpha`.
    pub f_alpha: Option<f64>,
    /// `gaussian` or `kraskov`.
    pub te_estimator: String,
    /// Whether F-PCMCI drops variables that depend on their own past only.
    pub neglect_only_autodep: bool,
    /// `none` or `fdr_bh`.
    pub fdr: String,
    /// Variables that nothing may cause.
    pub exogenous: Vec<String>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Memory in bytes that a test may take; `None`: no bound.
    pub max_memory: Option<usize>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: "fpcmci".into(),
            cond_ind_test: "gpdc".into(),
            alpha: 0.05,
            pc_alpha: Some(0.2),
            tau_min: 1,
            tau_max: 1,
            f_alpha: None,
            te_estimator: "gaussian".into(),
            neglect_only_autodep: true,
            fdr: "none".into(),
            exogenous: Vec::new(),
            seed: 42,
            max_memory: None,
        }
    }
}

impl Settings {
    /// Whether the settings make sense by themselves.
    ///
    /// # Errors
    /// The first one that does not: its name, its value, what is allowed.
    pub fn check(&self) -> Result<()> {
        one_of("method", &self.method, &METHODS)?;
        independence_tests::by_name(&self.cond_ind_test, &self.test_settings())?;
        one_of("te-estimator", &self.te_estimator, &ESTIMATORS)?;
        one_of("fdr", &self.fdr, &CORRECTIONS)?;
        level("alpha", self.alpha)?;
        self.pc_alpha.map_or(Ok(()), |alpha| level("pc-alpha", alpha))?;
        self.f_alpha.map_or(Ok(()), |alpha| level("f-alpha", alpha))?;
        if self.tau_max < self.tau_min {
            let reason = format!("{} is below tau-min {}; lags run from tau-min to tau-max", self.tau_max, self.tau_min);
            return Err(Error::param("tau-max", reason));
        }
        if self.tau_max == 0 {
            return Err(Error::param("tau-max", "0 leaves no past; give at least 1"));
        }
        if self.method == "fpcmci" && self.tau_min == 0 {
            let reason = "0: the transfer-entropy filter of fpcmci knows the past only; give 1, or use pcmciplus";
            return Err(Error::param("tau-min", reason));
        }
        Ok(())
    }

    fn test_settings(&self) -> independence_tests::TestSettings {
        independence_tests::TestSettings { seed: self.seed, max_memory: self.max_memory, ..Default::default() }
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
        let unknown = self.exogenous.iter().find(|name| header::position(data.var_names(), name).is_none());
        match unknown {
            Some(name) => {
                let all = data.var_names().join(", ");
                Err(Error::param("exogenous", format!("there is no variable '{name}'; variables: {all}")))
            }
            None => Ok(()),
        }
    }
}

fn one_of(name: &str, value: &str, allowed: &[&str]) -> Result<()> {
    if allowed.contains(&value) {
        return Ok(());
    }
    let hint = header::nearest(allowed, value).map_or(String::new(), |near| format!("did you mean '{near}'? "));
    Err(Error::param(name, format!("'{value}' is unknown; {hint}allowed: {}", allowed.join(", "))))
}

fn level(name: &str, value: f64) -> Result<()> {
    if value > 0.0 && value < 1.0 {
        return Ok(());
    }
    Err(Error::param(name, format!("{value} is not a level; give a number between 0 and 1, such as 0.05")))
}
