//! J-PCMCI+: PCMCI+ on several recordings that may differ.
//!
//! Source: Günther, Ninad and Runge 2023, UAI, "Causal discovery for time series from multiple datasets with latent contexts".
//!
//! 1. PC1 finds the lagged parents of system variables and time contexts.
//! 2. Which contexts drive which system variables: the skeleton of PCMCI+ on links from contexts.
//! 3. Which system variables differ between recordings (or steps) for reasons that were not recorded: the same on links from
//!    dummies.
//! 4. The skeleton of the system, given contexts and dummies.
//! 5. Colliders and rules as in PCMCI+; what comes from a context helps to orient.
//!
//! Example: two people walk at different speeds and keep different distances. Pooled, speed and distance are correlated. Given
//! who walks they are not.

use super::{
    mci::{correct, first, mci_conditions},
    pc_stable::PcStable,
    pcmci::nodes_of,
    pcmciplus::{Level, PcmciPlusSettings},
    result::{PcmciResult, Status, TargetParents},
    run::Run,
    settings::PcmciSettings,
    skeleton::{Conditions, Skeleton},
};
use crate::{
    numeric::rows::is_constant_column,
    types::{
        Assumption, CondIndTest, Control, DataFrame, Dummy, Error, LinkAssumptions, LinkMark, Node, Result,
        Samples, add_new, same_value,
    },
};

/// What a variable is, seen over several recordings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NodeClass {
    /// A variable whose causes are looked for.
    #[default]
    System,
    /// Constant in each recording, such as a person's age: it drives the system at lag 0.
    SpaceContext,
    /// The same in all recordings at each step, such as the time of day: it drives the system at any lag.
    TimeContext,
}

with_defaults! {
    /// Settings of [`run_jpcmciplus`].
    #[derive(Clone, Debug)]
    pub struct JpcmciPlusSettings {
        /// Lags, one level `pc_alpha`, limits, link assumptions. `tau_min` is 0.
        pub pcmci: PcmciSettings = PcmciSettings { tau_min: 0, pc_alpha: vec![0.01], ..PcmciSettings::default() },
        /// How links at lag 0 are oriented.
        pub plus: PcmciPlusSettings = PcmciPlusSettings::default(),
        /// What each variable of the data is; empty: all are of the system.
        pub classes: Vec<NodeClass> = Vec::new(),
        /// Dummies, in the order of their nodes, which come after the variables of the data. Default: which recording.
        pub dummies: Vec<Dummy> = vec![Dummy::Space],
    }
}

/// What J-PCMCI+ finds. Matrices and lists are by node: the variables of the data, then the dummies.
#[derive(Clone, Debug)]
pub struct JpcmciPlusResult {
    /// Graph and values. Values of contexts and dummies are those of the search for them.
    pub result: PcmciResult,
    /// Lagged parents of the system among itself, strongest first.
    pub lagged_parents: Vec<Vec<Node>>,
    /// Contexts that drive each variable: those of space, then those of time.
    pub context_parents: Vec<Vec<Node>>,
    /// Dummies on which each variable depends.
    pub dummy_parents: Vec<Vec<Node>>,
}

