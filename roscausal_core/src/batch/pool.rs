//! A folder of batch files, each complete or absent. The node that writes and the nodes that analyse share it.
//!
//! - `PREFIX<id>.csv` is a complete batch. `PREFIX<id>.json` may lie beside it; it is written first.
//! - `.NAME.tmp` and `.NAME.*.tmp` are being written. `.NAME.lock` belongs to the node that analyses NAME, and counts the attempts.
//! - `.PREFIX<number>.journal` holds what is recorded but in no batch yet. While NAME becomes a file, the journal
//!   is renamed to `.NAME.commit` and `.NAME.done` (see `writer`). The node that records holds a lock on the
//!   folder.
//! - `.finished-<name>` lists batches that were analysed and are about to be removed together.
//! - `rejected/` holds batches that cannot be analysed, each with `NAME.reason.txt`.

use std::{
    collections::BTreeSet,
    fs::{self, File, TryLockError},
    io::{Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use super::IdFormat;
use crate::{Error, Result, Time};

/// A folder of batches whose names start with a prefix.
#[derive(Clone, Debug)]
pub struct Pool {
    dir: PathBuf,
    prefix: String,
    ids: IdFormat,
}

/// The current contents of a pool.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    /// File names of the complete batches, oldest first, by the times in their ids. Batches whose ids hold no time come
    /// before them, in the order of their names.
    pub batches: Vec<String>,
    /// Other files; they are never touched.
    pub foreign: BTreeSet<String>,
}

/// How much a pool may hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    /// Batches; 0: any number.
    pub max_batches: usize,
    /// Bytes of batches and their metadata; 0: any number.
    pub max_bytes: u64,
    /// What happens if there is no room for a new batch: the oldest one is deleted, or the new one waits.
    pub drop_oldest: bool,
}

/// A file that is complete on disk but does not have its name yet.
#[derive(Debug)]
#[must_use = "publish it, or it is not there"]
pub(super) struct Staged {
    temporary: PathBuf,
    path: PathBuf,
}

/// A batch that this process analyses. Dropping the claim releases the batch.
#[derive(Debug)]
pub struct Claim {
    lock: File,
    lock_path: PathBuf,
    name: String,
    attempt: u32,
}

impl Pool {
    /// Opens the folder, and creates it if necessary.
    ///
    /// # Errors
    /// A folder that cannot be created, or a prefix that is not allowed in a file name.
    pub fn open(dir: impl Into<PathBuf>, prefix: &str) -> Result<Self> {
        let dir = dir.into();
        Error::ensure(!prefix.contains(['/', '\\']) && !prefix.starts_with('.'), "csv_prefix", || {
            format!("'{prefix}' cannot begin a file name; leave out '/' and a leading '.'")
        })?;
        fs::create_dir_all(&dir).map_err(|e| Error::file(&dir, e))?;
        Ok(Self { dir, prefix: prefix.to_owned(), ids: IdFormat::default() })
    }

    /// The same pool, whose batches have ids of another format.
    #[must_use]
    pub fn with_id_format(mut self, ids: IdFormat) -> Self {
        self.ids = ids;
        self
    }

