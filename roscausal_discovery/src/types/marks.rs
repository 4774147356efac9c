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
    /// `o->`: the effect does not cause the cause. Either the cause drives the effect, or something not recorded drives
    /// both, or both.
    CircleHead,
    /// `<-o`: `o->` read from its other end; only at lag 0.
    HeadCircle,
    /// `<->`: neither causes the other; something not recorded drives both.
    Bidirected,
    /// `x->`: the data contradict themselves at the cause.
    ConflictHead,
    /// `<-x`: `x->` read from its other end; only at lag 0.
    HeadConflict,
    /// `o-x`: open at the cause, contradictory at the effect; only at lag 0.
    CircleConflict,
    /// `x-o`: `o-x` read from its other end; only at lag 0.
    ConflictCircle,
    /// `--x`: the cause drives the effect, and the data contradict themselves at the effect; only at lag 0.
    TailConflict,
    /// `x--`: `--x` read from its other end; only at lag 0.
    ConflictTail,
    /// `--o`: the cause drives the effect, whose end is open; only at lag 0.
    TailCircle,
    /// `o--`: `--o` read from its other end; only at lag 0.
    CircleTail,
    /// `---`: both ends are causes; only with selected samples.
    TailTail,
}

/// What stands at one end of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LinkEnd {
    /// `o`: cause or not, nobody knows.
    Circle,
    /// `-`: this end causes the other one, directly or over steps that were not recorded.
    Tail,
    /// An arrow head: this end does not cause the other one.
    Head,
    /// `x`: the data say both.
    Conflict,
}

impl LinkMark {
    /// All marks, no link first.
    pub const ALL: [Self; 17] = [
        Self::Absent,
        Self::Forward,
        Self::Backward,
        Self::Unoriented,
        Self::Conflict,
        Self::CircleHead,
        Self::HeadCircle,
        Self::Bidirected,
        Self::ConflictHead,
        Self::HeadConflict,
        Self::CircleConflict,
        Self::ConflictCircle,
        Self::TailConflict,
        Self::ConflictTail,
        Self::TailCircle,
        Self::CircleTail,
        Self::TailTail,
    ];

    /// The field's symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Absent => "",
            Self::Forward => "-->",
            Self::Backward => "<--",
            Self::Unoriented => "o-o",
            Self::Conflict => "x-x",
            Self::CircleHead => "o->",
            Self::HeadCircle => "<-o",
            Self::Bidirected => "<->",
            Self::ConflictHead => "x->",
            Self::HeadConflict => "<-x",
            Self::CircleConflict => "o-x",
            Self::ConflictCircle => "x-o",
            Self::TailConflict => "--x",
            Self::ConflictTail => "x--",
            Self::TailCircle => "--o",
            Self::CircleTail => "o--",
            Self::TailTail => "---",
        }
    }

    /// The same link, read from its other end.
    pub fn mirrored(self) -> Self {
        self.ends().map_or(self, |(left, right)| Self::from_ends(right, left))
    }

    /// The mark with these ends, at the cause and at the effect.
    pub fn from_ends(left: LinkEnd, right: LinkEnd) -> Self {
        use LinkEnd::{Circle, Conflict, Head, Tail};
        match (left, right) {
            (Tail, Head) => Self::Forward,
            (Head, Tail) => Self::Backward,
            (Circle, Circle) => Self::Unoriented,
            (Conflict, Conflict) => Self::Conflict,
            (Circle, Head) => Self::CircleHead,
            (Head, Circle) => Self::HeadCircle,
            (Head, Head) => Self::Bidirected,
            (Conflict, Head) => Self::ConflictHead,
            (Head, Conflict) => Self::HeadConflict,
            (Circle, Conflict) => Self::CircleConflict,
            (Conflict, Circle) => Self::ConflictCircle,
            (Tail, Conflict) => Self::TailConflict,
            (Conflict, Tail) => Self::ConflictTail,
            (Tail, Circle) => Self::TailCircle,
            (Circle, Tail) => Self::CircleTail,
            (Tail, Tail) => Self::TailTail,
        }
    }

    /// What stands at the cause and at the effect; `None` without a link.
    pub fn ends(self) -> Option<(LinkEnd, LinkEnd)> {
        use LinkEnd::{Circle, Conflict, Head, Tail};
        Some(match self {
            Self::Absent => return None,
            Self::Forward => (Tail, Head),
            Self::Backward => (Head, Tail),
            Self::Unoriented => (Circle, Circle),
            Self::Conflict => (Conflict, Conflict),
            Self::CircleHead => (Circle, Head),
            Self::HeadCircle => (Head, Circle),
            Self::Bidirected => (Head, Head),
            Self::ConflictHead => (Conflict, Head),
            Self::HeadConflict => (Head, Conflict),
            Self::CircleConflict => (Circle, Conflict),
            Self::ConflictCircle => (Conflict, Circle),
            Self::TailConflict => (Tail, Conflict),
            Self::ConflictTail => (Conflict, Tail),
            Self::TailCircle => (Tail, Circle),
            Self::CircleTail => (Circle, Tail),
            Self::TailTail => (Tail, Tail),
        })
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
