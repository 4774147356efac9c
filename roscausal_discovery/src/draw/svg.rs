//! The few SVG shapes that the pictures consist of.

use std::fmt::Write;

use super::layout::cubic;
pub(super) use super::point::Point;
use crate::{
    model::{Link, Model},
    types::{LinkMark, names::plain, visible},
};

/// An SVG document under construction.
pub(super) struct Svg {
    body: String,
    width: f64,
    height: f64,
}

pub(super) const INK: &str = "#1f2933";
pub(super) const FAINT: &str = "#9aa5b1";
pub(super) const POSITIVE: &str = "#c2410c";
pub(super) const NEGATIVE: &str = "#1d4ed8";
/// Of a strength without a sign.
pub(super) const UNSIGNED: &str = "#475569";

impl Svg {
    pub(super) fn new(width: f64, height: f64) -> Self {
        let mut svg = Self { body: String::new(), width, height };
        svg.raw(&format!("<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>"));
        svg
    }

    pub(super) fn raw(&mut self, element: &str) {
        self.body.push_str(element);
        self.body.push('\n');
    }

    pub(super) fn text(&mut self, at: Point, size: f64, anchor: &str, fill: &str, text: &str) {
        let text = escaped(text);
        self.raw(&format!(
            "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"{size}\" text-anchor=\"{anchor}\" fill=\"{fill}\">{text}</text>",
            at.x, at.y
        ));
    }

    /// How the model was found, at the top.
    pub(super) fn title(&mut self, text: &str) {
        let text = escaped(text);
        self.raw(&format!("{TITLE} x=\"16\" y=\"26\" font-size=\"15\" fill=\"{INK}\">{text}</text>"));
    }

    /// Text on a white background, for labels on lines.
    pub(super) fn label(&mut self, at: Point, size: f64, fill: &str, text: &str) {
        let width = label_width(size, text);
        self.raw(&format!(
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{:.1}\" rx=\"4\" fill=\"#ffffff\" \
             fill-opacity=\"0.85\"/>",
            at.x - width / 2.0,
            at.y - 0.62 * size - 1.0,
            1.3 * size
        ));
        self.text(at.plus(0.0, 0.36 * size), size, "middle", fill, text);
    }

    /// A curved arrow (quadratic Bézier) with a head at `to`. `dash` is as in `stroke-dasharray`.
    pub(super) fn arrow(&mut self, from: Point, bend: Point, to: Point, stroke: &Stroke) {
        self.route(&cubic(from, bend, to), stroke);
    }

    /// An arrow along cubic Bézier curves: the start, then two control points and the end of each.
    pub(super) fn route(&mut self, path: &[Point], stroke: &Stroke) {
        let [start, between @ .., bend, to] = path else { return };
        let head = 6.0 + 1.8 * stroke.width;
        let back = to.towards(*bend);
        let neck = to.plus(back.x * head * 0.9, back.y * head * 0.9);
        let mut d = format!("M {:.1} {:.1} C", start.x, start.y);
        // The line ends in the head; its last control point moves along, so that it does not overshoot.
        let last = bend.plus(neck.x - to.x, neck.y - to.y);
        for point in between.iter().chain([&last, &neck]) {
            let _ = write!(d, " {:.1} {:.1}", point.x, point.y);
        }
        self.raw(&format!("<path d=\"{d}\" fill=\"none\" {}/>", stroke.attributes()));
        self.line_end(stroke.ends.1, *to, back, head, stroke);
        if stroke.ends.0 != '-' {
            let towards = start.towards(*between.first().unwrap_or(bend));
            self.line_end(stroke.ends.0, *start, towards, head, stroke);
        }
    }

    /// A circle around a place.
    pub(super) fn circle(&mut self, at: Point, radius: f64, fill: &str, stroke: &str, width: f64) {
        self.raw(&format!(
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{stroke}\" stroke-width=\"{width}\"/>",
            at.x, at.y
        ));
    }

