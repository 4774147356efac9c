//! What LPCMCI knows of causes: which node is an ancestor of which, which is not, and where the data contradict themselves.

use super::graph::Graph;
use crate::types::Node;

/// What is known of whether one node causes another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Known {
    #[default]
    Nothing,
    Ancestor,
    NonAncestor,
    /// The data said both; it stays so.
    Ambiguous,
}

/// By cause, effect and lag; kept even where there is no link (any more).
pub(crate) struct Knowledge {
    known: Vec<Known>,
}

impl Knowledge {
    pub(crate) fn new(graph: &Graph) -> Self {
        Self { known: vec![Known::Nothing; graph.n_places()] }
    }

    /// Whether `a` causes `b`. What is later never does.
    pub(crate) fn get(&self, graph: &Graph, a: Node, b: Node) -> Known {
        if a.lag < b.lag {
            return Known::NonAncestor;
        }
        graph.place(a, b).map_or(Known::Nothing, |place| self.known[place])
    }

    pub(crate) fn set(&mut self, graph: &Graph, a: Node, b: Node, known: Known) {
        if let Some(place) = graph.place(a, b) {
            self.known[place] = known;
        }
    }
}
