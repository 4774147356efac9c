//! MCAP files (mcap.dev/spec) of either ROS version. The crate `mcap` parses records. Finding records and unpacking
//! chunks is done here, so that damaged files are used as far as they are intact and no length is trusted.

use std::{collections::HashMap, path::Path, sync::Arc};

use mcap::records::{Channel, ChunkIndex, Record as McapRecord, Statistics, op};
use roscausal_core::{Result, Time, ensure};

use crate::{
    chunk::{Chunk, records},
    mcap_record::parse,
    source::{Contents, Format, Parsed, Piece, Span, find_laps, next_place, some_of},
    topic::{Encoding, Record, Topic, type_name},
};

/// Messages outside chunks are read in pieces of about this size.
const PLAIN_PIECE: u64 = 1 << 20;
/// A longer name of a type is damage, bytes.
const LONGEST_NAME: usize = 1000;
/// Length of opcode and length before a record.
const RECORD_HEADER: u64 = 9;
/// Length of the footer with its header.
const FOOTER: u64 = RECORD_HEADER + 8 + 8 + 4;
/// Length of a message record before its bytes: channel, sequence, log time, publish time.
const MESSAGE_HEADER: usize = 2 + 4 + 8 + 8;

pub(crate) struct McapFile {
    contents: Contents,
    /// Name and text of each type.
    schemas: HashMap<u16, (String, Arc<str>)>,
}

impl McapFile {
    pub(crate) fn open(path: &Path, losses: &mut Vec<String>) -> Result<Self> {
        let mut this = Self { contents: Contents::open(path)?, schemas: HashMap::new() };
        let reason = match this.summary() {
            Ok(Some(summary))
                if is_complete(&summary, this.contents.file.length) && !this.has_more(&summary) =>
            {
                this.use_summary(summary);
                find_laps(&mut this);
                return Ok(this);
            }
            // Properly closed, but without an index.
            Ok(_) => None,
            Err(reason) => Some(reason),
        };
        if let Some(reason) = some_of(&this.scan()).or(reason) {
            losses.push(format!(
                "{}: the file is damaged or was not closed; what is whole was read ({reason})",
                path.display()
            ));
        }
        find_laps(&mut this);
        Ok(this)
    }

    /// The records of the summary, which lies before the footer at the end; `None` if there is no summary.
    fn summary(&mut self) -> Parsed<Option<Summary>> {
        let footer = self.contents.file.length.checked_sub(FOOTER + mcap::MAGIC.len() as u64);
        let footer = footer.ok_or("it has no end record")?;
        self.contents.seek(footer)?;
        let end: [u8; (FOOTER as usize) + mcap::MAGIC.len()] =
            self.contents.file.array().map_err(|error| error.to_string())?;
        let (record, magic) = end.split_at(FOOTER as usize);
        ensure(magic == mcap::MAGIC && record[0] == op::FOOTER, || "it has no end record")?;
        let McapRecord::Footer(place) = parse(op::FOOTER, &record[RECORD_HEADER as usize..])? else {
            return Err("it has no end record".into());
        };
        if place.summary_start == 0 {
            return Ok(None);
        }
        // The checksum covers everything from the summary up to itself.
        let checked = (footer + FOOTER - 4).checked_sub(place.summary_start);
        let end = if place.summary_offset_start == 0 { footer } else { place.summary_offset_start };
        let length = end.checked_sub(place.summary_start).filter(|_| end <= footer);
        let (Some(checked), Some(length)) = (checked, length) else {
            return Err("its summary is not where it should be".into());
        };
        self.contents.seek(place.summary_start)?;
        let bytes = self.contents.file.take(checked).map_err(|error| error.to_string())?;
        let sound = place.summary_crc == 0 || crc32fast::hash(&bytes) == place.summary_crc;
        ensure(sound, || "the checksum of its summary is wrong")?;
        let bytes = &bytes[..usize::try_from(length).unwrap_or(0)];
        let mut summary = Summary::default();
        records(bytes, |opcode, body| summary.add(opcode, body))?;
        Ok(Some(summary))
    }

