//! Parameters from files and from `-p`: values for the nodes whose names match a pattern.

use std::collections::{BTreeMap, HashSet};
use std::path::Path;

use roscausal_core::{ensure, params::Value};
use serde_norway::Value as Yaml;

use super::BadArgument;

/// Brackets within brackets, at most. For a text of deeper ones the library takes quadratic time.
const DEEPEST: usize = 64;

/// Parameter values from any number of files and `-p` arguments, in order.
#[derive(Clone, Debug, Default)]
pub struct ParamFile {
    /// Node patterns with their values. A pattern has one item per path segment (`*` matches one, `**` any number).
    nodes: Vec<(Vec<String>, BTreeMap<String, Value>)>,
}

impl ParamFile {
    /// Sets one value for the nodes that match `node`.
    fn insert(&mut self, node: &str, name: &str, value: Value) {
        let pattern = segments(node);
        let index = self.nodes.iter().position(|(known, _)| *known == pattern).unwrap_or_else(|| {
            self.nodes.push((pattern, BTreeMap::new()));
            self.nodes.len() - 1
        });
        self.nodes[index].1.insert(name.to_owned(), value);
    }

    /// Adds a rule `[node:]name:=value` as it follows `-p`, with the value in YAML.
    ///
    /// # Errors
    /// No `:=`, no parameter name, or no value.
    pub fn add_rule(&mut self, rule: &str) -> Result<(), BadArgument> {
        let wrong = |why: &str| BadArgument(format!("-p {rule}: {why}; write name:=value, such as dt:=0.1"));
        let (name, text) = rule.split_once(":=").ok_or_else(|| wrong("there is no ':='"))?;
        let (node, name) = name.split_once(':').unwrap_or(("/**", name));
        ensure(!name.is_empty() && !name.contains(':'), || wrong("the name is not a parameter's name"))?;
        let value = parsed(text).map_err(|why| wrong(&format!("the value {why}")))?;
        self.insert(node, name, scalar_or_list(&value).map_err(|why| wrong(&why))?);
        Ok(())
    }

    /// Adds a file: `node: {ros__parameters: {name: value}}`. Nodes are nested by namespace or written as paths.
    ///
    /// # Errors
    /// A file that cannot be read, is not YAML, or is not of that form; the message names the place.
    pub fn add_file(&mut self, path: &Path) -> Result<(), BadArgument> {
        let wrong = |why: String| BadArgument(format!("parameter file {}: {why}", path.display()));
        let text =
            std::fs::read_to_string(path).map_err(|error| wrong(format!("cannot be read ({error})")))?;
        self.add_text(&text).map_err(wrong)
    }

    /// Adds the text of a file.
    ///
    /// # Errors
    /// What is wrong in it.
    pub fn add_text(&mut self, text: &str) -> Result<(), String> {
        self.add_nodes("", &parsed(text)?)
    }

    fn add_nodes(&mut self, node: &str, yaml: &Yaml) -> Result<(), String> {
        let form = "write 'node_name: {ros__parameters: {name: value}}'";
        let Yaml::Mapping(entries) = yaml else {
            return Err(format!("'{node}' holds no 'ros__parameters'; {form}"));
        };
        for (key, inner) in entries {
            let key =
                key.as_str().ok_or_else(|| format!("a node's name under '{node}' is not text; {form}"))?;
            match (key, inner) {
                ("ros__parameters", _) if node.is_empty() => {
                    return Err(format!("'ros__parameters' stands under no node; {form}"));
                }
                ("ros__parameters", Yaml::Mapping(_)) => self.add_values(node, "", inner)?,
                ("ros__parameters", Yaml::Null) => {}
                ("ros__parameters", _) => {
                    return Err(format!("'ros__parameters' of '{node}' is not a mapping; {form}"));
                }
                _ => self.add_nodes(&format!("{node}/{key}"), inner)?,
            }
        }
        Ok(())
    }

