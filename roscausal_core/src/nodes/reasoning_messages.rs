//! Questions from messages, and answers as messages.

use roscausal_discovery::Error;
use roscausal_msgs::{
    CausalModelInfo, Contribution, EffectResponse, ExplainResponse, Forecast, Intervention, Outlook, Time,
    WhatIfRequest, WhatIfResponse,
};
use roscausal_reasoning::{
    Facts, StructuralModel,
    answer::{EffectAnswer, ExplainAnswer, Forecast as OwnForecast, WhatIfAnswer},
    graph::{Arrow, Graph, Pair},
    question::{Action, CostTerm, Intervention as OwnIntervention, Limit, WhatIf},
};
use serde_json::{Value as Json, json};

use super::reasoning_rows::Moment;

/// The graph of a model that was published, without the columns `context`. Within a moment, a pair that is not `cause -> effect` may
/// go either way.
pub(super) fn graph_of(info: &CausalModelInfo, context: &[String]) -> Result<(Graph, Facts), Error> {
    let is_context = |name: &String| context.contains(name) || name.starts_with("do_");
    let links: Vec<_> =
        info.links.iter().filter(|link| !is_context(&link.cause) && !is_context(&link.effect)).collect();
    let mut names: Vec<String> =
        info.candidate_features.iter().filter(|name| !is_context(name)).cloned().collect();
    for name in links.iter().flat_map(|link| [&link.cause, &link.effect]) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    let mut facts = Facts {
        dt: Some(info.dt).filter(|dt| *dt > 0.0 && dt.is_finite()),
        method: format!("{} with {}", info.method, info.cond_ind_test),
        ..Facts::default()
    };
    let (mut arrows, mut pairs): (Vec<Arrow>, Vec<Pair>) = (Vec::new(), Vec::new());
    for link in &links {
        let place = |wanted: &String| names.iter().position(|name| name == wanted).unwrap_or_default();
        let (cause, effect, lag) = (place(&link.cause), place(&link.effect), link.lag as usize);
        let directed = link.description.is_empty()
            || link.description.starts_with(&format!("{} -> {} (lag", link.cause, link.effect));
        let both_ways = lag == 0
            && links
                .iter()
                .any(|other| other.lag == 0 && other.cause == link.effect && other.effect == link.cause);
        if directed && !both_ways {
            arrows.push(Arrow { cause, effect, lag });
        } else if lag == 0 {
            if !pairs
                .iter()
                .any(|pair| (pair.b, pair.a) == (cause, effect) || (pair.a, pair.b) == (cause, effect))
            {
                pairs.push(Pair { a: cause, b: effect, conflict: true });
            }
        } else {
            facts.warnings.push(format!("the link '{}' is no plain cause and is left out", link.description));
            continue;
        }
        facts.p_values.push((link.cause.clone(), link.effect.clone(), lag, link.p_value));
    }
    let linked = |name: &&String| links.iter().any(|link| link.cause == **name || link.effect == **name);
    facts.dropped = names.iter().filter(|name| !linked(name)).cloned().collect();
    let largest = links.iter().map(|link| link.lag).max().unwrap_or(0).max(info.max_lag);
    Ok((Graph::new(names, largest as usize, &arrows, &pairs)?, facts))
}

/// A question from its message; 0 steps: `horizon`.
pub(super) fn what_if(
    request: WhatIfRequest,
    horizon: usize,
    paths: usize,
    seed: u64,
) -> Result<WhatIf, String> {
    let own = |one: Intervention| {
        let made = match one.kind {
            Intervention::SET => OwnIntervention::set(one.variable, one.values),
            Intervention::SHIFT => OwnIntervention::shift(one.variable, one.values),
            other => {
                return Err(format!(
                    "type {other} of an intervention is unknown; it is SET (0) or SHIFT (1)"
                ));
            }
        };
        Ok(made.during(one.first_step as usize, one.last_step as usize))
    };
    let mut actions = Vec::new();
    for action in request.actions {
        let interventions = action.interventions.into_iter().map(own).collect::<Result<_, _>>()?;
        actions.push(Action { name: action.name, interventions });
    }
    let bound = |value: f64| Some(value).filter(|value| !value.is_nan());
    Ok(WhatIf {
        counterfactual: request.counterfactual,
        horizon: if request.horizon == 0 { horizon } else { request.horizon as usize },
        actions,
        variables: request.variables,
        cost: request.cost.into_iter().map(|c| CostTerm { variable: c.variable, weight: c.weight }).collect(),
        limits: request
            .limits
            .into_iter()
            .map(|l| Limit {
                variable: l.variable,
                above: bound(l.above),
                below: bound(l.below),
                probability: l.probability,
            })
            .collect(),
        allow_extrapolation: request.allow_extrapolation,
        paths,
        seed,
    })
}

/// A forecast as its message.
pub(super) fn forecast(own: OwnForecast) -> Forecast {
    Forecast {
        variable: own.variable,
        mean: own.mean,
        lower: own.lower,
        upper: own.upper,
        skill: own.skill.into_iter().map(|skill| skill.unwrap_or(f64::NAN)).collect(),
    }
}

