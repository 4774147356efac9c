//! The nearest neighbours of ranks, for many arrangements of one row X: by one pass and a short walk for each.
//!
//! The information is that of [`Estimator`]. Y and Z do not move, so the distances of a sample in Z and in (Y, Z) are sorted once, by
//! counting, since distances of ranks are small integers. Then, for each arrangement:
//!
//! 1. Guess the radius of the k nearest: that of this sample in an arrangement before, with X about where it is now.
//! 2. A pass counts the samples within it in (X, Y, Z). If the count is far from `k`, guess again, by how the count grew from pass to
//!    pass.
//! 3. Walk from there to the radius, one distance after the other. The samples at a distance `r` are on the sorted lists: those with
//!    `r` in (Y, Z), and those whose X is `r` above or below.
//! 4. A pass counts the samples within the radius in (X, Z); without Z the sorted list of X has the number.
//!
//! About the radius there are about two samples for each distance, so the walk is short. A bisection takes seven passes and more.
//!
//! Example: `k = 1`, and at the guess 5 there are 4 samples within. At distance 5 is one and at 4 are two, so 1 is within 3, the
//! sample itself: the nearest neighbours are 4 away, and the radius is 3.

use pulp::{Arch, Simd, WithSimd};

use super::{
    coordinate::{Coordinate, widen},
    estimator::Estimator,
};
use crate::{ground::Result, numeric::special::digamma_table};

/// Samples that one arrangement is held against before the next: what is read of an arrangement stays in the nearest cache.
const TILE: usize = 32;
/// Places of X with a guess of their own.
const GUESSES: usize = 32;
/// Distances that the walk looks at together.
const STRIDE: usize = 16;
/// Another pass is quicker than as many steps, and one more for each [`PASS`] samples.
const FAR: f64 = 4.0;
/// Samples that a pass takes in the time of a step.
const PASS: f64 = 400.0;

/// Samples by a number from 0 below their number: a counting sort.
#[derive(Default)]
struct Sorted {
    /// Entry `v`: how many numbers are below `v`.
    starts: Vec<u16>,
    samples: Vec<u16>,
}

impl Sorted {
    fn sort(&mut self, numbers: &[i16]) {
        self.count(numbers);
        self.samples.resize(numbers.len(), 0);
        // Filling from the back turns the end of each number into its start, which is one entry too far on.
        for (sample, &v) in numbers.iter().enumerate().rev() {
            let place = &mut self.starts[v as usize + 1];
            *place -= 1;
            self.samples[usize::from(*place)] = sample as u16;
        }
        self.starts.remove(0);
        self.starts.push(numbers.len() as u16);
    }

    /// Counts alone, for [`Sorted::up_to`].
    fn count(&mut self, numbers: &[i16]) {
        self.starts.clear();
        self.starts.resize(numbers.len() + 2, 0);
        for &v in numbers {
            self.starts[v as usize + 1] += 1;
        }
        for v in 1..self.starts.len() {
            self.starts[v] += self.starts[v - 1];
        }
    }

    /// The samples with a number from `low` to below `high`.
    fn between(&self, low: usize, high: usize) -> &[u16] {
        &self.samples[usize::from(self.starts[low])..usize::from(self.starts[high])]
    }

    /// How many have `v` or less.
    fn up_to(&self, v: usize) -> usize {
        usize::from(self.starts[v + 1])
    }
}

/// An arrangement of X.
struct Arrangement<'a> {
    x: &'a [i16],
    sorted: Sorted,
}

impl Arrangement<'_> {
    /// How many X are within `r` of `at`.
    fn between(&self, at: i16, r: usize) -> usize {
        let (at, last) = (at as usize, self.x.len() - 1);
        let below = if at > r { self.sorted.up_to(at - r - 1) } else { 0 };
        self.sorted.up_to((at + r).min(last)) - below
    }
}

/// One sample: its distances to all.
struct Sample {
    number: usize,
    in_z: Vec<i16>,
    in_yz: Vec<i16>,
    by_z: Sorted,
    by_yz: Sorted,
    /// By where X is, since the radius depends on it.
    guesses: [Guess; GUESSES],
}

