//! Predict, what if, had I, explain, effect: what each answer promises.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;
#[path = "../examples/golden_reasoning/moments.rs"]
mod moments;

use common::{act, arrow, chain, chain_graph, chain_model, frame, names, noise, open_model, set};
use ndarray::Array2;
use proptest::prelude::*;
use roscausal_discovery::DataFrame;
use roscausal_reasoning::{
    Settings, StructuralModel,
    answer::{EffectQuestion, ExplainQuestion, Status, effect, explain, predict, what_if},
    default_intervention_targets,
    graph::{Graph, Pair},
    model::{Equations, Schedule},
    question::{Action, CostTerm, Kind, Limit, Situation, WhatIf},
};

fn ask(actions: Vec<Action>) -> WhatIf {
    WhatIf { actions, horizon: 5, paths: 200, ..WhatIf::default() }
}

fn effect_of(cause: &str, on: &str) -> EffectQuestion {
    EffectQuestion { cause: cause.into(), effect: on.into(), max_lag: 5, standardised: false }
}

fn why(variable: &str, rows: Option<(usize, usize)>) -> ExplainQuestion {
    ExplainQuestion {
        variable: variable.into(),
        from_row: rows.map(|rows| rows.0),
        to_row: rows.map(|rows| rows.1),
        horizon: 10,
        seed: 1,
        start: 0.0,
    }
}

#[test]
fn a_bad_question_gets_a_status_and_a_sentence_with_the_way_out() {
    let model = chain_model(400);
    let rows = chain(2, 50);
    let bad = |question: WhatIf, words: &str| {
        let answer = what_if(&model, &Situation::newest(rows.view()), &question);
        assert_eq!(answer.status, Status::BadRequest, "{question:?}");
        assert!(answer.message.contains(words) && answer.outlooks.is_empty(), "{}", answer.message);
    };
    bad(ask(vec![set("stop", "r_w", 0.0)]), "the model has r, d, h");
    bad(ask(vec![act("a", "r", Kind::Set, (0, 2), vec![0.0])]), "the next sample is step 1");
    bad(ask(vec![act("a", "r", Kind::Set, (3, 9), vec![0.0])]), "1..5");
    bad(ask(vec![act("a", "r", Kind::Set, (4, 2), vec![0.0])]), "4..2");
    bad(ask(vec![act("a", "r", Kind::Set, (1, 3), vec![0.0, 1.0])]), "one for each step");
    bad(ask(vec![act("a", "r", Kind::Set, (1, 0), vec![])]), "0 values");
    bad(ask(vec![Action { name: "stop".into(), interventions: vec![] }]), "go on");
    bad(ask(vec![set("a", "r", f64::NAN)]), "finite");
    bad(ask(vec![set("a", "r", f64::INFINITY)]), "finite");
    bad(WhatIf { horizon: 0, ..ask(vec![]) }, "1 to 1000");
    bad(WhatIf { horizon: 1_000_000_000, ..ask(vec![]) }, "1 to 1000");
    bad(WhatIf { paths: 0, ..ask(vec![]) }, "20 to");
    bad(WhatIf { paths: usize::MAX, ..ask(vec![]) }, "20 to");
    bad(ask((0..1000).map(|k| set(&k.to_string(), "r", 0.0)).collect()), "1000 actions");
    bad(ask(vec![set("a", "r", 0.0), set("a", "r", 1.0)]), "two actions");
    let mut both = set("a", "r", 0.0);
    both.interventions.extend(act("", "r", Kind::Shift, (2, 2), vec![0.1]).interventions);
    bad(ask(vec![both]), "set it or shift it");
    bad(
        WhatIf { cost: vec![CostTerm { variable: "x".into(), weight: 1.0 }], ..ask(vec![]) },
        "no variable 'x'",
    );
    bad(WhatIf { cost: vec![CostTerm { variable: "r".into(), weight: f64::NAN }], ..ask(vec![]) }, "weight");
    let limit = |above, below, probability| Limit { variable: "d".into(), above, below, probability };
    bad(WhatIf { limits: vec![limit(None, None, 0.9)], ..ask(vec![]) }, "no bound");
    bad(WhatIf { limits: vec![limit(Some(2.0), Some(1.0), 0.9)], ..ask(vec![]) }, "nothing is above");
    bad(WhatIf { limits: vec![limit(Some(2.0), None, 1.9)], ..ask(vec![]) }, "probability");
    assert_eq!(effect(&model, &effect_of("r", "hh")).status, Status::BadRequest);
    assert_eq!(
        effect(&model, &EffectQuestion { max_lag: 1_000_000, ..effect_of("r", "h") }).status,
        Status::BadRequest
    );
    let situation = Situation::newest(rows.view());
    assert_eq!(explain(&model, &situation, &why("x", None)).status, Status::BadRequest);
    assert_eq!(explain(&model, &situation, &why("h", Some((9, 9)))).status, Status::BadRequest);
    let far = ExplainQuestion { horizon: 1_000_000_000, ..why("h", None) };
    assert!(explain(&model, &situation, &far).message.contains("1 to 100"));
    // After all of them the next question is answered.
    assert_eq!(predict(&model, &situation, 5, 100, 1).status, Status::Ok);
}

