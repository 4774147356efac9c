//! Links that were known to exist before the analysis, in the model.

use super::Settings;
use crate::{
    ground::{
        Assumption,
        names::{plain, position},
    },
    model::Model,
};

/// Marks the links of the model that were required: they were not tested.
pub(super) fn mark_required(model: &mut Model, settings: &Settings, names: &[String]) {
    let Some(known) = settings.link_assumptions.as_ref() else { return };
    for link in &mut model.links {
        let (cause, effect) = (position(names, &link.cause), position(names, &link.effect));
        if let (Some(cause), Some(effect)) = (cause, effect) {
            link.required = known.get(cause, effect, link.lag) == Some(Assumption::Exists);
        }
    }
    model.warnings.extend(told(settings, names));
}

/// What to tell of links that are known to exist: they were not tested.
fn told(settings: &Settings, names: &[String]) -> Option<String> {
    let known = settings.link_assumptions.as_ref()?;
    let mut links = Vec::new();
    for (cause, of) in names.iter().enumerate() {
        for (effect, to) in names.iter().enumerate() {
            let exists = |lag: &usize| known.get(cause, effect, *lag) == Some(Assumption::Exists);
            let lags = (settings.tau_min..=settings.tau_max).filter(exists);
            links.extend(lags.map(|lag| format!("{} -> {} at lag {lag}", plain(of), plain(to))));
        }
    }
    let listed = links.join(", ");
    (!links.is_empty())
        .then(|| format!("known beforehand and not tested, which a strength of 1 means: {listed}"))
}
