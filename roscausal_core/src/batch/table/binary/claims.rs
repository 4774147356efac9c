//! Sizes that Parquet and Arrow files claim, checked before the libraries of the Arrow project allocate them.
//!
//! The libraries check most lengths against the bytes that are there. They trust how long a packed part will be: a page of
//! Parquet, a buffer of Arrow.

use arrow_ipc::{CompressionType, MessageHeader, root_as_footer, root_as_message};
use parquet::file::metadata::ParquetMetaData;

use crate::memory::{Growth, Memory};

/// Structures of Thrift lie at most this deep within each other in the header of a page.
const DEEPEST: usize = 8;
/// What an Arrow file ends with: the length of its footer, and a mark.
const ARROW_END: usize = 4 + 6;

/// Checks the pages of a Parquet file, as far as their headers can be read; the library tells what is wrong beyond.
///
/// # Errors
/// A page that claims to grow beyond what data do.
pub(super) fn check_parquet(bytes: &[u8], metadata: &ParquetMetaData, memory: Memory) -> Result<(), String> {
    let mut growth = Growth::default();
    for column in metadata.row_groups().iter().flat_map(|group| group.columns()) {
        let start = column.dictionary_page_offset().unwrap_or(column.data_page_offset());
        let place = usize::try_from(start).ok().zip(usize::try_from(column.compressed_size()).ok());
        let (start, length) =
            place.ok_or("a column of it begins before the file, or has a length below 0")?;
        let mut rest = bytes.get(start..start.saturating_add(length)).unwrap_or_default();
        while let Some([unpacked, packed]) = page(&mut rest) {
            growth.check(unpacked, packed, memory)?;
            let Some(next) = usize::try_from(packed).ok().and_then(|packed| rest.get(packed..)) else {
                break;
            };
            rest = next;
        }
    }
    Ok(())
}

/// The claimed length of the page that begins here, and its packed length, which follows its header (fields 2 and 3).
fn page(rest: &mut &[u8]) -> Option<[u64; 2]> {
    let (mut field, mut lengths) = (0, [None; 2]);
    while let Some((id, kind)) = next_field(rest, field)? {
        field = id;
        match (id, kind) {
            (2 | 3, 5) => lengths[usize::try_from(id).ok()? - 2] = u64::try_from(whole(rest)?).ok(),
            _ => skip(kind, rest, DEEPEST)?,
        }
    }
    Some([lengths[0]?, lengths[1]?])
}

/// Number and kind of the next field in Thrift's compact form; `Some(None)` at the end of the structure.
fn next_field(rest: &mut &[u8], last: i64) -> Option<Option<(i64, u8)>> {
    let (&byte, left) = rest.split_first()?;
    *rest = left;
    if byte == 0 {
        return Some(None);
    }
    let id = match i64::from(byte >> 4) {
        0 => whole(rest)?,
        step => last.checked_add(step)?,
    };
    Some(Some((id, byte & 15)))
}

