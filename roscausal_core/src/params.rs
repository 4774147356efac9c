//! Parameters: values as a middleware stores them, and the specification a node declares.

/// A parameter value, as the ROS parameter server and ROS 2 parameters know them.
#[derive(Clone, Debug, PartialEq)]
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
    /// Value when nothing is set; its variant is the parameter's type.
    pub default: Value,
    /// One line for `ros2 param describe` and the documentation.
    pub description: &'static str,
    /// What is allowed.
    pub allowed: Allowed,
}

/// The values a parameter may take.
#[derive(Clone, Debug, PartialEq)]
pub enum Allowed {
    /// Any value of the default's type.
    Any,
    /// A number from the first to the second, both included.
    Range(f64, f64),
    /// One of these words.
    OneOf(&'static [&'static str]),
}
