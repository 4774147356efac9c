//! The `roscausal` command: simulate, record, discover, replay. It needs no ROS.

mod chart;
mod cli;
mod demo;
mod discover;
mod expected;
mod experiment;
mod export;
mod failure;
mod folders;
mod interrupt;
mod nodes;
mod output;
mod recording;
mod replay;
mod report;
mod sink;
mod teleop;
mod terminal;
mod topics;
mod web;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    cli.start_logging();
    let interrupt = interrupt::Interrupt::on_ctrl_c();
    let done = match &cli.command {
        cli::Command::Demo(args) => demo::run(args, &interrupt),
        cli::Command::Replay(args) => replay::run(args, &interrupt),
        cli::Command::Discover(args) => discover::run(args, &interrupt),
        cli::Command::Experiment(args) => experiment::run(args, &interrupt),
        cli::Command::Teleop(args) => teleop::run(args),
        cli::Command::Topics(args) => topics::run(args, &interrupt),
    };
    failure::exit_code(done)
}
