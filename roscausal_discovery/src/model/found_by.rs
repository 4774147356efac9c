//! What found a model: a method of the registry, or a program of its own.

use std::{convert::Infallible, fmt, str::FromStr};

use crate::methods::Method;

/// What found a model; in files its name.
///
/// ```
/// use roscausal_discovery::{FoundBy, methods::Method};
///
/// assert_eq!(FoundBy::from("fpcmci"), FoundBy::Method(Method::Fpcmci));
/// assert_eq!(FoundBy::from("my_program").method(), None);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FoundBy {
    /// A method of the registry.
    Method(Method),
    /// A program that is not of the registry, by its name.
    Program(String),
}

impl FoundBy {
    /// The method, if it is of the registry.
    pub fn method(&self) -> Option<Method> {
        match self {
            Self::Method(method) => Some(*method),
            Self::Program(_) => None,
        }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::Method(method) => method.name(),
            Self::Program(name) => name,
        }
    }

    /// Whether it has one level only, `pc_alpha`, which also decides on the links.
    pub fn decides_by_pc_alpha(&self) -> bool {
        self.method().is_some_and(|method| method.info().one_level)
    }
}

impl From<Method> for FoundBy {
    fn from(method: Method) -> Self {
        Self::Method(method)
    }
}

impl Default for FoundBy {
    fn default() -> Self {
        Self::Method(Method::default())
    }
}

impl From<&str> for FoundBy {
    fn from(name: &str) -> Self {
        name.parse().map_or_else(|_| Self::Program(name.to_owned()), Self::Method)
    }
}

impl FromStr for FoundBy {
    type Err = Infallible;

    fn from_str(name: &str) -> Result<Self, Infallible> {
        Ok(name.into())
    }
}

impl fmt::Display for FoundBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

as_text!(FoundBy);
