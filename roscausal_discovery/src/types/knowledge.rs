//! What is known of links before an analysis, as rules about named variables, checked together before it becomes assumptions.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{
    common::add_new,
    error::{Error, Result, ensure},
    links::{Assumption, LinkAssumptions, circle_of},
    names::{nearest, plain, position},
    text::{quoted, short},
};

/// Links that all rules together may name, each as often as it is named.
const MOST_LINKS: usize = 5_000_000;

/// What a rule says of its links.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Known {
    /// They exist, and are not tested.
    Required,
    /// They do not exist.
    Forbidden,
    /// They may exist.
    Allowed,
    /// They may exist, and not the other way round.
    Directed,
}

/// What is known of the links from a cause to an effect; `*` is any variable.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LinkRule {
    /// Name of the cause.
    pub cause: String,
    /// Name of the effect.
    pub effect: String,
    /// In steps; `None`: all lags of the analysis.
    pub lags: Option<Vec<i64>>,
    /// What is known of them.
    pub is: Known,
    /// Where the rule is, for messages: `line 3`; its text has no such field.
    #[serde(skip)]
    pub place: String,
}

/// What all rules say of one link: for each statement the rule that makes it.
#[derive(Clone, Copy, Default)]
struct Said<'a> {
    required: Option<&'a LinkRule>,
    forbidden: Option<&'a LinkRule>,
    allowed: Option<&'a LinkRule>,
}

/// Cause, effect and lag.
type Place = (usize, usize, usize);

impl LinkAssumptions {
    /// The assumptions that rules make of the variables `names` with lags `tau_min..=tau_max`; with `only`, links that no rule names do
    /// not exist. Nothing drives the variables `exogenous`. Where an allowed link is also forbidden, the rule that names more of its two
    /// variables holds, in whatever order they come; all other contradictions are refused.
    ///
    /// ```
    /// use roscausal_discovery::{Known, LinkAssumptions, LinkRule};
    ///
    /// let rule = |is, line: usize| {
    ///     let (cause, effect, lags) = ("a".to_owned(), "b".to_owned(), Some(vec![1]));
    ///     LinkRule { cause, effect, lags, is, place: format!("line {line}") }
    /// };
    /// let names = ["a", "b"].map(str::to_owned);
    /// let known = [rule(Known::Required, 1), rule(Known::Forbidden, 6)];
    /// let error = LinkAssumptions::of_rules(&known, false, &names, [1, 2], &[]).unwrap_err().to_string();
    /// assert!(error.contains("line 1") && error.contains("line 6"), "{error}");
    /// ```
    ///
    /// # Errors
    /// An unknown variable, a lag that the analysis does not have, a rule that no link fits, rules that contradict each other.
    pub fn of_rules(
        rules: &[LinkRule],
        only: bool,
        names: &[String],
        [tau_min, tau_max]: [usize; 2],
        exogenous: &[usize],
    ) -> Result<Self> {
        let mut stated: BTreeMap<Place, Said<'_>> = BTreeMap::new();
        let mut named = 0_usize;
        for rule in rules {
            let (causes, effects) =
                (rule.variables(&rule.cause, names)?, rule.variables(&rule.effect, names)?);
            let lags = rule.lags([tau_min, tau_max])?;
            named =
                named.saturating_add(causes.len().saturating_mul(effects.len()).saturating_mul(lags.len()));
            Error::ensure_data(named <= MOST_LINKS, || {
                format!("the rules name more than {MOST_LINKS} links; give fewer rules, or fewer lags")
            })?;
            let mut fits = false;
            for &cause in &causes {
                for &effect in &effects {
                    for &lag in lags.iter().filter(|lag| **lag > 0 || cause != effect) {
                        fits = true;
                        rule.say(&mut stated, (cause, effect, lag));
                    }
                }
            }
            let reason =
                "a variable does not drive itself at lag 0; give lags from 1 on, or leave the rule out";
            ensure(fits, || rule.fault(reason))?;
        }
        let link = |(cause, effect, lag): Place| {
            format!("{} -> {} at lag {lag}", short(&plain(&names[cause])), short(&plain(&names[effect])))
        };
        for (&place, now) in &mut stated {
            now.settle(&link(place))?;
            let effect = place.1;
            if let Some(rule) = now.pointing().filter(|_| exogenous.contains(&effect)) {
                let (link, effect, line) = (link(place), quoted(&plain(&names[effect])), &rule.place);
                let is = if rule.is == Known::Required { "required" } else { "directed" };
                let reason = format!(
                    "{link} is {is}, but {effect} is exogenous, so nothing drives it ({line}); take back one of the two"
                );
                return Err(Error::param("links", reason));
            }
        }
        let mut causes = vec![Vec::new(); names.len()];
        for (&(cause, effect, _), _) in
            stated.iter().filter(|(place, now)| place.2 == 0 && now.pointing().is_some())
        {
            causes[effect].push(cause);
        }
        if let Some(circle) = circle_of(&causes) {
            let steps: Vec<String> = (0..circle.len())
                .map(|k| {
                    let place = (circle[k], circle[(k + 1) % circle.len()], 0);
                    let line = stated.get(&place).and_then(Said::pointing).map_or("", |rule| &rule.place);
                    format!("{} ({line})", link(place))
                })
                .collect();
            return Err(Error::Data(format!(
                "links with a direction go round in a circle within a moment: {}; give one of them lags from 1 on",
                steps.join(", ")
            )));
        }
        Self::stated(&stated, only, names.len(), [tau_min, tau_max])
    }

