//! The program of a backend: it runs one of the nodes, chosen by the program's own name or by the first argument.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::{ExitCode, exit};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use std::{path::Path, thread};

use roscausal_core::{Error, Result, middleware::Middleware, nodes, visible};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::{Console, console::Targets, in_time, memory};

/// The command line, a parameter or a name is wrong: starting again does not help.
const EXIT_USAGE: u8 = 2;
/// Something failed: starting again may help.
pub const EXIT_FAILED: u8 = 1;

/// A backend, from the view of its program.
pub trait Backend: Middleware {
    /// What the command line and the environment ask for, checked.
    type Start;
    /// The program's file name.
    const PROGRAM: &'static str;
    /// What may follow the node's name, for the usage line.
    const ARGUMENTS: &'static str;
    /// Time after a signal within which the node leaves the graph, whatever it is doing.
    const LEAVE_WITHIN: Duration;
    /// Time after that within which the program ends, finished or not.
    const END_WITHIN: Duration;

    /// Reads what follows the node's name on the command line. `name` is the name of the node, unless it is
    /// remapped.
    ///
    /// # Errors
    /// One sentence for the user.
    fn read(name: &str, args: Vec<String>) -> std::result::Result<Self::Start, String>;

    /// Which messages are logged.
    fn filter(start: &Self::Start) -> Targets;

    /// Joins the graph and logs to `/rosout`. While nobody answers, it waits until `goes_on` is false, that is,
    /// until the program is asked to end.
    ///
    /// # Errors
    /// The reason why the node cannot join.
    /// What keeps the node out.
    fn join(
        start: Self::Start,
        console: &Console,
        goes_on: impl Fn() -> bool + Send + 'static,
    ) -> Result<Self>;

    /// Leaves the graph at once, whatever the node is doing. It is called more than once.
    fn leave(&self);

    /// Whether the node ends because something failed.
    fn failed(&self) -> bool {
        false
    }
}

/// A node's name, and what runs it until the middleware ends.
pub type Node<B> = (&'static str, fn(&B) -> Result<()>);

/// Runs the program, which can be each of [`nodes::NODES`] and of `more`.
pub fn main<B: Backend>(more: &[Node<B>]) -> ExitCode {
    roscausal_core::spell_out_panics();
    let nodes = Nodes { more };
    // What is not UTF-8 gets marks, and is refused as what it then says.
    let mut args = std::env::args_os().map(|arg| arg.to_string_lossy().into_owned()).peekable();
    let program = args.next().unwrap_or_default();
    if args.next_if(|first| first == "--help" || first == "-h").is_some() {
        println!("{}", nodes.usage());
        return ExitCode::SUCCESS;
    }
    if args.next_if(|first| first == "--version" || first == "-V").is_some() {
        println!("{} {}", B::PROGRAM, env!("CARGO_PKG_VERSION"));
        return ExitCode::SUCCESS;
    }
    let node = nodes.named_by(&program).unwrap_or_else(|| args.next().unwrap_or_default());
    // Fits of a minute apart would hold for good what they need for a second.
    if node == "reasoning" {
        memory::give_back_large_blocks();
    }
    let start = if nodes.has(&node) {
        B::read(&format!("roscausal_{node}"), args.collect())
    } else {
        Err(format!("'{node}' is not a node; {}", nodes.usage()))
    };
    match start {
        Ok(start) => ExitCode::from(live(&node, start, |mw| nodes.run(&node, mw))),
        Err(reason) => {
            eprintln!("{}: {}", B::PROGRAM, visible::lines(&reason));
            ExitCode::from(EXIT_USAGE)
        }
    }
}

/// The nodes that the program can be.
struct Nodes<'a, B> {
    /// Those beside [`nodes::NODES`].
    more: &'a [Node<B>],
}

impl<B> Nodes<'_, B> {
    fn names(&self) -> Vec<&'static str> {
        nodes::NODES.into_iter().chain(self.more.iter().map(|(name, _)| *name)).collect()
    }

    fn has(&self, name: &str) -> bool {
        self.names().contains(&name)
    }

    /// The node that a program of this path is: `data` for `/opt/ros/lib/roscausal_data`.
    fn named_by(&self, program: &str) -> Option<String> {
        let name = Path::new(program).file_name()?.to_str()?.strip_prefix("roscausal_")?;
        self.has(name).then(|| name.to_owned())
    }
}

