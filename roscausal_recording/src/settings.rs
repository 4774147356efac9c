//! The settings that a recording was made with: a metadata record named `roscausal` in an MCAP file, which maps
//! `NODE.PARAMETER` to its value as text. It stands before the first message, so that a file that was cut short has it too;
//! programs that copy MCAP files may move it, and then the summary leads to it.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{ErrorKind, Read, Result, Seek, SeekFrom},
    path::Path,
};

use mcap::records::{Metadata, Record, op};

use crate::{
    folder::{has_ending, sorted},
    mcap_record::parse,
};

/// Name of the record.
pub(crate) const NAME: &str = "roscausal";
/// A longer record is not ours.
const LONGEST: u64 = 1 << 20;
/// Length of the footer record and the magic at the end of a file.
const END: u64 = 9 + 8 + 8 + 4 + mcap::MAGIC.len() as u64;

/// The settings in a recording, `NODE.PARAMETER` to value; empty for a recording without any, and for other formats than
/// MCAP. Of a folder, those of its first file that has some.
///
/// # Example
/// `{"data.dt": "0.3", "data.risk_lag": "1", "discovery.cond_ind_test": "gpdc"}`
pub fn settings(path: impl AsRef<Path>) -> BTreeMap<String, String> {
    let path = path.as_ref();
    if !path.is_dir() {
        // A file that cannot be read is reported by whoever reads its messages.
        return of_file(path).ok().flatten().unwrap_or_default();
    }
    // A pipe or a device would never end.
    let files = sorted(path, |file| has_ending(file, "mcap") && file.is_file());
    files.iter().find_map(|file| of_file(file).ok().flatten()).unwrap_or_default()
}

fn of_file(path: &Path) -> Result<Option<BTreeMap<String, String>>> {
    let mut file = File::open(path)?;
    let mut magic = [0; mcap::MAGIC.len()];
    file.read_exact(&mut magic)?;
    if magic != mcap::MAGIC {
        return Ok(None);
    }
    match search(&mut file, None) {
        Ok(None) => {}
        found => return found,
    }
    let Some(footer) = file.seek(SeekFrom::End(0))?.checked_sub(END) else { return Ok(None) };
    file.seek(SeekFrom::Start(footer + 9))?;
    let mut start = [0; 8];
    file.read_exact(&mut start)?;
    let start = u64::from_le_bytes(start);
    if start == 0 || start >= footer {
        return Ok(None);
    }
    file.seek(SeekFrom::Start(start))?;
    search(&mut file, Some(footer))
}

/// The settings in the next records: up to the first message or chunk, or in those that the indexes up to byte `end` name.
fn search(file: &mut File, end: Option<u64>) -> Result<Option<BTreeMap<String, String>>> {
    loop {
        let at = file.stream_position()?;
        if end.is_some_and(|end| at >= end) {
            return Ok(None);
        }
        let mut header = [0; 9];
        match file.read_exact(&mut header) {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(None),
            read => read?,
        }
        let [opcode, length @ ..] = header;
        let length = u64::from_le_bytes(length);
        match opcode {
            op::CHUNK | op::MESSAGE | op::DATA_END | op::FOOTER => return Ok(None),
            op::METADATA | op::METADATA_INDEX if length <= LONGEST => {
                let mut body = Vec::new();
                file.take(length).read_to_end(&mut body)?;
                match parse(opcode, &body) {
                    Ok(Record::Metadata(Metadata { name, metadata })) if name == NAME => {
                        return Ok(Some(metadata));
                    }
                    Ok(Record::MetadataIndex(index)) if end.is_some() && index.name == NAME => {
                        file.seek(SeekFrom::Start(index.offset))?;
                        // The record itself comes next; whatever follows it does not matter.
                        return search(file, None);
                    }
                    _ => {}
                }
            }
            _ => {
                let next = at.checked_add(9).and_then(|body| body.checked_add(length));
                let Some(next) = next else { return Ok(None) };
                file.seek(SeekFrom::Start(next))?;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use roscausal_core::Time;
    use roscausal_msgs::std_msgs;

    use super::*;
    use crate::McapWriter;

    fn some() -> BTreeMap<String, String> {
        [("data.dt", "0.3"), ("data.risk_lag", "1")].map(|(k, v)| (k.to_owned(), v.to_owned())).into()
    }

    #[test]
    fn settings_are_read_back_even_from_a_file_that_was_cut_short() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("run.mcap");
        let mut writer = McapWriter::create(&path).expect("creates");
        writer.write_settings(&some()).expect("writes");
        let text = std_msgs::String { data: "hello".into() };
        writer.write("/chatter", Time::from_secs_f64(1.0), &text).expect("writes");
        writer.finish().expect("closes");
        assert_eq!((settings(&path), settings(dir.path())), (some(), some()));
        let whole = std::fs::read(&path).expect("reads");
        for length in (0..whole.len()).step_by(7) {
            std::fs::write(&path, &whole[..length]).expect("writes");
            let found = settings(&path);
            assert!(found == some() || found.is_empty());
            assert!(length < 300 || found == some(), "{length}");
        }
    }

    #[test]
    fn settings_after_the_messages_are_found_through_the_summary() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("run.mcap");
        let mut writer = McapWriter::create(&path).expect("creates");
        let text = std_msgs::String { data: "hello".into() };
        writer.write("/chatter", Time::from_secs_f64(1.0), &text).expect("writes");
        writer.write_settings(&some()).expect("writes");
        writer.finish().expect("closes");
        assert_eq!(settings(&path), some());
    }

    #[test]
    fn other_files_have_none() {
        let dir = tempfile::tempdir().expect("a folder");
        for content in [&b""[..], b"#ROSBAG V2.0\n", b"time,a\n1,2\n", mcap::MAGIC] {
            std::fs::write(dir.path().join("run.bag"), content).expect("writes");
            assert!(settings(dir.path().join("run.bag")).is_empty());
        }
        assert!(settings(dir.path()).is_empty() && settings("no_such.bag").is_empty());
    }
}
