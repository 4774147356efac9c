//! Distance correlations of the ranks of independent uniform samples: what the reference holds GPDC's values against.

use std::{
    collections::HashMap,
    sync::{Arc, LazyLock, Mutex, OnceLock},
};

use super::distance_correlation::of_sorted;
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
    // Places of `n` uniform doubles in ascending order; they are 53 random bits each.
    let mut order = || {
        let mut keys: Vec<(u64, usize)> = (0..n).map(|i| (rng.next_u64() >> 11, i)).collect();
        keys.sort_unstable();
        keys
    };
    let (mut y_ranks, mut pairs, mut space) = (vec![0; n], Vec::new(), Vec::new());
    for place in table {
        let x = order();
        (1..).zip(order()).for_each(|(rank, (_, i))| y_ranks[i] = rank);
        pairs.clear();
        pairs.extend((1..).zip(x.iter().map(|&(_, i)| y_ranks[i])));
        *place = of_sorted(&mut pairs, &mut space);
    }
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
            [20, 1026].map(|n| pool.install(|| NullTable::new(n, 10, 42).0))
        };
        assert_eq!(made_by(1), made_by(3));
    }

    #[test]
    fn the_share_counts_strictly_larger_values() {
        let table = NullTable(vec![0.1, 0.2, 0.2, 0.4]);
        let shares: Vec<f64> = [0.0, 0.1, 0.2, 0.3, 0.4].map(|v| table.share_above(v)).to_vec();
        assert_eq!(shares, [1.0, 0.75, 0.25, 0.25, 0.0]);
    }
}