    /// What stands at the end `tip` of a line that comes from the direction `back`: a head, a circle, a cross, or nothing.
    fn line_end(&mut self, end: char, tip: Point, back: Point, size: f64, stroke: &Stroke) {
        let half = size * 0.45;
        let neck = tip.plus(back.x * size * 0.9, back.y * size * 0.9);
        let (left, right) =
            (neck.plus(-back.y * half, back.x * half), neck.plus(back.y * half, -back.x * half));
        let (colour, opacity) = (stroke.colour, stroke.opacity);
        match end {
            '<' | '>' => self.raw(&format!(
                "<path d=\"M {:.1} {:.1} L {:.1} {:.1} L {:.1} {:.1} Z\" fill=\"{colour}\" fill-opacity=\"{opacity}\"/>",
                tip.x, tip.y, left.x, left.y, right.x, right.y
            )),
            'o' => self.raw(&format!(
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{half:.1}\" fill=\"#ffffff\" stroke=\"{colour}\" \
                 stroke-width=\"2\" stroke-opacity=\"{opacity}\"/>",
                tip.x + back.x * half,
                tip.y + back.y * half
            )),
            'x' => {
                let (far, near) = (left.plus(-back.x * size * 0.9, -back.y * size * 0.9), right);
                let (other, opposite) = (right.plus(-back.x * size * 0.9, -back.y * size * 0.9), left);
                self.raw(&format!(
                    "<path d=\"M {:.1} {:.1} L {:.1} {:.1} M {:.1} {:.1} L {:.1} {:.1}\" stroke=\"{colour}\" \
                     stroke-width=\"2\" stroke-opacity=\"{opacity}\"/>",
                    far.x, far.y, near.x, near.y, other.x, other.y, opposite.x, opposite.y
                ));
            }
            _ => {}
        }
    }

    pub(super) fn finish(self) -> String {
        let mut out = String::new();
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             font-family=\"DejaVu Sans, sans-serif\">",
            w = self.width,
            h = self.height
        );
        out.push_str(&self.body);
        out.push_str("</svg>\n");
        out
    }
}

/// Width of a label with its background.
pub(super) fn label_width(size: f64, text: &str) -> f64 {
    0.62 * size * text.chars().count() as f64 + 6.0
}

/// How a line looks.
pub(super) struct Stroke {
    pub colour: &'static str,
    pub width: f64,
    pub dash: &'static str,
    pub opacity: f64,
    /// What stands at both ends, as in a mark: `('o', '>')`.
    pub ends: (char, char),
}

impl Stroke {
    /// A link of a model with these ends. With resamples, opacity and dashes show how often it was found; else dashes show the p-value.
    /// Strengths without a sign have no colour.
    pub(super) fn of(model: &Model, link: &Link, confidence: Option<f64>, mark: LinkMark) -> Self {
        let stroke =
            Self::of_link(link.drawn_strength(), link.p_value.unwrap_or(0.0), model.smallest_p(), mark);
        let stroke = Self { colour: if model.has_sign() { stroke.colour } else { UNSIGNED }, ..stroke };
        match confidence {
            Some(share) => Self { dash: dash_of_share(share), opacity: opacity(share), ..stroke },
            None => stroke,
        }
    }

    /// What is not a link of the model, but was found in many resamples.
    pub(super) fn of_maybe(mark: LinkMark) -> Self {
        Self { colour: FAINT, width: 1.2, dash: "1.5 4", opacity: 1.0, ends: ends_of(mark) }
    }

    /// The width shows the strength, the colour the sign, and the dashes the p-value.
    pub(super) fn of_link(value: f64, p_value: f64, smallest_p: f64, mark: LinkMark) -> Self {
        let width = 1.5 + 5.0 * value.abs().min(1.0);
        let colour = if value < 0.0 { NEGATIVE } else { POSITIVE };
        Self { colour, width, dash: dash(p_value, smallest_p), opacity: 1.0, ends: ends_of(mark) }
    }

