//! Which format a file has.

use std::{fs::File, io::Read, path::Path};

use roscausal_core::{Error, Result, content};

use crate::{
    bag::Bag,
    db3::Db3,
    mcap_file::McapFile,
    packed::{self, Unpacked},
    source::Source,
};

/// Opens one file according to its contents, whatever its name.
pub(crate) fn open_file(path: &Path, losses: &mut Vec<String>) -> Result<Box<dyn Source>> {
    let mut magic = Vec::new();
    let read = File::open(path).and_then(|file| file.take(content::NEEDED as u64).read_to_end(&mut magic));
    read.map_err(|error| Error::file(path, error))?;
    Ok(match magic.as_slice() {
        magic if magic.starts_with(b"#ROSBAG V2.0\n") => Box::new(Bag::open(path, losses)?),
        magic if magic.starts_with(mcap::MAGIC) => Box::new(McapFile::open(path, losses)?),
        magic if magic.starts_with(b"SQLite format 3\0") => Box::new(Db3::open(path, losses)?),
        magic if magic.starts_with(packed::MAGIC) => Box::new(Unpacked::open(path, losses, open_file)?),
        magic if magic.starts_with(b"#ROSBAG V") || magic.starts_with(b"#ROSRECORD V") => {
            return Err(Error::file(path, other_version(magic)));
        }
        [] => {
            let reason = "the file is empty; was the recording or its download broken off?";
            return Err(Error::file(path, reason));
        }
        first => {
            let reason = "this is not a recording: a ROS 1 bag, an MCAP file or a ROS 2 .db3 file is needed";
            return Err(Error::file(path, content::not_data(first).unwrap_or_else(|| reason.to_owned())));
        }
    })
}

/// Why a bag of another version than 2.0 is not read, and what makes one of it that is.
fn other_version(magic: &[u8]) -> String {
    let number = magic.split(|byte| *byte == b'V').nth(1).unwrap_or_default();
    let number: Vec<u8> =
        number.iter().copied().take_while(|byte| byte.is_ascii_digit() || *byte == b'.').take(8).collect();
    let number = String::from_utf8_lossy(&number);
    match number.starts_with(['0', '1']) {
        true => format!(
            "this is an old bag, of version {number}; 'rosbag fix OLD.bag NEW.bag' of ROS 1 makes one of version 2.0 of it"
        ),
        false => format!("this is a bag of version {number}; only version 2.0 is read"),
    }
}
