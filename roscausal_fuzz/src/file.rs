//! Inputs as a file, for readers that take a path.

use std::{fs, io::Result, path::Path};

use tempfile::NamedTempFile;

/// A temporary file that holds one input after the other; in memory where that is possible.
#[derive(Debug)]
pub struct InputFile(NamedTempFile);

impl InputFile {
    /// An empty file.
    ///
    /// # Errors
    /// The error of the file system.
    pub fn new() -> Result<Self> {
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        NamedTempFile::new_in(folder).map(Self)
    }

    /// The path of the file, which now holds this input.
    ///
    /// # Errors
    /// The error of the file system.
    pub fn with(&self, input: &[u8]) -> Result<&Path> {
        fs::write(self.0.path(), input)?;
        Ok(self.0.path())
    }
}
