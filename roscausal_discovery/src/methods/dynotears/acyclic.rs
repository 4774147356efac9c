//! How far a weighted graph is from having no cycle: `h(W) = tr exp(W * W) - N`, with `W * W` entry by entry.
//!
//! It is 0 exactly where there is no cycle, and smooth. Its gradient is `2 exp(W * W)' * W`. Source: Zheng, Aragam, Ravikumar
//! and Xing 2018, "DAGs with NO TEARS".

/// A square matrix by rows.
type Square<'a> = &'a [f64];

/// `h` and its gradient; `weights` is `N x N` by rows.
pub(super) fn cycles(weights: Square<'_>, n: usize) -> (f64, Vec<f64>) {
    let squares: Vec<f64> = weights.iter().map(|w| w * w).collect();
    let exp = exponential(&squares, n);
    let trace: f64 = (0..n).map(|i| exp[i * n + i] - 1.0).sum();
    let gradient = (0..n * n).map(|at| 2.0 * exp[(at % n) * n + at / n] * weights[at]).collect();
    (trace, gradient)
}

/// The exponential of a matrix without negative entries: its series of a small multiple, squared up again. All terms are
/// positive, so no digits cancel.
fn exponential(matrix: Square<'_>, n: usize) -> Vec<f64> {
    let row_sum = |i: usize| matrix[i * n..(i + 1) * n].iter().sum::<f64>();
    let norm = (0..n).map(row_sum).fold(0.0, f64::max);
    // Beyond this the exponential is not a number; the weights of such a graph are far from any minimum.
    let doublings = if norm > 0.5 { libm::log2(norm / 0.5).ceil().min(60.0) as i32 } else { 0 };
    let scale = 0.5_f64.powi(doublings);
    let small: Vec<f64> = matrix.iter().map(|v| v * scale).collect();
    let mut sum = identity(n);
    let mut term = identity(n);
    // 0.5^14 / 14! is below 1e-15.
    for k in 1..=14 {
        term = product(&term, &small, n);
        let by = 1.0 / f64::from(k);
        term.iter_mut().for_each(|v| *v *= by);
        sum.iter_mut().zip(&term).for_each(|(s, t)| *s += t);
        if term.iter().all(|v| *v < 1e-17) {
            break;
        }
    }
    for _ in 0..doublings {
        sum = product(&sum, &sum, n);
    }
    sum
}

fn identity(n: usize) -> Vec<f64> {
    (0..n * n).map(|at| if at / n == at % n { 1.0 } else { 0.0 }).collect()
}

fn product(a: Square<'_>, b: Square<'_>, n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    for (row, out) in a.chunks_exact(n).zip(out.chunks_exact_mut(n)) {
        for (factor, from) in row.iter().zip(b.chunks_exact(n)) {
            if *factor != 0.0 {
                out.iter_mut().zip(from).for_each(|(o, v)| *o += factor * v);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_cycle_is_0_and_a_cycle_of_two_has_its_known_measure() {
        // a -> b -> c, a -> c.
        let (h, gradient) = cycles(&[0.0, 2.0, -3.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0], 3);
        assert!(h.abs() < 1e-12 && gradient[0].abs() < 1e-12);
        // exp of [[0, u], [u, 0]] has cosh u on its diagonal.
        for w in [0.1_f64, 1.0, 3.0] {
            let (h, gradient) = cycles(&[0.0, w, w, 0.0], 2);
            let u = w * w;
            assert!((h - 2.0 * (u.cosh() - 1.0)).abs() < 1e-12 * u.cosh());
            assert!((gradient[1] - 2.0 * w * u.sinh()).abs() < 1e-12 * u.cosh() * w);
        }
    }
}
