//! The two phases that remove links: the ancestral one conditions on possible causes, the non-ancestral one also on what
//! paths over hidden causes need.

use super::{
    graph::{Link, Middle, Pair},
    rules::{Rules, apply_rules},
    search::Search,
    sets::{Conditions, union},
};
use crate::{
    methods::pc_stable::combinations,
    types::{Node, Result},
};

/// From which end of a pair conditions are taken.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Effect,
    Cause,
}

/// What a pair's turn in a round showed.
#[derive(Default)]
struct Turn {
    tested: bool,
    removed: bool,
}

impl Search<'_, '_> {
    /// Removes links given possible causes of one of their ends, and learns causes on the way.
    pub(super) fn ancestral_phase(&mut self, preliminary: bool) -> Result<()> {
        let mut size = 0;
        while self.settings.max_p_global.is_none_or(|most| size <= most) {
            let (removed, converged) = self.round(|search, pair| search.ancestral_turn(pair, size))?;
            if converged && !removed {
                break;
            }
            let changed = removed && apply_rules(self, Rules::Short, true)?;
            if changed {
                self.update_middles();
            }
            size = if changed { 0 } else { size + 1 };
        }
        self.set_middles(Middle::Both);
        let with_colliders = !preliminary || self.settings.prelim_with_collider_rules;
        if apply_rules(self, if with_colliders { Rules::Long } else { Rules::Short }, false)? {
            self.update_middles();
        }
        Ok(())
    }

    /// Removes links given what else may block a path.
    pub(super) fn non_ancestral_phase(&mut self) -> Result<()> {
        self.update_middles();
        let most = [self.settings.max_p_global, self.settings.max_p_non_ancestral];
        let most = most.into_iter().flatten().min();
        let mut size = 0;
        while most.is_none_or(|most| size <= most) {
            let (removed, converged) = self.round(|search, pair| search.non_ancestral_turn(pair, size))?;
            if converged && !removed {
                break;
            }
            size = if removed && apply_rules(self, Rules::Long, false)? { 0 } else { size + 1 };
        }
        apply_rules(self, Rules::Long, false)?;
        Ok(())
    }

    /// One turn of every pair, in groups: a variable with its own past, then the others by lag. What a group removes goes
    /// after it. Whether a link went, and whether no pair has sets left to test.
    fn round(&mut self, mut turn: impl FnMut(&mut Self, Pair) -> Result<Turn>) -> Result<(bool, bool)> {
        let (mut removed, mut converged) = (false, true);
        for group in self.groups() {
            let mut going = Vec::new();
            for pair in group {
                let shown = turn(self, pair)?;
                converged &= !shown.tested;
                if shown.removed {
                    going.push(pair);
                }
            }
            removed |= !going.is_empty();
            going.into_iter().for_each(|pair| self.remove(pair));
        }
        Ok((removed, converged))
    }

    fn groups(&self) -> Vec<Vec<Pair>> {
        let (n, tau_max) = (self.graph.n_vars, self.graph.tau_max);
        let pair = |i, j, lag| Pair { x: Node::new(i, lag), y: Node::new(j, 0) };
        let own = (0..n).flat_map(|i| (1..=tau_max).rev().map(move |lag| pair(i, i, lag))).collect();
        let others = (0..=tau_max).map(|lag| {
            let all = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
            all.filter(|&(i, j)| if lag == 0 { i < j } else { i != j })
                .map(|(i, j)| pair(i, j, lag))
                .collect()
        });
        std::iter::once(own).chain(others).collect()
    }

    /// Whether sets from the cause's side count for this pair.
    fn asks_cause(&self, pair: Pair, size: usize) -> bool {
        let most = self.settings.max_cond_px;
        pair.x.lag == 0 || (most > 0 && most >= size)
    }

    fn ancestral_turn(&mut self, pair: Pair, size: usize) -> Result<Turn> {
        let mut turn = Turn::default();
        let Some(Link { middle, .. }) = self.graph.get(pair.x, pair.y).filter(|link| !link.is_final()) else {
            return Ok(turn);
        };
        let sides = [
            (Side::Effect, Middle::Right, !matches!(middle, Middle::Right | Middle::Both)),
            (
                Side::Cause,
                Middle::Left,
                !matches!(middle, Middle::Left | Middle::Both) && self.asks_cause(pair, size),
            ),
        ];
        let mut to_test = Vec::new();
        let mut exhausted = middle;
        for (side, half, wanted) in sides {
            if !wanted {
                continue;
            }
            let (a, b) = ends(pair, side);
            let conditions = self.ancestral_conditions(a, b);
            if conditions.choices.len() < size {
                exhausted = exhausted.with(half);
            } else {
                turn.tested = true;
                to_test.push((side, conditions));
            }
        }
        self.graph.put_middle(pair, exhausted);
        let most = self.settings.max_q_global;
        for (side, conditions) in to_test {
            turn.removed |= self.test_sets(pair, &conditions, size, most, Some(side))?;
        }
        Ok(turn)
    }

    fn non_ancestral_turn(&mut self, pair: Pair, size: usize) -> Result<Turn> {
        let mut turn = Turn::default();
        if self.graph.get(pair.x, pair.y).is_none_or(|link| link.is_final()) {
            return Ok(turn);
        }
        let mut to_test = vec![self.non_ancestral_conditions(pair.y, pair.x)];
        if self.asks_cause(pair, size) {
            to_test.push(self.non_ancestral_conditions(pair.x, pair.y));
        }
        let too_large = |c: &Conditions| self.settings.max_pds_set.is_some_and(|most| c.choices.len() > most);
        if to_test.iter().any(too_large) {
            return Ok(turn);
        }
        if to_test.iter().any(|conditions| conditions.choices.len() < size) {
            self.graph.put_middle(pair, Middle::Final);
            return Ok(turn);
        }
        turn.tested = true;
        let most = [self.settings.max_q_global, self.settings.max_q_non_ancestral];
        let most = most.into_iter().flatten().min();
        for conditions in to_test {
            turn.removed |= self.test_sets(pair, &conditions, size, most, None)?;
        }
        Ok(turn)
    }

    /// Tests a pair given `size` of the choices, at most `most` such sets; whether one separates it.
    pub(super) fn test_sets(
        &mut self,
        pair: Pair,
        conditions: &Conditions,
        size: usize,
        most: Option<usize>,
        side: Option<Side>,
    ) -> Result<bool> {
        for chosen in combinations(&conditions.choices, size).take(most.unwrap_or(usize::MAX)) {
            let mut z = union(pair, &chosen, &conditions.always);
            if let Some(side) = side {
                z = self.with_contexts(pair, z, side);
            }
            if self.separates(pair, &z)?.is_some() {
                self.add_separating(pair, z, true);
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// CAnDOIT's rule: the contexts of every intervened condition join the conditions.
    fn with_contexts(&self, pair: Pair, z: Vec<Node>, side: Side) -> Vec<Node> {
        let lags = if side == Side::Effect { self.graph.tau_max + 1 } else { self.graph.tau_max };
        let intervened =
            self.settings.contexts.iter().filter(|(var, _)| z.iter().any(|node| node.var == *var));
        let contexts: Vec<Node> =
            intervened.flat_map(|&(_, context)| (0..lags).map(move |lag| Node::new(context, lag))).collect();
        if contexts.is_empty() { z } else { union(pair, &z, &contexts) }
    }
}

/// The reference node and the other one.
fn ends(pair: Pair, side: Side) -> (Node, Node) {
    if side == Side::Effect { (pair.y, pair.x) } else { (pair.x, pair.y) }
}
