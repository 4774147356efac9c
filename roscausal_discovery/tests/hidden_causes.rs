//! With an oracle as the test, what LPCMCI says of causes is true, also where variables are hidden.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::sync::atomic::{AtomicUsize, Ordering};

use ndarray::Array2;
use proptest::prelude::*;
use roscausal_discovery::{
    Assumption, CondIndTest, Control, DataFrame, LinkAssumptions, LinkEnd, LinkMark, Node, PreparedTest,
    Result, Samples, TestResult,
    independence_tests::OracleCi,
    methods::{Intervened, LpcmciSettings, Status, run_candoit, run_lpcmci, run_tsfci},
};
use serde_json::Value;

const OBSERVED: usize = 4;
const ALL: usize = 5;

/// Knows the graph of all variables, and answers for those that are observed.
struct Oracle(OracleCi, Vec<usize>);

impl CondIndTest for Oracle {
    fn name(&self) -> &'static str {
        "oracle"
    }

    fn prepare<'a>(&'a self, _: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        Ok(Box::new(self))
    }
}

impl PreparedTest for &Oracle {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let full = |node: Node| Node::new(self.1[node.var], node.lag);
        let z: Vec<Node> = z.iter().copied().map(full).collect();
        let (value, p_value) =
            if self.0.is_separated(full(x), full(y), &z) { (0.0, 1.0) } else { (1.0, 0.0) };
        Ok(TestResult { value, p_value, confidence: None, n_samples: 0, n_lost: 0, dependent: None })
    }
}

type Links = Vec<(usize, usize, usize)>;

/// Random links (cause, effect, lag); those at lag 0 go from a smaller to a larger variable. The last variable is hidden.
fn links() -> impl Strategy<Value = Links> {
    prop::collection::vec((0..ALL, 0..ALL, 0..2_usize), 2..8).prop_map(|mut links| {
        links.retain(|&(i, j, lag)| lag > 0 || i < j);
        // The hidden one may drive all, and has a past.
        links.extend([(4, 0, 1), (4, 2, 1)]);
        links.sort_unstable();
        links.dedup();
        links
    })
}

fn oracle(links: &[(usize, usize, usize)]) -> Oracle {
    oracle_of(ALL, links, (0..ALL).collect())
}

fn oracle_of(n_vars: usize, links: &[(usize, usize, usize)], observed: Vec<usize>) -> Oracle {
    let mut truth = LinkAssumptions::none(n_vars);
    links.iter().for_each(|&(i, j, lag)| truth.insert(i, j, lag, Assumption::Exists).unwrap());
    Oracle(OracleCi::new(&truth).unwrap(), observed)
}

fn any_data(n_vars: usize) -> DataFrame {
    let names = (0..n_vars).map(|var| format!("X{var}")).collect();
    DataFrame::new(vec![Array2::zeros((50, n_vars))], names).unwrap()
}

/// Whether `i` at `t - lag` causes `j` at `t`, over any path.
fn causes(links: &Links, i: usize, j: usize, lag: usize) -> bool {
    let mut open = vec![(j, 0)];
    let mut seen = open.clone();
    while let Some((var, back)) = open.pop() {
        for &(cause, _, more) in links.iter().filter(|link| link.1 == var) {
            let node = (cause, back + more);
            if node == (i, lag) {
                return true;
            }
            if node.1 <= lag && !seen.contains(&node) {
                seen.push(node);
                open.push(node);
            }
        }
    }
    false
}

