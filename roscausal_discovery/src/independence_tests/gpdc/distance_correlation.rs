//! Distance correlation (Székely, Rizzo and Bakirov 2007), the biased V-statistic, in `O(n log n)`.
//!
//! The double sum of `|x_i - x_j| |y_i - y_j|` needs only the pairs that are concordant: `(x_i - x_j)(y_i - y_j)`
//! sums over all pairs to `n sum(xy) - sum(x) sum(y)`, and the discordant pairs are the rest with their sign
//! turned. A merge sort by y of the samples in the order of x meets each concordant pair once (after Chaudhuri and
//! Hu 2019). For ranks the arithmetic is in integers, so the value has no rounding before its last three
//! operations; ties need no special case, because their products vanish.

/// Ranks `1..=n` of finite `values`; ties take the largest rank.
pub(super) fn ranks(values: &[f64]) -> Vec<u32> {
    let mut order: Vec<(f64, u32)> = values.iter().zip(0..).map(|(&value, i)| (value, i)).collect();
    order.sort_unstable_by(|a, b| a.0.partial_cmp(&b.0).unwrap_or(std::cmp::Ordering::Equal));
    let mut ranks = vec![0; values.len()];
    let mut rank = values.len();
    for k in (0..order.len()).rev() {
        if k + 1 < order.len() && order[k].0 != order[k + 1].0 {
            rank = k + 1;
        }
        ranks[order[k].1 as usize] = rank as u32;
    }
    ranks
}

/// Distance correlation of two series of ranks in `1..=n`, in `[0, 1]`; 0 where one of them is constant.
pub(super) fn of_ranks(x: &[u32], y: &[u32]) -> f64 {
    let n = x.len();
    // Counting sort by x.
    let mut starts = vec![0u32; n + 2];
    x.iter().for_each(|&rank| starts[rank as usize + 1] += 1);
    (1..starts.len()).for_each(|k| starts[k] += starts[k - 1]);
    let mut pairs = vec![(0, 0); n];
    for (&x, &y) in x.iter().zip(y) {
        let place = &mut starts[x as usize];
        pairs[*place as usize] = (x, y);
        *place += 1;
    }
    of_sorted(&mut pairs, &mut Vec::new())
}

/// Distance correlation of pairs of ranks that are sorted by the first; leaves them sorted by the second. `space` is
/// reused memory.
pub(super) fn of_sorted(pairs: &mut [(u32, u32)], space: &mut Vec<(u32, u32)>) -> f64 {
    let n = pairs.len() as i128;
    let distances_x = row_sums(pairs.iter().map(|pair| pair.0), pairs.len());
    let (mut sum_x, mut sum_y, mut sum_xy) = (0, 0, 0);
    for &(x, y) in &*pairs {
        let (x, y) = (u64::from(x), u64::from(y));
        sum_x += x;
        sum_y += y;
        sum_xy += x * y;
    }
    let concordant = sort_by_second(pairs, space);
    let distances_y = row_sums(pairs.iter().map(|pair| pair.1), pairs.len());
    let mut rows = Rows::default();
    for &(x, y) in &*pairs {
        rows.add(distances_x[x as usize], distances_y[y as usize]);
    }
    let rows = rows.sums();
    let products = 2 * (2 * concordant - (n * i128::from(sum_xy) - i128::from(sum_x) * i128::from(sum_y)));
    let covariance = n * n * products - 2 * n * rows.xy + rows.x * rows.y;
    let squares = |of: &dyn Fn(&(u32, u32)) -> u32| {
        let (mut sum, mut sum_of_squares) = (0, 0);
        for pair in &*pairs {
            let value = u64::from(of(pair));
            sum += value;
            sum_of_squares += value * value;
        }
        2 * (n * i128::from(sum_of_squares) - i128::from(sum) * i128::from(sum))
    };
    let variance_x = n * n * squares(&|pair| pair.0) - 2 * n * rows.xx + rows.x * rows.x;
    let variance_y = n * n * squares(&|pair| pair.1) - 2 * n * rows.yy + rows.y * rows.y;
    from_sums(covariance, variance_x, variance_y)
}

