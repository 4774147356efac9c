//! What a row of a table of trajectories says of an agent, and in which unit.

/// The unit of positions: how many metres one is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionUnit(f64);

impl PositionUnit {
    pub(super) const METRES: Self = Self(1.0);
    pub(super) const CENTIMETRES: Self = Self(0.01);
    pub(super) const MILLIMETRES: Self = Self(0.001);
    pub(super) const FEET: Self = Self(0.3048);

    /// Units in a metre.
    pub(super) fn per_metre(self) -> f64 {
        1.0 / self.0
    }
}

impl std::str::FromStr for PositionUnit {
    type Err = roscausal_discovery::Error;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let word = text.to_ascii_lowercase();
        let unit = match word.as_str() {
            "m" => Some(Self::METRES),
            "cm" => Some(Self::CENTIMETRES),
            "mm" => Some(Self::MILLIMETRES),
            "ft" | "feet" => Some(Self::FEET),
            // A length, such as that of a pixel.
            _ => word.strip_suffix('m').and_then(|metres| metres.trim_end().parse().ok()).map(Self),
        };
        unit.filter(|unit| unit.0.is_finite() && unit.0 > 0.0)
            .ok_or_else(|| Self::Err::unknown("position_unit", text, &["m", "cm", "mm", "ft", "0.03m"]))
    }
}

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
