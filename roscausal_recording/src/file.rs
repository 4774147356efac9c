//! Reading a file at any position, without trusting any length in it.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek, SeekFrom},
    path::Path,
};

/// A file that is read at any position, never past its end.
pub(crate) struct Bytes {
    file: BufReader<File>,
    pub(crate) length: u64,
    pub(crate) offset: u64,
}

impl Bytes {
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        Ok(Self { file: BufReader::with_capacity(1 << 16, file), length, offset: 0 })
    }

    pub(crate) fn left(&self) -> u64 {
        self.length.saturating_sub(self.offset)
    }

    pub(crate) fn seek(&mut self, offset: u64) -> io::Result<()> {
        match i64::try_from(i128::from(offset) - i128::from(self.offset)) {
            Ok(distance) => self.file.seek_relative(distance)?,
            Err(_) => drop(self.file.seek(SeekFrom::Start(offset))?),
        }
        self.offset = offset;
        Ok(())
    }

    /// The next `count` bytes. Never allocates more than the file has.
    pub(crate) fn take(&mut self, count: u64) -> io::Result<Vec<u8>> {
        if count > self.left() {
            return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the file ends here"));
        }
        let mut bytes = vec![0; usize::try_from(count).map_err(io::Error::other)?];
        self.file.read_exact(&mut bytes)?;
        self.offset += count;
        Ok(bytes)
    }

    pub(crate) fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.take(N as u64)?);
        Ok(bytes)
    }
}
