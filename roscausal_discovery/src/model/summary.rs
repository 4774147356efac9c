//! What may be said of a model: a conclusion, the links that stand out, what to do next. It is data; each surface writes it in its way.
//!
//! 1. A link between two variables has a word. Where its chance was measured, that of the chance. Else its p-value must stand out among
//!    all tests of the run (Benjamini and Hochberg), and half of the resamples must have it, where there are any; then it is `beyond
//!    chance`. What does not stand out is `may be chance`, and nothing is claimed of it; nor of dependence, which is no cause.
//! 2. The conclusion has at most [`MOST_SENTENCES`]: what is claimed, firmest first, and what would look the same; what chance gives;
//!    what is wrong with the data or was not tested.
//! 3. The advice is ordered by what it would change: the time budget, longer lags, a period, the number of tests, more rows, causes that
//!    were not recorded.
//!
//! Example: eight series that have nothing to do with each other give 13 links at level 0.05. Each may be chance, and the conclusion
//! says so first.

use ndarray::Array3;
use serde::Serialize;

use super::{Advice, Link, Model, Outcome, cells, word_of};
use crate::{
    later::{Later, Within},
    methods::{Method, MethodInfo, Reads, Status, fdr_bh},
    profile::{DataProfile, FEW},
    types::{LinkMark, Named, add_new, names::plain, spelled_out, text::listed, time_in_words},
    unsteady::Unsteady,
};

/// Sentences of a conclusion, pieces of advice, and pairs that a sentence names; at most.
const MOST_SENTENCES: usize = 5;
const MOST_ADVICE: usize = 3;
const MOST_NAMED: usize = 4;
/// The words of links, firmest first.
const WORDS: [&str; 7] =
    ["firm", "given", "beyond chance", "likely", "without a p-value", "unsure", "may be chance"];
/// So many of the words are claims.
const CLAIMS: usize = 5;
/// Chance is not mentioned where it gives fewer links.
const FEW_BY_CHANCE: f64 = 0.5;

/// What may be said of a model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// How it was found: method, test, level, lags, samples.
    pub headline: String,
    /// At most five sentences for a reader who knows no statistics.
    pub conclusion: Vec<String>,
    /// The links between two variables, firmest first.
    pub links: Vec<SummaryLink>,
    /// The variables that depend on their own past.
    pub own_past: Vec<String>,
    /// At most three pieces of advice, what would change most first.
    pub advice: Vec<SummaryAdvice>,
    /// What the data is like; `None` if nobody looked.
    pub about_data: Option<String>,
    /// What else a reader should know of the analysis, each once.
    pub notes: Vec<String>,
}

/// A link between two variables.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SummaryLink {
    /// Name of the cause.
    pub cause: String,
    /// Name of the effect.
    pub effect: String,
    /// Steps from cause to effect.
    pub lag: usize,
    /// The same in seconds, if the step is known.
    pub seconds: Option<f64>,
    /// Its mark, such as `-->`.
    pub mark: LinkMark,
    /// Strength; `None` if it was not tested.
    pub value: Option<f64>,
    /// P-value; `None` if it was not tested.
    pub p_value: Option<f64>,
    /// Samples of its test; `None` if they are not known.
    pub samples: Option<usize>,
    /// `firm`, `given` (required beforehand), `beyond chance`, `likely`, `without a p-value`, `unsure` or `may be chance`.
    pub sure: &'static str,
    /// The chance that it is real, where that was measured.
    pub chance: Option<f64>,
    /// Share of the resamples that have it; `None` without resamples.
    pub confidence: Option<f64>,
}

/// What to do next.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SummaryAdvice {
    /// What it is about: `time_budget`, `tau_max`, `tau_min`, `season`, `rows`, `fdr`, `record_longer`, `method` or `resamples`.
    pub about: &'static str,
    /// It in words.
    pub text: String,
}

impl SummaryLink {
    /// Whether the link may be claimed.
    pub fn is_claim(&self) -> bool {
        WORDS[..CLAIMS].contains(&self.sure)
    }
}

impl Summary {
    /// The summary with the settings in its texts as a surface spells them.
    #[must_use]
    pub fn spelled(mut self, spell: impl Fn(&str) -> String) -> Self {
        let advice = self.advice.iter_mut().map(|one| &mut one.text);
        let texts =
            self.conclusion.iter_mut().chain(&mut self.about_data).chain(&mut self.notes).chain(advice);
        texts.for_each(|text| *text = spelled_out(text, &spell));
        self
    }
}

