//! What a row of a table of trajectories says of an agent, and in which unit.

/// The unit of positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PositionUnit {
    /// `m`
    Metres,
    /// `cm`
    Centimetres,
    /// `mm`
    Millimetres,
    /// `ft`
    Feet,
}

impl PositionUnit {
    /// Units in a metre.
    pub(super) fn per_metre(self) -> f64 {
        match self {
            Self::Metres => 1.0,
            Self::Centimetres => 100.0,
            Self::Millimetres => 1000.0,
            Self::Feet => 1.0 / 0.3048,
        }
    }
}

roscausal_discovery::words!(
    PositionUnit, "position_unit": Metres "m", Centimetres "cm", Millimetres "mm", Feet "ft" | "feet"
);

/// What a row says of an agent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    pub(super) time: f64,
    pub(super) place: (f64, f64),
    pub(super) velocity: Option<(f64, f64)>,
    /// Where only the size of the velocity is known; NaN: not even that.
    pub(super) speed: f64,
    pub(super) heading: f64,
    pub(super) goal: (f64, f64),
}

impl Sample {
    /// Of an agent of which only the place is known.
    pub(super) fn at(time: f64, place: (f64, f64)) -> Self {
        let (speed, heading, goal) = (f64::NAN, f64::NAN, (f64::NAN, f64::NAN));
        Self { time, place, velocity: None, speed, heading, goal }
    }
    pub(super) fn turn_into_radians(&mut self) {
        self.heading = self.heading.to_radians();
    }

    /// The velocity of a speed and a heading.
    pub(super) fn with_velocity(&mut self) {
        let (vx, vy) = (self.speed * libm::cos(self.heading), self.speed * libm::sin(self.heading));
        self.velocity = self.velocity.or((vx.is_finite() && vy.is_finite()).then_some((vx, vy)));
    }

    /// Its heading: the one in the table, or that of its velocity.
    pub(super) fn heading(&self, scaled: impl Fn((f64, f64)) -> (f64, f64)) -> f64 {
        match self.velocity.map(scaled) {
            _ if !self.heading.is_nan() => self.heading,
            Some((vx, vy)) => libm::atan2(vy, vx),
            None => 0.0,
        }
    }
}
