//! The pages of an SQLite file, read without SQLite, for files that were cut short or damaged: SQLite takes missing bytes for
//! zeros, so it finds rows twice or stops at the first lost page (sqlite.org/fileformat2.html).
//!
//! Rows lie in leaf pages of a table's tree. Each leaf says how many rows it has and where each begins, so its rows can be read
//! whether or not the pages above it are there. Example: of a file whose last page is lost, everything else is found.

use std::{io, path::Path};

use crate::file::Bytes;

/// First byte of a page with rows of a table. A page that continues a long row begins with the number of another page, and no
/// file is so long that this number begins with 13.
const TABLE_LEAF: u8 = 13;
/// Length of the file's header, before the first page's own.
const FILE_HEADER: usize = 100;
/// Length of a leaf page's header.
const LEAF_HEADER: usize = 8;
/// Length of the page number before the content of a page that continues a row.
const LINK: usize = 4;

/// An SQLite file as pages.
pub(super) struct Pages {
    file: Bytes,
    /// Length of a page.
    size: usize,
    /// The part of it that holds content.
    usable: usize,
}

/// A row of the table `messages` of rosbag2: `id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Message {
    pub(super) row: i64,
    pub(super) topic: i64,
    pub(super) stamp: i64,
    pub(super) place: Place,
}

/// Where a row lies: its page, and the byte in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    page: u32,
    offset: u16,
}

impl Pages {
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let mut file = Bytes::open(path)?;
        let header: [u8; FILE_HEADER] = file.array()?;
        let size = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 65536,
            size => usize::from(size),
        };
        // SQLite has no smaller ones.
        let usable = size.checked_sub(usize::from(header[20])).filter(|usable| size >= 512 && *usable >= 480);
        Ok(Self { file, size, usable: usable.ok_or_else(|| io::Error::other("its header is damaged"))? })
    }

    /// All messages in the file, in the order of the pages; each row once.
    pub(super) fn messages(&mut self) -> io::Result<Vec<Message>> {
        let count = self.file.length.div_ceil(self.size as u64);
        let (mut found, mut rows) = (Vec::new(), std::collections::HashSet::new());
        for number in 1..=u32::try_from(count).unwrap_or(u32::MAX) {
            let page = self.page(number)?;
            let of_page = leaf_cells(&page, number).filter_map(|offset| {
                Cell::parse(&page, offset.into(), self.usable)?.message(Place { page: number, offset })
            });
            found.extend(of_page.filter(|message| rows.insert(message.row)));
        }
        Ok(found)
    }

    /// The bytes of a message.
    ///
    /// # Errors
    /// A part of it lies in a page that is not there.
    pub(super) fn data(&mut self, place: Place) -> io::Result<Vec<u8>> {
        let lost = || io::Error::new(io::ErrorKind::UnexpectedEof, "a part of them is not in the file");
        let page = self.page(place.page)?;
        let cell = Cell::parse(&page, place.offset.into(), self.usable).ok_or_else(lost)?;
        // A damaged length must not cost memory.
        let length = usize::try_from(cell.length).ok().filter(|_| cell.length <= self.file.length);
        let length = length.ok_or_else(lost)?;
        let (mut content, mut next) = (cell.local.to_vec(), cell.overflow);
        while content.len() < length {
            let page = self.page(next.ok_or_else(lost)?)?;
            let (link, more) = page.split_first_chunk::<LINK>().ok_or_else(lost)?;
            let wanted = (length - content.len()).min(self.usable - LINK);
            content.extend_from_slice(more.get(..wanted).ok_or_else(lost)?);
            next = Some(u32::from_be_bytes(*link)).filter(|next| *next != 0);
        }
        let (_, start) = columns(&content).ok_or_else(lost)?;
        content.drain(..start);
        Ok(content)
    }

    /// A page, counted from 1, as far as the file has it.
    fn page(&mut self, number: u32) -> io::Result<Vec<u8>> {
        let offset = u64::from(number.saturating_sub(1)) * self.size as u64;
        if number == 0 || offset >= self.file.length {
            return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "a page is not in the file"));
        }
        self.file.seek(offset)?;
        self.file.take(self.file.left().min(self.size as u64))
    }
}

/// Where the rows of a table's leaf begin; of any other page: nowhere.
fn leaf_cells(page: &[u8], number: u32) -> impl Iterator<Item = u16> {
    let start = if number == 1 { FILE_HEADER } else { 0 };
    let header = page.get(start..).and_then(|page| page.first_chunk::<LEAF_HEADER>());
    let count = header
        .filter(|header| header[0] == TABLE_LEAF)
        .map_or(0, |header| usize::from(u16::from_be_bytes([header[3], header[4]])));
    let pointers = page.get(start + LEAF_HEADER..).unwrap_or_default();
    pointers.as_chunks::<2>().0.iter().take(count).map(|pointer| u16::from_be_bytes(*pointer))
}