/// Whether there is a link in both or in none, and no end has a head in one and a tail in the other.
fn agrees(a: LinkMark, b: LinkMark) -> bool {
    let same = |a: LinkEnd, b: LinkEnd| a == b || a == LinkEnd::Circle || b == LinkEnd::Circle;
    match (a.ends(), b.ends()) {
        (None, None) => true,
        (Some(a), Some(b)) => same(a.0, b.0) && same(a.1, b.1),
        _ => false,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn every_tail_is_a_cause_and_every_head_is_none(links in links(), k in 0_usize..3) {
        let settings = LpcmciSettings { n_preliminary_iterations: k, ..LpcmciSettings::default() };
        let found = run_lpcmci(&any_data(OBSERVED), &oracle(&links), &settings, &Control::default()).unwrap();
        for ((i, j, lag), mark) in found.result.graph.indexed_iter() {
            let Some((left, right)) = mark.ends() else { continue };
            for (end, truth) in [(left, causes(&links, i, j, lag)), (right, lag == 0 && causes(&links, j, i, 0))] {
                prop_assert!(end != LinkEnd::Conflict);
                prop_assert!(end == LinkEnd::Circle || (end == LinkEnd::Tail) == truth, "{i} {j} {lag} {mark}");
            }
        }
    }

    #[test]
    fn tsfci_has_the_links_of_lpcmci_and_contradicts_no_mark_where_a_test_knows_the_truth(links in links()) {
        let (data, test, control) = (any_data(OBSERVED), oracle(&links), Control::default());
        let of_lpcmci = run_lpcmci(&data, &test, &LpcmciSettings::default(), &control).unwrap().result;
        let of_tsfci = run_tsfci(&data, &test, &LpcmciSettings::default(), &control).unwrap();
        for (at, mark) in of_tsfci.graph.indexed_iter() {
            prop_assert!(agrees(*mark, of_lpcmci.graph[at]), "{at:?} {mark} {}", of_lpcmci.graph[at]);
        }
    }

    #[test]
    fn a_direct_cause_stays_adjacent_and_both_readings_of_a_pair_agree(links in links()) {
        let settings = LpcmciSettings::default();
        let found = run_lpcmci(&any_data(OBSERVED), &oracle(&links), &settings, &Control::default()).unwrap();
        let graph = &found.result.graph;
        for &(i, j, lag) in links.iter().filter(|link| link.0 < OBSERVED && link.1 < OBSERVED) {
            prop_assert!(graph[[i, j, lag]].is_link(), "{i} {j} {lag}");
        }
        for i in 0..OBSERVED {
            for j in 0..OBSERVED {
                prop_assert_eq!(graph[[i, j, 0]], graph[[j, i, 0]].mirrored());
            }
        }
    }
}

#[test]
fn a_hidden_common_cause_is_called_one() {
    // 4 is hidden and drives 0 and 2; both have causes of their own, 1 and 3, which orient the link.
    let links = [(4, 0, 0), (4, 2, 0), (1, 0, 0), (3, 2, 0)];
    let (data, test) = (any_data(OBSERVED), oracle(&links));
    let settings = LpcmciSettings { tau_max: 0, ..LpcmciSettings::default() };
    let found = run_lpcmci(&data, &test, &settings, &Control::default()).unwrap();
    let fci = LpcmciSettings { tau_max: 0, ..LpcmciSettings::default() };
    let by_fci = run_tsfci(&data, &test, &fci, &Control::default()).unwrap();
    for graph in [&found.result.graph, &by_fci.graph] {
        assert_eq!(graph[[0, 2, 0]], LinkMark::Bidirected);
        assert_eq!(graph[[1, 0, 0]], LinkMark::CircleHead);
    }
}

/// 23 graphs with hidden variables: what the reference's LPCMCI finds with an oracle. tsFCI finds the same links in all of them, and
/// the same marks in all but one, where ends stay open that LPCMCI, which looks at them with more links there, can tell.
#[test]
fn lpcmci_finds_the_references_graph_of_every_oracle_case_and_tsfci_its_links() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/golden/methods/oracle.json");
    let cases: Vec<Value> = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    assert_eq!(cases.len(), 23);
    let mut open = Vec::new();
    for case in cases {
        let count = |value: &Value| value.as_u64().map(|v| v as usize);
        let counts = |list: &Value| list.as_array().unwrap().iter().filter_map(count).collect::<Vec<usize>>();
        let links = case["oracle"]["links"].as_array().unwrap().iter().map(counts);
        let links: Links = links.map(|link| (link[0], link[1], link[2])).collect();
        let observed = counts(&case["oracle"]["observed"]);
        let (data, params) = (any_data(observed.len()), &case["params"]);
        let test = oracle_of(count(&case["oracle"]["n_vars"]).unwrap(), &links, observed);
        let (tau_min, tau_max) = (count(&params["tau_min"]).unwrap_or(0), count(&params["tau_max"]).unwrap());
        let usual = LpcmciSettings::default();
        let settings = LpcmciSettings {
            tau_min,
            tau_max,
            n_preliminary_iterations: count(&params["n_preliminary_iterations"]).unwrap_or(1),
            max_cond_px: count(&params["max_cond_px"]).unwrap_or(0),
            prelim_with_collider_rules: params["prelim_with_collider_rules"].as_bool().unwrap_or(true),
            ..usual
        };
        let by_lpcmci = run_lpcmci(&data, &test, &settings, &Control::default()).unwrap().result;
        let settings = LpcmciSettings { tau_min, tau_max, ..LpcmciSettings::default() };
        let by_tsfci = run_tsfci(&data, &test, &settings, &Control::default()).unwrap();
        for ((i, j, lag), mark) in by_lpcmci.graph.indexed_iter() {
            assert_eq!(mark.symbol(), case["graph"][i][j][lag], "{} {i} {j} {lag}", case["id"]);
            let of_tsfci = by_tsfci.graph[[i, j, lag]];
            assert!(agrees(of_tsfci, *mark), "{} {i} {j} {lag}: {of_tsfci} {mark}", case["id"]);
        }
        if by_tsfci.graph != by_lpcmci.graph {
            open.push(case["id"].to_string());
        }
    }
    assert_eq!(open, ["\"lpcmci_oracle_14\""]);
}

