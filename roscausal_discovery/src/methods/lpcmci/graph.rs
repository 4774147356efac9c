//! The graph while LPCMCI works on it: links with two ends and a middle mark, the same at all times.

use crate::types::{LinkEnd, Node};

/// What is known of whether a link stays (Gerhardus and Runge 2020, section 3). It speaks of the pair A, B with A before B:
/// earlier, or at the same time with the smaller index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Middle {
    /// `?`: nothing is known.
    Unknown,
    /// `L`: B is not an ancestor of A, or no subset of A's parents separates them.
    Left,
    /// `R`: A is not an ancestor of B, or no subset of B's parents separates them.
    Right,
    /// `!`: both.
    Both,
    /// `-`: the link stays.
    Final,
    /// `x`: contradictory.
    Conflict,
}

impl Middle {
    fn symbol(self) -> char {
        match self {
            Self::Unknown => '?',
            Self::Left => 'L',
            Self::Right => 'R',
            Self::Both => '!',
            Self::Final => '-',
            Self::Conflict => 'x',
        }
    }

    /// The mark after `half`, which is `Left` or `Right`, is known, too.
    pub(crate) fn with(self, half: Self) -> Self {
        match self {
            Self::Unknown => half,
            Self::Left | Self::Right if self != half => Self::Both,
            same => same,
        }
    }
}

/// A link, read from one end to the other. The middle mark does not turn with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Link {
    pub(crate) left: LinkEnd,
    pub(crate) middle: Middle,
    pub(crate) right: LinkEnd,
}

impl Link {
    fn turned(self) -> Self {
        Self { left: self.right, right: self.left, ..self }
    }

    pub(crate) fn is_final(self) -> bool {
        self.middle == Middle::Final
    }

    /// Three characters, such as `oL>`.
    pub(crate) fn symbol(self) -> String {
        let end = |end, head| match end {
            LinkEnd::Circle => 'o',
            LinkEnd::Tail => '-',
            LinkEnd::Head => head,
            LinkEnd::Conflict => 'x',
        };
        [end(self.left, '<'), self.middle.symbol(), end(self.right, '>')].iter().collect()
    }
}

/// Whether `a` comes before `b`: earlier, or at the same time with the smaller index.
pub(crate) fn before(a: Node, b: Node) -> bool {
    (b.lag, a.var) < (a.lag, b.var)
}

/// A pair of nodes as it is stored: the first one before the second, which is at lag 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Pair {
    pub(crate) x: Node,
    pub(crate) y: Node,
}

impl Pair {
    /// The pair of `a` and `b`, in order, shifted to the present; with the shift.
    pub(crate) fn of(a: Node, b: Node) -> (Self, usize) {
        let (x, y) = if before(a, b) { (a, b) } else { (b, a) };
        (Self { x: Node::new(x.var, x.lag - y.lag), y: Node::new(y.var, 0) }, y.lag)
    }
}

/// Links of all pairs at most `tau_max` steps apart.
pub(crate) struct Graph {
    pub(crate) n_vars: usize,
    pub(crate) tau_max: usize,
    /// By first variable, second variable, lag; a pair at lag 0 stands at both places.
    links: Vec<Option<Link>>,
    /// For each node of the window a bit for each node that it is adjacent to.
    adjacency: Vec<u64>,
    /// Words of the bits of one node.
    words: usize,
}

impl Graph {
    pub(crate) fn new(n_vars: usize, tau_max: usize) -> Self {
        let n_nodes = n_vars * (tau_max + 1);
        let words = n_nodes.div_ceil(64);
        Self {
            n_vars,
            tau_max,
            links: vec![None; n_vars * n_nodes],
            adjacency: vec![0; n_nodes * words],
            words,
        }
    }

    /// The place of what concerns the node `a`, not after `b`, and `b`; `None` if they are too far apart.
    #[inline]
    pub(crate) fn place(&self, a: Node, b: Node) -> Option<usize> {
        let lag = a.lag.checked_sub(b.lag).filter(|&lag| lag <= self.tau_max)?;
        Some((a.var * self.n_vars + b.var) * (self.tau_max + 1) + lag)
    }

    /// Nodes of the window.
    pub(crate) fn n_nodes(&self) -> usize {
        self.n_vars * (self.tau_max + 1)
    }

    /// The place of a node of the window among all of them.
    #[inline]
    pub(crate) fn index(&self, node: Node) -> usize {
        debug_assert!(node.lag <= self.tau_max, "{node:?} is not in the window");
        node.var * (self.tau_max + 1) + node.lag
    }

    pub(crate) fn n_places(&self) -> usize {
        self.links.len()
    }

