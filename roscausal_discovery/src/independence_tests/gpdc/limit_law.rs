//! The law of the distance correlation of two long independent series of ranks. [`super::null_law`] makes it that of few samples.
//!
//! Source: Székely, Rizzo and Bakirov 2007, theorem 5: `n dCov^2` of independent series tends to a sum of squares of independent
//! normal variables, weighted by the products of the eigenvalues of both centred distance kernels. Ranks make both kernels the one
//! of the uniform distribution, `-|u - v|` centred on `[0, 1]`: its eigenfunctions are `cos(k pi u)` with eigenvalues
//! `2 / (k pi)^2`, and its distance variance is `2 / 45`. So the law depends on nothing:
//!
//! `(n - 1) dCor^2 -> sum over j, k >= 1 of 90 / (pi^4 j^2 k^2) Z_jk^2`,
//!
//! with `n - 1` for `n` because the mean is exact then: 2.5. The characteristic function follows from Euler's product of the sine,
//! the survival function from it by a sum over half steps (Davies 1973), whose error falls exponentially with the step.
//!
//! Example: `above(12.5)` is 0.00062: of 1600 pairs of independent series of 5001 samples one has a distance correlation above
//! 0.05, because `5000 * 0.05^2 = 12.5`.

use std::{f64::consts::PI, sync::LazyLock};

/// The largest weight, of the first eigenvalues of both kernels: `90 / pi^4`.
const LARGEST: f64 = 0.923_938_402_921_590_4;
/// Steps of the characteristic function's argument: the sum repeats itself after `2 pi / STEP`, beyond all that matters.
const STEP: f64 = 0.05;
/// The characteristic function is below 1e-15 from here on.
const FARTHEST: f64 = 120.0;
/// Eigenvalues of one kernel that are not summed up in a series.
const FIRST: usize = 400;
/// Place from which on the survival function is continued by its tail: 2e-9 there, and the sum exact to 1e-14.
const TAIL: f64 = 35.0;

/// The characteristic function at the half steps, as logarithm of its size and phase.
static HALF_STEPS: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| {
    (0..(FARTHEST / STEP) as usize).map(|k| characteristic((k as f64 + 0.5) * STEP)).collect()
});

/// Probability that the weighted sum exceeds `x`.
pub(super) fn above(x: f64) -> f64 {
    if x <= TAIL {
        return by_sum(x);
    }
    // As of the largest weight alone: the others add a factor that no longer changes.
    by_sum(TAIL) * libm::exp(-(x - TAIL) / (2.0 * LARGEST)) * (TAIL / x).sqrt()
}

fn by_sum(x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let term = |(k, (size, phase)): (usize, &(f64, f64))| {
        let half = k as f64 + 0.5;
        libm::exp(*size) * libm::sin(phase - half * STEP * x) / half
    };
    let sum: f64 = HALF_STEPS.iter().enumerate().map(term).sum();
    (0.5 + sum / PI).clamp(0.0, 1.0)
}

/// `E exp(i t Q)` of the weighted sum `Q`: the logarithm of its size, and its phase.
///
/// `E exp(i t w Z^2) = (1 - 2 i t w)^(-1/2)`, and for each `j` the product over `k` of `1 - 2 i t w_jk` is `sin(z) / z` with
/// `z^2 = 2 i t pi^2 90 / (pi^4 j^2)`, so `z = (1 + i) a`.
fn characteristic(t: f64) -> (f64, f64) {
    let scale = (t * 90.0).sqrt() / PI;
    let (mut size, mut phase) = (0.0, 0.0);
    let (mut squares, mut fourths) = (PI * PI / 6.0, PI.powi(4) / 90.0);
    for j in 1..=FIRST {
        let j = j as f64;
        let (log_size, angle) = log_sine_quotient(scale / j);
        size += log_size;
        phase += angle;
        squares -= 1.0 / (j * j);
        fourths -= 1.0 / j.powi(4);
    }
    // The rest by the series of the logarithm, `-z^2 / 6 - z^4 / 180` with `z^2 = 2 i a^2`.
    phase -= scale * scale / 3.0 * squares;
    size += scale.powi(4) / 45.0 * fourths;
    (-0.5 * size, -0.5 * phase)
}

