//! The nearest neighbours of ranks, for many arrangements of one row X: by a few passes over bytes for each.
//!
//! The information is that of [`Estimator`]. Y and Z do not move, so a sample's distances in Z and in (Y, Z) serve all arrangements.
//! Then, for each arrangement:
//!
//! 1. Guess the radius of the k nearest: about that of this sample in the arrangements before, with X about where it is now.
//! 2. A pass computes the distances in (X, Y, Z) from there, a byte each: a radius is an integer, and it is seldom more than a hundred
//!    away from the guess.
//! 3. Passes over the bytes count the samples within a radius. The next radius is where the count would be `k`, by how fast it
//!    grows. About four passes find it, for about two samples are at each distance.
//! 4. A pass counts the samples within the radius in (X, Z); without Z a table of X has the number.
//!
//! Example: `k = 1`, and at the guess 5 there are 4 samples within. The count grows by 1 with each distance, so the next radius is
//! 5 - 2.5, say 3, and 1 is within it, the sample itself. Within 4 there are 2, so the radius is 3.

use pulp::{Arch, Simd, WithSimd};

use super::{
    coordinate::{Coordinate, apart, widen},
    estimator::Estimator,
};
use crate::{numeric::special::digamma_table, types::Result};

/// Samples that one arrangement is held against before the next: what is read of an arrangement stays in the nearest cache.
const TILE: usize = 32;
/// Places of X with a guess of their own.
const GUESSES: usize = 32;
/// Parts of a distance that guesses are made of.
const UNIT: i64 = 256;
/// A guess learns from a radius this part of the difference.
const LEARNT: i64 = 8;
/// Steps by how fast the count grows; then by halves, which is sure to end soon.
const STEPS: usize = 8;
/// Distances on either side of a guess that bytes have room for.
const REACH: usize = 127;
/// Rows are filled up to whole blocks: a pass has no rest that is less than a vector.
const BLOCK: usize = 128;
/// Radii are so far apart, at the least, that tell how fast the count grows.
const APART: usize = 32;

/// An arrangement of X.
struct Arrangement {
    /// Whole [`BLOCK`]s; what is beyond the samples counts for nothing, since the other distances are infinite there.
    x: Vec<i16>,
    /// Entry `v`: how many X are at most `v`.
    up_to: Vec<u16>,
}

impl Arrangement {
    fn new(ranks: &[i16]) -> Self {
        let mut up_to = Vec::new();
        i16::profile(ranks, &mut up_to);
        let mut x = ranks.to_vec();
        x.resize(ranks.len().next_multiple_of(BLOCK), 0);
        Self { x, up_to }
    }

    /// How many X are within `r` of `at`.
    fn between(&self, at: i16, r: usize) -> usize {
        let (at, last) = (at as usize, self.up_to.len() - 1);
        let below = if at > r { self.up_to[at - r - 1] } else { 0 };
        usize::from(self.up_to[(at + r).min(last)] - below)
    }
}

/// One sample: its distances to all.
#[derive(Default)]
struct Sample {
    number: usize,
    /// Whole [`BLOCK`]s, filled up with the largest number.
    in_z: Vec<i16>,
    in_yz: Vec<i16>,
    /// Entry `r`: how many are within `r`.
    within_z: Vec<u16>,
    within_yz: Vec<u16>,
    /// Radii in parts of [`UNIT`], by where X is, since they depend on it; `None` before the first.
    guesses: [Option<i64>; GUESSES],
    /// The radius of the last arrangement.
    last: usize,
    /// Distances for each sample more, about the radius, in parts of [`UNIT`].
    slope: i64,
}

/// The distances of one sample in (X, Y, Z), a byte each.
struct Near {
    /// Less than [`Near::first`] is 0, more than a byte has room for is 255. Whole [`BLOCK`]s.
    bytes: Vec<u8>,
    first: usize,
}

