//! The result of an analysis as users and files see it: one versioned object.

mod check;
mod confidence;
mod found_by;
mod outcome;
mod summary;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

pub use confidence::{Advice, Confidence, ResamplingFacts, word_of};
pub use found_by::FoundBy;
pub use outcome::Outcome;
pub use summary::{Summary, SummaryAdvice, SummaryLink};

use crate::{
    independence_tests::smallest_p,
    methods::Status,
    numeric::normal::normal_quantile,
    profile::DataProfile,
    types::{LinkEnd, LinkMark, SampleCount, names::plain, spelled_out},
};

/// Version of the layout. A reader takes this one and [`SCHEMA_1`].
pub const SCHEMA: &str = "roscausal/model/2";
/// The version before, which does not say what was tested: where its entries are 0 and 1, that is [`Outcome::Unknown`].
pub const SCHEMA_1: &str = "roscausal/model/1";

read_unchecked! {
    /// A causal model: the question and the result. `docs/model-schema.md` describes every field.
    ///
    /// The matrices `graph`, `val_matrix` and `p_matrix` are `[cause][effect][lag 0..=tau_max]`. Those named as in the
    /// message (`causal_structure`, `val`, `pval`) are `[lag - tau_min][effect][cause]`, with 0 where there is no link.
    ///
    /// Reading one checks it ([`Model::check`]): no text becomes a model whose parts do not fit together.
    #[derive(Clone, Debug, Default, PartialEq, Serialize)]
    pub struct Model "Model" {
        /// [`SCHEMA`].
        pub schema: String,
        /// `complete`, or `partial: ...` if the time budget ended the analysis.
        pub status: Status,
        /// Discovery method, such as `fpcmci`.
        pub method: FoundBy,
        /// Independence test, such as `gpdc`.
        pub cond_ind_test: String,
        /// Significance level of a link.
        pub alpha: f64,
        /// Significance level of the condition selection; `None` if a score chose it per variable.
        pub pc_alpha: Option<f64>,
        /// Significance level of the transfer-entropy filter; `None` without a filter.
        pub f_alpha: Option<f64>,
        /// Correction for multiple testing: `none` or `fdr_bh`.
        pub fdr: String,
        /// Smallest lag, in steps.
        pub tau_min: usize,
        /// Largest lag, in steps.
        pub tau_max: usize,
        /// Step between samples in seconds, if known.
        pub dt: Option<f64>,
        /// Samples that a test uses if no value is missing.
        pub n_samples: usize,
        /// Recordings analysed together. No lagged sample spans two recordings.
        pub n_recordings: usize,
        /// Seed of all random numbers.
        pub seed: u64,
        /// The other settings that were not the default, by their names in Python; empty: none, and absent in files.
        #[serde(default, skip_serializing_if = "Map::is_empty")]
        pub settings: Map<String, Value>,
        /// Run time in seconds; null in files, so that the same seed gives the same bytes.
        pub run_time_s: Option<f64>,
        /// Variables of the model, in the order of the matrices.
        pub features: Vec<String>,
        /// Variables that were analysed but have no link (left out of `features` by F-PCMCI).
        pub dropped: Vec<String>,
        /// The links found, in the order cause, effect, lag.
        pub links: Vec<Link>,
        /// Link marks, in files `""`, `-->`, `<--`, `o-o`, `x-x`; where causes may be hidden also `o->`, `<->`, `x->` and, at lag 0, others
        /// of these ends ([`LinkMark`](crate::LinkMark)).
        pub graph: Vec<Vec<Vec<LinkMark>>>,
        /// Whether each entry was tested; if not, why.
        #[serde(default)]
        pub outcomes: Vec<Vec<Vec<Outcome>>>,
        /// Strength of every tested pair; `None` if it was not tested.
        pub val_matrix: Vec<Vec<Vec<Option<f64>>>>,
        /// P-value of every tested pair; `None` if it was not tested.
        pub p_matrix: Vec<Vec<Vec<Option<f64>>>>,
        /// Samples that the test of each entry used; `None` if it was not tested, or this is not known.
        #[serde(default)]
        pub n_matrix: Vec<Vec<Vec<Option<usize>>>>,
        /// 1 where there is a link.
        pub causal_structure: Vec<Vec<Vec<i32>>>,
        /// Strength where there is a link; 1 for one that was required.
        pub val: Vec<Vec<Vec<f64>>>,
        /// P-value where there is a link; 0 for one that was required.
        pub pval: Vec<Vec<Vec<f64>>>,
        /// What a reader of the model should know, one sentence each.
        pub warnings: Vec<String>,
        /// What the data are like, if they were looked at.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub about_data: Option<DataProfile>,
        /// How often resamples found each link; in files its fields stand beside the others, null without resamples.
        #[serde(flatten, with = "confidence")]
        pub confidence: Option<Box<Confidence>>,
    }
}

