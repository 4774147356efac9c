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

/// The running nodes: those that record, and the one that analyses.
pub(super) struct Nodes {
    recording: Vec<Running>,
    discovery: Running,
}

struct Running {
    node: LoopbackNode,
    thread: JoinHandle<Result<()>>,
}

impl Nodes {
    /// Starts robot, human, data and discovery; the receiver tells the progress of the analysis.
    pub(super) fn start(bus: &Loopback) -> Result<(Self, Receiver<Progress>)> {
        let (sender, progress) = channel();
        let tell = move |progress| drop(sender.send(progress));
        let recording = ["robot", "human", "data"].map(|name| Running::start(bus, name, move |mw| nodes::run(name, mw)));
        let discovery = Running::start(bus, "discovery", move |mw| nodes::discovery_with(mw, tell));
        let nodes = Self { recording: recording.into_iter().collect(), discovery };
        // Subscriptions come first: nothing of the first messages is to be missed.
        nodes.await_start(bus)?;
        Ok((nodes, progress))
    }

    fn await_start(&self, bus: &Loopback) -> Result<()> {
        let wanted = ["/roscausal/robot", "/roscausal/humans"];
        let heard = |topic: &&str| bus.subscriber_count(topic) > 0;
        let inputs = ["/mobile_base_controller/odom", "/robot_pose", "/ped/control/teleop_persons"];
        while !wanted.iter().chain(&inputs).all(heard) {
            if self.recording.iter().any(|node| node.thread.is_finished()) {
                return Ok(());
            }
            thread::sleep(std::time::Duration::from_millis(1));
        }
        bus.settle();
        Ok(())
    }

    /// Ends the recording nodes: the data node writes what it has.
    pub(super) fn end_recording(&self) -> Result<()> {
        for running in &self.recording {
            running.node.shutdown();
        }
        while self.recording.iter().any(|running| !running.thread.is_finished()) {
            thread::sleep(std::time::Duration::from_millis(1));
        }
        Ok(())
    }

    /// Ends all; the first failure of a node is the answer.
    pub(super) fn end(self) -> Result<()> {
        self.discovery.node.shutdown();
        for running in self.recording.into_iter().chain([self.discovery]) {
            let name = running.node.node_name();
            running.thread.join().map_err(|_| Error::Middleware(format!("node {name} died; please report it")))??;
        }
        Ok(())
    }
}

impl Running {
    fn start(
        bus: &Loopback,
        name: &str,
        body: impl FnOnce(&LoopbackNode) -> Result<()> + Send + 'static,
    ) -> Self {
        let node = bus.node(name);
        let its_own = node.clone();
        Self { node, thread: thread::spawn(move || body(&its_own)) }
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
