//! Work in a pool of its own, with as many threads as asked for.

use crate::{Error, Result};

/// Runs `work` where everything parallel in it uses `threads` threads; 0: one per core.
///
/// ```
/// # fn main() -> roscausal_core::Result<()> {
/// assert_eq!(roscausal_core::threads::in_pool(2, || Ok(6 * 7))?, 42);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// The work's own; `threads` where the system has no more of them.
pub fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| Error::param("threads", e))?.install(work)
}
