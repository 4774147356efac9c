//! The parameters of the discovery node.

use std::{
    path::{Path, PathBuf},
    sync::LazyLock,
};

use roscausal_discovery::{
    changes::Levels,
    confidence::Resampling,
    methods::{Method, default_intervention_targets},
    settings::{Kind, Request, SETTINGS, Setting},
};

use super::regime::RollParams;
use crate::{
    Error, Result,
    batch::{IdFormat, joint::People},
    bounded, external, param_specs,
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
    /// What is asked of an analysis.
    pub request: Request,
    /// The file of what is known of links.
    pub links: Option<PathBuf>,
    /// The program of an external method.
    pub program: Option<PathBuf>,
    pub people: People,
    pub batches_per_model: usize,
    pub keep_batches: bool,
    pub analyse_incomplete: bool,
    pub max_pool_size: usize,
    pub max_attempts: u32,
    pub nice: i32,
    pub image_scale: f32,
    /// How to resample; `None`: not.
    pub resampling: Option<Resampling>,
    /// How to roll; `None`: each model is of its own batches.
    pub rolling: Option<RollParams>,
}

/// What a running node keeps: where files and programs are, and what its regime rests on. All else it takes anew, from the next batch
/// on.
const FIXED: [&str; 15] = [
    "data_dir", "res_dir", "csv_prefix", "id_format", "cd_method_dir", "null_dist", "links", "people",
    "keep_batches", "window_batches", "window_samples", "detect_changes", "change_rows", "suspect_level",
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
    let of_node = param_specs! {
        "data_dir" = text("~/roscausal/pp_pool"), Any, "folder to watch for batches";
        "res_dir" = text(""), Any, "folder for model files; empty: only publish";
        "csv_prefix" = text("data_"), Any, "prefix of the batches' file names";
        "id_format" = text("%Y%m%d_%H%M%S"), Any,
            "strftime format of the batches' ids, by which the oldest is found";
        "cd_method_dir" = text(""), Any, "folder of external methods (programs)";
        "people" = text("pooled"), OneOf(People::NAMES),
            "models for several people: one of all people, as recordings of one system; one each; both; or one with \
             everybody's variables";
        "batches_per_model" = Int(1), Range(1.0, 1000.0), "number of batches analysed together for one model";
        "keep_batches" = Bool(false), Any, "move analysed batches to analysed/ instead of deleting them";
        "analyse_incomplete" = Bool(false), Any, "analyse batches whose recording was cut short";
        "max_pool_size" = Int(0), Range(0.0, 1e6),
            "most batches that wait; the oldest are deleted; 0: no limit";
        "max_attempts" = Int(3), Range(1.0, 1000.0),
            "number of attempts to analyse a batch before it is rejected";
        "nice" = Int(0), Range(0.0, 19.0), "priority of an analysis as in nice(1): 0 normal, 19 lowest";
        "window_batches" = Int(1), Range(1.0, 1000.0),
            "most batches of a model, the newest of the present regime; a model for each new one; 1: of it alone";
        of_data "window_samples" = Int(2000), Range(0.0, 1e9),
            "most samples of such a model, but one batch at least; 0: no limit";
        of_data "detect_changes" = text("auto"), OneOf(&DETECT),
            "tell when a mechanism changes, on /roscausal/model_changes; auto: if window_batches is above 1";
        of_data "change_rows" = Int(0), Range(0.0, 1e6),
            "rows that are compared with the regime at a time, more for many variables; 0: each batch as a whole";
        of_data "suspect_level" = Double(Levels::default().suspect), Range(1e-9, 0.999),
            "level at which a change is suspected, corrected for the number of links";
        of_data "confirm_level" = Double(Levels::default().confirm), Range(1e-9, 0.999),
            "level at which a suspected change is confirmed";
        "image_scale" = Double(0.6), Range(0.1, 4.0), "pixels per unit of the published pictures";
    };
    of_node.into_iter().chain(OF_SETTINGS.iter().cloned()).collect()
}

/// The settings of an analysis as parameters. They stay for as long as the program runs, and so do their texts.
static OF_SETTINGS: LazyLock<Vec<ParamSpec>> = LazyLock::new(|| SETTINGS.iter().map(spec_of).collect());

