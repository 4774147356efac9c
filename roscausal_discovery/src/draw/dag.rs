//! The summary graph of a model.

use super::{
    arrows::{Arrow, arrows, merged},
    circle::{size, variable},
    layout::{Edge, MATRIX_FROM, Route, plan},
    matrix::{Matrix, matrix},
    maybe::{Maybe, maybes},
    point::Point,
    svg::{
        FAINT, INK, Stroke, Svg, display, escaped, height_of_marks, is_resampled, label_width,
        legend_of_marks, legend_of_model,
    },
};
use crate::model::Model;

/// Left of and above the graph.
const MARGIN: Point = Point { x: 16.0, y: 44.0 };
/// Size of the labels.
const TEXT: f64 = 12.0;
/// Height of the legend below the graph.
const LEGEND: f64 = 92.0;
/// Height of a line below the legend.
const LINE: f64 = 17.0;

/// The summary graph as SVG: one node per variable, and one arrow for each mark of a pair of cause and effect, labelled with its
/// lags. A variable that depends on its own past has a loop. From 16 variables on there is a matrix beside it.
pub fn dag(model: &Model) -> String {
    picture(model, beside(model))
}

/// The summary graph of [`dag`] and its matrix, if there is one, as two pictures.
pub fn dag_and_matrix(model: &Model) -> (String, Option<String>) {
    (picture(model, None), beside(model).map(|_| matrix(model)))
}

fn beside(model: &Model) -> Option<Matrix<'_>> {
    (model.features.len() >= MATRIX_FROM).then(|| Matrix::new(model))
}

fn picture(model: &Model, matrix: Option<Matrix<'_>>) -> String {
    let arrows = arrows(model);
    let edge =
        |arrow: &Arrow<'_>| Edge { from: arrow.from, to: arrow.to, label: label_width(TEXT, &arrow.label()) };
    let maybes = pairs_at_any_lag(&arrows, maybes(model));
    let faint = |maybe: &Maybe| Edge {
        from: maybe.from,
        to: maybe.to,
        label: label_width(TEXT, &format!("{:.2}", maybe.share)),
    };
    let edges: Vec<Edge> = arrows.iter().map(edge).chain(maybes.iter().map(faint)).collect();
    let plan = plan(model.features.len(), &edges);
    let (beside, tall) = matrix.as_ref().map_or((0.0, 0.0), Matrix::size);
    let lines = merged(&arrows, model.smallest_p());
    let foot = MARGIN.y + plan.height.max(if model.features.is_empty() { 60.0 } else { 0.0 }) + 24.0;
    let longest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0);
    let width = (MARGIN.x + plan.width + if beside > 0.0 { 40.0 + beside } else { 0.0 })
        .max(7.0 * longest as f64 + MARGIN.x)
        .max(460.0 - MARGIN.x);
    let list = if lines.is_empty() { 0.0 } else { LINE * (lines.len() + 1) as f64 };
    let height = (foot + LEGEND + height_of_marks(model) + list).max(MARGIN.y + tall);
    let mut svg = Svg::new(width + MARGIN.x, height);
    svg.title(&title(model));
    // A small graph stands in the middle.
    let shift = if beside > 0.0 { 0.0 } else { (width - MARGIN.x - plan.width) / 2.0 };
    let moved = |at: &Point| at.plus(MARGIN.x + shift, MARGIN.y);
    let group = |arrow: &Arrow<'_>| {
        format!(
            "<g class=\"link\" data-cause=\"{}\" data-effect=\"{}\"><title>{}</title>",
            escaped(&arrow.strongest.cause),
            escaped(&arrow.strongest.effect),
            escaped(&arrow.words(model.smallest_p()))
        )
    };
    for (arrow, route) in arrows.iter().zip(&plan.routes) {
        let stroke = Stroke::of(model, arrow.strongest, arrow.confidence(), arrow.mark);
        let path: Vec<Point> = route.path.iter().map(moved).collect();
        svg.raw(&group(arrow));
        svg.route(&path, &stroke);
        svg.raw("</g>");
    }
    for (arrow, route) in arrows.iter().zip(&plan.routes) {
        let Some(at) = &route.label else { continue };
        svg.raw(&group(arrow));
        svg.label(moved(at), TEXT, INK, &arrow.label());
        svg.raw("</g>");
    }
    let between: Vec<(&Maybe, &Route)> = maybes.iter().zip(plan.routes.iter().skip(arrows.len())).collect();
    draw_maybes(&mut svg, &between, &model.features, moved);
    let (size, nodes) = (size(&model.features), model.features.iter().zip(&plan.nodes));
    nodes.for_each(|(name, at)| variable(&mut svg, moved(at), name, size));
    if let Some(matrix) = matrix {
        matrix.draw(&mut svg, MARGIN.plus(plan.width + 40.0, 0.0));
    }
    if model.features.is_empty() {
        let middle = Point::new(MARGIN.x + width / 2.0, MARGIN.y + 40.0);
        svg.text(middle, 16.0, "middle", FAINT, "no causal link found");
    }
    below(&mut svg, foot, model, plan.routes.iter().any(|route| route.label.is_none()), &lines);
    svg.finish()
}

