//! The nodes on one bus: those that record run as tasks of whoever drives the bus, and the one that analyses as a
//! thread.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{Receiver, channel},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use roscausal_core::{
    Error, Result,
    loopback::{Loopback, LoopbackNode, LoopbackTask},
    middleware::Middleware,
    nodes::{self, Recorded},
    params::Value,
};
use roscausal_discovery::Progress;
use roscausal_hrisim::Simulation;

use crate::{discover::Analysis, folders::Folders, interrupt::Interrupt};

/// The nodes that record, in the order in which they take part.
pub(crate) const RECORDING: [&str; 3] = ["robot", "human", "data"];

/// Time between two checks whether a node is up.
const LOOK_AGAIN: Duration = Duration::from_millis(1);

/// The running nodes: those that record, and perhaps the one that analyses alongside.
pub(crate) struct Nodes {
    bus: Loopback,
    recording: Vec<(&'static str, LoopbackTask<Result<()>>)>,
    /// Batches that the data node has recorded.
    batches: Arc<AtomicU64>,
    discovery: Option<Threaded>,
    /// Beside the bus, for whoever watches.
    reasoning: Option<Threaded>,
}

/// What a node returned, however it ended; `what` it is.
fn ended(what: &str, node: thread::Result<Result<()>>) -> Result<()> {
    node.unwrap_or_else(|_| Err(Error::Middleware(format!("{what} died; please report it"))))
}

/// A node on a thread of its own.
pub(crate) struct Threaded {
    node: LoopbackNode,
    thread: JoinHandle<Result<()>>,
}

impl Threaded {
    /// Starts the node.
    pub(crate) fn start(
        bus: &Loopback,
        name: &str,
        run: impl FnOnce(&LoopbackNode) -> Result<()> + Send + 'static,
    ) -> Self {
        let node = bus.node(name);
        let its_own = node.clone();
        Self { node, thread: thread::spawn(move || run(&its_own)) }
    }

    /// Waits until the node has this topic.
    fn with_topic(self, wanted: &str) -> Self {
        let is_wanted = |topic: &str| topic.trim_start_matches('/') == wanted.trim_start_matches('/');
        while !self.is_finished() && !self.node.topics().iter().any(|(topic, _)| is_wanted(topic)) {
            thread::sleep(LOOK_AGAIN);
        }
        self
    }

    /// Whether the node has ended.
    pub(crate) fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Ends the node and waits for it. Returns its failure, which says `what` it was.
    pub(crate) fn end(self, what: &str) -> Result<()> {
        self.node.shutdown();
        ended(what, self.thread.join())
    }
}

impl Nodes {
    /// Starts the nodes `names` of [`RECORDING`].
    pub(crate) fn start(bus: &Loopback, names: &[&'static str]) -> Self {
        let batches = Arc::new(AtomicU64::new(0));
        let run = |name: &'static str| {
            let batches = batches.clone();
            bus.start_task(name, async move |mw| match name {
                "data" => {
                    let count = |recorded: Recorded| batches.store(recorded.batches, Ordering::Relaxed);
                    nodes::data_task(&mw, count).await
                }
                _ => nodes::run_task(name, &mw).await,
            })
        };
        let recording = names.iter().map(|&name| (name, run(name))).collect();
        Self { bus: bus.clone(), recording, batches, discovery: None, reasoning: None }
    }

    /// Batches that the data node has recorded of what it has heard; they are on disk a little later.
    pub(crate) fn batches_recorded(&self) -> u64 {
        self.batches.load(Ordering::Relaxed)
    }

    /// Also starts the discovery node. The receiver gets the progress of each analysis.
    pub(crate) fn with_discovery(mut self) -> (Self, Receiver<Progress>) {
        let (sender, progress) = channel();
        // Nobody listens any more once the command ends.
        let tell = move |progress| sender.send(progress).unwrap_or_default();
        let node = Threaded::start(&self.bus, "discovery", move |mw| nodes::discovery_with(mw, tell));
        // Its last topic: whoever looks for topics from now on finds all of them.
        self.discovery = Some(node.with_topic("/roscausal/tsdag/compressed"));
        (self, progress)
    }

    /// If somebody watches, also starts the reasoning node, on one thread and beside the bus, which does not wait for it.
    pub(crate) fn with_reasoning(mut self, watched: bool) -> Self {
        if watched {
            self.bus.set_node_param("reasoning", "threads", Value::Int(1));
            let node = Threaded::start(&self.bus, "reasoning", nodes::reasoning_beside);
            self.reasoning = Some(node.with_topic(nodes::STRUCTURAL_MODEL_TOPIC));
        }
        self
    }

    /// Whether a node has ended too early.
    pub(crate) fn one_has_ended(&self) -> bool {
        self.recording.iter().any(|(_, node)| node.is_finished())
            || [&self.discovery, &self.reasoning].into_iter().flatten().any(Threaded::is_finished)
    }

    /// Ends the nodes that record, each after the previous one has left. The data node writes what it has.
    pub(crate) fn end_recording(&mut self) -> Result<()> {
        let mut recording = std::mem::take(&mut self.recording).into_iter();
        recording.try_for_each(|(name, node)| ended(&format!("the node {name}"), node.end()))
    }

