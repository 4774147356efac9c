//! A global allocator that measures what a decoder allocates.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
};

thread_local! {
    static LIVE: Cell<usize> = const { Cell::new(0) };
    static PEAK: Cell<usize> = const { Cell::new(0) };
}

/// The system allocator, which also records the most bytes that the calling thread has held.
#[derive(Debug)]
pub struct Allocator;

fn grow(bytes: usize) {
    // A thread that is ending has no cells any more. What it allocates then does not matter.
    let _ = LIVE.try_with(|live| {
        live.set(live.get().wrapping_add(bytes));
        let _ = PEAK.try_with(|peak| peak.set(peak.get().max(live.get())));
    });
}

fn shrink(bytes: usize) {
    let _ = LIVE.try_with(|live| live.set(live.get().saturating_sub(bytes)));
}

// An allocator needs unsafe code. Every call goes to the system allocator with unchanged arguments.
#[allow(unsafe_code, reason = "GlobalAlloc is an unsafe trait; each method forwards its arguments unchanged")]
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        shrink(layout.size());
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        shrink(layout.size());
        grow(size);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// Does `work`. Returns its result, and the most bytes that this thread held for it at a time; 0 unless [`Allocator`] is the global
/// allocator.
pub fn peak_of<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let before = begin();
    let done = work();
    (done, peak().saturating_sub(before))
}

/// Starts to measure. Returns what the thread holds now.
pub(crate) fn begin() -> usize {
    let live = LIVE.with(Cell::get);
    PEAK.with(|peak| peak.set(live));
    live
}

/// The most that the thread has held since the start.
pub(crate) fn peak() -> usize {
    PEAK.with(Cell::get)
}
