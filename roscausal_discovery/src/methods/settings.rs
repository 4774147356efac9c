//! The settings of PCMCI and its kin.

use super::fdr::Fdr;
use crate::types::{CondIndTest, DataFrame, Error, LinkAssumptions, Result};

with_defaults! {
    /// Settings of a run. Each method uses those that it has.
    ///
    /// ```
    /// use roscausal_discovery::methods::{Fdr, PcmciSettings};
    ///
    /// let settings = PcmciSettings { tau_max: 5, fdr: Fdr::Bh, ..PcmciSettings::default() };
    /// assert_eq!((settings.tau_min, settings.alpha_level), (1, 0.05));
    /// ```
    #[derive(Clone, Debug)]
    pub struct PcmciSettings {
        /// Smallest lag of a link. Default 1 (PCMCI+: 0).
        pub tau_min: usize = 1,
        /// Largest lag of a link. Default 1.
        pub tau_max: usize = 1,
        /// Significance level of the condition selection. With several levels a model-selection score chooses one, per
        /// target (PCMCI+: one for all). Empty means [`PC_ALPHAS`] or [`PCMCIPLUS_ALPHAS`]. Default 0.2, PCMCI+: 0.01.
        pub pc_alpha: Vec<f64> = vec![0.2],
        /// Significance level of a link (with `fixed_thres`: the threshold). Default 0.05.
        pub alpha_level: f64 = 0.05,
        /// Largest condition set of PC1; `None`: no limit.
        pub max_conds_dim: Option<usize> = None,
        /// Condition sets tested per size in PC1. Default 1.
        pub max_combinations: usize = 1,
        /// How many of the effect's parents MCI conditions on; `None`: all.
        pub max_conds_py: Option<usize> = None,
        /// How many of the cause's parents MCI conditions on; `None`: all.
        pub max_conds_px: Option<usize> = None,
        /// PCMCI+: the same for lagged causes; `None`: as `max_conds_px`.
        pub max_conds_px_lagged: Option<usize> = None,
        /// Correction of the p-values of links.
        pub fdr: Fdr = Fdr::None,
        /// Which links may exist; `None`: all.
        pub link_assumptions: Option<LinkAssumptions> = None,
    }
}

/// Levels from which PCMCI chooses by score if none is given.
pub const PC_ALPHAS: [f64; 6] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5];

/// Levels from which PCMCI+ chooses by score if none is given.
pub const PCMCIPLUS_ALPHAS: [f64; 5] = [0.001, 0.005, 0.01, 0.025, 0.05];

/// Refuses a smallest lag above the largest one.
pub(super) fn check_order(tau_min: usize, tau_max: usize) -> Result<()> {
    Error::ensure(tau_min <= tau_max, "tau_min", || format!("{tau_min} is larger than tau_max = {tau_max}"))
}

impl PcmciSettings {
    /// Checks the settings against the data and the test.
    pub(crate) fn check(&self, data: &DataFrame, test: &dyn CondIndTest) -> Result<()> {
        check_order(self.tau_min, self.tau_max)?;
        data.check_length(self.tau_max, self.cut_off())?;
        for (name, value) in
            self.pc_alpha.iter().map(|a| ("pc_alpha", *a)).chain([("alpha", self.alpha_level)])
        {
            let allowed = value > 0.0 && (value < 1.0 || (value == 1.0 && name == "pc_alpha"));
            let threshold = test.decides_by_value() && value > 0.0 && value.is_finite();
            Error::ensure(allowed || threshold, name, || format!("{value} is not between 0 and 1"))?;
        }
        let reason = "0 is not allowed; give 1 or more";
        Error::ensure(self.max_combinations > 0, "max_combinations", || reason)?;
        let reason = "fixed_thres gives no p-values to correct; choose fdr none";
        Error::ensure(self.fdr == Fdr::None || !test.decides_by_value(), "fdr", || reason)?;
        match &self.link_assumptions {
            Some(links) => {
                let hidden = |target| links.of_target(target).find(|(_, a)| a.speaks_of_hidden_causes());
                if let Some((_, assumption)) = (0..links.n_vars()).find_map(hidden) {
                    let reason =
                        format!("'{}' speaks of hidden causes, for which lpcmci allows", assumption.symbol());
                    return Err(Error::param("link_assumptions", reason));
                }
                links.check(data.n_vars(), self.tau_min, self.tau_max)
            }
            None => Ok(()),
        }
    }

    pub(crate) fn cut_off(&self) -> usize {
        self.tau_max.saturating_mul(2)
    }

    /// The given assumptions, or all links.
    pub(crate) fn links(&self, n_vars: usize) -> LinkAssumptions {
        self.link_assumptions
            .clone()
            .unwrap_or_else(|| LinkAssumptions::all(n_vars, self.tau_min, self.tau_max))
    }
}