impl<B: Backend> Nodes<'_, B> {
    fn usage(&self) -> String {
        format!("usage: {} {} {}", B::PROGRAM, self.names().join("|"), B::ARGUMENTS)
    }

    fn run(&self, name: &str, mw: &B) -> Result<()> {
        match self.more.iter().find(|(other, _)| *other == name) {
            Some((_, run)) => run(mw),
            None => nodes::run(name, mw),
        }
    }
}

/// Runs a node from joining the graph to leaving it. Returns the exit code of the program.
fn live<B: Backend>(node: &str, start: B::Start, run: impl FnOnce(&B) -> Result<()>) -> u8 {
    let console = Console::install(B::filter(&start));
    console.name(&format!("roscausal_{node}"));
    let reported = |error: Error| {
        tracing::error!("{error}");
        match error {
            Error::Param { .. } | Error::Topic { .. } | Error::File { .. } => EXIT_USAGE,
            _ => EXIT_FAILED,
        }
    };
    let joined = Stop::on_signals().and_then(|stop| {
        let asked = stop.clone();
        let mw = B::join(start, &console, move || !asked.is_asked())?;
        stop.end_with(&mw);
        Ok(mw)
    });
    let mw = match joined {
        Ok(mw) => mw,
        Err(error) => return reported(error),
    };
    // Errors are logged while /rosout still works.
    let code = match catch_unwind(AssertUnwindSafe(|| run(&mw))) {
        Ok(Ok(())) if mw.failed() => EXIT_FAILED,
        Ok(Ok(())) => 0,
        Ok(Err(error)) => reported(error),
        Err(_) => {
            tracing::error!("the node {} panicked; it leaves", mw.node_name());
            EXIT_FAILED
        }
    };
    mw.leave();
    code
}

/// SIGINT and SIGTERM: the first signal asks the node to end; the second one, or a time-out, ends the program.
struct Stop<B> {
    asked: AtomicBool,
    node: OnceLock<B>,
}

impl<B: Backend> Stop<B> {
    fn on_signals() -> Result<Arc<Self>> {
        let fault = |error| Error::Middleware(format!("signals cannot be caught: {error}"));
        let mut signals = Signals::new([SIGINT, SIGTERM]).map_err(fault)?;
        let stop = Arc::new(Self { asked: AtomicBool::new(false), node: OnceLock::new() });
        let own = stop.clone();
        let listen = move || signals.forever().for_each(|_| own.take_signal());
        thread::Builder::new().name("signals".to_owned()).spawn(listen).map_err(fault)?;
        Ok(stop)
    }

    fn is_asked(&self) -> bool {
        self.asked.load(Ordering::SeqCst)
    }

    /// Registers the node that has to end.
    fn end_with(&self, node: &B) {
        let _ = self.node.set(node.clone());
        if self.is_asked() {
            node.shutdown();
        }
    }

    fn take_signal(self: &Arc<Self>) {
        if self.asked.swap(true, Ordering::SeqCst) {
            self.leave_in_time();
            exit(EXIT_FAILED.into());
        }
        tracing::info!("ending");
        if let Some(node) = self.node.get() {
            node.shutdown();
        }
        let late = self.clone();
        thread::spawn(move || {
            thread::sleep(B::LEAVE_WITHIN);
            let end = Instant::now() + B::END_WITHIN;
            late.leave_in_time();
            thread::sleep(end.saturating_duration_since(Instant::now()));
            let waited = (B::LEAVE_WITHIN + B::END_WITHIN).as_secs();
            tracing::error!("not finished {waited} s after the signal; ended all the same");
            exit(EXIT_FAILED.into());
        });
    }

    /// Leaves within a deadline, because the middleware may never answer.
    fn leave_in_time(&self) {
        if let Some(node) = self.node.get().cloned() {
            in_time(B::LEAVE_WITHIN + B::END_WITHIN, move || node.leave());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_the_node_that_it_is_named_after_if_that_one_is_built_in() {
        let all = Nodes::<()> { more: &[("hrisim", |_| Ok(()))] };
        assert_eq!(all.named_by("/opt/ros/lib/roscausal_data").as_deref(), Some("data"));
        assert_eq!(all.named_by("roscausal_hrisim").as_deref(), Some("hrisim"));
        assert_eq!(all.named_by("roscausal_ros2"), None);
        let fewer = Nodes::<()> { more: &[] };
        assert!(fewer.named_by("roscausal_hrisim").is_none() && !fewer.has("hrisim") && fewer.has("data"));
    }
}
