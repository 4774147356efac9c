//! The number types in which nearest neighbours are searched: ranks as small integers, and doubles.

use pulp::{Arch, Simd, WithSimd};

/// [`Coordinate::widen`] with the widest vectors of the processor.
pub(super) fn widen<T: Coordinate>(out: &mut [T], at: T, row: &[T]) {
    Arch::new().dispatch(Widen { out, at, row });
}

struct Widen<'a, T> {
    out: &'a mut [T],
    at: T,
    row: &'a [T],
}

impl<T: Coordinate> WithSimd for Widen<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        T::widen(self.out, self.at, self.row);
    }
}

/// A number type for the nearest-neighbour search.
///
/// The methods are the inner loops of the search. They are inlined into code for the widest vectors of the
/// processor.
pub(crate) trait Coordinate: Copy + Default + PartialOrd + Send + Sync {
    /// Distances of one sample, prepared for counting.
    type Profile: Default;

    /// `out[j] = max(out[j], |at - row[j]|)`.
    fn widen(out: &mut [Self], at: Self, row: &[Self]);

    /// The largest distance that counts as nearer than the `k`-th neighbour. The sample itself (distance 0) is not
    /// a neighbour. `guess` is a starting point for the search; `scratch` is working memory.
    fn radius(distances: &[Self], k: usize, guess: Self, scratch: &mut Vec<Self>) -> Self;

    /// Number of samples with `max(distances[j], |at - row[j]|)` within `radius`.
    fn count_within(distances: &[Self], at: Self, row: &[Self], radius: Self) -> usize;

    /// Prepares distances for [`Coordinate::look_up`].
    fn profile(distances: &[Self], profile: &mut Self::Profile);

    /// Number of samples with a distance within `radius`.
    fn look_up(profile: &Self::Profile, radius: Self) -> usize;
}

/// The distance of two ranks.
#[inline(always)]
pub(super) fn apart(a: i16, b: i16) -> i16 {
    a.wrapping_sub(b).max(b.wrapping_sub(a))
}

/// Ranks `0..n`, each once, with `n` at most [`MAX_RANKS`]: distances are small integers.
impl Coordinate for i16 {
    /// Entry `r`: number of samples with a distance of at most `r`.
    type Profile = Vec<u16>;

    #[inline(always)]
    fn widen(out: &mut [i16], at: i16, row: &[i16]) {
        for (out, &v) in out.iter_mut().zip(row) {
            *out = (*out).max(apart(at, v));
        }
    }

    #[inline(always)]
    fn radius(distances: &[i16], k: usize, guess: i16, _scratch: &mut Vec<i16>) -> i16 {
        let wanted = k as i16 + 1;
        let count = |radius: i16| {
            let mut count = 0_i16;
            for &d in distances {
                count += i16::from(d <= radius);
            }
            count
        };
        // count(below) < wanted <= count(above): distances to others are at least 1.
        let (mut below, mut above) = (0, distances.len() as i16 - 1);
        let mut probe = guess.clamp(1, above);
        let mut step = (above >> 6).max(2);
        let mut galloping = true;
        let mut last = None;
        while above - below > 1 {
            let enough = count(probe) >= wanted;
            if enough {
                above = probe
            } else {
                below = probe
            }
            galloping &= last.is_none_or(|before| before == enough);
            last = Some(enough);
            let next = if enough { above.saturating_sub(step) } else { below.saturating_add(step) };
            probe = if galloping && next > below && next < above {
                step = step.saturating_mul(2);
                next
            } else {
                below + (above - below) / 2
            };
        }
        above - 1
    }

    #[inline(always)]
    fn count_within(distances: &[i16], at: i16, row: &[i16], radius: i16) -> usize {
        let mut count = 0_i16;
        for (&d, &v) in distances.iter().zip(row) {
            count += i16::from(d.max(apart(at, v)) <= radius);
        }
        count as usize
    }

    fn profile(distances: &[i16], profile: &mut Vec<u16>) {
        profile.clear();
        profile.resize(distances.len(), 0);
        for &d in distances {
            profile[d as usize] += 1;
        }
        let mut sum = 0;
        for count in profile {
            sum += *count;
            *count = sum;
        }
    }

    #[inline(always)]
    fn look_up(profile: &Vec<u16>, radius: i16) -> usize {
        profile[radius as usize] as usize
    }
}

/// Most samples for which ranks and counts fit into an `i16`.
pub(crate) const MAX_RANKS: usize = i16::MAX as usize;

/// A distance below this fraction of the distance to the k-th neighbour counts as nearer.
const NEARER: f64 = 0.999_999_999;

impl Coordinate for f64 {
    /// The distances in rising order.
    type Profile = Vec<f64>;

    #[inline(always)]
    fn widen(out: &mut [f64], at: f64, row: &[f64]) {
        for (out, &v) in out.iter_mut().zip(row) {
            let apart = (at - v).abs();
            *out = if apart > *out { apart } else { *out };
        }
    }

    #[inline(always)]
    fn radius(distances: &[f64], k: usize, _guess: f64, scratch: &mut Vec<f64>) -> f64 {
        const FEW: usize = 16;
        if k < FEW {
            // The k + 1 smallest in rising order. Most samples are farther than the last of them.
            let mut nearest = [f64::INFINITY; FEW];
            for &d in distances {
                if d < nearest[k] {
                    let mut at = k;
                    while at > 0 && nearest[at - 1] > d {
                        nearest[at] = nearest[at - 1];
                        at -= 1;
                    }
                    nearest[at] = d;
                }
            }
            return NEARER * nearest[k];
        }
        scratch.clear();
        scratch.extend_from_slice(distances);
        let (_, kth, _) = scratch.select_nth_unstable_by(k, f64::total_cmp);
        NEARER * *kth
    }

    #[inline(always)]
    fn count_within(distances: &[f64], at: f64, row: &[f64], radius: f64) -> usize {
        let mut count = 0_u64;
        for (&d, &v) in distances.iter().zip(row) {
            count += u64::from((d <= radius) & ((at - v).abs() <= radius));
        }
        count as usize
    }

    fn profile(distances: &[f64], profile: &mut Vec<f64>) {
        profile.clear();
        profile.extend_from_slice(distances);
        profile.sort_unstable_by(f64::total_cmp);
    }

    #[inline(always)]
    fn look_up(profile: &Vec<f64>, radius: f64) -> usize {
        profile.partition_point(|&d| d <= radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_radius_lies_just_below_the_kth_neighbour() {
        let distances: Vec<i16> = vec![0, 5, 3, 3, 9, 1, 7, 2, 8, 9];
        let mut sorted = distances.clone();
        sorted.sort_unstable();
        for (k, &kth) in sorted.iter().enumerate().skip(1) {
            for guess in 0..=10 {
                assert_eq!(i16::radius(&distances, k, guess, &mut Vec::new()), kth - 1);
            }
            let floats: Vec<f64> = distances.iter().map(|&d| f64::from(d)).collect();
            let radius = f64::radius(&floats, k, 0.0, &mut Vec::new());
            assert!((radius - f64::from(kth) * NEARER).abs() < 1e-12);
        }
    }

    #[test]
    fn many_neighbours_are_selected_like_few() {
        let distances: Vec<f64> = (0..50).map(|i| f64::from((i * 37) % 50)).collect();
        for k in 1..50 {
            assert_eq!(f64::radius(&distances, k, 0.0, &mut Vec::new()), NEARER * k as f64);
        }
    }
}
