//! How far to trust a link: the analysis again and again on rows drawn from the data.
//!
//! 1. Draw rows of the lag embedding, so that lags stay whole: a subsample of 0.632 of them, or a bootstrap.
//! 2. Run the whole method on them. Count for each pair and lag how often there was a link, and with which mark.
//! 3. Put the shares, the majority and the intervals of the values into the model.
//!
//! A share is not a probability that the link is causal: a hidden common cause makes a link firm, too, and so does a system that
//! changes while it is recorded. It says how well the link would be found again in such data. Sources: Debeire, Runge,
//! Gerhardus and Eyring 2024, "Bootstrap aggregation and confidence measures to improve time series causal discovery"; Politis,
//! Romano and Wolf 1999, "Subsampling".
//!
//! Why subsamples: rows that are drawn twice break smooth regressions and neighbours, so that a bootstrap finds absent links in
//! 0.17 (parcorr) and 0.29 (gpdc) of its resamples at a level of 0.05; subsamples find them in 0.05.
//!
//! ```
//! use roscausal_discovery::{Control, DataFrame, Settings, confidence::{Resampling, analyse_resampled}, methods::Method};
//!
//! # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
//! # let mut values = ndarray::Array2::zeros((300, 2));
//! # for t in 1..300 {
//! #     values[[t, 0]] = noise(2 * t);
//! #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
//! # }
//! # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
//! let settings = Settings { method: Method::Pcmci, cond_ind_test: "parcorr".into(), ..Settings::default() };
//! let model = analyse_resampled(&data, &settings, &Resampling::default(), &Control::default())?;
//! assert!(model.links[0].confidence.is_some_and(|share| share > 0.9));
//! # Ok::<(), roscausal_discovery::Error>(())
//! ```

mod advice;
mod draws;
mod resamples;
mod size;
mod summary;

use resamples::Resamples;
use summary::Summary;

pub use crate::settings::{Block, FEWEST_RESAMPLES, MOST_RESAMPLES, Resampling, Scheme};
pub use advice::set_step;
pub use draws::bootstrap_rows;
pub use resamples::data_of_resample;

use serde::Serialize;

use crate::{
    analysis::{Found, analyse, analyse_with_evidence},
    evidence::Evidence,
    methods::Status,
    model::{Confidence, Link, Model, ResamplingFacts, nested},
    settings::Settings,
    types::{Control, DataFrame, LinkMark, Result, Stop},
};

/// Share of the values between the low and the high one.
const LEVEL: f64 = 0.9;

/// The graph of one resample.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResampleGraph {
    /// Its number, from 0.
    pub resample: usize,
    /// The variables of the data, in the order of the matrices.
    pub variables: Vec<String>,
    /// Link marks, `[cause][effect][lag]`.
    pub graph: Vec<Vec<Vec<LinkMark>>>,
    /// Strengths, `[cause][effect][lag]`.
    pub val_matrix: Vec<Vec<Vec<f64>>>,
}

/// A model with its fields of confidence, and all that it rests on.
#[derive(Clone, Debug)]
pub struct Resampled {
    /// The model.
    pub model: Model,
    /// What stands behind its links.
    pub evidence: Evidence,
    /// The graph of each resample.
    pub graphs: Vec<ResampleGraph>,
}

/// Analyses `data` as [`analyse`] does, and resamples: the model has its fields of confidence.
///
/// The resamples run in parallel; their number of threads changes nothing. If the time budget ends, those that came to their
/// end count, and the status is partial; below 20 there is no confidence.
///
/// # Errors
/// Invalid settings, data that are too few to draw from, or cancellation.
pub fn analyse_resampled(
    data: &DataFrame,
    settings: &Settings,
    resampling: &Resampling,
    control: &Control,
) -> Result<Model> {
    Ok(resampled(data, settings, resampling, control, false)?.model)
}

/// As [`analyse_resampled`], or [`analyse`] without resampling, and keeps what stands behind the links and the graph of each
/// resample. The model is the same.
///
/// # Errors
/// As [`analyse_resampled`].
pub fn resample(
    data: &DataFrame,
    settings: &Settings,
    resampling: Option<&Resampling>,
    control: &Control,
) -> Result<Resampled> {
    if let Some(resampling) = resampling {
        return resampled(data, settings, resampling, control, true);
    }
    let (model, evidence) = analyse_with_evidence(data, settings, control)?;
    Ok(Resampled { model, evidence, graphs: Vec::new() })
}