    /// Whether there are messages that no chunk of the summary holds: in the data section, outside the chunks and their indexes.
    fn has_more(&mut self, summary: &Summary) -> bool {
        let place = |index: &ChunkIndex| {
            let end = index.chunk_start_offset.saturating_add(index.chunk_length);
            (index.chunk_start_offset, end.saturating_add(index.message_index_length))
        };
        let mut chunks: Vec<(u64, u64)> = summary.chunks.iter().map(place).collect();
        chunks.sort_unstable();
        let mut chunks = chunks.into_iter().peekable();
        let mut at = mcap::MAGIC.len() as u64;
        loop {
            if let Some((_, end)) = chunks.next_if(|(start, end)| *start == at && *end > at) {
                at = end;
                continue;
            }
            match self.contents.seek(at).and_then(|()| self.record_header()) {
                Ok((op::DATA_END | op::FOOTER, _)) => return false,
                Ok((op::CHUNK | op::MESSAGE, _)) | Err(_) => return true,
                Ok((_, length)) => at = at.saturating_add(RECORD_HEADER).saturating_add(length),
            }
        }
    }

    fn use_summary(&mut self, summary: Summary) {
        self.schemas.extend(summary.schemas.into_iter().map(|(name, text, id)| (id, (name, text.into()))));
        let mut channels = summary.channels;
        channels.sort_by_key(|channel| channel.id);
        for channel in channels {
            let counts = summary.statistics.as_ref().map(|statistics| &statistics.channel_message_counts);
            let messages = counts.map(|counts| counts.get(&channel.id).copied().unwrap_or(0));
            self.add_channel(&channel, messages);
        }
        let piece = |index: &ChunkIndex| Piece {
            offset: index.chunk_start_offset,
            length: index.chunk_length,
            start: time(index.message_start_time),
            end: time(index.message_end_time),
            cut: false,
            lap: 0,
        };
        self.contents.begin(summary.chunks.iter().map(piece).collect());
    }

    /// Finds topics and pieces by reading the whole file. Returns what is wrong.
    fn scan(&mut self) -> Vec<String> {
        let mut scan = Scan::default();
        let mut start = mcap::MAGIC.len() as u64;
        // Whatever is damaged, the next chunk begins anew.
        while let Err(fault) = self.scan_from(start, &mut scan) {
            scan.plain.close(scan.end, &mut scan.pieces);
            scan.faults.push(fault);
            let Some(offset) = self.next_chunk(scan.end + 1) else { break };
            start = offset;
        }
        self.contents.count(scan.counts);
        self.contents.begin(scan.pieces);
        scan.faults
    }

    /// Reads records from `start` to the end. A chunk that is damaged is a fault, and the next one is read.
    ///
    /// # Errors
    /// Why there is no next record.
    fn scan_from(&mut self, start: u64, scan: &mut Scan) -> Parsed<()> {
        self.contents.seek(start)?;
        let mut ended = false;
        loop {
            let offset = self.contents.file.offset;
            scan.end = offset;
            let (opcode, length) = match self.record_header() {
                Ok(header) => header,
                Err(_) if ended => return Ok(()),
                Err(fault) => return Err(fault),
            };
            let begin = self.contents.file.offset;
            let whole = length <= self.contents.file.left();
            if opcode != op::MESSAGE || offset - scan.plain.offset > PLAIN_PIECE {
                scan.plain.close(offset, &mut scan.pieces);
            }
            match opcode {
                op::FOOTER => return Ok(()),
                // Of the summary, which follows, topics are read that are lost with the chunk that defined them.
                op::DATA_END => ended = true,
                // Its length may be the damage.
                op::CHUNK if !whole && self.next_chunk(begin).is_some() => (),
                op::CHUNK => {
                    self.contents.seek(begin)?;
                    let body = self.body(length)?;
                    self.scan_chunk((offset, length), &body, whole, scan);
                }
                op::MESSAGE if whole => {
                    let body = self.body(length)?;
                    scan.plain.open(offset);
                    if let Ok((channel, stamp, _)) = message(&body) {
                        scan.add(channel, stamp, None);
                    }
                }
                op::SCHEMA | op::CHANNEL if whole => {
                    let body = self.body(length)?;
                    let defined = self.define(opcode, &body);
                    defined.map_err(|fault| format!("the record at byte {offset}: {fault}"))?;
                }
                0 => return Err(format!("there is no record at byte {offset}")),
                _ => (),
            }
            ensure(whole, || format!("it ends at byte {}, within a record", self.contents.file.length))?;
            self.contents.seek(begin + length)?;
        }
    }

