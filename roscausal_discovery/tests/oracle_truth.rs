//! With an oracle as the test, the methods find the true graph, on random graphs.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use ndarray::Array2;
use proptest::prelude::*;
use roscausal_discovery::{
    Assumption, Control, DataFrame, LinkAssumptions, LinkMark,
    independence_tests::OracleCi,
    methods::{ColliderRule, PcmciPlusSettings, PcmciSettings, run_pcmci, run_pcmciplus},
};

fn any_data(n_vars: usize) -> DataFrame {
    let names = (0..n_vars).map(|v| format!("X{v}")).collect();
    DataFrame::new(vec![Array2::zeros((50, n_vars))], names).unwrap()
}

/// Random links `(cause, effect, lag)`; those at lag 0 go from smaller to larger variables, so there is no cycle.
fn links(
    n_vars: usize,
    max_lag: usize,
    contemporaneous: bool,
) -> impl Strategy<Value = Vec<(usize, usize, usize)>> {
    let link = (0..n_vars, 0..n_vars, usize::from(!contemporaneous)..=max_lag);
    prop::collection::vec(link, 0..2 * n_vars).prop_map(|mut links| {
        links.retain(|&(i, j, lag)| lag > 0 || i < j);
        links.sort_unstable();
        links.dedup();
        links
    })
}

fn truth_of(n_vars: usize, links: &[(usize, usize, usize)]) -> LinkAssumptions {
    let mut truth = LinkAssumptions::none(n_vars);
    links.iter().for_each(|&(i, j, lag)| truth.insert(i, j, lag, Assumption::Exists).unwrap());
    truth
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn pcmci_finds_the_lagged_graph(links in links(4, 2, false)) {
        let oracle = OracleCi::new(&truth_of(4, &links)).unwrap();
        let settings = PcmciSettings { tau_max: 2, ..PcmciSettings::default() };
        let result = run_pcmci(&any_data(4), &oracle, &settings, &Control::default()).unwrap();
        for ((i, j, lag), mark) in result.graph.indexed_iter() {
            prop_assert_eq!(mark.is_link(), links.contains(&(i, j, lag)), "{} {} {}", i, j, lag);
        }
    }

    #[test]
    fn pcmciplus_and_pc_find_the_class_of_the_graph(
        links in links(4, 1, true),
        rule in prop::sample::select(vec![ColliderRule::Majority, ColliderRule::Conservative, ColliderRule::None]),
        reset_lagged_links in any::<bool>(),
        pc_only in any::<bool>(),
    ) {
        let oracle = OracleCi::new(&truth_of(4, &links)).unwrap();
        let settings = PcmciSettings { tau_min: 0, tau_max: 1, pc_alpha: vec![0.05], ..PcmciSettings::default() };
        let plus =
            PcmciPlusSettings { contemp_collider_rule: rule, reset_lagged_links, pc_only, ..Default::default() };
        let result = run_pcmciplus(&any_data(4), &oracle, &settings, &plus, &Control::default()).unwrap();
        let expected = class_of(4, &links);
        for ((i, j, lag), &mark) in result.graph.indexed_iter() {
            let expected = if lag > 0 {
                if links.contains(&(i, j, lag)) { LinkMark::Forward } else { LinkMark::Absent }
            } else {
                expected[i][j]
            };
            prop_assert_eq!(mark, expected, "{} {} {}", i, j, lag);
        }
    }
}

/// Marks at lag 0 that are common to all graphs with the same links and the same unshielded colliders, found by
/// trying every direction of every link.
fn class_of(n_vars: usize, links: &[(usize, usize, usize)]) -> Vec<Vec<LinkMark>> {
    let pairs: Vec<(usize, usize)> = links.iter().filter(|l| l.2 == 0).map(|l| (l.0, l.1)).collect();
    let lagged: Vec<_> = links.iter().copied().filter(|l| l.2 > 0).collect();
    let truth = colliders(n_vars, &pairs, &lagged);
    let mut marks = vec![vec![LinkMark::Absent; n_vars]; n_vars];
    for directions in 0..1_u32 << pairs.len() {
        let turned: Vec<(usize, usize)> = pairs
            .iter()
            .enumerate()
            .map(|(k, &(i, j))| if directions >> k & 1 == 1 { (j, i) } else { (i, j) })
            .collect();
        if has_cycle(n_vars, &turned) || colliders(n_vars, &turned, &lagged) != truth {
            continue;
        }
        for &(i, j) in &turned {
            for (a, b, mark) in [(i, j, LinkMark::Forward), (j, i, LinkMark::Backward)] {
                let seen = marks[a][b];
                marks[a][b] =
                    if seen == LinkMark::Absent || seen == mark { mark } else { LinkMark::Unoriented };
            }
        }
    }
    marks
}

/// Unshielded colliders `(i at lag) -> k <- j`, with `k` and `j` at lag 0.
fn colliders(
    n_vars: usize,
    pairs: &[(usize, usize)],
    lagged: &[(usize, usize, usize)],
) -> Vec<(usize, usize, usize, usize)> {
    let adjacent = |i: usize, j: usize| pairs.contains(&(i, j)) || pairs.contains(&(j, i));
    let mut found = Vec::new();
    for &(j, k) in pairs {
        for i in 0..n_vars {
            if pairs.contains(&(i, k)) && i < j && !adjacent(i, j) {
                found.push((i, 0, k, j));
            }
            if lagged.contains(&(i, k, 1)) && !lagged.contains(&(i, j, 1)) {
                found.push((i, 1, k, j));
            }
        }
    }
    found.sort_unstable();
    found
}

fn has_cycle(n_vars: usize, pairs: &[(usize, usize)]) -> bool {
    let mut left: Vec<usize> = (0..n_vars).collect();
    while let Some(at) = left.iter().position(|&v| !pairs.iter().any(|&(i, j)| j == v && left.contains(&i))) {
        left.remove(at);
    }
    !left.is_empty()
}