/// The pairs without an arrow that many resamples link: of all lags the one found most often.
fn pairs_at_any_lag(arrows: &[Arrow<'_>], maybes: Vec<Maybe>) -> Vec<Maybe> {
    let mut pairs: Vec<Maybe> = Vec::new();
    for maybe in maybes.into_iter().filter(|maybe| maybe.from != maybe.to) {
        if arrows.iter().any(|arrow| (arrow.from, arrow.to) == (maybe.from, maybe.to)) {
            continue;
        }
        match pairs.iter_mut().find(|pair| (pair.from, pair.to) == (maybe.from, maybe.to)) {
            Some(pair) if pair.share < maybe.share => *pair = maybe,
            Some(_) => {}
            None => pairs.push(maybe),
        }
    }
    pairs
}

/// Thin dotted lines, with the share of resamples on them.
fn draw_maybes(
    svg: &mut Svg,
    between: &[(&Maybe, &Route)],
    names: &[String],
    moved: impl Fn(&Point) -> Point,
) {
    for (maybe, route) in between {
        let (cause, effect) = (display(&names[maybe.from]), display(&names[maybe.to]));
        let (lag, share) = (maybe.lag, maybe.share);
        let words = format!(
            "{cause} → {effect}, lag {lag}: no link of the model, but in {share:.2} of the resamples"
        );
        svg.raw(&format!("<g class=\"maybe\"><title>{}</title>", escaped(&words)));
        let path: Vec<Point> = route.path.iter().map(&moved).collect();
        svg.route(&path, &Stroke::of_maybe(maybe.mark()));
        if let Some(at) = &route.label {
            svg.label(moved(at), TEXT, FAINT, &format!("{:.2}", maybe.share));
        }
        svg.raw("</g>");
    }
}

/// The legend, and what the arrows that stand for several lags mean.
fn below(svg: &mut Svg, foot: f64, model: &Model, bare: bool, lines: &[String]) {
    legend_of_model(svg, Point::new(16.0, foot), model);
    let note = if is_resampled(model) && !bare {
        "lines: share of the resamples with the link"
    } else if bare {
        "strengths and lags: see the matrix"
    } else {
        "on an arrow: lags in steps · largest strength"
    };
    svg.text(Point::new(186.0, foot + 4.0), TEXT, "start", INK, note);
    if let Some(step) = model.step_in_words() {
        svg.text(Point::new(186.0, foot + 22.0), TEXT, "start", INK, &format!("one step is {step}"));
    }
    legend_of_marks(svg, Point::new(16.0, foot + LEGEND - 16.0), model);
    let foot = foot + height_of_marks(model);
    if !lines.is_empty() {
        svg.text(Point::new(16.0, foot + LEGEND - 8.0), TEXT, "start", FAINT, "arrows with several lags");
    }
    for (row, line) in lines.iter().enumerate() {
        svg.text(Point::new(16.0, foot + LEGEND - 8.0 + LINE * (row + 1) as f64), TEXT, "start", INK, line);
    }
}

/// One line that says how the model was found.
pub(super) fn title(model: &Model) -> String {
    format!(
        "{} · {} · {} · {} samples",
        model.method.name().to_uppercase(),
        model.cond_ind_test.to_uppercase(),
        model.link_level().map_or("α by score".to_owned(), |level| format!("α = {level}")),
        model.n_samples
    )
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
        link.mark = crate::types::LinkMark::CircleHead;
        let open = dag(&model);
        let explained = "cause, or something not recorded drives both";
        assert!(open.contains(explained) && !plain.contains(explained));
        // One at the link, one in the legend.
        assert_eq!(open.matches("<circle").count(), plain.matches("<circle").count() + 2);
    }

    #[test]
    fn names_have_one_size() {
        let mut model = example();
        model.features[0] = "room_temperature".into();
        let sizes: std::collections::BTreeSet<String> = dag(&model)
            .split("class=\"node\"")
            .skip(1)
            .filter_map(|node| Some(node.split_once("font-size=\"")?.1.split_once('"')?.0.to_owned()))
            .collect();
        assert_eq!(sizes.len(), 1, "{sizes:?}");
    }

    #[test]
    fn names_cannot_break_the_picture() {
        let mut model = example();
        model.features[0] = "<script>&\"".into();
        assert!(dag(&model).contains("&lt;script&gt;&amp;&quot;"));
    }
}
