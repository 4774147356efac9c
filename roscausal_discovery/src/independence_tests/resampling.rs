//! Significance and confidence by block resampling.

use super::settings::TestSettings;
use crate::{
    numeric::{
        random::{Rng, seed_of_draw},
        rows::unit_factor,
    },
    types::{Control, Node, Result, Samples},
};

/// Resampling for one test.
pub(crate) struct Resampling<'a> {
    pub(crate) rng: Rng,
    pub(crate) control: &'a Control,
}

impl<'a> Resampling<'a> {
    /// That of one test on these samples.
    pub(crate) fn of(samples: &'a Samples<'_>, seed: u64, x: Node, y: Node, z: &[Node]) -> Self {
        let rng = Rng::for_test(seed_of_draw(seed, samples.data().draw), x, y, z);
        Self { rng, control: samples.control() }
    }
    /// P-value of a two-sided test. X is shuffled in blocks; the p-value is the fraction of surrogates whose
    /// statistic is at least as large, `(count + 1) / (samples + 1)`.
    pub(crate) fn shuffle_p(
        &mut self,
        x: &[f64],
        y: &[f64],
        samples: usize,
        block_length: Option<usize>,
        value: f64,
        statistic: impl Fn(&[f64], &[f64]) -> f64,
    ) -> Result<f64> {
        let length = block_length.unwrap_or_else(|| optimal_block_length(&[x])).clamp(1, x.len().max(1));
        let mut surrogate = vec![0.0; x.len()];
        let mut starts: Vec<usize> = (0..x.len()).step_by(length).collect();
        let mut count = 0_usize;
        for sample in 0..samples {
            if sample % 64 == 0 {
                self.control.check()?;
            }
            self.rng.shuffle(&mut starts);
            let mut at = 0;
            for &start in &starts {
                let block = &x[start..(start + length).min(x.len())];
                surrogate[at..at + block.len()].copy_from_slice(block);
                at += block.len();
            }
            count += usize::from(statistic(&surrogate, y).abs() >= value.abs());
        }
        Ok((count + 1) as f64 / (samples + 1) as f64)
    }

    /// Percentile interval of the statistic over block-bootstrap samples, drawn jointly for all rows.
    pub(crate) fn bootstrap(
        &mut self,
        x: &[f64],
        y: &[f64],
        z: &[Vec<f64>],
        settings: &TestSettings,
        statistic: impl Fn(Vec<f64>, Vec<f64>, Vec<Vec<f64>>) -> f64,
    ) -> Result<(f64, f64)> {
        let n = x.len();
        let rows: Vec<&[f64]> = [x, y].into_iter().chain(z.iter().map(Vec::as_slice)).collect();
        let length = settings.conf_blocklength.unwrap_or_else(|| optimal_block_length(&rows));
        let (samples, length) = (settings.conf_samples, length.clamp(1, n.max(1)));
        let mut values = Vec::with_capacity(samples);
        let mut index = Vec::with_capacity(n + length);
        for sample in 0..samples.max(1) {
            if sample % 16 == 0 {
                self.control.check()?;
            }
            index.clear();
            while index.len() < n {
                let start = self.rng.below(n - length + 1);
                index.extend(start..start + length);
            }
            index.truncate(n);
            let draw = |row: &[f64]| -> Vec<f64> { index.iter().map(|&t| row[t]).collect() };
            values.push(statistic(draw(x), draw(y), z.iter().map(|row| draw(row)).collect()));
        }
        values.sort_unstable_by(f64::total_cmp);
        let tail = 0.5 - 0.5 * settings.conf_lev;
        let at = |q: f64| values[((q * values.len() as f64) as usize).min(values.len() - 1)];
        Ok((at(tail), at(1.0 - tail)))
    }
}

/// Block length for surrogates that keep the autocorrelation (Mader et al. 2013, Eq. 6, after Peifer et al. 2005).
/// It follows from the decay `phi` of the envelope of the autocorrelation. The longest of the rows counts, up to a
/// tenth of the samples. If the decay cannot be fitted, it is a twentieth of the samples.
pub(crate) fn optimal_block_length(rows: &[&[f64]]) -> usize {
    let n = rows.first().map_or(0, |row| row.len());
    let longest = n / 10;
    let of_row = |row: &&[f64]| match decay(&envelope(&autocorrelation(row, longest))) {
        Some(phi) => {
            let odds = phi / (1.0 - phi);
            let ratio = (odds + odds * odds) / (1.0 + 2.0 * odds);
            libm::cbrt(4.0 * n as f64 * ratio * ratio) as usize
        }
        None => n / 20,
    };
    rows.iter().map(of_row).max().unwrap_or(1).min(longest).max(1)
}

/// Autocorrelation at lags `0..=max_lag`, each a correlation of the two overlapping parts.
fn autocorrelation(row: &[f64], max_lag: usize) -> Vec<f64> {
    let correlation = |a: &[f64], b: &[f64]| {
        let n = a.len() as f64;
        let (mean_a, mean_b) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
        let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
        for (x, y) in a.iter().zip(b) {
            let (x, y) = (x - mean_a, y - mean_b);
            ab += x * y;
            aa += x * x;
            bb += y * y;
        }
        if aa > 0.0 && bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
    };
    let unit = unit_factor(row);
    let row: Vec<f64> = row.iter().map(|v| v * unit).collect();
    (0..=max_lag.min(row.len().saturating_sub(2)))
        .map(|k| correlation(&row[k..], &row[..row.len() - k]))
        .collect()
}

