//! Random systems of several kinds: what the tables of docs/confidence.md are measured on.

use std::f64::consts::TAU;

use ndarray::Array2;
use roscausal_discovery::mix;

/// Steps before the first sample.
const BEFORE: usize = 200;

/// What a kind of systems has.
pub(crate) struct Kind {
    pub(crate) name: &'static str,
    /// Share of pairs with a link.
    dense: f64,
    /// Range of coefficients.
    strength: [f64; 2],
    /// Range of the share of its own past.
    past: [f64; 2],
    effect: fn(f64) -> f64,
}

pub(crate) const KINDS: [Kind; 6] = [
    Kind { name: "strong", dense: 0.2, strength: [0.3, 0.6], past: [0.2, 0.6], effect: |x| x },
    Kind { name: "weak", dense: 0.25, strength: [0.05, 0.25], past: [0.2, 0.6], effect: |x| x },
    Kind { name: "dense", dense: 0.5, strength: [0.1, 0.4], past: [0.1, 0.5], effect: |x| x },
    Kind { name: "slow", dense: 0.2, strength: [0.1, 0.4], past: [0.8, 0.95], effect: |x| x },
    Kind {
        name: "bent",
        dense: 0.25,
        strength: [0.2, 0.6],
        past: [0.2, 0.6],
        effect: |x| x * (1.0 + 4.0 * (-x * x / 2.0).exp()) / 2.0,
    },
    Kind { name: "empty", dense: 0.0, strength: [0.1, 0.2], past: [0.1, 0.9], effect: |x| x },
];

pub(crate) struct Draw(pub(crate) u64);

impl Draw {
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 += 1;
        (mix(self.0) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn within(&mut self, [from, to]: [f64; 2]) -> f64 {
        from + (to - from) * self.uniform()
    }

    pub(crate) fn whole(&mut self, [from, to]: [usize; 2]) -> usize {
        from + (self.uniform() * (to + 1 - from) as f64) as usize
    }

    pub(crate) fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// A random system and data of it.
pub(crate) struct System {
    /// `(cause, effect, lag, coefficient)`.
    pub(crate) links: Vec<(usize, usize, usize, f64)>,
    pub(crate) data: Array2<f64>,
}

/// Draws systems until one does not run away.
pub(crate) fn system(kind: &Kind, vars: usize, lags: usize, rows: usize, draw: &mut Draw) -> System {
    loop {
        let mut links = Vec::new();
        for (cause, effect) in (0..vars).flat_map(|i| (0..vars).map(move |j| (i, j))) {
            if cause != effect && draw.uniform() < kind.dense {
                let sign = if draw.uniform() < 0.5 { -1.0 } else { 1.0 };
                links.push((cause, effect, draw.whole([1, lags]), sign * draw.within(kind.strength)));
            }
        }
        let past: Vec<f64> = (0..vars).map(|_| draw.within(kind.past)).collect();
        let mut all = Array2::zeros((rows + BEFORE, vars));
        for row in lags..rows + BEFORE {
            for var in 0..vars {
                let of_links = links.iter().filter(|(_, effect, ..)| *effect == var);
                let driven: f64 =
                    of_links.map(|&(i, _, lag, c)| c * (kind.effect)(all[[row - lag, i]])).sum();
                all[[row, var]] = past[var] * all[[row - 1, var]] + driven + draw.normal();
            }
        }
        if all.iter().all(|value: &f64| value.abs() < 100.0) {
            return System { links, data: all.slice_move(ndarray::s![BEFORE.., ..]) };
        }
    }
}
