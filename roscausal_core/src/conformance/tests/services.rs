//! Laws of services.

use std::{
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use roscausal_msgs::{Effect, EffectRequest, EffectResponse, Explain, ExplainRequest};

use super::{PATIENCE, QUIET, must};
use crate::{
    Result,
    gate::lock,
    middleware::{Middleware, Reply},
};

/// A question with a number, which the answer repeats.
fn question(cause: &str, number: u32) -> EffectRequest {
    EffectRequest { cause: cause.to_owned(), max_lag: number, ..EffectRequest::default() }
}

fn answer(request: &EffectRequest) -> EffectResponse {
    EffectResponse { total: vec![request.max_lag.into()], ..EffectResponse::default() }
}

fn ask<M: Middleware>(caller: &M, name: &str, cause: &str, number: u32) -> Result<Vec<f64>> {
    caller.call::<Effect>(name, &question(cause, number), PATIENCE).map(|answer| answer.total)
}

/// Answers of questions whose cause is "slow". The others are answered at once.
type Open = Arc<Mutex<Vec<(EffectRequest, Reply<EffectResponse>)>>>;

/// A service that keeps its slow questions open.
fn serve<M: Middleware>(node: &M, name: &str) -> Result<(M::Server, Open)> {
    let open = Open::default();
    let kept = open.clone();
    let server = node.serve::<Effect>(name, move |request, reply| match request.cause.as_str() {
        "slow" => lock(&kept).push((request, reply)),
        "dropped" => drop(reply),
        _ => reply.send(answer(&request)),
    })?;
    Ok((server, open))
}

fn wait_for_one(open: &Open) -> (EffectRequest, Reply<EffectResponse>) {
    let start = Instant::now();
    loop {
        if let Some(one) = lock(open).pop() {
            return one;
        }
        assert!(start.elapsed() < PATIENCE, "a question arrives: not within {PATIENCE:?}");
        thread::sleep(Duration::from_millis(1));
    }
}

/// Several callers at once each get the answers to their own questions.
pub fn every_caller_gets_its_own_answers<M: Middleware>(node: &impl Fn(&str) -> M) {
    let (server, near) = (node("own_server"), node("own_caller"));
    let _server = must(serve(&server, "/own_answers"), "serve");
    thread::scope(|scope| {
        for caller in 0..3 {
            let near = near.clone();
            scope.spawn(move || {
                for number in 10 * caller..10 * caller + 4 {
                    let reported = must(ask(&near, "/own_answers", "x", number), "a question is answered");
                    assert_eq!(reported, [f64::from(number)], "the answer belongs to the question");
                }
            });
        }
    });
}

/// An answer may come late, from another thread, and holds up no other question.
pub fn a_late_answer_holds_up_no_other<M: Middleware>(node: &impl Fn(&str) -> M) {
    let (server, slow, quick) = (node("late_server"), node("late_slow"), node("late_quick"));
    let (_server, open) = must(serve(&server, "/late_answers"), "serve");
    thread::scope(|scope| {
        let waiting = scope.spawn(|| must(ask(&slow, "/late_answers", "slow", 1), "a late answer arrives"));
        let (request, reply) = wait_for_one(&open);
        let reported =
            must(ask(&quick, "/late_answers", "x", 2), "a question is answered while another one is open");
        assert_eq!(reported, [2.0]);
        assert!(!waiting.is_finished(), "the late answer has not been given yet");
        reply.send(answer(&request));
        assert!(
            waiting.join().is_ok_and(|reported| reported == [1.0]),
            "the late answer is that of its question"
        );
    });
}

/// A reply that is dropped, a service that ends, and a service that nobody offers are errors for the caller. None lets
/// it wait longer than it wants to.
pub fn no_answer_is_an_error<M: Middleware>(node: &impl Fn(&str) -> M) {
    const PATIENT: Duration = Duration::from_secs(2);
    let (server, caller) = (node("none_server"), node("none_caller"));
    let (offer, open) = must(serve(&server, "/no_answers"), "serve");
    assert_eq!(must(ask(&caller, "/no_answers", "x", 1), "a question is answered"), [1.0]);
    let start = Instant::now();
    let call = |name: &str, cause: &str| caller.call::<Effect>(name, &question(cause, 0), PATIENT);
    assert!(call("/no_answers", "dropped").is_err(), "a dropped reply is an error");
    thread::scope(|scope| {
        let waiting = scope.spawn(|| call("/no_answers", "slow"));
        let (_, reply) = wait_for_one(&open);
        drop(offer);
        drop(reply);
        assert!(waiting.join().is_ok_and(|reported| reported.is_err()), "the end of a service is an error");
    });
    assert!(call("/nobody_offers_it", "x").is_err(), "a service that nobody offers is an error");
    assert!(start.elapsed() < 3 * PATIENT + PATIENCE, "a caller waits no longer than it wants to");
}

/// A caller that has left disturbs nobody.
pub fn a_caller_that_has_left_disturbs_nobody<M: Middleware>(node: &impl Fn(&str) -> M) {
    let (server, caller) = (node("left_server"), node("left_caller"));
    let (_server, open) = must(serve(&server, "/left"), "serve");
    assert_eq!(must(ask(&caller, "/left", "x", 1), "a question is answered"), [1.0]);
    let hasty = caller.call::<Effect>("/left", &question("slow", 2), QUIET);
    assert!(hasty.is_err(), "no answer in time is an error");
    let (request, reply) = wait_for_one(&open);
    reply.send(answer(&request));
    assert_eq!(must(ask(&caller, "/left", "x", 3), "the next question is answered"), [3.0]);
}

/// A node offers a service once. After the service has ended, its name is free again, and nothing calls back.
pub fn a_service_is_offered_once<M: Middleware>(node: &impl Fn(&str) -> M) {
    let (server, caller) = (node("once_server"), node("once_caller"));
    let (offer, _) = must(serve(&server, "~once"), "serve under a private name");
    assert!(serve(&server, "~once").is_err(), "a name is taken once");
    assert_eq!(must(ask(&caller, "/once_server/once", "x", 1), "a private name belongs to the node"), [1.0]);
    drop(offer);
    let (_again, _) = must(serve(&server, "~once"), "the name is free after the service has ended");
    assert_eq!(must(ask(&caller, "/once_server/once", "x", 2), "the new service answers"), [2.0]);
    for name in ["/9lives", "a b", "/a//b"] {
        assert!(serve(&server, name).is_err(), "'{name}' is not a legal name");
    }
}

/// A question of another type than the service's is an error.
pub fn a_question_of_another_type_is_an_error<M: Middleware>(node: &impl Fn(&str) -> M) {
    let (server, caller) = (node("typed_server"), node("typed_caller"));
    let _server = must(serve(&server, "/typed"), "serve");
    assert_eq!(must(ask(&caller, "/typed", "x", 1), "a question is answered"), [1.0]);
    let other = caller.call::<Explain>("/typed", &ExplainRequest::default(), Duration::from_secs(1));
    assert!(other.is_err(), "a question of another type is an error");
}
