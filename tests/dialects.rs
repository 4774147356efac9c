//! `roscausal discover` on the tables that people have: every spelling of the same data gives the same model.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

mod common;

use std::{
    fs,
    io::Write,
    path::Path,
    process::{Command, Stdio},
};

use common::roscausal;
use roscausal_fuzz::unit;
use serde_json::Value;

/// `a` drives `b` one step later: 200 rows of time, a, b, each a number with six digits.
fn rows() -> Vec<[f64; 3]> {
    let mut state = 7_u64;
    let mut noise = || unit(&mut state) - 0.5;
    let (mut a, mut b) = (0.0, 0.0);
    let digits = |value: f64| (value * 1e6).round() / 1e6;
    let row = |i: usize| {
        (a, b) = (0.4 * a + noise(), 0.3 * b + 0.8 * a + 0.5 * noise());
        [i as f64 * 0.25, digits(a), digits(b)]
    };
    (0..200).map(row).collect()
}

/// The rows as text: a header, then a line made of each row.
fn text(header: &str, line: impl Fn(usize, [f64; 3]) -> String) -> String {
    let lines = rows().into_iter().enumerate().map(|(i, row)| line(i, row) + "\n");
    format!("{header}\n{}", lines.collect::<String>())
}

fn plain() -> String {
    text("time,a,b", |_, [t, a, b]| format!("{t},{a},{b}"))
}

fn comma(number: f64) -> String {
    number.to_string().replace('.', ",")
}

fn analyse(dir: &Path, file: &str, more: &[&str]) -> Result<Value, String> {
    let quick = ["discover", file, "--method", "pcmci", "--test", "parcorr", "--format", "json"];
    let out = roscausal(dir, &[&quick[..], more].concat());
    let reported = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(!reported.contains("panicked"), "{reported}");
    if out.status.success() { Ok(serde_json::from_slice(&out.stdout).expect("JSON")) } else { Err(reported) }
}

fn with(content: &[u8], more: &[&str]) -> Result<Value, String> {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), content).expect("writes");
    analyse(dir.path(), "data.csv", more)
}

fn utf16(text: &str, mark: bool) -> Vec<u8> {
    let units = mark.then_some('\u{feff}').into_iter().chain(text.chars()).collect::<String>();
    units.encode_utf16().flat_map(u16::to_le_bytes).collect()
}

fn gzip(text: &str) -> Vec<u8> {
    let mut child =
        Command::new("gzip").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("gzip is there");
    let mut input = child.stdin.take().expect("a pipe");
    let text = text.to_owned();
    let writer = std::thread::spawn(move || input.write_all(text.as_bytes()).expect("writes"));
    let out = child.wait_with_output().expect("ends");
    writer.join().expect("wrote");
    out.stdout
}

