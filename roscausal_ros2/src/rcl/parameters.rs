//! A node's parameters, declared with descriptions and ranges.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, MutexGuard};

use roscausal_core::params::{Allowed, ParamSpec, Params, TakeParams, Value, nearest};
use roscausal_core::{Result, gate::lock};

/// The parameters of one node.
pub(crate) struct Parameters {
    /// Values from the command line and the parameter files.
    overrides: BTreeMap<String, Value>,
    declared: Mutex<BTreeMap<String, Declared>>,
    /// The node's parameters, and what decides on changes of them.
    watched: Mutex<Option<(Params, TakeParams)>>,
}

struct Declared {
    /// `None` for a parameter that the node itself has set without declaring it.
    spec: Option<ParamSpec>,
    /// `None` while nobody has set it.
    value: Option<Value>,
}

/// The parameter that every node has: whether time comes from `/clock`.
pub(crate) const USE_SIM_TIME: ParamSpec =
    ParamSpec::new("use_sim_time", Value::Bool(false), Allowed::Any, "Take time from /clock").live();

impl Parameters {
    /// The parameters of a node that was started with these values.
    pub(crate) fn new(overrides: BTreeMap<String, Value>) -> Self {
        Self { overrides, declared: Mutex::default(), watched: Mutex::default() }
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

    /// Has `take` decide on changes of the node's parameters, which are `now`; also on those that were set since the node read them.
    pub(crate) fn watch(&self, now: &Params, take: TakeParams) {
        let declared = self.lock();
        let current = declared.values().filter_map(|one| Some((one.spec.as_ref()?.name, one.current()?)));
        let mut now = now.clone();
        let since = now.with(current);
        if since != now {
            match take(&since) {
                Ok(()) => now = since,
                Err(error) => tracing::warn!("not taken: {error}"),
            }
        }
        *lock(&self.watched) = Some((now, take));
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
                Some(spec) => spec.changed(value).map_err(|error| error.to_string())?,
                None => value,
            };
            checked.push((name, value));
        }
        if let Some((now, take)) = &mut *lock(&self.watched) {
            let changed = now.with(checked.iter().map(|(name, value)| (name.as_str(), value)));
            take(&changed).map_err(|error| error.to_string())?;
            *now = changed;
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
        ParamSpec::new("rate", Value::Double(1.0), Allowed::Range(0.0, 10.0), "of the test").live();

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
    fn a_running_node_refuses_what_it_reads_at_the_start_and_takes_the_rest_by_the_checks_of_the_start() {
        let mut live = Vec::new();
        for name in roscausal_core::nodes::NODES {
            let (specs, node) = (roscausal_core::nodes::parameters(name).unwrap(), node(&[]));
            for spec in &specs {
                node.declare(spec).unwrap();
                let change = vec![(ros2_name(spec.name), Some(spec.default.clone()))];
                match node.set(change) {
                    Ok(set) => live.push(set[0].0.clone()),
                    Err(reason) => {
                        assert!(
                            reason.contains(spec.name) && reason.contains("start the node again"),
                            "{reason}"
                        );
                        let descriptor = crate::wire::descriptor(spec.name, None, Some(spec.clone()));
                        assert!(descriptor.read_only, "{}", spec.name);
                    }
                }
            }
        }
        assert!(
            ["ts_length", "sig_alpha", "cd_method", "max_lag"]
                .iter()
                .all(|name| live.iter().any(|one| one == name))
        );
        assert!(
            ["dt", "features", "data_dir", "cd_method_dir"]
                .iter()
                .all(|name| live.iter().all(|one| one != name))
        );
    }

    #[test]
    fn the_node_has_the_last_word_and_a_refused_change_changes_nothing() {
        let bus = roscausal_core::loopback::Loopback::lockstep();
        let now = Params::read(&bus.node("test"), &[RATE]).unwrap();
        let parameters = node(&[]);
        parameters.declare(&RATE).unwrap();
        parameters.put("/free", Value::Int(1));
        // Set between the node's reading and its asking to be told.
        let set =
            |name: &str, value: f64| parameters.set(vec![(name.to_owned(), Some(Value::Double(value)))]);
        set("rate", 5.0).unwrap();
        let taken = std::sync::Arc::new(Mutex::new(Vec::new()));
        let reported = taken.clone();
        let odd = |rate: f64| roscausal_core::Error::param("rate", format!("{rate} is odd"));
        let take = move |params: &Params| {
            let rate = params.double("rate");
            if rate == 7.0 {
                Err(odd(rate))
            } else {
                lock(&reported).push(rate);
                Ok(())
            }
        };
        parameters.watch(&now, Box::new(take));
        set("rate", 2.0).unwrap();
        assert!(set("rate", 7.0).unwrap_err().contains("7 is odd"));
        set("free", 3.0).unwrap();
        assert_eq!(
            (parameters.get("rate"), lock(&taken).as_slice()),
            (Some(Value::Double(2.0)), &[5.0, 2.0, 2.0][..])
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