/// Distance correlation from the sums of products of the doubly centred distances.
fn from_sums(covariance: i128, variance_x: i128, variance_y: i128) -> f64 {
    let scale = (variance_x as f64).sqrt() * (variance_y as f64).sqrt();
    if scale > 0.0 && covariance > 0 { (covariance as f64 / scale).sqrt().min(1.0) } else { 0.0 }
}

/// Sums over the samples of the row sums of both distance matrices.
#[derive(Default)]
struct Sums {
    x: i128,
    y: i128,
    xx: i128,
    xy: i128,
    yy: i128,
}

/// The same in words of the machine, where a row sum is below 2^31 and its square below 2^62.
#[derive(Default)]
struct Rows {
    sums: Sums,
    x: i64,
    y: i64,
    xx: u64,
    xy: u64,
    yy: u64,
}

impl Rows {
    fn add(&mut self, x: i64, y: i64) {
        const SMALL: i64 = 1 << 31;
        if x >= SMALL || y >= SMALL {
            let (x, y) = (i128::from(x), i128::from(y));
            self.sums.x += x;
            self.sums.y += y;
            self.sums.xx += x * x;
            self.sums.xy += x * y;
            self.sums.yy += y * y;
            return;
        }
        self.x += x;
        self.y += y;
        let (x, y) = (x as u64, y as u64);
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        if (self.xx | self.xy | self.yy) >= 1 << 62 {
            self.carry();
        }
    }

    fn carry(&mut self) {
        self.sums.x += i128::from(std::mem::take(&mut self.x));
        self.sums.y += i128::from(std::mem::take(&mut self.y));
        self.sums.xx += i128::from(std::mem::take(&mut self.xx));
        self.sums.xy += i128::from(std::mem::take(&mut self.xy));
        self.sums.yy += i128::from(std::mem::take(&mut self.yy));
    }

    fn sums(mut self) -> Sums {
        self.carry();
        self.sums
    }
}

/// For each rank that occurs in the sorted `ranks`: the sum of its distances to all of them.
fn row_sums(ranks: impl Iterator<Item = u32> + Clone, n: usize) -> Vec<i64> {
    let sum: i64 = ranks.clone().map(i64::from).sum();
    let mut sums = vec![0; n + 1];
    let mut before = 0;
    for (k, rank) in ranks.enumerate() {
        let value = i64::from(rank);
        sums[rank as usize] = value * (2 * k as i64 - n as i64) + sum - 2 * before;
        before += value;
    }
    sums
}

/// Merge sort by the second rank; returns the sum over the pairs of samples that are in order in both ranks of
/// `(x_j - x_i) (y_j - y_i)`.
fn sort_by_second(pairs: &mut [(u32, u32)], space: &mut Vec<(u32, u32)>) -> i128 {
    /// Runs of this length are sorted by insertion, pair by pair.
    const RUN: usize = 16;
    let n = pairs.len();
    space.clear();
    space.resize(n, (0, 0));
    let mut concordant = 0;
    for run in pairs.chunks_mut(RUN) {
        let mut sum = 0;
        for j in 1..run.len() {
            let (x, y) = run[j];
            for &(before_x, before_y) in &run[..j] {
                sum += u64::from(x - before_x) * u64::from(y.saturating_sub(before_y));
            }
        }
        concordant += i128::from(sum);
        for j in 1..run.len() {
            let now = run[j];
            let mut k = j;
            while k > 0 && run[k - 1].1 > now.1 {
                run[k] = run[k - 1];
                k -= 1;
            }
            run[k] = now;
        }
    }
    let (mut from, mut to): (&mut [_], &mut [_]) = (pairs, space);
    let mut width = RUN;
    let mut swapped = false;
    while width < n {
        for (source, target) in from.chunks(2 * width).zip(to.chunks_mut(2 * width)) {
            concordant += merge(source, width.min(source.len()), target, n);
        }
        std::mem::swap(&mut from, &mut to);
        swapped = !swapped;
        width *= 2;
    }
    if swapped {
        to.copy_from_slice(from);
    }
    concordant
}

