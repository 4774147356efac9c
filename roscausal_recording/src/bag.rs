//! ROS 1 bags, version 2.0 (wiki.ros.org/Bags/Format/2.0). They are read here, because the crate `rosbag` panics on
//! bags that were cut short or never closed.

use std::{collections::BTreeMap, io::Read, path::Path};

use roscausal_core::{Result, Time, ensure};

use crate::{
    source::{Contents, Format, Parsed, Piece, Span, find_laps, next_place, some_of},
    topic::{Encoding, Record, Topic, Topics, type_name},
};

const MAGIC_LENGTH: u64 = "#ROSBAG V2.0\n".len() as u64;
/// More than any recorder writes into one chunk. A larger claim is damage.
const LARGEST_CHUNK: u64 = 1 << 30;

/// A record's `op` field.
mod op {
    pub(super) const MESSAGE: u8 = 2;
    pub(super) const BAG_HEADER: u8 = 3;
    pub(super) const CHUNK: u8 = 5;
    pub(super) const CHUNK_INFO: u8 = 6;
    pub(super) const CONNECTION: u8 = 7;
}

pub(crate) struct Bag(Contents);

impl Bag {
    pub(crate) fn open(path: &Path, losses: &mut Vec<String>) -> Result<Self> {
        let mut bag = Self(Contents::open(path)?);
        if let Err(reason) = bag.read_index() {
            bag.0.topics = Topics::default();
            bag.0.numbers.clear();
            let end = bag.scan().map_or(String::new(), |fault| format!("; what is whole was read: {fault}"));
            losses.push(format!("{}: the bag has no valid index ({reason}){end}", path.display()));
        }
        find_laps(&mut bag);
        Ok(bag)
    }

    /// Topics and chunks from the index at the end of a closed bag.
    fn read_index(&mut self) -> Parsed<()> {
        self.0.seek(MAGIC_LENGTH)?;
        let header = self.header()?;
        ensure(header.op() == Some(op::BAG_HEADER), || "the bag header is missing")?;
        let index = header.u64("index_pos").filter(|index| *index > 0).ok_or("it was never closed")?;
        if index > self.0.file.length {
            return Err(format!("the file ends at byte {} of {index} and more", self.0.file.length));
        }
        let (connections, chunks) = (header.u32("conn_count"), header.u32("chunk_count"));
        self.0.seek(index)?;
        let (mut pieces, mut counts) = (Vec::new(), BTreeMap::new());
        let mut found = 0;
        while self.0.file.left() > 0 {
            let header = self.header()?;
            let data = self.block()?;
            match header.op() {
                Some(op::CONNECTION) => {
                    self.add_connection(&header, &data)?;
                    found += 1;
                }
                Some(op::CHUNK_INFO) => {
                    let offset = header.u64("chunk_pos").filter(|offset| *offset < index);
                    let offset = offset.ok_or("a chunk's place is not in the file")?;
                    let (start, end) = (header.time("start_time"), header.time("end_time"));
                    let (start, end) = start.zip(end).ok_or("a chunk has no time")?;
                    pieces.push(Piece { offset, length: 0, start, end, cut: false, lap: 0 });
                    for pair in data.chunks_exact(8) {
                        let [connection, count] = [&pair[..4], &pair[4..]].map(u32_le);
                        *counts.entry(connection).or_insert(0u64) += u64::from(count);
                    }
                }
                _ => return Err(format!("an unexpected record before byte {}", self.0.file.offset)),
            }
        }
        let whole = connections.is_none_or(|count| count == found)
            && chunks.is_none_or(|count| count as usize == pieces.len());
        ensure(whole, || "connections or chunks are missing from it")?;
        self.0.count(counts);
        self.0.begin(pieces);
        Ok(())
    }

    /// Topics and chunks from the chunks themselves. Returns what is wrong, if anything.
    fn scan(&mut self) -> Option<String> {
        let (mut scan, mut start) = (Scan::default(), MAGIC_LENGTH);
        // Whatever is damaged, the next chunk begins anew.
        while let Err(fault) = self.scan_from(start, &mut scan) {
            scan.faults.push(fault);
            let Some(offset) = self.next_chunk(self.0.file.offset.max(start + 1)) else { break };
            start = offset;
        }
        self.0.count(scan.counts);
        self.0.begin(scan.pieces);
        some_of(&scan.faults)
    }

