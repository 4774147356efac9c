//! Control of the false discovery rate.

use ndarray::Array3;

/// P-values corrected for multiple testing (Benjamini and Hochberg 1995). Only the entries in `tested` count and
/// change.
pub fn fdr_bh(p_matrix: &Array3<f64>, tested: &Array3<bool>) -> Array3<f64> {
    let mut entries: Vec<((usize, usize, usize), f64)> =
        p_matrix.indexed_iter().filter(|(at, _)| tested[*at]).map(|(at, &p)| (at, p)).collect();
    entries.sort_by(|a, b| a.1.total_cmp(&b.1));
    let m = entries.len() as f64;
    let mut q_matrix = p_matrix.clone();
    let mut smallest = 1.0_f64;
    for (rank, &(at, p)) in entries.iter().enumerate().rev() {
        smallest = smallest.min(p * m / (rank + 1) as f64);
        q_matrix[at] = smallest;
    }
    q_matrix
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corrected_values_are_the_textbook_ones() {
        // Five p-values: q = min over larger ones of p m / rank.
        let p = Array3::from_shape_vec((1, 1, 6), vec![0.01, 0.04, 0.03, 0.005, 0.5, 0.001]).unwrap();
        let tested = Array3::from_shape_vec((1, 1, 6), vec![true, true, true, true, true, false]).unwrap();
        let q = fdr_bh(&p, &tested);
        let expected = [0.025, 0.05, 0.05, 0.025, 0.5, 0.001];
        q.iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-15, "{a} {b}"));
    }
}
