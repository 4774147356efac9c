//! What a run finds: graph, values, p-values, and how far it came.

use std::{fmt, str::FromStr};

use ndarray::Array3;

use crate::types::{CompleteRows, LinkMark, Node, SampleCount, text::quoted};

/// Whether a run came to its end.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Status {
    /// All tests were done.
    #[default]
    Complete,
    /// The time budget ended the run: untested links have value 0, p-value 1 and no mark. The text says how far the
    /// run came.
    Partial(String),
}

impl fmt::Display for Status {
    /// As the status of a model: `complete`, or `partial: ` and how far the run came.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Complete => f.write_str("complete"),
            Self::Partial(how_far) => write!(f, "partial: {how_far}"),
        }
    }
}

impl FromStr for Status {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.strip_prefix("partial: ")) {
            ("complete", _) => Ok(Self::Complete),
            (_, Some(how_far)) => Ok(Self::Partial(how_far.to_owned())),
            _ => Err(format!("{} is not a status: complete, or partial: and how far it came", quoted(text))),
        }
    }
}

as_text!(Status);

/// What the condition selection (PC1) found for one candidate link into a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The source.
    pub node: Node,
    /// Smallest `|value|` over its tests; 1 for a link that is assumed to exist.
    pub val_min: f64,
    /// Largest p-value over its tests; 0 for a link that is assumed to exist.
    pub pval_max: f64,
    /// Value of the test with the largest p-value.
    pub value: f64,
    /// Samples of this test; `None` before any.
    pub samples: Option<SampleCount>,
}

/// Result of PC1 for one target.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TargetParents {
    /// Parents, strongest first: the order in which they are conditioned on.
    pub parents: Vec<Node>,
    /// All candidates, by source and then lag.
    pub candidates: Vec<Candidate>,
    /// The level that the score chose, if several were given.
    pub optimal_pc_alpha: Option<f64>,
}

/// Result of a discovery run. Matrices are `[cause][effect][lag 0..=tau_max]`. Entries that were not tested have
/// value 0 and p-value 1.
#[derive(Clone, Debug, Default)]
pub struct PcmciResult {
    /// Link marks.
    pub graph: Array3<LinkMark>,
    /// Values of the tests.
    pub val_matrix: Array3<f64>,
    /// P-values of the tests, before any correction.
    pub p_matrix: Array3<f64>,
    /// P-values after the requested correction.
    pub q_matrix: Option<Array3<f64>>,
    /// Confidence intervals, if the test gives them.
    pub conf_matrix: Option<Array3<Option<(f64, f64)>>>,
    /// Samples of the test that each entry rests on; `None` where nothing was tested.
    pub samples: Array3<Option<SampleCount>>,
    /// PC1 for each target; empty for methods without PC1.
    pub parents: Vec<TargetParents>,
    /// PCMCI+: separating sets that are not empty: of the tests that removed links, as the votes on colliders amend them.
    pub sepsets: Vec<Sepset>,
    /// PCMCI+: unshielded triples that are neither colliders nor non-colliders.
    pub ambiguous_triples: Vec<(Node, usize, usize)>,
    /// PCMCI+: the level that the score chose, if several were given.
    pub optimal_alpha: Option<f64>,
    /// Samples that a test uses if no value is missing.
    pub n_samples: usize,
    /// Tests done.
    pub n_tests: usize,
    /// What the reader should know about the tests. One sentence each.
    pub remarks: Vec<String>,
    /// What the tests took, where a test tells.
    pub effort: Option<String>,
    /// Whether the run came to its end.
    pub status: Status,
}

/// A separating set of PCMCI+: `cause _||_ effect | conditions` and the lagged conditions of both.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sepset {
    /// Cause at its lag.
    pub cause: Node,
    /// Effect at lag 0.
    pub effect: usize,
    /// Contemporaneous conditions.
    pub conditions: Vec<Node>,
}

impl PcmciResult {
    /// A result before any test.
    pub(crate) fn untested(n_vars: usize, tau_max: usize, n_samples: usize) -> Self {
        let shape = (n_vars, n_vars, tau_max + 1);
        Self {
            graph: Array3::default(shape),
            val_matrix: Array3::zeros(shape),
            p_matrix: Array3::ones(shape),
            samples: Array3::default(shape),
            n_samples,
            ..Self::default()
        }
    }

    /// Writes what a test says of an entry.
    pub(crate) fn put(&mut self, at: [usize; 3], value: f64, p_value: f64, samples: Option<SampleCount>) {
        self.val_matrix[at] = value;
        self.p_matrix[at] = p_value;
        self.samples[at] = samples;
    }

    /// Gives an entry what is known of another one.
    pub(crate) fn copy(&mut self, from: [usize; 3], to: [usize; 3]) {
        self.put(to, self.val_matrix[from], self.p_matrix[from], self.samples[from]);
    }

    /// All entries from lag `tau_min` on rest on one fit to the rows that are complete.
    pub(crate) fn all_rest_on(&mut self, rows: &CompleteRows, tau_min: usize) {
        let samples = SampleCount { used: rows.len(), lost: rows.n_lost };
        for ((cause, effect, lag), entry) in self.samples.indexed_iter_mut() {
            *entry = (lag >= tau_min && (lag > 0 || cause != effect)).then_some(samples);
        }
    }

    /// The lagged causes of each variable.
    pub(crate) fn lagged_parents(&self) -> Vec<Vec<Node>> {
        let mut parents = vec![Vec::new(); self.graph.dim().0];
        for ((cause, effect, lag), mark) in self.graph.indexed_iter() {
            if lag > 0 && mark.is_link() {
                parents[effect].push(Node::new(cause, lag));
            }
        }
        parents
    }

    /// The p-values that decide: the corrected ones, if a correction was requested.
    pub fn deciding_p(&self) -> &Array3<f64> {
        self.q_matrix.as_ref().unwrap_or(&self.p_matrix)
    }
}
