//! What is known before the analysis, and how it tests: flags for settings of the engine that are seldom needed.

use std::{fs, path::PathBuf, sync::Arc};

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result};
use roscausal_discovery::{
    Assumption, DataFrame, LinkAssumptions, Model, Settings,
    independence_tests::{NullDistributions, Significance},
    methods::{ColliderRule, Method, Reads},
    names::{nearest, plain, position},
    vectors_of,
};
use serde::Deserialize;

/// Flags for what is known, and for how it is tested.
#[derive(ClapArgs, Clone, Debug, Default)]
pub(crate) struct AssumeArgs {
    /// File with what is known of links: required, forbidden, directed (docs/data.md).
    #[arg(long, value_name = "FILE.toml")]
    links: Option<PathBuf>,
    /// Largest set of conditions in the condition selection (lpcmci: beyond those that are always there); default: no limit.
    #[arg(long, value_name = "N")]
    max_conds: Option<usize>,
    /// lpcmci, candoit: sets of conditions of one size that are tested for a pair, from each of its ends; default: all.
    #[arg(long, value_name = "N")]
    max_sets: Option<usize>,
    /// candoit: contexts of interventions do not join their variables as conditions, which takes far fewer tests.
    #[arg(long)]
    no_extra_conditions: bool,
    /// How a test gives its p-value: analytic, shuffle, threshold (--alpha is then the threshold). Default: the test's own way.
    #[arg(long, value_name = "HOW")]
    significance: Option<String>,
    /// Surrogates of a shuffle test, or size of gpdc's null distribution, up to 1000000. Default: 500.
    #[arg(long, value_name = "N")]
    shuffles: Option<usize>,
    /// cmiknn: end the surrogates of a test once so many reach its value; the p-value is then their share of those drawn. Default:
    /// all are drawn.
    #[arg(long, value_name = "N")]
    shuffle_stop: Option<usize>,
    /// gpdc: null distributions to hold its values against, where the number of samples is one of theirs; columns separated by commas,
    /// the first row has the numbers of samples.
    #[arg(long, value_name = "FILE.csv")]
    null_dist: Option<PathBuf>,
    /// Variables of several columns, separated by commas, for --test parcorrmult: place=x+y.
    #[arg(long, value_name = "NAME=COLUMN+COLUMN", value_delimiter = ',')]
    vector: Vec<String>,
    /// pcmciplus, jpcmciplus: how colliders are found: majority, conservative, none.
    #[arg(long, value_name = "RULE")]
    collider_rule: Option<String>,
    /// pcmciplus, jpcmciplus: where orientations contradict each other, the first one stays (instead of the mark x-x).
    #[arg(long)]
    first_orientation: bool,
}

/// The file of `--links`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    /// No link may exist except those named here.
    #[serde(default)]
    only: bool,
    #[serde(default)]
    link: Vec<Rule>,
}

/// What is known of the links from a cause to an effect; `*` is any variable.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Rule {
    cause: String,
    effect: String,
    /// In steps; all if not given.
    lags: Option<Vec<usize>>,
    is: Kind,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Kind {
    /// It exists, and is not tested.
    Required,
    /// It does not exist.
    Forbidden,
    /// It may exist.
    Allowed,
    /// It may exist, and not the other way round.
    Directed,
}

impl AssumeArgs {
    /// Puts these flags into the settings for data with these variables.
    ///
    /// # Errors
    /// A file that cannot be read, names a variable that does not exist, or assumes what cannot be; a setting that the test or
    /// method does not have.
    pub(super) fn set(&self, settings: &mut Settings, names: &[String]) -> Result<()> {
        if let Some(file) = &self.links {
            let text = fs::read_to_string(file).map_err(|error| Error::file(file, error))?;
            let links = assumptions(&text, names, settings.tau_min, settings.tau_max);
            settings.link_assumptions = Some(links.map_err(|reason| Error::file(file, reason))?);
        }
        settings.max_conds = self.max_conds;
        settings.max_sets = self.max_sets;
        settings.extra_conditions = !self.no_extra_conditions;
        settings.shuffles = self.shuffles;
        settings.shuffle_stop = self.shuffle_stop;
        settings.null_distributions = self.null_distributions()?;
        settings.significance = self.significance.as_deref().map(str::parse::<Significance>).transpose()?;
        if let Some(rule) = &self.collider_rule {
            settings.pcmciplus.contemp_collider_rule = rule.parse::<ColliderRule>().map_err(|_| {
                Error::param("collider-rule", format!("'{rule}' is not majority, conservative or none"))
            })?;
        }
        for (flag, given) in
            [("collider-rule", self.collider_rule.is_some()), ("first-orientation", self.first_orientation)]
        {
            if given && !settings.method.reads(Reads::Orientation) {
                let reason = format!(
                    "{} has no colliders at lag 0; it is for {}",
                    settings.method,
                    Method::names_that_read(Reads::Orientation)
                );
                return Err(Error::param(flag, reason));
            }
        }
        settings.pcmciplus.conflict_resolution = !self.first_orientation;
        if self.shuffle_stop.is_some() && settings.cond_ind_test != "cmiknn" {
            let reason = format!("{} has no such end; it is for the test cmiknn", settings.cond_ind_test);
            return Err(Error::param("shuffle-stop", reason));
        }
        settings.check()?;
        check_shuffles(settings)
    }
}

