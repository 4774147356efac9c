//! The table of settings. A new one is a field of [`Settings`](super::Settings) or [`Request`](super::Request) and an entry here.

use serde_json::Value;

use super::{
    Group, Kind, Readers, Setting,
    plain::{self, Plain},
};
use crate::{
    confidence::Scheme,
    independence_tests::{GpSearch, Significance, TRANSFORMS, draws},
    methods::{ColliderRule, Fdr, Method, Reads},
    transfer_entropy::TeEstimator,
};

/// What most settings have in common.
const USUAL: Setting = Setting {
    id: "",
    flag: "",
    param: "",
    kind: Kind::Flag,
    unit: "",
    help: "",
    unset: "",
    param_unset: "",
    by_method: None,
    group: Group::Method,
    expert: false,
    of_data: true,
    most_of_data: f64::INFINITY,
    readers: Readers::All,
    get: |_| Value::Null,
    set: |_, _| Ok(()),
};

/// The name in Rust and Python, the flag, the node's parameter, and where the value is kept.
macro_rules! setting {
    ($id:literal $flag:literal $param:literal $($field:ident).+, $($key:ident: $value:expr),+ $(,)?) => {
        Setting {
            id: $id,
            flag: $flag,
            param: $param,
            get: |request| request.$($field).+.json(),
            set: |request, value| plain::read(&mut request.$($field).+, value),
            $($key: $value,)+
            ..USUAL
        }
    };
}

/// Settings of one test.
const fn of_test(test: fn(&str, Option<Significance>) -> bool, why: &'static str) -> Readers {
    Readers::Tests { method: Method::asks_for_p_values, test, why }
}

/// Settings of GPDC's regressions, which TiMINo takes, too.
const OF_PROCESS: Readers = Readers::Tests {
    method: |method| method.info().asks_test,
    test: |test, _| test == "gpdc",
    why: "fits no Gaussian process",
};
const OF_CMIKNN: Readers = of_test(|test, _| test == "cmiknn", "has no nearest neighbours");
const OF_FILTER: &str = "has no filter";
const OF_CONDITIONS: &str = "chooses no conditions";
const OF_COLLIDERS: &str = "has no colliders at lag 0";

