//! The parameters of the discovery node.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use roscausal_discovery::{
    PcAlpha, Settings, VectorNames,
    changes::Levels,
    confidence::{Resampling, Scheme},
    independence_tests::{GpSearch, NullDistributions, by_name},
    methods::{ActsOn, Fdr, Method, acts_on_of, usual_acts_on},
    transfer_entropy::TeEstimator,
    vectors_of,
};

use super::regime::RollParams;
use crate::{
    Error, Result,
    batch::{IdFormat, joint::People},
    external,
    params::{Allowed, ParamSpec, Params, Value},
};

/// The discovery node's parameters, checked.
#[derive(Clone)]
pub(super) struct DiscoveryParams {
    pub data_dir: PathBuf,
    pub res_dir: Option<PathBuf>,
    pub csv_prefix: String,
    /// Format of the batches' ids, which tell their times.
    pub ids: IdFormat,
    pub settings: Settings,
    /// The program of an external method.
    pub program: Option<PathBuf>,
    pub people: People,
    pub batches_per_model: usize,
    pub keep_batches: bool,
    pub analyse_incomplete: bool,
    pub max_pool_size: usize,
    pub max_attempts: u32,
    pub threads: usize,
    pub nice: i32,
    pub time_budget_s: Option<f64>,
    pub image_scale: f32,
    /// Columns that are one variable.
    pub vectors: VectorNames,
    /// How to resample; `None`: not.
    pub resampling: Option<Resampling>,
    /// How to roll; `None`: each model is of its own batches.
    pub rolling: Option<RollParams>,
}

/// What a running node keeps: where files and programs are, and what its regime rests on. All else it takes anew, from the next batch
/// on.
const FIXED: [&str; 14] = [
    "data_dir",
    "res_dir",
    "csv_prefix",
    "id_format",
    "cd_method_dir",
    "null_dist",
    "people",
    "keep_batches",
    "window_batches",
    "window_samples",
    "detect_changes",
    "change_rows",
    "suspect_level",
    "confirm_level",
];

/// Names, defaults, allowed values and descriptions.
pub(super) fn specs() -> Vec<ParamSpec> {
    let live = |spec: ParamSpec| if FIXED.contains(&spec.name) { spec } else { spec.live() };
    all().into_iter().map(live).collect()
}

