//! The two hyperparameters of the regressions, and where they may be.

use super::lbfgsb::Bounds;
use crate::numeric::random::Rng;

/// Length scale and noise variance of the kernel `RBF(l) + White(s)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Theta {
    /// Length scale of the RBF kernel, in standard deviations of a condition.
    pub(super) l: f64,
    /// Variance of the white noise, in variances of the target.
    pub(super) s: f64,
}

/// Natural logarithm of 1e5.
const FAR: f64 = 11.512_925_464_970_229;
/// Bounds of the logarithms of both hyperparameters.
pub(super) const BOUNDS: Bounds<2> = Bounds { lower: [-FAR; 2], upper: [FAR; 2] };

impl Theta {
    /// Where every search starts.
    pub(super) const START: Self = Self { l: 1.0, s: 1.0 };

    /// From `(ln l, ln s)`.
    pub(super) fn from_logarithms([l, s]: [f64; 2]) -> Self {
        Self { l: libm::exp(l), s: libm::exp(s) }
    }

    /// Anywhere from a hundredth to a hundred, evenly by logarithms.
    pub(super) fn random(rng: &mut Rng) -> Self {
        let mut between = || libm::log(100f64) * (2.0 * rng.unit() - 1.0);
        Self::from_logarithms([between(), between()])
    }

    /// `(ln l, ln s)`.
    pub(super) fn logarithms(self) -> [f64; 2] {
        [libm::log(self.l), libm::log(self.s)]
    }
}
