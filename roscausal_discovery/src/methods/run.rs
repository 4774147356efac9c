//! One run of a method: a prepared test, its samples, and the count of tests.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;

use super::shared_times::SharedTimes;
use crate::{
    numeric::{least_squares::LeastSquares, rows::is_constant},
    types::{CondIndTest, Control, Error, Node, PreparedTest, Result, Samples, TestResult},
};

/// A test that cannot say what fewer samples would tell is asked again on them where the samples that count are fewer by this factor.
const ASKED_AGAIN: f64 = 1.15;

/// One run: a prepared test, its samples, and the counting of tests.
pub(crate) struct Run<'a> {
    pub(crate) samples: &'a Samples<'a>,
    test: Box<dyn PreparedTest + 'a>,
    /// The test on rows that are counted once, for columns that recordings of one time have in common.
    once: Option<Box<dyn PreparedTest + 'a>>,
    /// How many samples count of the other tests of recordings of one time.
    shared: Option<SharedTimes>,
    by_value: bool,
    one_sided: bool,
    cheap: bool,
    /// Variables of the test that are not columns of the data.
    n_dummies: usize,
    n_tests: AtomicUsize,
    /// Whether a test had conditions: else nothing was regressed.
    conditioned: AtomicBool,
}

impl<'a> Run<'a> {
    pub(crate) fn new(test: &'a dyn CondIndTest, samples: &'a Samples<'a>) -> Result<Self> {
        if !test.supports_vectors() {
            samples.data().of_scalars(test.name())?;
        }
        let prepared = test.prepare(samples)?;
        let cheap = prepared.is_cheap();
        Ok(Self {
            samples,
            test: prepared,
            once: samples.once().map(|once| test.prepare(once)).transpose()?,
            shared: SharedTimes::of(samples),
            by_value: test.decides_by_value(),
            one_sided: test.is_one_sided(),
            cheap,
            n_dummies: 0,
            n_tests: AtomicUsize::new(0),
            conditioned: AtomicBool::new(false),
        })
    }

    pub(crate) fn control(&self) -> &Control {
        self.samples.control()
    }

    /// The same run; the test knows so many dummies besides the variables of the data.
    pub(crate) fn with_dummies(self, n_dummies: usize) -> Self {
        Self { n_dummies, ..self }
    }

    /// Variables, dummies included.
    pub(crate) fn n_vars(&self) -> usize {
        self.samples.data().n_vars() + self.n_dummies
    }

    pub(crate) fn n_tests(&self) -> usize {
        self.n_tests.load(Ordering::Relaxed)
    }

    /// Tests `x _||_ y | z`, without a decision.
    pub(crate) fn test(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        self.control().check()?;
        let mut result = self.counted(x, y, z)?;
        // Results have no NaN: it counts as no evidence, and is not an answer.
        if result.value.is_nan() {
            result = TestResult { value: 0.0, p_value: 1.0, n_samples: 0, ..result };
        }
        if result.p_value.is_nan() {
            result.p_value = 1.0;
        }
        if self.has_no_answer(&result, x, y, z) {
            result.n_samples = 0;
        }
        self.n_tests.fetch_add(1, Ordering::Relaxed);
        if !z.is_empty() {
            self.conditioned.store(true, Ordering::Relaxed);
        }
        self.control().count(1);
        Ok(result)
    }

    /// The test on as many samples as count.
    fn counted(&self, x: Node, y: Node, z: &[Node]) -> Result<TestResult> {
        let (Some(once), Some(shared)) = (&self.once, &self.shared) else {
            return self.test.run_test(x, y, z);
        };
        if self.samples.are_common(x, y) {
            return once.run_test(x, y, z);
        }
        let all = self.test.run_test(x, y, z)?;
        let effect = shared.effect(x, y, z);
        // A thousandth is what rounding and chance make of independent people.
        if effect < 1.001 {
            return Ok(all);
        }
        match self.test.with_samples(all, (all.n_samples as f64 / effect) as usize, z.len()) {
            Some(fewer) => Ok(fewer),
            None if effect > ASKED_AGAIN => once.run_test(x, y, z),
            None => Ok(all),
        }
    }

