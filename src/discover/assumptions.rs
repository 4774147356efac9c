//! What is known before the analysis, and how it tests: flags for settings of the engine that are seldom needed.

use std::{path::PathBuf, sync::Arc};

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result, bounded};
use roscausal_discovery::{
    Assumption, DataFrame, Error as EngineError, LinkAssumptions, LinkRule, Model, Settings,
    independence_tests::{NullDistributions, Significance},
    methods::{ColliderRule, Method, Reads},
    names::{plain, position},
    text::{line_of, reason_of},
    vectors_of,
};
use serde::Deserialize;
use toml::Spanned;

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
    link: Vec<Spanned<LinkRule>>,
}

impl AssumeArgs {
    /// Puts these flags into the settings for data with these variables.
    ///
    /// # Errors
    /// A file that cannot be read, names a variable that does not exist, or assumes what cannot be; a setting that the test or
    /// method does not have.
    pub(super) fn set(&self, settings: &mut Settings, names: &[String]) -> Result<()> {
        if let Some(file) = &self.links {
            let text = bounded::read_settings(file)?;
            let exogenous: Vec<usize> =
                settings.exogenous.iter().filter_map(|name| position(names, name)).collect();
            let links = assumptions(&text, names, [settings.tau_min, settings.tau_max], &exogenous);
            settings.link_assumptions = Some(links.map_err(|error| match error {
                // Between the file and a flag.
                EngineError::Param { name, reason } => Error::Param { name, reason },
                other => Error::file(file, other),
            })?);
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
        let text = bounded::read_text(file, bounded::MODEL)?;
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
    lags: [usize; 2],
    exogenous: &[usize],
) -> std::result::Result<LinkAssumptions, EngineError> {
    let file: File = toml::from_str(text).map_err(|error| {
        let line = line_of(text.as_bytes(), error.span().map_or(0, |span| span.start));
        EngineError::Data(format!("line {line}: {}", reason_of(error.message())))
    })?;
    let rule = |rule: Spanned<LinkRule>| {
        let place = format!("line {}", line_of(text.as_bytes(), rule.span().start));
        LinkRule { place, ..rule.into_inner() }
    };
    let rules: Vec<LinkRule> = file.link.into_iter().map(rule).collect();
    LinkAssumptions::of_rules(&rules, file.only, names, lags, exogenous)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn links(text: &str) -> std::result::Result<LinkAssumptions, String> {
        assumptions(text, &["a", "b", "c"].map(str::to_owned), [0, 2], &[]).map_err(|error| error.to_string())
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
            (
                "[[link]]\ncause = 'a'\neffect = 'b'\nlags = []\nis = 'required'\n",
                "a -> b (line 1): lags names none",
            ),
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
