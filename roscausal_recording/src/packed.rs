//! What rosbag2 compressed: whole files (`run_0.mcap.zstd`, `run_0.db3.zstd`), or each message by itself.

use std::{
    fs::File,
    io::{self, BufReader, Read, Write},
    path::{Path, PathBuf},
};

use roscausal_core::{
    Error, Result, Time, ensure,
    memory::{GROWTH, Growth, most_grown},
};
use tempfile::NamedTempFile;

use crate::{
    source::{Moment, Source},
    topic::{Record, Topic},
};

/// First bytes of data that Zstandard compressed.
pub(crate) const MAGIC: &[u8] = b"\x28\xb5\x2f\xfd";
/// Endings of the names of compressed files.
pub(crate) const ENDINGS: [&str; 2] = ["zstd", "zst"];

/// A compressed file, unpacked into a temporary one.
pub(crate) struct Unpacked {
    source: Box<dyn Source>,
    names: Names,
    _file: NamedTempFile,
}

/// The file that the user named, and the one that is read.
struct Names {
    users: String,
    temporary: String,
}

impl Names {
    /// A sentence that names the user's file.
    fn reported(&self, sentence: &str) -> String {
        sentence.replace(&self.temporary, &self.users)
    }
}

impl Unpacked {
    /// Unpacks a file and opens what was in it with `open`.
    pub(crate) fn open(
        path: &Path,
        losses: &mut Vec<String>,
        open: impl FnOnce(&Path, &mut Vec<String>) -> Result<Box<dyn Source>>,
    ) -> Result<Self> {
        let fail = |error: io::Error| Error::file(path, format!("it cannot be unpacked: {error}"));
        let packed = File::open(path).map_err(fail)?;
        let length = packed.metadata().map_err(fail)?.len();
        let mut file = NamedTempFile::new().map_err(fail)?;
        let cut = unpack(BufReader::new(packed), most_grown(length), &mut file).map_err(fail)?;
        let names = Names { users: path.display().to_string(), temporary: file.path().display().to_string() };
        if let Some(reason) = cut {
            losses.push(format!(
                "{}: the compressed file is damaged; it was unpacked up to there ({reason})",
                names.users
            ));
        }
        let first = losses.len();
        let mut magic = [0; MAGIC.len()];
        let read = File::open(file.path()).and_then(|mut file| file.read_exact(&mut magic));
        let is_packed = read.is_ok() && magic == MAGIC;
        ensure(!is_packed, || Error::file(path, "it is compressed twice; unpack it with 'unzstd'"))?;
        let source = open(file.path(), losses).map_err(|error| match error {
            Error::File { reason, .. } => Error::file(path, names.reported(&reason)),
            other => other,
        })?;
        losses[first..].iter_mut().for_each(|loss| *loss = names.reported(loss));
        Ok(Self { source, names, _file: file })
    }
}

/// Unpacks at most `left` bytes. Returns why it ended early, if it did.
///
/// # Errors
/// The target cannot be written.
fn unpack(packed: impl io::BufRead, mut left: u64, to: &mut impl Write) -> io::Result<Option<String>> {
    let mut decoder = zstd::stream::read::Decoder::with_buffer(packed)?;
    let mut piece = vec![0; 1 << 16];
    loop {
        match decoder.read(&mut piece) {
            Ok(0) => return Ok(None),
            Err(error) => return Ok(Some(error.to_string())),
            Ok(count) => {
                left = match left.checked_sub(count as u64) {
                    Some(left) => left,
                    None => return Ok(Some(format!("it grows by more than {GROWTH}"))),
                };
                to.write_all(&piece[..count])?;
            }
        }
    }
}

/// The bytes of a message that was compressed by itself.
///
/// # Errors
/// Why it cannot be unpacked.
pub(crate) fn message(packed: &[u8], growth: &mut Growth) -> std::result::Result<Vec<u8>, String> {
    let (mut bytes, length) = (Vec::new(), packed.len() as u64);
    let cut = unpack(packed, growth.most(length), &mut bytes).map_err(|error| error.to_string())?;
    growth.count(length, bytes.len() as u64);
    cut.map_or(Ok(bytes), Err)
}

/// The name that a compressed file had before; `None`: it has no such name.
pub(crate) fn unpacked_name(path: &Path) -> Option<PathBuf> {
    let is_packed = path.extension().is_some_and(|ending| ENDINGS.iter().any(|known| ending == *known));
    is_packed.then(|| path.with_extension(""))
}

impl Source for Unpacked {
    fn topics(&self) -> &[Topic] {
        self.source.topics()
    }

    fn next_start(&self) -> Option<Moment> {
        self.source.next_start()
    }

    fn laps(&self) -> u32 {
        self.source.laps()
    }

    fn load(&mut self, wanted: &[bool], out: &mut Vec<Record>) -> std::result::Result<(), String> {
        self.source.load(wanted, out).map_err(|loss| self.names.reported(&loss))
    }

    fn counts(&self) -> Vec<Option<u64>> {
        self.source.counts()
    }

    fn span(&self) -> Option<(Time, Time)> {
        self.source.span()
    }

    fn progress(&self) -> f64 {
        self.source.progress()
    }
}
