//! The search for the maximum of a likelihood: the path of the textbook's L-BFGS-B, at a fraction of its cost.
//!
//! A likelihood has several maxima, and which one is the answer is a matter of the path: here the one that exact likelihoods
//! take from `l = s = 1`. Three things make it cheap, and none of them may change where it ends:
//!
//! 1. **Loose likelihoods**, where samples are many. Each is only as exact as its gradient is large ([`LOOSE`]). Beside the search run shadows of it:
//!    copies that are told every value and gradient moved by several times its error. While all of them ask for the next
//!    likelihood at nearly the same place, the errors do not matter: the exact search is one more copy among them. As soon as
//!    one goes elsewhere or ends earlier, the whole search is repeated with likelihoods exact to [`TIGHT`].
//! 2. **The end on a model.** Near the maximum the search goes on with a cubic model of the likelihood in its place
//!    ([`super::local_model`]), from the very state that it is in. That counts only where the model is certainly convex, knows
//!    its end well enough, and leaves less to gain than [`Level::near`] from the last iterate.
//! 3. **A likelihood where the model ends**, where the model knows it not well enough yet: it corrects the model. One that the
//!    model did not foresee makes it wait until the search has come nearer.
//!
//! `docs/gpdc.md` has the measurements behind each constant.

use super::{
    lbfgsb::{Minimizer, Point, Tolerances},
    local_model::{CubicModel, Predicted, Seen},
    theta::BOUNDS,
};

/// Likelihoods whose errors the shadows watch.
const LOOSE: Level = Level { fraction: 1e-4, least: 1e-4, near: 5e-5, shadows: 4 };
/// Likelihoods whose errors are below what the path can tell.
const TIGHT: Level = Level { fraction: 1e-8, least: 1e-8, near: 5e-5, shadows: 0 };
/// Samples up to which a search begins with tight likelihoods. Of 20,000 regressions on 40 to 240 samples loose ones changed the
/// maximum of two, on 49 and 108 samples, in a way that no shadow saw.
const FEW_SAMPLES: usize = 160;
/// How many times its error a gradient or value is moved by for a shadow.
const SAFETY: f64 = 3.0;
/// Distance at which a shadow has left the path, in logarithms; and what each unit of the last step adds.
const APART: f64 = 0.01;
const APART_PER_STEP: f64 = 0.04;
/// The gradient is expected to fall to this fraction of the smallest so far.
const NEXT_GRADIENT: f64 = 0.3;

/// Steps that are followed on a model at the most, and how far they may lead.
const MODEL_STEPS: usize = 30;
const MODEL_RADIUS: f64 = 0.5;
/// What may be left to gain where the search ends on a model: more would be a stop before the maximum, which depends on digits
/// that a model does not have.
const STATIONARY: f64 = 2e-5;
/// A decrease so many times the stopping rule's may be one to stop at.
const NEARLY_STOPPING: f64 = 10.0;
/// Curvature, in its standard deviations, from which on a model is certainly convex.
const CERTAINLY_CONVEX: f64 = 4.0;
/// What the end may be expected to leave to gain: as a fraction of the stopping rule, to end there; as a fraction of what it
/// gains, to evaluate the likelihood there.
const UNSEEN: f64 = 0.15;
const TRUSTED: f64 = 0.05;
/// Error of a gradient at the end, as a fraction of the one expected; and what it may leave, as a fraction of the stopping rule.
const ERROR_AT_END: f64 = 0.06;
const LEFT_BY_ERROR: f64 = 0.05 * UNSEEN;
/// Curvature, for each sample, below which an end may be a shelf that the path leaves again; and how near to such an end a likelihood
/// must have been seen.
const SHELF: f64 = 0.01;
const SEEN_NEAR: f64 = 1e-3;
/// Standard deviations at which a gradient is a surprise, and the part of `near` within which the model is tried again then.
const SURPRISE: f64 = 5.0;
const NEARER: f64 = 0.1;

/// How exact the likelihoods of a search are, and when its end is left to a model.
struct Level {
    /// Error of a gradient, as a fraction of its largest component.
    fraction: f64,
    /// An error that serves however small the gradient is.
    least: f64,
    /// Log likelihood that the end on a model may gain.
    near: f64,
    /// Copies that are told errors.
    shadows: usize,
}

