//! A file that is read piece by piece, and what the formats share.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use roscausal_core::{Error, Result, Time, memory::Growth};

use crate::{
    file::Bytes,
    laps::{BACK_S, LapFinder, Laps},
    topic::{Record, Topic, Topics},
};

/// A fault and its position; the name of the file is added later.
pub(crate) type Parsed<T> = std::result::Result<T, String>;

/// A lap, and a recording time in it.
pub(crate) type Moment = (u32, Time);

/// A file that is read piece by piece.
pub(crate) trait Source: Send {
    fn topics(&self) -> &[Topic];

    /// A lower bound for the times of all messages still to come; `None` at the end.
    fn next_start(&self) -> Option<Moment>;

    /// How often it begins anew: 1 plus how often its recording time goes back.
    fn laps(&self) -> u32 {
        1
    }

    /// Reads the next piece: its messages of the wanted topics, in any order.
    ///
    /// # Errors
    /// What was lost and where, in one sentence. Whatever is intact is in `out` nevertheless.
    fn load(&mut self, wanted: &[bool], out: &mut Vec<Record>) -> Parsed<()>;

    /// How many messages of each topic there should be, where that is known.
    fn counts(&self) -> Vec<Option<u64>> {
        self.topics().iter().map(|topic| topic.messages).collect()
    }

    /// How many messages there are, if known without reading everything.
    fn held(&self) -> Option<u64> {
        self.topics().iter().map(|topic| topic.messages).sum()
    }

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
    /// The earliest lap of its messages.
    pub(crate) lap: u32,
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
        pieces.sort_by_key(|piece| (piece.lap, piece.start, piece.offset));
        Self { pieces, next: 0 }
    }

    pub(crate) fn take(&mut self) -> Option<Piece> {
        let piece = self.pieces.get(self.next).copied()?;
        self.next += 1;
        Some(piece)
    }

    pub(crate) fn next_start(&self) -> Option<Moment> {
        self.pieces.get(self.next).map(|piece| (piece.lap, piece.start))
    }

    /// In the order of the file.
    fn of_file(&self) -> Vec<Piece> {
        let mut pieces = self.pieces.clone();
        pieces.sort_by_key(|piece| piece.offset);
        pieces
    }

    pub(crate) fn span(&self) -> Option<(Time, Time)> {
        let start = self.pieces.iter().map(|piece| piece.start).min()?;
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
    /// Laps, with the number of the first message of each piece, by its offset.
    laps: Laps,
    numbered: HashMap<u64, u64>,
    /// The number of the next message.
    number: u64,
    /// How far its chunks have grown.
    pub(crate) growth: Growth,
    /// Bytes of pieces that are still to come: each byte of the file is in one piece.
    unread: u64,
}

