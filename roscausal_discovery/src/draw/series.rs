//! The time series of a batch.

use ndarray::{ArrayView1, ArrayView2, s};

use super::{
    axis::Axis,
    svg::{FAINT, INK, Point, Svg, cut, display},
};
use crate::types::unique;

const WIDTH: f64 = 900.0;
const LEFT: f64 = 60.0;
/// Most letters of a name and its unit, above their strip.
const LETTERS: usize = 90;
const STRIP: f64 = 110.0;

/// Places along the time that the eye can tell apart: three for each unit of the picture's width.
const PLACES: usize = 3 * WIDTH as usize;

/// How the columns of interventions begin: 0 in them means "nothing imposed".
const IMPOSED: &str = "do_";

/// The time series of a batch as SVG, one strip per variable with its unit (empty: not known) and axis, and the time below. `values` is `T x N`; a
/// missing sample interrupts the line and is shaded. Where a column named `do_...` is not 0, an intervention is on: all
/// strips are shaded in another colour.
pub fn series(names: &[String], units: &[&str], values: ArrayView2<f64>, dt: Option<f64>) -> String {
    let (rows, height) = (values.nrows(), 40.0 + STRIP * names.len() as f64 + 38.0);
    let right = WIDTH - 20.0;
    let mut svg = Svg::new(WIDTH, height);
    let end = rows.saturating_sub(1).max(1) as f64;
    let time = Axis { low: 0.0, high: end * dt.unwrap_or(1.0), from: LEFT, to: right };
    let x = |row: usize| time.at(row as f64 * dt.unwrap_or(1.0));
    let imposed = interventions(names, values);
    let per_place = (rows / PLACES).max(1);
    for (strip, (name, column)) in names.iter().zip(values.columns()).enumerate() {
        let (top, bottom) = (30.0 + STRIP * strip as f64, 30.0 + STRIP * (strip as f64 + 0.82));
        let y = Axis::around(column.iter().copied(), bottom, top);
        let unit = units.get(strip).filter(|u| !u.is_empty()).map_or(String::new(), |u| format!(" ({u})"));
        let name = cut(&(display(name) + &unit), LETTERS);
        svg.text(Point::new(LEFT, top - 5.0), 13.0, "start", INK, &name);
        let gaps = gaps(column.iter().map(|v| v.is_finite()), per_place);
        let imposed = imposed.iter().map(|rows| (rows, "imposed", "#f59e0b", 0.22));
        for ((from, to), class, fill, opacity) in
            imposed.chain(gaps.iter().map(|rows| (rows, "gap", FAINT, 0.3)))
        {
            let (left, width) = (x(*from) - 0.5, x(*to) - x(*from) + 1.0);
            svg.raw(&format!(
                "<rect class=\"{class}\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{:.1}\" \
                 fill=\"{fill}\" fill-opacity=\"{opacity}\"/>",
                bottom - top
            ));
        }
        if column.iter().any(|v| v.is_finite()) {
            y.draw_left(&mut svg, LEFT, right, 5);
        }
        svg.raw(&format!(
            "<path d=\"M {LEFT} {top:.1} V {bottom:.1} H {right:.1}\" fill=\"none\" stroke=\"{INK}\" stroke-width=\"1\"/>"
        ));
        let mut path = String::new();
        let mut last = None;
        for row in seen(column, per_place) {
            let joined = last.is_some_and(|last| column.slice(s![last..row]).iter().all(|v| v.is_finite()));
            let pen = if joined { "L" } else { "M" };
            path.push_str(&format!("{pen} {:.1} {:.1} ", x(row), y.at(column[row])));
            last = Some(row);
        }
        svg.raw(&format!("<path d=\"{path}\" fill=\"none\" stroke=\"#1d4ed8\" stroke-width=\"1.3\"/>"));
    }
    time.draw_below(&mut svg, 30.0 + STRIP * names.len() as f64 - 0.1 * STRIP, 8);
    let unit = if dt.is_some() { "time in s" } else { "time in steps" };
    svg.text(Point::new((LEFT + right) / 2.0, height - 8.0), 12.0, "middle", INK, unit);
    let notes = [
        (values.iter().any(|v| !v.is_finite()), "grey: missing"),
        (!imposed.is_empty(), "orange: an intervention is on"),
    ];
    let notes: Vec<&str> = notes.into_iter().filter(|(there, _)| *there).map(|(_, note)| note).collect();
    svg.text(Point::new(right, height - 8.0), 12.0, "end", INK, &notes.join(" · "));
    svg.finish()
}

