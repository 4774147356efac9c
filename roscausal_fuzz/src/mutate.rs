//! Inputs made from those of a corpus: bytes, tokens, and what a format consists of (`structure`) are changed.

use crate::{
    random::Random,
    structure::{self, LONGEST, insert},
};

/// Makes inputs from those of a corpus. The same seed makes the same inputs.
#[derive(Debug)]
pub struct Mutator<'a> {
    random: Random,
    tokens: &'a [&'a [u8]],
}

impl<'a> Mutator<'a> {
    /// A mutator that also inserts `tokens`.
    pub fn new(seed: u64, tokens: &'a [&'a [u8]]) -> Self {
        Self { random: Random(seed), tokens }
    }

    /// The next input: one of the corpus with one to eight changes, half of the inputs with one.
    pub fn next(&mut self, corpus: &[Vec<u8>]) -> Vec<u8> {
        let mut input = self.random.one_of(corpus).cloned().unwrap_or_default();
        let changes = if self.random.below(2) == 0 { 1 } else { 1 + self.random.below(8) };
        for _ in 0..changes {
            match self.random.below(2) {
                0 => structure::change(&mut self.random, &mut input, corpus),
                _ => self.change_bytes(&mut input, corpus),
            }
            input.truncate(LONGEST);
        }
        input
    }

    fn change_bytes(&mut self, input: &mut Vec<u8>, corpus: &[Vec<u8>]) {
        let Self { random, tokens } = self;
        let at = random.below(input.len() + 1);
        let length = random.below(1 + (input.len() - at).min(64));
        match random.below(9) {
            0 => input.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << random.below(8)),
            1 => input.iter_mut().skip(at).take(1).for_each(|byte| *byte = random.below(256) as u8),
            2 => input.truncate(at),
            3 => drop(input.drain(at..at + length)),
            4 => {
                let bytes: Vec<u8> = (0..length).map(|_| random.below(256) as u8).collect();
                insert(input, at, &bytes, 1);
            }
            5 | 6 => {
                let part = input[at..at + length].to_vec();
                insert(input, at, &part, [1, 2, 16, 1000][random.below(4)]);
            }
            7 => {
                let other = random.one_of(corpus).cloned().unwrap_or_default();
                let from = random.below(other.len() + 1);
                input.truncate(at);
                input.extend_from_slice(&other[from..]);
            }
            _ => {
                let token = random.one_of(tokens).copied().unwrap_or(&[0xff]);
                insert(input, at, token, [1, 1, 1, 3, 200, 5000][random.below(6)]);
            }
        }
    }
}
