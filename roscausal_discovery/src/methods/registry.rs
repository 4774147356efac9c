//! The methods by name: one line each says what a user, a command and a node have to know of it.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use crate::{
    independence_tests::spelled,
    types::{Error, Result, text::listed},
};

use Reads::{
    ActsOn, ExtraConditions, FAlpha, Fdr, MaxConds, MaxSets, NeglectOnlyAutodep, Orientation, PcAlpha,
    TeEstimator,
};

/// A method of causal discovery.
///
/// ```
/// use roscausal_discovery::methods::Method;
///
/// let method: Method = "PCMCI+".parse()?;
/// assert_eq!(method, Method::Pcmciplus);
/// assert!(method.info().lag_zero && !method.info().hidden_causes);
/// let error = "pcmcip".parse::<Method>().unwrap_err().to_string();
/// assert!(error.contains("did you mean 'pcmci'?"));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Method {
    /// PCMCI behind a transfer-entropy filter ([`run_fpcmci`](super::run_fpcmci)).
    #[default]
    Fpcmci,
    /// Lagged links ([`run_pcmci`](super::run_pcmci)).
    Pcmci,
    /// Lagged and contemporaneous links ([`run_pcmciplus`](super::run_pcmciplus)).
    Pcmciplus,
    /// Each link given all others ([`run_fullci`](super::run_fullci)).
    Fullci,
    /// Each link given its target's own past ([`run_bivci`](super::run_bivci)).
    Bivci,
    /// Each link given nothing ([`get_lagged_dependencies`](super::get_lagged_dependencies)).
    Lagdep,
    /// Regressions on the past of all variables ([`run_granger`](super::run_granger)).
    Granger,
    /// A linear model oriented by noise that is not Gaussian ([`run_varlingam`](super::run_varlingam)).
    Varlingam,
    /// A sparse linear model without cycles ([`run_dynotears`](super::run_dynotears)).
    Dynotears,
    /// Models whose noise must be independent ([`run_timino`](super::run_timino)).
    Timino,
    /// Links where common causes may be hidden ([`run_lpcmci`](super::run_lpcmci)).
    Lpcmci,
    /// The same, with interventions ([`run_candoit`](super::run_candoit)).
    Candoit,
    /// The same question as LPCMCI's, the older way ([`run_tsfci`](super::run_tsfci)).
    Tsfci,
    /// Links of several recordings that may differ ([`run_jpcmciplus`](super::run_jpcmciplus)).
    Jpcmciplus,
}

/// A setting that some methods read and others do not. Every method reads the level, the lags, the exogenous variables and the
/// seed; those that ask a test read the test and the correction, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reads {
    /// Level of the condition selection.
    PcAlpha,
    /// Level of the transfer-entropy filter.
    FAlpha,
    /// Estimator of the transfer-entropy filter.
    TeEstimator,
    /// Whether variables that depend on their own past only are left out.
    NeglectOnlyAutodep,
    /// How links at lag 0 are oriented: the rule for colliders, and what happens where orientations contradict each other.
    Orientation,
    /// Largest set of conditions that is chosen from more.
    MaxConds,
    /// Correction of the p-values of single tests for their number.
    Fdr,
    /// Most sets of conditions of one size for a pair.
    MaxSets,
    /// Whether contexts of interventions join their variables as conditions.
    ExtraConditions,
    /// Which variable each column of interventions sets.
    ActsOn,
}

/// What there is to know of a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MethodInfo {
    /// The method.
    pub method: Method,
    /// The name that users choose it by; any case, `_` and `-` anywhere.
    pub name: &'static str,
    /// Other names of it.
    pub aliases: &'static [&'static str],
    /// Smallest lag, where the user gives none.
    pub tau_min: usize,
    /// Level of the condition selection, where the user gives none.
    pub pc_alpha: f64,
    /// Whether that level decides on the links, too, and `alpha` is not read.
    pub one_level: bool,
    /// The independence test, where the user names none.
    pub test: &'static str,
    /// The settings that it reads and not every method does.
    pub reads: &'static [Reads],
    /// Whether it tests links at lag 0.
    pub lag_zero: bool,
    /// Whether it allows for causes that were not recorded.
    pub hidden_causes: bool,
    /// Whether it analyses several recordings as one system.
    pub several_recordings: bool,
    /// Whether each link comes with a p-value.
    pub p_values: bool,
    /// Whether it asks an independence test (TiMINo: for a regression); the others are models of linear effects.
    pub uses_test: bool,
    /// Whether it models lag 0 alone, too: `tau_max` may be 0, and `tau_min` must be.
    pub models_lag_zero: bool,
    /// What must hold for its answer to be right, beyond dense enough samples and a system that does not change.
    pub assumes: &'static str,
    /// What it can say.
    pub says: &'static str,
    /// How its run time grows: `N` variables, `p` lags, `T` samples.
    pub cost: &'static str,
    /// When to take it.
    pub take_it: &'static str,
}

