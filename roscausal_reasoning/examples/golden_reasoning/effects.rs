//! Adjustment sets, total effects, mediation, unoriented links.

use ndarray::Array2;
use roscausal_reasoning::{
    effects::{Mediation, adjusted, wright},
    graph::{Graph, adjustment},
    linear::LinearSystem,
};
use serde_json::{Value, json};

use super::case::{Answer, Case, count, list, matrix, node, nodes, numbers, written};

pub(crate) fn adjustment_sets(case: &Case) -> Answer<Value> {
    let graph = case.graph()?;
    let matrix_of = |rows: &Value| -> Answer<Array2<f64>> {
        let rows = list(rows)?.iter().map(numbers).collect::<Answer<Vec<_>>>()?;
        let n = rows.len();
        Array2::from_shape_vec((n, n), rows.concat()).map_err(|e| e.to_string())
    };
    let system = LinearSystem {
        coefficients: list(&case.input["coefficients"])?.iter().map(matrix_of).collect::<Answer<_>>()?,
        intercepts: vec![0.0; graph.len()],
        order: graph.order().to_vec(),
    };
    let answer = |query: &Value| {
        let (x, y) = (nodes(&query["x"])?, node(&query["y"][0])?);
        let found = adjustment(&graph, &x, y);
        let mut answer = json!({ "causal_path": found.causal_path, "window": found.window,
            "mediators": written(&found.mediators), "optimal_set": found.set.as_deref().map(written) });
        if let [x] = x[..] {
            answer["true_effect"] = json!(system.effects(x.lag)[x.lag][[y.var, x.var]]);
        }
        Ok(answer)
    };
    list(&case.input["queries"])?.iter().map(answer).collect()
}

pub(crate) fn total_effects(case: &Case) -> Answer<Value> {
    let (graph, samples) = (case.graph()?, case.samples()?);
    let answer = |query: &Value| {
        let (x, y) = (nodes(&query["x"])?, node(&query["y"][0])?);
        let found = adjustment(&graph, &x, y);
        let set = found.set.clone().ok_or("no adjustment set")?;
        let fit = adjusted(&samples, &x, y, &set, found.window);
        let of_set = fit.fit.coefficients[1..].iter().zip(&fit.means);
        let rest = of_set.fold(fit.fit.intercept, |sum, (b, v)| sum + b * v);
        let means: Vec<f64> =
            numbers(&query["do_values"])?.iter().map(|v| rest + fit.coefficients[0] * v).collect();
        Ok(
            json!({ "adjustment_set": written(&set), "first_sample": fit.first_sample, "n_samples": fit.n_samples,
            "coefficient": fit.coefficients[0], "standard_error": fit.standard_errors[0], "mean_under_do": means,
            "wright": wright(&samples, &graph, x[0], y, &found, found.window) }),
        )
    };
    list(&case.input["queries"])?.iter().map(answer).collect()
}

pub(crate) fn mediation(case: &Case) -> Answer<Value> {
    let (graph, samples) = (case.graph()?, case.samples()?);
    let horizon = count(&case.input["horizon"])?;
    let standardise = case.input["standardise"] == true;
    let found = Mediation::fit(&samples, &graph, horizon, standardise).map_err(|e| e.to_string())?;
    let none = Array2::zeros((graph.len(), graph.len()));
    let coefficients = (0..=horizon).map(|lag| matrix(found.system.coefficients.get(lag).unwrap_or(&none)));
    let mediated = found.mediated.iter().map(|lags| lags.iter().map(matrix).collect::<Value>());
    Ok(json!({ "first_sample": horizon, "coefficients": coefficients.collect::<Value>(),
        "total_effects": found.total.iter().map(matrix).collect::<Value>(), "mediated_effects": mediated.collect::<Value>(),
        "ace": ace(&found, false), "acs": acs(&found, false), "amce": amce(&found, false), "ace_all_lags": ace(&found, true),
        "acs_all_lags": acs(&found, true), "amce_all_lags": amce(&found, true) }))
}

/// The effects of all lags as one number: their mean, or the largest.
fn summary(effects: &[Array2<f64>], effect: usize, cause: usize, mean: bool) -> f64 {
    let sizes = effects.iter().map(|lag| lag[[effect, cause]].abs());
    if mean { sizes.sum::<f64>() / effects.len().max(1) as f64 } else { sizes.fold(0.0, f64::max) }
}

/// Average causal effect of each variable on the others (Runge et al. 2015).
fn ace(found: &Mediation, over: bool) -> Vec<f64> {
    let n = found.system.len();
    let mean = |i| (0..n).filter(|&j| j != i).map(|j| summary(&found.total, j, i, over)).sum::<f64>();
    (0..n).map(|i| mean(i) / (n - 1).max(1) as f64).collect()
}

/// Average causal susceptibility of each variable to the others.
fn acs(found: &Mediation, over: bool) -> Vec<f64> {
    let n = found.system.len();
    let mean = |j| (0..n).filter(|&i| i != j).map(|i| summary(&found.total, j, i, over)).sum::<f64>();
    (0..n).map(|j| mean(j) / (n - 1).max(1) as f64).collect()
}

/// Average effect that each variable passes on: over ordered pairs of others; a variable with itself counts as a pair only for the mean
/// over lags.
fn amce(found: &Mediation, over: bool) -> Vec<f64> {
    let n = found.system.len();
    let of = |k: usize| {
        let others: Vec<usize> = (0..n).filter(|&i| i != k).collect();
        let pairs = others.iter().flat_map(|&i| others.iter().map(move |&j| (i, j)));
        let pairs: Vec<_> = pairs.filter(|(i, j)| over || i != j).collect();
        pairs.iter().map(|&(i, j)| summary(&found.mediated[k], j, i, over)).sum::<f64>()
            / pairs.len().max(1) as f64
    };
    (0..n).map(of).collect()
}

pub(crate) fn ambiguous(case: &Case) -> Answer<Value> {
    let (graph, samples) = (case.graph()?, case.samples()?);
    let members = graph.orientations().map_err(|e| e.to_string())?;
    let effect = |graph: &Graph, query: &Value| -> Answer<f64> {
        let (x, y) = (nodes(&query["x"])?, node(&query["y"][0])?);
        let found = adjustment(graph, &x, y);
        match (found.causal_path, &found.set) {
            (false, _) => Ok(0.0),
            (true, None) => Err("no adjustment set".into()),
            (true, Some(set)) => Ok(adjusted(&samples, &x, y, set, found.window).coefficients[0]),
        }
    };
    let answer = |query: &Value| {
        let mut effects: Vec<f64> =
            members.iter().map(|member| effect(&member.graph, query)).collect::<Answer<_>>()?;
        effects.sort_by(f64::total_cmp);
        Ok(json!({ "smallest": effects.first(), "largest": effects.last(), "effects": effects }))
    };
    let turned: Vec<Value> = members.iter().map(|member| json!(member.turned)).collect();
    let answers: Vec<Value> = list(&case.input["queries"])?.iter().map(answer).collect::<Answer<_>>()?;
    Ok(json!({ "members": turned, "answers": answers }))
}