/// One link of a [`Model`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Link {
    /// Name of the cause.
    pub cause: String,
    /// Name of the effect.
    pub effect: String,
    /// Steps from cause to effect.
    pub lag: usize,
    /// Strength; `None` if it was not tested.
    pub value: Option<f64>,
    /// P-value; `None` if it was not tested.
    pub p_value: Option<f64>,
    /// Samples that its test used, if known.
    #[serde(default)]
    pub n_used: Option<usize>,
    /// Mark: `-->`, or `o-o` / `x-x` if the direction at lag 0 is open; with hidden causes also `o->`, `<->` and others.
    /// [`Link::sentence`] says what it means.
    pub mark: LinkMark,
    /// Samples that the test of this link left out because a value was missing.
    pub n_lost: usize,
    /// Share of the resamples that have the link, whatever its mark; `None` without resamples.
    #[serde(default)]
    pub confidence: Option<f64>,
    /// The chance that it is real, by the p-values of its run; `None` where that was not measured (docs/confidence.md), and of a
    /// variable with its own past.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chance: Option<f64>,
    /// Lower end of the strength's interval of 90 %: the spread of the resamples, around the strength of all rows.
    #[serde(default)]
    pub value_low: Option<f64>,
    /// Upper end of that interval.
    #[serde(default)]
    pub value_high: Option<f64>,
    /// How much of the effect the cause moves, in the variables' units; of a model with resamples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<LinkSize>,
    /// Of a model that rolls on: stamp in seconds from which on the link is in every model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since: Option<f64>,
    /// Of a model that rolls on: how many of the last eight models have the link.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seen: Option<usize>,
    /// Whether it was required beforehand: then it was not tested.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub required: bool,
}

/// How much more of an effect goes with more of its cause, the effect's other causes being the same; in the variables' units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinkSize {
    /// This much more of the cause.
    pub step: f64,
    /// Gives this much more of the effect.
    pub change: f64,
    /// Lower end of the change's interval of 95 %.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Link {
    /// Its strength as it is drawn and ordered by: 1 if it was not tested.
    pub fn drawn_strength(&self) -> f64 {
        self.value.unwrap_or(1.0)
    }

    /// Its strength with this many decimals, or that it was not tested.
    pub fn strength_in_words(&self, decimals: usize) -> String {
        match self.value {
            Some(value) => format!("{value:.decimals$}"),
            None => (if self.required { "required" } else { "not tested" }).to_owned(),
        }
    }

    /// `likely (probability 62 %)`; no word where the chance was not measured.
    pub fn word(&self) -> Option<String> {
        // Neither 0 nor 100: it is never that sure.
        let percent = |chance: f64| (100.0 * chance).clamp(1.0, 99.0);
        self.chance.map(|of| format!("{} (probability {:.0} %)", word_of(of.max(0.1)), percent(of)))
    }

    /// Its size: `0.1 more h_risk: 0.05 to 0.2 less h_v`.
    pub fn size_in_words(&self) -> Option<String> {
        let LinkSize { step, low, high, .. } = self.size?;
        let (cause, effect) = (plain(&self.cause), plain(&self.effect));
        let number = |value: f64| {
            let digits = (1.0 - libm::log10(value.abs().max(1e-12)).floor()).clamp(0.0, 12.0) as usize;
            let text = format!("{value:.digits$}");
            if text.contains('.') {
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            } else {
                text
            }
        };
        Some(match (low > 0.0, high < 0.0) {
            (true, _) => {
                format!("{} more {cause}: {} to {} more {effect}", number(step), number(low), number(high))
            }
            (_, true) => {
                format!("{} more {cause}: {} to {} less {effect}", number(step), number(-high), number(-low))
            }
            _ => format!("{} more {cause}: no steady direction of {effect}", number(step)),
        })
    }

    /// What its mark means, in a plain sentence.
    ///
    /// ```
    /// use roscausal_discovery::{Link, LinkMark};
    ///
    /// let (cause, effect) = ("h_risk".to_owned(), "h_v".to_owned());
    /// let link = Link { cause, effect, lag: 1, mark: LinkMark::Bidirected, ..Link::default() };
    /// assert_eq!(link.sentence(), "h_risk and h_v: something not recorded drives both");
    /// ```
    pub fn sentence(&self) -> String {
        let (a, b) = (&self.cause, &self.effect);
        match self.mark {
            LinkMark::Forward => format!("{a} causes {b}"),
            LinkMark::Bidirected => format!("{a} and {b}: something not recorded drives both"),
            LinkMark::CircleHead => {
                format!("{a} causes {b}, or something not recorded drives both, or both of this")
            }
            LinkMark::Unoriented => format!("{a} and {b} depend on each other; the data do not say how"),
            LinkMark::ConflictHead => {
                format!("{b} does not cause {a}; whether {a} causes {b} the data contradict themselves")
            }
            LinkMark::Conflict => {
                format!("{a} and {b} depend on each other; the data contradict themselves on how")
            }
            LinkMark::ConflictCircle | LinkMark::CircleConflict => {
                format!("{a} and {b} depend on each other; what the data say of how is partly contradictory")
            }
            _ => format!("{a} and {b} are associated"),
        }
    }
}

