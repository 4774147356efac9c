//! Files that are not what their name says: a pointer of Git LFS, a web page, an archive. Recognised by their first bytes.

/// Bytes of a file that [`not_data`] needs.
pub const NEEDED: usize = 512;

/// What to do with a Parquet or Arrow file that a program without the feature `columnar` gets.
const WITHOUT_COLUMNAR: &str = "this program was built without them: convert it to CSV with pandas, give the data frame to the \
                                Python package, or build with 'cargo install --locked --path . --features columnar'";

/// First bytes of formats that hold data, but that nothing here reads; what they are; and the way out.
const PACKED: [(&[u8], &str, &str); 18] = [
    (b"PK\x03\x04", "a ZIP archive", "unpack it with 'unzip'"),
    (b"\x1f\x8b", "compressed with gzip", "unpack it with 'gunzip'"),
    (b"\x28\xb5\x2f\xfd", "compressed with Zstandard", "unpack it with 'unzstd'"),
    (b"\xfd7zXZ\x00", "compressed with xz", "unpack it with 'unxz'"),
    (b"BZh", "compressed with bzip2", "unpack it with 'bunzip2'"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", "unpack it with '7z x'"),
    (b"\x04\x22\x4d\x18", "compressed with LZ4", "unpack it with 'unlz4'"),
    (b"PAR1", "a Parquet file", WITHOUT_COLUMNAR),
    (b"ARROW1", "an Arrow file", WITHOUT_COLUMNAR),
    (b"\xff\xff\xff\xff", "an Arrow stream", WITHOUT_COLUMNAR),
    (b"\x89HDF\r\n", "an HDF5 file", "convert it to CSV, such as with pandas"),
    (b"\x93NUMPY", "a NumPy file", "convert it to CSV with numpy.savetxt and a header"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook", "save its sheet as CSV"),
    (b"RDX", "a workspace of R", "write the data with write.csv"),
    (b"MATLAB 5.0", "a MATLAB file", "convert it to CSV, such as with scipy.io.loadmat"),
    (b"\x80\x04\x95", "a pickle of Python", "write the data with pandas' to_csv"),
    (b"\x80\x05\x95", "a pickle of Python", "write the data with pandas' to_csv"),
    (b"%PDF", "a PDF document", "take the data that it was made from"),
];

/// What a file is that begins with `first`, and how to get what was meant; `None` if it may be data.
///
/// ```
/// let told = roscausal_core::content::not_data(b"<!DOCTYPE html>\n<html>").unwrap();
/// assert!(told.starts_with("this is a web page"));
/// assert_eq!(roscausal_core::content::not_data(b"time,h_v\n0,1\n"), None);
/// ```
pub fn not_data(first: &[u8]) -> Option<String> {
    let told = |text: &str| Some(text.to_owned());
    let has = |name: &[u8]| first.windows(name.len()).take(1 << 16).any(|window| window == name);
    if first.starts_with(b"PK\x03\x04") && (has(b"[Content_Types].xml") || has(b"xl/work")) {
        return told(
            "the file is an Excel workbook; save its sheet as CSV, such as with pandas' read_excel and to_csv",
        );
    }
    if let Some((_, what, way)) = PACKED.iter().find(|(magic, ..)| first.starts_with(magic)) {
        return Some(format!("the file is {what}; {way}"));
    }
    if first.get(257..262) == Some(b"ustar") {
        return told("the file is a tar archive; unpack it with 'tar xf'");
    }
    let text = String::from_utf8_lossy(&first[..first.len().min(NEEDED)]);
    let text = text.trim_start_matches('\u{feff}').trim_start();
    if text.starts_with("version https://git-lfs.github.com/") {
        let size = text.lines().find_map(|line| line.strip_prefix("size "));
        let size = size.map_or(String::new(), |size| format!(" of {size} bytes"));
        return Some(format!(
            "this is a Git LFS pointer to a file{size}, not the file; get it with 'git lfs pull'"
        ));
    }
    if (!text.contains('\n') && text.contains("annex/objects/")) || text.starts_with("/annex/objects/") {
        return told("this is a git-annex pointer, not the file; get it with 'git annex get'");
    }
    let lower = text.to_lowercase();
    if lower.lines().any(|line| line.starts_with("@relation") || line.starts_with("@attribute")) {
        return told("this is an ARFF file; write CSV with scipy.io.arff.loadarff and pandas' to_csv");
    }
    if ["<!doctype html", "<html", "<head"].iter().any(|start| lower.starts_with(start)) {
        let way =
            "a download ended at an error or a login; open its address in a browser and save the file itself";
        return Some(format!("this is a web page, not data; {way}"));
    }
    if lower.starts_with("<?xml") {
        return told("this is an XML document, not data; a server may have answered with an error");
    }
    if text.starts_with('{') || text.starts_with("[{") {
        return told(
            "this is JSON, not a table; a model is printed by 'roscausal show', and pandas' read_json and to_csv make a table of rows",
        );
    }
    None
}

/// First bytes of recordings: ROS 1 bags of any version, MCAP files, databases of ROS 2.
const RECORDINGS: [&[u8]; 4] = [b"#ROSBAG V", b"#ROSRECORD V", b"\x89MCAP0", b"SQLite format 3"];

/// Whether a file that begins with `first` is a recording.
pub fn is_recording(first: &[u8]) -> bool {
    RECORDINGS.iter().any(|magic| first.starts_with(magic))
}

/// What bytes are that were taken for a table and hold none: a recording through a pipe, or no text at all.
pub fn not_a_table(first: &[u8]) -> Option<&'static str> {
    if is_recording(first) {
        return Some(
            "this is a recording; give the file by its name, such as run.mcap: a recording is not read from a pipe",
        );
    }
    let control = |byte: &u8| *byte < 9 || (14..27).contains(byte);
    first.iter().take(NEEDED).any(control).then_some(
        "this is not text; a table is CSV, Parquet, Arrow or NumPy's .npz, a recording .bag, .mcap or .db3",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pointer_a_page_and_an_archive_are_told_by_their_content_with_the_way_out() {
        let lfs = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 123456\n";
        let mut tar = vec![0; 512];
        tar[257..262].copy_from_slice(b"ustar");
        for (first, reported) in [
            (&lfs[..], "Git LFS pointer to a file of 123456 bytes, not the file; get it with 'git lfs pull'"),
            (b"/annex/objects/SHA256E-s12--ab.bag\n", "'git annex get'"),
            (b"\n <HTML><body>404", "this is a web page"),
            (b"\xef\xbb\xbf<!doctype HTML>", "this is a web page"),
            (b"<?xml version='1.0'?><Error>", "XML document"),
            (b"PK\x03\x04abc", "a ZIP archive; unpack it with 'unzip'"),
            (b"\x1f\x8b\x08", "gunzip"),
            (&tar, "tar xf"),
            (b"{\"schema\": \"roscausal/model/1\"", "roscausal show"),
            (b"PK\x03\x04....[Content_Types].xml", "an Excel workbook; save its sheet as CSV"),
            (b"% made\n@RELATION walk\n@attribute a numeric\n", "an ARFF file"),
            (b"RDX3\nX", "write.csv"),
            (b"%PDF-1.7\n", "a PDF document"),
            (b"MATLAB 5.0 MAT-file", "scipy.io.loadmat"),
        ] {
            let found = not_data(first);
            assert!(found.as_deref().is_some_and(|found| found.contains(reported)), "{found:?}: {reported}");
        }
    }

    #[test]
    fn a_recording_in_a_pipe_and_bytes_that_are_no_text_are_told() {
        assert!(not_a_table(b"\x89MCAP0\r\n").is_some_and(|reported| reported.contains("recording")));
        assert!(not_a_table(b"#ROSBAG V2.0\n").is_some_and(|reported| reported.contains("by its name")));
        assert!(not_a_table(b"a,b\n1\x00,2\n").is_some_and(|reported| reported.contains("not text")));
        assert_eq!(not_a_table(b"# caf\xc3\xa9\r\ntime\ta\x0b\n0,1\n"), None);
    }

    #[test]
    fn data_is_data() {
        for first in
            [&b"time,a,b\n0,1,2\n"[..], b"#ROSBAG V2.0\n", b"\x89MCAP0\r\n", b"", b"# a comment\na b\n"]
        {
            assert_eq!(not_data(first), None);
        }
    }
}
