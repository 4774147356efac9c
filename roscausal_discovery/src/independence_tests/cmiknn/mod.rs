//! CMIknn: conditional mutual information from nearest neighbours. It makes no assumption about the form of the
//! dependence.

mod coordinate;
mod estimator;
mod ranked;
mod surrogates;

pub(crate) use self::estimator::Estimator;
use self::{
    coordinate::{Coordinate, MAX_RANKS},
    surrogates::{block_permutation, local_permutation, nearest},
};
use super::{
    resampling::{Resampling, optimal_block_length},
    settings::{Confidence, Significance, TestSettings},
};
use crate::{
    numeric::{
        random::{Rng, seed_of_draw},
        rows::{is_constant, moments, random_ranks, standardized},
    },
    types::{CondIndTest, Error, LaggedArrays, Named, Node, PreparedTest, Result, Samples, TestResult},
};

/// Noise that breaks ties in untransformed rows, as a fraction of the row's standard deviation.
const TIE_NOISE: f64 = 1e-6;
/// Values of surrogates that are held in memory at once; 500 surrogates of 32,000 samples are fewer.
const AT_ONCE: usize = 1 << 24;

/// Conditional mutual information in nats from nearest neighbours (Frenzel and Pompe 2007), with a local permutation
/// test (Runge 2018, AISTATS, "Conditional independence testing based on a nearest-neighbor estimator").
///
/// Take it if the form of the dependence is unknown, also with multiplicative noise. It needs some hundred samples, has
/// less power than a test that knows the form, and takes the longest.
///
/// Surrogates rearrange Y among the nearest samples in Z, or X in blocks if there is no Z. The p-value is
/// `(count + 1) / (samples + 1)`, where `count` is the number of surrogates whose information is not below the value.
/// All surrogates are drawn, unless `shuffle_stop` is given: then a test ends with the surrogate that is the so-many-th to reach the
/// value, and the p-value is their share of those drawn until then (Besag and Clifford 1991, "Sequential Monte Carlo p-values"):
/// as valid, and most of the time of absent links is saved.
///
/// ```
/// use roscausal_discovery::{CondIndTest, DataFrame, Node, Samples};
/// use roscausal_discovery::independence_tests::{CmiKnn, TestSettings};
///
/// // The size of Y follows X, its sign does not: correlation cannot see it.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let values = ndarray::Array2::from_shape_fn((200, 2), |(t, k)| noise(2 * t) * if k == 1 { noise(2 * t + 1).signum() } else { 1.0 });
/// let data = DataFrame::new(vec![values], vec!["x".into(), "y".into()])?;
/// let samples = Samples::new(&data, 0);
/// let test = CmiKnn::new(&TestSettings { sig_samples: Some(199), ..TestSettings::default() })?;
/// let result = test.prepare(&samples)?.run_test(Node::new(0, 0), Node::new(1, 0), &[])?;
/// assert_eq!(result.p_value, 0.005);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct CmiKnn {
    settings: TestSettings,
    significance: Significance,
    transform: Transform,
    /// Number of neighbours; below 1, the fraction of the samples.
    knn: f64,
    shuffle_neighbors: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transform {
    /// Ranks. `uniform` differs only by a scale factor, and information does not depend on scale.
    Ranks,
    Standardize,
    None,
}

impl CmiKnn {
    /// The test with these settings.
    ///
    /// # Errors
    /// A setting that is not allowed: there is no analytic significance or confidence interval.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        settings.check()?;
        let significance = settings.significance.unwrap_or(Significance::ShuffleTest);
        let reason = "cmiknn has no analytic one; choose 'shuffle_test' or 'fixed_thres'";
        Error::ensure(significance != Significance::Analytic, "significance", || reason)?;
        let reason = "cmiknn has none from theory; choose 'bootstrap'";
        Error::ensure(settings.confidence != Some(Confidence::Analytic), "confidence", || reason)?;
        let knn = settings.knn;
        Error::ensure(knn > 0.0 && knn.is_finite(), "knn", || {
            format!("{knn} must be a number of neighbours, or a fraction of the samples below 1")
        })?;
        let shuffle_neighbors = settings.shuffle_neighbors;
        Error::ensure(shuffle_neighbors > 1, "shuffle_neighbors", || {
            format!("{shuffle_neighbors} must be at least 2, of which the sample itself is one")
        })?;
        let transform = match settings.transform.as_str() {
            "ranks" | "uniform" => Transform::Ranks,
            "standardize" => Transform::Standardize,
            "none" => Transform::None,
            other => {
                let reason = format!("'{other}' must be ranks, uniform, standardize or none");
                return Err(Error::param("transform", reason));
            }
        };
        Ok(Self { settings: settings.clone(), significance, transform, knn, shuffle_neighbors })
    }

    /// Number of neighbours for `n` samples; `None` if there are too few samples.
    fn neighbours(&self, n: usize) -> Option<usize> {
        let k = if self.knn < 1.0 { ((self.knn * n as f64) as usize).max(1) } else { self.knn as usize };
        (k < n).then_some(k)
    }
}

impl CondIndTest for CmiKnn {
    fn name(&self) -> &'static str {
        "cmiknn"
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        if self.neighbours(samples.len()).is_none() {
            return Err(Error::Data(format!(
                "{} samples after a cut-off of {} are too few for cmiknn with {knn} = {}: record longer or lower {knn}",
                samples.len(),
                samples.cut_off(),
                self.knn,
                knn = Named("knn")
            )));
        }
        Ok(Box::new(Prepared { test: self, samples }))
    }

    fn decides_by_value(&self) -> bool {
        self.significance == Significance::FixedThres
    }

    fn is_one_sided(&self) -> bool {
        true
    }
}

