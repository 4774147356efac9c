//! Do the data reach here? The distance of a state to the states that trained an equation.
//!
//! Parents are standardised by the training rows. Distance of two rows: root of the mean squared difference over the columns. `d` is the
//! mean distance to the 5 nearest rows; the limit is twice the `ceil(0.99 n)`-th smallest `d` of the training rows themselves, each
//! without itself. This is positivity, too: a value must have occurred together with a state like the present one.

/// Neighbours that count.
pub const NEIGHBOURS: usize = 5;
/// Most training rows that are kept.
pub(crate) const MOST_ROWS: usize = 1000;
/// Part of the training rows below the limit's half.
const SHARE: f64 = 0.99;
/// Rows that are compared at a time.
const BLOCK: usize = 32;

/// The training rows of one equation, and how far from them is too far.
#[derive(Clone, Debug)]
pub struct Support {
    neighbours: usize,
    n: usize,
    /// Standardised, one run per column; the rows in the order of the first column.
    rows: Vec<f64>,
    scales: Vec<(f64, f64)>,
    /// Smallest and largest value of each column.
    ranges: Vec<(f64, f64)>,
    limit: f64,
}

impl Support {
    /// The support that training rows give, one list of values per column.
    pub fn new(columns: &[Vec<f64>], neighbours: usize) -> Self {
        let n = columns.first().map_or(0, Vec::len);
        let moments = |column: &Vec<f64>| {
            let mean = column.iter().sum::<f64>() / n as f64;
            let deviation = (column.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64).sqrt();
            (mean, if deviation > 0.0 { deviation } else { 1.0 })
        };
        let scales: Vec<(f64, f64)> = columns.iter().map(moments).collect();
        let standard = |(column, (mean, deviation)): (&Vec<f64>, &(f64, f64))| {
            column.iter().map(|v| (v - mean) / deviation).collect::<Vec<f64>>()
        };
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        let range = |column: &Vec<f64>| column.iter().fold(none, |(low, high), &v| (low.min(v), high.max(v)));
        let mut order: Vec<usize> = (0..n).collect();
        if let Some(first) = columns.first() {
            order.sort_by(|&a, &b| first[a].total_cmp(&first[b]));
        }
        let in_order = |column: Vec<f64>| order.iter().map(|&i| column[i]).collect::<Vec<f64>>();
        let rows = columns.iter().zip(&scales).map(standard).flat_map(in_order).collect();
        let ranges = columns.iter().map(range).collect();
        let mut support =
            Self { neighbours: neighbours.max(1), n, rows, scales, ranges, limit: f64::INFINITY };
        support.limit = 2.0 * support.own_distance();
        support
    }

    /// The distance beyond which a state is outside.
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// Smallest and largest value that a column had.
    pub fn range(&self, column: usize) -> Option<(f64, f64)> {
        self.ranges.get(column).copied()
    }

    /// Mean distance to the nearest rows; 0 without columns.
    pub fn distance(&self, place: &[f64]) -> f64 {
        self.search(&self.standard(place), None, usize::MAX)
    }

    /// Whether a state is inside. As soon as enough rows are near, the others are not looked at.
    pub fn holds(&self, place: &[f64]) -> bool {
        let standard = self.standard(place);
        self.has_enough_near(&standard) || self.search(&standard, None, usize::MAX) <= self.limit
    }

    /// Whether so many rows as count are within the limit, so that their mean is, too.
    fn has_enough_near(&self, place: &[f64]) -> bool {
        let near = self.limit * self.limit * place.len() as f64;
        let mut found = 0;
        for (start, least) in self.outward(place) {
            if least > near {
                return false;
            }
            let (squares, length) = self.squares(place, start);
            found += squares[..length].iter().map(|square| usize::from(*square <= near)).sum::<usize>();
            if found >= self.neighbours {
                return true;
            }
        }
        false
    }

