//! Fan charts: what was, and what may come under each candidate action, side by side.

use ndarray::ArrayView2;

use super::{
    axis::Axis,
    svg::{FAINT, INK, Point, Svg, cut, dashed, display},
};

const LEFT: f64 = 118.0;
const GAP: f64 = 18.0;
const HEAD: f64 = 50.0;
const STRIP: f64 = 118.0;
/// Part of a strip that is chart, the rest is space to the next.
const CHART: f64 = 0.84;
/// Below the last strip: numbers of the axis, its name, the legend.
const FOOT: f64 = 70.0;
const BLUE: &str = "#1d4ed8";
const ORANGE: &str = "#f59e0b";
/// Opacity of the outer and the inner band, and what is left of it where the data do not carry the answer.
const BANDS: [f64; 2] = [0.18, 0.34];
const BEYOND: f64 = 0.4;

/// One variable in the steps to come: quantiles, the first is that of the next step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fan {
    /// The middle.
    pub median: Vec<f64>,
    /// The inner band: lower and upper end.
    pub inner: [Vec<f64>; 2],
    /// The outer band.
    pub outer: [Vec<f64>; 2],
}

/// One candidate action and what it leads to: a column of the chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Candidate {
    /// What it is called.
    pub name: String,
    /// A few words below its name; the reason where there is no answer.
    pub note: String,
    /// A fan for each variable of the chart; none where there is no answer.
    pub fans: Vec<Fan>,
    /// Steps for which the data carry the answer; what lies beyond is drawn fainter.
    pub carried: usize,
    /// What is done: the number of the variable in the chart (or none, if it is not shown), first and last step, from 1.
    pub acts: Vec<(Option<usize>, usize, usize)>,
}

/// Fan charts of the same variables from the same moment.
#[derive(Clone, Debug)]
pub struct FanChart<'a> {
    /// The variables, one strip each.
    pub names: &'a [String],
    /// Their units, where they are known; empty: none.
    pub units: &'a [String],
    /// The rows up to now, the last of which is now: `T x variables`.
    pub past: ArrayView2<'a, f64>,
    /// What was observed after it, where it was: `T x variables`.
    pub observed: ArrayView2<'a, f64>,
    /// Step in seconds, if known.
    pub dt: Option<f64>,
    /// Steps to come.
    pub horizon: usize,
    /// Probabilities of the inner and the outer band.
    pub bands: [f64; 2],
    /// The columns.
    pub candidates: &'a [Candidate],
}

/// Fan charts as SVG: a column for each candidate, a strip for each variable. The axes are common, so that candidates are compared by
/// eye. The steps in which something is done are shaded, its own variable's strip more.
pub fn fans(chart: &FanChart<'_>) -> String {
    let columns = chart.candidates.len().max(1);
    let wide = [620.0, 400.0][(columns - 1).min(1)] - if columns > 2 { 100.0 } else { 0.0 };
    let width = LEFT + columns as f64 * (wide + GAP);
    let height = HEAD + STRIP * chart.names.len() as f64 + FOOT;
    let mut svg = Svg::new(width, height);
    let step = chart.dt.unwrap_or(1.0);
    let past = chart.past.nrows().saturating_sub(1);
    for (column, candidate) in chart.candidates.iter().enumerate() {
        let left = LEFT + column as f64 * (wide + GAP);
        let (low, high) = (-(past as f64) * step, chart.horizon.max(1) as f64 * step);
        let time = Axis { low, high, from: left, to: left + wide };
        svg.text(Point::new(left, 20.0), 14.0, "start", INK, &fitting(&display(&candidate.name), wide, 14.0));
        let answered = !candidate.fans.is_empty();
        if answered {
            svg.text(Point::new(left, 38.0), 11.0, "start", INK, &fitting(&candidate.note, wide, 11.0));
        }
        for (strip, name) in chart.names.iter().enumerate() {
            let (top, bottom) = (HEAD + STRIP * strip as f64, HEAD + STRIP * (strip as f64 + CHART));
            let y = axis(chart, strip, bottom, top);
            if column == 0 {
                let middle = (top + bottom) / 2.0;
                svg.text(Point::new(10.0, middle), 14.0, "start", INK, &fitting(&display(name), 66.0, 14.0));
                let unit = chart.units.get(strip).map_or("", String::as_str);
                svg.text(Point::new(10.0, middle + 17.0), 11.0, "start", INK, &fitting(unit, 66.0, 11.0));
            }
            Strip { chart, candidate, strip, time, y, step }.draw(&mut svg, column == 0);
        }
        if !answered {
            let mut lines = wrapped(&candidate.note, wide - 20.0, 11.0);
            lines.truncate(6);
            for (k, line) in lines.iter().enumerate() {
                svg.label(Point::new(left + wide / 2.0, HEAD + 22.0 + 17.0 * k as f64), 11.0, INK, line);
            }
        }
        let below = HEAD + STRIP * (chart.names.len() as f64 - 1.0 + CHART);
        time.draw_below(&mut svg, below, if wide > 500.0 { 9 } else { 5 });
        let unit = if chart.dt.is_some() { "time from now in s" } else { "steps from now" };
        svg.text(Point::new(left + wide / 2.0, below + 32.0), 12.0, "middle", INK, unit);
    }
    legend(&mut svg, chart, width, height - 12.0);
    svg.finish()
}

