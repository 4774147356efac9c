//! The G test, for discrete variables.

use std::{
    collections::HashMap,
    sync::atomic::{AtomicUsize, Ordering},
};

use super::{
    resampling::Resampling,
    settings::{Confidence, Significance, TestSettings},
};
use crate::{
    numeric::special::chi_squared_sf,
    types::{CondIndTest, Error, LaggedArrays, Node, PreparedTest, Result, Samples, TestResult},
};

/// G test of discrete variables: `G = 2 sum n ln(n / e)` over the cells of X and Y in every stratum of Z. `e` is
/// the count expected under independence (McDonald 2014, Handbook of Biological Statistics, "G-test of
/// independence").
///
/// Take it for categories, states and counts. It needs some samples for each combination of the levels of X, Y and Z, so
/// few levels and few conditions.
///
/// P-value: chi-squared, of `G` divided by its mean over all tables with the same margins (Bartlett's correction) and multiplied by the
/// degrees of freedom. Each stratum gives `(rows - 1) (columns - 1)` of these, not counting rows and columns without a sample. Below five
/// samples for each of them it finds too little, and a run then carries a remark: [`CmiSymb`](super::CmiSymb) shuffles instead. Without
/// degrees of freedom the value is 0 and the p-value 1. Equal values form a level, so discretise measurements before use. With
/// `as_tigramite` `G` is not corrected: few samples for each degree of freedom then find too much.
///
/// ```
/// use roscausal_discovery::{CondIndTest, DataFrame, Node, Samples};
/// use roscausal_discovery::independence_tests::{Gsquared, TestSettings};
///
/// // A light that is on when one of two switches is.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let switch = |i: usize| f64::from(u8::from(noise(i) > 0.0));
/// let values = ndarray::Array2::from_shape_fn((200, 3), |(t, k)| match k {
///     2 => switch(2 * t).max(switch(2 * t + 1)),
///     k => switch(2 * t + k),
/// });
/// let data = DataFrame::new(vec![values], vec!["first".into(), "second".into(), "light".into()])?;
/// let samples = Samples::new(&data, 0);
/// let test = Gsquared::new(&TestSettings::default())?;
/// let prepared = test.prepare(&samples)?;
/// let (first, second, light) = (Node::new(0, 0), Node::new(1, 0), Node::new(2, 0));
/// assert!(prepared.run_test(first, second, &[])?.p_value > 0.05);
/// assert!(prepared.run_test(first, second, &[light])?.p_value < 0.001);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Gsquared {
    settings: TestSettings,
    significance: Significance,
}

impl Gsquared {
    /// The test with these settings.
    ///
    /// # Errors
    /// A setting that is not allowed: there is no analytic confidence interval.
    pub fn new(settings: &TestSettings) -> Result<Self> {
        settings.check()?;
        let reason = "gsquared has none from theory; choose 'bootstrap'";
        Error::ensure(settings.confidence != Some(Confidence::Analytic), "confidence", || reason)?;
        let significance = settings.significance.unwrap_or(Significance::Analytic);
        Ok(Self { settings: settings.clone(), significance })
    }
}

impl CondIndTest for Gsquared {
    fn name(&self) -> &'static str {
        "gsquared"
    }

    fn prepare<'a>(&'a self, samples: &'a Samples<'a>) -> Result<Box<dyn PreparedTest + 'a>> {
        if samples.is_empty() {
            return Err(Error::Data(format!("no sample is left after a cut-off of {}", samples.cut_off())));
        }
        Ok(Box::new(Prepared { test: self, samples, sparse: Sparse::default() }))
    }

    fn decides_by_value(&self) -> bool {
        self.significance == Significance::FixedThres
    }
}

/// Samples for each degree of freedom below which the corrected law finds too little, and chi-squared alone too much.
const ENOUGH: usize = 5;

/// What a test does whose law does not hold.
pub(super) const FALSE_LINKS: &str = "finds links that do not exist";

/// Tests so far, and how many of them had too few samples for the chi-squared law.
#[derive(Default)]
pub(super) struct Sparse {
    tests: AtomicUsize,
    sparse: AtomicUsize,
}