    fn add_values(&mut self, node: &str, prefix: &str, yaml: &Yaml) -> Result<(), String> {
        let Yaml::Mapping(entries) = yaml else {
            let value =
                scalar_or_list(yaml).map_err(|why| format!("parameter '{prefix}' of '{node}': {why}"))?;
            self.insert(node, prefix, value);
            return Ok(());
        };
        for (key, inner) in entries {
            let key = match key {
                Yaml::String(key) => key.clone(),
                Yaml::Number(key) => key.to_string(),
                _ => return Err(format!("a parameter's name of '{node}' is neither text nor a number")),
            };
            let name = if prefix.is_empty() { key } else { format!("{prefix}.{key}") };
            self.add_values(node, &name, inner)?;
        }
        Ok(())
    }

    /// The values for one node. Those under its own name take precedence over those of patterns, later ones over
    /// earlier ones.
    pub fn for_node(&self, full_name: &str) -> BTreeMap<String, Value> {
        let name = segments(full_name);
        let fits = |exact: bool| {
            let name = &name;
            self.nodes.iter().filter(move |(pattern, _)| fit(pattern, name) && (pattern == name) == exact)
        };
        let values = fits(false).chain(fits(true)).flat_map(|(_, values)| values);
        values.map(|(name, value)| (name.clone(), value.clone())).collect()
    }

    /// The patterns that name this node, but in another namespace: nothing under them is for it.
    pub fn missed(&self, full_name: &str) -> Vec<String> {
        let name = segments(full_name);
        let misses = |(pattern, _): &&(Vec<String>, _)| pattern.last() == name.last() && !fit(pattern, &name);
        self.nodes.iter().filter(misses).map(|(pattern, _)| pattern.join("/")).collect()
    }
}

