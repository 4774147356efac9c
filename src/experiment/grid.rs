//! The factors of an experiment: scenarios, lengths, steps, risks, tests and methods.

use roscausal_core::{Error, Result, batch::risk::RiskModel};
use roscausal_discovery::{
    PcAlpha, Settings,
    methods::{Method, Reads},
};
use serde::{Deserialize, Serialize};

/// Everything that defines a run except its seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Setting {
    pub(crate) scenario: String,
    /// Seconds recorded.
    pub(crate) length: f64,
    /// Seconds between samples.
    pub(crate) step: f64,
    pub(crate) risk_model: String,
    pub(crate) risk_lag: usize,
    pub(crate) method: Method,
    pub(crate) test: String,
}

/// The values of each factor, the base first.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    pub(crate) scenarios: Vec<String>,
    pub(crate) lengths: Vec<f64>,
    pub(crate) steps: Vec<f64>,
    pub(crate) risk_models: Vec<String>,
    pub(crate) risk_lags: Vec<usize>,
    pub(crate) methods: Vec<Method>,
    pub(crate) tests: Vec<String>,
}

/// Lengths and steps that a recording may have, seconds.
const LENGTHS: (f64, f64) = (20.0, 100_000.0);
const STEPS: (f64, f64) = (0.04, 10.0);

impl Grid {
    /// Checks every value.
    ///
    /// # Errors
    /// The first value that is not allowed, with what is allowed.
    pub(crate) fn check(&self, analysis: &Settings) -> Result<()> {
        within("lengths", &self.lengths, LENGTHS)?;
        within("steps", &self.steps, STEPS)?;
        self.risk_models.iter().try_for_each(|model| model.parse::<RiskModel>().map(drop))?;
        if let Some(lag) = self.risk_lags.iter().find(|lag| **lag > 1) {
            return Err(Error::param("risk-lags", format!("{lag} is not allowed; use 0 or 1")));
        }
        let reads = |method: &Method| method.reads(Reads::PcAlpha);
        if analysis.pc_alpha != PcAlpha::Default && !self.methods.iter().any(reads) {
            let others = Method::names_that_read(Reads::PcAlpha);
            let reason = format!("none of these methods chooses conditions; it applies to {others}");
            return Err(Error::param("pc_alpha", reason));
        }
        Ok(self.settings(true).iter().try_for_each(|setting| setting.analysis(analysis).check())?)
    }

    /// The settings of a sweep: the base, and every other value of each factor with the rest at the base. With
    /// `cross`, every combination.
    pub(crate) fn settings(&self, cross: bool) -> Vec<Setting> {
        let sizes = [
            self.scenarios.len(),
            self.lengths.len(),
            self.steps.len(),
            self.risk_models.len(),
            self.risk_lags.len(),
            self.methods.len(),
            self.tests.len(),
        ];
        // The last factor changes first.
        let places = |mut number: usize| {
            let mut places = [0; 7];
            for (place, size) in places.iter_mut().zip(sizes).rev() {
                (*place, number) = (number % size, number / size);
            }
            places
        };
        let is_wanted = |places: &[usize; 7]| cross || places.iter().filter(|place| **place > 0).count() < 2;
        let setting = |[scenario, length, step, risk_model, risk_lag, method, test]: [usize; 7]| Setting {
            scenario: self.scenarios[scenario].clone(),
            length: self.lengths[length],
            step: self.steps[step],
            risk_model: self.risk_models[risk_model].clone(),
            risk_lag: self.risk_lags[risk_lag],
            method: self.methods[method],
            test: self.tests[test].clone(),
        };
        (0..sizes.iter().product()).map(places).filter(is_wanted).map(setting).collect()
    }
}

/// Refuses a number of seconds that is not from `low` to `high`.
pub(super) fn within(name: &str, values: &[f64], (low, high): (f64, f64)) -> Result<()> {
    let outside = values.iter().find(|value| !(low..=high).contains(*value));
    let reason = |value: &f64| format!("{value} is not a number of seconds from {low} to {high}");
    outside.map_or(Ok(()), |value| Err(Error::param(name, reason(value))))
}

impl Setting {
    /// The analysis of this setting: its method and test, and the rest as in `base`, as far as the method reads it.
    pub(crate) fn analysis(&self, base: &Settings) -> Settings {
        let settings = Settings {
            method: self.method,
            cond_ind_test: self.test.clone(),
            tau_min: self.method.info().tau_min,
            ..base.clone()
        };
        settings.as_read()
    }