/// The information of each arrangement of X; `arrangements` holds them one after the other, each of ranks from 0 below the number of
/// samples.
///
/// # Errors
/// If the control stops the run.
pub(super) fn information(estimator: &Estimator<'_, i16>, arrangements: &[i16]) -> Result<Vec<f64>> {
    let n = estimator.y[0].len();
    let psi = digamma_table(n);
    let arrangements: Vec<Arrangement> = arrangements.chunks_exact(n).map(Arrangement::new).collect();
    let mut sums = vec![0.0; arrangements.len()];
    let mut tile: Vec<Sample> = (0..TILE.min(n)).map(|_| Sample::default()).collect();
    let mut near = Near { bytes: vec![u8::MAX; n.next_multiple_of(BLOCK)], first: 0 };
    for first in (0..n).step_by(TILE) {
        estimator.control.check()?;
        let tile = &mut tile[..TILE.min(n - first)];
        for (number, sample) in (first..).zip(tile.iter_mut()) {
            sample.place(estimator, number);
        }
        for (arrangement, sum) in arrangements.iter().zip(&mut sums) {
            for sample in &mut *tile {
                let radius = sample.radius(arrangement, estimator.k, &mut near);
                let k_xz = sample.within_xz(arrangement, radius);
                let (k_yz, k_z) = (sample.within_yz[radius], sample.within_z[radius]);
                *sum += psi[k_xz] + psi[usize::from(k_yz)] - psi[usize::from(k_z)];
            }
        }
    }
    Ok(sums.iter().map(|sum| psi[estimator.k] - sum / n as f64).collect())
}

impl Sample {
    /// Becomes the sample with this number.
    fn place(&mut self, estimator: &Estimator<'_, i16>, number: usize) {
        let n = estimator.y[0].len();
        self.number = number;
        self.in_z.clear();
        self.in_z.resize(n, 0);
        for row in estimator.z {
            widen(&mut self.in_z, row[number], row);
        }
        self.in_yz.clone_from(&self.in_z);
        for row in estimator.y {
            widen(&mut self.in_yz, row[number], row);
        }
        i16::profile(&self.in_z, &mut self.within_z);
        i16::profile(&self.in_yz, &mut self.within_yz);
        for distances in [&mut self.in_z, &mut self.in_yz] {
            distances.resize(n.next_multiple_of(BLOCK), i16::MAX);
        }
        (self.guesses, self.last, self.slope) = ([None; GUESSES], n / 2, UNIT);
    }

    /// The largest distance below that of the `k`-th neighbour in (X, Y, Z).
    fn radius(&mut self, of: &Arrangement, k: usize, near: &mut Near) -> usize {
        let n = of.up_to.len();
        let at = of.x[self.number];
        let guess = &mut self.guesses[at as usize * GUESSES / n];
        let mut r = guess.map_or(self.last, |radius| (radius / UNIT) as usize);
        near.fill(at, &of.x, &self.in_yz, r);
        // Within 0 there is only the sample itself, within the number of samples there are all.
        let (mut below, mut above) = (0, n - 1);
        let mut before = None;
        for step in 0.. {
            r = r.clamp(below + 1, (above - 1).max(below + 1));
            if !near.has(r) {
                near.fill(at, &of.x, &self.in_yz, r);
            }
            let count = near.within(r);
            if count <= k {
                below = r;
            } else {
                above = r;
            }
            if above - below <= 1 {
                break;
            }
            let missing = k as i64 - count as i64;
            if let Some((other, then)) = before.replace((r, count))
                && r.abs_diff(other) >= APART
                && count != then
            {
                self.slope = UNIT * (r as i64 - other as i64) / (count as i64 - then as i64);
            }
            let steps = (2 * missing + 1) * self.slope / (2 * UNIT);
            r = if step < STEPS { (r as i64 + steps).max(0) as usize } else { below.midpoint(above) };
        }
        let radius = below as i64 * UNIT;
        *guess = Some(guess.map_or(radius, |before| before + (radius - before) / LEARNT));
        self.last = below;
        below
    }

    /// How many samples are within `radius` in (X, Z).
    fn within_xz(&self, of: &Arrangement, radius: usize) -> usize {
        let at = of.x[self.number];
        if usize::from(self.within_z[0]) == of.up_to.len() {
            return of.between(at, radius);
        }
        Arch::new().dispatch(Within { radius: radius as i16, at, x: &of.x, others: &self.in_z })
    }
}

impl Near {
    /// Becomes the distances to the sample that is at `at` in X and has the distances `others` in the other dimensions; those about
    /// `middle` exactly.
    fn fill(&mut self, at: i16, x: &[i16], others: &[i16], middle: usize) {
        self.first = middle.saturating_sub(REACH);
        Arch::new().dispatch(Narrow { bytes: &mut self.bytes, first: self.first as u16, at, x, others });
    }

    /// Whether the samples within `r` can be counted.
    fn has(&self, r: usize) -> bool {
        (self.first..self.first + usize::from(u8::MAX)).contains(&r)
    }

