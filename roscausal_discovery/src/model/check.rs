//! The one check of a model: everything that reads one goes through it, so what is drawn, compared or asked is whole.

use std::collections::{HashMap, HashSet};

use serde::{Deserialize, Deserializer, de::Error as _};

use super::{Confidence, Link, LinkSize, Model, Outcome, SCHEMA, SCHEMA_1, Unchecked, cells, is_listed};
use crate::types::{
    Error, LinkEnd, LinkMark, Result, ensure,
    text::{check_names, check_nesting, check_schema, check_step, is_share, quoted, reason_of},
};

/// Bytes of a model's file beyond those of its matrices, and for each of their places.
const BYTES: usize = 1 << 20;
const BYTES_OF_A_PLACE: usize = 4096;

type Checked = std::result::Result<(), String>;

/// What says how large a model is, before its matrices are read.
#[derive(Deserialize)]
struct Head {
    schema: String,
    #[serde(default)]
    features: Vec<String>,
    #[serde(default)]
    dropped: Vec<String>,
    #[serde(default)]
    tau_max: u64,
}

impl Model {
    /// Reads the model in the text of a file.
    ///
    /// ```
    /// use roscausal_discovery::Model;
    ///
    /// let error = Model::from_json(br#"{"schema": "roscausal/model/3"}"#).unwrap_err().to_string();
    /// assert!(error.contains("this program reads 'roscausal/model/2'"), "{error}");
    /// ```
    ///
    /// # Errors
    /// Text that is not a model of [`SCHEMA`], or one of which two parts do not fit together.
    pub fn from_json(text: &[u8]) -> Result<Self> {
        check_nesting(text).map_err(|e| invalid(&e))?;
        let head: Head = serde_json::from_slice(text).map_err(|e| invalid(&reason_of(e)))?;
        if head.schema != SCHEMA_1 {
            check_schema(&head.schema, SCHEMA)?;
        }
        let lags = usize::try_from(head.tau_max).unwrap_or(usize::MAX).saturating_add(1);
        let places = head.features.len().saturating_mul(head.features.len()).saturating_mul(lags);
        let most =
            places.saturating_add(head.dropped.len()).saturating_mul(BYTES_OF_A_PLACE).saturating_add(BYTES);
        if text.len() > most {
            let n = head.features.len();
            let reason = format!("{} bytes are too many for {n} variables and {lags} lags", text.len());
            return Err(invalid(&reason));
        }
        // Read unchecked first: the check words its faults itself.
        let mut json = serde_json::Deserializer::from_slice(text);
        let read = Unchecked::deserialize(&mut json).and_then(|model| json.end().map(|()| model));
        let mut model = read.map_err(|e| invalid(&reason_of(e)))?;
        model.upgrade();
        model.check()?;
        Ok(model)
    }

    /// Makes a model of version 1 one of this version. It has 0 and 1 where nothing was tested, and also where a test found exactly
    /// that: neither is known.
    fn upgrade(&mut self) {
        if self.schema != SCHEMA_1 {
            return;
        }
        self.schema = SCHEMA.to_owned();
        let place = |link: &Link| self.places(&link.cause, &link.effect).map(|(i, j)| (i, j, link.lag));
        let required: HashSet<_> = self.links.iter().filter(|link| link.required).filter_map(place).collect();
        let is_link = |i: usize, j: usize, lag: usize| {
            self.graph.get(i).and_then(|of| of.get(j)?.get(lag)).is_some_and(|mark| mark.is_link())
        };
        let outcome = |i: usize, j: usize, lag: usize, value: Option<f64>, p: Option<f64>| match (value, p) {
            _ if lag < self.tau_min || (lag == 0 && i == j) => Outcome::NotAsked,
            _ if required.contains(&(i, j, lag)) => Outcome::Required,
            (Some(value), Some(p)) if value != 0.0 || p != 1.0 || is_link(i, j, lag) => Outcome::Tested,
            _ => Outcome::Unknown,
        };
        let mut outcomes = Vec::new();
        for (i, (values, ps)) in self.val_matrix.iter().zip(&self.p_matrix).enumerate() {
            let mut of_cause = Vec::new();
            for (j, (values, ps)) in values.iter().zip(ps).enumerate() {
                let pairs = values.iter().zip(ps).enumerate();
                of_cause.push(pairs.map(|(lag, (value, p))| outcome(i, j, lag, *value, *p)).collect());
            }
            outcomes.push(of_cause);
        }
        for matrix in [&mut self.val_matrix, &mut self.p_matrix] {
            let cells = matrix.iter_mut().flatten().flatten();
            let of = outcomes.iter().flatten().flat_map(|row: &Vec<Outcome>| row);
            cells.zip(of).filter(|(_, of)| **of != Outcome::Tested).for_each(|(cell, _)| *cell = None);
        }
        self.n_matrix =
            outcomes.iter().map(|of| of.iter().map(|row| vec![None; row.len()]).collect()).collect();
        for link in self.links.iter_mut().filter(|link| link.required) {
            (link.value, link.p_value) = (None, None);
        }
        self.outcomes = outcomes;
    }

