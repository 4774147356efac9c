//! How much longer to record until a link that is not settled would show, if it is real.
//!
//! 1. A link found in a share of the resamples has the test statistic `z` that gives this share: with the threshold `c`, a
//!    bootstrap finds it in `P(|N(z, 1)| > c)` of the resamples, subsamples of a share `f` in
//!    `P(|N(sqrt(f) z, 1 - f)| > c)`.
//! 2. `z` grows with the root of the samples. Four of five recordings of `n ((c + 0.842) / z)^2` samples find the link.
//! 3. `z` is uncertain by 1.282 either way (80 %), and so is the number of samples.
//!
//! It is no promise: two thirds of the links found in 0.3 to 0.5 of the resamples are not there.

use crate::settings::{Resampling, Scheme};
use crate::{
    model::{Advice, Confidence, Model, cells},
    numeric::normal::normal_quantile,
};

/// Normal quantile of 0.8: four of five recordings.
const POWER: f64 = 0.842;
/// Normal quantile of 0.9: the range holds 80 %.
const RANGE: f64 = 1.282;
/// From this share on a link is settled.
const SETTLED: f64 = 0.9;

/// Puts the advice for each pair and lag that a resample had a link at into a model with a confidence.
pub(super) fn add(model: &mut Model, resampling: &Resampling) {
    let Some(mut confidence) = model.confidence.take() else { return };
    let advice = Question { model, confidence: &confidence, resampling }.answers();
    confidence.advice = advice;
    model.confidence = Some(confidence);
}

/// Sets the step of a model's samples, in seconds, and says its advice in minutes.
pub fn set_step(model: &mut Model, dt: Option<f64>) {
    model.dt = dt;
    let n = model.n_samples as f64;
    if let Some(confidence) = &mut model.confidence {
        let done = confidence.resampling.done;
        confidence.advice.iter_mut().for_each(|advice| in_time(advice, n, done, dt));
    }
}

fn in_time(advice: &mut Advice, n: f64, done: usize, dt: Option<f64>) {
    let minutes = |n_needed: Option<f64>| Some((n_needed? - n).max(0.0) * dt? / 60.0);
    advice.minutes = minutes(advice.n_needed);
    advice.minutes_low = minutes(advice.n_low);
    advice.minutes_high = minutes(advice.n_high);
    advice.sentence = sentence(advice, n, done);
}

struct Question<'a> {
    model: &'a Model,
    confidence: &'a Confidence,
    resampling: &'a Resampling,
}

impl Question<'_> {
    fn answers(&self) -> Vec<Advice> {
        let answer = |([i, j, lag], &share): ([usize; 3], &f64)| {
            let in_model = self.model.graph[i][j][lag].is_link();
            let is_asked = i != j && lag >= self.model.tau_min && (lag > 0 || i < j);
            (is_asked && (share > 0.0 || in_model)).then(|| self.answer((i, j, lag), share, in_model))
        };
        cells(&self.confidence.link_frequency).filter_map(answer).collect()
    }

    fn answer(&self, (i, j, lag): (usize, usize, usize), share: f64, in_model: bool) -> Advice {
        let level = self.model.link_level().unwrap_or(self.model.alpha);
        let (n, c) = (self.model.n_samples as f64, -normal_quantile(0.5 * level));
        let z = self.statistic(share, c);
        let needed = |z: f64| (z > 0.0).then(|| n * ((c + POWER) / z).powi(2));
        let (middle, low, high) = (needed(z), needed(z + RANGE), needed(z - RANGE));
        let names = &self.model.features;
        let mut advice = Advice {
            cause: names[i].clone(),
            effect: names[j].clone(),
            lag,
            in_model,
            confidence: share,
            n_needed: middle,
            n_low: low,
            n_high: high,
            ..Advice::default()
        };
        in_time(&mut advice, n, self.confidence.resampling.done, self.model.dt);
        advice
    }

    /// The statistic at which a link is found in this share of the resamples.
    fn statistic(&self, share: f64, c: f64) -> f64 {
        let half = 0.5 / self.confidence.resampling.done as f64;
        let share = share.clamp(half, 1.0 - half);
        let (mut low, mut high) = (0.0, 40.0);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if found_share(self.resampling, middle, c) < share { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

/// The share of resamples that find a link whose test on all data has the statistic `z`; `c` is the threshold.
pub(super) fn found_share(resampling: &Resampling, z: f64, c: f64) -> f64 {
    let (mean, deviation) = match resampling.scheme {
        Scheme::Bootstrap => (z, 1.0),
        Scheme::Subsample => (resampling.share.sqrt() * z, (1.0 - resampling.share).sqrt()),
    };
    let below = |x: f64| 0.5 * libm::erfc(-x / std::f64::consts::SQRT_2);
    below((mean - c) / deviation) + below((-mean - c) / deviation)
}

fn sentence(advice: &Advice, n: f64, done: usize) -> String {
    let found = format!("found in {:.0} of {done}", done as f64 * advice.confidence);
    if advice.confidence >= SETTLED {
        return format!("{found}; settled");
    }
    let Some(needed) = advice.n_needed.filter(|&needed| needed <= 10.0 * n) else {
        return format!("{found}; not settled by ten times as much");
    };
    let (unit, middle, low, high) = match (advice.minutes, advice.minutes_low) {
        (Some(middle), Some(low)) => ("minutes", middle, low, advice.minutes_high),
        _ => {
            let more = |needed: f64| (needed - n).max(0.0);
            ("samples", more(needed), advice.n_low.map_or(0.0, more), advice.n_high.map(more))
        }
    };
    let high = match high {
        Some(high) if advice.n_high.is_some_and(|n_high| n_high <= 10.0 * n) => number(high),
        _ => "more than ten times as much".into(),
    };
    let (middle, low) = (number(middle), number(low));
    format!(
        "{found}; if it is real, about {middle} more {unit} ({low} to {high}) show it in 4 of 5 recordings"
    )
}

/// A number as people say it.
fn number(value: f64) -> String {
    if value >= 10.0 || value == 0.0 { format!("{value:.0}") } else { format!("{value:.1}") }
}