    /// The folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Path of a file of the pool.
    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.join(name)
    }

    /// The id of a batch that begins at `start`.
    pub fn id(&self, start: Time) -> String {
        self.ids.id(start)
    }

    /// The name of a new batch: prefix, id, and a counter if the name is taken.
    pub fn new_name(&self, id: &str) -> String {
        let id: String = id.chars().map(|c| if matches!(c, '/' | '\\' | '\0') { '-' } else { c }).collect();
        let name = |suffix: &str| format!("{}{id}{suffix}.csv", self.prefix);
        let free = |name: &String| !self.path(name).exists();
        std::iter::once(name("")).chain((2..).map(|n| name(&format!("_{n}")))).find(free).unwrap_or_default()
    }

    /// Writes a file so that it is complete or absent at any moment: temporary name, fsync, rename, fsync of the
    /// folder.
    ///
    /// # Errors
    /// The error of the file system, with the path.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf> {
        let path = self.path(name);
        write_whole(&path, bytes)?;
        Ok(path)
    }

    /// The current contents of the folder.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn contents(&self) -> Result<Contents> {
        let mut contents = Contents::default();
        for entry in fs::read_dir(&self.dir).map_err(|e| Error::file(&self.dir, e))? {
            let entry = entry.map_err(|e| Error::file(&self.dir, e))?;
            let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
            let Ok(name) = entry.file_name().into_string() else { continue };
            if !is_file || name.starts_with('.') {
                continue;
            }
            let ours = name.starts_with(&self.prefix);
            if ours && name.ends_with(".csv") {
                contents.batches.push(name);
            } else if !(ours && name.ends_with(".json")) {
                contents.foreign.insert(name);
            }
        }
        let start = |name: &String| name.strip_prefix(&self.prefix).and_then(|id| self.ids.start(id));
        contents.batches.sort_by_cached_key(|name| (start(name), name.clone()));
        Ok(contents)
    }

    /// Writes a file that gets its name only through [`Staged::publish`]. The temporary name is fixed, because recovery looks for it. A
    /// file or link that lies there is removed first.
    pub(super) fn stage(&self, name: &str, bytes: &[u8]) -> Result<Staged> {
        let (temporary, path) = (self.path(&format!(".{name}.tmp")), self.path(name));
        let write = || -> std::io::Result<()> {
            fs::create_dir_all(&self.dir)?;
            fs::remove_file(&temporary).or_else(ignore_missing)?;
            let mut file = File::create_new(&temporary)?;
            file.write_all(bytes)?;
            file.sync_all()
        };
        write().map_err(|e| {
            let _ = fs::remove_file(&temporary);
            Error::file(&path, e)
        })?;
        Ok(Staged { temporary, path })
    }

    /// The staged file of a name, if a process that is gone left one.
    pub(super) fn staged(&self, name: &str) -> Option<Staged> {
        let (temporary, path) = (self.path(&format!(".{name}.tmp")), self.path(name));
        temporary.exists().then_some(Staged { temporary, path })
    }

    /// File name of a journal.
    pub(super) fn journal_name(&self, number: u64) -> String {
        format!(".{}{number:09}.journal", self.prefix)
    }

    /// Names of the hidden files of this pool's batches that end with `suffix`, sorted, without dot and suffix.
    pub(super) fn hidden(&self, suffix: &str) -> Result<Vec<String>> {
        let mut names = Vec::new();
        for entry in fs::read_dir(&self.dir).map_err(|e| Error::file(&self.dir, e))? {
            let entry = entry.map_err(|e| Error::file(&self.dir, e))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            let ours = name.strip_prefix('.').filter(|name| name.starts_with(&self.prefix));
            names.extend(ours.and_then(|name| name.strip_suffix(suffix)).map(str::to_owned));
        }
        names.sort();
        Ok(names)
    }

    /// Makes this process the only one that records into this folder, for as long as the returned file lives.
    pub(super) fn lock_for_recording(&self) -> Result<File> {
        let lock = File::open(&self.dir).map_err(|e| Error::file(&self.dir, e))?;
        if !try_lock(&lock, &self.dir)? {
            let dir = self.dir.display();
            let reason = format!("another node records into {dir}; give each node its own folder");
            return Err(Error::param("data_dir", reason));
        }
        Ok(lock)
    }

    /// Makes room for a batch of `incoming` bytes. Returns the batches that were dropped; `None` if there is no
    /// room.
    ///
    /// # Errors
    /// The error of the file system.
    pub fn make_room(&self, limits: Limits, incoming: u64) -> Result<Option<Vec<String>>> {
        let mut dropped = Vec::new();
        if limits.max_batches == 0 && limits.max_bytes == 0 {
            return Ok(Some(dropped));
        }
        let names = self.contents()?.batches;
        let size = |name: &str| {
            let of = |name: &str| fs::metadata(self.path(name)).map_or(0, |meta| meta.len());
            of(name) + of(&sidecar(name))
        };
        let (mut count, mut bytes) = (names.len(), names.iter().map(|name| size(name)).sum::<u64>());
        let mut oldest = names.iter();
        // A single batch may exceed the limit: it gets an empty pool.
        while count > 0
            && (limits.max_batches > 0 && count >= limits.max_batches
                || limits.max_bytes > 0 && bytes + incoming > limits.max_bytes)
        {
            let Some(name) = oldest.next().filter(|_| limits.drop_oldest) else { return Ok(None) };
            let of_it = size(name);
            // A batch under analysis stays.
            let Some(claim) = self.claim(name)? else { continue };
            self.remove(claim)?;
            dropped.push(name.clone());
            (count, bytes) = (count - 1, bytes.saturating_sub(of_it));
        }
        Ok(Some(dropped))
    }

    /// Claims a batch for this process and counts the attempt. `None` if another node has claimed it, or it is
    /// gone.
    ///
    /// # Errors
    /// A lock file that cannot be written.
    pub fn claim(&self, name: &str) -> Result<Option<Claim>> {
        let lock_path = self.path(&format!(".{name}.lock"));
        let fault = |e: std::io::Error| Error::file(&lock_path, e);
        let opened = File::options().create(true).truncate(false).read(true).write(true).open(&lock_path);
        let mut lock = opened.map_err(fault)?;
        // Another node has it, or has finished with the batch and removed its lock.
        if !try_lock(&lock, &lock_path)? || !is_still(&lock, &lock_path) {
            return Ok(None);
        }
        if !self.path(name).exists() {
            // Analysed by another node since the folder was listed.
            remove(&lock_path)?;
            return Ok(None);
        }
        let mut text = String::new();
        (&lock).take(16).read_to_string(&mut text).map_err(fault)?;
        let attempt = text.trim().parse::<u32>().unwrap_or(0).saturating_add(1);
        lock.seek(SeekFrom::Start(0)).map_err(fault)?;
        write!(lock, "{attempt:<10}").and_then(|()| lock.sync_all()).map_err(fault)?;
        Ok(Some(Claim { lock, lock_path, name: name.to_owned(), attempt }))
    }

    /// Removes analysed batches, or moves them into `folder`. It is all or nothing: if this process dies meanwhile,
    /// [`Pool::finish_all`] continues.
    ///
    /// # Errors
    /// The error of the file system.
    pub fn finish(&self, claims: Vec<Claim>, folder: Option<&Path>) -> Result<()> {
        let list = match claims.as_slice() {
            [first, _, ..] => {
                let names = claims.iter().map(|claim| claim.name()).collect::<Vec<_>>();
                let path = self.path(&format!(".finished-{}", first.name()));
                write_whole(&path, serde_json::json!(names).to_string().as_bytes())?;
                Some(path)
            }
            _ => None,
        };
        for claim in claims {
            match folder {
                Some(folder) => self.keep(claim, folder)?,
                None => self.remove(claim)?,
            }
        }
        list.map_or(Ok(()), |path| remove(&path))
    }

    /// Completes what a process that is gone began with [`Pool::finish`].
    ///
    /// # Errors
    /// The error of the file system.
    pub fn finish_all(&self, folder: Option<&Path>) -> Result<()> {
        for entry in fs::read_dir(&self.dir).map_err(|e| Error::file(&self.dir, e))?.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if !name.strip_prefix(".finished-").is_some_and(|name| name.starts_with(&self.prefix)) {
                continue;
            }
            let bytes = fs::read(entry.path()).map_err(|e| Error::file(entry.path(), e))?;
            let names: Vec<String> = serde_json::from_slice(&bytes).unwrap_or_default();
            let ours = |name: &&String| name.starts_with(&self.prefix) && !name.contains(['/', '\\']);
            let mut busy = false;
            for name in names.iter().filter(ours) {
                match (self.claim(name)?, folder) {
                    (Some(claim), Some(folder)) => self.keep(claim, folder)?,
                    (Some(claim), None) => self.remove(claim)?,
                    (None, _) => busy |= self.path(name).exists(),
                }
            }
            if !busy {
                remove(&entry.path())?;
            }
        }
        Ok(())
    }

    /// Removes an analysed batch with its metadata and lock.
    ///
    /// # Errors
    /// The error of the file system.
    pub fn remove(&self, claim: Claim) -> Result<()> {
        for path in [self.path(&claim.name), self.path(&sidecar(&claim.name))] {
            remove(&path)?;
        }
        claim.finish()
    }

    /// Moves an analysed batch with its metadata into another folder.
    ///
    /// # Errors
    /// The error of the file system.
    pub fn keep(&self, claim: Claim, folder: &Path) -> Result<()> {
        self.move_to(&claim.name, folder)?;
        claim.finish()
    }

    /// Moves a batch to `rejected/` and writes the reason beside it.
    ///
    /// # Errors
    /// The error of the file system.
    pub fn reject(&self, claim: Claim, reason: &str) -> Result<()> {
        let folder = self.dir.join("rejected");
        fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, e))?;
        write_whole(&folder.join(format!("{}.reason.txt", claim.name)), format!("{reason}\n").as_bytes())?;
        self.move_to(&claim.name, &folder)?;
        claim.finish()
    }

    fn move_to(&self, name: &str, folder: &Path) -> Result<()> {
        fs::create_dir_all(folder).map_err(|e| Error::file(folder, e))?;
        for name in [name.to_owned(), sidecar(name)] {
            let (from, to) = (self.path(&name), folder.join(&name));
            fs::rename(&from, &to).or_else(ignore_missing).map_err(|e| Error::file(&from, e))?;
        }
        Ok(())
    }
}