impl AssumeArgs {
    fn null_distributions(&self) -> Result<Option<Arc<NullDistributions>>> {
        let Some(file) = &self.null_dist else { return Ok(None) };
        let text = fs::read_to_string(file).map_err(|error| Error::file(file, error))?;
        Ok(Some(Arc::new(NullDistributions::parse(&text)?)))
    }

    /// The data in which columns that belong together are one variable.
    ///
    /// # Errors
    /// A text that is not `NAME=COLUMN+COLUMN`, a column that does not exist, or is in two variables.
    pub(super) fn vectors(&self, data: DataFrame) -> Result<DataFrame> {
        Ok(data.with_named_vectors(&vectors_of(&self.vector)?)?)
    }
}

/// Marks the links of the model that were required: they were not tested.
pub(super) fn mark_required(model: &mut Model, settings: &Settings, names: &[String]) {
    let Some(known) = settings.link_assumptions.as_ref() else { return };
    for link in &mut model.links {
        let (cause, effect) = (position(names, &link.cause), position(names, &link.effect));
        if let (Some(cause), Some(effect)) = (cause, effect) {
            link.required = known.get(cause, effect, link.lag) == Some(Assumption::Exists);
        }
    }
}

/// What to tell of links that are known to exist: they were not tested.
pub(super) fn told(settings: &Settings, names: &[String]) -> Option<String> {
    let known = settings.link_assumptions.as_ref()?;
    let mut links = Vec::new();
    for (cause, of) in names.iter().enumerate() {
        for (effect, to) in names.iter().enumerate() {
            let exists = |lag: &usize| known.get(cause, effect, *lag) == Some(Assumption::Exists);
            let lags = (settings.tau_min..=settings.tau_max).filter(exists);
            links.extend(lags.map(|lag| format!("{} -> {} at lag {lag}", plain(of), plain(to))));
        }
    }
    let listed = links.join(", ");
    (!links.is_empty())
        .then(|| format!("known beforehand and not tested, which a strength of 1 means: {listed}"))
}

/// Refuses fewer shuffles than the level needs: with `n` of them no p-value is below `1 / (n + 1)`, and nothing would be found.
fn check_shuffles(settings: &Settings) -> Result<()> {
    let Some(shuffles) = settings.shuffles.filter(|_| settings.significance != Some(Significance::Analytic))
    else {
        return Ok(());
    };
    let by_pc = settings.method.info().one_level;
    let level = if by_pc { settings.level_of_pc().unwrap_or(settings.alpha) } else { settings.alpha };
    let smallest = 1.0 / (shuffles as f64 + 1.0);
    if smallest <= level {
        return Ok(());
    }
    let flag = if by_pc { "pc-alpha" } else { "alpha" };
    let needed = (1.0 / level).ceil();
    Err(Error::param(
        "shuffles",
        format!(
            "with {shuffles} the smallest p-value is {smallest:.4}, above the level {level} of {}, so nothing could be found; give at \
             least {needed}, or a higher level (--{flag})",
            settings.method
        ),
    ))
}

