//! tsFCI: FCI on a window of a time series.
//!
//! Sources: Entner and Hoyer 2010, PGM, "On causal discovery from time series data using FCI"; the rules of Zhang 2008; that links
//! of one size go together, so that which links stay does not depend on the order of the columns, Colombo and Maathuis 2014.
//!
//! Two things are known beforehand: what is later does not cause what is earlier, and a link is the same at all times, so what is
//! found of a pair at the end of the window holds for the pair anywhere in it.
//!
//! 1. Each pair is tested given sets of neighbours of one of its ends, of growing size. What separates it is kept.
//! 2. Colliders are marked in unshielded triples. They show where paths through hidden causes may
//!    run: from such a path's nodes (possible d-separation) further sets are taken, and each pair that is left is tested given
//!    these.
//! 3. All marks but those of time are forgotten. Colliders are marked again, then the rules run until nothing changes.
//!
//! Example: hidden `h` drives `x` and `y`. LPCMCI and tsFCI draw the same `<->` where a test knows the truth; on data tsFCI misses
//! more, because it never conditions on the past that it knows to be causes. An end may stay open that LPCMCI tells: what LPCMCI
//! learns while there are more links stays known.

use super::{
    LpcmciSettings,
    graph::{Middle, Pair},
    knowledge::Knowledge,
    result_of,
    rules::{Rules, apply_rules},
    search::Search,
    sets::Conditions,
};
use crate::{
    methods::{result::PcmciResult, run::Run},
    types::{CondIndTest, Control, DataFrame, LinkEnd, Node, Result, Samples, unique},
};

/// tsFCI: what causes what, where common causes may be hidden, by FCI on all variables at all lags of a window.
///
/// Take it to compare with; [`run_lpcmci`](super::run_lpcmci) answers the same question, with the same marks, and finds far more
/// links where variables depend on their own past. A link's p-value is the largest of its tests.
///
/// Of the settings it reads the lags (`tau_max` is the length of the window; 0 makes it FCI), `pc_alpha`, `link_assumptions` and
/// `max_p_global`, the largest number of conditions; `None`: no limit, and a number of tests that doubles with each node of the window.
///
/// ```
/// use roscausal_discovery::{Assumption, Control, DataFrame, LinkAssumptions, LinkMark, independence_tests::OracleCi};
/// use roscausal_discovery::methods::{LpcmciSettings, run_tsfci};
///
/// // Both 0 and 1 drive 2, which drives 3: that 2 causes 3 follows from 0 and 1.
/// let mut truth = LinkAssumptions::none(4);
/// for (cause, effect) in [(0, 2), (1, 2), (2, 3)] {
///     truth.insert(cause, effect, 0, Assumption::Exists)?;
/// }
/// let data = DataFrame::new(vec![ndarray::Array2::zeros((50, 4))], ["a", "b", "c", "d"].map(String::from).to_vec())?;
/// let settings = LpcmciSettings { tau_max: 0, ..LpcmciSettings::default() };
/// let found = run_tsfci(&data, &OracleCi::new(&truth)?, &settings, &Control::default())?;
/// assert_eq!(found.graph[[2, 3, 0]], LinkMark::Forward);
/// assert_eq!(found.graph[[0, 2, 0]], LinkMark::CircleHead);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Settings or data that do not match, a test that fails, or cancellation. Running out of time is not an error: the status says
/// in which phase, and the graph is what is left so far.
pub fn run_tsfci(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &LpcmciSettings,
    control: &Control,
) -> Result<PcmciResult> {
    settings.check(data, test)?;
    let samples = Samples::new(data, 2 * settings.tau_max).with_control(control.clone());
    let run = Run::new(test, &samples)?;
    let mut search = Search::new(&run, settings).like_fci();
    let ended = all_phases(&mut search);
    result_of(&search, &run, ended, &format!("phase of {}", search.phase))
}

fn all_phases(search: &mut Search<'_, '_>) -> Result<()> {
    search.phase = "neighbours".to_owned();
    search.set_middles(Middle::Final);
    search.given_neighbours()?;
    search.phase = "possible d-separation".to_owned();
    apply_rules(search, Rules::Colliders, false)?;
    search.given_possible_d_separation()?;
    search.phase = "orientation".to_owned();
    search.forget_orientations();
    apply_rules(search, Rules::Colliders, false)?;
    apply_rules(search, Rules::Long, false)?;
    Ok(())
}