/// What most methods have in common.
const USUAL: MethodInfo = MethodInfo {
    method: Method::Pcmci,
    name: "pcmci",
    aliases: &[],
    tau_min: 1,
    pc_alpha: 0.2,
    one_level: false,
    test: "gpdc",
    reads: &[],
    lag_zero: true,
    hidden_causes: false,
    several_recordings: true,
    p_values: true,
    uses_test: true,
    models_lag_zero: false,
    assumes: "all common causes recorded",
    says: "lagged links; pairs at lag 0 without a direction",
    cost: "(N p)^2 tests of few conditions",
    take_it: "as the first choice",
};

/// All methods, in the order of the enum: one entry each, which says how the method differs from the usual.
macro_rules! methods {
    ($($method:ident $name:literal $($key:ident: $value:expr),+;)+) => {
        const METHODS: [MethodInfo; [$($name),+].len()] =
            [$(MethodInfo { method: Method::$method, name: $name, $($key: $value,)+ ..USUAL }),+];
    };
}

const OF_FILTER: &[Reads] = &[PcAlpha, MaxConds, Fdr, FAlpha, TeEstimator, NeglectOnlyAutodep];

methods! {
    Fpcmci "fpcmci" reads: OF_FILTER, lag_zero: false,
        says: "lagged links",
        cost: "as pcmci on the variables that its filter keeps",
        take_it: "when some variables may have no part in the system, and with a slow test";
    Pcmci "pcmci" reads: &[PcAlpha, MaxConds, Fdr];
    Pcmciplus "pcmciplus" aliases: &["pcmci+"], tau_min: 0, pc_alpha: 0.01, one_level: true,
        reads: &[PcAlpha, MaxConds, Fdr, Orientation],
        says: "lagged links; links at lag 0 with a direction where the data have one",
        cost: "as pcmci, and sets of neighbours at lag 0",
        take_it: "when effects follow faster than the samples";
    Fullci "fullci" reads: &[Fdr],
        cost: "N^2 p tests of N p conditions",
        take_it: "with few variables and many samples, to compare";
    Bivci "bivci" reads: &[Fdr],
        assumes: "no third variable drives two others",
        says: "pairs",
        cost: "N^2 p tests of p conditions",
        take_it: "as the Granger test of two variables";
    Lagdep "lagdep" aliases: &["laggeddependencies"], reads: &[Fdr],
        assumes: "nothing",
        says: "dependencies, not links",
        cost: "N^2 p tests without conditions",
        take_it: "to choose tau_max before anything else";
    Granger "granger" reads: &[Fdr], lag_zero: false, uses_test: false,
        assumes: "all common causes recorded; linear effects, none within a sample",
        says: "lagged links",
        cost: "one regression, T (N p)^2",
        take_it: "as the baseline, with few variables and many samples";
    Varlingam "varlingam" tau_min: 0, uses_test: false, models_lag_zero: true,
        assumes: "all common causes recorded; linear effects, noise that is not Gaussian, no cycle within a sample",
        says: "lagged links; links at lag 0, all with a direction",
        cost: "T N^3 and T (N p)^2",
        take_it: "where pcmciplus leaves lag 0 without a direction and the noise is far from Gaussian";
    Dynotears "dynotears" tau_min: 0, p_values: false, uses_test: false, models_lag_zero: true,
        assumes: "all common causes recorded; linear effects, noise of equal size, no cycle within a sample",
        says: "weights, lagged and at lag 0; no p-values",
        cost: "T (N p)^2 once, then steps of N^3 p",
        take_it: "to compare with results of others";
    Timino "timino" tau_min: 0,
        assumes: "noise that is independent of the causes and added to their effect; its test names the model: parcorr a line, gpdc any smooth form",
        says: "which variable drives which, and where it cannot tell; lags at which that shows",
        cost: "N^2 regressions on N p causes",
        take_it: "where effects are not linear or the noise is far from Gaussian, and no answer is better than a wrong one";
    Lpcmci "lpcmci" tau_min: 0, pc_alpha: 0.05, one_level: true,
        reads: &[PcAlpha, MaxConds, MaxSets], hidden_causes: true,
        assumes: "the system does not change, and no sample was selected",
        says: "causes, non-causes and hidden common causes, at lag 0 and later; where it cannot tell",
        cost: "some ten times pcmciplus",
        take_it: "when not everything was recorded";
    Candoit "candoit" tau_min: 0, pc_alpha: 0.05, one_level: true,
        reads: &[PcAlpha, MaxConds, MaxSets, ExtraConditions, ActsOn], hidden_causes: true,
        assumes: "as lpcmci; each intervention has a column: the imposed value, or 0",
        says: "as lpcmci; interventions tell causes from common causes",
        cost: "as lpcmci, with a column for each intervention",
        take_it: "when something was imposed for a while, such as a robot that stood still";
    Tsfci "tsfci" tau_min: 0, pc_alpha: 0.05, one_level: true,
        reads: &[PcAlpha, MaxConds], hidden_causes: true,
        assumes: "as lpcmci",
        says: "as lpcmci, with fewer links where variables depend on their own past",
        cost: "doubles with each variable and lag",
        take_it: "to compare with results of others";
    Jpcmciplus "jpcmciplus" aliases: &["jpcmci+"], tau_min: 0, pc_alpha: 0.01, one_level: true, test: "parcorr",
        reads: &[PcAlpha, MaxConds, Fdr, Orientation],
        assumes: "all common causes recorded but what is constant in a recording; linear effects, the same in all recordings",
        says: "as pcmciplus; what several recordings differ in makes no link",
        cost: "as pcmciplus, three times",
        take_it: "when several people, robots or days are pooled";
}

