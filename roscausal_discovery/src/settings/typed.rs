//! What to analyse, and how.

use crate::{
    independence_tests::{self, Significance, TestSettings},
    later::Within,
    methods::{
        ActsOn, Fdr, LpcmciSettings, Method, PcmciPlusSettings, PcmciSettings, TiminoModel, TiminoSettings,
    },
    profile::DataProfile,
    transfer_entropy::TeEstimator,
    types::{Assumption, CondIndTest, DataFrame, Error, LinkAssumptions, Result, names},
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

/// What becomes of the levels of recordings that differ; the surfaces do it ([`Levelled`](crate::Levelled)), not [`analyse`](crate::analyse).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Levels {
    /// Taken out where they differ by more than chance.
    #[default]
    Auto,
    /// They stay.
    Keep,
    /// Taken out.
    Remove,
}

words!(Levels, "levels": Auto "auto", Keep "keep", Remove "remove");

with_defaults! {
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
    /// assert!(error.to_string().contains("tau_max"));
    /// ```
    #[derive(Clone, Debug, PartialEq)]
    pub struct Settings {
        /// The method.
        pub method: Method = Method::Fpcmci,
        /// Name of an independence test ([`independence_tests::names`]).
        pub cond_ind_test: String = "gpdc".into(),
        /// What the test reads; its seed is that of all random numbers, below.
        pub test: TestSettings = TestSettings::default(),
        /// Significance level of a link, in (0, 1).
        pub alpha: f64 = 0.05,
        /// Level of the condition selection.
        pub pc_alpha: PcAlpha = PcAlpha::Default,
        /// Smallest lag, in steps.
        pub tau_min: usize = 1,
        /// Largest lag, in steps; at most 100,000.
        pub tau_max: usize = 1,
        /// Level of the transfer-entropy filter; `None`: `alpha`.
        pub f_alpha: Option<f64> = None,
        /// Estimator of the transfer-entropy filter.
        pub te_estimator: TeEstimator = TeEstimator::Auto,
        /// Whether F-PCMCI drops variables that depend on their own past only.
        pub neglect_only_autodep: bool = true,
        /// Correction for many tests.
        pub fdr: Fdr = Fdr::None,
        /// Variables that may be causes only: no link points to them.
        pub exogenous: Vec<String> = Vec::new(),
        /// CAnDOIT: columns of interventions, and the variable that each sets; `None`: those of the simulator, as far as they are
        /// there ([`default_intervention_targets`](crate::methods::default_intervention_targets)).
        pub acts_on: Option<ActsOn> = None,
        /// What becomes of the levels of recordings that differ.
        pub levels: Levels = Levels::Auto,
        /// Seed of all random numbers.
        pub seed: u64 = 42,
        /// Which links may exist; `None`: all.
        pub link_assumptions: Option<LinkAssumptions> = None,
        /// Largest condition set of the condition selection (LPCMCI: beyond the conditions that are always there); `None`: no limit.
        pub max_conds: Option<usize> = None,
        /// LPCMCI and CAnDOIT: sets of conditions tested per pair, side and size; `None`: all.
        pub max_sets: Option<usize> = None,
        /// CAnDOIT: whether contexts join their variables as conditions, as published.
        pub extra_conditions: bool = true,
        /// What only PCMCI+ has.
        pub pcmciplus: PcmciPlusSettings = PcmciPlusSettings::default(),
    }
}

impl Settings {
    pub(crate) fn lpcmci(&self, data: &DataFrame) -> LpcmciSettings {
        let context = self.context(data);
        let given = self.link_assumptions.clone().map(LinkAssumptions::allowing_hidden_causes);
        let restricted = given.is_some() || !context.is_empty();
        let all = || LinkAssumptions::all_with_hidden_causes(data.n_vars(), self.tau_min, self.tau_max);
        let usual = LpcmciSettings::default();
        LpcmciSettings {
            tau_min: self.tau_min,
            tau_max: self.tau_max,
            pc_alpha: self.level_of_pc().unwrap_or(usual.pc_alpha),
            link_assumptions: restricted.then(|| given.unwrap_or_else(all).exogenous(&context)),
            max_p_global: self.max_conds,
            max_q_global: self.max_sets,
            ..usual
        }
    }

    /// What TiMINo takes; its model is that of the test.
    ///
    /// # Errors
    /// A test that has no regression of its own.
    pub(crate) fn timino(&self, data: &DataFrame, test: &str) -> Result<TiminoSettings> {
        Ok(TiminoSettings {
            tau_min: self.tau_min,
            tau_max: self.tau_max,
            alpha_level: self.alpha,
            model: TiminoModel::of_test(test)?,
            exogenous: self.context(data),
            test: self.test_settings(),
        })
    }

