//! A node's parameters, declared with descriptions and ranges.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Mutex, MutexGuard},
};

use roscausal_core::{
    Result,
    gate::lock,
    params::{Allowed, ParamSpec, Value, nearest},
};

/// The parameters of one node.
pub(crate) struct Parameters {
    /// Values from the command line and the parameter files.
    overrides: BTreeMap<String, Value>,
    declared: Mutex<BTreeMap<String, Declared>>,
}

struct Declared {
    /// `None` for a parameter that the node itself has set without declaring it.
    spec: Option<ParamSpec>,
    /// `None` while nobody has set it.
    value: Option<Value>,
}

/// The parameter that every node has: whether time comes from `/clock`.
pub(crate) const USE_SIM_TIME: ParamSpec =
    ParamSpec::new("use_sim_time", Value::Bool(false), Allowed::Any, "Take time from /clock");

impl Parameters {
    /// The parameters of a node that was started with these values.
    pub(crate) fn new(overrides: BTreeMap<String, Value>) -> Self {
        Self { overrides, declared: Mutex::default() }
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Declared>> {
        lock(&self.declared)
    }

    /// Declares a parameter unless it is already declared. Returns the value set for it, and whether it is new.
    ///
    /// # Errors
    /// If the value that the node was started with is not allowed.
    pub(crate) fn declare(&self, spec: &ParamSpec) -> Result<(Option<Value>, bool)> {
        let name = ros2_name(spec.name);
        let mut declared = self.lock();
        if let Some(known) = declared.get(&name) {
            return Ok((known.value.clone(), false));
        }
        let value = self.overrides.get(&name).map(|value| spec.checked(value.clone())).transpose()?;
        declared.insert(name, Declared { spec: Some(spec.clone()), value: value.clone() });
        Ok((value, true))
    }

    /// The current value; `None` for an unknown name.
    pub(crate) fn get(&self, name: &str) -> Option<Value> {
        self.lock().get(name)?.current().cloned()
    }

    /// Sets parameters, all of them or none (a value `None` unsets). Returns what was set.
    ///
    /// # Errors
    /// The first parameter that cannot be set, and why.
    pub(crate) fn set(
        &self,
        changes: Vec<(String, Option<Value>)>,
    ) -> std::result::Result<Vec<(String, Value)>, String> {
        let mut declared = self.lock();
        let mut checked = Vec::new();
        for (name, value) in changes {
            let Some(entry) = declared.get(&name) else {
                let known: Vec<_> = declared.keys().collect();
                let near =
                    nearest(&known, &name).map_or(String::new(), |near| format!("; did you mean '{near}'?"));
                return Err(format!("parameter '{name}' is not declared{near}"));
            };
            let value =
                value.ok_or_else(|| format!("parameter '{name}': cannot be unset; set it to a value"))?;
            let value = match &entry.spec {
                Some(spec) => spec.checked(value).map_err(|error| error.to_string())?,
                None => value,
            };
            checked.push((name, value));
        }
        for (name, value) in &checked {
            if let Some(entry) = declared.get_mut(name) {
                entry.value = Some(value.clone());
            }
        }
        Ok(checked)
    }

    /// Sets a parameter from within the node, declared or not.
    pub(crate) fn put(&self, name: &str, value: Value) {
        let mut declared = self.lock();
        declared.entry(ros2_name(name)).or_insert(Declared { spec: None, value: None }).value = Some(value);
    }

    /// Names of parameters, and their prefixes (names up to a `.`). `depth` 0 means any depth.
    pub(crate) fn list(&self, prefixes: &[String], depth: u64) -> (Vec<String>, Vec<String>) {
        let shallow = |rest: &str| depth == 0 || (rest.matches('.').count() as u64) < depth;
        let listed = |name: &&String| {
            if prefixes.is_empty() {
                return shallow(name);
            }
            prefixes.iter().any(|prefix| {
                let below = name.strip_prefix(prefix.as_str()).and_then(|rest| rest.strip_prefix('.'));
                *name == prefix || below.is_some_and(shallow)
            })
        };
        let names: Vec<_> = self.lock().keys().filter(listed).cloned().collect();
        let prefixes = names.iter().filter_map(|name| Some(name.rsplit_once('.')?.0.to_owned()));
        let prefixes = prefixes.collect::<BTreeSet<_>>().into_iter().collect();
        (names, prefixes)
    }

    /// The specification under this name. `None` for unknown names, and for a parameter that the node has set
    /// without declaring it.
    pub(crate) fn spec(&self, name: &str) -> Option<ParamSpec> {
        self.lock().get(name)?.spec.clone()
    }

    /// Names of the parameters that the node was started with. Those that another parameter names, such as
    /// `goal_param`, are left out: they are read when needed.
    pub(crate) fn given(&self) -> Vec<String> {
        let declared = self.lock();
        let texts = declared.values().filter_map(Declared::current);
        let named: Vec<_> = texts.map(|value| ros2_name(&value.to_string())).collect();
        self.overrides.keys().filter(|name| !named.contains(name)).cloned().collect()
    }
}

impl Declared {
    fn current(&self) -> Option<&Value> {
        self.value.as_ref().or(self.spec.as_ref().map(|spec| &spec.default))
    }
}

/// ROS 2 has no global parameters, so an absolute ROS 1 name `/a/b` becomes this node's `a.b`.
pub(crate) fn ros2_name(name: &str) -> String {
    name.strip_prefix('/').map_or_else(|| name.to_owned(), |name| name.replace('/', "."))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: ParamSpec =
        ParamSpec::new("rate", Value::Double(1.0), Allowed::Range(0.0, 10.0), "of the test");

    fn node(overrides: &[(&str, Value)]) -> Parameters {
        Parameters::new(overrides.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect())
    }

    #[test]
    fn what_the_node_was_started_with_wins_over_the_default() {
        let value = Value::Double(3.0);
        let parameters = node(&[("rate", value.clone())]);
        assert_eq!(parameters.get("rate"), None);
        assert_eq!(parameters.declare(&RATE).unwrap(), (Some(value.clone()), true));
        assert_eq!(parameters.declare(&RATE).unwrap(), (Some(value.clone()), false));
        assert_eq!(parameters.get("rate"), Some(value));
        assert!(node(&[("rate", Value::Double(11.0))]).declare(&RATE).is_err());
    }

    #[test]
    fn all_changes_are_made_or_none() {
        let parameters = node(&[]);
        parameters.declare(&RATE).unwrap();
        parameters.put("/free", Value::Int(1));
        let change = |name: &str, value| (name.to_owned(), Some(value));
        for (bad, reason) in [
            (change("rate", Value::Double(11.0)), "rate"),
            (change("rat", Value::Double(1.0)), "did you mean 'rate'"),
            (("rate".to_owned(), None), "cannot be unset"),
        ] {
            let error = parameters.set(vec![change("free", Value::Int(2)), bad]).unwrap_err();
            assert!(error.contains(reason), "{error}");
            assert_eq!(parameters.get("free"), Some(Value::Int(1)));
        }
        parameters.set(vec![change("rate", Value::Double(2.0)), change("free", Value::Int(2))]).unwrap();
        assert_eq!(
            (parameters.get("rate"), parameters.get("free")),
            (Some(Value::Double(2.0)), Some(Value::Int(2)))
        );
    }

    #[test]
    fn each_prefix_is_listed_once() {
        let parameters = node(&[]);
        for name in ["a.b.x", "a.c", "a.d.y", "a.e", "top"] {
            parameters.put(name, Value::Int(0));
        }
        let strings = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        assert_eq!(
            parameters.list(&[], 0),
            (strings(&["a.b.x", "a.c", "a.d.y", "a.e", "top"]), strings(&["a", "a.b", "a.d"]))
        );
        assert_eq!(parameters.list(&[], 1), (strings(&["top"]), vec![]));
        assert_eq!(parameters.list(&strings(&["a"]), 1), (strings(&["a.c", "a.e"]), strings(&["a"])));
        assert_eq!(parameters.list(&strings(&["a.c"]), 1).0, strings(&["a.c"]));
    }
}
