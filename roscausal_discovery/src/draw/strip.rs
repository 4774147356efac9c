//! Strengths of links over time: one strip per link, with intervals, and marks where something changed.

use super::{
    axis::Axis,
    point::Point,
    svg::{FAINT, INK, NEGATIVE, POSITIVE, Svg, escaped},
};

/// What a picture of links over time shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Strips {
    /// One line above the picture.
    pub title: String,
    /// What the numbers of the time axis are.
    pub unit: String,
    /// A strip for each link.
    pub links: Vec<Strip>,
    /// Times at which something changed, and what.
    pub changes: Vec<(f64, String)>,
}

/// One link over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Strip {
    /// Its name.
    pub name: String,
    /// Its points, in the order of time.
    pub points: Vec<StripPoint>,
}

/// The strength of a link in one model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StripPoint {
    /// When.
    pub time: f64,
    /// Strength.
    pub value: f64,
    /// Strengths in nine of ten resamples, if there were any.
    pub interval: Option<(f64, f64)>,
    /// Whether the model has the link.
    pub found: bool,
}

/// Left and right of the strips.
const LEFT: f64 = 190.0;
const RIGHT: f64 = 20.0;
const WIDTH: f64 = 860.0;
/// Height of a strip, and of the part of it that is drawn in.
const STRIP: f64 = 62.0;
const INNER: f64 = 46.0;
const TOP: f64 = 44.0;

/// The picture as SVG. A full dot: the model has the link; an empty one: it does not.
pub fn strips(of: &Strips) -> String {
    let foot = TOP + STRIP * of.links.len().max(1) as f64;
    let mut svg = Svg::new(WIDTH, foot + 62.0);
    svg.text(Point::new(16.0, 26.0), 15.0, "start", INK, &of.title);
    let times = || of.links.iter().flat_map(|strip| strip.points.iter().map(|point| point.time));
    let time = Axis::around(times().chain(of.changes.iter().map(|(at, _)| *at)), LEFT, WIDTH - RIGHT);
    for (at, what) in &of.changes {
        let x = time.at(*at);
        svg.raw(&format!(
            "<g class=\"change\"><title>{}</title><path d=\"M {x:.1} {TOP} V {foot:.1}\" stroke=\"{INK}\" stroke-width=\"1.6\" \
             stroke-dasharray=\"4 3\"/></g>",
            escaped(what)
        ));
    }
    for (row, strip) in of.links.iter().enumerate() {
        draw_strip(&mut svg, strip, &time, TOP + STRIP * row as f64);
    }
    if of.links.is_empty() {
        svg.text(Point::new(WIDTH / 2.0, TOP + 30.0), 15.0, "middle", FAINT, "no link in any model");
    }
    for tick in time.ticks(8) {
        svg.text(Point::new(time.at(tick), foot + 14.0), 10.0, "middle", INK, &format!("{tick}"));
    }
    svg.text(Point::new((LEFT + WIDTH - RIGHT) / 2.0, foot + 32.0), 12.0, "middle", INK, &of.unit);
    let legend = "full: in the model; empty: not; bars: nine of ten resamples; dashed: a confirmed change";
    svg.text(Point::new(16.0, foot + 52.0), 12.0, "start", INK, legend);
    svg.finish()
}

fn draw_strip(svg: &mut Svg, strip: &Strip, time: &Axis, top: f64) {
    let ends = |point: &StripPoint| {
        let (low, high) = point.interval.unwrap_or((point.value, point.value));
        [point.value, low, high]
    };
    let values = strip.points.iter().flat_map(ends).chain([0.0]);
    let axis = Axis::around(values, top + INNER, top + 4.0);
    svg.text(Point::new(16.0, top + 0.5 * STRIP), 12.0, "start", INK, &strip.name);
    axis.draw_left(svg, LEFT - 8.0, WIDTH - RIGHT, 3);
    for point in strip.points.iter().filter(|point| point.value.is_finite()) {
        let (x, y) = (time.at(point.time), axis.at(point.value));
        let colour = if point.value < 0.0 { NEGATIVE } else { POSITIVE };
        if let Some((low, high)) = point.interval {
            svg.raw(&format!(
                "<path d=\"M {x:.1} {:.1} V {:.1}\" stroke=\"{colour}\" stroke-width=\"2\" stroke-opacity=\"0.45\"/>",
                axis.at(low),
                axis.at(high)
            ));
        }
        let fill = if point.found { colour } else { "#ffffff" };
        svg.raw(&format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.4\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.4\"/>"
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_model_is_a_dot_and_each_change_a_line() {
        let point = |time: f64, found| StripPoint { time, value: -0.3, interval: Some((-0.4, -0.1)), found };
        let strip =
            Strip { name: "a → b, lag 1".into(), points: vec![point(0.0, true), point(9.0, false)] };
        let of = Strips { links: vec![strip], changes: vec![(4.0, "<a>".into())], ..Strips::default() };
        let svg = strips(&of);
        assert_eq!((svg.matches("<circle").count(), svg.matches("class=\"change\"").count()), (2, 1));
        assert!(svg.contains("&lt;a&gt;") && svg.contains("fill=\"#ffffff\" stroke"));
        assert!(strips(&Strips::default()).contains("no link in any model"));
    }
}
