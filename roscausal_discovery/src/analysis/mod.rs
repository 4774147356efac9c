//! One analysis, from settings to model. The commands and the discovery node all enter here.

mod outcome;
mod settings;

pub(crate) use outcome::{Found, Outcome};
pub use settings::{PcAlpha, Settings};

use crate::{
    evidence::{Evidence, Known},
    ground::{CondIndTest, Control, DataFrame, Result, Samples},
    independence_tests,
    methods::{FpcmciResult, PcmciResult, Status},
    model::{Matrices, Model, nested},
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
    Ok(run(data, settings, control, false)?.0)
}

/// As [`analyse`], and keeps what stands behind each link. The model is the same.
///
/// # Errors
/// As [`analyse`].
pub fn analyse_with_evidence(
    data: &DataFrame,
    settings: &Settings,
    control: &Control,
) -> Result<(Model, Evidence)> {
    let (model, evidence) = run(data, settings, control, true)?;
    Ok((model, evidence.unwrap_or_default()))
}

fn run(
    data: &DataFrame,
    settings: &Settings,
    control: &Control,
    keep: bool,
) -> Result<(Model, Option<Evidence>)> {
    let test = independence_tests::by_name(&settings.cond_ind_test, &settings.test_settings())?;
    analysed(data, test.as_ref(), settings, control, keep)
}

/// Analyses `data` as [`analyse`] does, with a test of your own instead of the one that the settings name.
///
/// # Errors
/// As [`analyse`], and those of the test.
pub fn analyse_with(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &Settings,
    control: &Control,
) -> Result<Model> {
    let settings = Settings { cond_ind_test: test.name().to_owned(), ..settings.clone() };
    Ok(analysed(data, test, &settings, control, false)?.0)
}

fn analysed(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &Settings,
    control: &Control,
    keep: bool,
) -> Result<(Model, Option<Evidence>)> {
    settings.check_numbers()?;
    settings.check_data(data)?;
    let (mut model, evidence) = match Outcome::of(data, test, settings, control)? {
        Outcome::Filtered(result) => filtered(data, test, settings, &result, control, keep),
        Outcome::Plain(result) => {
            control.tell(result.effort.as_deref());
            let blank = Model { n_recordings: data.recordings().len(), ..settings.blank_model() };
            let model = with_result(blank, data.var_names().to_vec(), (*result).clone());
            let evidence =
                keep.then(|| Evidence::gather(data, data, &model, settings.method, &Known::of(&result)));
            (model, evidence)
        }
    };
    model.warnings.extend(remarks_on_levels(data, test));
    Ok((model, evidence))
}

/// Variables that a test of categories cannot judge, because almost every sample is a category of its own.
fn remarks_on_levels(data: &DataFrame, test: &dyn CondIndTest) -> Vec<String> {
    if test.name() != "gsquared" {
        return Vec::new();
    }
    let remark = |var: usize| {
        let values = data.recordings().iter().flat_map(|recording| recording.column(var).to_vec());
        let values: Vec<u64> = values.filter(|v| v.is_finite()).map(|v| (v + 0.0).to_bits()).collect();
        let levels = values.iter().collect::<std::collections::HashSet<_>>().len();
        let few = values.len() < FEWEST_OF_A_LEVEL * levels;
        few.then(|| {
            format!(
                "'{}' has {levels} different values in {} samples: gsquared is for categories and takes each value for one, so its \
                 result on it means nothing; make categories of it, or take a test for numbers such as parcorr or gpdc",
                data.var_names()[var],
                values.len()
            )
        })
    };
    (0..data.n_vars()).filter_map(remark).collect()
}

/// Samples of a category that the G test needs on average (McDonald 2014, "Small numbers").
const FEWEST_OF_A_LEVEL: usize = 5;

/// F-PCMCI: the model keeps the variables that have a link; the others are listed as dropped.
fn filtered(
    data: &DataFrame,
    test: &dyn CondIndTest,
    settings: &Settings,
    result: &FpcmciResult,
    control: &Control,
    keep: bool,
) -> (Model, Option<Evidence>) {
    let n_samples = Samples::new(data, 2 * settings.tau_max).len();
    let name = |&var: &usize| data.var_names()[var].clone();
    let features: Vec<String> = result.features.iter().map(name).collect();
    let others = (0..data.n_vars()).filter(|var| !result.features.contains(var));
    let dropped = others.map(|var| name(&var)).collect();
    let n_recordings = data.recordings().len();
    let blank = Model { n_samples, n_recordings, dropped, ..settings.blank_model() };
    let mut evidence = None;
    let mut model = match &result.pcmci {
        Some(found) => {
            let place = |var: &usize| result.selected.iter().position(|selected| selected == var);
            control.tell(found.effort.as_deref());
            let places: Vec<usize> = result.features.iter().filter_map(place).collect();
            let model = with_result(blank, features, found.on_features(&places));
            evidence = keep.then(|| {
                let tested = data.select(&result.selected);
                Evidence::gather(data, &tested, &model, settings.method, &Known::of(found))
            });
            model
        }
        None => blank,
    };
    model.warnings.extend(remarks_on_filter(settings.te_estimator, test, result));
    if let Status::Partial(how_far) = &result.status {
        model.status = format!("partial: {how_far}");
    }
    (model, evidence)
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
    if result.status == Status::Complete && !result.selected.is_empty() && result.features.is_empty() {
        remarks.push(format!(
            "no link between two variables that the filter lets through is one for {}, so all variables are left out, with their \
             links to themselves; the method pcmci tests and shows all",
            test.name()
        ));
    }
    remarks
}