impl Claim {
    /// File name of the batch.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How often this batch has been claimed, including this time.
    pub fn attempt(&self) -> u32 {
        self.attempt
    }

    /// Releases the batch without counting this attempt.
    ///
    /// # Errors
    /// The error of the file system.
    pub fn abandon(mut self) -> Result<()> {
        let attempt = self.attempt.saturating_sub(1);
        let written = self.lock.seek(SeekFrom::Start(0)).and_then(|_| write!(self.lock, "{attempt:<10}"));
        written.map_err(|e| Error::file(&self.lock_path, e))
    }

    fn finish(self) -> Result<()> {
        remove(&self.lock_path)
    }
}

/// Name of the metadata beside a batch.
pub fn sidecar(name: &str) -> String {
    format!("{}.json", name.strip_suffix(".csv").unwrap_or(name))
}

/// The complete files in a folder whose names end so, sorted by name.
///
/// # Errors
/// A folder that cannot be listed.
pub fn with_ending(folder: &Path, ending: &str) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(|e| Error::file(folder, e))?;
    let named = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // Nor a pipe or a device, which would never end.
        name.ends_with(ending) && !name.starts_with('.') && path.is_file()
    };
    let paths = entries.map(|entry| entry.map(|entry| entry.path()).map_err(|e| Error::file(folder, e)));
    let mut paths = paths.collect::<Result<Vec<_>>>()?;
    paths.retain(named);
    paths.sort();
    Ok(paths)
}