impl Method {
    /// All methods.
    pub fn all() -> impl Iterator<Item = Self> {
        METHODS.iter().map(|info| info.method)
    }

    /// Names of all methods.
    pub fn names() -> impl Iterator<Item = &'static str> {
        METHODS.iter().map(|info| info.name)
    }

    /// Its line in the registry.
    pub fn info(self) -> &'static MethodInfo {
        &METHODS[self as usize]
    }

    /// The name that users choose it by.
    pub fn name(self) -> &'static str {
        self.info().name
    }

    /// The table of all methods for a terminal: what each says, assumes and costs, and when to take it.
    ///
    /// ```
    /// use roscausal_discovery::methods::Method;
    ///
    /// assert!(Method::table().contains("take it:  as the baseline"));
    /// ```
    pub fn table() -> String {
        let yes = |flag: bool| if flag { "yes" } else { "no" };
        let entry = |info: &MethodInfo| {
            let MethodInfo { name, says, assumes, take_it, cost, .. } = info;
            let (lag, hidden, several) =
                (yes(info.lag_zero), yes(info.hidden_causes), yes(info.several_recordings));
            let (p_values, test) = (yes(info.p_values), yes(info.uses_test));
            format!(
                "{name}\n  says:     {says}\n  assumes:  {assumes}\n  take it:  {take_it}\n  cost:     {cost}\n  lag 0: {lag}, \
                 hidden causes: {hidden}, several recordings: {several}, p-values: {p_values}, independence test: {test}\n"
            )
        };
        METHODS.iter().map(entry).collect::<Vec<_>>().join("\n")
    }

    /// Names of the methods that read this setting.
    pub fn names_that_read(setting: Reads) -> String {
        let readers = Self::all().filter(|method| method.reads(setting)).map(Self::name);
        listed(&readers.collect::<Vec<_>>())
    }

    /// Whether it asks a test for p-values. TiMINo takes the regression of a test, and none of its p-values.
    pub fn uses_p_values(self) -> bool {
        self.info().uses_test && self != Self::Timino
    }

    /// Whether it reads this setting.
    pub fn reads(self, setting: Reads) -> bool {
        self.info().reads.contains(&setting)
    }
}

impl FromStr for Method {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wanted = spelled(text);
        let is_meant = |info: &&MethodInfo| info.name == wanted || info.aliases.contains(&wanted.as_str());
        match METHODS.iter().find(is_meant) {
            Some(info) => Ok(info.method),
            None => Err(Error::unknown("method", text, &Self::names().collect::<Vec<_>>())),
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_has_its_line_in_the_order_of_the_enum() {
        for (place, method) in Method::all().enumerate() {
            assert_eq!((method as usize, method.info().method), (place, method));
            assert_eq!(method.name().parse::<Method>().unwrap(), method);
            // Files write it as users do.
            assert_eq!(serde_json::to_string(&method).unwrap(), format!("\"{method}\""));
        }
    }

    #[test]
    fn a_method_is_known_by_its_aliases_in_any_spelling() {
        for (text, method) in [
            ("F-PCMCI", Method::Fpcmci),
            ("PCMCI", Method::Pcmci),
            ("pcmci+", Method::Pcmciplus),
            ("pcmci_plus", Method::Pcmciplus),
            ("lagged_dependencies", Method::Lagdep),
            ("J-PCMCI+", Method::Jpcmciplus),
            ("CAnDOIT", Method::Candoit),
        ] {
            assert_eq!(text.parse::<Method>().unwrap(), method, "{text}");
        }
    }

    #[test]
    fn the_table_says_all_of_every_method() {
        let table = Method::table();
        for info in Method::all().map(Method::info) {
            for text in [info.name, info.says, info.assumes, info.take_it, info.cost] {
                assert!(!text.is_empty() && table.contains(text), "{text}");
            }
            // A method that models lag 0 starts there.
            assert!(!info.models_lag_zero || (info.lag_zero && info.tau_min == 0), "{}", info.name);
        }
    }

    #[test]
    fn an_unknown_method_is_an_error_that_names_the_nearest() {
        for (text, near) in [("fpcmi", "fpcmci"), ("pcmciplu", "pcmciplus"), ("bivc", "bivci")] {
            let error = text.parse::<Method>().unwrap_err().to_string();
            assert!(error.contains(&format!("did you mean '{near}'?")), "{error}");
        }
        assert!("".parse::<Method>().is_err());
    }
}
