//! `roscausal_ros2 NODE --ros-args ...`: one of the nodes on ROS 2. Under a link `roscausal_NODE` the node is
//! told by the program's name.

use std::{path::Path, process::ExitCode, thread, time::Duration};

use roscausal_core::{Error, middleware::Middleware};
use roscausal_ros2::{Args, Ros2, args::BadArgument, console::Console};
use signal_hook::{
    consts::{SIGINT, SIGTERM},
    iterator::Signals,
};

/// The nodes that this program can be.
const NODES: [&str; 7] = ["robot", "human", "data", "discovery", "markers", "hrisim", "dashboard"];
/// How long after a signal the node is out of the graph, whatever it still does.
const LEAVE_WITHIN: Duration = Duration::from_millis(700);
/// How long after a signal the program ends, finished or not.
const END_WITHIN: Duration = Duration::from_secs(15);

/// The command line, a parameter or a name is wrong: starting again will not help.
const EXIT_USAGE: u8 = 2;
/// Something broke: starting again may help.
const EXIT_FAILED: u8 = 1;

fn main() -> ExitCode {
    match run() {
        Ok(code) => code,
        Err(error) => {
            eprintln!("roscausal_ros2: {error}");
            ExitCode::from(EXIT_USAGE)
        }
    }
}

fn run() -> Result<ExitCode, BadArgument> {
    let mut args = std::env::args().peekable();
    let program = args.next().unwrap_or_default();
    if args.next_if(|first| first == "--help" || first == "-h").is_some() {
        println!("{}", usage());
        return Ok(ExitCode::SUCCESS);
    }
    let file_name = Path::new(&program).file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let node = match file_name.strip_prefix("roscausal_").filter(|name| NODES.contains(name)) {
        Some(name) => name.to_owned(),
        None => args.next().unwrap_or_default(),
    };
    if !NODES.contains(&node.as_str()) {
        return Err(BadArgument(format!("'{node}' is no node; {}", usage())));
    }
    let args = Args::parse(&format!("roscausal_{node}"), args, |name| std::env::var(name).ok())?;
    let console = Console::install(args.log_level);
    console.name(&args.names.full_name().trim_start_matches('/').replace('/', "."));
    args.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    Ok(live(&node, &args, &console).unwrap_or_else(|error| {
        tracing::error!("{error}");
        ExitCode::from(match error {
            Error::Param { .. } | Error::Topic { .. } | Error::File { .. } => EXIT_USAGE,
            _ => EXIT_FAILED,
        })
    }))
}

fn usage() -> String {
    format!(
        "usage: roscausal_ros2 {} [--ros-args -p name:=value -r from:=to --params-file FILE --log-level LEVEL]",
        NODES.join("|")
    )
}

/// The node's life, from joining the graph until it has left it.
fn live(node: &str, args: &Args, console: &Console) -> Result<ExitCode, Error> {
    let ros = Ros2::start(args)?;
    if args.rosout {
        console.forward(&ros)?;
    }
    end_on_signals(&ros)?;
    end_with_the_library(&ros);
    tracing::info!("{} is on domain {}", ros.node_name(), args.network.domain_id);
    let outcome = match node {
        "hrisim" => roscausal_hrisim::node::run(&ros),
        "dashboard" => roscausal_dashboard::run(&ros),
        name => roscausal_core::nodes::run(name, &ros),
    };
    let failed = ros.failed();
    ros.leave();
    outcome?;
    Ok(if failed { ExitCode::from(EXIT_FAILED) } else { ExitCode::SUCCESS })
}

/// SIGINT and SIGTERM end the node; a second one ends the program at once.
fn end_on_signals(ros: &Ros2) -> Result<(), Error> {
    let failed = |error| Error::Middleware(format!("signals cannot be caught: {error}"));
    let mut signals = Signals::new([SIGINT, SIGTERM]).map_err(failed)?;
    let ros = ros.clone();
    thread::spawn(move || {
        let mut signals = signals.forever();
        if signals.next().is_none() {
            return;
        }
        tracing::info!("ending");
        ros.shutdown();
        let still_there = ros.clone();
        thread::spawn(move || {
            thread::sleep(LEAVE_WITHIN);
            still_there.leave();
            thread::sleep(END_WITHIN);
            tracing::error!("not finished {} s after the signal; ended all the same", END_WITHIN.as_secs());
            std::process::exit(EXIT_FAILED.into());
        });
        if signals.next().is_some() {
            ros.leave();
            std::process::exit(EXIT_FAILED.into());
        }
    });
    Ok(())
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
