//! The command line: subcommands and logging.

use std::{
    ffi::OsString,
    path::{Path, PathBuf},
    sync::LazyLock,
};

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;
use roscausal_core::{Error, Result, visible};
use tracing_subscriber::field::MakeExt as _;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::format::debug_fn;
use tracing_subscriber::{Layer as _, fmt, layer::SubscriberExt as _, util::SubscriberInitExt as _};

use crate::{
    compare, demo, discover, experiment, flags, html_report, output, presets, reasoning, replay, roll, route,
    show, teleop, terminal, topics,
};

/// Examples at the end of each `--help`; a test understands each line.
mod examples {
    pub(super) const DEMO: &str = "Examples:\n  roscausal demo\n  roscausal demo --seed 7 --out my_demo --record run.mcap\n  roscausal demo --web --do robot.off@60..90";
    pub(super) const ROLL: &str = "Examples:\n  roscausal roll data.csv --window 500 --step 125\n  roscausal roll run.mcap --batch 500 --changes -o rolling\n  roscausal roll data.csv --window 300 --test parcorr --format jsonl";
    pub(super) const DISCOVER: &str = "Examples:\n  roscausal discover data.csv\n  roscausal discover a.csv b.csv --method pcmci --test parcorr --tau-max 5 -o result\n  roscausal discover log.csv --dt 0.1 --columns 'h_*' --feature 'closing = rate(dist)'\n  roscausal discover walk.tsv --format trajectories --goal last\n  roscausal discover run.mcap --people /people --person 7";
    pub(super) const SHOW: &str = "Examples:\n  roscausal show result\n  roscausal show result --report report.html --latex links.tex\n  roscausal show result/model.json --format dot | dot -Tpdf -o model.pdf";
    pub(super) const COMPARE: &str = "Examples:\n  roscausal compare a/model.json b/model.json\n  roscausal compare a/model.json b/model.json -o difference";
    pub(super) const REPLAY: &str = "Examples:\n  roscausal replay run.mcap --speed 5 --web\n  roscausal replay walk.bag --people /people --person nearest:1 -o models";
    pub(super) const EXPERIMENT: &str = "Examples:\n  roscausal experiment --seeds 501..520 --out sweep";
    pub(super) const REPORT: &str = "Examples:\n  roscausal report result -o report.html\n  roscausal report data.csv -o report.html --latex links.tex";
    pub(super) const TELEOP: &str = "Examples:\n  roscausal teleop";
    pub(super) const TOPICS: &str = "Examples:\n  roscausal topics walk.bag";
    pub(super) const WHATIF: &str = "Examples:\n  roscausal whatif result --data a.csv,b.csv\n  roscausal whatif result/model.json --data a.csv --action 'stop: r_v=0' --action 'go on' --cost h_risk\n  roscausal whatif result/model.json --data a.csv --action 'stop: r_v=0' --had --at 60";
    pub(super) const EFFECT: &str =
        "Examples:\n  roscausal effect result/model.json --data a.csv --cause r_v --effect h_v";
    pub(super) const ROUTE: &str = "Examples:\n  roscausal route model --map house.toml --data mon.csv,tue.csv --from dock_s0 --to dock_n3 --at 11:40";
    pub(super) const EXPLAIN: &str =
        "Examples:\n  roscausal explain result/model.json --data a.csv --variable h_v";
}

/// Find out what causes what between robots and people.
#[derive(Parser)]
#[command(name = "roscausal", version, about, propagate_version = true, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Say more on stderr (`-v`: progress of the nodes, `-vv`: everything).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    /// Say nothing on stderr but errors.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Colours: auto (where a person reads; not if NO_COLOR is set), always, never.
    #[arg(long, global = true, value_enum, default_value_t = terminal::Colour::Auto, value_name = "WHEN", hide_possible_values = true, hide_short_help = true)]
    color: terminal::Colour,
}

