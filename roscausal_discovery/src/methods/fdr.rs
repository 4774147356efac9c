//! Control of the false discovery rate.

use ndarray::Array3;

/// Correction of p-values for the number of tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fdr {
    /// None.
    #[default]
    None,
    /// Benjamini and Hochberg, over all links; a pair at lag 0 with one p-value for both directions counts once.
    Bh,
    /// The same over the lagged links; p-values at lag 0 stay as they are. The reference's.
    BhLagged,
}

impl Fdr {
    /// What the reference means by this word.
    #[must_use]
    pub fn as_tigramite(self) -> Self {
        if self == Self::Bh { Self::BhLagged } else { self }
    }
}

words!(Fdr, "fdr": None "none", Bh "fdr_bh", BhLagged "fdr_bh_lagged");

/// P-values corrected for multiple testing (Benjamini and Hochberg 1995). Only the entries in `tested` count and
/// change.
///
/// Of the links with a corrected p-value below 0.05, one in twenty is expected to be false.
///
/// ```
/// use ndarray::arr3;
/// use roscausal_discovery::methods::fdr_bh;
///
/// let p_values = arr3(&[[[0.01, 0.04, 0.5]]]);
/// let corrected = fdr_bh(&p_values, &p_values.mapv(|_| true));
/// assert!((corrected[[0, 0, 0]] - 0.03).abs() < 1e-12 && (corrected[[0, 0, 1]] - 0.06).abs() < 1e-12);
/// ```
pub fn fdr_bh(p_matrix: &Array3<f64>, tested: &Array3<bool>) -> Array3<f64> {
    let mut q_matrix = p_matrix.clone();
    let places = q_matrix.indexed_iter_mut().filter(|(at, _)| tested[*at]);
    benjamini_hochberg(places.map(|(_, p)| p).collect());
    q_matrix
}

/// Corrects these p-values: `q_(k) = min over l >= k of p_(l) n / l`.
pub(crate) fn benjamini_hochberg(mut p_values: Vec<&mut f64>) {
    p_values.sort_by(|a, b| a.total_cmp(b));
    let n = p_values.len() as f64;
    let mut smallest = 1.0_f64;
    for (rank, p) in p_values.into_iter().enumerate().rev() {
        smallest = smallest.min(*p * n / (rank + 1) as f64);
        *p = smallest;
    }
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
