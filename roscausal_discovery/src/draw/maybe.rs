//! What is not a link of a model, but was found in many of its resamples.

use super::svg::MAYBE;
use crate::{
    model::{Model, cells},
    types::LinkMark,
};

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
    let maybe = |([from, to, lag], &share): ([usize; 3], &f64)| {
        let is_link = model.graph[from][to][lag].is_link();
        // At lag 0 each pair is twice in the matrix.
        let is_drawn = share >= MAYBE && !is_link && lag >= model.tau_min && (lag > 0 || from < to);
        is_drawn.then_some(Maybe { from, to, lag, share })
    };
    cells(&confidence.link_frequency).filter_map(maybe).collect()
}
