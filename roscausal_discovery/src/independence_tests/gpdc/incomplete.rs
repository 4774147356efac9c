//! Incomplete Cholesky factorisation of a kernel matrix with pivots in panels.

use faer::{Accum, MatMut, MatRef, Par, linalg::matmul};
use pulp::{Arch, NullaryFnOnce};

use super::{buffer::Buffer, kernel::Inputs, real::Real};

/// Candidates of a panel.
pub(super) const PANEL: usize = 16;
/// A candidate whose remainder falls below this share of the largest one is left for a later panel.
const SHARE_OF_LARGEST: f64 = 0.3;

/// `K = L L' + E` with `E` positive semidefinite, by pivots (Fine and Scheinberg 2001; Harbrecht, Peters and Schneider
/// 2012).
///
/// Pivots come in panels: the largest remainders are the candidates, and of those the largest is taken again and
/// again as long as it has not fallen far below the largest at the panel's start. So most of the work is products of
/// matrices, at a rank a few percent higher than by single pivots. The pivots of another length scale may be given:
/// they are the first candidates, and as good as any where they pass the same test.
pub(super) struct Incomplete<T> {
    n: usize,
    /// `n x r`, columns by pivot, with room for more.
    pub(super) columns: Buffer,
    /// Pivots in their order.
    pub(super) pivots: Vec<u32>,
    /// Diagonal of `E`; minus infinity at the pivots.
    pub(super) remainder: Vec<T>,
    /// Pivots of another factorisation that have not been candidates yet.
    hints: Vec<u32>,
    /// Room for those that may be candidates.
    above: Vec<(T, u32)>,
}

impl<T: Real> Incomplete<T> {
    /// Bytes that `n` samples at rank `r` take at the most.
    pub(super) fn bytes(n: usize, r: usize) -> usize {
        (n * r + 2 * n) * size_of::<T>()
    }

    /// Rank 0, with room for `max_rank`; `hints` are pivots of a similar matrix.
    pub(super) fn new(n: usize, max_rank: usize, hints: &[u32]) -> Self {
        let columns = Buffer::of::<T>((max_rank + PANEL) * n);
        let hints = hints.iter().rev().copied().collect();
        let remainder = vec![T::from_double(1.0); n];
        Self { n, columns, pivots: Vec::with_capacity(max_rank + PANEL), remainder, hints, above: Vec::new() }
    }

    pub(super) fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// `L`, column-major.
    pub(super) fn factor(&self) -> &[T] {
        self.columns.numbers(self.n * self.rank())
    }

    /// Takes more pivots until no remainder exceeds `tolerance`; `None` where the rank exceeds `max_rank`, or is about
    /// to. `max_rank` is at most that of [`Incomplete::new`], and `n` for no limit; `l` is the same on every call.
    pub(super) fn extend(&mut self, inputs: &Inputs, l: f64, tolerance: f64, max_rank: usize) -> Option<()> {
        let n = self.n;
        loop {
            let largest = self.largest();
            if largest <= tolerance {
                return Some(());
            }
            let k = self.rank();
            // Where half of the ranks have not brought half of the digits, all of them will hardly bring the rest.
            let hopeless = |part: f64| largest > libm::pow(tolerance, part * k as f64 / max_rank as f64);
            if max_rank < n
                && (k >= max_rank
                    || k >= max_rank / 2 && k > PANEL && hopeless(1.0)
                    || k >= max_rank / 4 && k > PANEL && hopeless(0.6))
            {
                return None;
            }
            self.take_panel(inputs, l, tolerance, largest);
        }
    }

    /// Takes more pivots until no remainder exceeds `tolerance` or the rank is `rank`, which is at most that of [`Incomplete::new`].
    pub(super) fn extend_to_rank(&mut self, inputs: &Inputs, l: f64, tolerance: f64, rank: usize) {
        while self.rank() < rank.min(self.n) {
            let largest = self.largest();
            if largest <= tolerance {
                return;
            }
            self.take_panel(inputs, l, tolerance, largest);
        }
    }

    fn largest(&self) -> f64 {
        Arch::new().dispatch(Largest(&self.remainder)).double()
    }

