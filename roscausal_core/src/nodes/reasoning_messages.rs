//! Questions from messages, and answers as messages.

use std::collections::HashSet;

use roscausal_discovery::{
    Error, Link, LinkMark,
    text::{check_step, is_share, quoted},
};
use roscausal_msgs::{
    CausalModelInfo, Contribution, EffectResponse, ExplainResponse, Forecast, Intervention, Outlook,
    RouteRequest, RouteResponse, Time, WhatIfRequest, WhatIfResponse,
};
use roscausal_reasoning::{
    Facts, StructuralModel,
    answer::{EffectAnswer, ExplainAnswer, Forecast as OwnForecast, Status, WhatIfAnswer},
    graph::{Arrow, Graph, Pair},
    question::{Action, CostTerm, Intervention as OwnIntervention, Limit, WhatIf},
    route::plan::{Cost, Trip},
};
use serde_json::{Value as Json, json};

use super::{
    model_messages::model_of,
    reasoning_rows::{Answerable, Moment},
};
use crate::{grammar::Parsed, house::House};

/// The graph of a model that was published, without the columns `context`: that of [`Graph::of_model`]. Links at lag 0 that are
/// listed as causes in both directions contradict each other.
///
/// # Errors
/// What is not a graph ([`Graph::new`]), no step, or no p-value.
pub(super) fn graph_of(info: &CausalModelInfo, context: &[String]) -> Result<(Graph, Facts), Error> {
    let is_context = |name: &String| context.contains(name) || name.starts_with("do_");
    let mut model = model_of(info);
    check_step(model.dt)?;
    model.features.retain(|name| !is_context(name));
    model.links.retain(|link| !is_context(&link.cause) && !is_context(&link.effect));
    let linked: HashSet<&String> = model.links.iter().flat_map(|link| [&link.cause, &link.effect]).collect();
    model.dropped = model.features.iter().filter(|name| !linked.contains(name)).cloned().collect();
    let is_of_now =
        |link: &&Link| link.lag == 0 && link.mark == LinkMark::Forward && link.cause != link.effect;
    let within_a_moment: HashSet<(String, String)> =
        model.links.iter().filter(is_of_now).map(|link| (link.cause.clone(), link.effect.clone())).collect();
    for link in &mut model.links {
        if let Some(p) = link.p_value.filter(|p| !is_share(*p)) {
            let (cause, effect) = (quoted(&link.cause), quoted(&link.effect));
            let reason = format!("the p-value of {cause} -> {effect} at lag {} is {p}, not 0 to 1", link.lag);
            return Err(Error::Data(reason));
        }
        if link.lag == 0 && within_a_moment.contains(&(link.effect.clone(), link.cause.clone())) {
            link.mark = LinkMark::Conflict;
        }
    }
    Ok((Graph::of_model(&model, &[])?, Facts::of_model(&model)))
}

/// A question from its message; 0 steps: `horizon`.
pub(super) fn what_if(request: WhatIfRequest, horizon: usize, paths: usize, seed: u64) -> Parsed<WhatIf> {
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
    let action = |action: roscausal_msgs::Action| {
        let interventions = action.interventions.into_iter().map(own).collect::<Result<_, String>>()?;
        Ok(Action { name: action.name, interventions })
    };
    let actions = request.actions.into_iter().map(action).collect::<Result<_, String>>()?;
    let bound = |value: f64| Some(value).filter(|value| !value.is_nan());
    let limit = |l: roscausal_msgs::Limit| Limit {
        variable: l.variable,
        above: bound(l.above),
        below: bound(l.below),
        probability: l.probability,
    };
    Ok(WhatIf {
        counterfactual: request.counterfactual,
        horizon: if request.horizon == 0 { horizon } else { request.horizon as usize },
        actions,
        variables: request.variables,
        cost: request.cost.into_iter().map(|c| CostTerm { variable: c.variable, weight: c.weight }).collect(),
        limits: request.limits.into_iter().map(limit).collect(),
        allow_extrapolation: request.allow_extrapolation,
        paths,
        seed,
    })
}

