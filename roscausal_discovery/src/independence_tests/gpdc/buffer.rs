//! Memory that is used again: a likelihood takes several arrays per evaluation, and fresh pages from the system cost
//! more than what is written into them.

use std::{
    cell::RefCell,
    ops::{Deref, DerefMut},
};

/// Buffers with more doubles (32 MB) go back to the system at once: above 10,000 samples memory is dearer than time.
const LARGEST_KEPT: usize = 4 << 20;
/// Doubles that a thread keeps (72 MB): those of a likelihood on 5000 samples.
const MOST_KEPT: usize = 9 << 20;
/// Buffers that a thread keeps.
const MOST_BUFFERS: usize = 16;
/// Lengths are rounded up to multiples of this, so that similar arrays share memory.
const GRAIN: usize = 512;

thread_local! {
    static SPARE: RefCell<Vec<Vec<f64>>> = const { RefCell::new(Vec::new()) };
}

/// An array of doubles whose memory returns to its thread when dropped.
pub(super) struct Buffer {
    memory: Vec<f64>,
    n: usize,
}

impl Buffer {
    /// An array of `n` doubles with any content.
    pub(super) fn any(n: usize) -> Self {
        let fitting = SPARE.with_borrow_mut(|spare| {
            let fits = spare.iter().enumerate().filter(|(_, memory)| memory.len() >= n);
            let best = fits.min_by_key(|(_, memory)| memory.len()).map(|(k, _)| k);
            if best.is_none() && n > LARGEST_KEPT {
                // What is spare would come on top.
                spare.clear();
            }
            best.map(|k| spare.swap_remove(k))
        });
        Self { memory: fitting.unwrap_or_else(|| vec![0.0; n.next_multiple_of(GRAIN)]), n }
    }

    /// Memory for `n` numbers of any precision, with any content.
    pub(super) fn of<T>(n: usize) -> Self {
        Self::any((n * size_of::<T>()).div_ceil(size_of::<f64>()))
    }

    /// The first `n` numbers of a precision.
    pub(super) fn numbers<T: bytemuck::Pod>(&self, n: usize) -> &[T] {
        &bytemuck::cast_slice(&self[..])[..n]
    }

    /// The same to write.
    pub(super) fn numbers_mut<T: bytemuck::Pod>(&mut self, n: usize) -> &mut [T] {
        &mut bytemuck::cast_slice_mut(&mut self[..])[..n]
    }

    /// An array of `n` zeros.
    pub(super) fn zeros(n: usize) -> Self {
        let mut buffer = Self::any(n);
        buffer.fill(0.0);
        buffer
    }
}

impl Deref for Buffer {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        &self.memory[..self.n]
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.memory[..self.n]
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let memory = std::mem::take(&mut self.memory);
        // A thread that ends has no spare list any more: then the memory is freed.
        let _ = SPARE.try_with(|spare| {
            let mut spare = spare.borrow_mut();
            let kept: usize = spare.iter().map(Vec::len).sum();
            if memory.len() > LARGEST_KEPT || kept + memory.len() > MOST_KEPT {
                return;
            }
            spare.push(memory);
            if spare.len() > MOST_BUFFERS {
                // The smallest is the cheapest to make again.
                let smallest = (0..spare.len()).min_by_key(|&k| spare[k].len());
                smallest.map(|k| spare.swap_remove(k));
            }
        });
    }
}
