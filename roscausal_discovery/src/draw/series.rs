//! The time series of a batch.

use ndarray::ArrayView2;

use super::svg::{INK, Point, Svg, display};

const WIDTH: f64 = 900.0;
const LEFT: f64 = 110.0;
const STRIP: f64 = 110.0;

/// The time series of a batch as SVG, one strip per variable. `values` is `T x N`; a missing sample interrupts the
/// line.
pub fn series(names: &[String], values: ArrayView2<f64>, dt: Option<f64>) -> String {
    let (rows, height) = (values.nrows(), 40.0 + STRIP * names.len() as f64 + 30.0);
    let mut svg = Svg::new(WIDTH, height);
    let x = |row: usize| LEFT + (WIDTH - LEFT - 20.0) * row as f64 / rows.saturating_sub(1).max(1) as f64;
    for (strip, (name, column)) in names.iter().zip(values.columns()).enumerate() {
        let finite = column.iter().copied().filter(|v| v.is_finite());
        let low = finite.clone().fold(f64::INFINITY, f64::min);
        let high = finite.fold(f64::NEG_INFINITY, f64::max);
        let (top, bottom) = (30.0 + STRIP * strip as f64, 30.0 + STRIP * (strip as f64 + 0.82));
        let span = if high > low { high - low } else { 1.0 };
        svg.text(Point::new(12.0, (top + bottom) / 2.0 + 5.0), 14.0, "start", INK, &display(name));
        svg.raw(&format!(
            "<path d=\"M {LEFT} {top:.1} V {bottom:.1} H {:.1}\" fill=\"none\" stroke=\"{INK}\" stroke-width=\"1\"/>",
            WIDTH - 20.0
        ));
        if low.is_finite() {
            svg.text(Point::new(LEFT - 6.0, top + 10.0), 10.0, "end", INK, &format!("{high:.3}"));
            svg.text(Point::new(LEFT - 6.0, bottom), 10.0, "end", INK, &format!("{low:.3}"));
        }
        let mut path = String::new();
        let mut pen_down = false;
        for (row, value) in column.iter().enumerate() {
            if value.is_finite() {
                let y = bottom - (bottom - top) * (value - low) / span;
                path.push_str(&format!("{} {:.1} {y:.1} ", if pen_down { "L" } else { "M" }, x(row)));
            }
            pen_down = value.is_finite();
        }
        svg.raw(&format!("<path d=\"{path}\" fill=\"none\" stroke=\"#1d4ed8\" stroke-width=\"1.3\"/>"));
    }
    let (length, unit) = match dt {
        Some(dt) => (format!("{:.1}", rows.saturating_sub(1) as f64 * dt), "s"),
        None => (rows.to_string(), "samples"),
    };
    svg.text(Point::new(WIDTH - 20.0, height - 10.0), 12.0, "end", INK, &format!("{length} {unit}"));
    svg.finish()
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn a_missing_sample_breaks_the_line() {
        let values = array![[0.0], [1.0], [f64::NAN], [2.0], [3.0]];
        let svg = series(&["h_v".to_owned()], values.view(), Some(0.1));
        let line = svg.lines().find(|line| line.contains("#1d4ed8")).expect("has a line");
        assert_eq!(line.matches("M ").count(), 2);
        assert!(!svg.contains("NaN"));
    }
}