/// A row as it lies in its leaf.
struct Cell<'a> {
    row: i64,
    /// Length of the whole row.
    length: u64,
    /// The part of it that lies in the leaf.
    local: &'a [u8],
    /// The page in which it goes on.
    overflow: Option<u32>,
}

impl<'a> Cell<'a> {
    fn parse(page: &'a [u8], offset: usize, usable: usize) -> Option<Self> {
        let mut rest = page.get(offset..)?;
        let length = varint(&mut rest)?;
        let row = varint(&mut rest)?.cast_signed();
        let (local, rest) = rest.split_at_checked(local_length(length, usable))?;
        let overflow = match length == local.len() as u64 {
            true => None,
            false => Some(u32::from_be_bytes(*rest.first_chunk()?)),
        };
        Some(Self { row, length, local, overflow })
    }

    /// The row as a message, if it has the columns of one.
    fn message(&self, place: Place) -> Option<Message> {
        let ([topic, stamp], start) = columns(self.local)?;
        (start as u64 <= self.length).then_some(Message { row: self.row, topic, stamp, place })
    }
}

/// How many bytes of a row lie in its leaf.
fn local_length(length: u64, usable: usize) -> usize {
    let (most, least) = (usable - 35, (usable - 12) * 32 / 255 - 23);
    match usize::try_from(length) {
        Ok(length) if length <= most => length,
        _ => {
            let beyond = length.saturating_sub(least as u64) % (usable - LINK) as u64;
            let local = least + usize::try_from(beyond).unwrap_or(0);
            if local <= most { local } else { least }
        }
    }
}

/// Topic and time of a row of `messages`, and where its bytes begin. `None`: it is of another table.
fn columns(row: &[u8]) -> Option<([i64; 2], usize)> {
    let mut rest = row;
    let header = usize::try_from(varint(&mut rest)?).ok()?;
    let mut kinds = row.get(row.len() - rest.len()..header)?;
    // The row's number stands elsewhere, so its column is empty.
    let [id, topic, stamp, data] =
        [varint(&mut kinds)?, varint(&mut kinds)?, varint(&mut kinds)?, varint(&mut kinds)?];
    if id != 0 || !kinds.is_empty() || data < 12 || data % 2 == 1 {
        return None;
    }
    let mut body = row.get(header..)?;
    let numbers = [integer(topic, &mut body)?, integer(stamp, &mut body)?];
    Some((numbers, row.len() - body.len()))
}

/// An integer column of this kind.
fn integer(kind: u64, body: &mut &[u8]) -> Option<i64> {
    let size = match kind {
        1..=4 => kind as usize,
        5 => 6,
        6 => 8,
        8 | 9 => return Some((kind - 8).cast_signed()),
        _ => return None,
    };
    let bytes = body.split_off(..size)?;
    let sign = if bytes[0] & 0x80 == 0 { 0 } else { -1 };
    Some(bytes.iter().fold(sign, |value, byte| value << 8 | i64::from(*byte)))
}

/// A number of one to nine bytes: seven bits each, the highest first; the ninth has eight.
fn varint(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for place in 0..9 {
        let byte = rest.split_off_first()?;
        if place == 8 {
            return Some(value << 8 | u64::from(*byte));
        }
        value = value << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pages_hold_what_sqlite_wrote_into_them() {
        let file = tempfile::NamedTempFile::new().expect("a file");
        let database = rusqlite::Connection::open(file.path()).expect("opens");
        let create = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT); INSERT INTO topics VALUES (1, '/odom');\
                      CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);\
                      CREATE INDEX by_time ON messages (timestamp);";
        database.execute_batch(create).expect("creates");
        let lengths = [0_usize, 1, 700, 4061, 4062, 9000, 100_000];
        let mut written = Vec::new();
        for (i, length) in lengths.iter().cycle().take(140).enumerate() {
            let number = i64::try_from(i).expect("small");
            let stamp = [number, -number, 1_700_000_000_000_000_000 + number][i % 3];
            let data: Vec<u8> = (0..*length).map(|at| (at + i) as u8).collect();
            let values = (number + 1, number % 300, stamp, &data);
            database.execute("INSERT INTO messages VALUES (?, ?, ?, ?)", values).expect("inserts");
            written.push((number + 1, number % 300, stamp, data));
        }
        drop(database);
        let mut pages = Pages::open(file.path()).expect("opens");
        let mut found = pages.messages().expect("reads");
        found.sort_by_key(|message| message.row);
        let mut read = |message: &Message| pages.data(message.place).expect("is whole");
        let found: Vec<_> = found.iter().map(|m| (m.row, m.topic, m.stamp, read(m))).collect();
        assert_eq!(found, written);
    }
}