/// What an arrangement tells of the next.
#[derive(Clone, Copy, Default)]
struct Guess {
    radius: usize,
    /// Samples for each distance, about the radius.
    density: f64,
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

/// Distances to look at together for so many samples.
fn strides(samples: usize, density: f64) -> usize {
    ((samples as f64 / density) as usize + 2).min(STRIDE)
}

/// The information of each arrangement of X; `arrangements` holds them one after the other, each of ranks from 0 below the number of
/// samples.
///
/// # Errors
/// If the control stops the run.
pub(super) fn information(estimator: &Estimator<'_, i16>, arrangements: &[i16]) -> Result<Vec<f64>> {
    let n = estimator.y[0].len();
    let psi = digamma_table(n);
    let arrange = |x| {
        let mut sorted = Sorted::default();
        sorted.sort(x);
        Arrangement { x, sorted }
    };
    let arrangements: Vec<Arrangement<'_>> = arrangements.chunks_exact(n).map(arrange).collect();
    let mut sums = vec![0.0; arrangements.len()];
    let mut tile: Vec<Sample> = (0..TILE.min(n)).map(|_| Sample::new()).collect();
    for first in (0..n).step_by(TILE) {
        estimator.control.check()?;
        let tile = &mut tile[..TILE.min(n - first)];
        for (number, sample) in (first..).zip(tile.iter_mut()) {
            sample.place(estimator, number);
        }
        for (arrangement, sum) in arrangements.iter().zip(&mut sums) {
            for sample in &mut *tile {
                let (radius, k_xz) = sample.radius(arrangement, estimator.k);
                *sum += psi[k_xz] + psi[sample.by_yz.up_to(radius)] - psi[sample.by_z.up_to(radius)];
            }
        }
    }
    Ok(sums.iter().map(|sum| psi[estimator.k] - sum / n as f64).collect())
}

impl Sample {
    fn new() -> Self {
        Self {
            number: 0,
            in_z: Vec::new(),
            in_yz: Vec::new(),
            by_z: Sorted::default(),
            by_yz: Sorted::default(),
            guesses: [Guess::default(); GUESSES],
        }
    }

    /// Becomes the sample with this number.
    fn place(&mut self, estimator: &Estimator<'_, i16>, number: usize) {
        let n = estimator.y[0].len();
        self.number = number;
        self.guesses = [Guess { radius: n / 2, density: 1.0 }; GUESSES];
        self.in_z.clear();
        self.in_z.resize(n, 0);
        for row in estimator.z {
            widen(&mut self.in_z, row[number], row);
        }
        self.in_yz.clone_from(&self.in_z);
        for row in estimator.y {
            widen(&mut self.in_yz, row[number], row);
        }
        self.by_z.count(&self.in_z);
        self.by_yz.sort(&self.in_yz);
    }

    /// The largest distance below that of the `k`-th neighbour in (X, Y, Z), and how many samples are within it in (X, Z).
    fn radius(&mut self, of: &Arrangement<'_>, k: usize) -> (usize, usize) {
        let at = of.x[self.number];
        let within = |others, radius: usize| {
            Arch::new().dispatch(Within { radius: radius as i16, at, x: of.x, others })
        };
        let last = of.x.len() - 1;
        let place = at as usize * GUESSES / of.x.len();
        let guess = &mut self.guesses[place];
        let mut r = guess.radius;
        let mut count = within(&self.in_yz, r);
        loop {
            let steps = (k as f64 + 0.5 - count as f64) / guess.density;
            if steps.abs() < FAR + of.x.len() as f64 / PASS {
                break;
            }
            let next = (r as f64 + steps).clamp(0.0, last as f64) as usize;
            let there = within(&self.in_yz, next);
            let density = (there as f64 - count as f64) / (next as f64 - r as f64);
            // Where the density misleads, the walk is sure to arrive.
            let nearer = there.abs_diff(k) < count.abs_diff(k);
            if next != r && density > 0.0 {
                guess.density = density;
            }
            if !nearer {
                break;
            }
            (r, count) = (next, there);
        }
        let density = guess.density;
        // Within 0 there is only the sample itself, within the number of samples there are all.
        let r = if count > k {
            self.walk_down(of, r, count, k, density)
        } else {
            self.walk_up(of, r, count, k, density)
        };
        self.guesses[place].radius = r;
        let in_xz = if self.by_z.up_to(0) == of.x.len() { of.between(at, r) } else { within(&self.in_z, r) };
        (r, in_xz)
    }

