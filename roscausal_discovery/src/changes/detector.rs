//! The detector: regime, suspicion, decision.

use std::collections::{BTreeSet, VecDeque};

use ndarray::{Array2, ArrayView2, s};
use serde::{Deserialize, Serialize};

use super::{
    baseline::Baseline,
    batch::Batch,
    compare::{Changed, Groups},
    curves,
    event::{ChangeEvent, Form, Kind, Status},
    place::Place,
    terms::{Comparison, Difference, Mechanisms, NONE},
    when,
};
use crate::types::{Control, Error, Named, Result, names::plain};

/// Most rows of a regime that are compared; but this many parts, however long.
const MOST_ROWS: usize = 2000;
const PARTS: usize = 8;
/// Comparisons that come before the first suspicion: they make the baseline.
const FIRST: usize = 2;
/// Batches in which the time of a change is looked for.
const LOCATED_IN: usize = 5;
/// Earlier regimes that may be recognised.
const REMEMBERED: usize = 8;
/// Most rows of a regime of curves.
const MOST_ROWS_OF_CURVES: usize = 1000;
/// Batches that may leave a suspicion open.
const MORE: usize = 2;
/// Batches after a change in which what else changed with it is looked for.
const LOOKS: usize = 4;

with_defaults! {
    /// The levels of the two stages, corrected for the number of links.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Levels {
        /// Below it a change is suspected.
        pub suspect: f64 = 0.2,
        /// Below it a suspected change is confirmed.
        pub confirm: f64 = 0.003,
    }
}

/// Reads batches one after another and tells when a mechanism changes. The [module](super) says how.
///
/// It can be written to a file and read back between two batches: it goes on as if nothing had happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detector {
    names: Vec<String>,
    tau_max: usize,
    exogenous: Vec<usize>,
    levels: Levels,
    form: Form,
    /// The batches since the last change, oldest first.
    regime: VecDeque<Batch>,
    /// Number of the present regime, from 1.
    number: usize,
    /// First row of the present regime.
    since: usize,
    /// Earlier regimes, oldest first.
    closed: VecDeque<(usize, Vec<Batch>)>,
    held: Option<Suspicion>,
    /// What the newest regime is known to have begun with.
    #[serde(default)]
    begun: Begun,
    /// Cause and effect of curves that were seen among slopes.
    #[serde(default)]
    curved: BTreeSet<(usize, usize)>,
    #[serde(default, alias = "yardstick")]
    baseline: Baseline,
    rows: usize,
    reported: usize,
}

/// The links that changed when the present regime began, and the batches in which more are looked for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Begun {
    links: Vec<Place>,
    /// What became of each of them, where that is known: not in files of before.
    #[serde(default)]
    kinds: Vec<Option<Kind>>,
    looks: usize,
}

impl Begun {
    fn add(&mut self, found: &[Difference]) {
        self.kinds.resize(self.links.len(), None);
        self.links.extend(found.iter().map(|difference| difference.at));
        self.kinds.extend(found.iter().map(|difference| Some(difference.kind)));
    }

    fn known(&self) -> Vec<(Place, Option<Kind>)> {
        self.links.iter().enumerate().map(|(k, at)| (*at, self.kinds.get(k).copied().flatten())).collect()
    }

    /// The lag that a link had before, if it came to another one.
    fn moved_from(&self, to: &Difference) -> Option<usize> {
        let gone = Kind::Vanished;
        let mut all = self.links.iter().zip(&self.kinds);
        let from = all.find(|(at, kind)| **kind == Some(gone) && to.moves_with(**at, gone));
        from.map(|(at, _)| at.lag)
    }
}

/// A batch that seems to differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Suspicion {
    batch: Batch,
    /// The batches after it that left the suspicion open.
    #[serde(default)]
    more: Vec<Batch>,
    /// The links that differ in it, most certain first, and the id of the event of those that were told.
    links: Vec<(Difference, Option<String>)>,
    /// How far each link was from the regime.
    all: Vec<(Place, f64)>,
}

