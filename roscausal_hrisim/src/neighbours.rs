//! Finds nearby bodies by sorting them into square cells.

use crate::geometry::{Vec2, bounds};

/// Bodies by cell. A cell is as wide as the range, so all neighbours lie in nine cells.
#[derive(Debug)]
pub(crate) struct Neighbours {
    min: Vec2,
    range: f64,
    columns: usize,
    rows: usize,
    /// First entry of each cell in `order`, and the end of the last cell.
    starts: Vec<usize>,
    order: Vec<usize>,
}

/// Most cells. Wider cells only mean that a few more bodies are checked.
const MAX_CELLS: f64 = 10_000.0;

impl Neighbours {
    /// Sorts bodies at `positions` for queries within `range` metres.
    pub(crate) fn new(positions: impl Iterator<Item = Vec2> + Clone, range: f64) -> Self {
        let (min, max) = bounds(positions.clone()).unwrap_or_default();
        let size = max - min;
        let range = range.max((size.x * size.y / MAX_CELLS).sqrt()).max(size.x.max(size.y) / MAX_CELLS);
        let (columns, rows) = ((size.x / range) as usize + 1, (size.y / range) as usize + 1);
        let mut near =
            Self { min, range, columns, rows, starts: vec![0; columns * rows + 1], order: Vec::new() };
        let cells: Vec<usize> = positions.map(|p| near.cell(p)).collect();
        cells.iter().for_each(|cell| near.starts[cell + 1] += 1);
        (0..columns * rows).for_each(|cell| near.starts[cell + 1] += near.starts[cell]);
        let mut next = near.starts.clone();
        near.order = vec![0; cells.len()];
        for (index, cell) in cells.into_iter().enumerate() {
            near.order[next[cell]] = index;
            next[cell] += 1;
        }
        near
    }

    fn cell(&self, p: Vec2) -> usize {
        let column = ((p.x - self.min.x) / self.range) as usize;
        let row = ((p.y - self.min.y) / self.range) as usize;
        row.min(self.rows - 1) * self.columns + column.min(self.columns - 1)
    }

    /// Calls `visit` with every body in the cell of `p` and the eight around it.
    pub(crate) fn each_near(&self, p: Vec2, mut visit: impl FnMut(usize)) {
        let cell = self.cell(p);
        let (column, row) = (cell % self.columns, cell / self.columns);
        for y in row.saturating_sub(1)..=(row + 1).min(self.rows - 1) {
            let from = y * self.columns + column.saturating_sub(1);
            let to = y * self.columns + (column + 1).min(self.columns - 1);
            self.order[self.starts[from]..self.starts[to + 1]].iter().for_each(|&index| visit(index));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    #[test]
    fn everyone_within_range_is_visited_once() {
        let mut rng = Rng::new(1, 0);
        let places: Vec<Vec2> =
            (0..300).map(|_| Vec2::new(rng.uniform(-40.0, 60.0), rng.uniform(0.0, 25.0))).collect();
        let near = Neighbours::new(places.iter().copied(), 10.0);
        for p in &places {
            let mut seen = Vec::new();
            near.each_near(*p, |index| seen.push(index));
            let distinct: std::collections::BTreeSet<_> = seen.iter().copied().collect();
            assert_eq!(distinct.len(), seen.len());
            let within = (0..places.len()).filter(|&index| places[index].distance(*p) <= 10.0);
            within.for_each(|index| assert!(distinct.contains(&index)));
        }
    }

    #[test]
    fn nobody_at_all_is_no_trouble() {
        let near = Neighbours::new(std::iter::empty(), 10.0);
        near.each_near(Vec2::ZERO, |_| unreachable!());
    }
}
