//! One analysis, from settings to model. The commands and the discovery node all enter here.

mod beforehand;
mod chance;
mod contexts;
mod method_result;

use crate::settings::Settings;
pub(crate) use method_result::{Found, MethodResult};

use std::collections::HashSet;

use self::beforehand::Beforehand;
use crate::{
    evidence::{Evidence, Known},
    independence_tests::regression_ci::MOST_VALUES,
    methods::{FpcmciResult, PcmciResult, Status},
    model::{Matrices, Model, Outcome, nested},
    transfer_entropy::TeEstimator,
    types::{CondIndTest, Control, DataFrame, Error, LinkMark, Named, Result, Samples, names},
};

/// The least p-value of a model.
const SMALLEST_P: f64 = 1e-300;

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
    Ok((model, evidence.unwrap_or_else(|| Evidence::of_data(data))))
}

fn run(
    data: &DataFrame,
    settings: &Settings,
    control: &Control,
    keep: bool,
) -> Result<(Model, Option<Evidence>)> {
    let test = settings.test()?;
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
    settings.check_numbers(test.name())?;
    settings.check_data(data)?;
    check_levels(data, test, &settings.test.categories)?;
    let (mut model, evidence) = match MethodResult::of(data, test, settings, control)? {
        MethodResult::Filtered(result) => filtered(data, test, settings, &result, control, keep),
        MethodResult::Plain(result) => {
            control.tell(result.effort.as_deref());
            let blank = Model { n_recordings: data.recordings().len(), ..settings.blank_model() };
            let known = Beforehand::of(settings, data);
            let model = with_result(blank, data.var_names().to_vec(), (*result).clone(), &known);
            let evidence =
                keep.then(|| Evidence::gather(data, data, &model, settings.method, &Known::of(&result)));
            (model, evidence)
        }
    };
    model.warnings.extend(beforehand::required_in_words(settings, data.var_names()));
    // Rows of one time are not counted once for each person: what the tests used.
    let used = model.n_matrix.iter().flatten().flatten().filter_map(|used| *used).max();
    if let Some(most) = used.filter(|_| data.shared_times().is_some()) {
        model.n_samples = most;
    }
    if !control.silent {
        chance::fill(&mut model, settings);
    }
    Ok((model, evidence))
}

