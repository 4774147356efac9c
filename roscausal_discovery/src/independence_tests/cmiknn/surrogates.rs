//! Surrogates of CMIknn: local permutations and block permutations.

use super::coordinate::{Coordinate, widen};
use crate::numeric::random::Rng;

/// The `m` nearest samples of each sample in the maximum norm of `z`, including itself. Nearest first; of equals
/// the earliest first. Flat, `m` per sample.
pub(super) fn nearest<T: Coordinate>(z: &[Vec<T>], m: usize) -> Vec<usize> {
    let n = z.first().map_or(0, Vec::len);
    let mut distances = vec![T::default(); n];
    let mut flat = Vec::with_capacity(n * m);
    for i in 0..n {
        distances.fill(T::default());
        z.iter().for_each(|row| widen(&mut distances, row[i], row));
        let start = flat.len();
        for (j, &d) in distances.iter().enumerate() {
            if flat.len() - start == m {
                if distances[flat[start + m - 1]] <= d {
                    continue;
                }
                flat.pop();
            }
            let at = flat[start..].partition_point(|&other: &usize| distances[other] <= d);
            flat.insert(start + at, j);
        }
    }
    flat
}

/// A permutation within neighbourhoods (Runge 2018, AISTATS, Algorithm 1). In random order, each sample takes a
/// random one of its `m` neighbours in Z that no other sample took. If all are taken, it takes any of them.
pub(super) fn local_permutation(neighbours: &[usize], m: usize, rng: &mut Rng, out: &mut [usize]) {
    let n = out.len();
    let mut order: Vec<usize> = (0..n).collect();
    rng.shuffle(&mut order);
    let mut taken = vec![false; n];
    let mut choice = vec![0; m];
    for i in order {
        choice.copy_from_slice(&neighbours[i * m..(i + 1) * m]);
        for left in (1..=m).rev() {
            let at = rng.below(left);
            out[i] = choice[at];
            if !taken[out[i]] {
                break;
            }
            choice.swap(at, left - 1);
        }
        taken[out[i]] = true;
    }
}

/// A permutation of whole blocks of `length` samples; the last block may be shorter.
pub(super) fn block_permutation(length: usize, rng: &mut Rng, out: &mut [usize]) {
    let n = out.len();
    let mut starts: Vec<usize> = (0..n).step_by(length.max(1)).collect();
    rng.shuffle(&mut starts);
    let samples = starts.into_iter().flat_map(|start| start..(start + length.max(1)).min(n));
    out.iter_mut().zip(samples).for_each(|(out, sample)| *out = sample);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Node;

    fn rng(seed: u64) -> Rng {
        Rng::for_test(seed, Node::new(0, 1), Node::new(1, 0), &[])
    }

    #[test]
    fn neighbours_are_the_nearest() {
        let z = [vec![0.0, 10.0, 1.0, 2.0, 11.0, 30.0], vec![0.0; 6]];
        assert_eq!(nearest(&z, 2), [0, 2, 1, 4, 2, 0, 3, 2, 4, 1, 5, 4]);
    }

    #[test]
    fn local_permutations_stay_local_and_seldom_repeat() {
        let n = 200_usize;
        let z = [(0..n).map(|i| ((i * 83) % n) as i16).collect::<Vec<_>>()];
        let neighbours = nearest(&z, 5);
        let (mut random, mut out) = (rng(3), vec![0; n]);
        let mut moved = 0;
        for _ in 0..50 {
            local_permutation(&neighbours, 5, &mut random, &mut out);
            assert!((0..n).all(|i| neighbours[i * 5..i * 5 + 5].contains(&out[i])));
            moved += (0..n).filter(|&i| out[i] != i).count();
            let mut used = out.clone();
            used.sort_unstable();
            used.dedup();
            assert!(used.len() > 8 * n / 10, "{} of {n} samples are used", used.len());
        }
        assert!(moved > 50 * n / 2);
    }

    #[test]
    fn blocks_stay_together() {
        let mut out = vec![0; 23];
        block_permutation(5, &mut rng(1), &mut out);
        let mut sorted = out.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..23).collect::<Vec<_>>());
        assert!(out.windows(2).filter(|pair| pair[1] == pair[0] + 1).count() >= 18);
    }
}
