//! The random stream of the null tables and of the draws of resamples: PCG64 (XSL-RR 128/64; O'Neill 2014) seeded through the hash of
//! `SeedSequence` (O'Neill 2015, "Developing a `seed_seq` alternative"), so that a seed means the same numbers
//! as in the field's Python tools.
//!
//! Not `rand_pcg`: it has the generator, but not `SeedSequence`, which is most of what is here.
//!
//! A seed has many streams, told apart by a key of 32-bit words ("spawned" streams): the words of the seed are filled up with
//! zeros to the size of the pool, and those of the key are mixed into the pool after them.

/// A PCG64 stream.
pub(crate) struct Pcg64 {
    state: u128,
    increment: u128,
    /// The upper half of the last integer, if only its lower half was used.
    half: Option<u32>,
}

const MULTIPLIER: u128 = 0x2360_ed05_1fc6_5da4_4385_df64_9fcc_f645;

impl Pcg64 {
    /// The stream of `seed`.
    pub(crate) fn new(seed: u64) -> Self {
        Self::of_key(seed, &[])
    }

    /// The stream number `key` of `seed`.
    pub(crate) fn of_key(seed: u64, key: &[u32]) -> Self {
        let words = seed_sequence(seed, key);
        let wide = |i: usize| (u128::from(words[i]) << 64) | u128::from(words[i + 1]);
        let mut rng = Self { state: 0, increment: (wide(2) << 1) | 1, half: None };
        rng.step();
        rng.state = rng.state.wrapping_add(wide(0));
        rng.step();
        rng
    }

    /// The next integer, uniform over all 64 bits.
    pub(crate) fn next_u64(&mut self) -> u64 {
        self.step();
        let folded = (self.state >> 64) as u64 ^ self.state as u64;
        folded.rotate_right((self.state >> 122) as u32)
    }

    /// A number below `bound`, uniform (Lemire 2019, "Fast random integer generation in an interval"): from half an integer,
    /// the low half first. A bound of 1 takes none.
    pub(crate) fn below(&mut self, bound: u32) -> u32 {
        if bound <= 1 {
            return 0;
        }
        let mut product = u64::from(self.next_u32()) * u64::from(bound);
        if (product as u32) < bound {
            let least = bound.wrapping_neg() % bound;
            while (product as u32) < least {
                product = u64::from(self.next_u32()) * u64::from(bound);
            }
        }
        (product >> 32) as u32
    }

    fn next_u32(&mut self) -> u32 {
        self.half.take().unwrap_or_else(|| {
            let number = self.next_u64();
            self.half = Some((number >> 32) as u32);
            number as u32
        })
    }

    /// Passes over the next `steps` integers, in `O(log steps)` (Brown 1994, "Random number generation with arbitrary
    /// strides").
    pub(crate) fn skip(&mut self, mut steps: u128) {
        let (mut multiplier, mut increment) = (MULTIPLIER, self.increment);
        while steps > 0 {
            if steps & 1 == 1 {
                self.state = self.state.wrapping_mul(multiplier).wrapping_add(increment);
            }
            increment = multiplier.wrapping_add(1).wrapping_mul(increment);
            multiplier = multiplier.wrapping_mul(multiplier);
            steps >>= 1;
        }
    }

    /// The next double, uniform in `[0, 1)`, a multiple of 2^-53.
    #[cfg(test)]
    pub(crate) fn next_f64(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    fn step(&mut self) {
        self.state = self.state.wrapping_mul(MULTIPLIER).wrapping_add(self.increment);
    }
}

/// Four words of state from a seed and a key: a pool of four hashed 32-bit words, each mixed into each other one, then the
/// words of the key into each.
fn seed_sequence(seed: u64, key: &[u32]) -> [u64; 4] {
    const POOL: usize = 4;
    let entropy = [seed as u32, (seed >> 32) as u32];
    let mut constant = 0x43b0_d7e5_u32;
    let mut hash = |value: u32| {
        let mixed = value ^ constant;
        constant = constant.wrapping_mul(0x931e_8875);
        let mixed = mixed.wrapping_mul(constant);
        mixed ^ (mixed >> 16)
    };
    let mut pool: [u32; POOL] = std::array::from_fn(|i| hash(entropy.get(i).copied().unwrap_or(0)));
    let mix = |x: u32, y: u32| {
        let mixed = x.wrapping_mul(0xca01_f9dd).wrapping_sub(y.wrapping_mul(0x4973_f715));
        mixed ^ (mixed >> 16)
    };
    for source in 0..POOL {
        for target in (0..POOL).filter(|&target| target != source) {
            pool[target] = mix(pool[target], hash(pool[source]));
        }
    }
    for &word in key {
        pool.iter_mut().for_each(|target| *target = mix(*target, hash(word)));
    }
    let mut constant = 0x8b51_f9dd_u32;
    let mut out = [0u64; 4];
    for i in 0..8 {
        let mixed = pool[i % POOL] ^ constant;
        constant = constant.wrapping_mul(0x58f3_8ded);
        let mixed = mixed.wrapping_mul(constant);
        out[i / 2] |= u64::from(mixed ^ (mixed >> 16)) << (32 * (i % 2));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seed_42_gives_the_published_stream() {
        let mut rng = Pcg64::new(42);
        let first: Vec<f64> = (0..4).map(|_| rng.next_f64()).collect();
        assert_eq!(first, [0.7739560485559633, 0.4388784397520523, 0.8585979199113825, 0.6973680290593639]);
    }
    #[test]
    fn skipping_equals_drawing() {
        for steps in [0, 1, 2, 7, 1000] {
            let (mut drawn, mut skipped) = (Pcg64::new(9), Pcg64::new(9));
            for _ in 0..steps {
                drawn.next_u64();
            }
            skipped.skip(steps);
            assert_eq!(skipped.next_u64(), drawn.next_u64(), "{steps}");
        }
    }
}
