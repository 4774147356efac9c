//! A place in the bytes of a message, and how to pass what stands there.

use super::{
    Wire,
    schema::{Array, Field, Kind, Schema, Struct, width},
};
use crate::wire::Fault;

/// Most bytes after the last field.
const PADDING: usize = 3;

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
    form: Form,
}

/// What differs between the versions of CDR, and between those who write them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Form {
    /// Numbers are aligned to their size, at most to this.
    align: usize,
    /// Which types begin with their length in bytes (a DHEADER).
    delimited: Delimited,
    /// Whether arrays of other things than numbers do.
    arrays: bool,
    /// Bytes of a unit of the length of a wide text.
    wide: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Delimited {
    Nothing,
    Outermost,
    All,
}

impl Form {
    const CDR: Self = Self { align: 8, delimited: Delimited::Nothing, arrays: false, wide: 4 };

    /// The forms of a representation, the standard's first (OMG DDS-XTypes 1.3, 7.4.3). Others leave out lengths that it demands, and
    /// each vendor has its own wide texts.
    fn all(representation: u16, has_wide: bool) -> Result<Vec<Self>, Fault> {
        let second = |delimited: &[Delimited]| {
            let form = |delimited, arrays| Self { align: 4, delimited, arrays, wide: 1 };
            delimited.iter().flat_map(|one| [form(*one, true), form(*one, false)]).collect::<Vec<_>>()
        };
        let forms = match representation {
            0 | 1 => vec![Self::CDR],
            6 | 7 => second(&[Delimited::Nothing]),
            8 | 9 => second(&[Delimited::All, Delimited::Outermost]),
            other => return Err(Fault::Representation(other)),
        };
        let widths: &[usize] = if has_wide { &[1, 2, 4] } else { &[4] };
        Ok(forms
            .into_iter()
            .flat_map(|form| widths.iter().map(move |wide| Self { wide: *wide, ..form }))
            .collect())
    }
}

