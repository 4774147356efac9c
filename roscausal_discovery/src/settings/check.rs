//! What may be asked for without knowing the data, and the model that it begins.

use super::{PcAlpha, Request, Settings};
use crate::{
    independence_tests::Significance,
    methods::{Method, Reads, TiminoModel},
    model::{self, Model},
    types::{Dummy, Error, Named, Result},
};

impl Settings {
    /// Checks the settings on their own, without data.
    ///
    /// # Errors
    /// The first invalid setting: its name, its value, and what is allowed.
    pub fn check(&self) -> Result<()> {
        let test = self.test()?;
        if self.method == Method::Jpcmciplus {
            test.with_dummies(&[Dummy::Space])?;
        }
        if self.method == Method::Timino {
            TiminoModel::of_test(test.name())?;
        }
        self.check_numbers(test.name())
    }

    /// Checks everything but the name of the test; `test` is the one that is used.
    pub(crate) fn check_numbers(&self, test: &str) -> Result<()> {
        level("alpha", self.alpha)?;
        if let PcAlpha::Fixed(alpha) = self.pc_alpha {
            level("pc_alpha", alpha)?;
        }
        self.f_alpha.map_or(Ok(()), |alpha| level("f_alpha", alpha))?;
        let info = self.method.info();
        let is_fci_there = matches!(self.method, Method::Lpcmci | Method::Tsfci);
        if !is_fci_there && self.tau_max == 0 && !info.models_lag_zero {
            let (method, lpcmci, varlingam) = (self.method, Method::Lpcmci, Method::Varlingam);
            let reason = format!(
                "0 leaves {method} no past; give at least 1, or use {lpcmci} or {varlingam}, which also find links at lag 0 alone"
            );
            return Err(Error::param("tau_max", reason));
        }
        Error::check_lags(self.tau_min, self.tau_max)?;
        let asked = Self { cond_ind_test: test.to_owned(), ..self.clone() };
        Request { settings: asked, ..Request::default() }.check_readers()?;
        self.check_shuffles()?;
        match self.method {
            Method::Lpcmci | Method::Tsfci => self.check_lpcmci()?,
            Method::Candoit => {
                self.check_lpcmci()?;
                self.check_lag_zero("interventions act at lag 0")?;
            }
            Method::Jpcmciplus => {
                self.check_lag_zero("contexts act at lag 0")?;
                let reason = "jpcmciplus has no score that chooses a level; give one, such as 0.01";
                Error::ensure(self.pc_alpha != PcAlpha::ByScore, "pc_alpha", || reason)?;
            }
            _ => {}
        }
        if self.tau_min == 0 && !info.lag_zero {
            let what = if self.method.reads(Reads::FAlpha) { "the transfer-entropy filter of " } else { "" };
            let reason =
                format!("0: {what}{} knows the past only; give 1, or use {}", self.method, Method::Pcmciplus);
            return Err(Error::param("tau_min", reason));
        }
        Error::ensure(self.tau_min == 0 || !info.models_lag_zero, "tau_min", || {
            format!("{}: {} models lag 0 too; give 0, or leave it out", self.tau_min, self.method)
        })
    }

    /// Refuses null distributions with a significance that takes none, and fewer surrogates than the level needs: with `n` of them no
    /// p-value is below `1 / (n + 1)`, and nothing would be found.
    fn check_shuffles(&self) -> Result<()> {
        let how = self.test.significance;
        let free = self.test.null_distributions.is_none();
        let reason = "the significance that is asked for takes none; give analytic, or leave it out";
        Error::ensure(free || how.is_none_or(|how| how == Significance::Analytic), "null_dist", || reason)?;
        let Some(shuffles) = self.test.sig_samples.filter(|_| how != Some(Significance::Analytic)) else {
            return Ok(());
        };
        let by_pc = self.method.info().one_level;
        let level = if by_pc { self.level_of_pc().unwrap_or(self.alpha) } else { self.alpha };
        let smallest = 1.0 / (shuffles as f64 + 1.0);
        if smallest <= level {
            return Ok(());
        }
        let (method, least) = (self.method, (1.0 / level).ceil());
        let flag = Named(if by_pc { "pc_alpha" } else { "alpha" });
        let reason = format!(
            "with {shuffles} the smallest p-value is {smallest:.4}, above the level {level} of {method}, so nothing could be found; give at \
             least {least}, or a higher level ({flag})"
        );
        Err(Error::param("shuffles", reason))
    }

    fn check_lag_zero(&self, why: &str) -> Result<()> {
        let lag = self.tau_min;
        Error::ensure(lag == 0, "tau_min", || format!("{lag}: {why}; give 0, or leave it out"))
    }

    /// LPCMCI and tsFCI have one level, and work on data without time, too.
    fn check_lpcmci(&self) -> Result<()> {
        Error::ensure(self.pc_alpha != PcAlpha::ByScore, "pc_alpha", || {
            format!("{} has no score that chooses a level; give one, such as 0.05", self.method)
        })?;
        // A link that is never tested looks certain.
        let reason = "0 tests nothing; give at least 1, or leave it out";
        Error::ensure(self.max_sets != Some(0), "max_sets", || reason)
    }

    /// The test that the method asks, `none` if it asks none.
    pub fn asked_test(&self) -> &str {
        if self.method.info().uses_test { &self.cond_ind_test } else { "none" }
    }

    /// The test for which dependence is looked for that is not tested; `None`: it is not.
    pub fn looked_for(&self) -> Option<&str> {
        (!self.test.as_tigramite).then(|| self.asked_test())
    }

    /// A model that holds the settings and no result yet.
    pub fn blank_model(&self) -> Model {
        let mut model = Model {
            schema: model::SCHEMA.to_owned(),
            method: self.method.into(),
            cond_ind_test: self.asked_test().to_owned(),
            alpha: self.alpha,
            pc_alpha: self.level_of_pc(),
            f_alpha: self.method.reads(Reads::FAlpha).then_some(self.f_alpha.unwrap_or(self.alpha)),
            fdr: self.fdr.name().to_owned(),
            tau_min: self.tau_min,
            tau_max: self.tau_max,
            n_recordings: 1,
            seed: self.seed,
            ..Model::default()
        };
        model.settings = Request { settings: self.clone(), ..Request::default() }.beyond(&model);
        model
    }
}

fn level(name: &str, value: f64) -> Result<()> {
    Error::ensure(value > 0.0 && value < 1.0, name, || {
        format!("{value} is not a level; give a number between 0 and 1, such as 0.05")
    })
}
