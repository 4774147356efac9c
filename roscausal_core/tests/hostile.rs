//! Hostile files and texts: no panic, and memory proportional to the input.

#![allow(clippy::expect_used, reason = "a test may panic: that is how it fails")]

#[path = "hostile/tables.rs"]
mod tables;

use std::{fs, path::Path};

use roscausal_core::{
    batch::{
        Sampling, Select, Table, Values,
        journal::{self, Header, Sample, Subject},
        postprocess::Feature,
    },
    params::{Allowed, ParamSpec, Value},
    signal::How,
};
use roscausal_discovery::Model;
use roscausal_fuzz::{Allocator, Target};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn run(name: &str, seeds: &[&[u8]], tokens: &[&[u8]], bytes_per_byte: usize, decode: impl Fn(&[u8])) {
    let target = Target {
        corpus: format!("{}/tests/corpus/{name}", env!("CARGO_MANIFEST_DIR")).into(),
        seeds: seeds.iter().map(|seed| seed.to_vec()).collect(),
        tokens,
        bytes_per_byte,
    };
    target.run(decode);
}

/// A table of `tests/tables`.
fn shared_table(name: &str) -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/tables").join(name)).expect("it is there")
}

#[test]
fn a_hostile_csv_is_refused_or_read() {
    let seeds: [&[u8]; 4] = [
        b"time,r_x,r_y\n0,1,2\n0.1,1.5,2\n0.2,,nan\n",
        b"r_{gx};r_{\theta}\n1;2\n3;4\n",
        b"\xef\xbb\xbf\"a \"\"b\"\"\",c\r\n1e300,-inf\r\n",
        b"h_1_x\th_1_y\n1\t2\n",
    ];
    let tokens: [&[u8]; 9] = [b",", b"\n", b"\"", b"nan", b"1e999", b"\t", b";", b"a,", b"0\n"];
    run("csv", &seeds, &tokens, 200, |input| {
        let path = Path::new("hostile.csv");
        if let Ok(table) = Table::from_bytes(input, None, path) {
            assert!(table.values.iter().all(|v| !v.is_infinite()));
            let _ = table.dt();
            let _ = roscausal_discovery::DataFrame::new(vec![table.values], table.names);
        }
        let _ = Table::from_bytes(input, Some(&["r_x".to_owned()]), path);
    });
}

#[test]
fn a_hostile_expression_is_refused_or_read() {
    let seeds: [&[u8]; 4] = [
        b"dist(h, h.goal)",
        b"risk(h, r) * 2 - (1 + h.v) / max(0.1, r.omega)",
        b"norm(h.x - r.x)",
        b"t ^ -2.5e3",
    ];
    let tokens: [&[u8]; 9] = [b"(", b")", b"-", b"+1", b"h.v*", b"max(", b"dist(", b"1e", b","];
    run("expression", &seeds, &tokens, 400, |input| {
        let _ = Feature::new("features", "f", &String::from_utf8_lossy(input));
    });
}

#[test]
fn a_hostile_journal_is_refused_or_replayed_up_to_its_last_whole_block() {
    let header = Header {
        number: 1,
        dt_s: 0.1,
        ts_length_s: Some(1.0),
        max_gap_s: 0.5,
        sampling: Sampling::default(),
        sel_agent: "all".into(),
        frame: "map".into(),
        next_row_ns: 0,
        signals: vec![
            ("a".into(), How::Hold(1.0)),
            ("b".into(), How::Average(1.0)),
            ("c".into(), How::Linear),
        ],
    };
    let sample = |of, i: i64| Sample { of, stamp_ns: i * 50_000_000, values: Values::from_array([0.5; 7]) };
    let subjects = [Subject::Robot, Subject::Person(1), Subject::Signal(0), Subject::Signal(2)];
    let samples: Vec<Sample> = (0..30).flat_map(|i| subjects.map(|of| sample(of, i))).collect();
    let whole = journal::encode(&header, &samples);
    run(
        "journal",
        &[&whole, &whole[..200]],
        &[b"\xff\xff\xff\xff", b"roscausal-journal/1\n"],
        400,
        |input| {
            let _ = journal::replay(input);
        },
    );
    // With valid checksums: a faulty disk does not produce this, but a hostile writer does.
    run(
        "journal_header",
        &[&serde_json::to_vec(&header).expect("JSON")],
        &[b"1e999", b"-", b"null", b"9"],
        4000,
        |input| {
            if let Ok(header) = serde_json::from_slice::<Header>(input) {
                let _ = journal::replay(&journal::encode(&header, &samples[..20]));
            }
        },
    );
}

#[test]
fn hostile_json_is_refused_or_read() {
    run(
        "json",
        &[b"{\"features\": [], \"links\": []}"],
        &[b"[", b"{\"a\":", b"1e999", b"null", b"\"\\ud800\""],
        200,
        |input| {
            let _ = Model::from_json(input);
            let _ = serde_json::from_slice::<serde_json::Value>(input);
        },
    );
}

#[test]
fn hostile_parameters_are_refused_or_understood() {
    let text = |text: &str| Value::Str(text.to_owned());
    let specs = [
        ParamSpec::new("a", Value::Bool(false), Allowed::Any, ""),
        ParamSpec::new("b", Value::Int(0), Allowed::Range(0.0, 10.0), ""),
        ParamSpec::new("c", Value::Double(0.0), Allowed::Range(0.0, 10.0), ""),
        ParamSpec::new("d", text("x"), Allowed::OneOf(&["x", "yy"]), ""),
        ParamSpec::new("e", Value::List(Vec::new()), Allowed::Any, ""),
    ];
    run(
        "parameter",
        &[b"True", b"1e5", b"nearest:3", b"1,2,3", b"-9223372036854775808"],
        &[b",", b"e", b"nearest:"],
        400,
        |input| {
            let value = text(&String::from_utf8_lossy(input));
            specs.iter().for_each(|spec| drop(spec.checked(value.clone())));
            let _ = value.to_string().parse::<Select>();
        },
    );
}
