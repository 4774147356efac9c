//! A point of a picture.

/// A point in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub x: f64,
    pub y: f64,
}

impl Point {
    pub(crate) fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    pub(crate) fn plus(self, dx: f64, dy: f64) -> Self {
        Self::new(self.x + dx, self.y + dy)
    }

    /// Unit vector from here to `other`; to the right if they are the same point.
    pub(crate) fn towards(self, other: Self) -> Self {
        let (dx, dy) = (other.x - self.x, other.y - self.y);
        let length = libm::hypot(dx, dy);
        if length > 0.0 { Self::new(dx / length, dy / length) } else { Self::new(1.0, 0.0) }
    }
}
