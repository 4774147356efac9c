//! Heights within each column: every item as near to its neighbours as the others allow.
//!
//! Within a column the order is fixed and each pair has a least distance. The heights that are nearest to what the
//! neighbours pull at, in least squares, come from isotonic regression by pooling adjacent violators (Ayer and others
//! 1955). Sweeps over the columns repeat this.

/// Sweeps there and back.
const SWEEPS: usize = 12;

/// How far an item reaches up and down from its height, and how strongly its arrows are kept straight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) up: f64,
    pub(super) down: f64,
    /// Large for the slots of long arrows.
    pub(super) straight: f64,
}

/// The height of each item. `near` are the neighbours of each item, in both columns beside its own.
pub(super) fn heights(columns: &[Vec<usize>], items: &[Extent], near: &[Vec<usize>], gap: f64) -> Vec<f64> {
    let mut y = vec![0.0; items.len()];
    // Packed, and centred on the tallest column.
    for column in columns {
        let steps = steps(column, items, gap);
        let middle = steps.last().copied().unwrap_or(0.0) / 2.0;
        column.iter().zip(&steps).for_each(|(&item, step)| y[item] = step - middle);
    }
    for sweep in 0..2 * SWEEPS {
        let settle = |column: &Vec<usize>, y: &mut Vec<f64>| {
            let (pull, weight): (Vec<f64>, Vec<f64>) =
                column.iter().map(|&item| pulled(item, items, near, y)).unzip();
            let steps = steps(column, items, gap);
            let free: Vec<f64> = pull.iter().zip(&steps).map(|(pull, step)| pull - step).collect();
            let fitted = isotonic(&free, &weight);
            column.iter().zip(fitted).zip(&steps).for_each(|((&item, fit), step)| y[item] = fit + step);
        };
        if sweep % 2 == 0 {
            columns.iter().for_each(|column| settle(column, &mut y));
        } else {
            columns.iter().rev().for_each(|column| settle(column, &mut y));
        }
    }
    y
}

/// Least heights above the first item of the column.
fn steps(column: &[usize], items: &[Extent], gap: f64) -> Vec<f64> {
    let mut at = 0.0;
    let mut steps = Vec::with_capacity(column.len());
    for (place, &item) in column.iter().enumerate() {
        if place > 0 {
            at += items[column[place - 1]].down + gap + items[item].up;
        }
        steps.push(at);
    }
    steps
}

/// Where the neighbours of an item pull it, and how strongly.
fn pulled(item: usize, items: &[Extent], near: &[Vec<usize>], y: &[f64]) -> (f64, f64) {
    let (mut sum, mut weight) = (0.0, 0.0);
    for &other in &near[item] {
        let w = items[item].straight * items[other].straight;
        sum += w * y[other];
        weight += w;
    }
    if weight > 0.0 { (sum / weight, weight) } else { (y[item], 0.1) }
}

/// The rising values nearest to `values` in weighted least squares.
fn isotonic(values: &[f64], weights: &[f64]) -> Vec<f64> {
    // Blocks of equal value: value, weight, length.
    let mut blocks: Vec<(f64, f64, usize)> = Vec::with_capacity(values.len());
    for (&value, &weight) in values.iter().zip(weights) {
        blocks.push((value, weight, 1));
        while let [.., before, last] = blocks[..] {
            if before.0 <= last.0 {
                break;
            }
            let weight = before.1 + last.1;
            let value = (before.0 * before.1 + last.0 * last.1) / weight;
            blocks.truncate(blocks.len() - 2);
            blocks.push((value, weight, before.2 + last.2));
        }
    }
    blocks.into_iter().flat_map(|(value, _, length)| std::iter::repeat_n(value, length)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn violators_are_pooled() {
        assert_eq!(isotonic(&[1.0, 3.0, 2.0, 4.0], &[1.0; 4]), [1.0, 2.5, 2.5, 4.0]);
        assert_eq!(isotonic(&[3.0, 0.0], &[1.0, 2.0]), [1.0, 1.0]);
    }

    #[test]
    fn items_keep_their_distance() {
        let extent = Extent { up: 10.0, down: 5.0, straight: 1.0 };
        let y = heights(
            &[vec![0], vec![1, 2, 3]],
            &[extent; 4],
            &[vec![1, 2, 3], vec![0], vec![0], vec![0]],
            2.0,
        );
        assert!(y[2] - y[1] >= 17.0 - 1e-9 && y[3] - y[2] >= 17.0 - 1e-9, "{y:?}");
        assert!((y[2] - y[0]).abs() < 1e-6, "{y:?}");
    }
}