fn all() -> Vec<ParamSpec> {
    use Allowed::{Any, OneOf, Range};
    use Value::{Bool, Double, Int};
    let text = |text: &str| Value::Str(text.to_owned());
    vec![
        ParamSpec::new("data_dir", text("~/roscausal/pp_pool"), Any, "folder to watch for batches"),
        ParamSpec::new("res_dir", text(""), Any, "folder for model files; empty: only publish"),
        ParamSpec::new("csv_prefix", text("data_"), Any, "prefix of the batches' file names"),
        ParamSpec::new(
            "id_format",
            text("%Y%m%d_%H%M%S"),
            Any,
            "strftime format of the batches' ids, by which the oldest is found",
        ),
        ParamSpec::of_data(
            "cd_method",
            text(Method::default().name()),
            Any,
            "fpcmci, pcmci, pcmciplus, fullci, bivci, lagdep, granger, varlingam, dynotears, timino, lpcmci, candoit, tsfci, jpcmciplus, or a program in cd_method_dir",
        ),
        ParamSpec::new("cd_method_dir", text(""), Any, "folder of external methods (programs)"),
        ParamSpec::of_data(
            "cond_ind_test",
            text("gpdc"),
            Any,
            "gpdc, parcorr, robustparcorr, parcorrwls, parcorrmult, cmiknn, cmisymb, gsquared or regressionci",
        ),
        ParamSpec::of_data("sig_alpha", Double(0.05), Range(1e-9, 0.999), "significance level of a link"),
        ParamSpec::of_data(
            "pc_alpha",
            Double(-1.0),
            Range(-1.0, 0.999),
            "significance level of the condition selection; -1: the method's own (pcmci 0.2, lpcmci 0.05, pcmciplus 0.01); 0: chosen by \
             a score",
        ),
        ParamSpec::of_data(
            "f_alpha",
            Double(0.0),
            Range(0.0, 0.999),
            "significance level of F-PCMCI's filter; 0: as sig_alpha",
        ),
        ParamSpec::of_data(
            "te_estimator",
            text(TeEstimator::default().name()),
            OneOf(TeEstimator::NAMES),
            "estimator of F-PCMCI's filter; auto: gaussian for a linear test, else gaussian+dcor",
        ),
        ParamSpec::of_data(
            "gp_search",
            text(GpSearch::default().name()),
            OneOf(GpSearch::NAMES),
            "gpdc: likelihoods as exact as they must be, or all exact (slow; the same maxima)",
        ),
        ParamSpec::of_data(
            "gp_restarts",
            Int(0),
            Range(0.0, 1000.0),
            "gpdc: searches from this many random places more, of which the best counts",
        ),
        ParamSpec::new(
            "null_dist",
            text(""),
            Any,
            "gpdc: CSV file of null distributions; the first row has the numbers of samples; empty: its own",
        ),
        ParamSpec::of_data(
            "vectors",
            Value::List(Vec::new()),
            Any,
            "parcorrmult: columns that are one variable, such as place=h_x+h_y",
        ),
        ParamSpec::of_data(
            "fdr_method",
            text(Fdr::default().name()),
            OneOf(Fdr::NAMES),
            "correction for multiple testing",
        ),
        ParamSpec::of_data("min_lag", Int(1), Range(0.0, 1000.0), "smallest lag, in steps"),
        ParamSpec::of_data("max_lag", Int(1), Range(1.0, 1000.0), "largest lag, in steps"),
        ParamSpec::of_data(
            "exogenous",
            Value::List(Vec::new()),
            Any,
            "variables that may be causes only, such as weather; columns of interventions are so without being named",
        ),
        ParamSpec::of_data(
            "acts_on",
            Value::List(
                usual_acts_on()
                    .iter()
                    .map(|(column, variable)| text(&format!("{column}={variable}")))
                    .collect(),
            ),
            Any,
            "candoit: columns of interventions and the variable that each sets, such as do_robot_speed=r_v",
        ),
        ParamSpec::of_data(
            "extra_conditions",
            Bool(true),
            Any,
            "candoit: contexts of interventions join their variables as conditions, as published; false takes far fewer tests",
        ),
        ParamSpec::of_data(
            "max_sets",
            Int(0),
            Range(0.0, 1e9),
            "lpcmci, candoit: sets of conditions of one size that are tested for a pair, from each of its ends; 0: all",
        ),
        ParamSpec::of_data("seed", Int(42), Range(0.0, 9e15), "seed of all random numbers"),
        ParamSpec::of_data(
            "people",
            text("pooled"),
            OneOf(&People::NAMES),
            "models for several people: one of all people, as recordings of one system; one each; both; or one with \
             everybody's variables",
        ),
        ParamSpec::new(
            "batches_per_model",
            Int(1),
            Range(1.0, 1000.0),
            "number of batches analysed together for one model",
        ),
        ParamSpec::new(
            "keep_batches",
            Bool(false),
            Any,
            "move analysed batches to analysed/ instead of deleting them",
        ),
        ParamSpec::new(
            "analyse_incomplete",
            Bool(false),
            Any,
            "analyse batches whose recording was cut short",
        ),
        ParamSpec::new(
            "max_pool_size",
            Int(0),
            Range(0.0, 1e6),
            "most batches that wait; the oldest are deleted; 0: no limit",
        ),
        ParamSpec::new(
            "max_attempts",
            Int(3),
            Range(1.0, 1000.0),
            "number of attempts to analyse a batch before it is rejected",
        ),
        ParamSpec::new("threads", Int(0), Range(0.0, 1024.0), "threads of an analysis; 0: all cores"),
        ParamSpec::new(
            "nice",
            Int(0),
            Range(0.0, 19.0),
            "priority of an analysis as in nice(1): 0 normal, 19 lowest",
        ),
        ParamSpec::new(
            "time_budget",
            Double(0.0),
            Range(0.0, 1e9),
            "wall time that an analysis may take, in seconds, also in simulated time; 0: no limit",
        ),
        ParamSpec::new(
            "max_memory",
            Int(0),
            Range(0.0, 1e9),
            "megabytes that a test, or an external method, may take; 0: no limit",
        ),
        ParamSpec::of_data(
            "resamples",
            Int(0),
            Range(0.0, 10_000.0),
            "analyses of rows drawn from the data, for the confidence of links: 20 to 10000; 0: none",
        ),
        ParamSpec::of_data(
            "resampling",
            text(Scheme::default().name()),
            OneOf(Scheme::NAMES),
            "how rows are drawn: a share of them, each once, or as many as there are, with replacement",
        ),
        ParamSpec::of_data(
            "resample_share",
            Double(Resampling::default().share),
            Range(0.01, 0.99),
            "share of the rows in a subsample",
        ),
        ParamSpec::of_data(
            "resample_block",
            text("1"),
            Any,
            "neighbouring rows that are drawn together: a number, or cube_root of the number of rows",
        ),
        ParamSpec::of_data(
            "window_batches",
            Int(1),
            Range(1.0, 1000.0),
            "most batches of a model, the newest of the present regime; a model for each new one; 1: of it alone",
        ),
        ParamSpec::of_data(
            "window_samples",
            Int(2000),
            Range(0.0, 1e9),
            "most samples of such a model, but one batch at least; 0: no limit",
        ),
        ParamSpec::of_data(
            "detect_changes",
            text("auto"),
            OneOf(&DETECT),
            "tell when a mechanism changes, on /roscausal/model_changes; auto: if window_batches is above 1",
        ),
        ParamSpec::of_data(
            "change_rows",
            Int(0),
            Range(0.0, 1e6),
            "rows that are compared with the regime at a time, more for many variables; 0: each batch as a whole",
        ),
        ParamSpec::of_data(
            "suspect_level",
            Double(Levels::default().suspect),
            Range(1e-9, 0.999),
            "level at which a change is suspected, corrected for the number of links",
        ),
        ParamSpec::of_data(
            "confirm_level",
            Double(Levels::default().confirm),
            Range(1e-9, 0.999),
            "level at which a suspected change is confirmed",
        ),
        ParamSpec::new(
            "image_scale",
            Double(0.6),
            Range(0.1, 4.0),
            "pixels per unit of the published pictures",
        ),
    ]
}