/// Matrices of a run in tigramite's layout, `[cause][effect][lag 0..=tau_max]`.
#[derive(Default)]
pub struct Matrices {
    /// Link marks.
    pub graph: Vec<Vec<Vec<LinkMark>>>,
    /// Strengths; what they are where nothing was tested does not matter, but 1 where a link was required.
    pub val_matrix: Vec<Vec<Vec<f64>>>,
    /// P-values; 0 where a link was required.
    pub p_matrix: Vec<Vec<Vec<f64>>>,
    /// What was tested; empty: all pairs and lags from `tau_min` on.
    pub outcomes: Vec<Vec<Vec<Outcome>>>,
    /// Samples of each test; empty if not known.
    pub samples: Vec<Vec<Vec<Option<SampleCount>>>>,
}

impl Matrices {
    /// The outcome of each entry of `n` variables.
    fn all_outcomes(&mut self, n: usize, [tau_min, tau_max]: [usize; 2]) -> Vec<Vec<Vec<Outcome>>> {
        let asked = |[i, j, lag]: [usize; 3]| lag >= tau_min && (lag > 0 || i != j);
        let of = |at| if asked(at) { Outcome::Tested } else { Outcome::NotAsked };
        match self.outcomes.is_empty() {
            true => nested(&(0..n).collect::<Vec<_>>(), tau_max + 1, of),
            false => std::mem::take(&mut self.outcomes),
        }
    }

    /// The numbers where something was tested.
    fn of_tested(matrix: &[Vec<Vec<f64>>], outcomes: &[Vec<Vec<Outcome>>]) -> Vec<Vec<Vec<Option<f64>>>> {
        let vars: Vec<usize> = (0..outcomes.len()).collect();
        let n_lags = outcomes.iter().flatten().map(Vec::len).max().unwrap_or(0);
        let tested = |[i, j, lag]: [usize; 3]| outcomes[i][j][lag] == Outcome::Tested;
        nested(&vars, n_lags, |at| tested(at).then(|| matrix[at[0]][at[1]][at[2]]))
    }

    /// A matrix of the message, `[lag][effect][cause]`: 0 where the effect has no link from the cause.
    fn by_lag<T: Default>(
        &self,
        n: usize,
        lags: std::ops::RangeInclusive<usize>,
        pick: impl Fn([usize; 3]) -> T,
    ) -> Vec<Vec<Vec<T>>> {
        let entry = |lag: usize, effect: usize, cause: usize| {
            let mark = self.graph[cause][effect].get(lag).copied().unwrap_or_default();
            if points_to_effect(mark) { pick([cause, effect, lag]) } else { T::default() }
        };
        let row = |lag, effect| (0..n).map(|cause| entry(lag, effect, cause)).collect();
        lags.map(|lag| (0..n).map(|effect| row(lag, effect)).collect()).collect()
    }
}

/// A matrix in this layout, of some of the variables.
pub(crate) fn nested<T>(vars: &[usize], n_lags: usize, at: impl Fn([usize; 3]) -> T) -> Vec<Vec<Vec<T>>> {
    let lags = |i, j| (0..n_lags).map(|lag| at([i, j, lag])).collect();
    vars.iter().map(|&i| vars.iter().map(|&j| lags(i, j)).collect()).collect()
}

