//! Weakly minimal separating sets: no member that is not an ancestor of the pair can be left out.

use super::{
    graph::Pair,
    search::{Search, Separating},
};
use crate::types::{Node, Result, add_new};

/// A set of conditions.
type Nodes = Vec<Node>;

impl Search<'_, '_> {
    /// Makes the smallest sets on record of a removed pair weakly minimal, by leaving out one member at a time.
    pub(super) fn make_minimal(&mut self, pair: Pair) -> Result<()> {
        let stored = self.evidence(pair).map_or(Vec::new(), |evidence| evidence.separating.clone());
        let least = stored.iter().map(|set| set.nodes.len()).min().unwrap_or(0);
        let mut level: Vec<Vec<Node>> = Vec::new();
        for set in stored.iter().filter(|set| set.nodes.len() == least) {
            add_new(&mut level, set.nodes.clone());
        }
        while !level.is_empty() {
            let (minimal, next) = self.one_level(pair, &level)?;
            if !minimal.is_empty() {
                let sets = minimal.into_iter().map(|nodes| Separating { nodes, minimal: true });
                self.set_separating(pair, sets.collect());
                break;
            }
            level = next;
        }
        Ok(())
    }

    /// The sets that are weakly minimal, and the smaller ones that separate with the smallest value.
    fn one_level(&mut self, pair: Pair, level: &[Nodes]) -> Result<(Vec<Nodes>, Vec<Nodes>)> {
        let (mut minimal, mut smaller) = (Vec::new(), Vec::new());
        for set in level {
            let is_no_cause =
                |node: &Node| !self.is_ancestor(*node, pair.x) && !self.is_ancestor(*node, pair.y);
            let no_cause: Vec<Node> = set.iter().copied().filter(is_no_cause).collect();
            let mut separating = Vec::new();
            if set.len() > 1 {
                for node in no_cause {
                    let rest: Vec<Node> = set.iter().copied().filter(|&other| other != node).collect();
                    if let Some(value) = self.separates(pair, &rest)? {
                        separating.push((value, rest));
                    }
                }
            }
            if separating.is_empty() {
                minimal.push(set.clone());
            }
            smaller.extend(separating);
        }
        let least = smaller.iter().map(|(value, _)| *value).fold(f64::INFINITY, f64::min);
        let mut next: Vec<Vec<Node>> = Vec::new();
        smaller.into_iter().filter(|(value, _)| *value == least).for_each(|(_, set)| add_new(&mut next, set));
        Ok((minimal, next))
    }
}