impl<'a> Cursor<'a> {
    /// Stands at the first field of a message. Where its form is not certain, it is the first one in which the message is whole.
    ///
    /// # Errors
    /// A representation that is not read, or a message in none of its forms.
    pub(super) fn new(schema: &'a Schema, wire: Wire, bytes: &'a [u8]) -> Result<Self, Fault> {
        let mut cursor =
            Self { schema, bytes, at: 0, origin: 0, cdr: false, big_endian: false, form: Form::CDR };
        if wire == Wire::Ros1 {
            return Ok(cursor);
        }
        let start = cursor.take(4)?;
        let representation = u16::from_be_bytes([start[0], start[1]]);
        (cursor.origin, cursor.cdr) = (4, true);
        cursor.big_endian = representation.is_multiple_of(2);
        let mut forms = Form::all(representation, schema.has_wide)?.into_iter();
        if forms.len() == 1 {
            return Ok(cursor);
        }
        let mut fault = None;
        let fits = forms.find(|form| {
            let mut trial = Self { form: *form, ..cursor.clone() };
            match trial.pass(Kind::Struct(0), Array::One) {
                Ok(()) if trial.left() <= PADDING => return true,
                Ok(()) => fault.get_or_insert(Fault::Trailing { left: trial.left() }),
                Err(reason) => fault.get_or_insert(reason),
            };
            false
        });
        match (fits, fault) {
            (Some(form), _) => Ok(Self { form, ..cursor }),
            (None, fault) => Err(fault.unwrap_or(Fault::Representation(representation))),
        }
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
            let padding = (self.at - self.origin).wrapping_neg() % size.min(self.form.align);
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
        if array != Array::One && self.has_length(kind) {
            self.length(1)?;
        }
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

    /// Whether an array of such elements begins with its length in bytes.
    fn has_length(&self, kind: Kind) -> bool {
        self.form.arrays
            && matches!(kind, Kind::Struct(_) | Kind::Time | Kind::Duration | Kind::Text | Kind::WideText)
    }

    /// Enters a type: returns where it ends, if its length stands before it.
    ///
    /// # Errors
    /// A length beyond the message.
    pub(super) fn enter(&mut self, kind: Kind) -> Result<Option<usize>, Fault> {
        let is_type = matches!(kind, Kind::Struct(_) | Kind::Time | Kind::Duration);
        let has_length = match self.form.delimited {
            Delimited::Nothing => false,
            Delimited::Outermost => self.at == self.origin && kind == Kind::Struct(0),
            Delimited::All => is_type,
        };
        if !has_length {
            return Ok(None);
        }
        let length = self.length(1)?;
        Ok(Some(self.at + length as usize))
    }

    /// Leaves a type that [`enter`](Self::enter) entered. A later version of it may have more fields than are known here.
    pub(super) fn leave(&mut self, end: Option<usize>) -> Result<(), Fault> {
        match end {
            Some(end) if end < self.at => {
                Err(Fault::Truncated { offset: end, needed: self.at - end, left: 0 })
            }
            Some(end) => {
                self.at = end;
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// Passes a field with all its elements.
    pub(super) fn pass(&mut self, kind: Kind, array: Array) -> Result<(), Fault> {
        let begins_with_length = array != Array::One && self.has_length(kind);
        let end = if begins_with_length { self.peek_end()? } else { None };
        let count = self.count(kind, array)?;
        self.pass_elements(kind, count)?;
        match end {
            Some(end) if end != self.at => Err(Fault::Trailing { left: end.abs_diff(self.at) }),
            _ => Ok(()),
        }
    }

    /// Passes fields that follow each other.
    pub(super) fn pass_all(&mut self, fields: &[Field]) -> Result<(), Fault> {
        fields.iter().try_for_each(|field| self.pass(field.kind, field.array))
    }

    /// Where an array ends whose length in bytes comes next.
    fn peek_end(&self) -> Result<Option<usize>, Fault> {
        let mut ahead = self.clone();
        let length = ahead.length(1)?;
        Ok(Some(ahead.at + length as usize))
    }

    /// Passes `count` elements. Numbers are passed at once, however many.
    /// So is what takes no bytes, however deep it is nested.
    pub(super) fn pass_elements(&mut self, kind: Kind, count: u32) -> Result<(), Fault> {
        if count == 0 || self.least(kind) == 0 {
            return Ok(());
        }
        match kind {
            Kind::Struct(place) => (0..count).try_for_each(|_| self.pass_struct(place)),
            Kind::Text => (0..count).try_for_each(|_| self.text().map(|_| ())),
            Kind::WideText => (0..count).try_for_each(|_| {
                let length = self.unsigned(4)?;
                let needed = usize::try_from(length).unwrap_or(usize::MAX).saturating_mul(self.form.wide);
                self.take(needed).map(|_| ())
            }),
            Kind::Time | Kind::Duration if self.form.delimited == Delimited::All => {
                (0..count).try_for_each(|_| self.number(kind).map(|_| ()))
            }
            kind => {
                let size = usize::from(width(kind));
                self.align(if size == 8 && matches!(kind, Kind::Time | Kind::Duration) { 4 } else { size });
                self.take(size.saturating_mul(count as usize)).map(|_| ())
            }
        }
    }

    fn pass_struct(&mut self, place: usize) -> Result<(), Fault> {
        let schema = self.schema;
        let fields = &schema.types[place].fields;
        let end = self.enter(Kind::Struct(place))?;
        if fields.is_empty() && self.cdr {
            self.take(1)?;
        }
        self.pass_all(fields)?;
        self.leave(end)
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
            Kind::Bool => f64::from(self.unsigned(1)? != 0),
            Kind::Unsigned(size) => self.unsigned(usize::from(size))? as f64,
            Kind::Signed(size) => {
                let unused = 64 - 8 * u32::from(size);
                ((self.unsigned(usize::from(size))? << unused) as i64 >> unused) as f64
            }
            Kind::Float(4) => f64::from(f32::from_bits(self.unsigned(4)? as u32)),
            Kind::Float(_) => f64::from_bits(self.unsigned(8)?),
            Kind::Time | Kind::Duration => {
                self.enter(kind)?;
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
        self.enter(Kind::Time)?;
        self.plain_time()
    }

    fn plain_time(&mut self) -> Result<crate::Time, Fault> {
        let seconds = self.unsigned(4)? as u32;
        let nanos = self.unsigned(4)? as u32;
        let seconds = if self.cdr { i64::from(seconds as i32) } else { i64::from(seconds) };
        Ok(crate::Time::from_nanos(seconds * 1_000_000_000 + i64::from(nanos)))
    }

    /// Passes a field, and collects where the stamps of its headers stand, with their values.
    pub(super) fn stamps(
        &mut self,
        kind: Kind,
        array: Array,
        out: &mut Vec<(usize, crate::Time)>,
    ) -> Result<(), Fault> {
        let Kind::Struct(place) = kind else { return self.pass(kind, array) };
        let count = self.count(kind, array)?;
        if self.least(kind) == 0 {
            return Ok(());
        }
        let schema = self.schema;
        let Struct { name, fields, .. } = &schema.types[place];
        for _ in 0..count {
            let end = self.enter(kind)?;
            if fields.is_empty() && self.cdr {
                self.take(1)?;
            }
            for Field { name: field, kind, array } in fields {
                if name == "std_msgs/Header"
                    && field == "stamp"
                    && *kind == Kind::Time
                    && *array == Array::One
                {
                    self.enter(*kind)?;
                    self.align(4);
                    let at = self.at;
                    out.push((at, self.plain_time()?));
                } else {
                    self.stamps(*kind, *array, out)?;
                }
            }
            self.leave(end)?;
        }
        Ok(())
    }

    /// Appends the next field to `out` as the first version of CDR writes it.
    fn rewrite(&mut self, kind: Kind, array: Array, out: &mut Vec<u8>) -> Result<(), Fault> {
        let count = self.count(kind, array)?;
        if array == Array::Any {
            self.put(count, out);
        }
        if count == 0 || self.least(kind) == 0 {
            return Ok(());
        }
        for _ in 0..if kind.is_plain() { 1 } else { count } {
            match kind {
                Kind::Struct(place) => {
                    let end = self.enter(kind)?;
                    let schema = self.schema;
                    let fields = &schema.types[place].fields;
                    if fields.is_empty() {
                        out.extend(self.take(1)?);
                    }
                    fields.iter().try_for_each(|field| self.rewrite(field.kind, field.array, out))?;
                    self.leave(end)?;
                }
                Kind::Text => {
                    let length = self.length(1)?;
                    self.put(length, out);
                    out.extend(self.take(length as usize)?);
                }
                Kind::Time | Kind::Duration => {
                    self.enter(kind)?;
                    for _ in 0..2 {
                        let half = self.unsigned(4)? as u32;
                        self.put(half, out);
                    }
                }
                Kind::WideText => return Err(Fault::Unsupported("a wstring")),
                // All numbers of an array at once.
                kind => {
                    let size = usize::from(width(kind));
                    self.align(size);
                    pad(out, size);
                    out.extend(self.take(size.saturating_mul(count as usize))?);
                }
            }
        }
        Ok(())
    }

    /// Appends a number of 4 bytes in the byte order of the message.
    fn put(&self, value: u32, out: &mut Vec<u8>) {
        pad(out, 4);
        out.extend(if self.big_endian { value.to_be_bytes() } else { value.to_le_bytes() });
    }
}

/// Pads to a multiple of `size`, counted from the first field.
fn pad(out: &mut Vec<u8>, size: usize) {
    let padding = (out.len() - 4).wrapping_neg() % size;
    out.resize(out.len() + padding, 0);
}

/// A message of the second version of CDR (XCDR2) as the first writes it.
///
/// # Errors
/// Bytes that are no message of this schema.
pub(crate) fn as_first_version(schema: &Schema, bytes: &[u8]) -> Result<Vec<u8>, Fault> {
    let mut cursor = Cursor::new(schema, Wire::Cdr, bytes)?;
    let mut out = vec![0, u8::from(!cursor.big_endian), 0, 0];
    cursor.rewrite(Kind::Struct(0), Array::One, &mut out)?;
    match cursor.left() {
        left if left > PADDING => Err(Fault::Trailing { left }),
        _ => Ok(out),
    }
}
