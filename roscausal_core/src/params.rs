//! Parameters: values as a middleware stores them, and the specifications that a node declares.

use std::{collections::BTreeMap, fmt};

use serde::Serialize;

use crate::{Error, Result};

/// The known name that a user may have meant.
pub use roscausal_discovery::names::{instead, nearest};

/// A parameter value, as in the ROS 1 parameter server and in ROS 2 parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// Boolean.
    Bool(bool),
    /// Integer.
    Int(i64),
    /// Double.
    Double(f64),
    /// String.
    Str(String),
    /// List of values (ROS 2: all of one type).
    List(Vec<Value>),
}

/// A parameter as a node declares it: name, default, description, allowed values.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamSpec {
    /// Private name (`dt`), or an absolute one (`/hri/human_goal`) for a parameter that belongs to no node.
    pub name: &'static str,
    /// The value if nothing is set. Its variant is the type of the parameter.
    pub default: Value,
    /// One line for `ros2 param describe` and the documentation.
    pub description: &'static str,
    /// The allowed values.
    pub allowed: Allowed,
    /// Whether it describes the data or their analysis, so that settings that come with data may set it: never a path, a
    /// program, a pool, or what an analysis may cost.
    pub of_data: bool,
    /// Whether a node that runs takes a new value, from its next batch on. All others are read when the node starts.
    pub live: bool,
}

/// The values that a parameter may take.
#[derive(Clone, Debug, PartialEq)]
pub enum Allowed {
    /// Any value of the default's type.
    Any,
    /// A number between these two, both included.
    Range(f64, f64),
    /// One of these words.
    OneOf(&'static [&'static str]),
}

/// A table of parameters, as a list of [`ParamSpec`]: what it is of [`ParamSpec::of_data`] and [`ParamSpec::live`], its name, default,
/// allowed values and description.
///
/// ```
/// use roscausal_core::{param_specs, params::{Allowed::Range, Value::Double}};
///
/// let specs = param_specs! {
///     of_data live "dt" = Double(0.1), Range(0.001, 60.0), "step between rows in seconds";
/// };
/// assert!(specs[0].live && specs[0].of_data);
/// ```
#[macro_export]
macro_rules! param_specs {
    ($($($kind:ident)* $name:literal = $default:expr, $allowed:expr, $description:expr;)*) => {
        vec![$($crate::params::ParamSpec::new($name, $default, $allowed, $description)$(.$kind())*),*]
    };
}

impl ParamSpec {
    /// A specification. The nodes keep them in static tables.
    pub const fn new(name: &'static str, value: Value, allowed: Allowed, description: &'static str) -> Self {
        Self { name, default: value, description, allowed, of_data: false, live: false }
    }

    /// The same for a parameter that settings that come with data may set ([`ParamSpec::of_data`]).
    #[must_use]
    pub const fn of_data(mut self) -> Self {
        self.of_data = true;
        self
    }

    /// The same for a parameter that may change while its node runs.
    #[must_use]
    pub const fn live(mut self) -> Self {
        self.live = true;
        self
    }

    /// What somebody sets while the node runs, as this parameter's type.
    ///
    /// # Errors
    /// A parameter that is read when the node starts, and those of [`ParamSpec::checked`].
    pub fn changed(&self, value: Value) -> Result<Value> {
        let value = self.checked(value)?;
        if self.live {
            return Ok(value);
        }
        let reason =
            format!("it is read when the node starts; start the node again with {}:={value}", self.name);
        Err(Error::param(self.name, reason))
    }

    fn is_word(&self, text: &str) -> bool {
        matches!(&self.allowed, Allowed::OneOf(words) if words.contains(&text))
    }