impl Sparse {
    /// Counts a test of `n` samples; `enough` of them for each degree of freedom are not too few.
    pub(super) fn count(&self, n: usize, dof: usize, enough: usize) {
        self.tests.fetch_add(1, Ordering::Relaxed);
        self.sparse.fetch_add(usize::from(n < enough * dof), Ordering::Relaxed);
    }

    /// What to say of the test of this name and of what it finds, if there were too few samples.
    pub(super) fn caution(&self, name: &str, finds: &str, enough: usize) -> Option<String> {
        let (tests, sparse) = (self.tests.load(Ordering::Relaxed), self.sparse.load(Ordering::Relaxed));
        (sparse > 0).then(|| {
            format!(
                "{sparse} of {tests} tests had fewer than {enough} samples for each degree of freedom, where {name} \
                 {finds}; record longer, use variables with fewer values or, if all are categories, the test cmisymb"
            )
        })
    }
}

struct Prepared<'a> {
    test: &'a Gsquared,
    samples: &'a Samples<'a>,
    sparse: Sparse,
}

impl PreparedTest for Prepared<'_> {
    fn run_test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let LaggedArrays { x: xs, y: ys, z: zs, n_lost } = self.samples.arrays(x, y, z);
        let settings = &self.test.settings;
        let stratum = strata(&zs, xs.len());
        let corrected = !settings.as_tigramite && self.test.significance == Significance::Analytic;
        let g = g_statistic(&levels(&xs), &levels(&ys), &stratum, corrected);
        self.sparse.count(xs.len(), g.dof, ENOUGH);
        let mut resampling = Resampling::of(self.samples, settings.seed, x, y, z);
        let p_value = match self.test.significance {
            Significance::Analytic if corrected => chi_squared_sf(g.value * g.dof as f64 / g.mean, g.dof),
            Significance::Analytic => chi_squared_sf(g.value, g.dof),
            Significance::FixedThres => 1.0,
            Significance::ShuffleTest if g.dof == 0 => 1.0,
            Significance::ShuffleTest => {
                let samples = settings.sig_samples.unwrap_or(500);
                resampling.shuffle_p(&xs, &ys, samples, settings.sig_blocklength, g.value, |x, y| {
                    g_statistic(&levels(x), &levels(y), &stratum, false).value
                })?
            }
        };
        let mut result = TestResult::new(g.value, p_value, xs.len(), n_lost);
        if settings.confidence.is_some() {
            result.confidence = Some(resampling.bootstrap(&xs, &ys, &zs, settings, |x, y, z| {
                g_statistic(&levels(&x), &levels(&y), &strata(&z, x.len()), false).value
            })?);
        }
        Ok(result)
    }

    fn caution(&self) -> Option<String> {
        let finds = if self.test.settings.as_tigramite { FALSE_LINKS } else { "may miss links" };
        (self.test.significance == Significance::Analytic)
            .then(|| self.sparse.caution("gsquared", finds, ENOUGH))?
    }

    fn is_cheap(&self) -> bool {
        self.test.significance != Significance::ShuffleTest && self.test.settings.confidence.is_none()
    }
}

/// The statistic, its degrees of freedom and, if asked for, its mean over all tables with the same margins.
pub(super) struct G {
    pub(super) value: f64,
    pub(super) dof: usize,
    mean: f64,
}

/// Levels of a row as numbers `0..`, in order of appearance.
pub(super) fn levels(row: &[f64]) -> Vec<usize> {
    let mut seen = HashMap::new();
    row.iter()
        .map(|v| {
            let next = seen.len();
            // -0 and 0 are one level.
            *seen.entry((v + 0.0).to_bits()).or_insert(next)
        })
        .collect()
}

/// Stratum of each sample: the combination of the levels of all rows of Z.
pub(super) fn strata(z: &[Vec<f64>], n: usize) -> Vec<usize> {
    let mut stratum = vec![0; n];
    for row in z {
        let mut seen = HashMap::new();
        for (s, level) in stratum.iter_mut().zip(levels(row)) {
            let next = seen.len();
            *s = *seen.entry((*s, level)).or_insert(next);
        }
    }
    stratum
}

