//! Two hundred random networks of `tests/golden/quality`: the same graphs as the reference, link by link.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../examples/golden/driver.rs"]
#[allow(dead_code, reason = "the reading of files is shared, the rest is another test's")]
mod driver;

use std::path::{Path, PathBuf};

use roscausal_discovery::{
    Control, DataFrame,
    independence_tests::{ParCorr, TestSettings},
    methods::{PcmciPlusSettings, PcmciResult, PcmciSettings, run_pcmci, run_pcmciplus},
};

/// The folder of networks.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden/quality")
}

fn check(file: &str, level: f64, run: impl Fn(&DataFrame) -> PcmciResult) {
    let folder = folder();
    let graphs = driver::read_json(&folder.join(file)).unwrap();
    let graphs = graphs.as_object().unwrap();
    assert_eq!(graphs.len(), 100);
    for (id, golden) in graphs {
        let (names, table) = driver::read_csv(&folder.join(format!("data/{id}.csv"))).unwrap();
        let result = run(&DataFrame::new(vec![table], names).unwrap());
        for ((i, j, lag), mark) in result.graph.indexed_iter() {
            let p = golden["p"][i][j][lag].as_f64().unwrap_or(1.0);
            let expected = golden["graph"][i][j][lag].as_str().unwrap();
            assert!(
                mark.symbol() == expected || (p - level).abs() < 1e-6,
                "{id}: {i} -> {j} at lag {lag}: '{mark}' for '{expected}' (p = {p})"
            );
        }
    }
}

fn pcmci(data: &DataFrame) -> PcmciResult {
    let test = ParCorr::new(&TestSettings::default()).unwrap();
    let settings = PcmciSettings { tau_max: 2, ..PcmciSettings::default() };
    run_pcmci(data, &test, &settings, &Control::default()).unwrap()
}

#[test]
fn pcmci_gives_the_graphs_of_the_reference() {
    check("graphs_A_pcmci_parcorr.json", 0.05, pcmci);
}

#[test]
fn pcmci_gives_the_graphs_of_the_reference_without_links() {
    check("graphs_C_pcmci_parcorr_null.json", 0.05, pcmci);
}

#[test]
fn pcmciplus_gives_the_graphs_of_the_reference() {
    check("graphs_A_pcmciplus_parcorr_a05.json", 0.05, |data| {
        let test = ParCorr::new(&TestSettings::default()).unwrap();
        let settings =
            PcmciSettings { tau_min: 0, tau_max: 2, pc_alpha: vec![0.05], ..PcmciSettings::default() };
        run_pcmciplus(data, &test, &settings, &PcmciPlusSettings::default(), &Control::default()).unwrap()
    });
}
