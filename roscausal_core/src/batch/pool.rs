//! A folder of batch files, each whole or absent, shared by the node that writes and the nodes that analyse.
//!
//! - `PREFIX<id>.csv` is a whole batch; beside it may stand `PREFIX<id>.json` (written before it).
//! - `.NAME.tmp` is being written; `.NAME.lock` belongs to the node that analyses NAME and counts the attempts.
//! - `rejected/` holds batches that cannot be analysed, with `NAME.reason.txt`.

use std::{
    collections::BTreeSet,
    fs::{self, File, OpenOptions, TryLockError},
    io::{Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use crate::{Error, Result};

/// A folder of batches whose names start with a prefix.
#[derive(Clone, Debug)]
pub struct Pool {
    dir: PathBuf,
    prefix: String,
}

/// What a pool holds now.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    /// File names of the whole batches, oldest first: ids are times, so the order of the names is that of time.
    pub batches: Vec<String>,
    /// Other files, which nobody touches.
    pub foreign: BTreeSet<String>,
}

/// A batch that is ours to analyse; dropping it gives it back.
#[derive(Debug)]
pub struct Claim {
    lock: File,
    lock_path: PathBuf,
    name: String,
    attempt: u32,
}

impl Pool {
    /// Opens the folder, creating it when it is not there.
    ///
    /// # Errors
    /// A folder that cannot be created, a prefix that is no part of a file name.
    pub fn open(dir: impl Into<PathBuf>, prefix: &str) -> Result<Self> {
        let dir = dir.into();
        if prefix.contains(['/', '\\']) || prefix.starts_with('.') {
            let reason = format!("'{prefix}' is no start of a file name; leave out '/' and a leading '.'");
            return Err(Error::param("csv_prefix", reason));
        }
        fs::create_dir_all(&dir).map_err(|e| Error::file(&dir, e))?;
        Ok(Self { dir, prefix: prefix.to_owned() })
    }

    /// The folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Path of a file of the pool.
    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.join(name)
    }

    /// The name of a new batch: prefix, id, and a counter when that name is taken.
    pub fn new_name(&self, id: &str) -> String {
        let id: String = id.chars().map(|c| if matches!(c, '/' | '\\' | '\0') { '-' } else { c }).collect();
        let name = |suffix: &str| format!("{}{id}{suffix}.csv", self.prefix);
        let free = |name: &String| !self.path(name).exists();
        std::iter::once(name("")).chain((2..).map(|n| name(&format!("_{n}")))).find(free).unwrap_or_default()
    }

    /// Writes a file so that it is whole or absent at any instant: temporary name, fsync, rename, fsync of the folder.
    ///
    /// # Errors
    /// What the file system says, with the path.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf> {
        let path = self.path(name);
        write_whole(&path, bytes)?;
        Ok(path)
    }

    /// What the folder holds now.
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
        contents.batches.sort();
        Ok(contents)
    }

    /// Claims a batch for this process and counts the attempt; `None` when another node has it, or it is gone.
    ///
    /// # Errors
    /// A lock file that cannot be written.
    pub fn claim(&self, name: &str) -> Result<Option<Claim>> {
        let lock_path = self.path(&format!(".{name}.lock"));
        let fault = |e: std::io::Error| Error::file(&lock_path, e);
        let mut lock = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(&lock_path)
            .map_err(fault)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Ok(None),
            Err(TryLockError::Error(e)) => return Err(fault(e)),
        }
        if !self.path(name).exists() {
            // Analysed by another node between the listing and now.
            fs::remove_file(&lock_path).or_else(ignore_missing).map_err(fault)?;
            return Ok(None);
        }
        let mut text = String::new();
        (&lock).take(16).read_to_string(&mut text).map_err(fault)?;
        let attempt = text.trim().parse::<u32>().unwrap_or(0).saturating_add(1);
        lock.seek(SeekFrom::Start(0)).map_err(fault)?;
        write!(lock, "{attempt:<10}").and_then(|()| lock.sync_all()).map_err(fault)?;
        Ok(Some(Claim { lock, lock_path, name: name.to_owned(), attempt }))
    }

    /// Removes an analysed batch with what belongs to it.
    ///
    /// # Errors
    /// What the file system says.
    pub fn remove(&self, claim: Claim) -> Result<()> {
        for path in [self.path(&claim.name), self.path(&sidecar(&claim.name))] {
            fs::remove_file(&path).or_else(ignore_missing).map_err(|e| Error::file(&path, e))?;
        }
        claim.finish()
    }

    /// Moves an analysed batch, with what belongs to it, into another folder.
    ///
    /// # Errors
    /// What the file system says.
    pub fn keep(&self, claim: Claim, folder: &Path) -> Result<()> {
        self.move_to(&claim.name, folder)?;
        claim.finish()
    }

    /// Moves a batch to `rejected/` and writes the reason beside it.
    ///
    /// # Errors
    /// What the file system says.
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

    /// How often this batch has been claimed, this time included.
    pub fn attempt(&self) -> u32 {
        self.attempt
    }

    /// Gives the batch back as if this attempt had not been.
    ///
    /// # Errors
    /// What the file system says.
    pub fn abandon(mut self) -> Result<()> {
        let attempt = self.attempt.saturating_sub(1);
        let written = self.lock.seek(SeekFrom::Start(0)).and_then(|_| write!(self.lock, "{attempt:<10}"));
        written.map_err(|e| Error::file(&self.lock_path, e))
    }

    fn finish(self) -> Result<()> {
        fs::remove_file(&self.lock_path).or_else(ignore_missing).map_err(|e| Error::file(&self.lock_path, e))
    }
}

