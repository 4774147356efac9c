//! PCMCI+: lagged and contemporaneous links.

use super::{
    extension::dag_parents,
    mci::{correct, first, mci_conditions},
    orientation::{Triple, orient_by_rules, orient_colliders, unshielded_triples},
    pc_stable::{PcStable, combinations},
    pcmci::{nodes_of, with_run},
    result::{PcmciResult, TargetParents},
    run::Run,
    settings::{PCMCIPLUS_ALPHAS, PcmciSettings},
    skeleton::Skeleton,
};
use crate::types::{CondIndTest, Control, DataFrame, LinkAssumptions, LinkMark, Node, Result};

/// How PCMCI+ tells a collider from a chain in an unshielded triple.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ColliderRule {
    /// By the fraction of separating sets that contain the middle: a collider below one half, ambiguous at one
    /// half.
    #[default]
    Majority,
    /// A collider if no separating set contains the middle, a non-collider if all do, otherwise ambiguous.
    Conservative,
    /// By the one separating set that removed the link.
    None,
}

words!(ColliderRule, "collider_rule": Majority "majority", Conservative "conservative", None "none");

with_defaults! {
    /// Settings that only PCMCI+ has.
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct PcmciPlusSettings {
        /// How colliders are found.
        pub contemp_collider_rule: ColliderRule = ColliderRule::Majority,
        /// Marks links of contradictory direction `x-x`; otherwise the first orientation stays. Default true.
        pub conflict_resolution: bool = true,
        /// Tests all lagged links again in the second phase, not only those that PC1 kept. Default false.
        pub reset_lagged_links: bool = false,
        /// The PC algorithm on time series: no PC1, no MCI; conditions are neighbours at all lags. Default false.
        pub pc_only: bool = false,
    }
}

/// PCMCI+: lagged and contemporaneous links, directed as far as the data allow.
///
/// 1. PC1 finds lagged conditions, as in [`run_pcmci`](super::run_pcmci).
/// 2. MCI tests with growing sets of neighbours at lag 0 as further conditions find the skeleton.
/// 3. Colliders orient links at lag 0, Meek's rules what follows from them. What stays open is marked `o-o`, what
///    contradicts itself `x-x`.
///
/// Take it when effects may follow within one step. Autocorrelation helps: a lagged link into one end of a pair at lag 0
/// often decides its direction.
///
/// Source: Runge 2020, UAI (PMLR 124), "Discovering contemporaneous and lagged causal relations in autocorrelated nonlinear
/// time series datasets".
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, LinkMark};
/// use roscausal_discovery::independence_tests::{ParCorr, TestSettings};
/// use roscausal_discovery::methods::{PcmciPlusSettings, PcmciSettings, run_pcmciplus};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let mut values = ndarray::Array2::zeros((300, 3));
/// # for t in 1..300 {
/// #     values[[t, 0]] = noise(2 * t);
/// #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
/// #     values[[t, 2]] = 0.7 * values[[t, 1]] + noise(1000 + 3 * t);
/// # }
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into(), "c".into()])?;
/// let test = ParCorr::new(&TestSettings::default())?;
/// // `a` drives `b` one step later, and `b` drives `c` within the step.
/// let settings = PcmciSettings { tau_min: 0, pc_alpha: vec![0.01], ..PcmciSettings::default() };
/// let plus = PcmciPlusSettings::default();
/// let result = run_pcmciplus(&data, &test, &settings, &plus, &Control::default())?;
/// assert_eq!(result.graph[[0, 1, 1]], LinkMark::Forward);
/// assert_eq!(result.graph[[1, 2, 0]], LinkMark::Forward);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// The significance level is `pc_alpha`; from several a score chooses one for all variables. `tau_min` is 0 or 1.
///
/// # Errors
/// As [`super::run_pcmci`].
pub fn run_pcmciplus(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &PcmciSettings,
    plus: &PcmciPlusSettings,
    control: &Control,
) -> Result<PcmciResult> {
    let levels = if settings.pc_alpha.is_empty() { &PCMCIPLUS_ALPHAS[..] } else { &settings.pc_alpha };
    with_run(data, test, settings, control, |run, links, result| {
        let mut best: Option<(f64, PcmciResult)> = None;
        for &pc_alpha in levels {
            let mut found = PcmciResult::untested(run.n_vars(), settings.tau_max, run.samples.len());
            let level = Level { run, settings, plus, links, pc_alpha };
            let out_of_time = level.run(&mut found)?;
            if out_of_time || levels.len() == 1 {
                *result = found;
                return Ok(out_of_time);
            }
            let score = level.score(&found)?;
            if best.as_ref().is_none_or(|(lowest, _)| score < *lowest) {
                found.optimal_alpha = Some(pc_alpha);
                best = Some((score, found));
            }
        }
        if let Some((_, found)) = best {
            *result = found;
        }
        Ok(false)
    })
}