    /// The link between two nodes, read from `a` to `b`.
    #[inline]
    pub(crate) fn get(&self, a: Node, b: Node) -> Option<Link> {
        match self.place(a, b) {
            Some(place) => self.links[place],
            None => self.links[self.place(b, a)?].map(Link::turned),
        }
    }

    /// Whether two nodes of the window are adjacent.
    #[inline]
    pub(crate) fn adjacent(&self, a: Node, b: Node) -> bool {
        let (a, b) = (self.index(a), self.index(b));
        self.adjacency[a * self.words + b / 64] >> (b % 64) & 1 == 1
    }

    /// Says of a pair, at all times at which it lies in the window, whether it is adjacent.
    fn put_adjacent(&mut self, a: Node, b: Node, there: bool) {
        let latest = a.lag.min(b.lag);
        for shift in 0..=self.tau_max.saturating_sub(a.lag.max(b.lag) - latest) {
            let of = |node: Node| self.index(Node::new(node.var, node.lag - latest + shift));
            let (a, b) = (of(a), of(b));
            for (from, to) in [(a, b), (b, a)] {
                let word = &mut self.adjacency[from * self.words + to / 64];
                *word = *word & !(1 << (to % 64)) | u64::from(there) << (to % 64);
            }
        }
    }

    /// Puts a link between two nodes, read from `a` to `b`, or takes it away.
    pub(crate) fn put(&mut self, a: Node, b: Node, link: Option<Link>) {
        let mut was = link.is_some();
        if let Some(place) = self.place(a, b) {
            was = std::mem::replace(&mut self.links[place], link).is_some();
        }
        if let Some(place) = self.place(b, a) {
            was = std::mem::replace(&mut self.links[place], link.map(Link::turned)).is_some();
        }
        if was != link.is_some() {
            self.put_adjacent(a, b, link.is_some());
        }
    }

    pub(crate) fn put_middle(&mut self, pair: Pair, middle: Middle) {
        if let Some(link) = self.get(pair.x, pair.y) {
            self.put(pair.x, pair.y, Some(Link { middle, ..link }));
        }
    }

    /// All nodes of the window, by variable and then lag.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = Node> + use<> {
        let (n_vars, tau_max) = (self.n_vars, self.tau_max);
        (0..n_vars).flat_map(move |var| (0..=tau_max).map(move |lag| Node::new(var, lag)))
    }

    /// The neighbours of `a` in the window, with the link read from each to `a`.
    pub(crate) fn neighbours(&self, a: Node) -> impl Iterator<Item = (Node, Link)> + '_ {
        let row = self.index(a) * self.words;
        let mut bits = self.adjacency[row..row + self.words].iter().copied();
        let (mut word, mut first) = (bits.next().unwrap_or(0), 0);
        std::iter::from_fn(move || {
            while word == 0 {
                word = bits.next()?;
                first += 64;
            }
            let index = first + word.trailing_zeros() as usize;
            word &= word - 1;
            let node = Node::new(index / (self.tau_max + 1), index % (self.tau_max + 1));
            Some((node, self.get(node, a)?))
        })
    }

    /// All links once, read from the node before to the node after, which is at lag 0.
    pub(crate) fn pairs(&self) -> Vec<(Pair, Link)> {
        let mut pairs = Vec::new();
        for y in (0..self.n_vars).map(|var| Node::new(var, 0)) {
            for x in self.nodes().filter(|&x| before(x, y)) {
                pairs.extend(self.get(x, y).map(|link| (Pair { x, y }, link)));
            }
        }
        pairs
    }

    /// Both readings of all links, at all times at which they lie in the window.
    pub(crate) fn readings(&self) -> Vec<(Node, Node, Link)> {
        let pairs = self.pairs();
        pairs.iter().flat_map(|&(Pair { x, y }, link)| [(x, y, link), (y, x, link.turned())]).collect()
    }

    /// Unshielded triples A, B, C within one window: A and B are adjacent, B and C are, A and C are not, and A comes before C.
    /// The latest of the three is at lag 0.
    pub(crate) fn unshielded(&self) -> Vec<[Node; 3]> {
        let mut triples = Vec::new();
        for b in self.nodes() {
            let neighbours: Vec<Node> = self.neighbours(b).map(|(node, _)| node).collect();
            for &a in &neighbours {
                for &c in neighbours.iter().filter(|&&c| before(a, c) && (b.lag == 0 || c.lag == 0)) {
                    if !self.adjacent(a, c) {
                        triples.push([a, b, c]);
                    }
                }
            }
        }
        triples
    }
}
