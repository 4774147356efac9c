//! The settings of LPCMCI.

use crate::{
    methods::settings::check_order,
    types::{CondIndTest, DataFrame, Error, LinkAssumptions, Result},
};

with_defaults! {
    /// Settings of LPCMCI. The defaults are the reference's.
    #[derive(Clone, Debug)]
    pub struct LpcmciSettings {
        /// Smallest lag of a link. Default 0.
        pub tau_min: usize = 0,
        /// Largest lag of a link; 0 makes it FCI. Default 1.
        pub tau_max: usize = 1,
        /// Significance level of every test. Default 0.05.
        pub pc_alpha: f64 = 0.05,
        /// How often the ancestral phase runs beforehand, to learn parents to condition on. Default 1; the paper has 4.
        pub n_preliminary_iterations: usize = 1,
        /// Largest set from the side of a lagged cause. Default 0.
        pub max_cond_px: usize = 0,
        /// Largest number of conditions beyond those that are always there; `None`: no limit.
        pub max_p_global: Option<usize> = None,
        /// The same in the non-ancestral phase alone.
        pub max_p_non_ancestral: Option<usize> = None,
        /// Sets tested per pair, side and size, 1 or more; `None`: all.
        pub max_q_global: Option<usize> = None,
        /// The same in the non-ancestral phase alone.
        pub max_q_non_ancestral: Option<usize> = None,
        /// Pairs with more choices than this are not tested in the non-ancestral phase.
        pub max_pds_set: Option<usize> = None,
        /// Whether the preliminary phases end with the rules that find colliders. Default true.
        pub prelim_with_collider_rules: bool = true,
        /// Whether the non-ancestral phase runs. Default true.
        pub non_ancestral_phase: bool = true,
        /// Which links may exist; `None`: all.
        pub link_assumptions: Option<LinkAssumptions> = None,
        /// CAnDOIT's rule: pairs of an intervened variable and its context column. Where the variable is a condition in an
        /// ancestral phase, its contexts are, too.
        pub contexts: Vec<(usize, usize)> = Vec::new(),
    }
}

impl LpcmciSettings {
    pub(super) fn check(&self, data: &DataFrame, test: &dyn CondIndTest) -> Result<()> {
        check_order(self.tau_min, self.tau_max)?;
        data.check_length(self.tau_max, self.tau_max.saturating_mul(2))?;
        // A link that is never tested looks certain.
        let numbers_of_sets =
            [("max_q_global", self.max_q_global), ("max_q_non_ancestral", self.max_q_non_ancestral)];
        if let Some((name, _)) = numbers_of_sets.into_iter().find(|(_, most)| *most == Some(0)) {
            return Err(Error::param(name, "0 tests nothing; give at least 1, or None for all"));
        }
        let level = self.pc_alpha;
        let fits = level > 0.0 && (level < 1.0 || test.decides_by_value() && level.is_finite());
        Error::ensure(fits, "pc_alpha", || format!("{level} is not between 0 and 1"))?;
        let known = self.contexts.iter().all(|&(variable, context)| variable.max(context) < data.n_vars());
        Error::ensure(known, "contexts", || "an intervened variable or its context is not a column")?;
        self.link_assumptions
            .as_ref()
            .map_or(Ok(()), |links| links.check(data.n_vars(), self.tau_min, self.tau_max))
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::independence_tests::{ParCorr, TestSettings};

    #[test]
    fn a_phase_that_would_test_no_set_is_refused() {
        let data = DataFrame::new(vec![Array2::zeros((50, 2))], vec!["a".into(), "b".into()]).unwrap();
        let test = ParCorr::new(&TestSettings::default()).unwrap();
        let of = |max_q_global, max_q_non_ancestral| {
            let settings = LpcmciSettings { max_q_global, max_q_non_ancestral, ..LpcmciSettings::default() };
            settings.check(&data, &test).map_err(|error| error.to_string())
        };
        assert!(of(Some(0), None).unwrap_err().contains("'max_q_global': 0 tests nothing"));
        assert!(of(Some(3), Some(0)).unwrap_err().contains("'max_q_non_ancestral': 0 tests nothing"));
        assert_eq!(of(Some(1), Some(1)), Ok(()));
    }
}
