//! What a factorisation of `A = K + s I` gives a likelihood, whatever its form.

/// A factorisation of `A = K + s I`.
pub(super) trait Factorisation {
    /// `log det A`.
    fn log_determinant(&self) -> f64;
    /// The parts of the gradient that do not depend on the target; of a factorisation for a search.
    fn traces(&self) -> Traces;
    /// `A^-1 y`.
    fn alpha(&self, y: &[f64]) -> Vec<f64>;
    /// The parts of the gradient that depend on the target `y`; of a factorisation for a search.
    fn solve(&self, y: &[f64]) -> Solution;
    /// Error of the likelihood at the solution `alpha` that the truncation of the kernel matrix leaves.
    fn truncation_error(&self, _alpha: &[f64]) -> f64 {
        0.0
    }
}

/// The parts of the gradient that do not depend on the target.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Traces {
    /// `tr(A^-1)`.
    pub(super) inverse: f64,
    /// `tr(A^-2)`.
    pub(super) squared: f64,
    /// `tr(A^-1 dK / d ln l)`.
    pub(super) derivative: f64,
}

/// The parts that depend on it.
pub(super) struct Solution {
    /// `a = A^-1 y`.
    pub(super) alpha: Vec<f64>,
    /// `a' A^-1 a`.
    pub(super) squared: f64,
    /// `a' (dK / d ln l) a`.
    pub(super) derivative: f64,
}