impl Detector {
    /// A detector for variables with these names. `exogenous` ones are set by others: they are not effects.
    ///
    /// # Errors
    /// Fewer than two variables, a lag of 0 or one that is too large, an exogenous variable that there is not, or levels outside (0, 1).
    pub fn new(names: Vec<String>, tau_max: usize, exogenous: &[String], levels: Levels) -> Result<Self> {
        let reason = "a change of a link needs two variables and lags from 1 on";
        Error::ensure(names.len() >= 2 && tau_max > 0, "changes", || reason)?;
        Error::check_lags(1, tau_max)?;
        for (name, level) in [("suspect_level", levels.suspect), ("confirm_level", levels.confirm)] {
            Error::ensure(level > 0.0 && level < 1.0, name, || format!("{level} is not between 0 and 1"))?;
        }
        let place = |name: &String| {
            let place = names.iter().position(|known| known == name);
            place.ok_or_else(|| Error::param("exogenous", format!("there is no variable '{name}'")))
        };
        let exogenous = exogenous.iter().map(place).collect::<Result<_>>()?;
        Ok(Self {
            names,
            tau_max,
            exogenous,
            levels,
            form: Form::default(),
            regime: VecDeque::new(),
            number: 1,
            since: 0,
            closed: VecDeque::new(),
            held: None,
            begun: Begun::default(),
            curved: BTreeSet::new(),
            baseline: Baseline::default(),
            rows: 0,
            reported: 0,
        })
    }

    /// The same detector for mechanisms of another form.
    #[must_use]
    pub fn of_form(mut self, form: Form) -> Self {
        self.form = form;
        self
    }

    /// Whether this is the detector for variables that begin with these, of which `exogenous` ones are set by others, and with
    /// these settings.
    pub fn is_for(
        &self,
        names: &[String],
        exogenous: &[String],
        tau_max: usize,
        levels: Levels,
        form: Form,
    ) -> bool {
        let settings = (self.tau_max, self.levels, self.form) == (tau_max, levels, form);
        let of_these = self.exogenous.iter().filter(|&&var| var < names.len());
        let are_same = of_these.filter_map(|&var| self.names.get(var)).eq(exogenous);
        settings && self.names.starts_with(names) && are_same
    }

    /// Fewest rows of a batch: each slope needs some.
    pub fn fewest_rows(&self) -> usize {
        20 * (self.names.len() * self.tau_max + 1)
    }

    /// Rows read so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of the present regime, from 1.
    pub fn regime(&self) -> usize {
        self.number
    }

    /// The row at which the present regime begins, as far as it is known: all rows from here on are of it.
    pub fn since(&self) -> usize {
        self.since
    }

    /// The variables, in the order of the columns.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// What slopes do not follow, in a sentence; nothing is found there, and nothing should be concluded from that.
    pub fn misfit(&self) -> Option<String> {
        let name = |var: usize| plain(&self.names[var]);
        let curve = |&(cause, effect): &(usize, usize)| format!("{} on {}", name(effect), name(cause));
        let curves: Vec<String> = self.curved.iter().map(curve).collect();
        (!curves.is_empty()).then(|| {
            format!(
                "slopes do not fit where a dependence is a curve ({}): its changes are not seen; {} gpdc compares curves",
                curves.join(", "),
                Named("test")
            )
        })
    }

    /// Events told so far, all stages of one change as one.
    pub fn reported(&self) -> usize {
        self.reported
    }

    /// The same detector, whose events are numbered from `reported + 1` on: for one that takes over from another.
    #[must_use]
    pub fn numbered_after(mut self, reported: usize) -> Self {
        self.reported = reported;
        self
    }

    /// One exogenous variable more, which was 0 until now: an intervention that is announced for the first time.
    pub fn add_exogenous(&mut self, name: &str) {
        self.exogenous.push(self.names.len());
        self.names.push(name.to_owned());
        let closed = self.closed.iter_mut().flat_map(|(_, batches)| batches);
        let held = self.held.iter_mut().flat_map(|held| held.more.iter_mut().chain([&mut held.batch]));
        self.regime.iter_mut().chain(closed).chain(held).for_each(Batch::extend);
    }

