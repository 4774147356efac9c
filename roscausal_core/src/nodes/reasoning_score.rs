//! How the node's predictions turn out: each is scored when its time comes.

use std::collections::VecDeque;

use roscausal_reasoning::answer::Forecast;

/// Rows over which the score runs.
const RECENT: usize = 300;
/// Rows below which nothing is said against the model.
const ENOUGH: usize = 100;
/// Coverage below which the model no longer fits.
const TOO_LOW: f64 = 0.75;

struct Pending {
    stamp_ns: i64,
    /// The variables' last values.
    last: Vec<f64>,
    forecasts: Vec<Forecast>,
}

/// One row against the predictions of it.
struct Scored {
    inside: usize,
    outside: usize,
    /// Squared errors in units of the variables' variances: of the mean, and of the last value.
    own: f64,
    other: f64,
}

/// The running score.
#[derive(Default)]
pub(super) struct Score {
    pending: VecDeque<Pending>,
    recent: VecDeque<Scored>,
}

impl Score {
    /// A prediction that was published: one forecast for each of the model's variables.
    pub(super) fn predicted(&mut self, stamp_ns: i64, last: Vec<f64>, forecasts: Vec<Forecast>) {
        self.pending.push_back(Pending { stamp_ns, last, forecasts });
    }

    /// Predictions that are void: the model is another, an experiment began, or rows are missing.
    pub(super) fn forget_pending(&mut self) {
        self.pending.clear();
    }

    /// Scores everything that was predicted for a row.
    pub(super) fn observed(&mut self, stamp_ns: i64, step_ns: i64, values: &[f64], deviations: &[f64]) {
        let mut scored = Scored { inside: 0, outside: 0, own: 0.0, other: 0.0 };
        let steps_to = |pending: &Pending| {
            (stamp_ns.saturating_sub(pending.stamp_ns) as f64 / step_ns.max(1) as f64).round() as i64
        };
        for pending in &self.pending {
            let Some(step) = usize::try_from(steps_to(pending) - 1).ok() else { continue };
            for (var, forecast) in pending.forecasts.iter().enumerate() {
                let (Some(mean), Some(lower), Some(upper), Some(&value), Some(&last), Some(&deviation)) = (
                    forecast.mean.get(step),
                    forecast.lower.get(step),
                    forecast.upper.get(step),
                    values.get(var),
                    pending.last.get(var),
                    deviations.get(var),
                ) else {
                    continue;
                };
                if !(value.is_finite() && mean.is_finite() && last.is_finite() && deviation > 0.0) {
                    continue;
                }
                let is_inside = (*lower..=*upper).contains(&value);
                scored.inside += usize::from(is_inside);
                scored.outside += usize::from(!is_inside);
                scored.own += ((value - mean) / deviation).powi(2);
                scored.other += ((value - last) / deviation).powi(2);
            }
        }
        let longest = |pending: &Pending| pending.forecasts.iter().map(|f| f.mean.len()).max().unwrap_or(0);
        self.pending.retain(|pending| (steps_to(pending).max(0) as usize) < longest(pending));
        if scored.inside + scored.outside > 0 {
            self.recent.push_back(scored);
        }
        while self.recent.len() > RECENT {
            self.recent.pop_front();
        }
    }

    /// Rows that the score rests on.
    pub(super) fn rows(&self) -> usize {
        self.recent.len()
    }

    /// Part of what happened that lay in its interval; NaN before anything was scored.
    pub(super) fn coverage(&self) -> f64 {
        let sum = |of: fn(&Scored) -> usize| self.recent.iter().map(of).sum::<usize>() as f64;
        let inside = sum(|scored| scored.inside);
        inside / (inside + sum(|scored| scored.outside))
    }

    /// `1 - MSE / MSE of the last value`; NaN before anything was scored.
    pub(super) fn skill(&self) -> f64 {
        let sum = |of: fn(&Scored) -> f64| self.recent.iter().map(of).sum::<f64>();
        1.0 - sum(|scored| scored.own) / sum(|scored| scored.other)
    }

    /// What is to be said against the model.
    pub(super) fn trouble(&self) -> Option<String> {
        let coverage = self.coverage();
        (self.rows() >= ENOUGH && coverage < TOO_LOW).then(|| {
            format!(
                "the model no longer fits: {:.0} % of the last {} steps lay in their intervals; a new one is needed",
                100.0 * coverage,
                self.rows()
            )
        })
    }

    /// The score in a sentence, for answers.
    pub(super) fn sentence(&self) -> Option<String> {
        (self.rows() > 0).then(|| {
            let (rows, percent, skill) = (self.rows(), 100.0 * self.coverage(), self.skill());
            format!(
                "live score of the last {rows} steps: {percent:.0} % of what happened lay in its interval, skill over the \
                 last value {skill:.2}"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prediction_is_scored_when_its_time_comes() {
        let mut score = Score::default();
        let forecast = Forecast {
            variable: "d".into(),
            mean: vec![1.0, 2.0],
            lower: vec![0.5, 1.5],
            upper: vec![1.5, 2.5],
            skill: Vec::new(),
            ..Forecast::default()
        };
        score.predicted(0, vec![0.0], vec![forecast]);
        score.observed(10, 10, &[1.0], &[1.0]);
        assert_eq!((score.coverage(), score.skill()), (1.0, 1.0));
        score.observed(20, 10, &[4.0], &[1.0]);
        // Missed by 2, where the last value would have been missed by 4.
        assert_eq!((score.coverage(), score.rows()), (0.5, 2));
        assert!((score.skill() - (1.0 - 4.0 / 17.0)).abs() < 1e-12, "{}", score.skill());
        score.observed(30, 10, &[9.0], &[1.0]);
        assert_eq!((score.rows(), score.pending.len()), (2, 0));
        assert_eq!(score.trouble(), None);
    }

    #[test]
    fn a_model_that_no_longer_fits_is_told() {
        let mut score = Score::default();
        for k in 0..120 {
            let forecast =
                Forecast { mean: vec![0.0], lower: vec![-1.0], upper: vec![1.0], ..Forecast::default() };
            score.predicted(k, vec![0.0], vec![forecast]);
            score.observed(k + 1, 1, &[if k % 2 == 0 { 0.0 } else { 5.0 }], &[1.0]);
        }
        assert!(
            score.trouble().is_some_and(|text| text.contains("50 % of the last 120")),
            "{:?}",
            score.trouble()
        );
    }
}
