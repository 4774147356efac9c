//! The command line: subcommands and logging.

use clap::{Parser, Subcommand};
use tracing_subscriber::{EnvFilter, fmt};

use crate::{demo, discover, experiment, replay, teleop, topics};

/// Find out what causes what between robots and people.
#[derive(Parser)]
#[command(name = "roscausal", version, about, propagate_version = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Say more on stderr (`-v`: progress of the nodes, `-vv`: everything).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Simulate a robot and a person, record them and find the causal model, all in one process.
    Demo(demo::Args),
    /// Find the causal model of CSV files or recordings (ROS 1 .bag, ROS 2 .mcap and .db3).
    Discover(discover::Args),
    /// Play a recording to the nodes as if it were live: one model for each batch.
    Replay(replay::Args),
    /// Run the demo's chain over many seeds and measure how often each link is found.
    Experiment(experiment::Args),
    /// Drive the simulated person from the keyboard, in real time, while the nodes record.
    Teleop(teleop::Args),
    /// List what a recording holds: topics with type, number of messages, rate and longest gap.
    Topics(topics::Args),
}

impl Cli {
    /// Logs to stderr. `RUST_LOG` takes precedence.
    pub(crate) fn start_logging(&self) {
        let default = ["warn", "info", "debug"][usize::from(self.verbose).min(2)];
        let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
        fmt().with_env_filter(filter).with_writer(std::io::stderr).with_target(false).compact().init();
    }
}
