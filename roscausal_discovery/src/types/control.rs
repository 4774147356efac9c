//! Control of a running analysis: progress, time budget, cancellation.

use std::{
    fmt,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
};

use super::{
    error::{Error, Result},
    lock::lock,
};

/// How far a run has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Tests done so far.
    pub done: usize,
    /// Estimate of the tests that the whole run takes. It changes while PC1 removes links.
    pub estimated_total: usize,
}

/// Why a run stopped before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The time budget is used up. The run returns what it has, with a partial status.
    OutOfTime,
    /// The caller cancelled. The run ends with [`Error::Cancelled`].
    Cancelled,
}

type OnProgress = Arc<dyn Fn(Progress) + Send + Sync>;
type OutOfTime = Arc<dyn Fn() -> bool + Send + Sync>;

/// The caller's control of a run: progress, time budget, cancellation. Clones share one state.
///
/// The crate knows no clock: the time budget is a closure that says whether the time is up. Budget and cancellation are
/// looked at before each test, and inside tests that take long.
///
/// ```
/// use std::time::{Duration, Instant};
/// use roscausal_discovery::Control;
///
/// let start = Instant::now();
/// let control = Control::default()
///     .on_progress(|progress| eprintln!("{} of about {} tests", progress.done, progress.estimated_total))
///     .out_of_time(move || start.elapsed() > Duration::from_secs(60));
/// assert!(control.check().is_ok());
/// ```
#[derive(Clone, Default)]
pub struct Control {
    on_progress: Option<OnProgress>,
    out_of_time: Option<OutOfTime>,
    cancel: Option<Arc<AtomicBool>>,
    /// Whether nobody reads words on what is found.
    pub(crate) silent: bool,
    state: Arc<State>,
}

#[derive(Default)]
struct State {
    done: AtomicUsize,
    estimated_total: AtomicUsize,
    out_of_time: AtomicBool,
    effort: Mutex<Option<String>>,
}

impl Control {
    /// Adds a callback that runs after each test, on the thread that ran the test.
    #[must_use]
    pub fn on_progress(mut self, f: impl Fn(Progress) + Send + Sync + 'static) -> Self {
        self.on_progress = Some(Arc::new(f));
        self
    }

    /// Adds a time budget: `f` says whether the time is up.
    #[must_use]
    pub fn out_of_time(mut self, f: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        self.out_of_time = Some(Arc::new(f));
        self
    }

    /// Adds a flag that cancels the run when it becomes true.
    #[must_use]
    pub fn cancel_on(mut self, flag: Arc<AtomicBool>) -> Self {
        self.cancel = Some(flag);
        self
    }

    /// The reason to stop now, if there is one.
    pub fn stop(&self) -> Option<Stop> {
        if self.cancel.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            return Some(Stop::Cancelled);
        }
        if self.state.out_of_time.load(Ordering::Relaxed) {
            return Some(Stop::OutOfTime);
        }
        if self.out_of_time.as_ref().is_some_and(|f| f()) {
            self.state.out_of_time.store(true, Ordering::Relaxed);
            return Some(Stop::OutOfTime);
        }
        None
    }

    /// Fails if the run has to stop.
    ///
    /// # Errors
    /// [`Error::Cancelled`], for both reasons; [`Control::stop`] tells them apart.
    pub fn check(&self) -> Result<()> {
        match self.stop() {
            None => Ok(()),
            Some(Stop::OutOfTime) => Err(Error::Cancelled("the time budget is used up".into())),
            Some(Stop::Cancelled) => Err(Error::Cancelled("the caller cancelled the run".into())),
        }
    }

    /// Whether an error means that the time budget is used up, so that the result so far counts.
    pub fn is_timeout(&self, error: &Error) -> bool {
        matches!(error, Error::Cancelled(_)) && self.stop() == Some(Stop::OutOfTime)
    }

    /// Fails if the caller cancelled the run. For what comes before the first test and takes no time of its own to speak of: a run
    /// whose time is up still says how far it came.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub(crate) fn check_cancelled(&self) -> Result<()> {
        if let Some(Stop::Cancelled) = self.stop() { self.check() } else { Ok(()) }
    }

    /// The same time budget and cancellation, with a count of its own that nobody is told, and without words on what is found.
    pub(crate) fn silent(&self) -> Self {
        Self { on_progress: None, state: Arc::default(), silent: true, ..self.clone() }
    }

    /// Tests done so far by all runs under this control.
    pub fn done(&self) -> usize {
        self.state.done.load(Ordering::Relaxed)
    }

    /// Estimate of the tests that all runs under this control will have done.
    pub fn estimated_total(&self) -> usize {
        self.state.estimated_total.load(Ordering::Relaxed).max(self.done())
    }

    /// What the tests of the last run took, in a sentence, where they tell.
    pub fn effort(&self) -> Option<String> {
        lock(&self.state.effort).clone()
    }

    /// Keeps what the tests of a run took.
    pub(crate) fn tell(&self, effort: Option<&str>) {
        *lock(&self.state.effort) = effort.map(str::to_owned);
    }

    /// Adds `n` tests to the estimated total.
    pub(crate) fn expect_tests(&self, n: usize) {
        self.state.estimated_total.fetch_add(n, Ordering::Relaxed);
    }

    /// Counts `n` tests as done and reports the progress.
    pub(crate) fn count(&self, n: usize) {
        let done = self.state.done.fetch_add(n, Ordering::Relaxed) + n;
        if let Some(f) = &self.on_progress {
            f(Progress { done, estimated_total: self.estimated_total() });
        }
    }
}

impl fmt::Debug for Control {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Control").field("done", &self.done()).finish_non_exhaustive()
    }
}
