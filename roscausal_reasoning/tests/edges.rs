//! Odd data and odd questions: each is answered, or refused in a sentence.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::{arrow, chain, chain_graph, frame, noise, open_model, set};
use ndarray::Array2;
use roscausal_discovery::DataFrame;
use roscausal_reasoning::{
    Settings, StructuralModel,
    answer::{
        EffectAnswer, EffectQuestion, ExplainAnswer, ExplainQuestion, Status, effect, explain, predict,
        what_if,
    },
    graph::Graph,
    model::Equations,
    question::{Situation, WhatIf},
};

/// Lines, not checked on rows that they have not seen.
fn lines(values: Array2<f64>) -> StructuralModel {
    let settings = Settings { equations: Equations::Linear, check: false, ..Settings::default() };
    StructuralModel::fit(&frame(values), &chain_graph(), &settings, &Vec::new()).unwrap()
}

#[test]
fn a_row_that_alone_decides_on_a_coefficient_is_no_noise_and_the_file_reads_back() {
    // r is 0 but for one row: what r does to d is known from that row alone.
    let mut values = chain(1, 400);
    values.column_mut(0).fill(0.0);
    values[[200, 0]] = 1.0;
    let model = lines(values.clone());
    let summaries = &model.members()[0].model.summaries;
    assert_eq!(summaries.iter().map(|summary| summary.alone).collect::<Vec<_>>(), [1, 1, 0]);
    assert!((0.1..0.5).contains(&summaries[1].rmse), "{}", summaries[1].rmse);
    let read = StructuralModel::from_json(&model.to_json()).unwrap();
    assert_eq!(read.to_json(), model.to_json());
    let answer = predict(&read, &Situation::newest(values.view()), 5, 100, 1);
    assert_eq!(answer.status, Status::Ok, "{}", answer.message);
    let reported =
        "the equation of d has a coefficient that rests on one row alone (1 row left out of its noise)";
    assert!(answer.caveats.iter().any(|caveat| caveat.contains(reported)), "{:?}", answer.caveats);
    assert!(!lines(chain(1, 400)).to_json().contains("alone"), "ordinary rows all count");
}

#[test]
fn rows_that_are_masked_train_no_equation_and_count_for_no_effect() {
    // In the masked rows d follows r the other way round. (The row after them follows them no more.)
    let mut values = chain(1, 800);
    let turned = |t: usize| t % 200 >= 120;
    let masked = |t: usize| turned(t) || t.is_multiple_of(200);
    for t in 1..800 {
        if turned(t) {
            values[[t, 1]] = 5.0 * values[[t - 1, 0]];
        }
    }
    let settings = Settings { equations: Equations::Linear, check: false, ..Settings::default() };
    let fit = |data: &DataFrame| StructuralModel::fit(data, &chain_graph(), &settings, &Vec::new()).unwrap();
    let mask = Array2::from_shape_fn(values.dim(), |(t, _)| masked(t));
    let model = fit(&frame(values.clone()).with_mask(vec![mask], "y".parse().unwrap()).unwrap());
    let question = EffectQuestion { cause: "r".into(), effect: "d".into(), max_lag: 2, standardised: false };
    let total = |model: &StructuralModel| effect(model, &question).total[1];
    let free = total(&lines(chain(1, 800)));
    assert!((total(&model) - free).abs() < 0.1 * free.abs(), "{} {free}", total(&model));
    assert!(total(&lines(values)) > 0.0, "without the mask the other rows decide");
    assert!(model.members()[0].model.summaries[1].rows <= 480);
    let read = StructuralModel::from_json(&model.to_json()).unwrap();
    assert_eq!((read.to_json(), total(&read)), (model.to_json(), total(&model)));
    let beyond = model.to_json().replace("\"masked\":[[", "\"masked\":[[800,");
    assert!(StructuralModel::from_json(&beyond).is_err());
}

#[test]
fn values_too_large_to_compute_with_refuse_their_equation_and_the_file_reads_back() {
    let mut values = chain(1, 400);
    values[[200, 2]] = 1e300;
    let model = lines(values);
    let missing = model.members()[0].model.summaries[2].missing.clone().unwrap_or_default();
    assert!(missing.contains("the equation of h") && missing.contains("too large"), "{missing}");
    assert_eq!(StructuralModel::from_json(&model.to_json()).unwrap().to_json(), model.to_json());
}

#[test]
fn a_question_counts_its_variables_and_graphs_before_any_memory_is_taken() {
    let refused = |model: &StructuralModel, question: WhatIf| {
        let rows = model.samples().recordings()[0].clone();
        let answer = what_if(model, &Situation { rows: rows.view(), now: 100 }, &question);
        assert!(answer.outlooks.is_empty() && answer.status == Status::BadRequest, "{}", answer.message);
        answer.message
    };
    // 13 million steps of paths, with 4 numbers each.
    let actions = |count: usize| (0..count).map(|k| set(&k.to_string(), "r", 0.0)).collect::<Vec<_>>();
    let large = WhatIf { actions: actions(13), horizon: 1000, paths: 1000, ..WhatIf::default() };
    let message = refused(&lines(chain(1, 400)), large);
    assert!(message.contains("13 x 1000 x 1000 x 3 x 1 need too much memory"), "{message}");
    // The same for half the actions, with two graphs.
    let half = WhatIf { actions: actions(6), horizon: 1000, paths: 1000, ..WhatIf::default() };
    let message = refused(&open_model(), half);
    assert!(message.contains("6 x 1000 x 1000 x 3 x 2 need too much memory"), "{message}");
    // Had-I has a path for each refit, however many are asked for.
    let had = WhatIf {
        actions: actions(10),
        horizon: 50,
        paths: 100_000,
        counterfactual: true,
        ..WhatIf::default()
    };
    let model = lines(chain(1, 400));
    let rows = model.samples().recordings()[0].clone();
    let answer = what_if(&model, &Situation { rows: rows.view(), now: 100 }, &had);
    assert_eq!((answer.status, answer.outlooks.len()), (Status::Ok, 10), "{}", answer.message);
}