/// How exact one gradient is to be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accuracy {
    /// Its largest component, as expected.
    pub(super) expected: f64,
    fraction: f64,
    least: f64,
}

impl Accuracy {
    /// The error of a gradient whose largest component is `steepness`.
    pub(super) fn error(&self, steepness: f64) -> f64 {
        (self.fraction * steepness).max(self.least)
    }
}

/// What a search has come to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    /// The maximum: `(ln l, ln s)`, and minus the log likelihood there.
    pub(super) optimum: Point<2>,
    /// Whether the errors of loose likelihoods could have changed the path, so that it was searched again.
    pub(super) repeated: bool,
}

/// The minimum that L-BFGS-B reaches from `(0, 0)`; `evaluate` gives the function as exactly as asked for.
/// Of `n_samples` that are few the likelihoods are tight from the start: they cost little there.
///
/// # Errors
/// Those of `evaluate`.
pub(super) fn search<E>(
    n_samples: usize,
    mut evaluate: impl FnMut([f64; 2], Accuracy) -> Result<Seen, E>,
) -> Result<Found, E> {
    let few = n_samples <= FEW_SAMPLES;
    if !few && let Some(optimum) = Path::new(&LOOSE, n_samples).follow(&mut evaluate)? {
        return Ok(Found { optimum, repeated: false });
    }
    let nowhere = Point { x: [0.0; 2], value: f64::INFINITY, gradient: [0.0; 2] };
    let optimum = Path::new(&TIGHT, n_samples).follow(&mut evaluate)?.unwrap_or(nowhere);
    Ok(Found { optimum, repeated: !few })
}

/// The textbook's search, each likelihood by `evaluate`.
///
/// # Errors
/// Those of `evaluate`.
pub(super) fn textbook<E>(
    start: [f64; 2],
    mut evaluate: impl FnMut([f64; 2]) -> Result<(f64, [f64; 2]), E>,
) -> Result<Point<2>, E> {
    let mut minimizer = Minimizer::new(start, BOUNDS, Tolerances::default());
    while let Some(x) = minimizer.wants {
        let (value, gradient) = evaluate(x)?;
        minimizer.tell(value, gradient);
    }
    Ok(minimizer.best().unwrap_or(Point { x: start, value: f64::INFINITY, gradient: [0.0; 2] }))
}

/// A search under way.
struct Path<'a> {
    level: &'a Level,
    /// Curvature below which an end may be a shelf.
    shelf: f64,
    near: f64,
    minimizer: Minimizer<2>,
    shadows: Vec<Minimizer<2>>,
    trail: Vec<Seen>,
}

impl<'a> Path<'a> {
    fn new(level: &'a Level, n_samples: usize) -> Self {
        let minimizer = Minimizer::new([0.0; 2], BOUNDS, Tolerances::default());
        let shadows = vec![minimizer.clone(); level.shadows];
        Self {
            level,
            shelf: SHELF * n_samples as f64,
            near: level.near,
            minimizer,
            shadows,
            trail: Vec::new(),
        }
    }

    /// Where the path ends; `None` where a shadow left it.
    fn follow<E>(
        mut self,
        evaluate: &mut impl FnMut([f64; 2], Accuracy) -> Result<Seen, E>,
    ) -> Result<Option<Point<2>>, E> {
        while let Some(x) = self.minimizer.wants {
            if let Some(end) = self.end_on_model() {
                if end.is_known() {
                    return Ok(Some(end.optimum));
                }
                let seen = evaluate(end.optimum.x, end.accuracy())?;
                if end.is_surprised_by(&seen) {
                    self.near *= NEARER;
                }
                self.trail.push(seen);
                continue;
            }
            let seen = evaluate(x, self.accuracy())?;
            if !self.shadows_agree(&seen) {
                return Ok(None);
            }
            self.minimizer.tell(seen.point.value, seen.point.gradient);
            self.trail.push(seen);
        }
        let all_ended = self.shadows.iter().all(|shadow| shadow.wants.is_none());
        Ok(self.minimizer.best().filter(|_| all_ended))
    }

    fn accuracy(&self) -> Accuracy {
        let smallest = self.trail.iter().map(|seen| steepness(&seen.point)).fold(f64::INFINITY, f64::min);
        let Level { fraction, least, .. } = *self.level;
        Accuracy { expected: NEXT_GRADIENT * smallest, fraction, least }
    }

