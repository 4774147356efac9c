//! Distance correlations of the ranks of independent uniform samples: what the reference holds GPDC's values against.

use std::{
    collections::HashMap,
    sync::{Arc, LazyLock, Mutex, OnceLock},
};

use super::{distance_correlation::of_sorted, permutation::Permutations};
use crate::{numeric::pcg64::Pcg64, types::lock};

/// Sorted distance correlations of `samples` pairs of uniform series.
#[derive(Debug)]
pub(super) struct NullTable(Vec<f64>);

/// Sample size, number of samples, seed.
type Key = (usize, usize, u64);
type Tables = Mutex<HashMap<Key, Arc<OnceLock<Arc<NullTable>>>>>;

/// A table depends on nothing but its key, so the process keeps each one. The map's lock is held for a look-up only;
/// who needs a table that another thread is making waits for that one.
static TABLES: LazyLock<Tables> = LazyLock::new(Mutex::default);

impl NullTable {
    /// The table for series of `n` samples; made once per process.
    pub(super) fn get(n: usize, samples: usize, seed: u64) -> Arc<Self> {
        let slot = {
            let mut tables = lock(&TABLES);
            tables.entry((n, samples, seed)).or_default().clone()
        };
        slot.get_or_init(|| Arc::new(Self::new(n, samples, seed))).clone()
    }

    /// Shares the samples out over as many threads as the caller's pool has: threads of its own, because a worker of
    /// the pool that waited for others could take up a task that waits for this table.
    fn new(n: usize, samples: usize, seed: u64) -> Self {
        let mut table = vec![0.0; samples];
        let each = samples.div_ceil(rayon::current_num_threads()).max(1);
        std::thread::scope(|scope| {
            let mut shares = table.chunks_mut(each).enumerate().map(|(k, share)| {
                let mut rng = Pcg64::new(seed);
                rng.skip(2 * n as u128 * (k * each) as u128);
                move || fill(share, n, rng)
            });
            let first = shares.next();
            shares.for_each(|share| drop(scope.spawn(share)));
            first.into_iter().for_each(|share| share());
        });
        table.sort_unstable_by(f64::total_cmp);
        Self(table)
    }

    #[cfg(test)]
    pub(super) fn values(&self) -> &[f64] {
        &self.0
    }

    /// Share of the table strictly above `value`.
    pub(super) fn share_above(&self, value: f64) -> f64 {
        let not_above = self.0.partition_point(|&null| null <= value);
        (self.0.len() - not_above) as f64 / self.0.len().max(1) as f64
    }
}

/// Draws `2 n` numbers for each place of `table` and writes the distance correlation of one half's ranks with the
/// other's.
fn fill(table: &mut [f64], n: usize, mut rng: Pcg64) {
    let permutations = (n <= Permutations::MOST).then(|| Permutations::new(n));
    let (mut x, mut y, mut y_ranks) = (Vec::new(), Vec::new(), vec![0; n]);
    let mut ranks = vec![0; n + Permutations::padding()];
    let (mut pairs, mut space) = (Vec::new(), Vec::new());
    for place in table {
        uniform_order(&mut rng, n, &mut x);
        uniform_order(&mut rng, n, &mut y);
        (1..).zip(&y).for_each(|(rank, &i)| y_ranks[i as usize] = rank);
        let y_ranks = x.iter().map(|&i| y_ranks[i as usize]);
        *place = if let Some(permutations) = &permutations {
            ranks.iter_mut().zip(y_ranks).for_each(|(to, rank)| *to = rank as u16);
            permutations.distance_correlation(&ranks)
        } else {
            pairs.clear();
            pairs.extend((1..).zip(y_ranks));
            of_sorted(&mut pairs, &mut space)
        };
    }
}

/// Draws `n` doubles, uniform in `[0, 1)`, and writes their places in ascending order. The doubles are 53 random bits
/// each; sorting goes by those bits with the place below them.
fn uniform_order(rng: &mut Pcg64, n: usize, order: &mut Vec<u32>) {
    const PLACE_BITS: u32 = 11;
    order.clear();
    if n <= 1 << PLACE_BITS {
        let keys: Vec<u64> = (0..n as u64).map(|i| rng.next_u64() >> PLACE_BITS << PLACE_BITS | i).collect();
        order.extend(sorted_uniform(&keys).iter().map(|key| (key & ((1 << PLACE_BITS) - 1)) as u32));
    } else {
        let mut keys: Vec<(u64, u32)> = (0..n as u32).map(|i| (rng.next_u64() >> PLACE_BITS, i)).collect();
        keys.sort_unstable();
        order.extend(keys.iter().map(|key| key.1));
    }
}

/// `keys`, uniform over all integers, in ascending order: first into as many bins, then nearly sorted by insertion.
fn sorted_uniform(keys: &[u64]) -> Vec<u64> {
    let bins = keys.len().next_power_of_two().max(2);
    let bin = |key: u64| (key >> (64 - bins.trailing_zeros())) as usize;
    let mut starts = vec![0u32; bins];
    keys.iter().for_each(|&key| starts[bin(key)] += 1);
    let mut next = 0;
    for start in &mut starts {
        next += std::mem::replace(start, next);
    }
    let mut sorted = vec![0; keys.len()];
    for &key in keys {
        let place = &mut starts[bin(key)];
        sorted[*place as usize] = key;
        *place += 1;
    }
    for k in 1..sorted.len() {
        let key = sorted[k];
        let mut to = k;
        while to > 0 && sorted[to - 1] > key {
            sorted[to] = sorted[to - 1];
            to -= 1;
        }
        sorted[to] = key;
    }
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_made_once() {
        let table = NullTable::get(50, 20, 7);
        assert!(Arc::ptr_eq(&table, &NullTable::get(50, 20, 7)));
        assert!(!Arc::ptr_eq(&table, &NullTable::get(51, 20, 7)));
    }

    #[test]
    fn any_number_of_threads_makes_the_same_table() {
        let made_by = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            [20, Permutations::MOST + 2].map(|n| pool.install(|| NullTable::new(n, 10, 42).0))
        };
        assert_eq!(made_by(1), made_by(3));
    }

    #[test]
    fn bins_sort_any_keys() {
        let mut rng = Pcg64::new(3);
        for n in [0, 1, 2, 3, 64, 500] {
            for shift in [0, 20, 63] {
                let mut keys: Vec<u64> = (0..n).map(|_| rng.next_u64() >> shift).collect();
                let sorted = sorted_uniform(&keys);
                keys.sort_unstable();
                assert_eq!(sorted, keys);
            }
        }
    }

    #[test]
    fn the_share_counts_strictly_larger_values() {
        let table = NullTable(vec![0.1, 0.2, 0.2, 0.4]);
        let shares: Vec<f64> = [0.0, 0.1, 0.2, 0.3, 0.4].map(|v| table.share_above(v)).to_vec();
        assert_eq!(shares, [1.0, 0.75, 0.25, 0.25, 0.0]);
    }
}
