//! The node as a program: its arguments, its log, its end.

use std::time::Duration;

use roscausal_core::Result;
use roscausal_ros::console::{LevelFilter, Targets};
use roscausal_ros::{Console, program::Backend};

use crate::Ros1;

impl Backend for Ros1 {
    /// The node's name; rosrust reads the command line itself.
    type Start = String;
    const PROGRAM: &'static str = "roscausal_ros1";
    const ARGUMENTS: &'static str = "[topic:=other] [_parameter:=value] [__name:=name]";
    const LEAVE_WITHIN: Duration = Duration::from_secs(10);
    const END_WITHIN: Duration = Duration::ZERO;

    fn read(name: &str, args: Vec<String>) -> std::result::Result<String, String> {
        match args.iter().find(|arg| arg.starts_with('_') && arg.ends_with(":=")) {
            Some(empty) => {
                Err(format!("the argument {empty} has no value; for an empty text write {empty}'\"\"'"))
            }
            None => Ok(name.to_owned()),
        }
    }

    /// `RUST_LOG` sets the filter.
    fn filter(_: &String) -> Targets {
        let chosen = std::env::var("RUST_LOG").ok().and_then(|text| text.parse().ok());
        // ROS 1's own client logs much below warnings.
        let usual = || Targets::new().with_default(LevelFilter::INFO).with_target("hyper", LevelFilter::WARN);
        chosen.unwrap_or_else(usual)
    }

    fn join(name: String, console: &Console, goes_on: impl Fn() -> bool + Send + 'static) -> Result<Self> {
        let node = Self::connect(&name, &goes_on)?;
        node.log_with(console)?;
        Ok(node)
    }

    fn leave(&self) {
        self.close();
    }
}
