//! Where the circles, arrows and labels of a summary graph go.
//!
//! Two layouts. Few variables stand on a ring ([`ring`]), in the same place from model to model. More stand in columns
//! ([`layered`]), causes left of effects, and each label has a slot of its own. Both keep two promises, which
//! `tests/layout.rs` measures on the finished pictures: no arrow passes within the circle of a variable that is not its own,
//! and no two labels overlap. The same graph gives the same picture.
//!
//! Ours, and none of the kept libraries: `rust-sugiyama` and `fdg` place the nodes but route no edge around them and know
//! no labels; `layout-rs` draws its own shapes, and its edges have no slot for a label either.

mod columns;
mod curve;
mod layered;
mod order;
mod ranks;
mod ring;

pub(crate) use curve::{Boxed, cubic};

use super::point::Point;

/// Radius of a variable's circle.
pub(crate) const NODE: f64 = 38.0;
/// Height of a label.
pub(crate) const LABEL: f64 = 16.0;
/// Space that stays free around a circle and between labels.
const CLEAR: f64 = 5.0;
/// Most variables on a labelled ring.
const ON_RING: usize = 9;
/// From this many variables on a matrix stands beside the graph, and says what crowded arrows cannot.
pub(crate) const MATRIX_FROM: usize = 16;
/// Links per variable from which a graph with a matrix is a ring without labels.
const CROWDED: usize = 3;

/// One arrow to lay out, and the width of its label in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    pub(crate) from: usize,
    pub(crate) to: usize,
    pub(crate) label: f64,
}

/// Where everything goes. All coordinates are at least 0.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plan {
    pub(crate) width: f64,
    pub(crate) height: f64,
    /// Centres of the circles.
    pub(crate) nodes: Vec<Point>,
    /// One route per edge, in the order of the edges.
    pub(crate) routes: Vec<Route>,
}

/// Where one arrow goes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Route {
    /// Cubic Bézier curves from rim to rim: the start, then two control points and the end of each.
    pub(crate) path: Vec<Point>,
    /// Centre of the label; `None` in a crowded graph.
    pub(crate) label: Option<Point>,
}

/// The layout of `n` variables and these arrows.
pub(crate) fn plan(n: usize, edges: &[Edge]) -> Plan {
    let plan = if n >= MATRIX_FROM && edges.len() > CROWDED * n {
        ring::bare(n, edges)
    } else if n <= ON_RING {
        ring::labelled(n, edges).unwrap_or_else(|| layered::layered(n, edges))
    } else {
        layered::layered(n, edges)
    };
    plan.cropped(edges)
}

impl Plan {
    /// Moved so that nothing is left of or above 0, and as large as what is in it.
    fn cropped(mut self, edges: &[Edge]) -> Self {
        let mut all = Boxed::NOTHING;
        for &at in &self.nodes {
            all = all.and(Boxed::around(at, 2.0 * NODE + 4.0, 2.0 * NODE + 4.0));
        }
        for (route, edge) in self.routes.iter().zip(edges) {
            curve::samples(&route.path).for_each(|at| all = all.and(Boxed::around(at, 14.0, 14.0)));
            if let Some(at) = route.label {
                all = all.and(Boxed::around(at, edge.label, LABEL));
            }
        }
        if self.nodes.is_empty() {
            return Self { width: 0.0, height: 0.0, ..self };
        }
        let moved = |at: &mut Point| *at = at.plus(-all.left, -all.top);
        self.nodes.iter_mut().for_each(moved);
        for route in &mut self.routes {
            route.path.iter_mut().chain(&mut route.label).for_each(moved);
        }
        Self { width: all.right - all.left, height: all.bottom - all.top, ..self }
    }
}

/// The loop of a variable to itself in the direction `out`, `reach` circles far, and the centre of its label.
fn own_loop(at: Point, out: Point, reach: f64, label: f64) -> (Vec<Point>, Point) {
    let side = Point::new(-out.y, out.x);
    let rim = |turn: f64| {
        let (sin, cos) = libm::sincos(turn);
        at.plus(NODE * (out.x * cos + side.x * sin), NODE * (out.y * cos + side.y * sin))
    };
    let (start, end) = (rim(-0.6), rim(0.6));
    let bend = at.plus(out.x * NODE * reach, out.y * NODE * reach);
    let peak = 0.5 * NODE * (libm::cos(0.6_f64) + reach);
    // The label begins where the loop ends, whichever way the loop looks.
    let far = peak + 4.0 + (out.x.abs() * label / 2.0).min(label / 2.0) + out.y.abs() * LABEL / 2.0;
    (cubic(start, bend, end), at.plus(out.x * far, out.y * far))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_no_picture_and_one_variable_is_a_circle() {
        assert_eq!((plan(0, &[]).width, plan(0, &[]).nodes.len()), (0.0, 0));
        let one = plan(1, &[Edge { from: 0, to: 0, label: 40.0 }]);
        assert!(one.nodes.len() == 1 && one.routes[0].label.is_some() && one.width < 120.0, "{one:?}");
    }

    #[test]
    fn a_variable_stays_in_its_place_from_model_to_model() {
        let edge = |from, to| Edge { from, to, label: 50.0 };
        let gaps = |edges: &[Edge]| {
            let nodes = plan(5, edges).nodes;
            (nodes[3].x - nodes[0].x, nodes[3].y - nodes[0].y)
        };
        let (one, two) = (gaps(&[edge(0, 1)]), gaps(&[edge(2, 1), edge(4, 3), edge(1, 1)]));
        assert!((one.0 - two.0).hypot(one.1 - two.1) < 1e-9);
    }
}
