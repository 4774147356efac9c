//! Hostile arguments and parameter files: no panic, and memory proportional to the input.

use roscausal_fuzz::{Allocator, Target};
use roscausal_ros2::{Args, ParamFile};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

#[test]
fn hostile_arguments_are_refused_or_understood() {
    let target = Target {
        corpus: concat!(env!("CARGO_MANIFEST_DIR"), "/tests/corpus/args").into(),
        seeds: vec![
            b"--ros-args\0-r\0/a:=/b\0-p\0dt:=0.1\0--log-level\0node:=debug".to_vec(),
            b"--ros-args\0-r\0__node:=x\0-r\0__ns:=/y\0-p\0n:a:=[1, 2]\0--".to_vec(),
        ],
        tokens: &[b":=", b"\0", b"-p\0", b"-r\0", b"rostopic://", b"/", b"~", b"[", b"{", b"&a [*a]"],
        bytes_per_byte: 4000,
    };
    target.run(|input| {
        let text = String::from_utf8_lossy(input);
        // Parameter files have a test of their own.
        let args = text.split('\0').filter(|arg| *arg != "--params-file").map(str::to_owned);
        let _ = Args::parse("node", args, |_| None);
    });
}

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
            b"ros__parameters:", b"/**:", b"- ", b"&a ", b"*a", b"<<: ", b"!!", b"[", b"{", b"\n  ",
            b"1e999", b"? ",
        ],
        bytes_per_byte: 4000,
    };
    target.run(|input| {
        let mut file = ParamFile::default();
        let _ = file.add_text(&String::from_utf8_lossy(input));
    });
}
