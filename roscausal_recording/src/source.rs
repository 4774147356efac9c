//! A file that is read piece by piece, and what the formats share.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use roscausal_core::{Error, Result, Time, memory::Growth};

use crate::{
    file::Bytes,
    topic::{Record, Topic, Topics},
};

/// A fault and its position; the name of the file is added later.
pub(crate) type Parsed<T> = std::result::Result<T, String>;

/// A file that is read piece by piece.
pub(crate) trait Source: Send {
    fn topics(&self) -> &[Topic];

    /// A lower bound for the times of all messages still to come; `None` at the end.
    fn next_start(&self) -> Option<Time>;

    /// Reads the next piece: its messages of the wanted topics, in any order.
    ///
    /// # Errors
    /// What was lost and where, in one sentence. Whatever is intact is in `out` nevertheless.
    fn load(&mut self, wanted: &[bool], out: &mut Vec<Record>) -> Parsed<()>;

    /// Times of the first and the last message, if known without reading everything.
    fn span(&self) -> Option<(Time, Time)>;

    /// The fraction that has been read, from 0 to 1.
    fn progress(&self) -> f64;
}

/// A piece of a file: its position, and the recording times of its messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub(crate) offset: u64,
    pub(crate) length: u64,
    pub(crate) start: Time,
    pub(crate) end: Time,
    /// Whether the file ends within the piece.
    pub(crate) cut: bool,
}

/// The pieces of a file in the order of their messages.
#[derive(Debug, Default)]
pub(crate) struct Pieces {
    pieces: Vec<Piece>,
    next: usize,
}

impl Pieces {
    /// The pieces in order. A damaged index may name one twice; it is read once.
    pub(crate) fn new(mut pieces: Vec<Piece>) -> Self {
        pieces.sort_by_key(|piece| piece.offset);
        pieces.dedup_by_key(|piece| piece.offset);
        pieces.sort_by_key(|piece| (piece.start, piece.offset));
        Self { pieces, next: 0 }
    }

    pub(crate) fn take(&mut self) -> Option<Piece> {
        let piece = self.pieces.get(self.next).copied()?;
        self.next += 1;
        Some(piece)
    }

    pub(crate) fn next_start(&self) -> Option<Time> {
        self.pieces.get(self.next).map(|piece| piece.start)
    }

    pub(crate) fn span(&self) -> Option<(Time, Time)> {
        let start = self.pieces.first()?.start;
        self.pieces.iter().map(|piece| piece.end).max().map(|end| (start, end))
    }

    pub(crate) fn progress(&self) -> f64 {
        if self.pieces.is_empty() { 1.0 } else { self.next as f64 / self.pieces.len() as f64 }
    }
}

/// A file that consists of pieces, and its topics.
pub(crate) struct Contents {
    pub(crate) path: PathBuf,
    pub(crate) file: Bytes,
    pub(crate) topics: Topics,
    /// The file's id of a connection or channel -> index of its topic.
    pub(crate) numbers: HashMap<u32, usize>,
    pub(crate) pieces: Pieces,
    /// How far its chunks have grown.
    pub(crate) growth: Growth,
    /// Bytes of pieces that are still to come: each byte of the file is in one piece.
    unread: u64,
}

impl Contents {
    /// A file before anything is known about it.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let file = Bytes::open(path).map_err(|error| Error::file(path, error))?;
        let (topics, numbers, pieces) = (Topics::default(), HashMap::new(), Pieces::default());
        let unread = file.length();
        Ok(Self { path: path.to_owned(), file, topics, numbers, pieces, growth: Growth::default(), unread })
    }

    /// Keeps the pieces; reading them begins.
    pub(crate) fn begin(&mut self, pieces: Vec<Piece>) {
        self.pieces = Pieces::new(pieces);
        self.growth = Growth::default();
        self.unread = self.file.length();
    }

    /// The next `count` bytes of a piece.
    pub(crate) fn piece(&mut self, count: u64) -> Parsed<Vec<u8>> {
        self.unread = self.unread.checked_sub(count).ok_or("pieces of the file lie over each other")?;
        self.file.take(count).map_err(|error| error.to_string())
    }

    pub(crate) fn add(&mut self, number: u32, topic: Topic) {
        self.numbers.insert(number, self.topics.add(topic));
    }

    /// Adds a message of the topic with this id in the file, if the topic is wanted.
    pub(crate) fn take(
        &self,
        (number, stamp, bytes): (u32, Time, &[u8]),
        wanted: &[bool],
        out: &mut Vec<Record>,
    ) -> Parsed<()> {
        let topic = *self.numbers.get(&number).ok_or_else(|| format!("its topic {number} is unknown"))?;
        if wanted.get(topic) == Some(&true) {
            out.push(Record { topic, stamp, bytes: bytes.to_vec() });
        }
        Ok(())
    }

    pub(crate) fn seek(&mut self, offset: u64) -> Parsed<()> {
        self.file.seek(offset).map_err(|error| error.to_string())
    }
}

/// A format whose files consist of pieces.
pub(crate) trait Format: Send {
    fn contents(&self) -> &Contents;

    fn contents_mut(&mut self) -> &mut Contents;

    /// Reads a piece, as [`Source::load`].
    fn read(&mut self, piece: Piece, wanted: &[bool], out: &mut Vec<Record>) -> Parsed<()>;
}

impl<F: Format> Source for F {
    fn topics(&self) -> &[Topic] {
        &self.contents().topics
    }

    fn next_start(&self) -> Option<Time> {
        self.contents().pieces.next_start()
    }

    fn load(&mut self, wanted: &[bool], out: &mut Vec<Record>) -> Parsed<()> {
        let Some(piece) = self.contents_mut().pieces.take() else { return Ok(()) };
        // The start of the recording has already reported that the piece is cut.
        self.read(piece, wanted, out).or_else(|reason| {
            let (path, offset) = (self.contents().path.display(), piece.offset);
            let fault =
                || format!("{path}: the chunk at byte {offset} is left out or not complete: {reason}");
            if piece.cut { Ok(()) } else { Err(fault()) }
        })
    }

    fn span(&self) -> Option<(Time, Time)> {
        self.contents().pieces.span()
    }

    fn progress(&self) -> f64 {
        self.contents().pieces.progress()
    }
}

/// First and last of a set of stamps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Span(pub(crate) Option<(Time, Time)>);

impl Span {
    pub(crate) fn add(&mut self, stamp: Time) {
        self.0 = Some(self.0.map_or((stamp, stamp), |(start, end)| (start.min(stamp), end.max(stamp))));
    }
}