fn resampled(
    data: &DataFrame,
    settings: &Settings,
    resampling: &Resampling,
    control: &Control,
    keep: bool,
) -> Result<Resampled> {
    resampling.check()?;
    settings.check()?;
    let plan = Resamples::new(data, settings, resampling)?;
    let (mut model, evidence) = match keep {
        true => analyse_with_evidence(data, settings, control)?,
        false => (analyse(data, settings, control)?, Evidence::default()),
    };
    let ended_after = |done: usize| {
        Status::Partial(format!("the time budget ended after {done} of {} resamples", resampling.resamples))
    };
    if control.stop() == Some(Stop::OutOfTime) {
        if model.status == Status::Complete {
            model.status = ended_after(0);
        }
        return Ok(Resampled { model, evidence, graphs: Vec::new() });
    }
    let found = plan.run(control)?;
    if found.len() < resampling.resamples {
        model.status = ended_after(found.len());
    }
    let graphs = if keep { graphs_of(&found, data.var_names()) } else { Vec::new() };
    if found.len() < FEWEST_RESAMPLES {
        model.warnings.push(format!("{} resamples are too few for a confidence", found.len()));
        return Ok(Resampled { model, evidence, graphs });
    }
    model.warnings.extend(remarks(settings, resampling));
    let facts = ResamplingFacts {
        scheme: resampling.scheme.name().into(),
        share: (resampling.scheme == Scheme::Subsample).then_some(resampling.share),
        block: resampling.block.name(),
        block_lengths: plan.block_lengths(),
        asked: resampling.resamples,
        done: found.len(),
        seed: settings.seed,
        level: LEVEL,
    };
    let summary = Summary::new(&found, (data.n_vars(), settings.tau_max));
    model.warnings.extend(summary.of_dropped(data.var_names(), &model));
    let confidence = summary.on_features(data.var_names(), &model.features, facts);
    let mut model = with_confidence(model, confidence, resampling);
    size::add(&mut model, data, settings);
    Ok(Resampled { model, evidence, graphs })
}

fn graphs_of(found: &[Found], names: &[String]) -> Vec<ResampleGraph> {
    let vars: Vec<usize> = (0..names.len()).collect();
    let graph = |(resample, one): (usize, &Found)| {
        let n_lags = one.graph.dim().2;
        ResampleGraph {
            resample,
            variables: names.to_vec(),
            graph: nested(&vars, n_lags, |at| one.graph[at]),
            val_matrix: nested(&vars, n_lags, |at| one.values[at]),
        }
    };
    found.iter().enumerate().map(graph).collect()
}

fn with_confidence(mut model: Model, confidence: Confidence, resampling: &Resampling) -> Model {
    let widened = resampling.widened();
    let one_sided = model.val_matrix.iter().flatten().flatten().flatten().all(|value| *value >= 0.0);
    let place = |link: &Link| model.places(&link.cause, &link.effect).unwrap_or_default();
    let places: Vec<(usize, usize)> = model.links.iter().map(place).collect();
    for (link, (i, j)) in model.links.iter_mut().zip(places) {
        let lag = link.lag;
        link.confidence = Some(confidence.link_frequency[i][j][lag]);
        let Some(value) = link.value else { continue };
        let [low, mean, high] =
            [&confidence.val_low, &confidence.val_mean, &confidence.val_high].map(|of| of[i][j][lag]);
        let within = |end: f64| if one_sided { end.max(0.0) } else { end };
        link.value_low = Some(within(value + widened * (low - mean)));
        link.value_high = Some(within(value + widened * (high - mean)));
    }
    model.confidence = Some(Box::new(confidence));
    advice::add(&mut model, resampling);
    model
}

/// What a reader of the frequencies should know.
fn remarks(settings: &Settings, resampling: &Resampling) -> Vec<String> {
    let mut remarks = vec![
        "a confidence says how often a link is found again in such data; a hidden common cause, or a system that changes while \
         it is recorded, makes false links firm, too"
            .to_owned(),
    ];
    let smooth = ["gpdc", "cmiknn"].contains(&settings.cond_ind_test.as_str());
    if smooth && resampling.scheme == Scheme::Bootstrap {
        remarks.push(format!(
            "{} on a bootstrap finds absent links too often, since rows are drawn twice; subsamples do not",
            settings.cond_ind_test
        ));
    }
    remarks
}

#[cfg(test)]
mod tests;