#[test]
fn rows_that_are_not_there_or_of_another_model_have_a_status_of_their_own() {
    let model = chain_model(400);
    let rows = chain(2, 50);
    let status = |rows: &Array2<f64>, now: usize, question: &WhatIf| {
        let answer = what_if(&model, &Situation { rows: rows.view(), now }, question);
        assert_eq!(answer.message.is_empty(), answer.status == Status::Ok);
        answer.status
    };
    assert_eq!(status(&rows, 50, &ask(vec![])), Status::NoData);
    assert_eq!(status(&Array2::zeros((0, 3)), 0, &ask(vec![])), Status::NoData);
    assert_eq!(status(&Array2::zeros((50, 2)), 9, &ask(vec![])), Status::NoModel);
    let had = WhatIf { counterfactual: true, ..ask(vec![]) };
    assert_eq!((status(&rows, 44, &had), status(&rows, 45, &had)), (Status::Ok, Status::NoData));
    let mut holes = rows.clone();
    holes[[49, 1]] = f64::NAN;
    assert_eq!(status(&holes, 49, &ask(vec![])), Status::NoData);
    assert_eq!(status(&holes, 48, &ask(vec![])), Status::Ok);
    assert_eq!(
        explain(&model, &Situation::newest(holes.view()), &why("h", Some((45, 49)))).status,
        Status::NoData
    );
    assert_eq!(
        explain(&model, &Situation::newest(rows.view()), &why("h", Some((45, 90)))).status,
        Status::NoData
    );
}

#[test]
fn a_value_that_was_never_seen_is_refused_unless_extrapolation_is_asked_for() {
    let model = chain_model(600);
    let rows = chain(2, 50);
    let situation = Situation::newest(rows.view());
    let question = ask(vec![set("slow", "r", 0.0), set("mad", "r", 9.0)]);
    let answer = what_if(&model, &situation, &question);
    assert_eq!(
        (answer.status, answer.outlooks[0].refused, answer.outlooks[1].refused),
        (Status::Ok, false, true)
    );
    assert!(answer.outlooks[1].text.contains("r = 9") && answer.outlooks[1].forecasts.is_empty());
    let alone = what_if(&model, &situation, &ask(vec![set("mad", "r", 9.0)]));
    assert_eq!(alone.status, Status::NotSupported);
    assert!(alone.message.contains("seen: r from"), "{}", alone.message);
    let forced =
        what_if(&model, &situation, &WhatIf { allow_extrapolation: true, ..ask(vec![set("mad", "r", 9.0)]) });
    assert_eq!((forced.status, forced.outlooks[0].supported_steps), (Status::NotSupported, 0));
    assert_eq!(forced.outlooks[0].forecasts[2].mean.len(), 5);
    assert!(forced.caveats.iter().any(|caveat| caveat.contains("the data do not reach")));
}

