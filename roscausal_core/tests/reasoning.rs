//! The reasoning node on the loopback bus: rows and a model in, predictions and answers out.

#![allow(clippy::expect_used, clippy::panic, reason = "a test may panic: that is how it fails")]

use std::{
    fmt::Write as _,
    fs,
    sync::mpsc,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use roscausal_core::{
    Result, Time,
    loopback::{Loopback, LoopbackNode, LoopbackPublisher},
    middleware::{Middleware, Publish, Qos},
    nodes,
    params::Value,
};
use roscausal_msgs::{
    Action, Cancel, CancelRequest, CausalLink, CausalModelInfo, CostTerm, Effect, EffectRequest, Explain,
    ExplainRequest, Features, Intervention, Limit, Prediction, Status, WhatIf, WhatIfRequest, WhatIfResponse,
    diagnostic_msgs::DiagnosticArray,
    std_msgs::{Header, String as Text},
};

const STEP: f64 = 0.3;
const PATIENCE: Duration = Duration::from_secs(60);

/// A robot's speed, and a distance that shrinks with it: `d(t) = 0.6 d(t-1) - 0.8 r_v(t-1)`, with noise.
fn rows(count: usize) -> Vec<[f64; 2]> {
    let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
    let mut rows = vec![[0.5, 1.0]];
    for t in 1..count {
        let [r_v, d] = rows[t - 1];
        rows.push([0.25 + 0.5 * r_v + noise(2 * t), 1.0 + 0.6 * d - 0.8 * r_v + 0.3 * noise(2 * t + 1)]);
    }
    rows
}

fn row(t: usize, [r_v, d]: [f64; 2]) -> Features {
    let stamp = Time::from_secs_f64(1000.0 + STEP * t as f64);
    let names = ["r_v", "d", "do_robot_speed"].map(str::to_owned).to_vec();
    Features { header: Header { stamp, frame_id: "map".into() }, names, values: vec![r_v, d, 0.0] }
}

fn model(names: [&str; 2]) -> CausalModelInfo {
    let [r_v, d] = names;
    let link = |cause: &str, effect: &str| CausalLink {
        cause: cause.into(),
        effect: effect.into(),
        lag: 1,
        value: 0.5,
        p_value: 0.001,
        confidence: -1.0,
        description: format!("{cause} -> {effect} (lag 1): strength 0.500, p = 0.0010"),
        mark: "-->".into(),
        tested: true,
        ..CausalLink::default()
    };
    CausalModelInfo {
        header: Header { stamp: Time::from_secs_f64(1000.0), frame_id: "map".into() },
        method: "pcmci".into(),
        cond_ind_test: "parcorr".into(),
        max_lag: 1,
        dt: STEP,
        candidate_features: names.map(str::to_owned).to_vec(),
        links: vec![link(r_v, r_v), link(r_v, d), link(d, d)],
        ..CausalModelInfo::default()
    }
}

struct Bench {
    bus: Loopback,
    node: LoopbackNode,
    runs: JoinHandle<Result<()>>,
    planner: LoopbackNode,
    features: LoopbackPublisher<Features>,
    models: LoopbackPublisher<CausalModelInfo>,
}

impl Bench {
    fn new(bus: Loopback, settings: &[(&str, Value)]) -> Self {
        bus.set_node_param("reasoning", "equations", Value::Str("linear".into()));
        settings.iter().for_each(|(name, value)| bus.set_node_param("reasoning", name, value.clone()));
        let planner = bus.node("planner");
        let features = planner.advertise(nodes::FEATURES_TOPIC, Qos::Volatile(10)).expect("advertises");
        let models = planner.advertise("/roscausal/causal_model_info", Qos::Latched).expect("advertises");
        let node = bus.node("reasoning");
        let runs = {
            let node = node.clone();
            thread::spawn(move || nodes::run("reasoning", &node))
        };
        // The last thing that it does before it waits.
        while features.subscriber_count() == 0 && !runs.is_finished() {
            thread::sleep(Duration::from_millis(1));
        }
        Self { bus, node, runs, planner, features, models }
    }

    /// In lockstep, with `count` rows and the model of `names`.
    fn with_rows(count: usize, names: [&str; 2]) -> Self {
        let bench = Self::new(Loopback::lockstep(), &[]);
        bench.models.publish(&model(names)).expect("publishes");
        bench.tell(0..count);
        bench
    }

    fn tell(&self, some: std::ops::Range<usize>) {
        for (t, values) in rows(some.end).into_iter().enumerate().skip(some.start) {
            let row = row(t, values);
            self.bus.advance_to(row.header.stamp);
            self.features.publish(&row).expect("publishes");
            self.bus.settle();
        }
    }

    fn ask(&self, question: &WhatIfRequest) -> WhatIfResponse {
        self.planner.call::<WhatIf>(nodes::WHAT_IF_SERVICE, question, PATIENCE).expect("an answer")
    }

    fn end(self) {
        self.node.shutdown();
        self.runs.join().expect("no panic").expect("ends well");
    }
}

fn set(name: &str, variable: &str, value: f64) -> Action {
    Action::one(name, Intervention::set(variable, [value]))
}

fn slow_or_fast() -> WhatIfRequest {
    WhatIfRequest {
        horizon: 5,
        actions: vec![set("fast", "r_v", 0.9), set("slow", "r_v", 0.1)],
        // A large distance is cheap.
        cost: vec![CostTerm { variable: "d".into(), weight: -1.0 }],
        ..WhatIfRequest::default()
    }
}

type Subscription = <LoopbackNode as Middleware>::Subscription;

fn listen<T: roscausal_core::Message>(
    bench: &Bench,
    topic: &str,
    qos: Qos,
) -> (Subscription, mpsc::Receiver<T>) {
    let (send, messages) = mpsc::channel();
    let take = move |message: T| send.send(message).unwrap_or_default();
    (bench.planner.subscribe(topic, qos, take).expect("subscribes"), messages)
}

#[test]
fn a_planner_is_told_which_action_is_best_and_what_the_answer_rests_on() {
    let bench = Bench::with_rows(400, ["r_v", "d"]);
    let answer = bench.ask(&slow_or_fast());
    assert_eq!((answer.status, answer.message.as_str()), (Status::Ok as u8, ""), "{answer:?}");
    assert_eq!((answer.ranking.clone(), answer.dt), (vec![1, 0], STEP));
    assert_eq!(answer.stamp, row(399, [0.0; 2]).header.stamp);
    // The long-run difference of d is 0.8 x 0.8 / (1 - 0.6) x (1 - 0.6^4) after four steps of it.
    let d = |k: usize| answer.outlooks[k].forecasts[1].mean[4];
    let truth = 0.8 * 0.8 * (1.0 - 0.6_f64.powi(4)) / 0.4;
    assert!((d(1) - d(0) - truth).abs() < 0.15 * truth, "{} instead of {truth}", d(1) - d(0));
    let says = |what: &str| answer.caveats.iter().any(|caveat| caveat.contains(what));
    assert!(says("live score of the last") && says("was found 120 s ago"), "{:?}", answer.caveats);
    assert!(!says("newest row is"), "{:?}", answer.caveats);
    bench.bus.advance_to(answer.stamp.plus_secs(2.0));
    let later = bench.ask(&slow_or_fast()).caveats;
    assert!(later.iter().any(|caveat| caveat.contains("the newest row is 2.0 s old")), "{later:?}");

    let why = ExplainRequest { variable: "d".into(), ..ExplainRequest::default() };
    let why = bench.planner.call::<Explain>(nodes::EXPLAIN_SERVICE, &why, PATIENCE).expect("an answer");
    let parts: f64 = why.contributions.iter().map(|part| part.value).sum();
    assert!(why.status == 0 && (why.expected + parts - why.change).abs() < 1e-6, "{why:?}");
    assert!(why.to_time > why.from_time && why.text.contains("d "), "{why:?}");
    // The same change again, by its times.
    let again = ExplainRequest { variable: "d".into(), from_time: why.from_time, to_time: why.to_time };
    let again = bench.planner.call::<Explain>(nodes::EXPLAIN_SERVICE, &again, PATIENCE).expect("an answer");
    assert_eq!((again.change, again.contributions), (why.change, why.contributions));

    let drives = EffectRequest { cause: "r_v".into(), effect: "d".into(), ..EffectRequest::default() };
    let drives = bench.planner.call::<Effect>(nodes::EFFECT_SERVICE, &drives, PATIENCE).expect("an answer");
    assert!((drives.total[1] + 0.8).abs() < 0.1 && drives.lower[1] < drives.upper[1], "{drives:?}");
    bench.end();
}

#[test]
fn each_row_is_predicted_and_each_prediction_scored() {
    let bench = Bench::new(Loopback::lockstep(), &[]);
    let (_one, predictions) = listen::<Prediction>(&bench, nodes::PREDICTION_TOPIC, Qos::Volatile(1000));
    let (_two, reports) = listen::<DiagnosticArray>(&bench, "/diagnostics", Qos::Volatile(1000));
    bench.models.publish(&model(["r_v", "d"])).expect("publishes");
    bench.tell(0..500);
    let (_three, models) = listen::<Text>(&bench, nodes::STRUCTURAL_MODEL_TOPIC, Qos::Latched);
    bench.bus.settle();
    let all: Vec<Prediction> = predictions.try_iter().collect();
    // The model is there with the 200th row.
    assert!((295..=301).contains(&all.len()), "{}", all.len());
    let last = all.last().expect("predictions");
    assert_eq!((last.forecasts.len(), last.forecasts[0].mean.len(), last.dt), (2, 10, STEP));
    assert!((0.8..=1.0).contains(&last.coverage), "{}", last.coverage);
    let report = reports.try_iter().flat_map(|report| report.status).filter(|s| s.name == "reasoning").last();
    let report = report.expect("a report a second");
    let figure = |key: &str| report.values.iter().find(|pair| pair.key == key).map(|pair| pair.value.clone());
    let skill: f64 = figure("skill over the last value").expect("a figure").parse().expect("a number");
    assert!(report.message == "running" && skill > 0.1, "{report:?}");
    let latched = models.try_iter().last().expect("is latched").data;
    let json: serde_json::Value = serde_json::from_str(&latched).expect("JSON");
    assert!(json["model_id"] == last.model_id.as_str() && latched.len() < 100_000, "{latched}");
    bench.end();
}

#[test]
fn predictions_that_need_too_much_memory_are_missed_aloud() {
    let settings = [("horizon", Value::Int(1000)), ("prediction_paths", Value::Int(100_000))];
    let bench = Bench::new(Loopback::lockstep(), &settings);
    let (_one, predictions) = listen::<Prediction>(&bench, nodes::PREDICTION_TOPIC, Qos::Volatile(1000));
    let (_two, reports) = listen::<DiagnosticArray>(&bench, "/diagnostics", Qos::Volatile(1000));
    bench.models.publish(&model(["r_v", "d"])).expect("publishes");
    bench.tell(0..230);
    let report = reports.try_iter().flat_map(|report| report.status).filter(|s| s.name == "reasoning").last();
    let report = report.expect("a report a second");
    assert!(
        report.message.contains("no predictions") && report.message.contains("too much memory"),
        "{report:?}"
    );
    assert_eq!(predictions.try_iter().count(), 0);
    bench.end();
}

#[test]
fn a_bad_question_gets_a_sentence_and_the_next_one_an_answer() {
    let bench = Bench::with_rows(300, ["r_v", "d"]);
    let good = slow_or_fast();
    let with = |change: &dyn Fn(&mut WhatIfRequest)| {
        let mut question = good.clone();
        change(&mut question);
        question
    };
    let first = |q: &mut WhatIfRequest, change: &dyn Fn(&mut Intervention)| {
        change(&mut q.actions[0].interventions[0])
    };
    let nan = f64::NAN;
    let questions = [
        with(&|q| first(q, &|one| one.variable = "r_w".into())),
        with(&|q| first(q, &|one| one.first_step = 0)),
        with(&|q| first(q, &|one| one.values = vec![nan])),
        with(&|q| first(q, &|one| one.values.clear())),
        with(&|q| first(q, &|one| one.kind = 9)),
        with(&|q| q.actions[0].interventions.clear()),
        with(&|q| q.horizon = 1_000_000_000),
        with(&|q| q.actions = (0..1000).map(|k| set(&format!("action {k}"), "r_v", 0.5)).collect()),
        with(&|q| {
            let shift = Intervention { kind: Intervention::SHIFT, ..q.actions[0].interventions[0].clone() };
            q.actions[0].interventions.push(shift);
        }),
        with(&|q| q.cost[0].weight = nan),
        with(&|q| q.variables = vec!["nobody".into()]),
        with(&|q| {
            q.limits = vec![Limit { variable: "d".into(), above: nan, below: nan, probability: 0.9 }];
        }),
    ];
    for question in questions {
        let answer = bench.ask(&question);
        assert_eq!(answer.status, Status::BadRequest as u8, "{question:?}: {answer:?}");
        assert!(answer.message.len() > 20, "{}", answer.message);
    }
    for stamp in [5.0, 1e6] {
        let answer = bench.ask(&with(&|q| q.stamp = Time::from_secs_f64(stamp)));
        assert_eq!(answer.status, Status::NoData as u8, "{answer:?}");
        assert!(answer.message.contains("go from 1000.000 to"), "{}", answer.message);
    }
    // Far from everything seen.
    let answer =
        bench.ask(&WhatIfRequest { actions: vec![set("race", "r_v", 30.0)], ..WhatIfRequest::default() });
    assert_eq!(answer.status, Status::NotSupported as u8, "{answer:?}");
    assert_eq!(bench.ask(&good).status, Status::Ok as u8);
    bench.end();
}

#[test]
fn what_is_missing_is_said_and_a_new_model_mends_it() {
    let bench = Bench::new(Loopback::lockstep(), &[]);
    let answer = bench.ask(&slow_or_fast());
    assert_eq!(answer.status, Status::NoModel as u8);
    assert!(answer.message.contains("start roscausal_discovery"), "{}", answer.message);
    bench.models.publish(&model(["r_v", "h_dg"])).expect("publishes");
    bench.tell(0..50);
    let answer = bench.ask(&slow_or_fast());
    assert_eq!(answer.status, Status::NoData as u8);
    assert!(answer.message.contains("50 rows and 200 are needed"), "{}", answer.message);
    bench.tell(50..260);
    let answer = bench.ask(&slow_or_fast());
    assert_eq!(answer.status, Status::NoModel as u8);
    assert!(answer.message.contains("'h_dg' is not on /roscausal/features"), "{}", answer.message);
    bench.models.publish(&model(["r_v", "d"])).expect("publishes");
    bench.bus.settle();
    assert_eq!(bench.ask(&slow_or_fast()).status, Status::Ok as u8);
    bench.end();
}

#[test]
fn a_restarted_node_has_its_rows_from_the_batches() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut csv = "time,r_v,d\n".to_owned();
    for (t, [r_v, d]) in rows(300).into_iter().enumerate() {
        writeln!(csv, "{:.1},{r_v},{d}", 1000.0 + STEP * t as f64).expect("writes");
    }
    let (batch, graph) = (dir.path().join("data_1.csv"), dir.path().join("graph.json"));
    fs::write(&batch, csv).expect("writes");
    let links = r#"{"links": [{"cause": "r_v", "effect": "r_v", "lag": 1}, {"cause": "r_v", "effect": "d", "lag": 1},
                              {"cause": "d", "effect": "d", "lag": 1}]}"#;
    fs::write(&graph, links).expect("writes");
    let file = |path: &std::path::Path| Value::Str(path.display().to_string());
    let settings = [("data", Value::List(vec![file(&batch)])), ("graph", file(&graph))];
    let bench = Bench::new(Loopback::lockstep(), &settings);
    bench.bus.advance_to(Time::from_secs_f64(2000.0));
    let answer = bench.ask(&slow_or_fast());
    assert_eq!((answer.status, answer.ranking), (Status::Ok as u8, vec![1, 0]), "{}", answer.message);
    bench.end();
}