    /// The radius, from a larger one that has `count` samples, and `density` about it.
    fn walk_down(
        &self,
        of: &Arrangement<'_>,
        mut r: usize,
        mut count: usize,
        k: usize,
        density: f64,
    ) -> usize {
        loop {
            let steps = strides(count - k, density).min(r);
            for found in self.at_distances(of, r + 1 - steps, steps)[..steps].iter().rev() {
                count -= found;
                r -= 1;
                if count <= k {
                    return r;
                }
            }
        }
    }

    /// The same from one that is not larger.
    fn walk_up(&self, of: &Arrangement<'_>, mut r: usize, mut count: usize, k: usize, density: f64) -> usize {
        loop {
            let steps = strides(k + 1 - count, density).min(of.x.len() - 1 - r);
            for found in &self.at_distances(of, r + 1, steps)[..steps] {
                count += found;
                if count > k {
                    return r;
                }
                r += 1;
            }
        }
    }

    /// How many samples are at each of some distances, from `first` on, which is at least 1.
    #[inline]
    fn at_distances(&self, of: &Arrangement<'_>, first: usize, steps: usize) -> [usize; STRIDE] {
        let (n, at) = (of.x.len(), of.x[self.number] as usize);
        let mut counts = [0; STRIDE];
        // The farthest of their coordinates is X ...
        let above = of.sorted.between((at + first).min(n), (at + first + steps).min(n));
        let below = of.sorted.between((at + 1).saturating_sub(first + steps), (at + 1).saturating_sub(first));
        for side in [above, below] {
            for &j in side {
                let apart = usize::from(of.x[usize::from(j)].abs_diff(at as i16));
                let in_others = self.in_yz[usize::from(j)] as usize;
                counts[(apart - first) % STRIDE] += usize::from(in_others <= apart);
            }
        }
        // ... or it is not.
        for &j in self.by_yz.between(first, first + steps) {
            let apart = self.in_yz[usize::from(j)] as usize;
            let in_x = usize::from(of.x[usize::from(j)].abs_diff(at as i16));
            counts[(apart - first) % STRIDE] += usize::from(in_x < apart);
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{
        ground::Control,
        numeric::{random::Rng, rows::random_ranks},
    };

    #[test]
    fn a_counting_sort_lists_each_sample_once() {
        let mut sorted = Sorted::default();
        sorted.sort(&[3, 0, 3, 1]);
        let between = |low, high| sorted.between(low, high).to_vec();
        assert_eq!([between(0, 2), between(2, 3), between(3, 4)], [vec![1, 3], vec![], vec![0, 2]]);
        assert_eq!((0..4).map(|v| sorted.up_to(v)).collect::<Vec<_>>(), [1, 2, 2, 4]);
    }

    proptest! {
        /// Byte for byte, with repeated values in the arrangements as local permutations leave them.
        #[test]
        fn it_is_the_information_that_bisection_finds(
            values in prop::collection::vec(-1e3..1e3_f64, 60 * 4),
            drawn in prop::collection::vec(0..60_i16, 60 * 5),
            dimensions in 0..3_usize,
            k in 1..59_usize,
        ) {
            let rank = |row: &[f64]| random_ranks(row, &mut Rng::new(1)).iter().map(|&r| r as i16).collect();
            let rows: Vec<Vec<i16>> = values.chunks(60).map(rank).collect();
            let arrangements = [&rows[0][..], &drawn].concat();
            let control = Control::default();
            let estimator = Estimator { k, y: &[&rows[1][..]], z: &rows[2..2 + dimensions], control: &control };
            let expected = estimator.information(&[&arrangements]).unwrap();
            prop_assert_eq!(information(&estimator, &arrangements).unwrap(), expected);
        }
    }

    #[test]
    fn a_stopped_control_ends_the_search() {
        let control = Control::default().out_of_time(|| true);
        let row: Vec<i16> = (0..20).collect();
        assert!(information(&Estimator { k: 3, y: &[&row], z: &[], control: &control }, &row).is_err());
    }
}
