//! What a reader of the page asks the reasoning node.

use roscausal_msgs::{Action, CostTerm, ExplainRequest, Intervention, Time, WhatIfRequest};
use serde_json::Value as Json;
use tokio::sync::oneshot;

/// Most actions of one question, most steps, and the longest name.
const MOST_ACTIONS: usize = 8;
const MOST_STEPS: u32 = 100;
const LONGEST_NAME: usize = 200;

/// What was read of a question, or why it is refused.
pub(crate) type Parsed<T> = Result<T, &'static str>;

/// What a reader asks.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Question {
    WhatIf(WhatIfRequest),
    Explain(ExplainRequest),
}

/// A question and who waits for its answer.
pub(crate) struct Asked {
    pub(crate) question: Question,
    pub(crate) reply: oneshot::Sender<Json>,
}

impl Question {
    /// `{"actions": [{"variable": "r_v", "value": 0.4}, ...], "cost": {"variable": "h_risk", "weight": 1}, "horizon": 10}`: what if each
    /// variable were set to the value, beside going on. Without a horizon, or with 0, it is the node's.
    pub(crate) fn what_if(text: &str) -> Parsed<Self> {
        let json: Json = serde_json::from_str(text).map_err(|_| "The question is not JSON.\n")?;
        let actions = json["actions"].as_array().ok_or("The question has no list of actions.\n")?;
        if actions.len() > MOST_ACTIONS {
            return Err("There are too many actions in one question.\n");
        }
        let mut request = WhatIfRequest {
            actions: vec![Action { name: "go on".into(), interventions: Vec::new() }],
            horizon: horizon(&json["horizon"])?,
            ..WhatIfRequest::default()
        };
        for action in actions {
            let (variable, value) = term(action, "value")?;
            let name = format!("{variable} = {}", written(value));
            if request.actions.iter().all(|known| known.name != name) {
                request.actions.push(Action::one(name, Intervention::set(variable, [value])));
            }
        }
        if !json["cost"].is_null() {
            let (variable, weight) = term(&json["cost"], "weight")?;
            request.cost.push(CostTerm { variable, weight });
        }
        Ok(Self::WhatIf(request))
    }

    /// `{"variable": "h_v"}`: why did it change, by the largest change of late?
    pub(crate) fn explain(text: &str) -> Parsed<Self> {
        let json: Json = serde_json::from_str(text).map_err(|_| "The question is not JSON.\n")?;
        let variable = name(&json)?;
        Ok(Self::Explain(ExplainRequest { variable, from_time: Time::ZERO, to_time: Time::ZERO }))
    }
}

/// The steps that are asked for; 0 where the question does not say.
fn horizon(json: &Json) -> Parsed<u32> {
    if json.is_null() {
        return Ok(0);
    }
    let steps = json.as_f64().filter(|steps| *steps >= 0.0 && steps.fract() == 0.0);
    let steps = steps.ok_or(
        "The horizon is not a whole number of steps; give one, such as 10, or leave it out for the node's own.\n",
    )?;
    Ok(steps.min(f64::from(MOST_STEPS)) as u32)
}

fn name(json: &Json) -> Parsed<String> {
    let name = json["variable"].as_str().filter(|name| !name.is_empty() && name.len() <= LONGEST_NAME);
    name.map(str::to_owned).ok_or("The question names no variable.\n")
}

fn term(json: &Json, number: &str) -> Parsed<(String, f64)> {
    let value = json[number].as_f64().filter(|value| value.is_finite()).ok_or("A number is missing.\n")?;
    Ok((name(json)?, value))
}

