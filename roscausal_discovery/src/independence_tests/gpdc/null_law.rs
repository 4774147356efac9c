//! The p-value of a distance correlation of ranks: the limit law of [`super::limit_law`], corrected for the number of samples and
//! for ties.
//!
//! The statistic is `x = (n - 1) dCor^2`, and the limit of its law has the mean 2.5 and the variance 2.
//!
//! **Few samples.** The largest possible `x` is `n - 1`, and the upper tail is shorter than the limit's. The limit law is therefore
//! asked at `y = -1.43 / n - (1 - 0.36 / n) (n - 1) / 0.66 ln(1 - 0.66 x / (n - 1))`, which grows with `x` and is finite. The three
//! constants are fitted to random pairs. What is left, by `examples/levels.rs`: of 200,000 pairs of 30 samples 0.0504, 0.0099 and 0.00101 are
//! below 0.05, 0.01 and 0.001; of 40,000 pairs of 500 samples 0.0509, 0.0103 and 0.0008.
//!
//! **Ties** make the law wider. Over all orders of one series against the other, mean and variance of `x` follow exactly from three
//! sums of each centred distance kernel `A`: `sum A_ii`, `sum A_ij^2` and `sum A_ii^2` (Hoeffding's combinatorial moments). `x` is moved
//! and scaled to the mean and variance that ranks without ties have. Then comes the correction above.
//!
//! Example: 100 samples with the distance correlation 0.22, without ties: `x = 4.79`, p = 0.067.

use super::limit_law::above;

/// The constants of the correction: shift, scale and curvature.
const SHIFT: f64 = 1.43;
const SCALE: f64 = 0.36;
const CURVATURE: f64 = 0.66;
/// The smallest p-value: a p-value of 0 would say that chance is impossible.
const SMALLEST: f64 = 1e-300;
/// Samples below which the variance over all orders has no formula.
const FEWEST: usize = 4;

/// Probability that two independent series with the ties of the ranks `x` and `y` have a distance correlation of `value` or more;
/// above 0.
pub(super) fn p_value(x: &[u32], y: &[u32], value: f64) -> f64 {
    let n = x.len().min(y.len());
    if n < 2 {
        return 1.0;
    }
    let statistic = (n as f64 - 1.0) * value * value;
    let untied = Kernel::untied(n);
    let kernels = [Kernel::of(x), Kernel::of(y)];
    let tied = kernels.iter().any(Option::is_some) && n >= FEWEST;
    let statistic = match tied {
        false => statistic,
        true => {
            let [of_x, of_y] = kernels.map(|kernel| kernel.unwrap_or(untied));
            let (mean, variance) = moments(&untied, &untied, n);
            let (own_mean, own_variance) = moments(&of_x, &of_y, n);
            let moved = mean + (statistic - own_mean) * (variance / own_variance).sqrt();
            if moved.is_finite() { moved } else { statistic }
        }
    };
    above(corrected(statistic, n)).clamp(SMALLEST, 1.0)
}

/// Where the limit law has the probability that `x` has for `n` samples.
fn corrected(x: f64, n: usize) -> f64 {
    let n = n as f64;
    let of_most = (CURVATURE * x / (n - 1.0)).min(1.0 - f64::EPSILON);
    -SHIFT / n - (1.0 - SCALE / n) * (n - 1.0) / CURVATURE * libm::log1p(-of_most)
}

/// Sums of a centred distance kernel of ranks, `A_ij = -|r_i - r_j|` without its row and column means.
#[derive(Clone, Copy, Debug)]
struct Kernel {
    /// `sum A_ii`.
    trace: f64,
    /// `sum A_ij^2`.
    squares: f64,
    /// `sum A_ii^2`.
    diagonal: f64,
}

impl Kernel {
    /// That of the ranks `1..=n`.
    fn untied(n: usize) -> Self {
        let n = n as f64;
        let square = n * n;
        Self {
            trace: (square - 1.0) / 3.0,
            squares: (square - 1.0) * (2.0 * square + 7.0) / 45.0,
            diagonal: (square - 1.0) * (2.0 * square - 3.0) / (15.0 * n),
        }
    }