/// PCMCI+ at one level.
pub(super) struct Level<'a, 'b> {
    pub(super) run: &'a Run<'b>,
    pub(super) settings: &'a PcmciSettings,
    pub(super) plus: &'a PcmciPlusSettings,
    pub(super) links: &'a LinkAssumptions,
    pub(super) pc_alpha: f64,
}

impl Level<'_, '_> {
    /// Returns whether the time budget ended the run; then there are values but no links.
    fn run(&self, result: &mut PcmciResult) -> Result<bool> {
        let levels = [self.pc_alpha];
        let pc = PcStable { pc_alphas: &levels, ..self.settings.pc_stable(self.links, &levels) };
        let (parents, out_of_time) = match self.plus.pc_only {
            true => (vec![TargetParents::default(); self.run.n_vars()], false),
            false => pc.run(self.run)?,
        };
        let conditions = nodes_of(&parents);
        self.start(result, &parents);
        result.parents = parents;
        if out_of_time {
            result.graph.fill(LinkMark::Absent);
            return Ok(true);
        }
        let mut skeleton = Skeleton {
            run: self.run,
            links: self.links,
            level: self.pc_alpha,
            max_conds_dim: self.settings.max_conds_dim,
            conditions: &|x, j, contemporaneous| self.conditions(&conditions, x, j, contemporaneous),
            sources: None,
            all_lags: self.plus.pc_only,
            sepsets: Default::default(),
        };
        if skeleton.find(result)? {
            result.graph.fill(LinkMark::Absent);
            return Ok(true);
        }
        if self.orient(&mut skeleton, result)? {
            return Ok(true);
        }
        correct(result, self.settings.fdr, self.links, self.pc_alpha);
        Ok(false)
    }

    /// Orients what the skeleton left. Returns whether the time budget ended it; then there are no links.
    pub(super) fn orient(&self, skeleton: &mut Skeleton<'_, '_>, result: &mut PcmciResult) -> Result<bool> {
        let (colliders, ambiguous) = match self.colliders(skeleton, result) {
            Err(error) if self.run.is_timeout(&error) => {
                result.graph.fill(LinkMark::Absent);
                return Ok(true);
            }
            found => found?,
        };
        result.sepsets = skeleton.listed();
        orient_colliders(&mut result.graph, &colliders, self.plus.conflict_resolution);
        orient_by_rules(&mut result.graph, &ambiguous, self.plus.conflict_resolution);
        result.ambiguous_triples = ambiguous.iter().map(|t| (t.i, t.k, t.j)).collect();
        Ok(false)
    }

    /// Marks, values and p-values before the second phase: those of PC1, and every link at lag 0.
    pub(super) fn start(&self, result: &mut PcmciResult, parents: &[TargetParents]) {
        for (target, found) in parents.iter().enumerate() {
            for candidate in &found.candidates {
                let at = [candidate.node.var, target, candidate.node.lag];
                result.put(at, candidate.value, candidate.pval_max, candidate.samples);
            }
            for (node, assumption) in self.links.of_target(target) {
                let at = [node.var, target, node.lag];
                let every = self.plus.reset_lagged_links || self.plus.pc_only;
                let certain = node.lag == 0 || assumption.exists() || every;
                let kept = certain || found.parents.contains(&node);
                if kept {
                    result.graph[at] = assumption.mark();
                }
                if assumption.exists() {
                    result.val_matrix[at] = 1.0;
                    result.p_matrix[at] = 0.0;
                } else if kept {
                    // A placeholder until the first test in this phase: any p-value replaces it. A link that PC1
                    // removed keeps the value of the test that removed it.
                    result.p_matrix[at] = -1.0;
                }
            }
        }
    }

