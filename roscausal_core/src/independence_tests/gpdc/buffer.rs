//! Memory that is used again: a likelihood takes a few large arrays per evaluation, and fresh pages from the system cost
//! more than what is written into them.

use std::{
    cell::RefCell,
    ops::{Deref, DerefMut},
};

/// Buffers with more doubles go back to the system at once (2 MB each at 500 samples).
const LARGEST_KEPT: usize = 1 << 20;
/// Buffers that a thread keeps.
const MOST_KEPT: usize = 4;

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
        let mut memory = SPARE.with_borrow_mut(Vec::pop).unwrap_or_default();
        if memory.len() < n {
            memory.resize(n, 0.0);
        }
        Self { memory, n }
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
        if memory.capacity() <= LARGEST_KEPT {
            // A thread that ends has no spare list any more: then the memory is freed.
            let _ = SPARE.try_with(|spare| {
                let mut spare = spare.borrow_mut();
                if spare.len() < MOST_KEPT {
                    spare.push(memory);
                }
            });
        }
    }
}
