//! Mutations that know what formats consist of: sizes as bytes, numbers as text, and parts such as lists, lines and blocks.

use std::ops::Range;

use crate::random::Random;

/// Length of the longest input.
pub(crate) const LONGEST: usize = 1 << 16;

/// What breaks sizes, counts and indices.
const SIZES: [u64; 14] = [
    0,
    1,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    1 << 31,
    0xffff_ffff,
    1 << 32,
    1 << 62,
    (1 << 63) - 1,
    u64::MAX,
];
/// What breaks numbers that are written as text, and values of another type.
const VALUES: [&str; 24] = [
    "0", "1", "-1", "2", "255", "65536", "2147483648", "4294967295", "4611686018427387904",
    "9223372036854775807", "-9223372036854775808", "18446744073709551616", "9999999999999999999999", "1e999",
    "-1e308", "5e-324", "0.5", "nan", "inf", "null", "true", "\"\"", "[]", "{}",
];
/// Attempts to find a number that looks like a size.
const ATTEMPTS: usize = 64;
const BRACKETS: [(u8, u8); 3] = [(b'[', b']'), (b'{', b'}'), (b'(', b')')];

/// Changes a size, a number or a part of the input.
pub(crate) fn change(random: &mut Random, input: &mut Vec<u8>, corpus: &[Vec<u8>]) {
    match random.below(8) {
        0..3 => size(random, input),
        3..5 if number(random, input) => {}
        3..5 => size(random, input),
        _ => parts(random, input, corpus),
    }
}

/// Replaces an integer of 1, 2, 4 or 8 bytes that may be a size: above 0 and at most twice the length of the input.
fn size(random: &mut Random, input: &mut [u8]) {
    for attempt in 1..=ATTEMPTS {
        let (at, width) = (random.below(input.len()), [1, 2, 4, 8][random.below(4)]);
        let Some(bytes) = input.get(at..at + width) else { continue };
        let big_endian = random.below(4) == 0;
        let join = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
        let now = if big_endian { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) };
        if attempt < ATTEMPTS && !(1..=2 * input.len() as u64).contains(&now) {
            continue;
        }
        let new = match random.below(4) {
            0 => [now.wrapping_sub(1), now.wrapping_add(1), now.wrapping_mul(2), now / 2][random.below(4)],
            _ => SIZES[random.below(SIZES.len())],
        };
        let new = match big_endian {
            true => new.to_be_bytes()[8 - width..].to_vec(),
            false => new.to_le_bytes()[..width].to_vec(),
        };
        input[at..at + width].copy_from_slice(&new);
        return;
    }
}

/// Replaces a number that is written as text. In half of the cases a padding of spaces behind it keeps the text as long as it was,
/// as in the header of a NumPy file. Returns whether there is such a number.
fn number(random: &mut Random, input: &mut Vec<u8>) -> bool {
    let from = random.below(input.len());
    let digit = |at: &usize| input[*at].is_ascii_digit();
    let Some(found) = (from..input.len()).find(digit).or_else(|| (0..from).find(digit)) else {
        return false;
    };
    let before = |at: &usize| matches!(input[*at], b'0'..=b'9' | b'.' | b'-');
    let start = (0..found).rev().take_while(before).last().unwrap_or(found);
    let within = |byte: &&u8| matches!(**byte, b'0'..=b'9' | b'.' | b'e' | b'E' | b'+' | b'-');
    let end = found + input[found..].iter().take_while(within).count();
    let new = match (random.below(4), std::str::from_utf8(&input[start..end]).unwrap_or("").parse::<i128>()) {
        (0, Ok(now)) => now.saturating_add(random.below(5) as i128 - 2).to_string(),
        _ => VALUES[random.below(VALUES.len())].to_owned(),
    };
    if random.below(2) == 0 {
        pad(input, end, new.len(), end - start);
    }
    input.splice(start..end, new.bytes());
    true
}

/// Makes the padding after `from` shorter or longer, for a text before it that will be `new` bytes long and not `old`.
fn pad(input: &mut Vec<u8>, from: usize, new: usize, old: usize) {
    let Some(at) = input[from..].windows(2).position(|two| two == b"  ").map(|at| from + at) else { return };
    let spaces = input[at..].iter().take_while(|byte| **byte == b' ').count();
    match new.checked_sub(old) {
        Some(more) => drop(input.drain(at..at + more.min(spaces))),
        None => insert(input, at, b" ", old - new),
    }
}

/// Doubles, swaps, drops, replaces, nests or ends with a part of the input.
fn parts(random: &mut Random, input: &mut Vec<u8>, corpus: &[Vec<u8>]) {
    let one = part(random, input);
    match random.below(6) {
        0 => {
            let bytes = input[one.clone()].to_vec();
            let at = if random.below(2) == 0 { one.end } else { random.below(input.len() + 1) };
            insert(input, at, &bytes, [1, 2, 16, 1000][random.below(4)]);
        }
        1 => {
            let two = part(random, input);
            let (first, second) = if one.start < two.start { (one, two) } else { (two, one) };
            if first.end <= second.start {
                let bytes = input[first.clone()].to_vec();
                let others: Vec<u8> = input.splice(second.clone(), bytes).collect();
                input.splice(first, others);
            }
        }
        2 => drop(input.drain(one)),
        3 => {
            let other = random.one_of(corpus).cloned().unwrap_or_default();
            let from = part(random, &other);
            input.splice(one, other[from].iter().copied());
        }
        4 => {
            let (open, close) = BRACKETS[random.below(BRACKETS.len())];
            let deep = [1, 100, 30_000][random.below(3)];
            insert(input, one.end, &[close], deep);
            insert(input, one.start, &[open], deep);
        }
        _ => input.truncate(one.end),
    }
}

