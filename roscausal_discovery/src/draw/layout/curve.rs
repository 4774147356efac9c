//! Curves and boxes: what is measured before a picture is drawn.

use super::super::point::Point;

/// Points of a curve that are looked at, per Bézier piece.
const STEPS: usize = 24;

/// An upright rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Boxed {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) right: f64,
    pub(crate) bottom: f64,
}

impl Boxed {
    /// The box around nothing.
    pub(super) const NOTHING: Self =
        Self { left: f64::INFINITY, top: f64::INFINITY, right: f64::NEG_INFINITY, bottom: f64::NEG_INFINITY };

    /// The box of this size around `at`.
    pub(crate) fn around(at: Point, width: f64, height: f64) -> Self {
        Self {
            left: at.x - width / 2.0,
            top: at.y - height / 2.0,
            right: at.x + width / 2.0,
            bottom: at.y + height / 2.0,
        }
    }

    /// The smallest box around both.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            left: self.left.min(other.left),
            top: self.top.min(other.top),
            right: self.right.max(other.right),
            bottom: self.bottom.max(other.bottom),
        }
    }

    /// Whether the two have a point in common when both keep `gap` between them.
    pub(crate) fn hits(&self, other: &Self, gap: f64) -> bool {
        self.left < other.right + gap
            && other.left < self.right + gap
            && self.top < other.bottom + gap
            && other.top < self.bottom + gap
    }

    /// Whether a point of the box is nearer than `radius` to `at`.
    pub(super) fn hits_circle(&self, at: Point, radius: f64) -> bool {
        let (x, y) = (at.x.clamp(self.left, self.right), at.y.clamp(self.top, self.bottom));
        libm::hypot(x - at.x, y - at.y) < radius
    }
}

/// A quadratic Bézier curve as a cubic one.
pub(crate) fn cubic(from: Point, bend: Point, to: Point) -> Vec<Point> {
    let third = |end: Point| end.plus((bend.x - end.x) * 2.0 / 3.0, (bend.y - end.y) * 2.0 / 3.0);
    vec![from, third(from), third(to), to]
}

/// Points along cubic Bézier curves, from the first to the last.
pub(super) fn samples(path: &[Point]) -> impl Iterator<Item = Point> {
    let piece = |p: &[Point]| {
        let [a, b, c, d] = [p[0], p[1], p[2], p[3]];
        (0..=STEPS).map(move |step| at(step as f64 / STEPS as f64, [a, b, c, d]))
    };
    path.windows(4).step_by(3).flat_map(piece)
}

/// The point of a cubic Bézier curve at `t` in `[0, 1]`.
pub(super) fn at(t: f64, [a, b, c, d]: [Point; 4]) -> Point {
    let s = 1.0 - t;
    let [wa, wb, wc, wd] = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
    Point::new(wa * a.x + wb * b.x + wc * c.x + wd * d.x, wa * a.y + wb * b.y + wc * c.y + wd * d.y)
}

/// The smallest distance of a curve from a point, at the points that are looked at.
pub(super) fn distance(path: &[Point], from: Point) -> f64 {
    samples(path).map(|p| libm::hypot(p.x - from.x, p.y - from.y)).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quadratic_curve_is_the_same_as_a_cubic_one() {
        let [a, b, c] = [(0.0, 0.0), (10.0, 20.0), (30.0, 0.0)].map(|(x, y)| Point::new(x, y));
        let middle = samples(&cubic(a, b, c)).nth(STEPS / 2).unwrap();
        assert!((middle.x - 12.5).abs() < 1e-9 && (middle.y - 10.0).abs() < 1e-9, "{middle:?}");
        assert!((distance(&cubic(a, b, c), Point::new(12.5, 13.0)) - 3.0).abs() < 0.1);
    }

    #[test]
    fn boxes_that_touch_do_not_hit_without_a_gap() {
        let one = Boxed::around(Point::new(0.0, 0.0), 10.0, 10.0);
        let two = Boxed::around(Point::new(10.0, 0.0), 10.0, 10.0);
        assert!(!one.hits(&two, 0.0) && one.hits(&two, 1.0));
        assert!(one.hits_circle(Point::new(8.0, 0.0), 3.1) && !one.hits_circle(Point::new(8.0, 8.0), 4.0));
    }
}
