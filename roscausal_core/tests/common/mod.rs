//! What the tests of folders share.

use std::{fs, path::Path};

/// Sorted names of the files in a folder that end with `end`; none if there is no folder.
pub(crate) fn names(dir: &Path, end: &str) -> Vec<String> {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| !name.starts_with('.') && name.ends_with(end))
        .collect();
    names.sort();
    names
}
