//! Memory that goes back to the system.

/// Gives blocks of 256 KiB and more back to the system as soon as they are freed. Left to itself, glibc keeps them for their thread as
/// soon as one was freed: after a fit of three Gaussian processes to 500 rows that was 20 MB, of the 56 MB that the reasoning node took.
/// With another C library it does nothing.
#[allow(unsafe_code, reason = "mallopt has no safe wrapper; it is called before there is another thread")]
pub(crate) fn give_back_large_blocks() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: mallopt takes two numbers, and an unknown one changes nothing.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, 256 * 1024)
    };
}