#[test]
fn the_same_data_in_thirty_dialects_give_the_same_model() {
    let expected = with(plain().as_bytes(), &[]).expect("reads");
    assert_eq!(expected["links"][1]["cause"], "a");
    let start = 1_464_818_234.0;
    let stamp = |t: f64, per: f64| format!("{:.0}", (start + t) * per);
    let clock =
        |t: f64| format!("08:{:02}:{:02}.{:02.0}", (t / 60.0) as u32, t as u32 % 60, t.fract() * 100.0);
    let unix = plain();
    let dialects: Vec<(&str, Vec<u8>)> = vec![
        ("CR LF", unix.replace('\n', "\r\n").into()),
        ("CR", unix.replace('\n', "\r").into()),
        ("a mark of UTF-8", format!("\u{feff}{unix}").into()),
        ("UTF-16", utf16(&unix, true)),
        ("a comment in the last line, which has no end", format!("{unix}# end").into()),
        ("UTF-16 without a mark", utf16(&unix, false)),
        ("Latin-1", [b"# gr\xf6\xdfe\n", unix.as_bytes()].concat()),
        ("gzip", gzip(&unix)),
        ("TAB", unix.replace(',', "\t").into()),
        ("semicolon", unix.replace(',', ";").into()),
        ("semicolon and decimal comma", text("time;a;b", |_, row| row.map(comma).join(";")).into()),
        ("TAB and decimal comma", text("time\ta\tb", |_, row| row.map(comma).join("\t")).into()),
        ("a spreadsheet's sep", format!("sep=;\n{}", unix.replace(',', ";")).into()),
        ("spaces", unix.replace(',', " ").into()),
        (
            "columns aligned by spaces",
            text("  time     a     b", |_, [t, a, b]| format!("{t:8.2} {a:12.6} {b:12.6}")).into(),
        ),
        ("bars", unix.replace(',', "|").into()),
        ("spaces after commas", unix.replace(',', ", ").into()),
        ("quoted names", unix.replacen("time,a,b", "\"time\",\"a\",\"b\"", 1).into()),
        ("quoted cells", text("time,a,b", |_, row| row.map(|v| format!("\"{v}\"")).join(",")).into()),
        (
            "comments",
            format!("# made by hand\n# twice\n{}", unix.replacen('\n', "\n# units: s, m, m\n", 1)).into(),
        ),
        ("NumPy's header", format!("# {unix}").into()),
        ("NumPy's header and spaces", format!("# {}", unix.replace(',', " ")).into()),
        ("pandas' index", text(",time,a,b", |i, [t, a, b]| format!("{i},{t},{a},{b}")).into()),
        (
            "pandas' index read and written again",
            text("Unnamed: 0,time,a,b", |i, [t, a, b]| format!("{i},{t},{a},{b}")).into(),
        ),
        (
            "R's row numbers",
            text("\"time\" \"a\" \"b\"", |i, [t, a, b]| format!("{} {t} {a} {b}", i + 1)).into(),
        ),
        (
            "a separator at the end of each line",
            text("time,a,b,", |_, [t, a, b]| format!("{t},{a},{b},")).into(),
        ),
        (
            "a separator at the end of each row",
            text("time,a,b", |_, [t, a, b]| format!("{t},{a},{b},")).into(),
        ),
        ("empty lines", unix.replace('\n', "\n\n").into()),
        ("exponents", text("time,a,b", |_, [t, a, b]| format!("{t:e},{a:E},{b:e}")).into()),
        ("milliseconds by name", text("time_ms,a,b", |_, [t, a, b]| format!("{},{a},{b}", t * 1e3)).into()),
        ("seconds in brackets", unix.replacen("time", "Time [s]", 1).into()),
        ("ROS 1's echo", text("%time,a,b", |_, [t, a, b]| format!("{},{a},{b}", stamp(t, 1e9))).into()),
        ("seconds since 1970", text("stamp,a,b", |_, [t, a, b]| format!("{},{a},{b}", start + t)).into()),
        (
            "milliseconds since 1970",
            text("t,a,b", |_, [t, a, b]| format!("{},{a},{b}", stamp(t, 1e3))).into(),
        ),
        (
            "microseconds since 1970",
            text("t,a,b", |_, [t, a, b]| format!("{},{a},{b}", stamp(t, 1e6))).into(),
        ),
        ("nanoseconds from 0", text("timestamp,a,b", |_, [t, a, b]| format!("{},{a},{b}", t * 1e9)).into()),
        ("dates", text("timestamp,a,b", |_, [t, a, b]| format!("2026-11-24T{},{a},{b}", clock(t))).into()),
        (
            "dates with a zone",
            text("Date_Time,a,b", |_, [t, a, b]| format!("2026-11-24 {}+01:00,{a},{b}", clock(t))).into(),
        ),
        (
            "pandas' index of dates",
            text(",a,b", |_, [t, a, b]| format!("2026-11-24 {},{a},{b}", clock(t))).into(),
        ),
        (
            "dates by slashes",
            text("date,a,b", |_, [t, a, b]| format!("2026/11/24 {},{a},{b}", clock(t))).into(),
        ),
        (
            "dates with the day first",
            text("date,a,b", |_, [t, a, b]| format!("24.11.2026 {},{a},{b}", clock(t))).into(),
        ),
        ("time of day", text("time,a,b", |_, [t, a, b]| format!("{},{a},{b}", clock(t))).into()),
    ];
    assert!(dialects.len() >= 30);
    for (name, content) in dialects {
        let model = with(&content, &[]).unwrap_or_else(|reported| panic!("{name}: {reported}"));
        for field in ["features", "links", "p_matrix", "n_samples"] {
            assert_eq!(model[field], expected[field], "{name}");
        }
        let dt = model["dt"].as_f64().expect("a step");
        assert!((dt - 0.25).abs() < 1e-5, "{name}: {dt}");
    }
}

