//! Which method and test to take for given data, and why.
//!
//! Rules, in this order; the first that applies decides:
//!
//! 1. A column of interventions varies: CAnDOIT.
//! 2. Several recordings whose levels differ by more than chance: J-PCMCI+.
//! 3. Else LPCMCI: nothing says that all common causes were recorded.
//!
//! The test: that of the method, if it has but one; for categories or mixed data one that knows them; GPDC, which sees any form of
//! additive dependence, where it ends in good time; else partial correlation, of ranks where there are outliers.
//!
//! Example: two people of whom one walks twice as fast are compared with J-PCMCI+, so that the difference makes no link.

use crate::{
    effort::Effort,
    independence_tests::regression_ci::{ENOUGH as ENOUGH_OF_MIXED, MOST_VALUES, categories},
    levels::levels_differ,
    methods::Method,
    profile::DataProfile,
    settings::Settings,
    types::DataFrame,
};

/// Seconds that an analysis may take before a faster test is advised.
const PATIENCE_S: f64 = 600.0;
/// Samples for each degree of freedom below which gsquared misses links.
const ENOUGH: usize = 5;

/// What to take, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Recommendation {
    /// The method.
    pub method: Method,
    /// Name of the independence test.
    pub test: String,
    /// The reasons, one sentence each.
    pub why: Vec<String>,
}

impl Recommendation {
    /// What to take for `data`. The settings' lags, exogenous variables and interventions count; the method and the test do not.
    ///
    /// ```
    /// use roscausal_discovery::{Recommendation, DataFrame, Settings, methods::Method};
    ///
    /// let values = ndarray::Array2::from_shape_fn((200, 2), |(t, k)| ((t * t * (k + 3)) % 101) as f64 / 7.0);
    /// let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
    /// let recommended = Recommendation::of(&data, &Settings::default());
    /// assert_eq!(recommended.method, Method::Lpcmci);
    /// assert!(recommended.why[0].contains("recorded"));
    /// # Ok::<(), roscausal_discovery::Error>(())
    /// ```
    pub fn of(data: &DataFrame, settings: &Settings) -> Self {
        let (method, mut why) = method_for(data, settings);
        let (test, reason) = test_for(data, &Settings { method, ..settings.clone() });
        why.push(reason);
        Self { method, test, why }
    }

    /// The settings with this method and test.
    #[must_use]
    pub fn applied(&self, settings: &Settings) -> Settings {
        Settings {
            method: self.method,
            cond_ind_test: self.test.clone(),
            tau_min: self.method.info().tau_min,
            ..settings.clone()
        }
    }
}

fn method_for(data: &DataFrame, settings: &Settings) -> (Method, Vec<String>) {
    if let Ok(interventions) = settings.interventions(data) {
        let columns = data.listed(interventions.iter().map(|one| one.context));
        let reason = format!(
            "{columns}: it holds what was imposed on the system, and what follows an intervention tells causes from common causes \
             (candoit)"
        );
        return (Method::Candoit, vec![reason]);
    }
    let each: Vec<usize> = (0..data.recordings().len()).collect();
    let differing: Vec<usize> = (0..data.n_vars()).filter(|&var| levels_differ(data, var, &each)).collect();
    if !differing.is_empty() && settings.jpcmciplus(data).is_ok() {
        let (n, names) = (data.recordings().len(), data.listed(differing));
        let reason = format!(
            "the {n} recordings differ in the level of {names}, which would look like links if they were pooled as they are (jpcmciplus)"
        );
        let care = "jpcmciplus assumes that all common causes were recorded, but those that are constant in a recording";
        return (Method::Jpcmciplus, vec![reason, care.to_owned()]);
    }
    let reason = "nothing says that all common causes were recorded, and only lpcmci then tells a cause from a hidden common cause; \
                  if all were recorded, pcmciplus finds more directions";
    (Method::Lpcmci, vec![reason.to_owned()])
}