/// The entries of such a matrix with their places: cause, effect and lag.
pub(crate) fn cells<T>(matrix: &[Vec<Vec<T>>]) -> impl Iterator<Item = ([usize; 3], &T)> {
    let rows = matrix.iter().enumerate();
    let pairs = rows.flat_map(|(i, of)| of.iter().enumerate().map(move |(j, lags)| (i, j, lags)));
    pairs.flat_map(|(i, j, lags)| lags.iter().enumerate().map(move |(lag, entry)| ([i, j, lag], entry)))
}

impl Model {
    /// The model with the settings in its notes as a surface spells them.
    #[must_use]
    pub fn spelled(mut self, spell: impl Fn(&str) -> String) -> Self {
        let remarks = self.about_data.iter_mut().flat_map(|profile| &mut profile.remarks);
        self.warnings.iter_mut().chain(remarks).for_each(|note| *note = spelled_out(note, &spell));
        self
    }

    /// The level that decided on the links: `pc_alpha` where the method has no other; `None` if a score chose it for each variable.
    pub fn link_level(&self) -> Option<f64> {
        if self.method.decides_by_pc_alpha() { self.pc_alpha } else { Some(self.alpha) }
    }

    /// Where a cause and an effect stand among its features.
    pub(crate) fn places(&self, cause: &str, effect: &str) -> Option<(usize, usize)> {
        let place = |name: &str| self.features.iter().position(|feature| feature == name);
        Some((place(cause)?, place(effect)?))
    }

    /// The name of [`Model::link_level`], and the level as text.
    pub fn link_level_in_words(&self) -> (&'static str, String) {
        let name = if self.method.decides_by_pc_alpha() { "pc_alpha" } else { "alpha" };
        (name, self.link_level().map_or("chosen by a score".to_owned(), |level| level.to_string()))
    }

    /// Puts the matrices of a run into the model, and derives the links and the matrices of the message from them.
    #[must_use]
    pub fn with_matrices(mut self, features: Vec<String>, mut matrices: Matrices) -> Self {
        let n = features.len();
        let outcomes = matrices.all_outcomes(n, [self.tau_min, self.tau_max]);
        let samples = |i: usize, j: usize, lag: usize| {
            let tested = outcomes[i][j][lag] == Outcome::Tested;
            matrices.samples.get(i).and_then(|to| to[j][lag]).filter(|_| tested)
        };
        let lags = || self.tau_min..=self.tau_max;
        self.val = matrices.by_lag(n, lags(), |[i, j, lag]| matrices.val_matrix[i][j][lag]);
        self.pval = matrices.by_lag(n, lags(), |[i, j, lag]| matrices.p_matrix[i][j][lag]);
        self.causal_structure = matrices.by_lag(n, lags(), |_| 1);
        self.links = Vec::new();
        for ([i, j, lag], &mark) in cells(&matrices.graph) {
            if !is_listed(mark, lag, i, j) {
                continue;
            }
            let tested = outcomes[i][j][lag] == Outcome::Tested;
            let samples = samples(i, j, lag);
            self.links.push(Link {
                cause: features[i].clone(),
                effect: features[j].clone(),
                lag,
                value: tested.then(|| matrices.val_matrix[i][j][lag]),
                p_value: tested.then(|| matrices.p_matrix[i][j][lag]),
                n_used: samples.map(|samples| samples.used),
                mark,
                n_lost: samples.map_or(0, |samples| samples.lost),
                required: outcomes[i][j][lag] == Outcome::Required,
                ..Link::default()
            });
        }
        let vars: Vec<usize> = (0..n).collect();
        self.n_matrix =
            nested(&vars, self.tau_max + 1, |[i, j, lag]| samples(i, j, lag).map(|samples| samples.used));
        self.features = features;
        self.graph = matrices.graph;
        self.val_matrix = Matrices::of_tested(&matrices.val_matrix, &outcomes);
        self.p_matrix = Matrices::of_tested(&matrices.p_matrix, &outcomes);
        self.outcomes = outcomes;
        self
    }