    fn attributes(&self) -> String {
        let Self { colour, width, opacity, .. } = self;
        let dash = dashed(self.dash);
        format!("stroke=\"{colour}\" stroke-width=\"{width:.2}\" stroke-opacity=\"{opacity}\"{dash}")
    }
}

/// The ends of a mark; a tail for what is none.
fn ends_of(mark: LinkMark) -> (char, char) {
    let mut letters = mark.symbol().chars();
    (letters.next().unwrap_or('-'), letters.next_back().unwrap_or('-'))
}

/// One line for each mark with a circle, a cross or two heads that is present, from `at` downwards.
pub(super) fn legend_of_marks(svg: &mut Svg, at: Point, model: &Model) {
    for (k, (mark, text)) in present_marks(model).into_iter().enumerate() {
        let y = at.y + 18.0 * k as f64;
        let stroke = Stroke { colour: INK, ends: ends_of(mark), ..Stroke::of_link(0.1, 0.0, 1.0, mark) };
        let (from, to) = (Point::new(at.x, y), Point::new(at.x + 44.0, y));
        svg.arrow(from, Point::new(at.x + 22.0, y), to, &stroke);
        svg.text(Point::new(at.x + 54.0, y + 4.0), 12.0, "start", INK, text);
    }
}

/// Height of the legend of marks.
pub(super) fn height_of_marks(model: &Model) -> f64 {
    18.0 * present_marks(model).len() as f64
}

fn present_marks(model: &Model) -> Vec<(LinkMark, &'static str)> {
    let known = [
        (LinkMark::CircleHead, "cause, or something not recorded drives both"),
        (LinkMark::Bidirected, "something not recorded drives both"),
        (LinkMark::Unoriented, "depend on each other, direction open"),
        (LinkMark::ConflictHead, "cause or not: contradictory"),
        (LinkMark::Conflict, "direction contradictory"),
    ];
    known.into_iter().filter(|(mark, _)| model.links.iter().any(|link| link.mark == *mark)).collect()
}

/// Solid below the smallest p-value that the test can resolve, long dashes below 0.01, short ones above.
pub(super) fn dash(p_value: f64, smallest_p: f64) -> &'static str {
    match p_value {
        p if p < smallest_p => "",
        p if p < 0.01 => "14 5",
        _ => "5 4",
    }
}

/// How strong a line is drawn, by the share of resamples that have the link.
fn opacity(share: f64) -> f64 {
    match share {
        s if s >= 0.9 => 1.0,
        s if s >= 0.7 => 0.75,
        s if s >= 0.5 => 0.55,
        _ => 0.35,
    }
}

/// Dashes for a link that fewer than half of the resamples have.
fn dash_of_share(share: f64) -> &'static str {
    if share < 0.5 { "5 4" } else { "" }
}

/// The attribute of a dashed line; nothing for a full one.
pub(super) fn dashed(dash: &str) -> String {
    if dash.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{dash}\"") }
}

/// From this share of the resamples on, what is not a link of the model is drawn, dotted.
pub(super) const MAYBE: f64 = 0.3;

/// A line at `at` that looks so, and what it means.
fn key(svg: &mut Svg, at: Point, look: &str, text: &str) {
    svg.raw(&format!("<path d=\"M {:.1} {:.1} h 44\" {look}/>", at.x, at.y));
    svg.text(at.plus(54.0, 4.0), 12.0, "start", INK, text);
}

