//! A variable's circle with its name, whatever its length.

use super::{
    layout::NODE,
    point::Point,
    svg::{INK, Svg, display, escaped},
};

/// Most lines of a name in a circle.
const LINES: usize = 3;
/// Smallest text of a name.
const SMALLEST: f64 = 8.0;
/// Width of a letter, as a part of its height.
const LETTER: f64 = 0.6;

/// Draws a variable. A name that does not fit is cut; the whole name is shown on hover and read aloud.
pub(super) fn variable(svg: &mut Svg, at: Point, name: &str) {
    svg.raw(&format!("<g class=\"node\"><title>{}</title>", escaped(&display(name))));
    svg.raw(&format!(
        "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{NODE}\" fill=\"#eef2f6\" stroke=\"{INK}\" stroke-width=\"1.6\"/>",
        at.x, at.y
    ));
    let lines = lines(&display(name));
    let longest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0).max(4);
    let room = if lines.len() > 1 { 1.4 } else { 1.6 };
    let size = (room * NODE / (LETTER * longest as f64)).clamp(SMALLEST, 16.0);
    let first = at.y + 0.36 * size - 0.55 * size * (lines.len() - 1) as f64;
    for (row, line) in lines.iter().enumerate() {
        svg.text(Point::new(at.x, first + 1.1 * size * row as f64), size, "middle", INK, line);
    }
    svg.raw("</g>");
}

/// A name in at most [`LINES`] lines that fit the circle, broken where words end; what is too long is cut.
fn lines(name: &str) -> Vec<String> {
    let fits = (1.4 * NODE / (LETTER * SMALLEST)) as usize;
    if name.chars().count() <= fits {
        return vec![name.to_owned()];
    }
    let mut lines = vec![String::new()];
    for word in name.split_inclusive(['_', '.', '/', ' ', '-', ':']) {
        for letter in word.chars() {
            let line = lines.last().map_or(0, |line| line.chars().count());
            if line >= fits {
                lines.push(String::new());
            }
            lines.last_mut().into_iter().for_each(|line| line.push(letter));
        }
        // The next word begins a line if it would not end in this one.
        let line = lines.last().map_or(0, |line| line.chars().count());
        if line + 3 > fits {
            lines.push(String::new());
        }
    }
    lines.retain(|line| !line.is_empty());
    if lines.len() > LINES {
        lines.truncate(LINES);
        if let Some(last) = lines.last_mut() {
            last.pop();
            last.push('…');
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
        assert!(long.iter().all(|line| line.chars().count() <= 12), "{long:?}");
    }
}
