//! `--record FILE.mcap`: also writes what is published into a file.

use std::path::{Path, PathBuf};

use roscausal_core::{
    Error, Result,
    loopback::{Loopback, LoopbackNode},
};
use roscausal_recording::{McapWriter, Recorder};

use crate::{nodes, output};

/// What a recording of ours has near its beginning: the library that wrote it.
const MARK: &str = "\0\0\0roscausal ";

/// A recorder, if one is wanted.
pub(crate) struct Sink(Option<(PathBuf, Recorder<LoopbackNode>)>);

/// Where to record.
#[derive(clap::Args)]
#[command(next_help_heading = "Nodes and page")]
pub(crate) struct SinkArgs {
    /// Record every topic of the run, including models and pictures, into this MCAP file.
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Overwrite the file of --record although roscausal did not record it.
    #[arg(long, requires = "record")]
    force: bool,
}

impl SinkArgs {
    /// Makes sure that it can be written, before any work.
    ///
    /// # Errors
    /// A file of others without --force, or a folder in which nothing can be written.
    pub(crate) fn claim(&self) -> Result<Option<&Path>> {
        let path = self.record.as_deref();
        path.map_or(Ok(()), |path| output::claim_file(path, MARK, self.force)).map(|()| path)
    }

    /// The same beside a recording that is read meanwhile, a file or a folder of them.
    ///
    /// # Errors
    /// In addition, what is read itself.
    pub(crate) fn claim_beside(&self, read: &Path) -> Result<Option<&Path>> {
        if let Some(path) = &self.record
            && let (Ok(written), Ok(read)) = (path.canonicalize(), read.canonicalize())
            && written.starts_with(&read)
        {
            return Err(Error::file(path, "this is read at the same time; record into another file"));
        }
        self.claim()
    }
}

impl Sink {
    /// Opens the file, if there is one, and writes the settings of the run into it.
    pub(crate) fn open(bus: &Loopback, path: Option<&Path>) -> Result<Self> {
        let Some(path) = path else { return Ok(Self(None)) };
        let mut writer = McapWriter::create(path)?;
        writer.write_settings(&nodes::carried(bus)?)?;
        Ok(Self(Some((path.to_owned(), Recorder::new(&bus.node("recorder"), writer)))))
    }

    /// Listens to all topics that exist now.
    pub(crate) fn watch(&mut self) -> Result<()> {
        self.0.as_mut().map_or(Ok(()), |(_, recorder)| recorder.watch())
    }

    /// Completes the file and reports it.
    pub(crate) fn close(self) -> Result<()> {
        if let Some((path, recorder)) = self.0 {
            let messages = recorder.finish()?;
            say!("{}: {messages} messages recorded", path.display());
        }
        Ok(())
    }
}
