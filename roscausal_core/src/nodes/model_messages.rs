//! From a [`Model`] to the messages that the discovery node publishes, and back.

use std::collections::HashSet;

use roscausal_discovery::{Link, LinkMark, Model, Settings, draw};
use roscausal_msgs::{
    CausalLink, CausalModel, CausalModelInfo, Time,
    sensor_msgs::{CompressedImage, Image},
    std_msgs::{Float32MultiArray, Header, Int32MultiArray, MultiArrayDimension, MultiArrayLayout},
};

use crate::Result;

/// Where a model comes from, and from when.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    /// Name of the batch, without extension; several are joined by `+`.
    pub batch_id: String,
    /// Frame in which the batch was recorded.
    pub frame_id: String,
    /// Stamp of the first sample.
    pub start: Time,
    /// Stamp of the last sample.
    pub end: Time,
    /// Variables that were given to the method.
    pub candidate_features: Vec<String>,
}

/// The model as `roscausal_msgs/CausalModel`: arrays `[lag][target][source]`, flattened row-major.
pub fn causal_model(model: &Model, header: &Header) -> CausalModel {
    let n = model.features.len() as u32;
    let lags = (model.tau_max - model.tau_min + 1) as u32;
    let dim = |label: &str, size, stride| MultiArrayDimension { label: label.to_owned(), size, stride };
    let dims = vec![dim("lag", lags, lags * n * n), dim("target", n, n * n), dim("source", n, n)];
    let layout = MultiArrayLayout { dim: dims, data_offset: 0 };
    let floats = |matrix: &[Vec<Vec<f64>>]| Float32MultiArray {
        layout: layout.clone(),
        data: matrix.iter().flatten().flatten().map(|&v| v as f32).collect(),
    };
    CausalModel {
        header: header.clone(),
        features: model.features.clone(),
        causal_structure: Int32MultiArray {
            layout: layout.clone(),
            data: model.causal_structure.iter().flatten().flatten().copied().collect(),
        },
        val_matrix: floats(&model.val),
        pval_matrix: floats(&model.pval),
        original_shape: vec![lags as i32, n as i32, n as i32],
    }
}

/// Everything else about the model. `before` is the model published previously.
pub fn causal_model_info(
    model: &Model,
    header: &Header,
    origin: &Origin,
    before: Option<&Model>,
) -> CausalModelInfo {
    let mut links: Vec<&Link> = model.links.iter().collect();
    links.sort_by(|a, b| b.drawn_strength().abs().total_cmp(&a.drawn_strength().abs()));
    let (gained, lost) = match before {
        Some(before) => (names_not_in(model, before), names_not_in(before, model)),
        None => (model.links.iter().map(short).collect(), Vec::new()),
    };
    CausalModelInfo {
        header: header.clone(),
        batch_id: origin.batch_id.clone(),
        method: model.method.to_string(),
        cond_ind_test: model.cond_ind_test.clone(),
        fdr_method: model.fdr.clone(),
        alpha: model.alpha,
        pc_alpha: model.pc_alpha.unwrap_or(0.0),
        min_lag: model.tau_min as u32,
        max_lag: model.tau_max as u32,
        dt: model.dt.unwrap_or(0.0),
        n_samples: model.n_samples as u32,
        start_time: origin.start,
        end_time: origin.end,
        seed: model.seed,
        run_time_s: model.run_time_s.unwrap_or(0.0),
        software_version: env!("CARGO_PKG_VERSION").to_owned(),
        candidate_features: origin.candidate_features.clone(),
        links: links.iter().map(|link| causal_link(model, link)).collect(),
        links_gained: gained,
        links_lost: lost,
    }
}