impl Model {
    /// What may be said of this model.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use roscausal_discovery::{Control, DataFrame, Settings, analyse, methods::Method};
    ///
    /// let mut noise = (1_u64..).map(|k| ((k.wrapping_mul(6_364_136_223_846_793_005) >> 33) % 1000) as f64 / 500.0 - 1.0);
    /// let mut x = Array2::from_shape_fn((300, 2), |_| noise.next().unwrap_or_default());
    /// (1..300).for_each(|t| x[[t, 1]] += 2.0 * x[[t - 1, 0]]);
    /// let data = DataFrame::new(vec![x], vec!["a".into(), "b".into()])?;
    /// let settings = Settings { method: Method::Pcmci, cond_ind_test: "parcorr".into(), ..Settings::default() };
    /// let summary = analyse(&data, &settings, &Control::default())?.summary();
    /// assert!(summary.conclusion[0].contains("a drives b 1 row later (more gives more)"), "{summary:?}");
    /// # Ok::<(), roscausal_discovery::Error>(())
    /// ```
    pub fn summary(&self) -> Summary {
        let of = Facts::of(self);
        Summary {
            headline: self.headline(),
            conclusion: of.conclusion(),
            own_past: of.own_past(),
            advice: of.advice(),
            about_data: of.about_data(),
            notes: of.notes(),
            links: of.links,
        }
    }

    /// How it was found: `PCMCI with parcorr (alpha 0.05, lags 1..3) on 498 samples: 4 links between variables`.
    fn headline(&self) -> String {
        let step = self.step_in_words().map_or(String::new(), |step| format!(" at steps of {step}"));
        let recordings = match self.n_recordings {
            1 => String::new(),
            n if self.settings.get("levels").is_some_and(|levels| levels == "remove") => {
                format!(" from {n} recordings without their own levels")
            }
            n => format!(" from {n} recordings"),
        };
        let tested = self.count_of(Outcome::Tested) > 0;
        let samples = match self.samples_used() {
            Some((fewest, most)) if fewest == most => most.to_string(),
            Some((fewest, most)) => format!("{fewest} to {most}"),
            None if tested || self.features.is_empty() => self.n_samples.to_string(),
            None => format!("0 of {}", self.n_samples),
        };
        let (level_name, level) = self.link_level_in_words();
        let fdr = if self.fdr == "none" { String::new() } else { format!(" corrected by {}", self.fdr) };
        let (method, test) = (self.method.name().to_uppercase(), &self.cond_ind_test);
        let links = count(self.links.iter().filter(|link| link.cause != link.effect).count(), "link");
        format!(
            "{method} with {test} ({level_name} {level}{fdr}, lags {}..{}) on {samples} samples{recordings}{step}: {links} between variables",
            self.tau_min, self.tau_max
        )
    }

    /// The step between rows in words, where it is known: `0.100 s`, `1 day`.
    pub fn step_in_words(&self) -> Option<String> {
        let dt = self.dt?;
        let step = self.lag_in_words(1);
        let is_plain = step.ends_with(" s") && (0.005..1000.0).contains(&dt);
        Some(if is_plain { format!("{dt:.3} s") } else { step })
    }

    /// `lag` steps in words: `0.2 s`, `3 days`, `2 rows`.
    pub fn lag_in_words(&self, lag: usize) -> String {
        self.dt.map_or_else(|| count(lag, "row"), |dt| time_in_words(dt, lag))
    }
}

/// `1 link`, `2 links`.
fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// Whether the method finds dependence, of which nothing is claimed.
fn only_dependence(model: &Model) -> bool {
    model.method.method() == Some(Method::Lagdep)
}

/// What the parts of a summary are made from.
struct Facts<'a> {
    model: &'a Model,
    info: Option<&'static MethodInfo>,
    links: Vec<SummaryLink>,
    /// P-values of the tests between two variables, 1 where a filter let nothing through, and how many stand out.
    p_values: Vec<f64>,
    stand_out: usize,
    /// The level that decides on a link.
    level: f64,
}