#[test]
fn simulated_means_and_intervals_are_those_of_the_exact_formulas() {
    let settings = Settings { equations: Equations::Linear, members: 1, check: false, ..Settings::default() };
    let model = StructuralModel::fit(&frame(chain(1, 3000)), &chain_graph(), &settings, &Vec::new()).unwrap();
    let rows = chain(2, 40);
    let question = WhatIf { paths: 20_000, horizon: 6, ..ask(vec![set("a", "r", 0.3)]) };
    let answer = what_if(&model, &Situation::newest(rows.view()), &question);
    let directed = &model.members()[0].model;
    let mut schedule = Schedule::free(3, 6);
    (0..6).for_each(|step| schedule.set(step, 0, 0.3));
    let variance: Vec<f64> = directed.summaries.iter().map(|summary| summary.rmse.powi(2)).collect();
    let past: Vec<f64> = rows.row(39).to_vec();
    let (mean, spread) = moments::moments(&directed.members[0], &past, &schedule, &variance);
    for (var, forecast) in answer.outlooks[0].forecasts.iter().enumerate() {
        for step in 0..6 {
            let (at, sd) = (step * 3 + var, spread[step * 3 + var].sqrt());
            assert!((forecast.mean[step] - mean[at]).abs() <= 0.03 * sd + 1e-12, "{var} {step}");
            let width = forecast.upper[step] - forecast.lower[step];
            assert!((width - 2.0 * 1.645 * sd).abs() <= 0.2 * sd + 1e-12, "{var} {step}: {width} {sd}");
        }
    }
}

#[test]
fn an_intervention_shows_the_cause_and_not_the_correlation() {
    // z drives r and h; r does nothing to h, but they go together.
    let mut x = Array2::zeros((1500, 3));
    for t in 1..1500 {
        let e = |k: usize| noise(5, 3 * t + k);
        x[[t, 1]] = 0.9 * x[[t - 1, 1]] + 0.4 * e(1);
        x[[t, 0]] = x[[t - 1, 1]] + 0.2 * e(0);
        x[[t, 2]] = x[[t - 1, 1]] + 0.2 * e(2);
    }
    let graph = Graph::new(names(), 1, &[arrow(1, 1, 1), arrow(1, 0, 1), arrow(1, 2, 1)], &[]).unwrap();
    let model = StructuralModel::fit(&frame(x.clone()), &graph, &Settings::default(), &Vec::new()).unwrap();
    let answer = what_if(
        &model,
        &Situation::newest(x.view()),
        &ask(vec![set("low", "r", -0.5), set("high", "r", 0.5)]),
    );
    let [low, high] = &answer.outlooks[..] else { panic!("two outlooks") };
    assert_eq!(low.forecasts[2], high.forecasts[2], "common random numbers: no effect is exactly none");
    let none = effect(&model, &effect_of("r", "h"));
    assert!(none.total.iter().all(|total| *total == 0.0) && none.text.contains("no path"), "{}", none.text);
}

#[test]
fn nothing_changed_had_i_done_nothing() {
    let model = chain_model(500);
    let rows = chain(3, 60);
    let question = WhatIf { counterfactual: true, ..ask(vec![]) };
    let answer = what_if(&model, &Situation { rows: rows.view(), now: 30 }, &question);
    for (var, forecast) in answer.outlooks[0].forecasts.iter().enumerate() {
        for step in 0..5 {
            let real = rows[[31 + step, var]];
            let all = [forecast.mean[step], forecast.lower[step], forecast.upper[step]];
            assert!(all.iter().all(|value| (value - real).abs() < 1e-9), "{all:?} {real}");
        }
    }
}

#[test]
fn had_i_acted_the_noise_stays_and_the_effect_is_the_systems() {
    let model = chain_model(3000);
    let rows = chain(3, 60);
    let question =
        WhatIf { counterfactual: true, ..ask(vec![act("push", "r", Kind::Shift, (1, 1), vec![1.0])]) };
    let answer = what_if(&model, &Situation { rows: rows.view(), now: 30 }, &question);
    let moved =
        |var: usize, step: usize| answer.outlooks[0].forecasts[var].mean[step] - rows[[31 + step, var]];
    // r by 1, 0.8, ..; d by -0.5 a step later; h by 0.7 x -0.5 after two.
    for (var, step, truth) in
        [(0, 0, 1.0), (0, 1, 0.8), (1, 0, 0.0), (1, 1, -0.5), (2, 1, 0.0), (2, 2, -0.35)]
    {
        assert!((moved(var, step) - truth).abs() < 0.06, "{var} {step}: {}", moved(var, step));
    }
}

