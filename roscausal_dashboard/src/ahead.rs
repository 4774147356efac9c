//! What may come: the newest prediction, and the rows that lead to it.

use std::collections::{BTreeMap, VecDeque};

use roscausal_msgs::{Features, Forecast, Prediction};
use serde_json::{Value as Json, json};

use crate::{
    history::NEW_RUN_S,
    moment::{fine, rounded},
};

/// Rows that a chart shows of the past, and rows that are kept: an answer may be about a row of some time ago.
const ROWS: usize = 40;
const KEPT: usize = 1000;
/// Most variables of a message that are shown, and most steps.
const MOST_VARIABLES: usize = 64;
const MOST_STEPS: usize = 200;

/// Rows and the newest prediction.
#[derive(Default)]
pub(crate) struct Ahead {
    /// Time and values.
    rows: VecDeque<(f64, Vec<f64>)>,
    names: Vec<String>,
    /// The smallest and the largest value of each variable in this run.
    seen: BTreeMap<String, (f64, f64)>,
    prediction: Option<Prediction>,
    changed: bool,
}

impl Ahead {
    /// A row of the variables.
    pub(crate) fn row(&mut self, row: &Features) {
        let t = row.header.stamp.as_secs_f64();
        let again = self.rows.back().is_some_and(|(last, _)| t < last - NEW_RUN_S);
        if again || row.names != self.names {
            *self = Self { names: row.names.clone(), ..Self::default() };
        }
        for (name, &value) in row.names.iter().zip(&row.values).take(MOST_VARIABLES) {
            if value.is_finite() {
                let (low, high) = self.seen.entry(name.clone()).or_insert((value, value));
                (*low, *high) = (low.min(value), high.max(value));
            }
        }
        self.rows.push_back((t, row.values.clone()));
        if self.rows.len() > KEPT {
            self.rows.pop_front();
        }
    }

    /// A prediction.
    pub(crate) fn prediction(&mut self, prediction: Prediction) {
        self.prediction = Some(prediction);
        self.changed = true;
    }

    /// The newest prediction for the page, once.
    pub(crate) fn news(&mut self) -> Option<Json> {
        let prediction = self.prediction.as_ref().filter(|_| std::mem::take(&mut self.changed))?;
        let forecasts = forecasts(&prediction.forecasts);
        let range = |one: &Forecast| {
            self.seen.get(&one.variable).map(|(low, high)| json!([one.variable, fine(*low), fine(*high)]))
        };
        let seen: Vec<Json> = prediction.forecasts.iter().take(MOST_VARIABLES).filter_map(range).collect();
        Some(json!({
            "t": rounded(prediction.header.stamp.as_secs_f64()),
            "dt": prediction.dt,
            "model": prediction.model_id,
            "coverage": prediction.coverage,
            "forecasts": forecasts,
            "seen": seen,
        }))
    }

    /// The rows up to a time: times, and the values of each variable, null where unknown.
    pub(crate) fn past(&self, until: f64) -> Json {
        let end = self.rows.partition_point(|(t, _)| *t <= until + 1e-6);
        let known: Vec<&(f64, Vec<f64>)> = self.rows.range(end.saturating_sub(ROWS)..end).collect();
        let of = |k: usize| -> Vec<Json> {
            known.iter().map(|(_, values)| json!(values.get(k).copied().map(fine))).collect()
        };
        let names = self.names.iter().take(MOST_VARIABLES).enumerate();
        let values: Vec<Json> = names.map(|(k, name)| json!([name, of(k)])).collect();
        json!({"t": known.iter().map(|(t, _)| rounded(*t)).collect::<Vec<_>>(), "values": values})
    }
}

/// Forecasts for the page; what is not finite is null.
pub(crate) fn forecasts(all: &[Forecast]) -> Vec<Json> {
    let numbers = |values: &[f64]| values.iter().take(MOST_STEPS).map(|v| fine(*v)).collect::<Vec<_>>();
    let one = |forecast: &Forecast| {
        json!({
            "variable": forecast.variable,
            "mean": numbers(&forecast.mean),
            "lower": numbers(&forecast.lower),
            "upper": numbers(&forecast.upper),
        })
    };
    all.iter().take(MOST_VARIABLES).map(one).collect()
}

#[cfg(test)]
mod tests {
    use roscausal_core::Time;
    use roscausal_msgs::std_msgs::Header;

    use super::*;

    fn row(t: f64, values: &[f64]) -> Features {
        let header = Header { stamp: Time::from_secs_f64(t), frame_id: String::new() };
        let names = (0..values.len()).map(|k| format!("v{k}")).collect();
        Features { header, names, values: values.to_vec() }
    }

    #[test]
    fn a_prediction_is_told_once_with_the_range_that_was_seen() {
        let mut ahead = Ahead::default();
        for (t, x) in [(0.0, 0.5), (0.3, f64::NAN), (0.6, -1.0)] {
            ahead.row(&row(t, &[x, 2.0]));
        }
        assert_eq!(ahead.news(), None);
        let forecast = Forecast { variable: "v0".into(), mean: vec![0.1, f64::NAN], ..Forecast::default() };
        ahead.prediction(Prediction {
            forecasts: vec![forecast],
            coverage: f64::NAN,
            ..Prediction::default()
        });
        let news = ahead.news().expect("a prediction");
        assert_eq!(news["seen"], json!([["v0", -1.0, 0.5]]));
        assert_eq!(news["forecasts"][0]["mean"], json!([0.1, null]));
        assert!(news["coverage"].is_null() && ahead.news().is_none());
    }

    #[test]
    fn a_small_variable_keeps_its_digits() {
        let mut ahead = Ahead::default();
        ahead.row(&row(0.0, &[1e-9, 0.123_456]));
        ahead.row(&row(0.3, &[-2.5e-9, 1.0]));
        let of = |variable: &str, mean: f64| Forecast {
            variable: variable.into(),
            mean: vec![mean],
            ..Forecast::default()
        };
        let all = vec![of("v0", 1.234_56e-9), of("v1", 0.123_456)];
        ahead.prediction(Prediction { forecasts: all, ..Prediction::default() });
        let news = ahead.news().expect("a prediction");
        assert_eq!(news["seen"], json!([["v0", -2.5e-9, 1e-9], ["v1", 0.1235, 1.0]]));
        assert_eq!(news["forecasts"][0]["mean"], json!([1.235e-9]));
        assert_eq!(news["forecasts"][1]["mean"], json!([0.1235]));
        assert_eq!(ahead.past(1.0)["values"][0], json!(["v0", [1e-9, -2.5e-9]]));
    }

    #[test]
    fn the_past_ends_at_the_moment_asked_about_and_a_new_run_has_none() {
        let mut ahead = Ahead::default();
        for k in 0..100 {
            ahead.row(&row(f64::from(k), &[f64::from(k)]));
        }
        let past = ahead.past(97.0);
        assert_eq!(past["t"].as_array().map(Vec::len), Some(ROWS));
        assert_eq!(past["values"][0][1][ROWS - 1].as_f64(), Some(97.0));
        ahead.row(&row(1.0, &[5.0]));
        assert_eq!(ahead.past(9.0), json!({"t": [1.0], "values": [["v0", [5.0]]]}));
        ahead.row(&row(2.0, &[5.0, 6.0]));
        assert_eq!(ahead.past(9.0)["t"], json!([2.0]));
    }
}