    /// The setting as cells of a table; [`Setting::HEADER`] names them.
    pub(crate) fn cells(&self) -> [String; 7] {
        [
            self.scenario.clone(),
            self.length.to_string(),
            self.step.to_string(),
            self.risk_model.clone(),
            self.risk_lag.to_string(),
            self.method.to_string(),
            self.test.clone(),
        ]
    }

    /// Names of [`Setting::cells`].
    pub(crate) const HEADER: [&str; 7] =
        ["scenario", "length_s", "step_s", "risk_model", "risk_lag", "method", "test"];
}

/// Seeds from `A..B`, including both ends, or a single seed.
pub(crate) fn seeds(text: &str) -> Result<Vec<u64>> {
    let fault = || Error::param("seeds", format!("'{text}' is not a range of seeds; write it as 1..20"));
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    let number = |text: &str| text.trim_start_matches('=').trim().parse::<u64>().map_err(|_| fault());
    let (first, last) = (number(first)?, number(last)?);
    if last < first || last - first >= 1_000_000 { Err(fault()) } else { Ok((first..=last).collect()) }
}

/// The part `I/N` of the jobs that this process does: those whose number modulo `N` is `I - 1`.
pub(crate) fn shard(text: &str) -> Result<(usize, usize)> {
    let fault =
        || Error::param("shard", format!("'{text}' is not a share; write 1/4 to 4/4 for four machines"));
    let (i, n) = text.split_once('/').ok_or_else(fault)?;
    match (i.trim().parse::<usize>(), n.trim().parse::<usize>()) {
        (Ok(i), Ok(n)) if (1..=n).contains(&i) => Ok((i, n)),
        _ => Err(fault()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        let texts = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect();
        Grid {
            scenarios: texts(&["encounters", "encounters_ignored"]),
            lengths: vec![300.0, 75.0, 150.0],
            steps: vec![0.3, 0.1],
            risk_models: texts(&["v1_1"]),
            risk_lags: vec![1, 0],
            methods: vec![Method::Fpcmci, Method::Pcmci],
            tests: texts(&["gpdc"]),
        }
    }

    #[test]
    fn a_sweep_varies_one_factor_at_a_time_around_the_base() {
        let settings = grid().settings(false);
        assert_eq!(settings.len(), 1 + 1 + 2 + 1 + 1 + 1);
        assert_eq!((settings[0].length, settings[0].step), (300.0, 0.3));
        assert!(settings.iter().all(|s| s.scenario == "encounters" || s.length == 300.0));
        assert_eq!(grid().settings(true).len(), 2 * 3 * 2 * 2 * 2);
    }

    #[test]
    fn values_that_make_no_sense_are_refused_by_name() {
        let refusal = |change: fn(&mut Grid)| {
            let mut grid = grid();
            change(&mut grid);
            grid.check(&Settings::default()).expect_err("is refused").to_string()
        };
        assert!(refusal(|grid| grid.lengths.push(-5.0)).contains("'lengths': -5"));
        assert!(refusal(|grid| grid.steps.push(f64::NAN)).contains("'steps': NaN"));
        assert!(refusal(|grid| grid.risk_models.push("v2".into())).contains("v1_0"));
        assert!(refusal(|grid| grid.risk_lags.push(2)).contains("0 or 1"));
        assert!(refusal(|grid| grid.tests.push("gpcd".into())).contains("gpdc"));
        assert!(grid().check(&Settings::default()).is_ok());
    }

    #[test]
    fn a_level_of_conditions_is_for_those_methods_of_a_sweep_that_choose_some() {
        let base = Settings { pc_alpha: PcAlpha::Fixed(0.1), ..Settings::default() };
        let mut grid = grid();
        grid.methods.push(Method::Granger);
        assert!(grid.check(&base).is_ok());
        let of = |method: Method| {
            let settings = grid.settings(true);
            let setting = settings.iter().find(|setting| setting.method == method).expect("is there");
            setting.analysis(&base).pc_alpha
        };
        assert_eq!((of(Method::Pcmci), of(Method::Granger)), (PcAlpha::Fixed(0.1), PcAlpha::Default));
        grid.methods = vec![Method::Granger];
        let error = grid.check(&base).expect_err("nobody reads it").to_string();
        assert!(error.contains("'pc_alpha': none of these methods"), "{error}");
    }

    #[test]
    fn seeds_are_a_range_with_both_ends_and_shards_count_from_one() {
        assert_eq!(seeds("1..3").expect("a range"), [1, 2, 3]);
        assert_eq!(seeds("7").expect("one"), [7]);
        assert!(seeds("3..1").is_err() && seeds("five").is_err());
        assert_eq!(shard("2/4").expect("a share"), (2, 4));
        assert!(shard("0/4").is_err() && shard("5/4").is_err() && shard("1").is_err());
    }
}