#[test]
fn what_happened_once_in_a_long_recording_leaves_finite_answers() {
    // Equations bend by what 10,000 rows say; wherever the event is, one of these tables has it in a row that is left out.
    for event in [10_000, 10_010, 10_020] {
        let mut x = chain(1, 10_030);
        x.column_mut(0).fill(0.0);
        x[[event, 0]] = 1.0;
        let model =
            StructuralModel::fit(&frame(x.clone()), &chain_graph(), &Settings::default(), &Vec::new())
                .unwrap();
        let question =
            WhatIf { counterfactual: true, ..ask(vec![act("push", "d", Kind::Shift, (1, 1), vec![0.2])]) };
        let answer = what_if(&model, &Situation { rows: x.view(), now: 30 }, &question);
        let forecasts = answer.outlooks.iter().flat_map(|outlook| &outlook.forecasts);
        assert!(forecasts.flat_map(|one| one.lower.iter().chain(&one.upper)).all(|value| value.is_finite()));
    }
}

#[test]
fn the_parts_of_an_explanation_sum_to_the_change() {
    for equations in [Equations::Auto, Equations::Linear, Equations::Gp] {
        let settings = Settings { equations, check: false, ..Settings::default() };
        let model =
            StructuralModel::fit(&frame(chain(1, 400)), &chain_graph(), &settings, &Vec::new()).unwrap();
        let rows = chain(4, 80);
        let answer = explain(&model, &Situation::newest(rows.view()), &why("h", Some((60, 66))));
        let sum: f64 = answer.contributions.iter().map(|one| one.value).sum();
        assert!((answer.expected + sum - answer.change).abs() < 1e-9, "{answer:?}");
        assert!((answer.change - (rows[[66, 2]] - rows[[60, 2]])).abs() < 1e-12);
        assert!(answer.contributions.windows(2).all(|pair| pair[0].value.abs() >= pair[1].value.abs()));
    }
}

#[test]
fn a_push_is_found_to_be_the_reason_and_told_in_a_sentence() {
    let model = chain_model(1000);
    let mut rows = chain(4, 80);
    // At row 70 the distance falls for no reason that the data have; what follows, follows.
    for t in 70..80 {
        let e = |k: usize| 0.02 * noise(9, 3 * t + k);
        let push = if t == 70 { -3.0 } else { 0.0 };
        rows[[t, 0]] = 0.8 * rows[[t - 1, 0]] + e(0);
        rows[[t, 1]] = 0.6 * rows[[t - 1, 1]] - 0.5 * rows[[t - 1, 0]] + push + e(1);
        rows[[t, 2]] = 0.5 * rows[[t - 1, 2]] + 0.7 * rows[[t - 1, 1]] + e(2);
    }
    let answer = explain(&model, &Situation { rows: rows.view(), now: 73 }, &why("h", None));
    assert_eq!((answer.status, answer.contributions[0].variable.as_str()), (Status::Ok, "d"));
    assert!(
        answer.text.contains("h fell by") && answer.text.contains("because d was smaller than expected"),
        "{}",
        answer.text
    );
    assert!(answer.text.contains("d -> h"), "{}", answer.text);
}

#[test]
fn an_effect_is_the_systems_with_an_interval_and_says_through_what() {
    let model = chain_model(3000);
    let answer = effect(&model, &effect_of("r", "h"));
    let truth = [0.0, 0.0, -0.35, -0.35 * (0.8 + 0.6 + 0.5)];
    for (lag, truth) in truth.iter().enumerate() {
        assert!((answer.total[lag] - truth).abs() < 0.08, "{lag}: {} {truth}", answer.total[lag]);
        assert!(answer.lower[lag] <= answer.total[lag] && answer.total[lag] <= answer.upper[lag]);
    }
    assert_eq!((answer.mediators.as_slice(), answer.direct[1]), (&["d".to_owned()][..], 0.0));
    assert!(answer.robustness > 0.1 && answer.robustness < 1.0);
    assert!(answer.caveats.iter().any(|caveat| caveat.contains("r was never imposed")));
    assert!(answer.caveats.iter().all(|caveat| !caveat.contains("does not fit")), "{:?}", answer.caveats);
}