impl Contents {
    /// A file before anything is known about it.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let file = Bytes::open(path).map_err(|error| Error::file(path, error))?;
        let (path, unread) = (path.to_owned(), file.length);
        let (topics, numbers, pieces, laps, numbered, growth) = Default::default();
        Ok(Self { path, file, topics, numbers, pieces, laps, numbered, number: 0, growth, unread })
    }

    /// Keeps the pieces; reading them begins.
    pub(crate) fn begin(&mut self, pieces: Vec<Piece>) {
        self.pieces = Pieces::new(pieces);
        self.growth = Growth::default();
        self.unread = self.file.length;
    }

    /// The next `count` bytes of a piece.
    pub(crate) fn piece(&mut self, count: u64) -> Parsed<Vec<u8>> {
        self.unread = self.unread.checked_sub(count).ok_or("pieces of the file lie over each other")?;
        self.file.take(count).map_err(|error| error.to_string())
    }

    pub(crate) fn add(&mut self, number: u32, topic: Topic) {
        self.numbers.insert(number, self.topics.add(topic));
    }

    /// Sets how many messages the topics of these numbers have, and that the others have none.
    pub(crate) fn count(&mut self, counts: impl IntoIterator<Item = (u32, u64)>) {
        self.topics.iter_mut().for_each(|topic| topic.messages = Some(0));
        for (number, count) in counts {
            if let Some(topic) = self.numbers.get(&number) {
                let messages = &mut self.topics[*topic].messages;
                *messages = messages.map(|messages| messages.saturating_add(count));
            }
        }
    }

    /// Adds a message of the topic with this id in the file, if the topic is wanted.
    pub(crate) fn take(
        &mut self,
        (number, stamp, bytes): (u32, Time, &[u8]),
        wanted: &[bool],
        out: &mut Vec<Record>,
    ) -> Parsed<()> {
        let topic = *self.numbers.get(&number).ok_or_else(|| format!("its topic {number} is unknown"))?;
        let lap = self.laps.of(topic, self.number);
        self.number += 1;
        if wanted.get(topic) == Some(&true) {
            out.push(Record { topic, lap, stamp, bytes: bytes.to_vec() });
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

    fn next_start(&self) -> Option<Moment> {
        self.contents().pieces.next_start()
    }

    fn load(&mut self, wanted: &[bool], out: &mut Vec<Record>) -> Parsed<()> {
        let Some(piece) = self.contents_mut().pieces.take() else { return Ok(()) };
        let number = self.contents().numbered.get(&piece.offset).copied().unwrap_or(0);
        self.contents_mut().number = number;
        // The start of the recording has already reported that the piece is cut.
        self.read(piece, wanted, out).or_else(|reason| {
            let (path, offset) = (self.contents().path.display(), piece.offset);
            let fault =
                || format!("{path}: the chunk at byte {offset} is left out or not complete: {reason}");
            if piece.cut { Ok(()) } else { Err(fault()) }
        })
    }

    fn laps(&self) -> u32 {
        self.contents().laps.count()
    }

    fn span(&self) -> Option<(Time, Time)> {
        self.contents().pieces.span()
    }

    fn progress(&self) -> f64 {
        self.contents().pieces.progress()
    }
}

/// Finds the laps of a file, if its recording times go back. Then the file is read once for it.
pub(crate) fn find_laps(file: &mut impl Format) {
    let mut pieces = file.contents().pieces.of_file();
    let mut newest = None::<Time>;
    let goes_back = pieces.iter().any(|piece| {
        let before = newest.replace(newest.map_or(piece.end, |newest| newest.max(piece.end)));
        before.is_some_and(|before| before.secs_since(piece.start) > BACK_S)
    });
    // Within a single piece they may as well.
    if !goes_back && pieces.len() != 1 {
        return;
    }
    let (mut finder, wanted) = (LapFinder::default(), vec![true; file.contents().topics.len()]);
    let mut numbered = HashMap::new();
    for piece in &pieces {
        numbered.insert(piece.offset, finder.count);
        let mut records = Vec::new();
        // Whatever is wrong with it is reported when it is read in its turn.
        let _ = file.read(*piece, &wanted, &mut records);
        records.iter().for_each(|record| finder.add(record.topic, record.stamp));
    }
    let laps = finder.finish();
    for piece in &mut pieces {
        piece.lap = numbered.get(&piece.offset).map_or(0, |number| laps.first(*number));
    }
    let contents = file.contents_mut();
    (contents.laps, contents.numbered) = (laps, numbered);
    contents.begin(pieces);
}

/// Bytes in which a place is looked for at a time.
const SEARCHED: u64 = 1 << 20;
/// What is looked for is known by this many bytes.
const ENOUGH: u64 = 256;

/// The first place at `from` or later at which `is_it` holds of the bytes and their offset in the file.
pub(crate) fn next_place(file: &mut Bytes, from: u64, is_it: impl Fn(&[u8], u64) -> bool) -> Option<u64> {
    let mut at = from;
    while at < file.length {
        file.seek(at).ok()?;
        let window = file.take(SEARCHED.min(file.left())).ok()?;
        let is_last = at + window.len() as u64 >= file.length;
        // What begins near the end of the window is looked at in the next one.
        let begin = if is_last { window.len() } else { window.len().saturating_sub(ENOUGH as usize) };
        let found = (0..begin).find(|place| {
            let rest = &window[*place..];
            is_it(&rest[..rest.len().min(ENOUGH as usize)], at + *place as u64)
        });
        if let Some(place) = found {
            return Some(at + place as u64);
        }
        if is_last {
            return None;
        }
        at += begin as u64;
    }
    None
}

/// The first fault, and how many more there are; `None` without any.
pub(crate) fn some_of(faults: &[String]) -> Option<String> {
    let first = faults.first()?;
    Some(match faults.len() {
        1 => first.clone(),
        more => format!("{first}, and {} more", more - 1),
    })
}

/// First and last of a set of stamps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Span(pub(crate) Option<(Time, Time)>);

impl Span {
    pub(crate) fn add(&mut self, stamp: Time) {
        self.0 = Some(self.0.map_or((stamp, stamp), |(start, end)| (start.min(stamp), end.max(stamp))));
    }
}