fn spec_of(setting: &'static Setting) -> ParamSpec {
    let default = match setting.id {
        "acts_on" => {
            default_intervention_targets().iter().map(|(column, of)| format!("{column}={of}")).collect()
        }
        _ => setting.default_value(),
    };
    let default = setting.as_param(&default);
    let number = || default.parse::<f64>().unwrap_or_default();
    let int = || Value::Int(number() as i64);
    let range = |least: f64, most: f64| Allowed::Range(number().min(least), most);
    // A level is neither 0 nor 1.
    let between = |least: f64, most: f64| match most {
        1.0 => range(1e-9, 0.999),
        most => range(least, most.min(1e9)),
    };
    let (value, allowed) = match setting.kind {
        Kind::Flag => (Value::Bool(default == "true"), Allowed::Any),
        // The largest whole number that is a number without loss, but for a few.
        Kind::Count(least, most) => (int(), range(least as f64, (most as f64).min(9e15))),
        Kind::Lag => (int(), range(0.0, 100_000.0)),
        Kind::Bytes => (int(), range(0.0, 1e9)),
        Kind::Number(least, most) | Kind::NumberOr(least, most, _) => {
            (Value::Double(number()), between(least, most))
        }
        Kind::Word(words) if !setting.default_value().is_null() => {
            (Value::Str(default), Allowed::OneOf(words))
        }
        Kind::Word(_) | Kind::Method | Kind::Test | Kind::Text | Kind::File(_) => {
            (Value::Str(default), Allowed::Any)
        }
        Kind::List(_) => {
            let items = default.split(',').filter(|item| !item.is_empty());
            (Value::List(items.map(|item| Value::Str(item.to_owned())).collect()), Allowed::Any)
        }
    };
    let spec = ParamSpec::new(setting.param, value, allowed, described(setting).leak());
    ParamSpec { of_data: setting.of_data, ..spec }
}

/// What a setting is, in one line: what it takes, and what its value for "not set" means.
fn described(setting: &Setting) -> String {
    let words = match setting.kind {
        // The range names them.
        Kind::Word(_) if !setting.default_value().is_null() => String::new(),
        Kind::Method => format!("{}, or a program in cd_method_dir", setting.kind.words().join(", ")),
        kind => kind.words().join(", "),
    };
    let words = if words.is_empty() { words } else { format!(": {words}") };
    let unset = match (setting.unset, setting.param_unset, setting.by_method) {
        ("", ..) => String::new(),
        (_, "", _) if setting.id == "acts_on" => String::new(),
        (what, "", _) => format!("; empty: {what}"),
        (what, value, None) => format!("; {value}: {what}"),
        (what, value, Some(_)) => format!("; {value}: {what} ({}); 0: auto", setting.default_words()),
    };
    let unit = if setting.kind == Kind::Bytes { "; megabytes" } else { "" };
    format!("{}{words}{unit}{unset}", setting.help)
}

/// The file of what is known of links.
fn links_of(params: &Params) -> Option<PathBuf> {
    params.text_if_set("links").map(|file| super::path(&file))
}

/// What the parameters say of an analysis.
fn request_of(params: &Params, program: bool) -> Result<Request> {
    let mut given = Vec::new();
    for setting in &SETTINGS {
        let text = params.text(setting.param);
        // A program is not a method that is known here. The usual effects count as far as their columns are there.
        let usual = |spec: &ParamSpec| spec.name == setting.param && spec.default.to_string() == text;
        let is_usual = setting.id == "acts_on" && OF_SETTINGS.iter().any(usual);
        if (program && setting.id == "method") || is_usual {
            continue;
        }
        let value = match setting.kind {
            Kind::File(_) if text.is_empty() => continue,
            Kind::File(ending) => bounded::read_setting(&super::path(&text), ending)?.into(),
            _ => setting.of_param(&text).map_err(|reason| Error::param(setting.id, reason))?,
        };
        // A parameter always has a value; its default is not the user's.
        if setting.by_method.is_none() && value == setting.default_value() {
            continue;
        }
        given.push((setting, value));
    }
    Request::of(&given).map_err(|error| Error::of_rules(error, links_of(params)))
}

