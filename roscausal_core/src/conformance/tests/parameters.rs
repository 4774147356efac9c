//! Laws of parameters.

use super::must;
use crate::{
    middleware::Middleware,
    params::{Allowed, ParamSpec, Value},
};

fn spec(name: &'static str, default: Value) -> ParamSpec {
    ParamSpec::new(name, default, Allowed::Any, "of the conformance tests")
}

/// A parameter that nobody has set is `None`, whatever its default.
pub fn an_unset_parameter_is_none<M: Middleware>(node: &impl Fn(&str) -> M) {
    let node = node("param_unset");
    let unset = spec("law_unset", Value::Double(0.1));
    assert_eq!(must(node.param(&unset), "ask for a parameter"), None, "an unset parameter is None");
}

/// A parameter that the node sets reads back with its type. Set again, it has the new value.
pub fn a_set_parameter_reads_back<M: Middleware>(node: &impl Fn(&str) -> M) {
    let node = node("param_set");
    let words =
        |words: &[&str]| Value::List(words.iter().map(|word| Value::Str((*word).to_owned())).collect());
    for (spec, first, second) in [
        (spec("law_bool", Value::Bool(false)), Value::Bool(true), Value::Bool(false)),
        (spec("law_int", Value::Int(0)), Value::Int(-7), Value::Int(8)),
        (spec("law_double", Value::Double(0.0)), Value::Double(0.25), Value::Double(-1e9)),
        (spec("law_text", Value::Str(String::new())), Value::Str("a b".into()), Value::Str("ä".into())),
        (spec("law_words", words(&[])), words(&["x", "y"]), words(&["z"])),
    ] {
        for value in [first, second] {
            must(node.set_param(spec.name, value.clone()), "set a parameter");
            let read = must(node.param(&spec), "ask for a parameter");
            assert_eq!(read, Some(value), "a set parameter reads back ({})", spec.name);
        }
    }
}

/// A private parameter of one node is invisible to another.
pub fn private_parameters_are_the_nodes_own<M: Middleware>(node: &impl Fn(&str) -> M) {
    let (mine, other) = (node("param_mine"), node("param_other"));
    let own = spec("law_own", Value::Int(0));
    must(mine.set_param(own.name, Value::Int(1)), "set a parameter");
    assert_eq!(must(other.param(&own), "ask for a parameter"), None, "another node's parameter is its own");
    assert_eq!(must(mine.param(&own), "ask for a parameter"), Some(Value::Int(1)), "it is still set");
}

/// A parameter with an absolute name is the same for all nodes. Only for loopback and ROS 1: in ROS 2 every
/// parameter belongs to a node.
pub fn absolute_parameters_are_shared<M: Middleware>(node: &impl Fn(&str) -> M) {
    let (writer, reader) = (node("param_writer"), node("param_reader"));
    let shared = spec("/law_shared/goal", Value::List(Vec::new()));
    let goal = Value::List(vec![Value::Double(1.5), Value::Double(-2.0)]);
    must(writer.set_param(shared.name, goal.clone()), "set a parameter");
    assert_eq!(must(reader.param(&shared), "ask for a parameter"), Some(goal), "absolute names are shared");
}
