//! Models over time as a picture.

use super::counts::{LinkCount, link_counts};
use crate::{
    changes::{ChangeEvent, Status},
    draw::{Strip, StripPoint, Strips, strips},
    ground::names::plain,
    model::Model,
};

/// Most links that have a strip.
const MOST: usize = 24;

/// One strip for each link that some model has (of the frequent ones at most 24), and a line at each confirmed change. `models`
/// are at their times.
pub fn strips_of(models: &[(f64, &Model)], unit: &str, events: &[(f64, &ChangeEvent)]) -> String {
    let all: Vec<&Model> = models.iter().map(|(_, model)| *model).collect();
    let mut counts = link_counts(&all);
    let n_links = counts.len();
    counts.sort_by_key(|count| std::cmp::Reverse(count.found));
    counts.truncate(MOST);
    let strip = |count: &LinkCount| Strip {
        name: format!(
            "{} → {}, lag {}: {}/{}",
            plain(&count.cause),
            plain(&count.effect),
            count.lag,
            count.found,
            count.of
        ),
        points: models.iter().filter_map(|(time, model)| point(model, *time, count)).collect(),
    };
    let shown =
        if n_links > MOST { format!(", the {MOST} most frequent links of {n_links}") } else { String::new() };
    let confirmed = events.iter().filter(|(_, event)| event.status == Status::Confirmed);
    strips(&Strips {
        title: format!("{} models over time{shown}", models.len()),
        unit: unit.to_owned(),
        links: counts.iter().map(strip).collect(),
        changes: confirmed.map(|(time, event)| (*time, event.sentence())).collect(),
    })
}

/// The strength of a link in a model that tested it.
fn point(model: &Model, time: f64, of: &LinkCount) -> Option<StripPoint> {
    let place = |name: &str| model.features.iter().position(|feature| feature == name);
    let (i, j) = (place(&of.cause)?, place(&of.effect)?);
    let value = *model.val_matrix.get(i)?.get(j)?.get(of.lag)?;
    let interval = model.confidence.as_ref().map(|c| (c.val_low[i][j][of.lag], c.val_high[i][j][of.lag]));
    let found = model
        .links
        .iter()
        .any(|link| link.cause == of.cause && link.effect == of.effect && link.lag == of.lag);
    Some(StripPoint { time, value, interval, found })
}