    /// That of `ranks`, each at most their number; `None` without ties.
    fn of(ranks: &[u32]) -> Option<Self> {
        let mut counts = vec![0_u32; ranks.len() + 1];
        ranks.iter().for_each(|&rank| counts[rank as usize] += 1);
        if counts.iter().all(|&count| count <= 1) {
            return None;
        }
        let n = ranks.len() as f64;
        let occurring = || counts.iter().enumerate().filter(|(_, count)| **count > 0);
        let each = || occurring().map(|(rank, &count)| (rank as f64, f64::from(count)));
        let sum: f64 = each().map(|(rank, count)| rank * count).sum();
        let squares: f64 = each().map(|(rank, count)| rank * rank * count).sum();
        // Row sums of the distances: `r (2 below + own - n) + sum - 2 sum below - own`.
        let (mut below, mut sum_below) = (0.0, 0.0);
        let rows: Vec<(f64, f64)> = each()
            .map(|(rank, count)| {
                let row = rank * (2.0 * below + count - n) + sum - 2.0 * sum_below - rank * count;
                below += count;
                sum_below += rank * count;
                (row, count)
            })
            .collect();
        let all: f64 = rows.iter().map(|(row, count)| row * count).sum();
        let of_rows: f64 = rows.iter().map(|(row, count)| row * row * count).sum();
        let on_diagonal = |row: f64| 2.0 * row / n - all / (n * n);
        Some(Self {
            trace: all / n,
            squares: 2.0 * (n * squares - sum * sum) - 2.0 / n * of_rows + all * all / (n * n),
            diagonal: rows.iter().map(|&(row, count)| on_diagonal(row).powi(2) * count).sum(),
        })
    }
}

/// Mean and variance of `x` over all orders of one series of `n` samples against the other.
fn moments(x: &Kernel, y: &Kernel, n: usize) -> (f64, f64) {
    let n = n as f64;
    let off = |of: &Kernel| (n - 1.0) * of.squares - of.trace * of.trace;
    let on = |of: &Kernel| n * (n + 1.0) * of.diagonal - (n - 1.0) * (of.trace * of.trace + 2.0 * of.squares);
    let scale = x.squares * y.squares;
    let pairs = 2.0 * off(x) * off(y) / ((n - 1.0).powi(2) * (n + 1.0) * (n - 2.0));
    let singles = on(x) * on(y) / ((n + 1.0) * n * (n - 1.0) * (n - 2.0) * (n - 3.0));
    (x.trace * y.trace / scale.sqrt(), (n - 1.0).powi(2) / scale * (pairs + singles))
}

#[cfg(test)]
mod tests {
    use super::{
        super::distance_correlation::{of_ranks, ranks},
        *,
    };
    use crate::numeric::pcg64::Pcg64;

    /// A series of `n` uniform numbers, rounded to `values` different ones.
    fn series(rng: &mut Pcg64, n: usize, values: Option<f64>) -> Vec<u32> {
        let round = |v: f64| values.map_or(v, |values| (v * values).floor());
        ranks(&(0..n).map(|_| round(rng.next_f64())).collect::<Vec<_>>())
    }

    #[test]
    fn sums_of_a_kernel_are_those_of_its_matrix() {
        let mut rng = Pcg64::new(1);
        for values in [Some(3.0), Some(8.0), Some(40.0)] {
            let ranks = series(&mut rng, 30, values);
            let n = ranks.len();
            let d = |i: usize, j: usize| (f64::from(ranks[i]) - f64::from(ranks[j])).abs();
            let row = |i: usize| (0..n).map(|j| d(i, j)).sum::<f64>() / n as f64;
            let rows: Vec<f64> = (0..n).map(row).collect();
            let all = rows.iter().sum::<f64>() / n as f64;
            let entry = |i: usize, j: usize| rows[i] + rows[j] - all - d(i, j);
            let kernel = Kernel::of(&ranks).unwrap();
            let trace: f64 = (0..n).map(|i| entry(i, i)).sum();
            let squares: f64 = (0..n * n).map(|k| entry(k / n, k % n).powi(2)).sum();
            let diagonal: f64 = (0..n).map(|i| entry(i, i).powi(2)).sum();
            for (fast, slow) in
                [(kernel.trace, trace), (kernel.squares, squares), (kernel.diagonal, diagonal)]
            {
                assert!((fast - slow).abs() < 1e-9 * slow, "{values:?}: {fast} {slow}");
            }
        }
    }

