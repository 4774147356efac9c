//! Hostile scenario files: no panic, and memory proportional to the file.

use std::path::Path;

use roscausal_fuzz::{Allocator, Target};
use roscausal_hrisim::{Scenario, scenario::SCENARIOS};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

#[test]
fn a_hostile_scenario_is_refused_or_read() {
    let target = Target {
        corpus: format!("{}/tests/corpus/scenario", env!("CARGO_MANIFEST_DIR")).into(),
        seeds: SCENARIOS
            .iter()
            .filter_map(|name| toml::to_string(&Scenario::named(name)?).ok().map(String::into_bytes))
            // too deep for a recursive reader
            .chain([format!("a = {}", "[".repeat(50_000)).into_bytes()])
            .collect(),
        tokens: &[
            b"[[", b"]]", b"=", b"nan", b"inf", b"1e308", b"-1", b"{", b"9223372036854775807", b"\n",
            b"[a.b]\n",
        ],
        bytes_per_byte: 2000,
    };
    target.run(|input| {
        if let Ok(scenario) = Scenario::from_toml(&String::from_utf8_lossy(input), Path::new("hostile.toml"))
        {
            let _ = scenario.world();
        }
    });
}
