//! Special functions for the null distributions of the tests, and an exponential for the vector units.

/// P(X >= x) of the chi-squared distribution with `dof` degrees of freedom; 1 for `dof` = 0 or `x` <= 0.
///
/// Finite sums for integer degrees of freedom (Abramowitz and Stegun 1964, 26.4.4 and 26.4.5). All terms are
/// positive, so the far tail keeps its relative accuracy.
///
/// Why not `statrs`: its `ChiSquared::sf` (0.19) is as accurate, both within 2e-13 of scipy down to 1e-178, but differs in the
/// last bits, so that p-values of earlier releases would not come out again.
pub(crate) fn chi_squared_sf(x: f64, dof: usize) -> f64 {
    if dof == 0 || x <= 0.0 || x.is_nan() {
        return 1.0;
    }
    let half = 0.5 * x;
    let odd = dof % 2 == 1;
    let mut sum = if odd { libm::erfc(half.sqrt()) } else { 0.0 };
    // Terms e^-h h^a / Gamma(a + 1) for a = 0, 1, ... (even dof) or 1/2, 3/2, ... (odd dof).
    let mut a = if odd { 0.5 } else { 0.0 };
    let ln_half = libm::log(half);
    let mut ln_term = a * ln_half - half - libm::lgamma(a + 1.0);
    for _ in 0..dof / 2 {
        sum += libm::exp(ln_term);
        a += 1.0;
        ln_term += ln_half - libm::log(a);
    }
    sum.clamp(0.0, 1.0)
}

/// `exp(x)` for `x <= 0` within 1 unit in the last place; 0 below -708. No branch and no call, so that loops over
/// it vectorise: `2^k` by its bits times a polynomial on `|r| <= ln(2)/2`.
#[inline(always)]
pub(crate) fn exp_of_negative(x: f64) -> f64 {
    /// 1.5 * 2^52: adding it rounds to an integer, which then stands in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let clamped = if x < -708.0 { -708.0 } else { x };
    let shifted = clamped.mul_add(std::f64::consts::LOG2_E, ROUND);
    let k = shifted - ROUND;
    let r = k.mul_add(-LN_2_LOW, k.mul_add(-LN_2_HIGH, clamped));
    // 1 + r + r^2 q(r), q of degree 9 by Chebyshev interpolation: within 2e-17.
    let mut q = 2.510_038_549_551_032e-8_f64;
    for coefficient in [
        2.762_008_844_540_974_6e-7,
        2.755_726_845_999_706_4e-6,
        2.480_152_129_595_437_6e-5,
        1.984_126_986_305_361_8e-4,
        1.388_888_891_721_371_7e-3,
        8.333_333_333_330_062e-3,
        4.166_666_666_662_413e-2,
        1.666_666_666_666_666_9e-1,
        5.000_000_000_000_001e-1,
        1.0,
        1.0,
    ] {
        q = q.mul_add(r, coefficient);
    }
    let power = f64::from_bits((shifted.to_bits() << 52).wrapping_add(1023 << 52));
    let value = q * power;
    if x < -708.0 { 0.0 } else { value }
}

/// Digamma of the integers `1..=n`; entry 0 is unused and 0. `psi(1) = -gamma`, `psi(k + 1) = psi(k) + 1/k`.
pub(crate) fn digamma_table(n: usize) -> Vec<f64> {
    const EULER_GAMMA: f64 = 0.577_215_664_901_532_9;
    let mut table = Vec::with_capacity(n + 1);
    table.push(0.0);
    // The terms become small, and plain summation would lose digits. The harmonic numbers are therefore summed with
    // a carried remainder (Kahan).
    let (mut sum, mut carry) = (-EULER_GAMMA, 0.0);
    for k in 1..=n {
        table.push(sum);
        let term = 1.0 / k as f64 - carry;
        let next = sum + term;
        carry = (next - sum) - term;
        sum = next;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a} against {b}");
    }

    #[test]
    fn chi_squared_tails_agree_with_tables() {
        close(chi_squared_sf(3.841_458_820_694_124, 1), 0.05, 1e-13);
        close(chi_squared_sf(5.991_464_547_107_979, 2), 0.05, 1e-13);
        close(chi_squared_sf(11.070_497_693_516_35, 5), 0.05, 1e-13);
        close(chi_squared_sf(124.342_113_404_004_08, 100), 0.05, 1e-12);
        // With two degrees of freedom it is the exponential distribution; checked as far as f64 reaches.
        close(chi_squared_sf(1400.0, 2), (-700.0_f64).exp(), 1e-12);
        assert_eq!((chi_squared_sf(0.0, 3), chi_squared_sf(7.0, 0)), (1.0, 1.0));
    }

    #[test]
    fn chi_squared_tail_falls_with_x_and_rises_with_dof() {
        for dof in 1..60 {
            for step in 1..200 {
                let x = 0.7 * f64::from(step);
                assert!(chi_squared_sf(x, dof) >= chi_squared_sf(x + 0.7, dof) - 1e-14);
                assert!(chi_squared_sf(x, dof + 1) >= chi_squared_sf(x, dof) - 1e-14);
            }
        }
    }

    #[test]
    fn digamma_agrees_with_known_values() {
        let psi = digamma_table(10_001);
        close(psi[1], -0.577_215_664_901_532_9, 1e-15);
        close(psi[2], 1.0 - 0.577_215_664_901_532_9, 1e-15);
        let n = 10_000.0_f64;
        close(psi[10_000], n.ln() - 0.5 / n - 1.0 / (12.0 * n * n), 1e-15);
    }
}