    fn scan_chunk(&mut self, (offset, length): (u64, u64), body: &[u8], whole: bool, scan: &mut Scan) {
        let mut span = Span::default();
        let fault = self.unpack(body, whole, |this, opcode, body| {
            if opcode == op::MESSAGE {
                let (channel, stamp, _) = message(body)?;
                scan.add(channel, stamp, Some(&mut span));
                Ok(())
            } else {
                this.define(opcode, body)
            }
        });
        let cut = !whole || fault.is_err();
        if let Some((start, end)) = span.0 {
            let length = length.saturating_add(RECORD_HEADER);
            scan.pieces.push(Piece { offset, length, start, end, cut, lap: 0 });
        }
        if let (true, Err(fault)) = (whole, fault) {
            scan.faults.push(format!("the chunk at byte {offset}: {fault}"));
        }
    }

    /// Where the next chunk begins, at `from` or later, if there is one.
    fn next_chunk(&mut self, from: u64) -> Option<u64> {
        let length = self.contents.file.length;
        let is_chunk = |bytes: &[u8], offset: u64| {
            let (header, body) = bytes.split_first_chunk::<{ RECORD_HEADER as usize }>()?;
            let [opcode, size @ ..] = *header;
            let end = offset.checked_add(RECORD_HEADER)?.checked_add(u64::from_le_bytes(size))?;
            let fits = opcode == op::CHUNK && end <= length && Chunk::fills(body, u64::from_le_bytes(size));
            fits.then_some(())
        };
        next_place(&mut self.contents.file, from, |bytes, offset| is_chunk(bytes, offset).is_some())
    }

    /// Stores a schema or a channel.
    fn define(&mut self, opcode: u8, body: &[u8]) -> Parsed<()> {
        if !matches!(opcode, op::SCHEMA | op::CHANNEL) {
            return Ok(());
        }
        match parse(opcode, body)? {
            McapRecord::Schema { header, data } => {
                let text = String::from_utf8_lossy(&data).into_owned();
                self.schemas.insert(header.id, (checked_name(header.name)?, text.into()));
            }
            McapRecord::Channel(channel) => self.add_channel(&channel, Some(0)),
            _ => (),
        }
        Ok(())
    }

    fn add_channel(&mut self, channel: &Channel, messages: Option<u64>) {
        if self.contents.numbers.contains_key(&u32::from(channel.id)) {
            return;
        }
        let (name, text) =
            self.schemas.get(&channel.schema_id).cloned().unwrap_or_else(|| (String::new(), "".into()));
        let encoding = match channel.message_encoding.as_str() {
            "ros1" => Encoding::Ros1,
            "cdr" => Encoding::Cdr,
            other => Encoding::Other(other.to_owned()),
        };
        let profiles = channel.metadata.get("offered_qos_profiles");
        let latched = profiles.is_some_and(|profiles| is_transient_local(profiles))
            || channel.metadata.get("latching").is_some_and(|latching| latching == "1");
        let topic = Topic {
            name: channel.topic.clone(),
            type_name: type_name(&name),
            md5: channel.metadata.get("md5sum").filter(|_| encoding == Encoding::Ros1).cloned(),
            encoding,
            definition: text,
            latched,
            messages,
        };
        self.contents.add(channel.id.into(), topic);
    }

    /// Calls `each` for every record in a chunk. Of a chunk that is cut short, the records up to there.
    fn unpack(
        &mut self,
        body: &[u8],
        whole: bool,
        mut each: impl FnMut(&mut Self, u8, &[u8]) -> Parsed<()>,
    ) -> Parsed<()> {
        let content = Chunk::parse(body)?.content(whole, &mut self.contents.growth)?;
        records(&content, |opcode, body| each(self, opcode, body))
    }

    fn record_header(&mut self) -> Parsed<(u8, u64)> {
        let end = self.contents.file.length;
        let ended = |_| format!("it ends at byte {end}");
        let header: [u8; RECORD_HEADER as usize] = self.contents.file.array().map_err(ended)?;
        let [opcode, length @ ..] = header;
        Ok((opcode, u64::from_le_bytes(length)))
    }

    /// The next `length` bytes, as far as the file has them.
    fn body(&mut self, length: u64) -> Parsed<Vec<u8>> {
        self.contents.piece(length.min(self.contents.file.left()))
    }
}

impl Format for McapFile {
    fn contents(&self) -> &Contents {
        &self.contents
    }

    fn contents_mut(&mut self) -> &mut Contents {
        &mut self.contents
    }