impl<'a> Facts<'a> {
    fn of(model: &'a Model) -> Self {
        let level = model.link_level().unwrap_or(model.alpha);
        let info = model.method.method().map(Method::info);
        let between = |([i, j, lag], _): &([usize; 3], _)| i != j && (*lag > 0 || i < j);
        let mut p_values: Vec<f64> = cells(&model.p_matrix).filter(between).filter_map(|(_, p)| *p).collect();
        let filtered = model.count_of(Outcome::Filtered);
        let (n, dropped) = (model.features.len(), model.dropped.len());
        let pairs = |n: usize| {
            n * n.saturating_sub(1) * (model.tau_max + 1 - model.tau_min.max(1).min(model.tau_max))
        };
        p_values.extend(vec![1.0; filtered + pairs(n + dropped).saturating_sub(pairs(n))]);
        // The largest p-value that stands out among all.
        let of_all = Array3::from_shape_vec((1, 1, p_values.len()), p_values.clone()).unwrap_or_default();
        let corrected = match model.fdr.as_str() {
            "none" => fdr_bh(&of_all, &of_all.mapv(|_| true)),
            _ => of_all,
        };
        let out = || p_values.iter().zip(&corrected).filter(|(_, corrected)| **corrected <= level);
        let largest = out().map(|(p, _)| *p).fold(-1.0, f64::max);
        let stand_out = out().count();
        let has_p = info.is_none_or(|info| info.p_values);
        let only_dependence = only_dependence(model);
        let sure = |link: &Link| match (link.chance, link.p_value) {
            _ if link.required => "given",
            (Some(chance), _) => word_of(chance.max(0.1)),
            _ if only_dependence || link.confidence.is_some_and(|share| share < 0.5) => "unsure",
            _ if !has_p => "without a p-value",
            (None, Some(p)) if p <= largest => "beyond chance",
            _ => "may be chance",
        };
        let summarised = |link: &Link| SummaryLink {
            cause: plain(&link.cause),
            effect: plain(&link.effect),
            lag: link.lag,
            seconds: model.dt.map(|dt| dt * link.lag as f64),
            mark: link.mark,
            value: link.value,
            p_value: link.p_value,
            samples: link.n_used,
            sure: sure(link),
            chance: link.chance,
            confidence: link.confidence,
        };
        let mut links: Vec<_> =
            model.links.iter().filter(|link| link.cause != link.effect).map(summarised).collect();
        let place =
            |link: &SummaryLink| WORDS.iter().position(|word| *word == link.sure).unwrap_or(WORDS.len());
        let number = |value: Option<f64>| value.unwrap_or(0.0);
        links.sort_by(|a, b| {
            (place(a).cmp(&place(b)))
                .then(number(b.chance).total_cmp(&number(a.chance)))
                .then(number(b.confidence).total_cmp(&number(a.confidence)))
                .then(number(b.value).abs().total_cmp(&number(a.value).abs()))
        });
        Self { model, info, links, p_values, stand_out, level }
    }

    fn own_past(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for link in self.model.links.iter().filter(|link| link.cause == link.effect) {
            add_new(&mut names, plain(&link.cause));
        }
        names
    }

    /// The links that chance alone would give, where that is worth a word.
    fn by_chance(&self) -> Option<f64> {
        let by_chance = self.level * self.p_values.len() as f64;
        let is_one = self.model.fdr == "none" && self.model.link_level().is_some();
        (is_one && self.info.is_none_or(|info| info.p_values) && by_chance >= FEW_BY_CHANCE)
            .then_some(by_chance)
    }

    fn conclusion(&self) -> Vec<String> {
        let model = self.model;
        let mut reported: Vec<String> =
            WORDS[..CLAIMS].iter().filter_map(|word| self.claimed(word)).collect();
        let claims = self.links.iter().filter(|link| link.is_claim()).count();
        if claims > 0 && self.info.is_some_and(|info| !info.hidden_causes) {
            reported.push("Each may instead come of something not recorded that drives both.".into());
        }
        if self.links.is_empty() {
            reported.push(self.nothing_found());
        } else {
            reported.extend(self.left_to_chance(claims));
        }
        if model.status != Status::Complete {
            reported.push(format!("This result is {}.", model.status));
        }
        let [later, season, unsteady] = self.seen();
        reported.extend(later.map(|found| format!("Seen, but not tested: {found}.")));
        reported.extend(self.within());
        reported.extend([season, unsteady].into_iter().flatten().map(|found| found + "."));
        reported.extend(self.drifting());
        if self.links.is_empty() {
            reported.extend(self.missed());
        }
        reported.extend(self.untested());
        if claims > 0 && !model.has_sign() && self.info.is_some_and(|info| info.uses_test) {
            let test = &model.cond_ind_test;
            reported.push(format!("{test} sees any form: whether more gives more or less it does not say."));
        }
        reported.truncate(MOST_SENTENCES);
        reported
    }