    /// Neighbours of the effect, then the lagged parents of both ends.
    pub(super) fn conditions(
        &self,
        parents: &[Vec<Node>],
        x: Node,
        j: usize,
        contemporaneous: &[Node],
    ) -> Vec<Node> {
        let s = self.settings;
        let of_cause = if x.lag > 0 { s.max_conds_px_lagged.or(s.max_conds_px) } else { s.max_conds_px };
        let mut z = contemporaneous.to_vec();
        mci_conditions(x, first(&parents[j], s.max_conds_py), first(&parents[x.var], of_cause), &mut z);
        z
    }

    /// Sorts the unshielded triples into colliders and ambiguous ones.
    fn colliders(
        &self,
        skeleton: &mut Skeleton<'_, '_>,
        result: &PcmciResult,
    ) -> Result<(Vec<Triple>, Vec<Triple>)> {
        let triples = unshielded_triples(&result.graph);
        if self.plus.contemp_collider_rule == ColliderRule::None {
            let in_sepset = |t: &Triple| skeleton.sepset(t.i, t.j).contains(&Node::new(t.k, 0));
            return Ok((triples.into_iter().filter(|t| !in_sepset(t)).collect(), Vec::new()));
        }
        let asked: &Skeleton<'_, '_> = skeleton;
        let shares = self.run.map_tests(&triples, |triple| self.share_with_middle(asked, result, triple));
        let (mut colliders, mut ambiguous) = (Vec::new(), Vec::new());
        for (triple, share) in triples.into_iter().zip(shares) {
            let conservative = self.plus.contemp_collider_rule == ColliderRule::Conservative;
            match share? {
                Some((with, all)) if with == 0 || (!conservative && 2 * with < all) => {
                    skeleton.amend(&triple, false);
                    colliders.push(triple);
                }
                Some((with, all)) if with == all || (!conservative && 2 * with > all) => {
                    skeleton.amend(&triple, true);
                }
                _ => ambiguous.push(triple),
            }
        }
        Ok((colliders, ambiguous))
    }

    /// Of the sets of neighbours that separate the ends of a triple: how many contain its middle, and how many
    /// there are. `None` if there are none.
    fn share_with_middle(
        &self,
        skeleton: &Skeleton<'_, '_>,
        result: &PcmciResult,
        triple: &Triple,
    ) -> Result<Option<(usize, usize)>> {
        let mut neighbours = vec![skeleton.neighbours(result, triple.j)];
        if triple.i.lag == 0 {
            neighbours.push(skeleton.neighbours(result, triple.i.var));
        }
        let middle = Node::new(triple.k, 0);
        let ends = [triple.i, Node::new(triple.j, 0)];
        neighbours.iter_mut().for_each(|of| of.retain(|node| !ends.contains(node)));
        let (mut with, mut all) = (0, 0);
        for (k, of) in neighbours.iter().enumerate() {
            // What is a set of both ends' neighbours votes once.
            let has_voted = |set: &[Node]| {
                neighbours[..k].iter().any(|before| set.iter().all(|node| before.contains(node)))
            };
            // All sizes vote, whatever the limit of the skeleton: small sets alone seldom hold the middle.
            for size in 0..=of.len() {
                for set in combinations(of, size).filter(|set| !has_voted(set)) {
                    let z = (skeleton.conditions)(triple.i, triple.j, &set);
                    let outcome = self.run.test(triple.i, Node::new(triple.j, 0), &z)?;
                    if !self.run.decide(outcome, self.pc_alpha).1 {
                        all += 1;
                        with += usize::from(set.contains(&middle));
                    }
                }
            }
        }
        Ok((all > 0).then_some((with, all)))
    }

    /// Sum of the model-selection scores of all variables given their parents, in one DAG of the equivalence class.
    fn score(&self, result: &PcmciResult) -> Result<f64> {
        let parents = dag_parents(&result.graph, &result.val_matrix);
        parents.iter().enumerate().map(|(j, parents)| self.run.score(Node::new(j, 0), parents)).sum()
    }
}