struct Prepared<'a> {
    test: &'a CmiKnn,
    samples: &'a Samples<'a>,
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let LaggedArrays { x: xs, y: ys, z: mut zs, n_lost } = self.samples.arrays(x, y, z);
        let settings = &self.test.settings;
        let mut result = TestResult::new(0.0, 1.0, xs.len(), n_lost);
        if is_constant(&xs) || is_constant(&ys) || self.test.neighbours(xs.len()).is_none() {
            result.confidence = settings.confidence.map(|_| (0.0, 0.0));
            return Ok(result);
        }
        zs.retain(|row| !is_constant(row));
        let mut resampling = Resampling::of(self.samples, settings.seed, x, y, z);
        (result.value, result.p_value) = self.value_and_p(&xs, &ys, &zs, &mut resampling.rng, true)?;
        if settings.confidence.is_some() {
            // Samples that were drawn twice are ties. They are broken at random, in the same way each time.
            let seed = seed_of_draw(settings.seed, self.samples.data().draw);
            let ties = Rng::for_test(seed ^ 1, x, y, z);
            result.confidence = Some(resampling.bootstrap(&xs, &ys, &zs, settings, |x, y, z| {
                self.value_and_p(&x, &y, &z, &mut ties.clone(), false).map_or(0.0, |(value, _)| value)
            })?);
        }
        Ok(result)
    }
}

impl Prepared<'_> {
    fn value_and_p(
        &self,
        x: &[f64],
        y: &[f64],
        z: &[Vec<f64>],
        rng: &mut Rng,
        with_p: bool,
    ) -> Result<(f64, f64)> {
        let rows = || [x, y].into_iter().chain(z.iter().map(Vec::as_slice));
        if self.test.transform == Transform::Ranks && x.len() <= MAX_RANKS {
            let rows =
                rows().map(|row| random_ranks(row, rng).iter().map(|&rank| rank as i16).collect()).collect();
            return self.of_rows::<i16>(x, rows, rng, with_p, ranked::information);
        }
        let rows = rows()
            .map(|row| match self.test.transform {
                Transform::Ranks => random_ranks(row, rng).iter().map(|&rank| rank as f64).collect(),
                Transform::Standardize => standardized(&without_ties(row, rng)),
                Transform::None => without_ties(row, rng),
            })
            .collect();
        self.of_rows::<f64>(x, rows, rng, with_p, |estimator, arrangements| {
            estimator.information(&[arrangements])
        })
    }

    /// Value and p-value from the transformed rows X, Y, Z..., by the `information` of arrangements of one of them.
    fn of_rows<T: Coordinate>(
        &self,
        raw_x: &[f64],
        mut rows: Vec<Vec<T>>,
        rng: &mut Rng,
        with_p: bool,
        information: impl Fn(&Estimator<'_, T>, &[T]) -> Result<Vec<f64>>,
    ) -> Result<(f64, f64)> {
        let z = rows.split_off(2);
        let n = raw_x.len();
        // Information is symmetric. Which of the two moves matters for surrogates only.
        let (moves, stays) = if z.is_empty() { (&rows[0], &rows[1]) } else { (&rows[1], &rows[0]) };
        let samples = match self.test.significance {
            Significance::ShuffleTest if with_p => self.test.settings.sig_samples.unwrap_or(500),
            _ => 0,
        };
        let mut order = vec![0; n];
        let m = self.test.shuffle_neighbors.min(n);
        let neighbours = if samples > 0 { nearest(&z, m) } else { Vec::new() };
        let length = || self.test.settings.sig_blocklength.unwrap_or_else(|| optimal_block_length(&[raw_x]));
        let length = if z.is_empty() && samples > 0 { length() } else { 1 };
        let k = self.test.neighbours(n).unwrap_or(1);
        let estimator = Estimator { k, y: &[stays], z: &z, control: self.samples.control() };
        let stop = self.test.settings.shuffle_stop.unwrap_or(usize::MAX);
        // All at once, as far as memory goes, share more of the work; with a stop, as many as are drawn at the least, then twice as
        // many and so on.
        let (mut drawn, mut count, mut value) = (0, 0, None);
        loop {
            let batch = stop.max(drawn).min(samples - drawn).min((AT_ONCE / n.max(1)).max(1));
            let mut arrangements = Vec::with_capacity((batch + 1) * n);
            if value.is_none() {
                arrangements.extend_from_slice(moves);
            }
            for _ in 0..batch {
                if z.is_empty() {
                    block_permutation(length, rng, &mut order);
                } else {
                    local_permutation(&neighbours, m, rng, &mut order);
                }
                arrangements.extend(order.iter().map(|&i| moves[i]));
            }
            let values = information(&estimator, &arrangements)?;
            let nulls = if value.is_none() { &values[1..] } else { &values[..] };
            let of_data = *value.get_or_insert(values[0]);
            for &null in nulls {
                drawn += 1;
                count += usize::from(null >= of_data);
                if count == stop {
                    return Ok((of_data, count as f64 / drawn as f64));
                }
            }
            if drawn == samples {
                let p_value = if samples > 0 { (count + 1) as f64 / (samples + 1) as f64 } else { 1.0 };
                return Ok((of_data, p_value));
            }
        }
    }
}

/// The row, with a little noise if values repeat.
fn without_ties(row: &[f64], rng: &mut Rng) -> Vec<f64> {
    let mut sorted = row.to_vec();
    sorted.sort_by(f64::total_cmp);
    if sorted.windows(2).all(|pair| pair[0] != pair[1]) {
        return row.to_vec();
    }
    let (_, deviation) = moments(row);
    row.iter().map(|v| v + TIE_NOISE * deviation * (rng.unit())).collect()
}

#[cfg(test)]
mod tests;