#[test]
fn ten_callers_at_once_get_the_same_answer_while_rows_arrive() {
    let start = Instant::now();
    let bus = Loopback::live(move || Time::from_secs_f64(1000.0 + start.elapsed().as_secs_f64()));
    let bench = Bench::new(bus, &[("refit_every", Value::Double(1e6)), ("threads", Value::Int(2))]);
    bench.models.publish(&model(["r_v", "d"])).expect("publishes");
    let all = rows(300);
    for (t, values) in all.iter().enumerate().take(250) {
        bench.features.publish(&row(t, *values)).expect("publishes");
    }
    let question = WhatIfRequest { stamp: row(240, [0.0; 2]).header.stamp, ..slow_or_fast() };
    // The fit takes its time.
    let patient = Instant::now();
    while bench.ask(&question).status != Status::Ok as u8 {
        assert!(patient.elapsed() < PATIENCE, "no model");
        thread::sleep(Duration::from_millis(20));
    }
    let answers: Vec<WhatIfResponse> = thread::scope(|scope| {
        let callers: Vec<_> = (0..10)
            .map(|k| {
                let (caller, question) = (bench.bus.node(&format!("caller{k}")), &question);
                scope.spawn(move || caller.call::<WhatIf>(nodes::WHAT_IF_SERVICE, question, PATIENCE))
            })
            .collect();
        for (t, values) in all.iter().enumerate().skip(250) {
            bench.features.publish(&row(t, *values)).expect("publishes");
        }
        callers.into_iter().map(|caller| caller.join().expect("no panic").expect("an answer")).collect()
    });
    for answer in &answers {
        assert_eq!(answer.status, Status::Ok as u8, "{answer:?}");
        // As text, because a skill that was not measured is NaN.
        assert_eq!(format!("{:?}", answer.outlooks), format!("{:?}", answers[0].outlooks));
    }
    bench.end();
}

