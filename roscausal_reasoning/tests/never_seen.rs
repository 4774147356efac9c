//! What was never recorded is not ranked, whatever the graph says: on random systems, and one by one.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::{act, arrow, chain, chain_model, noise, set};
use ndarray::Array2;
use proptest::prelude::*;
use roscausal_discovery::DataFrame;
use roscausal_reasoning::{
    Settings, StructuralModel,
    answer::{Status, WhatIfAnswer, what_if},
    graph::{Arrow, Graph},
    model::Equations,
    question::{Action, CostTerm, Kind, Limit, Situation, WhatIf},
};

fn named(n: usize) -> Vec<String> {
    (0..n).map(|k| format!("x{k}")).collect()
}

/// A linear system with these links; each variable also follows itself. Some are recorded as codes, in steps of 1.
fn system(seed: u64, n: usize, links: &[(usize, usize, usize)]) -> (Array2<f64>, StructuralModel) {
    let mut x = Array2::zeros((260, n));
    for t in 3..260 {
        for var in 0..n {
            let from = links.iter().filter(|(_, effect, _)| *effect == var);
            let driven: f64 = from.map(|&(cause, _, lag)| 0.4 * x[[t - lag, cause]]).sum();
            x[[t, var]] = 0.3 * x[[t - 1, var]] + driven + noise(seed, n * t + var);
        }
    }
    if seed.is_multiple_of(3) {
        x.column_mut(0).mapv_inplace(f64::round);
    }
    let own = (0..n).map(|var| arrow(var, var, 1));
    let arrows: Vec<Arrow> = links.iter().map(|&(a, b, lag)| arrow(a, b, lag)).chain(own).collect();
    let graph = Graph::new(named(n), 2, &arrows, &[]).unwrap();
    let data = DataFrame::new(vec![x.clone()], named(n)).unwrap();
    let settings = Settings { equations: Equations::Linear, members: 5, check: false, ..Settings::default() };
    (x, StructuralModel::fit(&data, &graph, &settings, &Vec::new()).unwrap())
}

fn range(x: &Array2<f64>, var: usize) -> (f64, f64) {
    let column = x.column(var);
    (
        column.iter().copied().fold(f64::INFINITY, f64::min),
        column.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    )
}

/// Whether `var` or anything that it drives in at most so many steps is `wanted`.
fn reaches(links: &[(usize, usize, usize)], var: usize, wanted: usize, steps: usize) -> bool {
    var == wanted
        || links.iter().any(|&(cause, effect, lag)| {
            cause == var && lag < steps && reaches(links, effect, wanted, steps - lag)
        })
}

fn cost(variable: &str, weight: f64) -> CostTerm {
    CostTerm { variable: variable.into(), weight }
}

fn newest(x: &Array2<f64>, model: &StructuralModel, question: &WhatIf) -> WhatIfAnswer {
    what_if(model, &Situation::newest(x.view()), question)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn no_ranked_action_lies_outside_what_was_recorded_or_moves_nothing_of_the_cost(
        seed in 0u64..1_000_000,
        links in proptest::collection::vec((0usize..4, 0usize..4, 1usize..3), 0..5),
        actions in proptest::collection::vec((0usize..4, -1.0f64..2.0, 1usize..6, any::<bool>()), 1..6),
        priced in 0usize..4,
        (had, allow_extrapolation) in any::<(bool, bool)>(),
    ) {
        let mut links: Vec<_> = links.into_iter().filter(|(cause, effect, _)| cause < effect).collect();
        links.sort_unstable();
        links.dedup();
        let (x, model) = system(seed, 4, &links);
        // A value as a part of the range: below 0 and above 1 it was never seen.
        let value = |var: usize, part: f64| range(&x, var).0 + part * (range(&x, var).1 - range(&x, var).0);
        let action = |(k, &(var, part, first, set)): (usize, &(usize, f64, usize, bool))| {
            let (kind, value) = if set { (Kind::Set, value(var, part)) } else { (Kind::Shift, 3.0 * part) };
            act(&k.to_string(), &format!("x{var}"), kind, (first, 0), vec![value])
        };
        let question = WhatIf {
            actions: actions.iter().enumerate().map(action).chain([Action::go_on()]).collect(),
            cost: vec![cost(&format!("x{priced}"), 1.0)],
            counterfactual: had,
            allow_extrapolation,
            horizon: 6,
            paths: 60,
            ..WhatIf::default()
        };
        let answer = what_if(&model, &Situation { rows: x.view(), now: 240 }, &question);
        for (k, &(var, part, first, is_set)) in actions.iter().enumerate() {
            let outlook = &answer.outlooks[k];
            let (ranked, seen) = (answer.ranking.contains(&k), (-0.011..=1.011).contains(&part));
            if is_set && !seen {
                prop_assert!(!ranked && outlook.supported_steps < first && (outlook.refused || allow_extrapolation), "{outlook:?}");
                prop_assert!(outlook.text.contains("do not reach") && (!outlook.refused || outlook.cost.is_nan()), "{}", outlook.text);
            }
            prop_assert!(!ranked || reaches(&links, var, priced, 7 - first), "{links:?} {outlook:?}");
            prop_assert!(!ranked || 2 * outlook.supported_steps >= 6, "{outlook:?}");
            let length = if allow_extrapolation || had { 6 } else { outlook.supported_steps };
            prop_assert!(outlook.forecasts.iter().all(|forecast| forecast.mean.len() == length), "{outlook:?}");
            prop_assert!(outlook.refused || outlook.supported_steps > 0 || allow_extrapolation);
            for (own, forecast) in outlook.forecasts.iter().enumerate().filter(|_| !had) {
                let (low, high) = range(&x, own);
                let margin = 0.011 * (high - low);
                let inside = |mean: &f64| (low - margin..=high + margin).contains(mean);
                prop_assert!(forecast.mean[..outlook.supported_steps].iter().all(inside), "{forecast:?} {low} {high}");
            }
        }
        // Where a guess is allowed, one that no step carries is none.
        let none = answer.outlooks.iter().all(|outlook| outlook.refused || outlook.supported_steps == 0);
        prop_assert_eq!(none, answer.status == Status::NotSupported, "{}", answer.message);
    }
}