/// A forecast as its message.
pub(super) fn forecast(own: OwnForecast) -> Forecast {
    let OwnForecast { variable, mean, lower, upper, skill, .. } = own;
    let skill = skill.into_iter().map(|skill| skill.unwrap_or(f64::NAN)).collect();
    Forecast { variable, mean, lower, upper, skill }
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
    let contribution = |own: roscausal_reasoning::answer::Contribution| {
        let roscausal_reasoning::answer::Contribution { variable, value, lower, upper, text } = own;
        Contribution { variable, value, lower, upper, text }
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

/// The answer to a question about a route, or why there is none.
pub(super) fn route_response(house: &House, request: &RouteRequest) -> Answerable<RouteResponse> {
    let told = house.newest().map_err(|error| (Status::NoData, error.to_string()))?;
    let (map, known) = &*told;
    let bad = |error: Error| match error {
        Error::Data(reason) => (Status::NotSupported, reason),
        other => (Status::BadRequest, other.to_string()),
    };
    let trip = Trip {
        from: map.place(&request.from_place).map_err(bad)?,
        to: map.place(&request.to_place).map_err(bad)?,
        hour: request.hour,
        horizon: request.horizon,
        allowed: (request.allowed != 0.0).then_some(request.allowed),
        now: (!request.now.is_empty()).then_some(request.now.as_slice()),
        cost: Cost::default(),
    };
    let (best, at_once) = known.house(map, request.loaded).best(&trip).map_err(bad)?;
    let (lower, upper) = best.seconds_interval();
    Ok(RouteResponse {
        wait: best.wait,
        places: best.places.iter().map(|place| map.places[*place].name.clone()).collect(),
        seconds: best.seconds.mean,
        lower,
        upper,
        people: best.people,
        battery: best.battery,
        late: best.late.unwrap_or(0.0),
        text: best.sentence(map, at_once.as_ref()),
        caveats: known.notes(map, request.loaded),
        ..RouteResponse::default()
    })
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
    let members = model.members().iter();
    let members = members.map(|one| json!({"equations": one.model.summaries, "quality": one.quality}));
    let rows: usize = model.samples().recordings().iter().map(|recording| recording.nrows()).sum();
    json!({
        "model_id": model.id(),
        "variables": graph.names(),
        "links": links,
        "dt": model.facts.dt,
        "method": model.facts.method,
        "rows": rows,
        "members": members.collect::<Vec<Json>>(),
    })
    .to_string()
}

#[cfg(test)]
mod tests {
    use roscausal_discovery::{LinkMark, Model, Settings};
    use roscausal_msgs::{CausalLink, std_msgs::Header};

    use super::{
        super::model_messages::{Origin, causal_model_info},
        *,
    };

    fn link(cause: &str, effect: &str, lag: u32, mark: &str) -> CausalLink {
        let (cause, effect, mark) = (cause.into(), effect.into(), mark.into());
        CausalLink { cause, effect, lag, mark, tested: true, ..CausalLink::default() }
    }

    #[test]
    fn a_pair_within_a_moment_may_go_either_way_and_columns_of_experiments_are_no_variables() {
        let info = CausalModelInfo {
            max_lag: 2,
            candidate_features: ["h_v", "d", "r_v", "do_robot_speed"].map(str::to_owned).to_vec(),
            links: vec![
                link("r_v", "d", 1, "-->"),
                link("h_v", "d", 0, "o-o"),
                link("d", "h_v", 0, "o-o"),
                link("do_robot_speed", "r_v", 0, "-->"),
                link("h_v", "d", 2, "<->"),
            ],
            ..CausalModelInfo::default()
        };
        let (graph, facts) = graph_of(&info, &["do_robot_speed".to_owned()]).expect("a graph");
        assert_eq!(graph.names(), ["h_v", "d", "r_v"]);
        assert_eq!(graph.arrows().collect::<Vec<_>>(), [Arrow { cause: 2, effect: 1, lag: 1 }]);
        assert_eq!(graph.pairs(), [Pair { a: 0, b: 1, conflict: false }]);
        assert_eq!((graph.largest_lag(), facts.warnings.len(), facts.dt), (2, 1, None));
    }

    #[test]
    fn a_message_is_the_graph_that_the_file_of_its_model_is_for_every_mark() {
        let names = ["a", "b", "c"].map(str::to_owned).to_vec();
        for (mark, lag) in LinkMark::ALL.into_iter().skip(1).flat_map(|mark| [(mark, 0), (mark, 1)]) {
            let possible = lag == 0 || matches!(mark.symbol(), "-->" | "o->" | "<->" | "x->");
            if !possible || mark == LinkMark::Backward {
                continue;
            }
            let link = |cause: &str, effect: &str, lag, mark| Link {
                cause: cause.into(),
                effect: effect.into(),
                lag,
                value: Some(0.5),
                p_value: Some(0.01),
                mark,
                ..Link::default()
            };
            let links = vec![link("a", "b", 1, LinkMark::Forward), link("b", "c", lag, mark)];
            let model =
                Model { features: names.clone(), tau_max: 1, links, ..Settings::default().blank_model() };
            let origin = Origin { candidate_features: names.clone(), ..Origin::default() };
            let info = causal_model_info(&model, &Header::default(), &origin, None);
            let (of_message, facts) = graph_of(&info, &[]).expect("a graph");
            let of_file = Graph::of_model(&model, &[]).expect("a graph");
            let all = |graph: &Graph| (graph.arrows().collect::<Vec<_>>(), graph.pairs().to_vec());
            assert_eq!(all(&of_message), all(&of_file), "{mark:?} at lag {lag}");
            assert_eq!(facts.warnings, Facts::of_model(&model).warnings);
        }
    }

    #[test]
    fn causes_in_both_directions_within_a_moment_contradict_each_other() {
        let links = vec![link("a", "b", 0, "-->"), link("b", "a", 0, "")];
        let (graph, _) =
            graph_of(&CausalModelInfo { links, ..CausalModelInfo::default() }, &[]).expect("a graph");
        assert_eq!(graph.pairs(), [Pair { a: 0, b: 1, conflict: true }]);
    }

    #[test]
    fn a_message_that_is_no_model_is_refused_in_a_sentence() {
        let whole = CausalModelInfo {
            max_lag: 1,
            candidate_features: ["a", "b"].map(str::to_owned).to_vec(),
            links: vec![link("a", "b", 1, "-->")],
            ..CausalModelInfo::default()
        };
        assert!(graph_of(&whole, &[]).is_ok());
        let refused = |change: fn(&mut CausalModelInfo)| {
            let mut info = whole.clone();
            change(&mut info);
            graph_of(&info, &[]).expect_err("no graph").to_string()
        };
        type Case = (&'static str, fn(&mut CausalModelInfo));
        let cases: [Case; 12] = [
            ("too large", |info| info.max_lag = u32::MAX),
            ("too large", |info| info.links[0].lag = 4_000_000_000),
            ("too many", |info| info.candidate_features = (0..3000).map(|k| format!("x{k}")).collect()),
            ("there twice", |info| info.candidate_features.push("a".into())),
            ("has no name", |info| info.candidate_features.push(String::new())),
            ("there twice", |info| info.links.push(info.links[0].clone())),
            ("lag 0", |info| info.links.push(link("a", "a", 0, "-->"))),
            ("not a step", |info| info.dt = f64::NAN),
            ("not a step", |info| info.dt = -0.1),
            ("not a step", |info| info.dt = 1e300),
            ("p-value", |info| info.links[0].p_value = f64::NAN),
            ("p-value", |info| info.links[0].p_value = 2.0),
        ];
        for (reported, change) in cases {
            let error = refused(change);
            assert!(error.contains(reported), "{reported}: {error}");
        }
    }

    #[test]
    fn an_unknown_type_of_intervention_is_refused_in_words() {
        let odd = Intervention { kind: 7, ..Intervention::default() };
        let action = roscausal_msgs::Action { name: "odd".into(), interventions: vec![odd] };
        let request = WhatIfRequest { actions: vec![action], ..WhatIfRequest::default() };
        assert!(what_if(request, 10, 400, 1).expect_err("unknown").contains("SET (0) or SHIFT (1)"));
    }
}