#[test]
fn a_question_gets_no_answer_after_its_patience() {
    let bus = Loopback::live(|| Time::from_secs_f64(1000.0 + STEP * 300.0));
    let bench = Bench::new(bus, &[("paths", Value::Int(100_000)), ("refit_every", Value::Double(1e6))]);
    bench.models.publish(&model(["r_v", "d"])).expect("publishes");
    for (t, values) in rows(300).into_iter().enumerate() {
        bench.features.publish(&row(t, values)).expect("publishes");
    }
    let asked = |patience| bench.ask(&WhatIfRequest { patience, ..slow_or_fast() });
    while asked(60.0).status != Status::Ok as u8 {
        thread::sleep(Duration::from_millis(20));
    }
    let late = asked(1e-9);
    assert_eq!((late.status, late.ranking, late.outlooks), (Status::Late as u8, vec![], vec![]));
    assert_eq!(asked(f64::NAN).status, Status::BadRequest as u8);
    bench.end();
}

#[test]
fn a_question_that_is_cancelled_ends_and_the_next_is_answered() {
    let bus = Loopback::live(|| Time::from_secs_f64(1000.0 + STEP * 300.0));
    let asks = bus.clone();
    let bench = Bench::new(bus, &[("paths", Value::Int(100_000)), ("refit_every", Value::Double(1e6))]);
    bench.models.publish(&model(["r_v", "d"])).expect("publishes");
    for (t, values) in rows(300).into_iter().enumerate() {
        bench.features.publish(&row(t, values)).expect("publishes");
    }
    while bench.ask(&slow_or_fast()).status != Status::Ok as u8 {
        thread::sleep(Duration::from_millis(20));
    }
    let cancel = |older_than| {
        let cancel =
            bench.planner.call::<Cancel>(nodes::CANCEL_SERVICE, &CancelRequest { older_than }, PATIENCE);
        cancel.expect("an answer").ended
    };
    assert_eq!(cancel(0.0), 0, "nothing runs");
    let long = thread::spawn(move || {
        let planner = asks.node("impatient");
        let long = WhatIfRequest { horizon: 50, ..slow_or_fast() };
        planner.call::<WhatIf>(nodes::WHAT_IF_SERVICE, &long, 10 * PATIENCE).expect("an answer")
    });
    let begun = Instant::now();
    while cancel(0.0) == 0 && begun.elapsed() < PATIENCE {
        assert_eq!(cancel(1e6), 0, "it has not been asked that long ago");
        thread::sleep(Duration::from_millis(1));
    }
    let ended = long.join().expect("no panic");
    assert_eq!((ended.status, ended.message.as_str()), (Status::Late as u8, "the question was cancelled"));
    assert_eq!(bench.ask(&slow_or_fast()).status, Status::Ok as u8);
    bench.end();
}

#[test]
fn models_that_come_faster_than_fits_end_do_not_keep_the_node_without_one() {
    let bus = Loopback::live(|| Time::from_secs_f64(1000.0 + STEP * 300.0));
    // Gaussian processes: a fit takes longer than the next model.
    let bench = Bench::new(bus, &[("equations", Value::Str("gp".into())), ("threads", Value::Int(1))]);
    for (t, values) in rows(300).into_iter().enumerate() {
        bench.features.publish(&row(t, values)).expect("publishes");
    }
    let begun = Instant::now();
    loop {
        bench.models.publish(&model(["r_v", "d"])).expect("publishes");
        let answer = bench.ask(&WhatIfRequest::default());
        if answer.status == Status::Ok as u8 {
            break;
        }
        assert!(begun.elapsed() < PATIENCE, "{answer:?}");
        thread::sleep(Duration::from_millis(2));
    }
    bench.end();
}
