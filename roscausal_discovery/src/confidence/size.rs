//! How much of its effect a cause moves, in the variables' own units.
//!
//! The slope of the effect on the cause, given the effect's other causes in the model, by least squares; the interval of 95 % is
//! of HC3 variances (`numeric/slope.rs`). It is told per round step of the cause, about its standard deviation. A link that
//! bends has a slope, too: its mean one. Where the interval holds 0, the link has no steady direction.

use crate::{
    model::{LinkSize, Model},
    numeric::{rows::centred, slope::slope},
    settings::Settings,
    types::{DataFrame, LinkMark, Node, Samples},
};

/// Normal quantile of a two-sided interval of 95 %.
const RANGE: f64 = 1.959_964;

/// Adds the sizes to the model's links from one variable to another.
pub(super) fn add(model: &mut Model, data: &DataFrame, settings: &Settings) {
    let samples = Samples::new(data, 2 * settings.tau_max);
    let place = |name: &str| data.var_names().iter().position(|other| other == name);
    let causes_of = |effect: &str| -> Vec<Node> {
        let of = model.links.iter().filter(|link| link.effect == effect && link.mark == LinkMark::Forward);
        of.filter_map(|link| Some(Node::new(place(&link.cause)?, link.lag))).collect()
    };
    let size = |cause: &str, effect: &str, lag: usize| {
        let (cause, target) = (Node::new(place(cause)?, lag), Node::new(place(effect)?, 0));
        let others: Vec<Node> = causes_of(effect).into_iter().filter(|node| *node != cause).collect();
        let arrays = samples.arrays(cause, target, &others);
        let (x, y) = (centred(arrays.x), centred(arrays.y));
        let others: Vec<Vec<f64>> = arrays.z.into_iter().map(centred).collect();
        let columns: Vec<&[f64]> = others.iter().map(Vec::as_slice).collect();
        let found = slope(&y, &x, &columns, 1)?;
        let step = round((x.iter().map(|v| v * v).sum::<f64>() / x.len().max(1) as f64).sqrt())?;
        let range = RANGE * found.variance.sqrt();
        let of = |slope: f64| step * slope;
        Some(LinkSize {
            step,
            change: of(found.value),
            low: of(found.value - range),
            high: of(found.value + range),
        })
    };
    let sizes: Vec<Option<LinkSize>> = (model.links.iter())
        .map(|link| match link.mark == LinkMark::Forward && link.cause != link.effect {
            true => size(&link.cause, &link.effect, link.lag),
            false => None,
        })
        .collect();
    model.links.iter_mut().zip(sizes).for_each(|(link, size)| link.size = size);
}

/// The largest of 1, 2, 5 times a power of ten that is not above a value.
fn round(value: f64) -> Option<f64> {
    let unit = libm::pow(10_f64, libm::log10(value).floor());
    let step = [5.0, 2.0, 1.0].map(|f| f * unit).into_iter().find(|step| *step <= value * (1.0 + 1e-9));
    step.filter(|step| *step > 0.0 && step.is_finite())
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::{
        confidence::{Resampling, resample},
        methods::Method,
        numeric::random::Rng,
        types::Control,
    };

    #[test]
    fn a_size_is_the_slope_in_the_variables_units_and_its_interval_holds_it() {
        let mut rng = Rng::new(4);
        let mut normal = || (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
        let mut x = Array2::zeros((600, 2));
        for t in 1..600 {
            x[[t, 0]] = 0.03 * normal();
            x[[t, 1]] = 20.0 - 40.0 * x[[t - 1, 0]] + 0.4 * (x[[t - 1, 1]] - 20.0) + normal();
        }
        let data = DataFrame::new(vec![x], vec!["h_risk".into(), "h_v".into()]).unwrap();
        let settings =
            Settings { method: Method::Pcmci, cond_ind_test: "parcorr".into(), ..Settings::default() };
        let resampling = Resampling { resamples: 20, ..Resampling::default() };
        let model = resample(&data, &settings, Some(&resampling), &Control::default()).unwrap().model;
        let link = model.links.iter().find(|link| link.cause == "h_risk" && link.effect == "h_v").unwrap();
        let size = link.size.unwrap();
        assert_eq!(size.step, 0.02);
        assert!(size.low < -0.8 && -0.8 < size.high && size.high < -0.6 && size.low > -1.0, "{size:?}");
        let words = link.size_in_words().unwrap();
        assert!(words.starts_with("0.02 more h_risk: 0.") && words.ends_with(" less h_v"), "{words}");
        // A variable's own past has none.
        assert!(model.links.iter().all(|link| link.cause != link.effect || link.size.is_none()));
        assert_eq!((round(0.031), round(7.0), round(0.0)), (Some(0.02), Some(5.0), None));
    }
}
