//! Equations by Gaussian processes, and support.

use roscausal_discovery::independence_tests::{GpRegression, TestSettings};
use roscausal_reasoning::{linear::least_squares, model::Support};
use serde_json::{Value, json};

use super::case::{Answer, Case, count, list, number, numbers};

fn rows(value: &Value) -> Answer<Vec<Vec<f64>>> {
    list(value)?.iter().map(numbers).collect()
}

fn columns(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    (0..rows.first().map_or(0, Vec::len)).map(|k| rows.iter().map(|row| row[k]).collect()).collect()
}

pub(crate) fn equation(case: &Case, expected: &Value) -> Answer<Value> {
    let (x, y, query) =
        (columns(&rows(&case.input["x"])?), numbers(&case.input["y"])?, rows(&case.input["query"])?);
    let line = least_squares(&y, &x);
    let on_line =
        |place: &[f64]| line.coefficients.iter().zip(place).fold(line.intercept, |sum, (b, v)| sum + b * v);
    let mut answer = json!({});
    for (name, trend) in [("no_trend", false), ("linear_trend", true)] {
        let target = if trend { &line.residuals } else { &y };
        let numbers_of = |process: &GpRegression| -> Answer<Value> {
            let mean = |place: &Vec<f64>| process.mean(place) + if trend { on_line(place) } else { 0.0 };
            Ok(json!({ "log_likelihood": process.optimum().log_likelihood,
                "length_scale": process.optimum().length_scale, "noise_variance": process.optimum().noise,
                "mean": query.iter().map(mean).collect::<Vec<f64>>(),
                "function_variance": process.function_variance(&query).map_err(|e| e.to_string())?,
                "leave_one_out_residuals": process.leave_one_out().map_err(|e| e.to_string())? }))
        };
        let found = GpRegression::fit(target, &x, &TestSettings::default()).map_err(|e| e.to_string())?;
        answer[name] = numbers_of(&found)?;
        let (l, s) = (number(&expected[name]["length_scale"])?, number(&expected[name]["noise_variance"])?);
        let given = GpRegression::at(target, &x, l, s).map_err(|e| e.to_string())?;
        answer[name]["given"] = numbers_of(&given)?;
    }
    Ok(answer)
}

pub(crate) fn support(case: &Case) -> Answer<Value> {
    let support = Support::new(&columns(&rows(&case.input["training"])?), count(&case.input["k"])?);
    let query = rows(&case.input["query"])?;
    let distance: Vec<f64> = query.iter().map(|place| support.distance(place)).collect();
    let supported: Vec<bool> = query.iter().map(|place| support.holds(place)).collect();
    Ok(json!({ "limit": support.limit(), "distance": distance, "supported": supported }))
}