impl DiscoveryParams {
    pub(super) fn new(params: &Params) -> Result<Self> {
        let positive = |name: &str| Some(params.double(name)).filter(|value| *value > 0.0);
        let named = params.text("cd_method");
        let (method, program) = match (named.parse(), params.text_if_set("cd_method_dir")) {
            (Ok(method), _) => (method, None),
            (Err(_), Some(dir)) => (Method::default(), Some(external::program(Path::new(&dir), &named)?)),
            (Err(error), None) => return Err(in_the_nodes_words(error)),
        };
        let settings = Settings {
            method,
            cond_ind_test: params.text("cond_ind_test"),
            alpha: params.double("sig_alpha"),
            pc_alpha: match params.double("pc_alpha") {
                level if level <= -1.0 => PcAlpha::Default,
                0.0 => PcAlpha::ByScore,
                level => PcAlpha::Fixed(level),
            },
            exogenous: params.list("exogenous"),
            acts_on: acts_on(params)?,
            f_alpha: positive("f_alpha"),
            te_estimator: params.text("te_estimator").parse().map_err(in_the_nodes_words)?,
            fdr: params.text("fdr_method").parse().map_err(in_the_nodes_words)?,
            gp_search: params.text("gp_search").parse().map_err(in_the_nodes_words)?,
            gp_restarts: params.count("gp_restarts"),
            null_distributions: null_distributions(params)?,
            extra_conditions: params.flag("extra_conditions"),
            max_sets: Some(params.count("max_sets")).filter(|&most| most > 0),
            tau_min: params.count("min_lag"),
            tau_max: params.count("max_lag"),
            seed: params.int("seed").unsigned_abs(),
            max_memory: Some(params.count("max_memory") * 1_000_000).filter(|&bytes| bytes > 0),
            ..Settings::default()
        };
        if program.is_none() {
            settings.check().map_err(in_the_nodes_words)?;
        }
        let resampling = resampling_of(params)?;
        if resampling.is_some() && program.is_some() {
            return Err(Error::param("resamples", "external methods are not resampled; set it to 0"));
        }
        let rolling = rolling_of(params);
        if rolling.is_some() && params.count("batches_per_model") > 1 {
            let reason = "with window_batches or detect_changes each batch gives a model; set it to 1";
            return Err(Error::param("batches_per_model", reason));
        }
        let vectors = vectors(params, &settings, program.is_some() || rolling.is_some())?;
        Ok(Self {
            vectors,
            resampling,
            rolling,
            data_dir: super::path(&params.text("data_dir")),
            res_dir: params.text_if_set("res_dir").map(|dir| super::path(&dir)),
            csv_prefix: params.text("csv_prefix"),
            ids: IdFormat::new(&params.text("id_format"))?,
            settings,
            program,
            people: params.text("people").parse().map_err(|reason| Error::param("people", reason))?,
            batches_per_model: params.count("batches_per_model"),
            keep_batches: params.flag("keep_batches"),
            analyse_incomplete: params.flag("analyse_incomplete"),
            max_pool_size: params.count("max_pool_size"),
            max_attempts: params.count("max_attempts") as u32,
            threads: params.count("threads"),
            nice: params.int("nice") as i32,
            time_budget_s: positive("time_budget"),
            image_scale: params.double("image_scale") as f32,
        })
    }
}

