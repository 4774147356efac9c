//! The order within each column, with few crossings: sweeps by barycentre (Sugiyama, Tagawa and Toda 1981).

/// Sweeps there and back.
const SWEEPS: usize = 10;

/// Sorts each column so that arrows between neighbouring columns cross little. `left` and `right` are the neighbours of
/// each item in the column before and after it.
pub(super) fn order(columns: &mut Vec<Vec<usize>>, left: &[Vec<usize>], right: &[Vec<usize>]) {
    let mut place = vec![0.0; left.len()];
    columns.iter().for_each(|column| number(column, &mut place));
    let mut best = (crossings(columns, right, &place), columns.clone());
    for _ in 0..SWEEPS {
        columns.iter_mut().for_each(|column| sort(column, left, &mut place));
        columns.iter_mut().rev().for_each(|column| sort(column, right, &mut place));
        let now = crossings(columns, right, &place);
        if now < best.0 {
            best = (now, columns.clone());
        }
    }
    *columns = best.1;
}

fn number(column: &[usize], place: &mut [f64]) {
    column.iter().enumerate().for_each(|(at, &item)| place[item] = at as f64);
}

/// By the mean place of the neighbours; who has none keeps the own place.
fn sort(column: &mut [usize], neighbours: &[Vec<usize>], place: &mut [f64]) {
    let mean = |item: usize| {
        let near = &neighbours[item];
        let sum: f64 = near.iter().map(|&other| place[other]).sum();
        if near.is_empty() { place[item] } else { sum / near.len() as f64 }
    };
    let mut keyed: Vec<(f64, usize)> = column.iter().map(|&item| (mean(item), item)).collect();
    keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
    column.iter_mut().zip(keyed).for_each(|(slot, (_, item))| *slot = item);
    number(column, place);
}

/// Crossings of arrows between neighbouring columns, counted by a Fenwick tree (Barth, Mutzel and Jünger 2004).
fn crossings(columns: &[Vec<usize>], right: &[Vec<usize>], place: &[f64]) -> usize {
    let between = |pair: &[Vec<usize>]| {
        let mut tree = vec![0_usize; pair[1].len() + 1];
        let (mut seen, mut count) = (0, 0);
        for &item in &pair[0] {
            let mut ends: Vec<usize> = right[item].iter().map(|&end| place[end] as usize).collect();
            ends.sort_unstable();
            for &end in &ends {
                // Arrows seen so far that end above or at this one do not cross it.
                let (mut at, mut below) = (end + 1, 0);
                while at > 0 {
                    below += tree[at];
                    at &= at - 1;
                }
                count += seen - below;
            }
            for end in ends {
                let mut at = end + 1;
                while at < tree.len() {
                    tree[at] += 1;
                    at += at & at.wrapping_neg();
                }
                seen += 1;
            }
        }
        count
    };
    columns.windows(2).map(between).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crossing_that_need_not_be_is_gone() {
        // 0 -> 3, 1 -> 2, with 2 above 3.
        let mut columns = vec![vec![0, 1], vec![2, 3]];
        let (left, right) = ([vec![], vec![], vec![1], vec![0]], [vec![3], vec![2], vec![], vec![]]);
        let place = [0.0, 1.0, 0.0, 1.0];
        assert_eq!(crossings(&columns, &right, &place), 1);
        order(&mut columns, &left, &right);
        let mut after = vec![0.0; 4];
        columns.iter().for_each(|column| number(column, &mut after));
        assert_eq!(crossings(&columns, &right, &after), 0);
    }
}