/// The axis of a variable: the same for all candidates.
fn axis(chart: &FanChart<'_>, strip: usize, bottom: f64, top: f64) -> Axis {
    let fans = chart.candidates.iter().filter_map(|candidate| candidate.fans.get(strip));
    let ends = fans.flat_map(|fan| fan.outer.iter().chain([&fan.median]).flatten().copied());
    let column = |rows: &ArrayView2<'_, f64>| -> Vec<f64> {
        rows.columns().into_iter().nth(strip).map_or(Vec::new(), |c| c.to_vec())
    };
    Axis::around(ends.chain(column(&chart.past)).chain(column(&chart.observed)), bottom, top)
}

/// One variable under one candidate.
struct Strip<'a, 'b> {
    chart: &'a FanChart<'b>,
    candidate: &'a Candidate,
    strip: usize,
    time: Axis,
    y: Axis,
    step: f64,
}

impl Strip<'_, '_> {
    fn draw(&self, svg: &mut Svg, numbers: bool) {
        let (left, right) = (self.time.from, self.time.to);
        let (top, bottom) = (self.y.to, self.y.from);
        for &(variable, first, last) in &self.candidate.acts {
            let (from, to) = (self.x(first as f64 - 1.0), self.x(last as f64));
            let opacity = if variable == Some(self.strip) { 0.3 } else { 0.11 };
            let (width, height) = ((to - from).max(1.0), bottom - top);
            svg.raw(&format!(
                "<rect class=\"action\" x=\"{from:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" \
                 fill=\"{ORANGE}\" fill-opacity=\"{opacity}\"/>"
            ));
        }
        if numbers {
            self.y.draw_left(svg, left, right, 4);
        } else {
            for tick in self.y.ticks(4) {
                let y = self.y.at(tick);
                svg.raw(&format!(
                    "<path d=\"M {left:.1} {y:.1} H {right:.1}\" stroke=\"{FAINT}\" stroke-width=\"0.4\"/>"
                ));
            }
        }
        let now = self.x(0.0);
        svg.raw(&format!(
            "<path d=\"M {left:.1} {top:.1} V {bottom:.1} H {right:.1} M {now:.1} {top:.1} V {bottom:.1}\" fill=\"none\" \
             stroke=\"{INK}\" stroke-width=\"0.8\"/>"
        ));
        let past = self.chart.past.nrows() as f64 - 1.0;
        let before = self.points(&self.chart.past, |row| row as f64 - past);
        self.line(svg, "past", &before, INK, 1.4, "");
        let after = self.points(&self.chart.observed, |row| row as f64 + 1.0);
        self.line(svg, "observed", &after, FAINT, 1.2, "2 3");
        if let Some(fan) = self.candidate.fans.get(self.strip) {
            self.fan(svg, fan, before.last().copied().flatten());
        }
    }