    /// How many samples are within `r`.
    fn within(&self, r: usize) -> usize {
        Arch::new().dispatch(UpTo { bytes: &self.bytes, last: (r - self.first) as u8 })
    }
}

/// The pass of [`Near::fill`].
struct Narrow<'a> {
    bytes: &'a mut [u8],
    first: u16,
    at: i16,
    x: &'a [i16],
    others: &'a [i16],
}

impl WithSimd for Narrow<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for ((byte, &v), &d) in self.bytes.iter_mut().zip(self.x).zip(self.others) {
            *byte =
                (d.max(apart(self.at, v)) as u16).saturating_sub(self.first).min(u16::from(u8::MAX)) as u8;
        }
    }
}

/// The pass of [`Near::within`]: how many bytes are at most `last`.
struct UpTo<'a> {
    bytes: &'a [u8],
    last: u8,
}

impl WithSimd for UpTo<'_> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let (vectors, rest) = S::as_simd_u8s(self.bytes);
        let (last, one) = (simd.splat_u8s(self.last), simd.splat_u8s(1));
        let mut count = rest.iter().filter(|&&byte| byte <= self.last).count();
        // As many as a byte can count.
        for part in vectors.chunks(usize::from(u8::MAX)) {
            let mut lanes = simd.splat_u8s(0);
            for &bytes in part {
                let mask = simd.less_than_or_equal_u8s(bytes, last);
                if size_of::<S::m8s>() == size_of::<S::u8s>() {
                    lanes = simd.add_u8s(lanes, simd.and_u8s(bytemuck::cast(mask), one));
                } else {
                    // AVX-512 has masks of 64 bits.
                    count += bytemuck::cast::<S::m8s, u64>(mask).count_ones() as usize;
                }
            }
            let lanes: &[u8] = bytemuck::cast_slice(std::slice::from_ref(&lanes));
            count += lanes.iter().map(|&lane| usize::from(lane)).sum::<usize>();
        }
        count
    }
}

/// A pass: how many samples are within a radius, of one whose X is `at`.
struct Within<'a> {
    radius: i16,
    at: i16,
    x: &'a [i16],
    /// Distances in the other dimensions.
    others: &'a [i16],
}

impl WithSimd for Within<'_> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        i16::count_within(self.others, self.at, self.x, self.radius)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{
        numeric::{random::Rng, rows::random_ranks},
        types::Control,
    };

    fn ranked(row: &[f64]) -> Vec<i16> {
        random_ranks(row, &mut Rng::new(1)).iter().map(|&rank| rank as i16).collect()
    }

    /// By passes and by bisection: byte for byte.
    fn both(k: usize, rows: &[Vec<i16>], arrangements: &[i16]) -> (Vec<f64>, Vec<f64>) {
        let control = Control::default();
        let estimator = Estimator { k, y: &[&rows[0]], z: &rows[1..], control: &control };
        (information(&estimator, arrangements).unwrap(), estimator.information(&[arrangements]).unwrap())
    }

    proptest! {
        /// With repeated values in the arrangements as local permutations leave them.
        #[test]
        fn it_is_the_information_that_bisection_finds(
            values in prop::collection::vec(-1e3..1e3_f64, 60 * 4),
            drawn in prop::collection::vec(0..60_i16, 60 * 5),
            dimensions in 0..3_usize,
            k in 1..59_usize,
        ) {
            let rows: Vec<Vec<i16>> = values.chunks(60).map(ranked).collect();
            let (found, expected) = both(k, &rows[1..2 + dimensions], &[&rows[0][..], &drawn].concat());
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn a_radius_far_from_the_guess_is_found_too() {
        let n = 900;
        let mut rng = Rng::new(7);
        let mut row = || ranked(&(0..n).map(|_| rng.unit()).collect::<Vec<_>>());
        let rows = [row(), row(), row()];
        // A random one and one in order in turn: what one tells is wrong for the next.
        let arrangements = [row(), rows[0].clone(), row(), rows[0].clone()].concat();
        for k in [1, 90, 500, n - 1] {
            for rows in [&rows[..1], &rows[..]] {
                let (found, expected) = both(k, rows, &arrangements);
                assert_eq!(found, expected, "k = {k}, {} dimensions", rows.len());
            }
        }
    }

    #[test]
    fn a_stopped_control_ends_the_search() {
        let control = Control::default().out_of_time(|| true);
        let row: Vec<i16> = (0..20).collect();
        assert!(information(&Estimator { k: 3, y: &[&row], z: &[], control: &control }, &row).is_err());
    }
}