    /// Reads a recording in parts of `size` rows; what is left over joins the last part. Returns what is found, in order.
    ///
    /// Rows that are `masked` are not effects, but still the past of others; there is a word for each row, or none at all.
    ///
    /// # Errors
    /// As [`Detector::read`], parts that are too small, and a mask of another length.
    pub fn read_in_parts(
        &mut self,
        values: ArrayView2<'_, f64>,
        masked: &[bool],
        size: usize,
        control: &Control,
    ) -> Result<Vec<ChangeEvent>> {
        let mut reported = Vec::new();
        self.read_each(values, masked, size, control, &mut reported)?;
        Ok(reported)
    }

    /// As [`Detector::read_in_parts`], into `reported`: what was found before an error stays there.
    ///
    /// # Errors
    /// As [`Detector::read_in_parts`].
    pub fn read_each(
        &mut self,
        values: ArrayView2<'_, f64>,
        masked: &[bool],
        size: usize,
        control: &Control,
        reported: &mut Vec<ChangeEvent>,
    ) -> Result<()> {
        let (given, n) = (masked.len(), values.nrows());
        Error::ensure(given == 0 || given == n, "mask", || {
            format!("it is for {given} rows, and the recording has {n}; give one for each")
        })?;
        let (n_vars, fewest) = (self.names.len(), self.fewest_rows());
        Error::ensure(size >= fewest, "change_rows", || {
            format!("parts of {size} rows are too small for {n_vars} variables; give at least {fewest}")
        })?;
        let parts = (n / size).max(1);
        for part in 0..parts {
            // The rows before a part are its past.
            let from = (part * size).saturating_sub(if part == 0 { 0 } else { 2 * self.tau_max });
            let to = if part + 1 == parts { n } else { (part + 1) * size };
            let masked = masked.get(from..to).unwrap_or_default().to_vec();
            let rows = values.slice(s![from..to, ..]).to_owned();
            reported.extend(self.read_stretch(&rows, masked, part > 0, control)?);
        }
        Ok(())
    }

    /// Reads the next batch, `T x N`; its first `2 tau_max` rows serve as the past of the others. Returns what is told of it.
    ///
    /// A row counts if nothing is missing in it and in the `2 tau_max` rows before it. A batch with too few such rows is passed over.
    ///
    /// # Errors
    /// Another number of variables, or cancellation.
    pub fn read(&mut self, values: &Array2<f64>, control: &Control) -> Result<Vec<ChangeEvent>> {
        self.read_stretch(values, Vec::new(), false, control)
    }

    /// `overlaps`: whether the first `2 tau_max` rows were read before.
    fn read_stretch(
        &mut self,
        values: &Array2<f64>,
        masked: Vec<bool>,
        overlaps: bool,
        control: &Control,
    ) -> Result<Vec<ChangeEvent>> {
        let (n, wanted) = (values.ncols(), self.names.len());
        Error::ensure_data(n == wanted, || {
            format!("a batch of {n} variables, where the others have {wanted}")
        })?;
        let past = 2 * self.tau_max;
        let begin = self.rows - if overlaps { past } else { 0 };
        self.rows = begin + values.nrows();
        let batch = Batch::new(values.clone(), begin + past).with_masked(masked);
        if batch.len(past) + past < self.fewest_rows() {
            return Ok(Vec::new());
        }
        let mut events = Vec::new();
        self.take(batch, control, &mut events)?;
        Ok(events)
    }

    /// Takes a batch. Where a suspicion is withdrawn, the batches that waited for it are taken anew: another link may have changed in them.
    fn take(&mut self, batch: Batch, control: &Control, events: &mut Vec<ChangeEvent>) -> Result<()> {
        if let Some(held) = self.held.take() {
            let Some(Suspicion { batch: first, more, .. }) = self.decide(held, &batch, control, events)?
            else {
                return Ok(());
            };
            self.join(first);
            return more.into_iter().chain([batch]).try_for_each(|batch| self.take(batch, control, events));
        }
        self.look_again(&batch, control, events)?;
        self.suspect(batch, control, events)
    }

