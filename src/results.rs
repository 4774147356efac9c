//! A folder of results (`--out`): it belongs to one run, whose files take the place of the set before together.
//!
//! In `.roscausal/` within the folder, so that nothing but the folder itself has to be writable:
//! - `lock` is locked by the run that has the folder, and names its process; the kernel releases it when the process ends.
//! - `list.json` names the files of the set. No other file is ever replaced or removed.
//! - `work-*/set/` is where a run works. The next run removes what a killed one left.
//! - `new/set/` is a complete set with its list.
//!
//! A complete set takes its place in one of two ways. Where nothing else is in the folder, and the system can, the two folders
//! change places in one step. Else `work-*` gets the name `new`: from that moment the set counts, and each file moves to its place.
//! If the process is killed meanwhile, whoever has the lock next goes on with it. The list moves last.

use std::{
    collections::BTreeSet,
    fs::{self, File, OpenOptions, TryLockError},
    io::{ErrorKind, Read, Write},
    path::{Component, Path, PathBuf},
    process,
};

use roscausal_core::{
    Error, Result,
    batch::pool::{is_still, without_path},
    bounded, ensure,
};
use serde::{Deserialize, Serialize};
use tempfile::TempDir;

/// Folder of what this file keeps about the results.
const HOME: &str = ".roscausal";
/// Most bytes of a list of results.
const LONGEST_LIST: u64 = 16 << 20;
const LOCK: &str = "lock";
const LIST: &str = "list.json";
const WORK: &str = "work-";
const NEW: &str = "new";
const SET: &str = "set";
/// How often the lock is tried while other runs come and go.
const ATTEMPTS: usize = 10;

/// The folder of a run that holds it. Dropped before [`Results::finish`], the set before stays as it was.
pub(crate) struct Results {
    dir: PathBuf,
    force: bool,
    /// Files of the set before.
    old: BTreeSet<PathBuf>,
    // The order of the fields is that in which they are dropped.
    work: TempDir,
    _lock: Lock,
}

/// The files of a set, relative to the folder.
#[derive(Default, Serialize, Deserialize)]
struct List {
    /// The number that the file system gave the file of this list. One that was unpacked or copied has another: what it says is
    /// not believed, or a stranger's list would have the user's files removed.
    #[serde(default)]
    inode: u64,
    files: BTreeSet<PathBuf>,
    /// Files of the set before that this one does not have.
    #[serde(default)]
    gone: BTreeSet<PathBuf>,
}

impl Results {
    /// Takes a folder for this run, before any work: it is new, empty, or holds the results of an earlier run, or `force` is
    /// given (`None`: the command has no such flag). `reads`: the files and folders that the run reads.
    ///
    /// # Errors
    /// A folder with files of others, one that another run has, one that cannot be written, or one whose results the run reads.
    pub(crate) fn begin(dir: &Path, force: Option<bool>, reads: &[PathBuf]) -> Result<Self> {
        if force != Some(true) && holds_files_of_others(dir).map_err(|e| unwritable(dir, e))? {
            let way = if force.is_some() { ", or write into it with --force" } else { "" };
            let reason = format!("there are files of others in this folder; choose another --out{way}");
            return Err(Error::file(dir, reason));
        }
        let lock = Lock::take(dir)?;
        complete(dir)?;
        let home = dir.join(HOME);
        for left in named(&home, WORK) {
            let _ = fs::remove_dir_all(left);
        }
        if let Some((parent, prefix)) = dir.canonicalize().ok().and_then(|root| beside(&root)) {
            remove_left_beside(&parent, &prefix, &home);
        }
        let old = List::read(&home.join(LIST))?.unwrap_or_default().files;
        let made = || -> std::io::Result<TempDir> {
            let work = tempfile::Builder::new().prefix(WORK).tempdir_in(&home)?;
            fs::create_dir(work.path().join(SET))?;
            Ok(work)
        };
        let work = made().map_err(|e| unwritable(dir, e))?;
        let results = Self { dir: dir.to_owned(), force: force == Some(true), old, work, _lock: lock };
        reads.iter().try_for_each(|path| results.spare(path))?;
        Ok(results)
    }

