//! An analysis on a thread of its own, with a pool of threads of its own: the caller polls Python's signals and reports
//! progress meanwhile. Nothing is global, so a process that forks afterwards, or calls from many threads, is safe.

use std::{
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, Receiver, RecvTimeoutError},
    },
    time::{Duration, Instant},
};

use pyo3::{exceptions::PyRuntimeError, prelude::*};
use roscausal_discovery::{Control, Error, Result, lock};

use crate::errors::raised;

/// Time between two looks at Python's signals.
const LOOK_AGAIN: Duration = Duration::from_millis(50);
/// Time between two reports of progress: ten a second.
const REPORT_AGAIN: Duration = Duration::from_millis(100);

/// What an analysis may take, and who is told of its progress.
pub(crate) struct Means<'py> {
    /// Threads; 0 means all cores.
    pub(crate) threads: usize,
    /// Seconds after which a partial result is returned.
    pub(crate) time_budget: Option<f64>,
    /// Called with (tests done, estimated total) from the caller's thread.
    pub(crate) progress: Option<Bound<'py, PyAny>>,
}

impl Means<'_> {
    /// All cores, for as long as it takes, and nobody is told.
    pub(crate) fn all_cores() -> Self {
        Self { threads: 0, time_budget: None, progress: None }
    }

    /// The control of a run that ends when `cancel` is set or the time is over.
    pub(crate) fn control(&self, cancel: Arc<AtomicBool>) -> Result<Control> {
        let control = Control::default().cancel_on(cancel);
        let Some(budget) = self.time_budget else { return Ok(control) };
        if budget.is_nan() || budget <= 0.0 {
            return Err(Error::param("time_budget", format!("{budget} is not a number of seconds above 0")));
        }
        let start = Instant::now();
        Ok(control.out_of_time(move || start.elapsed().as_secs_f64() > budget))
    }

    fn report(&self, control: &Control) -> PyResult<()> {
        let Some(progress) = &self.progress else { return Ok(()) };
        progress.call1((control.done(), control.estimated_total())).map(drop)
    }
}

/// Runs `work` and returns its result. Ctrl-C, and an exception of the progress callback, cancel it and are raised.
pub(crate) fn watched<T: Send + 'static>(
    py: Python<'_>,
    means: &Means<'_>,
    work: impl FnOnce(&Control) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let cancel = Arc::new(AtomicBool::new(false));
    let control = means.control(cancel.clone()).map_err(raised)?;
    let (threads, of_thread) = (means.threads, control.clone());
    let done = wait(py, &cancel, || means.report(&control), move || in_pool(threads, || work(&of_thread)))?;
    done.map_err(raised)
}

/// Runs `work` in a pool of its own of this many threads, at most as many as cores (0: all cores).
pub(crate) fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.min(cores)).build();
    pool.map_err(|e| Error::param("threads", e))?.install(work)
}

/// Runs `work` on a thread and waits for it, without the GIL. Signals set `cancel`.
pub(crate) fn wait<T: Send + 'static>(
    py: Python<'_>,
    cancel: &AtomicBool,
    report: impl Fn() -> PyResult<()>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let (tell, told) = mpsc::channel();
    let told = Mutex::new(told);
    std::thread::Builder::new().name("roscausal".into()).spawn(move || {
        let _ = tell.send(work());
    })?;
    let mut failure = None;
    let mut reported = Instant::now();
    loop {
        match py.detach(|| next(&told)) {
            Ok(done) => return failure.map_or_else(report, Err).map(|()| done),
            Err(RecvTimeoutError::Timeout) => {
                let mut looked = py.check_signals();
                if looked.is_ok() && failure.is_none() && reported.elapsed() >= REPORT_AGAIN {
                    looked = report();
                    reported = Instant::now();
                }
                if let Err(error) = looked {
                    cancel.store(true, Ordering::Relaxed);
                    failure.get_or_insert(error);
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                let text = "the analysis ended by a fault of roscausal itself; please report it";
                return Err(PyRuntimeError::new_err(text));
            }
        }
    }
}

fn next<T>(told: &Mutex<Receiver<T>>) -> std::result::Result<T, RecvTimeoutError> {
    lock(told).recv_timeout(LOOK_AGAIN)
}