    /// What else changed when the present regime began: the newest batches may show what the first ones did not.
    fn look_again(&mut self, newest: &Batch, control: &Control, events: &mut Vec<ChangeEvent>) -> Result<()> {
        let (Some((_, before)), true) = (self.closed.back(), self.begun.looks > 0) else { return Ok(()) };
        let before: Vec<&Batch> = before.iter().collect();
        let after: Vec<&Batch> = self.regime.iter().chain([newest]).collect();
        let groups = (before.as_slice(), after.as_slice());
        let comparison = self.comparison(control);
        let mechanisms = comparison.mechanisms(groups.0, groups.1)?;
        if mechanisms.incomparable {
            return Ok(());
        }
        let Changed { found, mechanisms, .. } =
            comparison.changed(groups, mechanisms, self.levels.confirm, &self.begun.known(), None)?;
        let mut begun = self.begun.clone();
        begun.add(&found);
        let mut reported = Vec::new();
        for difference in &found {
            let mut event = self.event(self.next_id(reported.len()), Status::Confirmed, difference);
            event.changed_between = located(&comparison, groups, difference.at, &mechanisms);
            event.regime = Some(self.number);
            event.moved_from = begun.moved_from(difference);
            reported.push(event);
        }
        self.reported += reported.len();
        self.begun = Begun { looks: begun.looks - 1, ..begun };
        events.extend(reported);
        Ok(())
    }

    fn comparison<'a>(&'a self, control: &'a Control) -> Comparison<'a> {
        Comparison {
            form: self.form,
            names: &self.names,
            tau_max: self.tau_max,
            exogenous: &self.exogenous,
            baseline: &self.baseline,
            control,
        }
    }

    /// Stage one: a batch joins the regime, or is held back.
    fn suspect(&mut self, batch: Batch, control: &Control, events: &mut Vec<ChangeEvent>) -> Result<()> {
        let regime: Vec<&Batch> = self.regime.iter().collect();
        if regime.is_empty() {
            self.join(batch);
            return Ok(());
        }
        let comparison = self.comparison(control);
        let mechanisms = comparison.mechanisms(&regime, &[&batch])?;
        if mechanisms.incomparable {
            return Ok(());
        }
        let mut differences = comparison.differences((&regime, &[&batch]), &mechanisms)?;
        let of_effect = |effect| mechanisms.bending(effect).into_iter().map(move |cause| (cause, effect));
        let curved: Vec<(usize, usize)> = (0..self.names.len()).flat_map(of_effect).collect();
        let all: Vec<(Place, f64)> = differences.iter().map(|link| (link.at, link.z)).collect();
        let begins = self.baseline.comparisons() < FIRST;
        differences.retain(|difference| !begins && difference.q <= self.levels.suspect);
        differences.sort_by(|a, b| a.p.total_cmp(&b.p).then(a.at.cmp(&b.at)));
        if differences.is_empty() {
            self.curved.extend(curved);
            self.baseline.add(all);
            self.join(batch);
            return Ok(());
        }
        let mut links = Vec::new();
        let mut effects = Vec::new();
        let (mut reported, mut pushed) = (self.reported, Vec::new());
        for difference in differences {
            let difference = comparison.described(difference, (&regime, &[&batch]), &mechanisms);
            let mut id = None;
            if !effects.contains(&difference.at.effect) {
                effects.push(difference.at.effect);
                reported += 1;
                id = Some(format!("change-{reported}"));
                pushed.push((id.clone().unwrap_or_default(), difference));
            }
            links.push((difference, id));
        }
        events.extend(pushed.into_iter().map(|(id, of)| self.event(id, Status::Suspected, &of)));
        self.reported = reported;
        self.curved.extend(curved);
        self.held = Some(Suspicion { batch, more: Vec::new(), links, all });
        Ok(())
    }