pub(super) fn g_statistic(x: &[usize], y: &[usize], stratum: &[usize], with_mean: bool) -> G {
    let count = |row: &[usize]| row.iter().max().map_or(0, |most| most + 1);
    let (rows, columns, n_strata) = (count(x), count(y), count(stratum));
    // Samples sorted by stratum, so that one small table suffices.
    let mut start = vec![0; n_strata + 1];
    stratum.iter().for_each(|&s| start[s + 1] += 1);
    (0..n_strata).for_each(|s| start[s + 1] += start[s]);
    let mut at = start.clone();
    let mut order = vec![0; stratum.len()];
    for (i, &s) in stratum.iter().enumerate() {
        order[at[s]] = i;
        at[s] += 1;
    }
    let (mut of_x, mut of_y) = (vec![0_usize; rows], vec![0_usize; columns]);
    let mut cells: HashMap<(usize, usize), usize> = HashMap::new();
    let (mut value, mut dof, mut mean) = (0.0, 0, 0.0);
    for s in 0..n_strata {
        of_x.fill(0);
        of_y.fill(0);
        cells.clear();
        let members = &order[start[s]..start[s + 1]];
        for &i in members {
            of_x[x[i]] += 1;
            of_y[y[i]] += 1;
            *cells.entry((x[i], y[i])).or_default() += 1;
        }
        let n = members.len() as f64;
        // A map has no fixed order. Sorting makes the sum the same every time.
        let mut cells: Vec<_> = cells.iter().map(|(&cell, &observed)| (cell, observed)).collect();
        cells.sort_unstable();
        for ((a, b), observed) in cells {
            let (observed, expected) = (observed as f64, of_x[a] as f64 * of_y[b] as f64 / n);
            value += 2.0 * observed * libm::log(observed / expected);
        }
        let used = |counts: &[usize]| counts.iter().filter(|&&c| c > 0).count();
        let own = used(&of_x).saturating_sub(1) * used(&of_y).saturating_sub(1);
        dof += own;
        if with_mean && own > 0 {
            let cell = |&a: &usize| of_y.iter().map(move |&b| mean_of_cell(n, a as f64, b as f64));
            mean += of_x.iter().flat_map(cell).sum::<f64>();
        }
    }
    // Rounding may leave a zero value slightly negative. Without degrees of freedom there is no dependence.
    G { value: if dof > 0 { value.max(0.0) } else { 0.0 }, dof, mean }
}

