//! The node as a program: its arguments, its log, its end.

use std::{thread, time::Duration};

use roscausal_core::{Result, middleware::Middleware};
use roscausal_ros::{
    Console,
    console::{LevelFilter, Targets},
    program::Backend,
};

use crate::{Args, Ros2};

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
            // Both report as errors what is ordinary on a network.
            .with_target("rustdds", LevelFilter::OFF)
            .with_target("ros2_client", LevelFilter::OFF)
    }

    fn join(args: Args, console: &Console, _: &dyn Fn() -> bool) -> Result<Self> {
        console.name(&args.names.logger());
        args.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
        let ros = Self::start(&args)?;
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

/// A panic on one of the library's own threads leaves a node that hears nothing: it ends, to be started again.
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