    /// Tells the shadows what was seen, moved by its errors; `false` where one of them wants it elsewhere.
    fn shadows_agree(&mut self, seen: &Seen) -> bool {
        let (point, count) = (&seen.point, self.trail.len());
        let last = self.minimizer.best().map_or(point.x, |at| at.x);
        let apart = APART + APART_PER_STEP * distance(point.x, last);
        self.shadows.iter_mut().enumerate().all(|(number, shadow)| {
            let Some(wants) = shadow.wants else { return false };
            // To first order, the value where the shadow is.
            let slope = (0..2).map(|i| point.gradient[i] * (wants[i] - point.x[i])).sum::<f64>();
            // Signs that differ from shadow to shadow and from place to place.
            let signs = (number + 1) * (2 * count + 3);
            let moved = |bit: usize, error: f64| SAFETY * if signs >> bit & 1 == 0 { error } else { -error };
            let gradient = [0, 1].map(|i| point.gradient[i] + moved(i, seen.errors[i]));
            shadow.tell(point.value + slope + moved(2, seen.errors[1]), gradient);
            distance(wants, point.x) <= apart
        })
    }

    /// Where the search ends on a model of the likelihood; `None` where the model is not to be relied on.
    fn end_on_model(&self) -> Option<End> {
        let at = self.trail.last()?.point;
        let model = CubicModel::new(&self.trail, self.minimizer.curvatures()?)?;
        let start = self.minimizer.best()?;
        let at_start = model.predict(start.x)?;
        if at_start.above_minimum > 2.0 * self.near {
            return None;
        }
        let enough = Tolerances::default().relative_decrease * at.value.abs().max(1.0);
        // The model's value at the start of the step that is under way may differ from the one that was told.
        let offset = start.value - at_start.value;
        let (mut search, mut before) = (self.minimizer.clone(), start);
        for _ in 0..MODEL_STEPS {
            let Some(x) = search.wants else { break };
            if distance(x, at.x) > MODEL_RADIUS {
                return None;
            }
            let predicted = model.predict(x)?;
            search.tell(predicted.value + offset, predicted.gradient);
            let now = search.best()?;
            if now.x != before.x {
                let nearly_stopping = before.value - now.value < NEARLY_STOPPING * enough;
                if nearly_stopping && predicted.above_minimum > STATIONARY {
                    return None;
                }
                before = now;
            }
        }
        let optimum = search.best()?;
        let predicted = model.predict(optimum.x)?;
        let gain = at_start.value - predicted.value;
        let convex = predicted.curvature > CERTAINLY_CONVEX * predicted.curvature_deviation;
        let ends = search.wants.is_none() && predicted.above_minimum < STATIONARY;
        let is_shelf = predicted.curvature < self.shelf && distance(optimum.x, at.x) > SEEN_NEAR;
        let end = End { optimum, predicted, enough, is_shelf };
        let known = predicted.left <= UNSEEN * enough;
        let trusted = known || predicted.left <= TRUSTED * (at.value - predicted.value);
        (convex && ends && gain <= self.near && trusted).then_some(end)
    }
}

/// Where a search ends on a model.
struct End {
    optimum: Point<2>,
    predicted: Predicted,
    /// The stopping rule's decrease.
    enough: f64,
    /// Whether it is hardly curved, and was not seen from near.
    is_shelf: bool,
}

impl End {
    /// Whether the model knows the end well enough.
    fn is_known(&self) -> bool {
        self.predicted.left <= UNSEEN * self.enough && !self.is_shelf
    }

    /// How exact a likelihood there is to be.
    fn accuracy(&self) -> Accuracy {
        let [u, v] = self.predicted.deviations;
        let least = (2.0 * LEFT_BY_ERROR * self.enough * self.predicted.curvature).sqrt();
        Accuracy { expected: u.max(v), fraction: ERROR_AT_END, least }
    }

    /// Whether the gradient there is not what the model said.
    fn is_surprised_by(&self, seen: &Seen) -> bool {
        (0..2).any(|i| {
            let off = (seen.point.gradient[i] - self.predicted.gradient[i]).abs();
            off > SURPRISE * libm::hypot(self.predicted.deviations[i], seen.errors[i])
        })
    }
}

/// Largest component of a gradient.
fn steepness(point: &Point<2>) -> f64 {
    point.gradient[0].abs().max(point.gradient[1].abs())
}

/// Largest difference of two places.
fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
}