fn test_for(data: &DataFrame, settings: &Settings) -> (String, String) {
    let answer = |test: &str, reason: String| (test.to_owned(), reason);
    if settings.method == Method::Jpcmciplus {
        return answer(
            "parcorr",
            "parcorr: the one test that can say which recording a sample is from".to_owned(),
        );
    }
    let has_outliers = || {
        let (profile, _) = DataProfile::of(data, settings.tau_max);
        profile.variables.iter().any(|variable| variable.outliers > 0)
    };
    let n_values = |var: usize| data.different_values(var, MOST_VALUES).len();
    let is_category = categories(data, &settings.test.categories);
    let categories: Vec<usize> =
        (0..data.n_vars()).filter(|&var| is_category[var] && n_values(var) > 1).collect();
    let rows: usize = data.recordings().iter().map(|r| r.nrows()).sum();
    if categories.len() == data.n_vars() {
        // Of two variables given two others.
        let values = (0..data.n_vars()).map(n_values).max().unwrap_or(0);
        let freedom = values.saturating_sub(1).pow(2) * values.pow(2);
        if rows < ENOUGH * freedom {
            let reason = format!(
                "cmisymb: all variables are categories, and {rows} samples are fewer than {ENOUGH} for each of {freedom} degrees of \
                 freedom, where gsquared may miss links"
            );
            return answer("cmisymb", reason);
        }
        return answer("gsquared", "gsquared: all variables are categories".to_owned());
    }
    if !categories.is_empty() && settings.method != Method::Candoit {
        let freedom = categories.iter().map(|&var| n_values(var).saturating_sub(1).pow(2)).max();
        let mut reason = format!(
            "regressionci: {} has a few whole values, the others are numbers",
            data.listed(categories)
        );
        if rows < ENOUGH_OF_MIXED * freedom.unwrap_or(0) {
            reason += &format!(
                "; below {ENOUGH_OF_MIXED} samples for each degree of freedom, as here, it finds too much"
            );
        }
        if has_outliers() {
            reason += "; outliers make it find too much at 0.01";
        }
        return answer("regressionci", reason);
    }
    let seconds =
        Effort::of(rows, data.n_vars(), &Settings { cond_ind_test: "gpdc".into(), ..settings.clone() })
            .seconds;
    if seconds <= PATIENCE_S {
        let reason =
            format!("gpdc: it sees dependence of any form, and takes about {:.0} s here", seconds.ceil());
        return answer("gpdc", reason);
    }
    let slow =
        format!("gpdc, which sees dependence of any form, would take about {:.0} min here", seconds / 60.0);
    if has_outliers() {
        return answer("robustparcorr", format!("robustparcorr: {slow}, and there are outliers"));
    }
    answer("parcorr", format!("parcorr: {slow}; effects that are not linear may be missed"))
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::numeric::random::mix;

    fn noise(i: usize) -> f64 {
        mix(i as u64) as f64 / u64::MAX as f64
    }

    fn data(recordings: Vec<Array2<f64>>, names: &[&str]) -> DataFrame {
        DataFrame::new(recordings, names.iter().map(|name| (*name).to_owned()).collect()).unwrap()
    }

    fn plain(rows: usize, higher: f64, seed: usize) -> Array2<f64> {
        Array2::from_shape_fn((rows, 2), |(t, v)| noise(seed + 2 * t + v) + higher)
    }

    fn chosen(data: &DataFrame) -> (Method, String) {
        let recommended = Recommendation::of(data, &Settings::default());
        assert!(
            !recommended.why.is_empty() && recommended.applied(&Settings::default()).check().is_ok(),
            "{recommended:?}"
        );
        (recommended.method, recommended.test)
    }

    #[test]
    fn people_who_differ_are_compared_and_those_who_do_not_are_not() {
        let names = ["a", "b"];
        let differ = data(vec![plain(200, 0.0, 0), plain(200, 1.0, 900)], &names);
        assert_eq!(chosen(&differ), (Method::Jpcmciplus, "parcorr".to_owned()));
        let same = data(vec![plain(200, 0.0, 0), plain(200, 0.0, 900)], &names);
        assert_eq!(chosen(&same).0, Method::Lpcmci);
        assert_eq!(chosen(&data(vec![plain(200, 0.0, 0)], &names)).0, Method::Lpcmci);
    }

    #[test]
    fn interventions_categories_and_long_recordings_choose_their_method_and_test() {
        let wide = |imposed: f64| {
            Array2::from_shape_fn((100, 2), |(t, v)| {
                if v == 0 { noise(t) } else { f64::from(u8::from(t > 50)) * imposed }
            })
        };
        assert_eq!(chosen(&data(vec![wide(0.7)], &["r_v", "do_robot_speed"])).0, Method::Candoit);
        let open = data(vec![wide(1.0)], &["speed", "open"]);
        assert_eq!(chosen(&open), (Method::Lpcmci, "regressionci".to_owned()));
        let whole = data(vec![plain(200, 0.0, 5).mapv_into(|v| (3.0 * v).floor())], &["a", "b"]);
        assert_eq!(chosen(&whole).1, "gsquared");
        let sparse = data(vec![plain(100, 0.0, 5).mapv_into(|v| (9.0 * v).floor())], &["a", "b"]);
        assert_eq!(chosen(&sparse).1, "cmisymb");
        assert_eq!(chosen(&data(vec![plain(200, 0.0, 0)], &["a", "b"])).1, "gpdc");
        assert_eq!(chosen(&data(vec![plain(150_000, 0.0, 0)], &["a", "b"])).1, "parcorr");
    }
}
