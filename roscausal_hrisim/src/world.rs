//! The map: walls, distances to them, and routes around them.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, HashMap},
};

use crate::geometry::{Segment, Vec2, bounds};

/// Names of the built-in maps.
pub const MAPS: [&str; 4] = ["hall", "corridor", "corridor_turn", "corridor_doors"];

/// Free space that a route keeps from the walls, metres.
const CLEARANCE: f64 = 0.4;
/// Cell size of the route search, metres.
const CELL: f64 = 0.25;
/// Most cells. A larger map is searched with larger cells.
const MAX_CELLS: f64 = 250_000.0;

/// Walls in the map frame, and the free cells between them.
#[derive(Clone, Debug)]
pub struct World {
    walls: Vec<Segment>,
    min: Vec2,
    cell: f64,
    columns: usize,
    rows: usize,
    free: Vec<bool>,
}

impl World {
    /// The built-in map with that name; see [`MAPS`].
    pub fn named(name: &str) -> Option<Self> {
        let walls = match name {
            "hall" => outline(&HALL),
            "corridor" => outline(&CORRIDOR),
            "corridor_turn" => outline(&CORRIDOR_TURN),
            "corridor_doors" => [outline(&CORRIDOR_DOORS), ROOMS.to_vec()].concat(),
            _ => return None,
        };
        Some(Self::new(walls))
    }

    /// A map with these walls.
    pub fn new(walls: Vec<Segment>) -> Self {
        let around = bounds(walls.iter().flat_map(|wall| [wall.a, wall.b]));
        let (min, max) = around.unwrap_or((Vec2::new(-10.0, -10.0), Vec2::new(10.0, 10.0)));
        let size = max - min;
        let cell = CELL.max((size.x * size.y / MAX_CELLS).sqrt());
        let (columns, rows) = ((size.x / cell).ceil() as usize + 1, (size.y / cell).ceil() as usize + 1);
        let mut world = Self { walls, min, cell, columns, rows, free: Vec::new() };
        world.free =
            (0..columns * rows).map(|index| world.clearance(world.centre(index)) >= CLEARANCE).collect();
        world
    }

    /// The walls.
    pub fn walls(&self) -> &[Segment] {
        &self.walls
    }

    /// Lower left and upper right corner of all walls.
    pub fn bounds(&self) -> (Vec2, Vec2) {
        let extent = Vec2::new((self.columns - 1) as f64, (self.rows - 1) as f64) * self.cell;
        (self.min, self.min + extent)
    }

    /// The nearest point of any wall; `None` without walls.
    pub fn nearest_wall_point(&self, p: Vec2) -> Option<Vec2> {
        self.walls.iter().map(|wall| wall.nearest(p)).min_by(|a, b| a.distance(p).total_cmp(&b.distance(p)))
    }

    /// Distance from the nearest wall; infinite without walls.
    pub fn clearance(&self, p: Vec2) -> f64 {
        self.nearest_wall_point(p).map_or(f64::INFINITY, |wall| wall.distance(p))
    }

    /// Whether the straight line from `a` to `b` stays at least `clearance` away from every wall.
    pub fn is_clear(&self, a: Vec2, b: Vec2, clearance: f64) -> bool {
        let way = Segment { a, b };
        self.walls.iter().all(|wall| wall.distance(&way) >= clearance)
    }

    /// Where a body of this radius ends up that moves from `from` to `to`: never in or beyond a wall.
    pub fn moved(&self, from: Vec2, to: Vec2, radius: f64) -> Vec2 {
        let blocked = |to: Vec2| self.walls.iter().any(|wall| wall.crosses(&Segment { a: from, b: to }));
        if blocked(to) {
            return from;
        }
        let pushed = self.pushed_out(to, radius);
        if blocked(pushed) { from } else { pushed }
    }

    /// The point, moved away from walls that are nearer than `radius`.
    fn pushed_out(&self, p: Vec2, radius: f64) -> Vec2 {
        let mut point = p;
        for wall in self.walls.iter().chain(&self.walls) {
            let nearest = wall.nearest(point);
            let away = point - nearest;
            let distance = away.norm();
            if distance < radius && distance > 0.0 {
                point = nearest + away * (radius / distance);
            }
        }
        point
    }

