//! Reading recordings: topics are found and played to the nodes on a bus of their own, which makes batches.

mod choose;
pub(crate) mod clocks;
mod coverage;
mod inputs;
mod order;
mod persons;
mod play;
mod robots;
mod roles;
mod seen;
pub(crate) mod stamps;

use std::path::{Path, PathBuf};

use roscausal_core::{
    Error, Result,
    batch::{joint::Facts, pool::Pool},
    content,
    loopback::Loopback,
    memory::Memory,
    params::Value,
};
use roscausal_recording::{Recording, folders_in, is_named_so, recordings_in};

use crate::{chart, folders::batches_in, interrupt::Interrupt, nodes, nodes::Nodes};
pub(crate) use inputs::{FLAGS, InputArgs, Inputs, parse as parameter};
pub(crate) use play::{Play, Played};
pub(crate) use seen::Seen;

/// Whether a path is a recording, judged by its contents, or meant to be one by its name; a folder, if it holds one.
pub(crate) fn is_recording(path: &Path) -> bool {
    use std::io::Read;
    // A pipe can be read once only, and that is for its table.
    if path.metadata().is_ok_and(|what| !what.is_file() && !what.is_dir()) {
        return false;
    }
    if path.is_dir() {
        return !recordings_in(path).is_empty()
            || (!folders_in(path).is_empty() && batches_in(path).is_err());
    }
    let mut start = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(16).read_to_end(&mut start));
    is_named_so(path) || (read.is_ok() && content::is_recording(&start))
}

/// How many runs there are, as the beginning of a sentence.
pub(crate) fn runs(laps: u32) -> String {
    format!("the time of recording goes back, or files share it, so it holds {laps} runs")
}

/// Whether one of the batches holds the same rows, as where a recording was played in a loop.
fn is_repeated(batch: &Path, batches: &[PathBuf]) -> Result<bool> {
    let read = |path: &Path| std::fs::read(path).map_err(|error| Error::file(path, error));
    let rows = read(batch)?;
    for earlier in batches {
        let is_as_long = earlier.metadata().is_ok_and(|file| file.len() == rows.len() as u64);
        if is_as_long && read(earlier)? == rows {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Renames a batch and what is known of it: runs may begin at equal times.
fn of_run(batch: &Path, run: u32) -> Result<PathBuf> {
    let stem = batch.file_stem().unwrap_or_default().to_string_lossy();
    let renamed = |ending: &str| batch.with_file_name(format!("{stem}_run{run}.{ending}"));
    for ending in ["csv", "json"] {
        let from = batch.with_extension(ending);
        std::fs::rename(&from, renamed(ending)).map_err(|error| Error::file(&from, error))?;
    }
    Ok(renamed("csv"))
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
        inputs.chosen.iter().for_each(|line| tell!("{}: {line}", path.display()));
        inputs.clocks.notes.iter().for_each(|note| tell!("note: {note}"));
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
        let laps = self.recording.laps();
        if laps > 1 {
            tell!(
                "note: {}: {}; each is a recording of its own (of files of one run, name one: what both hold counts twice)",
                self.path.display(),
                runs(laps)
            );
        }
        self.recording = self.recording.by_lap();
        let (mut batches, mut numbers, mut trouble) = (Vec::new(), Vec::new(), String::new());
        for lap in 1.. {
            let folder = if laps > 1 { folder.join(format!("run_{lap}")) } else { folder.to_path_buf() };
            let (found, played, seen) = self.play_lap(&folder, interrupt, quiet, &mut numbers)?;
            for batch in found {
                if lap > 1 && is_repeated(&batch, &batches)? {
                    let file = self.path.display();
                    tell!("note: {file}: run {lap} holds the rows of an earlier one and is left out");
                } else {
                    batches.push(if lap == 1 { batch } else { of_run(&batch, lap)? });
                }
            }
            if !self.recording.next_lap() {
                played.tell(&self.path);
                trouble = played.troubles(seen);
                break;
            }
        }
        if self.inputs.is_cut() && batches.iter().any(|batch| Facts::read(batch).complete) {
            batches.retain(|batch| Facts::read(batch).complete);
        }
        if batches.is_empty() {
            let what = match self.inputs.nodes {
                ["data"] => "nothing in it could be recorded",
                _ => "robot and people are never there together",
            };
            return Err(Error::file(&self.path, format!("{what}: {trouble}")));
        }
        Ok(batches)
    }

    /// Plays one run of the recording. `numbers`: how many messages of each topic were read.
    fn play_lap(
        &mut self,
        folder: &Path,
        interrupt: &Interrupt,
        quiet: bool,
        numbers: &mut Vec<u64>,
    ) -> Result<(Vec<PathBuf>, Played, String)> {
        let (raw, processed) = (folder.join("data_pool"), folder.join("pp_pool"));
        let bus = Loopback::lockstep();
        nodes::set_pools(&bus, &raw, &processed);
        // The whole recording is one batch, unless the recording or a flag says otherwise.
        bus.set_node_param("data", "ts_length", Value::Double(0.0));
        self.set_params(&bus);
        let play = Play::new(&bus, &mut self.recording, &self.inputs)?.in_order_of_stamps()?;
        let seen = Seen::on(&bus)?;
        let nodes = Nodes::start(&bus, self.inputs.nodes);
        let bar = chart::bar("reading", 1000, quiet);
        let played = play.run(numbers, |progress, _| {
            bar.set_position((progress * 1000.0) as u64);
            !interrupt.is_set()
        });
        nodes.end()?;
        bar.finish_and_clear();
        let played = played?;
        interrupt.check()?;
        // Without post-processing the raw batches are the result.
        let folder = if self.inputs.is_raw() { raw } else { processed };
        let pool = Pool::open(&folder, "data_")?;
        let batches: Vec<PathBuf> = pool.contents()?.batches.iter().map(|name| folder.join(name)).collect();
        if let (false, Some(remark)) = (batches.is_empty(), seen.remark()) {
            tell!("note: {}: {remark}", self.path.display());
        }
        Ok((batches, played, seen.to_string()))
    }

    /// Sets the parameters that follow from the chosen topics, and those of the user.
    pub(crate) fn set_params(&self, bus: &Loopback) {
        for (node, name, value) in &self.inputs.params {
            bus.set_node_param(node, name, value.clone());
        }
    }
}
