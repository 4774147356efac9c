//! The model that an experiment finds in its own runs, which others are then tried on.

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result};
use roscausal_discovery::{Control, DataFrame, Model, Settings, analyse, methods::Method};

use super::{grid, runner::Runner};
use crate::interrupt::Interrupt;

/// Arguments of an experiment that finds a model in some runs and tries it in others.
#[derive(ClapArgs)]
#[command(mut_arg("seeds", |arg| arg.default_value("101..120").help("Seeds of the runs in which it is tried, including both ends")))]
pub(super) struct Trained {
    /// Scenario of one person and one robot: a built-in name or a TOML file.
    #[arg(long, default_value = "encounters")]
    pub(super) scenario: String,
    /// Seeds of the runs in which the model is found, including both ends.
    #[arg(long, default_value = "1..4", value_name = "A..B")]
    pub(super) train: String,
    /// Discovery method.
    #[arg(long, default_value = "pcmci")]
    pub(super) method: String,
    /// Independence test.
    #[arg(long, default_value = "parcorr")]
    pub(super) test: String,
    /// Largest lag, in samples.
    #[arg(long, default_value_t = 2)]
    tau_max: usize,
    /// Equations: auto (a Gaussian process where it predicts better than a line), linear, gp.
    #[arg(long, default_value = "auto", value_parser = ["auto", "linear", "gp"])]
    pub(super) equations: String,
    #[command(flatten)]
    pub(super) runner: Runner,
}

impl Trained {
    /// The seeds for the model, and those on which it is tried.
    ///
    /// # Errors
    /// What is not a range, or a seed that is in both; `why` not.
    pub(super) fn seeds(&self, why: &str) -> Result<(Vec<u64>, Vec<u64>)> {
        let (train, seeds) = (grid::seeds(&self.train)?, self.runner.seeds()?);
        match seeds.iter().find(|seed| train.contains(seed)) {
            Some(seed) => Err(Error::param("seeds", format!("seed {seed} is one of --train, too; {why}"))),
            None => Ok((train, seeds)),
        }
    }

    /// Finds the model of runs with `dt` seconds between rows.
    ///
    /// # Errors
    /// An unknown method or test, those of the analysis, or cancellation.
    pub(super) fn found(&self, data: &DataFrame, dt: f64, interrupt: &Interrupt) -> Result<Model> {
        let method: Method = self.method.parse()?;
        let settings = Settings {
            method,
            cond_ind_test: self.test.clone(),
            tau_min: method.info().tau_min,
            tau_max: self.tau_max,
            ..Settings::default()
        };
        settings.check()?;
        let mut found = analyse(data, &settings, &Control::default().cancel_on(interrupt.flag()))?;
        found.dt = Some(dt);
        Ok(found)
    }
}

/// The links between variables: `h_risk -> h_v (1), ...`.
pub(super) fn links(found: &Model) -> String {
    let others = found.links.iter().filter(|link| link.cause != link.effect);
    let all: Vec<String> =
        others.map(|link| format!("{} -> {} ({})", link.cause, link.effect, link.lag)).collect();
    all.join(", ")
}

/// Names of variables that are given as `name = expression`.
pub(super) fn names(features: &[&str]) -> Vec<String> {
    features.iter().map(|item| item.split(' ').next().unwrap_or_default().to_owned()).collect()
}
