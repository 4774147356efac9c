//! Hostile graphs and structural models: no panic, and memory proportional to the text.

#![allow(clippy::expect_used, reason = "a test may panic: that is how it fails")]

use ndarray::Array2;
use roscausal_discovery::DataFrame;
use roscausal_fuzz::{Allocator, Target};
use roscausal_reasoning::model::{Equations, Settings, StructuralModel, graph_of_json};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

const TOKENS: [&[u8]; 9] =
    [b"[", b"{\"a\":", b"1e999", b"null", b"\"\\ud800\"", b"\"x-x\"", b"\"o-o\"", b"\"lag\": 0", b","];
const GRAPH: &str = r#"{"links": [{"cause": "a", "effect": "b", "lag": 1}, {"cause": "b", "effect": "b", "lag": 2},
    {"cause": "b", "effect": "c", "lag": 0, "mark": "o-o"}], "variables": ["a", "b", "c"], "units": {"a": "m/s"}, "dt": 0.3}"#;

fn run(name: &str, seeds: Vec<Vec<u8>>, bytes_per_byte: usize, decode: impl Fn(&str)) {
    let corpus = format!("{}/tests/corpus/{name}", env!("CARGO_MANIFEST_DIR")).into();
    let target = Target { corpus, seeds, tokens: &TOKENS, bytes_per_byte };
    target.run(|input| decode(&String::from_utf8_lossy(input)));
}

#[test]
fn a_hostile_graph_is_refused_or_read() {
    let model = include_bytes!("../../roscausal_core/tests/corpus/json/model.json");
    run("graph", vec![GRAPH.into(), model.to_vec()], 2000, |text| {
        let _ = graph_of_json(text, &[]);
        let _ = graph_of_json(text, &["a".to_owned(), "r_do".to_owned()]);
    });
}

#[test]
fn a_hostile_structural_model_is_refused_or_read() {
    let row =
        |(t, k): (usize, usize)| ((t * 7 + k * 3) % 11) as f64 + if k > 0 { (t % 5) as f64 } else { 0.0 };
    let data = DataFrame::new(
        vec![Array2::from_shape_fn((60, 3), row)],
        ["a", "b", "c"].map(str::to_owned).to_vec(),
    );
    let (graph, facts) = graph_of_json(GRAPH, &[]).expect("a graph");
    let model = |equations| {
        let settings = Settings { equations, ..Settings::default() };
        let fitted = StructuralModel::fit(data.as_ref().expect("data"), &graph, &settings, &Vec::new())
            .expect("a model");
        fitted.with_facts(facts.clone()).to_json().into_bytes()
    };
    run("structural_model", vec![model(Equations::Linear), model(Equations::Gp)], 20_000, |text| {
        let _ = StructuralModel::from_json(text);
    });
}
