//! Axes with round numbers.

use super::{
    point::Point,
    svg::{FAINT, INK, Svg},
};

/// Size of the numbers.
const TEXT: f64 = 10.0;

/// A range of values and where it is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    /// Pixels of `low` and `high`.
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Axis {
    /// An axis that holds all of the values that are finite, with a little room; 0 to 1 without any.
    pub(super) fn around(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|value| value.is_finite()) {
            (low, high) = (low.min(value), high.max(value));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let room = if high > low { 0.04 * (high - low) } else { 0.5 * high.abs().max(1e-3) };
        Self { low: low - room, high: high + room, from, to }
    }

    /// The pixel of a value.
    pub(super) fn at(&self, value: f64) -> f64 {
        self.from + (self.to - self.from) * (value - self.low) / (self.high - self.low)
    }

    /// About `count` round numbers on the axis: multiples of 1, 2 or 5 times a power of ten.
    pub(super) fn ticks(&self, count: usize) -> Vec<f64> {
        let rough = (self.high - self.low) / count.max(1) as f64;
        let unit = libm::pow(10_f64, libm::log10(rough).floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].map(|f| f * unit).into_iter().find(|step| *step >= rough * (1.0 - 1e-9));
        let Some(step) = step.filter(|step| *step > 0.0 && step.is_finite()) else { return Vec::new() };
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last.min(first + 50)).map(|k| k as f64 * step).collect()
    }

    /// Draws the numbers left of the vertical line at `x`, with faint lines to `right`.
    pub(super) fn draw_left(&self, svg: &mut Svg, x: f64, right: f64, count: usize) {
        let ticks = self.ticks(count);
        for &tick in &ticks {
            let y = self.at(tick);
            svg.raw(&format!(
                "<path d=\"M {x:.1} {y:.1} H {right:.1}\" stroke=\"{FAINT}\" stroke-width=\"0.4\"/>"
            ));
            svg.text(Point::new(x - 5.0, y + 3.5), TEXT, "end", INK, &number(tick, &ticks));
        }
    }

    /// Draws the numbers below the horizontal line at `y`.
    pub(super) fn draw_below(&self, svg: &mut Svg, y: f64, count: usize) {
        let ticks = self.ticks(count);
        for &tick in &ticks {
            let x = self.at(tick);
            svg.raw(&format!("<path d=\"M {x:.1} {y:.1} v 4\" stroke=\"{INK}\" stroke-width=\"0.8\"/>"));
            svg.text(Point::new(x, y + 14.0), TEXT, "middle", INK, &number(tick, &ticks));
        }
    }
}

/// A tick with as many decimals as tell it from its neighbours.
fn number(tick: f64, ticks: &[f64]) -> String {
    let step = if let [a, b, ..] = ticks { b - a } else { tick.abs().max(1.0) };
    let largest = ticks.iter().fold(0.0_f64, |most, tick| most.max(tick.abs()));
    if largest >= 1e6 || (largest > 0.0 && largest < 1e-3) {
        return format!("{tick:.1e}");
    }
    let decimals = (-libm::log10(step)).ceil().clamp(0.0, 9.0) as usize;
    let text = format!("{tick:.decimals$}");
    if text.trim_start_matches('-').trim_matches(['0', '.']).is_empty() {
        text.replace('-', "")
    } else {
        text.replace('-', "−")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_axis() {
        let axis = Axis { low: -0.13, high: 0.94, from: 100.0, to: 0.0 };
        let ticks = axis.ticks(5);
        let words: Vec<String> = ticks.iter().map(|&tick| number(tick, &ticks)).collect();
        assert_eq!(words, ["0.0", "0.5"]);
        assert!((axis.at(0.94)).abs() < 1e-9 && (axis.at(-0.13) - 100.0).abs() < 1e-9);
    }

    #[test]
    fn a_constant_and_nothing_have_an_axis() {
        let constant = Axis::around([3.0; 4].into_iter(), 0.0, 1.0);
        assert!(constant.low < 3.0 && constant.high > 3.0 && !constant.ticks(4).is_empty());
        let nothing = Axis::around([f64::NAN].into_iter(), 0.0, 1.0);
        assert!(nothing.low < 0.0 && nothing.high > 1.0);
    }
}