#[test]
fn truth_values_and_words_for_a_missing_value_are_numbers() {
    let content = text("time,a,b,near", |i, [t, a, b]| {
        let b = if i == 50 { "N/A".to_owned() } else { b.to_string() };
        format!("{t},{a},{b},{}", if a > 0.0 { "True" } else { "False" })
    });
    let model = with(content.as_bytes(), &[]).expect("reads");
    assert_eq!(model["features"], serde_json::json!(["a", "b", "near"]));
    assert!(model["warnings"].to_string().contains("'b': 1 of 200 cells"), "{}", model["warnings"]);
}

#[test]
fn words_are_refused_by_name_or_encoded_when_asked() {
    let content =
        text("time,a,b,state", |i, [t, a, b]| format!("{t},{a},{b},{}", ["walk", "idle"][i / 7 % 2]));
    let reported = with(content.as_bytes(), &[]).expect_err("words");
    for words in ["line 2, column 'state': 'walk' is not a number", "--encode codes", "--columns"] {
        assert!(reported.contains(words), "{reported}");
    }
    let model = with(content.as_bytes(), &["--encode", "codes"]).expect("encoded");
    assert!(model["warnings"].to_string().contains("words of column 'state' as codes: 0 idle, 1 walk"));
    assert_eq!(
        with(content.as_bytes(), &["--columns", "!state"]).expect("left out")["features"]
            .as_array()
            .map(Vec::len),
        Some(2)
    );
}

#[cfg(unix)]
#[test]
fn a_pipe_is_read_once() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("data.csv"), plain()).expect("writes");
    let expected = with(plain().as_bytes(), &[]).expect("reads");
    for file in ["/dev/stdin", "-"] {
        let program = env!("CARGO_BIN_EXE_roscausal");
        let line =
            format!("cat data.csv | {program} discover {file} --method pcmci --test parcorr --format json");
        let out = Command::new("sh").args(["-c", &line]).current_dir(dir.path()).output().expect("runs");
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let model: Value = serde_json::from_slice(&out.stdout).expect("JSON");
        assert_eq!(model["links"], expected["links"]);
    }
}

#[test]
fn a_hole_splits_a_table_and_is_told() {
    let content = text("time,a,b", |i, [t, a, b]| format!("{},{a},{b}", if i < 90 { t } else { t + 20.0 }));
    let model = with(content.as_bytes(), &[]).expect("reads");
    assert_eq!((&model["n_recordings"], &model["n_samples"]), (&2.into(), &196.into()));
    assert!(model["warnings"].to_string().contains("1 gap of more than 1.25 s (the longest 20.25 s)"));
    let model = with(content.as_bytes(), &["--max-gap", "60"]).expect("reads");
    assert_eq!(model["n_recordings"], 1);
}

#[test]
fn uneven_steps_are_an_error_and_are_resampled_when_asked() {
    let uneven =
        text("time,a,b", |i, [t, a, b]| format!("{},{a},{b}", t + 0.2 * ((i * 37 % 101) as f64 / 101.0)));
    let reported = with(uneven.as_bytes(), &[]).expect_err("uneven");
    assert!(
        reported.contains("its steps are uneven")
            && reported.contains("--dt")
            && reported.contains("--resample last"),
        "{reported}"
    );
    for how in ["last", "mean", "linear"] {
        let model = with(uneven.as_bytes(), &["--dt", "0.5", "--resample", how]).expect("resampled");
        assert!((model["dt"].as_f64().expect("a step") - 0.5).abs() < 1e-9);
        assert!(
            model["warnings"].to_string().contains("resampled to steps of 0.5 s"),
            "{}",
            model["warnings"]
        );
    }
    assert!(with(uneven.as_bytes(), &["--resample", "mean"]).expect_err("no step").contains("--dt"));
    assert!(with(b"a,b\n1,2\n2,1\n", &["--dt", "1"]).expect_err("no times").contains("it has no times"));
}

#[test]
fn a_little_jitter_is_measured_and_told() {
    let content = text("time,a,b", |i, [t, a, b]| format!("{},{a},{b}", t + 0.02 * (i % 3) as f64));
    let model = with(content.as_bytes(), &[]).expect("even enough");
    assert!(model["warnings"].to_string().contains("steps of 0.27 s vary by"), "{}", model["warnings"]);
}

