//! The journal on disk: a thread that appends samples and syncs them.

use std::{
    collections::VecDeque,
    fs::{self, File},
    io::{Seek, SeekFrom, Write},
    path::PathBuf,
    sync::{Arc, Condvar, Mutex},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use super::{
    Entry, Sample,
    format::{begin, block_of},
};
use crate::{
    Error, Result,
    batch::pool::{Pool, remove, sync_dir},
    gate::{lock, wait},
};

/// Most entries that wait for the disk: a minute of many people.
const WAITING: usize = 200_000;
/// Most samples that are written at a time.
const AT_ONCE: usize = 4096;
/// Time between two syncs. Written data survives the end of the process at once, and a loss of power after the next
/// sync.
const SYNC_EVERY: Duration = Duration::from_millis(400);

/// The thread that keeps the journal. Dropping it writes what is waiting.
#[derive(Debug)]
pub struct Journal {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// State of the journal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JournalStatus {
    /// Samples that are in no journal because too many waited for the disk. They are still in memory, and will be
    /// in their batch unless the node dies first.
    pub unprotected: u64,
    /// Why nothing can be written now, if that is so.
    pub trouble: Option<String>,
}

#[derive(Debug)]
struct Shared {
    pool: Pool,
    queue: Mutex<Queue>,
    changed: Condvar,
    files: Mutex<Files>,
}

#[derive(Debug, Default)]
struct Queue {
    entries: VecDeque<Entry>,
    status: JournalStatus,
    ending: bool,
}

#[derive(Debug, Default)]
struct Files {
    /// Journals up to this number are no longer needed.
    retired: u64,
    current: u64,
    /// File of the current journal, and how many of its bytes are complete.
    open: Option<(File, PathBuf, u64)>,
    /// The last sync, what was written since, and whether the file itself is new.
    synced: Option<Instant>,
    unsynced: bool,
    new: bool,
}

impl Files {
    /// Waits until the disk has what was written.
    fn sync(&mut self, pool: &Pool) -> Result<()> {
        if let Some((file, path, _)) = self.open.as_ref().filter(|_| self.unsynced) {
            file.sync_data().map_err(|e| Error::file(path, e))?;
        }
        if self.new {
            sync_dir(pool.dir())?;
        }
        self.new = false;
        self.unsynced = false;
        self.synced = Some(Instant::now());
        Ok(())
    }

    /// Time until the next sync is due; `None` if everything is synced.
    fn sync_due(&self) -> Option<Duration> {
        let since = self.synced.map_or(SYNC_EVERY, |synced| synced.elapsed());
        self.unsynced.then(|| SYNC_EVERY.saturating_sub(since))
    }
}

impl Journal {
    /// Starts the thread. Journals lie in the folder of `pool`.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub fn start(pool: Pool) -> Result<Self> {
        let (queue, changed, files) = Default::default();
        let shared = Arc::new(Shared { pool, queue, changed, files });
        let works = shared.clone();
        let thread = thread::Builder::new()
            .name("journal".into())
            .spawn(move || works.work())
            .map_err(|e| Error::Data(format!("no thread for the journal: {e}")))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Hands over entries; returns at once.
    pub fn append(&self, entries: Vec<Entry>) {
        if entries.is_empty() {
            return;
        }
        let mut queue = lock(&self.shared.queue);
        for entry in entries {
            if queue.entries.len() < WAITING || !matches!(entry, Entry::Sample(_)) {
                queue.entries.push_back(entry);
            } else {
                queue.status.unprotected += 1;
            }
        }
        drop(queue);
        self.shared.changed.notify_all();
    }

    /// State of the journal.
    pub fn status(&self) -> JournalStatus {
        lock(&self.shared.queue).status.clone()
    }

    /// The batch of journal `number` is about to become a file. Renames its journal to `marker`; nothing is written
    /// to it any more. Returns whether there was one.
    pub(in crate::batch) fn retire(&self, number: u64, marker: &str) -> Result<bool> {
        let mut files = lock(&self.shared.files);
        self.shared.drain(&mut files);
        files.retired = files.retired.max(number);
        if files.current <= number {
            files.sync(&self.shared.pool)?;
            files.open = None;
        }
        let (from, to) = (self.shared.path(number), self.shared.pool.path(marker));
        match fs::rename(&from, &to) {
            Ok(()) => sync_dir(self.shared.pool.dir()).map(|()| true),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(false),
            Err(e) => Err(Error::file(&from, e)),
        }
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        lock(&self.shared.queue).ending = true;
        self.shared.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn path(&self, number: u64) -> PathBuf {
        self.pool.path(&self.pool.journal_name(number))
    }

    /// Writes whenever something new arrives. What could not be written is tried again then.
    fn work(&self) {
        loop {
            let sync_due = self.write_what_waits();
            let queue = lock(&self.queue);
            let troubled = queue.status.trouble.is_some();
            if !queue.entries.is_empty() && !troubled {
                continue;
            }
            match sync_due {
                _ if queue.ending => {
                    drop(queue);
                    let mut files = lock(&self.files);
                    return self.tell(files.sync(&self.pool));
                }
                Some(due) if !troubled => drop(wait(&self.changed, queue, due)),
                // Not before something new arrives: a full disk must not keep the CPU busy.
                _ => drop(wait(&self.changed, queue, Duration::MAX)),
            }
        }
    }

    /// Writes, and syncs if that is due. Returns the time until the next sync is due.
    fn write_what_waits(&self) -> Option<Duration> {
        let mut files = lock(&self.files);
        self.drain(&mut files);
        if files.sync_due() == Some(Duration::ZERO) {
            self.tell(files.sync(&self.pool));
        }
        files.sync_due()
    }

    fn tell(&self, done: Result<()>) {
        if let Err(error) = done {
            let mut queue = lock(&self.queue);
            if queue.status.trouble.is_none() {
                tracing::error!("the open batch is not journalled: {error}");
            }
            queue.status.trouble = Some(format!("the open batch is not journalled: {error}"));
        }
    }

    /// Writes what is waiting, as far as the disk takes it.
    fn drain(&self, files: &mut Files) {
        loop {
            let batch = self.next();
            if batch.is_empty() {
                return;
            }
            let done = self.write(files, &batch);
            if done.is_err() {
                return self.tell(done);
            }
            let mut queue = lock(&self.queue);
            queue.entries.drain(..batch.len());
            queue.status.trouble = None;
        }
    }

    /// The oldest entries: one of another kind, or several samples. They stay in the queue until they are written.
    /// Only this thread, or the writer while it holds the lock of the files, takes them out.
    fn next(&self) -> Vec<Entry> {
        let queue = lock(&self.queue);
        let samples =
            queue.entries.iter().take_while(|entry| matches!(entry, Entry::Sample(_))).take(AT_ONCE).count();
        queue.entries.iter().take(samples.max(1)).cloned().collect()
    }

    fn write(&self, files: &mut Files, entries: &[Entry]) -> Result<()> {
        match entries.first() {
            Some(Entry::Begin(header)) => {
                // What was written to the previous journal must reach the disk first.
                files.sync(&self.pool)?;
                files.current = header.number;
                files.open = None;
                if header.number > files.retired {
                    let path = self.path(header.number);
                    let bytes = begin(header);
                    let fault = |e: std::io::Error| Error::file(&path, e);
                    let mut file = File::create(&path).map_err(fault)?;
                    file.write_all(&bytes).map_err(fault)?;
                    (files.unsynced, files.new) = (true, true);
                    files.open = Some((file, path, bytes.len() as u64));
                }
            }
            Some(Entry::Abandon(number)) => {
                if files.current == *number {
                    files.open = None;
                }
                remove(&self.path(*number))?;
            }
            _ => {
                let Some((file, path, whole)) = &mut files.open else { return Ok(()) };
                let sample =
                    |entry: &Entry| if let Entry::Sample(sample) = entry { Some(*sample) } else { None };
                let samples: Vec<Sample> = entries.iter().filter_map(sample).collect();
                let bytes = block_of(&samples);
                // First removes what a full disk took of the last block.
                let mut append = || -> std::io::Result<()> {
                    if file.seek(SeekFrom::End(0))? != *whole {
                        file.set_len(*whole)?;
                        file.seek(SeekFrom::Start(*whole))?;
                    }
                    file.write_all(&bytes)
                };
                append().map_err(|e| Error::file(&*path, e))?;
                *whole += bytes.len() as u64;
                files.unsynced = true;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{
            decode,
            format::tests::{header, samples},
        },
        *,
    };

    #[test]
    fn what_is_appended_is_on_disk_and_a_retired_journal_is_written_no_more() {
        let dir = tempfile::tempdir().expect("a folder");
        let pool = Pool::open(dir.path(), "data_").expect("opens");
        let journal = Journal::start(pool.clone()).expect("starts");
        let samples = samples(5);
        let entries =
            |samples: &[Sample]| samples.iter().map(|sample| Entry::Sample(*sample)).collect::<Vec<_>>();
        journal.append([vec![Entry::Begin(header())], entries(&samples[..4])].concat());
        assert!(journal.retire(3, ".data_1.csv.commit").expect("renames"));
        journal.append(entries(&samples[4..]));
        let marker = fs::read(pool.path(".data_1.csv.commit")).expect("is there");
        assert_eq!(decode(&marker).expect("a journal").1.len(), 4);
        assert!(!journal.retire(4, ".data_2.csv.commit").expect("there is none"));
        drop(journal);
        assert!(!pool.path(&pool.journal_name(3)).exists());
        assert_eq!(
            fs::metadata(pool.path(".data_1.csv.commit")).expect("is there").len(),
            marker.len() as u64
        );
    }

    #[test]
    fn a_journal_of_no_use_is_removed() {
        let dir = tempfile::tempdir().expect("a folder");
        let pool = Pool::open(dir.path(), "data_").expect("opens");
        let journal = Journal::start(pool).expect("starts");
        journal.append(vec![Entry::Begin(header()), Entry::Abandon(3)]);
        drop(journal);
        assert_eq!(fs::read_dir(dir.path()).expect("lists").count(), 0);
    }
}
