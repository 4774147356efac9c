//! Reading recordings: topics are found and played to the nodes on a bus of their own, which makes batches.

mod choose;
mod coverage;
mod inputs;
mod persons;
mod play;
mod robots;
mod roles;

use std::path::{Path, PathBuf};

use roscausal_core::{
    Error, Result,
    batch::{joint::Facts, pool::Pool},
    loopback::Loopback,
    memory::Memory,
    params::Value,
};
use roscausal_recording::Recording;

use crate::{chart, interrupt::Interrupt, nodes, nodes::Nodes};
pub(crate) use inputs::{InputArgs, Inputs, parse as parameter};
pub(crate) use play::Play;

/// Names that only recordings have.
const EXTENSIONS: [&str; 3] = ["bag", "mcap", "db3"];

/// Whether a path is a recording, judged by its contents, or meant to be one by its name; a folder, if it holds one.
pub(crate) fn is_recording(path: &Path) -> bool {
    use std::io::Read;
    // A pipe can be read once only, and that is for its table.
    if path.metadata().is_ok_and(|what| !what.is_file() && !what.is_dir()) {
        return false;
    }
    let mut start = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(16).read_to_end(&mut start));
    let magics: [&[u8]; 3] = [b"#ROSBAG V", b"\x89MCAP0", b"SQLite format 3\0"];
    if path.is_dir() {
        return holds_recordings(path);
    }
    is_named_so(path) || (read.is_ok() && magics.iter().any(|magic| start.starts_with(magic)))
}

/// Whether a file has the name of a recording; rosbag2 compresses whole files: run_0.mcap.zstd.
fn is_named_so(path: &Path) -> bool {
    let is_one =
        |path: &Path| path.extension().is_some_and(|name| EXTENSIONS.iter().any(|known| name == *known));
    let is_packed = path.extension().is_some_and(|name| name == "zstd" || name == "zst");
    is_one(path) || (is_packed && is_one(&path.with_extension("")))
}

/// Whether a folder has files with the names of recordings.
fn holds_recordings(folder: &Path) -> bool {
    folder
        .read_dir()
        .into_iter()
        .flatten()
        .flatten()
        .any(|entry| is_named_so(&entry.path()) && entry.path().is_file())
}

/// A recording, and what is to be played of it.
pub(crate) struct Source {
    pub(crate) path: PathBuf,
    pub(crate) recording: Recording,
    pub(crate) inputs: Inputs,
}

impl Source {
    /// Opens the recording and chooses its topics. Prints the choice on stderr. Reading may take `max_memory` bytes.
    pub(crate) fn open(path: &Path, args: &InputArgs, max_memory: Option<u64>) -> Result<Self> {
        let recording = Recording::open(path)?.within(Memory::of(max_memory));
        let inputs = Inputs::choose(&recording, path, args)?;
        for line in &inputs.chosen {
            crate::terminal::tell!("{}: {line}", path.display());
        }
        Ok(Self { path: path.to_owned(), recording, inputs })
    }

    /// Plays the recording to the recording nodes and returns the batches that they made in `folder`: one, or
    /// several if the recording's clock jumps or it is cut into batches. Of those, only the full ones count if there are any.
    pub(crate) fn batches(
        mut self,
        folder: &Path,
        interrupt: &Interrupt,
        quiet: bool,
    ) -> Result<Vec<PathBuf>> {
        let (raw, processed) = (folder.join("data_pool"), folder.join("pp_pool"));
        let bus = Loopback::lockstep();
        nodes::set_pools(&bus, &raw, &processed);
        // The whole recording is one batch, unless the recording or a flag says otherwise.
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
        let mut batches: Vec<PathBuf> =
            pool.contents()?.batches.iter().map(|name| processed.join(name)).collect();
        if self.inputs.sets("data", "ts_length") && batches.iter().any(|batch| Facts::read(batch).complete) {
            batches.retain(|batch| Facts::read(batch).complete);
        }
        if batches.is_empty() {
            let what = match self.inputs.nodes {
                ["data"] => "nothing in it could be recorded",
                _ => "robot and people are never there together",
            };
            let reason = format!("{what}: {}", played.troubles());
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
