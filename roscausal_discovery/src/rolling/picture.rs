//! Models over time as a picture.

use super::counts::{LinkCount, link_counts};
use crate::{
    changes::{ChangeEvent, Status},
    draw::{Strip, StripPoint, Strips, strips},
    model::{Link, Model},
    types::names::plain,
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
        name: format!("{} → {}", plain(&count.cause), plain(&count.effect)),
        note: format!("lag {}: {} of {}", count.lag, count.found, count.of),
        points: models.iter().filter_map(|(time, model)| point(model, *time, count)).collect(),
    };
    let shown =
        if n_links > MOST { format!(", the {MOST} most frequent links of {n_links}") } else { String::new() };
    let confirmed: Vec<&(f64, &ChangeEvent)> =
        events.iter().filter(|(_, event)| event.status == Status::Confirmed).collect();
    strips(&Strips {
        title: format!("{} models over time{shown}", models.len()),
        unit: unit.to_owned(),
        links: counts.iter().map(strip).collect(),
        changes: confirmed.iter().map(|(time, event)| (*time, event.sentence())).collect(),
        regimes: regimes(&confirmed),
    })
}

/// The first regime, and those that confirmed changes begin; one that is back is named as it was.
fn regimes(confirmed: &[&(f64, &ChangeEvent)]) -> Vec<(f64, String)> {
    let mut all: Vec<(usize, f64, String)> = Vec::new();
    for (time, event) in confirmed {
        let Some(number) = event.regime.filter(|number| all.iter().all(|(known, ..)| known != number)) else {
            continue;
        };
        if all.is_empty() {
            all.push((1, 0.0, "regime 1".to_owned()));
        }
        let name = match event.same_as {
            Some(earlier) => format!("regime {number}, as {earlier}"),
            None => format!("regime {number}"),
        };
        all.push((number, *time, name));
    }
    all.into_iter().map(|(_, time, name)| (time, name)).collect()
}

/// The strength of a link in a model that tested it.
fn point(model: &Model, time: f64, of: &LinkCount) -> Option<StripPoint> {
    let (i, j) = model.places(&of.cause, &of.effect)?;
    let value = (*model.val_matrix.get(i)?.get(j)?.get(of.lag)?)?;
    let interval = model.confidence.as_ref().map(|c| (c.val_low[i][j][of.lag], c.val_high[i][j][of.lag]));
    let is_it = |link: &Link| link.cause == of.cause && link.effect == of.effect && link.lag == of.lag;
    let found = model.links.iter().any(is_it);
    Some(StripPoint { time, value, interval, found })
}
