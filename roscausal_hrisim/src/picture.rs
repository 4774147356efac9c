//! A run as an animated SVG: walls, paths, and everybody's positions over time.

use std::fmt::Write;

use crate::{Simulation, geometry::Vec2, simulation::STEP};

/// Steps from frame to frame: 0.4 s.
const EVERY: u64 = 10;
/// Most frames; of a longer run the first part is shown.
const MOST_FRAMES: usize = 2_000;
/// Length of the picture's longer side, pixels.
const SIZE: f64 = 560.0;
const MARGIN: f64 = 14.0;
/// How many times faster than the run the film is.
const FASTER: f64 = 6.0;
const PERSON: &str = "#0072b2";
const ROBOT: &str = "#d55e00";
const CROWD: &str = "#8a97a5";
const INK: &str = "#1f2933";
/// Height of clock, scale and legend below the scene, pixels.
const FOOT: f64 = 46.0;
/// Least width, for the legend.
const WIDE: f64 = 440.0;

/// One moment.
#[derive(Clone, Debug, PartialEq)]
struct Frame {
    people: Vec<(Vec2, Vec2)>,
    robots: Vec<Vec2>,
    crowd: Vec<Vec2>,
}

/// Film of a run, recorded step by step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Film {
    frames: Vec<Frame>,
}

impl Film {
    /// Records the current state, if a frame is due.
    pub fn take(&mut self, simulation: &Simulation) {
        if !simulation.steps().is_multiple_of(EVERY) || self.frames.len() >= MOST_FRAMES {
            return;
        }
        self.frames.push(Frame {
            people: simulation.people.iter().map(|person| (person.position, person.goal)).collect(),
            robots: simulation.robots.iter().map(|robot| robot.position).collect(),
            crowd: simulation.crowd.members.iter().map(|member| member.position).collect(),
        });
    }

