//! Conditional mutual information of discrete variables, by counting.

use super::{
    gsquared::{g_statistic, levels, strata},
    settings::{Significance, TestSettings},
};
use crate::{
    numeric::random::Rng,
    types::{CondIndTest, Error, LaggedArrays, Node, PreparedTest, Result, Samples, TestResult},
};

/// Conditional mutual information of discrete variables, in nats, from the counts of each combination of levels.
///
/// The value is that of [`Gsquared`](super::Gsquared) over `2 n`. The p-value is not from theory: X is shuffled among the samples
/// with the same levels of Z, 500 times, so that it also holds for few samples per combination. Take it where G-squared warns
/// by its small counts; it takes some hundred times longer. Equal values form a level, so discretise measurements before use.
///
/// Source: Runge et al. 2019, supplement S3 (CMIsymb); the permutations: Tsamardinos and Borboudakis 2010.
///
/// ```
/// use roscausal_discovery::{CondIndTest, DataFrame, Node, Samples};
/// use roscausal_discovery::independence_tests::{CmiSymb, TestSettings};
///
/// // The second coin copies the first: one bit, ln 2 nats.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let values = ndarray::Array2::from_shape_fn((200, 2), |(t, _)| f64::from(u8::from(noise(t) > 0.0)));
/// let data = DataFrame::new(vec![values], vec!["first".into(), "second".into()])?;
/// let samples = Samples::new(&data, 0);
/// let test = CmiSymb::new(&TestSettings::default())?;
/// let result = test.prepare(&samples)?.run_test(Node::new(0, 0), Node::new(1, 0), &[])?;
/// assert!((result.value - 2f64.ln()).abs() < 0.02 && result.p_value < 0.01);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct CmiSymb {
    significance: Significance,
    sig_samples: usize,
    seed: u64,
}

impl CmiSymb {
    /// The test with these settings.
    ///
    /// # Errors
    /// A setting that is not allowed: there is no p-value from theory and no confidence interval.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        settings.check()?;
        let reason = "cmisymb has none from theory; take gsquared, or 'shuffle_test'";
        Error::ensure(settings.significance != Some(Significance::Analytic), "significance", || reason)?;
        Error::ensure(settings.confidence.is_none(), "confidence", || "cmisymb has none; leave it out")?;
        let significance = settings.significance.unwrap_or(Significance::ShuffleTest);
        Ok(Self { significance, sig_samples: settings.sig_samples.unwrap_or(500), seed: settings.seed })
    }
}

impl CondIndTest for CmiSymb {
    fn name(&self) -> &'static str {
        "cmisymb"
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        if samples.is_empty() {
            return Err(Error::Data(format!("no sample is left after a cut-off of {}", samples.cut_off())));
        }
        Ok(Box::new(Prepared { test: self, samples }))
    }

    fn decides_by_value(&self) -> bool {
        self.significance == Significance::FixedThres
    }
}

struct Prepared<'a> {
    test: &'a CmiSymb,
    samples: &'a Samples<'a>,
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let LaggedArrays { x: xs, y: ys, z: zs, n_lost } = self.samples.arrays(x, y, z);
        let (of_x, of_y, stratum) = (levels(&xs), levels(&ys), strata(&zs, xs.len()));
        let g = g_statistic(&of_x, &of_y, &stratum, false);
        let p_value = match self.test.significance {
            // No stratum has two levels of both: nothing can be learnt.
            _ if g.dof == 0 => 1.0,
            Significance::FixedThres => 1.0,
            _ => self.shuffled(&of_x, &of_y, &stratum, g.value, Rng::for_test(self.test.seed, x, y, z))?,
        };
        let value = g.value / (2.0 * xs.len().max(1) as f64);
        Ok(TestResult::new(value, p_value, xs.len(), n_lost))
    }

    fn is_cheap(&self) -> bool {
        self.test.significance == Significance::FixedThres
    }
}

impl Prepared<'_> {
    /// The share of shuffles within strata whose statistic is at least `value`.
    fn shuffled(&self, x: &[usize], y: &[usize], stratum: &[usize], value: f64, mut rng: Rng) -> Result<f64> {
        let mut members = vec![Vec::new(); stratum.iter().max().map_or(0, |most| most + 1)];
        stratum.iter().enumerate().for_each(|(i, &s)| members[s].push(i));
        let mut surrogate = x.to_vec();
        // Counts that are the same give the same sum up to rounding.
        let least = value * (1.0 - 1e-12);
        let mut count = 0;
        for shuffle in 0..self.test.sig_samples {
            if shuffle % 64 == 0 {
                self.samples.control().check()?;
            }
            for samples in &members {
                let mut of_stratum: Vec<usize> = samples.iter().map(|&i| x[i]).collect();
                rng.shuffle(&mut of_stratum);
                samples.iter().zip(of_stratum).for_each(|(&i, level)| surrogate[i] = level);
            }
            count += usize::from(g_statistic(&surrogate, y, stratum, false).value >= least);
        }
        Ok((count + 1) as f64 / (self.test.sig_samples + 1) as f64)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::{independence_tests::Confidence, types::DataFrame};

    #[test]
    fn what_a_third_variable_explains_is_no_dependence() {
        let mut rng = Rng::new(7);
        // Both copy the third, one time in five wrongly.
        let mut values = Array2::zeros((300, 3));
        for mut row in values.rows_mut() {
            let third = rng.below(2) as f64;
            let mut copy = || if rng.below(5) == 0 { 1.0 - third } else { third };
            (row[0], row[1], row[2]) = (copy(), copy(), third);
        }
        let names = (0..3).map(|k| k.to_string()).collect();
        let data = DataFrame::new(vec![values], names).unwrap();
        let samples = Samples::new(&data, 0);
        let test = CmiSymb::new(&TestSettings::default()).unwrap();
        let prepared = test.prepare(&samples).unwrap();
        let p = |z: &[Node]| prepared.run_test(Node::new(0, 0), Node::new(1, 0), z).unwrap().p_value;
        assert!(p(&[]) < 0.01);
        assert!(p(&[Node::new(2, 0)]) > 0.05);
    }

    #[test]
    fn p_values_of_independent_series_are_spread_evenly() {
        let mut rng = Rng::new(11);
        let values = Array2::from_shape_simple_fn((60, 81), || rng.below(3) as f64);
        let data = DataFrame::new(vec![values], (0..81).map(|k| k.to_string()).collect()).unwrap();
        let samples = Samples::new(&data, 0);
        let test = CmiSymb::new(&TestSettings { sig_samples: Some(100), ..TestSettings::default() }).unwrap();
        let prepared = test.prepare(&samples).unwrap();
        let p = |k: usize| {
            prepared
                .run_test(Node::new(2 * k, 0), Node::new(2 * k + 1, 0), &[Node::new(80, 0)])
                .unwrap()
                .p_value
        };
        let small = (0..40).filter(|&k| p(k) < 0.25).count();
        // 10 of 40 are expected, with a deviation of 2.7.
        assert!((2..=18).contains(&small), "{small}");
    }

    #[test]
    fn what_it_does_not_have_is_refused() {
        for settings in [
            TestSettings { significance: Some(Significance::Analytic), ..TestSettings::default() },
            TestSettings { confidence: Some(Confidence::Bootstrap), ..TestSettings::default() },
        ] {
            assert!(CmiSymb::new(&settings).is_err());
        }
    }
}
