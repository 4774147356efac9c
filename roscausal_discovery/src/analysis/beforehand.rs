//! What was decided of each entry before any test, so that a model can say why one was not tested.

use std::borrow::Cow;

use crate::{
    methods::Status,
    model::Outcome,
    settings::Settings,
    types::{Assumption, DataFrame, LinkAssumptions, SampleCount, names::plain},
};

/// What was known of links, and what a filter let through.
pub(super) struct Beforehand<'a> {
    tau_min: usize,
    /// What the user knows; `None`: nothing.
    links: Option<LinkAssumptions>,
    /// Of F-PCMCI: the links that its filter let through, and the place of each variable of the model among its variables.
    filter: Option<(&'a LinkAssumptions, Vec<usize>)>,
    /// The place of each variable of the model in the data; as it is without a filter.
    vars: Cow<'a, [usize]>,
}

impl<'a> Beforehand<'a> {
    pub(super) fn of(settings: &Settings, data: &DataFrame) -> Self {
        let vars = (0..data.n_vars()).collect::<Vec<_>>().into();
        Self { tau_min: settings.tau_min, links: settings.pcmci(data).link_assumptions, filter: None, vars }
    }

    pub(super) fn behind_filter(
        self,
        filter: &'a LinkAssumptions,
        places: Vec<usize>,
        features: &'a [usize],
    ) -> Self {
        Self { filter: Some((filter, places)), vars: features.into(), ..self }
    }

    /// The outcome of an entry, by the samples of its test, if there was one, and by whether it is a link.
    pub(super) fn outcome(
        &self,
        [i, j, lag]: [usize; 3],
        samples: Option<SampleCount>,
        is_link: bool,
        status: &Status,
    ) -> Outcome {
        if lag < self.tau_min || (lag == 0 && i == j) {
            return Outcome::NotAsked;
        }
        match self.links.as_ref().map(|links| links.get(self.vars[i], self.vars[j], lag)) {
            Some(None) => return Outcome::Forbidden,
            Some(Some(assumption)) if assumption.exists() => return Outcome::Required,
            _ => {}
        }
        if let Some(samples) = samples {
            return if samples.used > 0 { Outcome::Tested } else { Outcome::NoAnswer };
        }
        let passes =
            |(links, places): &(&LinkAssumptions, Vec<usize>)| links.get(places[i], places[j], lag).is_some();
        match status {
            _ if self.filter.as_ref().is_some_and(|filter| !passes(filter)) => Outcome::Filtered,
            Status::Partial(_) => Outcome::Ended,
            // Such as what an intervention sets.
            Status::Complete if is_link => Outcome::Required,
            Status::Complete => Outcome::NotAsked,
        }
    }
}

/// The links that were required, in words: they were not tested.
pub(super) fn required_in_words(settings: &Settings, names: &[String]) -> Option<String> {
    let known = settings.link_assumptions.as_ref()?;
    let mut links = Vec::new();
    for (cause, of) in names.iter().enumerate() {
        for (effect, to) in names.iter().enumerate() {
            let exists = |lag: &usize| known.get(cause, effect, *lag) == Some(Assumption::Exists);
            let lags = (settings.tau_min..=settings.tau_max).filter(exists);
            links.extend(lags.map(|lag| format!("{} -> {} at lag {lag}", plain(of), plain(to))));
        }
    }
    (!links.is_empty()).then(|| format!("required, so not tested: {}", links.join(", ")))
}
