//! A variable at a lag: what independence tests speak of.

/// A variable at a lag: `var` at `t - lag`.
///
/// ```
/// use roscausal_discovery::Node;
///
/// let speed_before = Node::new(0, 1);
/// assert_eq!(speed_before.shifted(2), Node { var: 0, lag: 3 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Node {
    /// Column of the data frame.
    pub var: usize,
    /// Steps into the past, 0 for the present.
    pub lag: usize,
}

impl Node {
    /// The node `var` at `t - lag`.
    pub fn new(var: usize, lag: usize) -> Self {
        Self { var, lag }
    }

    /// The node `steps` further into the past.
    pub fn shifted(self, steps: usize) -> Self {
        Self { var: self.var, lag: self.lag + steps }
    }
}
