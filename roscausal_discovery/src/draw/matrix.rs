//! The links as a matrix, effects in rows and causes in columns: readable where a graph is crowded.
//!
//! Each lag has its place and colour within a cell, and the disc is as large as the confidence, without resamples as the strength; a
//! ring is a negative link.

use super::{
    point::Point,
    svg::{FAINT, INK, Svg, cut, display, escaped, is_resampled},
};
use crate::model::Model;

/// Room of one lag in a cell.
const SLOT: f64 = 12.0;
const TEXT: f64 = 11.0;
/// Most letters of a name at the edge.
const LETTERS: usize = 22;
/// Height of the legend below the matrix.
const LEGEND: f64 = 60.0;
/// Perceptually even and safe for colour-blind readers (viridis): dark for early, light for late.
const COLOURS: [[f64; 3]; 5] =
    [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [221.0, 190.0, 20.0]];

/// The matrix of a model, ready to be drawn.
pub(super) struct Matrix<'a> {
    model: &'a Model,
    names: Vec<String>,
    /// Lags per side of a cell.
    side: usize,
}

impl<'a> Matrix<'a> {
    pub(super) fn new(model: &'a Model) -> Self {
        let lags = model.tau_max - model.tau_min.min(model.tau_max) + 1;
        let names = model.features.iter().map(|name| cut(&display(name), LETTERS)).collect();
        Self { model, names, side: (lags as f64).sqrt().ceil() as usize }
    }

    fn cell(&self) -> f64 {
        SLOT * self.side as f64 + 4.0
    }

    fn margin(&self) -> f64 {
        let longest = self.names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        0.62 * TEXT * longest as f64 + 10.0
    }

    /// Width and height of all of it.
    pub(super) fn size(&self) -> (f64, f64) {
        let grid = self.cell() * self.names.len() as f64;
        ((grid + self.margin() + 4.0).max(300.0), grid + self.margin() + 22.0 + LEGEND)
    }

    /// Draws it with its top left corner at `at`.
    pub(super) fn draw(&self, svg: &mut Svg, at: Point) {
        let (cell, margin) = (self.cell(), self.margin());
        let grid = cell * self.names.len() as f64;
        let corner = at.plus(margin, margin + 22.0);
        svg.text(at.plus(0.0, 12.0), 12.0, "start", INK, "rows: effects · columns: causes");
        for (i, name) in self.names.iter().enumerate() {
            let middle = cell * (i as f64 + 0.5);
            svg.text(corner.plus(-5.0, middle + 0.36 * TEXT), TEXT, "end", INK, name);
            let top = corner.plus(middle + 0.36 * TEXT, -5.0);
            let (x, y, name) = (top.x, top.y, escaped(name));
            svg.raw(&format!(
                "<text transform=\"translate({x:.1} {y:.1}) rotate(-90)\" font-size=\"{TEXT}\" fill=\"{INK}\">{name}</text>"
            ));
        }
        for line in 0..=self.names.len() {
            let offset = cell * line as f64;
            svg.raw(&format!(
                "<path d=\"M {:.1} {:.1} h {grid:.1} M {:.1} {:.1} v {grid:.1}\" stroke=\"{FAINT}\" \
                 stroke-width=\"0.5\"/>",
                corner.x,
                corner.y + offset,
                corner.x + offset,
                corner.y
            ));
        }
        for link in &self.model.links {
            let Some((cause, effect)) = self.model.places(&link.cause, &link.effect) else { continue };
            let slot = link.lag.saturating_sub(self.model.tau_min);
            let within = |slot: usize| 2.0 + SLOT * (slot as f64 + 0.5);
            let disc = corner.plus(
                cell * cause as f64 + within(slot % self.side),
                cell * effect as f64 + within(slot / self.side),
            );
            let found = link.confidence.map_or(String::new(), |share| format!(", found in {share:.2}"));
            let p = link.p_value.map_or(String::new(), |p| format!(", p {p:.4}"));
            let (from, to) = (display(&link.cause), display(&link.effect));
            let words = format!("{from} → {to}, lag {}: {}{p}{found}", link.lag, link.strength_in_words(2));
            let strength = link.drawn_strength();
            let size = link.confidence.unwrap_or(strength.abs());
            self.disc(svg, disc, link.lag, size.copysign(strength), &words);
        }
        self.legend(svg, Point::new(at.x, corner.y + grid + 18.0));
    }