    /// Reads records from `start` on. A chunk that is damaged is a fault, and the next one is read.
    ///
    /// # Errors
    /// Why there is no next record.
    fn scan_from(&mut self, start: u64, scan: &mut Scan) -> Parsed<()> {
        self.0.seek(start)?;
        while self.0.file.left() > 0 {
            let offset = self.0.file.offset;
            let header = self.header()?;
            match header.op() {
                Some(op::CHUNK) => {
                    let length = u64::from(self.length()?);
                    let begin = self.0.file.offset;
                    let next = begin.saturating_add(length);
                    let whole = next <= self.0.file.length;
                    // Its length may be the damage.
                    if whole || self.next_chunk(begin).is_none() {
                        self.0.seek(begin)?;
                        self.scan_chunk((offset, length), &header, scan);
                    }
                    self.0.seek(if whole { next } else { begin })?;
                    ensure(whole, || format!("it ends within the chunk at byte {offset}"))?;
                }
                Some(op::CONNECTION) => {
                    let data = self.block()?;
                    self.add_connection(&header, &data)?;
                }
                Some(_) => {
                    let length = u64::from(self.length()?);
                    let left = self.0.file.left();
                    ensure(length <= left, || format!("it ends within the record at byte {offset}"))?;
                    self.0.seek(self.0.file.offset + length)?;
                }
                None => return Err(format!("there is no record at byte {offset}")),
            }
        }
        Ok(())
    }

    fn scan_chunk(&mut self, (offset, length): (u64, u64), header: &Fields, scan: &mut Scan) {
        let (chunk, mut fault) = match self.chunk(offset, length, header) {
            Ok(chunk) => chunk,
            Err(fault) => return scan.faults.push(fault),
        };
        let mut span = Span::default();
        let parsed = records(&chunk, |header, data| {
            match header.op() {
                Some(op::CONNECTION) => self.add_connection(header, data)?,
                Some(op::MESSAGE) => {
                    let (connection, stamp) = header.message()?;
                    span.add(stamp);
                    *scan.counts.entry(connection).or_insert(0) += 1;
                }
                _ => (),
            }
            Ok(())
        });
        if let Err(reason) = parsed {
            fault.get_or_insert(format!("the chunk at byte {offset}: {reason}"));
        }
        if let Some((start, end)) = span.0 {
            scan.pieces.push(Piece { offset, length: 0, start, end, cut: fault.is_some(), lap: 0 });
        }
        scan.faults.extend(fault);
    }

    /// Where the next chunk begins, at `from` or later, if there is one.
    fn next_chunk(&mut self, from: u64) -> Option<u64> {
        next_place(&mut self.0.file, from, |bytes, _| is_chunk(bytes))
    }

    fn add_connection(&mut self, header: &Fields<impl AsRef<[u8]>>, data: &[u8]) -> Parsed<()> {
        let fields = Fields(data);
        let connection = header.u32("conn").ok_or("a connection has no number")?;
        let name = header.text("topic").or(fields.text("topic")).ok_or("a connection has no topic")?;
        let recorded_type = fields.text("type").ok_or("a connection has no type")?;
        let topic = Topic {
            name,
            type_name: type_name(&recorded_type),
            encoding: Encoding::Ros1,
            md5: fields.text("md5sum").filter(|md5| md5 != "*"),
            definition: fields.text("message_definition").unwrap_or_default().into(),
            latched: fields.get("latching") == Some(b"1"),
            messages: None,
        };
        self.0.add(connection, topic);
        Ok(())
    }

    /// The content of the chunk whose header has been read, and what is wrong with it. A chunk that is cut short by
    /// the file or the compression is returned as far as it goes.
    fn chunk(&mut self, offset: u64, length: u64, header: &Fields) -> Parsed<(Vec<u8>, Option<String>)> {
        let left = self.0.file.left();
        let mut fault = (length > left).then(|| format!("it ends within the chunk at byte {offset}"));
        let data = self.0.piece(length.min(left))?;
        let packed = data.len() as u64;
        let most = self.0.growth.most(packed).min(LARGEST_CHUNK);
        let size = header.u32("size").map(u64::from).filter(|size| *size <= most);
        let size = size.ok_or_else(|| format!("the chunk at byte {offset} has no valid size"))?;
        let mut content = Vec::new();
        let read = match header.get("compression") {
            Some(b"none") => {
                content = data;
                Ok(0)
            }
            Some(b"bz2") => {
                bzip2::read::BzDecoder::new(data.as_slice()).take(size + 1).read_to_end(&mut content)
            }
            Some(b"lz4") => lz4::Decoder::new(data.as_slice())
                .and_then(|decoder| decoder.take(size + 1).read_to_end(&mut content)),
            _ => return Err(format!("the chunk at byte {offset} has an unknown compression")),
        };
        if let Err(error) = read {
            fault.get_or_insert(format!("the chunk at byte {offset} cannot be decompressed: {error}"));
        } else if content.len() as u64 != size {
            fault.get_or_insert(format!("the chunk at byte {offset} has not the size it should have"));
        }
        self.0.growth.count(packed, content.len() as u64);
        Ok((content, fault))
    }

