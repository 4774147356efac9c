//! `roscausal_ros1 NODE [ROS arguments]`: one of the nodes of ROS-Causal on a ROS 1 master. Under another name,
//! such as `roscausal_data`, it runs the node of that name.

use std::{
    env,
    io::IsTerminal,
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
    process::ExitCode,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::Duration,
};

use roscausal_core::{Error, Result, middleware::Middleware, nodes};
use roscausal_ros1::{Ros1, Rosout};
use signal_hook::{
    consts::{SIGINT, SIGTERM},
    iterator::Signals,
};
use tracing_subscriber::{EnvFilter, Layer, filter::LevelFilter, prelude::*};

/// The simulator, beside [`nodes::NODES`].
const SIMULATOR: &str = "hrisim";
/// The live page.
const DASHBOARD: &str = "dashboard";
/// How long a node may take to save and leave before it is taken off the master and ended.
const FAREWELL: Duration = Duration::from_secs(10);

fn main() -> ExitCode {
    let rosout = start_logs();
    let Some(node) = node_to_run() else {
        let nodes = nodes::NODES.join("|");
        eprintln!(
            "usage: roscausal_ros1 {nodes}|{SIMULATOR}|{DASHBOARD} [topic:=other] [_parameter:=value] [__name:=name]"
        );
        return ExitCode::from(2);
    };
    run(&node, &rosout).unwrap_or_else(|error| {
        tracing::error!("{error}");
        ExitCode::FAILURE
    })
}

/// Runs the node to its end; what goes wrong meanwhile is told while `/rosout` still takes it.
fn run(node: &str, rosout: &Rosout) -> Result<ExitCode> {
    let stop = Stop::on_signals()?;
    let mw = Ros1::connect(&format!("roscausal_{node}"), &|| !stop.asked())?;
    rosout.attach(&mw);
    stop.end_with(&mw);
    let outcome = catch_unwind(AssertUnwindSafe(|| run_node(node, &mw)));
    match &outcome {
        Ok(Ok(())) => {}
        Ok(Err(error)) => tracing::error!("{error}"),
        Err(_) => tracing::error!("the node {} panicked; it leaves the master", mw.node_name()),
    }
    mw.close();
    Ok(if matches!(outcome, Ok(Ok(()))) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The node named by the program's own name, or by the first argument.
fn node_to_run() -> Option<String> {
    let mut args = env::args();
    let program = args.next().unwrap_or_default();
    let is_node =
        |name: &String| name == SIMULATOR || name == DASHBOARD || nodes::NODES.contains(&name.as_str());
    let name = Path::new(&program).file_name()?.to_str()?.strip_prefix("roscausal_").map(str::to_owned);
    name.filter(is_node).or_else(|| args.next().filter(is_node))
}

fn run_node(node: &str, mw: &Ros1) -> Result<()> {
    match node {
        SIMULATOR => {
            mw.warn_of_unknown_params(&roscausal_hrisim::node::parameters());
            roscausal_hrisim::node::run(mw)
        }
        DASHBOARD => {
            mw.warn_of_unknown_params(&roscausal_dashboard::parameters());
            roscausal_dashboard::run(mw)
        }
        name => {
            mw.warn_of_unknown_params(&nodes::parameters(name)?);
            nodes::run(name, mw)
        }
    }
}

/// Lines to stderr (`RUST_LOG` chooses) and to `/rosout`.
fn start_logs() -> Rosout {
    let rosout = Rosout::default();
    // ROS 1's own client is chatty below warnings
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info,hyper=warn"));
    let terminal = tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_target(false);
    let terminal = terminal.with_ansi(std::io::stderr().is_terminal()).with_filter(filter);
    tracing_subscriber::registry().with(terminal).with(rosout.clone().with_filter(LevelFilter::INFO)).init();
    rosout
}

/// SIGINT and SIGTERM: the first asks the node to end, the second, or ten seconds, ends it.
struct Stop {
    count: Arc<AtomicUsize>,
    node: Arc<OnceLock<Ros1>>,
}

impl Stop {
    fn on_signals() -> Result<Self> {
        let (count, node) = (Arc::new(AtomicUsize::new(0)), Arc::new(OnceLock::<Ros1>::new()));
        let fault = |error: std::io::Error| Error::Middleware(format!("cannot listen to signals: {error}"));
        let mut signals = Signals::new([SIGINT, SIGTERM]).map_err(fault)?;
        let (seen, its_node) = (count.clone(), node.clone());
        let listen = move || {
            for _ in signals.forever() {
                let node = its_node.get();
                if seen.fetch_add(1, Ordering::SeqCst) > 0 {
                    leave_now(node);
                }
                if let Some(node) = node {
                    node.shutdown();
                }
                let late = its_node.clone();
                thread::spawn(move || {
                    thread::sleep(FAREWELL);
                    leave_now(late.get());
                });
            }
        };
        thread::Builder::new().name("signals".to_owned()).spawn(listen).map_err(fault)?;
        Ok(Self { count, node })
    }

    fn asked(&self) -> bool {
        self.count.load(Ordering::SeqCst) > 0
    }

    fn end_with(&self, mw: &Ros1) {
        let _ = self.node.set(mw.clone());
        if self.asked() {
            mw.shutdown();
        }
    }
}

fn leave_now(node: Option<&Ros1>) -> ! {
    if let Some(node) = node {
        node.close();
    }
    std::process::exit(1)
}
