//! The line search of Moré and Thuente (1994): a step with sufficient decrease and small slope, by safeguarded
//! cubic and quadratic interpolation.

/// Sufficient decrease: `f(t) <= f(0) + DECREASE * t * f'(0)`.
const DECREASE: f64 = 1e-3;
/// Small slope: `|f'(t)| <= SLOPE * |f'(0)|`.
const SLOPE: f64 = 0.9;
/// Relative width of the bracket at which to stop.
const WIDTH: f64 = 0.1;

/// What to do after an evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    /// Evaluate at this step next.
    Try(f64),
    /// The last step is good, or as good as it gets.
    Done,
    /// The numbers make no sense.
    Failed,
}

/// A step with the function and its slope there.
#[derive(Clone, Copy, Debug)]
struct Trial {
    step: f64,
    value: f64,
    slope: f64,
}

/// State of a search.
#[derive(Clone, Debug)]
pub(super) struct LineSearch {
    start: Trial,
    longest: f64,
    current: f64,
    /// Best step so far.
    best: Trial,
    /// The other end of the interval that holds the minimum.
    other: Trial,
    bracketed: bool,
    /// First stage: no step yet with sufficient decrease and a slope above that of the decrease.
    first_stage: bool,
    shortest_allowed: f64,
    longest_allowed: f64,
    width: f64,
    width_before: f64,
}

impl LineSearch {
    /// A search from `value` with `slope < 0`, whose first trial is `first`, up to `longest`.
    pub(super) fn new(value: f64, slope: f64, first: f64, longest: f64) -> Self {
        let start = Trial { step: 0.0, value, slope };
        Self {
            start,
            longest,
            current: first,
            best: start,
            other: start,
            bracketed: false,
            first_stage: true,
            shortest_allowed: 0.0,
            longest_allowed: 5.0 * first,
            width: longest,
            width_before: 2.0 * longest,
        }
    }

    /// Takes the value and slope at the step last asked for.
    pub(super) fn next(&mut self, value: f64, slope: f64) -> Step {
        if value.is_nan() || slope.is_nan() {
            return Step::Failed;
        }
        let now = Trial { step: self.current, value, slope };
        let decrease_slope = DECREASE * self.start.slope;
        let ceiling = self.start.value + now.step * decrease_slope;
        if self.first_stage && now.value <= ceiling && now.slope >= decrease_slope {
            self.first_stage = false;
        }
        let at_edge = now.step <= self.shortest_allowed || now.step >= self.longest_allowed;
        let narrow = self.longest_allowed - self.shortest_allowed <= WIDTH * self.longest_allowed;
        if self.bracketed && (at_edge || narrow)
            || now.step == self.longest && now.value <= ceiling && now.slope <= decrease_slope
            || now.step == 0.0 && (now.value > ceiling || now.slope >= decrease_slope)
            || now.value <= ceiling && now.slope.abs() <= SLOPE * -self.start.slope
        {
            return Step::Done;
        }
        self.current = if self.first_stage && now.value <= self.best.value && now.value > ceiling {
            // Work on the function minus its sufficient decrease.
            let tilt = |t: Trial, sign: f64| Trial {
                value: t.value - sign * t.step * decrease_slope,
                slope: t.slope - sign * decrease_slope,
                ..t
            };
            (self.best, self.other) = (tilt(self.best, 1.0), tilt(self.other, 1.0));
            let next = self.interpolate(tilt(now, 1.0));
            (self.best, self.other) = (tilt(self.best, -1.0), tilt(self.other, -1.0));
            next
        } else {
            self.interpolate(now)
        };
        if self.bracketed {
            if (self.other.step - self.best.step).abs() >= 0.66 * self.width_before {
                self.current = self.best.step + 0.5 * (self.other.step - self.best.step);
            }
            self.width_before = self.width;
            self.width = (self.other.step - self.best.step).abs();
            self.shortest_allowed = self.best.step.min(self.other.step);
            self.longest_allowed = self.best.step.max(self.other.step);
        } else {
            self.shortest_allowed = self.current + 1.1 * (self.current - self.best.step);
            self.longest_allowed = self.current + 4.0 * (self.current - self.best.step);
        }
        self.current = self.current.clamp(0.0, self.longest);
        let at_edge = self.current <= self.shortest_allowed || self.current >= self.longest_allowed;
        let narrow = self.longest_allowed - self.shortest_allowed <= WIDTH * self.longest_allowed;
        if self.bracketed && (at_edge || narrow) {
            self.current = self.best.step;
        }
        Step::Try(self.current)
    }