/// YAML without aliases, which rcl refuses too, and of which a short text makes a long one.
fn parsed(text: &str) -> Result<Yaml, String> {
    let names = |mark: char| -> HashSet<&str> {
        let ends = |c: char| !(c.is_alphanumeric() || c == '_' || c == '-');
        let of = |rest: &'_ str| rest.find(ends).unwrap_or(rest.len());
        text.split(mark).skip(1).map(|rest| &rest[..of(rest)]).filter(|name| !name.is_empty()).collect()
    };
    if let Some(name) = names('*').intersection(&names('&')).next() {
        return Err(format!("has the alias '*{name}', which ROS does not read; write its value there"));
    }
    let mut depth = 0_usize;
    for byte in text.bytes() {
        match byte {
            b'[' | b'{' => depth += 1,
            b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        ensure(depth <= DEEPEST, || {
            format!("has lists in lists, more than {DEEPEST} deep; a parameter is one list at most")
        })?;
    }
    serde_norway::from_str(text).map_err(|error| format!("is not YAML: {error}"))
}

fn segments(name: &str) -> Vec<String> {
    name.split('/').filter(|segment| !segment.is_empty()).map(str::to_owned).collect()
}

fn fit(pattern: &[String], name: &[String]) -> bool {
    match (pattern, name) {
        ([], []) => true,
        ([first, rest @ ..], _) if first == "**" => {
            fit(rest, name) || name.split_first().is_some_and(|(_, later)| fit(pattern, later))
        }
        ([first, rest @ ..], [segment, later @ ..]) => (first == "*" || first == segment) && fit(rest, later),
        _ => false,
    }
}

/// A parameter value from YAML: a scalar, or a list of scalars of one type.
///
/// # Errors
/// No value, a list of mixed types, a list of lists, or a mapping.
fn scalar_or_list(yaml: &Yaml) -> Result<Value, String> {
    Ok(match yaml {
        Yaml::Null => return Err("there is no value; write \"\" for an empty one".into()),
        Yaml::Bool(value) => Value::Bool(*value),
        Yaml::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(int), _) => Value::Int(int),
            (None, Some(double)) if !number.is_u64() => Value::Double(double),
            _ => return Err(format!("{number} does not fit a 64-bit integer")),
        },
        Yaml::String(text) => Value::Str(text.clone()),
        Yaml::Sequence(items) => {
            let items = items.iter().map(scalar_or_list).collect::<Result<Vec<_>, _>>()?;
            let nested = items.iter().any(|item| matches!(item, Value::List(_)));
            ensure(!nested, || "a list of lists is not a ROS 2 parameter")?;
            let kind = |item: &Value| std::mem::discriminant(item);
            let equal = items.windows(2).all(|pair| kind(&pair[0]) == kind(&pair[1]));
            let reason = "the items of a list must all be of one type (write 1.0, not 1, among doubles)";
            ensure(equal, || reason)?;
            Value::List(items)
        }
        Yaml::Mapping(_) | Yaml::Tagged(_) => return Err("a value is a scalar or a list of scalars".into()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> Result<ParamFile, String> {
        let mut params = ParamFile::default();
        params.add_text(text).map(|()| params)
    }

    #[test]
    fn lists_in_lists_and_aliases_are_refused_before_they_are_read() {
        let mut file = ParamFile::default();
        for deep in ["[".repeat(50_000), "{a: ".repeat(50_000), "[[],".repeat(50_000)] {
            assert!(file.add_text(&deep).unwrap_err().contains("more than 64 deep"));
            assert!(
                file.add_rule(&format!("a:={deep}")).unwrap_err().to_string().contains("more than 64 deep")
            );
        }
        let bomb = "a: &a [1, 1]\nb: &b-2 [*a, *a]\nc: [*b-2, *b-2]\n";
        assert!(file.add_text(bomb).unwrap_err().contains("alias"));
        let many = format!("n: {{ros__parameters: {{a: [{}], b: 'x*y & z'}}}}", "'[]', ".repeat(1000));
        file.add_text(&many).expect("one list");
    }

    #[test]
    fn the_nodes_own_name_wins_over_patterns_wherever_they_stand() {
        let mut params =
            file("robot:\n  ros__parameters: {a: 2}\n/**:\n  ros__parameters: {a: 1, b: 1e3}\n").unwrap();
        params.insert("/**", "a", Value::Int(9));
        let values = params.for_node("/robot");
        assert_eq!(values["a"], Value::Int(2));
        assert_eq!(values["b"], Value::Double(1000.0));
        assert_eq!(params.for_node("/x/robot")["a"], Value::Int(9));
    }

    #[test]
    fn what_a_file_has_for_the_node_of_another_namespace_is_named() {
        let params = file("bot: {ros__parameters: {a: 1}}\n/**/bot: {ros__parameters: {b: 1}}\n").unwrap();
        assert_eq!(params.missed("/r1/bot"), ["bot"]);
        assert!(params.missed("/bot").is_empty() && params.missed("/r1/other").is_empty());
    }

    #[test]
    fn nested_nodes_patterns_and_nested_parameters_are_found() {
        let params = file(
            "my:\n  ns:\n    bot: {ros__parameters: {f: {x: 1.5, y: {z: 'yes'}}, l: [a, b]}}\n\
             /*: {ros__parameters: {no: 1}}\n/**/bot: {ros__parameters: {w: true}}\n",
        )
        .unwrap();
        let values = params.for_node("/my/ns/bot");
        let names: Vec<_> = values.keys().map(String::as_str).collect();
        assert_eq!(names, ["f.x", "f.y.z", "l", "w"]);
        assert_eq!(values["f.y.z"], Value::Str("yes".into()));
    }

    #[test]
    fn a_wrong_file_is_refused_with_the_place() {
        for (text, place) in [
            ("a: [1, 2", "line"),
            ("robot: {ros__parameters: {dt: }}", "'dt'"),
            ("robot: {ros__parameters: {goal: [1, 2.5]}}", "'goal'"),
            ("robot: {dt: 1}", "ros__parameters"),
            ("ros__parameters: {dt: 1}", "under no node"),
            ("robot: {ros__parameters: 3}", "not a mapping"),
            ("- a", "ros__parameters"),
        ] {
            let error = file(text).unwrap_err();
            assert!(error.contains(place), "{text}: {error}");
        }
        let error = ParamFile::default().add_file(Path::new("/no/such.yaml")).unwrap_err().0;
        assert!(error.contains("/no/such.yaml"), "{error}");
    }
}