/// Merges the sorted halves of `source`, split at `middle`, into `target`; returns the sum over the concordant
/// pairs between the halves. Ranks are at most `n`.
fn merge(source: &[(u32, u32)], middle: usize, target: &mut [(u32, u32)], n: usize) -> i128 {
    let (left, right) = source.split_at(middle);
    // One sum of a row stays below n^3, so n may be 2 million; so many of them stay below 2^62.
    let n = n.max(1) as u128;
    let at_once = ((1 << 62) / (n * n * n)).clamp(1, 1 << 20) as usize;
    let (mut concordant, mut sum_x, mut sum_y, mut sum_xy) = (0i128, 0i64, 0i64, 0i64);
    let (mut i, mut j) = (0, 0);
    for places in target.chunks_mut(at_once) {
        let mut some = 0i64;
        for place in places {
            // Which half is next is a coin's toss to the processor: no branch depends on it.
            let (from_left, from_right) = (left.get(i), right.get(j));
            let next_left = from_left.map_or(u64::MAX, |pair| u64::from(pair.1));
            let next_right = from_right.map_or(u64::MAX, |pair| u64::from(pair.1));
            let is_left = next_left <= next_right;
            let pair = if is_left { from_left } else { from_right };
            *place = pair.copied().unwrap_or_default();
            let (x, y) = (i64::from(place.0), i64::from(place.1));
            let (of_left, of_right) = (-i64::from(is_left), i64::from(is_left) - 1);
            some += of_right & (i as i64 * x * y - x * sum_y - y * sum_x + sum_xy);
            sum_x += of_left & x;
            sum_y += of_left & y;
            sum_xy += of_left & (x * y);
            i += usize::from(is_left);
            j += usize::from(!is_left);
        }
        concordant += i128::from(some);
    }
    concordant
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The definition: doubly centred distance matrices.
    fn by_definition(x: &[f64], y: &[f64]) -> f64 {
        let n = x.len();
        let centred = |v: &[f64]| {
            let d = |i: usize, j: usize| (v[i] - v[j]).abs();
            let rows: Vec<f64> = (0..n).map(|i| (0..n).map(|j| d(i, j)).sum::<f64>() / n as f64).collect();
            let all = rows.iter().sum::<f64>() / n as f64;
            let mut out = vec![0.0; n * n];
            (0..n).for_each(|i| (0..n).for_each(|j| out[i * n + j] = d(i, j) - rows[i] - rows[j] + all));
            out
        };
        let (a, b) = (centred(x), centred(y));
        let mean = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let scale = (mean(&a, &a) * mean(&b, &b)).sqrt();
        if scale > 0.0 { (mean(&a, &b).max(0.0) / scale).sqrt() } else { 0.0 }
    }

    #[test]
    fn ties_take_the_largest_rank() {
        assert_eq!(ranks(&[0.5, -1.0, 0.5, 3.0, 0.0, -0.0]), [5, 1, 5, 6, 3, 3]);
    }

    #[test]
    fn a_constant_series_has_correlation_zero() {
        assert_eq!(of_ranks(&[3, 3, 3], &[1, 2, 3]), 0.0);
        assert_eq!(of_ranks(&[1], &[1]), 0.0);
        assert_eq!(of_ranks(&[], &[]), 0.0);
    }

    #[test]
    fn a_series_has_correlation_one_with_itself() {
        let x: Vec<u32> = (1..=40).collect();
        assert!((of_ranks(&x, &x) - 1.0).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn the_fast_sum_equals_the_definition(
            pairs in prop::collection::vec((-20i32..20, -20i32..20), 2..120),
        ) {
            let (x, y): (Vec<f64>, Vec<f64>) =
                pairs.iter().map(|&(x, y)| (f64::from(x) / 7.0, f64::from(y * y) / 3.0)).unzip();
            let (x, y) = (ranks(&x), ranks(&y));
            let double = |v: &[u32]| v.iter().map(|&v| f64::from(v)).collect::<Vec<_>>();
            let expected = by_definition(&double(&x), &double(&y));
            prop_assert!((of_ranks(&x, &y) - expected).abs() < 1e-7);
            prop_assert!((of_ranks(&x, &y).powi(2) - expected.powi(2)).abs() < 1e-13);
        }
    }
}