/// All settings of an analysis, in the order in which they are listed.
pub static SETTINGS: [Setting; 38] = [
    setting! {
        "method" "method" "cd_method" settings.method,
        kind: Kind::Method,
        help: "Discovery method",
    },
    setting! {
        "test" "test" "cond_ind_test" settings.cond_ind_test,
        kind: Kind::Test,
        help: "Independence test",
        by_method: Some(|info| info.test.to_owned()),
    },
    setting! {
        "alpha" "alpha" "sig_alpha" settings.alpha,
        kind: LEVEL,
        help: "Significance level of a link, in (0, 1)",
        readers: Readers::Methods {
            read: |info| !info.one_level && info.p_values,
            why: "has one level, that of the condition selection",
            instead: Some("pc_alpha"),
        },
    },
    setting! {
        "pc_alpha" "pc-alpha" "pc_alpha" settings.pc_alpha,
        kind: Kind::NumberOr(0.0, 1.0, "auto"),
        help: "Significance level of the condition selection, in (0, 1); auto: chosen by a score",
        unset: "the method's own", param_unset: "-1", by_method: Some(|info| info.pc_alpha.to_string()),
        readers: Readers::Named(Reads::PcAlpha, OF_CONDITIONS),
    },
    setting! {
        "tau_min" "tau-min" "min_lag" settings.tau_min,
        kind: Kind::Lag, unit: "steps", most_of_data: 200.0,
        help: "Smallest lag, in steps",
        by_method: Some(|info| info.tau_min.to_string()),
    },
    setting! {
        "tau_max" "tau-max" "max_lag" settings.tau_max,
        kind: Kind::Lag, unit: "steps", most_of_data: 200.0,
        help: "Largest lag, in steps; at most 100000",
    },
    setting! {
        "f_alpha" "f-alpha" "f_alpha" settings.f_alpha,
        kind: LEVEL,
        help: "Significance level of F-PCMCI's filter",
        unset: "the level of a link", param_unset: "0", readers: Readers::Named(Reads::FAlpha, OF_FILTER),
    },
    setting! {
        "te_estimator" "te-estimator" "te_estimator" settings.te_estimator,
        kind: Kind::Word(TeEstimator::NAMES),
        help: "Estimator of F-PCMCI's filter; auto: gaussian for a linear test, else gaussian+dcor",
        readers: Readers::Named(Reads::TeEstimator, OF_FILTER),
    },
    setting! {
        "neglect_only_autodep" "keep-autodep" "neglect_only_autodep" settings.neglect_only_autodep,
        help: "F-PCMCI's filter drops variables that depend on their own past only",
        expert: true, readers: Readers::Named(Reads::NeglectOnlyAutodep, OF_FILTER),
    },
    setting! {
        "fdr" "fdr" "fdr_method" settings.fdr,
        kind: Kind::Word(Fdr::NAMES),
        help: "Correction for multiple testing",
        readers: Readers::Named(Reads::Fdr, "has no p-values of single tests to correct"),
    },
    setting! {
        "exogenous" "exogenous" "exogenous" settings.exogenous,
        kind: Kind::List("COLUMN"),
        help: "Columns that may be causes only (interventions, context), separated by commas",
    },
    setting! {
        "acts_on" "acts-on" "acts_on" settings.acts_on,
        kind: Kind::List("COLUMN=VARIABLE"),
        help: "candoit: columns of interventions and the variable that each sets, separated by commas",
        unset: "do_robot_speed=r_v, do_robot_off=r_v, do_human_v=h_v, do_human_stop=h_v, as far as they are there",
        readers: Readers::Named(Reads::ActsOn, "knows of no interventions"),
    },
    setting! {
        "extra_conditions" "no-extra-conditions" "extra_conditions" settings.extra_conditions,
        help: "candoit: contexts of interventions join their variables as conditions, as published; without, it takes far fewer tests",
        expert: true, readers: Readers::Named(Reads::ExtraConditions, "has no contexts of interventions"),
    },
    setting! {
        "links" "links" "links" links,
        kind: Kind::File("toml"),
        help: "File with what is known of links: required, forbidden, directed (docs/data.md)",
        unset: "nothing is known", of_data: false,
        readers: Readers::Methods {
            read: |info| info.method.asks_for_p_values() && info.method != Method::Candoit,
            why: "does not read what is known of links",
            instead: None,
        },
    },
    setting! {
        "vectors" "vector" "vectors" vectors,
        kind: Kind::List("NAME=COLUMN+COLUMN"),
        help: "parcorrmult: variables of several columns, separated by commas, such as place=x+y",
    },
    setting! {
        "max_conds" "max-conds" "max_conds" settings.max_conds,
        kind: NUMBER,
        help: "Largest set of conditions in the condition selection (lpcmci: beyond those that are always there)",
        unset: "no limit", param_unset: "-1", expert: true, readers: Readers::Named(Reads::MaxConds, OF_CONDITIONS),
    },
    setting! {
        "max_sets" "max-sets" "max_sets" settings.max_sets,
        kind: NUMBER,
        help: "lpcmci, candoit: sets of conditions of one size that are tested for a pair, from each of its ends",
        unset: "all", param_unset: "0", expert: true, readers: Readers::Named(Reads::MaxSets, "has no such limit"),
    },
    setting! {
        "collider_rule" "collider-rule" "collider_rule" settings.pcmciplus.contemp_collider_rule,
        kind: Kind::Word(ColliderRule::NAMES),
        help: "pcmciplus, jpcmciplus: how colliders are found",
        expert: true, readers: Readers::Named(Reads::Orientation, OF_COLLIDERS),
    },
    setting! {
        "conflict_resolution" "first-orientation" "conflict_resolution" settings.pcmciplus.conflict_resolution,
        help: "pcmciplus, jpcmciplus: orientations that contradict each other are marked x-x; without, the first one stays",
        expert: true, readers: Readers::Named(Reads::Orientation, OF_COLLIDERS),
    },
    setting! {
        "significance" "significance" "significance" settings.test.significance,
        kind: Kind::Word(Significance::NAMES),
        help: "How a test gives its p-value; threshold: alpha is a threshold for the test's value",
        unset: "the test's own way", expert: true, readers: of_test(|_, _| true, ""),
    },
    setting! {
        "shuffles" "shuffles" "shuffles" settings.test.sig_samples,
        kind: SURROGATES, unit: "N", most_of_data: 10_000.0,
        help: "Surrogates of a shuffle test, or size of gpdc's null distribution, up to 1000000",
        unset: "500", param_unset: "0", expert: true, readers: of_test(draws, "draws no surrogates here"),
    },
    setting! {
        "sig_blocklength" "shuffle-block" "sig_blocklength" settings.test.sig_blocklength,
        kind: SURROGATES, unit: "rows",
        help: "Neighbouring rows that a shuffle test moves together",
        unset: "from the autocorrelation", param_unset: "0", expert: true,
        readers: of_test(
            |test, how| {
                test == "cmiknn" || (how == Some(Significance::ShuffleTest) && !["cmisymb", "regressionci"].contains(&test))
            },
            "shuffles no blocks here",
        ),
    },
    setting! {
        "shuffle_stop" "shuffle-stop" "shuffle_stop" settings.test.shuffle_stop,
        kind: SURROGATES, unit: "N",
        help: "cmiknn: end the surrogates of a test once so many reach its value; the p-value is then their share of those drawn",
        unset: "all are drawn", param_unset: "0", expert: true, readers: of_test(|test, _| test == "cmiknn", "has no such end"),
    },
    setting! {
        "knn" "knn" "knn" settings.test.knn,
        kind: Kind::Number(0.0, f64::INFINITY),
        help: "cmiknn: number of nearest neighbours; below 1, a fraction of the samples",
        expert: true, readers: OF_CMIKNN,
    },
    setting! {
        "shuffle_neighbors" "shuffle-neighbors" "shuffle_neighbors" settings.test.shuffle_neighbors,
        kind: Kind::Count(2, 1_000_000), unit: "N", most_of_data: 1000.0,
        help: "cmiknn: neighbours among the conditions with which a surrogate exchanges its value",
        expert: true, readers: OF_CMIKNN,
    },
    setting! {
        "transform" "transform" "transform" settings.test.transform,
        kind: Kind::Word(TRANSFORMS),
        help: "cmiknn: what values are turned into before distances are measured",
        expert: true, readers: OF_CMIKNN,
    },
    setting! {
        "gp_search" "gp-search" "gp_search" settings.test.gp_search,
        kind: Kind::Word(GpSearch::NAMES),
        help: "How gpdc searches for the maximum of a likelihood; exact: every likelihood exact, slow; the same maxima",
        expert: true, readers: OF_PROCESS,
    },
    setting! {
        "gp_restarts" "gp-restarts" "gp_restarts" settings.test.gp_restarts,
        kind: Kind::Count(0, 1000), unit: "N", most_of_data: 20.0,
        help: "Extra random restarts of gpdc's optimiser; the best is kept; 0: the reference's answers",
        expert: true, readers: OF_PROCESS,
    },
    setting! {
        "null_dist" "null-dist" "null_dist" settings.test.null_distributions,
        kind: Kind::File("csv"),
        help: "gpdc: null distributions to hold its values against, where the number of samples is one of theirs; columns separated by \
               commas, the first row has the numbers of samples",
        unset: "gpdc's own", expert: true, of_data: false,
        readers: of_test(|test, _| test == "gpdc", "makes its p-values in another way"),
    },
    setting! {
        "as_tigramite" "as-tigramite" "as_tigramite" settings.test.as_tigramite,
        help: "Answer as tigramite also where it is known to be wrong (docs/methods.md)",
        expert: true,
        readers: of_test(
            |test, _| ["gpdc", "parcorrwls", "regressionci"].contains(&test),
            "is not known to be wrong there",
        ),
    },
    setting! {
        "seed" "seed" "seed" settings.seed,
        kind: Kind::Count(0, u64::MAX),
        help: "Seed of all random numbers",
        group: Group::Seed,
    },
    setting! {
        "resamples" "resamples" "resamples" resampling.resamples,
        kind: Kind::Count(0, 10_000), unit: "N", most_of_data: 1000.0,
        help: "Repeat the analysis on N resamples, 20 to 10000, and report how often each link appears; 0: off. 100 give a frequency to \
               0.1. The analysis takes up to N times as long",
        group: Group::Resampling,
    },
    setting! {
        "resampling" "resampling" "resampling" resampling.scheme,
        kind: Kind::Word(Scheme::NAMES), unit: "scheme",
        help: "How rows are drawn: a share of them, each once, or as many as there are, with replacement",
        group: Group::Resampling,
    },
    setting! {
        "share" "share" "resample_share" resampling.share,
        kind: Kind::Number(0.0, 1.0),
        help: "Share of the rows in a subsample, between 0 and 1",
        group: Group::Resampling,
    },
    setting! {
        "block" "block" "resample_block" resampling.block,
        kind: Kind::Text, unit: "L",
        help: "Neighbouring rows that are drawn together: a number, or cube_root of the number of rows",
        group: Group::Resampling,
    },
    setting! {
        "threads" "threads" "threads" threads,
        kind: Kind::Count(0, 1024),
        help: "Threads of the analysis; 0: all cores. They do not change the result",
        group: Group::Run, of_data: false,
    },
    setting! {
        "time_budget" "time-budget" "time_budget" time_budget,
        kind: Kind::Number(0.0, f64::INFINITY), unit: "seconds",
        help: "Seconds after which to stop with a partial result (roll: with the windows that came to their end)",
        unset: "no limit", param_unset: "0", group: Group::Run, of_data: false,
    },
    setting! {
        "max_memory" "max-memory" "max_memory" settings.test.max_memory,
        kind: Kind::Bytes, unit: "MB",
        help: "Memory that a test, a program of cd_method_dir, or the command's reading of files may take; what needs more is refused",
        unset: "no limit; reading may take what is free", param_unset: "0", group: Group::Run, of_data: false,
    },
];

const LEVEL: Kind = Kind::Number(0.0, 1.0);
const NUMBER: Kind = Kind::Count(0, 1_000_000_000);
const SURROGATES: Kind = Kind::Count(0, 1_000_000);
