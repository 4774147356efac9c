//! Random numbers that depend on a seed and where they are used.

use roscausal_discovery::mix;

/// A number that depends on a seed and two places.
pub(crate) fn at(seed: u64, a: usize, b: usize) -> u64 {
    mix(mix(mix(seed) ^ a as u64) ^ b as u64)
}

/// `number` as one of `0..n` (`n` > 0).
pub(crate) fn below(number: u64, n: usize) -> usize {
    ((u128::from(number) * n as u128) >> 64) as usize
}

/// `number` as one between 0 and 1, never 1.
pub(crate) fn unit(number: u64) -> f64 {
    (number >> 11) as f64 / (1_u64 << 53) as f64
}

/// `number` as one of the standard normal distribution (Box and Muller 1958).
pub(crate) fn normal(number: u64) -> f64 {
    (-2.0 * libm::log(1.0 - unit(number))).sqrt() * libm::cos(std::f64::consts::TAU * unit(mix(number)))
}

/// The blocks `(start, length)` of a moving-block bootstrap (Künsch 1989) of `stretches` of consecutive places, numbered through:
/// blocks of `block` places within a stretch (all of it where it is shorter), until as many places are drawn as there are.
pub(crate) fn blocks(seed: u64, stretches: &[usize], block: usize) -> Vec<(usize, usize)> {
    let total: usize = stretches.iter().sum();
    let begins = |stretch: usize| if stretch == 0 { 0 } else { stretch.saturating_sub(block) + 1 };
    let places: usize = stretches.iter().map(|&stretch| begins(stretch)).sum();
    let (mut drawn, mut blocks) = (0, Vec::new());
    while drawn < total && places > 0 {
        let mut place = below(at(seed, blocks.len(), 0), places);
        let mut start = 0;
        for &stretch in stretches {
            if place < begins(stretch) {
                let length = block.clamp(1, stretch).min(total - drawn);
                blocks.push((start + place, length));
                drawn += length;
                break;
            }
            place -= begins(stretch);
            start += stretch;
        }
    }
    blocks
}

/// The length of a block for `n` places in all.
pub(crate) fn block_length(n: usize) -> usize {
    libm::cbrt(n as f64).ceil().max(1.0) as usize
}

/// How often each place counts in a moving-block bootstrap.
pub(crate) fn block_counts(seed: u64, stretches: &[usize], block: usize) -> Vec<u32> {
    let mut counts = vec![0; stretches.iter().sum()];
    for (start, length) in blocks(seed, stretches, block) {
        counts[start..start + length].iter_mut().for_each(|count| *count += 1);
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bootstrap_draws_as_many_places_as_there_are_and_no_block_leaves_its_stretch() {
        for seed in 0..50 {
            let counts = block_counts(seed, &[40, 0, 3, 20], 5);
            assert_eq!((counts.len(), counts.iter().sum::<u32>()), (63, 63));
        }
        assert!(block_counts(1, &[], 3).is_empty());
    }
}