    /// The animated picture of the first `seconds`. People are blue with crosses for goals, robots orange,
    /// pedestrians grey; lines show the paths of people and robots. Below are the clock, a scale and a legend. Without
    /// frames it shows only the walls.
    pub fn svg(&self, simulation: &Simulation, seconds: f64) -> String {
        let (min, max) = simulation.world().bounds();
        let extent = max - min;
        let scale = (SIZE - 2.0 * MARGIN) / extent.x.max(extent.y).max(1e-9);
        let at = |p: Vec2| ((p.x - min.x) * scale + MARGIN, (max.y - p.y) * scale + MARGIN);
        let (width, height) = ((extent.x * scale + 2.0 * MARGIN).max(WIDE), extent.y * scale + 2.0 * MARGIN);
        let count = (seconds / (STEP * EVERY as f64)).ceil().max(0.0) as usize;
        let frames = &self.frames[..count.min(self.frames.len())];
        let length = frames.len() as f64 * STEP * EVERY as f64 / FASTER;

        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{tall:.0}\" \
             viewBox=\"0 0 {width:.0} {tall:.0}\" font-family=\"DejaVu Sans, sans-serif\" font-size=\"12\">\n\
             <title>The run from above, {FASTER:.0} times faster</title>\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
            tall = height + FOOT
        );
        let mut add = |element: String| {
            // Writing to a String cannot fail.
            let _ = writeln!(svg, "{element}");
        };
        for wall in simulation.world().walls() {
            let ((x1, y1), (x2, y2)) = (at(wall.a), at(wall.b));
            add(format!(
                "<path d=\"M {x1:.1} {y1:.1} L {x2:.1} {y2:.1}\" stroke=\"{INK}\" stroke-width=\"3\"/>"
            ));
        }
        let Some(first) = frames.first() else {
            return svg + "</svg>\n";
        };
        let (y, to, all) = (height + 14.0, length * FASTER, simulation.time());
        add(clock(frames.len(), length, y));
        add(format!("<text x=\"56\" y=\"{y:.0}\" fill=\"{INK}\">of the first {to:.0} of {all:.0} s</text>"));
        add(bar(scale, width - MARGIN, height + 10.0));
        add(legend(height + 34.0, !first.crowd.is_empty()));
        let mut body = |way: Vec<Vec2>, colour: &str, radius: f64, with_line: bool| {
            let places: Vec<(f64, f64)> = way.into_iter().map(at).collect();
            if with_line {
                let line: Vec<String> = places.iter().map(|(x, y)| format!("{x:.0} {y:.0}")).collect();
                add(format!(
                    "<path d=\"M {}\" fill=\"none\" stroke=\"{colour}\" stroke-opacity=\"0.18\" stroke-width=\"2\"/>",
                    line.join(" L ")
                ));
            }
            let list = |pick: fn(&(f64, f64)) -> f64| {
                places.iter().map(|place| format!("{:.0}", pick(place))).collect::<Vec<_>>().join(";")
            };
            let animate = |name: &str, values: String| {
                format!(
                    "<animate attributeName=\"{name}\" dur=\"{length:.1}s\" repeatCount=\"indefinite\" values=\"{values}\"/>"
                )
            };
            let (x, y) = places[0];
            add(format!(
                "<circle cx=\"{x:.0}\" cy=\"{y:.0}\" r=\"{radius}\" fill=\"{colour}\">{}{}</circle>",
                animate("cx", list(|place| place.0)),
                animate("cy", list(|place| place.1))
            ));
        };
        for index in 0..first.crowd.len() {
            body(frames.iter().map(|frame| frame.crowd[index]).collect(), CROWD, 4.0, false);
        }
        for index in 0..first.robots.len() {
            body(frames.iter().map(|frame| frame.robots[index]).collect(), ROBOT, 8.0, true);
        }
        for index in 0..first.people.len() {
            body(frames.iter().map(|frame| frame.people[index].0).collect(), PERSON, 6.0, true);
        }
        for index in 0..first.people.len() {
            let goals: Vec<(f64, f64)> = frames.iter().map(|frame| at(frame.people[index].1)).collect();
            let values: Vec<String> = goals.iter().map(|(x, y)| format!("{x:.0} {y:.0}")).collect();
            add(format!(
                "<path d=\"M -5 -5 L 5 5 M -5 5 L 5 -5\" stroke=\"{PERSON}\" stroke-width=\"2\"><animateTransform \
                 attributeName=\"transform\" type=\"translate\" calcMode=\"discrete\" dur=\"{length:.1}s\" \
                 repeatCount=\"indefinite\" values=\"{}\"/></path>",
                values.join(";")
            ));
        }
        svg + "</svg>\n"
    }
}

/// The time of the run in whole seconds: one text per second, of which one is seen.
fn clock(frames: usize, length: f64, y: f64) -> String {
    let seconds = (frames as f64 * STEP * EVERY as f64).ceil().max(1.0) as usize;
    let mut out = format!("<g class=\"clock\" fill=\"{INK}\">");
    for second in 0..seconds {
        let (from, to) = (second as f64 / seconds as f64, (second + 1) as f64 / seconds as f64);
        // Hidden, seen from its second on, hidden again.
        let (values, times) = match second {
            0 => ("visible;hidden", format!("0;{to:.5}")),
            _ if second + 1 == seconds => ("hidden;visible", format!("0;{from:.5}")),
            _ => ("hidden;visible;hidden", format!("0;{from:.5};{to:.5}")),
        };
        let seen = if second == 0 { "visible" } else { "hidden" };
        // A clock of one second stands still.
        let animation = match seconds {
            1 => String::new(),
            _ => format!(
                "<animate attributeName=\"visibility\" calcMode=\"discrete\" dur=\"{length:.1}s\" \
                 repeatCount=\"indefinite\" values=\"{values}\" keyTimes=\"{times}\"/>"
            ),
        };
        let _ = write!(
            out,
            "<text x=\"{MARGIN}\" y=\"{y:.0}\" visibility=\"{seen}\">{second} s{animation}</text>"
        );
    }
    out + "</g>"
}