impl Search<'_, '_> {
    /// Tests every pair given sets of neighbours. Neighbours are those at the start of a size; what it removes goes after it.
    fn given_neighbours(&mut self) -> Result<()> {
        let mut size = 0;
        loop {
            let pairs = self.open_pairs();
            let of = |pair: &Pair| [pair.y, pair.x].map(|end| self.neighbours_but(end, *pair)).to_vec();
            let choices: Vec<Vec<Vec<Node>>> = pairs.iter().map(of).collect();
            if !self.tests_of_size(&pairs, &choices, size)? {
                return Ok(());
            }
            size += 1;
        }
    }

    /// Tests every pair that is left given sets of nodes to which a path may run that hidden causes open. Those of an end that does
    /// not cause the other one are enough, which the later end never does.
    fn given_possible_d_separation(&mut self) -> Result<()> {
        let mut pairs = self.open_pairs();
        let ends = |pair: &Pair| if pair.x.lag == 0 { vec![pair.y, pair.x] } else { vec![pair.y] };
        let of =
            |pair: &Pair| ends(pair).into_iter().map(|end| self.possible_d_separation(end, *pair)).collect();
        let mut choices: Vec<Vec<Vec<Node>>> = pairs.iter().map(of).collect();
        let mut size = 0;
        while self.tests_of_size(&pairs, &choices, size)? {
            size += 1;
            let stays: Vec<bool> = pairs.iter().map(|pair| self.graph.adjacent(pair.x, pair.y)).collect();
            let mut kept = stays.iter();
            pairs.retain(|_| kept.next() == Some(&true));
            let mut kept = stays.iter();
            choices.retain(|_| kept.next() == Some(&true));
        }
        Ok(())
    }

    /// Tests pairs given `size` of the choices of an end; whether any end had so many.
    fn tests_of_size(&mut self, pairs: &[Pair], choices: &[Vec<Vec<Node>>], size: usize) -> Result<bool> {
        if self.settings.max_p_global.is_some_and(|most| size > most) {
            return Ok(false);
        }
        let (mut asked, mut going) = (false, Vec::new());
        for (&pair, ends) in pairs.iter().zip(choices) {
            for of_end in ends.iter().filter(|of_end| of_end.len() >= size) {
                asked = true;
                let conditions = Conditions { always: Vec::new(), choices: of_end.clone() };
                if self.test_sets(pair, &conditions, size, None, None)? {
                    going.push(pair);
                    break;
                }
            }
        }
        going.into_iter().for_each(|pair| self.remove(pair));
        Ok(asked)
    }

    /// The pairs that are adjacent and not certain.
    fn open_pairs(&self) -> Vec<Pair> {
        let pairs = self.graph.pairs().into_iter().map(|(pair, _)| pair);
        pairs.filter(|&pair| !self.is_certain(pair)).collect()
    }

    fn neighbours_but(&self, end: Node, pair: Pair) -> Vec<Node> {
        let neighbours = self.graph.neighbours(end).map(|(node, _)| node);
        neighbours.filter(|node| *node != pair.x && *node != pair.y).collect()
    }

    /// Nodes that a path from `end` reaches on which each inner node is a collider, or adjacent to both that it is between.
    fn possible_d_separation(&self, end: Node, pair: Pair) -> Vec<Node> {
        let mut open: Vec<(Node, Node)> = self.graph.neighbours(end).map(|(node, _)| (end, node)).collect();
        let mut visited = open.clone();
        let n_nodes = self.graph.n_nodes();
        let mut seen = vec![false; n_nodes * n_nodes];
        let step_at = |from: Node, to: Node| self.graph.index(from) * n_nodes + self.graph.index(to);
        open.iter().for_each(|&(from, to)| seen[step_at(from, to)] = true);
        while let Some((v, w)) = open.pop() {
            let into = self.graph.get(v, w).is_some_and(|link| link.right == LinkEnd::Head);
            for (u, link) in self.graph.neighbours(w).filter(|(u, _)| *u != v && *u != end) {
                let collider = into && link.right == LinkEnd::Head;
                if (collider || self.graph.adjacent(u, v))
                    && !std::mem::replace(&mut seen[step_at(w, u)], true)
                {
                    visited.push((w, u));
                    open.push((w, u));
                }
            }
        }
        let mut found: Vec<Node> = visited.into_iter().map(|(_, node)| node).collect();
        found.retain(|node| *node != pair.x && *node != pair.y);
        unique(found)
    }

    /// Gives every link the marks that it had before any rule, and forgets what rules learnt.
    fn forget_orientations(&mut self) {
        self.known = Knowledge::new(&self.graph);
        self.graph.pairs().into_iter().for_each(|(pair, _)| self.assume_again(pair));
        self.set_middles(Middle::Final);
    }
}
