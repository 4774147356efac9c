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
    /// When regimes began after the first one, and their names, which begins with that of the first one; empty: no band.
    pub regimes: Vec<(f64, String)>,
}

/// One link over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Strip {
    /// Its name.
    pub name: String,
    /// What stands below the name, such as in how many models it is.
    pub note: String,
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

/// Room right of the strips, and for the numbers left of them.
const RIGHT: f64 = 20.0;
const NUMBERS: f64 = 52.0;
/// Width of a letter of a name, about.
const LETTER: f64 = 7.2;
const WIDTH: f64 = 860.0;
/// Height of a strip, and of the part of it that is drawn in.
const STRIP: f64 = 62.0;
const INNER: f64 = 46.0;
const TOP: f64 = 64.0;
/// Top and height of the band of regimes.
const BAND: (f64, f64) = (38.0, 16.0);
/// Fills of regimes, in turn.
const SHADES: [&str; 2] = ["#dbe4ee", "#f3e3d3"];

/// The picture as SVG. A full dot: the model has the link; an empty one: it does not.
pub fn strips(of: &Strips) -> String {
    let foot = TOP + STRIP * of.links.len().max(1) as f64;
    let mut svg = Svg::new(WIDTH, foot + 62.0);
    svg.text(Point::new(16.0, 26.0), 15.0, "start", INK, &of.title);
    let left = left_of(of);
    let times = || of.links.iter().flat_map(|strip| strip.points.iter().map(|point| point.time));
    let time = Axis::around(times().chain(of.changes.iter().map(|(at, _)| *at)), left, WIDTH - RIGHT);
    for (at, what) in &of.changes {
        let x = time.at(*at);
        svg.raw(&format!(
            "<g class=\"change\"><title>{}</title><path d=\"M {x:.1} {TOP} V {foot:.1}\" stroke=\"{INK}\" stroke-width=\"1.6\" \
             stroke-dasharray=\"4 3\"/></g>",
            escaped(what)
        ));
    }
    draw_regimes(&mut svg, of, &time);
    for (row, strip) in of.links.iter().enumerate() {
        draw_strip(&mut svg, strip, &time, TOP + STRIP * row as f64);
    }
    if of.links.is_empty() {
        svg.text(Point::new(WIDTH / 2.0, TOP + 30.0), 15.0, "middle", FAINT, "no link in any model");
    }
    time.draw_below(&mut svg, foot, 8);
    svg.text(Point::new((left + WIDTH - RIGHT) / 2.0, foot + 32.0), 12.0, "middle", INK, &of.unit);
    let legend = "full: in the model; empty: not; bars: nine of ten resamples; dashed: a confirmed change";
    svg.text(Point::new(16.0, foot + 52.0), 12.0, "start", INK, legend);
    svg.finish()
}

/// Where the strips begin: right of the longest name and the numbers, within half of the picture.
fn left_of(of: &Strips) -> f64 {
    let longest =
        of.links.iter().flat_map(|strip| [&strip.name, &strip.note]).map(|text| text.chars().count());
    (16.0 + LETTER * longest.max().unwrap_or(0) as f64 + NUMBERS).clamp(150.0, 0.5 * WIDTH)
}

/// A band above the strips: which regime was when. A name that does not fit is left out; it is the title, too.
fn draw_regimes(svg: &mut Svg, of: &Strips, time: &Axis) {
    for (place, (begin, name)) in of.regimes.iter().enumerate() {
        let from = if place == 0 { time.from } else { time.at(*begin).clamp(time.from, time.to) };
        let to = of.regimes.get(place + 1).map_or(time.to, |(end, _)| time.at(*end));
        let (to, (top, height)) = (to.clamp(from, time.to), BAND);
        let (title, width, colour) = (escaped(name), to - from, SHADES[place % SHADES.len()]);
        svg.raw(&format!(
            "<g class=\"regime\"><title>{title}</title><rect x=\"{from:.1}\" y=\"{top}\" width=\"{width:.1}\" \
             height=\"{height}\" fill=\"{colour}\"/></g>"
        ));
        if to - from > 6.5 * name.chars().count() as f64 + 8.0 {
            let middle = Point::new(0.5 * (from + to), top + height - 4.0);
            svg.text(middle, 11.0, "middle", INK, name);
        }
    }
}

fn draw_strip(svg: &mut Svg, strip: &Strip, time: &Axis, top: f64) {
    let ends = |point: &StripPoint| {
        let (low, high) = point.interval.unwrap_or((point.value, point.value));
        [point.value, low, high]
    };
    let values = strip.points.iter().flat_map(ends).chain([0.0]);
    let axis = Axis::around(values, top + INNER, top + 4.0);
    svg.text(Point::new(16.0, top + 0.5 * STRIP - 4.0), 12.0, "start", INK, &strip.name);
    svg.text(Point::new(16.0, top + 0.5 * STRIP + 11.0), 11.0, "start", INK, &strip.note);
    axis.draw_left(svg, time.from - 8.0, WIDTH - RIGHT, 3);
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
        svg.circle(Point::new(x, y), 3.4, fill, colour, 1.4);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_model_is_a_dot_and_each_change_a_line() {
        let point = |time: f64, found| StripPoint { time, value: -0.3, interval: Some((-0.4, -0.1)), found };
        let strip = Strip {
            name: "a → b".into(),
            note: "lag 1".into(),
            points: vec![point(0.0, true), point(9.0, false)],
        };
        let regimes = vec![(0.0, "regime 1".into()), (4.0, "regime 2".into())];
        let of =
            Strips { links: vec![strip], changes: vec![(4.0, "<a>".into())], regimes, ..Strips::default() };
        let svg = strips(&of);
        assert_eq!((svg.matches("<circle").count(), svg.matches("class=\"change\"").count()), (2, 1));
        assert_eq!(
            (svg.matches("class=\"regime\"").count(), svg.matches(">regime 2</text>").count()),
            (2, 1)
        );
        assert!(svg.contains("&lt;a&gt;") && svg.contains("fill=\"#ffffff\" stroke"));
        assert!(strips(&Strips::default()).contains("no link in any model"));
    }
}
