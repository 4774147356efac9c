//! Opens recordings: a file, or a folder of files, read as one recording.

use std::path::{Path, PathBuf};

use roscausal_core::{Error, Result, Time};

use crate::{
    copies::left_out,
    formats::open_file,
    laps::BACK_S,
    metadata::Metadata,
    packed::unpacked_name,
    recording::Recording,
    source::{Moment, Source},
    topic::{Record, Topic, Topics},
};

impl Recording {
    /// Opens a recording: a file, or a folder of files as `ros2 bag record` makes it (`metadata.yaml` is not
    /// needed).
    ///
    /// # Errors
    /// A file that cannot be read, or is not a recording. A damaged recording opens; see [`Recording::losses`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let mut losses = Vec::new();
        let source: Box<dyn Source> = if path.is_dir() {
            Box::new(Folder::open(path, &mut losses)?)
        } else {
            open_file(path, &mut losses)?
        };
        Ok(Self::of(path, source, losses))
    }
}

/// The recordings in a folder, as one.
pub(crate) struct Folder {
    files: Vec<File>,
    topics: Topics,
    /// How many messages of each topic there should be, where that is known.
    counts: Vec<Option<u64>>,
}

struct File {
    source: Box<dyn Source>,
    /// For each topic of the file, its index among the folder's topics.
    topics: Vec<usize>,
    /// The first lap of the file.
    lap: u32,
    /// What was recorded up to then is in another file.
    after: Option<Time>,
}

const EXTENSIONS: [&str; 3] = ["bag", "mcap", "db3"];
/// Ending of the name of a bag that its recorder has not closed.
const OPEN: &str = "active";

/// Whether a file has the name of a recording: `run.bag`, `run.mcap`, `run_0.db3`, `run.bag.active` (never closed), or one of
/// these that rosbag2 compressed, such as `run_0.mcap.zstd`.
pub fn is_named_so(path: &Path) -> bool {
    let path = unpacked_name(path).unwrap_or_else(|| path.to_owned());
    let path = if has_ending(&path, OPEN) { path.with_extension("") } else { path };
    EXTENSIONS.iter().any(|known| has_ending(&path, known))
}

pub(crate) fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|extension| extension == ending)
}

/// The files of a folder that have the names of recordings, in the order of their names.
pub fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    // rosbag2's player leaves what it unpacked beside the compressed file.
    let is_unpacked = |file: &Path| unpacked_name(file).is_some_and(|name| name.exists());
    // A pipe or a device would never end.
    let is_one = |file: &PathBuf| is_named_so(file) && !is_unpacked(file) && file.is_file();
    sorted(folder, is_one)
}

/// The folders in a folder that hold recordings, in the order of their names.
pub fn folders_in(folder: &Path) -> Vec<PathBuf> {
    sorted(folder, |path| path.is_dir() && !recordings_in(path).is_empty())
}

/// What such paths there are in a folder, in the order of their names.
pub(crate) fn sorted(folder: &Path, is_one: impl Fn(&PathBuf) -> bool) -> Vec<PathBuf> {
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut paths: Vec<_> = entries.map(|entry| entry.path()).filter(is_one).collect();
    paths.sort();
    paths
}

/// Most names that a sentence lists.
const MOST_NAMED: usize = 5;

/// `a, b and 3 more`, without their folder.
fn names(paths: &[PathBuf]) -> String {
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let listed = paths.iter().take(MOST_NAMED).map(name).collect::<Vec<_>>().join(", ");
    match paths.len().saturating_sub(MOST_NAMED) {
        0 => listed,
        more => format!("{listed} and {more} more"),
    }
}

