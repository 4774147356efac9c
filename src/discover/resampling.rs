//! `--resamples` and its kin: how often to analyse again on rows drawn from the data.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result};
use roscausal_discovery::confidence::{Resampling, Scheme};

/// Whether the report says how much longer to record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Advised {
    /// It does.
    On,
    /// It does not.
    Off,
}

/// How to resample; the same arguments for every subcommand that analyses.
#[derive(ClapArgs, Clone, Default)]
pub(crate) struct ResampleArgs {
    /// Analyse again on so many draws of the rows, and say of each link in how many of them it is (20 to 10000; 100 tell a
    /// share to 0.1); 0: not. The analysis takes up to so many times as long.
    #[arg(long, value_name = "N")]
    resamples: Option<usize>,
    /// How rows are drawn: subsample (a share of them, each once), bootstrap (with replacement, as the Python tools do).
    #[arg(long, value_name = "SCHEME", value_parser = clap::builder::PossibleValuesParser::new(Scheme::NAMES))]
    resampling: Option<String>,
    /// Share of the rows in a subsample, between 0 and 1. Default: 0.632.
    #[arg(long)]
    share: Option<f64>,
    /// Neighbouring rows that are drawn together: a number, or `cube_root` of the number of rows. Default: 1.
    #[arg(long, value_name = "L")]
    block: Option<String>,
}

impl ResampleArgs {
    /// What is asked for; `None`: no resamples.
    ///
    /// # Errors
    /// A number that makes no sense, or a flag about resamples without any.
    pub(crate) fn asked(&self) -> Result<Option<Resampling>> {
        let resamples = self.resamples.unwrap_or(0);
        if resamples == 0 {
            let flags = [
                ("resampling", self.resampling.is_some()),
                ("share", self.share.is_some()),
                ("block", self.block.is_some()),
            ];
            return match flags.into_iter().find(|(_, given)| *given && self.resamples.is_none()) {
                Some((flag, _)) => {
                    Err(Error::param(flag, "it is for --resamples; give their number, such as 100"))
                }
                None => Ok(None),
            };
        }
        let usual = Resampling::default();
        let resampling = Resampling {
            resamples,
            scheme: self.resampling.as_deref().map_or(Ok(usual.scheme), str::parse)?,
            share: self.share.unwrap_or(usual.share),
            block: self.block.as_deref().map_or(Ok(usual.block), str::parse)?,
        };
        resampling.check()?;
        if self.share.is_some() && resampling.scheme == Scheme::Bootstrap {
            return Err(Error::param(
                "share",
                "a bootstrap draws as many rows as there are; a share is for subsamples",
            ));
        }
        Ok(Some(resampling))
    }
}

/// What `discover` does with the resamples.
#[derive(ClapArgs, Clone)]
pub(crate) struct ResultArgs {
    /// File for the graphs of the resamples, one JSON object on each line.
    #[arg(long, value_name = "FILE", requires = "resamples")]
    pub(crate) resample_out: Option<PathBuf>,
    /// Whether to say how much longer to record until a link that is not settled would show.
    #[arg(long, value_enum, default_value = "on", num_args = 0..=1, require_equals = true, default_missing_value = "on")]
    pub(crate) advice: Advised,
}

impl Default for ResultArgs {
    fn default() -> Self {
        Self { resample_out: None, advice: Advised::On }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_about_resamples_want_resamples_that_make_sense() {
        let args = |resamples, share: Option<f64>, block: Option<&str>, scheme: Option<&str>| ResampleArgs {
            resamples,
            share,
            block: block.map(str::to_owned),
            resampling: scheme.map(str::to_owned),
        };
        assert_eq!(args(None, None, None, None).asked().unwrap(), None);
        assert_eq!(args(Some(0), Some(0.5), None, None).asked().unwrap(), None);
        assert_eq!(args(Some(50), None, None, None).asked().unwrap().unwrap().resamples, 50);
        let refused = |args: ResampleArgs, says: &str| {
            let error = args.asked().unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        };
        refused(args(None, Some(0.5), None, None), "'share'");
        refused(args(Some(19), None, None, None), "19 is not from 20 to 10000");
        refused(args(Some(50), Some(1.0), None, None), "between 0 and 1");
        refused(args(Some(50), None, Some("long"), None), "cube_root");
        refused(args(Some(50), Some(0.5), None, Some("bootstrap")), "for subsamples");
    }
}
