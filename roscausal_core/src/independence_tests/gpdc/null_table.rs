//! Distance correlations of the ranks of independent uniform samples: what GPDC's values are held against.

use std::{
    collections::HashMap,
    sync::{Arc, LazyLock, Mutex, OnceLock},
};

use super::{distance_correlation::of_sorted, pcg64::Pcg64};

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
            let mut tables = TABLES.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            tables.entry((n, samples, seed)).or_default().clone()
        };
        slot.get_or_init(|| Arc::new(Self::new(n, samples, seed))).clone()
    }

    fn new(n: usize, samples: usize, seed: u64) -> Self {
        let mut rng = Pcg64::new(seed);
        let (mut pairs, mut space) = (Vec::new(), Vec::new());
        let (mut x, mut y) = (Vec::new(), Vec::new());
        let mut y_ranks = vec![0; n];
        let mut one = || {
            uniform_order(&mut rng, n, &mut x);
            uniform_order(&mut rng, n, &mut y);
            (1..).zip(&y).for_each(|(rank, &i)| y_ranks[i as usize] = rank);
            pairs.clear();
            pairs.extend((1..).zip(&x).map(|(rank, &i)| (rank, y_ranks[i as usize])));
            of_sorted(&mut pairs, &mut space)
        };
        let mut table: Vec<f64> = (0..samples).map(|_| one()).collect();
        table.sort_unstable_by(f64::total_cmp);
        Self(table)
    }

    /// Share of the table strictly above `value`.
    pub(super) fn share_above(&self, value: f64) -> f64 {
        let not_above = self.0.partition_point(|&null| null <= value);
        (self.0.len() - not_above) as f64 / self.0.len().max(1) as f64
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