/// An unsigned number, seven bits in each byte, the lowest first.
fn varint(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for place in 0..10 {
        let (&byte, left) = rest.split_first()?;
        *rest = left;
        value |= u64::from(byte & 0x7f).checked_shl(7 * place)?;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// A number with a sign, which is its lowest bit.
fn whole(rest: &mut &[u8]) -> Option<i64> {
    let value = varint(rest)?;
    Some((value >> 1) as i64 ^ -((value & 1) as i64))
}

/// Skips a value of this kind.
fn skip(kind: u8, rest: &mut &[u8], depth: usize) -> Option<()> {
    let depth = depth.checked_sub(1)?;
    let mut bytes = |count: usize| rest.split_at_checked(count).map(|(_, left)| *rest = left);
    match kind {
        1 | 2 => Some(()),
        3 => bytes(1),
        4..=6 => varint(rest).map(drop),
        7 => bytes(8),
        8 => {
            let length = usize::try_from(varint(rest)?).ok()?;
            *rest = rest.get(length..)?;
            Some(())
        }
        9 | 10 => {
            let (&byte, left) = rest.split_first()?;
            *rest = left;
            let count = if byte >> 4 == 15 { varint(rest)? } else { u64::from(byte >> 4) };
            // A truth value in a list takes a byte.
            let kind = if matches!(byte & 15, 1 | 2) { 3 } else { byte & 15 };
            (0..count).try_for_each(|_| skip(kind, rest, depth))
        }
        12 => {
            let mut field = 0;
            while let Some((id, kind)) = next_field(rest, field)? {
                field = id;
                skip(kind, rest, depth)?;
            }
            Some(())
        }
        _ => None,
    }
}

/// Checks an Arrow file.
///
/// # Errors
/// A block that is not in the file, or a buffer that claims to grow beyond what data do.
pub(super) fn check_arrow_file(bytes: &[u8], memory: Memory) -> Result<(), String> {
    let cut = || "it is cut off".to_owned();
    let length =
        bytes.len().checked_sub(ARROW_END).and_then(|at| bytes[at..].first_chunk::<4>()).ok_or_else(cut)?;
    let start = usize::try_from(i32::from_le_bytes(*length)).ok();
    let start = start.and_then(|length| (bytes.len() - ARROW_END).checked_sub(length)).ok_or_else(cut)?;
    let footer = root_as_footer(&bytes[start..bytes.len() - ARROW_END]).map_err(|error| error.to_string())?;
    let mut growth = Growth::default();
    let blocks =
        footer.dictionaries().into_iter().flatten().chain(footer.recordBatches().into_iter().flatten());
    for block in blocks {
        let [offset, head, body] = [block.offset(), i64::from(block.metaDataLength()), block.bodyLength()]
            .map(|number| usize::try_from(number).unwrap_or(usize::MAX));
        let block =
            bytes.get(offset..).and_then(|rest| rest.get(..head.checked_add(body)?)).ok_or_else(cut)?;
        let (head, body) = block.split_at(head);
        // Before it stand its length, and since version 0.15 a mark.
        let head = head.strip_prefix(b"\xff\xff\xff\xff").unwrap_or(head);
        check_message(head.get(4..).ok_or_else(cut)?, body, &mut growth, memory)?;
    }
    Ok(())
}

/// Checks an Arrow stream.
///
/// # Errors
/// A message that is not there as a whole, or a buffer that claims to grow beyond what data do.
pub(super) fn check_arrow_stream(mut rest: &[u8], memory: Memory) -> Result<(), String> {
    let mut growth = Growth::default();
    let cut = || "it is cut off".to_owned();
    loop {
        rest = rest.strip_prefix(b"\xff\xff\xff\xff").unwrap_or(rest);
        if rest.is_empty() {
            return Ok(());
        }
        let (length, left) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
        let (head, left) = left.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or_else(cut)?;
        if head.is_empty() {
            return Ok(());
        }
        let message = root_as_message(head).map_err(|error| error.to_string())?;
        let body = usize::try_from(message.bodyLength()).unwrap_or(usize::MAX);
        let (body, left) = left.split_at_checked(body).ok_or_else(cut)?;
        check_message(head, body, &mut growth, memory)?;
        rest = left;
    }
}

/// Checks the packed buffers of a message: each begins with the length that it will have. They are in memory at once.
fn check_message(head: &[u8], body: &[u8], growth: &mut Growth, memory: Memory) -> Result<(), String> {
    let message = root_as_message(head).map_err(|error| error.to_string())?;
    let batch = match message.header_type() {
        MessageHeader::DictionaryBatch => message.header_as_dictionary_batch().and_then(|batch| batch.data()),
        _ => message.header_as_record_batch(),
    };
    let Some(batch) = batch else { return Ok(()) };
    let is_packed = batch
        .compression()
        .is_some_and(|packed| matches!(packed.codec(), CompressionType::ZSTD | CompressionType::LZ4_FRAME));
    let mut held: u64 = 0;
    for buffer in batch.buffers().into_iter().flatten() {
        let place = usize::try_from(buffer.offset()).ok().zip(usize::try_from(buffer.length()).ok());
        let there = place.and_then(|(offset, length)| body.get(offset..)?.get(..length));
        let there = there.ok_or("a buffer is not in the file")?;
        if let (true, Some(claimed)) = (is_packed, there.first_chunk::<8>()) {
            let claimed = u64::try_from(i64::from_le_bytes(*claimed)).unwrap_or(0);
            held = held.saturating_add(claimed);
            memory.check(held)?;
            growth.check(claimed, there.len() as u64, memory)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lengths_of_a_page_are_found_among_other_fields() {
        // 1: type 0; 2: 300 bytes; 3: 20 bytes; 5: a structure with a number, a text, a list of truth values; end.
        let header = [
            0x15, 0x00, 0x15, 0xd8, 0x04, 0x15, 0x28, 0x2c, 0x15, 0x06, 0x18, 0x02, b'a', b'b', 0x19, 0x21,
            1, 2, 0x00, 0x00, 0x77,
        ];
        let mut rest = &header[..];
        assert_eq!(page(&mut rest), Some([300, 20]));
        assert_eq!(rest, [0x77]);
        for length in 0..header.len() - 1 {
            assert_eq!(page(&mut &header[..length]), None, "{length}");
        }
        assert_eq!(page(&mut &[0x1c; 1000][..]), None, "deeper than any header");
    }
}