    fn read(&mut self, piece: Piece, wanted: &[bool], out: &mut Vec<Record>) -> Parsed<()> {
        let end = piece.offset.saturating_add(piece.length);
        self.contents.seek(piece.offset)?;
        let mut unknown = None;
        while self.contents.file.offset < end {
            let (opcode, length) = self.record_header()?;
            // A damaged length does not reach into the next piece.
            let left = self.contents.file.left().min(end.saturating_sub(self.contents.file.offset));
            let whole = length <= left;
            let body = self.body(length.min(left))?;
            // A message of a topic that is not known does not end the chunk.
            let mut take = |this: &mut Self, body: &[u8]| -> Parsed<()> {
                let taken = this.contents.take(message(body)?, wanted, out);
                unknown = unknown.take().or(taken.err());
                Ok(())
            };
            match opcode {
                op::CHUNK => self.unpack(&body, whole, |this, opcode, body| match opcode {
                    op::MESSAGE => take(this, body),
                    _ => Ok(()),
                })?,
                op::MESSAGE if whole => take(self, &body)?,
                _ => (),
            }
        }
        unknown.map_or(Ok(()), Err)
    }
}

/// What a scan has found.
#[derive(Default)]
struct Scan {
    pieces: Vec<Piece>,
    plain: Plain,
    /// Messages of each channel.
    counts: HashMap<u32, u64>,
    faults: Vec<String>,
    /// Where the last record begins, or would begin.
    end: u64,
}

impl Scan {
    /// Counts a message, in the chunk with this span or outside chunks.
    fn add(&mut self, channel: u32, stamp: Time, span: Option<&mut Span>) {
        span.unwrap_or(&mut self.plain.span).add(stamp);
        *self.counts.entry(channel).or_insert(0) += 1;
    }
}

/// Messages outside chunks, one after the other.
#[derive(Default)]
struct Plain {
    offset: u64,
    span: Span,
}

impl Plain {
    fn open(&mut self, offset: u64) {
        if self.span.0.is_none() {
            self.offset = offset;
        }
    }

    fn close(&mut self, end: u64, pieces: &mut Vec<Piece>) {
        if let Some((start, last)) = std::mem::take(&mut self.span).0 {
            let length = end.saturating_sub(self.offset);
            pieces.push(Piece { offset: self.offset, length, start, end: last, cut: false, lap: 0 });
        }
    }
}

/// The parts of the summary that are needed.
#[derive(Default)]
struct Summary {
    /// Name, text and number.
    schemas: Vec<(String, String, u16)>,
    channels: Vec<Channel>,
    chunks: Vec<ChunkIndex>,
    statistics: Option<Statistics>,
}

impl Summary {
    fn add(&mut self, opcode: u8, body: &[u8]) -> Parsed<()> {
        if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::CHUNK_INDEX | op::STATISTICS) {
            return Ok(());
        }
        match parse(opcode, body)? {
            McapRecord::Schema { header, data } => {
                let name = checked_name(header.name)?;
                self.schemas.push((name, String::from_utf8_lossy(&data).into_owned(), header.id));
            }
            McapRecord::Channel(channel) => self.channels.push(channel),
            McapRecord::ChunkIndex(chunk) => self.chunks.push(chunk),
            McapRecord::Statistics(statistics) => self.statistics = Some(statistics),
            _ => (),
        }
        Ok(())
    }
}

/// The name of a type, which each of its topics repeats.
fn checked_name(name: String) -> Parsed<String> {
    if name.len() <= LONGEST_NAME { Ok(name) } else { Err("the name of a type is too long".into()) }
}

/// Whether the summary leads to every message.
fn is_complete(summary: &Summary, length: u64) -> bool {
    let within = |index: &ChunkIndex| {
        index.chunk_start_offset.checked_add(index.chunk_length).is_some_and(|end| end <= length)
    };
    let Some(statistics) = &summary.statistics else { return false };
    let chunks = summary.chunks.len();
    chunks == statistics.chunk_count as usize
        && summary.chunks.iter().all(within)
        && summary.channels.len() == statistics.channel_count as usize
}

/// Channel, recording time and bytes.
fn message(body: &[u8]) -> Parsed<(u32, Time, &[u8])> {
    let (header, bytes) =
        body.split_first_chunk::<MESSAGE_HEADER>().ok_or("a message is shorter than its header")?;
    let stamp = header[6..14].iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte));
    Ok((u16::from_le_bytes([header[0], header[1]]).into(), time(stamp), bytes))
}

fn time(nanos: u64) -> Time {
    Time::from_nanos(i64::try_from(nanos).unwrap_or(i64::MAX))
}

/// Whether the YAML that ROS 2 stores with a topic says transient local.
pub(crate) fn is_transient_local(profiles: &str) -> bool {
    profiles.lines().any(|line| {
        let value = line.trim().trim_start_matches("- ").strip_prefix("durability:").map(str::trim);
        matches!(value, Some("1" | "transient_local"))
    })
}
