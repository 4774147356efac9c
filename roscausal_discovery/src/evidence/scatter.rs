//! Scatters of a link's samples.

use crate::{independence_tests::residuals, numeric::rows::standardize, types::LaggedArrays};

/// Samples that the regression is made of; of more, evenly chosen ones tell the same.
const MOST_SAMPLES: usize = 20_000;

/// Which of `n` samples [`scatters`] wants: first those that are drawn, at most `points`, then those of the regression; both evenly
/// chosen. And the number of the former.
pub(super) fn positions(n: usize, points: usize) -> (Vec<usize>, usize) {
    let drawn = points.min(n);
    let step = n.div_ceil(MOST_SAMPLES).max(1);
    ((0..drawn).map(|k| k * n / drawn).chain((0..n).step_by(step)).collect(), drawn)
}

/// Cause against effect, and what is left of both after a linear regression on the conditions. `arrays` has the samples of
/// [`positions`]: the first `drawn` are drawn as they are, the regression is one of the others.
pub(super) fn scatters(arrays: LaggedArrays, drawn: usize) -> (Vec<[f32; 2]>, Vec<[f32; 2]>) {
    let LaggedArrays { mut x, mut y, mut z, .. } = arrays;
    let raw = thin(&x[..drawn], &y[..drawn], drawn);
    if drawn == 0 || z.is_empty() {
        return (raw, Vec::new());
    }
    for row in [&mut x, &mut y].into_iter().chain(&mut z) {
        row.drain(..drawn);
    }
    let scale = |row: &[f64]| {
        let mean = row.iter().sum::<f64>() / row.len() as f64;
        row.iter().map(|v| (v - mean).powi(2)).sum::<f64>().sqrt()
    };
    let [scale_x, scale_y] = [&x, &y].map(|row| scale(row));
    if !(standardize(&mut x) && standardize(&mut y)) {
        return (raw, Vec::new());
    }
    z.retain_mut(|row| standardize(row));
    let (mut x, mut y) = residuals(x, y, z);
    x.iter_mut().for_each(|v| *v *= scale_x);
    y.iter_mut().for_each(|v| *v *= scale_y);
    (raw, thin(&x, &y, drawn))
}

fn thin(x: &[f64], y: &[f64], points: usize) -> Vec<[f32; 2]> {
    let points = points.min(x.len());
    let pick = |k: usize| {
        let at = k * x.len() / points;
        [rounded(x[at]), rounded(y[at])]
    };
    (0..points).map(pick).collect()
}

/// To four digits: more is not seen in a plot.
fn rounded(value: f64) -> f32 {
    format!("{value:.3e}").parse().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_conditions_explain_is_gone_from_the_residuals() {
        let z: Vec<f64> = (0..200).map(|i| f64::from(i % 7)).collect();
        let e: Vec<f64> = (0..200).map(|i| f64::from(i * i % 13)).collect();
        let x: Vec<f64> = z.iter().zip(&e).map(|(z, e)| 100.0 * z + e).collect();
        let (at, drawn) = positions(200, 50);
        assert_eq!((at.len(), drawn), (250, 50));
        let some = |row: &[f64]| at.iter().map(|&i| row[i]).collect::<Vec<f64>>();
        let arrays = LaggedArrays { x: some(&x), y: some(&e), z: vec![some(&z)], n_lost: 0 };
        let (raw, left) = scatters(arrays, drawn);
        assert_eq!((raw.len(), left.len()), (50, 50));
        assert!(left.iter().all(|p| (p[0] - p[1]).abs() < 0.5), "{left:?}");
        assert!(raw.iter().any(|p| p[0] > 300.0) && left.iter().all(|p| p[0].abs() < 20.0));
    }
}
