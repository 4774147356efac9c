//! The marks of links in a graph.

use std::{cmp::Ordering, fmt, str::FromStr};

use super::text::quoted;

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
    pub const ALL: [Self; 17] = {
        use LinkMark::*;
        [
            Absent, Forward, Backward, Unoriented, Conflict, CircleHead, HeadCircle, Bidirected,
            ConflictHead, HeadConflict, CircleConflict, ConflictCircle, TailConflict, ConflictTail,
            TailCircle, CircleTail, TailTail,
        ]
    };

    /// Their symbols, in the order of the variants.
    const SYMBOLS: [&str; 17] = [
        "", "-->", "<--", "o-o", "x-x", "o->", "<-o", "<->", "x->", "<-x", "o-x", "x-o", "--x", "x--", "--o",
        "o--", "---",
    ];

    /// The field's symbol.
    pub fn symbol(self) -> &'static str {
        Self::SYMBOLS[self as usize]
    }

    /// The same link, read from its other end.
    pub fn mirrored(self) -> Self {
        self.ends().map_or(self, |(left, right)| Self::from_ends(right, left))
    }

    /// The mark with these ends, at the cause and at the effect.
    pub fn from_ends(left: LinkEnd, right: LinkEnd) -> Self {
        Self::ALL.into_iter().find(|mark| mark.ends() == Some((left, right))).unwrap_or_default()
    }

    /// What stands at the cause and at the effect; `None` without a link.
    pub fn ends(self) -> Option<(LinkEnd, LinkEnd)> {
        let end = |letter: u8| match letter {
            b'o' => LinkEnd::Circle,
            b'-' => LinkEnd::Tail,
            b'x' => LinkEnd::Conflict,
            _ => LinkEnd::Head,
        };
        let [left, _, right] = self.symbol().as_bytes() else { return None };
        Some((end(*left), end(*right)))
    }

    /// Whether there is a link.
    pub fn is_link(self) -> bool {
        self != Self::Absent
    }
}

impl Ord for LinkMark {
    /// By symbol, so that files list marks as text is sorted.
    fn cmp(&self, other: &Self) -> Ordering {
        self.symbol().cmp(other.symbol())
    }
}

impl PartialOrd for LinkMark {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl FromStr for LinkMark {
    type Err = String;

    fn from_str(symbol: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|known| known.symbol() == symbol).ok_or_else(|| {
            let all: Vec<&str> = Self::ALL.iter().skip(1).map(|mark| mark.symbol()).collect();
            format!("{} is not a mark; marks are {}", quoted(symbol), all.join(" "))
        })
    }
}

as_text!(LinkMark);

impl fmt::Display for LinkMark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.symbol())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pair_of_ends_has_one_mark_and_its_symbol_reads_back() {
        use LinkEnd::{Circle, Conflict, Head, Tail};
        let ends = [Circle, Conflict, Head, Tail];
        let mut marks: Vec<LinkMark> =
            ends.into_iter().flat_map(|left| ends.map(|right| LinkMark::from_ends(left, right))).collect();
        assert!(marks.iter().all(|mark| mark.is_link() && mark.mirrored().mirrored() == *mark));
        marks.sort();
        marks.dedup();
        assert_eq!(marks.len(), 16);
        assert_eq!(LinkMark::from_ends(Tail, Head), LinkMark::Forward);
        assert_eq!(LinkMark::from_ends(Circle, Head), LinkMark::CircleHead);
        assert_eq!(LinkMark::from_ends(Tail, Conflict), LinkMark::TailConflict);
        for mark in LinkMark::ALL {
            assert_eq!(mark.symbol().parse(), Ok(mark));
        }
    }
}
