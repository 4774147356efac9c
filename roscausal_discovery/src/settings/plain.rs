//! Values of settings as JSON, which all surfaces have in common.

use std::sync::Arc;

use serde_json::{Map, Value, json};

use super::{
    links::LinkRules,
    scheme::{Block, Scheme},
    typed::{Levels, PcAlpha},
};
use crate::{
    independence_tests::{GpSearch, NullDistributions, Significance},
    methods::{ActsOn, ColliderRule, Fdr, Method, acts_on_of},
    transfer_entropy::TeEstimator,
    types::{Error, Result, VectorNames, vectors_of},
};

/// Reads a value into its place.
pub(super) fn read<T: Plain>(place: &mut T, value: &Value) -> Result<()> {
    *place = T::of(value)?;
    Ok(())
}

/// A value that is written as JSON, and read from it.
pub(super) trait Plain: Sized {
    fn json(&self) -> Value;
    fn of(value: &Value) -> Result<Self>;
}

/// The kind of a value was checked before; what is left is an error of a surface.
fn wrong(value: &Value, wanted: &str) -> Error {
    Error::param("settings", format!("{value} is not {wanted}"))
}

macro_rules! as_serde {
    ($($type:ty, $wanted:literal;)+) => { $(impl Plain for $type {
        fn json(&self) -> Value {
            json!(self)
        }

        fn of(value: &Value) -> Result<Self> {
            serde_json::from_value(value.clone()).map_err(|_| wrong(value, $wanted))
        }
    })+ };
}

as_serde! {
    bool, "true or false";
    usize, "a whole number of 0 or more";
    u64, "a whole number of 0 or more";
    f64, "a number";
    String, "a word";
    Vec<String>, "a list of words";
}

macro_rules! as_word {
    ($($type:ty),+) => { $(impl Plain for $type {
        fn json(&self) -> Value {
            Value::from(self.name())
        }

        fn of(value: &Value) -> Result<Self> {
            value.as_str().map_or_else(|| Err(wrong(value, "a word")), str::parse)
        }
    })+ };
}

as_word!(Method, TeEstimator, Fdr, GpSearch, Significance, ColliderRule, Levels, Scheme);

impl Plain for Block {
    fn json(&self) -> Value {
        Value::from(self.name())
    }

    fn of(value: &Value) -> Result<Self> {
        value.as_str().map_or_else(|| value.to_string().parse(), str::parse)
    }
}

impl<T: Plain> Plain for Option<T> {
    fn json(&self) -> Value {
        self.as_ref().map_or(Value::Null, Plain::json)
    }

    fn of(value: &Value) -> Result<Self> {
        if value.is_null() { Ok(None) } else { T::of(value).map(Some) }
    }
}

impl Plain for PcAlpha {
    fn json(&self) -> Value {
        match self {
            Self::Default => Value::Null,
            Self::Fixed(level) => json!(level),
            Self::ByScore => "auto".into(),
        }
    }

    fn of(value: &Value) -> Result<Self> {
        Ok(match value.as_f64() {
            Some(level) => Self::Fixed(level),
            None if value.is_null() => Self::Default,
            None => Self::ByScore,
        })
    }
}

/// A list of texts, or of the object's keys and values.
fn texts<T>(
    value: &Value,
    of_texts: fn(&[String]) -> Result<T>,
    of: impl Fn(&Map<String, Value>) -> Option<T>,
) -> Result<T> {
    let given = match value {
        Value::Object(map) => of(map),
        list => return of_texts(&Vec::<String>::of(list)?),
    };
    given.ok_or_else(|| wrong(value, "a dict of names"))
}

impl Plain for ActsOn {
    fn json(&self) -> Value {
        self.iter().map(|(column, variable)| format!("{column}={variable}")).collect()
    }

    fn of(value: &Value) -> Result<Self> {
        texts(value, acts_on_of, |map| {
            map.iter().map(|(column, of)| Some((column.clone(), of.as_str()?.to_owned()))).collect()
        })
    }
}

impl Plain for VectorNames {
    fn json(&self) -> Value {
        self.iter().map(|(name, columns)| format!("{name}={}", columns.join("+"))).collect()
    }

    fn of(value: &Value) -> Result<Self> {
        texts(value, vectors_of, |map| {
            let columns = |value: &Value| serde_json::from_value(value.clone()).ok();
            map.iter().map(|(name, of)| Some((name.clone(), columns(of)?))).collect()
        })
    }
}

impl Plain for Arc<NullDistributions> {
    fn json(&self) -> Value {
        self.sizes().collect()
    }

    /// The text of a table, or an object of lists.
    fn of(value: &Value) -> Result<Self> {
        if let Value::String(table) = value {
            return NullDistributions::parse(table).map(Arc::new);
        }
        let Value::Object(given) = value else { return Err(wrong(value, "a file or a dict of lists")) };
        let one = |(size, values): (&String, &Value)| {
            let values = serde_json::from_value::<Vec<f64>>(values.clone()).ok();
            let read = size.parse::<usize>().ok().zip(values);
            read.ok_or_else(|| wrong(value, "a dict such as {298: [0.05, 0.08]}"))
        };
        NullDistributions::new(given.iter().map(one).collect::<Result<Vec<_>>>()?).map(Arc::new)
    }
}

impl Plain for LinkRules {
    fn json(&self) -> Value {
        json!(self)
    }

    /// The text of a file, or what it holds.
    fn of(value: &Value) -> Result<Self> {
        value.as_str().map_or_else(|| Self::of_value(value), Self::of_text)
    }
}
