use roscausal_core::Time;

use crate::topic::{Record, Topic};

/// A file that is read piece by piece.
pub(crate) trait Source: Send {
    fn topics(&self) -> &[Topic];

    /// Nothing that is still to come is earlier; `None` at the end.
    fn next_start(&self) -> Option<Time>;

    /// Reads the next piece: its messages of the topics wanted, in any order.
    ///
    /// # Errors
    /// What was lost and where, in one sentence; what is whole is in `out` all the same.
    fn load(&mut self, wanted: &[bool], out: &mut Vec<Record>) -> Result<(), String>;

    /// Time of the first and of the last message, when known without reading all.
    fn span(&self) -> Option<(Time, Time)>;

    /// How much has been read, from 0 to 1.
    fn progress(&self) -> f64;
}

/// A piece of a file: where it is, and when its messages were recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub(crate) offset: u64,
    pub(crate) length: u64,
    pub(crate) start: Time,
    pub(crate) end: Time,
    /// What of it the file still has.
    pub(crate) cut: bool,
}

/// The pieces of a file in the order of their messages.
#[derive(Debug, Default)]
pub(crate) struct Pieces {
    pieces: Vec<Piece>,
    next: usize,
}

impl Pieces {
    pub(crate) fn new(mut pieces: Vec<Piece>) -> Self {
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

/// First and last of some stamps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Span(pub(crate) Option<(Time, Time)>);

impl Span {
    pub(crate) fn add(&mut self, stamp: Time) {
        self.0 = Some(self.0.map_or((stamp, stamp), |(start, end)| (start.min(stamp), end.max(stamp))));
    }
}
