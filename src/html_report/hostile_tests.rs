//! Hostile models and evidence for a report.

use std::fs;

use ndarray::Array2;
use roscausal_discovery::{Control, DataFrame, Settings, analyse_with_evidence, methods::Method};

use super::{latex, page, source};
use crate::{
    folders::EVIDENCE,
    hostile_tests::{JSON, run},
};

/// A model with links within a moment, and its evidence, as files.
fn analysed() -> [Vec<u8>; 2] {
    let value = |(t, k): (usize, usize)| {
        let noise = |i: usize| ((12.9898 * i as f64).sin() * 43_758.545).fract();
        noise(t) * k as f64 + noise(3 * t + k) + if k > 0 { noise(3 * t) } else { 0.0 }
    };
    let names = ["a", "b", "c"].map(str::to_owned).to_vec();
    let data = DataFrame::new(vec![Array2::from_shape_fn((100, 3), value)], names).expect("data");
    let settings = Settings {
        method: Method::Pcmciplus,
        cond_ind_test: "parcorr".into(),
        tau_min: 0,
        tau_max: 1,
        ..Settings::default()
    };
    let (model, evidence) = analyse_with_evidence(&data, &settings, &Control::default()).expect("a model");
    assert!(model.links.iter().any(|link| link.lag == 0), "{:?}", model.links);
    [model.to_file_json().into_bytes(), evidence.to_json().into_bytes()]
}

#[test]
fn a_hostile_model_or_evidence_is_refused_or_a_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).expect("a file");
    let [model, evidence] = analysed();
    let report = || {
        let material = source::stored(folder.path()).ok()?;
        let _ = (page::html(&material), latex::table(&material.model), latex::tikz(&material.model));
        Some(material)
    };
    write("model.json", &model);
    write(EVIDENCE, &evidence);
    assert!(report().is_some_and(|material| material.evidence.is_some()));
    run("report_evidence", vec![evidence.clone()], &JSON, 20_000, |input| {
        write(EVIDENCE, input);
        report();
    });
    write(EVIDENCE, &evidence);
    run("report_model", vec![model], &JSON, 20_000, |input| {
        write("model.json", input);
        report();
    });
}