/// Writes a file so that it is complete or absent at any moment, even after a loss of power.
///
/// # Errors
/// The error of the file system, with the path.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let name = path.file_name().ok_or_else(|| Error::file(path, "not the name of a file"))?;
    let (dir, name) = (folder_of(path), name.to_string_lossy());
    let write = || -> std::io::Result<()> {
        fs::create_dir_all(dir)?;
        // The name is this process's own: nobody else writes into the file, and no link that lies there is followed.
        let mut file = tempfile::Builder::new()
            .prefix(&format!(".{name}."))
            .suffix(".tmp")
            .make_in(dir, |path| File::options().write(true).create_new(true).open(path))?;
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        file.persist(path).map(drop).map_err(|error| error.error)
    };
    write().map_err(|e| Error::file(path, without_path(e)))?;
    sync_dir(dir)
}

/// An error of the crate tempfile in words, without the temporary path, which says nothing to the user.
pub fn without_path(error: std::io::Error) -> String {
    let text = error.to_string();
    text.split_once(" at path ").map_or(text.as_str(), |(reason, _)| reason).to_owned()
}

/// Removes a file that may be gone already.
pub(super) fn remove(path: &Path) -> Result<()> {
    fs::remove_file(path).or_else(ignore_missing).map_err(|e| Error::file(path, e))
}

/// Locks a file or folder; false if another process has it.
pub(crate) fn try_lock(file: &File, path: &Path) -> Result<bool> {
    match file.try_lock() {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => Ok(false),
        Err(TryLockError::Error(e)) => Err(Error::file(path, e)),
    }
}

impl Staged {
    /// Gives the file its name in one step.
    pub(super) fn publish(self) -> Result<()> {
        fs::rename(&self.temporary, &self.path).map_err(|e| Error::file(&self.path, e))?;
        sync_dir(folder_of(&self.path))
    }
}

/// Waits until the names in a folder are on disk.
pub(super) fn sync_dir(dir: &Path) -> Result<()> {
    File::open(dir).and_then(|dir| dir.sync_all()).map_err(|e| Error::file(dir, e))
}

/// The folder that a file lies in; the current one for a mere name.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether an open file is still the one with that name, which is not a link.
#[cfg(unix)]
pub fn is_still(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(open), Ok(named)) => (open.dev(), open.ino()) == (named.dev(), named.ino()),
        _ => false,
    }
}

/// Whether an open file is still the one with that name, which is not a link.
#[cfg(not(unix))]
pub fn is_still(_file: &File, path: &Path) -> bool {
    path.exists()
}

fn ignore_missing(error: std::io::Error) -> std::io::Result<()> {
    if error.kind() == std::io::ErrorKind::NotFound { Ok(()) } else { Err(error) }
}

#[cfg(test)]
#[path = "pool_tests.rs"]
mod tests;