    /// Which of the claims' variables drift, of two that both do: that alone may link them.
    fn drifting(&self) -> Option<String> {
        let profile = self.model.about_data.as_ref()?;
        let drift = |of: &&SummaryLink| of.is_claim() && profile.both_drift([&of.cause, &of.effect]);
        let mut names: Vec<String> = Vec::new();
        for link in self.links.iter().filter(drift) {
            [&link.cause, &link.effect].into_iter().for_each(|name| add_new(&mut names, name.clone()));
        }
        let (detrend, difference) = (Named("detrend"), Named("difference"));
        (!names.is_empty()).then(|| {
            format!(
                "{} drift, which alone may link them: {detrend} or {difference} takes it out.",
                listed(&names)
            )
        })
    }

    /// The pairs of which something is claimed with this word.
    fn claimed(&self, word: &str) -> Option<String> {
        let mut pairs: Vec<Vec<&SummaryLink>> = Vec::new();
        for link in self.links.iter().filter(|link| link.sure == word) {
            let same = |of: &&mut Vec<&SummaryLink>| {
                let (there, back) = ((&of[0].cause, &of[0].effect), (&of[0].effect, &of[0].cause));
                let is_pair = [there, back].map(|pair| pair == (&link.cause, &link.effect));
                of[0].mark == link.mark && (is_pair[0] || (is_pair[1] && link.mark == LinkMark::Bidirected))
            };
            match pairs.iter_mut().find(same) {
                Some(pair) => pair.push(link),
                None => pairs.push(vec![link]),
            }
        }
        let named: Vec<String> = pairs.iter().take(MOST_NAMED).map(|pair| self.phrase(pair)).collect();
        let more = match pairs.len().saturating_sub(MOST_NAMED) {
            0 => String::new(),
            more => format!("; and {} more", count(more, "pair")),
        };
        let mut word = word.to_owned();
        word[..1].make_ascii_uppercase();
        (!named.is_empty()).then(|| format!("{word}: {}{more}.", named.join("; ")))
    }

    /// `a drives b 0.1 s later (more gives less)`.
    fn phrase(&self, pair: &[&SummaryLink]) -> String {
        let (cause, effect) = (&pair[0].cause, &pair[0].effect);
        let mut lags: Vec<usize> = pair.iter().map(|link| link.lag).collect();
        lags.sort_unstable();
        let later: Vec<String> =
            lags.iter().filter(|lag| **lag > 0).map(|lag| self.model.lag_in_words(*lag)).collect();
        let mut when: Vec<String> =
            lags.iter().filter(|lag| **lag == 0).map(|_| "at the same time".into()).collect();
        when.extend((!later.is_empty()).then(|| format!("{} later", listed(&later))));
        let when = listed(&when);
        match pair[0].mark {
            LinkMark::Forward => format!("{cause} drives {effect} {when}{}", self.sign(pair)),
            LinkMark::CircleHead => {
                format!("{cause} drives {effect} {when}, or something not recorded drives both")
            }
            LinkMark::Bidirected => format!("something not recorded drives {cause} and {effect}"),
            _ => format!("{cause} and {effect} depend on each other {when}, which drives which is open"),
        }
    }

