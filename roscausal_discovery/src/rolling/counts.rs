//! In how many models each link is: the summary of windows and batches.

use serde::{Deserialize, Serialize};

use crate::model::Model;

/// A link, and in how many models it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkCount {
    /// Name of the cause.
    pub cause: String,
    /// Name of the effect.
    pub effect: String,
    /// Steps from cause to effect.
    pub lag: usize,
    /// Models with the link.
    pub found: usize,
    /// Models that tested it: those with these variables and this lag.
    pub of: usize,
    /// Mean strength in the models with the link.
    pub mean_value: f64,
}

/// Counts the links of models, in the order in which they first occur.
///
/// ```
/// use roscausal_discovery::rolling::link_counts;
///
/// assert!(link_counts(&[]).is_empty());
/// ```
pub fn link_counts(models: &[&Model]) -> Vec<LinkCount> {
    let mut counts: Vec<LinkCount> = Vec::new();
    for link in models.iter().flat_map(|model| &model.links) {
        let is_same =
            |c: &&mut LinkCount| c.cause == link.cause && c.effect == link.effect && c.lag == link.lag;
        if let Some(count) = counts.iter_mut().find(is_same) {
            count.found += 1;
            count.mean_value += link.drawn_strength();
            continue;
        }
        let knows =
            |model: &&&Model, name: &String| model.features.contains(name) || model.dropped.contains(name);
        let tests = |model: &&&Model| {
            let lags = model.tau_min..=model.tau_max;
            knows(model, &link.cause) && knows(model, &link.effect) && lags.contains(&link.lag)
        };
        counts.push(LinkCount {
            cause: link.cause.clone(),
            effect: link.effect.clone(),
            lag: link.lag,
            found: 1,
            of: models.iter().filter(tests).count(),
            mean_value: link.drawn_strength(),
        });
    }
    counts.iter_mut().for_each(|count| count.mean_value /= count.found as f64);
    counts
}