/// A bar of 1, 2 or 5 times a power of ten metres, up to a quarter of the picture; its right end is at `x`.
fn bar(scale: f64, x: f64, y: f64) -> String {
    let most = SIZE / 4.0 / scale;
    let power = libm::pow(10_f64, libm::log10(most).floor());
    let metres =
        [5.0, 2.0, 1.0].map(|by| by * power).into_iter().find(|metres| *metres <= most).unwrap_or(power);
    let left = x - metres * scale;
    let (top, words, base) = (y - 3.0, left - 6.0, y + 4.0);
    format!(
        "<path class=\"scale\" d=\"M {left:.1} {top:.1} v 6 M {left:.1} {y:.1} H {x:.1} M {x:.1} {top:.1} v 6\" fill=\"none\" \
         stroke=\"{INK}\" stroke-width=\"1.5\"/><text x=\"{words:.1}\" y=\"{base:.1}\" text-anchor=\"end\" fill=\"{INK}\">{metres} m</text>"
    )
}

/// What is who.
fn legend(y: f64, with_crowd: bool) -> String {
    let dot = |x: f64, colour: &str, radius: f64| {
        format!("<circle cx=\"{x:.0}\" cy=\"{y:.0}\" r=\"{radius}\" fill=\"{colour}\"/>")
    };
    let word =
        |x: f64, text: &str| format!("<text x=\"{x:.0}\" y=\"{:.0}\" fill=\"{INK}\">{text}</text>", y + 4.0);
    let mut out = String::from("<g class=\"legend\">");
    out += &(dot(22.0, ROBOT, 7.0) + &word(34.0, "robot"));
    out += &(dot(92.0, PERSON, 5.0) + &word(102.0, "person"));
    out += &format!(
        "<g transform=\"translate(168 {y:.0})\"><path d=\"M -5 -5 L 5 5 M -5 5 L 5 -5\" stroke=\"{PERSON}\" \
         stroke-width=\"2\"/></g>"
    );
    out += &word(178.0, "their goal");
    if with_crowd {
        out += &(dot(252.0, CROWD, 4.0) + &word(262.0, "other people"));
    }
    out += &word(360.0, "line: path");
    out + "</g>"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;

    #[test]
    fn everybody_is_in_the_picture_and_moves() {
        let mut simulation = Simulation::new(&Scenario::crowd(3, 2), 1).unwrap();
        let mut film = Film::default();
        for _ in 0..250 {
            simulation.step();
            film.take(&simulation);
        }
        let svg = film.svg(&simulation, 60.0);
        // In the picture and, one of each kind, in the legend.
        assert_eq!(svg.matches("<circle").count(), 1 + 3 + 2 + 3);
        assert_eq!(svg.matches("values=").count(), 2 * 6 + 1 + 10);
        assert!(svg.contains("dur=\"1.7s\"") && !svg.contains("NaN"), "10 s in a sixth of the time");
        let half = film.svg(&simulation, 5.0);
        assert!(half.len() < svg.len() && half.contains(">of the first 5 of 10 s<"), "which part it shows");
    }

    #[test]
    fn the_clock_shows_one_second_at_a_time_and_the_scale_is_round() {
        let clock = clock(25, 10.0 / FASTER, 0.0);
        assert_eq!(
            (clock.matches("<text").count(), clock.matches("visibility=\"visible\"").count()),
            (10, 1)
        );
        assert!(
            clock.contains(">1 s<animate") && clock.contains("keyTimes=\"0;0.10000;0.20000\""),
            "{clock}"
        );
        // 20 pixels per metre: a quarter of the picture is 7 m.
        let bar = bar(20.0, 500.0, 0.0);
        assert!(bar.contains(">5 m<") && bar.contains("M 400.0"), "{bar}");
    }

    #[test]
    fn a_run_that_has_not_begun_shows_the_walls() {
        let simulation = Simulation::new(&Scenario::default(), 1).unwrap();
        let svg = Film::default().svg(&simulation, 60.0);
        assert_eq!((svg.matches("<path").count(), svg.matches("<circle").count()), (4, 0));
    }
}
