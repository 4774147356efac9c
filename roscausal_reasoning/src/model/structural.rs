//! The structural model: a graph, the rows it was fitted on, and one set of equations for each graph that it may stand for.

use roscausal_discovery::{DataFrame, Error, Link, Model, Result, methods::Status};
use serde::{Deserialize, Serialize};

use super::{
    directed::{Directed, Settings},
    equation::Hyperparameters,
};
use crate::{
    graph::{Graph, Orientation, is_no_plain_cause},
    quality::Quality,
    samples::{ActsOn, Samples},
};

/// One graph that the model may stand for, and its equations.
#[derive(Debug)]
pub struct Member {
    /// Cause and effect of each pair that the graph leaves open.
    pub turned: Vec<(usize, usize)>,
    /// Whether this has a collider that the method did not find, as every direction of the open pairs does.
    pub against_the_rule: bool,
    /// The equations.
    pub model: Directed,
    /// How they do on rows that they have not seen; `None` where it was not measured.
    pub quality: Option<Quality>,
}

/// What else is known of the graph: for the caveats.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Facts {
    /// Step between rows in seconds.
    pub dt: Option<f64>,
    /// How the graph was found, such as `fpcmci with gpdc`; empty for one written by hand.
    pub method: String,
    /// P-value of each link, where it is known.
    pub p_values: Vec<(String, String, usize, f64)>,
    /// Variables that the method dropped.
    pub dropped: Vec<String>,
    /// What a reader should know, such as that the analysis ran out of time.
    pub warnings: Vec<String>,
    /// Units of variables, where they are known.
    pub units: Vec<(String, String)>,
}

impl Facts {
    /// What a model says.
    pub fn of_model(model: &Model) -> Self {
        let mut warnings = Vec::new();
        if model.status != Status::Complete {
            warnings.push(format!("the model is {}: links may be missing", model.status));
        }
        for link in model.links.iter().filter(|link| is_no_plain_cause(link)) {
            let (Link { cause, mark, effect, lag, .. }, why) = (link, link.sentence());
            warnings.push(format!(
                "the link {cause} {mark} {effect} at lag {lag} is left out ({why}): effects along it are not in the answer"
            ));
        }
        let p_value = |link: &Link| Some((link.cause.clone(), link.effect.clone(), link.lag, link.p_value?));
        Self {
            dt: model.dt,
            method: format!("{} with {}", model.method, model.cond_ind_test),
            p_values: model.links.iter().filter_map(p_value).collect(),
            dropped: model.dropped.clone(),
            warnings,
            units: Vec::new(),
        }
    }
}

/// A causal graph made ready to reason on.
///
/// ```
/// use ndarray::Array2;
/// use roscausal_discovery::DataFrame;
/// use roscausal_reasoning::{StructuralModel, Settings, default_intervention_targets, graph::{Arrow, Graph}};
///
/// // `b` follows `a` one step later.
/// let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// let mut values = Array2::zeros((300, 2));
/// for t in 1..300 {
///     values[[t, 0]] = noise(2 * t);
///     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + 0.1 * noise(2 * t + 1);
/// }
/// let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// let graph = Graph::new(vec!["a".into(), "b".into()], 1, &[Arrow { cause: 0, effect: 1, lag: 1 }], &[])?;
/// let model = StructuralModel::fit(&data, &graph, &Settings::default(), &default_intervention_targets())?;
/// let b = &model.members()[0].model.summaries[1];
/// assert!((b.coefficients[0] - 0.7).abs() < 0.05);
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
#[derive(Debug)]
pub struct StructuralModel {
    graph: Graph,
    samples: Samples,
    settings: Settings,
    members: Vec<Member>,
    /// What else is known of the graph.
    pub facts: Facts,
}

