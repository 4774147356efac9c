//! Ranks and normal scores, for the rank-based tests.

use statrs::function::erf::erfc_inv;

/// Standard normal quantile of `q` in (0, 1).
pub(crate) fn normal_quantile(q: f64) -> f64 {
    -std::f64::consts::SQRT_2 * erfc_inv(2.0 * q)
}

/// Empirical distribution function of each value, `k/n`; ties get the largest rank.
pub(crate) fn uniform_ranks(row: &mut [f64]) {
    let n = row.len() as f64;
    let mut sorted = row.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    row.iter_mut().for_each(|v| {
        // -0.0 and 0.0 are the same value.
        let value = *v;
        *v = sorted.partition_point(|s| *s <= value || s.total_cmp(&value).is_le()) as f64 / n;
    });
}

/// Replaces each value by the normal quantile of `(k - 1/2) / n`, `k` its rank, the mean one of ties: the scores of `-x` are those of `x`
/// with the other sign.
pub(crate) fn normal_scores(row: &mut [f64]) {
    let mut sorted = row.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    row.iter_mut().for_each(|v| {
        let (below, upto) = (sorted.partition_point(|s| *s < *v), sorted.partition_point(|s| *s <= *v));
        *v = normal_quantile((below + upto) as f64 / (2 * sorted.len()) as f64);
    });
}

/// The reference's: the quantile of `k / n`, `k` the largest rank of ties, and of `1 - 1e-5` instead of 1. So the largest value of each
/// variable is an outlier, and outliers at the same sample are a dependence.
pub(crate) fn reference_normal_scores(row: &mut [f64]) {
    uniform_ranks(row);
    row.iter_mut().for_each(|v| *v = normal_quantile(if *v == 1.0 { 1.0 - 1e-5 } else { *v }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_take_the_largest_rank() {
        let mut row = [1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 0.0];
        uniform_ranks(&mut row);
        let sevenths = row.map(|v| (v * 7.0).round() as i32);
        assert_eq!(sevenths, [3, 3, 6, 6, 6, 7, 1]);
    }

    #[test]
    fn normal_scores_are_known_quantiles() {
        let mut row = [10.0, -1.0, 5.0, 7.0];
        let mut turned = row.map(|v: f64| -v);
        normal_scores(&mut turned);
        let mut own = row;
        normal_scores(&mut own);
        assert!((own[0] - 1.150_349_380_376_008).abs() < 1e-13, "{own:?}");
        own.iter().zip(turned).for_each(|(a, b)| assert!((a + b).abs() < 1e-13, "{a} {b}"));
        reference_normal_scores(&mut row);
        let known = [4.264_890_793_923_841, -0.674_489_750_196_081_7, 0.0, 0.674_489_750_196_081_7];
        row.iter().zip(known).for_each(|(a, b)| assert!((a - b).abs() < 1e-13, "{a} {b}"));
    }
}
