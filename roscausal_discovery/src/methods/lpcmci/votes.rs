//! Whether a node separates two others: the sets that separate them vote.

use rustc_hash::FxHashSet;

use super::{graph::Pair, search::Search, sets::union};
use crate::{
    methods::pc_stable::combinations,
    types::{Node, Result, add_new},
};

impl Search<'_, '_> {
    /// Whether more than half of the sets that separate A and C hold B.
    pub(super) fn separates_with(&mut self, b: Node, a: Node, c: Node) -> Result<bool> {
        let is_final = |end| self.graph.get(end, b).is_some_and(|link| link.is_final());
        let searched = self.searches_votes() && is_final(a) && is_final(c);
        let (with, all) = self.count_votes(b, a, c, searched)?;
        Ok(2 * with > all)
    }

    /// Whether less than half of the sets that separate A and C hold B.
    pub(super) fn separates_without(&mut self, b: Node, a: Node, c: Node) -> Result<bool> {
        let (with, all) = self.count_votes(b, a, c, self.searches_votes())?;
        Ok(2 * with < all)
    }

    fn count_votes(&mut self, b: Node, a: Node, c: Node, searched: bool) -> Result<(usize, usize)> {
        let (pair, shift) = Pair::of(a, c);
        if !self.votes.contains_key(&(pair, searched)) {
            let sets = self.voting_sets(pair, searched)?;
            self.votes.insert((pair, searched), sets);
        }
        let sets = self.votes.get(&(pair, searched)).map_or(&[][..], Vec::as_slice);
        // What is later than both is in no set.
        let b = b.lag.checked_sub(shift).map(|lag| Node::new(b.var, lag));
        Ok((b.map_or(0, |b| sets.iter().filter(|set| set.contains(&b)).count()), sets.len()))
    }

    /// The sets on record, and those found by a search.
    fn voting_sets(&mut self, pair: Pair, searched: bool) -> Result<Vec<Vec<Node>>> {
        let mut sets: Vec<Vec<Node>> = Vec::new();
        for set in self.evidence(pair).map_or(&[][..], |evidence| &evidence.separating) {
            add_new(&mut sets, set.nodes.clone());
        }
        if !searched {
            return Ok(sets);
        }
        let parents = self.parents(pair.x, pair.y);
        let mut seen = FxHashSet::default();
        for (a, b) in [(pair.x, pair.y), (pair.y, pair.x)] {
            let mut choices = self.apds(a, b);
            choices.retain(|node| !parents.contains(node));
            let most = self.settings.max_p_global.unwrap_or(usize::MAX);
            let of_cause = a == pair.x && pair.x.lag > 0;
            let most = if of_cause { most.min(self.settings.max_cond_px) } else { most };
            for size in 0..=choices.len().min(most) {
                for chosen in combinations(&choices, size) {
                    let z = union(pair, &chosen, &parents);
                    if seen.insert(z.clone()) && self.separates(pair, &z)?.is_some() {
                        add_new(&mut sets, z);
                    }
                }
            }
        }
        Ok(sets)
    }
}