#[test]
fn a_used_up_time_budget_gives_the_graph_so_far() {
    let asked = AtomicUsize::new(0);
    let control = Control::default().out_of_time(move || asked.fetch_add(1, Ordering::Relaxed) > 20);
    let links = vec![(0, 1, 1), (1, 2, 1), (4, 0, 1), (4, 2, 1), (0, 0, 1)];
    let found =
        run_lpcmci(&any_data(OBSERVED), &oracle(&links), &LpcmciSettings::default(), &control).unwrap();
    let Status::Partial(how_far) = &found.result.status else { panic!("{:?}", found.result.status) };
    assert!(how_far.contains("preliminary 1"), "{how_far}");
    assert!(found.result.n_tests < 25 && found.result.graph[[0, 1, 1]].is_link());

    let asked = AtomicUsize::new(0);
    let control = Control::default().out_of_time(move || asked.fetch_add(1, Ordering::Relaxed) > 20);
    let found =
        run_tsfci(&any_data(OBSERVED), &oracle(&links), &LpcmciSettings::default(), &control).unwrap();
    let Status::Partial(how_far) = &found.status else { panic!("{:?}", found.status) };
    assert!(how_far.contains("the phase of neighbours"), "{how_far}");
    assert!(found.n_tests < 25 && found.graph[[0, 1, 1]].is_link());
}

#[test]
fn interventions_without_a_column_of_their_own_are_refused() {
    let (data, test, settings) = (any_data(3), oracle(&[]), LpcmciSettings::default());
    let error = |interventions: &[Intervened]| {
        run_candoit(&data, &test, &settings, interventions, true, &Control::default())
            .unwrap_err()
            .to_string()
    };
    assert!(error(&[]).contains("take lpcmci"));
    assert!(error(&[Intervened { variable: Some(0), context: 3 }]).contains("column 3 does not exist"));
    assert!(error(&[Intervened { variable: Some(1), context: 1 }]).contains("two roles"));
}