    /// Takes the pivots of one panel; `largest` is the largest remainder.
    fn take_panel(&mut self, inputs: &Inputs, l: f64, tolerance: f64, largest: f64) {
        let (n, k, arch) = (self.n, self.rank(), Arch::new());
        let least = tolerance.max(SHARE_OF_LARGEST * largest);
        let (mut candidates, in_order) = self.candidates(least, tolerance);
        let width = candidates.len();
        let (before, panel) = self.columns.numbers_mut::<T>((k + width) * n).split_at_mut(k * n);
        for (column, &pivot) in panel.chunks_exact_mut(n).zip(&candidates) {
            T::column(inputs, l, pivot as usize, 0, column, &mut []);
        }
        if k > 0 {
            let mut rows = Buffer::of::<T>(k * width);
            let rows = rows.numbers_mut::<T>(k * width);
            for (row, &pivot) in rows.chunks_exact_mut(k).zip(&candidates) {
                row.iter_mut()
                    .zip(before.chunks_exact(n))
                    .for_each(|(to, column)| *to = column[pivot as usize]);
            }
            matmul::matmul(
                MatMut::from_column_major_slice_mut(panel, n, width),
                Accum::Add,
                MatRef::from_column_major_slice(before, n, k),
                MatRef::from_column_major_slice(rows, k, width),
                T::from_double(-1.0),
                Par::Seq,
            );
        }
        let mut taken = 0;
        for next in 0..width {
            let best =
                if in_order { next } else { taken + largest_of(&self.remainder, &candidates[taken..]) };
            let pivot = candidates[best] as usize;
            let left = self.remainder[pivot].double();
            if left < least || left <= tolerance {
                if in_order {
                    continue;
                }
                break;
            }
            candidates.swap(taken, best);
            if best > taken {
                let (left, right) = panel.split_at_mut(best * n);
                left[taken * n..(taken + 1) * n].swap_with_slice(&mut right[..n]);
            }
            let (before, now) = panel.split_at_mut(taken * n);
            let diagonal = left.sqrt();
            let (remainder, scale) = (&mut self.remainder[..], T::from_double(1.0 / diagonal));
            arch.dispatch(NextColumn { before, now: &mut now[..n], remainder, pivot, scale });
            now[pivot] = T::from_double(diagonal);
            self.remainder[pivot] = T::NEG_INFINITY;
            self.pivots.push(pivot as u32);
            taken += 1;
        }
    }

    /// Candidates of the next panel, and whether they are to be taken in their order. There is at least one whose
    /// remainder is not below `least`.
    fn candidates(&mut self, least: f64, tolerance: f64) -> (Vec<u32>, bool) {
        // The rank may be low: the first panels are narrow.
        let width = PANEL.min(4 + self.rank());
        let mut candidates = Vec::with_capacity(PANEL);
        while candidates.len() < width
            && let Some(hint) = self.hints.pop()
        {
            if self.remainder[hint as usize].double() >= least {
                candidates.push(hint);
            }
        }
        if !candidates.is_empty() {
            return (candidates, true);
        }
        if self.pivots.is_empty() {
            // All remainders are 1: any sample is as good as any other.
            return (vec![0], true);
        }
        // With their remainders, so that a comparison looks nowhere else. Remainders only fall: what is below `least` now is not taken.
        let may_be_taken = |rest: f64| rest >= least && rest > tolerance;
        self.above.clear();
        self.above.extend(
            (0..)
                .zip(&self.remainder)
                .filter(|(_, rest)| may_be_taken(rest.double()))
                .map(|(i, rest)| (*rest, i)),
        );
        let order = |a: &(T, u32), b: &(T, u32)| b.0.double().total_cmp(&a.0.double()).then(a.1.cmp(&b.1));
        if self.above.len() > width {
            self.above.select_nth_unstable_by(width, order);
            self.above.truncate(width);
        }
        self.above.sort_unstable_by(order);
        candidates.extend(self.above.iter().map(|(_, i)| i));
        (candidates, false)
    }
}

/// Place of the largest remainder among `candidates`, the first of equals.
fn largest_of<T: Real>(remainder: &[T], candidates: &[u32]) -> usize {
    let at = |k: usize| remainder[candidates[k] as usize];
    (1..candidates.len()).fold(0, |best, k| if at(k) > at(best) { k } else { best })
}

/// The largest value.
struct Largest<'a, T>(&'a [T]);

impl<T: Real> NullaryFnOnce for Largest<'_, T> {
    type Output = T;

    #[inline(always)]
    fn call(self) -> T {
        const LANES: usize = 32;
        let mut lanes = [T::NEG_INFINITY; LANES];
        let chunks = self.0.chunks_exact(LANES);
        let rest = chunks.remainder();
        for chunk in chunks {
            for k in 0..LANES {
                lanes[k] = if chunk[k] > lanes[k] { chunk[k] } else { lanes[k] };
            }
        }
        lanes.iter().chain(rest).fold(T::NEG_INFINITY, |a, &b| if b > a { b } else { a })
    }
}

/// Turns `now`, the kernel's column at `pivot`, into the next column of the factor: takes off the products of the
/// columns `before`, scales, and takes its squares off the remainder.
struct NextColumn<'a, T> {
    before: &'a [T],
    now: &'a mut [T],
    remainder: &'a mut [T],
    pivot: usize,
    scale: T,
}

impl<T: Real> NullaryFnOnce for NextColumn<'_, T> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { before, now, remainder, pivot, scale } = self;
        let n = now.len();
        let mut fours = before.chunks_exact(4 * n);
        for four in fours.by_ref() {
            let (a, rest) = four.split_at(n);
            let (b, rest) = rest.split_at(n);
            let (c, d) = rest.split_at(n);
            let (fa, fb, fc, fd) = (a[pivot], b[pivot], c[pivot], d[pivot]);
            for ((((value, a), b), c), d) in now.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                *value = d.mul_add(-fd, c.mul_add(-fc, b.mul_add(-fb, a.mul_add(-fa, *value))));
            }
        }
        for column in fours.remainder().chunks_exact(n) {
            let factor = column[pivot];
            for (value, c) in now.iter_mut().zip(column) {
                *value = c.mul_add(-factor, *value);
            }
        }
        for (value, remainder) in now.iter_mut().zip(remainder) {
            *value *= scale;
            *remainder = value.mul_add(-*value, *remainder);
        }
    }
}
