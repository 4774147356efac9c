//! Questions of the page's readers to the reasoning node, and its answers as JSON. They are asked one after the other on a thread of
//! their own, so that a long answer holds up neither the page nor the topics.

use std::{
    sync::mpsc::{Receiver, SyncSender, sync_channel},
    thread,
    time::Duration,
};

use roscausal_core::{
    Error, Result,
    middleware::Middleware,
    nodes::{EXPLAIN_SERVICE, WHAT_IF_SERVICE},
};
use roscausal_msgs::{Contribution, Explain, ExplainResponse, Outlook, Status, WhatIf, WhatIfResponse};
use serde_json::{Value as Json, json};

use crate::{
    ahead::forecasts,
    asked::{Asked, Question},
    hub::{Frame, Hub, Keep},
    moment::rounded,
};

/// How long an answer may take.
const PATIENCE: Duration = Duration::from_secs(5);
/// Questions that may wait.
const WAITING: usize = 8;

/// Answers questions by the services of the reasoning node, until the returned sender is dropped.
///
/// # Errors
/// No thread.
pub(crate) fn answer<M: Middleware>(mw: &M, hub: &Hub) -> Result<SyncSender<Asked>> {
    let (sender, asked): (_, Receiver<Asked>) = sync_channel(WAITING);
    let (mw, hub) = (mw.clone(), hub.clone());
    let failed = |error: Error| {
        let message = format!("{error}; the node roscausal_reasoning answers such questions: is it running?");
        json!({"status": "NO_ANSWER", "message": message})
    };
    let work = move || {
        for Asked { question, reply } in asked {
            // Whoever has closed the page waits for nothing.
            if !reply.is_closed() {
                drop(reply.send(answered(&mw, &hub, &question).unwrap_or_else(failed)));
            }
        }
    };
    let begun = thread::Builder::new().name("dashboard-questions".into()).spawn(work);
    begun.map_err(|error| Error::Middleware(format!("no thread for questions: {error}")))?;
    Ok(sender)
}

fn answered<M: Middleware>(mw: &M, hub: &Hub, question: &Question) -> Result<Json> {
    match question {
        Question::WhatIf(request) => {
            let response = mw.call::<WhatIf>(WHAT_IF_SERVICE, request, PATIENCE)?;
            let past = hub.ahead().past(response.stamp.as_secs_f64());
            Ok(what_if_json(&response, past))
        }
        Question::Explain(request) => {
            let response = mw.call::<Explain>(EXPLAIN_SERVICE, request, PATIENCE)?;
            let json = explain_json(&request.variable, &response);
            // Everybody sees the last explanation.
            if response.status == Status::Ok as u8 {
                hub.send(Frame { kind: "explanation", data: json.to_string().into() }, Keep::Last);
            }
            Ok(json)
        }
    }
}

/// A status by its name in docs/reasoning.md.
fn status(number: u8) -> &'static str {
    let names = ["OK", "NOT_SUPPORTED", "AMBIGUOUS", "NO_MODEL", "NO_DATA", "BAD_REQUEST", "LATE"];
    names.get(usize::from(number)).copied().unwrap_or("NO_ANSWER")
}

fn what_if_json(response: &WhatIfResponse, past: Json) -> Json {
    let outlook = |one: &Outlook| {
        json!({
            "action": one.action,
            "supported": one.supported_steps,
            "cost": one.cost,
            "best": one.probability_best,
            "text": one.text,
            "forecasts": forecasts(&one.forecasts),
        })
    };
    json!({
        "status": status(response.status),
        "message": response.message,
        "t": rounded(response.stamp.as_secs_f64()),
        "dt": response.dt,
        "model": response.model_id,
        "outlooks": response.outlooks.iter().map(outlook).collect::<Vec<_>>(),
        "ranking": response.ranking,
        "caveats": response.caveats,
        "past": past,
    })
}

fn explain_json(variable: &str, response: &ExplainResponse) -> Json {
    let part = |one: &Contribution| json!({"variable": one.variable, "value": one.value, "lower": one.lower, "upper": one.upper});
    json!({
        "status": status(response.status),
        "message": response.message,
        "variable": variable,
        "from": rounded(response.from_time.as_secs_f64()),
        "to": rounded(response.to_time.as_secs_f64()),
        "change": response.change,
        "expected": response.expected,
        "parts": response.contributions.iter().map(part).collect::<Vec<_>>(),
        "text": response.text,
        "caveats": response.caveats,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_keeps_its_status_and_unknown_numbers_are_null() {
        let outlook = Outlook { action: "go on".into(), cost: f64::NAN, ..Outlook::default() };
        let response =
            WhatIfResponse { status: 1, dt: 0.3, outlooks: vec![outlook], ..WhatIfResponse::default() };
        let json = what_if_json(&response, Json::Null);
        assert_eq!(
            (json["status"].as_str(), &json["outlooks"][0]["cost"]),
            (Some("NOT_SUPPORTED"), &Json::Null)
        );
        assert_eq!(status(99), "NO_ANSWER");
    }
}
