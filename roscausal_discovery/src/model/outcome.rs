//! What is known of a pair at a lag: a test's answer, or why there is none.

use serde::{Deserialize, Serialize};

/// Whether an entry of a model was tested; if not, why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It has strength, p-value and samples.
    Tested,
    /// The method does not look at it: a lag below `tau_min`, a variable at the same moment as itself.
    #[default]
    NotAsked,
    /// Known beforehand: the link exists.
    Required,
    /// Known beforehand: there is no such link.
    Forbidden,
    /// The filter of F-PCMCI let nothing through here.
    Filtered,
    /// The test had no answer: too few samples in common, nothing in them varies, or the conditions determine it.
    NoAnswer,
    /// The time budget ended before.
    Ended,
    /// A model of version 1 does not say whether it was tested.
    Unknown,
}

impl Outcome {
    /// All of them.
    pub const ALL: [Self; 8] = {
        use Outcome::*;
        [Tested, NotAsked, Required, Forbidden, Filtered, NoAnswer, Ended, Unknown]
    };

    /// Why there is no test: `not tested: ...`; `None` if there is one.
    pub fn why_not(self) -> Option<&'static str> {
        match self {
            Self::Tested => None,
            Self::NotAsked => Some("the method does not test it"),
            Self::Required => Some("it was required"),
            Self::Forbidden => Some("it was ruled out beforehand"),
            Self::Filtered => Some("the filter let nothing through"),
            Self::NoAnswer => {
                Some("too few samples in common, nothing in them varies, or the conditions determine it")
            }
            Self::Ended => Some("the time budget ended before"),
            Self::Unknown => Some("the file does not say whether it was tested"),
        }
    }
}
