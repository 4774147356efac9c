//! The conditions of a link's test, as each method chooses them.

use serde::{Deserialize, Serialize};

use crate::{
    methods::{Method, PcmciResult, mci_conditions},
    types::Node,
};

/// A variable at a lag that was held fixed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Condition {
    /// Its name.
    pub name: String,
    /// Steps before the effect.
    pub lag: usize,
}

impl Condition {
    pub(super) fn new(names: &[String], node: Node) -> Self {
        Self { name: names[node.var].clone(), lag: node.lag }
    }
}

/// What a run knows about its tests.
pub(crate) struct Known<'a> {
    result: &'a PcmciResult,
}

impl<'a> Known<'a> {
    pub(crate) fn of(result: &'a PcmciResult) -> Self {
        Self { result }
    }

    pub(super) fn interval(&self, at: [usize; 3]) -> Option<(f64, f64)> {
        self.result.conf_matrix.as_ref().and_then(|conf| conf.get(at).copied().flatten())
    }

    /// The conditions of `x _||_ (effect, 0)`, and what is not in them.
    pub(super) fn conditions(
        &self,
        method: Method,
        x: Node,
        effect: usize,
        n_vars: usize,
        [tau_min, tau_max]: [usize; 2],
    ) -> (Vec<Node>, String) {
        let mut z = Vec::new();
        let parents = |var: usize| self.result.parents.get(var).map_or(&[][..], |found| &found.parents);
        let past = |var: usize| (tau_min.max(1)..=tau_max).map(move |lag| Node::new(var, lag));
        let mut note = "";
        match method {
            Method::Fpcmci | Method::Pcmci => mci_conditions(x, parents(effect), parents(x.var), &mut z),
            Method::Pcmciplus => {
                mci_conditions(x, parents(effect), parents(x.var), &mut z);
                note = "PCMCI+ also tests it given sets of variables at lag 0; the weakest of these tests counts";
            }
            Method::Jpcmciplus => {
                mci_conditions(x, parents(effect), parents(x.var), &mut z);
                note = "J-PCMCI+ also tests it given contexts, which recording a sample is from, and sets of variables at lag 0; the \
                        weakest of these tests counts";
            }
            Method::Fullci => z.extend((0..n_vars).flat_map(past).filter(|node| *node != x)),
            Method::Bivci => z.extend(past(effect).filter(|node| *node != x)),
            Method::Lagdep => note = "a dependence without conditions is not a causal link",
            Method::Granger | Method::Varlingam | Method::Dynotears => {
                note = "one linear model of all variables at once; there are no conditions of a single link";
            }
            Method::Timino => {
                note = "what is left of the effect without this cause depends on it; there are no conditions of a single link";
            }
            Method::Lpcmci | Method::Candoit | Method::Tsfci => {
                note = "it is tested given many sets; the weakest of these tests counts";
            }
        }
        (z, note.to_owned())
    }
}
