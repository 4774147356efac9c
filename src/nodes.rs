//! The nodes as threads on one bus.

use std::{
    path::Path,
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{Receiver, channel},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use roscausal_core::{
    Error, Result,
    discovery::{Progress, analysis::Settings},
    loopback::{Loopback, LoopbackNode},
    middleware::Middleware,
    nodes,
    params::Value,
};

use crate::folders::Folders;

/// The nodes that record, in the order in which they take part.
pub(crate) const RECORDING: [&str; 3] = ["robot", "human", "data"];

/// Between two looks whether a node is up.
const LOOK_AGAIN: Duration = Duration::from_millis(1);

/// The running nodes: those that record, and perhaps the one that analyses beside them.
pub(crate) struct Nodes {
    bus: Loopback,
    recording: Vec<Running>,
    discovery: Option<Running>,
}

struct Running {
    name: &'static str,
    node: LoopbackNode,
    thread: JoinHandle<Result<()>>,
}

impl Running {
    fn join(self) -> Result<()> {
        let died = |_| Error::Middleware(format!("the node {} died; please report it", self.name));
        self.thread.join().map_err(died)?
    }
}

impl Nodes {
    /// Starts the nodes `names` of [`RECORDING`].
    pub(crate) fn start(bus: &Loopback, names: &[&'static str]) -> Result<Self> {
        let mut this = Self { bus: bus.clone(), recording: Vec::new(), discovery: None };
        for &name in names {
            let handle = Arc::new(Mutex::new(None));
            let told = handle.clone();
            let thread = bus.start(name, move |mw| {
                *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(mw.clone());
                nodes::run(name, &mw)
            })?;
            let node = handle.lock().unwrap_or_else(PoisonError::into_inner).take();
            let node = node.ok_or_else(|| Error::Middleware(format!("the node {name} did not start")))?;
            this.recording.push(Running { name, node, thread });
        }
        Ok(this)
    }

    /// Starts the discovery node too; the receiver tells the progress of each analysis.
    pub(crate) fn with_discovery(mut self) -> Result<(Self, Receiver<Progress>)> {
        let (sender, progress) = channel();
        let node = self.bus.node("discovery");
        let its_own = node.clone();
        // Nobody listens any more once the command ends.
        let tell = move |progress| sender.send(progress).unwrap_or_default();
        let thread = thread::spawn(move || nodes::discovery_with(&its_own, tell));
        // Its last topic: whoever looks for topics from here on finds them all.
        let is_up = || node.topics().iter().any(|(topic, _)| topic == "/roscausal/tsdag/compressed");
        while !thread.is_finished() && !is_up() {
            thread::sleep(LOOK_AGAIN);
        }
        self.discovery = Some(Running { name: "discovery", node, thread });
        Ok((self, progress))
    }

    /// Whether a node has ended before its time.
    pub(crate) fn one_has_ended(&self) -> bool {
        self.recording.iter().chain(&self.discovery).any(|running| running.thread.is_finished())
    }

    /// Ends the nodes that record, each after the one before has left; the data node writes what it has.
    pub(crate) fn end_recording(&mut self) -> Result<()> {
        for running in std::mem::take(&mut self.recording) {
            running.node.shutdown();
            self.bus.settle();
            running.join()?;
        }
        Ok(())
    }

    /// Ends all and waits for them. The first failure of a node is the answer.
    pub(crate) fn end(mut self) -> Result<()> {
        if let Some(discovery) = &self.discovery {
            discovery.node.shutdown();
        }
        let recorded = self.end_recording();
        let analysed = self.discovery.take().map_or(Ok(()), Running::join);
        recorded.and(analysed)
    }
}

/// Where the data node puts its batches.
pub(crate) fn set_pools(bus: &Loopback, raw: &Path, processed: &Path) {
    bus.set_node_param("data", "data_dir", text(&raw.display().to_string()));
    bus.set_node_param("data", "pp_data_dir", text(&processed.display().to_string()));
}

/// Tells the discovery node how to analyse what comes into `folders`, so many batches at a time.
pub(crate) fn set_discovery(
    bus: &Loopback,
    folders: &Folders,
    settings: &Settings,
    batches: u32,
    threads: Option<usize>,
) {
    let values = [
        ("data_dir", text(&folders.processed.display().to_string())),
        ("res_dir", text(&folders.models.display().to_string())),
        ("batches_per_model", Value::Int(i64::from(batches))),
        ("keep_batches", Value::Bool(true)),
        ("cd_method", text(&settings.method)),
        ("cond_ind_test", text(&settings.cond_ind_test)),
        ("sig_alpha", Value::Double(settings.alpha)),
        ("pc_alpha", Value::Double(settings.level_of_pc().unwrap_or(0.0))),
        ("f_alpha", Value::Double(settings.f_alpha.unwrap_or(0.0))),
        ("te_estimator", text(&settings.te_estimator)),
        ("fdr_method", text(&settings.fdr)),
        ("min_lag", Value::Int(settings.tau_min as i64)),
        ("max_lag", Value::Int(settings.tau_max as i64)),
        ("seed", Value::Int(i64::try_from(settings.seed).unwrap_or(i64::MAX))),
        ("threads", Value::Int(threads.unwrap_or(0) as i64)),
    ];
    values.into_iter().for_each(|(name, value)| bus.set_node_param("discovery", name, value));
}

fn text(text: &str) -> Value {
    Value::Str(text.to_owned())
}