    /// Checks version, names, lags, marks and numbers, and that all parts are of one size and say the same.
    ///
    /// # Errors
    /// The first fault, in a sentence.
    pub fn check(&self) -> Result<()> {
        check_schema(&self.schema, SCHEMA)?;
        self.parts().map_err(|reason| invalid(&reason))
    }

    fn parts(&self) -> Checked {
        let text = |error: Error| error.to_string();
        Error::check_lags(self.tau_min, self.tau_max).map_err(text)?;
        check_names(self.features.iter().chain(&self.dropped)).map_err(text)?;
        check_step(self.dt).map_err(text)?;
        let levels = [("alpha", Some(self.alpha)), ("pc_alpha", self.pc_alpha), ("f_alpha", self.f_alpha)];
        for (name, level) in levels.into_iter().chain([("run_time_s", self.run_time_s)]) {
            if let Some(value) = level.filter(|value| !(value.is_finite() && *value >= 0.0)) {
                return Err(format!("{name} is {value}; it is a number from 0 on"));
            }
        }
        let (n, lags) = (self.features.len(), self.tau_max + 1);
        for (name, size) in [
            ("graph", sized(&self.graph, [n, n, lags])),
            ("outcomes", sized(&self.outcomes, [n, n, lags])),
            ("val_matrix", sized(&self.val_matrix, [n, n, lags])),
            ("p_matrix", sized(&self.p_matrix, [n, n, lags])),
            ("n_matrix", sized(&self.n_matrix, [n, n, lags])),
            ("causal_structure", sized(&self.causal_structure, [lags - self.tau_min, n, n])),
            ("val", sized(&self.val, [lags - self.tau_min, n, n])),
            ("pval", sized(&self.pval, [lags - self.tau_min, n, n])),
        ] {
            size.map_err(|size| format!("{name} is not of the size {size}"))?;
        }
        check_numbers("val", self.val.iter().flatten().flatten().copied(), "finite", f64::is_finite)?;
        check_numbers("pval", self.pval.iter().flatten().flatten().copied(), A_SHARE, is_share)?;
        let numbers = |matrix: &[Vec<Vec<Option<f64>>>]| -> Vec<f64> {
            matrix.iter().flatten().flatten().copied().flatten().collect()
        };
        check_numbers("val_matrix", numbers(&self.val_matrix), "finite", f64::is_finite)?;
        check_numbers("p_matrix", numbers(&self.p_matrix), A_SHARE, is_share)?;
        self.tested()?;
        if let Some(odd) =
            self.causal_structure.iter().flatten().flatten().find(|cell| !matches!(cell, 0 | 1))
        {
            return Err(format!("causal_structure holds {odd}; it is 1 for a link and 0 for none"));
        }
        self.marks()?;
        self.listed()?;
        self.confidence.as_deref().map_or(Ok(()), |confidence| self.resampled(confidence))
    }

