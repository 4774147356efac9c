//! What resampling adds to a model: how often each link was found, and how its value varied.

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::types::LinkMark;

/// Numbers `[cause][effect][lag]`.
type Numbers = Vec<Vec<Vec<f64>>>;

/// How the data were resampled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResamplingFacts {
    /// `subsample` or `bootstrap`.
    pub scheme: String,
    /// Share of the rows in a subsample; `None` for a bootstrap.
    pub share: Option<f64>,
    /// Rows drawn together, as asked for: a number or `cube_root`.
    pub block: String,
    /// Rows drawn together, by recording.
    pub block_lengths: Vec<usize>,
    /// Resamples asked for.
    pub asked: usize,
    /// Resamples that came to their end within the time budget.
    pub done: usize,
    /// Seed of the draws.
    pub seed: u64,
    /// Share of the values between `val_low` and `val_high`.
    pub level: f64,
}

/// What resampling says of each possible link. Matrices are `[cause][effect][lag]`, of the model's features.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Confidence {
    /// How the data were resampled.
    pub resampling: ResamplingFacts,
    /// Share of the resamples with a link, whatever its mark.
    pub link_frequency: Numbers,
    /// Share of the resamples by mark, for the marks that occur.
    pub mark_frequency: BTreeMap<LinkMark, Numbers>,
    /// Share of the resamples with a link at any lag, `[cause][effect]`.
    pub summary_frequency: Vec<Vec<f64>>,
    /// The marks of the majority.
    pub majority_graph: Vec<Vec<Vec<LinkMark>>>,
    /// Mean of the values.
    pub val_mean: Numbers,
    /// Percentile 5 of the values.
    pub val_low: Numbers,
    /// Percentile 95 of the values.
    pub val_high: Numbers,
    /// What would settle the links that are not settled.
    pub advice: Vec<Advice>,
}

/// How many samples a link would need to be found in four of five recordings, if it is real.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    /// Name of the cause.
    pub cause: String,
    /// Name of the effect.
    pub effect: String,
    /// Steps from cause to effect.
    pub lag: usize,
    /// Whether the model has the link.
    pub in_model: bool,
    /// Share of the resamples that have it.
    pub confidence: f64,
    /// Samples needed; `None`: no number of samples can be told.
    pub n_needed: Option<f64>,
    /// Lower end of the range of 80 %.
    pub n_low: Option<f64>,
    /// Upper end of that range; `None`: there is none.
    pub n_high: Option<f64>,
    /// Minutes of recording more, where the step is known.
    pub minutes: Option<f64>,
    /// Lower end of their range.
    pub minutes_low: Option<f64>,
    /// Upper end of their range.
    pub minutes_high: Option<f64>,
    /// All this in words.
    pub sentence: String,
}

/// What a share of resamples is called in reports.
///
/// ```
/// use roscausal_discovery::word_of;
///
/// assert_eq!([0.95, 0.6, 0.2, 0.01].map(word_of), ["firm", "likely", "unsure", "absent"]);
/// ```
pub fn word_of(confidence: f64) -> &'static str {
    match confidence {
        c if c >= 0.9 => "firm",
        c if c >= 0.5 => "likely",
        c if c >= 0.1 => "unsure",
        _ => "absent",
    }
}

/// The fields in a file: each is null without resamples.
#[derive(Default, Deserialize)]
#[serde(default)]
struct InFile {
    resampling: Option<ResamplingFacts>,
    link_frequency: Option<Numbers>,
    mark_frequency: Option<BTreeMap<LinkMark, Numbers>>,
    summary_frequency: Option<Vec<Vec<f64>>>,
    majority_graph: Option<Vec<Vec<Vec<LinkMark>>>>,
    val_mean: Option<Numbers>,
    val_low: Option<Numbers>,
    val_high: Option<Numbers>,
    advice: Option<Vec<Advice>>,
}

/// Their names, in their order.
const FIELDS: [&str; 9] = [
    "resampling", "link_frequency", "mark_frequency", "summary_frequency", "majority_graph", "val_mean",
    "val_low", "val_high", "advice",
];

/// Writes the fields of a model.
pub(super) fn serialize<S: Serializer>(of: &Option<Box<Confidence>>, to: S) -> Result<S::Ok, S::Error> {
    match of {
        Some(confidence) => confidence.serialize(to),
        None => to.collect_map(FIELDS.map(|name| (name, ()))),
    }
}

/// Reads the fields of a model; `None` where the file has none, or null.
pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Box<Confidence>>, D::Error> {
    let fields = InFile::deserialize(from)?;
    let whole = || {
        Some(Box::new(Confidence {
            resampling: fields.resampling?,
            link_frequency: fields.link_frequency?,
            mark_frequency: fields.mark_frequency?,
            summary_frequency: fields.summary_frequency?,
            majority_graph: fields.majority_graph?,
            val_mean: fields.val_mean?,
            val_low: fields.val_low?,
            val_high: fields.val_high?,
            advice: fields.advice.unwrap_or_default(),
        }))
    };
    Ok(whole())
}
