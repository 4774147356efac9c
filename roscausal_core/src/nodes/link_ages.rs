//! How old the links of a rolling model are.

use roscausal_discovery::Model;
use serde::{Deserialize, Serialize};

/// Models that are remembered.
const REMEMBERED: usize = 8;

/// A link over the last models.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Age {
    cause: String,
    effect: String,
    lag: usize,
    /// From when on it is in every model, seconds; of a link that is in the last one.
    since: Option<f64>,
    /// In which of the last models it is, oldest first.
    seen: Vec<bool>,
}

impl Age {
    /// Counts one more model, of a batch that begins at `start`.
    pub(super) fn count(ages: &mut Vec<Self>, model: &Model, start: f64) {
        for link in &model.links {
            if !ages.iter().any(|age| age.is_of(&link.cause, &link.effect, link.lag)) {
                let (cause, effect) = (link.cause.clone(), link.effect.clone());
                ages.push(Self { cause, effect, lag: link.lag, since: None, seen: Vec::new() });
            }
        }
        for age in ages.iter_mut() {
            let is_there = model.links.iter().any(|link| age.is_of(&link.cause, &link.effect, link.lag));
            age.since = if is_there { age.since.or(Some(start)) } else { None };
            age.seen.push(is_there);
            age.seen.drain(..age.seen.len().saturating_sub(REMEMBERED));
        }
        ages.retain(|age| age.seen.contains(&true));
    }

    /// Writes the ages into the model's links.
    pub(super) fn write(ages: &[Self], model: &mut Model) {
        for link in &mut model.links {
            if let Some(age) = ages.iter().find(|age| age.is_of(&link.cause, &link.effect, link.lag)) {
                link.since = age.since;
                link.seen = Some(age.seen.iter().filter(|seen| **seen).count());
            }
        }
    }

    fn is_of(&self, cause: &str, effect: &str, lag: usize) -> bool {
        (self.cause.as_str(), self.effect.as_str(), self.lag) == (cause, effect, lag)
    }
}

#[cfg(test)]
mod tests {
    use roscausal_discovery::{LinkMark, Matrices, Settings};

    use super::*;

    fn model(mark: &str) -> Model {
        let graph = vec![vec![vec![LinkMark::Absent; 2]; 2]; 2];
        let numbers = |v: f64| vec![vec![vec![v; 2]; 2]; 2];
        let mut matrices =
            Matrices { graph, val_matrix: numbers(0.5), p_matrix: numbers(0.001), ..Matrices::default() };
        matrices.graph[0][1][1] = mark.parse().unwrap();
        Settings::default().blank_model().with_matrices(vec!["a".into(), "b".into()], matrices)
    }

    #[test]
    fn a_link_has_the_time_since_when_it_is_in_every_model_and_the_count_of_the_last_eight() {
        let mut ages = Vec::new();
        let marks = ["-->", "-->", "", "-->", "-->", "-->", "-->", "-->", "-->"];
        let mut last = model("-->");
        for (i, mark) in marks.iter().enumerate() {
            last = model(mark);
            Age::count(&mut ages, &last, 10.0 * i as f64);
        }
        Age::write(&ages, &mut last);
        assert_eq!((last.links[0].since, last.links[0].seen), (Some(30.0), Some(7)));
        (0..8).for_each(|i| Age::count(&mut ages, &model(""), f64::from(i)));
        assert_eq!(ages, []);
    }
}
