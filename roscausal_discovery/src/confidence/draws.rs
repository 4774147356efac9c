//! Which rows a resample takes.
//!
//! A bootstrap draws the starts of blocks with replacement, uniform over all starts but the last possible one, and puts the
//! blocks end to end until there are as many rows as before: the reference's draw, number by number. A subsample takes a share
//! of the blocks without replacement, in the order of time (Politis, Romano and Wolf 1999, "Subsampling").
//!
//! Resample `b` has the stream number `b` of the seed; from the second recording on, stream number `(b, recording)`.

use crate::settings::{FEWEST_BLOCKS, FEWEST_ROWS, Resampling, Scheme};
use crate::{
    numeric::pcg64::Pcg64,
    types::{Error, Result},
};

/// Checks that recordings of `n_rows` rows are long enough to draw from.
pub(super) fn check(resampling: &Resampling, n_rows: &[usize]) -> Result<()> {
    let all: usize = n_rows.iter().sum();
    if all < FEWEST_ROWS {
        return Err(Error::Data(format!(
            "resampling draws from {all} rows (those whose lags are recorded, too) and needs at least {FEWEST_ROWS}: record longer, \
             or leave the resamples out"
        )));
    }
    let mut n_blocks = 0;
    for (k, &n) in n_rows.iter().enumerate().filter(|(_, n)| **n > 0) {
        let length = resampling.block.length(n);
        // The only row is a block.
        if length >= n.max(2) {
            let reason = format!("blocks of {length} rows are as long as recording {}, which has {n}", k + 1);
            return Err(Error::param("block", format!("{reason}; give shorter blocks")));
        }
        n_blocks += n / length;
    }
    if n_blocks < FEWEST_BLOCKS {
        return Err(Error::Data(format!(
            "resampling finds {n_blocks} blocks of rows and needs at least {FEWEST_BLOCKS}: record longer, or give shorter \
             blocks"
        )));
    }
    Ok(())
}

/// The rows, from 0, of resample `b` of a recording of `n` rows.
pub(super) fn rows(resampling: &Resampling, seed: u64, b: usize, recording: usize, n: usize) -> Vec<usize> {
    if n == 0 {
        return Vec::new();
    }
    let key = [b as u32, recording as u32];
    let mut rng = Pcg64::of_key(seed, if recording == 0 { &key[..1] } else { &key });
    let length = resampling.block.length(n);
    match resampling.scheme {
        Scheme::Bootstrap => bootstrap(&mut rng, n, length),
        Scheme::Subsample => subsample(&mut rng, n, length, resampling.share),
    }
}

/// The first and the number of the rows of a bootstrap, for a comparison with other programs.
///
/// ```
/// // Block length 1, 248 rows, the first resample of seed 42.
/// let rows = roscausal_discovery::confidence::bootstrap_rows(42, 0, 248, 1);
/// assert_eq!((rows.len(), &rows[..4]), (248, &[122, 226, 143, 225][..]));
/// ```
pub fn bootstrap_rows(seed: u64, b: usize, n: usize, length: usize) -> Vec<usize> {
    bootstrap(&mut Pcg64::of_key(seed, &[b as u32]), n, length.max(1))
}

fn bootstrap(rng: &mut Pcg64, n: usize, length: usize) -> Vec<usize> {
    let starts = n.saturating_sub(length).max(1) as u32;
    let mut rows = Vec::with_capacity(n + length);
    for _ in 0..n.div_ceil(length) {
        let start = rng.below(starts) as usize;
        rows.extend(start..(start + length).min(n));
    }
    rows.truncate(n);
    rows
}

fn subsample(rng: &mut Pcg64, n: usize, length: usize, share: f64) -> Vec<usize> {
    let n_blocks = n.div_ceil(length);
    let wanted = ((share * n_blocks as f64) as usize).max(1);
    let mut blocks: Vec<usize> = (0..n_blocks).collect();
    for place in 0..wanted {
        let other = place + rng.below((n_blocks - place) as u32) as usize;
        blocks.swap(place, other);
    }
    blocks.truncate(wanted);
    blocks.sort_unstable();
    blocks.into_iter().flat_map(|block| block * length..((block + 1) * length).min(n)).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::settings::Block;

    #[test]
    fn a_bootstrap_draws_the_rows_of_the_reference() {
        // Seed, rows, block, resample; the first rows and the sum of all, from numpy.
        let first = bootstrap_rows(42, 0, 248, 6);
        assert_eq!(first[..8], [120, 121, 122, 123, 124, 125, 221, 222]);
        assert_eq!(first.iter().sum::<usize>(), 33_122);
        let wide_seed = bootstrap_rows(1_099_511_627_781, 12, 300, 1);
        assert_eq!(wide_seed[..4], [291, 138, 76, 165]);
        assert_eq!(wide_seed.iter().sum::<usize>(), 44_678);
    }

    proptest! {
        #[test]
        fn a_subsample_has_its_share_of_the_rows_each_once_and_in_order(
            n in 20_usize..300, share in 0.1_f64..0.95, b in 0_usize..50, length in 1_usize..5,
        ) {
            let resampling = Resampling { share, block: Block::Rows(length), ..Resampling::default() };
            let rows = rows(&resampling, 7, b, 0, n);
            prop_assert!(rows.windows(2).all(|pair| pair[0] < pair[1]) && rows.iter().all(|&row| row < n));
            prop_assert!((rows.len() as f64 - share * n as f64).abs() <= 2.0 * length as f64);
        }

        #[test]
        fn recordings_of_one_resample_draw_from_streams_of_their_own(b in 0_usize..1000) {
            let resampling = Resampling { scheme: Scheme::Bootstrap, ..Resampling::default() };
            prop_assert_ne!(rows(&resampling, 1, b, 0, 200), rows(&resampling, 1, b, 1, 200));
        }
    }
}
