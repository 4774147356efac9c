//! A library of others that panics on a damaged file gives an error instead.
//!
//! The readers of Parquet and Arrow panic on some files, such as a page whose dictionary is not there. No library turns a panic
//! into an error without printing it, so this does.

use std::{
    any::Any,
    cell::Cell,
    panic::{self, AssertUnwindSafe},
    sync::Once,
};

thread_local! {
    /// A panic of this thread is expected.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// What `read` returns.
///
/// # Errors
/// The message of its panic.
pub(super) fn guarded<T>(read: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    static SILENCE: Once = Once::new();
    SILENCE.call_once(|| {
        let ordinary = panic::take_hook();
        panic::set_hook(Box::new(move |reported| {
            if !GUARDED.get() {
                ordinary(reported);
            }
        }));
    });
    let outer = GUARDED.replace(true);
    let outcome = panic::catch_unwind(AssertUnwindSafe(read));
    GUARDED.set(outer);
    outcome.unwrap_or_else(|payload| Err(message(payload.as_ref())))
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied().map(str::to_owned);
    text.or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "it cannot be decoded".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_and_an_answer_stays() {
        let reported = guarded::<()>(|| panic!("no page {}", 3));
        assert_eq!(reported, Err("no page 3".into()));
        assert_eq!(guarded(|| Ok(7)), Ok(7));
        assert!(!GUARDED.get());
    }
}
