//! Whether the mechanisms of two groups of batches differ.

use super::{
    batch::{Batch, column, squares},
    curves,
    event::{Form, Kind},
    place::Place,
    terms::{Comparison, Difference, Mechanisms, NONE},
};
use crate::{
    analysis::analyse,
    methods::Method,
    numeric::slope::{Conditions, Slope, dot, slope},
    settings::Settings,
    types::{DataFrame, MaskType, Node, Result},
};

/// So many squares are conditions of an effect at most; each stands out so far, in standard deviations, and at this level.
const MOST_CURVED: usize = 2;
const CURVED_Z: f64 = 5.0;
const CURVED: f64 = 1e-6;

/// Level at which the batches behind the first one must show a change alone: that one may have old rows.
const ALONE: f64 = 0.01;

/// The batches before and those after, which are compared.
pub(super) type Groups<'a> = (&'a [&'a Batch], &'a [&'a Batch]);

impl Comparison<'_> {
    /// What drives each variable, over all these batches. A variable is left out that an intervention drives whose values differ
    /// between the groups.
    pub(super) fn mechanisms(&self, before: &[&Batch], after: &[&Batch]) -> Result<Mechanisms> {
        let parents = match self.form {
            Form::Slope => self.linear_parents(before, after)?,
            Form::Curve => curves::inputs(self, before, after),
        };
        let all: Vec<&Batch> = before.iter().chain(after).copied().collect();
        let curved = |(effect, parents): (usize, &Vec<Node>)| match self.form {
            Form::Slope if !self.exogenous.contains(&effect) => self.curved(&all, effect, parents),
            _ => Vec::new(),
        };
        let curved = parents.iter().enumerate().map(curved).collect();
        let one_sided: Vec<usize> =
            self.exogenous.iter().copied().filter(|&var| range(before, var) != range(after, var)).collect();
        // Where it is (nearly) constant within each batch, nothing says which mechanisms it touches.
        let seen = |var: &usize| before.iter().chain(after).any(|batch| batch.varies(*var, self.past()));
        // What is switched on in one group only may touch a mechanism in any form, also one that no slope shows.
        let switched = |var: &usize| [before, after].iter().any(|group| constant(range(group, *var)));
        let all = one_sided.iter().any(switched) || !one_sided.iter().all(seen);
        let touched = |of: &Vec<Node>| all || of.iter().any(|node| one_sided.contains(&node.var));
        let left_out = parents.iter().map(touched).collect();
        Ok(Mechanisms { parents, curved, left_out, incomparable: all })
    }

    /// The parents that PCMCI with ParCorr finds.
    fn linear_parents(&self, before: &[&Batch], after: &[&Batch]) -> Result<Vec<Vec<Node>>> {
        let recordings = before.iter().chain(after).map(|batch| batch.values.clone()).collect();
        let data = with_masks(DataFrame::new(recordings, self.names.to_vec())?, before, after)?;
        let settings = Settings {
            method: Method::Pcmci,
            cond_ind_test: "parcorr".into(),
            tau_min: 1,
            tau_max: self.tau_max,
            exogenous: self.exogenous.iter().map(|&var| self.names[var].clone()).collect(),
            ..Settings::default()
        };
        let model = analyse(&data, &settings, self.control)?;
        let place = |name: &str| self.names.iter().position(|known| known == name);
        let mut parents = vec![Vec::new(); self.names.len()];
        for link in &model.links {
            if let (Some(cause), Some(effect)) = (place(&link.cause), place(&link.effect)) {
                parents[effect].push(Node::new(cause, link.lag));
            }
        }
        Ok(parents)
    }

    /// The nodes whose squares drive an effect beyond its parents, strongest first.
    fn curved(&self, batches: &[&Batch], effect: usize, parents: &[Node]) -> Vec<Node> {
        let of = |node: Node| column(batches, node, self.past());
        let square = |node: Node| squares(batches, node, self.past());
        let y = of(Node::new(effect, 0));
        let nodes: Vec<Node> = (0..self.names.len())
            .flat_map(|var| (1..=self.tau_max).map(move |lag| Node::new(var, lag)))
            .collect();
        let (mut found, mut given): (Vec<Node>, Vec<Vec<f64>>) =
            (Vec::new(), parents.iter().map(|&node| of(node)).collect());
        while found.len() < MOST_CURVED {
            let refs: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
            let Some(left) = Conditions::new(&refs).map(|given| given.residuals(&y)) else { break };
            let stands_out = |node: &Node| {
                let squares = square(*node);
                let scale = (dot(&squares, &squares) * dot(&left, &left) / left.len() as f64).sqrt();
                dot(&squares, &left).abs() / scale
            };
            let new = nodes.iter().filter(|node| !found.contains(node)).map(|node| (*node, stands_out(node)));
            let best = new.filter(|(_, z)| *z >= CURVED_Z).max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((node, _)) = best else { break };
            let squares = square(node);
            if !parents.contains(&node) {
                given.push(of(node));
            }
            let refs: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
            if slope(&y, &squares, &refs, batches.len()).is_none_or(|slope| slope.p_value() > CURVED) {
                break;
            }
            found.push(node);
            given.push(squares);
        }
        found
    }

    /// The links that are compared: all of one variable to another at lags from 1 on. Of an effect with a curve only those of the causes that
    /// bend: the slopes of others take up what squares leave of the curve.
    fn places(&self, mechanisms: &Mechanisms) -> Vec<Place> {
        let n = self.names.len();
        let mut all = Vec::new();
        for effect in (0..n).filter(|&var| !mechanisms.left_out[var] && !self.exogenous.contains(&var)) {
            let curved = mechanisms.curved[effect].iter().map(|node| node.var).filter(|var| *var != effect);
            let curved: Vec<usize> = curved.collect();
            let is_compared =
                |cause: &usize| *cause != effect && (curved.is_empty() || curved.contains(cause));
            for cause in (0..n).filter(is_compared) {
                all.extend((1..=self.tau_max).map(|lag| Place { cause, effect, lag }));
            }
        }
        all
    }

    /// The slope of a link in a group of batches.
    pub(super) fn slope(&self, batches: &[&Batch], at: Place, mechanisms: &Mechanisms) -> Option<Slope> {
        let of = |node: Node| column(batches, node, self.past());
        let (y, x) = (of(Node::new(at.effect, 0)), of(Node::new(at.cause, at.lag)));
        let mut given: Vec<Vec<f64>> = mechanisms.given(at).into_iter().map(of).collect();
        given.extend(mechanisms.curved[at.effect].iter().map(|&node| squares(batches, node, self.past())));
        let given: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
        slope(&y, &x, &given, batches.len())
    }

    /// The slope of an effect on the square of a node.
    fn bend(&self, batches: &[&Batch], node: Node, effect: usize, mechanisms: &Mechanisms) -> Option<Slope> {
        let of = |node: Node| column(batches, node, self.past());
        let square = |node: Node| squares(batches, node, self.past());
        let others = mechanisms.parents[effect].iter().filter(|other| **other != node).chain([&node]);
        let curved = mechanisms.curved[effect].iter().filter(|other| **other != node);
        let given: Vec<Vec<f64>> =
            others.map(|&other| of(other)).chain(curved.map(|&other| square(other))).collect();
        let given: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
        slope(&of(Node::new(effect, 0)), &square(node), &given, batches.len())
    }

    fn slopes_differ(&self, (before, after): Groups<'_>, mechanisms: &Mechanisms) -> Result<Vec<Difference>> {
        let (mut found, groups) = (Vec::new(), [before, after]);
        for at in self.places(mechanisms) {
            self.control.check()?;
            if let [Some(before), Some(after)] = groups.map(|group| self.slope(group, at, mechanisms)) {
                let (kind, mut z) = (kind_of(before, after), before.z_of_same(after));
                // Where a cause bends, its slope depends on where its values lie; a change moves the bend, too.
                for node in mechanisms.curved[at.effect].iter().filter(|node| node.var == at.cause) {
                    let bends = groups.map(|group| self.bend(group, *node, at.effect, mechanisms));
                    if let [Some(before), Some(after)] = bends {
                        z = z.clamp(-before.z_of_same(after).abs(), before.z_of_same(after).abs());
                    }
                }
                found.push(Difference { at, before, after, kind, z, p: 1.0, q: 1.0 });
            }
        }
        Ok(found)
    }

    fn curves_differ(&self, groups: Groups<'_>, mechanisms: &Mechanisms) -> Result<Vec<Difference>> {
        let places = self.places(mechanisms);
        let mut found = Vec::new();
        for of_effect in places.chunk_by(|a, b| a.effect == b.effect) {
            self.control.check()?;
            found.extend(curves::differences_of(self, groups, of_effect, mechanisms)?);
        }
        Ok(found)
    }

    /// A difference with what the link was and is; of slopes it has that already.
    pub(super) fn described(
        &self,
        difference: Difference,
        groups: Groups<'_>,
        mechanisms: &Mechanisms,
    ) -> Difference {
        if self.form == Form::Slope {
            return difference;
        }
        match curves::describe(self, groups, difference.at, mechanisms) {
            Some((before, after, kind)) => Difference { before, after, kind, ..difference },
            None => difference,
        }
    }

    /// Compares all links of two groups.
    pub(super) fn differences(&self, groups: Groups<'_>, mechanisms: &Mechanisms) -> Result<Vec<Difference>> {
        let mut found = match self.form {
            Form::Slope => self.slopes_differ(groups, mechanisms)?,
            Form::Curve => self.curves_differ(groups, mechanisms)?,
        };
        found.iter_mut().for_each(|link| link.p = self.baseline.p_value(link.at, link.z));
        corrected(&mut found);
        Ok(found)
    }
}

/// What has changed between two groups.
pub(super) struct Changed {
    /// The links, and what each of them is now.
    pub(super) found: Vec<Difference>,
    /// The conditions, with these links.
    pub(super) mechanisms: Mechanisms,
    /// What the groups say of all links.
    pub(super) all: Vec<Difference>,
}

impl Comparison<'_> {
    /// The links that differ between the groups at `level`, alike behind the first batch alone, most certain first. A link joins the conditions of its effect once it is found, so that the next one is a change of its own. The first one
    /// must have been `suspected` in the same direction; `known` ones, and other lags of a pair, are not told again.
    pub(super) fn changed(
        &self,
        (before, after): Groups<'_>,
        mut mechanisms: Mechanisms,
        level: f64,
        known: &[Place],
        suspected: Option<&[Difference]>,
    ) -> Result<Changed> {
        let (mut found, mut all): (Vec<Difference>, Option<Vec<Difference>>) = (Vec::new(), None);
        let later = after.get(1..).filter(|later| !later.is_empty()).unwrap_or(after);
        known.iter().for_each(|at| mechanisms.add(*at));
        loop {
            let together = self.differences((before, after), &mechanisms)?;
            let alone = self.differences((before, later), &mechanisms)?;
            let is_told = |at: Place| {
                let told = known.iter().copied().chain(found.iter().map(|told| told.at));
                // One curve that changes may show in those of other causes.
                let is_same = |told: Place| told.cause == at.cause || self.form == Form::Curve;
                told.into_iter().any(|told| told.effect == at.effect && is_same(told))
            };
            let is_alike =
                |a: &Difference, b: &Difference| self.form == Form::Curve || a.rises() == b.rises();
            let is_suspected = |of: &Difference| match suspected {
                Some(all) if found.is_empty() => {
                    all.iter().any(|seen| seen.at == of.at && is_alike(seen, of))
                }
                _ => true,
            };
            let shown = together.iter().filter(|of| of.q <= level && !is_told(of.at) && is_suspected(of));
            let shown = shown.filter_map(|of| {
                let next = alone.iter().find(|next| next.at == of.at)?;
                (next.p <= ALONE && is_alike(next, of)).then_some((*of, *next))
            });
            let Some((of, next)) = shown.min_by(|(a, _), (b, _)| a.p.total_cmp(&b.p).then(a.at.cmp(&b.at)))
            else {
                return Ok(Changed { found, mechanisms, all: all.unwrap_or(together) });
            };
            // What the link is now, the newest batch tells alone: where the suspicion began early, others have old rows.
            let newest = after.get(after.len().saturating_sub(1)..).unwrap_or(after);
            let now = self.differences((before, newest), &mechanisms)?;
            let next = now.into_iter().find(|now| now.at == of.at).unwrap_or(next);
            let next = self.described(next, (before, newest), &mechanisms);
            found.push(Difference { p: of.p, q: of.q, ..next });
            mechanisms.add(of.at);
            all.get_or_insert(together);
        }
    }
}

