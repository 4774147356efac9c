//! The `roscausal` command as a library: simulate, record, discover, replay. It needs no ROS.
//!
//! The program `roscausal` calls [`command`]; the Python package also calls the parts: [`run_demo`], [`read_recordings`], and
//! models and answers in words and in other programs' formats.

#[macro_use]
mod terminal;

mod carried;
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
#[cfg(test)]
mod hostile_tests;
mod html_report;
mod interrupt;
mod nodes;
mod output;
mod presets;
mod reasoning;
mod recording;
mod replay;
mod report;
mod results;
mod roll;
mod route;
mod settings;
mod show;
mod sink;
mod teleop;
mod topics;
mod travel;
mod web;

use std::ffi::OsString;

use roscausal_discovery::methods::Method;

pub use demo::run_demo;
pub use discover::{Recordings, read_recordings};
pub use export::{dot, graphml, links_csv};
pub use reasoning::{effect_text, explain_text, what_if_text};
pub use report::text;

/// Runs the command with these arguments, the first of which is its name, and returns its exit code: 0 finished,
/// 1 failure, 2 wrong usage, 3 a question that the data do not carry, 130 ended by Ctrl-C. Wrong usage ends the process.
pub fn command<I: IntoIterator<Item = OsString>>(args: I) -> u8 {
    roscausal_core::spell_out_panics();
    let interrupt = interrupt::Interrupt::on_ctrl_c();
    let cli = match cli::Cli::with_presets(args.into_iter().collect()) {
        Ok(Some(cli)) => cli,
        Ok(None) => return failure::exit_code(Ok(()), &interrupt),
        Err(error) => return failure::exit_code(Err(error), &interrupt),
    };
    cli.start_logging();
    if cli.command.only_reads() {
        interrupt.nothing_at_stake("there is no result yet");
    }
    let done = match &cli.command {
        cli::Command::Demo(args) => demo::run(args, &interrupt),
        cli::Command::Replay(args) => replay::run(args, &interrupt),
        cli::Command::Discover(args) => discover::run(args, &interrupt),
        cli::Command::Roll(args) => roll::run(args, &interrupt),
        cli::Command::Methods => {
            terminal::print_text(&Method::table());
            Ok(())
        }
        cli::Command::Completions { shell, man } => {
            shell.iter().for_each(|shell| cli::print_completions(*shell));
            man.iter().try_for_each(|dir| cli::write_manual(dir))
        }
        cli::Command::Man { dir } => cli::write_manual(dir),
        cli::Command::Show(args) => show::run(args),
        cli::Command::Compare(args) => compare::run(args),
        cli::Command::Experiment(args) => experiment::run(args, &interrupt),
        cli::Command::Report(args) => html_report::run(args, &interrupt),
        cli::Command::Teleop(args) => teleop::run(args),
        cli::Command::Topics(args) => topics::run(args, &interrupt),
        cli::Command::Whatif(args) => return failure::answered(reasoning::what_if(args), &interrupt),
        cli::Command::Route(args) => return failure::answered(route::run(args), &interrupt),
        cli::Command::Effect(args) => return failure::answered(reasoning::effect(args), &interrupt),
        cli::Command::Explain(args) => return failure::answered(reasoning::explain(args), &interrupt),
    };
    failure::exit_code(done, &interrupt)
}