    /// The value as this parameter's type. ROS-Causal's spellings are accepted: `"True"`, `"0.1"`, an integer for a
    /// double, a number for a text.
    ///
    /// # Errors
    /// A value of another kind, or one that is not allowed. The message has the name, the value and what is
    /// allowed.
    pub fn checked(&self, value: Value) -> Result<Value> {
        let fault = |wanted: &str| Error::param(self.name, format!("{value} is not {wanted}"));
        let value = match (&self.default, &value) {
            (Value::Bool(_), value) => Value::Bool(value.as_bool().ok_or_else(|| fault("true or false"))?),
            (Value::Int(_), value) => Value::Int(value.as_int().ok_or_else(|| fault("a whole number"))?),
            // "" means "none" where any number is allowed.
            (Value::Double(_), Value::Str(text)) if text.is_empty() && self.allowed == Allowed::Any => value,
            (Value::Double(_), value) => Value::Double(value.as_double().ok_or_else(|| fault("a number"))?),
            (Value::Str(_), Value::List(_)) => return Err(fault("a text")),
            (Value::Str(_), Value::Str(text))
                if matches!(text.as_str(), "None" | "none") && !self.is_word(text) =>
            {
                Value::Str(String::new())
            }
            (Value::Str(_), value) => Value::Str(value.to_string()),
            (Value::List(_), Value::List(_)) => value,
            (Value::List(_), Value::Str(text)) => {
                let items = text.split(',').map(str::trim).filter(|item| !item.is_empty());
                Value::List(items.map(|item| Value::Str(item.to_owned())).collect())
            }
            (Value::List(_), _) => return Err(fault("a list")),
        };
        match &self.allowed {
            Allowed::Range(low, high) if !value.as_double().is_some_and(|v| v >= *low && v <= *high) => {
                let reason = format!("{value} is not allowed; give a number from {low} to {high}");
                Err(Error::param(self.name, reason))
            }
            Allowed::OneOf(words) if !words.contains(&value.to_string().as_str()) => {
                let allowed = instead(words, &value.to_string(), "allowed:");
                Err(Error::param(self.name, format!("'{value}' is unknown; {allowed}")))
            }
            _ => Ok(value),
        }
    }
}

impl Value {
    /// The value as a boolean, from any of its spellings.
    pub fn as_bool(&self) -> Option<bool> {
        match self {
            Self::Bool(value) => Some(*value),
            Self::Int(0) => Some(false),
            Self::Int(1) => Some(true),
            Self::Str(text) => match text.to_lowercase().as_str() {
                "true" | "yes" | "on" | "1" => Some(true),
                "false" | "no" | "off" | "0" | "" => Some(false),
                _ => None,
            },
            _ => None,
        }
    }

    /// The value as an integer, from any of its spellings.
    pub fn as_int(&self) -> Option<i64> {
        match self {
            Self::Int(value) => Some(*value),
            Self::Double(value) if value.fract() == 0.0 && value.abs() < 9e15 => Some(*value as i64),
            Self::Str(text) => text.trim().parse().ok(),
            _ => None,
        }
    }

    /// The value as a number, from any of its spellings.
    pub fn as_double(&self) -> Option<f64> {
        match self {
            Self::Int(value) => Some(*value as f64),
            Self::Double(value) => Some(*value),
            Self::Str(text) => text.trim().parse().ok().filter(|v: &f64| !v.is_nan()),
            _ => None,
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => value.fmt(f),
            Self::Int(value) => value.fmt(f),
            Self::Double(value) => value.fmt(f),
            Self::Str(value) => value.fmt(f),
            Self::List(values) => {
                let values: Vec<String> = values.iter().map(Self::to_string).collect();
                write!(f, "[{}]", values.join(", "))
            }
        }
    }
}

/// The checked parameters of one node, by name.
#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    pub(crate) values: BTreeMap<&'static str, Value>,
}

