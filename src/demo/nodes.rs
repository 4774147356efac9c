//! The four nodes as threads on one bus.

use std::{
    sync::mpsc::{Receiver, channel},
    thread::{self, JoinHandle},
};

use roscausal_core::{
    Error, Result,
    discovery::{Progress, analysis::Settings},
    loopback::{Loopback, LoopbackNode},
    middleware::Middleware,
    nodes,
    params::Value,
};

use super::{BATCHES, folders::Folders};

/// Step of the demo's batches in seconds.
const DT: f64 = 0.3;

/// Recording nodes, in the order in which they take part.
const RECORDING: [&str; 3] = ["robot", "human", "data"];

/// The running nodes: those that record, and the one that analyses beside them.
pub(super) struct Nodes {
    bus: Loopback,
    recording: Vec<JoinHandle<Result<()>>>,
    discovery: LoopbackNode,
    analysing: JoinHandle<Result<()>>,
}

impl Nodes {
    /// Starts robot, human, data and discovery; the receiver tells the progress of the analysis.
    pub(super) fn start(bus: &Loopback) -> Result<(Self, Receiver<Progress>)> {
        let (sender, progress) = channel();
        let start = |name: &'static str| bus.start(name, move |mw| nodes::run(name, &mw));
        let recording = RECORDING.into_iter().map(start).collect::<Result<Vec<_>>>()?;
        let discovery = bus.node("discovery");
        let its_own = discovery.clone();
        // Nobody listens any more once the demo ends.
        let tell = move |progress| sender.send(progress).unwrap_or_default();
        let analysing = thread::spawn(move || nodes::discovery_with(&its_own, tell));
        Ok((Self { bus: bus.clone(), recording, discovery, analysing }, progress))
    }

    /// Whether a node has ended before its time.
    pub(super) fn one_has_ended(&self) -> bool {
        self.analysing.is_finished() || self.recording.iter().any(JoinHandle::is_finished)
    }

    /// Ends all and waits for them; the data node writes what it has. The first failure of a node is the answer.
    pub(super) fn end(self) -> Result<()> {
        self.discovery.shutdown();
        self.bus.shutdown();
        for (name, thread) in RECORDING.into_iter().zip(self.recording).chain([("discovery", self.analysing)])
        {
            let died = |_| Error::Middleware(format!("the node {name} died; please report it"));
            thread.join().map_err(died)??;
        }
        Ok(())
    }
}

/// Sets the nodes' parameters as a launch file would.
pub(super) fn set_parameters(
    bus: &Loopback,
    folders: &Folders,
    settings: &Settings,
    ts_length: f64,
    threads: Option<usize>,
) {
    let text = |text: &str| Value::Str(text.to_owned());
    let path = |path: &std::path::Path| Value::Str(path.display().to_string());
    let set = |node: &str, values: Vec<(&str, Value)>| {
        values.into_iter().for_each(|(name, value)| bus.set_node_param(node, name, value));
    };
    set(
        "data",
        vec![
            ("data_dir", path(&folders.raw)),
            ("pp_data_dir", path(&folders.processed)),
            ("ts_length", Value::Double(ts_length)),
            ("dt", Value::Double(DT)),
            // The risk as in the authors' published result.
            ("risk_model", text("v1_1")),
            ("risk_lag", Value::Int(1)),
        ],
    );
    set(
        "discovery",
        vec![
            ("data_dir", path(&folders.processed)),
            ("res_dir", path(&folders.models)),
            ("batches_per_model", Value::Int(i64::from(BATCHES))),
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
            ("threads", Value::Int(threads.unwrap_or(0) as i64)),
        ],
    );
}
