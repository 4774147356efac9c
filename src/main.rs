//! The `roscausal` command: simulate, record, discover, replay. It needs no ROS.

mod chart;
mod cli;
mod compare;
mod demo;
mod discover;
mod expected;
mod experiment;
mod export;
mod failure;
mod flags;
mod folders;
mod interrupt;
mod nodes;
mod output;
mod presets;
mod recording;
mod replay;
mod report;
mod show;
mod sink;
mod teleop;
mod terminal;
mod web;

use std::process::ExitCode;

fn main() -> ExitCode {
    let interrupt = interrupt::Interrupt::on_ctrl_c();
    let cli = match cli::Cli::with_presets() {
        Ok(cli) => cli,
        Err(error) => return failure::exit_code(Err(error), &interrupt),
    };
    cli.start_logging();
    let done = match &cli.command {
        cli::Command::Demo(args) => demo::run(args, &interrupt),
        cli::Command::Replay(args) => replay::run(args, &interrupt),
        cli::Command::Discover(args) => discover::run(args, &interrupt),
        cli::Command::Completions { shell } => {
            cli::print_completions(*shell);
            Ok(())
        }
        cli::Command::Man { dir } => cli::write_manual(dir),
        cli::Command::Show(args) => show::run(args),
        cli::Command::Compare(args) => compare::run(args),
        cli::Command::Experiment(args) => experiment::run(args, &interrupt),
        cli::Command::Teleop(args) => teleop::run(args),
    };
    failure::exit_code(done, &interrupt)
}
