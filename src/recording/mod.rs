//! Reading recordings: topics are found and played to the nodes on a bus of their own, which makes batches.

mod coverage;
mod inputs;
mod play;
mod roles;

use std::path::{Path, PathBuf};

use roscausal_core::{Error, Result, batch::pool::Pool, loopback::Loopback, params::Value};
use roscausal_recording::Recording;

use crate::{chart, interrupt::Interrupt, nodes, nodes::Nodes};
pub(crate) use inputs::{InputArgs, Inputs};
pub(crate) use play::Play;

/// Names that only recordings have.
const EXTENSIONS: [&str; 3] = ["bag", "mcap", "db3"];

/// Whether a path is a recording, judged by its contents, or meant to be one by its name (a folder always is).
pub(crate) fn is_recording(path: &Path) -> bool {
    use std::io::Read;
    let mut start = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(16).read_to_end(&mut start));
    let magics: [&[u8]; 3] = [b"#ROSBAG V", b"\x89MCAP0", b"SQLite format 3\0"];
    let is_one =
        |path: &Path| path.extension().is_some_and(|name| EXTENSIONS.iter().any(|known| name == *known));
    // rosbag2 compresses whole files: run_0.mcap.zstd.
    let is_packed = path.extension().is_some_and(|name| name == "zstd" || name == "zst");
    let is_named_so = is_one(path) || (is_packed && is_one(&path.with_extension("")));
    path.is_dir() || is_named_so || (read.is_ok() && magics.iter().any(|magic| start.starts_with(magic)))
}

/// A recording, and what is to be played of it.
pub(crate) struct Source {
    pub(crate) path: PathBuf,
    pub(crate) recording: Recording,
    pub(crate) inputs: Inputs,
}

impl Source {
    /// Opens the recording and chooses its topics. Prints the choice on stderr.
    pub(crate) fn open(path: &Path, args: &InputArgs) -> Result<Self> {
        let recording = Recording::open(path)?;
        let inputs = Inputs::choose(&recording, path, args)?;
        for line in &inputs.chosen {
            crate::terminal::tell!("{}: {line}", path.display());
        }
        Ok(Self { path: path.to_owned(), recording, inputs })
    }

    /// Plays the recording to the recording nodes and returns the batches that they made in `folder`: one, or
    /// several if the recording's clock jumps.
    pub(crate) fn batches(
        mut self,
        folder: &Path,
        interrupt: &Interrupt,
        quiet: bool,
    ) -> Result<Vec<PathBuf>> {
        let (raw, processed) = (folder.join("data_pool"), folder.join("pp_pool"));
        let bus = Loopback::lockstep();
        nodes::set_pools(&bus, &raw, &processed);
        // The whole recording is one batch.
        bus.set_node_param("data", "ts_length", Value::Double(0.0));
        self.set_params(&bus);
        let play = Play::new(&bus, &mut self.recording, &self.inputs)?;
        let nodes = Nodes::start(&bus, self.inputs.nodes);
        let bar = chart::bar("reading", 1000, quiet);
        let played = play.run(|progress, _| {
            bar.set_position((progress * 1000.0) as u64);
            !interrupt.is_set()
        });
        nodes.end()?;
        bar.finish_and_clear();
        let played = played?;
        if interrupt.is_set() {
            return Err(Error::Cancelled("by the user".into()));
        }
        played.tell(&self.path);
        let pool = Pool::open(&processed, "data_")?;
        let batches: Vec<PathBuf> =
            pool.contents()?.batches.iter().map(|name| processed.join(name)).collect();
        if batches.is_empty() {
            let reason = format!("robot and people are never there together: {}", played.troubles());
            return Err(Error::file(&self.path, reason));
        }
        Ok(batches)
    }

    /// Sets the parameters that follow from the chosen topics, and those of the user.
    pub(crate) fn set_params(&self, bus: &Loopback) {
        for (node, name, value) in &self.inputs.params {
            bus.set_node_param(node, name, value.clone());
        }
    }
}