#[test]
fn a_wrong_graph_is_noticed_where_paths_and_adjustment_disagree() {
    // The graph leaves out d -> h and says r -> h.
    let arrows = [arrow(0, 0, 1), arrow(1, 1, 1), arrow(2, 2, 1), arrow(0, 1, 1), arrow(0, 2, 1)];
    let graph = Graph::new(names(), 1, &arrows, &[]).unwrap();
    let model =
        StructuralModel::fit(&frame(chain(1, 3000)), &graph, &Settings::default(), &Vec::new()).unwrap();
    let answer = effect(&model, &effect_of("r", "h"));
    assert!(
        answer.caveats.iter().any(|caveat| caveat.contains("does not fit the data")),
        "{:?}",
        answer.caveats
    );
}

#[test]
fn an_open_link_on_which_the_answer_depends_is_named() {
    let model = open_model();
    assert_eq!(model.members().len(), 2);
    let answer = effect(&model, &effect_of("r", "h"));
    assert_eq!(answer.status, Status::Ambiguous);
    assert!(answer.message.contains("whether r drives d or d drives r"), "{}", answer.message);
    let rows = model.samples().recordings()[0].clone();
    let question = ask(vec![set("a", "r", 1.0)]);
    let answer = what_if(&model, &Situation::newest(rows.view()), &question);
    assert_eq!(answer.status, Status::Ambiguous, "{}", answer.message);
    // The interval holds both answers; d drives h whichever way the link goes.
    assert!(answer.outlooks[0].forecasts[1].lower[0] < 0.0 && answer.outlooks[0].forecasts[1].upper[0] > 0.5);
    assert_eq!(effect(&model, &effect_of("d", "h")).status, Status::Ok);
}

#[test]
fn more_open_links_than_can_be_tried_are_refused_by_name() {
    let many: Vec<String> = (0..8).map(|k| format!("x{k}")).collect();
    let pairs: Vec<Pair> = (0..7).map(|k| Pair { a: k, b: k + 1, conflict: true }).collect();
    let graph = Graph::new(many.clone(), 1, &[], &pairs).unwrap();
    let values = Array2::from_shape_fn((100, 8), |(t, k)| noise(1, 8 * t + k));
    let data = DataFrame::new(vec![values], many).unwrap();
    let error = StructuralModel::fit(&data, &graph, &Settings::default(), &Vec::new()).unwrap_err();
    assert!(error.to_string().contains("x0 - x1"), "{error}");
}

#[test]
fn rows_in_which_a_variable_was_imposed_do_not_train_its_equation() {
    // From row 500 on an experiment holds r_v at 2, whatever it did.
    let mut values = Array2::zeros((1000, 3));
    for t in 1..1000 {
        let on = t >= 500;
        values[[t, 0]] = if on { 2.0 } else { 0.7 * values[[t - 1, 0]] + 0.3 * noise(1, 2 * t) };
        values[[t, 1]] = 0.5 * values[[t - 1, 0]] + 0.1 * noise(1, 2 * t + 1);
        values[[t, 2]] = if on { 2.0 } else { 0.0 };
    }
    let columns = ["r_v", "h_v", "do_robot_speed"].map(str::to_owned).to_vec();
    let data = DataFrame::new(vec![values], columns).unwrap();
    let graph =
        Graph::new(vec!["r_v".into(), "h_v".into()], 1, &[arrow(0, 0, 1), arrow(0, 1, 1)], &[]).unwrap();
    let fit = |acts_on| StructuralModel::fit(&data, &graph, &Settings::default(), &acts_on).unwrap();
    let (reported, untold) = (fit(default_intervention_targets()), fit(Vec::new()));
    let summary = |model: &StructuralModel, var: usize| model.members()[0].model.summaries[var].clone();
    assert_eq!((summary(&reported, 0).rows, summary(&reported, 1).rows), (499, 999));
    assert!((summary(&reported, 0).coefficients[0] - 0.7).abs() < 0.1);
    assert!(summary(&untold, 0).coefficients[0] > 0.85, "without being told it is misled");
    let answer = effect(&reported, &effect_of("r_v", "h_v"));
    assert!(answer.caveats.iter().any(|caveat| caveat.contains("imposed by experiment in 500 rows")));
}

