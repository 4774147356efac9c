//! A node's name and namespace, and the remaps of the names that it uses.

use roscausal_core::middleware::{is_graph_name, is_token};
use roscausal_core::{Error, Result, ensure};

use super::BadArgument;

/// A node's full name and its remaps. Turns the names used in the code into absolute names.
#[derive(Clone, Debug)]
pub struct Names {
    node: String,
    /// `/` or `/a/b`.
    namespace: String,
    rules: Vec<Remap>,
}

/// One rule `[node:]from:=to`.
#[derive(Clone, Debug)]
pub struct Remap {
    node: Option<String>,
    from: String,
    to: String,
}

impl Remap {
    /// Reads a rule as it follows `-r`.
    ///
    /// # Errors
    /// No `:=`, an empty side, or an illegal node name or namespace.
    pub fn parse(rule: &str) -> std::result::Result<Self, BadArgument> {
        let wrong =
            |why: &str| BadArgument(format!("-r {rule}: {why}; write from:=to, such as odom:=/robot/odom"));
        let (left, to) = rule.split_once(":=").ok_or_else(|| wrong("there is no ':='"))?;
        let (node, from) = match left.split_once(':') {
            Some((node, from)) if !from.starts_with("//") => (Some(node.to_owned()), from),
            _ => (None, left),
        };
        let from = from.strip_prefix("rostopic://").unwrap_or(from);
        ensure(!from.is_empty() && !to.is_empty(), || wrong("one side is empty"))?;
        let legal = match from {
            "__node" | "__name" => is_token(to),
            "__ns" => is_namespace(to),
            _ => true,
        };
        if !legal {
            return Err(wrong(match from {
                "__ns" => "a namespace begins with '/' and is made of letters, digits, '_' and single '/'",
                _ => "a node's name is made of letters, digits and '_'",
            }));
        }
        Ok(Self { node, from: from.to_owned(), to: to.to_owned() })
    }
}

impl Names {
    /// The names of a node that the code calls `node`, after the rules for its own name and namespace.
    ///
    /// # Errors
    /// If `node` is not a legal name.
    pub fn new(node: &str, rules: Vec<Remap>) -> std::result::Result<Self, BadArgument> {
        if !is_token(node) {
            return Err(BadArgument(format!("'{node}' is not a node's name: use letters, digits and '_'")));
        }
        let special = |keys: &[&str], name: &str| {
            let applies = |rule: &&Remap| {
                keys.contains(&rule.from.as_str()) && rule.node.as_deref().is_none_or(|node| node == name)
            };
            rules.iter().find(applies).map(|rule| rule.to.clone())
        };
        let namespace = special(&["__ns"], node).unwrap_or_else(|| "/".into());
        let node = special(&["__node", "__name"], node).unwrap_or_else(|| node.to_owned());
        Ok(Self { node, namespace, rules })
    }

    /// The node's name without its namespace.
    pub fn node(&self) -> &str {
        &self.node
    }

    /// The namespace: `/`, or `/a/b`.
    pub fn namespace(&self) -> &str {
        &self.namespace
    }

    /// Name of its logger: `namespace.node`.
    pub fn logger(&self) -> String {
        self.full_name().trim_start_matches('/').replace('/', ".")
    }

    /// `/namespace/node`.
    pub fn full_name(&self) -> String {
        format!("{}/{}", self.namespace.trim_end_matches('/'), self.node)
    }

    /// The absolute name of a topic after the remaps. The first matching rule is applied, once.
    ///
    /// # Errors
    /// An illegal name, before or after the remap.
    pub fn resolve(&self, topic: &str) -> Result<String> {
        let name = self.expand(topic);
        checked(topic, &name)?;
        let fits = |rule: &&Remap| {
            rule.node.as_deref().is_none_or(|node| node == self.node) && self.expand(&rule.from) == name
        };
        let Some(rule) = self.rules.iter().find(fits) else { return Ok(name) };
        let name = self.expand(&rule.to);
        checked(&rule.to, &name)?;
        Ok(name)
    }

    fn expand(&self, name: &str) -> String {
        let name = name.replace("{node}", &self.node);
        let name = name.replace("{ns}", &self.namespace).replace("{namespace}", &self.namespace);
        let base = self.namespace.trim_end_matches('/');
        match name.strip_prefix('~') {
            Some("") => self.full_name(),
            Some(private) => format!("{base}/{}/{}", self.node, private.trim_start_matches('/')),
            None if name.starts_with('/') => name,
            None => format!("{base}/{name}"),
        }
    }
}

/// Whether `text` is `/`, or name parts that each follow a single slash.
pub(crate) fn is_namespace(text: &str) -> bool {
    text == "/" || (text.starts_with('/') && is_graph_name(text))
}

fn checked(asked: &str, name: &str) -> Result<()> {
    let reason = "not a legal name: use letters, digits, single '_' and single '/', no digit after a '/'";
    let legal = is_graph_name(name) && !name.contains("__");
    ensure(legal, || Error::Topic { topic: asked.to_owned(), reason: reason.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(rules: &[&str]) -> Names {
        Names::new("robot", rules.iter().map(|rule| Remap::parse(rule).unwrap()).collect()).unwrap()
    }

    #[test]
    fn relative_private_and_absolute_names_resolve_within_the_namespace() {
        let names = names(&["__ns:=/my/ns", "__node:=bot"]);
        assert_eq!(names.full_name(), "/my/ns/bot");
        for (asked, resolved) in [
            ("odom", "/my/ns/odom"),
            ("/odom", "/odom"),
            ("~/odom", "/my/ns/bot/odom"),
            ("~odom", "/my/ns/bot/odom"),
        ] {
            assert_eq!(names.resolve(asked).unwrap(), resolved);
        }
    }

    #[test]
    fn the_first_rule_that_fits_is_applied_once() {
        let names = names(&["chat:=a", "chat:=b", "/a:=c", "other:/odom:=/no", "robot:/odom:=/yes"]);
        assert_eq!(names.resolve("/chat").unwrap(), "/a");
        assert_eq!(names.resolve("a").unwrap(), "/c");
        assert_eq!(names.resolve("odom").unwrap(), "/yes");
    }

    #[test]
    fn rules_and_names_that_ros_refuses_are_refused() {
        for rule in ["a", "a:=", ":=b", "__ns:=foo", "__node:=a/b", "__node:=1a"] {
            assert!(Remap::parse(rule).is_err(), "{rule}");
        }
        for topic in ["", "/", "a//b", "1a", "a b", "a__b", "a/"] {
            assert!(names(&[]).resolve(topic).is_err(), "{topic}");
        }
        assert!(names(&["a:=b//c"]).resolve("a").is_err());
    }
}