/// Refuses measurements where the test counts categories: where almost every sample is a category of its own, its results mean
/// nothing. What is known to be a category is one.
fn check_levels(data: &DataFrame, test: &dyn CondIndTest, known: &[String]) -> Result<()> {
    if !matches!(test.name(), "gsquared" | "cmisymb") {
        return Ok(());
    }
    let known: Vec<_> = known.iter().map(|name| names::position(data.var_names(), name)).collect();
    for (var, name) in data.var_names().iter().enumerate().filter(|(var, _)| !known.contains(&Some(*var))) {
        let values = data.recordings().iter().flat_map(|recording| recording.column(var).to_vec());
        let values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
        let levels = values.iter().map(|v| (v + 0.0).to_bits()).collect::<HashSet<_>>().len();
        let are_whole = values.iter().all(|v| v.fract() == 0.0);
        if values.len() < FEWEST_OF_A_LEVEL * levels && (!are_whole || levels > MOST_VALUES) {
            return Err(Error::Data(format!(
                "{} is a test of categories, but '{name}' has {levels} different values in {} samples, so it is a measurement; \
                 take a test of numbers (parcorr, gpdc or cmiknn), or bring it to a few levels, as round({name}) does; if its \
                 values are categories, {} names it",
                test.name(),
                values.len(),
                Named("categories")
            )));
        }
    }
    Ok(())
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
    let blank = Model { n_samples, n_recordings: data.recordings().len(), dropped, ..settings.blank_model() };
    let mut evidence = None;
    let mut model = match &result.pcmci {
        Some(found) => {
            let place = |var: &usize| result.selected.iter().position(|selected| selected == var);
            control.tell(found.effort.as_deref());
            let places: Vec<usize> = result.features.iter().filter_map(place).collect();
            let known = Beforehand::of(settings, data).behind_filter(
                &result.link_assumptions,
                places.clone(),
                &result.features,
            );
            let model = with_result(blank, features, found.on_features(&places), &known);
            evidence = keep.then(|| {
                let tested = data.select(&result.selected);
                Evidence::gather(data, &tested, &model, settings.method, &Known::of(found))
            });
            model
        }
        None => blank,
    };
    model.warnings.extend(remarks_on_filter(settings.te_estimator, test, result));
    if result.status != Status::Complete {
        model.status = result.status.clone();
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

fn with_result(blank: Model, features: Vec<String>, result: PcmciResult, known: &Beforehand<'_>) -> Model {
    let vars: Vec<usize> = (0..features.len()).collect();
    let n_lags = blank.tau_max + 1;
    let outcome =
        |at: [usize; 3]| known.outcome(at, result.samples[at], result.graph[at].is_link(), &result.status);
    let outcomes = nested(&vars, n_lags, outcome);
    let matrices = Matrices {
        graph: nested(&vars, n_lags, |at @ [i, j, lag]| {
            // What the time budget left untested is not a link.
            let untested = outcomes[i][j][lag] == Outcome::Ended;
            if untested { LinkMark::Absent } else { result.graph[at] }
        }),
        val_matrix: nested(&vars, n_lags, |at| result.val_matrix[at]),
        // No p-value is 0: rounding makes it so.
        p_matrix: nested(&vars, n_lags, |at| result.deciding_p()[at].max(SMALLEST_P)),
        outcomes,
        samples: nested(&vars, n_lags, |at| result.samples[at]),
    };
    let mut model = blank.with_matrices(features, matrices);
    model.n_samples = result.n_samples;
    model.warnings.extend(result.remarks);
    model.status = result.status.clone();
    model
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        independence_tests::{NullDistributions, Significance, TestSettings},
        methods::Method,
        settings::PcAlpha,
    };

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

    /// The pair twice, with a context for each method that has some: `do_a` sets `a` in the second recording.
    fn pair_for(method: Method) -> DataFrame {
        let (plain, data) = (pair().recordings()[0].clone(), pair());
        let names = |more: &[&str]| {
            let more = more.iter().map(|name| (*name).to_owned());
            data.var_names().iter().cloned().chain(more).collect()
        };
        match method {
            Method::Jpcmciplus => {
                let other = plain.slice(ndarray::s![..;-1, ..]).to_owned();
                let mut other = other + 3.0;
                (1..300).for_each(|t| other[[t, 1]] = 0.7 * other[[t - 1, 0]] + plain[[299 - t, 0]]);
                DataFrame::new(vec![plain, other], names(&[])).unwrap()
            }
            Method::Candoit => {
                let imposed = |on: f64| {
                    let value = |t: usize| if t.is_multiple_of(3) { on } else { 0.0 };
                    let mut wide = ndarray::Array2::from_shape_fn((300, 3), |(t, v)| match v {
                        2 => value(t),
                        0 => plain[[t, 0]] + 2.0 * value(t),
                        _ => plain[[t, 1]],
                    });
                    (1..300).for_each(|t| wide[[t, 1]] += 1.4 * value(t - 1));
                    wide
                };
                DataFrame::new(vec![imposed(0.0), imposed(1.0)], names(&["do_a"])).unwrap()
            }
            _ => data,
        }
    }

    fn settings(method: Method) -> Settings {
        let acts_on = (method == Method::Candoit).then(|| vec![("do_a".to_owned(), "a".to_owned())]);
        let info = method.info();
        Settings {
            method,
            acts_on,
            tau_min: info.tau_min,
            cond_ind_test: info.test.to_owned(),
            ..Settings::default()
        }
    }

    #[test]
    fn a_filter_or_a_test_that_leaves_nothing_is_told() {
        let reported = |f_alpha: f64, alpha: f64| {
            let cond_ind_test = "parcorr".into();
            let strict =
                Settings { cond_ind_test, alpha, f_alpha: Some(f_alpha), ..settings(Method::Fpcmci) };
            let model = analyse(&pair(), &strict, &Control::default()).unwrap();
            let concluded = model.summary().conclusion.join(" ");
            assert!(
                !concluded.contains("no link was tested"),
                "a test may be what left them out: {concluded}"
            );
            (model.dropped.len(), model.warnings.join("; "))
        };
        let (dropped, nothing_through) = reported(1e-300, 0.05);
        assert!(
            dropped == 2 && nothing_through.contains("the filter lets nothing through"),
            "{nothing_through}"
        );
        let (dropped, nothing_found) = reported(0.05, 1e-300);
        assert!(dropped == 2 && nothing_found.contains("all variables are left out"), "{nothing_found}");
        assert_eq!(reported(0.05, 0.05), (0, String::new()));
    }

    #[test]
    fn every_method_finds_the_link_and_names_its_test() {
        for method in Method::all().filter(|method| *method != Method::Lagdep) {
            let of_method = Settings { cond_ind_test: "parcorr".into(), ..settings(method) };
            let model = analyse(&pair_for(method), &of_method, &Control::default()).unwrap();
            let found =
                model.links.iter().any(|link| link.cause == "a" && link.effect == "b" && link.lag == 1);
            assert!(found, "{method}: {:?}", model.links);
            let test = if method.info().uses_test { "parcorr" } else { "none" };
            assert_eq!(model.cond_ind_test, test, "{method}");
        }
    }

    fn refused(data: &DataFrame, settings: &Settings) -> String {
        analyse(data, settings, &Control::default()).unwrap_err().to_string()
    }

    #[test]
    fn the_dummy_is_no_variable_of_the_model_and_is_told() {
        let data = pair_for(Method::Jpcmciplus);
        let model = analyse(&data, &settings(Method::Jpcmciplus), &Control::default()).unwrap();
        assert_eq!((model.features.len(), model.graph.len(), model.n_recordings), (2, 2, 2));
        assert!(
            model.warnings.iter().any(|reported| reported.contains("the recordings differ in a")),
            "{:?}",
            model.warnings
        );
    }

    #[test]
    fn what_is_constant_in_each_recording_is_a_context_and_nothing_drives_it() {
        let with_age = |(k, of): (usize, &ndarray::Array2<f64>)| {
            ndarray::Array2::from_shape_fn((300, 3), |(t, v)| if v == 2 { k as f64 } else { of[[t, v]] })
        };
        let wide = pair_for(Method::Jpcmciplus).recordings().iter().enumerate().map(with_age).collect();
        let names = ["a", "b", "age"].map(str::to_owned).to_vec();
        let data = DataFrame::new(wide, names).unwrap();
        let model = analyse(&data, &settings(Method::Jpcmciplus), &Control::default()).unwrap();
        assert!(model.links.iter().all(|link| link.effect != "age"), "{:?}", model.links);
        assert!(
            model
                .warnings
                .iter()
                .any(|reported| reported.contains("taken as contexts") && reported.contains("age"))
        );
    }

    #[test]
    fn contexts_and_interventions_that_the_data_do_not_have_are_one_sentence() {
        let of = settings(Method::Jpcmciplus);
        let data = pair_for(Method::Jpcmciplus);
        let error = refused(&data, &Settings { exogenous: vec!["b".into()], ..of.clone() });
        assert!(error.contains("'b' varies within recording 1") && error.contains("candoit"), "{error}");
        let error = refused(&pair(), &of);
        assert!(error.contains("there is one") && error.contains("pcmciplus"), "{error}");
        let error = Settings { cond_ind_test: "gpdc".into(), ..of.clone() }.check().unwrap_err().to_string();
        assert!(error.contains("take parcorr"), "{error}");
        assert!(Settings { pc_alpha: PcAlpha::ByScore, ..of.clone() }.check().is_err());
        assert!(Settings { tau_min: 1, ..of.clone() }.check().is_err());
        let long = Settings { tau_max: 200, ..of };
        let error = refused(&data, &long);
        assert!(error.contains("record longer"), "{error}");

        let of = settings(Method::Candoit);
        let error = refused(&pair(), &of);
        assert!(error.contains("do_a=a") && error.contains("no column 'do_a'"), "{error}");
        let error = refused(&pair(), &Settings { acts_on: None, ..of.clone() });
        assert!(error.contains("no column holds one") && error.contains("take lpcmci"), "{error}");
        let still = pair_for(Method::Candoit).recordings()[0].clone();
        let names = ["a", "b", "do_a"].map(str::to_owned).to_vec();
        let error = refused(&DataFrame::new(vec![still], names).unwrap(), &of);
        assert!(error.contains("nothing was imposed"), "{error}");
    }

    #[test]
    fn what_says_how_p_values_are_made_is_refused_where_nobody_reads_it() {
        let of = |method, test: &str| Settings { cond_ind_test: test.into(), ..settings(method) };
        let nulls = Some(Arc::new(NullDistributions::new(vec![(248, vec![0.1, 0.2])]).unwrap()));
        let shuffle = Some(Significance::ShuffleTest);
        let with = |test: TestSettings, given: Settings| Settings { test, ..given };
        let by = |significance| TestSettings { significance, ..TestSettings::default() };
        let drawing = |significance| TestSettings { sig_samples: Some(100), ..by(significance) };
        let with_nulls = |significance, given| {
            with(TestSettings { null_distributions: nulls.clone(), ..by(significance) }, given)
        };
        let threshold = Some(Significance::FixedThres);
        for (given, says) in [
            (with_nulls(shuffle, of(Method::Pcmci, "gpdc")), "'null_dist': the significance"),
            (with_nulls(None, of(Method::Pcmci, "parcorr")), "'null_dist': parcorr makes"),
            (with_nulls(None, of(Method::Timino, "gpdc")), "'null_dist': timino uses no p-value"),
            (with(drawing(None), of(Method::Pcmci, "parcorr")), "'shuffles': parcorr draws no surrogates"),
            (with(drawing(threshold), of(Method::Pcmci, "cmiknn")), "'shuffles': cmiknn draws no surrogates"),
            (
                with(drawing(None), of(Method::Granger, "gpdc")),
                "'shuffles': granger uses no independence test",
            ),
            (
                with(by(shuffle), of(Method::Varlingam, "gpdc")),
                "'significance': varlingam uses no independence test",
            ),
        ] {
            let error = given.check().unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
        assert!(with_nulls(None, of(Method::Pcmci, "gpdc")).check().is_ok());
        for (test, significance) in
            [("gpdc", None), ("cmiknn", None), ("parcorr", shuffle), ("gpdc", shuffle)]
        {
            let read = with(drawing(significance), of(Method::Pcmci, test));
            assert!(read.check().is_ok(), "{test} {significance:?}");
        }
    }

    #[test]
    fn lags_beyond_the_data_are_refused_before_anything_is_made_for_them() {
        for method in Method::all() {
            let of = |tau_max| Settings { tau_max, cond_ind_test: "parcorr".into(), ..settings(method) };
            for tau_max in [1_000_000_000, usize::MAX] {
                let error = of(tau_max).check().unwrap_err().to_string();
                assert!(
                    error.contains(&format!("'tau_max': {tau_max} is above 100000")),
                    "{method}: {error}"
                );
            }
            let known = Settings { exogenous: vec!["a".into()], ..of(100_000) };
            for settings in [of(100_000), known] {
                let error = refused(&pair_for(method), &settings);
                assert!(error.contains("has 300 samples; tau_max = 100000 needs"), "{method}: {error}");
            }
        }
    }

    #[test]
    fn what_an_intervention_sets_is_given_and_what_was_not_recorded_may_drive_all() {
        let data = pair_for(Method::Candoit);
        let of = Settings { cond_ind_test: "parcorr".into(), ..settings(Method::Candoit) };
        let model = analyse(&data, &of, &Control::default()).unwrap();
        assert_eq!(model.graph[2][0][0], LinkMark::Forward);
        assert!(model.graph[2][2].iter().all(|mark| !mark.is_link()));
        assert!(model.warnings.iter().any(|reported| reported.contains("'do_a' drives 'a': this was given")));
        // Named as exogenous alone, it may drive any variable, and still nothing drives it.
        let free = Settings { acts_on: None, exogenous: vec!["do_a".into()], ..of };
        let model = analyse(&data, &free, &Control::default()).unwrap();
        assert_eq!(model.graph[2][0][0], LinkMark::Forward);
        assert!(model.warnings.iter().any(|reported| reported.contains("may drive any of them")));
        assert!(
            model.links.iter().all(|link| link.effect != "do_a" || link.cause == "do_a"),
            "{:?}",
            model.links
        );
    }

    #[test]
    fn what_is_given_and_not_read_is_refused_and_what_is_not_given_never() {
        use crate::{independence_tests::GpSearch, methods::Reads};
        for method in Method::all() {
            let usual = settings(method);
            assert!(usual.check().is_ok(), "{method}");
            let pairs = Some(vec![("do_a".to_owned(), "a".to_owned())]);
            for (name, reads, given) in [
                ("pc_alpha", Reads::PcAlpha, Settings { pc_alpha: PcAlpha::Fixed(0.1), ..usual.clone() }),
                ("f_alpha", Reads::FAlpha, Settings { f_alpha: Some(0.1), ..usual.clone() }),
                (
                    "te_estimator",
                    Reads::TeEstimator,
                    Settings { te_estimator: TeEstimator::Gaussian, ..usual.clone() },
                ),
                ("acts_on", Reads::ActsOn, Settings { acts_on: pairs, ..usual.clone() }),
            ] {
                match given.check() {
                    Ok(()) => assert!(method.reads(reads), "{method} takes {name} and does not read it"),
                    Err(error) => {
                        let (error, readers) = (error.to_string(), Method::names_that_read(reads));
                        assert!(!method.reads(reads) && error.contains(&format!("'{name}'")), "{error}");
                        assert!(error.contains(&format!("it applies to {readers}")), "{error}");
                    }
                }
            }
            let of_process = [
                TestSettings { gp_restarts: 2, ..TestSettings::default() },
                TestSettings { gp_search: GpSearch::Exact, ..TestSettings::default() },
            ];
            for test in of_process {
                let given = Settings { test, ..usual.clone() };
                let reads = method.info().uses_test && given.cond_ind_test == "gpdc";
                assert_eq!(given.check().is_ok(), reads, "{method}");
                assert!(Settings { cond_ind_test: "parcorr".into(), ..given }.check().is_err(), "{method}");
            }
        }
    }

    #[test]
    fn a_threshold_is_alpha_also_where_a_method_has_one_level_only() {
        for method in Method::all() {
            let significance = Some(Significance::FixedThres);
            let test = TestSettings { significance, ..TestSettings::default() };
            let of = Settings { alpha: 0.3, test, ..settings(method) };
            let info = method.info();
            let expected = if info.one_level { 0.3 } else { info.pc_alpha };
            assert_eq!(of.level_of_pc(), Some(expected), "{method}");
            let given = Settings { pc_alpha: PcAlpha::Fixed(0.4), ..of.clone() };
            assert_eq!(given.level_of_pc(), Some(0.4), "{method}");
            let by_p = Settings { test: TestSettings::default(), ..of };
            assert_eq!(by_p.level_of_pc(), Some(info.pc_alpha), "{method}");
        }
    }

    #[test]
    fn a_link_that_must_exist_and_ends_in_an_exogenous_variable_is_refused_and_both_are_named() {
        use crate::types::{Assumption, LinkAssumptions};
        for (method, lag) in [(Method::Pcmci, 1), (Method::Pcmciplus, 0), (Method::Lpcmci, 1)] {
            let mut links = LinkAssumptions::all(2, 0, 1);
            links.insert(0, 1, lag, Assumption::Exists).unwrap();
            let of = Settings {
                cond_ind_test: "parcorr".into(),
                tau_min: 0,
                link_assumptions: Some(links),
                ..settings(method)
            };
            let error = refused(&pair(), &Settings { exogenous: vec!["b".into()], ..of.clone() });
            assert!(error.contains(&format!("a -> b at lag {lag} is required")), "{error}");
            assert!(error.contains("'b' is exogenous"), "{error}");
            // The cause may be exogenous.
            let other = Settings { exogenous: vec!["a".into()], ..of };
            assert!(analyse(&pair(), &other, &Control::default()).is_ok(), "{method}");
        }
        // Of a pair without a direction the one away from an exogenous variable is left, but not between two of them.
        let mut links = LinkAssumptions::all(2, 0, 1);
        links.insert(0, 1, 0, Assumption::ExistsUnoriented).unwrap();
        let exogenous = |names: &[&str]| Settings {
            cond_ind_test: "parcorr".into(),
            link_assumptions: Some(links.clone()),
            exogenous: names.iter().map(|name| (*name).to_owned()).collect(),
            ..settings(Method::Pcmciplus)
        };
        assert!(analyse(&pair(), &exogenous(&["b"]), &Control::default()).is_ok());
        let error = refused(&pair(), &exogenous(&["a", "b"]));
        assert!(error.contains("b -> a at lag 0 is required, but 'a' is exogenous"), "{error}");
    }

    #[test]
    fn lag_0_alone_is_for_methods_that_model_it() {
        for method in Method::all() {
            let alone = Settings { tau_max: 0, tau_min: 0, ..settings(method) };
            let models_it = method.info().models_lag_zero || matches!(method, Method::Lpcmci | Method::Tsfci);
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