fn assumptions(
    text: &str,
    names: &[String],
    tau_min: usize,
    tau_max: usize,
) -> std::result::Result<LinkAssumptions, String> {
    let file: File = toml::from_str(text).map_err(|error| error.to_string().trim().replace('\n', " "))?;
    let mut links = match file.only {
        true => LinkAssumptions::none(names.len()),
        false => LinkAssumptions::all(names.len(), tau_min, tau_max),
    };
    for rule in &file.link {
        let lags = rule.lags.clone().unwrap_or_else(|| (tau_min..=tau_max).collect());
        if lags.is_empty() {
            let (cause, effect) = (&rule.cause, &rule.effect);
            return Err(format!("{cause} -> {effect}: lags names none; give some, or leave it out for all"));
        }
        if let Some(lag) = lags.iter().find(|lag| !(tau_min..=tau_max).contains(lag)) {
            return Err(format!(
                "{} -> {}: lag {lag} is not among the lags {tau_min} to {tau_max}",
                rule.cause, rule.effect
            ));
        }
        let mut fits = false;
        for cause in variables(&rule.cause, names)? {
            for effect in variables(&rule.effect, names)? {
                for &lag in lags.iter().filter(|lag| **lag > 0 || cause != effect) {
                    rule.apply(&mut links, cause, effect, lag)?;
                    fits = true;
                }
            }
        }
        if !fits {
            let reason =
                "a variable does not drive itself at lag 0; give lags from 1 on, or leave the rule out";
            return Err(format!("{} -> {}: {reason}", rule.cause, rule.effect));
        }
    }
    Ok(links)
}

impl Rule {
    fn apply(
        &self,
        links: &mut LinkAssumptions,
        cause: usize,
        effect: usize,
        lag: usize,
    ) -> std::result::Result<(), String> {
        let assumption = match (self.is, lag) {
            (Kind::Forbidden, _) => {
                links.remove(cause, effect, lag);
                return Ok(());
            }
            (Kind::Required, _) => Assumption::Exists,
            (Kind::Allowed, 0) => Assumption::TestUnoriented,
            (Kind::Allowed | Kind::Directed, _) => Assumption::Test,
        };
        if self.is == Kind::Directed && lag > 0 && cause != effect {
            links.remove(effect, cause, lag);
        }
        links.insert(cause, effect, lag, assumption).map_err(|error| error.to_string())
    }
}

fn variables(name: &str, names: &[String]) -> std::result::Result<Vec<usize>, String> {
    if name == "*" {
        return Ok((0..names.len()).collect());
    }
    position(names, name).map(|place| vec![place]).ok_or_else(|| {
        let hint = nearest(names, name).map_or(String::new(), |near| format!("did you mean '{near}'? "));
        format!("there is no variable '{name}'; {hint}variables: {}", names.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn links(text: &str) -> std::result::Result<LinkAssumptions, String> {
        assumptions(text, &["a", "b", "c"].map(str::to_owned), 0, 2)
    }

    #[test]
    fn each_kind_of_rule_is_what_it_says() {
        let found = links(
            "[[link]]\ncause = 'a'\neffect = 'b'\nlags = [1]\nis = 'required'\n\
             [[link]]\ncause = '*'\neffect = 'c'\nis = 'forbidden'\n\
             [[link]]\ncause = 'a'\neffect = 'b'\nlags = [0, 2]\nis = 'directed'\n",
        )
        .expect("rules");
        assert_eq!(found.get(0, 1, 1), Some(Assumption::Exists));
        assert_eq!([found.get(0, 2, 1), found.get(2, 2, 2), found.get(2, 0, 0)], [None; 3]);
        assert_eq!(found.get(2, 0, 1), Some(Assumption::Test));
        assert_eq!((found.get(0, 1, 0), found.get(1, 0, 2)), (Some(Assumption::Test), None));
        let only = links("only = true\n[[link]]\ncause = 'a'\neffect = 'b'\nlags = [1]\nis = 'allowed'\n")
            .expect("rules");
        assert_eq!((only.get(0, 1, 1), only.get(1, 1, 1)), (Some(Assumption::Test), None));
    }

    #[test]
    fn a_rule_that_does_not_mention_lags_is_for_all_of_them() {
        let found = links("[[link]]\ncause = 'a'\neffect = 'b'\nis = 'required'\n").expect("a rule");
        assert_eq!([0, 1, 2].map(|lag| found.get(0, 1, lag)), [Some(Assumption::Exists); 3]);
    }

    #[test]
    fn a_wrong_rule_is_named() {
        for (text, told) in [
            ("[[link]]\ncause = 'a'\neffect = 'd'\nis = 'allowed'\n", "no variable 'd'"),
            ("[[link]]\ncause = 'a'\neffect = 'b'\nlags = [3]\nis = 'allowed'\n", "lag 3 is not among"),
            ("[[link]]\ncause = 'a'\neffect = 'b'\nlags = []\nis = 'required'\n", "a -> b: lags names none"),
            (
                "[[link]]\ncause = 'a'\neffect = 'a'\nlags = [0]\nis = 'required'\n",
                "does not drive itself at lag 0",
            ),
            ("[[link]]\ncause = 'a'\neffect = 'b'\nis = 'likely'\n", "likely"),
            ("links = 3\n", "links"),
        ] {
            assert!(links(text).expect_err(text).contains(told), "{text}");
        }
    }
}