/// What opacity, dashes and dots mean in a model with resamples, from `at` downwards.
fn legend_of_shares(svg: &mut Svg, at: Point) {
    let rows = [(0.95, "firm: 0.9 or more"), (0.6, "likely: 0.5"), (0.4, "unsure: below")];
    for (row, (share, text)) in rows.into_iter().enumerate() {
        let (dash, opacity) = (dashed(dash_of_share(share)), opacity(share));
        let look = format!("stroke=\"{INK}\" stroke-width=\"3\" stroke-opacity=\"{opacity}\"{dash}");
        key(svg, at.plus(0.0, 18.0 * row as f64), &look, text);
    }
    let look = format!("stroke=\"{FAINT}\" stroke-width=\"1.2\" stroke-dasharray=\"1.5 4\"");
    key(svg, at.plus(170.0, 36.0), &look, &format!("no link, but in {MAYBE} or more"));
}

/// Whether its links say in which share of the resamples they are.
pub(super) fn is_resampled(model: &Model) -> bool {
    model.confidence.is_some() || model.links.iter().any(|link| link.confidence.is_some())
}

/// The legend for widths, colours and dashes of a model, from `at` downwards.
pub(super) fn legend_of_model(svg: &mut Svg, at: Point, model: &Model) {
    let signed = model.has_sign();
    if !is_resampled(model) {
        return legend(svg, at, model.smallest_p(), signed);
    }
    legend_of_shares(svg, at);
    svg.text(Point::new(at.x, at.y + 58.0), 12.0, "start", INK, width_words(signed));
}

fn width_words(signed: bool) -> &'static str {
    if signed { "width: |strength|; orange +, blue −" } else { "width: strength" }
}

/// The legend for widths, colours and dashes, from `at` downwards.
fn legend(svg: &mut Svg, at: Point, smallest_p: f64, signed: bool) {
    let mut y = at.y;
    let smallest = format!("p < {smallest_p}");
    for (dash, text) in [("", smallest.as_str()), ("14 5", "p < 0.01"), ("5 4", "p ≥ 0.01")] {
        let look = format!("stroke=\"{INK}\" stroke-width=\"3\"{}", dashed(dash));
        key(svg, Point::new(at.x, y), &look, text);
        y += 18.0;
    }
    svg.text(Point::new(at.x, y + 4.0), 12.0, "start", INK, width_words(signed));
}

/// What the line of a title begins with, and its height.
const TITLE: &str = "<text class=\"title\"";
const TITLE_HEIGHT: f64 = 32.0;

/// A graph as a document wants it: so many millimetres wide, with or without the line above it that says how it was found.
pub fn fitted(svg: &str, width: Option<f64>, title: bool) -> String {
    let Some((head, body)) = svg.split_once('\n') else { return svg.to_owned() };
    let mut words: Vec<String> = head.split('"').map(str::to_owned).collect();
    let size = |at: usize| words.get(at).and_then(|word| word.parse::<f64>().ok());
    let (Some(wide), Some(high)) = (size(3), size(5)) else { return svg.to_owned() };
    let top = if title { 0.0 } else { TITLE_HEIGHT };
    let (unit, part) = width.map_or(("", 1.0), |width| ("mm", width / wide));
    words[3] = format!("{:.2}{unit}", wide * part);
    words[5] = format!("{:.2}{unit}", (high - top) * part);
    words[7] = format!("0 {top} {wide} {}", high - top);
    let kept = body.lines().filter(|line| title || !line.starts_with(TITLE));
    kept.fold(words.join("\"") + "\n", |text, line| text + line + "\n")
}

/// A text for XML: what has a meaning there is spelled out, and so is what no reader could see, of which much has no place there.
pub fn escaped(text: &str) -> String {
    visible::line(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A variable's name for display: `h_{\theta}` becomes `h_θ`.
pub(super) fn display(name: &str) -> String {
    plain(&name.replace("\\theta", "θ").replace("\\omega", "ω"))
}

/// A text of at most so many letters: a longer one ends with an ellipsis.
pub(super) fn cut(text: &str, most: usize) -> String {
    match text.chars().count() {
        count if count <= most => text.to_owned(),
        _ => text.chars().take(most.saturating_sub(1)).chain(['…']).collect(),
    }
}
