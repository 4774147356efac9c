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
    /// pedestrians grey; lines show the paths of people and robots. Without frames it shows only the walls.
    pub fn svg(&self, simulation: &Simulation, seconds: f64) -> String {
        let (min, max) = simulation.world().bounds();
        let extent = max - min;
        let scale = (SIZE - 2.0 * MARGIN) / extent.x.max(extent.y).max(1e-9);
        let at = |p: Vec2| ((p.x - min.x) * scale + MARGIN, (max.y - p.y) * scale + MARGIN);
        let (width, height) = (extent.x * scale + 2.0 * MARGIN, extent.y * scale + 2.0 * MARGIN);
        let count = (seconds / (STEP * EVERY as f64)).ceil().max(0.0) as usize;
        let frames = &self.frames[..count.min(self.frames.len())];
        let length = frames.len() as f64 * STEP * EVERY as f64 / FASTER;

        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
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
            svg.push_str("</svg>\n");
            return svg;
        };
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
        svg.push_str("</svg>\n");
        svg
    }
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
        assert_eq!(svg.matches("<circle").count(), 1 + 3 + 2);
        assert_eq!(svg.matches("values=").count(), 2 * 6 + 1);
        assert!(svg.contains("dur=\"1.7s\"") && !svg.contains("NaN"), "10 s in a sixth of the time");
        let half = film.svg(&simulation, 5.0);
        assert!(half.len() < svg.len());
    }

    #[test]
    fn a_run_that_has_not_begun_shows_the_walls() {
        let simulation = Simulation::new(&Scenario::default(), 1).unwrap();
        let svg = Film::default().svg(&simulation, 60.0);
        assert_eq!((svg.matches("<path").count(), svg.matches("<circle").count()), (4, 0));
    }
}