/// `x0` drives nothing, `x1` drives `x2`.
fn childless() -> (Array2<f64>, StructuralModel) {
    system(1, 3, &[(1, 2, 1)])
}

#[test]
fn an_action_without_a_child_is_refused_where_it_was_never_seen_and_else_called_without_effect() {
    let (x, model) = childless();
    let question = WhatIf {
        actions: vec![set("race", "x0", 90.0), set("slow", "x0", 0.0)],
        cost: vec![cost("x2", 1.0), cost("x0", -0.2)],
        ..WhatIf::default()
    };
    let answer = newest(&x, &model, &question);
    assert!(
        answer.outlooks[0].refused && answer.outlooks[0].text.contains("x0 = 90 (seen: x0 from"),
        "{answer:?}"
    );
    assert_eq!((answer.status, &answer.ranking[..]), (Status::Ok, &[1][..]));
    let says = |answer: &WhatIfAnswer, what: &str| answer.caveats.iter().any(|caveat| caveat.contains(what));
    let no_path = "x0 has no effect on x1 and x2 within 10 steps: the graph has no path";
    assert!(says(&answer, &format!("{no_path}; it is ranked by x0 alone")), "{:?}", answer.caveats);

    let question = WhatIf { cost: vec![cost("x2", 1.0)], ..question };
    let slow = WhatIf { actions: vec![set("slow", "x0", 0.0), Action::go_on()], ..question.clone() };
    let answer = newest(&x, &model, &slow);
    assert!(answer.ranking.is_empty() && answer.status == Status::Ok, "nothing to rank by: {answer:?}");
    assert!(answer.outlooks[0].text.contains("not ranked: x0 has no effect on x2"), "{answer:?}");
    assert!(answer.message.contains("no action is ranked") && says(&answer, no_path), "{answer:?}");
    // With an action that does move it, going on is a choice.
    let moves =
        WhatIf { actions: vec![set("a", "x0", 0.0), set("b", "x1", -1.0), Action::go_on()], ..question };
    assert_eq!(newest(&x, &model, &moves).ranking, [1, 2]);
    let alone =
        WhatIf { actions: vec![set("slow", "x0", 0.0)], variables: vec!["x1".into()], ..WhatIf::default() };
    assert!(says(&newest(&x, &model, &alone), "x0 has no effect on x1"));
    let other = WhatIf { actions: vec![set("b", "x1", 0.0)], ..WhatIf::default() };
    assert!(!says(&newest(&x, &model, &other), "no effect"), "x2 moves, the others need no note");
}

#[test]
fn a_variable_that_never_changed_can_be_set_to_what_it_was_only() {
    let mut x = chain(1, 300);
    x.column_mut(0).fill(0.5);
    let links = [arrow(1, 1, 1), arrow(1, 2, 1), arrow(2, 2, 1)];
    let graph = Graph::new(common::names(), 1, &links, &[]).unwrap();
    let model =
        StructuralModel::fit(&common::frame(x.clone()), &graph, &Settings::default(), &Vec::new()).unwrap();
    let question =
        WhatIf { actions: vec![set("same", "r", 0.5), set("other", "r", 0.51)], ..WhatIf::default() };
    let answer = newest(&x, &model, &question);
    assert_eq!(answer.outlooks.iter().map(|outlook| outlook.refused).collect::<Vec<_>>(), [false, true]);
    assert!(answer.outlooks[1].text.contains("seen: r = 0.5 in every row"), "{}", answer.outlooks[1].text);
}