    /// The assumptions of statements that do not contradict each other.
    fn stated(
        stated: &BTreeMap<Place, Said<'_>>,
        only: bool,
        n: usize,
        [min, max]: [usize; 2],
    ) -> Result<Self> {
        let mut links = if only { Self::none(n) } else { Self::all(n, min, max) };
        for (&(cause, effect, lag), _) in stated.iter().filter(|(_, now)| now.forbidden.is_some()) {
            links.remove(cause, effect, lag);
        }
        for (&(cause, effect, lag), now) in stated {
            let back =
                if lag == 0 { stated.get(&(effect, cause, 0)).copied() } else { None }.unwrap_or_default();
            let assumption = match (now.required, now.allowed) {
                (Some(_), _) => Assumption::Exists,
                // The other end says more.
                (None, None) => continue,
                _ if back.required.is_some() => continue,
                (None, Some(_)) if lag > 0 || back.forbidden.is_some() => Assumption::Test,
                _ => Assumption::TestUnoriented,
            };
            links.insert(cause, effect, lag, assumption)?;
        }
        Ok(links)
    }
}

impl<'a> Said<'a> {
    /// The rule by which the link, if there is one, has this direction.
    fn pointing(&self) -> Option<&'a LinkRule> {
        self.required.or(self.allowed.filter(|rule| rule.is == Known::Directed))
    }

    /// Refuses what contradicts itself, and drops what a more specific rule overrides.
    fn settle(&mut self, link: &str) -> Result<()> {
        let Some(forbidden) = self.forbidden else { return Ok(()) };
        let fault = |is: &str, rule: &LinkRule| {
            let (first, second) = (&rule.place, &forbidden.place);
            Err(Error::Data(match first == second {
                true => format!(
                    "{first} says that {link} is {is}, and that it does not exist; name its variables"
                ),
                false => {
                    format!("{link} is {is} ({first}) and forbidden ({second}); take back one of the two")
                }
            }))
        };
        if let Some(rule) = self.required {
            return fault("required", rule);
        }
        let Some(allowed) = self.allowed else { return Ok(()) };
        match allowed.named().cmp(&forbidden.named()) {
            std::cmp::Ordering::Less => self.allowed = None,
            std::cmp::Ordering::Greater => self.forbidden = None,
            std::cmp::Ordering::Equal => return fault("allowed", allowed),
        }
        Ok(())
    }

    fn or(known: &mut Option<&'a LinkRule>, rule: &'a LinkRule) {
        if known.is_none_or(|known| known.named() < rule.named()) {
            *known = Some(rule);
        }
    }
}

impl LinkRule {
    /// How many of the two variables the rule names.
    fn named(&self) -> usize {
        [&self.cause, &self.effect].into_iter().filter(|name| *name != "*").count()
    }

