//! Paths into a message: `pose.pose.position.x`, `ranges[3]`, `people[*].velocity.x`.

use std::{fmt, str::FromStr};

/// Longest path in steps.
const LONGEST: usize = 64;

/// One step of a path.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Step {
    /// A field by its name.
    Field(String),
    /// An element of an array, counted from 0.
    Index(u32),
    /// All elements of an array.
    All,
}

/// A path into a message.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Path(pub Vec<Step>);

impl Path {
    /// The path one field further.
    #[must_use]
    pub fn field(&self, name: &str) -> Self {
        let mut steps = self.0.clone();
        steps.push(Step::Field(name.to_owned()));
        Self(steps)
    }

    /// The path to all elements.
    #[must_use]
    pub fn all(&self) -> Self {
        let mut steps = self.0.clone();
        steps.push(Step::All);
        Self(steps)
    }
}

impl FromStr for Path {
    type Err = String;

    /// Fields separated by dots; an array is followed by an index or `*` in brackets.
    fn from_str(text: &str) -> Result<Self, String> {
        let fault = || format!("'{text}' is not a path into a message, such as pose.position.x or ranges[0]");
        let mut steps = Vec::new();
        for part in text.split('.') {
            let (name, mut rest) = part.split_at(part.find('[').unwrap_or(part.len()));
            let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
            if name.is_empty() || !name.chars().all(is_name) {
                return Err(fault());
            }
            steps.push(Step::Field(name.to_owned()));
            while let Some(inner) = rest.strip_prefix('[') {
                let (index, after) = inner.split_once(']').ok_or_else(fault)?;
                steps.push(match index.trim() {
                    "*" | "" => Step::All,
                    index => Step::Index(index.parse().map_err(|_| fault())?),
                });
                rest = after;
            }
            if !rest.is_empty() || steps.len() > LONGEST {
                return Err(fault());
            }
        }
        Ok(Self(steps))
    }
}

impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, step) in self.0.iter().enumerate() {
            match step {
                Step::Field(name) if place == 0 => f.write_str(name)?,
                Step::Field(name) => write!(f, ".{name}")?,
                Step::Index(index) => write!(f, "[{index}]")?,
                Step::All => f.write_str("[*]")?,
            }
        }
        Ok(())
    }
}