/// J-PCMCI+: lagged and contemporaneous links of one system from several recordings, and what makes the recordings differ.
///
/// Take it when several people, robots or days are pooled. A dummy says which recording a sample is from, so that a difference
/// that nobody recorded makes no link. It tests with `parcorr`; without dummies, any test will do.
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, independence_tests::{ParCorr, TestSettings}};
/// use roscausal_discovery::methods::{JpcmciPlusSettings, run_jpcmciplus};
///
/// // Two recordings of independent noise; the second is higher in both variables.
/// let noise = |i: usize| 4.0 * (roscausal_discovery::mix(i as u64) as f64 / u64::MAX as f64 - 0.5);
/// let recording =
///     |k: usize| ndarray::Array2::from_shape_fn((150, 2), |(t, v)| noise(999 * k + 2 * t + v) + 2.0 * k as f64);
/// let data = DataFrame::new(vec![recording(0), recording(1)], vec!["a".into(), "b".into()])?;
/// let test = ParCorr::new(&TestSettings::default())?;
/// let found = run_jpcmciplus(&data, &test, &JpcmciPlusSettings::default(), &Control::default())?;
/// assert!(!found.result.graph[[0, 1, 0]].is_link());
/// // Node 2 is the dummy: what the recordings differ in.
/// assert!(found.dummy_parents.iter().any(|list| !list.is_empty()));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// As [`run_pcmciplus`](super::run_pcmciplus); several levels, `tau_min` above 0, a context that is none, a dummy that the test
/// or the data do not allow.
pub fn run_jpcmciplus(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &JpcmciPlusSettings,
    control: &Control,
) -> Result<JpcmciPlusResult> {
    let classes = check(data, test, settings)?;
    let own_test =
        if settings.dummies.is_empty() { None } else { Some(test.with_dummies(&settings.dummies)?) };
    let test = own_test.as_deref().unwrap_or(test);
    let samples = Samples::new(data, settings.pcmci.cut_off()).with_control(control.clone());
    let run = Run::new(test, &samples)?.with_dummies(settings.dummies.len());
    let nodes = Nodes { classes: &classes, n_data: data.n_vars() };
    let possible = nodes.possible(&settings.pcmci.links(data.n_vars()), run.n_vars())?;
    let search = Search { run: &run, settings, nodes, possible };
    let blank = PcmciResult::untested(run.n_vars(), settings.pcmci.tau_max, samples.len());
    let nothing = || vec![Vec::new(); run.n_vars()];
    let mut found = JpcmciPlusResult {
        result: blank,
        lagged_parents: nothing(),
        context_parents: nothing(),
        dummy_parents: nothing(),
    };
    if search.run(&mut found)? {
        found.result.graph.fill(LinkMark::Absent);
        let (done, n) = (run.n_tests(), control.estimated_total());
        let how_far = format!("the time budget ended the run after {done} of about {n} tests");
        found.result.status = Status::Partial(how_far);
    }
    found.result.remarks = remarks(data, &classes);
    found.result.effort = run.effort();
    found.result.n_tests = run.n_tests();
    Ok(found)
}

/// Recordings up to which a context of space has too few values to tell much.
const FEW_RECORDINGS: usize = 5;

/// What the reader should know of contexts that have few values.
fn remarks(data: &DataFrame, classes: &[NodeClass]) -> Vec<String> {
    let n = data.recordings().len();
    let is_space = |var: &usize| classes[*var] == NodeClass::SpaceContext && n <= FEW_RECORDINGS;
    let remark = |var: usize| {
        let name = &data.var_names()[var];
        format!(
            "'{name}' has one value in each of {n} recordings, so links from it are weak evidence; record more of them"
        )
    };
    (0..data.n_vars()).filter(is_space).map(remark).collect()
}

/// Checks settings and data. Returns the classes of all variables.
fn check(data: &DataFrame, test: &dyn CondIndTest, settings: &JpcmciPlusSettings) -> Result<Vec<NodeClass>> {
    let fail = |name: &str, reason: String| Err(Error::param(name, reason));
    settings.pcmci.check(data, test)?;
    let reason = "jpcmciplus takes one level; give one, such as 0.01";
    Error::ensure(settings.pcmci.pc_alpha.len() == 1, "pc_alpha", || reason)?;
    let lag = settings.pcmci.tau_min;
    Error::ensure(lag == 0, "tau_min", || format!("{lag}: contexts act at lag 0; give 0"))?;
    let mut classes = settings.classes.clone();
    if classes.is_empty() {
        classes = vec![NodeClass::System; data.n_vars()];
    }
    let (given, n) = (classes.len(), data.n_vars());
    Error::ensure(given == n, "classes", || format!("{given} classes for {n} variables; give one for each"))?;
    for (var, class) in classes.iter().enumerate() {
        let name = &data.var_names()[var];
        if *class == NodeClass::SpaceContext
            && let Some(recording) = data.recordings().iter().position(|r| !is_constant_column(r.column(var)))
        {
            let reason =
                format!("'{name}' varies within recording {recording}; a context of space is constant there");
            return fail("contexts", reason);
        }
        if *class == NodeClass::TimeContext && !is_shared(data, var) {
            let reason = format!(
                "'{name}' is not the same in all recordings at each step; a context of time needs recordings of equal length on \
                 one clock"
            );
            return fail("contexts", reason);
        }
    }
    Ok(classes)
}