/// First and last row of each time in which any intervention is on.
fn interventions(names: &[String], values: ArrayView2<f64>) -> Vec<(usize, usize)> {
    let columns: Vec<usize> = (0..names.len()).filter(|&i| names[i].starts_with(IMPOSED)).collect();
    let off = |row: usize| columns.iter().all(|&i| values[[row, i]] == 0.0 || values[[row, i]].is_nan());
    gaps((0..values.nrows()).map(off), 1)
}

/// First and last row of each run of missing values; runs that begin at most `near` rows after the one before are one.
fn gaps(present: impl Iterator<Item = bool>, near: usize) -> Vec<(usize, usize)> {
    let mut gaps: Vec<(usize, usize)> = Vec::new();
    for (row, _) in present.enumerate().filter(|(_, present)| !present) {
        match gaps.last_mut() {
            Some(last) if last.1 + near >= row => last.1 = row,
            _ => gaps.push((row, row)),
        }
    }
    gaps
}

/// The rows whose finite values the eye can tell apart, in order: of each `per_place` rows the first, the last, the smallest and
/// the largest. A line through them covers what a line through all of them does.
fn seen(column: ArrayView1<f64>, per_place: usize) -> Vec<usize> {
    let mut rows = Vec::new();
    for from in (0..column.len()).step_by(per_place) {
        let to = (from + per_place).min(column.len());
        let finite = || (from..to).filter(|&row| column[row].is_finite());
        let by_value = |a: &usize, b: &usize| column[*a].total_cmp(&column[*b]);
        let ends =
            [finite().next(), finite().min_by(by_value), finite().max_by(by_value), finite().next_back()];
        rows.extend(unique(ends.into_iter().flatten().collect()));
    }
    rows
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, array};

    use super::*;

    #[test]
    fn a_missing_sample_breaks_the_line_and_the_name_is_whole() {
        let values = array![[0.0], [1.0], [f64::NAN], [2.0], [3.0]];
        let svg = series(&["speed_of_the_robot".to_owned()], &["m/s"], values.view(), Some(0.1));
        let line = svg.lines().find(|line| line.contains("#1d4ed8")).expect("has a line");
        assert_eq!(line.matches("M ").count(), 2);
        assert!(!svg.contains("NaN") && svg.contains(">speed_of_the_robot (m/s)<"));
        // An axis of one number has no scale: of -3.2 to 3.4 that was 0.
        let noise = series(&["a".to_owned()], &[], array![[-3.2], [3.4]].view(), None);
        assert!(noise.contains(">−2<") && noise.contains(">2<"), "{noise}");
        assert_eq!(svg.matches("class=\"gap\"").count(), 1);
        assert_eq!(gaps([true, false, false, true, false].into_iter(), 1), [(1, 2), (4, 4)]);
    }

    #[test]
    fn a_long_series_is_drawn_as_far_as_the_eye_sees() {
        let wave = |row: usize| if row == 77_777 { 9.0 } else { (row as f64 / 1000.0).sin() };
        let values =
            Array2::from_shape_fn((200_000, 1), |(row, _)| if row == 500 { f64::NAN } else { wave(row) });
        let picture = series(&["a".into()], &[], values.view(), None);
        assert!(picture.len() < 400_000, "{}", picture.len());
        let rows = seen(values.column(0), 200_000 / PLACES);
        assert!(rows.contains(&77_777) && !rows.contains(&500) && rows.is_sorted());
        assert!(rows.contains(&0) && rows.contains(&199_999));
    }

    #[test]
    fn an_intervention_is_shaded_in_every_strip() {
        let values = array![[0.0, 0.0], [1.0, 0.2], [2.0, 0.2], [3.0, 0.0], [4.0, 0.5]];
        let names = ["h_v".to_owned(), "do_robot_speed".to_owned()];
        assert_eq!(interventions(&names, values.view()), [(1, 2), (4, 4)]);
        let svg = series(&names, &[], values.view(), Some(0.1));
        assert_eq!(svg.matches("class=\"imposed\"").count(), 2 * 2);
        assert!(svg.contains("orange: an intervention is on") && !svg.contains("grey"));
        assert!(!series(&names[..1], &[], values.slice(ndarray::s![.., ..1]), None).contains("imposed"));
    }

    #[test]
    fn time_has_round_numbers_and_a_unit() {
        let values = ndarray::Array2::from_shape_fn((101, 1), |(t, _)| t as f64);
        let svg = series(&["h_v".to_owned()], &["m/s"], values.view(), Some(0.1));
        assert!(svg.contains("time in s") && svg.contains(">10<") && svg.contains(">2<"), "{svg}");
        assert!(series(&["h_v".to_owned()], &["m/s"], values.view(), None).contains("time in steps"));
    }
}