/// Name of the metadata beside a batch.
pub fn sidecar(name: &str) -> String {
    format!("{}.json", name.strip_suffix(".csv").unwrap_or(name))
}

/// Writes a file so that it is whole or absent at any instant, also after a loss of power.
///
/// # Errors
/// What the file system says, with the path.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let fault = |e: std::io::Error| Error::file(path, e);
    let (Some(dir), Some(name)) = (path.parent(), path.file_name()) else {
        return Err(Error::file(path, "not the name of a file"));
    };
    let dir = if dir.as_os_str().is_empty() { Path::new(".") } else { dir };
    let temporary = dir.join(format!(".{}.tmp", name.to_string_lossy()));
    let write = || -> std::io::Result<()> {
        fs::create_dir_all(dir)?;
        let mut file = File::create(&temporary)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        fs::rename(&temporary, path)?;
        File::open(dir)?.sync_all()
    };
    write().map_err(|e| {
        let _ = fs::remove_file(&temporary);
        fault(e)
    })
}

fn ignore_missing(error: std::io::Error) -> std::io::Result<()> {
    if error.kind() == std::io::ErrorKind::NotFound { Ok(()) } else { Err(error) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pool() -> (tempfile::TempDir, Pool) {
        let dir = tempfile::tempdir().expect("a folder");
        let pool = Pool::open(dir.path().join("pool"), "data_").expect("opens");
        (dir, pool)
    }

    #[test]
    fn batches_come_oldest_first_and_foreign_files_are_told_apart() {
        let (_dir, pool) = pool();
        for name in
            ["data_20240102_000000.csv", "data_20240101_235959.csv", "data_20240101_235959.json", "notes.txt"]
        {
            pool.write(name, b"x").expect("writes");
        }
        fs::write(pool.path(".data_3.csv.tmp"), b"half").expect("writes");
        let contents = pool.contents().expect("lists");
        assert_eq!(contents.batches, ["data_20240101_235959.csv", "data_20240102_000000.csv"]);
        assert_eq!(contents.foreign.into_iter().collect::<Vec<_>>(), ["notes.txt"]);
    }

    #[test]
    fn a_claimed_batch_is_nobody_elses_and_attempts_are_counted() {
        let (_dir, pool) = pool();
        pool.write("data_1.csv", b"x").expect("writes");
        let claim = pool.claim("data_1.csv").expect("claims").expect("is free");
        assert!(pool.claim("data_1.csv").expect("asks").is_none());
        assert_eq!(claim.attempt(), 1);
        drop(claim);
        let again = pool.claim("data_1.csv").expect("claims").expect("is free again");
        assert_eq!(again.attempt(), 2);
        again.abandon().expect("gives back");
        let last = pool.claim("data_1.csv").expect("claims").expect("is free");
        assert_eq!(last.attempt(), 2);
        pool.remove(last).expect("removes");
        assert!(pool.claim("data_1.csv").expect("asks").is_none());
        assert_eq!(fs::read_dir(pool.dir()).expect("lists").count(), 0);
    }

    #[test]
    fn a_rejected_batch_is_kept_with_its_reason() {
        let (_dir, pool) = pool();
        pool.write("data_1.csv", b"x").expect("writes");
        let claim = pool.claim("data_1.csv").expect("claims").expect("is free");
        pool.reject(claim, "line 2 is text").expect("rejects");
        let reason = fs::read_to_string(pool.path("rejected/data_1.csv.reason.txt")).expect("a reason");
        assert_eq!(reason, "line 2 is text\n");
        assert!(pool.path("rejected/data_1.csv").exists() && !pool.path("data_1.csv").exists());
    }

    #[test]
    fn a_name_that_is_taken_gets_a_number_and_stays_in_the_folder() {
        let (_dir, pool) = pool();
        assert_eq!(pool.new_name("../x"), "data_..-x.csv");
        pool.write("data_1.csv", b"x").expect("writes");
        assert_eq!(pool.new_name("1"), "data_1_2.csv");
    }
}