impl DiscoveryParams {
    pub(super) fn new(params: &Params) -> Result<Self> {
        let named = params.text("cd_method");
        let (method, program) = match (named.parse(), params.text_if_set("cd_method_dir")) {
            (Ok(method), _) => (method, None),
            (Err(_), Some(dir)) => (Method::default(), Some(external::program(Path::new(&dir), &named)?)),
            (Err(error), None) => return Err(error.into()),
        };
        let mut request = request_of(params, program.is_some())?;
        request.settings.method = method;
        if program.is_none() {
            request.check()?;
        }
        let resampling = request.resampling()?;
        let reason = "external methods are not resampled; set it to 0";
        Error::ensure(resampling.is_none() || program.is_none(), "resamples", || reason)?;
        let rolling = rolling_of(params);
        let reason = "external methods, windows and changes take each column for a variable; leave it empty";
        let by_column = program.is_some() || rolling.is_some();
        Error::ensure(request.vectors.is_empty() || !by_column, "vectors", || reason)?;
        if rolling.is_some() && params.count("batches_per_model") > 1 {
            let reason = "with window_batches or detect_changes each batch gives a model; set it to 1";
            return Err(Error::param("batches_per_model", reason));
        }
        Ok(Self {
            resampling,
            rolling,
            data_dir: super::path(&params.text("data_dir")),
            res_dir: params.text_if_set("res_dir").map(|dir| super::path(&dir)),
            csv_prefix: params.text("csv_prefix"),
            ids: IdFormat::new(&params.text("id_format"))?,
            request,
            links: links_of(params),
            program,
            people: params.text("people").parse()?,
            batches_per_model: params.count("batches_per_model"),
            keep_batches: params.flag("keep_batches"),
            analyse_incomplete: params.flag("analyse_incomplete"),
            max_pool_size: params.count("max_pool_size"),
            max_attempts: params.count("max_attempts") as u32,
            nice: params.int("nice") as i32,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loopback::Loopback;

    #[test]
    fn every_setting_is_a_parameter_and_its_default_asks_for_the_default() {
        let specs = specs();
        for setting in &SETTINGS {
            assert!(specs.iter().any(|spec| spec.name == setting.param), "{}", setting.param);
        }
        let usual = checked(&[]).expect("the defaults").request;
        assert_eq!(usual, Request::default());
        let described = |name: &str| specs.iter().find(|spec| spec.name == name).expect(name).description;
        assert!(Method::names().all(|name| described("cd_method").contains(name)));
    }

    #[test]
    fn what_is_known_of_links_is_a_file() {
        let dir = tempfile::tempdir().expect("a folder");
        let file = dir.path().join("links.toml");
        std::fs::write(&file, "[[link]]\ncause = '*'\neffect = 'weather'\nis = 'forbidden'\n")
            .expect("writes");
        let links = |file: &Path| checked(&[("links", Value::Str(file.display().to_string()))]);
        let rules = links(&file).expect("rules").request.links.expect("rules");
        let names = ["h_v", "weather"].map(str::to_owned);
        let known = rules.for_variables(&names, [1, 1], &[]).expect("fit");
        assert!(known.get(0, 1, 1).is_none() && known.get(1, 0, 1).is_some());
        std::fs::write(&file, "[[link]]\ncause = 'a'\n").expect("writes");
        let error = links(&file).err().expect("no rule").to_string();
        assert!(error.contains("links.toml: line 1") && error.contains("effect"), "{error}");
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
            params.request.settings.test.null_distributions.and_then(|given| given.share_above(248, 0.15)),
            Some(0.5)
        );
        let params = checked(&[place.clone(), pcmci.clone(), mult.clone()]).expect("a vector");
        assert_eq!(params.request.vectors, [("place".to_owned(), vec!["h_x".to_owned(), "h_y".to_owned()])]);
        for (given, says) in [
            (vec![null, ("cond_ind_test", word("parcorr"))], "null_dist"),
            (vec![("null_dist", word("/nowhere/null.csv"))], "/nowhere/null.csv"),
            (vec![place.clone(), pcmci.clone()], "choose cond_ind_test parcorrmult"),
            (vec![place.clone(), mult.clone()], "fpcmci takes each variable"),
            (
                vec![place.clone(), mult.clone(), ("cd_method", word("granger"))],
                "granger takes each variable",
            ),
            (vec![place, pcmci, mult, ("window_batches", Value::Int(3))], "windows and changes"),
            (vec![("vectors", Value::List(vec![word("place")]))], "'place' is not a vector"),
        ] {
            let error = checked(&given).err().expect(says).to_string();
            assert!(error.contains(says) && error.lines().count() == 1, "{says}: {error}");
        }
    }

    #[test]
    fn the_exogenous_variables_are_those_that_the_user_names() {
        let weather = Value::List(vec![Value::Str("weather".into())]);
        let named = |given: &[(&str, Value)]| checked(given).expect("allowed").request.settings.exogenous;
        assert_eq!(named(&[("exogenous", weather)]), ["weather"]);
        assert!(named(&[]).is_empty());
    }

    #[test]
    fn a_parameter_that_is_set_and_not_read_is_refused_with_those_who_read_it() {
        let word = |text: &str| Value::Str(text.to_owned());
        let method = ("cd_method", word("granger"));
        let effect = Value::List(vec![word("do_a=a")]);
        for (name, value, says) in [
            ("pc_alpha", Value::Double(0.1), "it applies to fpcmci, pcmci, "),
            ("f_alpha", Value::Double(0.1), "it applies to fpcmci"),
            ("te_estimator", word("gaussian"), "it applies to fpcmci"),
            ("acts_on", effect, "it applies to candoit"),
            ("gp_restarts", Value::Int(2), "it applies to the test gpdc"),
        ] {
            let error = checked(&[method.clone(), (name, value)]).err().expect(name).to_string();
            assert!(error.contains(&format!("'{name}'")) && error.contains(says), "{error}");
        }
        // The defaults are not given.
        let usual =
            default_intervention_targets().iter().map(|(of, sets)| word(&format!("{of}={sets}"))).collect();
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
