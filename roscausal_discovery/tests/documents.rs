//! What the repository's documents say of methods and tests is what the registries hold.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::{collections::BTreeSet, path::Path};

use ndarray::Array2;
use roscausal_discovery::{
    Control, DataFrame, DataProfile, Link, LinkMark, LinkSize, Model, Outcome, Settings,
    confidence::{Resampling, analyse_resampled},
    independence_tests,
    methods::Method,
    mix,
};
use serde_json::Value;

#[test]
fn the_documents_name_every_method_and_every_test() {
    let above = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for document in ["docs/methods.md", "docs/model-schema.md", "roscausal_discovery/README.md"] {
        let text = std::fs::read_to_string(above.join(document)).expect(document);
        let known = Method::names().chain(independence_tests::names()).filter(|name| *name != "gpdcpython");
        for name in known {
            assert!(text.contains(&format!("`{name}`")), "{document} does not name `{name}`");
        }
    }
}

#[test]
fn the_readme_is_read_in_two_minutes() {
    let readme = Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md");
    let words = std::fs::read_to_string(readme).expect("the README").split_whitespace().count();
    assert!(words < 900, "{words} words; the rest goes to docs");
}

#[test]
fn the_front_page_says_of_each_method_and_test_what_the_registries_hold() {
    let page = include_str!("../src/lib.rs");
    for name in Method::names().chain(independence_tests::names()).filter(|name| *name != "gpdcpython") {
        assert!(page.contains(&format!("//! | `{name}` |")), "the front page has no line of {name}");
    }
    assert!(
        page.contains("All take several recordings as one system and, all but `dynotears`, give a p-value")
    );
    assert!(page.contains("only `lpcmci`, `candoit` and `tsfci` allow for"));
    for info in Method::all().map(Method::info) {
        assert!(info.several_recordings, "{}", info.name);
        assert_eq!(info.p_values, info.name != "dynotears", "{}", info.name);
    }
    let with_hidden: Vec<&str> =
        Method::all().map(Method::info).filter(|info| info.hidden_causes).map(|info| info.name).collect();
    assert_eq!(with_hidden, ["lpcmci", "candoit", "tsfci"]);
}

/// A model with all that a model may have, of two variables of which one drives the other.
fn whole_model() -> Model {
    let noise = |k: usize| mix(k as u64) as f64 / u64::MAX as f64;
    let mut values = Array2::from_shape_fn((200, 2), |(row, var)| noise(2 * row + var));
    for row in 1..200 {
        values[[row, 1]] += values[[row - 1, 0]];
    }
    let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()]).unwrap();
    let settings = Settings { cond_ind_test: "parcorr".into(), method: Method::Pcmci, ..Settings::default() };
    let resampling = Resampling { resamples: 20, ..Resampling::default() };
    let mut model = analyse_resampled(&data, &settings, &resampling, &Control::default()).unwrap();
    model.about_data = Some(DataProfile::of(&data, 1).0);
    model.settings.insert("knn".into(), Value::from(5));
    model.links = vec![Link {
        chance: Some(0.5),
        size: Some(LinkSize { step: 1.0, change: 1.0, low: 0.0, high: 2.0 }),
        since: Some(0.0),
        seen: Some(1),
        required: true,
        ..Link::default()
    }];
    model
}

#[test]
fn the_schema_has_the_fields_marks_and_outcomes_of_the_types_and_no_others() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/model.schema.json");
    let schema: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let fields = |of: &Value| of.as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>();
    let model: Value = serde_json::from_str(&whole_model().to_json()).unwrap();
    assert_eq!(fields(&schema["properties"]), fields(&model));
    assert_eq!(fields(&schema["$defs"]["link"]["properties"]), fields(&model["links"][0]));
    let listed = |of: &Value| serde_json::from_value::<Vec<String>>(of["enum"].clone()).unwrap();
    let marks: Vec<&str> = LinkMark::ALL.iter().skip(1).map(|mark| mark.symbol()).collect();
    assert_eq!(listed(&schema["$defs"]["mark"]), marks);
    let outcomes =
        Outcome::ALL.map(|outcome| serde_json::to_value(outcome).unwrap().as_str().unwrap().to_owned());
    assert_eq!(listed(&schema["properties"]["outcomes"]["items"]["items"]["items"]), outcomes);
}