/// The answer as its message.
pub(super) fn what_if_response(answer: WhatIfAnswer, stamp: Time, more: Vec<String>) -> WhatIfResponse {
    let outlook = |own: roscausal_reasoning::answer::Outlook| Outlook {
        action: own.action,
        forecasts: own.forecasts.into_iter().map(forecast).collect(),
        supported_steps: u32::try_from(own.supported_steps).unwrap_or(u32::MAX),
        cost: own.cost,
        cost_lower: own.cost_lower,
        cost_upper: own.cost_upper,
        probability_limits: own.probability_limits,
        probability_best: own.probability_best,
        text: own.text,
    };
    WhatIfResponse {
        status: answer.status as u8,
        message: answer.message,
        stamp,
        dt: answer.dt.unwrap_or(f64::NAN),
        model_id: answer.model_id,
        outlooks: answer.outlooks.into_iter().map(outlook).collect(),
        ranking: answer.ranking.into_iter().filter_map(|k| i32::try_from(k).ok()).collect(),
        caveats: answer.caveats.into_iter().chain(more).collect(),
    }
}

/// The answer as its message.
pub(super) fn explain_response(answer: ExplainAnswer, moment: &Moment, more: Vec<String>) -> ExplainResponse {
    let contribution = |own: roscausal_reasoning::answer::Contribution| Contribution {
        variable: own.variable,
        value: own.value,
        lower: own.lower,
        upper: own.upper,
        text: own.text,
    };
    ExplainResponse {
        status: answer.status as u8,
        message: answer.message,
        from_time: moment.stamp(answer.from_row),
        to_time: moment.stamp(answer.to_row),
        change: answer.change,
        expected: answer.expected,
        contributions: answer.contributions.into_iter().map(contribution).collect(),
        text: answer.text,
        caveats: answer.caveats.into_iter().chain(more).collect(),
    }
}

/// The answer as its message.
pub(super) fn effect_response(answer: EffectAnswer, more: Vec<String>) -> EffectResponse {
    EffectResponse {
        status: answer.status as u8,
        message: answer.message,
        total: answer.total,
        lower: answer.lower,
        upper: answer.upper,
        direct: answer.direct,
        mediators: answer.mediators,
        mediated: answer.mediated,
        adjustment_set: answer.adjustment_set,
        robustness: answer.robustness,
        text: answer.text,
        caveats: answer.caveats.into_iter().chain(more).collect(),
    }
}

/// The structural model without its rows, as JSON: links, equations, skill.
pub(super) fn structural_model(model: &StructuralModel) -> String {
    let graph = model.graph();
    let link = |cause: usize, effect: usize, lag: usize, mark: &str| json!({"cause": graph.names()[cause], "effect": graph.names()[effect], "lag": lag, "mark": mark});
    let arrows = graph.arrows().map(|a: Arrow| link(a.cause, a.effect, a.lag, "-->"));
    let pairs =
        graph.pairs().iter().map(|p: &Pair| link(p.a, p.b, 0, if p.conflict { "x-x" } else { "o-o" }));
    let links: Vec<Json> = arrows.chain(pairs).collect();
    let members: Vec<Json> = model
        .members()
        .iter()
        .map(|member| json!({"equations": member.model.summaries, "quality": member.quality}))
        .collect();
    let rows: usize = model.samples().recordings().iter().map(|recording| recording.nrows()).sum();
    json!({
        "model_id": model.id(),
        "variables": graph.names(),
        "links": links,
        "dt": model.facts.dt,
        "method": model.facts.method,
        "rows": rows,
        "members": members,
    })
    .to_string()
}

#[cfg(test)]
mod tests {
    use roscausal_msgs::CausalLink;

    use super::*;

    fn link(cause: &str, effect: &str, lag: u32, arrow: &str) -> CausalLink {
        CausalLink {
            cause: cause.into(),
            effect: effect.into(),
            lag,
            description: format!("{cause} {arrow} {effect} (lag {lag}): strength 0.5, p = 0.01"),
            ..CausalLink::default()
        }
    }

    #[test]
    fn a_pair_within_a_moment_may_go_either_way_and_columns_of_experiments_are_no_variables() {
        let info = CausalModelInfo {
            max_lag: 2,
            candidate_features: ["h_v", "d", "r_v", "do_robot_speed"].map(str::to_owned).to_vec(),
            links: vec![
                link("r_v", "d", 1, "->"),
                link("h_v", "d", 0, "--"),
                link("d", "h_v", 0, "--"),
                link("do_robot_speed", "r_v", 0, "->"),
                link("h_v", "d", 2, "<->"),
            ],
            ..CausalModelInfo::default()
        };
        let (graph, facts) = graph_of(&info, &["do_robot_speed".to_owned()]).expect("a graph");
        assert_eq!(graph.names(), ["h_v", "d", "r_v"]);
        assert_eq!(graph.arrows().collect::<Vec<_>>(), [Arrow { cause: 2, effect: 1, lag: 1 }]);
        assert_eq!(graph.pairs(), [Pair { a: 0, b: 1, conflict: true }]);
        assert_eq!((graph.largest_lag(), facts.warnings.len(), facts.dt), (2, 1, None));
    }

    #[test]
    fn an_unknown_type_of_intervention_is_refused_in_words() {
        let odd = Intervention { kind: 7, ..Intervention::default() };
        let action = roscausal_msgs::Action { name: "odd".into(), interventions: vec![odd] };
        let request = WhatIfRequest { actions: vec![action], ..WhatIfRequest::default() };
        assert!(what_if(request, 10, 400, 1).expect_err("unknown").contains("SET (0) or SHIFT (1)"));
    }
}