impl StructuralModel {
    /// Fits the equations of `graph` on `data`. A variable that has no value in the data, such as the distance to a goal that nobody
    /// told, is left out with its links, and [`Facts::warnings`] name it.
    ///
    /// # Errors
    /// Invalid settings; data without one of the graph's variables, or with too few rows for every equation; pairs without a
    /// direction that are too many.
    pub fn fit(data: &DataFrame, graph: &Graph, settings: &Settings, acts_on: &ActsOn) -> Result<Self> {
        let samples = Samples::new(data, graph, acts_on)?;
        let has_value =
            |var: &usize| samples.recordings().iter().any(|r| r.column(*var).iter().any(|v| v.is_finite()));
        let (there, empty): (Vec<usize>, Vec<usize>) = (0..graph.len()).partition(has_value);
        if empty.is_empty() || there.is_empty() {
            return Self::of_samples(samples, graph, settings);
        }
        let names: Vec<&str> = empty.iter().map(|&var| graph.names()[var].as_str()).collect();
        let reported =
            format!("without a value in the data, and left out of the model: {}", names.join(", "));
        let rest = graph.only(&there)?;
        let mut model = Self::of_samples(Samples::new(data, &rest, acts_on)?, &rest, settings)?;
        model.facts.warnings.push(reported);
        Ok(model)
    }

    /// The same on samples.
    ///
    /// # Errors
    /// Those of [`StructuralModel::fit`].
    pub fn of_samples(samples: Samples, graph: &Graph, settings: &Settings) -> Result<Self> {
        settings.check()?;
        let member = |Orientation { graph, turned, against_the_rule }: Orientation| {
            let model = Directed::fit(&samples, &graph, settings, None)?;
            let quality = if settings.check { Quality::measure(&samples, &graph, settings) } else { None };
            Ok(Member { turned, against_the_rule, model, quality })
        };
        let members = graph.orientations()?.into_iter().map(member).collect::<Result<_>>()?;
        let (graph, settings) = (graph.clone(), settings.clone());
        Ok(Self { graph, samples, settings, members, facts: Facts::default() })
    }

    /// From parts that a file keeps: the hyperparameters and the quality are taken, the rest is fitted anew.
    pub(super) fn restored(
        samples: Samples,
        graph: Graph,
        settings: Settings,
        facts: Facts,
        kept: Vec<(Vec<Option<Hyperparameters>>, Option<Quality>)>,
    ) -> Result<Self> {
        settings.check()?;
        let orientations = graph.orientations()?;
        let fit = kept.iter().all(|(known, _)| known.len() == graph.len());
        let reason = "the structural model's equations do not match its graph; fit it anew";
        Error::ensure_data(fit && orientations.len() == kept.len(), || reason)?;
        let member = |(one, (known, quality)): (Orientation, (Vec<_>, _))| {
            let Orientation { graph, turned, against_the_rule } = one;
            let model = Directed::fit(&samples, &graph, &settings, Some(&known))?;
            Ok(Member { turned, against_the_rule, model, quality })
        };
        let members = orientations.into_iter().zip(kept).map(member).collect::<Result<_>>()?;
        Ok(Self { graph, samples, settings, members, facts })
    }

    /// The graph, with its open pairs.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The rows that the equations were fitted on.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// How they were fitted.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// One for each graph that the model may stand for; one alone if every link has a direction.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// With what else is known of the graph.
    #[must_use]
    pub fn with_facts(mut self, facts: Facts) -> Self {
        let found = std::mem::replace(&mut self.facts, facts).warnings;
        self.facts.warnings.extend(found);
        self
    }

    /// A number that tells models apart, from graph, data and settings.
    pub fn id(&self) -> String {
        let mut state = self.settings.seed;
        let mut add = |bits: u64| state = roscausal_discovery::mix(state ^ bits);
        for arrow in self.graph.arrows() {
            add((arrow.cause as u64) << 42 | (arrow.effect as u64) << 21 | arrow.lag as u64);
        }
        self.samples.recordings().iter().flatten().for_each(|value| add(value.to_bits()));
        format!("{state:016x}")
    }
}
