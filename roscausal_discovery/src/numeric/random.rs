//! Random numbers that depend on a seed and a test, not on the order of tests.

use crate::types::Node;

/// The step from one state of SplitMix64 to the next.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// One number of SplitMix64 (Steele, Lea and Flood 2014): it spreads neighbouring states over all 64 bits.
///
/// For numbers that depend on nothing but where they are used: a time, a place, a seed.
pub fn mix(state: u64) -> u64 {
    let v = state.wrapping_add(STEP);
    let v = (v ^ (v >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let v = (v ^ (v >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    v ^ (v >> 31)
}

/// The seed of random numbers on draw number `draw` of the data: that of the settings for the data themselves (0).
pub(crate) fn seed_of_draw(seed: u64, draw: u64) -> u64 {
    if draw == 0 { seed } else { mix(seed ^ mix(draw)) }
}

/// A small random generator (splitmix64: Steele, Lea and Flood 2014, "Fast splittable pseudorandom number
/// generators"): same seed, same numbers, everywhere.
#[derive(Clone, Debug)]
pub(crate) struct Rng(u64);

impl Rng {
    /// The generator of a seed.
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The generator of one test. Its numbers depend on the seed and the test, not on the order of tests.
    pub(crate) fn for_test(seed: u64, x: Node, y: Node, z: &[Node]) -> Self {
        let mut rng = Self(seed);
        for node in [x, y].iter().chain(z) {
            rng.0 = rng.next_u64() ^ ((node.var as u64) << 32 | node.lag as u64);
        }
        rng
    }

    /// The next integer, uniform over all 64 bits.
    pub(crate) fn next_u64(&mut self) -> u64 {
        let number = mix(self.0);
        self.0 = self.0.wrapping_add(STEP);
        number
    }

    /// A number in `[0, 1]`.
    pub(crate) fn unit(&mut self) -> f64 {
        self.next_u64() as f64 / u64::MAX as f64
    }

    /// A number below `n` (`n` > 0). The bias is negligible for n far below 2^64.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.next_u64()) * n as u128) >> 64) as usize
    }

    /// Fisher-Yates.
    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        (1..items.len()).rev().for_each(|i| items.swap(i, self.below(i + 1)));
    }
}
