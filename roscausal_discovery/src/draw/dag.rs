//! The summary graph of a model.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::svg::{FAINT, INK, Point, Stroke, Svg, display, height_of_marks, legend, legend_of_marks};
use crate::model::{Link, Model};

const NODE: f64 = 38.0;

/// The summary graph as SVG: one node per variable, and one arrow per pair of cause and effect, labelled with its
/// lags. A variable that depends on its own past has a loop.
pub fn dag(model: &Model) -> String {
    let n = model.features.len();
    let radius = if n <= 2 { 110.0 } else { 90.0 + 26.0 * n as f64 };
    let size = 2.0 * (radius + NODE + 86.0);
    let mut svg = Svg::new(size.max(440.0), size + 110.0 + height_of_marks(model));
    let centre = Point::new(size.max(440.0) / 2.0, size / 2.0 + 30.0);
    svg.text(Point::new(16.0, 26.0), 15.0, "start", INK, &title(model));
    let places: Vec<Point> = (0..n)
        .map(|i| {
            let angle = if n == 2 { TAU / 2.0 } else { -FRAC_PI_2 } + TAU * i as f64 / n as f64;
            let r = if n == 1 { 0.0 } else { radius };
            centre.plus(r * angle.cos(), r * angle.sin())
        })
        .collect();
    for (i, cause) in model.features.iter().enumerate() {
        for (j, effect) in model.features.iter().enumerate() {
            let lagged: Vec<&Link> =
                model.links.iter().filter(|link| link.cause == *cause && link.effect == *effect).collect();
            let Some(&strongest) = lagged.iter().max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()))
            else {
                continue;
            };
            let lags: Vec<String> = lagged.iter().map(|link| link.lag.to_string()).collect();
            let stroke =
                Stroke::of_link(strongest.value, strongest.p_value, model.smallest_p(), &strongest.mark);
            let label = format!("{} · {:.2}", lags.join(","), strongest.value);
            if i == j {
                self_loop(&mut svg, places[i], centre, &stroke, &label);
            } else {
                cross_link(&mut svg, places[i], places[j], &stroke, &label);
            }
        }
    }
    for (name, &place) in model.features.iter().zip(&places) {
        node(&mut svg, place, name);
    }
    if n == 0 {
        svg.text(centre, 16.0, "middle", FAINT, "no causal link found");
    }
    legend(
        &mut svg,
        Point::new(16.0, size + 30.0),
        model.smallest_p(),
        model.links.iter().any(|link| link.value < 0.0),
    );
    legend_of_marks(&mut svg, Point::new(16.0, size + 106.0), model);
    let note = "on an arrow: lag in steps · strength";
    svg.text(Point::new(16.0 + 170.0, size + 34.0), 12.0, "start", INK, note);
    if let Some(dt) = model.dt {
        svg.text(Point::new(186.0, size + 52.0), 12.0, "start", INK, &format!("one step is {dt:.3} s"));
    }
    svg.finish()
}

/// One line that says how the model was found.
pub(super) fn title(model: &Model) -> String {
    format!(
        "{} · {} · α = {} · {} samples",
        model.method.to_uppercase(),
        model.cond_ind_test.to_uppercase(),
        model.alpha,
        model.n_samples
    )
}

fn node(svg: &mut Svg, at: Point, name: &str) {
    svg.raw(&format!(
        "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{NODE}\" fill=\"#eef2f6\" stroke=\"{INK}\" stroke-width=\"1.6\"/>",
        at.x, at.y
    ));
    let name = display(name);
    let size = (1.5 * NODE / (0.6 * name.chars().count().max(4) as f64)).clamp(8.0, 16.0);
    svg.text(at.plus(0.0, 0.36 * size), size, "middle", INK, &name);
}

fn cross_link(svg: &mut Svg, from: Point, to: Point, stroke: &Stroke, label: &str) {
    let along = from.towards(to);
    let distance = (to.x - from.x).hypot(to.y - from.y);
    // Bent to the left of its direction, so that the arrow in the other direction takes the other side.
    let bend = Point::new((from.x + to.x) / 2.0, (from.y + to.y) / 2.0)
        .plus(along.y * distance * 0.18, -along.x * distance * 0.18);
    let leave = from.towards(bend);
    let arrive = to.towards(bend);
    let start = from.plus(leave.x * NODE, leave.y * NODE);
    let end = to.plus(arrive.x * (NODE + 2.0), arrive.y * (NODE + 2.0));
    svg.arrow(start, bend, end, stroke);
    let middle = Point::new(
        0.25 * start.x + 0.5 * bend.x + 0.25 * end.x,
        0.25 * start.y + 0.5 * bend.y + 0.25 * end.y,
    );
    svg.label(middle, 12.0, INK, label);
}

fn self_loop(svg: &mut Svg, at: Point, centre: Point, stroke: &Stroke, label: &str) {
    let out = if at == centre { Point::new(0.0, -1.0) } else { centre.towards(at) };
    let side = Point::new(-out.y, out.x);
    let rim = |turn: f64| {
        let (sin, cos) = turn.sin_cos();
        at.plus(NODE * (out.x * cos + side.x * sin), NODE * (out.y * cos + side.y * sin))
    };
    let (start, end) = (rim(-0.6), rim(0.6));
    let bend = at.plus(out.x * NODE * 3.2, out.y * NODE * 3.2);
    svg.arrow(start, bend, end, stroke);
    svg.label(at.plus(out.x * NODE * 2.4, out.y * NODE * 2.25), 12.0, INK, label);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::example;

    #[test]
    fn every_pair_has_one_arrow_and_every_variable_a_node() {
        let svg = dag(&example());
        assert_eq!(svg.matches("<circle").count(), 3);
        // Six arrows, each a line and a head, and three strokes of the legend.
        assert_eq!(svg.matches("<path").count(), 6 * 2 + 3);
        assert!(svg.contains("h_risk"));
    }

    #[test]
    fn an_open_end_is_a_circle_and_the_legend_explains_it_only_then() {
        let plain = dag(&example());
        let mut model = example();
        let link = model.links.iter_mut().find(|link| link.cause != link.effect).unwrap();
        link.mark = "o->".into();
        let open = dag(&model);
        let explained = "cause, or something not recorded drives both";
        assert!(open.contains(explained) && !plain.contains(explained));
        // One at the link, one in the legend.
        assert_eq!(open.matches("<circle").count(), plain.matches("<circle").count() + 2);
    }

    #[test]
    fn names_cannot_break_the_picture() {
        let mut model = example();
        model.features[0] = "<script>&\"".into();
        assert!(dag(&model).contains("&lt;script&gt;&amp;&quot;"));
    }
}
