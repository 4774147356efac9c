//! A folder of recordings, read as one recording.

use std::path::{Path, PathBuf};

use roscausal_core::{Error, Result, Time};

use crate::{
    packed::unpacked_name,
    recording::open_file,
    source::Source,
    topic::{Record, Topic, Topics},
};

/// The recordings in a folder, as one.
pub(crate) struct Folder {
    files: Vec<File>,
    topics: Topics,
}

struct File {
    source: Box<dyn Source>,
    /// For each topic of the file, its index among the folder's topics.
    topics: Vec<usize>,
}

const EXTENSIONS: [&str; 3] = ["bag", "mcap", "db3"];

impl Folder {
    pub(crate) fn open(path: &Path, losses: &mut Vec<String>) -> Result<Self> {
        let entries = path.read_dir().map_err(|error| Error::file(path, error))?;
        let is_plain = |file: &Path| {
            file.extension().is_some_and(|extension| EXTENSIONS.iter().any(|known| extension == *known))
        };
        // rosbag2's player leaves what it unpacked beside the compressed file.
        let is_recording = |file: &PathBuf| match unpacked_name(file) {
            Some(name) => is_plain(&name) && !name.exists(),
            None => is_plain(file),
        };
        // A pipe or a device would never end.
        let is_file = |file: &PathBuf| file.is_file();
        let mut paths: Vec<_> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(is_recording)
            .filter(is_file)
            .collect();
        paths.sort();
        let (mut files, mut topics) = (Vec::new(), Topics::default());
        for file in paths {
            match open_file(&file, losses) {
                Ok(source) => {
                    let indexes = source.topics().iter().map(|topic| topics.add(topic.clone())).collect();
                    files.push(File { source, topics: indexes });
                }
                Err(error) => losses.push(format!("{error}; its messages are left out")),
            }
        }
        if files.is_empty() {
            let reason = losses
                .pop()
                .unwrap_or_else(|| "no .bag, .mcap or .db3 file in this folder, compressed or not".into());
            return Err(Error::file(path, reason));
        }
        Ok(Self { files, topics })
    }

    fn earliest(&self) -> Option<(Time, usize)> {
        let starts = self.files.iter().enumerate();
        starts.filter_map(|(index, file)| Some((file.source.next_start()?, index))).min()
    }
}

impl Source for Folder {
    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn next_start(&self) -> Option<Time> {
        self.earliest().map(|(start, _)| start)
    }

    fn load(&mut self, wanted: &[bool], out: &mut Vec<Record>) -> std::result::Result<(), String> {
        let Some((_, index)) = self.earliest() else { return Ok(()) };
        let File { source, topics } = &mut self.files[index];
        let wanted: Vec<_> = topics.iter().map(|topic| wanted[*topic]).collect();
        let first = out.len();
        let loaded = source.load(&wanted, out);
        out[first..].iter_mut().for_each(|record| record.topic = topics[record.topic]);
        loaded
    }

    fn span(&self) -> Option<(Time, Time)> {
        let spans = self.files.iter().filter_map(|file| file.source.span());
        spans.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    fn progress(&self) -> f64 {
        self.files.iter().map(|file| file.source.progress()).sum::<f64>() / self.files.len() as f64
    }
}