    /// The blocks of rows, those with a first column like this place's first: where each starts, and the least square of a row in it
    /// and in all that follow.
    fn outward(&self, place: &[f64]) -> impl Iterator<Item = (usize, f64)> {
        let column = &self.rows[..if place.is_empty() { 0 } else { self.n }];
        let first = place.first().copied().unwrap_or(f64::NAN);
        let alike = column.partition_point(|v| *v < first).min(self.n.saturating_sub(1)) / BLOCK;
        // Blocks to the left of the first, and the one to the right of the last.
        let (mut left, mut right) = (alike, alike);
        let gap = move |at: Option<&f64>| at.map(|v| (v - first) * (v - first));
        std::iter::from_fn(move || {
            let below = left.checked_sub(1).and_then(|block| gap(column.get(block * BLOCK + BLOCK - 1)));
            let above = gap(column.get(right * BLOCK));
            match (below, above) {
                (Some(least), other) if other.is_none_or(|other| least < other && right > alike) => {
                    left -= 1;
                    Some((left * BLOCK, least))
                }
                (_, Some(least)) => {
                    right += 1;
                    Some(((right - 1) * BLOCK, if right == alike + 1 { 0.0 } else { least }))
                }
                (_, None) => None,
            }
        })
    }

    /// Sums of squared differences to a block of rows, and how many these are.
    fn squares(&self, place: &[f64], start: usize) -> ([f64; BLOCK], usize) {
        let length = BLOCK.min(self.n - start);
        let mut squares = [0.0_f64; BLOCK];
        for (column, centre) in self.rows.chunks_exact(self.n).zip(place) {
            let column = &column[start..start + length];
            squares.iter_mut().zip(column).for_each(|(sum, v)| *sum += (v - centre) * (v - centre));
        }
        (squares, length)
    }

    /// Whether a state is known and outside.
    pub(crate) fn is_left(&self, place: &[f64]) -> bool {
        !self.holds(place) && !place.iter().any(|value| value.is_nan())
    }

    /// The column whose value is farthest from what was seen: its number and how many deviations it is beyond the mean.
    pub fn farthest(&self, place: &[f64]) -> Option<usize> {
        let beyond = |k: &usize| {
            let ((low, high), (_, deviation)) = (self.ranges[*k], self.scales[*k]);
            (low - place[*k]).max(place[*k] - high) / deviation
        };
        (0..self.scales.len()).max_by(|a, b| beyond(a).total_cmp(&beyond(b)))
    }

    fn standard(&self, place: &[f64]) -> Vec<f64> {
        place.iter().zip(&self.scales).map(|(v, (mean, deviation))| (v - mean) / deviation).collect()
    }

    /// Mean distance to the nearest rows but `without`; not below it, where only so many `blocks` are looked at.
    fn search(&self, place: &[f64], without: Option<usize>, blocks: usize) -> f64 {
        let columns = place.len();
        let count = self.neighbours.min(self.n.saturating_sub(usize::from(without.is_some())));
        if columns == 0 || count == 0 {
            return 0.0;
        }
        let mut nearest = Least { values: Vec::with_capacity(count + 1), count };
        for (start, least) in self.outward(place).take(blocks) {
            if nearest.full_below(least) {
                break;
            }
            let (squares, length) = self.squares(place, start);
            for (i, &square) in squares[..length].iter().enumerate() {
                if !nearest.full_below(square) && without != Some(start + i) {
                    nearest.insert(square);
                }
            }
        }
        if nearest.values.len() < count {
            return f64::INFINITY;
        }
        nearest.values.iter().map(|square| (square / columns as f64).sqrt()).sum::<f64>() / count as f64
    }

    /// The `ceil(0.99 n)`-th smallest distance of a training row to the others.
    fn own_distance(&self) -> f64 {
        if self.scales.is_empty() || self.n < 2 {
            return f64::INFINITY;
        }
        let place = |i: usize| self.rows.chunks_exact(self.n).map(|column| column[i]).collect::<Vec<f64>>();
        let at_most = |i: usize| (self.search(&place(i), Some(i), 1), i);
        let mut order: Vec<(f64, usize)> = (0..self.n).map(at_most).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        // It is one of the largest: rows that cannot be among them are not searched to the end.
        let smaller = ((SHARE * self.n as f64).ceil() as usize).clamp(1, self.n) - 1;
        let count = self.n - smaller;
        let mut largest = Least { values: Vec::with_capacity(count + 1), count };
        for (at_most, i) in order {
            if largest.full_below(-at_most) {
                break;
            }
            largest.insert(-self.search(&place(i), Some(i), usize::MAX));
        }
        largest.values.last().map_or(f64::INFINITY, |value| -value)
    }
}

