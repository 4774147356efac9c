//! What is not a link of a model, but was found in many of its resamples.

use super::svg::MAYBE;
use crate::{model::Model, types::LinkMark};

/// A pair at a lag, by its variables' places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Maybe {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) lag: usize,
    /// Share of the resamples that have it.
    pub(super) share: f64,
}

impl Maybe {
    /// At lag 0 the direction is open.
    pub(super) fn mark(&self) -> LinkMark {
        if self.lag == 0 { LinkMark::TailTail } else { LinkMark::Forward }
    }
}

/// All of a model, by cause, effect and lag; none without resamples.
pub(super) fn maybes(model: &Model) -> Vec<Maybe> {
    let Some(confidence) = &model.confidence else { return Vec::new() };
    let n = model.features.len();
    let mut all = Vec::new();
    for (from, to) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        for lag in model.tau_min..=model.tau_max {
            let share = confidence.link_frequency[from][to][lag];
            let is_link = model.graph[from][to][lag].is_link();
            // At lag 0 each pair is twice in the matrix.
            if share >= MAYBE && !is_link && (lag > 0 || from < to) {
                all.push(Maybe { from, to, lag, share });
            }
        }
    }
    all
}
