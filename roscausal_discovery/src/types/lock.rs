//! Locking where a panic elsewhere must not spread.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks. A panic of another holder is ignored: its data is used as it is.
///
/// ```
/// let number = std::sync::Mutex::new(1);
/// *roscausal_discovery::lock(&number) += 1;
/// assert_eq!(*roscausal_discovery::lock(&number), 2);
/// ```
pub fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
