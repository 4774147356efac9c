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
const BLOCK: usize = 64;

/// The training rows of one equation, and how far from them is too far.
#[derive(Clone, Debug)]
pub struct Support {
    neighbours: usize,
    n: usize,
    /// Standardised, one run per column.
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
        let range = |column: &Vec<f64>| {
            column
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
        };
        let rows = columns.iter().zip(&scales).flat_map(standard).collect();
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
        self.search(&self.standard(place), None, None)
    }

    /// Whether a state is inside. As soon as enough rows are near, the others are not looked at.
    pub fn holds(&self, place: &[f64]) -> bool {
        let standard = self.standard(place);
        self.search(&standard, None, Some(self.limit)) <= self.limit
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

    /// Mean distance to the nearest rows but `without`. With `enough`: at most that as soon as so many rows are within it.
    fn search(&self, place: &[f64], without: Option<usize>, enough: Option<f64>) -> f64 {
        let columns = place.len();
        let count = self.neighbours.min(self.n.saturating_sub(usize::from(without.is_some())));
        if columns == 0 || count == 0 {
            return 0.0;
        }
        let near = enough.map_or(-1.0, |limit| limit * limit * columns as f64);
        // The squares of the nearest, the largest last.
        let mut nearest: Vec<f64> = Vec::with_capacity(count + 1);
        for start in (0..self.n).step_by(BLOCK) {
            let length = BLOCK.min(self.n - start);
            let mut squares = [0.0_f64; BLOCK];
            for (column, centre) in self.rows.chunks_exact(self.n).zip(place) {
                let column = &column[start..start + length];
                squares.iter_mut().zip(column).for_each(|(sum, v)| *sum += (v - centre) * (v - centre));
            }
            for (i, &square) in squares[..length].iter().enumerate() {
                let full = nearest.len() == count;
                if (full && square >= nearest[count - 1]) || without == Some(start + i) {
                    continue;
                }
                let at = nearest.partition_point(|other| *other <= square);
                nearest.insert(at, square);
                nearest.truncate(count);
            }
            if nearest.len() == count && nearest[count - 1] <= near {
                break;
            }
        }
        nearest.iter().map(|square| (square / columns as f64).sqrt()).sum::<f64>() / nearest.len() as f64
    }

    /// The `ceil(0.99 n)`-th smallest distance of a training row to the others.
    fn own_distance(&self) -> f64 {
        if self.scales.is_empty() || self.n < 2 {
            return f64::INFINITY;
        }
        let place = |i: usize| self.rows.chunks_exact(self.n).map(|column| column[i]).collect::<Vec<f64>>();
        let mut own: Vec<f64> = (0..self.n).map(|i| self.search(&place(i), Some(i), None)).collect();
        own.sort_by(f64::total_cmp);
        own[((SHARE * self.n as f64).ceil() as usize).clamp(1, self.n) - 1]
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
    fn without_parents_everything_is_inside() {
        assert!(Support::new(&[], NEIGHBOURS).holds(&[]));
    }
}
