//! The state of a run of LPCMCI, and how it asks its independence tests.

use std::collections::HashMap;

use super::{
    answers::{Answer, Answers},
    graph::{Graph, Link, Middle, Pair},
    knowledge::{Knowledge, Known},
    settings::LpcmciSettings,
};
use crate::{
    methods::run::Run,
    types::{Assumption, LinkAssumptions, LinkEnd, Node, Result, SampleCount},
};

/// A set that separates a pair, sorted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Separating {
    pub(super) nodes: Vec<Node>,
    /// Weakly minimal: no member that is not an ancestor of the pair can be left out.
    pub(super) minimal: bool,
}

/// What the tests of a pair said.
#[derive(Clone, Debug, Default)]
pub(super) struct Evidence {
    /// Largest p-value, and the value and samples of its test.
    pub(super) p_value: f64,
    pub(super) value: f64,
    pub(super) samples: Option<SampleCount>,
    pub(super) separating: Vec<Separating>,
}

pub(super) struct Search<'a, 'b> {
    pub(super) run: &'a Run<'b>,
    pub(super) settings: &'a LpcmciSettings,
    assumptions: LinkAssumptions,
    pub(super) graph: Graph,
    pub(super) known: Knowledge,
    evidence: Vec<Evidence>,
    answers: Answers,
    /// The sets that vote, by pair and whether new ones are searched; emptied when the graph changes.
    pub(super) votes: HashMap<(Pair, bool), Vec<Vec<Node>>>,
    pub(super) n_asked: usize,
    pub(super) phase: String,
    /// As FCI does: only the sets on record vote, and answers are not kept, because there may be millions.
    as_fci: bool,
}

impl<'a, 'b> Search<'a, 'b> {
    pub(super) fn new(run: &'a Run<'b>, settings: &'a LpcmciSettings) -> Self {
        let (n_vars, tau_max) = (run.n_vars(), settings.tau_max);
        let all = || LinkAssumptions::all_with_hidden_causes(n_vars, settings.tau_min, tau_max);
        let graph = Graph::new(n_vars, tau_max);
        let known = Knowledge::new(&graph);
        let mut search = Self {
            run,
            settings,
            assumptions: settings.link_assumptions.clone().unwrap_or_else(all),
            graph,
            known,
            evidence: Vec::new(),
            answers: Answers::default(),
            votes: HashMap::new(),
            n_asked: 0,
            phase: "start".to_owned(),
            as_fci: false,
        };
        search.initialise(&[]);
        search
    }

    /// The same search, in which only the sets on record vote and no answer is kept.
    pub(super) fn like_fci(mut self) -> Self {
        self.as_fci = true;
        self
    }

    /// Whether further separating sets are searched when sets vote.
    pub(super) fn searches_votes(&self) -> bool {
        !self.as_fci
    }

    /// The graph before any test: what the assumptions allow, and the causes that are remembered.
    pub(super) fn initialise(&mut self, remembered: &[(Node, Node)]) {
        let (n_vars, tau_max) = (self.graph.n_vars, self.graph.tau_max);
        self.graph = Graph::new(n_vars, tau_max);
        self.known = Knowledge::new(&self.graph);
        let untested = Evidence { p_value: f64::NEG_INFINITY, value: f64::INFINITY, ..Evidence::default() };
        self.evidence = vec![untested; self.graph.n_places()];
        self.votes.clear();
        for effect in 0..n_vars {
            let y = Node::new(effect, 0);
            for x in self.graph.nodes().filter(|x| *x != y) {
                match self.assumptions.get(x.var, effect, x.lag) {
                    Some(assumption) if x.lag > 0 || x.var < effect => self.assume(x, y, assumption),
                    None => {
                        if let Some(place) = self.graph.place(x, y) {
                            self.evidence[place].value = 0.0;
                        }
                    }
                    _ => {}
                }
            }
        }
        remembered.iter().for_each(|&(cause, effect)| self.learn(cause, effect, true));
    }

    fn assumption(&self, pair: Pair) -> Option<Assumption> {
        self.assumptions.get(pair.x.var, pair.y.var, pair.x.lag)
    }

    /// Whether a link is known to exist, so that it is not tested.
    pub(super) fn is_certain(&self, pair: Pair) -> bool {
        self.assumption(pair).is_some_and(Assumption::exists)
    }

    /// Puts a link back to what is assumed of it.
    pub(super) fn assume_again(&mut self, pair: Pair) {
        if let Some(assumption) = self.assumption(pair) {
            self.assume(pair.x, pair.y, assumption);
        }
    }

    fn assume(&mut self, x: Node, y: Node, assumption: Assumption) {
        let Some((left, right)) = assumption.mark().ends() else { return };
        let middle = match assumption {
            certain if certain.exists() => Middle::Final,
            _ if x.lag > 0 && self.settings.max_cond_px == 0 => Middle::Left,
            _ => Middle::Unknown,
        };
        self.graph.put(x, y, Some(Link { left, middle, right }));
    }