/// Whether a column is the same in all recordings.
pub(crate) fn is_shared(data: &DataFrame, var: usize) -> bool {
    let first = data.recordings()[0].column(var);
    data.recordings().iter().all(|recording| {
        let column = recording.column(var);
        column.len() == first.len() && column.iter().zip(first).all(same_value)
    })
}

/// What the nodes of a run are.
struct Nodes<'a> {
    classes: &'a [NodeClass],
    /// Variables of the data; the dummies follow.
    n_data: usize,
}

impl Nodes<'_> {
    fn is_system(&self, var: usize) -> bool {
        self.classes.get(var) == Some(&NodeClass::System)
    }

    fn is_dummy(&self, var: usize) -> bool {
        var >= self.n_data
    }

    fn is_context(&self, var: usize) -> bool {
        !self.is_system(var) && !self.is_dummy(var)
    }

    /// The links that may exist: those `given` among the variables that suit their classes, and dummies to the system.
    fn possible(&self, given: &LinkAssumptions, n_vars: usize) -> Result<LinkAssumptions> {
        let mut links = LinkAssumptions::none(n_vars);
        for effect in 0..self.n_data {
            for (cause, assumption) in given.of_target(effect) {
                let fits = match (self.classes[cause.var], self.classes[effect]) {
                    (NodeClass::System, NodeClass::System) => cause.lag > 0 || cause.var < effect,
                    (NodeClass::SpaceContext, NodeClass::System) => cause.lag == 0,
                    (NodeClass::TimeContext, NodeClass::System) => true,
                    (NodeClass::TimeContext, NodeClass::TimeContext) => cause.var == effect,
                    _ => false,
                };
                let directed = match assumption {
                    Assumption::TestUnoriented => Some(Assumption::Test),
                    Assumption::ExistsUnoriented => Some(Assumption::Exists),
                    Assumption::Test | Assumption::Exists => Some(assumption),
                    _ => None,
                };
                let free = self.is_system(cause.var).then_some(assumption);
                if let Some(assumption) = free.or(directed).filter(|_| fits) {
                    links.insert(cause.var, effect, cause.lag, assumption)?;
                }
            }
            for dummy in (self.n_data..n_vars).filter(|_| self.is_system(effect)) {
                links.insert(dummy, effect, 0, Assumption::Test)?;
            }
        }
        Ok(links)
    }
}

/// The run of all steps.
struct Search<'a, 'b> {
    run: &'a Run<'b>,
    settings: &'a JpcmciPlusSettings,
    nodes: Nodes<'a>,
    possible: LinkAssumptions,
}

impl Search<'_, '_> {
    /// Returns whether the time budget ended it.
    fn run(&self, found: &mut JpcmciPlusResult) -> Result<bool> {
        let levels = &self.settings.pcmci.pc_alpha;
        let of_contexts = self.links(|cause, _| (!self.nodes.is_dummy(cause.var)).then_some(false))?;
        let pc = PcStable { pc_alphas: levels, ..self.settings.pcmci.pc_stable(&of_contexts, levels) };
        let (mut parents, out_of_time) = pc.run(self.run)?;
        found.result.parents = parents.clone();
        let mut latest = found.result.clone();
        if out_of_time || self.contexts(&of_contexts, &parents, found, &mut latest)? {
            return Ok(true);
        }
        // Contexts of time are parents of their own kind from here on.
        for target in &mut parents {
            target.parents.retain(|node| self.nodes.is_system(node.var));
        }
        for var in (0..self.run.n_vars()).filter(|&var| !self.nodes.is_system(var)) {
            parents[var].parents.clear();
        }
        found.lagged_parents = nodes_of(&parents);
        found.result.parents = parents.clone();
        if !self.settings.dummies.is_empty() && self.dummies(&parents, found, &mut latest)? {
            return Ok(true);
        }
        self.system(&parents, found, &latest)
    }