#[allow(clippy::large_enum_variant, reason = "there is one per run")]
#[derive(Subcommand)]
pub(crate) enum Command {
    /// Simulate a robot and a person, record them and find the causal model, all in one process.
    #[command(after_help = examples::DEMO)]
    Demo(demo::Args),
    /// Find the causal model of CSV files or recordings (ROS 1 .bag, ROS 2 .mcap and .db3).
    #[command(after_help = examples::DISCOVER)]
    Discover(discover::Args),
    /// Print a stored model again, draw it, or write it and what stands behind it as one HTML file.
    #[command(after_help = examples::SHOW)]
    Show(show::Args),
    /// Say what differs between two stored models, and draw it.
    #[command(after_help = examples::COMPARE)]
    Compare(compare::Args),
    /// Find a model per window of time or batch, and tell when a mechanism changes.
    #[command(after_help = examples::ROLL)]
    Roll(roll::Args),
    /// Play a recording to the nodes as if it were live: one model for each batch.
    #[command(after_help = examples::REPLAY)]
    Replay(replay::Args),
    /// Run the demo's chain over many seeds and measure how often each link is found.
    #[command(after_help = examples::EXPERIMENT)]
    Experiment(experiment::Args),
    /// Older name of `show --report`; also of data, as `discover --out` does.
    #[command(after_help = examples::REPORT, hide = true)]
    Report(html_report::Args),
    /// Print what each discovery method says, assumes and costs, and when to take it.
    Methods,
    /// Print a script that completes this command's words in a shell (`source <(roscausal completions bash)`), or write the manual.
    Completions {
        /// The shell.
        #[arg(required_unless_present = "man")]
        shell: Option<Shell>,
        /// Folder for the manual pages, one for each subcommand (`man -l DIR/roscausal-discover.1`).
        #[arg(long, value_name = "DIR")]
        man: Option<PathBuf>,
    },
    /// Older name of `completions --man`.
    #[command(hide = true)]
    Man {
        /// Folder for them.
        dir: PathBuf,
    },
    /// Drive the simulated person from the keyboard, in real time, while the nodes record.
    #[command(after_help = examples::TELEOP)]
    Teleop(teleop::Args),
    /// List what a recording holds: topics with type, number of messages, rate and longest gap.
    #[command(after_help = examples::TOPICS)]
    Topics(topics::Args),
    /// Say what will happen over the next steps, if nobody acts or under each of some actions, or would have happened (--had), and
    /// which is best.
    #[command(after_help = examples::WHATIF, alias = "predict")]
    Whatif(reasoning::WhatIfArgs),
    /// Say how strongly one variable drives another, directly and through others, and what that rests on.
    #[command(after_help = examples::EFFECT)]
    Effect(reasoning::EffectArgs),
    /// Say why a variable changed.
    #[command(after_help = examples::EXPLAIN)]
    Explain(reasoning::ExplainArgs),
    /// Say where and when a robot should go: by which places and at which moment, from days of counts.
    #[command(after_help = examples::ROUTE, override_usage = "roscausal route MODEL --map FILE --data FILES\n       --from PLACE --to PLACE --at HH:MM [OPTIONS]")]
    Route(route::Args),
}

impl Command {
    /// Whether nothing is recorded, and no result is written bit by bit.
    pub(crate) fn only_reads(&self) -> bool {
        use Command::{Compare, Effect, Explain, Report, Route, Show, Whatif};
        matches!(self, Compare(_) | Effect(_) | Explain(_) | Report(_) | Route(_) | Show(_) | Whatif(_))
    }
}

/// The groups of flags in a `--help`, in their order, after the subcommand's own.
const HEADINGS: [&str; 8] =
    ["Data", "Recordings", "People", "Nodes and page", "Method", "Confidence", "Output", "For experts"];
/// The flags of these groups that `-h` shows: what nine in ten need.
const COMMON: [&str; 21] = [
    "columns", "rows", "dt", "feature", "people", "person", "method", "test", "alpha", "tau-max", "fdr",
    "resamples", "out", "format", "all", "time-budget", "changes", "speed", "record", "web", "label",
];

/// The command line as it is written down.
static WRITTEN: LazyLock<clap::Command> = LazyLock::new(Cli::command);

/// The same, with the flags of each subcommand in groups.
static GROUPED: LazyLock<clap::Command> = LazyLock::new(|| {
    let has_groups = |(_, sub): &(usize, &clap::Command)| {
        !sub.has_subcommands() && sub.get_arguments().any(|arg| arg.get_help_heading().is_some())
    };
    WRITTEN.get_subcommands().enumerate().filter(has_groups).fold(WRITTEN.clone(), |all, (place, sub)| {
        let new = grouped(sub).display_order(place).hide(sub.is_hide_set());
        all.mut_subcommand(sub.get_name(), |_| new)
    })
});