/// Logarithm of the size of `sin(z) / z` at `z = (1 + i) a`, and its continuous phase.
fn log_sine_quotient(a: f64) -> (f64, f64) {
    if a < 0.05 {
        return (a.powi(4) / 45.0 - a.powi(8) / 2362.5, -a * a / 3.0 + a.powi(6) / 354.375);
    }
    // sin z = (i / 2) exp(a - i a) (1 - exp(2 i z))
    let (small, angle) = (libm::exp(-2.0 * a), 2.0 * a);
    let (real, imaginary) = (1.0 - small * libm::cos(angle), -small * libm::sin(angle));
    let log_size = a - 0.5 * libm::log(8.0 * a * a) + 0.5 * libm::log(real * real + imaginary * imaginary);
    (log_size, 0.25 * PI - a + libm::atan2(imaginary, real))
}

#[cfg(test)]
mod tests {
    use super::{super::null_table::NullTable, *};

    /// The weighted sum with 30 x 30 weights and the rest at its mean.
    fn drawn(draws: usize) -> Vec<f64> {
        let mut rng = crate::numeric::pcg64::Pcg64::new(42);
        let mut normal = || {
            let (u, v) = (rng.next_f64(), rng.next_f64());
            (-2.0 * (1.0 - u).ln()).sqrt() * (2.0 * PI * v).cos()
        };
        let weights: Vec<f64> =
            (1..=30).flat_map(|j| (1..=30).map(move |k| LARGEST / f64::from(j * j * k * k))).collect();
        let rest = 2.5 - weights.iter().sum::<f64>();
        (0..draws).map(|_| rest + weights.iter().map(|w| w * normal().powi(2)).sum::<f64>()).collect()
    }

    /// Largest difference between the shares of `values` above them and the law.
    fn distance(mut values: Vec<f64>, law: impl Fn(f64) -> f64) -> f64 {
        values.sort_unstable_by(f64::total_cmp);
        let n = values.len() as f64;
        let off = |(k, value): (usize, &f64)| (1.0 - (k as f64 + 0.5) / n - law(*value)).abs();
        values.iter().enumerate().map(off).fold(0.0, f64::max)
    }

    /// Kolmogorov's distance that one of a thousand samples of the law itself exceeds.
    fn one_in_a_thousand(draws: usize) -> f64 {
        1.95 / (draws as f64).sqrt()
    }

    #[test]
    fn the_law_is_that_of_the_weighted_sum() {
        assert!(distance(drawn(5000), above) < one_in_a_thousand(5000));
        let mean: f64 = (0..4000).map(|k| above(0.01 * (f64::from(k) + 0.5)) * 0.01).sum();
        assert!((mean - 2.5).abs() < 1e-4, "{mean}");
    }

    #[test]
    fn the_law_is_that_of_random_series_of_2000_and_8000_samples() {
        for (n, draws) in [(2000, 1000), (8000, 400)] {
            let table = NullTable::get(n, draws, 42).values().to_vec();
            let off = distance(table, |value| above((n - 1) as f64 * value * value));
            assert!(off < one_in_a_thousand(draws), "{n} samples: {off}");
        }
    }

    #[test]
    fn the_tail_goes_on_smoothly_and_falls() {
        let slope = |x: f64| (above(x + 0.5) / above(x)).ln();
        assert!((slope(TAIL - 0.5) - slope(TAIL)).abs() < 0.01, "{} {}", slope(TAIL - 0.5), slope(TAIL));
        let all: Vec<f64> = (0..1000).map(|k| above(0.1 * f64::from(k))).collect();
        assert!(all.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12));
        assert_eq!((above(0.0), above(1e5)), (1.0, 0.0));
    }
}
