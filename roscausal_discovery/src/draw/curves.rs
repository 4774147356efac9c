//! Curves of figures over settings, such as recall against length.

use super::svg::{FAINT, INK, Point, Svg};

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 250.0;
/// Space for the numbers on the left and below.
const MARGIN: (f64, f64) = (52.0, 40.0);
const TITLE: f64 = 40.0;
const PER_ROW: usize = 2;
/// Distance from one name to the next.
const LINE: f64 = 15.0;
/// Steps of the vertical axis.
const STEPS: u32 = 4;
/// Distinguishable for colour-blind readers (Okabe and Ito 2008); the dots differ too.
const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// A named line through points `(x, y)`; points that are not finite are left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// Its points, `x` rising.
    pub points: Vec<(f64, f64)>,
}

/// Curves on common axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What is drawn.
    pub title: String,
    /// Bottom and top of the vertical axis; `None`: from 0 to the largest value.
    pub range: Option<(f64, f64)>,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// Panels over the same horizontal axis as SVG, two per row.
pub fn curves(title: &str, x_label: &str, panels: &[Panel]) -> String {
    let rows = panels.len().div_ceil(PER_ROW).max(1);
    let mut svg = Svg::new(WIDTH * PER_ROW as f64, TITLE + HEIGHT * rows as f64);
    svg.text(Point::new(14.0, 24.0), 14.0, "start", INK, title);
    for (place, panel) in panels.iter().enumerate() {
        let at = Point::new(WIDTH * (place % PER_ROW) as f64, TITLE + HEIGHT * (place / PER_ROW) as f64);
        draw(&mut svg, at, x_label, panel);
    }
    svg.finish()
}

fn draw(svg: &mut Svg, at: Point, x_label: &str, panel: &Panel) {
    let is_finite = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
    let points = || panel.curves.iter().flat_map(|curve| &curve.points).filter(is_finite);
    let largest = points().map(|p| p.1).fold(0.0, f64::max);
    let (low, high) = panel.range.unwrap_or((0.0, round_top(largest)));
    let from = points().map(|p| p.0).fold(f64::INFINITY, f64::min).min(0.0);
    let to = points().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
    let to = if to > from { to } else { from + 1.0 };
    let (left, right) = (at.x + MARGIN.0, at.x + WIDTH - 18.0);
    let (top, bottom) = (at.y + 26.0, at.y + HEIGHT - MARGIN.1);
    let x = |value: f64| left + (right - left) * (value - from) / (to - from);
    let y = |value: f64| bottom - (bottom - top) * (value - low) / (high - low);

    svg.text(Point::new(left, at.y + 16.0), 12.0, "start", INK, &panel.title);
    for tick in 0..=STEPS {
        let value = low + (high - low) * f64::from(tick) / f64::from(STEPS);
        svg.raw(&format!(
            "<path d=\"M {left:.1} {y:.1} H {right:.1}\" stroke=\"{FAINT}\" stroke-width=\"0.5\"/>",
            y = y(value)
        ));
        svg.text(Point::new(left - 6.0, y(value) + 4.0), 10.0, "end", INK, &short(value));
    }
    let mut ticks: Vec<f64> = points().map(|p| p.0).collect();
    ticks.sort_by(f64::total_cmp);
    ticks.dedup();
    let mut last = f64::NEG_INFINITY;
    for tick in ticks {
        if x(tick) - last > 24.0 {
            last = x(tick);
            svg.text(Point::new(last, bottom + 14.0), 10.0, "middle", INK, &short(tick));
        }
    }
    svg.text(Point::new((left + right) / 2.0, bottom + 30.0), 11.0, "middle", INK, x_label);

    let ends: Vec<f64> = points().filter(|p| p.0 >= to).map(|p| p.1).collect();
    let ends_low = ends.iter().sum::<f64>() < 0.5 * (low + high) * ends.len() as f64;
    // The names are stacked on the right, where the curves are not.
    let first_name = if ends_low { top + 16.0 } else { bottom + 8.0 - LINE * panel.curves.len() as f64 };
    for (i, curve) in panel.curves.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let finite = curve.points.iter().filter(is_finite);
        let finite: Vec<Point> = finite.map(|p| Point::new(x(p.0), y(p.1))).collect();
        let path: Vec<String> = finite.iter().map(|p| format!("{:.1} {:.1}", p.x, p.y)).collect();
        if !path.is_empty() {
            svg.raw(&format!(
                "<path d=\"M {}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
                path.join(" L ")
            ));
        }
        for p in finite {
            svg.raw(&format!("<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\" fill=\"{colour}\"/>", p.x, p.y));
        }
        let name = Point::new(right - 4.0, first_name + LINE * i as f64);
        svg.text(name, 11.0, "end", colour, &curve.name);
    }
}

/// The top of an axis that starts at 0, contains `largest`, and has round numbers at its steps.
fn round_top(largest: f64) -> f64 {
    let step = largest / f64::from(STEPS);
    let unit = libm::pow(10_f64, libm::log10(step).floor());
    let round = [1.0, 2.0, 2.5, 5.0, 10.0].map(|factor| factor * unit);
    // A little slack, because a power of ten need not be exact.
    let enough = round.into_iter().find(|round| *round >= step * (1.0 - 1e-9));
    enough.filter(|round| *round > 0.0).map_or(1.0, |round| round * f64::from(STEPS))
}

/// A number in few characters, such as 300, 3.33 or 0.025.
fn short(value: f64) -> String {
    let text = if value.abs() >= 100.0 { format!("{value:.0}") } else { format!("{value:.3}") };
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_point_is_drawn_in_its_place() {
        let curve =
            Curve { name: "a → b".into(), points: vec![(0.0, 0.0), (100.0, 1.0), (200.0, f64::NAN)] };
        let panel = Panel { title: "recall".into(), range: Some((0.0, 1.0)), curves: vec![curve] };
        let svg = curves("title", "length (s)", &[panel]);
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(
            svg.contains("cx=\"52.0\" cy=\"250.0\"") && svg.contains("cx=\"442.0\" cy=\"66.0\""),
            "{svg}"
        );
        assert!(svg.contains("a → b") && svg.contains("length (s)") && !svg.contains("NaN"));
    }

    #[test]
    fn nothing_at_all_is_a_picture_too() {
        assert!(curves("", "", &[]).starts_with("<svg"));
        let empty = Panel { title: String::new(), range: None, curves: vec![] };
        assert!(!curves("", "", &[empty]).contains("inf"));
    }

    #[test]
    fn an_axis_has_round_numbers() {
        let tops = [(1.85, 2.0), (3.7, 4.0), (4.0, 4.0), (4.1, 8.0), (0.03, 0.04), (1234.0, 2000.0)];
        for (largest, top) in tops {
            assert!((round_top(largest) / top - 1.0).abs() < 1e-9, "{largest}: {}", round_top(largest));
        }
        assert_eq!([0.0, f64::NAN].map(round_top), [1.0, 1.0]);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([300.0, 3.333_333, 0.025, 100.0, 0.0].map(short), ["300", "3.333", "0.025", "100", "0"]);
    }
}