    /// Ends all nodes, first those that record, since an analysis may be within a long test; `kept` closes what they recorded.
    pub(crate) fn end_early(
        mut self,
        kept: impl FnOnce() -> Result<()>,
        interrupt: &Interrupt,
    ) -> Result<()> {
        self.end_recording()?;
        self.bus.settle();
        kept()?;
        interrupt.nothing_at_stake("what is recorded is kept");
        self.end()
    }

    /// Ends all nodes and waits for them. Returns the first failure of a node.
    pub(crate) fn end(mut self) -> Result<()> {
        [&self.discovery, &self.reasoning].into_iter().flatten().for_each(|beside| beside.node.shutdown());
        let end = |beside: Option<Threaded>, what| beside.map_or(Ok(()), |node| node.end(what));
        let recorded = self.end_recording();
        let analysed = end(self.discovery.take(), "the node discovery");
        let reasoned = end(self.reasoning.take(), "the node reasoning");
        recorded.and(analysed).and(reasoned)
    }
}

/// Tells the nodes whom to record: the first robot and the first person of a simulation.
pub(crate) fn set_subjects(bus: &Loopback, simulation: &Simulation) {
    RECORDING.iter().for_each(|node| bus.set_node_param(node, "robot", text(first_robot(simulation))));
    for node in ["human", "data"] {
        bus.set_node_param(node, "sel_agent", text(&first_person(simulation).to_string()));
    }
}

/// Name of the first robot, which is the namespace of its topics; empty: none.
pub(crate) fn first_robot(simulation: &Simulation) -> &str {
    simulation.robots.first().map_or("", |robot| &robot.name)
}

/// Number of the first person; where only pedestrians walk, of the first of them.
pub(crate) fn first_person(simulation: &Simulation) -> u32 {
    simulation.people.first().map_or(1, |person| person.id)
}

/// Sets the folders of the data node.
pub(crate) fn set_pools(bus: &Loopback, raw: &Path, processed: &Path) {
    bus.set_node_param("data", "data_dir", text(&raw.display().to_string()));
    bus.set_node_param("data", "pp_data_dir", text(&processed.display().to_string()));
}

/// Configures the discovery node to analyse the batches in `folders`, with the given number of batches per model.
///
/// # Errors
/// A setting that the node does not allow.
pub(crate) fn set_discovery(
    bus: &Loopback,
    folders: &Folders,
    analysis: &Analysis,
    batches: u32,
) -> Result<()> {
    let of_run = [
        ("data_dir", folders.processed.display().to_string()),
        ("res_dir", folders.models.display().to_string()),
        ("batches_per_model", batches.to_string()),
        ("keep_batches", "true".to_owned()),
    ];
    let specs = nodes::parameters("discovery")?;
    for (name, value) in of_run.into_iter().chain(analysis.params()) {
        let Some(spec) = specs.iter().find(|spec| spec.name == name) else { continue };
        bus.set_node_param("discovery", name, spec.checked(text(&value))?);
    }
    Ok(())
}

/// Largest seed that a node takes.
const LARGEST_SEED: u64 = 9_000_000_000_000_000;

/// Refuses a seed that the nodes do not take.
///
/// # Errors
/// It is too large.
pub(crate) fn check_seed(seed: u64) -> Result<()> {
    Error::ensure(seed <= LARGEST_SEED, "seed", || {
        format!("{seed} is more than the nodes take; give a number from 0 to {LARGEST_SEED}")
    })
}

/// Nodes whose parameters decide what a run gives.
const DECIDING: [&str; 3] = ["human", "data", "discovery"];
/// Parameters of the data that follow from the topics, which whoever reads a recording finds anew.
const FOUND_ANEW: [&str; 2] = ["robot", "people_type"];

/// The parameters that a recording of this run carries, `NODE.PARAMETER` to value: those that were set and that data may decide. Of the analysis, those that are not the default.
pub(crate) fn carried(bus: &Loopback) -> Result<BTreeMap<String, String>> {
    let mut carried = BTreeMap::new();
    for node in DECIDING {
        let place = bus.node(node);
        for spec in nodes::parameters(node)? {
            let (name, topic) = (spec.name, spec.name.ends_with("_topic") || spec.name.ends_with("_param"));
            if topic || name.starts_with('/') || !spec.of_data || FOUND_ANEW.contains(&name) {
                continue;
            }
            let Some(value) = place.param(&spec)? else { continue };
            if node != "discovery" || spec.checked(value.clone())? != spec.default {
                carried.insert(format!("{node}.{name}"), value.to_string());
            }
        }
    }
    Ok(carried)
}

fn text(text: &str) -> Value {
    Value::Str(text.to_owned())
}

#[cfg(test)]
mod tests {
    use roscausal_core::params::Allowed;

    use super::*;

    #[test]
    fn a_seed_is_refused_where_the_nodes_would_refuse_it() {
        for node in ["data", "discovery"] {
            let specs = nodes::parameters(node).expect("a node");
            let seed = specs.iter().find(|spec| spec.name == "seed").expect("a seed");
            assert_eq!(seed.allowed, Allowed::Range(0.0, LARGEST_SEED as f64), "{node}");
        }
        assert!(check_seed(LARGEST_SEED).is_ok());
        for seed in [LARGEST_SEED + 1, 1 << 63, u64::MAX] {
            let error = check_seed(seed).expect_err("too large").to_string();
            assert!(error.contains(&format!("{seed} is more than the nodes take")), "{error}");
        }
    }
}
