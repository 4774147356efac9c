//! The marks of links in a graph.

use std::fmt;

/// Mark of a link in a graph, read from cause to effect.
///
/// ```
/// use roscausal_discovery::LinkMark;
///
/// assert_eq!(LinkMark::Forward.symbol(), "-->");
/// assert_eq!(LinkMark::Forward.mirrored(), LinkMark::Backward);
/// assert!(LinkMark::Unoriented.is_link() && !LinkMark::Absent.is_link());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum LinkMark {
    /// `""`: no link.
    #[default]
    Absent,
    /// `-->`: from cause to effect.
    Forward,
    /// `<--`: from effect to cause; only at lag 0.
    Backward,
    /// `o-o`: direction unknown; only at lag 0.
    Unoriented,
    /// `x-x`: contradictory directions; only at lag 0.
    Conflict,
}

impl LinkMark {
    /// The field's symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Absent => "",
            Self::Forward => "-->",
            Self::Backward => "<--",
            Self::Unoriented => "o-o",
            Self::Conflict => "x-x",
        }
    }

    /// The same link, read from its other end.
    pub fn mirrored(self) -> Self {
        match self {
            Self::Forward => Self::Backward,
            Self::Backward => Self::Forward,
            same => same,
        }
    }

    /// Whether there is a link.
    pub fn is_link(self) -> bool {
        self != Self::Absent
    }
}

impl fmt::Display for LinkMark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.symbol())
    }
}
