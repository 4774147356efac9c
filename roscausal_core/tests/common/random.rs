//! Random numbers for worlds of which all is known.

use std::f64::consts::TAU;

use roscausal_discovery::mix;

pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// In `[0, 1)`.
    pub(crate) fn share(&mut self) -> f64 {
        self.0 = mix(self.0);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Gaussian with variance 1.
    pub(crate) fn normal(&mut self) -> f64 {
        let (radius, angle) = ((-2.0 * (1.0 - self.share()).ln()).sqrt(), TAU * self.share());
        radius * angle.cos()
    }
}