    /// [`Results::begin`] where there is a `--out`.
    pub(crate) fn wanted(dir: Option<&Path>, force: bool, reads: &[PathBuf]) -> Result<Option<Self>> {
        dir.map(|dir| Self::begin(dir, Some(force), reads)).transpose()
    }

    /// Where the run writes its files.
    pub(crate) fn folder(&self) -> PathBuf {
        self.work.path().join(SET)
    }

    /// What an end of the process at once may remove.
    pub(crate) fn temporary(&self) -> PathBuf {
        self.work.path().to_owned()
    }

    /// Writes files into [`Results::folder`], which makes the whole set, and lets it take its place. Errors name the final place.
    pub(crate) fn write(self, files: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
        let folder = self.folder();
        files(&folder).map_err(|error| renamed(error, &folder, &self.dir))?;
        self.finish()
    }

    /// The files in [`Results::folder`] take the place of the set before.
    ///
    /// # Errors
    /// A file of others with the name of a result, or the file system's. Until the set is complete in the folder, all stays as
    /// it was.
    pub(crate) fn finish(self) -> Result<()> {
        let files = self.check_and_list()?;
        if self.exchange().map_err(|e| Error::file(&self.dir, without_path(e)))? {
            return Ok(());
        }
        self.commit(&files)?;
        complete(&self.dir)
    }

    /// Makes sure that the set takes no place of others, and writes its list.
    fn check_and_list(&self) -> Result<BTreeSet<PathBuf>> {
        let (mut files, set) = (BTreeSet::new(), self.folder());
        collect(&set, Path::new(""), &mut files).map_err(|e| Error::file(&self.dir, e))?;
        self.check(&files)?;
        let mut list = List { inode: 0, gone: self.old.difference(&files).cloned().collect(), files };
        let mut written = || {
            fs::create_dir_all(set.join(HOME))?;
            list.write(&set.join(HOME).join(LIST))
        };
        written().map_err(|e| renamed(Error::file(set.join(HOME), e), &set, &self.dir))?;
        Ok(list.files)
    }

    /// The folder of the set changes places with that of the results. `false`: that cannot be, or would not be the same, and all
    /// is as it was.
    #[cfg(target_os = "linux")]
    fn exchange(&self) -> std::io::Result<bool> {
        use std::os::unix::fs::MetadataExt;

        use rustix::fs::{CWD, RenameFlags, renameat_with};

        let (root, set) = (self.dir.canonicalize()?, self.folder());
        let (old, new) = (root.metadata()?, set.metadata()?);
        let works_in_it = std::env::current_dir().map_or(true, |folder| folder.starts_with(&root));
        let same_owner = (old.uid(), old.gid()) == (new.uid(), new.gid());
        if works_in_it || !same_owner || !self.is_all(&root, Path::new(""))? {
            return Ok(false);
        }
        let Some((parent, prefix)) = beside(&root) else { return Ok(false) };
        let Ok(beside) = tempfile::Builder::new().prefix(&prefix).tempdir_in(&parent) else {
            return Ok(false);
        };
        fs::set_permissions(&set, old.permissions())?;
        if fs::rename(&set, beside.path()).is_err() {
            return Ok(false);
        }
        // What has the temporary name then is removed: the folder of the old set.
        match renameat_with(CWD, beside.path(), CWD, &root, RenameFlags::EXCHANGE) {
            Ok(()) => {
                let _ = remove_beside(beside.path(), &root.join(HOME));
                // It is done, whether or not it can be waited for.
                let _ = File::open(parent).and_then(|parent| parent.sync_all());
                Ok(true)
            }
            Err(_) => fs::rename(beside.path(), &set).map(|()| false),
        }
    }

    #[cfg(not(target_os = "linux"))]
    fn exchange(&self) -> std::io::Result<bool> {
        Ok(false)
    }