    /// The level of the condition selection; `None` if a score chooses it. Of a method that has no other, it is `alpha` where
    /// values are held against a threshold: its own default is a p-value's.
    pub fn level_of_pc(&self) -> Option<f64> {
        let is_threshold = self.test.significance == Some(Significance::FixedThres);
        match self.pc_alpha {
            PcAlpha::Fixed(alpha) => Some(alpha),
            PcAlpha::ByScore => None,
            PcAlpha::Default if is_threshold && self.method.info().one_level => Some(self.alpha),
            PcAlpha::Default => Some(self.method.info().pc_alpha),
        }
    }

    /// The test that is named.
    ///
    /// # Errors
    /// A test that there is not, or settings that it does not allow, in the words of these.
    pub(crate) fn test(&self) -> Result<Box<dyn CondIndTest>> {
        let test = independence_tests::by_name(&self.cond_ind_test, &self.test_settings());
        test.map_err(in_words_of_settings)
    }

    pub(crate) fn test_settings(&self) -> TestSettings {
        TestSettings { seed: self.seed, ..self.test.clone() }
    }

    /// The exogenous variables by their place.
    pub(crate) fn context(&self, data: &DataFrame) -> Vec<usize> {
        self.exogenous.iter().filter_map(|name| names::position(data.var_names(), name)).collect()
    }

    pub(crate) fn pcmci(&self, data: &DataFrame) -> PcmciSettings {
        let context = self.context(data);
        let given = self.link_assumptions.clone();
        let restricted = given.is_some() || !context.is_empty();
        let all = || LinkAssumptions::all(data.n_vars(), self.tau_min, self.tau_max);
        PcmciSettings {
            tau_min: self.tau_min,
            tau_max: self.tau_max,
            pc_alpha: self.level_of_pc().into_iter().collect(),
            alpha_level: self.alpha,
            fdr: if self.test.as_tigramite { self.fdr.as_tigramite() } else { self.fdr },
            link_assumptions: restricted.then(|| given.unwrap_or_else(all).exogenous(&context)),
            max_conds_dim: self.max_conds,
            ..PcmciSettings::default()
        }
    }

    /// The profile of the data as the test sees them, [with later lags](DataProfile::with_later) unless all is as in tigramite.
    pub fn look_later(&self, profile: DataProfile, data: &DataFrame, dt: Option<f64>) -> DataProfile {
        let test = self.looked_for();
        let mut profile = profile.for_test(&self.cond_ind_test).with_later(data, self.tau_max, test, dt);
        if test.is_some() && self.tau_min > 0 {
            profile.within = Within::of(data, self.tau_max);
        }
        profile
    }

    /// Checks that the data can be analysed with these settings at all.
    pub(crate) fn check_data(&self, data: &DataFrame) -> Result<()> {
        if data.n_vars() < 2 {
            return Err(Error::Data(format!(
                "there is only one variable, '{}'; a cause and an effect need at least two columns (the time does not \
                 count)",
                data.var_names()[0]
            )));
        }
        // Before anything is made for each pair and lag. Models without a test look back once, tests also at the cause's past.
        let cut_off = self.tau_max.saturating_mul(if self.method.info().uses_test { 2 } else { 1 });
        data.check_length(self.tau_max, cut_off)?;
        for (setting, given) in [("exogenous", &self.exogenous), ("categories", &self.test.categories)] {
            if let Some(name) = given.iter().find(|name| names::position(data.var_names(), name).is_none()) {
                let all = data.var_names().join(", ");
                let reason = format!("there is no variable '{name}'; variables: {all}");
                return Err(Error::param(setting, reason));
            }
        }
        self.check_required_links(data)
    }

    /// Refuses links that are known to exist and end in a variable that nothing drives.
    fn check_required_links(&self, data: &DataFrame) -> Result<()> {
        let known = self.link_assumptions.as_ref().filter(|known| known.n_vars() == data.n_vars());
        let Some(known) = known else { return Ok(()) };
        let context = self.context(data);
        for &effect in &context {
            let required = known.of_target(effect).find(|(cause, what)| match what {
                // The other end names these.
                Assumption::ExistsBackward | Assumption::ExistsNotForward => false,
                Assumption::Exists | Assumption::ExistsNotBack => true,
                // Of an open direction the one away from the variable is left, unless nothing drives the other one, either.
                what => what.exists() && (cause.lag > 0 || context.contains(&cause.var)),
            });
            if let Some((cause, _)) = required {
                let name = |var: usize| names::plain(&data.var_names()[var]);
                let (from, to, lag) = (name(cause.var), name(effect), cause.lag);
                let reason = format!(
                    "{from} -> {to} at lag {lag} is required, but '{to}' is exogenous, so nothing drives it; take back one \
                     of the two"
                );
                return Err(Error::param("links", reason));
            }
        }
        Ok(())
    }
}

/// An error of a test: what it calls `sig_samples` is `shuffles` here.
fn in_words_of_settings(error: Error) -> Error {
    match error {
        Error::Param { name, reason } if name == "sig_samples" => Error::param("shuffles", reason),
        error => error,
    }
}