    /// How many entries have each outcome, those aside that the method does not look at. At lag 0 each pair counts once.
    pub fn outcome_counts(&self) -> Vec<(Outcome, usize)> {
        let mut counts: Vec<(Outcome, usize)> =
            Outcome::ALL.into_iter().map(|outcome| (outcome, 0)).collect();
        for (_, outcome) in cells(&self.outcomes).filter(|([i, j, lag], _)| *lag > 0 || i < j) {
            counts.iter_mut().filter(|(of, _)| of == outcome).for_each(|(_, count)| *count += 1);
        }
        counts.retain(|(outcome, count)| *count > 0 && *outcome != Outcome::NotAsked);
        counts
    }

    /// How many of them have this outcome.
    fn count_of(&self, outcome: Outcome) -> usize {
        self.outcome_counts().iter().find(|(of, _)| *of == outcome).map_or(0, |(_, count)| *count)
    }

    /// The fewest and the most samples that a test used; `None` if none was made, or this is not known.
    pub fn samples_used(&self) -> Option<(usize, usize)> {
        let used = || self.n_matrix.iter().flatten().flatten().flatten().copied();
        used().min().zip(used().max())
    }

    /// The partial correlation that tests of this model find in four of five such data, by Fisher's z at the fewest samples; `gpdc` needs 1.15
    /// times as much (120 linear systems of 150 and 400 samples). `None` for other tests, or where no one level decides.
    pub fn detectable(&self) -> Option<f64> {
        let factors = [("parcorr", 1.0), ("robustparcorr", 1.0), ("gpdc", 1.15)];
        let (_, factor) = factors.into_iter().find(|(test, _)| *test == self.cond_ind_test)?;
        let level = self.link_level().filter(|_| self.fdr == "none")?;
        let (fewest, _) = self.samples_used().filter(|(fewest, _)| *fewest > 10)?;
        let needed = normal_quantile(1.0 - level / 2.0) + normal_quantile(0.8);
        Some(libm::tanh(factor * needed / (fewest as f64 - 3.0).sqrt()))
    }

    /// Whether its strengths have a sign that says in which direction an effect goes.
    pub fn has_sign(&self) -> bool {
        let of_test = ["parcorr", "robustparcorr", "parcorrwls"].contains(&self.cond_ind_test.as_str());
        of_test || self.method.method().is_some_and(|method| !method.info().uses_test)
    }

    /// P-values below this are indistinguishable ([`smallest_p`]).
    pub fn smallest_p(&self) -> f64 {
        smallest_p(&self.cond_ind_test)
    }

    /// The model as pretty JSON with a final newline, without the run time: same seed, same bytes.
    pub fn to_file_json(&self) -> String {
        Self { run_time_s: None, ..self.clone() }.to_json()
    }

    /// The model and its [`Summary`] as pretty JSON with a final newline.
    pub fn to_json(&self) -> String {
        #[derive(Serialize)]
        struct Whole<'a> {
            #[serde(flatten)]
            model: &'a Model,
            summary: Summary,
        }
        let whole = Whole { model: self, summary: self.summary().spelled(str::to_owned) };
        // A struct of strings, numbers and lists always serialises.
        let mut json = serde_json::to_string_pretty(&whole).unwrap_or_default();
        json.push('\n');
        json
    }
}

/// Whether this entry stands for its link in the list: at lag 0 each pair is twice in the matrix, and a link with a direction
/// is listed from its cause.
fn is_listed(mark: LinkMark, lag: usize, i: usize, j: usize) -> bool {
    mark.ends().is_some_and(|(left, right)| match (left == LinkEnd::Head, right == LinkEnd::Head) {
        (false, true) => true,
        (true, false) => false,
        _ => lag > 0 || i < j,
    })
}

/// Whether a mark is a link that the effect may have from the cause (`<--` is the mirror image of another entry, and behind
/// `<->` is something that was not recorded).
fn points_to_effect(mark: LinkMark) -> bool {
    mark.ends().is_some_and(|(left, _)| left != LinkEnd::Head)
}