/// The mean of `2 k ln(k n / (a b))`, where `k` of `n` samples are in a row of `a` and in a column of `b` by chance: hypergeometric,
/// from its mode to both sides.
fn mean_of_cell(n: f64, a: f64, b: f64) -> f64 {
    const NEGLIGIBLE: f64 = 1e-17;
    let term = |k: f64| if k > 0.0 { 2.0 * k * libm::log(k * n / (a * b)) } else { 0.0 };
    let mode = ((a + 1.0) * (b + 1.0) / (n + 2.0)).floor();
    let (mut sum, mut weights) = (term(mode), 1.0);
    for up in [true, false] {
        let (mut k, mut weight) = (mode, 1.0);
        loop {
            // The odds of one more, or of one less: 0 at the ends.
            let more = |k: f64| (a - k) * (b - k) / ((k + 1.0) * (n - a - b + k + 1.0));
            weight *= if up { more(k) } else { more(k - 1.0).recip() };
            k += if up { 1.0 } else { -1.0 };
            if weight <= NEGLIGIBLE {
                break;
            }
            sum += weight * term(k);
            weights += weight;
        }
    }
    sum / weights
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::types::DataFrame;

    fn run(data: Array2<f64>, z: &[Node]) -> TestResult {
        let names = (0..data.ncols()).map(|i| i.to_string()).collect();
        let data = DataFrame::new(vec![data], names).expect("is a frame");
        let test = Gsquared::new(&TestSettings::default()).expect("is a test");
        let samples = Samples::new(&data, 0);
        let prepared = test.prepare(&samples).expect("prepares");
        prepared.run_test(Node::new(0, 0), Node::new(1, 0), z).expect("runs")
    }

    /// One row per count: `(x, y, z, count)`.
    fn table(cells: &[(f64, f64, f64, usize)]) -> Array2<f64> {
        let rows: Vec<[f64; 3]> =
            cells.iter().flat_map(|&(x, y, z, n)| std::iter::repeat_n([x, y, z], n)).collect();
        ndarray::arr2(&rows)
    }

    #[test]
    fn a_known_table_gives_its_g() {
        // [[10, 20], [30, 5]]: expected counts from margins 30, 35 and 40, 25 of 65.
        let g_of = |first: f64| -> f64 {
            let cells = [
                (first, 30.0, 40.0),
                (30.0 - first, 30.0, 25.0),
                (40.0 - first, 35.0, 40.0),
                (first - 5.0, 35.0, 25.0),
            ];
            let cells = cells.iter().filter(|cell| cell.0 > 0.0);
            cells.map(|(n, row, column): &(f64, f64, f64)| 2.0 * n * (n * 65.0 / (row * column)).ln()).sum()
        };
        let g = g_of(10.0);
        // Its mean over all tables with these margins (hypergeometric), by which it is divided.
        let choose =
            |n: f64, k: f64| libm::lgamma(n + 1.0) - libm::lgamma(k + 1.0) - libm::lgamma(n - k + 1.0);
        let weight = |x: f64| (choose(40.0, x) + choose(25.0, 30.0 - x) - choose(65.0, 30.0)).exp();
        let mean: f64 = (5..=30).map(f64::from).map(|x| weight(x) * g_of(x)).sum();
        let cells = [(0.0, 0.0, 0.0, 10), (0.0, 1.0, 0.0, 20), (1.0, 0.0, 0.0, 30), (1.0, 1.0, 0.0, 5)];
        let result = run(table(&cells), &[]);
        assert!((result.value - g).abs() < 1e-12);
        let p = libm::erfc((g / mean / 2.0).sqrt());
        assert!((result.p_value / p - 1.0).abs() < 1e-9, "{} for {p}", result.p_value);
    }

    #[test]
    fn strata_add_up_and_explain_away() {
        // X and Y are independent within each stratum, but not in the pooled data.
        let cells = [
            (0.0, 0.0, 0.0, 120),
            (0.0, 1.0, 0.0, 60),
            (1.0, 0.0, 0.0, 60),
            (1.0, 1.0, 0.0, 30),
            (0.0, 0.0, 1.0, 30),
            (0.0, 1.0, 1.0, 60),
            (1.0, 0.0, 1.0, 60),
            (1.0, 1.0, 1.0, 120),
        ];
        assert!(run(table(&cells), &[]).p_value < 0.05);
        let given = run(table(&cells), &[Node::new(2, 0)]);
        assert!(given.value.abs() < 1e-12 && given.p_value > 0.999, "{given:?}");
    }

    /// Over all 5040 orders of seven samples in one stratum; samples of a second one count apart.
    #[test]
    fn the_mean_is_that_over_all_orders() {
        fn orders(of: &mut Vec<usize>, from: usize, each: &mut impl FnMut(&[usize])) {
            if from == of.len() {
                each(of);
            }
            for k in from..of.len() {
                of.swap(from, k);
                orders(of, from + 1, each);
                of.swap(from, k);
            }
        }
        let (x, mut y, stratum) = ([0, 0, 0, 1, 1, 2, 2], vec![0, 0, 1, 1, 1, 2, 3], [0; 7]);
        let mean = g_statistic(&x, &y, &stratum, true).mean;
        let mut sum = 0.0;
        orders(&mut y, 0, &mut |y| sum += g_statistic(&x, y, &stratum, false).value);
        assert!((mean - sum / 5040.0).abs() < 1e-9, "{mean} {}", sum / 5040.0);
        let (twice, two) = ([x, x].concat(), [[0; 7], [1; 7]].concat());
        let of_two = g_statistic(&twice, &[y.clone(), y].concat(), &two, true);
        assert!((of_two.mean - 2.0 * mean).abs() < 1e-9 && of_two.dof == 12, "{}", of_two.mean);
    }

    #[test]
    fn the_mean_tends_to_the_degrees_of_freedom() {
        let of = |n: usize| mean_of_cell(4.0 * n as f64, 2.0 * n as f64, 2.0 * n as f64) * 4.0;
        assert!((of(100_000) - 1.0).abs() < 1e-5 && of(5) > 1.02, "{} {}", of(100_000), of(5));
    }

    #[test]
    fn a_constant_gives_no_evidence() {
        let result = run(table(&[(3.0, 0.0, 0.0, 7), (3.0, 1.0, 0.0, 9)]), &[Node::new(2, 0)]);
        assert_eq!((result.value, result.p_value), (0.0, 1.0));
    }
}
