//! Mutations of byte strings: bytes and tokens are changed, inserted, left out or doubled.

use crate::random::splitmix64;

/// Numbers that often break lengths, counts and indices.
const NUMBERS: [u64; 12] = [
    0,
    1,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    u64::MAX,
];
/// Length of the longest input.
const LONGEST: usize = 1 << 16;

/// Makes inputs from those of a corpus. The same seed makes the same inputs.
#[derive(Debug)]
pub struct Mutator<'a> {
    state: u64,
    tokens: &'a [&'a [u8]],
}

impl<'a> Mutator<'a> {
    /// A mutator that also inserts `tokens`.
    pub fn new(seed: u64, tokens: &'a [&'a [u8]]) -> Self {
        Self { state: seed, tokens }
    }

    /// The next input: one of the corpus with one to eight changes.
    pub fn next(&mut self, corpus: &[Vec<u8>]) -> Vec<u8> {
        let mut input = self.one_of(corpus).cloned().unwrap_or_default();
        for _ in 0..=self.below(8) {
            self.change(&mut input, corpus);
            input.truncate(LONGEST);
        }
        input
    }

    fn change(&mut self, input: &mut Vec<u8>, corpus: &[Vec<u8>]) {
        let at = self.below(input.len() + 1);
        let length = self.below(1 + (input.len() - at).min(64));
        match self.below(12) {
            0 => self.at(input, at, |byte, random| *byte ^= 1 << (random % 8)),
            1 => self.at(input, at, |byte, random| *byte = random as u8),
            2 => self.at(input, at, |byte, random| *byte = NUMBERS[random as usize % 5] as u8),
            3 => {
                let number = NUMBERS[self.below(NUMBERS.len())];
                let near = number.wrapping_add(self.below(5) as u64).wrapping_sub(2);
                let width = [2, 4, 8][self.below(3)];
                let mut bytes = near.to_le_bytes();
                if self.below(4) == 0 {
                    bytes[..width].reverse();
                }
                for (to, from) in input.iter_mut().skip(at).zip(&bytes[..width]) {
                    *to = *from;
                }
            }
            4 => input.truncate(at),
            5 => drop(input.drain(at..at + length)),
            6 => {
                let bytes: Vec<u8> = (0..length).map(|_| splitmix64(&mut self.state) as u8).collect();
                insert(input, at, &bytes);
            }
            7 | 8 => {
                let part = input[at..at + length].to_vec();
                let times = [1, 2, 16, 1000][self.below(4)];
                insert(input, at, &part.repeat(times.min(LONGEST / part.len().max(1))));
            }
            9 => {
                let other = self.one_of(corpus).cloned().unwrap_or_default();
                let from = self.below(other.len() + 1);
                input.truncate(at);
                input.extend_from_slice(&other[from..]);
            }
            _ => {
                let token = self.one_of(self.tokens).copied().unwrap_or(&[0xff]);
                let times = [1, 1, 1, 3, 200, 5000][self.below(6)];
                insert(input, at, &token.repeat(times.min(LONGEST / token.len().max(1))));
            }
        }
    }

    fn at(&mut self, input: &mut [u8], at: usize, change: impl Fn(&mut u8, u64)) {
        let random = splitmix64(&mut self.state);
        if let Some(byte) = input.get_mut(at) {
            change(byte, random);
        }
    }

    fn one_of<'b, T>(&mut self, items: &'b [T]) -> Option<&'b T> {
        items.get(self.below(items.len().max(1)))
    }

    fn below(&mut self, limit: usize) -> usize {
        (splitmix64(&mut self.state) % limit.max(1) as u64) as usize
    }
}

fn insert(input: &mut Vec<u8>, at: usize, bytes: &[u8]) {
    input.splice(at..at, bytes.iter().copied());
}
