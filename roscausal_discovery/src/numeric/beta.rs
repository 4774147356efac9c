//! The regularised incomplete beta function, for the F distribution and Student's t.
//!
//! Source: Abramowitz and Stegun 1964, 26.5.8 (continued fraction) and 26.6.2 (F distribution). Not `statrs`: its fraction ends
//! after 140 terms, and a test on some ten thousand samples needs more.

/// P(F >= f) of the F distribution with `(d1, d2)` degrees of freedom: `I_x(d2/2, d1/2)` at `x = d2 / (d2 + d1 f)`. One where
/// there are no degrees of freedom, `f` <= 0 or `f` is not a number.
///
/// The far tail keeps its relative accuracy: about 1e-12 for hundreds of degrees of freedom, down to the smallest numbers.
pub(crate) fn f_sf(f: f64, d1: usize, d2: usize) -> f64 {
    if d1 == 0 || d2 == 0 || f.is_nan() || f <= 0.0 {
        return 1.0;
    }
    if f.is_infinite() {
        return 0.0;
    }
    let (d1, d2) = (d1 as f64, d2 as f64);
    let (x, y) = (d2 / (d2 + d1 * f), d1 * f / (d2 + d1 * f));
    regularized(0.5 * d2, 0.5 * d1, x, y)
}

/// `I_x(a, b)` with `y = 1 - x` given exactly.
fn regularized(a: f64, b: f64, x: f64, y: f64) -> f64 {
    let ln_beta = libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    // The larger of the two is known to more digits by the smaller one.
    let ln_x = if y < 0.5 { libm::log1p(-y) } else { libm::log(x) };
    let ln_y = if x < 0.5 { libm::log1p(-x) } else { libm::log(y) };
    of_front(libm::exp(a * ln_x + b * ln_y - ln_beta), [a, b], [x, y])
}

/// `I_x(a, b)` from its factor `front` = `x^a y^b / B(a, b)`, by the fraction that ends sooner.
pub(super) fn of_front(front: f64, [a, b]: [f64; 2], [x, y]: [f64; 2]) -> f64 {
    let p = if x < (a + 1.0) / (a + b + 2.0) {
        front * continued_fraction(a, b, x) / a
    } else {
        1.0 - front * continued_fraction(b, a, y) / b
    };
    p.clamp(0.0, 1.0)
}

/// Continued fraction of the incomplete beta function (Abramowitz and Stegun 26.5.8), by Wallis's recurrence for its numerators and
/// denominators, scaled after each pair of terms so that the denominator is 1: one division waits for another, where Lentz's
/// method has two.
fn continued_fraction(a: f64, b: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let away_from_zero = |v: f64| if v.abs() < TINY { TINY } else { v };
    let first = 1.0 / away_from_zero(1.0 - (a + b) * x / (a + 1.0));
    // The last numerator over the last denominator is the value so far; the ones before are scaled alike.
    let (mut before, mut below_before, mut value) = (first, first, first);
    for m in 1..100_000 {
        let m = f64::from(m);
        let m2 = a + 2.0 * m;
        let even = m * (b - m) * x / ((m2 - 1.0) * m2);
        let odd = -(a + m) * (a + b + m) * x / (m2 * (m2 + 1.0));
        let (above, below) = (value + even * before, 1.0 + even * below_before);
        let (next, scale) = (above + odd * value, 1.0 / away_from_zero(below + odd));
        let last = value;
        (before, below_before, value) = (above * scale, below * scale, next * scale);
        if (value - last).abs() < 2e-16 * value.abs() {
            break;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::student_t::two_sided_p_value;

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a} against {b}");
    }

    #[test]
    fn f_tails_agree_with_closed_forms() {
        // d1 = 2: (1 + 2 f / d2)^(-d2 / 2), down to where f64 ends.
        for d2 in [1, 2, 7, 30, 289, 4000] {
            for f in [1e-3, 0.1, 1.0, 5.0, 60.0, 400.0] {
                let exact = (-0.5 * f64::from(d2) * (2.0 * f / f64::from(d2)).ln_1p()).exp();
                if exact > 1e-290 {
                    close(f_sf(f, 2, d2 as usize), exact, 1e-11);
                }
            }
        }
    }

    #[test]
    fn one_restriction_is_the_square_of_t() {
        for dof in [1, 3, 20, 294, 50_000] {
            for t in [1e-4, 0.5, 2.0, 9.0, 30.0] {
                let (f, t) = (f_sf(t * t, 1, dof), two_sided_p_value(t, dof));
                if t > 1e-290 {
                    close(f, t, 1e-10);
                }
            }
        }
    }

    #[test]
    fn what_is_no_test_is_no_evidence() {
        assert_eq!(
            (f_sf(3.0, 0, 5), f_sf(3.0, 2, 0), f_sf(f64::NAN, 2, 5), f_sf(-1.0, 2, 5)),
            (1.0, 1.0, 1.0, 1.0)
        );
        assert_eq!(f_sf(f64::INFINITY, 2, 5), 0.0);
        assert_eq!((two_sided_p_value(f64::NAN, 5), two_sided_p_value(f64::INFINITY, 5)), (1.0, 0.0));
    }
}
