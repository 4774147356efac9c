//! The baseline: how much a link differs from part to part while nothing changes.
//!
//! The variance of a slope holds for rows that are independent given the conditions. Rows of a robot and a person are not: an
//! encounter lasts for many rows, a part may hold none, and a mechanism that bends has other slopes where the cause has other
//! values. By that variance alone ten hours of an unchanged simulation show 30 to 150 changes.
//!
//! 1. Each comparison of a part with its regime that leads to no change leaves its `z` for each link. It counts once four more have
//!    come without a change: a change that is seen only at the second attempt must not hide itself.
//! 2. The variance of `z` is `v = (10 v_all + sum z^2) / (10 + n)`, with the same mean `v_all` over all links, which begins at 1 with
//!    the weight of 20; at least 1. So a link whose rows are independent keeps its level, and one whose slopes wander needs more.
//! 3. The tails follow from the fourth powers: with their mean `k = (120 + sum (z / s)^4) / (40 + n)` and `s^2` as `v` but without
//!    `v_all`, `z` is compared with a Student t of `4 + 6 / (k - 3)` degrees of freedom that has the variance `v`.
//!
//! Sources: Devlin and Roeder 1999 (genomic control: a test is scaled by what it shows where nothing is), Smyth 2004 (variances
//! that lean on those of all others).

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::place::Place;
use crate::numeric::student_t::two_sided_p_value;

/// Weight of the variance of all links in that of one, and of the variance 1 in that of all, in comparisons.
const LINK: f64 = 10.0;
const ALL: f64 = 20.0;
/// Weight of the normal distribution's fourth power.
const FOURTH: f64 = 40.0;
/// Comparisons that wait until as many more have come without a change.
const WAITING: usize = 4;
/// Largest `z` that counts.
const LARGEST: f64 = 1e3;

/// What the comparisons without a change have shown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Baseline {
    comparisons: usize,
    links: Vec<Shown>,
    /// The newest comparisons, oldest first: they do not count yet.
    waiting: VecDeque<Vec<(Place, f64)>>,
}

/// The same of one link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Shown {
    at: Place,
    n: f64,
    squares: f64,
    fourths: f64,
}

impl Baseline {
    /// Comparisons that count so far.
    pub(super) fn comparisons(&self) -> usize {
        self.comparisons
    }

    /// Takes a comparison without a change.
    pub(super) fn add(&mut self, zs: Vec<(Place, f64)>) {
        self.comparisons += 1;
        self.waiting.push_back(zs);
        while self.waiting.len() > WAITING {
            let oldest = self.waiting.pop_front();
            self.count(&oldest.unwrap_or_default());
        }
    }

    /// Forgets what does not count yet: a change shows that it may be of it.
    pub(super) fn forget(&mut self) {
        self.waiting.clear();
    }

    fn count(&mut self, zs: &[(Place, f64)]) {
        for &(at, z) in zs {
            let z = if z.is_nan() { 0.0 } else { z.abs().min(LARGEST) };
            let place = self.links.iter().position(|link| link.at == at).unwrap_or(self.links.len());
            if place == self.links.len() {
                self.links.push(Shown { at, n: 0.0, squares: 0.0, fourths: 0.0 });
            }
            if let Some(link) = self.links.get_mut(place) {
                link.n += 1.0;
                link.squares += z * z;
                link.fourths += z.powi(4);
            }
        }
    }

    /// The two-sided p-value of a link's `z`.
    pub(super) fn p_value(&self, at: Place, z: f64) -> f64 {
        let z = if z.is_nan() { 0.0 } else { z.abs().min(LARGEST) };
        let sum = |of: fn(&Shown) -> f64| self.links.iter().map(of).sum::<f64>();
        let of_all = ((ALL + sum(|link| link.squares)) / (ALL + sum(|link| link.n))).max(1.0);
        let of_link = self.links.iter().find(|link| link.at == at);
        let (n, squares, fourths) =
            of_link.map_or((0.0, 0.0, 0.0), |link| (link.n, link.squares, link.fourths));
        let variance = ((LINK * of_all + squares) / (LINK + n)).max(1.0);
        let own = ((LINK + squares) / (LINK + n)).max(1.0);
        let fourth = (3.0 * FOURTH + fourths / (own * own)) / (FOURTH + n);
        let dof = 4.0 + 6.0 / (fourth - 3.0).max(0.05);
        two_sided_p_value(z * (dof / (dof - 2.0) / variance).sqrt(), dof.round() as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Rng;

    const AT: Place = Place { cause: 0, effect: 1, lag: 1 };

    #[test]
    fn a_baseline_of_independent_rows_keeps_the_level_and_one_of_wandering_slopes_asks_for_more() {
        let mut rng = Rng::new(3);
        let mut normal = || (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
        let after = |scale: f64, normal: &mut dyn FnMut() -> f64| {
            let mut baseline = Baseline::default();
            (0..200).for_each(|_| baseline.add(vec![(AT, scale * normal())]));
            baseline.p_value(AT, 4.0)
        };
        let usual = Baseline::default().p_value(AT, 4.0);
        assert!((5e-5..3e-4).contains(&usual), "{usual}");
        let (calm, wandering) = (after(0.5, &mut normal), after(3.0, &mut normal));
        assert!(calm < 2.0 * usual, "{calm}");
        // 4 of a deviation of 3 is nothing.
        assert!((0.1..0.3).contains(&wandering), "{wandering}");
    }

    #[test]
    fn rare_large_differences_make_the_tail_heavy() {
        let mut baseline = Baseline::default();
        (0..100).for_each(|i| baseline.add(vec![(AT, if i % 20 == 0 { 6.0 } else { 1.0 })]));
        let p = baseline.p_value(AT, 6.0);
        assert!((1e-3..5e-2).contains(&p), "{p}");
    }

    #[test]
    fn odd_numbers_give_p_values_from_0_to_1() {
        let mut baseline = Baseline::default();
        for z in [0.0, f64::INFINITY, f64::NAN, -1e300] {
            assert!((0.0..=1.0).contains(&baseline.p_value(AT, z)));
            baseline.add(vec![(AT, z)]);
        }
        assert!((0.0..=1.0).contains(&baseline.p_value(AT, 1.0)));
    }
}
