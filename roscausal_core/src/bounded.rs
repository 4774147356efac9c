//! Files that others wrote, read up to a size: no file fills the memory.

use std::{fs::File, io::Read, path::Path};

use roscausal_discovery::text::check_nesting;
use serde::de::DeserializeOwned;

use crate::{Error, Result, ensure};

/// Most bytes of a file of settings, or of what is known of links.
pub const SETTINGS: u64 = 1 << 20;
/// Most bytes of a model, its evidence, or a structural model with its rows.
pub const MODEL: u64 = 512 << 20;

/// The bytes of a file of at most `most`.
///
/// # Errors
/// A file that cannot be read, is larger, or is no ordinary one: whoever opens a pipe waits for its writer. What a shell hands over
/// (`<(...)`) has one.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let is_of_shell = path.starts_with("/dev/fd") || path.starts_with("/proc/self/fd");
    let is_other = !is_of_shell && path.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir());
    ensure(!is_other, || Error::file(path, "not an ordinary file; give one"))?;
    let file = File::open(path).map_err(|e| Error::file(path, e))?;
    file.take(most + 1).read_to_end(&mut bytes).map_err(|e| Error::file(path, e))?;
    let large = || format!("the file is larger than {} MB, which no such file is; give another", most >> 20);
    ensure(bytes.len() as u64 <= most, || Error::file(path, large()))?;
    Ok(bytes)
}

/// The text of a file of at most `most` bytes.
///
/// # Errors
/// As [`read`], and bytes that are no UTF-8.
pub fn read_text(path: &Path, most: u64) -> Result<String> {
    String::from_utf8(read(path, most)?).map_err(|_| Error::file(path, "the file is not text (UTF-8)"))
}

/// The text of a file of settings in TOML or JSON: at most [`SETTINGS`] bytes that nest no deeper than
/// [`MOST_NESTING`](roscausal_discovery::text::MOST_NESTING).
///
/// # Errors
/// As [`read_text`], and deeper nesting.
pub fn read_settings(path: &Path) -> Result<String> {
    let text = read_text(path, SETTINGS)?;
    check_nesting(text.as_bytes()).map_err(|e| Error::file(path, e))?;
    Ok(text)
}

/// The text of a file that a setting of an analysis names: one that ends in `toml` as [`read_settings`], a table up to [`MODEL`] bytes.
///
/// # Errors
/// As these.
pub fn read_setting(path: &Path, ending: &str) -> Result<String> {
    if ending == "toml" { read_settings(path) } else { read_text(path, MODEL) }
}

/// What a JSON file of settings holds.
///
/// # Errors
/// As [`read_settings`]; a text that is not JSON, or not of this type.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    serde_json::from_str(&read_settings(path)?).map_err(|error| Error::file(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_its_bound() {
        let dir = tempfile::tempdir().expect("a folder");
        assert!(
            read(Path::new("/dev/zero"), 10)
                .expect_err("no end")
                .to_string()
                .contains("not an ordinary file")
        );
        let path = dir.path().join("settings.toml");
        std::fs::write(&path, "#".repeat(1 << 20)).expect("writes");
        assert_eq!(read_settings(&path).expect("fits").len(), 1 << 20);
        std::fs::write(&path, "#".repeat((1 << 20) + 1)).expect("writes");
        assert!(read_settings(&path).expect_err("too large").to_string().contains("larger than 1 MB"));
        std::fs::write(&path, format!("a = {}", "[".repeat(65))).expect("writes");
        assert!(read_settings(&path).expect_err("too deep").to_string().contains("line 1 nests deeper"));
    }
}