    /// Whether a result of 0 and 1 is not a measurement: the test has no degree of freedom, or a constant, or the conditions determine
    /// one of the two.
    fn has_no_answer(&self, result: &TestResult, x: Node, y: Node, z: &[Node]) -> bool {
        let of_data = |node: &Node| node.var < self.samples.data().n_vars();
        if result.value != 0.0 || result.p_value != 1.0 || ![x, y].iter().chain(z).all(of_data) {
            return false;
        }
        if result.n_samples <= 2 + z.len() {
            return true;
        }
        let arrays = self.samples.arrays(x, y, z);
        let is_determined = |of: &[f64]| {
            let columns: Vec<&[f64]> = arrays.z.iter().map(Vec::as_slice).chain([of]).collect();
            is_constant(of) || LeastSquares::new(&columns, &[], true).is_undetermined(z.len())
        };
        is_determined(&arrays.x) || is_determined(&arrays.y)
    }

    /// Fills in the decision at `level`, and with `fixed_thres` the p-value that follows from it.
    pub(crate) fn decide(&self, mut result: TestResult, level: f64) -> (TestResult, bool) {
        let dependent = match (self.by_value, self.one_sided) {
            (true, true) => result.value >= level,
            (true, false) => result.value.abs() >= level,
            (false, _) => result.p_value <= level,
        };
        if self.by_value {
            result.p_value = if dependent { 0.0 } else { 1.0 };
        }
        result.dependent = Some(dependent);
        (result, dependent)
    }

    pub(crate) fn score(&self, target: Node, parents: &[Node]) -> Result<f64> {
        self.control().check()?;
        self.test.model_selection_score(target, parents)
    }

    /// What the reader should know about each variable given the parents that were found, in the order of the variables, and about
    /// all tests.
    pub(crate) fn remarks(&self, parents: &[Vec<Node>]) -> Result<Vec<String>> {
        if self.control().silent {
            return Ok(Vec::new());
        }
        let regressed = self.conditioned.load(Ordering::Relaxed);
        let explained = |(_, parents): &(usize, &Vec<Node>)| regressed && !parents.is_empty();
        let effects: Vec<_> = parents.iter().enumerate().filter(explained).collect();
        let of = |(effect, parents): &(usize, &Vec<Node>)| self.test.remark(Node::new(*effect, 0), parents);
        let found: Result<Vec<String>> =
            self.map_tests(&effects, of).into_iter().filter_map(Result::transpose).collect();
        match found {
            // All tests are done: what is missing is words on them.
            Err(error) if self.is_timeout(&error) => Ok(self.caution().into_iter().collect()),
            found => Ok(found?.into_iter().chain(self.caution()).collect()),
        }
    }

    fn caution(&self) -> Option<String> {
        self.test.caution().or_else(|| self.once.as_ref()?.caution())
    }

    /// What the tests took.
    pub(crate) fn effort(&self) -> Option<String> {
        self.test.effort()
    }

    /// Maps `f` over `items`, in parallel if a test is worth a task of its own. Results are in order.
    pub(crate) fn map_tests<I: Sync, T: Send>(
        &self,
        items: &[I],
        f: impl Fn(&I) -> T + Sync + Send,
    ) -> Vec<T> {
        if self.cheap { items.iter().map(f).collect() } else { items.par_iter().map(f).collect() }
    }

    /// Maps `f` over `items` in parallel. Results are in order.
    pub(crate) fn map_targets<I: Sync, T: Send>(
        &self,
        items: &[I],
        f: impl Fn(&I) -> T + Sync + Send,
    ) -> Vec<T> {
        items.par_iter().map(f).collect()
    }

    /// Whether an error means that the time budget is used up, so that the result so far counts.
    pub(crate) fn is_timeout(&self, error: &Error) -> bool {
        self.control().is_timeout(error)
    }
}