    fn say<'a>(&'a self, stated: &mut BTreeMap<Place, Said<'a>>, (cause, effect, lag): Place) {
        let now = stated.entry((cause, effect, lag)).or_default();
        match self.is {
            Known::Required => Said::or(&mut now.required, self),
            Known::Forbidden => Said::or(&mut now.forbidden, self),
            Known::Allowed | Known::Directed => Said::or(&mut now.allowed, self),
        }
        if self.is == Known::Directed && cause != effect {
            Said::or(&mut stated.entry((effect, cause, lag)).or_default().forbidden, self);
        }
    }

    fn fault(&self, reason: &str) -> Error {
        let (cause, effect) = (short(&self.cause), short(&self.effect));
        Error::Data(format!("{cause} -> {effect} ({}): {reason}", self.place))
    }

    fn variables(&self, name: &str, names: &[String]) -> Result<Vec<usize>> {
        if name == "*" {
            return Ok((0..names.len()).collect());
        }
        position(names, name).map(|place| vec![place]).ok_or_else(|| {
            let near = nearest(names, name);
            let hint = near.map_or(String::new(), |near| format!("did you mean {}? ", quoted(near)));
            let all: Vec<String> = names.iter().map(|name| short(name)).collect();
            let (name, line, all) = (quoted(name), &self.place, all.join(", "));
            Error::Data(format!("there is no variable {name} ({line}); {hint}variables: {all}"))
        })
    }

    fn lags(&self, [tau_min, tau_max]: [usize; 2]) -> Result<Vec<usize>> {
        let Some(given) = &self.lags else { return Ok((tau_min..=tau_max).collect()) };
        ensure(!given.is_empty(), || self.fault("lags names none; give some, or leave it out for all"))?;
        let mut lags = Vec::new();
        for &lag in given {
            let known = usize::try_from(lag).map_err(|_| {
                let zero = if tau_min == 0 { "0, " } else { "" };
                self.fault(&format!(
                    "{lag} is not a lag; lags are {zero}1, 2, ... steps from cause to effect"
                ))
            })?;
            if !(tau_min..=tau_max).contains(&known) {
                return Err(self.fault(&format!("lag {lag} is not among the lags {tau_min} to {tau_max}")));
            }
            add_new(&mut lags, known);
        }
        Ok(lags)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rules such as `a b 1 required`: lags are separated by commas, `all` stands for all lags from `tau_min` to `tau_max`.
    fn of(text: &str, [tau_min, tau_max]: [usize; 2]) -> std::result::Result<LinkAssumptions, String> {
        let rule = |(k, line): (usize, &str)| {
            let [cause, effect, lags, is] = line.split_whitespace().collect::<Vec<_>>()[..] else {
                panic!("{line}");
            };
            let is = match is {
                "required" => Known::Required,
                "forbidden" => Known::Forbidden,
                "allowed" => Known::Allowed,
                _ => Known::Directed,
            };
            let lags = (lags != "all").then(|| lags.split(',').map(|lag| lag.parse().unwrap()).collect());
            let place = format!("line {}", k + 1);
            LinkRule { cause: cause.to_owned(), effect: effect.to_owned(), lags, is, place }
        };
        let rules: Vec<LinkRule> = text.lines().enumerate().map(rule).collect();
        let names = ["a", "b", "c", "weather"].map(str::to_owned);
        LinkAssumptions::of_rules(&rules, false, &names, [tau_min, tau_max], &[3])
            .map_err(|error| error.to_string())
    }

    #[test]
    fn knowledge_that_contradicts_itself_is_refused_with_every_line() {
        for (rules, lags, lines) in [
            ("a b 1 required\na b 1 forbidden", [1, 2], &["line 1", "line 2", "a -> b at lag 1"][..]),
            ("a b 1 forbidden\na b 1 required", [1, 2], &["line 1", "line 2"]),
            ("a b all required\na b 2 forbidden", [1, 2], &["line 1", "line 2", "lag 2"]),
            ("a b 1 required\n* b all forbidden", [1, 2], &["line 1", "line 2"]),
            ("a b 1 required\n* * 1 forbidden", [1, 2], &["line 1", "line 2"]),
            ("a a 1 required\na a 1 forbidden", [1, 2], &["line 1", "line 2"]),
            ("a b 1 required\nb a 1 directed", [1, 2], &["line 1", "line 2"]),
            ("a b 0 required\nb a 0 directed", [0, 2], &["line 1", "line 2"]),
            ("a b 1 allowed\na b 1 forbidden", [1, 2], &["line 1", "line 2", "allowed"]),
            ("a b 1 directed\nb a 1 directed", [1, 2], &["line 1", "line 2"]),
            ("a b 0 directed\nb a 0 directed", [0, 2], &["line 1", "line 2"]),
            ("a b 1 directed\na b 1 forbidden", [1, 2], &["line 1", "line 2"]),
            ("* * 1 directed", [1, 2], &["line 1 says"]),
            ("a b 0 required\nb a 0 required", [0, 2], &["line 1", "line 2", "circle"]),
            ("a b all required\nb a all required", [0, 2], &["line 1", "line 2", "circle"]),
            (
                "a b 0 required\nb c 0 required\nc a 0 required",
                [0, 1],
                &["line 1", "line 2", "line 3", "circle"],
            ),
            (
                "a b 0 required\nb c 0 directed\nc a 0 required",
                [0, 1],
                &["line 1", "line 2", "line 3", "circle"],
            ),
            ("a b 0 directed\nb c 0 directed\nc a 0 directed", [0, 1], &["line 1", "line 3", "circle"]),
            ("a weather 0 directed", [0, 1], &["line 1", "directed", "'weather' is exogenous"]),
            ("* * 0 required", [0, 1], &["line 1", "exogenous"]),
            ("a weather 1 required", [1, 2], &["line 1", "'weather' is exogenous"]),
            ("* weather all required", [0, 2], &["line 1", "exogenous"]),
            ("a d 1 required", [1, 2], &["line 1", "no variable 'd'", "c, weather"]),
            ("a b 3 required", [1, 2], &["line 1", "lag 3 is not among the lags 1 to 2"]),
            ("a b 0 required", [1, 2], &["line 1", "lag 0 is not among the lags 1 to 2"]),
            ("a b -1 required", [1, 2], &["line 1", "lags are 1, 2, ..."]),
            ("a b -9223372036854775808 required", [0, 2], &["line 1", "lags are 0, 1, 2, ..."]),
            ("a a 0 required", [0, 2], &["line 1", "itself at lag 0"]),
        ] {
            let error = of(rules, lags).expect_err(rules);
            assert!(lines.iter().all(|word| error.contains(word)), "{rules}\n{error}");
        }
    }

    #[test]
    fn knowledge_that_agrees_is_one_truth_in_any_order() {
        for (rules, place, known) in [
            ("a b 1 required\na b 1 required", (0, 1, 1), Some(Assumption::Exists)),
            ("a b 1 required\na b all allowed", (0, 1, 1), Some(Assumption::Exists)),
            ("a b 1 required\nb a 1 required", (1, 0, 1), Some(Assumption::Exists)),
            ("a b 0 required\nb a 1 required", (1, 0, 1), Some(Assumption::Exists)),
            ("a b 0 required\nb a 0 forbidden", (0, 1, 0), Some(Assumption::Exists)),
            ("a b 0 required\nb a 0 allowed", (0, 1, 0), Some(Assumption::Exists)),
            ("a b 0 required\na b 0 directed", (0, 1, 0), Some(Assumption::Exists)),
            ("* b all forbidden\na b 1 allowed", (0, 1, 1), Some(Assumption::Test)),
            ("* b all allowed\na b 1 forbidden", (0, 1, 1), None),
            ("a b 0 directed\na b 0 allowed", (0, 1, 0), Some(Assumption::Test)),
            ("a b 0 allowed\nb a 0 allowed", (0, 1, 0), Some(Assumption::TestUnoriented)),
            ("weather a 0 required\n* weather all forbidden", (3, 0, 0), Some(Assumption::Exists)),
        ] {
            let turned: Vec<&str> = rules.lines().rev().collect();
            for rules in [rules, &turned.join("\n")] {
                let links = of(rules, [0, 2]).expect(rules);
                assert_eq!(links.get(place.0, place.1, place.2), known, "{rules}");
            }
        }
    }

    #[test]
    fn many_rules_of_all_links_are_refused_before_they_are_listed() {
        let rule = LinkRule {
            cause: "*".into(),
            effect: "*".into(),
            lags: None,
            is: Known::Allowed,
            place: "line 1".into(),
        };
        let names: Vec<String> = (0..100).map(|k| format!("x{k}")).collect();
        let error = LinkAssumptions::of_rules(&vec![rule; 2000], false, &names, [1, 2], &[]).unwrap_err();
        assert!(error.to_string().contains("more than 5000000 links"), "{error}");
    }
}
