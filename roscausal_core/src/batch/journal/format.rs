//! The file format of the journal: a header and blocks of samples, each with length and checksum.

use serde::{Deserialize, Serialize};

use crate::{
    batch::{Field, Sampling, Values},
    signal::How,
};

/// The first bytes of every journal.
pub const MAGIC: &[u8] = b"roscausal-journal/1\n";
/// Bytes of one sample.
const SAMPLE: usize = 1 + 4 + 8 + 8 * Field::ALL.len();
/// Bytes before a block: length and checksum.
const BLOCK: usize = 8;
/// Most samples in one block.
const MOST_IN_BLOCK: usize = 4096;

/// The settings with which the samples of a journal were recorded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The journal's own number; it rises from batch to batch.
    pub number: u64,
    /// Step between rows, seconds.
    pub dt_s: f64,
    /// Length of a batch in seconds; `None`: until the end.
    pub ts_length_s: Option<f64>,
    /// Two samples farther apart are a gap, seconds.
    pub max_gap_s: f64,
    /// What rows hold of the samples around them.
    #[serde(alias = "hold", alias = "subsampling")]
    pub sampling: Sampling,
    /// The people to record, in the syntax of `sel_agent`.
    pub sel_agent: String,
    /// Frame of all positions.
    pub frame: String,
    /// The first row that may belong to this batch, in nanoseconds.
    pub next_row_ns: i64,
    /// The signals in the order of their numbers: name, and what rows hold.
    #[serde(default)]
    pub signals: Vec<(String, How)>,
}

/// What a sample is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// The robot.
    Robot,
    /// The person with this id.
    Person(u32),
    /// The signal with this number.
    Signal(u32),
}

impl Subject {
    /// Its two numbers in the file.
    fn code(self) -> (u8, u32) {
        match self {
            Self::Robot => (0, 0),
            Self::Person(id) => (1, id),
            Self::Signal(number) => (2, number),
        }
    }

    fn of(kind: u8, number: u32) -> Option<Self> {
        match kind {
            0 => Some(Self::Robot),
            1 => Some(Self::Person(number)),
            2 => Some(Self::Signal(number)),
            _ => None,
        }
    }
}

/// One sample of the robot, a person or a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// What it is of.
    pub of: Subject,
    /// Nanoseconds.
    pub stamp_ns: i64,
    /// What was measured; of a signal only `x`.
    pub values: Values,
}

/// What the recorder reports to the journal.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A journal begins.
    Begin(Header),
    /// A sample of the journal that began last.
    Sample(Sample),
    /// The journal of this number is not needed: nothing was recorded with it.
    Abandon(u64),
}

/// The bytes of a complete journal.
pub fn encode(header: &Header, samples: &[Sample]) -> Vec<u8> {
    let mut bytes = begin(header);
    samples.chunks(MOST_IN_BLOCK).for_each(|samples| bytes.extend(block_of(samples)));
    bytes
}

/// The beginning of a journal's file.
pub(super) fn begin(header: &Header) -> Vec<u8> {
    // Numbers, texts and flags always serialise.
    [MAGIC, &block(&serde_json::to_vec(header).unwrap_or_default())].concat()
}

/// A block of samples. If it is cut short, all of them are lost.
pub(super) fn block_of(samples: &[Sample]) -> Vec<u8> {
    let mut payload = Vec::with_capacity(samples.len() * SAMPLE);
    for sample in samples {
        let (kind, number) = sample.of.code();
        payload.push(kind);
        payload.extend(number.to_le_bytes());
        payload.extend(sample.stamp_ns.to_le_bytes());
        sample.values.to_array().iter().for_each(|value| payload.extend(value.to_le_bytes()));
    }
    block(&payload)
}

fn block(payload: &[u8]) -> Vec<u8> {
    let length = u32::try_from(payload.len()).unwrap_or(u32::MAX).to_le_bytes();
    [&length, &crc32fast::hash(payload).to_le_bytes(), payload].concat()
}

