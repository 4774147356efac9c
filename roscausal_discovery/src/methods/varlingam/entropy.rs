//! The entropy of a series by two averages, as the causal order needs it thousands of times.
//!
//! `H(u) = (1 + ln 2 pi)/2 - 79.047 (mean ln cosh u - 0.37457)^2 - 7.4129 (mean u exp(-u^2/2))^2` for a series `u` of mean 0
//! and deviation 1. The first term is the entropy of a Gaussian, the others take off what its shape differs.
//!
//! Source: Hyvärinen 1998, "New approximations of differential entropy".

use pulp::{Arch, NullaryFnOnce};

use crate::numeric::special::exp_of_negative;

/// The entropy of `x + slope y`, scaled by `scale` to deviation 1. Both have mean 0.
pub(super) fn entropy(arch: Arch, x: &[f64], y: &[f64], slope: f64, scale: f64) -> f64 {
    let (cosh, skewed) = arch.dispatch(Averages { x, y, slope, scale });
    let gaussian = 0.5 * (1.0 + libm::log(2.0 * std::f64::consts::PI));
    gaussian - 79.047 * (cosh - 0.37457).powi(2) - 7.4129 * skewed.powi(2)
}

/// The averages of `ln cosh u` and `u exp(-u^2/2)` for `u = scale (x + slope y)`.
struct Averages<'a> {
    x: &'a [f64],
    y: &'a [f64],
    slope: f64,
    scale: f64,
}

const LANES: usize = 16;
/// Factors between 1 and 2 that are multiplied before a logarithm is taken.
const FACTORS: usize = 512;

impl NullaryFnOnce for Averages<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn call(self) -> (f64, f64) {
        let Self { x, y, slope, scale } = self;
        let n = x.len().max(1) as f64;
        // ln cosh u = |u| - ln 2 + ln(1 + exp(-2 |u|)): the logarithms of many samples are one logarithm of a product.
        let (mut sizes, mut logarithms, mut skewed) = (0.0, 0.0, 0.0);
        for (x, y) in x.chunks(LANES * FACTORS).zip(y.chunks(LANES * FACTORS)) {
            let (mut size, mut product, mut skew) = ([0.0; LANES], [1.0; LANES], [0.0; LANES]);
            let (x_lanes, x_rest) = x.as_chunks::<LANES>();
            let (y_lanes, y_rest) = y.as_chunks::<LANES>();
            for (x, y) in x_lanes.iter().zip(y_lanes) {
                for k in 0..LANES {
                    let u = scale * slope.mul_add(y[k], x[k]);
                    size[k] += u.abs();
                    product[k] *= 1.0 + exp_of_negative(-2.0 * u.abs());
                    skew[k] += u * exp_of_negative(-0.5 * u * u);
                }
            }
            for (x, y) in x_rest.iter().zip(y_rest) {
                let u = scale * slope.mul_add(*y, *x);
                sizes += u.abs();
                logarithms += libm::log(1.0 + exp_of_negative(-2.0 * u.abs()));
                skewed += u * exp_of_negative(-0.5 * u * u);
            }
            for k in 0..LANES {
                sizes += size[k];
                logarithms += libm::log(product[k]);
                skewed += skew[k];
            }
        }
        ((sizes + logarithms) / n - std::f64::consts::LN_2, skewed / n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::{random::Rng, rows::standardized};

    #[test]
    fn it_is_the_formula_of_the_paper() {
        let mut rng = Rng::new(3);
        for n in [5, 700, 20_001] {
            let u = standardized(&(0..n).map(|_| rng.unit().powi(3)).collect::<Vec<_>>());
            let mean = |f: &dyn Fn(f64) -> f64| u.iter().map(|&v| f(v)).sum::<f64>() / n as f64;
            let exact = 0.5 * (1.0 + (2.0 * std::f64::consts::PI).ln())
                - 79.047 * (mean(&|v| v.cosh().ln()) - 0.37457).powi(2)
                - 7.4129 * mean(&|v| v * (-v * v / 2.0).exp()).powi(2);
            let x: Vec<f64> = u.iter().map(|v| 2.0 * v).collect();
            let zeros = vec![0.0; n];
            assert!((entropy(Arch::new(), &x, &zeros, 0.0, 0.5) - exact).abs() < 1e-11, "{n}");
        }
    }
}
