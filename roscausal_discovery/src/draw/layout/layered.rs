//! Variables in columns, causes left of effects (Sugiyama, Tagawa and Toda 1981, with the label slots of Gansner and
//! others 1993).
//!
//! Between two columns of variables lies a column of labels. An arrow runs from column to column through slots of its own;
//! within a column it is level, so it never enters a circle, and its label has one slot to itself.

use super::{
    super::point::Point,
    Edge, LABEL, NODE, Plan, Route,
    columns::{Extent, heights},
    order::order,
    own_loop,
    ranks::ranks,
};

/// Between two slots of a column.
const GAP: f64 = 9.0;
/// Half of what an arrow without a label takes.
const LINE: f64 = 4.0;
/// How far the loop of a variable to itself bends out, in circles; and what it and its label take above the circle.
const LOOP: f64 = 2.6;
const ABOVE: f64 = 50.0;
/// Least and largest space between two columns, for the arrows to change their height.
const BETWEEN: (f64, f64) = (30.0, 130.0);
/// The angle up and down from level within which arrows meet a circle.
const FAN: f64 = 0.85;

/// The slots of one arrow from left to right; the label is at `label`.
struct Chain {
    slots: Vec<usize>,
    label: usize,
    backwards: bool,
}

/// The variables in columns.
pub(super) fn layered(n: usize, edges: &[Edge]) -> Plan {
    let arrows: Vec<(usize, usize)> =
        edges.iter().filter(|edge| edge.from != edge.to).map(|edge| (edge.from, edge.to)).collect();
    let rank = ranks(n, &arrows);
    let n_columns = 2 * rank.iter().max().copied().unwrap_or(0) + 1;
    let mut columns = vec![Vec::new(); n_columns];
    let mut widths = vec![0.0_f64; n_columns];
    let mut items = Vec::new();
    for v in 0..n {
        let looped = edges.iter().any(|edge| edge.from == v && edge.to == v);
        items.push(Extent { up: NODE + if looped { ABOVE } else { 0.0 }, down: NODE, straight: 1.0 });
        columns[2 * rank[v]].push(v);
        widths[2 * rank[v]] = 2.0 * NODE;
    }
    let mut n_labels = vec![0_usize; n_columns];
    let mut chains: Vec<Option<Chain>> = Vec::new();
    let (mut left, mut right) = (vec![Vec::new(); n], vec![Vec::new(); n]);
    for edge in edges {
        if edge.from == edge.to {
            chains.push(None);
            continue;
        }
        let backwards = rank[edge.from] > rank[edge.to];
        let (a, b) = if backwards { (edge.to, edge.from) } else { (edge.from, edge.to) };
        let inner = 2 * rank[a] + 1..2 * rank[b];
        // The emptiest column of labels on the way.
        let odd = inner.clone().filter(|column| column % 2 == 1);
        let at = odd.min_by_key(|&column| n_labels[column]).unwrap_or(inner.start);
        n_labels[at] += 1;
        widths[at] = widths[at].max(edge.label);
        let mut slots = vec![a];
        for column in inner {
            let half = if column == at { LABEL / 2.0 } else { LINE };
            slots.push(items.len());
            columns[column].push(items.len());
            items.push(Extent { up: half, down: half, straight: 2.8 });
            left.push(Vec::new());
            right.push(Vec::new());
        }
        slots.push(b);
        for pair in slots.windows(2) {
            right[pair[0]].push(pair[1]);
            left[pair[1]].push(pair[0]);
        }
        chains.push(Some(Chain { slots, label: at - 2 * rank[a], backwards }));
    }
    order(&mut columns, &left, &right);
    let near: Vec<Vec<usize>> = left.iter().zip(&right).map(|(l, r)| [&l[..], r].concat()).collect();
    let y = heights(&columns, &items, &near, GAP);
    let x = middles(&columns, &widths, &right, &y);
    let column_of = columns_of(&columns, items.len());
    let nodes: Vec<Point> = (0..n).map(|v| Point::new(x[column_of[v]], y[v])).collect();
    let ports = Ports { leave: port_heights(n, &right, &y), arrive: port_heights(n, &left, &y) };
    let at = |slot: usize| Point::new(x[column_of[slot]], y[slot]);
    let route = |(edge, chain): (&Edge, &Option<Chain>)| match chain {
        None => {
            let (path, label) = own_loop(nodes[edge.from], Point::new(0.0, -1.0), LOOP, edge.label);
            Route { path, label: Some(label) }
        }
        Some(chain) => {
            let mut path = ports.path(chain, &at, |slot| widths[column_of[slot]]);
            if chain.backwards {
                path.reverse();
            }
            Route { path, label: Some(at(chain.slots[chain.label])) }
        }
    };
    Plan { width: 0.0, height: 0.0, routes: edges.iter().zip(&chains).map(route).collect(), nodes }
}

fn columns_of(columns: &[Vec<usize>], n_items: usize) -> Vec<usize> {
    let mut of = vec![0; n_items];
    columns.iter().enumerate().for_each(|(column, items)| items.iter().for_each(|&item| of[item] = column));
    of
}

/// The middle of each column; the space between two is larger where arrows change their height a lot.
fn middles(columns: &[Vec<usize>], widths: &[f64], right: &[Vec<usize>], y: &[f64]) -> Vec<f64> {
    let mut at = 0.0;
    let mut x = Vec::with_capacity(columns.len());
    for (column, width) in columns.iter().zip(widths) {
        x.push(at + width / 2.0);
        let rises =
            column.iter().flat_map(|&item| right[item].iter().map(move |&end| (y[end] - y[item]).abs()));
        at += width + (0.22 * rises.fold(0.0, f64::max)).clamp(BETWEEN.0, BETWEEN.1);
    }
    x
}

/// Where arrows meet the circles: for each variable, its neighbours on one side by height.
struct Ports {
    leave: Vec<Vec<usize>>,
    arrive: Vec<Vec<usize>>,
}

fn port_heights(n: usize, side: &[Vec<usize>], y: &[f64]) -> Vec<Vec<usize>> {
    let sorted = |v: usize| {
        let mut near = side[v].clone();
        near.sort_by(|&a, &b| y[a].total_cmp(&y[b]));
        near
    };
    (0..n).map(sorted).collect()
}

impl Ports {
    /// The curves from the left circle to the right one: level within the columns, S-shaped between them.
    fn path(&self, chain: &Chain, at: &impl Fn(usize) -> Point, width: impl Fn(usize) -> f64) -> Vec<Point> {
        let slots = &chain.slots;
        let (first, last) = (slots[0], slots[slots.len() - 1]);
        let rim = |v: usize, ports: &[usize], next: usize, side: f64| {
            let place = ports.iter().position(|&slot| slot == next).unwrap_or(0) as f64;
            let turn = FAN * (2.0 * (place + 0.5) / ports.len().max(1) as f64 - 1.0);
            at(v).plus(side * (NODE + 1.5) * libm::cos(turn), (NODE + 1.5) * libm::sin(turn))
        };
        let mut path = vec![rim(first, &self.leave[first], slots[1], 1.0)];
        let mut to = |end: Point| {
            let begin = path[path.len() - 1];
            let middle = (begin.x + end.x) / 2.0;
            path.extend([Point::new(middle, begin.y), Point::new(middle, end.y), end]);
        };
        for &slot in &slots[1..slots.len() - 1] {
            let (middle, half) = (at(slot), width(slot) / 2.0);
            to(middle.plus(-half, 0.0));
            to(middle.plus(half, 0.0));
        }
        to(rim(last, &self.arrive[last], slots[slots.len() - 2], -1.0));
        path
    }
}
