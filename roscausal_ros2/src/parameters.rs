//! A node's parameters: declared with descriptions and ranges, served by the standard services.

use std::{
    collections::BTreeMap,
    sync::{Mutex, MutexGuard},
};

use ros2_client::{
    parameters::raw,
    rcl_interfaces::{ListParametersResult, SetParametersRequest},
};
use roscausal_core::{
    Result,
    batch::header::nearest,
    params::{Allowed, ParamSpec, Value},
};
use roscausal_ros::lock;

/// The parameters of one node.
pub(crate) struct Parameters {
    /// Values from the command line and the parameter files.
    overrides: BTreeMap<String, Value>,
    declared: Mutex<BTreeMap<String, Declared>>,
}

struct Declared {
    /// `None` for what the node itself has set without declaring it.
    spec: Option<ParamSpec>,
    /// `None` while nobody has set it.
    value: Option<Value>,
}

/// The parameter that every node has: time comes from `/clock`.
pub(crate) const USE_SIM_TIME: ParamSpec = ParamSpec {
    name: "use_sim_time",
    default: Value::Bool(false),
    description: "Take time from /clock",
    allowed: Allowed::Any,
};

impl Parameters {
    pub(crate) fn new(overrides: BTreeMap<String, Value>) -> Self {
        Self { overrides, declared: Mutex::default() }
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Declared>> {
        lock(&self.declared)
    }

    /// Declares a parameter unless it is declared already. The value set for it, and whether it is new.
    ///
    /// # Errors
    /// When the value it was started with is not allowed.
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

    /// The value of now, as the wire has it; "not set" for an unknown name.
    pub(crate) fn get(&self, name: &str) -> raw::ParameterValue {
        let declared = self.lock();
        declared.get(name).and_then(Declared::current).map_or_else(not_set, to_wire)
    }

    /// Sets parameters, all of them or, with a reason, none. What was set is returned.
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

    /// Sets a parameter from within the node, whether it is declared or not.
    pub(crate) fn put(&self, name: &str, value: Value) {
        let mut declared = self.lock();
        declared.entry(ros2_name(name)).or_insert(Declared { spec: None, value: None }).value = Some(value);
    }

    /// Answers `list_parameters`: `depth` 0 is any depth, prefixes are names up to a `.`.
    pub(crate) fn list(&self, prefixes: &[String], depth: u64) -> ListParametersResult {
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
        let mut prefixes: Vec<_> =
            names.iter().filter_map(|name| Some(name.rsplit_once('.')?.0.to_owned())).collect();
        prefixes.dedup();
        ListParametersResult { names, prefixes }
    }

    /// Answers `describe_parameters` for one name; type 0 for an unknown one.
    pub(crate) fn describe(&self, name: &str) -> raw::ParameterDescriptor {
        let declared = self.lock();
        let entry = declared.get(name);
        let mut descriptor = raw::ParameterDescriptor {
            name: name.to_owned(),
            r#type: 0,
            description: String::new(),
            additional_constraints: String::new(),
            read_only: false,
            dynamic_typing: false,
            floating_point_range: vec![],
            integer_range: vec![],
        };
        descriptor.r#type = entry.and_then(Declared::current).map_or(0, |value| to_wire(value).ptype);
        let Some(spec) = entry.and_then(|entry| entry.spec.as_ref()) else { return descriptor };
        descriptor.description = spec.description.to_owned();
        match (&spec.allowed, &spec.default) {
            (Allowed::Range(from, to), Value::Int(_)) => {
                let (from_value, to_value) = (*from as i64, *to as i64);
                descriptor.integer_range = vec![raw::IntegerRange { from_value, to_value, step: 0 }];
            }
            (Allowed::Range(from, to), Value::Double(_)) => {
                let (from_value, to_value) = (*from, *to);
                descriptor.floating_point_range =
                    vec![raw::FloatingPointRange { from_value, to_value, step: 0.0 }];
            }
            (Allowed::Range(from, to), _) => {
                descriptor.additional_constraints = format!("a number from {from} to {to}")
            }
            (Allowed::OneOf(words), _) => {
                descriptor.additional_constraints = format!("one of: {}", words.join(", "))
            }
            (Allowed::Any, _) => {}
        }
        descriptor
    }

    /// Names of the parameters that the node was started with, but for those that another one names, such as
    /// `goal_param`: they are asked for when they are needed.
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

/// ROS 2 has no parameters outside nodes: an absolute ROS 1 name `/a/b` is this node's `a.b`.
pub(crate) fn ros2_name(name: &str) -> String {
    name.strip_prefix('/').map_or_else(|| name.to_owned(), |name| name.replace('/', "."))
}

fn not_set() -> raw::ParameterValue {
    ros2_client::ParameterValue::NotSet.into()
}

/// A value as `rcl_interfaces/ParameterValue`.
pub(crate) fn to_wire(value: &Value) -> raw::ParameterValue {
    use ros2_client::ParameterValue as Wire;
    macro_rules! list {
        ($items:expr, $kind:path, $array:path) => {
            $array(
                $items
                    .iter()
                    .filter_map(|item| match item {
                        $kind(item) => Some(item.clone()),
                        _ => None,
                    })
                    .collect(),
            )
        };
    }
    match value {
        Value::Bool(value) => Wire::Boolean(*value),
        Value::Int(value) => Wire::Integer(*value),
        Value::Double(value) => Wire::Double(*value),
        Value::Str(value) => Wire::String(value.clone()),
        Value::List(items) => match items.first() {
            Some(Value::Bool(_)) => list!(items, Value::Bool, Wire::BooleanArray),
            Some(Value::Int(_)) => list!(items, Value::Int, Wire::IntegerArray),
            Some(Value::Double(_)) => list!(items, Value::Double, Wire::DoubleArray),
            _ => list!(items, Value::Str, Wire::StringArray),
        },
    }
    .into()
}

/// The values of a set request; `None` for "unset".
pub(crate) fn from_wire(request: SetParametersRequest) -> Vec<(String, Option<Value>)> {
    use ros2_client::ParameterValue as Wire;
    let value = |value: raw::ParameterValue| match value.into() {
        Wire::NotSet => None,
        Wire::Boolean(value) => Some(Value::Bool(value)),
        Wire::Integer(value) => Some(Value::Int(value)),
        Wire::Double(value) => Some(Value::Double(value)),
        Wire::String(value) => Some(Value::Str(value)),
        Wire::ByteArray(items) => {
            Some(Value::List(items.into_iter().map(|byte| Value::Int(byte.into())).collect()))
        }
        Wire::BooleanArray(items) => Some(Value::List(items.into_iter().map(Value::Bool).collect())),
        Wire::IntegerArray(items) => Some(Value::List(items.into_iter().map(Value::Int).collect())),
        Wire::DoubleArray(items) => Some(Value::List(items.into_iter().map(Value::Double).collect())),
        Wire::StringArray(items) => Some(Value::List(items.into_iter().map(Value::Str).collect())),
    };
    request.parameter.into_iter().map(|parameter| (parameter.name, value(parameter.value))).collect()
}