    /// Puts in what is certain: `a` causes `b`, or does not.
    fn learn(&mut self, a: Node, b: Node, causes: bool) {
        let known = if causes { Known::Ancestor } else { Known::NonAncestor };
        self.known.set(&self.graph, a, b, known);
        self.mark_end(a, b, if causes { LinkEnd::Tail } else { LinkEnd::Head });
        if causes && a.lag == b.lag {
            self.learn(b, a, false);
        }
    }

    /// Puts `end` at `a` on the link between `a` and `b`; whether there is such a link and it changed.
    pub(super) fn mark_end(&mut self, a: Node, b: Node, end: LinkEnd) -> bool {
        let Some(link) = self.graph.get(a, b).filter(|link| link.left != end) else { return false };
        self.graph.put(a, b, Some(Link { left: end, ..link }));
        true
    }

    /// Known causes whose link still exists.
    pub(super) fn causes_with_link(&self) -> Vec<(Node, Node)> {
        let effects = (0..self.graph.n_vars).map(|var| Node::new(var, 0));
        let pairs = effects.flat_map(|y| self.graph.nodes().map(move |x| (x, y)));
        let is_cause = |&(x, y): &(Node, Node)| x != y && self.is_ancestor(x, y) && self.graph.adjacent(x, y);
        pairs.filter(is_cause).collect()
    }

    pub(super) fn is_ancestor(&self, a: Node, b: Node) -> bool {
        self.known.get(&self.graph, a, b) == Known::Ancestor
    }

    pub(super) fn is_no_ancestor(&self, a: Node, b: Node) -> bool {
        self.known.get(&self.graph, a, b) == Known::NonAncestor
    }

    pub(super) fn evidence(&self, pair: Pair) -> Option<&Evidence> {
        self.graph.place(pair.x, pair.y).map(|place| &self.evidence[place])
    }

    /// How strongly two nodes depend, as far as tests said: `|value|` of the largest p-value.
    pub(super) fn strength(&self, a: Node, b: Node) -> f64 {
        self.evidence(Pair::of(a, b).0).map_or(0.0, |evidence| evidence.value.abs())
    }

    pub(super) fn add_separating(&mut self, pair: Pair, nodes: Vec<Node>, minimal: bool) {
        let Some(place) = self.graph.place(pair.x, pair.y) else { return };
        let separating = &mut self.evidence[place].separating;
        if !separating.iter().any(|set| set.nodes == nodes && set.minimal == minimal) {
            separating.push(Separating { nodes, minimal });
        }
    }

    pub(super) fn set_separating(&mut self, pair: Pair, sets: Vec<Separating>) {
        if let Some(place) = self.graph.place(pair.x, pair.y) {
            self.evidence[place].separating = sets;
        }
    }

    pub(super) fn remove(&mut self, pair: Pair) {
        self.graph.put(pair.x, pair.y, None);
        self.votes.clear();
    }

    /// Tests a pair given `z`, which is sorted and holds neither of them: the value if they are independent.
    pub(super) fn separates(&mut self, pair: Pair, z: &[Node]) -> Result<Option<f64>> {
        self.n_asked += 1;
        let known = if self.as_fci { None } else { self.answers.get(&self.graph, pair, z) };
        let answer = match known {
            Some(answer) => answer,
            None => {
                let result = self.run.test(pair.x, pair.y, z)?;
                let (result, dependent) = self.run.decide(result, self.settings.pc_alpha);
                let answer = Answer {
                    value: result.value,
                    p_value: result.p_value,
                    samples: Some(result.samples()),
                    dependent,
                };
                if !self.as_fci {
                    self.answers.keep(answer);
                }
                answer
            }
        };
        // What is known to be absent keeps the value 0, though votes ask about it.
        let place = self.graph.place(pair.x, pair.y).filter(|_| self.assumption(pair).is_some());
        if let Some(place) = place {
            let evidence = &mut self.evidence[place];
            if answer.p_value > evidence.p_value {
                evidence.p_value = answer.p_value;
                evidence.value = answer.value;
                evidence.samples = answer.samples;
            }
        }
        Ok((!answer.dependent).then_some(answer.value))
    }

    /// Every head says that its end does not cause the other one, which the middle marks then know, too.
    pub(super) fn update_middles(&mut self) {
        for (pair, link) in self.graph.pairs() {
            let mut middle = link.middle;
            if link.right == LinkEnd::Head {
                middle = middle.with(Middle::Left);
            }
            if link.left == LinkEnd::Head {
                middle = middle.with(Middle::Right);
            }
            self.graph.put_middle(pair, middle);
        }
    }

    /// Gives every link that is not final this middle mark.
    pub(super) fn set_middles(&mut self, middle: Middle) {
        for (pair, link) in self.graph.pairs() {
            if !link.is_final() {
                self.graph.put_middle(pair, middle);
            }
        }
        self.votes.clear();
    }
}
