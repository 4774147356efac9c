//! Which column each variable stands in: causes left of effects, as far as there is no circle.
//!
//! 1. An order with few arrows against it (Eades, Lin and Smyth 1993): sinks go to the end, sources to the beginning, and
//!    if there are none, the variable with the most arrows out over arrows in goes to the beginning.
//! 2. Each variable stands right of all that point to it in this order (longest path).
//! 3. Each variable moves to the middle of its neighbours, as far as these leave room, so that arrows get short.
//! 4. Variables without arrows fill the emptiest columns.

use crate::types::unique;

/// Rounds of step 3.
const ROUNDS: usize = 8;

/// The column of each of `n` variables, from 0. Every arrow goes from one column to another.
///
/// Example: a -> b, b -> c, c -> a gives a 0, b 1, c 2; the last arrow goes back.
pub(super) fn ranks(n: usize, arrows: &[(usize, usize)]) -> Vec<usize> {
    let place = positions(&few_against(n, arrows));
    let forward: Vec<(usize, usize)> =
        arrows.iter().map(|&(a, b)| if place[a] < place[b] { (a, b) } else { (b, a) }).collect();
    let mut by_place: Vec<usize> = (0..n).collect();
    by_place.sort_by_key(|&v| place[v]);
    let mut before = vec![Vec::new(); n];
    let mut after = vec![Vec::new(); n];
    for &(a, b) in &forward {
        before[b].push(a);
        after[a].push(b);
    }
    let mut rank = vec![0_usize; n];
    by_place.iter().for_each(|&v| rank[v] = before[v].iter().map(|&u| rank[u] + 1).max().unwrap_or(0));
    for _ in 0..ROUNDS {
        for &v in &by_place {
            let low = before[v].iter().map(|&u| rank[u] + 1).max();
            let high = after[v].iter().map(|&u| rank[u].saturating_sub(1)).min();
            let mut around: Vec<usize> = before[v].iter().chain(&after[v]).map(|&u| rank[u]).collect();
            around.sort_unstable();
            let Some(&middle) = around.get(around.len() / 2) else { continue };
            rank[v] = middle.clamp(low.unwrap_or(0), high.unwrap_or(usize::MAX).max(low.unwrap_or(0)));
        }
    }
    let alone: Vec<usize> = (0..n).filter(|&v| before[v].is_empty() && after[v].is_empty()).collect();
    close_gaps(&mut rank, &alone);
    spread(&mut rank, &alone);
    rank
}

fn few_against(n: usize, arrows: &[(usize, usize)]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..n).collect();
    let (mut front, mut end) = (Vec::new(), Vec::new());
    let mut out = vec![0_i64; n];
    let mut into = vec![0_i64; n];
    for &(a, b) in arrows {
        out[a] += 1;
        into[b] += 1;
    }
    while !left.is_empty() {
        let sink = left.iter().position(|&v| out[v] == 0);
        let at = sink.or_else(|| left.iter().position(|&v| into[v] == 0)).unwrap_or_else(|| {
            let surplus = |&at: &usize| (out[left[at]] - into[left[at]], std::cmp::Reverse(at));
            (0..left.len()).max_by_key(surplus).unwrap_or(0)
        });
        let v = left.remove(at);
        if sink.is_some() {
            end.push(v)
        } else {
            front.push(v)
        }
        for &(a, b) in arrows {
            if a == v {
                into[b] -= 1;
            }
            if b == v {
                out[a] -= 1;
            }
        }
    }
    front.extend(end.into_iter().rev());
    front
}

fn positions(order: &[usize]) -> Vec<usize> {
    let mut place = vec![0; order.len()];
    order.iter().enumerate().for_each(|(at, &v)| place[v] = at);
    place
}

/// Columns that steps 2 and 3 left empty go.
fn close_gaps(rank: &mut [usize], alone: &[usize]) {
    let used = unique((0..rank.len()).filter(|v| !alone.contains(v)).map(|v| rank[v]).collect());
    rank.iter_mut().for_each(|r| *r = used.partition_point(|u| u < r));
}

fn spread(rank: &mut [usize], alone: &[usize]) {
    let linked = (0..rank.len()).filter(|v| !alone.contains(v)).map(|v| rank[v] + 1).max().unwrap_or(0);
    let columns = linked.max((alone.len() as f64).sqrt().ceil() as usize).max(1);
    let mut height = vec![0; columns];
    (0..rank.len()).filter(|v| !alone.contains(v)).for_each(|v| height[rank[v]] += 1);
    for &v in alone {
        rank[v] = (0..columns).min_by_key(|&column| height[column]).unwrap_or(0);
        height[rank[v]] += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_stand_left_of_effects() {
        assert_eq!(ranks(3, &[(0, 1), (1, 2), (0, 2)]), [0, 1, 2]);
        let rank = ranks(4, &[(0, 1), (1, 2), (2, 0)]);
        assert!(rank[0] != rank[1] && rank[1] != rank[2] && rank[2] != rank[0], "{rank:?}");
    }

    #[test]
    fn variables_without_links_fill_the_columns() {
        let rank = ranks(9, &[]);
        assert!((0..3).all(|column| rank.iter().filter(|&&r| r == column).count() == 3), "{rank:?}");
    }
}