    /// In which direction an effect goes, where the test tells.
    fn sign(&self, pair: &[&SummaryLink]) -> &'static str {
        let all = |is: fn(f64) -> bool| pair.iter().all(|link| link.value.is_some_and(is));
        match self.model.has_sign() {
            true if all(|value| value > 0.0) => " (more gives more)",
            true if all(|value| value < 0.0) => " (more gives less)",
            _ => "",
        }
    }

    /// Of the links that are no claims, and what chance gives.
    fn left_to_chance(&self, claims: usize) -> Option<String> {
        let (all, rest) = (self.links.len(), self.links.len() - claims);
        let chances: Vec<f64> = self.links.iter().filter_map(|link| link.chance).collect();
        let real = match chances.len() {
            0 => String::new(),
            n => format!(", and about {:.1} of the {n} found are real", chances.iter().sum::<f64>()),
        };
        let why = self.by_chance().map(|links| {
            let of = self.p_values.len();
            format!("of {of} pairs and lags chance alone would link {links:.1} at {}{real}", self.level)
        });
        let because = why.as_ref().map_or(String::new(), |why| format!(": {why}"));
        if only_dependence(self.model) {
            return Some(format!(
                "{} of pairs and lags, which is no cause: a past of their own, or a third variable, is enough for it.",
                count(all, "dependence")
            ));
        }
        match rest {
            0 => why.map(|why| format!("O{}.", &why[1..])),
            _ if claims == 0 => Some(format!(
                "None of the links between two variables ({all} found) stands out from chance, so report none{because}."
            )),
            _ => {
                let (is, it) = if rest == 1 { ("is", "it") } else { ("are", "them") };
                Some(format!("{} more {is} no finding, so do not report {it}{because}.", count(rest, "link")))
            }
        }
    }

    /// That there is no link, as far as anything was tested.
    fn nothing_found(&self) -> String {
        let model = self.model;
        let all: usize = model.outcome_counts().iter().map(|(_, count)| count).sum();
        let tested = model.count_of(Outcome::Tested);
        let has_more = |profile: &DataProfile| !profile.later.is_empty() || !profile.within.is_empty();
        let is_later = model.about_data.as_ref().is_some_and(has_more);
        let (from, to) = (model.tau_min, model.tau_max);
        let lags = if from == to { format!("lag {to}") } else { format!("lags {from} to {to}") };
        match tested {
            0 if all > 0 || model.status != Status::Complete => {
                "No pair has a result, so nothing is known of any link.".to_owned()
            }
            _ if tested < all => {
                format!("No causal link found among the {tested} of {all} pairs and lags that were tested.")
            }
            _ if is_later => format!("No causal link found at {lags}."),
            // All variables were left out, by which of the two is told beside this.
            0 => "No causal link found: no variable passes both the filter and the test.".to_owned(),
            _ => {
                format!(
                    "No causal link found between two variables: every pair may be independent at {lags}."
                )
            }
        }
    }

    /// How strong a link must be to be found, where none is.
    fn missed(&self) -> Option<String> {
        let size = self.model.detectable()?;
        let a = if self.model.cond_ind_test == "gpdc" { "linear effect with a " } else { "" };
        Some(format!(
            "A {a}partial correlation of {size:.2} would be found in four of five such recordings; a weaker one may be missed."
        ))
    }

    /// What was not tested, and why.
    fn untested(&self) -> Option<String> {
        let why = |(outcome, count): (Outcome, usize)| Some(format!("{count}: {}", outcome.why_not()?));
        // What a filter let out is what the method found, unless there is nothing else.
        let is_worth = |(outcome, _): &(Outcome, usize)| *outcome != Outcome::Filtered;
        let reported: Vec<String> =
            self.model.outcome_counts().into_iter().filter(is_worth).filter_map(why).collect();
        (!reported.is_empty())
            .then(|| format!("Pairs and lags that were not tested: {}.", reported.join("; ")))
    }

    fn advice(&self) -> Vec<SummaryAdvice> {
        let model = self.model;
        let mut all = Vec::new();
        let mut add = |about, text: String| all.push(SummaryAdvice { about, text });
        if model.status != Status::Complete {
            let budget = Named("time_budget");
            add("time_budget", format!("Let it end: without {budget}, or with a longer one."));
        }
        if let Some(profile) = &model.about_data {
            if let Some(later) = profile.later.first() {
                add("tau_max", format!("Test longer lags: {} {}.", Named("tau_max"), later.tau_max));
            }
            if self.not_linked_within().next().is_some() {
                let (about, value) = match self.info {
                    Some(info) if info.tau_min == 0 => ("tau_min", "0"),
                    _ => ("method", Method::Pcmciplus.info().name),
                };
                add(about, format!("Test links within a row, too: {} {value}.", Named(about)));
            }
            if let Some(season) = &profile.season {
                let (flag, period) = (Named("season"), season.period);
                add("season", format!("Take the mean course of the period out: {flag} {period}."));
            }
            if let Some(way) = Unsteady::way_out(&profile.unsteady) {
                add("rows", way + ".");
            }
        }
        if model.status == Status::Complete && model.features.is_empty() {
            let (flag, method) = (Named("method"), Method::Pcmci);
            add("method", format!("Test all pairs, without the filter: {flag} {method}."));
        }
        let reads_fdr = self.info.is_some_and(|info| info.reads.contains(&Reads::Fdr));
        let weak = self.links.iter().filter(|link| !link.is_claim()).count();
        if reads_fdr && weak > 0 && self.by_chance().is_some() {
            let (flag, left) = (Named("fdr"), count(self.stand_out, "link"));
            add("fdr", format!("Correct for the number of tests: {flag} leaves {left}."));
        }
        if let Some(text) = self.longer() {
            add("record_longer", text);
        }
        let claims = self.links.iter().any(SummaryLink::is_claim);
        if claims && self.info.is_some_and(|info| !info.hidden_causes && info.uses_test) {
            let method = Named("method");
            add(
                "method",
                format!("Ask which links a cause that was not recorded could make: {method} lpcmci."),
            );
        }
        if claims && model.confidence.is_none() && self.links.iter().all(|link| link.chance.is_none()) {
            add("resamples", format!("Ask how steady the links are: {} 100.", Named("resamples")));
        }
        all.truncate(MOST_ADVICE);
        all
    }

    /// How much longer to record for the likeliest link that is not settled.
    fn longer(&self) -> Option<String> {
        let model = self.model;
        let Some(confidence) = &model.confidence else {
            let has_few = model.n_samples < FEW || (self.links.is_empty() && self.missed().is_some());
            return has_few.then(|| "Record longer, to find weaker links.".to_owned());
        };
        let chance = |of: &Advice| {
            let is_it = |link: &&SummaryLink| {
                (&link.cause, &link.effect, link.lag) == (&plain(&of.cause), &plain(&of.effect), of.lag)
            };
            self.links.iter().find(is_it).and_then(|link| link.chance).unwrap_or(of.confidence)
        };
        // What is as good as certain, or as good as absent, is no use of more rows; nor what as many would show again.
        let has_enough = |of: &Advice| of.n_needed.is_some_and(|needed| needed <= model.n_samples as f64);
        let is_open = |of: &&Advice| of.in_model && (0.1..0.9).contains(&chance(of)) && !has_enough(of);
        let open = confidence.advice.iter().filter(is_open).max_by(|a, b| chance(a).total_cmp(&chance(b)))?;
        let (cause, effect) = (plain(&open.cause), plain(&open.effect));
        let after = if open.lag == 0 { "at once".to_owned() } else { self.model.lag_in_words(open.lag) };
        Some(format!("Record longer for {cause} -> {effect} ({after}): {}.", open.sentence))
    }

    /// What the data have of longer lags, of a period and of changes.
    fn seen(&self) -> [Option<String>; 3] {
        let Some(profile) = &self.model.about_data else { return [const { None }; 3] };
        let dt = self.model.dt;
        let season = profile.season.as_ref().map(|season| season.found(dt));
        [Later::found(&profile.later, dt), season, Unsteady::found(&profile.unsteady, dt)]
    }

    /// The pairs without a link that depend within a row, which was not tested.
    fn not_linked_within(&self) -> impl Iterator<Item = &Within> {
        let is_linked = |[a, b]: &[String; 2]| {
            self.links.iter().any(|link| [[a, b], [b, a]].contains(&[&link.cause, &link.effect]))
        };
        let within = self.model.about_data.iter().flat_map(|profile| &profile.within);
        within.filter(move |one| !is_linked(&one.variables))
    }

    fn within(&self) -> Option<String> {
        let one = |Within { variables: [a, b], strength }: &Within| format!("{a} and {b} ({strength:.2})");
        let pairs: Vec<String> = self.not_linked_within().take(MOST_NAMED).map(one).collect();
        let more = if self.not_linked_within().count() > MOST_NAMED { " and others" } else { "" };
        (!pairs.is_empty()).then(|| {
            format!("Seen, but not tested: dependence within one row of {}{more}.", pairs.join(", "))
        })
    }

    fn about_data(&self) -> Option<String> {
        let profile = self.model.about_data.as_ref()?;
        let concluded: Vec<String> = self.seen().into_iter().flatten().collect();
        let stated = |remark: &&String| !concluded.iter().any(|found| remark.starts_with(found));
        let remarks: Vec<&str> = profile.remarks.iter().filter(stated).map(String::as_str).collect();
        let fewest = profile.variables.iter().map(|variable| variable.effective_samples);
        match (remarks.is_empty(), profile.remarks.is_empty()) {
            (false, _) => Some(remarks.join(". ")),
            (true, true) => Some(format!(
                "no drift, no stretches without change, no outliers; worth at least {:.0} independent samples",
                fewest.fold(f64::INFINITY, f64::min)
            )),
            (true, false) => Some("nothing else stands out".to_owned()),
        }
    }

    fn notes(&self) -> Vec<String> {
        let model = self.model;
        let mut notes = Vec::new();
        if !model.dropped.is_empty() {
            let names: Vec<String> = model.dropped.iter().map(|name| plain(name)).collect();
            notes.push(format!("left out, without a link to another variable: {}", names.join(", ")));
        }
        model.warnings.iter().for_each(|warning| add_new(&mut notes, warning.clone()));
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        model::example,
        profile::{DataProfile, VariableProfile},
    };

    #[test]
    fn what_is_not_beyond_chance_is_not_claimed() {
        let mut model = example();
        model.p_matrix.iter_mut().flatten().flatten().for_each(|p| *p = p.map(|_| 0.04));
        model.links.iter_mut().for_each(|link| link.p_value = Some(0.04));
        let all = model.summary();
        assert!(all.links.iter().all(|link| link.sure == "beyond chance"), "six of six below 0.05: {all:?}");
        for (i, j) in [(0, 1), (1, 2)] {
            model.p_matrix[i][j][1] = Some(0.9);
        }
        let few = model.summary();
        assert!(few.links.iter().all(|link| link.sure == "may be chance" && !link.is_claim()), "{few:?}");
        let none = "None of the links between two variables (4 found) stands out";
        assert!(few.conclusion[0].starts_with(none), "{few:?}");
    }

    #[test]
    fn a_claim_of_two_variables_that_drift_is_told_of_as_one() {
        let of = |kpss: f64| {
            let one = |name: &str| VariableProfile {
                name: name.into(),
                kpss: Some(kpss),
                ..VariableProfile::default()
            };
            let variables = vec![one("h_v"), one("h_dg"), one("h_risk")];
            let about_data = Some(DataProfile { variables, ..DataProfile::default() });
            Model { cond_ind_test: "parcorr".into(), about_data, ..example() }.summary().conclusion.join(" ")
        };
        assert!(of(1.0).contains("drift, which alone may link them") && !of(0.5).contains("drift"));
    }

    #[test]
    fn how_likely_a_link_is_real_is_not_called_chance() {
        // "chance 99 %" beside "may be chance" reads as if luck had made it.
        let word = Link { chance: Some(0.62), ..Link::default() }.word();
        assert_eq!(word.as_deref(), Some("likely (probability 62 %)"));
    }

    #[test]
    fn a_short_recording_is_advised_to_be_longer() {
        let of = |n_samples| Model { n_samples, ..example() }.summary().advice;
        let is_told = |n_samples| of(n_samples).iter().any(|one| one.text.starts_with("Record longer"));
        assert!(is_told(FEW - 1) && !is_told(FEW));
    }

    #[test]
    fn links_of_one_pair_are_one_phrase_and_selves_are_folded() {
        let summary = Model { cond_ind_test: "parcorr".into(), ..example() }.summary();
        assert_eq!(summary.own_past, ["h_v", "h_dg"]);
        assert!(
            summary.conclusion[0].contains("h_v drives h_dg 0.3 s later (more gives more)"),
            "{summary:?}"
        );
        assert!(summary.links.len() == 4 && summary.conclusion.len() <= MOST_SENTENCES);
        // It is of the claims, so nothing stands between.
        assert!(summary.conclusion[1].starts_with("Each may instead come of"), "{summary:?}");
    }
}