impl Params {
    /// These parameters with some other values, which are checked already.
    #[must_use]
    pub fn with<'a>(&self, changes: impl IntoIterator<Item = (&'a str, &'a Value)>) -> Self {
        let mut params = self.clone();
        for (name, value) in changes {
            if let Some(own) = params.values.get_mut(name) {
                own.clone_from(value);
            }
        }
        params
    }

    /// A flag; false if this node has no parameter `name`.
    pub fn flag(&self, name: &str) -> bool {
        self.values.get(name).and_then(Value::as_bool).unwrap_or(false)
    }

    /// An integer; 0 if this node has no parameter `name`.
    pub fn int(&self, name: &str) -> i64 {
        self.values.get(name).and_then(Value::as_int).unwrap_or(0)
    }

    /// An integer that is not negative.
    pub fn count(&self, name: &str) -> usize {
        usize::try_from(self.int(name)).unwrap_or(0)
    }

    /// A number; NaN if this node has no parameter `name`, or its value is an empty text.
    pub fn double(&self, name: &str) -> f64 {
        self.values.get(name).and_then(Value::as_double).unwrap_or(f64::NAN)
    }

    /// A text; empty if this node has no parameter `name`.
    pub fn text(&self, name: &str) -> String {
        self.values.get(name).map_or(String::new(), Value::to_string)
    }

    /// A text; `None` if it is empty.
    pub fn text_if_set(&self, name: &str) -> Option<String> {
        Some(self.text(name)).filter(|text| !text.is_empty())
    }

    /// The items of a list as texts.
    pub fn list(&self, name: &str) -> Vec<String> {
        match self.values.get(name) {
            Some(Value::List(values)) => values.iter().map(Value::to_string).collect(),
            _ => Vec::new(),
        }
    }

    /// All parameters with their values, for a batch's metadata.
    pub fn all(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.values.iter().map(|(name, value)| (*name, value))
    }
}

/// What decides on new values of a node's parameters while it runs: it gets all of them as they would be, and takes them or says why
/// not.
pub type TakeParams = Box<dyn Fn(&Params) -> Result<()> + Send + Sync>;

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(default: Value, allowed: Allowed) -> ParamSpec {
        ParamSpec::new("dt", default, allowed, "")
    }

    fn text(text: &str) -> Value {
        Value::Str(text.into())
    }

    #[test]
    fn the_spellings_of_python_and_yaml_are_understood() {
        let flag = spec(Value::Bool(false), Allowed::Any);
        assert_eq!(flag.checked(text("True")).expect("a flag"), Value::Bool(true));
        let number = spec(Value::Double(0.1), Allowed::Range(0.01, 10.0));
        assert_eq!(number.checked(Value::Int(1)).expect("a number"), Value::Double(1.0));
        assert_eq!(number.checked(text("0.3")).expect("a number"), Value::Double(0.3));
        assert_eq!(spec(text("x"), Allowed::Any).checked(Value::Int(1000)).expect("a text"), text("1000"));
        assert_eq!(spec(text("x"), Allowed::Any).checked(text("None")).expect("a text"), text(""));
        let word = spec(text("auto"), Allowed::OneOf(&["auto", "none"]));
        assert_eq!(word.checked(text("none")).expect("a word"), text("none"));
        let length = spec(Value::Double(150.0), Allowed::Any);
        assert_eq!(length.checked(text("")).expect("no number"), text(""));
        assert!(number.checked(text("")).is_err());
    }

    #[test]
    fn a_running_node_is_set_what_it_reads_anew_and_nothing_else() {
        let number = spec(Value::Double(0.1), Allowed::Range(0.01, 10.0));
        let error = number.changed(Value::Double(1.0)).expect_err("read at the start").to_string();
        assert!(
            error.starts_with("parameter 'dt'") && error.contains("start the node again with dt:=1"),
            "{error}"
        );
        let number = number.live();
        assert_eq!(number.changed(text("1")).expect("a number"), Value::Double(1.0));
        assert!(number.changed(Value::Double(99.0)).is_err());
    }

    #[test]
    fn a_refusal_names_value_and_what_is_allowed() {
        let number = spec(Value::Double(0.1), Allowed::Range(0.01, 10.0));
        let error = number.checked(Value::Double(0.0)).expect_err("too small").to_string();
        assert_eq!(error, "parameter 'dt': 0 is not allowed; give a number from 0.01 to 10");
        assert!(number.checked(Value::Double(f64::NAN)).is_err());
        let word = spec(text("pcmci"), Allowed::OneOf(&["pcmci", "fpcmci"]));
        let error = word.checked(text("pcmcy")).expect_err("unknown").to_string();
        assert!(error.contains("did you mean 'pcmci'?"), "{error}");
    }
}
