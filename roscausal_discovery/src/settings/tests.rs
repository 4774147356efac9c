//! What holds for every entry of the table.

use std::{fmt::Write, fs, path::Path};

use serde_json::json;

use super::*;
use crate::independence_tests::TestSettings;

#[test]
fn every_field_of_the_settings_has_an_entry() {
    let Request { settings, vectors: _, links: _, resampling, threads: _, time_budget: _ } =
        Request::default();
    // A new field is missing here, and wants an entry.
    let Settings {
        method: _,
        cond_ind_test: _,
        test,
        alpha: _,
        pc_alpha: _,
        tau_min: _,
        tau_max: _,
        f_alpha: _,
        te_estimator: _,
        neglect_only_autodep: _,
        fdr: _,
        exogenous: _,
        acts_on: _,
        seed: _,
        link_assumptions: _,
        max_conds: _,
        max_sets: _,
        extra_conditions: _,
        levels: _,
        pcmciplus: _,
    } = settings;
    let Resampling { resamples: _, scheme: _, share: _, block: _ } = resampling;
    // Confidence intervals and the seed are another one's.
    let TestSettings {
        significance: _,
        sig_samples: _,
        sig_blocklength: _,
        confidence: _,
        conf_lev: _,
        conf_samples: _,
        conf_blocklength: _,
        seed: _,
        knn: _,
        shuffle_neighbors: _,
        shuffle_stop: _,
        transform: _,
        categories: _,
        gp_search: _,
        gp_restarts: _,
        null_distributions: _,
        as_tigramite: _,
        max_memory: _,
    } = test;
    // Of the settings 17, of the test 13, and two of PCMCI+; of the request four; four of resampling. Links are the request's.
    assert_eq!(SETTINGS.len(), 17 + 13 + 2 + 4 + 4);
}

#[test]
fn names_are_unique_and_every_entry_says_what_it_is() {
    for (place, one) in SETTINGS.iter().enumerate() {
        for name in [one.id, one.flag, one.param] {
            let others = SETTINGS[..place].iter().chain(&SETTINGS[place + 1..]);
            assert!(
                others.clone().all(|other| ![other.id, other.flag, other.param].contains(&name)),
                "{name} twice"
            );
            assert!(setting(name).is_some_and(|found| found.id == one.id), "{name}");
        }
        assert!(!one.help.is_empty() && !one.help.ends_with('.') && !one.help.contains('|'), "{}", one.id);
        assert_eq!(
            one.default_value().is_null(),
            !one.unset.is_empty(),
            "{}: what if it is not set?",
            one.id
        );
    }
}

/// A value that is not the default.
fn another_value(one: &Setting) -> Value {
    match one.kind {
        Kind::Flag => json!(one.default_value() == json!(false)),
        Kind::Count(least, _) => json!(least + 2),
        Kind::Lag => json!(3),
        Kind::Number(..) | Kind::NumberOr(..) => json!(0.25),
        Kind::Bytes => json!(3_000_000),
        Kind::Word(words) => json!(words[words.len() - 1]),
        Kind::Method | Kind::Test => json!(one.kind.words()[1]),
        Kind::Text => json!("7"),
        Kind::List(form) if form.contains('=') => json!(["a=b"]),
        Kind::List(_) => json!(["a", "b"]),
        Kind::File("csv") => json!("10\n0.5\n"),
        Kind::File(_) => json!({ "only": true, "link": [] }),
    }
}

#[test]
fn a_model_holds_every_setting_that_describes_its_analysis() {
    // Vectors are its variables, and resampling has fields of its own.
    let of_model = |one: &&Setting| one.of_data && one.group == Group::Method && one.id != "vectors";
    let usual = json!(Settings::default().blank_model());
    assert!(usual.get("settings").is_none(), "{usual}");
    for one in SETTINGS.iter().filter(of_model) {
        let (mut request, value) = (Request::default(), another_value(one));
        one.put(&mut request, &value).expect(one.id);
        let model = json!(request.settings.blank_model());
        let field = model.get(one.id).or_else(|| model.get(one.param));
        assert_eq!(field.or_else(|| model["settings"].get(one.id)), Some(&value), "{}: {model}", one.id);
    }
}

#[test]
fn a_value_is_read_as_it_is_written_and_kept_where_it_is_asked_for() {
    for one in &SETTINGS {
        let mut request = Request::default();
        let value = another_value(one);
        one.put(&mut request, &value).expect(one.id);
        if matches!(one.kind, Kind::File(_)) {
            assert!(!(one.get)(&request).is_null(), "{}", one.id);
            continue;
        }
        assert_eq!((one.get)(&request), value, "{}", one.id);
        assert_eq!(one.read(&one.written(&value)).expect(one.id), value, "{}", one.id);
        let wrong = one.put(&mut request, &json!({ "a": 1 })).expect_err(one.id).to_string();
        assert!(wrong.contains(&format!("'{}'", one.id)), "{wrong}");
    }
}

#[test]
fn a_method_with_one_level_has_it_by_either_name() {
    let asked = |ids: &[(&str, f64)]| {
        let method = [("method", json!("pcmciplus"))].into_iter();
        let given = method.chain(ids.iter().map(|(id, value)| (*id, json!(value))));
        let given: Vec<_> = given.map(|(id, value)| (setting(id).expect("a setting"), value)).collect();
        let request = Request::of(&given)?;
        request.check().map(|()| request.settings.pc_alpha)
    };
    assert_eq!(asked(&[("alpha", 0.05)]).expect("one"), PcAlpha::Fixed(0.05));
    assert_eq!(asked(&[("alpha", 0.01)]).expect("one"), asked(&[("pc_alpha", 0.01)]).expect("one"));
    let both = asked(&[("alpha", 0.02), ("pc_alpha", 0.01)]).expect_err("two levels").to_string();
    assert!(both.contains("pcmciplus has one level"), "{both}");
}

