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
    methods::{Method, benjamini_hochberg},
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
        let curved = match self.form {
            Form::Slope => self.curved(&[before, after].concat(), &parents),
            Form::Curve => vec![Vec::new(); parents.len()],
        };
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

    /// For each effect the nodes whose squares drive it beyond its parents, strongest first.
    fn curved(&self, batches: &[&Batch], parents: &[Vec<Node>]) -> Vec<Vec<Node>> {
        let squared: Vec<(Node, Vec<f64>)> =
            self.nodes().map(|node| (node, squares(batches, node, self.past()))).collect();
        let of_effect = |(effect, parents): (usize, &Vec<Node>)| match self.exogenous.contains(&effect) {
            true => Vec::new(),
            false => self.curved_of(batches, &squared, effect, parents),
        };
        parents.iter().enumerate().map(of_effect).collect()
    }

    fn curved_of(
        &self,
        batches: &[&Batch],
        squared: &[(Node, Vec<f64>)],
        effect: usize,
        parents: &[Node],
    ) -> Vec<Node> {
        let of = |node: Node| column(batches, node, self.past());
        let y = of(Node::new(effect, 0));
        let (mut found, mut given): (Vec<Node>, Vec<Vec<f64>>) =
            (Vec::new(), parents.iter().map(|&node| of(node)).collect());
        while found.len() < MOST_CURVED {
            let refs: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
            let Some(left) = Conditions::new(&refs).map(|given| given.residuals(&y)) else { break };
            let stands_out = |squares: &[f64]| {
                let scale = (dot(squares, squares) * dot(&left, &left) / left.len() as f64).sqrt();
                dot(squares, &left).abs() / scale
            };
            let new = squared.iter().filter(|(node, _)| !found.contains(node));
            let new = new.map(|(node, squares)| (*node, squares, stands_out(squares)));
            let best = new.filter(|(.., z)| *z >= CURVED_Z).max_by(|a, b| a.2.total_cmp(&b.2));
            let Some((node, squares, _)) = best else { break };
            if !parents.contains(&node) {
                given.push(of(node));
            }
            let refs: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
            if slope(&y, squares, &refs, batches.len()).is_none_or(|slope| slope.p_value() > CURVED) {
                break;
            }
            found.push(node);
            given.push(squares.clone());
        }
        found
    }

    /// The links that are compared: all of one variable to another at lags from 1 on. Of an effect with a curve only those of the causes that
    /// bend: the slopes of others take up what squares leave of the curve.
    fn places(&self, mechanisms: &Mechanisms) -> Vec<Place> {
        let n = self.names.len();
        let mut all = Vec::new();
        for effect in (0..n).filter(|&var| !mechanisms.left_out[var] && !self.exogenous.contains(&var)) {
            let bending = mechanisms.bending(effect);
            let is_compared =
                |cause: &usize| *cause != effect && (bending.is_empty() || bending.contains(cause));
            for cause in (0..n).filter(is_compared) {
                all.extend((1..=self.tau_max).map(|lag| Place { cause, effect, lag }));
            }
        }
        all
    }

    /// The slope of a link in a group of batches.
    pub(super) fn slope(&self, batches: &[&Batch], at: Place, mechanisms: &Mechanisms) -> Option<Slope> {
        let x = column(batches, Node::new(at.cause, at.lag), self.past());
        self.slope_on(batches, at.effect, &x, &self.conditions(batches, at, mechanisms))
    }

    fn slope_on(&self, batches: &[&Batch], effect: usize, x: &[f64], given: &[Vec<f64>]) -> Option<Slope> {
        let y = column(batches, Node::new(effect, 0), self.past());
        let given: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
        slope(&y, x, &given, batches.len())
    }

    /// The conditions of a possible link in a group of batches.
    pub(super) fn conditions(&self, batches: &[&Batch], at: Place, mechanisms: &Mechanisms) -> Vec<Vec<f64>> {
        let given = mechanisms.given(at).into_iter().map(|node| column(batches, node, self.past()));
        let curved = mechanisms.curved[at.effect].iter();
        given.chain(curved.map(|&node| squares(batches, node, self.past()))).collect()
    }

    /// The slope of an effect on the square of a node.
    fn bend(&self, batches: &[&Batch], node: Node, effect: usize, mechanisms: &Mechanisms) -> Option<Slope> {
        let of = |node: Node| column(batches, node, self.past());
        let square = |node: Node| squares(batches, node, self.past());
        let others = mechanisms.parents[effect].iter().filter(|other| **other != node).chain([&node]);
        let curved = mechanisms.curved[effect].iter().filter(|other| **other != node);
        let given: Vec<Vec<f64>> =
            others.map(|&other| of(other)).chain(curved.map(|&other| square(other))).collect();
        self.slope_on(batches, effect, &square(node), &given)
    }

    /// Effect, cause, and how far their bends are apart, of those that are compared.
    fn bends_differ(&self, (before, after): Groups<'_>, mechanisms: &Mechanisms) -> Vec<(usize, usize, f64)> {
        let mut found = Vec::new();
        for effect in (0..self.names.len()).filter(|&effect| !mechanisms.left_out[effect]) {
            for node in mechanisms.curved[effect].iter().filter(|node| node.var != effect) {
                let bends = [before, after].map(|group| self.bend(group, *node, effect, mechanisms));
                if let [Some(before), Some(after)] = bends {
                    found.push((effect, node.var, before.z_of_same(after).abs()));
                }
            }
        }
        found
    }

    /// What a link was and is.
    fn of_link(
        &self,
        at: Place,
        groups: Groups<'_>,
        mechanisms: &Mechanisms,
    ) -> Option<(Slope, Slope, Kind)> {
        if self.form == Form::Curve {
            return curves::describe(self, groups, at, mechanisms);
        }
        let (before, after) = (self.slope(groups.0, at, mechanisms)?, self.slope(groups.1, at, mechanisms)?);
        Some((before, after, kind_of(before, after)))
    }

    fn slopes_differ(&self, groups: Groups<'_>, mechanisms: &Mechanisms) -> Result<Vec<Difference>> {
        let mut found = Vec::new();
        let bends = self.bends_differ(groups, mechanisms);
        for at in self.places(mechanisms) {
            self.control.check()?;
            if let Some((before, after, kind)) = self.of_link(at, groups, mechanisms) {
                // Where a cause bends, its slope depends on where its values lie; a change moves the bend, too.
                let of_pair =
                    bends.iter().filter(|(effect, cause, _)| (*effect, *cause) == (at.effect, at.cause));
                let z = of_pair.fold(before.z_of_same(after), |z, (.., most)| z.clamp(-most, *most));
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
        if self.form == Form::Slope { difference } else { self.redescribed(difference, groups, mechanisms) }
    }

    /// A difference with what the link was and is in other groups.
    fn redescribed(&self, of: Difference, groups: Groups<'_>, mechanisms: &Mechanisms) -> Difference {
        let now = self.of_link(of.at, groups, mechanisms);
        now.map_or(of, |(before, after, kind)| Difference { before, after, kind, ..of })
    }

    /// Compares all links of two groups.
    pub(super) fn differences(&self, groups: Groups<'_>, mechanisms: &Mechanisms) -> Result<Vec<Difference>> {
        let mut found = match self.form {
            Form::Slope => self.slopes_differ(groups, mechanisms)?,
            Form::Curve => self.curves_differ(groups, mechanisms)?,
        };
        for link in &mut found {
            link.p = self.baseline.p_value(link.at, link.z);
            link.q = link.p;
        }
        benjamini_hochberg(found.iter_mut().map(|link| &mut link.q).collect());
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
    /// The links that differ between the groups at `level`, alike behind the first batch alone, most certain first. A link joins the
    /// conditions of its effect once it is found, so that the next one is a change of its own. The first one must have been
    /// `suspected` in the same direction; `known` ones are not told again, and other lags of a pair only where a link has moved: one
    /// lag vanished and the other appeared.
    pub(super) fn changed(
        &self,
        (before, after): Groups<'_>,
        mut mechanisms: Mechanisms,
        level: f64,
        known: &[(Place, Option<Kind>)],
        suspected: Option<&[Difference]>,
    ) -> Result<Changed> {
        let (mut found, mut all): (Vec<Difference>, Option<Vec<Difference>>) = (Vec::new(), None);
        let later = after.get(1..).filter(|later| !later.is_empty()).unwrap_or(after);
        known.iter().for_each(|(at, _)| mechanisms.add(*at));
        loop {
            let together = self.differences((before, after), &mechanisms)?;
            let alone = self.differences((before, later), &mechanisms)?;
            let is_told = |of: &Difference| {
                // One curve that changes may show in those of other causes.
                let is_same = |told: &Place| {
                    told.effect == of.at.effect && (told.cause == of.at.cause || self.form == Form::Curve)
                };
                let moves = |at: Place, kind: Kind| self.form == Form::Slope && of.moves_with(at, kind);
                let is_again =
                    |at: Place, kind: Option<Kind>| is_same(&at) && kind.is_none_or(|kind| !moves(at, kind));
                known.iter().any(|(at, kind)| is_again(*at, *kind))
                    || found.iter().any(|told| is_again(told.at, Some(told.kind)))
            };
            let is_suspected = |of: &Difference| match suspected {
                Some(all) if found.is_empty() => {
                    all.iter().any(|seen| seen.at == of.at && self.are_alike(seen, of))
                }
                _ => true,
            };
            let shown = together.iter().filter(|of| of.q <= level && !is_told(of) && is_suspected(of));
            let shown = shown.filter_map(|of| {
                let next = alone.iter().find(|next| next.at == of.at)?;
                (next.p <= ALONE && self.are_alike(next, of)).then_some((*of, *next))
            });
            let Some((of, next)) = shown.min_by(|(a, _), (b, _)| a.p.total_cmp(&b.p).then(a.at.cmp(&b.at)))
            else {
                return Ok(Changed { found, mechanisms, all: all.unwrap_or(together) });
            };
            // What the link is now, the newest batch tells alone: where the suspicion began early, others have old rows.
            let newest = after.get(after.len().saturating_sub(1)..).unwrap_or(after);
            let next = self.redescribed(next, (before, newest), &mechanisms);
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