/// The data of these batches, with their masks if one of them has some.
fn with_masks(data: DataFrame, before: &[&Batch], after: &[&Batch]) -> Result<DataFrame> {
    let batches = || before.iter().chain(after);
    if !batches().any(|batch| batch.is_masked()) {
        return Ok(data);
    }
    let masks = batches().map(|batch| batch.mask()).collect();
    data.with_mask(masks, MaskType { y: true, ..MaskType::default() })
}

/// What became of a slope.
fn kind_of(before: Slope, after: Slope) -> Kind {
    match (before.p_value() > NONE, after.p_value() > NONE) {
        (true, false) => Kind::Appeared,
        (false, true) => Kind::Vanished,
        _ if before.value * after.value < 0.0 => Kind::Reversed,
        _ if after.value.abs() > before.value.abs() => Kind::Stronger,
        _ => Kind::Weaker,
    }
}

fn constant([low, high]: [f64; 2]) -> bool {
    high - low <= 1e-12
}

/// Smallest and largest value of a variable in a group of batches.
fn range(group: &[&Batch], var: usize) -> [f64; 2] {
    let ends = group.iter().filter_map(|batch| batch.ranges.get(var).copied());
    ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or_default()
}

/// Benjamini and Hochberg 1995: `q_(k) = min over l >= k of p_(l) n / l`.
fn corrected(found: &mut [Difference]) {
    let n = found.len();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| found[b].p.total_cmp(&found[a].p));
    let mut smallest: f64 = 1.0;
    for (from_above, &place) in order.iter().enumerate() {
        smallest = smallest.min(found[place].p * n as f64 / (n - from_above) as f64);
        found[place].q = smallest;
    }
}