/// The command line, with the flags of each subcommand in groups.
pub(crate) fn command() -> clap::Command {
    GROUPED.clone()
}

fn grouped(sub: &'static clap::Command) -> clap::Command {
    let place =
        |arg: &clap::Arg| HEADINGS.iter().position(|heading| Some(*heading) == arg.get_help_heading());
    let is_rare = |arg: &clap::Arg| {
        arg.get_help_heading().is_some() && !arg.get_long().is_some_and(|flag| COMMON.contains(&flag))
    };
    let mut args: Vec<clap::Arg> = sub.get_arguments().cloned().collect();
    args.sort_by_key(place);
    let args = args.into_iter().map(|arg| if is_rare(&arg) { arg.hide_short_help(true) } else { arg });
    clap::Command::new(sub.get_name())
        .about(sub.get_about().cloned().unwrap_or_default())
        .args(args)
        .groups(sub.get_groups().cloned())
        .after_help(sub.get_after_help().cloned().unwrap_or_default())
}

/// The longest word of the command line that a complaint quotes, in characters: a path may be long.
const LONGEST_WORD: usize = 400;

/// Whose warnings of a file that is played are notes at its end.
const REPORTED_AT_THE_END: [&str; 5] =
    ["batch::recorder", "nodes::discovery", "nodes::health", "people", "signal"];

/// Complains about a command line that cannot be understood, and ends the process.
fn refuse(line: &[OsString], error: &clap::Error, colour: terminal::Colour) -> ! {
    // What clap quotes are words of the line: with these spelled out, it quotes nothing that a terminal obeys. Spelled in another way
    // where they mean something, such as x<U+001B> in a condition.
    let shown =
        |word: &OsString| visible::line(&visible::cut(&word.to_string_lossy(), LONGEST_WORD)).into_owned();
    let again = |shown: &dyn Fn(&OsString) -> String| {
        command().color(colour.for_clap()).try_get_matches_from(line.iter().map(shown)).err()
    };
    match again(&shown).or_else(|| again(&|word| shown(word).replace(['<', '>'], "|"))) {
        Some(shown) => terminal::print_complaint(&shown.render()),
        None => terminal::print_error(format_args!("{error}")),
    }
    std::process::exit(error.exit_code())
}

/// Prints the script of a shell.
pub(crate) fn print_completions(shell: Shell) {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command(), "roscausal", &mut script);
    terminal::print_text(&String::from_utf8_lossy(&script));
}