    /// Corner points of a route from `from` to `to` that keeps clear of walls, `to` last; `None` if there is none.
    /// A goal too close to a wall for a body is approached as far as possible.
    pub fn route(&self, from: Vec2, to: Vec2) -> Option<Vec<Vec2>> {
        // A goal on a wall is approached from this side of it.
        let end = self.pushed_out(to + (from - to).unit() * 1e-6, CLEARANCE + 0.01);
        let start = self.pushed_out(from, CLEARANCE + 0.01);
        if self.is_inside(end) && self.is_clear(start, end, CLEARANCE) {
            return Some(vec![to]);
        }
        let cells = self.search(self.free_cell_near(start)?, self.free_cell_near(end)?)?;
        let mut route = Vec::new();
        let mut here = start;
        let mut next = 0;
        while next < cells.len() {
            let seen = (next..cells.len()).rev().find(|&k| self.is_clear(here, cells[k], CLEARANCE * 0.9));
            let reached = seen.unwrap_or(next);
            here = cells[reached];
            route.push(here);
            next = reached + 1;
        }
        route.pop();
        route.push(to);
        Some(route)
    }

    /// Whether the point is in the bounding box of the walls.
    fn is_inside(&self, p: Vec2) -> bool {
        let (min, max) = self.bounds();
        self.walls.is_empty() || (p.x > min.x && p.x < max.x && p.y > min.y && p.y < max.y)
    }

    /// A random free position with at least `clearance` to the walls, reachable from `hub`.
    pub fn random_free(&self, rng: &mut crate::rng::Rng, hub: Vec2, clearance: f64) -> Option<Vec2> {
        let (min, max) = self.bounds();
        (0..1000).find_map(|_| {
            let p = Vec2::new(rng.uniform(min.x, max.x), rng.uniform(min.y, max.y));
            (self.clearance(p) >= clearance && self.route(hub, p).is_some()).then_some(p)
        })
    }

    fn centre(&self, index: usize) -> Vec2 {
        self.min + Vec2::new((index % self.columns) as f64, (index / self.columns) as f64) * self.cell
    }

    /// The free cell nearest to `p`, within 1.5 m, from which `p` is in sight.
    fn free_cell_near(&self, p: Vec2) -> Option<usize> {
        let reach = (1.5 / self.cell).ceil() as i64;
        let (column, row) =
            (((p.x - self.min.x) / self.cell).round(), ((p.y - self.min.y) / self.cell).round());
        let mut best: Option<(f64, usize)> = None;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let (x, y) = (column as i64 + dx, row as i64 + dy);
                if x < 0 || y < 0 || x >= self.columns as i64 || y >= self.rows as i64 {
                    continue;
                }
                let index = y as usize * self.columns + x as usize;
                let distance = self.centre(index).distance(p);
                let nearer = best.is_none_or(|(least, _)| distance < least);
                if self.free[index] && nearer && self.is_clear(self.centre(index), p, 1e-9) {
                    best = Some((distance, index));
                }
            }
        }
        best.map(|(_, index)| index)
    }

    /// Shortest path over free cells (A*, eight neighbours), as cell centres.
    fn search(&self, start: usize, end: usize) -> Option<Vec<Vec2>> {
        let goal = self.centre(end);
        let micro = |metres: f64| (metres * 1e6) as u64;
        let mut cost: HashMap<usize, (u64, usize)> = HashMap::from([(start, (0, start))]);
        let mut open = BinaryHeap::from([Reverse((micro(self.centre(start).distance(goal)), start))]);
        while let Some(Reverse((bound, here))) = open.pop() {
            if here == end {
                break;
            }
            let so_far = cost.get(&here).map_or(u64::MAX, |(so_far, _)| *so_far);
            if bound > so_far.saturating_add(micro(self.centre(here).distance(goal))) {
                continue;
            }
            for next in self.neighbours(here) {
                let total = so_far + micro(self.centre(here).distance(self.centre(next)));
                if cost.get(&next).is_none_or(|(known, _)| total < *known) {
                    cost.insert(next, (total, here));
                    open.push(Reverse((total + micro(self.centre(next).distance(goal)), next)));
                }
            }
        }
        let mut way = vec![self.centre(end)];
        let mut here = end;
        while here != start {
            here = cost.get(&here)?.1;
            way.push(self.centre(here));
        }
        way.reverse();
        Some(way)
    }

    fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> + '_ {
        let (x, y) = ((index % self.columns) as i64, (index / self.columns) as i64);
        let steps = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))).filter(|step| *step != (0, 0));
        steps.filter_map(move |(dx, dy)| {
            let (nx, ny) = (x + dx, y + dy);
            let inside = nx >= 0 && ny >= 0 && nx < self.columns as i64 && ny < self.rows as i64;
            let next = (ny * self.columns as i64 + nx) as usize;
            (inside && self.free[next]).then_some(next)
        })
    }
}

