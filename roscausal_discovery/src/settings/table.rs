//! The table of settings. A new one is a field of [`Settings`](super::Settings) or [`Request`](super::Request) and an entry here.

use serde_json::Value;

use super::{
    Group, Kind, Readers, Setting,
    plain::{self, Plain},
    scheme::Scheme,
    typed::Levels,
};
use crate::{
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
    auto: "",
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

/// For each setting: the name in Rust and Python, the flag, the node's parameter, where the value is kept; what it holds; what it is; and
/// what differs from [`USUAL`].
macro_rules! settings {
    ($($id:literal $flag:literal $param:literal $($field:ident).+ = $kind:expr, $help:literal $(, $key:ident: $value:expr)*;)+) => {
        /// All settings of an analysis, in the order in which they are listed.
        pub static SETTINGS: [Setting; [$($id),+].len()] = [$(Setting {
            id: $id,
            flag: $flag,
            param: $param,
            get: |request| request.$($field).+.json(),
            set: |request, value| plain::read(&mut request.$($field).+, value),
            kind: $kind,
            help: $help,
            $($key: $value,)*
            ..USUAL
        }),+];
    };
}

/// Settings of one test.
const fn of_test(test: fn(&str, Option<Significance>) -> bool, why: &'static str) -> Readers {
    Readers::Tests { method: Method::uses_p_values, test, why }
}

/// Settings of GPDC's regressions, which TiMINo takes, too.
const OF_PROCESS: Readers = Readers::Tests {
    method: |method| method.info().uses_test,
    test: |test, _| test == "gpdc",
    why: "fits no Gaussian process",
};
const OF_CMIKNN: Readers = of_test(|test, _| test == "cmiknn", "has no nearest neighbours");
const OF_FILTER: &str = "has no filter";
const OF_CONDITIONS: &str = "chooses no conditions";
const OF_COLLIDERS: &str = "has no colliders at lag 0";

fn shuffles_blocks(test: &str, how: Option<Significance>) -> bool {
    test == "cmiknn"
        || (how == Some(Significance::ShuffleTest) && !["cmisymb", "regressionci"].contains(&test))
}

const LEVEL: Kind = Kind::Number(0.0, 1.0);
const NUMBER: Kind = Kind::Count(0, 1_000_000_000);
const SURROGATES: Kind = Kind::Count(0, 1_000_000);

settings! {
    "method" "method" "cd_method" settings.method = Kind::Method,
        "Discovery method",
        auto: "says which to choose for these data and why";
    "test" "test" "cond_ind_test" settings.cond_ind_test = Kind::Test,
        "Independence test",
        by_method: Some(|info| info.test.to_owned());
    "alpha" "alpha" "sig_alpha" settings.alpha = LEVEL,
        "Significance level of a link, in (0, 1); where a method has one level only, that",
        readers: Readers::Methods {
            read: |info| !info.one_level && info.p_values,
            why: "has one level, that of the condition selection",
            instead: Some("pc_alpha"),
        };
    "pc_alpha" "pc-alpha" "pc_alpha" settings.pc_alpha = Kind::NumberOr(0.0, 1.0, "auto"),
        "Significance level of the condition selection, in (0, 1); auto: chosen by a score",
        unset: "the method's own", param_unset: "-1", by_method: Some(|info| info.pc_alpha.to_string()),
        readers: Readers::Named(Reads::PcAlpha, OF_CONDITIONS);
    "tau_min" "tau-min" "min_lag" settings.tau_min = Kind::Lag,
        "Smallest lag, in steps",
        unit: "steps", most_of_data: 200.0, by_method: Some(|info| info.tau_min.to_string());
    "tau_max" "tau-max" "max_lag" settings.tau_max = Kind::Lag,
        "Largest lag, in steps; at most 100000",
        unit: "steps", most_of_data: 200.0, auto: "as far as dependence is seen";
    "f_alpha" "f-alpha" "f_alpha" settings.f_alpha = LEVEL,
        "Significance level of F-PCMCI's filter",
        unset: "the level of a link", param_unset: "0", readers: Readers::Named(Reads::FAlpha, OF_FILTER);
    "te_estimator" "te-estimator" "te_estimator" settings.te_estimator = Kind::Word(TeEstimator::NAMES),
        "Estimator of F-PCMCI's filter; auto: gaussian for a linear test, else gaussian+dcor",
        readers: Readers::Named(Reads::TeEstimator, OF_FILTER);
    "neglect_only_autodep" "keep-autodep" "neglect_only_autodep" settings.neglect_only_autodep = Kind::Flag,
        "F-PCMCI's filter drops variables that depend on their own past only",
        expert: true, readers: Readers::Named(Reads::NeglectOnlyAutodep, OF_FILTER);
    "fdr" "fdr" "fdr_method" settings.fdr = Kind::Word(Fdr::NAMES),
        "Correction for multiple testing",
        readers: Readers::Named(Reads::Fdr, "has no p-values of single tests to correct");
    "exogenous" "exogenous" "exogenous" settings.exogenous = Kind::List("COLUMN"),
        "Columns that may be causes only (interventions, context), separated by commas";
    "acts_on" "acts-on" "acts_on" settings.acts_on = Kind::List("COLUMN=VARIABLE"),
        "candoit: columns of interventions and the variable that each sets, separated by commas",
        unset: "do_robot_speed=r_v, do_robot_off=r_v, do_human_v=h_v, do_human_stop=h_v, as far as they are there",
        readers: Readers::Named(Reads::ActsOn, "knows of no interventions");
    "extra_conditions" "no-extra-conditions" "extra_conditions" settings.extra_conditions = Kind::Flag,
        "candoit: contexts of interventions join their variables as conditions, as published; without, it takes far fewer tests",
        expert: true, readers: Readers::Named(Reads::ExtraConditions, "has no contexts of interventions");
    "levels" "levels" "levels" settings.levels = Kind::Word(Levels::NAMES),
        "Level and scale of each recording: auto takes them out where recordings differ, so that this makes no link; keep, remove. Batches \
         of one run have one level",
        readers: Readers::Methods {
            read: |info| !matches!(info.method, Method::Jpcmciplus | Method::Candoit),
            why: "compares recordings itself",
            instead: None,
        };
    "links" "links" "links" links = Kind::File("toml"),
        "File with what is known of links: required, forbidden, directed (docs/data.md)",
        unset: "nothing is known", of_data: false,
        readers: Readers::Methods {
            read: |info| info.method.uses_p_values() && info.method != Method::Candoit,
            why: "does not read what is known of links",
            instead: None,
        };
    "vectors" "vector" "vectors" vectors = Kind::List("NAME=COLUMN+COLUMN"),
        "parcorrmult: variables of several columns, separated by commas, such as place=x+y";
    "max_conds" "max-conds" "max_conds" settings.max_conds = NUMBER,
        "Largest set of conditions in the condition selection (lpcmci: beyond those that are always there)",
        unset: "no limit", param_unset: "-1", expert: true, readers: Readers::Named(Reads::MaxConds, OF_CONDITIONS);
    "max_sets" "max-sets" "max_sets" settings.max_sets = NUMBER,
        "lpcmci, candoit: sets of conditions of one size that are tested for a pair, from each of its ends",
        unset: "all", param_unset: "0", expert: true, readers: Readers::Named(Reads::MaxSets, "has no such limit");
    "collider_rule" "collider-rule" "collider_rule" settings.pcmciplus.contemp_collider_rule = Kind::Word(ColliderRule::NAMES),
        "pcmciplus, jpcmciplus: how colliders are found",
        expert: true, readers: Readers::Named(Reads::Orientation, OF_COLLIDERS);
    "conflict_resolution" "first-orientation" "conflict_resolution" settings.pcmciplus.conflict_resolution = Kind::Flag,
        "pcmciplus, jpcmciplus: orientations that contradict each other are marked x-x; without, the first one stays",
        expert: true, readers: Readers::Named(Reads::Orientation, OF_COLLIDERS);
    "significance" "significance" "significance" settings.test.significance = Kind::Word(Significance::NAMES),
        "How a test gives its p-value; threshold: alpha is a threshold for the test's value",
        unset: "the test's own way", expert: true, readers: of_test(|_, _| true, "");
    "shuffles" "shuffles" "shuffles" settings.test.sig_samples = SURROGATES,
        "Surrogates of a shuffle test, or size of gpdc's null distribution, up to 1000000",
        unit: "N", most_of_data: 10_000.0, unset: "500; gpdc: no table", param_unset: "0", expert: true,
        readers: of_test(draws, "draws no surrogates here");
    "sig_blocklength" "shuffle-block" "sig_blocklength" settings.test.sig_blocklength = SURROGATES,
        "Neighbouring rows that a shuffle test moves together",
        unit: "rows", unset: "from the autocorrelation", param_unset: "0", expert: true,
        readers: of_test(shuffles_blocks, "shuffles no blocks here");
    "shuffle_stop" "shuffle-stop" "shuffle_stop" settings.test.shuffle_stop = SURROGATES,
        "cmiknn: end the surrogates of a test once so many reach its value; the p-value is then their share of those drawn",
        unit: "N", unset: "all are drawn", param_unset: "0", expert: true, readers: of_test(|test, _| test == "cmiknn", "has no such end");
    "knn" "knn" "knn" settings.test.knn = Kind::Number(0.0, f64::INFINITY),
        "cmiknn: number of nearest neighbours; below 1, a fraction of the samples",
        expert: true, readers: OF_CMIKNN;
    "shuffle_neighbors" "shuffle-neighbors" "shuffle_neighbors" settings.test.shuffle_neighbors = Kind::Count(2, 1_000_000),
        "cmiknn: neighbours among the conditions with which a surrogate exchanges its value",
        unit: "N", most_of_data: 1000.0, expert: true, readers: OF_CMIKNN;
    "transform" "transform" "transform" settings.test.transform = Kind::Word(TRANSFORMS),
        "cmiknn: what values are turned into before distances are measured",
        expert: true, readers: OF_CMIKNN;
    "categories" "categories" "categories" settings.test.categories = Kind::List("COLUMN"),
        "Variables whose values are categories, whatever they are; without, those of at most ten whole values are",
        readers: of_test(|test, _| ["regressionci", "gsquared", "cmisymb"].contains(&test), "has no categories");
    "gp_search" "gp-search" "gp_search" settings.test.gp_search = Kind::Word(GpSearch::NAMES),
        "How gpdc searches for the maximum of a likelihood; exact: every likelihood exact, slow; the same maxima",
        expert: true, readers: OF_PROCESS;
    "gp_restarts" "gp-restarts" "gp_restarts" settings.test.gp_restarts = Kind::Count(0, 1000),
        "Extra random restarts of gpdc's optimiser; the best is kept; 0: the reference's answers",
        unit: "N", most_of_data: 20.0, expert: true, readers: OF_PROCESS;
    "null_dist" "null-dist" "null_dist" settings.test.null_distributions = Kind::File("csv"),
        "gpdc: null distributions to hold its values against, where the number of samples is one of theirs; columns separated by commas, \
         the first row has the numbers of samples",
        unset: "gpdc's own", expert: true, of_data: false, readers: of_test(|test, _| test == "gpdc", "makes its p-values in another way");
    "as_tigramite" "as-tigramite" "as_tigramite" settings.test.as_tigramite = Kind::Flag,
        "Answer as tigramite also where it is known to be wrong, pool recordings as they are, and look for nothing else \
         (docs/methods.md)",
        expert: true;
    "seed" "seed" "seed" settings.seed = Kind::Count(0, u64::MAX),
        "Seed of all random numbers",
        group: Group::Seed;
    "resamples" "resamples" "resamples" resampling.resamples = Kind::Count(0, 10_000),
        "Repeat the analysis on N resamples, 20 to 10000, and report how often each link appears; 0: off. 100 give a frequency to 0.1. \
         The analysis takes up to N times as long",
        unit: "N", most_of_data: 1000.0, group: Group::Resampling;
    "resampling" "resampling" "resampling" resampling.scheme = Kind::Word(Scheme::NAMES),
        "How rows are drawn: a share of them, each once, or as many as there are, with replacement",
        unit: "scheme", group: Group::Resampling;
    "share" "share" "resample_share" resampling.share = Kind::Number(0.0, 1.0),
        "Share of the rows in a subsample, between 0 and 1",
        group: Group::Resampling;
    "block" "block" "resample_block" resampling.block = Kind::Text,
        "Neighbouring rows that are drawn together: a number, or cube_root of the number of rows",
        unit: "L", group: Group::Resampling;
    "threads" "threads" "threads" threads = Kind::Count(0, 1024),
        "Threads of the analysis; 0: all cores. They do not change the result",
        group: Group::Run, of_data: false;
    "time_budget" "time-budget" "time_budget" time_budget = Kind::Number(0.0, f64::INFINITY),
        "Seconds after which to stop with a partial result (roll: with the windows that came to their end)",
        unit: "seconds", unset: "no limit", param_unset: "0", group: Group::Run, of_data: false;
    "max_memory" "max-memory" "max_memory" settings.test.max_memory = Kind::Bytes,
        "Memory that a test, a program of cd_method_dir, or the command's reading of files may take; what needs more is refused",
        unit: "MB", unset: "no limit; reading may take what is free", param_unset: "0", group: Group::Run, of_data: false;
}