/// Writes the manual pages, one for each subcommand.
///
/// # Errors
/// The error of the file system.
pub(crate) fn write_manual(dir: &Path) -> Result<()> {
    let mut command = command();
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

impl Cli {
    /// Reads the command line, and puts in the settings of files: the user's and the data's. `None` if it asked for help or the
    /// version, which is printed then. Wrong usage ends the process.
    ///
    /// # Errors
    /// A file of settings that cannot be used.
    pub(crate) fn with_presets(line: Vec<OsString>) -> Result<Option<Self>> {
        flags::know(&GROUPED);
        let colour = terminal::Colour::in_line(&line);
        colour.choose();
        let matches = match command().color(colour.for_clap()).try_get_matches_from(&line) {
            Ok(matches) => matches,
            Err(error) if error.use_stderr() => refuse(&line, &error, colour),
            Err(asked_for) => {
                // clap itself would not say that the text could not be written.
                terminal::print_styled(&asked_for.render());
                return Ok(None);
            }
        };
        if matches.subcommand().is_some_and(|(_, own)| own.get_flag("quiet")) {
            terminal::be_quiet();
        }
        let (whole, reported) = presets::apply(&line, &matches, &command())?;
        reported.iter().for_each(|reported| tell!("{reported}"));
        let understood = command().color(colour.for_clap()).try_get_matches_from(&whole);
        let mut matches = understood.unwrap_or_else(|error| refuse(&whole, &error, colour));
        let cli =
            Self::from_arg_matches_mut(&mut matches).map_err(|error| Error::param("arguments", error))?;
        cli.color.choose();
        Ok(Some(cli))
    }

    /// Logs to stderr. `RUST_LOG` takes precedence.
    pub(crate) fn start_logging(&self) {
        const LEVELS: [LevelFilter; 3] = [LevelFilter::WARN, LevelFilter::INFO, LevelFilter::DEBUG];
        let default = if self.quiet { LevelFilter::ERROR } else { LEVELS[usize::from(self.verbose).min(2)] };
        // As the nodes read it: without spans and fields, which would bring a library of regular expressions.
        let chosen = std::env::var("RUST_LOG").ok().and_then(|text| text.parse::<Targets>().ok());
        let fields = debug_fn(|out, field, value| {
            let value = visible::message(&format!("{value:?}"));
            match field.name() {
                "message" => write!(out, "{value}"),
                name => write!(out, "{name}={value}"),
            }
        });
        let log = fmt::layer()
            .with_writer(std::io::stderr)
            .with_target(false)
            .with_ansi(terminal::is_coloured())
            .compact()
            .fmt_fields(fields.delimited(" "))
            .with_filter(chosen.unwrap_or_else(|| {
                // What is played from a file is reported at its end, without advice for a robot that runs.
                let is_live = self.verbose > 0
                    || matches!(self.command, Command::Demo(_) | Command::Experiment(_) | Command::Teleop(_));
                let silent = REPORTED_AT_THE_END.iter().filter(|_| !is_live);
                let silent = silent.map(|module| (format!("roscausal_core::{module}"), LevelFilter::ERROR));
                Targets::new().with_default(default).with_targets(silent)
            }));
        // A program that calls the command twice has its log already.
        let _ = tracing_subscriber::registry().with(log).try_init();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The words of a line, with those in single quotes together.
    fn words(line: &str) -> Vec<String> {
        let quoted = line.split('\'').enumerate();
        quoted
            .flat_map(|(part, text)| match part % 2 {
                0 => text.split_whitespace().map(str::to_owned).collect(),
                _ => vec![text.to_owned()],
            })
            .collect()
    }

    #[test]
    fn a_short_help_has_at_most_25_flags_and_a_long_one_ends_with_those_for_experts() {
        let mut command = super::command().term_width(80);
        command.build();
        for sub in command.get_subcommands_mut() {
            let is_flag = |line: &&str| line.trim_start().starts_with('-');
            let short = sub.render_help().to_string();
            assert!(short.lines().filter(is_flag).count() <= 25, "{short}");
            // What cannot be broken is an example.
            let (flags, _) = short.split_once("Examples:").unwrap_or((&short, ""));
            assert!(flags.lines().all(|line| line.chars().count() <= 80), "{short}");
            let long = sub.render_long_help().to_string();
            let headings: Vec<usize> =
                HEADINGS.iter().filter_map(|of| long.find(&format!("\n{of}:\n"))).collect();
            assert!(headings.is_sorted(), "{long}");
        }
    }

    #[test]
    fn the_list_of_subcommands_begins_with_the_demo_and_has_no_old_name() {
        let help = super::command().render_help().to_string();
        let (_, listed) = help.split_once("Commands:\n").expect("a list");
        // What goes on below a name is indented farther.
        let listed =
            listed.lines().take_while(|line| !line.is_empty()).filter(|line| !line.starts_with("   "));
        let names: Vec<&str> = listed.filter_map(|line| line.split_whitespace().next()).collect();
        assert!(names.starts_with(&["demo", "discover", "show"]), "{names:?}");
        assert!(!names.contains(&"report") && !names.contains(&"man"), "{names:?}");
    }

    #[test]
    fn every_subcommand_with_flags_has_examples_that_are_understood() {
        let command = super::command();
        let mut seen = 0;
        for sub in command.get_subcommands() {
            let Some(help) = sub.get_after_help() else {
                assert!(
                    ["completions", "man", "methods"].contains(&sub.get_name()),
                    "{} has no example",
                    sub.get_name()
                );
                continue;
            };
            let help = help.to_string();
            for line in help.lines().skip(1) {
                let line = line.split(" | ").next().expect("a line").trim();
                if let Err(error) = super::command().try_get_matches_from(words(line)) {
                    panic!("{line}: {error}");
                }
                seen += 1;
            }
        }
        assert!(seen >= 18, "{seen}");
    }
}
