//! A graph from JSON: a model that discovery wrote, or one written by hand.

use std::collections::{BTreeMap, HashMap, HashSet};

use roscausal_discovery::{
    Error, LinkMark, Model, Result,
    text::{check_nesting, check_step, quoted, reason_of},
};
use serde::Deserialize;

use super::structural::Facts;
use crate::graph::{Arrow, Graph, Pair};

/// What tells a model from a graph that a person wrote.
#[derive(Deserialize)]
struct Head {
    schema: Option<String>,
}

/// What a person writes: `{"links": [{"cause": "r_v", "effect": "d", "lag": 1}]}`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ByHand {
    /// Default: the names in the links.
    #[serde(default)]
    variables: Vec<String>,
    links: Vec<Link>,
    #[serde(default)]
    units: BTreeMap<String, String>,
    dt: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Link {
    cause: String,
    effect: String,
    lag: usize,
    #[serde(default = "directed")]
    mark: LinkMark,
}

fn directed() -> LinkMark {
    LinkMark::Forward
}

/// The graph of a model file (`roscausal/model/2`), or of one written by hand, without the columns `context`.
///
/// By hand: `links` with `cause`, `effect`, `lag` and, at lag 0, `mark` (`-->`, `o-o`, `x-x`); if wanted `variables` (default: those of the
/// links), `units` by variable, and `dt` in seconds.
///
/// ```
/// use roscausal_reasoning::model::graph_of_json;
///
/// let text = r#"{"links": [{"cause": "r_v", "effect": "d", "lag": 1}], "units": {"d": "m"}}"#;
/// let (graph, facts) = graph_of_json(text, &[])?;
/// assert_eq!((graph.names(), facts.units.len()), (&["r_v".to_string(), "d".to_string()][..], 1));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Text that is neither; a graph that is none ([`Graph::new`]); a step that is not above 0.
pub fn graph_of_json(text: &str, context: &[String]) -> Result<(Graph, Facts)> {
    check_nesting(text.as_bytes())?;
    let head: Head =
        serde_json::from_str(text).map_err(|e| Error::Data(format!("this is not JSON: {}", reason_of(e))))?;
    if head.schema.is_some() {
        let model = Model::from_json(text.as_bytes())?;
        return Ok((Graph::of_model(&model, context)?, Facts::of_model(&model)));
    }
    let ByHand { mut variables, links, units, dt } = serde_json::from_str(text).map_err(|e| {
        let example = r#"{"links": [{"cause": "r_v", "effect": "d", "lag": 1}]}"#;
        Error::Data(format!("this is not a graph: {}; write {example}", reason_of(e)))
    })?;
    check_step(dt)?;
    if variables.is_empty() {
        let mut known = HashSet::new();
        let names = links.iter().flat_map(|link| [&link.cause, &link.effect]);
        variables = names.filter(|name| known.insert(*name)).cloned().collect();
    }
    let places: HashMap<&String, usize> = variables.iter().zip(0..).collect();
    let find = |what: &str, name: &String| {
        let missing = || Error::param("variables", format!("{what} {}, which is none of them", quoted(name)));
        places.get(name).copied().ok_or_else(missing)
    };
    units.keys().try_for_each(|name| find("units has", name).map(drop))?;
    let (mut arrows, mut pairs) = (Vec::new(), Vec::new());
    for link in &links {
        let (cause, effect) = (find("a link names", &link.cause)?, find("a link names", &link.effect)?);
        match (link.mark, link.lag) {
            (LinkMark::Forward, lag) => arrows.push(Arrow { cause, effect, lag }),
            (mark @ (LinkMark::Unoriented | LinkMark::Conflict), 0) => {
                pairs.push(Pair { a: cause, b: effect, conflict: mark == LinkMark::Conflict });
            }
            (mark, lag) => {
                let mark = quoted(mark.symbol());
                let reason = format!("{mark} at lag {lag}: a link is -->, or at lag 0 also o-o or x-x");
                return Err(Error::param("mark", reason));
            }
        }
    }
    let largest = links.iter().map(|link| link.lag).max().unwrap_or(0);
    let facts = Facts { dt, units: units.into_iter().collect(), ..Facts::default() };
    Ok((Graph::new(variables, largest, &arrows, &pairs)?, facts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_graph_is_refused_with_what_to_write() {
        let refused = |text: &str| graph_of_json(text, &[]).unwrap_err().to_string();
        assert!(refused("[").contains("JSON"));
        assert!(refused("{}").contains("\"links\""));
        assert!(refused(r#"{"links": [{"cause": "a", "effect": "b"}]}"#).contains("lag"));
        assert!(
            refused(r#"{"links": [{"cause": "a", "effect": "b", "lag": 1, "mark": "o-o"}]}"#)
                .contains("lag 0")
        );
        assert!(
            refused(r#"{"links": [{"cause": "a", "effect": "b", "lag": 4000000000}]}"#).contains("too large")
        );
        assert!(refused(r#"{"schema": "roscausal/model/9"}"#).contains("roscausal/model/2"));
        assert!(
            refused(r#"{"variables": ["a"], "links": [{"cause": "a", "effect": "b", "lag": 1}]}"#)
                .contains("'b'")
        );
        assert!(refused(r#"{"links": []}"#).contains("no variable"));
        assert!(
            refused(r#"{"dt": -0.3, "links": [{"cause": "a", "effect": "b", "lag": 1}]}"#)
                .contains("above 0")
        );
        assert!(
            refused(r#"{"units": {"c": "m"}, "links": [{"cause": "a", "effect": "b", "lag": 1}]}"#)
                .contains("units has 'c'")
        );
        assert!(refused(&"[".repeat(100)).contains("nests deeper"));
    }
}
