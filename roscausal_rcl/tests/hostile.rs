//! Hostile parameter files: no panic, and memory proportional to the input.

use roscausal_fuzz::{Allocator, Target};
use roscausal_rcl::ParamFile;

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

#[test]
fn a_hostile_parameter_file_is_refused_or_read() {
    let seeds = [
        include_bytes!("../../config/ros2.yaml").to_vec(),
        include_bytes!("../../config/hrisim.yaml").to_vec(),
        // too deep for a recursive reader
        vec![b'['; 50_000],
    ];
    let target = Target {
        corpus: concat!(env!("CARGO_MANIFEST_DIR"), "/tests/corpus/param_file").into(),
        seeds: seeds.to_vec(),
        tokens: &[
            b"ros__parameters:",
            b"/**:",
            b"- ",
            b"&a ",
            b"*a",
            b"<<: ",
            b"!!",
            b"[",
            b"{",
            b"\n  ",
            b"1e999",
            b"? ",
        ],
        // the YAML library expands aliases, up to a hundred times the events of the file
        bytes_per_byte: 200_000,
    };
    target.run(|input| {
        let mut file = ParamFile::default();
        let _ = file.add_text(&String::from_utf8_lossy(input));
    });
}