    /// Stage two: what the next batch says of a suspicion. Returns it if it is withdrawn.
    fn decide(
        &mut self,
        mut held: Suspicion,
        next_batch: &Batch,
        control: &Control,
        events: &mut Vec<ChangeEvent>,
    ) -> Result<Option<Suspicion>> {
        let regime: Vec<&Batch> = self.regime.iter().collect();
        let both: Vec<&Batch> = [&held.batch].into_iter().chain(&held.more).chain([next_batch]).collect();
        let comparison = self.comparison(control);
        let mechanisms = comparison.mechanisms(&regime, &both)?;
        let groups = (regime.as_slice(), both.as_slice());
        let suspected: Vec<Difference> = held.links.iter().map(|(seen, _)| *seen).collect();
        let Changed { found: confirmed, mechanisms, all: together } =
            comparison.changed(groups, mechanisms, self.levels.confirm, &[], Some(&suspected))?;
        let is_open = |(seen, _): &(Difference, Option<String>)| {
            let now = together.iter().find(|now| now.at == seen.at);
            now.is_some_and(|now| now.q <= self.levels.suspect && comparison.are_alike(now, seen))
        };
        let waits = confirmed.is_empty() && held.more.len() < MORE && held.links.iter().any(is_open);
        // Another link that differs in the new batch must not wait for this suspicion.
        let is_other = |now: &Difference| {
            now.q <= self.levels.suspect && held.links.iter().all(|(seen, _)| seen.at != now.at)
        };
        if waits && !comparison.differences((&regime, &[next_batch]), &mechanisms)?.iter().any(is_other) {
            held.more.push(next_batch.clone());
            self.held = Some(held);
            return Ok(None);
        }
        let same_as = if confirmed.is_empty() { None } else { self.known_regime(&comparison, &both)? };
        let mut begun = Begun::default();
        begun.add(&confirmed);
        let (mut effects, mut reported, mut more) = (Vec::new(), Vec::new(), 0);
        for difference in &confirmed {
            let of_effect = |(seen, id): &(Difference, Option<String>)| {
                id.clone().filter(|_| seen.at.effect == difference.at.effect)
            };
            // A second change of an effect was not suspected by itself.
            let known = held.links.iter().find_map(of_effect);
            let id = known.filter(|_| !effects.contains(&difference.at.effect)).unwrap_or_else(|| {
                more += 1;
                self.next_id(more - 1)
            });
            effects.push(difference.at.effect);
            let mut event = self.event(id, Status::Confirmed, difference);
            event.changed_between = located(&comparison, groups, difference.at, &mechanisms);
            event.regime = Some(self.number + 1);
            event.same_as = same_as;
            event.moved_from = begun.moved_from(difference);
            reported.push(event);
        }
        for (seen, id) in &held.links {
            let Some(id) = id.clone().filter(|_| !effects.contains(&seen.at.effect)) else { continue };
            // What cannot be compared any more is told with the slopes of the suspicion.
            let difference = together.iter().find(|now| now.at == seen.at).copied().unwrap_or(*seen);
            let difference = comparison.described(difference, (&regime, &both), &mechanisms);
            reported.push(self.event(id, Status::Withdrawn, &difference));
        }
        let since = reported.iter().filter_map(|event| event.changed_between).map(|[_, to]| to).max();
        let since = since.map_or(held.batch.first, |row| row.clamp(held.batch.first, next_batch.first));
        events.extend(reported);
        if confirmed.is_empty() {
            self.baseline.add(held.all.clone());
            return Ok(Some(held));
        }
        self.since = since;
        self.reported += more;
        let looks = if self.form == Form::Curve { 0 } else { LOOKS };
        self.begun = Begun { looks, ..begun };
        self.baseline.forget();
        // Rows from before the change would make the new regime differ from what follows.
        let held = [held.batch].into_iter().chain(held.more);
        let held = held.filter_map(|batch| batch.without_rows_before(since, 2 * self.tau_max));
        self.begin_regime(held.chain([next_batch.clone()]).collect());
        Ok(None)
    }

