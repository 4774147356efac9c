//! Hostile files that the command reads: no panic, and memory proportional to the file.

use std::{ffi::OsString, fs};

use roscausal_discovery::draw;
use roscausal_fuzz::{Allocator, InputFile, Target};

use crate::{carried, cli::command, export, folders::read_model, presets, report};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// A model that an analysis made.
const MODEL: &[u8] = include_bytes!("../roscausal_core/tests/corpus/json/model.json");
/// What breaks JSON, and models.
pub(crate) const JSON: [&[u8]; 9] = [
    b"[",
    b"{\"a\":",
    b"1e999",
    b"null",
    b"\"\\ud800\"",
    b"\"<->\"",
    b"\"o->\"",
    b"\"tau_max\": 2147483648",
    b",",
];
/// What breaks TOML.
pub(crate) const TOML: [&[u8]; 9] =
    [b"[[", b"]]", b"=", b"nan", b"1e999", b"{", b"\n", b"[a.b]\n", b"\"\"\""];

pub(crate) fn run(
    name: &str,
    seeds: Vec<Vec<u8>>,
    tokens: &[&[u8]],
    bytes_per_byte: usize,
    decode: impl Fn(&[u8]),
) {
    let corpus = format!("{}/tests/corpus/{name}", env!("CARGO_MANIFEST_DIR")).into();
    Target { corpus, seeds, tokens, bytes_per_byte }.run(decode);
}

#[test]
fn hostile_settings_beside_the_data_are_refused_or_become_flags() {
    let seeds = [
        "tau-max = 3\nmethod = \"pcmciplus\"\nalpha = 0.01\nparam = [\"data.dt=0.1\"]\n[data]\nrisk_lag = 1\n[discovery]\nresamples = 0\n",
        "max_gap = 0.5\nquiet = true\nfeature = [\"d = dist(h, r)\"]\ncolumns = [\"a\", \"b*\"]\n[discovery]\ncond_ind_test = \"gpdc\"\n",
    ];
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("walk.bag"), "#ROSBAG V2.0\n").expect("a recording");
    let lines = ["table.csv", "walk.bag"].map(|data| {
        let words = ["roscausal".into(), "discover".into(), folder.path().join(data).into_os_string()];
        let matches = command().try_get_matches_from(&words).expect("a command line");
        (words, matches)
    });
    // The table of all flags, made anew for each line.
    run("settings", seeds.map(Into::into).to_vec(), &TOML, 4000, |input| {
        for name in [carried::FILE, "walk.bag.roscausal.toml"] {
            fs::write(folder.path().join(name), input).expect("the settings");
        }
        for (line, matches) in &lines {
            let whole: Option<(Vec<OsString>, _)> = presets::apply(line, matches, &command()).ok();
            drop(whole.map(|(whole, _)| command().try_get_matches_from(whole)));
        }
    });
}

#[test]
fn a_hostile_model_is_refused_or_shown() {
    let file = InputFile::new().expect("a file");
    run("model", vec![MODEL.to_vec()], &JSON, 20_000, |input| {
        let Ok(model) = read_model(file.with(input).expect("it is written")) else { return };
        let _ =
            (report::text(&model), export::links_csv(&model), export::dot(&model), export::graphml(&model));
        let _ = (draw::dag(&model), draw::tsdag(&model), draw::matrix(&model));
    });
}

#[test]
fn a_name_that_is_longer_than_a_format_can_be_wide_is_shown() {
    let text = String::from_utf8_lossy(MODEL);
    let model: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let first = model["features"][0].to_string();
    let text = text.replace(&first, &format!("\"{}\"", "h".repeat(70_000)));
    let file = InputFile::new().expect("a file");
    let model = read_model(file.with(text.as_bytes()).expect("it is written")).expect("a model");
    assert!(report::text(&model).contains("hhh"));
}