    /// Numbers are where something was tested, and nowhere else.
    fn tested(&self) -> Checked {
        for ([i, j, lag], outcome) in cells(&self.outcomes) {
            let (tested, name) = (*outcome == Outcome::Tested, || self.name_of(i, j, lag));
            let has = [self.val_matrix[i][j][lag].is_some(), self.p_matrix[i][j][lag].is_some()];
            if has != [tested; 2] || (self.n_matrix[i][j][lag].is_some() && !tested) {
                let what = if tested { "tested, and has no number" } else { "not tested, and has a number" };
                return Err(format!("{} is {what}", name()));
            }
            let left = *outcome == Outcome::Ended && self.graph[i][j][lag].is_link();
            ensure(!left, || format!("{} is a link that the time budget left untested", name()))?;
        }
        Ok(())
    }

    /// The marks of the graph: known, at lag 0 the same from both ends, and no cause after its effect.
    fn marks(&self) -> Checked {
        for ([i, j, lag], mark) in cells(&self.graph) {
            let Some((left, right)) = mark.ends() else { continue };
            let link = || self.name_of(i, j, lag);
            let can_be = lag >= self.tau_min && (lag > 0 || i != j);
            ensure(can_be, || format!("graph has a link {}, which cannot be", link()))?;
            let back =
                lag > 0 && (right == LinkEnd::Tail || (left == LinkEnd::Head && right != LinkEnd::Head));
            ensure(!back, || format!("graph has {mark} for {}: the effect comes before its cause", link()))?;
            if lag == 0 && self.graph[j][i][0] != mark.mirrored() {
                let back = quoted(self.graph[j][i][0].symbol());
                return Err(format!("graph has {mark} for {} and {back} the other way round", link()));
            }
        }
        Ok(())
    }

    /// The list of links: those of the graph, each once, with numbers that can be.
    fn listed(&self) -> Checked {
        let places: HashMap<&str, usize> = self.features.iter().map(String::as_str).zip(0..).collect();
        let mut listed = HashSet::new();
        for (k, link) in self.links.iter().enumerate() {
            let of = |name: &String| {
                let unknown =
                    || format!("links[{k}] names {}, which is not one of its features", quoted(name));
                places.get(name.as_str()).copied().ok_or_else(unknown)
            };
            let place = (of(&link.cause)?, of(&link.effect)?, link.lag);
            let mark = self.graph[place.0][place.1].get(link.lag).ok_or_else(|| {
                format!("links[{k}] has lag {}; lags are {} to {}", link.lag, self.tau_min, self.tau_max)
            })?;
            let name = || self.name_of(place.0, place.1, place.2);
            if !link.mark.is_link() || *mark != link.mark {
                let (own, of_graph) = (quoted(link.mark.symbol()), quoted(mark.symbol()));
                return Err(format!("links[{k}], {}, has the mark {own}, and graph has {of_graph}", name()));
            }
            ensure(listed.insert(place), || format!("links has {} twice", name()))?;
            check_link(link).map_err(|reason| format!("links[{k}], {}: {reason}", name()))?;
            if link.value.is_some() != (self.outcomes[place.0][place.1][place.2] == Outcome::Tested) {
                return Err(format!("links[{k}], {}, and outcomes differ on whether it was tested", name()));
            }
            let of_matrices =
                [&self.val_matrix, &self.p_matrix].map(|matrix| matrix[place.0][place.1][place.2]);
            if [link.value, link.p_value] != of_matrices
                || self.n_matrix[place.0][place.1][place.2].is_some_and(|used| link.n_used != Some(used))
            {
                let what = "has another strength, p-value or number of samples than the matrices";
                return Err(format!("links[{k}], {}, {what}", name()));
            }
        }
        let is_missing = |([i, j, lag], mark): &([usize; 3], &LinkMark)| {
            is_listed(**mark, *lag, *i, *j) && !listed.contains(&(*i, *j, *lag))
        };
        match cells(&self.graph).find(is_missing) {
            Some(([i, j, lag], _)) => {
                Err(format!("graph has {}, and links has it not", self.name_of(i, j, lag)))
            }
            None => Ok(()),
        }
    }

