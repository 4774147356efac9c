//! Memory that goes back to the system.

/// From this size on [bytes], a block goes back to the system as soon as it is freed.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE: i32 = 256 * 1024;

/// Gives large blocks back when they are freed. Left to itself, glibc keeps them for their thread as soon as one was freed: after a fit
/// of three Gaussian processes to 500 rows that was 20 MB, of the 56 MB that the reasoning node took. Elsewhere it does nothing.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code, reason = "mallopt has no safe wrapper; it is called before there is another thread")]
pub(crate) fn give_back_large_blocks() {
    // SAFETY: mallopt takes two numbers, and an unknown one changes nothing.
    unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE) };
}

/// See above.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn give_back_large_blocks() {}