#[test]
fn the_cheapest_action_that_keeps_the_limits_is_the_best() {
    let model = chain_model(1000);
    let rows = chain(2, 50);
    let question = WhatIf {
        cost: vec![CostTerm { variable: "h".into(), weight: 1.0 }],
        limits: vec![Limit { variable: "r".into(), above: None, below: Some(0.7), probability: 0.95 }],
        horizon: 8,
        ..ask(vec![
            set("slow", "r", -0.6),
            set("middle", "r", 0.0),
            set("fast", "r", 0.6),
            set("too fast", "r", 0.75),
        ])
    };
    let answer = what_if(&model, &Situation::newest(rows.view()), &question);
    // A faster robot lowers the distance, and that lowers h.
    assert_eq!(answer.ranking, [2, 1, 0]);
    let best: Vec<f64> = answer.outlooks.iter().map(|outlook| outlook.probability_best).collect();
    assert!(
        best[2] > 0.9 && (best[..3].iter().sum::<f64>() - 1.0).abs() < 1e-9 && best[3] == 0.0,
        "{best:?}"
    );
    assert!(answer.outlooks[3].text.contains("does not keep the limits"), "{}", answer.outlooks[3].text);
    let nobody = WhatIf {
        limits: vec![Limit { variable: "h".into(), above: Some(99.0), below: None, probability: 0.9 }],
        ..question
    };
    let answer = what_if(&model, &Situation::newest(rows.view()), &nobody);
    assert!(answer.ranking.is_empty() && answer.message.contains("no action keeps the limits"));
}

#[test]
fn intervals_hold_as_often_as_they_say() {
    let model = chain_model(1500);
    let rows = chain(77, 800);
    let (mut inside, mut all) = (0, 0);
    for now in (10..780).step_by(10) {
        let answer = predict(&model, &Situation { rows: rows.view(), now }, 5, 200, now as u64);
        for (var, forecast) in answer.outlooks[0].forecasts.iter().enumerate() {
            for step in 0..5 {
                let real = rows[[now + 1 + step, var]];
                inside += usize::from(forecast.lower[step] <= real && real <= forecast.upper[step]);
                all += 1;
            }
        }
    }
    let share = inside as f64 / all as f64;
    assert!((0.85..0.96).contains(&share), "{share}");
}

#[test]
fn too_few_rows_refuse_what_needs_the_equation_and_nothing_else() {
    // h is there in 40 rows only.
    let mut values = chain(1, 600);
    (0..560).for_each(|t| values[[t, 2]] = f64::NAN);
    let model =
        StructuralModel::fit(&frame(values), &chain_graph(), &Settings::default(), &Vec::new()).unwrap();
    let rows = chain(2, 50);
    let answer = what_if(&model, &Situation::newest(rows.view()), &ask(vec![]));
    assert_eq!(answer.status, Status::NotSupported);
    assert!(
        answer.message.contains("too few rows") && answer.message.contains("equation of h"),
        "{}",
        answer.message
    );
    assert_eq!(effect(&model, &effect_of("r", "h")).status, Status::NotSupported);
    let held = what_if(&model, &Situation::newest(rows.view()), &ask(vec![set("held", "h", 0.0)]));
    assert_eq!(held.status, Status::Ok, "{}", held.message);
    let nothing =
        StructuralModel::fit(&frame(chain(1, 30)), &chain_graph(), &Settings::default(), &Vec::new());
    assert!(nothing.unwrap_err().to_string().contains("too few rows"));
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let model = open_model();
            let rows = model.samples().recordings()[0].clone();
            let answer = what_if(
                &model,
                &Situation::newest(rows.view()),
                &ask(vec![set("a", "r", 0.5), Action::go_on()]),
            );
            let why = explain(&model, &Situation::newest(rows.view()), &why("h", None));
            let how = effect(&model, &effect_of("d", "h"));
            (model.to_json(), serde_json::to_string(&answer).unwrap(), format!("{why:?} {how:?}"))
        })
    };
    assert!(bytes(1) == bytes(3));
}