    /// The next trial by interpolation (section 4 of the paper); moves the interval.
    fn interpolate(&mut self, now: Trial) -> f64 {
        let (best, other) = (self.best, self.other);
        let opposite = now.slope * best.slope.signum() < 0.0;
        let next;
        if now.value > best.value {
            // Higher: the minimum is between; cubic, or halfway to the quadratic.
            let cubic = cubic(best, now);
            let chord = (best.value - now.value) / (now.step - best.step);
            let quadratic = best.step + best.slope / (chord + best.slope) / 2.0 * (now.step - best.step);
            next = if (cubic - best.step).abs() < (quadratic - best.step).abs() {
                cubic
            } else {
                cubic + (quadratic - cubic) / 2.0
            };
            self.bracketed = true;
        } else if opposite {
            // Lower, slopes of opposite sign: the minimum is between; the longer of cubic and secant steps.
            let (cubic, secant) = (cubic(now, best), secant(now, best));
            next = if (cubic - now.step).abs() > (secant - now.step).abs() { cubic } else { secant };
            self.bracketed = true;
        } else if now.slope.abs() < best.slope.abs() {
            // Lower, the slope falls: extrapolate, not too near the other end.
            let far = if now.step > best.step { self.longest_allowed } else { self.shortest_allowed };
            let cubic = cubic_extrapolation(now, best).unwrap_or(far);
            let secant = secant(now, best);
            let cubic_is_nearer = (cubic - now.step).abs() < (secant - now.step).abs();
            if self.bracketed {
                let step = if cubic_is_nearer { cubic } else { secant };
                let limit = now.step + 0.66 * (other.step - now.step);
                next = if now.step > best.step { step.min(limit) } else { step.max(limit) };
            } else {
                let step = if cubic_is_nearer { secant } else { cubic };
                next = step.clamp(self.shortest_allowed, self.longest_allowed);
            }
        } else if self.bracketed {
            // Lower, the slope does not fall: cubic with the other end.
            next = cubic(now, other);
        } else {
            next = if now.step > best.step { self.longest_allowed } else { self.shortest_allowed };
        }
        if now.value > best.value {
            self.other = now;
        } else {
            if opposite {
                self.other = best;
            }
            self.best = now;
        }
        next
    }
}

/// The parts of the cubic through two trials: `theta`, and `gamma` with its scale inside the root.
fn cubic_parts(a: Trial, b: Trial) -> (f64, f64, f64) {
    let theta = 3.0 * (a.value - b.value) / (b.step - a.step) + a.slope + b.slope;
    let scale = theta.abs().max(a.slope.abs()).max(b.slope.abs());
    let square = (theta / scale).powi(2) - (a.slope / scale) * (b.slope / scale);
    (theta, scale, square)
}

/// Minimum of the cubic through `a` and `b`, as a step from `a`.
fn cubic(a: Trial, b: Trial) -> f64 {
    let (theta, scale, square) = cubic_parts(a, b);
    let gamma = scale * square.max(0.0).sqrt() * if b.step < a.step { -1.0 } else { 1.0 };
    let (p, q) = ((gamma - a.slope) + theta, ((gamma - a.slope) + gamma) + b.slope);
    a.step + p / q * (b.step - a.step)
}

/// The same beyond `a`, if the cubic has a minimum there.
fn cubic_extrapolation(a: Trial, b: Trial) -> Option<f64> {
    let (theta, scale, square) = cubic_parts(a, b);
    let gamma = scale * square.max(0.0).sqrt() * if a.step > b.step { -1.0 } else { 1.0 };
    let (p, q) = ((gamma - a.slope) + theta, (gamma + (b.slope - a.slope)) + gamma);
    (p / q < 0.0 && gamma != 0.0).then(|| a.step + p / q * (b.step - a.step))
}

/// Zero of the line through the slopes, as a step from `a`.
fn secant(a: Trial, b: Trial) -> f64 {
    a.step + a.slope / (a.slope - b.slope) * (b.step - a.step)
}