/// The chain with a further variable `z`, which `h` drives.
fn with_z(z: impl Fn(usize) -> f64) -> StructuralModel {
    let x = chain(1, 600);
    let values = Array2::from_shape_fn((600, 4), |(t, k)| if k < 3 { x[[t, k]] } else { z(t) });
    let names = ["r", "d", "h", "z"].map(str::to_owned).to_vec();
    let links = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 3)];
    let arrows = links.map(|(cause, effect)| arrow(cause, effect, 1));
    let graph = Graph::new(names.clone(), 1, &arrows, &[]).unwrap();
    let data = DataFrame::new(vec![values], names).unwrap();
    let settings = Settings { equations: Equations::Linear, check: false, ..Settings::default() };
    StructuralModel::fit(&data, &graph, &settings, &Vec::new()).unwrap()
}

fn beside(z: impl Fn(usize) -> f64, cause: &str, on: &str) -> EffectAnswer {
    let question = EffectQuestion { cause: cause.into(), effect: on.into(), max_lag: 5, standardised: false };
    effect(&with_z(z), &question)
}

#[test]
fn a_variable_that_an_effect_does_not_need_may_be_missing_in_every_row() {
    let (there, gone) = (|t: usize| noise(7, t), |_: usize| f64::NAN);
    let (with, without) = (beside(there, "r", "h"), beside(gone, "r", "h"));
    assert_eq!(
        (without.status, &without.mediators[..]),
        (Status::Ok, &["d".to_owned()][..]),
        "{}",
        without.message
    );
    assert!(without.total[2] < -0.15, "{:?}", without.total);
    let numbers = |answer: EffectAnswer| {
        (answer.total, answer.lower, answer.upper, answer.direct, answer.mediated, answer.adjustment_set)
    };
    assert_eq!(numbers(with), numbers(without));
    let on_it = beside(gone, "r", "z");
    assert_ne!(on_it.status, Status::Ok);
    assert!(on_it.message.contains("there is no variable 'z'"), "{}", on_it.message);
}

#[test]
fn a_change_is_explained_whatever_is_missing_of_what_does_not_drive_it() {
    let why = |model: &StructuralModel, variable: &str| -> ExplainAnswer {
        let question = ExplainQuestion {
            variable: variable.into(),
            from_row: Some(60),
            to_row: Some(66),
            horizon: 10,
            seed: 1,
            start: 0.0,
        };
        explain(model, &Situation::newest(model.samples().recordings()[0].view()), &question)
    };
    let whole = why(&with_z(|t| noise(7, t)), "h");
    let gaps = with_z(|t| if t < 400 { f64::NAN } else { noise(7, t) });
    let answer = why(&gaps, "h");
    assert_eq!(
        (answer.status, answer.contributions),
        (Status::Ok, whole.contributions),
        "{}",
        answer.message
    );
    let refused = why(&gaps, "z");
    assert_eq!(refused.status, Status::NoData);
    assert!(refused.message.contains("z is missing in row 60"), "{}", refused.message);
}

#[test]
fn a_what_if_needs_what_it_asks_about_and_what_drives_that() {
    let about = |variables: &[&str]| WhatIf {
        actions: vec![set("a", "r", 0.1)],
        variables: variables.iter().map(|name| (*name).to_owned()).collect(),
        paths: 100,
        ..WhatIf::default()
    };
    let ask = |model: &StructuralModel, question: &WhatIf| {
        what_if(model, &Situation { rows: model.samples().recordings()[0].view(), now: 500 }, question)
    };
    let (whole, gone) = (with_z(|t| noise(7, t)), with_z(|_| f64::NAN));
    let (there, without) = (ask(&whole, &about(&["h", "d"])), ask(&gone, &about(&["h", "d"])));
    assert_eq!(without.status, Status::Ok, "{}", without.message);
    assert_eq!(without.outlooks[0].forecasts, there.outlooks[0].forecasts);
    // What has no value at all is not part of the model, and named.
    assert_eq!(gone.graph().names(), ["r", "d", "h"]);
    assert!(gone.facts.warnings.iter().any(|reported| reported.ends_with("left out of the model: z")));
    assert_eq!(ask(&gone, &about(&[])).status, Status::Ok);
    let some: [&[&str]; 2] = [&["z"], &["r", "z"]];
    for variables in some {
        assert_ne!(ask(&gone, &about(variables)).status, Status::Ok, "{variables:?}");
    }
    // Had-I reads the rows that follow.
    let gap = with_z(|t| if t > 450 { f64::NAN } else { noise(7, t) });
    let had = |variables: &[&str]| WhatIf { counterfactual: true, ..about(variables) };
    assert_eq!(ask(&gap, &had(&["h"])).status, Status::Ok);
    assert_eq!(ask(&gap, &had(&["z"])).status, Status::NoData);
}