    fn resampled(&self, of: &Confidence) -> Checked {
        let (n, lags) = (self.features.len(), self.tau_max + 1);
        let matrices = [("link_frequency", &of.link_frequency), ("val_mean", &of.val_mean)];
        let matrices = matrices.into_iter().chain([("val_low", &of.val_low), ("val_high", &of.val_high)]);
        let by_mark = of.mark_frequency.iter().map(|(mark, matrix)| (mark.symbol(), matrix));
        for (name, matrix) in matrices.chain(by_mark.clone()) {
            sized(matrix, [n, n, lags])
                .map_err(|size| format!("{} is not of the size {size}", quoted(name)))?;
            check_numbers(name, matrix.iter().flatten().flatten().copied(), "finite", f64::is_finite)?;
        }
        for (name, matrix) in by_mark.chain([("link_frequency", &of.link_frequency)]) {
            check_numbers(name, matrix.iter().flatten().flatten().copied(), A_SHARE, is_share)?;
        }
        let square = of.summary_frequency.len() == n && of.summary_frequency.iter().all(|row| row.len() == n);
        let shares = of.summary_frequency.iter().flatten().all(|share| is_share(*share));
        ensure(square && shares, || format!("summary_frequency is not {n} x {n} numbers from 0 to 1"))?;
        sized(&of.majority_graph, [n, n, lags])
            .map_err(|size| format!("majority_graph is not of the size {size}"))?;
        let facts = &of.resampling;
        let shares = is_share(facts.level) && facts.share.is_none_or(is_share);
        let reason = "resampling has more resamples done than asked for, or a share that is not 0 to 1";
        ensure(facts.done <= facts.asked && shares, || reason)?;
        for advice in &of.advice {
            let [cause, effect] = [&advice.cause, &advice.effect];
            if let Some(name) = [cause, effect].into_iter().find(|name| !self.features.contains(name)) {
                return Err(format!("advice names {}, which is not one of its features", quoted(name)));
            }
            if advice.lag > self.tau_max || !is_share(advice.confidence) {
                let (cause, effect) = (quoted(cause), quoted(effect));
                return Err(format!("advice on {cause} -> {effect} has no lag or share that can be"));
            }
        }
        Ok(())
    }

    fn name_of(&self, cause: usize, effect: usize, lag: usize) -> String {
        format!("{} -> {} at lag {lag}", quoted(&self.features[cause]), quoted(&self.features[effect]))
    }
}

fn check_link(link: &Link) -> Checked {
    let sizes = link.size.map(|LinkSize { step, change, low, high }| [step, change, low, high]);
    ensure(
        link.value.is_some() == link.p_value.is_some(),
        || "value and p_value are both there, or both null",
    )?;
    let numbers = [link.value, link.value_low, link.value_high, link.since].into_iter().flatten();
    let finite = numbers.chain(sizes.into_iter().flatten()).all(f64::is_finite);
    ensure(finite, || "a number is not finite")?;
    let mut shares = [link.p_value, link.confidence, link.chance].into_iter().flatten();
    ensure(shares.all(is_share), || "p_value, confidence and chance are numbers from 0 to 1".into())
}

/// Whether a matrix has this size; else the size as text.
fn sized<T>(matrix: &[Vec<Vec<T>>], [a, b, c]: [usize; 3]) -> Checked {
    // A filter that lets nothing through leaves no variables, and nothing at any lag.
    let is_none = b == 0 && matrix.is_empty();
    let fits = is_none
        || matrix.len() == a && matrix.iter().all(|of| of.len() == b && of.iter().all(|row| row.len() == c));
    if fits { Ok(()) } else { Err(format!("{a} x {b} x {c}")) }
}

const A_SHARE: &str = "a number from 0 to 1";

fn check_numbers(
    name: &str,
    numbers: impl IntoIterator<Item = f64>,
    what: &str,
    is: fn(f64) -> bool,
) -> Checked {
    let odd = numbers.into_iter().find(|value| !is(*value));
    odd.map_or(Ok(()), |odd| Err(format!("{} holds {odd}, which is not {what}", quoted(name))))
}

fn invalid(reason: &dyn std::fmt::Display) -> Error {
    Error::Data(format!("not a valid model ({SCHEMA}): {reason}"))
}

impl<'de> Deserialize<'de> for Model {
    fn deserialize<D: Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
        let mut model = Unchecked::deserialize(from)?;
        model.upgrade();
        model.check().map_err(D::Error::custom)?;
        Ok(model)
    }
}