    fn fan(&self, svg: &mut Svg, fan: &Fan, present: Option<(f64, f64)>) {
        let course = |values: &[f64]| -> Vec<Option<(f64, f64)>> {
            let steps = values.iter().enumerate().map(|(k, &v)| v.is_finite().then_some((k as f64 + 1.0, v)));
            [present].into_iter().chain(steps).collect()
        };
        let carried = self.candidate.carried.min(fan.median.len());
        let parts = [(0, carried, 1.0, ""), (carried, fan.median.len(), BEYOND, "5 4")];
        for (from, to, share, dash) in parts.into_iter().filter(|(from, to, ..)| to > from) {
            for (class, [lower, upper], opacity) in
                [("outer", &fan.outer, BANDS[0]), ("inner", &fan.inner, BANDS[1])]
            {
                let (lower, upper) = (course(lower), course(upper));
                let there = (from..=to).filter_map(|k| Some(((*lower.get(k)?)?, (*upper.get(k)?)?)));
                let (down, up): (Vec<_>, Vec<_>) = there.unzip();
                let ring: Vec<String> =
                    down.into_iter().chain(up.into_iter().rev()).map(|p| self.place(p)).collect();
                if ring.len() > 2 {
                    svg.raw(&format!(
                        "<path class=\"{class}\" d=\"M {} Z\" fill=\"{BLUE}\" fill-opacity=\"{:.2}\"/>",
                        ring.join(" L "),
                        opacity * share
                    ));
                }
            }
            let median = course(&fan.median);
            self.line(svg, "median", &median[from..=to.min(median.len() - 1)], BLUE, 1.8, dash);
        }
    }

    fn points(&self, rows: &ArrayView2<'_, f64>, at: impl Fn(usize) -> f64) -> Vec<Option<(f64, f64)>> {
        let value = |row: usize| rows.get([row, self.strip]).copied().filter(|v| v.is_finite());
        (0..rows.nrows()).map(|row| value(row).map(|v| (at(row), v))).collect()
    }

    /// A line through what is known; a gap interrupts it.
    fn line(
        &self,
        svg: &mut Svg,
        class: &str,
        points: &[Option<(f64, f64)>],
        colour: &str,
        width: f64,
        dash: &str,
    ) {
        let mut path = String::new();
        let mut pen_down = false;
        for point in points {
            if let Some(point) = point {
                path.push_str(&format!("{} {} ", if pen_down { "L" } else { "M" }, self.place(*point)));
            }
            pen_down = point.is_some();
        }
        if !path.is_empty() {
            let dash = dashed(dash);
            svg.raw(&format!(
                "<path class=\"{class}\" d=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"{dash}/>",
                path.trim_end()
            ));
        }
    }

    /// The pixel of a step from now.
    fn x(&self, step: f64) -> f64 {
        self.time.at(step * self.step)
    }

    fn place(&self, (step, value): (f64, f64)) -> String {
        format!("{:.1} {:.1}", self.x(step), self.y.at(value))
    }
}

/// What is drawn how; only what is there.
fn legend(svg: &mut Svg, chart: &FanChart<'_>, width: f64, y: f64) {
    let percent = |share: f64| format!("{} %", (share * 1000.0).round() / 10.0);
    let band = |opacity: f64| format!("height=\"9\" fill=\"{BLUE}\" fill-opacity=\"{opacity}\"");
    let line = |colour: &str| format!("height=\"2\" fill=\"{colour}\"");
    let some = |has: &dyn Fn(&Candidate) -> bool| chart.candidates.iter().any(has);
    let answered = some(&|candidate| !candidate.fans.is_empty());
    let beyond = some(&|candidate| !candidate.fans.is_empty() && candidate.carried < chart.horizon);
    let acts = some(&|candidate| !candidate.acts.is_empty());
    let entries = [
        (true, line(INK), "past".to_owned()),
        (answered, line(BLUE), "median".to_owned()),
        (answered, band(BANDS[0] + BANDS[1]), percent(chart.bands[0])),
        (answered, band(BANDS[0]), percent(chart.bands[1])),
        (beyond, band(BANDS[0] * BEYOND), "not carried by the data".to_owned()),
        (chart.observed.nrows() > 0, line(FAINT), "observed".to_owned()),
        (acts, format!("height=\"9\" fill=\"{ORANGE}\" fill-opacity=\"0.3\""), "action".to_owned()),
    ];
    let mut x = 10.0;
    for (_, swatch, words) in entries.iter().filter(|(there, ..)| *there) {
        let lift = if swatch.starts_with("height=\"2\"") { 5.0 } else { 9.0 };
        svg.raw(&format!("<rect x=\"{x:.1}\" y=\"{:.1}\" width=\"20\" {swatch}/>", y - lift));
        svg.text(Point::new(x + 26.0, y), 11.0, "start", INK, words);
        x += 26.0 + 6.8 * words.chars().count() as f64 + 16.0;
        if x > width {
            break;
        }
    }
}