impl Folder {
    /// Opens the recordings in a folder. If there are none, but one folder in it holds some, opens that one.
    pub(crate) fn open(path: &Path, losses: &mut Vec<String>) -> Result<Self> {
        path.read_dir().map_err(|error| Error::file(path, error))?;
        let (paths, folders) = (recordings_in(path), folders_in(path));
        match (paths.is_empty(), folders.as_slice()) {
            (true, [only]) => return Self::open(only, losses),
            (true, [_, ..]) => {
                let reason = format!(
                    "this folder holds several folders of recordings; name one of them: {}",
                    names(&folders)
                );
                return Err(Error::file(path, reason));
            }
            (false, [_, ..]) => losses.push(format!(
                "{}: folders in it hold recordings, too, which are left out; name one to read it: {}",
                path.display(),
                names(&folders)
            )),
            (_, []) => (),
        }
        let mut opened = Vec::new();
        for file in paths {
            match open_file(&file, losses) {
                Ok(source) => opened.push((file, source)),
                Err(error) => losses.push(format!("{error}; its messages are left out")),
            }
        }
        if opened.is_empty() {
            let reason = losses
                .pop()
                .unwrap_or_else(|| "no .bag, .mcap or .db3 file in this folder, compressed or not".into());
            return Err(Error::file(path, reason));
        }
        let metadata = Metadata::of(path);
        losses.extend(metadata.missing());
        let copies = left_out(&opened);
        losses.extend(copies.iter().map(|(.., sentence)| sentence.clone()));
        let mut whole = Self { files: Vec::new(), topics: Topics::default(), counts: Vec::new() };
        for (number, (_, source)) in opened.into_iter().enumerate() {
            let of_file = copies.iter().filter(|(copy, ..)| *copy == number);
            let after = of_file.map(|(_, until, _)| *until).max();
            if after != Some(Time::MAX) {
                let topics = source.topics().iter().map(|topic| whole.topics.add(topic.clone())).collect();
                whole.files.push(File { source, topics, lap: 0, after });
            }
        }
        losses.extend(metadata.lost(whole.files.iter().map(|file| file.source.held()).sum()));
        whole.set_laps();
        whole.counts = metadata.counts(&whole.topics);
        Ok(whole)
    }

    /// Recordings of the same topics at the same times, which are not copies, are of several runs of a simulation: each is a lap.
    fn set_laps(&mut self) {
        let mut by_time: Vec<usize> = (0..self.files.len()).collect();
        by_time.sort_by_key(|index| self.files[*index].source.span());
        for (place, index) in by_time.iter().enumerate() {
            let file = &self.files[*index];
            let earlier = by_time[..place].iter().map(|earlier| &self.files[*earlier]);
            let beside = earlier.filter(|earlier| file.is_at_the_time_of(earlier));
            let taken: Vec<(u32, u32)> = beside.map(|of| (of.lap, of.lap + of.source.laps())).collect();
            let laps = file.source.laps();
            let is_free = |lap: u32| taken.iter().all(|(begin, end)| lap + laps <= *begin || lap >= *end);
            let free = taken.iter().map(|(_, end)| *end).chain([0]).filter(|lap| is_free(*lap)).min();
            self.files[*index].lap = free.unwrap_or(0);
        }
    }

    fn earliest(&self) -> Option<(Moment, usize)> {
        let starts = self.files.iter().enumerate();
        let start = |(index, file): (usize, &File)| {
            let (lap, start) = file.source.next_start()?;
            Some(((file.lap + lap, start), index))
        };
        starts.filter_map(start).min()
    }
}

impl File {
    /// Whether the files share more than a moment, and one has all topics of the other.
    fn is_at_the_time_of(&self, other: &Self) -> bool {
        let span = |file: &Self| file.source.span().map(|(start, end)| (file.after.unwrap_or(start), end));
        let spans = span(self).zip(span(other));
        let shared = spans.map_or(0.0, |(a, b)| a.1.min(b.1).secs_since(a.0.max(b.0)));
        let within = |a: &Self, b: &Self| a.topics.iter().all(|topic| b.topics.contains(topic));
        shared > BACK_S && (within(self, other) || within(other, self))
    }
}

impl Source for Folder {
    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn next_start(&self) -> Option<Moment> {
        self.earliest().map(|(start, _)| start)
    }

    fn laps(&self) -> u32 {
        self.files.iter().map(|file| file.lap + file.source.laps()).max().unwrap_or(1)
    }

    fn load(&mut self, wanted: &[bool], out: &mut Vec<Record>) -> std::result::Result<(), String> {
        let Some((_, index)) = self.earliest() else { return Ok(()) };
        let File { source, topics, lap, after } = &mut self.files[index];
        let wanted: Vec<_> = topics.iter().map(|topic| wanted[*topic]).collect();
        let first = out.len();
        let loaded = source.load(&wanted, out);
        if let Some(after) = *after {
            for record in out.extract_if(first.., |record| record.stamp <= after) {
                if let Some(Some(count)) = self.counts.get_mut(topics[record.topic]) {
                    *count = count.saturating_sub(1);
                }
            }
        }
        for record in &mut out[first..] {
            (record.topic, record.lap) = (topics[record.topic], record.lap + *lap);
        }
        loaded
    }

    fn counts(&self) -> Vec<Option<u64>> {
        self.counts.clone()
    }

    fn span(&self) -> Option<(Time, Time)> {
        self.files.iter().filter_map(|file| file.source.span()).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    fn progress(&self) -> f64 {
        self.files.iter().map(|file| file.source.progress()).sum::<f64>() / self.files.len() as f64
    }
}
