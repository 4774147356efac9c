//! The chunks of an MCAP file.

use std::{borrow::Cow, io::Read};

use roscausal_core::{ensure, memory::Growth};

use crate::source::Parsed;

/// More than any recorder writes into one chunk. A larger claim is damage.
const LARGEST: u64 = 1 << 30;

pub(crate) struct Chunk<'a> {
    size: u64,
    crc: u32,
    compression: &'a [u8],
    compressed_size: u64,
    data: &'a [u8],
}

impl<'a> Chunk<'a> {
    /// Parses the body of a chunk record, which may be cut short.
    pub(crate) fn parse(body: &'a [u8]) -> Parsed<Self> {
        let mut rest = body;
        let mut number = |size: usize| {
            let bytes = rest.split_off(..size).ok_or("its header is cut short")?;
            Ok::<_, String>(bytes.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte)))
        };
        let (_start, _end, size, crc) = (number(8)?, number(8)?, number(8)?, number(4)? as u32);
        let name = number(4)? as usize;
        let (compression, left) = rest.split_at_checked(name).ok_or("its header is cut short")?;
        let (compressed_size, data) = left.split_first_chunk::<8>().ok_or("its header is cut short")?;
        let compressed_size = u64::from_le_bytes(*compressed_size);
        let data = &data[..data.len().min(usize::try_from(compressed_size).unwrap_or(usize::MAX))];
        Ok(Self { size, crc, compression, compressed_size, data })
    }

    /// Whether `body` begins the body of a chunk record of `length` bytes: its own length and compression fit.
    pub(crate) fn fills(body: &'a [u8], length: u64) -> bool {
        let Ok(chunk) = Self::parse(body) else { return false };
        let header = 8 + 8 + 8 + 4 + 4 + chunk.compression.len() as u64 + 8;
        [&b""[..], b"zstd", b"lz4"].contains(&chunk.compression)
            && header.checked_add(chunk.compressed_size) == Some(length)
    }

    /// The records; of a chunk that is not `whole`, those that can be recovered.
    pub(crate) fn content(&self, whole: bool, growth: &mut Growth) -> Parsed<Cow<'a, [u8]>> {
        let packed = self.data.len() as u64;
        let most = growth.most(packed).min(LARGEST);
        ensure(self.size <= most, || format!("it claims a size of {} bytes", self.size))?;
        ensure(!whole || packed == self.compressed_size, || "it is shorter than it says")?;
        let mut content = Vec::new();
        let limit = self.size + 1;
        let unpacked = match self.compression {
            b"" => return self.checked(Cow::Borrowed(self.data), whole),
            b"zstd" => zstd::stream::read::Decoder::new(self.data)
                .and_then(|decoder| decoder.take(limit).read_to_end(&mut content)),
            b"lz4" => {
                lz4::Decoder::new(self.data).and_then(|decoder| decoder.take(limit).read_to_end(&mut content))
            }
            other => {
                let name = String::from_utf8_lossy(other);
                return Err(format!("its compression '{name}' is unknown (known: zstd, lz4, none)"));
            }
        };
        growth.count(packed, content.len() as u64);
        if let (true, Err(error)) = (whole, unpacked) {
            return Err(format!("it cannot be decompressed: {error}"));
        }
        self.checked(Cow::Owned(content), whole)
    }

    fn checked(&self, content: Cow<'a, [u8]>, whole: bool) -> Parsed<Cow<'a, [u8]>> {
        ensure(!whole || content.len() as u64 == self.size, || "it has not the size it should have")?;
        let sound = !whole || self.crc == 0 || crc32fast::hash(&content) == self.crc;
        ensure(sound, || "its checksum is wrong")?;
        Ok(content)
    }
}

/// Calls `each` with opcode and body of every complete record.
pub(crate) fn records(mut content: &[u8], mut each: impl FnMut(u8, &[u8]) -> Parsed<()>) -> Parsed<()> {
    while let Some(([opcode, length @ ..], rest)) = content.split_first_chunk::<9>() {
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
        let (body, rest) = rest.split_at_checked(length).ok_or("it is cut within a record")?;
        each(*opcode, body)?;
        content = rest;
    }
    if content.is_empty() { Ok(()) } else { Err("it is cut within a record".into()) }
}
