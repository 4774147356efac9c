//! `--resamples` and its kin: how often to analyse again on rows drawn from the data.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result};
use roscausal_discovery::{
    Named,
    confidence::{Resampling, Scheme},
    settings::Group,
};

use crate::{
    report::Detail,
    settings::{Given, of_groups},
};

/// Whether the report says how much longer to record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Advised {
    /// It does.
    On,
    /// It does not.
    Off,
}

/// How to resample; the same arguments for every subcommand that analyses.
#[derive(Clone, Debug, Default)]
pub(crate) struct ResampleArgs(Given);

of_groups!(ResampleArgs, &[Group::Resampling]);

impl ResampleArgs {
    fn of(given: Given) -> Self {
        Self(given)
    }

    /// What is asked for; `None`: no resamples.
    ///
    /// # Errors
    /// A number that makes no sense, or a flag about resamples without any.
    pub(crate) fn asked(&self) -> Result<Option<Resampling>> {
        if let (None, Some(other)) = (self.0.text("resamples"), self.0.first()) {
            let reason = format!("it is for {}; give their number, such as 100", Named("resamples"));
            return Err(Error::param(other.id, reason));
        }
        let resampling = self.0.request()?.resampling()?;
        let is_bootstrap = resampling.as_ref().is_some_and(|asked| asked.scheme == Scheme::Bootstrap);
        let reason = "a bootstrap draws as many rows as there are; a share is for subsamples";
        Error::ensure(self.0.text("share").is_none() || !is_bootstrap, "share", || reason)?;
        Ok(resampling)
    }
}

/// What `discover` does with the resamples.
#[derive(ClapArgs, Clone)]
#[command(next_help_heading = "Confidence")]
pub(crate) struct ResultArgs {
    /// File for the graphs of the resamples, one JSON object on each line.
    #[arg(long, value_name = "FILE", requires = "resamples")]
    pub(crate) resample_out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) detail: Detail,
    /// Whether to say what to do next, such as how much longer to record.
    #[arg(long, value_enum, default_value = "on", num_args = 0..=1, require_equals = true, default_missing_value = "on")]
    pub(crate) advice: Advised,
}

#[cfg(test)]
mod tests {
    use clap::{Args, FromArgMatches};

    use super::*;

    #[test]
    fn flags_about_resamples_want_resamples_that_make_sense() {
        let args = |words: &str| {
            let command = ResampleArgs::augment_args(clap::Command::new("test"));
            let matches = command.get_matches_from(["test"].into_iter().chain(words.split_whitespace()));
            ResampleArgs::from_arg_matches(&matches).unwrap()
        };
        assert_eq!(args("").asked().unwrap(), None);
        assert_eq!(args("--resamples 0 --share 0.5").asked().unwrap(), None);
        assert_eq!(args("--resamples 50").asked().unwrap().unwrap().resamples, 50);
        let refused = |words: &str, says: &str| {
            let error = args(words).asked().unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        };
        refused("--share 0.5", "'resample_share'");
        refused("--resamples 19", "19 is not from 20 to 10000");
        refused("--resamples 50 --share 1.0", "between 0 and 1");
        refused("--resamples 50 --block long", "cube_root");
        refused("--resamples 50 --share 0.5 --resampling bootstrap", "for subsamples");
    }
}