#[test]
fn what_nobody_reads_is_refused_with_those_who_do() {
    let asked = |method: &str, test: &str, id: &str, value: Value| {
        let names = [("method", json!(method)), ("test", json!(test)), (id, value)];
        let given = names.map(|(id, value)| (setting(id).expect("a setting"), value));
        Request::of(&given).and_then(|request| request.check()).map_err(|error| error.to_string())
    };
    for (method, test, id, value, says) in [
        (
            "granger",
            "gpdc",
            "gp_restarts",
            json!(2),
            "granger uses no independence test; it applies to the test gpdc",
        ),
        (
            "pcmci",
            "parcorr",
            "knn",
            json!(0.1),
            "parcorr has no nearest neighbours; it applies to the test cmiknn",
        ),
        ("pcmci", "parcorr", "shuffles", json!(99), "or with significance shuffle"),
        ("pcmci", "parcorr", "max_sets", json!(1), "it applies to lpcmci and candoit"),
        ("lpcmci", "parcorr", "fdr", json!("fdr_bh"), "has no p-values of single tests"),
        ("granger", "parcorr", "links", json!([]), "does not read what is known"),
        ("pcmci", "parcorr", "vectors", json!(["a=b+c"]), "parcorrmult"),
    ] {
        let error = asked(method, test, id, value).expect_err(id);
        assert!(error.contains(&format!("'{id}'")) && error.contains(says), "{error}");
    }
    for (method, test, id, value) in [
        ("pcmci", "parcorr", "alpha", json!(0.01)),
        ("timino", "gpdc", "gp_restarts", json!(2)),
        ("pcmci", "cmiknn", "knn", json!(12)),
        ("pcmci", "cmiknn", "transform", json!("none")),
        ("pcmci", "parcorrmult", "vectors", json!({ "a": ["b", "c"] })),
        ("pcmci", "gpdc", "shuffles", json!(99)),
    ] {
        asked(method, test, id, value).expect(id);
    }
}

/// Words in lines of at most 120 characters, after `indent`.
fn wrapped(text: &str, indent: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().expect("a line");
        if !line.is_empty() && line.len() + word.len() > 120 {
            lines.push(word.to_owned());
        } else {
            *line += if line.is_empty() { "" } else { " " };
            *line += word;
        }
    }
    lines.join(&format!("\n{indent}"))
}

/// The type of a setting in Python; None always means "as if it were left out".
fn python_type(setting: &Setting) -> String {
    let literal = |words: &[&str]| format!("Literal[\"{}\"]", words.join("\", \""));
    let path = "str | os.PathLike[str]";
    match setting.kind {
        Kind::Flag => "bool".into(),
        Kind::Count(..) | Kind::Lag | Kind::Bytes => "int".into(),
        Kind::Number(..) => "float".into(),
        Kind::NumberOr(.., word) => format!("float | {}", literal(&[word])),
        Kind::Word(words) => literal(words),
        Kind::Method | Kind::Test => "Method | str".into(),
        Kind::Text => "int | str".into(),
        Kind::List("COLUMN") => "Sequence[str]".into(),
        Kind::List("COLUMN=VARIABLE") => "Mapping[str, str]".into(),
        Kind::List(_) => "Mapping[str, Sequence[str]]".into(),
        Kind::File("csv") => format!("{path} | Mapping[int, Sequence[float]]"),
        Kind::File(_) => format!("{path} | Mapping[str, Any] | Sequence[Mapping[str, Any]]"),
    }
}

/// `ROSCAUSAL_WRITE_DOCS=1 cargo test -p roscausal_discovery the_types_of_python` writes the file anew.
#[test]
fn the_types_of_python_are_those_of_the_table() {
    let methods: Vec<String> = Method::names().map(|name| format!("\"{name}\"")).collect();
    let mut text = format!(
        "\"\"\"The types of the settings of an analysis. Made from the table of settings by its tests.\"\"\"\n\n\
         from __future__ import annotations\n\nimport os\nfrom collections.abc import Mapping, Sequence\n\
         from typing import Any, Literal, TypedDict\n\nMethod = Literal[\n    {},\n]  # fmt: skip\n\n\n\
         class Settings(TypedDict, total=False):\n    \"\"\"What `rc.discover` takes beside the data and the test.\"\"\"\n",
        wrapped(&methods.join(", "), "    ")
    );
    // The test may be one of the user's own, so it is an argument by itself.
    for setting in SETTINGS.iter().filter(|setting| setting.id != "test") {
        let unset = if setting.unset.is_empty() { "." } else { &format!("; None: {}.", setting.unset) };
        let unit = if setting.kind == Kind::Bytes { ", in bytes" } else { "" };
        let about = wrapped(&format!("{}{unit}{unset}", setting.help), "    ");
        let _ =
            write!(text, "\n    {}: {} | None\n    \"\"\"{about}\"\"\"\n", setting.id, python_type(setting));
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../roscausal_py/python/roscausal/settings.pyi");
    if std::env::var_os("ROSCAUSAL_WRITE_DOCS").is_some() {
        fs::write(&path, &text).expect("writes");
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    assert!(written == text, "settings.pyi is old: run with ROSCAUSAL_WRITE_DOCS=1");
}