    /// The latest earlier regime whose slopes two batches have.
    fn known_regime(&self, comparison: &Comparison<'_>, both: &[&Batch]) -> Result<Option<usize>> {
        for (number, batches) in self.closed.iter().rev() {
            let before: Vec<&Batch> = batches.iter().collect();
            let mechanisms: Mechanisms = comparison.mechanisms(&before, both)?;
            let differences = comparison.differences((&before, both), &mechanisms)?;
            if !differences.is_empty() && differences.iter().all(|difference| difference.q > NONE) {
                return Ok(Some(*number));
            }
        }
        Ok(None)
    }

    fn begin_regime(&mut self, batches: Vec<Batch>) {
        let old = std::mem::take(&mut self.regime).into();
        self.closed.push_back((self.number, old));
        if self.closed.len() > REMEMBERED {
            self.closed.pop_front();
        }
        self.number += 1;
        batches.into_iter().for_each(|batch| self.join(batch));
    }

    /// A batch joins the regime; the oldest rows beyond [`MOST_ROWS`] leave it.
    fn join(&mut self, batch: Batch) {
        self.regime.push_back(batch);
        let past = 2 * self.tau_max;
        let rows = |regime: &VecDeque<Batch>| regime.iter().map(|batch| batch.len(past)).sum::<usize>();
        let most = if self.form == Form::Curve { MOST_ROWS_OF_CURVES } else { MOST_ROWS };
        let parts = if self.form == Form::Curve { 1 } else { PARTS };
        while self.regime.len() > parts && rows(&self.regime) > most {
            self.regime.pop_front();
        }
    }

    /// The id of the event after `more` others that are not counted yet.
    fn next_id(&self, more: usize) -> String {
        format!("change-{}", self.reported + more + 1)
    }

    fn event(&self, id: String, status: Status, difference: &Difference) -> ChangeEvent {
        let Difference { at, before, after, kind, p, .. } = *difference;
        ChangeEvent {
            id,
            status,
            kind,
            cause: self.names[at.cause].clone(),
            effect: self.names[at.effect].clone(),
            lag: at.lag,
            before: before.value,
            after: after.value,
            form: self.form,
            p_value: p,
            time: self.rows,
            changed_between: None,
            regime: None,
            same_as: None,
            moved_from: None,
        }
    }
}

/// The rows between which a link changed, in the newest batches of the two groups.
fn located(
    comparison: &Comparison<'_>,
    groups: Groups<'_>,
    at: Place,
    mechanisms: &Mechanisms,
) -> Option<[usize; 2]> {
    let (before, after) = groups;
    let [.., newest] = after else { return None };
    let batches: Vec<&Batch> = before.iter().rev().take(LOCATED_IN - 2).rev().chain(after).copied().collect();
    let curve = match comparison.form {
        Form::Slope => None,
        Form::Curve => curves::curve_of(comparison, (before, &[newest]), at),
    };
    when::between(comparison, &batches, at, mechanisms, curve.as_ref())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::slope::Slope;

    #[test]
    fn what_became_of_the_links_in_a_file_of_before_stays_unknown() {
        let of_before = r#"{"links":[{"cause":0,"effect":1,"lag":1}],"looks":2}"#;
        let mut begun: Begun = serde_json::from_str(of_before).unwrap();
        let slope = Slope { value: 0.0, variance: 1.0 };
        let of = |lag: usize, kind: Kind| {
            let at = Place { cause: 0, effect: 1, lag };
            Difference { at, before: slope, after: slope, kind, z: 5.0, p: 0.0, q: 0.0 }
        };
        begun.add(&[of(2, Kind::Vanished)]);
        let kinds: Vec<Option<Kind>> = begun.known().into_iter().map(|(_, kind)| kind).collect();
        assert_eq!(kinds, [None, Some(Kind::Vanished)]);
        assert_eq!(begun.moved_from(&of(3, Kind::Appeared)), Some(2));
    }
}
