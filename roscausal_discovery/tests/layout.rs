//! The laws of the pictures of graphs, measured on the pictures: what is parsed is the SVG that users see.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod graphs;

use std::collections::BTreeMap;

use graphs::{GRAPHS, any_graph, random_model};
use roscausal_discovery::{Model, draw};

/// What a picture of a graph consists of.
#[derive(Default)]
struct Picture {
    /// Circles of the variables: name, centre, radius.
    circles: Vec<(String, [f64; 2], f64)>,
    /// Lines of the arrows: cause, effect, points along the line.
    lines: Vec<(String, String, Vec<[f64; 2]>)>,
    /// Backgrounds of the labels: left, top, right, bottom.
    labels: Vec<[f64; 4]>,
    size: [f64; 2],
}

fn attribute<'a>(element: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = element.split_once(&format!(" {name}=\""))?;
    Some(rest.split_once('"')?.0)
}

fn number(element: &str, name: &str) -> f64 {
    attribute(element, name).unwrap_or_else(|| panic!("no {name} in {element}")).parse().unwrap()
}

fn parse(svg: &str) -> Picture {
    let mut picture = Picture::default();
    let mut group = String::new();
    for line in svg.lines() {
        if line.starts_with("<svg") {
            picture.size = [number(line, "width"), number(line, "height")];
        } else if line.starts_with("<g ") {
            group = line.to_owned();
        } else if line == "</g>" {
            group.clear();
        } else if attribute(&group, "class") == Some("node") && line.starts_with("<circle") {
            let name = group.split_once("<title>").unwrap().1.split_once("</title>").unwrap().0;
            picture.circles.push((name.into(), [number(line, "cx"), number(line, "cy")], number(line, "r")));
        } else if attribute(&group, "class") == Some("link") && line.starts_with("<rect") {
            let (x, y) = (number(line, "x"), number(line, "y"));
            picture.labels.push([x, y, x + number(line, "width"), y + number(line, "height")]);
        } else if attribute(&group, "class") == Some("link") && line.contains("fill=\"none\"") {
            let ends = |name: &str| attribute(&group, name).unwrap().to_owned();
            picture.lines.push((
                ends("data-cause"),
                ends("data-effect"),
                along(attribute(line, "d").unwrap()),
            ));
        }
    }
    picture
}

/// Points along a path of cubic Bézier curves, close together.
fn along(d: &str) -> Vec<[f64; 2]> {
    let numbers: Vec<f64> = d.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    let points: Vec<[f64; 2]> = numbers.chunks(2).map(|p| [p[0], p[1]]).collect();
    assert!(points.len() % 3 == 1, "{d}");
    let piece = |p: &[[f64; 2]]| {
        let p = p.to_vec();
        (0..=60).map(move |step| {
            let (t, s) = (f64::from(step) / 60.0, 1.0 - f64::from(step) / 60.0);
            let w = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
            [0, 1].map(|axis| (0..4).map(|i| w[i] * p[i][axis]).sum::<f64>())
        })
    };
    points.windows(4).step_by(3).flat_map(piece).collect()
}

fn pairs(model: &Model) -> BTreeMap<(String, String), usize> {
    let mut pairs = BTreeMap::new();
    for link in &model.links {
        *pairs.entry((link.cause.clone(), link.effect.clone())).or_default() += 1;
    }
    pairs
}

#[test]
fn no_arrow_passes_within_a_circle_that_is_not_its_own_and_no_two_labels_overlap() {
    let mut labelled = 0;
    for number in 0..GRAPHS {
        let model = any_graph(number);
        let n = model.features.len();
        let svg = draw::dag(&model);
        let picture = parse(&svg);
        assert_eq!(picture.circles.len(), n, "graph {number}");
        assert_eq!(picture.lines.len(), pairs(&model).len(), "graph {number}: an arrow for each pair");
        for (cause, effect, points) in &picture.lines {
            for (name, centre, radius) in &picture.circles {
                if name == cause || name == effect {
                    continue;
                }
                let nearest = points
                    .iter()
                    .map(|p| (p[0] - centre[0]).hypot(p[1] - centre[1]))
                    .fold(f64::INFINITY, f64::min);
                assert!(
                    nearest > *radius,
                    "graph {number} of {n}: {cause} -> {effect} is {nearest} from {name}"
                );
            }
            assert!(
                points
                    .iter()
                    .all(|p| p[0] > 0.0 && p[1] > 0.0 && p[0] < picture.size[0] && p[1] < picture.size[1])
            );
        }
        for (i, a) in picture.labels.iter().enumerate() {
            for b in &picture.labels[..i] {
                let apart = a[0] >= b[2] || b[0] >= a[2] || a[1] >= b[3] || b[1] >= a[3];
                assert!(apart, "graph {number} of {n}: the labels {a:?} and {b:?} overlap");
            }
            for (name, centre, radius) in &picture.circles {
                let near = [centre[0].clamp(a[0], a[2]), centre[1].clamp(a[1], a[3])];
                let distance = (near[0] - centre[0]).hypot(near[1] - centre[1]);
                assert!(distance > *radius, "graph {number} of {n}: the label {a:?} covers {name}");
            }
        }
        for (i, (one, a, radius)) in picture.circles.iter().enumerate() {
            for (two, b, _) in &picture.circles[..i] {
                assert!((a[0] - b[0]).hypot(a[1] - b[1]) > 2.0 * radius, "graph {number}: {one} and {two}");
            }
        }
        labelled += usize::from(picture.labels.len() == picture.lines.len());
        assert!(n >= 16 || picture.labels.len() == picture.lines.len(), "graph {number} of {n} lacks labels");
        assert_eq!(n >= 16, svg.contains("rows: effects"), "graph {number}: a matrix from 16 variables on");
        assert_eq!(svg, draw::dag(&model), "graph {number} is the same each time");
    }
    assert!(labelled > GRAPHS as usize / 2, "only {labelled} graphs have all their labels");
}

#[test]
fn a_picture_is_no_larger_than_what_is_in_it() {
    for number in (0..GRAPHS).step_by(9) {
        let model = any_graph(number);
        let picture = parse(&draw::dag(&model));
        let left = picture.circles.iter().map(|c| c.1[0] - c.2);
        let right = picture.circles.iter().map(|c| c.1[0] + c.2).chain(picture.labels.iter().map(|l| l[2]));
        let top = picture.circles.iter().map(|c| c.1[1] - c.2).chain(picture.labels.iter().map(|l| l[1]));
        let (left, right) = (left.fold(f64::INFINITY, f64::min), right.fold(0.0, f64::max));
        let n = model.features.len();
        if n < 16 && picture.size[0] > 800.0 {
            assert!(
                left < 130.0 && picture.size[0] - right < 130.0,
                "{n}: {left}, {right} of {:?}",
                picture.size
            );
        }
        assert!(top.fold(f64::INFINITY, f64::min) < 130.0, "graph {number} of {n}");
    }
}

#[test]
fn an_arrow_for_several_lags_lists_each_of_them() {
    let model = random_model(6, 3.0, 4);
    let svg = draw::dag(&model);
    let several: Vec<_> = pairs(&model).into_iter().filter(|(_, count)| *count > 1).collect();
    assert!(!several.is_empty());
    for ((cause, effect), count) in several {
        let line = svg
            .lines()
            .find(|line| line.starts_with("<text") && line.contains(&format!(">{cause} → {effect}  lag")))
            .unwrap_or_else(|| panic!("{cause} -> {effect} is not listed"));
        assert_eq!(line.matches("lag ").count(), count, "{line}");
    }
}
