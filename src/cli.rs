//! The command line: subcommands and logging.

use std::{
    io::IsTerminal,
    path::{Path, PathBuf},
};

use clap::{CommandFactory, Parser, Subcommand};
use clap_complete::Shell;
use roscausal_core::{Error, Result};
use tracing_subscriber::{EnvFilter, fmt};

use crate::{
    compare, demo, discover, experiment, html_report, output, presets, reasoning, replay, roll, show, teleop,
    terminal, topics,
};

/// Find out what causes what between robots and people.
#[derive(Parser)]
#[command(name = "roscausal", version, about, propagate_version = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Say more on stderr (`-v`: progress of the nodes, `-vv`: everything).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    /// Say nothing on stderr but errors.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
}

#[allow(clippy::large_enum_variant, reason = "there is one per run")]
#[derive(Subcommand)]
pub(crate) enum Command {
    /// Simulate a robot and a person, record them and find the causal model, all in one process.
    Demo(demo::Args),
    /// Find the causal model of CSV files or recordings (ROS 1 .bag, ROS 2 .mcap and .db3).
    Discover(discover::Args),
    /// Print a stored model again, and draw it.
    Show(show::Args),
    /// Say what differs between two stored models, and draw it.
    Compare(compare::Args),
    /// Find a model per window of time or batch, and tell when a mechanism changes.
    Roll(roll::Args),
    /// Play a recording to the nodes as if it were live: one model for each batch.
    Replay(replay::Args),
    /// Run the demo's chain over many seeds and measure how often each link is found.
    Experiment(experiment::Args),
    /// Write a model and what stands behind it as one HTML file, to read, print and pass on.
    Report(html_report::Args),
    /// Print a script that completes this command's words in a shell: `source <(roscausal completions bash)`.
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Write the manual pages, one for each subcommand (`man -l DIR/roscausal-discover.1`).
    Man {
        /// Folder for them.
        dir: PathBuf,
    },
    /// Drive the simulated person from the keyboard, in real time, while the nodes record.
    Teleop(teleop::Args),
    /// List what a recording holds: topics with type, number of messages, rate and longest gap.
    Topics(topics::Args),
    /// Say what will happen over the next steps if nobody acts, by a causal model and data.
    Predict(reasoning::PredictArgs),
    /// Say what will happen under each of some actions, or would have happened (--had), and which is best.
    Whatif(reasoning::WhatIfArgs),
    /// Say how strongly one variable drives another, directly and through others, and what that rests on.
    Effect(reasoning::EffectArgs),
    /// Say why a variable changed.
    Explain(reasoning::ExplainArgs),
}

/// The long flags of all subcommands, without dashes.
pub(crate) fn long_flags() -> Vec<String> {
    let command = Cli::command();
    let longs =
        command.get_subcommands().flat_map(|sub| sub.get_arguments()).filter_map(|arg| arg.get_long());
    let mut longs: Vec<String> = longs.map(str::to_owned).collect();
    longs.sort();
    longs.dedup();
    longs
}

/// Prints the script of a shell.
pub(crate) fn print_completions(shell: Shell) {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "roscausal", &mut script);
    terminal::print(format_args!("{}", String::from_utf8_lossy(&script)));
}

/// Writes the manual pages, one for each subcommand.
///
/// # Errors
/// The error of the file system.
pub(crate) fn write_manual(dir: &Path) -> Result<()> {
    let mut command = Cli::command();
    command.build();
    let pages =
        std::iter::once(&command).chain(command.get_subcommands().filter(|sub| sub.get_name() != "help"));
    for page in pages {
        let name = page.get_display_name().unwrap_or("roscausal").to_owned();
        let mut text = Vec::new();
        clap_mangen::Man::new(page.clone()).render(&mut text).map_err(|error| Error::file(dir, error))?;
        output::write_file(dir, &format!("{name}.1"), &text)?;
    }
    Ok(())
}

/// Whether a subcommand has a long flag.
pub(crate) fn has_flag(subcommand: &str, flag: &str) -> bool {
    let command = Cli::command();
    let own = command.find_subcommand(subcommand);
    own.is_some_and(|own| own.get_arguments().any(|arg| arg.get_long() == Some(flag)))
}

impl Cli {
    /// Reads the command line, and puts in the settings that lie beside the data it names.
    ///
    /// # Errors
    /// A file of settings that cannot be used.
    pub(crate) fn with_presets(mut line: Vec<std::ffi::OsString>) -> Result<Self> {
        let matches = Self::command().get_matches_from(&line);
        if matches.subcommand().is_some_and(|(_, own)| own.get_flag("quiet")) {
            terminal::be_quiet();
        }
        if let Some((whole, told)) = presets::apply(&line, &matches)? {
            told.iter().for_each(|told| crate::terminal::tell!("{told}"));
            line = whole;
        }
        Ok(Self::parse_from(line))
    }

    /// Logs to stderr. `RUST_LOG` takes precedence.
    pub(crate) fn start_logging(&self) {
        let default =
            if self.quiet { "error" } else { ["warn", "info", "debug"][usize::from(self.verbose).min(2)] };
        let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
        let colours =
            std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|set| set.is_empty());
        let log = fmt()
            .with_env_filter(filter)
            .with_writer(std::io::stderr)
            .with_target(false)
            .with_ansi(colours)
            .compact();
        // A program that calls the command twice has its log already.
        let _ = log.try_init();
    }
}
