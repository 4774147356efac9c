//! `--record FILE.mcap`: also writes what is published into a file.

use std::path::{Path, PathBuf};

use roscausal_core::{
    Result,
    loopback::{Loopback, LoopbackNode},
};
use roscausal_recording::{McapWriter, Recorder};

use crate::nodes;

/// A recorder, if one is wanted.
pub(crate) struct Sink(Option<(PathBuf, Recorder<LoopbackNode>)>);

impl Sink {
    /// Opens the file, if there is one, and writes the settings of the run into it.
    pub(crate) fn open(bus: &Loopback, path: Option<&Path>) -> Result<Self> {
        let Some(path) = path else { return Ok(Self(None)) };
        let mut writer = McapWriter::create(path)?;
        writer.write_settings(&nodes::carried(bus)?)?;
        let recorder = Recorder::new(&bus.node("recorder"), writer);
        Ok(Self(Some((path.to_owned(), recorder))))
    }

    /// Listens to all topics that exist now.
    pub(crate) fn watch(&mut self) -> Result<()> {
        self.0.as_mut().map_or(Ok(()), |(_, recorder)| recorder.watch())
    }

    /// Completes the file and reports it.
    pub(crate) fn close(self) -> Result<()> {
        if let Some((path, recorder)) = self.0 {
            let messages = recorder.finish()?;
            crate::terminal::say!("{}: {messages} messages recorded", path.display());
        }
        Ok(())
    }
}
