//! Plane geometry: vectors, angles, wall segments, convex areas. Metres and radians.

use std::{
    f64::consts::{PI, TAU},
    ops::{Add, AddAssign, Mul, Neg, Sub},
};

use serde::{Deserialize, Serialize};

use crate::rng::Rng;

/// A point or a vector in the plane, written `[x, y]` in files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 2]", into = "[f64; 2]")]
pub struct Vec2 {
    /// First coordinate.
    pub x: f64,
    /// Second coordinate.
    pub y: f64,
}

impl Vec2 {
    /// The zero vector.
    pub const ZERO: Self = Self { x: 0.0, y: 0.0 };

    /// A vector from its coordinates.
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// The vector of length `r` in the direction `angle`.
    pub fn polar(r: f64, angle: f64) -> Self {
        Self { x: r * libm::cos(angle), y: r * libm::sin(angle) }
    }

    /// Scalar product.
    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// Third component of the vector product.
    pub fn cross(self, other: Self) -> f64 {
        self.x * other.y - self.y * other.x
    }

    /// Length.
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// Distance to another point.
    pub fn distance(self, other: Self) -> f64 {
        (other - self).norm()
    }

    /// Direction in (-pi, pi]; 0 for the zero vector.
    pub fn angle(self) -> f64 {
        libm::atan2(self.y, self.x)
    }

    /// The vector of length 1 in the same direction. Zero stays zero.
    pub fn unit(self) -> Self {
        let norm = self.norm();
        if norm > 0.0 { self * (1.0 / norm) } else { Self::ZERO }
    }

    /// The vector rotated to the left by a right angle.
    pub fn left(self) -> Self {
        Self { x: -self.y, y: self.x }
    }

    /// The vector, shortened to at most `limit`.
    pub fn at_most(self, limit: f64) -> Self {
        let norm = self.norm();
        if norm > limit { self * (limit / norm) } else { self }
    }

    /// True when both coordinates are finite.
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite()
    }
}

impl From<[f64; 2]> for Vec2 {
    fn from([x, y]: [f64; 2]) -> Self {
        Self { x, y }
    }
}

impl From<Vec2> for [f64; 2] {
    fn from(v: Vec2) -> Self {
        [v.x, v.y]
    }
}

impl Add for Vec2 {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y }
    }
}

impl AddAssign for Vec2 {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Vec2 {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y }
    }
}

impl Neg for Vec2 {
    type Output = Self;
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y }
    }
}

impl Mul<f64> for Vec2 {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self { x: self.x * factor, y: self.y * factor }
    }
}

/// The lower left and upper right corner of the box around these points; none without points.
pub(crate) fn bounds(points: impl Iterator<Item = Vec2>) -> Option<(Vec2, Vec2)> {
    points.map(|p| (p, p)).reduce(|(min, max), (p, _)| {
        (Vec2::new(min.x.min(p.x), min.y.min(p.y)), Vec2::new(max.x.max(p.x), max.y.max(p.y)))
    })
}

/// The same angle in (-pi, pi].
pub fn wrap(angle: f64) -> f64 {
    let turned = angle.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

impl Rng {
    /// A vector of two independent normals of standard deviation `sd`.
    pub fn normal2(&mut self, sd: f64) -> Vec2 {
        Vec2::new(sd * self.normal(), sd * self.normal())
    }
}

/// A straight wall from `a` to `b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// One end.
    pub a: Vec2,
    /// The other end.
    pub b: Vec2,
}

impl Segment {
    /// A wall from the coordinates of both ends.
    pub const fn new(ax: f64, ay: f64, bx: f64, by: f64) -> Self {
        Self { a: Vec2::new(ax, ay), b: Vec2::new(bx, by) }
    }

    /// The point of the segment that is nearest to `p`.
    pub fn nearest(&self, p: Vec2) -> Vec2 {
        let along = self.b - self.a;
        let length2 = along.dot(along);
        if length2 == 0.0 {
            return self.a;
        }
        self.a + along * ((p - self.a).dot(along) / length2).clamp(0.0, 1.0)
    }