/// The model of a message, as far as the message has it: variables, links and how they were found; no matrices.
pub fn model_of(info: &CausalModelInfo) -> Model {
    let mut features = info.candidate_features.clone();
    let mut known: HashSet<&String> = info.candidate_features.iter().collect();
    let linked = info.links.iter().flat_map(|link| [&link.cause, &link.effect]);
    features.extend(linked.filter(|name| known.insert(name)).cloned());
    let largest = info.links.iter().map(|link| link.lag).fold(info.max_lag, u32::max) as usize;
    Model {
        method: info.method.as_str().into(),
        cond_ind_test: info.cond_ind_test.clone(),
        alpha: info.alpha,
        // The message has 0 for a level that a score chose, and for a step that is not known.
        pc_alpha: Some(info.pc_alpha).filter(|level| *level > 0.0),
        dt: Some(info.dt).filter(|dt| *dt != 0.0),
        tau_min: largest.min(info.min_lag as usize),
        tau_max: largest,
        n_samples: info.n_samples as usize,
        features,
        links: info.links.iter().map(link_of).collect(),
        ..Settings::default().blank_model()
    }
}

fn link_of(link: &CausalLink) -> Link {
    // Messages of before there was a mark do not say what was tested, and all of it was.
    let tested = link.tested || link.mark.is_empty();
    Link {
        cause: link.cause.clone(),
        effect: link.effect.clone(),
        lag: link.lag as usize,
        value: tested.then_some(link.value),
        p_value: tested.then_some(link.p_value),
        mark: mark_of(link),
        confidence: Some(link.confidence).filter(|share| *share >= 0.0),
        required: !tested,
        ..Link::default()
    }
}

/// A picture as a raw image and as a PNG. `scale` is pixels per unit of the drawing.
///
/// # Errors
/// A drawing that cannot be rendered.
pub fn images(svg: &str, scale: f32, header: &Header) -> Result<(Image, CompressedImage)> {
    let pixels = draw::rasterise(svg, scale)?;
    let raw = Image {
        header: header.clone(),
        height: pixels.height,
        width: pixels.width,
        encoding: "rgb8".to_owned(),
        is_bigendian: 0,
        step: 3 * pixels.width,
        data: pixels.rgb,
    };
    Ok((raw, CompressedImage { header: header.clone(), format: "png".to_owned(), data: pixels.png }))
}

fn causal_link(model: &Model, link: &Link) -> CausalLink {
    let what = match link.mark {
        LinkMark::Forward | LinkMark::Unoriented => short(link),
        _ => format!("{} (lag {})", link.sentence(), link.lag),
    };
    let found = link.confidence.map_or(String::new(), |share| {
        let done = model.confidence.as_ref().map_or(100, |confidence| confidence.resampling.done);
        let word = link.word().map_or(String::new(), |word| word + ": ");
        format!(", {word}in {:.0} of {done} resamples", share * done as f64)
    });
    let since = link.since.map_or(String::new(), |since| format!(", in each since {since:.1} s"));
    let age = link.seen.map_or(String::new(), |seen| format!("; in {seen} of the last 8 models{since}"));
    let strength = match link.p_value {
        Some(p) => format!("strength {}, p = {p:.4}", link.strength_in_words(3)),
        None => link.strength_in_words(3),
    };
    CausalLink {
        cause: link.cause.clone(),
        effect: link.effect.clone(),
        lag: link.lag as u32,
        value: link.value.unwrap_or(f64::NAN),
        p_value: link.p_value.unwrap_or(f64::NAN),
        confidence: link.confidence.unwrap_or(-1.0),
        description: format!("{what}: {strength}{found}{age}"),
        mark: link.mark.to_string(),
        tested: link.value.is_some(),
        samples: link.n_used.map_or(0, |used| used as u32),
        chance: link.chance.unwrap_or(f64::NAN),
    }
}

/// The mark of a link of a message, such as `<->`. A link without one is a cause: whoever writes such a message knows no others. A mark
/// that is not known claims nothing of a direction.
pub fn mark_of(link: &CausalLink) -> LinkMark {
    match link.mark.as_str() {
        "" => LinkMark::Forward,
        given => given.parse().unwrap_or(LinkMark::Unoriented),
    }
}