/// A number as the page writes it: with all its digits, so that two values have two names.
fn written(value: f64) -> String {
    match value.abs() {
        size if size >= 1e21 => format!("{value:e}").replace('e', "e+"),
        size if size > 0.0 && size < 1e-6 => format!("{value:e}"),
        _ => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hostile_question_is_refused_or_asked() {
        let target = roscausal_fuzz::Target {
            corpus: concat!(env!("CARGO_MANIFEST_DIR"), "/tests/corpus/question").into(),
            seeds: vec![
                br#"{"actions": [{"variable": "r_v", "value": 0.4}], "cost": {"variable": "h", "weight": -1}, "horizon": 10}"#.to_vec(),
                br#"{"variable": "h_v"}"#.to_vec(),
            ],
            tokens: &[b"[", b"{\"actions\":", b"1e308", b"null", b"\"\\ud800\""],
            bytes_per_byte: 400,
        };
        target.run(|input| {
            let text = String::from_utf8_lossy(input);
            let _ = (Question::what_if(&text), Question::explain(&text));
        });
    }

    #[test]
    fn a_question_sets_one_variable_per_action_beside_going_on() {
        let text = r#"{"actions": [{"variable": "r_v", "value": 0.4}, {"variable": "r_v", "value": 0.4}, {"variable": "r_v", "value": 0}],
            "cost": {"variable": "<b>", "weight": -1}, "horizon": 1000000}"#;
        let Ok(Question::WhatIf(request)) = Question::what_if(text) else { panic!("no question") };
        let names: Vec<&str> = request.actions.iter().map(|action| action.name.as_str()).collect();
        assert_eq!(names, ["go on", "r_v = 0.4", "r_v = 0"]);
        assert_eq!(request.actions[1].interventions[0].values, [0.4]);
        assert_eq!((request.horizon, request.cost[0].variable.as_str()), (100, "<b>"));
        assert!(!request.allow_extrapolation);
    }

    #[test]
    fn two_actions_have_two_names_however_small_they_are() {
        let action = |value: &str| format!(r#"{{"variable": "x", "value": {value}}}"#);
        let all = ["1e-9", "2.5e-9", "0", "0.00004", "0.4", "0.40001", "-3", "1e21"].map(action).join(", ");
        let Ok(Question::WhatIf(request)) = Question::what_if(&format!(r#"{{"actions": [{all}]}}"#)) else {
            panic!("no question")
        };
        let names: Vec<&str> = request.actions[1..].iter().map(|action| action.name.as_str()).collect();
        // As JavaScript writes them: the page finds its answer by them.
        let written = ["1e-9", "2.5e-9", "0", "0.00004", "0.4", "0.40001", "-3", "1e+21"];
        assert_eq!(names, written.map(|value| format!("x = {value}")));
    }

    #[test]
    fn a_horizon_that_is_no_whole_number_is_refused_in_a_sentence() {
        let asked = |horizon: &str| Question::what_if(&format!(r#"{{"actions": [], "horizon": {horizon}}}"#));
        for bad in ["2.5", "-1", "\"10\"", "[10]", "true"] {
            let reason = asked(bad).expect_err(bad);
            assert!(reason.starts_with("The horizon is not a whole number"), "{bad}: {reason}");
        }
        for (good, steps) in [("10", 10), ("10.0", 10), ("0", 0), ("null", 0), ("1e12", 100)] {
            let Ok(Question::WhatIf(request)) = asked(good) else { panic!("{good} is refused") };
            assert_eq!(request.horizon, steps, "{good}");
        }
    }

    #[test]
    fn what_is_no_question_is_refused() {
        let long = format!(r#"{{"actions": [{{"variable": "{}", "value": 1}}]}}"#, "x".repeat(300));
        let many = format!(r#"{{"actions": [{}]}}"#, [r#"{"variable": "x", "value": 1}"#; 9].join(","));
        for bad in [
            "",
            "[]",
            "{}",
            r#"{"actions": [{"variable": "x"}]}"#,
            r#"{"actions": [{"value": 1}]}"#,
            r#"{"actions": [{"variable": "x", "value": 1e999}]}"#,
            r#"{"actions": [], "cost": {"variable": "x"}}"#,
            &long,
            &many,
        ] {
            assert!(Question::what_if(bad).is_err(), "{bad}");
        }
        assert!(Question::explain(r#"{"variable": ""}"#).is_err() && Question::explain("no").is_err());
        assert!(Question::explain(r#"{"variable": "h_v"}"#).is_ok());
    }
}