/// Text that fits into a width.
fn fitting(text: &str, width: f64, size: f64) -> String {
    cut(text, (width / (0.62 * size)) as usize)
}

/// Words in lines that fit into a width.
fn wrapped(text: &str, width: f64, size: f64) -> Vec<String> {
    let most = (width / (0.62 * size)) as usize;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(fitting(word, width, size)),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, array};

    use super::*;

    fn fan(level: f64) -> Fan {
        let row = |by: f64| vec![level + by, level + 2.0 * by, level + 3.0 * by];
        Fan { median: row(0.0), inner: [row(-0.1), row(0.1)], outer: [row(-0.3), row(0.3)] }
    }

    fn drawn(candidates: &[Candidate]) -> String {
        let past = array![[0.0, 5.0], [0.5, f64::NAN], [1.0, 6.0]];
        fans(&FanChart {
            names: &["h_v".to_owned(), "<d>".to_owned()],
            units: &["m/s".to_owned(), String::new()],
            past: past.view(),
            observed: Array2::zeros((0, 2)).view(),
            dt: Some(0.5),
            horizon: 3,
            bands: [0.5, 0.9],
            candidates,
        })
    }

    fn all(svg: &str, class: &str) -> usize {
        svg.matches(&format!("class=\"{class}\"")).count()
    }

    #[test]
    fn each_candidate_has_a_fan_for_each_variable_on_common_axes() {
        let one = |name: &str, level: f64| Candidate {
            name: name.into(),
            fans: vec![fan(level), fan(6.0)],
            carried: 3,
            ..Candidate::default()
        };
        let svg = drawn(&[one("go on", 1.0), one("slow", 0.2)]);
        assert_eq!(["outer", "inner", "median", "past"].map(|class| all(&svg, class)), [4, 4, 4, 4]);
        assert!(svg.contains(">go on<") && svg.contains(">slow<") && svg.contains(">m/s<"), "{svg}");
        assert!(
            svg.contains("time from now in s") && svg.contains(">90 %<") && svg.contains(">50 %<"),
            "{svg}"
        );
        assert!(svg.contains("&lt;d&gt;") && !svg.contains("NaN") && !svg.contains("action"), "{svg}");
        // The same value is at the same height in both columns: 6.0 is where the past of d ends.
        let heights: Vec<&str> = svg
            .lines()
            .filter(|line| line.contains("class=\"median\""))
            .filter_map(|line| line.split_once("d=\"")?.1.split_once('"'))
            .map(|(d, _)| d.rsplit(' ').next().unwrap_or_default())
            .collect();
        assert!(heights[1] == heights[3] && heights[0] != heights[2], "{heights:?}");
    }

    #[test]
    fn what_is_done_is_shaded_and_what_the_data_do_not_carry_is_fainter() {
        let acts = vec![(Some(0), 1, 2)];
        let some = Candidate {
            name: "stop".into(),
            fans: vec![fan(0.0), fan(6.0)],
            carried: 1,
            acts,
            ..Candidate::default()
        };
        let svg = drawn(&[some]);
        // A strip of its own variable, and one of another.
        assert_eq!(
            (svg.matches("fill-opacity=\"0.3\"").count(), svg.matches("fill-opacity=\"0.11\"").count()),
            (2, 1)
        );
        assert_eq!((all(&svg, "outer"), svg.matches("stroke-dasharray=\"5 4\"").count()), (4, 2));
        assert!(svg.contains("not carried by the data"), "{svg}");
    }

    #[test]
    fn a_candidate_without_an_answer_says_why() {
        let refused = Candidate {
            name: "race".into(),
            note: "the data do not reach r_v = 9".into(),
            ..Candidate::default()
        };
        let svg = drawn(&[refused]);
        assert!(svg.contains("do not reach") && all(&svg, "outer") == 0 && !svg.contains("median"), "{svg}");
        assert!(drawn(&[]).starts_with("<svg"));
    }
}
