//! What is known of links before the analysis: the rules of a file, or of a caller.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use toml::Spanned;

use crate::types::{
    Error, LinkAssumptions, LinkRule, Result,
    text::{check_nesting, line_of, reason_of},
};

/// What is known of links (docs/data.md): rules, each with its place, and whether no other link may exist.
///
/// ```
/// use roscausal_discovery::settings::LinkRules;
///
/// let rules = LinkRules::of_text("[[link]]\ncause = '*'\neffect = 'weather'\nis = 'forbidden'\n")?;
/// let names = ["walk", "weather"].map(str::to_owned);
/// let links = rules.for_variables(&names, [1, 1], &[])?;
/// assert!(links.get(0, 1, 1).is_none() && links.get(1, 0, 1).is_some());
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinkRules(Rules<LinkRule>);

#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
struct Rules<R> {
    /// No link may exist except those named here.
    #[serde(default)]
    only: bool,
    #[serde(default = "Vec::new")]
    link: Vec<R>,
}

impl LinkRules {
    /// The rules of a file in TOML.
    ///
    /// # Errors
    /// [`Error::Data`]: a text that is not such a file, with the line.
    pub fn of_text(text: &str) -> Result<Self> {
        check_nesting(text.as_bytes())?;
        let line = |byte: usize| format!("line {}", line_of(text.as_bytes(), byte));
        let file: Rules<Spanned<LinkRule>> = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            Error::Data(format!("{}: {}", line(start), reason_of(error.message())))
        })?;
        let rule = |rule: Spanned<LinkRule>| LinkRule { place: line(rule.span().start), ..rule.into_inner() };
        Ok(Self(Rules { only: file.only, link: file.link.into_iter().map(rule).collect() }))
    }

    /// The rules of a JSON object as the file has them, or of the list of its rules.
    ///
    /// # Errors
    /// [`Error::Data`]: other values.
    pub(super) fn of_value(value: &Value) -> Result<Self> {
        let read = match value {
            Value::Array(_) => serde_json::from_value(value.clone()).map(|link| Rules { only: false, link }),
            whole => serde_json::from_value(whole.clone()),
        };
        let mut rules: Rules<LinkRule> = read.map_err(|error| Error::Data(reason_of(error)))?;
        rules.link.iter_mut().zip(1..).for_each(|(rule, k)| rule.place = format!("rule {k}"));
        Ok(Self(rules))
    }

    /// The assumptions for these variables and the lags from the smallest to the largest; nothing drives the variables `exogenous`.
    ///
    /// # Errors
    /// Those of [`LinkAssumptions::of_rules`].
    pub fn for_variables(
        &self,
        names: &[String],
        lags: [usize; 2],
        exogenous: &[usize],
    ) -> Result<LinkAssumptions> {
        LinkAssumptions::of_rules(&self.0.link, self.0.only, names, lags, exogenous)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::types::Assumption;

    fn links(rules: Result<LinkRules>) -> std::result::Result<LinkAssumptions, String> {
        let names = ["a", "b", "c"].map(str::to_owned);
        rules.and_then(|rules| rules.for_variables(&names, [0, 2], &[])).map_err(|error| error.to_string())
    }

    #[test]
    fn each_kind_of_rule_is_what_it_says_in_a_file_and_as_a_value() {
        let text = "[[link]]\ncause = 'a'\neffect = 'b'\nlags = [1]\nis = 'required'\n\
                    [[link]]\ncause = '*'\neffect = 'c'\nis = 'forbidden'\n\
                    [[link]]\ncause = 'a'\neffect = 'b'\nlags = [0, 2]\nis = 'directed'\n";
        let list = json!([
            { "cause": "a", "effect": "b", "lags": [1], "is": "required" },
            { "cause": "*", "effect": "c", "is": "forbidden" },
            { "cause": "a", "effect": "b", "lags": [0, 2], "is": "directed" },
        ]);
        for found in [LinkRules::of_text(text), LinkRules::of_value(&list)] {
            let found = links(found).expect("rules");
            assert_eq!(found.get(0, 1, 1), Some(Assumption::Exists));
            assert_eq!([found.get(0, 2, 1), found.get(2, 2, 2), found.get(2, 0, 0)], [None; 3]);
            assert_eq!(found.get(2, 0, 1), Some(Assumption::Test));
            assert_eq!((found.get(0, 1, 0), found.get(1, 0, 2)), (Some(Assumption::Test), None));
        }
        let only = "only = true\n[[link]]\ncause = 'a'\neffect = 'b'\nlags = [1]\nis = 'allowed'\n";
        let only = links(LinkRules::of_text(only)).expect("rules");
        assert_eq!((only.get(0, 1, 1), only.get(1, 1, 1)), (Some(Assumption::Test), None));
    }

    #[test]
    fn a_rule_that_does_not_mention_lags_is_for_all_of_them() {
        let all = json!({ "link": [{ "cause": "a", "effect": "b", "is": "required" }] });
        let found = links(LinkRules::of_value(&all)).expect("a rule");
        assert_eq!([0, 1, 2].map(|lag| found.get(0, 1, lag)), [Some(Assumption::Exists); 3]);
    }

    #[test]
    fn a_wrong_rule_is_named_with_its_place() {
        for (rule, says) in [
            ("cause = 'a'\neffect = 'd'\nis = 'allowed'\n", "there is no variable 'd' (line 2)"),
            ("cause = 'a'\neffect = 'b'\nlags = [3]\nis = 'allowed'\n", "lag 3 is not among"),
            ("cause = 'a'\neffect = 'b'\nlags = []\nis = 'required'\n", "a -> b (line 2): lags names none"),
            ("cause = 'a'\neffect = 'a'\nlags = [0]\nis = 'required'\n", "does not drive itself at lag 0"),
            ("cause = 'a'\neffect = 'b'\nis = 'likely'\n", "line 5: unknown variant `likely`"),
            ("cause = 'a'\neffect = 'b'\n", "missing field `is`"),
        ] {
            let error = links(LinkRules::of_text(&format!("\n[[link]]\n{rule}"))).expect_err(says);
            assert!(error.contains(says), "{rule}\n{error}");
        }
        let deep = format!("link = {}", "[".repeat(1000));
        for (text, says) in [("links = 3\n", "line 1: unknown field `links`"), (&*deep, "nests deeper")] {
            let error = links(LinkRules::of_text(text)).expect_err(says);
            assert!(error.contains(says), "{error}");
        }
        let rule = |is: &str| json!({ "cause": "a", "effect": "b", "lags": [1], "is": is });
        for (value, says) in [
            (json!([rule("required"), rule("forbidden")]), "(rule 1) and forbidden (rule 2)"),
            (json!([rule("likely")]), "likely"),
            (json!({ "links": 3 }), "links"),
        ] {
            let error = links(LinkRules::of_value(&value)).expect_err(says);
            assert!(error.contains(says), "{value}\n{error}");
        }
    }
}