/// Header and samples of a journal, up to the first incomplete block.
///
/// # Errors
/// One sentence if the header itself is incomplete.
pub fn decode(bytes: &[u8]) -> Result<(Header, Vec<Sample>), String> {
    let mut rest = bytes.strip_prefix(MAGIC).ok_or("it does not begin as a journal")?;
    let header = next_block(&mut rest).ok_or("its first block is not whole")?;
    let header: Header = serde_json::from_slice(header).map_err(|e| format!("its header is none: {e}"))?;
    let mut samples = Vec::new();
    while let Some(block) = next_block(&mut rest) {
        for bytes in block.chunks_exact(SAMPLE) {
            samples.extend(sample(bytes));
        }
    }
    Ok((header, samples))
}

fn next_block<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = u32::from_le_bytes(*rest.first_chunk()?) as usize;
    let checksum = u32::from_le_bytes(*rest.get(4..)?.first_chunk()?);
    let payload = rest.get(BLOCK..)?.get(..length)?;
    *rest = rest.get(BLOCK + length..)?;
    (crc32fast::hash(payload) == checksum).then_some(payload)
}

fn sample(bytes: &[u8]) -> Option<Sample> {
    let (&kind, rest) = bytes.split_first()?;
    let (id, rest) = rest.split_first_chunk()?;
    let (stamp, rest) = rest.split_first_chunk()?;
    let mut values = [0.0; Field::ALL.len()];
    for (value, bytes) in values.iter_mut().zip(rest.as_chunks().0) {
        *value = f64::from_le_bytes(*bytes);
    }
    let of = Subject::of(kind, u32::from_le_bytes(*id))?;
    Some(Sample { of, stamp_ns: i64::from_le_bytes(*stamp), values: Values::from_array(values) })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn header() -> Header {
        Header {
            number: 3,
            dt_s: 0.1,
            ts_length_s: Some(1.0),
            max_gap_s: 0.5,
            sampling: Sampling::Linear,
            sel_agent: "all".into(),
            frame: "map".into(),
            next_row_ns: 0,
            signals: vec![("load".into(), How::Hold(1.0))],
        }
    }

    pub(crate) fn samples(n: i64) -> Vec<Sample> {
        let values = |x: f64| Values::from_array([f64::NAN, 1.0, x, 2.0, 0.1, 0.5, 0.0]);
        let of = |of, i: i64| Sample { of, stamp_ns: i * 50_000_000, values: values(i as f64) };
        (0..n).flat_map(|i| [of(Subject::Robot, i), of(Subject::Person(7), i)]).collect()
    }

    #[test]
    fn a_journal_is_read_as_it_was_written() {
        let (header, samples) = (header(), samples(3000));
        let (read, found) = decode(&encode(&header, &samples)).expect("a journal");
        assert_eq!((read, found.len()), (header, samples.len()));
        assert_eq!(format!("{found:?}"), format!("{samples:?}"));
    }

    #[test]
    fn a_journal_cut_anywhere_counts_up_to_its_last_whole_block() {
        let mut bytes = begin(&header());
        let whole = bytes.len();
        let samples = samples(10);
        samples.chunks(5).for_each(|block| bytes.extend(block_of(block)));
        let per_block = (bytes.len() - whole) / 4;
        for cut in 0..bytes.len() {
            match decode(&bytes[..cut]) {
                Err(_) => assert!(cut < whole),
                Ok((_, found)) => assert_eq!(found.len(), (cut - whole) / per_block * 5),
            }
        }
    }

    #[test]
    fn bytes_that_were_never_written_end_a_journal() {
        let samples = samples(10);
        let mut bytes = begin(&header());
        bytes.extend(block_of(&samples[..5]));
        let whole = bytes.len();
        bytes.extend(block_of(&samples[5..]));
        bytes[whole + 20] ^= 1;
        assert_eq!(decode(&bytes).expect("a journal").1.len(), 5);
        bytes.truncate(whole);
        bytes.extend([0xff; 64]);
        assert_eq!(decode(&bytes).expect("a journal").1.len(), 5);
    }
}