    /// Whether all that is in the folder is of the set before.
    #[cfg(target_os = "linux")]
    fn is_all(&self, root: &Path, below: &Path) -> std::io::Result<bool> {
        for entry in fs::read_dir(root.join(below))? {
            let entry = entry?;
            let path = below.join(entry.file_name());
            let is_ours = match entry.file_type()?.is_dir() {
                true if path == Path::new(HOME) => true,
                true => self.old.iter().any(|file| file.starts_with(&path)) && self.is_all(root, &path)?,
                false => self.old.contains(&path),
            };
            if !is_ours {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Makes sure that every folder of the set can be written, as far as can be known. From here on the set counts.
    fn commit(&self, files: &BTreeSet<PathBuf>) -> Result<()> {
        let folders: BTreeSet<&Path> = files.iter().filter_map(|file| file.parent()).collect();
        for folder in folders.into_iter().filter(|folder| *folder != Path::new("")) {
            let folder = self.dir.join(folder);
            fs::create_dir_all(&folder)
                .and_then(|()| tempfile::tempfile_in(&folder))
                .map_err(|e| Error::file(&folder, without_path(e)))?;
        }
        let home = self.dir.join(HOME);
        let commit = || -> std::io::Result<()> {
            fs::rename(self.work.path(), home.join(NEW))?;
            File::open(&home)?.sync_all()
        };
        commit().map_err(|e| Error::file(&self.dir, e))
    }

    /// Refuses to replace a file of others without `force`, and a folder.
    fn check(&self, files: &BTreeSet<PathBuf>) -> Result<()> {
        for file in files {
            let path = self.dir.join(file);
            let reason = "a link or file of others is where a folder of results has to be";
            let place = inside(&self.dir, file).ok_or_else(|| Error::file(&path, reason))?;
            let reason = match fs::symlink_metadata(&place) {
                Ok(found) if found.is_dir() => "a folder of others has the name of a result",
                Ok(_) if !self.force && !self.old.contains(file) => {
                    "a file of others has the name of a result; move it, or choose another --out"
                }
                _ => continue,
            };
            return Err(Error::file(path, reason));
        }
        Ok(())
    }

    /// Refuses to replace what the run reads.
    fn spare(&self, read: &Path) -> Result<()> {
        let (Ok(root), Ok(real)) = (self.dir.canonicalize(), read.canonicalize()) else { return Ok(()) };
        if let Ok(below) = real.strip_prefix(root)
            && self.old.iter().any(|file| file.starts_with(below))
        {
            let reason =
                format!("the results in {} would replace it; choose another --out", self.dir.display());
            return Err(Error::file(read, reason));
        }
        Ok(())
    }
}

/// Refuses to read from a set of which one part is old and one new. It changes nothing: only a run with this folder as `--out`
/// may.
///
/// # Errors
/// A run was killed while its results moved to their places.
pub(crate) fn check_whole(path: &Path) -> Result<()> {
    let is_partial = |folder: &&Path| is_folder(&folder.join(HOME).join(NEW));
    let Some(folder) = path.ancestors().find(is_partial) else { return Ok(()) };
    let reason =
        "a run was ended by force while it replaced these results; start it again with the same --out";
    Err(Error::file(if folder == Path::new("") { Path::new(".") } else { folder }, reason))
}

/// An error about a file in the folder `from`, in words about the folder `to`.
pub(crate) fn renamed(error: Error, from: &Path, to: &Path) -> Error {
    match error {
        Error::File { path, reason } => match path.strip_prefix(from) {
            Ok(below) => Error::File { path: to.join(below), reason },
            Err(_) => Error::File { path, reason },
        },
        other => other,
    }
}

fn unwritable(dir: &Path, error: std::io::Error) -> Error {
    Error::file(dir, format!("no results can be written here: {}", without_path(error)))
}

/// Where a folder that is about to change places with this one is, and what its name begins with.
fn beside(root: &Path) -> Option<(PathBuf, String)> {
    let name = root.file_name()?.to_string_lossy();
    Some((root.parent()?.to_owned(), format!(".{name}.roscausal-")))
}

/// The folders in this one whose names begin so.
fn named(folder: &Path, prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let is_named = |entry: &fs::DirEntry| entry.file_name().to_string_lossy().starts_with(prefix);
    entries.filter(is_named).map(|entry| entry.path()).filter(|path| is_folder(path)).collect()
}

/// Removes what runs that are gone left beside the folder: only what was one of results, or is empty.
fn remove_left_beside(parent: &Path, prefix: &str, home: &Path) {
    for left in named(parent, prefix) {
        let is_of_results = left.join(HOME).join(LIST).is_file();
        let _ = if is_of_results { remove_beside(&left, home) } else { fs::remove_dir(left) };
    }
}

/// Removes a set of results from beside the folder with this home. It moves there first: what is left of it when this process is
/// killed is known as ours.
fn remove_beside(set: &Path, home: &Path) -> std::io::Result<()> {
    let within = tempfile::Builder::new().prefix(WORK).tempdir_in(home)?;
    fs::rename(set, within.path())
}

/// Whether there is anything in a folder in which no run has left results.
fn holds_files_of_others(dir: &Path) -> std::io::Result<bool> {
    let home = dir.join(HOME);
    let new = home.join(NEW).join(SET).join(HOME).join(LIST);
    let is_own = |list: &Path| List::read(list).is_ok_and(|list| list.is_some());
    if !dir.exists() || (is_folder(&home) && (is_own(&home.join(LIST)) || is_own(&new))) {
        return Ok(false);
    }
    for entry in fs::read_dir(dir)? {
        if entry?.file_name() != HOME || !is_folder(&home) {
            return Ok(true);
        }
    }
    Ok(false)
}

fn is_folder(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|found| found.is_dir())
}

/// Where a file of a list is, unless its name leads out of the folder, or through a link.
fn inside(root: &Path, file: &Path) -> Option<PathBuf> {
    let mut place = root.to_owned();
    for (depth, part) in file.components().enumerate() {
        let Component::Normal(name) = part else { return None };
        let leads_on = depth == 0 || is_folder(&place) || fs::symlink_metadata(&place).is_err();
        if !leads_on || (depth == 0 && name == HOME) {
            return None;
        }
        place.push(name);
    }
    (place != root).then_some(place)
}

/// The files below a folder, but those that are still being written; folders without any are removed.
fn collect(root: &Path, below: &Path, files: &mut BTreeSet<PathBuf>) -> std::io::Result<()> {
    for entry in fs::read_dir(root.join(below))? {
        let entry = entry?;
        let (kind, path) = (entry.file_type()?, below.join(entry.file_name()));
        let name = entry.file_name().to_string_lossy().into_owned();
        if kind.is_dir() {
            collect(root, &path, files)?;
            let _ = fs::remove_dir(root.join(path));
        } else if kind.is_file() && !(name.starts_with('.') && name.ends_with(".tmp")) {
            files.insert(path);
        }
    }
    Ok(())
}

/// Moves a complete set to its place, if there is one that a run has left on its way there.
fn complete(dir: &Path) -> Result<()> {
    let home = dir.join(HOME);
    let new = home.join(NEW);
    if !is_folder(&new) {
        return Ok(());
    }
    let fault = |e: std::io::Error| {
        let reason =
            "the results are replaced only in part, and the next run into this folder goes on with it";
        Error::file(dir, format!("{e}; {reason}"))
    };
    let list = Path::new(SET).join(HOME).join(LIST);
    let list = inside(&new, &list).filter(|list| list.exists());
    if let Some(path) = list {
        let reason = "this list of results is not of a run into this folder; choose another --out";
        let list = List::read(&path)?.ok_or_else(|| Error::file(&path, reason))?;
        for file in &list.files {
            let from = inside(&new.join(SET), file);
            if let (Some(from), Some(to)) = (from, inside(dir, file)) {
                fs::create_dir_all(to.parent().unwrap_or(dir)).map_err(fault)?;
                fs::rename(from, to).or_else(ignore_missing).map_err(fault)?;
            }
        }
        for place in list.gone.iter().filter_map(|file| inside(dir, file)) {
            fs::remove_file(&place).or_else(ignore_missing).map_err(fault)?;
            // The folders that only the old set had.
            for folder in place.ancestors().skip(1).take_while(|folder| *folder != dir) {
                if fs::remove_dir(folder).is_err() {
                    break;
                }
            }
        }
        fs::rename(path, home.join(LIST)).map_err(fault)?;
    }
    fs::remove_dir_all(&new).map_err(fault)
}

fn ignore_missing(error: std::io::Error) -> std::io::Result<()> {
    match error.kind() {
        // A folder of the user's own has taken the name, or a file that of a folder.
        ErrorKind::NotFound | ErrorKind::IsADirectory | ErrorKind::NotADirectory => Ok(()),
        _ => Err(error),
    }
}

impl List {
    /// `None` if there is none, or it is not of a run into this folder.
    fn read(path: &Path) -> Result<Option<Self>> {
        let found = match fs::symlink_metadata(path) {
            Ok(found) if found.is_file() => found,
            Ok(_) => return Err(Error::file(path, "no list of results, but no file; choose another --out")),
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::file(path, error)),
        };
        let list: Self = serde_json::from_slice(&bounded::read(path, LONGEST_LIST)?)
            .map_err(|e| Error::file(path, format!("no list of results: {e}; choose another --out")))?;
        Ok(Some(list).filter(|list| list.inode == inode(&found)))
    }

    /// Writes it, with the number of its file.
    fn write(&mut self, path: &Path) -> std::io::Result<()> {
        let mut file = File::create(path)?;
        self.inode = inode(&file.metadata()?);
        file.write_all(&serde_json::to_vec(self)?)?;
        file.sync_all()
    }
}

#[cfg(unix)]
fn inode(of: &fs::Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(of)
}

/// Other systems do not tell it: lists are believed there.
#[cfg(not(unix))]
fn inode(_: &fs::Metadata) -> u64 {
    0
}

/// The lock on a folder, while it is held.
struct Lock {
    file: File,
    dir: PathBuf,
    /// Whether the folder is there only for this run.
    is_new: bool,
}

impl Lock {
    fn take(dir: &Path) -> Result<Self> {
        let is_new = !dir.exists();
        let (home, path) = (dir.join(HOME), dir.join(HOME).join(LOCK));
        for _ in 0..ATTEMPTS {
            fs::create_dir_all(dir).map_err(|e| unwritable(dir, e))?;
            fs::create_dir(&home)
                .or_else(|error| if is_folder(&home) { Ok(()) } else { Err(unwritable(dir, error)) })?;
            // Nothing is written through a link.
            let is_other = fs::symlink_metadata(&path).is_ok_and(|found| !found.is_file());
            let reason = "this is not a lock of a run; remove it, or choose another --out";
            ensure(!is_other, || Error::file(&path, reason))?;
            let opened = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
            let file = match opened {
                Ok(file) => file,
                // Removed with its folder by the run before.
                Err(error) if error.kind() == ErrorKind::NotFound => continue,
                Err(error) => return Err(unwritable(dir, error)),
            };
            match file.try_lock() {
                Ok(()) => {}
                // A file system without locks.
                Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {}
                Err(TryLockError::Error(error)) => return Err(unwritable(dir, error)),
                Err(TryLockError::WouldBlock) => {
                    let mut process = String::new();
                    let _ = file.take(20).read_to_string(&mut process);
                    let (process, way) = (process.trim(), "wait for its end, or choose another --out");
                    let reason = format!("process {process} writes its results into this folder; {way}");
                    return Err(Error::file(dir, reason));
                }
            }
            if is_still(&file, &path) {
                // Made first: where its file cannot be written it is removed.
                let mut lock = Self { file, dir: dir.to_owned(), is_new };
                let written = lock.file.set_len(0).and_then(|()| write!(lock.file, "{}", process::id()));
                return written.map(|()| lock).map_err(|e| unwritable(dir, e));
            }
        }
        Err(Error::file(dir, "other runs write their results into this folder; choose another --out"))
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Not the lock of a run that has the folder by now; each folder only if nothing else is in it.
        let home = self.dir.join(HOME);
        if is_still(&self.file, &home.join(LOCK)) {
            let _ = fs::remove_file(home.join(LOCK));
        }
        let _ = fs::remove_dir(home);
        if self.is_new {
            let _ = fs::remove_dir(&self.dir);
        }
        let _ = self.file.unlock();
    }
}

#[cfg(test)]
#[path = "results_tests.rs"]
mod tests;
