//! Exact answers of linear equations: interventions, noise, counterfactuals, explanations, forecasts.

use std::sync::Arc;

use ndarray::Array2;
use roscausal_discovery::Node;
use roscausal_reasoning::{
    explain,
    graph::Graph,
    linear::least_squares,
    model::{Equation, Schedule, System},
    quality,
};
use serde_json::{Value, json};

use super::{
    case::{Answer, Case, count, list, number, numbers, rows_of},
    moments::moments,
};

/// Least squares equations of a graph on the rows `first..last`; with each the noise's variance.
fn fitted(graph: &Graph, data: &Array2<f64>, first: usize, last: usize) -> (System, Vec<f64>) {
    let column = |node: Node| (first..last).map(|t| data[[t - node.lag, node.var]]).collect::<Vec<f64>>();
    let mut variances = Vec::new();
    let mut equations = Vec::new();
    for var in 0..graph.len() {
        let parents = graph.parents(var);
        let columns: Vec<Vec<f64>> = parents.iter().map(|&parent| column(parent)).collect();
        let fit = least_squares(&column(Node::new(var, 0)), &columns);
        variances.push(fit.variance);
        equations.push(Some(Arc::new(Equation::line(parents, fit.intercept, &fit.coefficients))));
    }
    (System { equations, order: graph.order().to_vec(), memory: graph.memory() }, variances)
}

/// The equations that a case gives.
fn known(case: &Case, graph: &Graph) -> Answer<(System, Vec<f64>)> {
    let (intercepts, sd) = (numbers(&case.input["intercepts"])?, numbers(&case.input["noise_sd"])?);
    let equation = |var: usize| {
        let of = |parent: &Node| number(&case.input["coefficients"][parent.lag][var][parent.var]);
        let coefficients: Vec<f64> = graph.parents(var).iter().map(of).collect::<Answer<_>>()?;
        Ok(Some(Arc::new(Equation::line(graph.parents(var), intercepts[var], &coefficients))))
    };
    let equations = (0..graph.len()).map(equation).collect::<Answer<_>>()?;
    let system = System { equations, order: graph.order().to_vec(), memory: graph.memory() };
    Ok((system, sd.iter().map(|sd| sd * sd).collect()))
}

/// The schedule of a case's interventions.
pub(crate) fn schedule(interventions: &Value, n: usize, horizon: usize) -> Answer<Schedule> {
    let mut schedule = Schedule::free(n, horizon);
    for one in list(interventions)? {
        let (step, var, value) = (count(&one["step"])? - 1, count(&one["var"])?, number(&one["value"])?);
        if one["type"] == "set" { schedule.set(step, var, value) } else { schedule.shift(step, var, value) }
    }
    Ok(schedule)
}

/// The rows `..=last` as one list.
pub(crate) fn past(data: &Array2<f64>, last: usize) -> Vec<f64> {
    data.slice(ndarray::s![..=last, ..]).iter().copied().collect()
}

pub(crate) fn questions(case: &Case) -> Answer<Value> {
    let graph = case.graph()?;
    let data = case.recordings()?.swap_remove(0);
    let (system, variance) = match case.input["first_sample"].as_u64() {
        Some(first) => fitted(&graph, &data, first as usize, data.nrows()),
        None => known(case, &graph)?,
    };
    let n = graph.len();
    let answer = |query: &Value| {
        let (row, horizon) = (count(&query["row"])?, count(&query["horizon"])?);
        let schedule = schedule(&query["interventions"], n, horizon)?;
        let (mean, variances) = moments(&system, &past(&data, row), &schedule, &variance);
        let noise = system.noise(&past(&data, row + horizon), row + 1);
        let mut rows = past(&data, row);
        system.run(&mut rows, &schedule, |step, var| noise[step * n + var]);
        let asked = &query["explain"];
        let (from, to) = (count(&asked["from_row"])?, count(&asked["to_row"])?);
        let found = explain::linear(&system, &past(&data, to), from, count(&asked["variable"])?);
        Ok(
            json!({ "mean": rows_of(&mean, n), "variance": rows_of(&variances, n), "noise": rows_of(&noise, n),
            "counterfactual": rows_of(&rows[(row + 1) * n..], n),
            "explanation": { "change": found.change, "expected_anyway": found.expected,
                "surprise_by_variable": found.surprises, "surprise_by_row_and_variable": rows_of(&found.by_row, n) } }),
        )
    };
    list(&case.input["queries"])?.iter().map(answer).collect()
}

pub(crate) fn prediction(case: &Case) -> Answer<Value> {
    let graph = case.graph()?;
    let data = case.recordings()?.swap_remove(0);
    let (n, train) = (graph.len(), count(&case.input["train_rows"])?);
    let (model, _) = fitted(&graph, &data, graph.memory(), train);
    let everything = quality::all_lagged(&graph).map_err(|e| e.to_string())?;
    let (var, _) = fitted(&everything, &data, everything.memory(), train);
    let rows: Vec<f64> = data.iter().copied().collect();
    let mut scratch = Vec::new();
    let one_step: Vec<Vec<f64>> = (0..n)
        .map(|j| (train..data.nrows()).map(|t| model.expected(&rows, t, j, &mut scratch)).collect())
        .collect();
    let horizons: Vec<usize> = list(&case.input["horizons"])?.iter().map(count).collect::<Answer<_>>()?;
    let squares = |system: Option<&System>| {
        quality::mean_squares(system, std::slice::from_ref(&data), train - 1, &horizons)
    };
    let (of_model, of_var, of_last) = (squares(Some(&model)), squares(Some(&var)), squares(None));
    let root = |squares: &[Vec<f64>]| -> Value {
        squares.iter().map(|row| row.iter().map(|v| v.sqrt()).collect::<Value>()).collect()
    };
    let skill = |reference: &[Vec<f64>]| -> Value {
        let row =
            |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| 1.0 - a / b).collect::<Value>();
        of_model.iter().zip(reference).map(row).collect()
    };
    Ok(
        json!({ "one_step": one_step, "skill_over_persistence": skill(&of_last), "skill_over_var": skill(&of_var),
        "rmse": { "model": root(&of_model), "var": root(&of_var), "persistence": root(&of_last) } }),
    )
}
