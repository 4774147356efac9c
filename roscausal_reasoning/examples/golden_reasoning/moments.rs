//! Mean and variance of linear equations under a schedule, by the formulas.

use roscausal_reasoning::model::{Schedule, System};

/// Mean and variance at each step, by the response to a unit of each noise: `(mean, variance)` by `[step * n + var]`.
pub(crate) fn moments(
    system: &System,
    past: &[f64],
    schedule: &Schedule,
    noise_variance: &[f64],
) -> (Vec<f64>, Vec<f64>) {
    let n = system.len();
    let outcome = |source: Option<(usize, usize)>| {
        let mut rows = past.to_vec();
        system.run(&mut rows, schedule, |step, var| f64::from(u8::from(source == Some((step, var)))));
        rows.split_off(past.len())
    };
    let mean = outcome(None);
    let mut variance = vec![0.0; mean.len()];
    for step in 0..schedule.steps() {
        for var in (0..n).filter(|&var| !schedule.is_set(step, var)) {
            let moved = outcome(Some((step, var)));
            for ((total, moved), mean) in variance.iter_mut().zip(moved).zip(&mean) {
                *total += (moved - mean).powi(2) * noise_variance[var];
            }
        }
    }
    (mean, variance)
}