    fn length(&mut self) -> Parsed<u32> {
        let offset = self.0.file.offset;
        let bytes = self.0.file.array().map_err(|_| format!("it ends at byte {offset}, within a record"))?;
        Ok(u32::from_le_bytes(bytes))
    }

    fn block(&mut self) -> Parsed<Vec<u8>> {
        let offset = self.0.file.offset;
        let length = self.length()?;
        self.0.file.take(u64::from(length)).map_err(|_| format!("it ends within the record at byte {offset}"))
    }

    fn header(&mut self) -> Parsed<Fields<Vec<u8>>> {
        self.block().map(Fields)
    }
}

/// What the chunks of a bag hold.
#[derive(Default)]
struct Scan {
    pieces: Vec<Piece>,
    /// Messages of each connection.
    counts: BTreeMap<u32, u64>,
    faults: Vec<String>,
}

impl Format for Bag {
    fn contents(&self) -> &Contents {
        &self.0
    }

    fn contents_mut(&mut self) -> &mut Contents {
        &mut self.0
    }

    fn read(&mut self, piece: Piece, wanted: &[bool], out: &mut Vec<Record>) -> Parsed<()> {
        self.0.seek(piece.offset)?;
        let header = self.header()?;
        ensure(header.op() == Some(op::CHUNK), || "there is no chunk")?;
        let length = u64::from(self.length()?);
        let (chunk, fault) = self.chunk(piece.offset, length, &header)?;
        let mut unknown = None;
        let parsed = records(&chunk, |header, data| {
            if header.op() != Some(op::MESSAGE) {
                return Ok(());
            }
            let (connection, stamp) = header.message()?;
            // A message of a topic that is not known does not end the chunk.
            let taken = self.0.take((connection, stamp, data), wanted, out);
            unknown = unknown.take().or(taken.err());
            Ok(())
        });
        parsed.and(fault.or(unknown).map_or(Ok(()), Err))
    }
}

/// Calls `each` for every complete record in the content of a chunk.
fn records(mut content: &[u8], mut each: impl FnMut(&Fields<&[u8]>, &[u8]) -> Parsed<()>) -> Parsed<()> {
    while !content.is_empty() {
        let header = block(&mut content)?;
        each(&Fields(header), block(&mut content)?)?;
    }
    Ok(())
}

/// Whether these bytes begin with the header of a chunk.
fn is_chunk(bytes: &[u8]) -> bool {
    let (mut rest, field) = (bytes, b"op=\x05");
    let Ok(header) = block(&mut rest) else { return false };
    let header = Fields(header);
    header.0.windows(field.len()).any(|window| window == field)
        && header.op() == Some(op::CHUNK)
        && header.u32("size").is_some()
        && header.get("compression").is_some()
}

fn block<'a>(content: &mut &'a [u8]) -> Parsed<&'a [u8]> {
    let cut = || "it is cut within a record".to_owned();
    let length = content.split_off(..4).ok_or_else(cut)?;
    content.split_off(..u32_le(length) as usize).ok_or_else(cut)
}

fn u32_le(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte))
}

/// The header of a record: repeated `length name=value`.
struct Fields<B = Vec<u8>>(B);

impl<B: AsRef<[u8]>> Fields<B> {
    fn get(&self, name: &str) -> Option<&[u8]> {
        let mut content = self.0.as_ref();
        while let Ok(field) = block(&mut content) {
            let Some(value) = field.strip_prefix(name.as_bytes()) else { continue };
            if let Some(value) = value.strip_prefix(b"=") {
                return Some(value);
            }
        }
        None
    }

    fn op(&self) -> Option<u8> {
        self.get("op")?.first().copied()
    }

    fn u32(&self, name: &str) -> Option<u32> {
        self.get(name).filter(|value| value.len() == 4).map(u32_le)
    }

    fn u64(&self, name: &str) -> Option<u64> {
        Some(u64::from_le_bytes(*self.get(name)?.first_chunk::<8>()?))
    }

    fn time(&self, name: &str) -> Option<Time> {
        let value = self.u64(name)?;
        let (sec, nanosec) = (value as u32, (value >> 32) as u32);
        Some(Time::from_nanos(i64::from(sec) * 1_000_000_000 + i64::from(nanosec)))
    }

    fn text(&self, name: &str) -> Option<String> {
        self.get(name).map(|value| String::from_utf8_lossy(value).into_owned())
    }

    fn message(&self) -> Parsed<(u32, Time)> {
        self.u32("conn").zip(self.time("time")).ok_or_else(|| "a message has no connection or time".into())
    }
}
