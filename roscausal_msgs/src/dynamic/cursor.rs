//! A place in the bytes of a message, and how to pass what stands there.

use super::{
    Wire,
    schema::{Array, Kind, Schema, width},
};
use crate::wire::Fault;

/// Reads a message from its first byte on.
#[derive(Clone, Debug)]
pub(super) struct Cursor<'a> {
    schema: &'a Schema,
    bytes: &'a [u8],
    at: usize,
    /// Where the fields begin: CDR aligns numbers from there.
    origin: usize,
    cdr: bool,
    big_endian: bool,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(schema: &'a Schema, wire: Wire, bytes: &'a [u8]) -> Result<Self, Fault> {
        let mut cursor = Self { schema, bytes, at: 0, origin: 0, cdr: false, big_endian: false };
        if wire == Wire::Cdr {
            let start = cursor.take(4)?;
            cursor.big_endian = match u16::from_be_bytes([start[0], start[1]]) {
                0 => true,
                1 => false,
                other => return Err(Fault::Representation(other)),
            };
            (cursor.origin, cursor.cdr) = (4, true);
        }
        Ok(cursor)
    }

    fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        let fault = Fault::Truncated { offset: self.at, needed: count, left: self.left() };
        let taken = self.bytes.get(self.at..).and_then(|rest| rest.get(..count)).ok_or(fault)?;
        self.at += count;
        Ok(taken)
    }

    /// Passes the padding before something that is aligned to `size`. The last of a message may lack it.
    fn align(&mut self, size: usize) {
        if self.cdr {
            let padding = (self.at - self.origin).wrapping_neg() % size;
            self.at = (self.at + padding).min(self.bytes.len());
        }
    }

    fn unsigned(&mut self, size: usize) -> Result<u64, Fault> {
        self.align(size);
        let big_endian = self.big_endian;
        let bytes = self.take(size)?;
        let join = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
        Ok(if big_endian { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) })
    }

    /// Length of a sequence whose elements take at least `least` bytes each.
    fn length(&mut self, least: u64) -> Result<u32, Fault> {
        let offset = self.at;
        let length = self.unsigned(4)? as u32;
        if u64::from(length).saturating_mul(least) > self.left() as u64 {
            return Err(Fault::Length { offset, length, left: self.left() });
        }
        Ok(length)
    }

    /// The least bytes of one value.
    pub(super) fn least(&self, kind: Kind) -> u64 {
        match kind {
            Kind::Struct(place) => self.schema.types[place].least[usize::from(self.cdr)],
            kind => u64::from(width(kind)),
        }
    }

    /// The number of elements of a field: for a sequence, as the message says.
    pub(super) fn count(&mut self, kind: Kind, array: Array) -> Result<u32, Fault> {
        match array {
            Array::One => Ok(1),
            Array::Any => self.length(self.least(kind)),
            Array::Fixed(count) => {
                let needed = self.least(kind).saturating_mul(u64::from(count));
                let left = self.left();
                if needed > left as u64 {
                    let needed = usize::try_from(needed).unwrap_or(usize::MAX);
                    return Err(Fault::Truncated { offset: self.at, needed, left });
                }
                Ok(count)
            }
        }
    }

    /// Passes a field with all its elements.
    pub(super) fn pass(&mut self, kind: Kind, array: Array) -> Result<(), Fault> {
        let count = self.count(kind, array)?;
        self.pass_elements(kind, count)
    }

    /// Passes `count` elements. Numbers are passed at once, however many.
    /// So is what takes no bytes, however deep it is nested.
    pub(super) fn pass_elements(&mut self, kind: Kind, count: u32) -> Result<(), Fault> {
        if count == 0 || self.least(kind) == 0 {
            return Ok(());
        }
        match kind {
            Kind::Struct(place) => {
                for _ in 0..count {
                    self.pass_struct(place)?;
                }
                Ok(())
            }
            Kind::Text => {
                for _ in 0..count {
                    self.text()?;
                }
                Ok(())
            }
            Kind::WideText => Err(Fault::Unsupported("a wstring, which this program cannot read past,")),
            kind => {
                let size = usize::from(width(kind));
                self.align(if size == 8 && matches!(kind, Kind::Time | Kind::Duration) { 4 } else { size });
                let needed = size.saturating_mul(count as usize);
                self.take(needed).map(|_| ())
            }
        }
    }

    fn pass_struct(&mut self, place: usize) -> Result<(), Fault> {
        let schema = self.schema;
        let fields = &schema.types[place].fields;
        if fields.is_empty() && self.cdr {
            return self.take(1).map(|_| ());
        }
        fields.iter().try_for_each(|field| self.pass(field.kind, field.array))
    }

    /// A text, without the NUL that ends it in CDR.
    pub(super) fn text(&mut self) -> Result<&'a [u8], Fault> {
        let length = self.length(1)?;
        let bytes = self.take(length as usize)?;
        Ok(if self.cdr { bytes.strip_suffix(&[0]).unwrap_or(bytes) } else { bytes })
    }

    /// One built-in value as a number.
    pub(super) fn number(&mut self, kind: Kind) -> Result<f64, Fault> {
        Ok(match kind {
            Kind::Bool => f64::from(u8::from(self.unsigned(1)? != 0)),
            Kind::Unsigned(size) => self.unsigned(usize::from(size))? as f64,
            Kind::Signed(size) => {
                let unused = 64 - 8 * u32::from(size);
                ((self.unsigned(usize::from(size))? << unused) as i64 >> unused) as f64
            }
            Kind::Float(4) => f64::from(f32::from_bits(self.unsigned(4)? as u32)),
            Kind::Float(_) => f64::from_bits(self.unsigned(8)?),
            Kind::Time | Kind::Duration => {
                let seconds = self.unsigned(4)? as u32;
                let nanos = self.unsigned(4)? as u32;
                // ROS 1's moments have no sign, all others have.
                let is_signed = self.cdr || kind == Kind::Duration;
                let seconds = if is_signed { f64::from(seconds as i32) } else { f64::from(seconds) };
                // ROS 1's durations have signed nanoseconds.
                let nanos = if kind == Kind::Duration { f64::from(nanos as i32) } else { f64::from(nanos) };
                seconds + nanos / 1e9
            }
            Kind::Text | Kind::WideText | Kind::Struct(_) => {
                return Err(Fault::Unsupported("a number that is none"));
            }
        })
    }

    /// Seconds and nanoseconds of a moment.
    pub(super) fn time(&mut self) -> Result<crate::Time, Fault> {
        let seconds = self.unsigned(4)? as u32;
        let nanos = self.unsigned(4)? as u32;
        let seconds = if self.cdr { i64::from(seconds as i32) } else { i64::from(seconds) };
        Ok(crate::Time::from_nanos(seconds * 1_000_000_000 + i64::from(nanos)))
    }
}
