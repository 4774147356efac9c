//! Variables on a ring. An arrow is an arc; the arrow back takes another arc.
//!
//! Each arrow takes the first of a list of bends that keeps clear of all other circles and of the pair's other arrows. Then each
//! label takes the first free place along its arrow. If a label finds none, the ring grows and all begins again.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::{
    super::point::Point,
    CLEAR, Edge, LABEL, NODE, Plan, Route,
    curve::{Boxed, at, cubic, distance},
    own_loop,
};

/// How far an arrow may bend to its left (negative: right), as a part of its length; the first that fits.
const BENDS: [f64; 15] =
    [0.18, 0.1, 0.26, 0.34, 0.42, -0.1, -0.18, -0.26, 0.5, -0.34, -0.42, -0.5, 0.7, -0.7, -0.9];
/// Two arrows between the same variables differ by this much in their bends.
const APART: f64 = 0.15;
/// Where a label may stand on its arrow; the first that is free.
const ALONG: [f64; 9] = [0.5, 0.42, 0.58, 0.35, 0.65, 0.28, 0.72, 0.22, 0.78];
/// How often the ring may grow, and by how much.
const TRIES: i32 = 14;
const GROWTH: f64 = 1.12;
/// Space along a crowded ring for each variable.
const PITCH: f64 = 2.0 * NODE + 26.0;

/// A ring on which every label has a place; `None` if there is none.
pub(super) fn labelled(n: usize, edges: &[Edge]) -> Option<Plan> {
    let first = if n <= 2 { 110.0 } else { 90.0 + 26.0 * n as f64 };
    (0..TRIES).find_map(|grown| {
        let nodes = places(n, first * GROWTH.powi(grown));
        let mut routes = arcs(&nodes, edges)?;
        label(&mut routes, &nodes, edges).then_some(Plan { width: 0.0, height: 0.0, nodes, routes })
    })
}

/// A ring without labels, for more arrows than labels have room; what they say is in the matrix.
pub(super) fn bare(n: usize, edges: &[Edge]) -> Plan {
    let first = PITCH * n as f64 / TAU;
    let ring = (0..TRIES).find_map(|grown| {
        let nodes = places(n, first * GROWTH.powi(grown));
        let routes = arcs(&nodes, edges)?.into_iter().map(|route| Route { label: None, ..route }).collect();
        Some(Plan { width: 0.0, height: 0.0, nodes, routes })
    });
    // No ring is too small for all bends after so much growth; without arrows there is a picture still.
    ring.unwrap_or_else(|| Plan { width: 0.0, height: 0.0, nodes: places(n, first), routes: Vec::new() })
}

fn places(n: usize, radius: f64) -> Vec<Point> {
    let begin = if n == 2 { TAU / 2.0 } else { -FRAC_PI_2 };
    let radius = if n == 1 { 0.0 } else { radius };
    let place = |i: usize| {
        let angle = begin + TAU * i as f64 / n as f64;
        Point::new(radius * libm::cos(angle), radius * libm::sin(angle))
    };
    (0..n).map(place).collect()
}

/// An arc for each arrow, clear of all circles but its own two; loops look outwards, with their labels.
fn arcs(nodes: &[Point], edges: &[Edge]) -> Option<Vec<Route>> {
    // The bends in use, seen from the variable with the smaller number.
    let mut bends = std::collections::BTreeMap::<_, Vec<f64>>::new();
    let mut routes = Vec::with_capacity(edges.len());
    for edge in edges {
        let (from, to) = (nodes[edge.from], nodes[edge.to]);
        if edge.from == edge.to {
            let out = if libm::hypot(from.x, from.y) < 1.0 {
                Point::new(0.0, -1.0)
            } else {
                Point::new(0.0, 0.0).towards(from)
            };
            let (path, label) = own_loop(from, out, 3.2, edge.label);
            routes.push(Route { path, label: Some(label) });
            continue;
        }
        let side = if edge.from < edge.to { 1.0 } else { -1.0 };
        let taken = bends.entry((edge.from.min(edge.to), edge.from.max(edge.to))).or_default();
        let others = || {
            let own = [edge.from, edge.to];
            nodes.iter().enumerate().filter(move |(i, _)| !own.contains(i)).map(|(_, &node)| node)
        };
        let found = BENDS.iter().find_map(|&bend| {
            if taken.iter().any(|taken| (taken - side * bend).abs() < APART) {
                return None;
            }
            let path = arc(from, to, bend);
            others().all(|node| distance(&path, node) > NODE + CLEAR).then_some((bend, path))
        })?;
        taken.push(side * found.0);
        routes.push(Route { path: found.1, label: None });
    }
    Some(routes)
}

fn arc(from: Point, to: Point, bend: f64) -> Vec<Point> {
    let along = from.towards(to);
    let length = bend * libm::hypot(to.x - from.x, to.y - from.y);
    let middle = Point::new((from.x + to.x) / 2.0, (from.y + to.y) / 2.0);
    let bend = middle.plus(along.y * length, -along.x * length);
    let (leave, arrive) = (from.towards(bend), to.towards(bend));
    let start = from.plus(leave.x * NODE, leave.y * NODE);
    cubic(start, bend, to.plus(arrive.x * (NODE + 2.0), arrive.y * (NODE + 2.0)))
}

/// Gives each arrow a place for its label, if there is one for all.
fn label(routes: &mut [Route], nodes: &[Point], edges: &[Edge]) -> bool {
    let boxed = |at: Point, edge: &Edge| Boxed::around(at, edge.label, LABEL);
    let loops = routes.iter().zip(edges).filter_map(|(route, edge)| Some(boxed(route.label?, edge)));
    let mut taken: Vec<Boxed> = loops.collect();
    let touching = |i: usize| taken[..i].iter().any(|other| other.hits(&taken[i], CLEAR));
    if (0..taken.len()).any(touching) {
        return false;
    }
    for (route, edge) in routes.iter_mut().zip(edges) {
        let [a, b, c, d] = route.path[..] else { return false };
        if route.label.is_some() {
            continue;
        }
        let free = |place: &Point| {
            let label = boxed(*place, edge);
            !taken.iter().any(|other| other.hits(&label, CLEAR))
                && !nodes.iter().any(|&node| label.hits_circle(node, NODE + CLEAR))
        };
        let Some(place) = ALONG.iter().map(|&t| at(t, [a, b, c, d])).find(free) else { return false };
        taken.push(boxed(place, edge));
        route.label = Some(place);
    }
    true
}