    /// A disc of this size from 0 to 1; a ring if it is negative.
    fn disc(&self, svg: &mut Svg, at: Point, lag: usize, value: f64, words: &str) {
        let radius = (5.5 * value.abs().min(1.0).sqrt()).max(1.5);
        let colour = self.colour(lag);
        let look = if value < 0.0 {
            format!(
                "r=\"{:.2}\" fill=\"#ffffff\" stroke=\"{colour}\" stroke-width=\"1.8\"",
                (radius - 0.9).max(1.0)
            )
        } else {
            format!("r=\"{radius:.2}\" fill=\"{colour}\"")
        };
        let title =
            if words.is_empty() { String::new() } else { format!("<title>{}</title>", escaped(words)) };
        svg.raw(&format!(
            "<circle class=\"cell\" cx=\"{:.1}\" cy=\"{:.1}\" {look}>{title}</circle>",
            at.x, at.y
        ));
    }

    fn legend(&self, svg: &mut Svg, at: Point) {
        let mut x = at.x + 6.0;
        svg.text(Point::new(at.x, at.y + 4.0), TEXT, "start", INK, "lag");
        x += 26.0;
        let lags: Vec<usize> = (self.model.tau_min..=self.model.tau_max).collect();
        // At most ten of many lags: enough to read the scale of colours.
        for &lag in lags.iter().step_by(lags.len().div_ceil(10)) {
            self.disc(svg, Point::new(x, at.y), lag, 1.0, "");
            svg.text(Point::new(x + 9.0, at.y + 4.0), TEXT, "start", INK, &lag.to_string());
            x += 32.0;
        }
        let mut x = at.x + 6.0;
        let y = at.y + 22.0;
        let what = if is_resampled(self.model) { "confidence 1" } else { "strength 1" };
        for (value, text, width) in
            [(0.1, "0.1", 36.0), (0.5, "0.5", 36.0), (1.0, what, 96.0), (-1.0, "negative", 60.0)]
        {
            self.disc(svg, Point::new(x, y), self.model.tau_min, value, "");
            svg.text(Point::new(x + 9.0, y + 4.0), TEXT, "start", INK, text);
            x += width;
        }
    }

    fn colour(&self, lag: usize) -> String {
        let span = (self.model.tau_max - self.model.tau_min.min(self.model.tau_max)).max(1) as f64;
        let along = lag.saturating_sub(self.model.tau_min) as f64 / span * (COLOURS.len() - 1) as f64;
        let from = (along as usize).min(COLOURS.len() - 2);
        let mix = along - from as f64;
        let [r, g, b] = [0, 1, 2].map(|i| COLOURS[from][i] * (1.0 - mix) + COLOURS[from + 1][i] * mix);
        format!("rgb({r:.0},{g:.0},{b:.0})")
    }
}

/// The matrix of a model as SVG: effects in rows, causes in columns, the lag by place and colour, the confidence by
/// size; without resamples the strength.
pub fn matrix(model: &Model) -> String {
    let matrix = Matrix::new(model);
    let (width, height) = matrix.size();
    let mut svg = Svg::new(width + 32.0, height + 32.0);
    matrix.draw(&mut svg, Point::new(16.0, 16.0));
    svg.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::example;

    #[test]
    fn each_link_has_a_disc_and_each_name_is_there_twice() {
        let svg = matrix(&example());
        assert_eq!(svg.matches("lag 1: 0.49").count(), 6);
        assert_eq!(svg.matches(">h_risk<").count(), 2);
    }

    #[test]
    fn a_surer_link_has_a_larger_disc_whatever_its_strength() {
        let mut model = example();
        for (link, share) in model.links.iter_mut().zip([0.9, 0.4]) {
            link.confidence = Some(share);
        }
        let svg = matrix(&model);
        let radius = |words: &str| -> f64 {
            let line = svg.lines().find(|line| line.contains(words)).expect(words);
            line.split_once(" r=\"")
                .and_then(|(_, rest)| rest.split_once('"'))
                .expect("a radius")
                .0
                .parse()
                .unwrap()
        };
        assert!(radius("found in 0.90") > radius("found in 0.40"), "{svg}");
        assert!(svg.contains("confidence 1") && !matrix(&example()).contains("confidence"));
    }

    #[test]
    fn a_negative_link_is_a_ring() {
        let mut model = example();
        model.links[0].value = Some(-0.4);
        let disc =
            |svg: &str| svg.lines().any(|line| line.contains("-0.40") && line.contains("fill=\"#ffffff\""));
        assert!(disc(&matrix(&model)) && !disc(&matrix(&example())));
    }
}