    /// The smallest distance between two segments; 0 if they cross.
    pub fn distance(&self, other: &Self) -> f64 {
        if self.crosses(other) {
            return 0.0;
        }
        let ends = [
            other.nearest(self.a).distance(self.a),
            other.nearest(self.b).distance(self.b),
            self.nearest(other.a).distance(other.a),
            self.nearest(other.b).distance(other.b),
        ];
        ends.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Whether the two have an inner point in common.
    pub fn crosses(&self, other: &Self) -> bool {
        let side = |s: &Self, p: Vec2| (s.b - s.a).cross(p - s.a);
        side(self, other.a) * side(self, other.b) < 0.0 && side(other, self.a) * side(other, self.b) < 0.0
    }
}

/// A convex polygon from which points are drawn. Its corners are in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Area(pub Vec<Vec2>);

impl Area {
    /// A uniformly distributed point in the polygon. With one corner it is that corner, with two it lies on the
    /// line.
    pub fn sample(&self, rng: &mut Rng) -> Vec2 {
        match self.0.as_slice() {
            [] => Vec2::ZERO,
            [point] => *point,
            [a, b] => *a + (*b - *a) * rng.unit(),
            corners => {
                let fan =
                    || corners.windows(2).skip(1).map(|pair| (pair[0] - corners[0], pair[1] - corners[0]));
                let area = |(u, v): (Vec2, Vec2)| u.cross(v).abs() / 2.0;
                let mut left = rng.unit() * fan().map(area).sum::<f64>();
                let (mut r, mut s) = (rng.unit(), rng.unit());
                if r + s > 1.0 {
                    (r, s) = (1.0 - r, 1.0 - s);
                }
                let found = fan().find(|triangle| {
                    left -= area(*triangle);
                    left < 0.0
                });
                let (u, v) = found.or_else(|| fan().next_back()).unwrap_or_default();
                corners[0] + u * r + v * s
            }
        }
    }

    /// Mean of the corners.
    pub fn centre(&self) -> Vec2 {
        let sum = self.0.iter().fold(Vec2::ZERO, |sum, corner| sum + *corner);
        sum * (1.0 / self.0.len().max(1) as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_an_area_lie_inside_and_fill_it_evenly() {
        let square =
            Area(vec![Vec2::new(0.0, 0.0), Vec2::new(2.0, 0.0), Vec2::new(2.0, 1.0), Vec2::new(0.0, 1.0)]);
        let mut rng = Rng::new(1, 1);
        let points: Vec<_> = (0..4000).map(|_| square.sample(&mut rng)).collect();
        assert!(points.iter().all(|p| (0.0..=2.0).contains(&p.x) && (0.0..=1.0).contains(&p.y)));
        let right = points.iter().filter(|p| p.x > 1.0).count();
        let upper = points.iter().filter(|p| p.y > 0.5).count();
        assert!((1850..2150).contains(&right) && (1850..2150).contains(&upper), "{right} {upper}");
    }

    #[test]
    fn segments_know_their_distance() {
        let wall = Segment::new(0.0, 0.0, 4.0, 0.0);
        assert_eq!(wall.nearest(Vec2::new(1.0, 3.0)), Vec2::new(1.0, 0.0));
        assert_eq!(wall.nearest(Vec2::new(-3.0, 4.0)), Vec2::ZERO);
        assert_eq!(wall.distance(&Segment::new(1.0, 2.0, 3.0, 1.0)), 1.0);
        assert_eq!(wall.distance(&Segment::new(1.0, 2.0, 1.0, -1.0)), 0.0);
    }

    #[test]
    fn wrapped_angles_lie_in_half_open_circle() {
        assert_eq!(wrap(PI), PI);
        assert_eq!(wrap(-PI), PI);
        assert!((wrap(3.0 * PI + 0.1) - (0.1 - PI)).abs() < 1e-12);
    }
}
