//! Parameters as the messages of `rcl_interfaces`.

use ros2_client::parameters::{NumericRange, ParameterDescriptor, raw};
use ros2_client::{ParameterValue as Wire, rcl_interfaces::SetParametersRequest};
use roscausal_core::params::{Allowed, ParamSpec, Value};

/// Type, description and range of a parameter; "not set" for an unknown one.
pub(crate) fn descriptor(
    name: &str,
    value: Option<Value>,
    spec: Option<ParamSpec>,
) -> raw::ParameterDescriptor {
    let mut descriptor = ParameterDescriptor::from_value(name, &to_wire(value));
    descriptor.description.clear();
    if let Some(ParamSpec { description, default, allowed, live, .. }) = spec {
        descriptor.read_only = !live;
        descriptor.description.push_str(description);
        match (allowed, default) {
            (Allowed::Range(from, to), Value::Int(_)) => {
                let (from_value, to_value) = (from as i64, to as i64);
                descriptor.range = NumericRange::IntegerRange { from_value, to_value, step: 0 };
            }
            (Allowed::Range(from_value, to_value), Value::Double(_)) => {
                descriptor.range = NumericRange::FloatingPointRange { from_value, to_value, step: 0.0 };
            }
            (Allowed::Range(from, to), _) => {
                descriptor.additional_constraints = format!("a number from {from} to {to}")
            }
            (Allowed::OneOf(words), _) => {
                descriptor.additional_constraints = format!("one of: {}", words.join(", "))
            }
            (Allowed::Any, _) => {}
        }
    }
    descriptor.into()
}

/// A value; "not set" for `None`.
pub(crate) fn to_wire(value: Option<Value>) -> Wire {
    fn all<T>(items: Vec<Value>, part: impl Fn(Value) -> Option<T>) -> Vec<T> {
        items.into_iter().filter_map(part).collect()
    }
    match value {
        None => Wire::NotSet,
        Some(Value::Bool(value)) => Wire::Boolean(value),
        Some(Value::Int(value)) => Wire::Integer(value),
        Some(Value::Double(value)) => Wire::Double(value),
        Some(Value::Str(value)) => Wire::String(value),
        Some(Value::List(items)) => match items.first() {
            Some(Value::Bool(_)) => Wire::BooleanArray(all(items, |item| item.as_bool())),
            Some(Value::Int(_)) => Wire::IntegerArray(all(items, |item| item.as_int())),
            Some(Value::Double(_)) => Wire::DoubleArray(all(items, |item| item.as_double())),
            _ => Wire::StringArray(all(items, |item| Some(item.to_string()))),
        },
    }
}

/// The values of a set request; `None` for "unset".
pub(crate) fn from_wire(request: SetParametersRequest) -> Vec<(String, Option<Value>)> {
    let list = |items: Vec<Value>| Some(Value::List(items));
    let value = |value: raw::ParameterValue| match value.into() {
        Wire::NotSet => None,
        Wire::Boolean(value) => Some(Value::Bool(value)),
        Wire::Integer(value) => Some(Value::Int(value)),
        Wire::Double(value) => Some(Value::Double(value)),
        Wire::String(value) => Some(Value::Str(value)),
        Wire::ByteArray(items) => list(items.into_iter().map(|byte| Value::Int(byte.into())).collect()),
        Wire::BooleanArray(items) => list(items.into_iter().map(Value::Bool).collect()),
        Wire::IntegerArray(items) => list(items.into_iter().map(Value::Int).collect()),
        Wire::DoubleArray(items) => list(items.into_iter().map(Value::Double).collect()),
        Wire::StringArray(items) => list(items.into_iter().map(Value::Str).collect()),
    };
    request.parameter.into_iter().map(|parameter| (parameter.name, value(parameter.value))).collect()
}