#[test]
fn files_with_different_steps_are_resampled_to_one_when_asked() {
    let dir = tempfile::tempdir().expect("a folder");
    fs::write(dir.path().join("slow.csv"), plain()).expect("writes");
    let fast = text("time,a,b", |_, [t, a, b]| format!("{},{a},{b}", t * 0.4));
    fs::write(dir.path().join("fast.csv"), fast).expect("writes");
    assert!(
        analyse(dir.path(), "slow.csv", &["fast.csv"])
            .expect_err("two steps")
            .contains("resample them (--dt)")
    );
    let model = analyse(dir.path(), "slow.csv", &["fast.csv", "--dt", "0.5"]).expect("resampled");
    assert_eq!((&model["n_recordings"], &model["dt"]), (&2.into(), &0.5.into()));
}

#[test]
fn the_user_has_the_last_word_on_the_times() {
    let content = text("when,a,b", |_, [t, a, b]| format!("{},{a},{b}", t * 400.0));
    let model = with(content.as_bytes(), &["--time-column", "when", "--time-unit", "ms"]).expect("reads");
    assert!((model["dt"].as_f64().expect("a step") - 0.1).abs() < 1e-9);
    let model = with(plain().as_bytes(), &["--time-column", "none", "--columns", "a,b"]).expect("reads");
    assert_eq!(model["dt"], Value::Null);
    assert!(
        with(plain().as_bytes(), &["--time-column", "tme"])
            .expect_err("unknown")
            .contains("did you mean 'time'?")
    );
}

#[test]
fn an_integer_for_a_missing_value_is_missing_when_it_is_named() {
    let content =
        text("time,a,b", |i, [t, a, b]| format!("{t},{a},{}", if i % 20 == 3 { -999.0 } else { b }));
    let model = with(content.as_bytes(), &["--missing-value", "-999"]).expect("reads");
    assert!(model["warnings"].to_string().contains("'b': 10 of 200 cells"), "{}", model["warnings"]);
    assert_eq!(model["graph"][0][1][1], "-->");
}

#[test]
fn tables_without_names_or_with_numbers_for_names_are_read() {
    let expected = with(plain().as_bytes(), &["--time-column", "none", "--columns", "a,b"]).expect("a model");
    let bare =
        |separator: &str| text("", |_, [_, a, b]| format!("{a}{separator}{b}")).trim_start().to_owned();
    let table = |header: &str| text(header, |_, [_, a, b]| format!("{a},{b}"));
    let index = |header: &str| text(header, |i, [_, a, b]| format!("{i},{a},{b}"));
    for (content, names) in [
        (bare(","), ["x_0", "x_1"]),
        (bare("  "), ["x_0", "x_1"]),
        (bare(";").replace('.', ","), ["x_0", "x_1"]),
        (format!("# made by hand\n\n# twice\n{}", bare(",")), ["x_0", "x_1"]),
        (index(",0,1"), ["0", "1"]),
        (table("0,1"), ["0", "1"]),
        (table("1,2"), ["1", "2"]),
        (table("# a,b"), ["a", "b"]),
    ] {
        let model =
            with(content.as_bytes(), &[]).unwrap_or_else(|reported| panic!("{reported}: {}", &content[..60]));
        assert_eq!(model["features"], serde_json::json!(names), "{}", &content[..40]);
        assert_eq!(model["val_matrix"], expected["val_matrix"], "{}", &content[..40]);
    }
    let named = with(bare(",").as_bytes(), &["--names", "speed,risk"]).expect("reads");
    assert_eq!(named["features"], serde_json::json!(["speed", "risk"]));
    let renamed = with(plain().as_bytes(), &["--names", "time,speed,risk"]).expect("reads");
    assert_eq!((&renamed["features"], &renamed["dt"]), (&serde_json::json!(["speed", "risk"]), &0.25.into()));
    assert!(
        with(bare(",").as_bytes(), &["--names", "a"]).expect_err("one").contains("1 names for 2 columns")
    );
    let reported = with(b"# c\n# d\n1.5,2\n3,x\n", &[]).expect_err("a word");
    assert!(reported.contains("line 4, column 'x_1': 'x'"), "{reported}");
    let reported =
        with(plain().as_bytes(), &["--no-header", "--time-column", "none"]).expect_err("words in line 1");
    assert!(reported.contains("line 1, column 'x_0': 'time'"), "{reported}");
    let timed =
        with(text("", |_, [t, a, b]| format!("{t},{a},{b}")).trim_start().as_bytes(), &[]).expect("reads");
    assert_eq!((timed["dt"].as_f64(), &timed["features"]), (Some(0.25), &serde_json::json!(["x_1", "x_2"])));
    let wide =
        (0..10).map(|i| (0..400).map(|k| format!("0.{}", i * 7 + k)).collect::<Vec<_>>().join(",") + "\n");
    let reported = with(wide.collect::<String>().as_bytes(), &[]).expect_err("on its side");
    assert!(reported.contains("rows of 400 numbers") && reported.contains("transpose"), "{reported}");
}