    /// All 720 orders of six samples, ties or none.
    #[test]
    fn mean_and_variance_are_those_over_all_orders() {
        fn orders(of: &mut Vec<u32>, from: usize, found: &mut Vec<Vec<u32>>) {
            if from == of.len() {
                found.push(of.clone());
            }
            for k in from..of.len() {
                of.swap(from, k);
                orders(of, from + 1, found);
                of.swap(from, k);
            }
        }
        for (x, mut y) in
            [([1, 2, 3, 4, 5, 6], vec![1, 2, 3, 4, 5, 6]), ([2, 2, 3, 6, 6, 6], vec![1, 3, 3, 4, 6, 6])]
        {
            let kernel = |of: &[u32]| Kernel::of(of).unwrap_or(Kernel::untied(6));
            let (mean, variance) = moments(&kernel(&x), &kernel(&y), 6);
            let mut all = Vec::new();
            orders(&mut y, 0, &mut all);
            let values: Vec<f64> = all.iter().map(|y| 5.0 * of_ranks(&x, y).powi(2)).collect();
            let own_mean = values.iter().sum::<f64>() / 720.0;
            let own = values.iter().map(|v| (v - own_mean).powi(2)).sum::<f64>() / 720.0;
            assert!(
                (mean - own_mean).abs() < 1e-9 && (variance - own).abs() < 1e-9,
                "{mean} {own_mean} {variance} {own}"
            );
        }
    }

    #[test]
    fn p_values_fall_with_the_value_and_never_reach_zero() {
        let mut rng = Pcg64::new(2);
        for (n, values) in [(5, None), (30, None), (30, Some(4.0)), (500, Some(20.0)), (60_000, None)] {
            let (x, y) = (series(&mut rng, n, values), series(&mut rng, n, values));
            let p: Vec<f64> = (0..=1000).map(|k| p_value(&x, &y, f64::from(k) / 1000.0)).collect();
            assert!(p.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12), "{n}");
            assert!(p[0] > 0.99 && p[1000] >= SMALLEST && p[1000] < 0.1, "{n}: {} {}", p[0], p[1000]);
        }
        assert_eq!(p_value(&[1], &[1], 0.5), 1.0);
    }

    /// Of independent pairs as many are below a level as it says: four standard errors, which a right law fails in a run of ten
    /// thousand.
    #[test]
    fn levels_hold_for_few_samples_and_ties() {
        const PAIRS: usize = 20_000;
        let mut rng = Pcg64::new(3);
        // Every fifth sample has the value of another.
        let fifth = |n: usize| Some(2.2 * n as f64);
        for (n, values) in [(30, None), (100, None), (60, fifth(60)), (200, Some(20.0))] {
            let mut counts = [0; 2];
            for _ in 0..PAIRS {
                let (x, y) = (series(&mut rng, n, values), series(&mut rng, n, values));
                let p = p_value(&x, &y, of_ranks(&x, &y));
                counts[0] += usize::from(p <= 0.05);
                counts[1] += usize::from(p <= 0.01);
            }
            for (level, count) in [0.05, 0.01].into_iter().zip(counts) {
                let expected = PAIRS as f64 * level;
                let off = (count as f64 - expected).abs();
                assert!(
                    off < 4.0 * (expected * (1.0 - level)).sqrt() + 0.02 * expected,
                    "{n} {values:?} {level}: {count}"
                );
            }
        }
    }
}
