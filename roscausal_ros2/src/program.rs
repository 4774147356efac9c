//! The node as a program: its arguments, its log, its end.

use std::process::{Command, exit};
use std::{os::unix::process::CommandExt, thread, time::Duration};

use roscausal_core::{Result, middleware::Middleware};
use roscausal_ros::Console;
use roscausal_ros::console::{LevelFilter, Targets};
use roscausal_ros::program::{Backend, EXIT_FAILED};

use crate::{Args, Ros2, node::HANGS};

impl Backend for Ros2 {
    type Start = Args;
    const PROGRAM: &'static str = "roscausal_ros2";
    const ARGUMENTS: &'static str =
        "[--ros-args -p name:=value -r from:=to --params-file FILE --log-level LEVEL]";
    const LEAVE_WITHIN: Duration = Duration::from_millis(700);
    const END_WITHIN: Duration = Duration::from_secs(15);

    fn read(name: &str, args: Vec<String>) -> std::result::Result<Args, String> {
        Args::parse(name, args, |variable| std::env::var(variable).ok()).map_err(|error| error.0)
    }

    fn filter(args: &Args) -> Targets {
        Targets::new()
            .with_default(LevelFilter::WARN)
            .with_target("roscausal", args.log_level)
            // Both log ordinary network events as errors.
            .with_target("rustdds", LevelFilter::OFF)
            .with_target("ros2_client", LevelFilter::OFF)
    }

    fn join(args: Args, console: &Console, goes_on: impl Fn() -> bool + Send + 'static) -> Result<Self> {
        console.name(&args.names.logger());
        args.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
        let its_console = console.clone();
        let ros = Self::start_watched(&args, move || start_anew(&its_console, goes_on()))?;
        if args.rosout {
            ros.log_with(console)?;
        }
        end_with_the_library(&ros);
        tracing::info!("{} is on domain {}", ros.node_name(), args.network.domain_id);
        Ok(ros)
    }

    fn leave(&self) {
        Self::leave(self);
    }

    fn failed(&self) -> bool {
        Self::failed(self)
    }
}

/// Replaces this process, whose DDS library has deadlocked, by a new one. The old process receives nothing any
/// more, and threads that wait for the library cannot be ended. The data node's journal holds what was recorded.
fn start_anew(console: &Console, goes_on: bool) {
    // /rosout needs the library.
    console.forward(drop);
    if !goes_on {
        tracing::error!("{HANGS}; ended all the same");
        exit(EXIT_FAILED.into());
    }
    tracing::error!("{HANGS}; the node is started anew");
    let mut args = std::env::args_os();
    let own_name = args.next().unwrap_or_default();
    let failure = match std::env::current_exe() {
        Ok(program) => Command::new(program).arg0(own_name).args(args).exec(),
        Err(error) => error,
    };
    tracing::error!("it cannot be started: {failure}");
    exit(EXIT_FAILED.into());
}

/// A panic on one of the library's own threads leaves a node that receives nothing. It ends, so that it can be
/// started again.
fn end_with_the_library(ros: &Ros2) {
    let ros = ros.clone();
    let ordinary = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        ordinary(panic);
        if thread::current().name().is_some_and(|name| name.starts_with("RustDDS")) {
            ros.fail("the DDS library broke off");
        }
    }));
}