fn short(link: &Link) -> String {
    let arrow = if link.mark == LinkMark::Forward { "->" } else { "--" };
    format!("{} {arrow} {} (lag {})", link.cause, link.effect, link.lag)
}

fn names_not_in(model: &Model, other: &Model) -> Vec<String> {
    let others: Vec<String> = other.links.iter().map(short).collect();
    model.links.iter().map(short).filter(|name| !others.contains(name)).collect()
}

#[cfg(test)]
mod tests {
    use roscausal_discovery::{Matrices, Settings};

    use super::*;

    /// Three variables and six links, all at lag 1.
    fn example() -> Model {
        let links = [(0, 0), (1, 1), (0, 1), (1, 0), (2, 0), (0, 2)];
        let mark = |i, j| if links.contains(&(i, j)) { LinkMark::Forward } else { LinkMark::Absent };
        let graph = (0..3).map(|i| (0..3).map(|j| vec![LinkMark::Absent, mark(i, j)]).collect()).collect();
        let numbers = |v: f64| vec![vec![vec![0.0, v]; 3]; 3];
        let names = ["h_v", "h_dg", "h_risk"].map(str::to_owned).to_vec();
        let matrices =
            Matrices { graph, val_matrix: numbers(0.49), p_matrix: numbers(0.001), ..Matrices::default() };
        Settings::default().blank_model().with_matrices(names, matrices)
    }

    #[test]
    fn arrays_are_lag_target_source_and_say_so() {
        let message = causal_model(&example(), &Header::default());
        assert_eq!(message.original_shape, [1, 3, 3]);
        // Row = effect h_v, column = cause h_risk.
        assert_eq!(message.causal_structure.data[2], 1);
        // Row = effect h_risk, column = cause h_dg.
        assert_eq!(message.causal_structure.data[2 * 3 + 1], 0);
        let labels: Vec<&str> = message.val_matrix.layout.dim.iter().map(|d| d.label.as_str()).collect();
        assert_eq!(labels, ["lag", "target", "source"]);
    }

    #[test]
    fn a_link_carries_its_confidence_and_minus_one_without_resamples() {
        let mut model = example();
        let confidence = |model: &Model| {
            let info = causal_model_info(model, &Header::default(), &Origin::default(), None);
            (info.links[0].confidence, info.links[0].description.clone())
        };
        assert_eq!(confidence(&model).0, -1.0);
        model.links[0].confidence = Some(0.41);
        let (share, words) = confidence(&model);
        assert_eq!(share, 0.41);
        assert!(words.ends_with(", in 41 of 100 resamples"), "{words}");
    }

    #[test]
    fn a_message_has_the_mark_of_each_link_and_whether_it_was_tested() {
        let mut model = example();
        for (link, mark) in model.links.iter_mut().zip(["-->", "<->", "o->", "o-o", "x->", "x-x"]) {
            link.mark = mark.parse().unwrap();
        }
        (model.links[0].value, model.links[0].p_value, model.links[0].required) = (None, None, true);
        let info = causal_model_info(&model, &Header::default(), &Origin::default(), None);
        let read: Vec<LinkMark> = info.links.iter().map(mark_of).collect();
        let written: Vec<LinkMark> = model.links.iter().map(|link| link.mark).collect();
        assert_eq!(read, written);
        let first = &info.links[0];
        assert!(!first.tested && first.value.is_nan() && first.description.ends_with(": required"));
        assert!(info.links[1].tested && info.links[1].chance.is_nan());
        let of = |mark: &str| mark_of(&CausalLink { mark: mark.into(), ..CausalLink::default() });
        assert_eq!([of(""), of("=>")], [LinkMark::Forward, LinkMark::Unoriented]);
    }

    #[test]
    fn gained_and_lost_links_are_told() {
        let now = example();
        let mut before = example();
        before.links[0].effect = "h_x".into();
        let info = causal_model_info(&now, &Header::default(), &Origin::default(), Some(&before));
        assert_eq!(info.links_gained.len(), 1);
        assert_eq!(info.links_lost, ["h_v -> h_x (lag 1)"]);
    }
}
