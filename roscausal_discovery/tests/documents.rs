//! What the repository's documents say of methods and tests is what the registries hold.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::path::Path;

use roscausal_discovery::{independence_tests, methods::Method};

#[test]
fn the_documents_name_every_method_and_every_test() {
    let above = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for document in ["README.md", "docs/model-schema.md", "roscausal_discovery/README.md"] {
        let text = std::fs::read_to_string(above.join(document)).expect(document);
        let known = Method::names().chain(independence_tests::names()).filter(|name| *name != "gpdcpython");
        for name in known {
            assert!(text.contains(&format!("`{name}`")), "{document} does not name `{name}`");
        }
    }
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
