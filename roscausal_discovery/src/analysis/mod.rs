//! One analysis, from settings to model. The commands and the discovery node all enter here.

mod outcome;
mod settings;

pub(crate) use outcome::{Found, Outcome};
pub use settings::{PcAlpha, Settings};

use crate::{
    ground::{CondIndTest, Control, DataFrame, Result, Samples},
    independence_tests,
    methods::{FpcmciResult, PcmciResult, Status},
    model::{Matrices, Model},
    transfer_entropy::TeEstimator,
};

/// Analyses `data` with `settings` under `control`: from data to model in one call.
///
/// ```
/// use roscausal_discovery::{Control, DataFrame, Settings, analyse};
///
/// # let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
/// # let mut values = ndarray::Array2::zeros((150, 2));
/// # for t in 1..150 {
/// #     values[[t, 0]] = noise(2 * t);
/// #     values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
/// # }
/// # let data = DataFrame::new(vec![values], vec!["a".into(), "b".into()])?;
/// // F-PCMCI with GPDC at lag 1.
/// let model = analyse(&data, &Settings::default(), &Control::default())?;
/// assert_eq!((model.features.len(), model.links.len()), (2, 1));
/// assert!(model.to_json().contains("\"cause\": \"a\""));
/// # Ok::<(), roscausal_discovery::Error>(())
/// ```
///
/// # Errors
/// Invalid settings, unsuitable data, or cancellation. Running out of time is not an error: the model's status says
/// so.
pub fn analyse(data: &DataFrame, settings: &Settings, control: &Control) -> Result<Model> {
    settings.check()?;
    settings.check_data(data)?;
    let test = independence_tests::by_name(&settings.cond_ind_test, &settings.test_settings())?;
    match Outcome::of(data, test.as_ref(), settings, control)? {
        Outcome::Filtered(result) => Ok(filtered(data, test.as_ref(), settings, &result, control)),
        Outcome::Plain(result) => {
            control.tell(result.effort.as_deref());
            Ok(with_result(settings.blank_model(), data.var_names().to_vec(), *result))
        }
    }
}

/// F-PCMCI: the model keeps the variables that have a link; the others are listed as dropped.
fn filtered(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &Settings,
    result: &FpcmciResult,
    control: &Control,
) -> Model {
    let n_samples = Samples::new(data, 2 * settings.tau_max).len();
    let name = |&var: &usize| data.var_names()[var].clone();
    let features: Vec<String> = result.features.iter().map(name).collect();
    let others = (0..data.n_vars()).filter(|var| !result.features.contains(var));
    let dropped = others.map(|var| name(&var)).collect();
    let blank = Model { n_samples, dropped, ..settings.blank_model() };
    let mut model = match &result.pcmci {
        Some(found) => {
            let place = |var: &usize| result.selected.iter().position(|selected| selected == var);
            control.tell(found.effort.as_deref());
            let places: Vec<usize> = result.features.iter().filter_map(place).collect();
            with_result(blank, features, found.on_features(&places))
        }
        None => blank,
    };
    model.warnings.extend(remarks_on_filter(settings.te_estimator, test, result));
    if let Status::Partial(how_far) = &result.status {
        model.status = format!("partial: {how_far}");
    }
    model
}

/// What a user should know about F-PCMCI's filter.
fn remarks_on_filter(estimator: TeEstimator, test: &dyn CondIndTest, result: &FpcmciResult) -> Vec<String> {
    let mut remarks = Vec::new();
    if estimator == TeEstimator::Gaussian && !test.is_linear() {
        remarks.push(format!(
            "the gaussian filter passes linear dependence only, so links that only {} sees may be missing; the te-estimator \
             auto passes them too",
            test.name()
        ));
    }
    if result.filter.is_some() && result.selected.is_empty() {
        remarks.push(
            "the filter lets nothing through: at this level no variable informs another, so no link was tested; the method \
             pcmci tests all"
                .into(),
        );
    }
    remarks
}

fn with_result(blank: Model, features: Vec<String>, result: PcmciResult) -> Model {
    let n = features.len();
    let matrices = Matrices {
        graph: nested(n, blank.tau_max, |at| result.graph[at].symbol().to_owned()),
        val_matrix: nested(n, blank.tau_max, |at| result.val_matrix[at]),
        p_matrix: nested(n, blank.tau_max, |at| result.deciding_p()[at]),
        n_lost: nested(n, blank.tau_max, |at| result.n_lost[at]),
    };
    let mut model = blank.with_matrices(features, matrices);
    model.n_samples = result.n_samples;
    model.warnings.extend(result.remarks);
    if let Status::Partial(how_far) = result.status {
        model.status = format!("partial: {how_far}");
    }
    model
}

fn nested<T>(n: usize, tau_max: usize, at: impl Fn([usize; 3]) -> T) -> Vec<Vec<Vec<T>>> {
    let lags = |i, j| (0..=tau_max).map(|lag| at([i, j, lag])).collect();
    (0..n).map(|i| (0..n).map(|j| lags(i, j)).collect()).collect()
}