/// A list, an object or a string with its brackets, a line, or a block of a power of two of bytes.
fn part(random: &mut Random, input: &[u8]) -> Range<usize> {
    let at = random.below(input.len());
    let found = match random.below(3) {
        0 => bracketed(input, at),
        1 => line(input, at),
        _ => None,
    };
    found.unwrap_or_else(|| {
        let length = 1 << random.below(13);
        let start = at / length * length;
        start..(start + length).min(input.len())
    })
}

/// From the first bracket or quote at or after `from` to the one that closes it.
fn bracketed(input: &[u8], from: usize) -> Option<Range<usize>> {
    let opens = |byte: &u8| matches!(byte, b'[' | b'{' | b'(' | b'"' | b'\'');
    let start = from + input[from..].iter().position(opens)?;
    let open = input[start];
    let close = BRACKETS.iter().find(|pair| pair.0 == open).map_or(open, |pair| pair.1);
    let mut depth = 0_usize;
    for (at, byte) in input.iter().enumerate().skip(start) {
        if *byte == close && at > start {
            depth -= 1;
        } else if *byte == open {
            depth += 1;
        }
        if depth == 0 {
            return Some(start..at + 1);
        }
    }
    None
}

/// Inserts `bytes` so many times, as far as an input may be long.
pub(crate) fn insert(input: &mut Vec<u8>, at: usize, bytes: &[u8], times: usize) {
    let repeated = bytes.repeat(times.min(LONGEST / bytes.len().max(1)));
    input.splice(at..at, repeated);
}

/// The line at `at` with its end; `None` without lines.
fn line(input: &[u8], at: usize) -> Option<Range<usize>> {
    let is_end = |byte: &u8| *byte == b'\n';
    let end = at + 1 + input.get(at..)?.iter().position(is_end)?;
    Some(input[..at].iter().rposition(is_end).map_or(0, |before| before + 1)..end)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What ten thousand changes by `mutate` make of an input.
    fn made(input: &[u8], mutate: impl Fn(&mut Random, &mut Vec<u8>)) -> Vec<Vec<u8>> {
        let mut random = Random(1);
        let one = |_| {
            let mut changed = input.to_vec();
            mutate(&mut random, &mut changed);
            changed
        };
        (0..10_000).map(one).collect()
    }

    #[test]
    fn a_size_becomes_every_special_value_in_either_order() {
        let mut input = vec![0xee; 40];
        input[8..16].copy_from_slice(&20_u64.to_le_bytes());
        input[24..28].copy_from_slice(&20_u32.to_be_bytes());
        let made = made(&input, |random, input| size(random, input));
        for value in [0, 1, 1 << 31, 1 << 62, 19, 21] {
            assert!(made.iter().any(|m| m[8..16] == u64::to_le_bytes(value)), "{value}");
        }
        for value in [0, 1, 1 << 31, u32::MAX] {
            assert!(made.iter().any(|m| m[24..28] == u32::to_be_bytes(value)), "{value}");
        }
    }

    #[test]
    fn a_number_in_a_header_changes_with_its_padding_or_without() {
        let header = b"{'descr': 'f8', 'shape': (20, 3), }          \n";
        let made = made(header, |random, input| assert!(number(random, input)));
        let has = |text: &str, padded: bool| {
            let found = |m: &&Vec<u8>| m.windows(text.len()).any(|part| part == text.as_bytes());
            made.iter().filter(found).any(|m| (m.len() == header.len()) == padded)
        };
        for text in ["(0, 3)", "(2147483648, 3)", "(4611686018427387904, 3)", "(20, -1)", "(null, 3)"] {
            assert!(has(text, false), "{text}");
        }
        assert!(
            has("(2147483648, 3)", true)
                && has("(0, 3)", true)
                && has("(20, 65536)", true)
                && has("(21, 3)", true)
        );
        assert!(!number(&mut Random(1), &mut b"none".to_vec()) && !number(&mut Random(1), &mut Vec::new()));
    }

    #[test]
    fn lists_are_doubled_swapped_dropped_replaced_and_nested() {
        let corpus = [b"[7]".to_vec()];
        let made = made(b"{\"a\": [1], \"b\": [2]}", |random, input| parts(random, input, &corpus));
        let has = |text: &str| made.iter().any(|m| m.windows(text.len()).any(|part| part == text.as_bytes()));
        for text in ["[1][1]", "[2], \"b\": [1]", ": , \"b\"", "[7], \"b\"", "[[1]]", "(((((("] {
            assert!(has(text), "{text}");
        }
        assert!(made.contains(&b"{\"a\": [1]".to_vec()));
    }
}