    /// The possible links for which `keep(cause, effect)` is some; where it is true they are certain.
    fn links(&self, keep: impl Fn(Node, usize) -> Option<bool>) -> Result<LinkAssumptions> {
        let mut links = LinkAssumptions::none(self.run.n_vars());
        for effect in 0..self.run.n_vars() {
            for (cause, assumption) in self.possible.of_target(effect) {
                // A pair at lag 0 is listed from both ends: taken once, from its cause.
                let from_cause = cause.lag > 0
                    || !self.nodes.is_system(cause.var)
                    || (self.nodes.is_system(effect) && cause.var < effect);
                if let Some(certain) = keep(cause, effect).filter(|_| from_cause) {
                    let assumption = if certain { Assumption::Exists } else { assumption };
                    links.insert(cause.var, effect, cause.lag, assumption)?;
                }
            }
        }
        Ok(links)
    }

    fn level<'a>(&'a self, links: &'a LinkAssumptions) -> Level<'a, 'a> {
        let s = self.settings;
        Level { run: self.run, settings: &s.pcmci, plus: &s.plus, links, pc_alpha: s.pcmci.pc_alpha[0] }
    }

    fn skeleton<'a>(
        &'a self,
        links: &'a LinkAssumptions,
        conditions: &'a Conditions<'a>,
        sources: Option<&'a [bool]>,
    ) -> Skeleton<'a, 'a> {
        let s = &self.settings.pcmci;
        Skeleton {
            run: self.run,
            links,
            level: s.pc_alpha[0],
            max_conds_dim: s.max_conds_dim,
            conditions,
            sources,
            all_lags: false,
            sepsets: Default::default(),
        }
    }

    fn blank(&self) -> PcmciResult {
        let s = &self.settings.pcmci;
        PcmciResult::untested(self.run.n_vars(), s.tau_max, self.run.samples.len())
    }

    /// Step 2: the contexts of each variable.
    fn contexts(
        &self,
        links: &LinkAssumptions,
        parents: &[TargetParents],
        found: &mut JpcmciPlusResult,
        latest: &mut PcmciResult,
    ) -> Result<bool> {
        let sources: Vec<bool> = (0..self.run.n_vars()).map(|var| self.nodes.is_context(var)).collect();
        let level = self.level(links);
        let mut result = self.blank();
        level.start(&mut result, parents);
        let of_all = nodes_of(parents);
        let conditions =
            |x: Node, j: usize, contemporaneous: &[Node]| level.conditions(&of_all, x, j, contemporaneous);
        if self.skeleton(links, &conditions, Some(&sources)).find(&mut result)? {
            return Ok(true);
        }
        for (effect, contexts) in found.context_parents.iter_mut().enumerate() {
            *contexts = self.parents_among(&result, effect, |var| self.nodes.is_context(var));
            contexts.sort_by_key(|node| self.nodes.classes[node.var] == NodeClass::TimeContext);
        }
        copy_values(&result, latest, |i, j| !self.nodes.is_system(i) || !self.nodes.is_system(j));
        Ok(false)
    }

    /// Step 3: the dummies of each variable.
    fn dummies(
        &self,
        parents: &[TargetParents],
        found: &mut JpcmciPlusResult,
        latest: &mut PcmciResult,
    ) -> Result<bool> {
        let links = self.links(|cause, effect| {
            let known = self.nodes.is_system(effect) && found.context_parents[effect].contains(&cause);
            if self.nodes.is_context(cause.var) { known.then_some(true) } else { Some(false) }
        })?;
        let sources: Vec<bool> = (0..self.run.n_vars()).map(|var| self.nodes.is_dummy(var)).collect();
        let mut result = self.blank();
        self.level(&links).start(&mut result, parents);
        let limit = self.settings.pcmci.max_conds_py;
        let known: Vec<Vec<Node>> = (0..self.run.n_vars())
            .map(|j| found.context_parents[j].iter().chain(&found.lagged_parents[j]).copied().collect())
            .collect();
        let conditions = |x: Node, j: usize, contemporaneous: &[Node]| {
            let mut z = contemporaneous.to_vec();
            add(&mut z, x, &found.context_parents[j]);
            add(&mut z, x, first(&known[j], limit));
            z
        };
        if self.skeleton(&links, &conditions, Some(&sources)).find(&mut result)? {
            return Ok(true);
        }
        for (effect, dummies) in found.dummy_parents.iter_mut().enumerate() {
            *dummies = self.parents_among(&result, effect, |var| self.nodes.is_dummy(var));
        }
        copy_values(&result, latest, |i, j| self.nodes.is_dummy(i) || self.nodes.is_dummy(j));
        // A context's own past counts as known from here on, and has the value 0, as in the reference.
        for (var, contexts) in found.context_parents.iter().enumerate() {
            for node in contexts.iter().filter(|node| node.var == var) {
                latest.val_matrix[[var, var, node.lag]] = 0.0;
                latest.p_matrix[[var, var, node.lag]] = 0.0;
            }
        }
        Ok(false)
    }

    /// Steps 4 and 5: the links of the system.
    fn system(
        &self,
        parents: &[TargetParents],
        found: &mut JpcmciPlusResult,
        latest: &PcmciResult,
    ) -> Result<bool> {
        let links = self.links(|cause, effect| {
            if self.nodes.is_system(cause.var) {
                return Some(false);
            }
            let of_effect = [&found.context_parents[effect], &found.dummy_parents[effect]];
            let certain = self.nodes.is_system(effect) && of_effect.iter().any(|list| list.contains(&cause));
            certain.then_some(true)
        })?;
        let s = &self.settings.pcmci;
        let all: Vec<Vec<Node>> = (0..self.run.n_vars())
            .map(|j| {
                let lists = [&found.lagged_parents[j], &found.context_parents[j], &found.dummy_parents[j]];
                lists.into_iter().flatten().copied().collect()
            })
            .collect();
        let conditions = |x: Node, j: usize, contemporaneous: &[Node]| {
            let mut z = contemporaneous.to_vec();
            add(&mut z, x, &found.dummy_parents[j]);
            add(&mut z, x, &found.context_parents[j]);
            add(&mut z, x, first(&all[j], s.max_conds_py));
            let limit = if x.lag > 0 { s.max_conds_px_lagged.or(s.max_conds_px) } else { s.max_conds_px };
            mci_conditions(x, &[], first(&all[x.var], limit), &mut z);
            z
        };
        let level = self.level(&links);
        let mut result = self.blank();
        level.start(&mut result, parents);
        result.parents = parents.to_vec();
        let mut skeleton = self.skeleton(&links, &conditions, None);
        if skeleton.find(&mut result)? || level.orient(&mut skeleton, &mut result)? {
            return Ok(true);
        }
        copy_values(latest, &mut result, |i, j| !self.nodes.is_system(i) || !self.nodes.is_system(j));
        correct(&mut result, s.fdr, &self.possible, s.pc_alpha[0]);
        found.result = result;
        Ok(false)
    }

    /// The causes of `effect` in a result that pass `is_meant`, by variable and then lag.
    fn parents_among(
        &self,
        result: &PcmciResult,
        effect: usize,
        is_meant: impl Fn(usize) -> bool,
    ) -> Vec<Node> {
        let n_lags = result.graph.dim().2;
        let nodes = (0..self.run.n_vars()).flat_map(|var| (0..n_lags).map(move |lag| Node::new(var, lag)));
        let points = |node: &Node| result.graph[[node.var, effect, node.lag]] == LinkMark::Forward;
        nodes.filter(|node| is_meant(node.var) && points(node)).collect()
    }
}

/// Adds what is neither `x` nor there yet.
fn add(z: &mut Vec<Node>, x: Node, nodes: &[Node]) {
    nodes.iter().filter(|node| **node != x).for_each(|&node| add_new(z, node));
}

/// Copies values and p-values of the pairs that are meant.
fn copy_values(from: &PcmciResult, to: &mut PcmciResult, is_meant: impl Fn(usize, usize) -> bool) {
    for ((i, j, lag), &p) in from.p_matrix.indexed_iter() {
        if is_meant(i, j) {
            let at = [i, j, lag];
            to.put(at, from.val_matrix[at], p, from.samples[at]);
        }
    }
}