/// When changes are looked for.
const DETECT: [&str; 3] = ["auto", "always", "never"];

/// How to roll; `None` with windows of one batch and without changes.
fn rolling_of(params: &Params) -> Option<RollParams> {
    let batches = params.count("window_batches");
    let detects = match params.text("detect_changes").as_str() {
        "always" => true,
        "never" => false,
        _ => batches > 1,
    };
    let levels = Levels { suspect: params.double("suspect_level"), confirm: params.double("confirm_level") };
    (batches > 1 || detects).then_some(RollParams {
        batches,
        samples: params.count("window_samples"),
        changes: detects.then_some(levels),
        change_rows: params.count("change_rows"),
    })
}

/// What interventions act on; `None`: as usual, as far as the columns are there.
fn acts_on(params: &Params) -> Result<Option<ActsOn>> {
    let given = acts_on_of(&params.list("acts_on")).map_err(in_the_nodes_words)?;
    Ok(Some(given).filter(|given| *given != usual_acts_on()))
}

/// The file of null distributions; `None` if none is named.
fn null_distributions(params: &Params) -> Result<Option<Arc<NullDistributions>>> {
    let Some(file) = params.text_if_set("null_dist") else { return Ok(None) };
    let file = super::path(&file);
    let text = std::fs::read_to_string(&file).map_err(|error| Error::file(&file, error))?;
    Ok(Some(Arc::new(NullDistributions::parse(&text).map_err(in_the_nodes_words)?)))
}

/// The columns that are one variable. Those who read the columns one by one have none: programs, and the search for changes.
fn vectors(params: &Params, settings: &Settings, one_by_one: bool) -> Result<VectorNames> {
    let vectors = vectors_of(&params.list("vectors")).map_err(in_the_nodes_words)?;
    if vectors.is_empty() {
        return Ok(vectors);
    }
    let fail = |reason: String| Err(Error::param("vectors", reason));
    if one_by_one {
        return fail(
            "external methods, windows and changes take each column for a variable; leave it empty".into(),
        );
    }
    let test = by_name(&settings.cond_ind_test, &Default::default()).map_err(in_the_nodes_words)?;
    // F-PCMCI's filter reads columns; what asks no test does so too.
    let by_columns = settings.method == Method::Fpcmci || !settings.method.info().asks_test;
    if by_columns || !test.judges_vectors() {
        return fail(format!(
            "{} takes each variable for one column; take cond_ind_test parcorrmult with a method that asks a test, such as pcmci",
            if by_columns { settings.method.name() } else { test.name() }
        ));
    }
    Ok(vectors)
}

/// How to resample; `None` without resamples.
fn resampling_of(params: &Params) -> Result<Option<Resampling>> {
    let resampling = Resampling {
        resamples: params.count("resamples"),
        scheme: params.text("resampling").parse().map_err(in_the_nodes_words)?,
        share: params.double("resample_share"),
        block: params.text("resample_block").parse().map_err(in_the_nodes_words)?,
    };
    if resampling.resamples == 0 {
        return Ok(None);
    }
    resampling.check().map_err(in_the_nodes_words)?;
    Ok(Some(resampling))
}