/// Absolute value of the analytic signal (the discrete Hilbert transform by its definition).
fn envelope(signal: &[f64]) -> Vec<f64> {
    let n = signal.len();
    let angle = |k: usize, t: usize| std::f64::consts::TAU * ((k * t) % n) as f64 / n as f64;
    // Frequencies 0 and n/2 count once, those between them twice, and the negative ones not at all.
    let spectrum: Vec<(f64, f64)> = (0..=n / 2)
        .map(|k| {
            let weight = if k == 0 || 2 * k == n { 1.0 } else { 2.0 };
            let (mut re, mut im) = (0.0, 0.0);
            for (t, v) in signal.iter().enumerate() {
                re += v * libm::cos(angle(k, t));
                im -= v * libm::sin(angle(k, t));
            }
            (weight * re / n as f64, weight * im / n as f64)
        })
        .collect();
    (0..n)
        .map(|t| {
            let (mut re, mut im) = (0.0, 0.0);
            for (k, (a, b)) in spectrum.iter().enumerate() {
                let (sin, cos) = libm::sincos(angle(k, t));
                re += a * cos - b * sin;
                im += a * sin + b * cos;
            }
            libm::hypot(re, im)
        })
        .collect()
}

/// The `phi` in (0, 1) for which `a phi^k` fits `y[k]` best by least squares, with `a` free.
fn decay(y: &[f64]) -> Option<f64> {
    if y.len() < 3 {
        return None;
    }
    // With the best `a`, minimising the sum of squares means maximising <y, phi^k>^2 / <phi^k, phi^k>.
    let fit = |phi: f64| {
        let (mut power, mut with_y, mut square) = (1.0, 0.0, 0.0);
        for v in y {
            with_y += v * power;
            square += power * power;
            power *= phi;
        }
        with_y * with_y / square
    };
    let steps = 400;
    let best = (1..steps).max_by(|&a, &b| {
        fit(f64::from(a) / f64::from(steps)).total_cmp(&fit(f64::from(b) / f64::from(steps)))
    })?;
    let (mut low, mut high) =
        (f64::from(best - 1) / f64::from(steps), f64::from(best + 1) / f64::from(steps));
    for _ in 0..100 {
        let (a, b) = (low + 0.381_966 * (high - low), low + 0.618_034 * (high - low));
        if fit(a) < fit(b) { low = a } else { high = b }
    }
    let phi = 0.5 * (low + high);
    (phi < 1.0 - 1e-9).then_some(phi)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_decay_of_a_geometric_curve_is_found() {
        let curve: Vec<f64> = (0..30).map(|k| 0.7 * 0.83_f64.powi(k)).collect();
        assert!((decay(&curve).unwrap() - 0.83).abs() < 1e-6);
    }

    #[test]
    fn the_envelope_of_an_oscillation_is_its_amplitude() {
        let wave: Vec<f64> =
            (0..32).map(|t| 0.4 * (std::f64::consts::TAU * f64::from(t) * 3.0 / 32.0).cos()).collect();
        envelope(&wave).iter().for_each(|v| assert!((v - 0.4).abs() < 1e-12));
    }

    #[test]
    fn blocks_are_at_least_one_and_at_most_a_tenth() {
        let mut rng = Rng::new(1);
        let noise: Vec<f64> = (0..200).map(|_| rng.below(1000) as f64).collect();
        assert!((1..=8).contains(&optimal_block_length(&[&noise])));
        let ramp: Vec<f64> = (0..200).map(f64::from).collect();
        assert!((1..=20).contains(&optimal_block_length(&[&ramp])));
        assert_eq!(optimal_block_length(&[&[1.0; 5]]), 1);
    }

    /// Block lengths of the reference, from the results in the repository.
    #[test]
    fn block_lengths_are_those_of_the_reference() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/golden");
        let text = std::fs::read_to_string(folder.join("misc.json")).unwrap();
        let misc: serde_json::Value = serde_json::from_str(&text).unwrap();
        let row = |value: &serde_json::Value| -> Vec<f64> {
            value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
        };
        let golden = &misc["block_length"];
        let (x, y) = (row(&golden["x"]), row(&golden["y"]));
        for (ours, golden) in autocorrelation(&x, 30).iter().zip(row(&golden["acf_x"])) {
            assert!((ours - golden).abs() < 1e-12);
        }
        assert_eq!(optimal_block_length(&[&x, &y]), golden["significance"].as_u64().unwrap() as usize);
        for entry in std::fs::read_dir(folder.join("single")).unwrap() {
            let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
            let single: serde_json::Value = serde_json::from_str(&text).unwrap();
            let Some(length) = single["result"]["block_length"].as_u64() else { continue };
            let (mut x, mut y) = (row(&single["x"]), row(&single["y"]));
            let samples: Vec<Vec<f64>> =
                single["z"].as_array().map_or(Vec::new(), |z| z.iter().map(&row).collect());
            let n_conditions = samples.first().map_or(0, Vec::len);
            let mut z: Vec<Vec<f64>> =
                (0..n_conditions).map(|k| samples.iter().map(|s| s[k]).collect()).collect();
            for row in [&mut x, &mut y].into_iter().chain(&mut z) {
                crate::numeric::rows::standardize(row);
            }
            let (x, y) = super::super::cholesky::residuals(x, y, z);
            let ours = [optimal_block_length(&[&x]), optimal_block_length(&[&x, &y])];
            println!("{} {length} {ours:?}", single["id"]);
            assert!(ours.contains(&(length as usize)), "{} {length} {ours:?}", single["id"]);
        }
    }
}