#[test]
fn each_value_of_a_schedule_counts_and_a_shift_is_answered_as_far_as_it_was_seen() {
    let model = chain_model(600);
    let rows = chain(2, 50);
    let question = WhatIf {
        actions: vec![
            act("ramp", "r", Kind::Set, (2, 4), vec![0.2, 0.4, 9.0]),
            act("up", "r", Kind::Shift, (1, 0), vec![0.4]),
        ],
        cost: vec![cost("h", 1.0)],
        horizon: 10,
        ..WhatIf::default()
    };
    let answer = newest(&rows, &model, &question);
    assert!(answer.outlooks[0].refused && answer.outlooks[0].text.contains("r = 9"), "{answer:?}");
    // 0.4 at each step adds up to 2, which was never seen.
    let up = &answer.outlooks[1];
    assert!(!up.refused && (1..10).contains(&up.supported_steps) && answer.ranking.is_empty(), "{up:?}");
    assert_eq!(up.forecasts[2].mean.len(), up.supported_steps);
    assert!(
        answer
            .caveats
            .iter()
            .any(|caveat| caveat.contains("'up' leads where") && caveat.contains("ends there"))
    );
    let all = newest(&rows, &model, &WhatIf { allow_extrapolation: true, ..question });
    assert!(all.outlooks[1].forecasts[2].mean.len() == 10 && all.ranking.is_empty(), "never ranked: {all:?}");
}

#[test]
fn where_the_present_was_never_seen_nothing_is_supported_and_the_status_says_so() {
    let model = chain_model(600);
    let mut rows = chain(2, 50);
    rows[[49, 1]] = 40.0;
    let question = WhatIf { actions: vec![Action::go_on(), set("a", "r", 0.1)], ..WhatIf::default() };
    let answer = newest(&rows, &model, &question);
    assert_eq!(answer.status, Status::NotSupported, "{answer:?}");
    assert!(
        answer.message.contains("d = 40") && answer.outlooks.iter().all(|o| o.supported_steps == 0),
        "{answer:?}"
    );
}

#[test]
fn a_forecast_ends_before_it_leaves_what_was_recorded() {
    // The second variable grows by 1 in each row, the third shrinks back.
    let x = Array2::from_shape_fn((300, 3), |(t, var)| match var {
        1 => t as f64 + 0.3 * noise(2, 3 * t),
        _ => noise(2, 3 * t + var),
    });
    let graph = Graph::new(common::names(), 1, &[arrow(1, 1, 1)], &[]).unwrap();
    let model =
        StructuralModel::fit(&common::frame(x.clone()), &graph, &Settings::default(), &Vec::new()).unwrap();
    let ask = |variables: &[&str], allow_extrapolation| {
        let variables = variables.iter().map(|name| (*name).to_owned()).collect();
        newest(&x, &model, &WhatIf { variables, allow_extrapolation, ..WhatIf::default() }).outlooks.remove(0)
    };
    // 1 % of the range are 3 steps of growth.
    let grows = ask(&["d"], false);
    assert!(
        (1..6).contains(&grows.supported_steps) && grows.forecasts[0].mean.len() == grows.supported_steps,
        "{grows:?}"
    );
    assert!(
        grows.text.contains(&format!("The data carry it for {} of 10", grows.supported_steps)),
        "{}",
        grows.text
    );
    let further = ask(&["d"], true);
    assert_eq!((further.forecasts[0].mean.len(), further.supported_steps), (10, grows.supported_steps));
    assert_eq!(ask(&["h"], false).supported_steps, 10, "what is not asked about does not count");
}

#[test]
fn limits_alone_rank_by_how_surely_they_are_kept() {
    let model = chain_model(800);
    let rows = chain(2, 50);
    let limit = Limit { variable: "h".into(), above: None, below: Some(2.0), probability: 0.0 };
    let question = WhatIf {
        actions: vec![set("slow", "r", -0.7), set("fast", "r", 0.7)],
        limits: vec![limit],
        ..WhatIf::default()
    };
    let answer = newest(&rows, &model, &question);
    assert_eq!(answer.ranking, [1, 0], "a fast robot keeps h low: {answer:?}");
}
