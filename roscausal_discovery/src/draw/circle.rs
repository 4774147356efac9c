//! A variable's circle with its name, whatever its length.

use super::{
    layout::NODE,
    point::Point,
    svg::{INK, Svg, display, escaped},
};

/// Most lines of a name in a circle.
const LINES: usize = 3;
/// Smallest text of a name, and the size by which its lines are broken.
const SMALLEST: f64 = 6.0;
const USUAL: f64 = 8.0;
/// Width of a letter, as a part of its height.
const LETTER: f64 = 0.6;

/// The size of all names of a graph: that in which each fits into its circle.
pub(super) fn size(names: &[String]) -> f64 {
    let of = |name: &String| {
        let lines = lines(&display(name));
        let longest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0).max(4);
        let room = if lines.len() > 1 { 1.4 } else { 1.6 };
        room * NODE / (LETTER * longest as f64)
    };
    names.iter().map(of).fold(16.0, f64::min).max(SMALLEST)
}

/// Draws a variable. A name that does not fit is cut; the whole name is shown on hover and read aloud.
pub(super) fn variable(svg: &mut Svg, at: Point, name: &str, size: f64) {
    svg.raw(&format!("<g class=\"node\"><title>{}</title>", escaped(&display(name))));
    svg.circle(at, NODE, "#eef2f6", INK, 1.6);
    let lines = lines(&display(name));
    let first = at.y + 0.36 * size - 0.55 * size * (lines.len() - 1) as f64;
    for (row, line) in lines.iter().enumerate() {
        svg.text(Point::new(at.x, first + 1.1 * size * row as f64), size, "middle", INK, line);
    }
    svg.raw("</g>");
}

/// A name in at most [`LINES`] lines, broken where words end, never inside one. As many words stand in a line as fit; a word that is
/// longer than any line stands alone, in smaller letters. What is too long for that is cut.
fn lines(name: &str) -> Vec<String> {
    let fits = |size: f64| (1.4 * NODE / (LETTER * size)) as usize;
    let mut lines = vec![String::new()];
    for word in name.split_inclusive(['_', '.', '/', ' ', '-', ':']) {
        let line = lines.last().map_or(0, |line| line.chars().count());
        if line > 0 && line + word.chars().count() > fits(USUAL) {
            lines.push(String::new());
        }
        lines.last_mut().into_iter().for_each(|line| line.push_str(word));
    }
    let cut = |line: &str, most: usize| line.chars().take(most - 1).chain(['…']).collect::<String>();
    let is_long = lines.len() > LINES;
    lines.truncate(LINES);
    let last = lines.len() - 1;
    for (k, line) in lines.iter_mut().enumerate() {
        if line.chars().count() > fits(SMALLEST) || (is_long && k == last) {
            *line = cut(line, fits(SMALLEST).min(line.chars().count()));
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_name_stays_in_its_circle() {
        assert_eq!(lines("h_v"), ["h_v"]);
        let long = lines("distance_to_the_nearest_person_in_front_of_the_robot");
        assert!(long.len() == LINES && long[LINES - 1].ends_with('…'), "{long:?}");
        assert!(long.iter().all(|line| line.chars().count() <= 14), "{long:?}");
        assert_eq!(lines("walking_speed"), ["walking_", "speed"]);
        assert_eq!(lines("room_temperature"), ["room_", "temperature"]);
        assert_eq!(lines("instrumentation"), ["instrumentati…"]);
    }
}