#[test]
fn what_counts_rows_or_says_when_is_left_out_and_named_unless_it_is_kept() {
    let content = text("__time,h.header.seq,year,month,a,b", |i, [t, a, b]| {
        format!("{t},{},{},{},{a},{b}", i + 7, 1980 + i / 12, 1 + i % 12)
    });
    let model = with(content.as_bytes(), &[]).expect("reads");
    assert_eq!((&model["features"], &model["dt"]), (&serde_json::json!(["a", "b"]), &0.25.into()));
    let reported = model["warnings"].to_string();
    assert!(
        reported.contains("h.header.seq counts the rows; year, month say when a row is; --keep has it"),
        "{reported}"
    );
    let kept = with(content.as_bytes(), &["--keep", "month,year"]).expect("reads");
    assert_eq!(kept["features"], serde_json::json!(["year", "month", "a", "b"]));
    assert_eq!(with(content.as_bytes(), &["--keep", "all"]).expect("reads")["features"][0], "h.header.seq");
    let named = with(content.as_bytes(), &["--columns", "month,a,b"]).expect("reads");
    assert_eq!(named["features"][0], "month");
}

#[test]
fn several_recordings_in_one_table_are_told_apart() {
    let named = |names: [&str; 3]| {
        text("run,time,a,b", |i, [t, a, b]| {
            format!("{},{},{a},{b}", names[i / 67], t - 0.25 * 67.0 * (i / 67) as f64)
        })
    };
    let reported = with(named(["1", "2", "3"]).as_bytes(), &[]).expect_err("the time begins anew");
    assert!(reported.contains("line 69") && reported.contains("--recording 'run'"), "{reported}");
    let content = named(["left", "right", "left again"]);
    for column in ["run", "time"] {
        let more = if column == "time" { &["--columns", "a,b"][..] } else { &[] };
        let model = with(content.as_bytes(), &[&["--recording", column], more].concat()).expect("reads");
        assert_eq!((&model["n_recordings"], &model["dt"]), (&3.into(), &0.25.into()), "{column}");
        assert_eq!(model["features"], serde_json::json!(["a", "b"]));
        assert_eq!(model["n_samples"], 194, "two samples less for each recording");
    }
    let panel = text("id,a,b", |i, [_, a, b]| format!("{},{a},{b}", 1 + i / 50));
    let model = with(panel.as_bytes(), &[]).expect("reads");
    assert_eq!(model["features"], serde_json::json!(["a", "b"]));
    assert!(model["warnings"].to_string().contains("--recording id"), "{}", model["warnings"]);
    assert!(
        with(panel.as_bytes(), &["--recording", "idd"]).expect_err("no such").contains("no column 'idd'")
    );
}

#[test]
fn rounded_times_and_working_days_are_one_step() {
    let at = |i: usize| 1.7e9 + i as f64 / 30.0;
    let content = text("time,a,b", |i, [_, a, b]| format!("{:.2},{a},{b}", at(i)));
    let model = with(content.as_bytes(), &[]).expect("30 Hz");
    assert!((model["dt"].as_f64().expect("a step") - 1.0 / 30.0).abs() < 1e-5, "{}", model["dt"]);
    assert!(model["warnings"].to_string().contains("rounded to 0.01 s"), "{}", model["warnings"]);
    // Monday to Friday, from 1 January 2024 on.
    let content =
        text("date,a,b", |i, [_, a, b]| format!("{},{a},{b}", (19_723 + i / 5 * 7 + i % 5) * 86_400));
    let model = with(content.as_bytes(), &[]).expect("working days");
    assert_eq!(model["n_recordings"], 1);
    assert!(model["summary"]["headline"].to_string().contains("at steps of 1 day"), "{}", model["summary"]);
}
