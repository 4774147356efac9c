//! Does the answer depend on the direction of a link that the data leave open?

use crate::{graph::Pair, model::StructuralModel};

/// What says that the answer depends on an open link, if it does: `effects` are those of the model's members; within `nothing` of 0 an
/// effect is none.
pub(super) fn sentence(model: &StructuralModel, effects: &[f64], nothing: f64) -> Option<String> {
    let sign = |effect: &f64| match *effect {
        effect if effect.abs() <= nothing => 0,
        effect if effect > 0.0 => 1,
        _ => -1,
    };
    let signs: Vec<i8> = effects.iter().map(sign).collect();
    if effects.len() < 2 || signs.windows(2).all(|pair| pair[0] == pair[1]) {
        return None;
    }
    let pair = deciding(model, effects)?;
    let name = |var: usize| &model.graph().names()[var];
    let (a, b) = (name(pair.a), name(pair.b));
    let smallest = effects.iter().copied().fold(f64::INFINITY, f64::min);
    let largest = effects.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (smallest, largest) = (super::sentences::short(smallest), super::sentences::short(largest));
    Some(format!(
        "the answer depends on whether {a} drives {b} or {b} drives {a}, which the data leave open: the effect is \
         {smallest} to {largest}; direct this link in the model, or sample faster"
    ))
}

/// The open pair whose two directions differ the most.
fn deciding(model: &StructuralModel, effects: &[f64]) -> Option<Pair> {
    let pairs = model.graph().pairs();
    let gap = |k: usize| {
        let mean = |forward: bool| {
            let of =
                model.members().iter().zip(effects).filter(|(m, _)| (m.turned[k].0 == pairs[k].a) == forward);
            let values: Vec<f64> = of.map(|(_, effect)| *effect).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        if let (Some(a), Some(b)) = (mean(true), mean(false)) { (a - b).abs() } else { -1.0 }
    };
    (0..pairs.len()).max_by(|&a, &b| gap(a).total_cmp(&gap(b))).map(|k| pairs[k])
}