/// Renames the settings in an error to this node's parameters.
pub(super) fn in_the_nodes_words(error: roscausal_discovery::Error) -> Error {
    match Error::from(error) {
        Error::Param { name, reason } => {
            let name = match name.as_str() {
                "method" => "cd_method",
                "test" => "cond_ind_test",
                "alpha" => "sig_alpha",
                "tau-min" => "min_lag",
                "tau-max" => "max_lag",
                "fdr" => "fdr_method",
                "share" => "resample_share",
                "block" => "resample_block",
                "vector" => "vectors",
                other => other,
            };
            Error::param(name.replace('-', "_"), reason)
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use roscausal_discovery::independence_tests;

    use super::*;
    use crate::loopback::Loopback;

    #[test]
    fn the_descriptions_name_every_method_and_every_test() {
        let specs = specs();
        let described = |name: &str| specs.iter().find(|spec| spec.name == name).expect(name).description;
        assert!(Method::names().all(|name| described("cd_method").contains(name)));
        let mut tests = independence_tests::names().filter(|name| *name != "gpdcpython");
        assert!(tests.all(|name| described("cond_ind_test").contains(name)));
    }

    fn checked(given: &[(&str, Value)]) -> Result<DiscoveryParams> {
        let bus = Loopback::lockstep();
        given.iter().for_each(|(name, value)| bus.set_node_param("discovery", name, value.clone()));
        let params = Params::read(&bus.node("discovery"), &specs())?;
        DiscoveryParams::new(&params)
    }

    #[test]
    fn null_distributions_and_vectors_are_read_or_refused_in_one_sentence_before_the_first_batch() {
        let dir = tempfile::tempdir().expect("a folder");
        let file = dir.path().join("null.csv");
        std::fs::write(&file, "248\n0.1\n0.2\n").expect("writes");
        let word = |text: &str| Value::Str(text.to_owned());
        let null = ("null_dist", word(&file.to_string_lossy()));
        let place = ("vectors", Value::List(vec![word("place=h_x+h_y")]));
        let (pcmci, mult) = (("cd_method", word("pcmci")), ("cond_ind_test", word("parcorrmult")));
        let params = checked(std::slice::from_ref(&null)).expect("a table");
        assert_eq!(
            params.settings.null_distributions.and_then(|given| given.share_above(248, 0.15)),
            Some(0.5)
        );
        let params = checked(&[place.clone(), pcmci.clone(), mult.clone()]).expect("a vector");
        assert_eq!(params.vectors, [("place".to_owned(), vec!["h_x".to_owned(), "h_y".to_owned()])]);
        for (given, says) in [
            (vec![null, ("cond_ind_test", word("parcorr"))], "null_dist"),
            (vec![("null_dist", word("/nowhere/null.csv"))], "/nowhere/null.csv"),
            (vec![place.clone(), pcmci.clone()], "take cond_ind_test parcorrmult"),
            (vec![place.clone(), mult.clone()], "fpcmci takes each variable"),
            (
                vec![place.clone(), mult.clone(), ("cd_method", word("granger"))],
                "granger takes each variable",
            ),
            (vec![place, pcmci, mult, ("window_batches", Value::Int(3))], "windows and changes"),
            (vec![("vectors", Value::List(vec![word("place")]))], "'place' is no vector"),
        ] {
            let error = checked(&given).err().expect(says).to_string();
            assert!(error.contains(says) && error.lines().count() == 1, "{says}: {error}");
        }
    }

    #[test]
    fn the_exogenous_variables_are_those_that_the_user_names() {
        let weather = Value::List(vec![Value::Str("weather".into())]);
        let named = |given: &[(&str, Value)]| checked(given).expect("allowed").settings.exogenous;
        assert_eq!(named(&[("exogenous", weather)]), ["weather"]);
        assert!(named(&[]).is_empty());
    }

    #[test]
    fn a_parameter_that_is_set_and_not_read_is_refused_with_those_who_read_it() {
        let word = |text: &str| Value::Str(text.to_owned());
        let method = ("cd_method", word("granger"));
        let effect = Value::List(vec![word("do_a=a")]);
        for (name, value, says) in [
            ("pc_alpha", Value::Double(0.1), "it is for fpcmci, pcmci, "),
            ("f_alpha", Value::Double(0.1), "it is for fpcmci"),
            ("te_estimator", word("gaussian"), "it is for fpcmci"),
            ("acts_on", effect, "it is for candoit"),
            ("gp_restarts", Value::Int(2), "it is for the test gpdc"),
        ] {
            let error = checked(&[method.clone(), (name, value)]).err().expect(name).to_string();
            assert!(error.contains(&format!("'{name}'")) && error.contains(says), "{error}");
        }
        // The defaults are not given.
        let usual = usual_acts_on().iter().map(|(of, sets)| word(&format!("{of}={sets}"))).collect();
        let unset = [("f_alpha", Value::Double(0.0)), ("pc_alpha", Value::Double(-1.0))];
        let unset = [&[method, ("acts_on", Value::List(usual))], &unset[..]].concat();
        assert!(checked(&unset).is_ok());
    }

    #[test]
    fn an_unknown_method_or_estimator_is_an_error_that_names_the_nearest() {
        for (name, value, near) in
            [("cd_method", "pcmcipls", "pcmciplus"), ("te_estimator", "krskov", "kraskov")]
        {
            let bus = Loopback::lockstep();
            bus.set_node_param("discovery", name, Value::Str(value.into()));
            let params = Params::read(&bus.node("discovery"), &specs());
            let error =
                params.and_then(|params| DiscoveryParams::new(&params)).err().expect(value).to_string();
            assert!(error.contains(name) && error.contains(&format!("did you mean '{near}'?")), "{error}");
        }
    }
}
