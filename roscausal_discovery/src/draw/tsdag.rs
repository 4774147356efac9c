//! The time series graph of a model.

use super::{
    dag::title,
    maybe::maybes,
    svg::{FAINT, INK, Point, Stroke, Svg, display, height_of_marks, legend_of_marks, legend_of_model},
};
use crate::model::Model;

const ROW: f64 = 84.0;
const COLUMN: f64 = 150.0;
const NODE: f64 = 9.0;

/// The time series graph as SVG. Variables are rows; time runs in columns up to the present `t`. Links into the
/// present are strong; their copies earlier in time are faint.
pub fn tsdag(model: &Model) -> String {
    let (n, columns) = (model.features.len(), model.tau_max + 1);
    let longest = model.features.iter().map(|name| display(name).chars().count()).max().unwrap_or(0);
    let left = 50.0 + 8.5 * longest as f64;
    let width = (left + COLUMN * columns as f64).max(440.0);
    let height = 80.0 + ROW * n.max(1) as f64 + 90.0;
    let mut svg = Svg::new(width, height + height_of_marks(model));
    svg.title(&title(model));
    let place = |row: usize, lag: usize| {
        Point::new(left + COLUMN * (model.tau_max - lag) as f64, 90.0 + ROW * row as f64)
    };
    let mut numbers = Vec::new();
    for maybe in maybes(model) {
        let stroke = Stroke::of_maybe(maybe.mark());
        let middle = arrow(&mut svg, place(maybe.from, maybe.lag), place(maybe.to, 0), &stroke);
        numbers.push((middle, FAINT, maybe.share));
    }
    for shift in (0..columns).rev() {
        for link in model.links.iter().filter(|link| link.lag + shift <= model.tau_max) {
            let Some((i, j)) = model.places(&link.cause, &link.effect) else { continue };
            let mut stroke = Stroke::of(model, link, link.confidence, link.mark);
            if shift > 0 {
                stroke.opacity *= 0.25;
            }
            let middle = arrow(&mut svg, place(i, link.lag + shift), place(j, shift), &stroke);
            if let Some(share) = link.confidence.filter(|_| shift == 0) {
                numbers.push((middle, INK, share));
            }
        }
    }
    numbers.into_iter().for_each(|(at, colour, share)| svg.label(at, 11.0, colour, &format!("{share:.2}")));
    for (row, name) in model.features.iter().enumerate() {
        svg.text(Point::new(16.0, place(row, 0).y + 5.0), 14.0, "start", INK, &display(name));
        (0..columns).for_each(|lag| svg.circle(place(row, lag), NODE, "#eef2f6", INK, 1.4));
    }
    for lag in 0..columns {
        let at = Point::new(place(0, lag).x, 60.0);
        svg.text(at, 13.0, "middle", INK, &if lag == 0 { "t".to_owned() } else { format!("t−{lag}") });
    }
    legend_of_model(&mut svg, Point::new(16.0, height - 66.0), model);
    legend_of_marks(&mut svg, Point::new(16.0, height + 6.0), model);
    svg.finish()
}

/// Draws an arrow; returns a place for its number, nearer to its cause, where fewer arrows meet than in the middle.
fn arrow(svg: &mut Svg, from: Point, to: Point, stroke: &Stroke) -> Point {
    let bend = bend(from, to);
    let (leave, arrive) = (from.towards(bend), to.towards(bend));
    let start = from.plus(leave.x * NODE, leave.y * NODE);
    let end = to.plus(arrive.x * (NODE + 1.0), arrive.y * (NODE + 1.0));
    svg.arrow(start, bend, end, stroke);
    on_curve(start, bend, end, 0.3)
}

/// The control point of the curve between two nodes: a link that would pass over other nodes is bent around them.
fn bend(from: Point, to: Point) -> Point {
    let steps = |way: f64, step: f64| (way.abs() / step).round() as usize;
    let (columns, rows) = (steps(to.x - from.x, COLUMN), steps(to.y - from.y, ROW));
    // A straight line meets another node where both have a common divisor.
    let meets = (2..=columns.max(rows)).any(|k| columns.is_multiple_of(k) && rows.is_multiple_of(k));
    let over = match (columns, rows) {
        (0, _) => 0.22,
        (_, 0) if meets => 0.22,
        _ if meets => 0.12,
        _ => 0.0,
    };
    let along = from.towards(to);
    let length = libm::hypot(to.x - from.x, to.y - from.y);
    Point::new((from.x + to.x) / 2.0, (from.y + to.y) / 2.0)
        .plus(along.y * length * over, -along.x * length * over)
}

/// The point of a quadratic curve at a part of its way.
fn on_curve(start: Point, bend: Point, end: Point, part: f64) -> Point {
    let mix = |a: f64, b: f64, c: f64| {
        let rest = 1.0 - part;
        rest * rest * a + 2.0 * rest * part * b + part * part * c
    };
    Point::new(mix(start.x, bend.x, end.x), mix(start.y, bend.y, end.y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::example;

    #[test]
    fn a_link_passes_over_no_node_but_its_ends() {
        let at = |column: usize, row: usize| Point::new(COLUMN * column as f64, ROW * row as f64);
        for (columns, rows) in (0..5).flat_map(|columns| (0..5).map(move |rows| (columns, rows))) {
            for (from, to) in [(at(0, 0), at(columns, rows)), (at(0, rows), at(columns, 0))] {
                let bend = bend(from, to);
                let curve = (0..=200).map(|k| on_curve(from, bend, to, f64::from(k) / 200.0));
                let curve: Vec<Point> = curve.collect();
                for node in (0..=columns).flat_map(|column| (0..=rows).map(move |row| at(column, row))) {
                    let far = |of: &Point| libm::hypot(of.x - node.x, of.y - node.y);
                    let is_end = far(&from) < 1.0 || far(&to) < 1.0;
                    let nearest = curve.iter().map(far).fold(f64::INFINITY, f64::min);
                    assert!(is_end || nearest > NODE, "{columns} x {rows}: {nearest}");
                }
            }
        }
    }

    #[test]
    fn each_variable_has_a_node_at_each_time() {
        let svg = tsdag(&example());
        assert_eq!(svg.matches("<circle").count(), 3 * 2);
        assert!(svg.contains("t−1"));
        let fitted = crate::draw::fitted(&svg, Some(85.0), false);
        assert!(fitted.contains(" width=\"85.00mm\"") && fitted.contains("viewBox=\"0 32 "), "{fitted}");
        assert!(svg.contains("PCMCI · GPDC") && !fitted.contains("PCMCI · GPDC"));
    }
}
