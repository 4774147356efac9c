//! Records of an MCAP file. The crate `mcap` allocates what the lengths in a record claim before it checks that the
//! record is that long. So the lengths are checked here first.

use mcap::{
    read::parse_record,
    records::{Record, op},
};
use roscausal_core::ensure;

use crate::source::Parsed;

/// A part of a record, as far as lengths are concerned.
#[derive(Clone, Copy)]
enum Part {
    /// A fixed number of bytes.
    Bytes(usize),
    /// A length of four bytes, followed by that many bytes: a string, an array, a map of numbers.
    Sized,
    /// A length of four bytes, followed by a map of strings in that many bytes.
    Strings,
}

/// The parts of a record up to its last length (mcap.dev/spec, Records).
fn parts(opcode: u8) -> &'static [Part] {
    use Part::{Bytes, Sized, Strings};
    match opcode {
        op::SCHEMA => &[Bytes(2), Sized, Sized, Sized],
        op::CHANNEL => &[Bytes(2 + 2), Sized, Sized, Strings],
        op::CHUNK_INDEX => &[Bytes(4 * 8), Sized, Bytes(8), Sized],
        op::METADATA => &[Sized, Strings],
        op::METADATA_INDEX => &[Bytes(2 * 8), Sized],
        op::STATISTICS => &[Bytes(8 + 2 + 4 * 4 + 2 * 8), Sized],
        _ => &[],
    }
}

/// Parses a record.
///
/// # Errors
/// Why it is not a record.
pub(crate) fn parse(opcode: u8, body: &[u8]) -> Parsed<Record<'_>> {
    ensure(lengths_hold(parts(opcode), body), || "a record claims to be longer than it is")?;
    parse_record(opcode, body).map_err(|error| error.to_string())
}

fn lengths_hold(parts: &[Part], mut rest: &[u8]) -> bool {
    parts.iter().all(|part| match *part {
        Part::Bytes(size) => rest.split_off(..size).is_some(),
        Part::Sized => sized(&mut rest).is_some(),
        Part::Strings => sized(&mut rest).is_some_and(|mut strings| {
            while sized(&mut strings).is_some() {}
            strings.is_empty()
        }),
    })
}

/// Takes as many bytes as its length says.
fn sized<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, left) = rest.split_first_chunk()?;
    let (bytes, left) = left.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    *rest = left;
    Some(bytes)
}