fn with_result(blank: Model, features: Vec<String>, result: PcmciResult) -> Model {
    let vars: Vec<usize> = (0..features.len()).collect();
    let n_lags = blank.tau_max + 1;
    let matrices = Matrices {
        graph: nested(&vars, n_lags, |at| result.graph[at].symbol().to_owned()),
        val_matrix: nested(&vars, n_lags, |at| result.val_matrix[at]),
        p_matrix: nested(&vars, n_lags, |at| result.deciding_p()[at]),
        n_lost: nested(&vars, n_lags, |at| result.n_lost[at]),
    };
    let mut model = blank.with_matrices(features, matrices);
    model.n_samples = result.n_samples;
    model.warnings.extend(result.remarks);
    if let Status::Partial(how_far) = result.status {
        model.status = format!("partial: {how_far}");
    }
    model
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::Method;

    /// `b` follows `a` one step later.
    fn pair() -> DataFrame {
        let noise = |i: usize| ((12.9898 * i as f64).sin() * 43758.5453).rem_euclid(1.0) - 0.5;
        let mut values = ndarray::Array2::zeros((300, 2));
        for t in 1..300 {
            values[[t, 0]] = noise(2 * t);
            values[[t, 1]] = 0.7 * values[[t - 1, 0]] + noise(2 * t + 1);
        }
        DataFrame::new(vec![values], vec!["a".into(), "b".into()]).unwrap()
    }

    fn settings(method: Method) -> Settings {
        Settings { method, tau_min: method.info().tau_min, ..Settings::default() }
    }

    #[test]
    fn a_filter_or_a_test_that_leaves_nothing_is_told() {
        let told = |f_alpha: f64, alpha: f64| {
            let cond_ind_test = "parcorr".into();
            let strict =
                Settings { cond_ind_test, alpha, f_alpha: Some(f_alpha), ..settings(Method::Fpcmci) };
            let model = analyse(&pair(), &strict, &Control::default()).unwrap();
            (model.dropped.len(), model.warnings.join("; "))
        };
        let (dropped, nothing_through) = told(1e-300, 0.05);
        assert!(
            dropped == 2 && nothing_through.contains("the filter lets nothing through"),
            "{nothing_through}"
        );
        let (dropped, nothing_found) = told(0.05, 1e-300);
        assert!(dropped == 2 && nothing_found.contains("all variables are left out"), "{nothing_found}");
        assert_eq!(told(0.05, 0.05), (0, String::new()));
    }

    #[test]
    fn every_method_finds_the_link_and_names_its_test() {
        for method in Method::all().filter(|method| *method != Method::Lagdep) {
            let of_method = Settings { cond_ind_test: "parcorr".into(), ..settings(method) };
            let model = analyse(&pair(), &of_method, &Control::default()).unwrap();
            let found =
                model.links.iter().any(|link| link.cause == "a" && link.effect == "b" && link.lag == 1);
            assert!(found, "{method}: {:?}", model.links);
            let test = if method.info().asks_test { "parcorr" } else { "none" };
            assert_eq!(model.cond_ind_test, test, "{method}");
        }
    }

    #[test]
    fn lag_0_alone_is_for_methods_that_model_it() {
        for method in Method::all() {
            let alone = Settings { tau_max: 0, tau_min: 0, ..settings(method) };
            let models_it = method.info().models_lag_zero || method == Method::Lpcmci;
            assert_eq!(alone.check().is_ok(), models_it, "{method}");
            if alone.check().is_ok() {
                let model = analyse(&pair(), &alone, &Control::default()).unwrap();
                assert_eq!(model.graph[0][1].len(), 1, "{method}");
            }
        }
        let error = Settings { tau_min: 1, ..settings(Method::Varlingam) }.check().unwrap_err().to_string();
        assert!(error.contains("models lag 0 too"), "{error}");
    }
}