/// The walls from each of these corners to the next one, and from the last to the first.
fn outline(corners: &[(f64, f64)]) -> Vec<Segment> {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| Segment::new(a.0, a.1, b.0, b.1)).collect()
}

const HALL: [(f64, f64); 4] = [(-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (-10.0, 10.0)];

/// 20 m x 4 m.
const CORRIDOR: [(f64, f64); 4] = [(-10.0, -2.0), (10.0, -2.0), (10.0, 2.0), (-10.0, 2.0)];

/// 4 m wide, along the lower and the right side of a square.
const CORRIDOR_TURN: [(f64, f64); 6] =
    [(-10.0, -10.0), (10.0, -10.0), (10.0, 10.0), (6.0, 10.0), (6.0, -6.0), (-10.0, -6.0)];

/// A 4 m wide corridor with two rooms on each side, each behind a door of 1.6 m: the walls around it, and those inside.
const CORRIDOR_DOORS: [(f64, f64); 4] = [(-10.0, -8.0), (10.0, -8.0), (10.0, 8.0), (-10.0, 8.0)];
const ROOMS: [Segment; 8] = [
    Segment::new(-10.0, 2.0, -5.8, 2.0),
    Segment::new(-4.2, 2.0, 4.2, 2.0),
    Segment::new(5.8, 2.0, 10.0, 2.0),
    Segment::new(-10.0, -2.0, -5.8, -2.0),
    Segment::new(-4.2, -2.0, 4.2, -2.0),
    Segment::new(5.8, -2.0, 10.0, -2.0),
    Segment::new(0.0, 2.0, 0.0, 8.0),
    Segment::new(0.0, -2.0, 0.0, -8.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn routes_lead_through_doors_and_never_through_walls() {
        let world = World::named("corridor_doors").unwrap();
        let (from, to) = (Vec2::new(-8.0, 6.0), Vec2::new(8.0, -6.0));
        let route = world.route(from, to).unwrap();
        assert!(route.len() > 2, "{route:?}");
        assert_eq!(*route.last().unwrap(), to);
        let mut here = from;
        for corner in route {
            assert!(world.is_clear(here, corner, 0.3), "{here:?} {corner:?}");
            here = corner;
        }
    }

    #[test]
    fn there_is_no_route_out_of_the_building() {
        for map in MAPS {
            let world = World::named(map).unwrap();
            assert!(world.route(Vec2::new(8.0, -1.0), Vec2::new(30.0, 0.0)).is_none(), "{map}");
        }
        let turn = World::named("corridor_turn").unwrap();
        assert!(turn.route(Vec2::new(-8.0, -8.0), Vec2::new(0.0, 5.0)).is_none());
        assert!(turn.route(Vec2::new(-8.0, -8.0), Vec2::new(8.0, 8.0)).is_some());
    }

    #[test]
    fn a_body_is_kept_its_radius_from_walls() {
        let hall = World::named("hall").unwrap();
        let from = Vec2::new(9.7, 9.7);
        let at = hall.moved(from, Vec2::new(9.99, 9.99), 0.2);
        assert!((hall.clearance(at) - 0.2).abs() < 1e-9, "{at:?}");
        assert_eq!(hall.moved(from, Vec2::new(11.0, 9.7), 0.2), from);
    }

    #[test]
    fn goals_at_a_wall_are_approached_straight() {
        let hall = World::named("hall").unwrap();
        let goal = Vec2::new(-9.99, -4.0);
        assert_eq!(hall.route(Vec2::new(5.0, 5.0), goal).unwrap(), vec![goal]);
    }
}