/// The least of many values, the largest of them last.
struct Least {
    values: Vec<f64>,
    count: usize,
}

impl Least {
    /// Whether there are as many as wanted, none above `value`.
    fn full_below(&self, value: f64) -> bool {
        self.values.len() == self.count && self.values.last().is_some_and(|last| value >= *last)
    }

    fn insert(&mut self, value: f64) {
        self.values.push(value);
        let mut at = self.values.len() - 1;
        while at > 0 && self.values[at - 1] > value {
            self.values.swap(at - 1, at);
            at -= 1;
        }
        self.values.truncate(self.count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Support {
        let columns: Vec<Vec<f64>> = vec![
            (0..400).map(|i| f64::from(i % 20)).collect(),
            (0..400).map(|i| f64::from(i / 20)).collect(),
        ];
        Support::new(&columns, NEIGHBOURS)
    }

    #[test]
    fn what_was_seen_is_inside_and_what_is_far_is_outside() {
        let support = grid();
        assert!(support.holds(&[3.0, 4.0]) && support.holds(&[19.0, 0.5]));
        assert!(!support.holds(&[40.0, 4.0]) && !support.holds(&[-20.0, 40.0]));
        assert_eq!((support.farthest(&[40.0, 4.0]), support.range(0)), (Some(0), Some((0.0, 19.0))));
    }

    #[test]
    fn what_is_unknown_is_nowhere() {
        let support = grid();
        assert!(support.is_left(&[40.0, 4.0]) && !support.is_left(&[3.0, 4.0]));
        assert!(!support.is_left(&[f64::NAN, 4.0]) && !support.holds(&[f64::NAN, 4.0]));
    }

    #[test]
    fn the_short_way_gives_the_verdict_of_the_distance() {
        let support = grid();
        for i in 0..300 {
            let place = [f64::from(i) * 0.13 - 10.0, f64::from(i % 37) - 8.0];
            assert_eq!(support.holds(&place), support.distance(&place) <= support.limit(), "{place:?}");
        }
    }

    #[test]
    fn the_limit_is_twice_the_share_of_all_own_distances() {
        for (n, columns) in [(7, 1), (40, 2), (333, 3), (1000, 4)] {
            let number = |i: usize| roscausal_discovery::mix(i as u64) as f64 / u64::MAX as f64;
            let columns: Vec<Vec<f64>> =
                (0..columns).map(|k| (0..n).map(|i| number(7 * i + k).powi(3)).collect()).collect();
            let support = Support::new(&columns, NEIGHBOURS);
            let mut own: Vec<f64> = (0..n).map(|i| by_definition(&columns, i)).collect();
            own.sort_by(f64::total_cmp);
            let limit = 2.0 * own[(0.99 * n as f64).ceil() as usize - 1];
            assert!((support.limit() - limit).abs() < 1e-12, "{n}: {} {limit}", support.limit());
        }
    }

    /// The mean distance of a row to the five nearest others.
    fn by_definition(columns: &[Vec<f64>], i: usize) -> f64 {
        let deviation = |column: &Vec<f64>| {
            let mean = column.iter().sum::<f64>() / column.len() as f64;
            (column.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / column.len() as f64).sqrt()
        };
        let square = |j: usize| {
            let part = |column: &Vec<f64>| ((column[i] - column[j]) / deviation(column)).powi(2);
            columns.iter().map(part).sum::<f64>() / columns.len() as f64
        };
        let others = (0..columns[0].len()).filter(|&j| j != i);
        let mut distances: Vec<f64> = others.map(|j| square(j).sqrt()).collect();
        distances.sort_by(f64::total_cmp);
        distances[..NEIGHBOURS].iter().sum::<f64>() / NEIGHBOURS as f64
    }

    #[test]
    fn without_parents_everything_is_inside() {
        assert!(Support::new(&[], NEIGHBOURS).holds(&[]));
    }
}
