//! A variable at a lag: what independence tests speak of.

/// A variable at a lag: `var` at `t - lag`.
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