/// A model of two features without links, for tests.
#[cfg(test)]
pub(crate) fn example() -> Model {
    let marks = |links: &[(usize, usize)]| -> Vec<Vec<Vec<LinkMark>>> {
        let mark = |i, j| if links.contains(&(i, j)) { LinkMark::Forward } else { LinkMark::Absent };
        (0..3).map(|i| (0..3).map(|j| vec![LinkMark::Absent, mark(i, j)]).collect()).collect()
    };
    let graph = marks(&[(0, 0), (1, 1), (0, 1), (1, 0), (2, 0), (0, 2)]);
    let numbers = |v: f64| vec![vec![vec![0.0, v]; 3]; 3];
    let model = Model {
        schema: SCHEMA.into(),
        method: "pcmci".into(),
        cond_ind_test: "gpdc".into(),
        alpha: 0.05,
        pc_alpha: Some(0.2),
        fdr: "none".into(),
        tau_min: 1,
        tau_max: 1,
        dt: Some(0.3),
        n_samples: 498,
        n_recordings: 1,
        seed: 1,
        run_time_s: Some(0.1),
        ..Model::default()
    };
    let names = ["h_v", "h_dg", "h_risk"].map(str::to_owned).to_vec();
    model.with_matrices(
        names,
        Matrices { graph, val_matrix: numbers(0.49), p_matrix: numbers(0.001), ..Matrices::default() },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_messages_matrices_have_effects_in_rows() {
        let model = example();
        // h_risk (2) drives h_v (0), h_dg (1) does not drive h_risk (2).
        assert_eq!(model.causal_structure[0][0][2], 1);
        assert_eq!(model.causal_structure[0][2][1], 0);
        assert_eq!(model.val[0][2][1], 0.0);
        assert_eq!(model.links.len(), 6);
        assert_eq!((model.links[0].cause.as_str(), model.links[0].lag), ("h_v", 1));
    }

    #[test]
    fn the_level_that_decided_is_told_by_its_name_also_where_both_are_equal() {
        let reported = |method: &str, pc_alpha| {
            let method = method.into();
            Model { method, pc_alpha, ..example() }.link_level_in_words()
        };
        assert_eq!(reported("pcmci", Some(0.2)), ("alpha", "0.05".to_owned()));
        assert_eq!(reported("pcmciplus", Some(0.05)), ("pc_alpha", "0.05".to_owned()));
        assert_eq!(reported("lpcmci", None), ("pc_alpha", "chosen by a score".to_owned()));
    }

    #[test]
    fn an_undirected_pair_is_listed_once() {
        let o = |mark: &str| vec![mark.parse::<LinkMark>().unwrap()];
        let graph = vec![vec![o(""), o("o-o")], vec![o("o-o"), o("")]];
        let half = vec![vec![vec![0.5]; 2]; 2];
        let matrices = Matrices { graph, val_matrix: half.clone(), p_matrix: half, ..Matrices::default() };
        let model = Model { tau_min: 0, tau_max: 0, ..example() }
            .with_matrices(vec!["a".into(), "b".into()], matrices);
        assert_eq!(model.links.len(), 1);
        assert_eq!(model.causal_structure, [[[0, 1], [1, 0]]]);
    }

    #[test]
    fn a_hidden_common_cause_is_listed_once_and_is_no_cause() {
        let o = |lag0: &str, lag1: &str| [lag0, lag1].map(|mark| mark.parse::<LinkMark>().unwrap()).to_vec();
        let graph = vec![vec![o("", ""), o("<->", "<->")], vec![o("<->", "o->"), o("", "")]];
        let half = vec![vec![vec![0.5; 2]; 2]; 2];
        let matrices = Matrices { graph, val_matrix: half.clone(), p_matrix: half, ..Matrices::default() };
        let model = Model { tau_min: 0, tau_max: 1, ..example() }
            .with_matrices(vec!["a".into(), "b".into()], matrices);
        let listed: Vec<_> = model.links.iter().map(|link| (link.lag, link.mark.symbol())).collect();
        assert_eq!(listed, [(0, "<->"), (1, "<->"), (1, "o->")]);
        assert_eq!(model.causal_structure, [[[0, 0], [0, 0]], [[0, 1], [0, 0]]]);
    }

    #[test]
    fn a_file_reads_back_as_the_same_model() {
        let model = Model { run_time_s: None, ..example() };
        let read: Model = serde_json::from_str(&model.to_file_json()).expect("reads");
        assert_eq!(read, model);
        assert_eq!(read.val_matrix[0][1], [None, Some(0.49)]);
        // One without variables, too: nothing came through the filter.
        let dropped = read.features.clone();
        let blank = Model { dropped, ..read.with_matrices(vec![], Matrices::default()) };
        let blank = Model { causal_structure: vec![], val: vec![], pval: vec![], ..blank };
        assert!(Model::from_json(blank.to_file_json().as_bytes()).is_ok());
    }
}