#[test]
fn a_file_reads_back_as_a_model_with_the_same_answers() {
    for model in [open_model(), chain_model(300)] {
        let text = model.to_json();
        let read = StructuralModel::from_json(&text).unwrap();
        assert!(read.to_json() == text);
        let rows = model.samples().recordings()[0].clone();
        let question = ask(vec![set("a", "r", 0.2)]);
        let situation = Situation::newest(rows.view());
        assert_eq!(what_if(&read, &situation, &question), what_if(&model, &situation, &question));
    }
    for broken in ["", "{}", "[1]", r#"{"schema": "roscausal/structural_model/2"}"#] {
        assert!(
            StructuralModel::from_json(broken).unwrap_err().to_string().contains("not a structural model")
        );
    }
    // Of another version its fields may be others: the version is what is told.
    let other = StructuralModel::from_json(r#"{"schema": "roscausal/structural_model/2", "rows": {}}"#);
    assert!(other.unwrap_err().to_string().contains("structural_model/2'; fit it anew"));
    let whole = chain_model(300).to_json();
    for end in (1..whole.len() - 1).step_by(whole.len() / 40) {
        assert!(StructuralModel::from_json(&whole[..end]).is_err(), "cut off after {end} bytes");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]
    #[test]
    fn no_data_and_no_question_make_a_panic(seed in 0u64..1_000_000, rows in 0usize..200, holes in 0usize..60, value in -50.0f64..50.0) {
        let mut values = chain(seed, rows.max(2));
        for k in 0..holes {
            let place = noise(seed, k).abs() * 1e6;
            let (t, var) = (place as usize % values.nrows(), place as usize % 3);
            values[[t, var]] = [f64::NAN, 0.0, 1e300, -1e-300][k % 4];
        }
        let fitted = StructuralModel::fit(&frame(values.clone()), &chain_graph(), &Settings::default(), &Vec::new());
        if let Ok(model) = fitted {
            let situation = Situation { rows: values.view(), now: seed as usize % values.nrows() };
            for counterfactual in [false, true] {
                let question = WhatIf { counterfactual, ..ask(vec![set("a", "r", value), Action::go_on()]) };
                let answer = what_if(&model, &situation, &question);
                prop_assert!(answer.status == Status::Ok || !answer.message.is_empty());
            }
            explain(&model, &situation, &why("h", None));
            effect(&model, &effect_of("r", "h"));
        }
    }
}

#[test]
fn what_something_unrecorded_may_be_behind_is_no_cause_and_no_open_pair() {
    let names: Vec<String> = (0..3).map(|k| format!("x{k}")).collect();
    let link = |cause: usize, effect: usize, lag, mark: &str| roscausal_discovery::Link {
        cause: format!("x{cause}"),
        effect: format!("x{effect}"),
        lag,
        value: Some(0.5),
        p_value: Some(0.01),
        mark: mark.parse().expect("a mark"),
        ..Default::default()
    };
    let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0);
    let rows = ndarray::Array2::from_shape_fn((60, 3), |(t, var)| noise(3 * t + var));
    let data = roscausal_discovery::DataFrame::new(vec![rows], names.clone()).unwrap();
    let quick = roscausal_discovery::Settings { cond_ind_test: "parcorr".into(), ..Default::default() };
    let control = roscausal_discovery::Control::default();
    let mut model = roscausal_discovery::analyse(&data, &quick, &control).unwrap();
    model.features = names.clone();
    model.links = vec![
        link(0, 1, 1, "-->"),
        link(1, 2, 1, "<->"),
        link(2, 2, 1, "<->"),
        link(2, 0, 1, "o->"),
        link(1, 2, 0, "<->"),
        link(0, 2, 0, "o-o"),
        link(2, 0, 0, "o-o"),
    ];
    let graph = Graph::of_model(&model, &[]).unwrap();
    assert_eq!(
        graph.arrows().collect::<Vec<_>>(),
        [roscausal_reasoning::graph::Arrow { cause: 0, effect: 1, lag: 1 }]
    );
    assert_eq!(graph.pairs(), [Pair { a: 0, b: 2, conflict: false }]);
    // Nobody is left to think that they were seen.
    let reported = roscausal_reasoning::Facts::of_model(&model).warnings.join("; ");
    assert!(
        reported.contains("x1 and x2: something not recorded") && reported.contains("x2 causes x0, or"),
        "{reported}"
    );
    assert_eq!(reported.matches("left out").count(), 4, "{reported}");
}
