//! The answers of tests, which LPCMCI asks again and again.
//!
//! A key is the pair and one bit for each node of its conditions. The number of answers that are kept is bounded, so that a search that
//! explodes does not take the memory, too; what is beyond is tested again.

use rustc_hash::FxHashMap;

use super::graph::{Graph, Pair};
use crate::types::{Node, SampleCount};

/// What one test said.
#[derive(Clone, Copy)]
pub(super) struct Answer {
    pub(super) value: f64,
    pub(super) p_value: f64,
    pub(super) samples: Option<SampleCount>,
    pub(super) dependent: bool,
}

/// Answers that are kept at most.
const MOST: usize = 1 << 18;

/// The answers so far.
#[derive(Default)]
pub(super) struct Answers {
    known: FxHashMap<Box<[u64]>, Answer>,
    /// The key that was asked for last; empty if it is not of the window.
    key: Vec<u64>,
}

impl Answers {
    /// What was said of a pair given `z`, whose order does not matter.
    pub(super) fn get(&mut self, graph: &Graph, pair: Pair, z: &[Node]) -> Option<Answer> {
        self.key.clear();
        let place = graph.place(pair.x, pair.y).filter(|_| z.iter().all(|node| node.lag <= graph.tau_max))?;
        self.key.resize(1 + graph.n_nodes().div_ceil(64), 0);
        self.key[0] = place as u64;
        for &node in z {
            let bit = graph.index(node);
            self.key[1 + bit / 64] |= 1 << (bit % 64);
        }
        self.known.get(self.key.as_slice()).copied()
    }

    /// Keeps the answer to what was asked for last.
    pub(super) fn keep(&mut self, answer: Answer) {
        if self.known.len() < MOST && !self.key.is_empty() {
            self.known.insert(self.key.as_slice().into(), answer);
        }
    }
}
