//! The parameters of the data node.

use std::time::Duration;

use serde_json::{Map, Value as Json, json};

use super::{path, scene_params::risk_specs};
use crate::{
    Error, Result,
    batch::{
        Field, IdFormat, Sampling, Select,
        pool::{Limits, Pool},
        postprocess::{Feature, Obstacle, Postprocess},
        recorder::RecorderConfig,
        risk::RiskModel,
        script::Script,
        writer::{Processing, WriterConfig},
    },
    param_specs,
    params::{Allowed, ParamSpec, Params, Value},
    signal::{Definitions, Signal, Signals},
};
use roscausal_discovery::names::plain;

/// Parameters that say where files are, not what is in them.
const PLACES: [&str; 8] = [
    "msg_path", "data_dir", "pp_data_dir", "pp_script_dir", "max_pool_size", "max_pool_bytes", "pool_policy",
    "journal",
];

/// Names, defaults, allowed values and descriptions.
pub(super) fn specs() -> Vec<ParamSpec> {
    use Allowed::{Any, OneOf, Range};
    use Value::{Bool, Double, Int, List, Str};
    let text = |text: &str| Str(text.to_owned());
    let names = ["h_v", "h_dg", "h_risk"].map(text).to_vec();
    let first = param_specs! {
        "data_dir" = text("~/roscausal/data_pool"), Any, "folder of raw batches";
        "pp_data_dir" = text("~/roscausal/pp_pool"), Any, "folder of post-processed batches";
        of_data "postprocess" = text("auto"), OneOf(&["auto", "builtin", "script", "none"]),
            "who post-processes; auto: pp_script if given, otherwise builtin; none: nobody, raw batches are the result";
        "pp_script_dir" = text(""), Any, "folder of pp_script";
        "pp_script" = text(""), Any, "program that post-processes a raw batch; empty: none";
        "pp_time_limit" = Double(60.0), Range(0.1, 86400.0), "seconds that pp_script may take";
        of_data live "ts_length" = Double(150.0), Any,
            "length of a batch in seconds; empty or 0: until the end";
        of_data "dt" = Double(0.1), Range(0.001, 60.0), "step between rows in seconds";
        of_data "sampling" = text("auto"), OneOf(Sampling::NAMES),
            "what a row holds: linear: what lies between the samples before and after it; hold: the newest sample that is not later; auto: hold where samples come two and a half times a row or more often, the nearest sample where they come about once, else linear";
        of_data "subsampling" = Bool(false), Any, "older name: true is the sampling hold";
        of_data "max_gap" = Double(0.5), Range(0.001, 60.0),
            "samples farther apart than this are a gap; the largest age of a held sample; seconds";
        "id_format" = text("%Y%m%d_%H%M%S"), Any, "strftime format of a batch's id, UTC";
        "csv_prefix" = text("data_"), Any, "prefix of the batches' file names";
        "max_pool_size" = Int(0), Range(0.0, 1e9),
            "most batches in data_dir, and in pp_data_dir; 0: no limit";
        "max_pool_bytes" = Int(0), Range(0.0, 9e15),
            "most bytes of batches in data_dir, and in pp_data_dir; 0: no limit";
        "pool_policy" = text("drop_oldest"), OneOf(&["drop_oldest", "stop_recording"]),
            "what to do when a pool is full";
        "journal" = Bool(true), Any,
            "also keep the open batch on disk, so that a crash costs at most about a second of it";
        of_data "legacy_columns" = Bool(false), Any, "raw columns as ROS-Causal 1.1 spells them";
        of_data "sel_agent" = text("1000"), Any,
            "who is recorded: an id, ids (3,7), nearest:N, all; nobody: only robot and signals";
        of_data "robot" = text(""), Any, "name of the robot, the namespace of its topics; empty: none";
        of_data "other_robots" = List(Vec::new()), Any,
            "names of other robots to record, such as robot2,robot3";
        of_data "context_topic" = text("/hri/interventions"), Any,
            "std_msgs/String with interventions, which are recorded as columns; empty: none";
        of_data "obstacle" = text("robot"), OneOf(Obstacle::NAMES),
            "what a person may collide with; nearest: the nearest of all recorded robots and people";
    };
    let rest = param_specs! {
        "delete_traj" = Bool(false), Any, "delete a raw batch once it is post-processed";
        of_data "risk_model" = text("v1_1"), OneOf(RiskModel::NAMES), "version of the risk";
        of_data "risk_lag" = Int(0), Range(0.0, 1.0), "rows by which risk(...) is lagged";
        of_data "risk_noise" = Double(0.0), Range(0.0, 10.0),
            "standard deviation of the noise on the risk's exponent";
        of_data "seed" = Int(0), Range(0.0, 9e15), "seed of that noise";
        of_data "feature_names" = List(names), Any,
            "names of the speed, the distance to the goal, and the risk";
        of_data "features" = List(Vec::new()), Any,
            "more features, each 'name = expression' (docs/data.md), such as r_v = r.v; one with the name of a usual one replaces it";
        of_data "features_only" = List(Vec::new()), Any, "features in the place of the usual three";
        of_data "signals" = List(Vec::new()), Any,
            "numbers of any topic as variables, each 'name = /topic.field' (docs/signals.md)";
        of_data "signal_max_age" = Double(2.0), Range(0.001, 1e9),
            "seconds for which a signal's last value counts, unless the signal says hold(..., seconds)";
        "msg_path" = text(""), Any,
            "folders of .msg files (PACKAGE/msg/NAME.msg), separated by ':', for types of signals; searched before the ROS \
             installation (AMENT_PREFIX_PATH)";
    };
    [first, risk_specs(), rest].concat()
}

/// How to record.
pub(super) fn recorder(params: &Params) -> Result<RecorderConfig> {
    let (dt_s, max_gap_s, length) =
        (params.double("dt"), params.double("max_gap"), params.double("ts_length"));
    if max_gap_s < dt_s && params.double("max_gap") != 0.5 {
        let reason = format!("{max_gap_s} is shorter than dt ({dt_s}); give at least dt");
        return Err(Error::param("max_gap", reason));
    }
    let ts_length_s = match length {
        length if length.is_nan() || length == 0.0 => None,
        length if length >= dt_s && length <= 1e7 => Some(length),
        length => {
            let reason = format!(
                "{length} is not allowed; give at least dt ({dt_s}) and at most 1e7, or 0: until the end"
            );
            return Err(Error::param("ts_length", reason));
        }
    };
    let select: Select =
        params.text("sel_agent").parse().map_err(|reason| Error::param("sel_agent", reason))?;
    let sampling =
        if params.flag("subsampling") { Sampling::Hold } else { params.text("sampling").parse()? };
    Ok(RecorderConfig { dt_s, ts_length_s, max_gap_s, sampling, select })
}

/// The signals to record.
pub(super) fn signals(params: &Params) -> Result<Signals> {
    let signals = Signal::parse_all(&params.list("signals"), params.double("signal_max_age"), "signals")?;
    let fault = |reason: String| Err(Error::param("signals", reason));
    let features = features(params)?;
    let only_signals = params.text("sel_agent").parse() == Ok(Select::Nobody);
    for signal in &signals {
        let name = &signal.name;
        let is_of_person =
            name.strip_prefix("h_").is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
        let is_of_robot = Field::ALL.iter().any(|field| *name == format!("r_{}", field.name()));
        if !only_signals && (is_of_person || is_of_robot) {
            return fault(format!("'{name}' is a column of the batch already; choose another name"));
        }
        if features.iter().any(|feature| plain(&feature.name) == *name) {
            return fault(format!("'{name}' is a feature, too; choose another name"));
        }
    }
    let reason = "nobody: there is nothing to record; give signals or features";
    Error::ensure(!signals.is_empty() || !features.is_empty(), "sel_agent", || reason)?;
    Ok(Signals::new(signals, Definitions::of(&params.text("msg_path"))))
}

/// The features; none of the paper's where nobody is recorded.
fn features(params: &Params) -> Result<Vec<Feature>> {
    let (more, only) = (params.list("features"), params.list("features_only"));
    let nobody = params.text("sel_agent").parse() == Ok(Select::Nobody);
    let usual = match only.is_empty() {
        true if nobody => Vec::new(),
        true => Feature::defaults(&params.list("feature_names"))?,
        false => Feature::parse("features_only", &only)?,
    };
    let more = Feature::parse("features", &more)?;
    let is_new = |one: &Feature| more.iter().all(|other| plain(&other.name) != plain(&one.name));
    Ok(usual.into_iter().filter(is_new).chain(more.iter().cloned()).collect())
}

/// Where and how batches are written.
pub(super) fn writer(params: &Params) -> Result<WriterConfig> {
    let (prefix, ids) = (params.text("csv_prefix"), IdFormat::new(&params.text("id_format"))?);
    let (raw, processed) = (path(&params.text("data_dir")), path(&params.text("pp_data_dir")));
    let processing = processing(params)?;
    let reason = "it is data_dir too; give each its own folder";
    Error::ensure(raw != processed || matches!(processing, Processing::None), "pp_data_dir", || reason)?;
    Ok(WriterConfig {
        raw: Pool::open(raw, &prefix)?.with_id_format(ids.clone()),
        processed: Pool::open(processed, &prefix)?.with_id_format(ids),
        legacy_columns: params.flag("legacy_columns"),
        delete_raw: params.flag("delete_traj"),
        processing,
        parameters: noted(params),
        limits: Limits {
            max_batches: params.count("max_pool_size"),
            max_bytes: params.int("max_pool_bytes").unsigned_abs(),
            drop_oldest: params.text("pool_policy") == "drop_oldest",
        },
        journal: params.flag("journal"),
    })
}

fn processing(params: &Params) -> Result<Processing> {
    let script = params.text("pp_script");
    Ok(match params.text("postprocess").as_str() {
        "none" => Processing::None,
        "builtin" => Processing::BuiltIn(built_in(params)?),
        "auto" if script.is_empty() => Processing::BuiltIn(built_in(params)?),
        _ => {
            let limit = Duration::from_secs_f64(params.double("pp_time_limit"));
            let script = Script::new(&path(&params.text("pp_script_dir")), &script, limit)?;
            let (obs_size, safe_dist) = (params.double("obs_size"), params.double("safe_dist"));
            let (sel_agent, delete_traj) = (params.text("sel_agent"), params.flag("delete_traj"));
            Processing::Script(script.with_arguments(obs_size, safe_dist, &sel_agent, delete_traj))
        }
    })
}

/// The built-in post-processing with these parameters.
///
/// # Errors
/// A parameter that is not allowed.
pub(super) fn built_in(params: &Params) -> Result<Postprocess> {
    Ok(Postprocess {
        risk_model: params.text("risk_model").parse()?,
        risk_lag: params.count("risk_lag"),
        risk_noise: params.double("risk_noise"),
        seed: params.int("seed").unsigned_abs(),
        obs_size: params.double("obs_size"),
        safe_dist: params.double("safe_dist"),
        obstacle: params.text("obstacle").parse()?,
        features: features(params)?,
    })
}

/// The parameters that are recorded beside each batch.
fn noted(params: &Params) -> Map<String, Json> {
    let what = params.all().filter(|(name, _)| !PLACES.contains(name));
    what.map(|(name, value)| (name.to_owned(), json!(value))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loopback::Loopback;

    fn with(settings: &[(&str, Value)]) -> Result<(RecorderConfig, WriterConfig)> {
        let dir = tempfile::tempdir().expect("a folder");
        let bus = Loopback::lockstep();
        for (name, folder) in [("data_dir", "raw"), ("pp_data_dir", "pp")] {
            let folder = dir.path().join(folder).display().to_string();
            bus.set_node_param("data", name, Value::Str(folder));
        }
        settings.iter().for_each(|(name, value)| bus.set_node_param("data", name, value.clone()));
        let params = Params::read(&bus.node("data"), &specs())?;
        Ok((recorder(&params)?, writer(&params)?))
    }

    fn text(text: &str) -> Value {
        Value::Str(text.to_owned())
    }

    #[test]
    fn the_defaults_are_the_originals() {
        let (recorder, writer) = with(&[]).expect("the defaults are allowed");
        assert_eq!((recorder.dt_s, recorder.ts_length_s), (0.1, Some(150.0)));
        assert_eq!(recorder.select, Select::Ids([1000].into()));
        assert!(matches!(writer.processing, Processing::BuiltIn(_)));
        assert!(!writer.parameters.contains_key("data_dir") && writer.parameters["dt"] == json!(0.1));
    }

    #[test]
    fn features_add_to_the_usual_ones_and_features_only_replaces_them() {
        let names = |settings: &[(&str, Value)]| match with(settings).expect("are allowed").1.processing {
            Processing::BuiltIn(built_in) => {
                built_in.features.iter().map(|one| one.name.clone()).collect::<Vec<_>>()
            }
            _ => Vec::new(),
        };
        assert_eq!(names(&[("features", text("r_v = r.v"))]), ["h_v", "h_dg", "h_risk", "r_v"]);
        assert_eq!(names(&[("features", text("h_v = 2 * h.v"))]), ["h_dg", "h_risk", "h_v"]);
        assert_eq!(
            names(&[("features_only", text("r_v = r.v")), ("features", text("d = dist(h, r)"))]),
            ["r_v", "d"]
        );
        assert_eq!(names(&[("sel_agent", text("nobody")), ("features", text("r_v = r.v"))]), ["r_v"]);
    }

    #[test]
    fn an_empty_length_is_until_the_end() {
        for length in [text(""), Value::Int(0), Value::Double(0.0)] {
            assert_eq!(with(&[("ts_length", length)]).expect("is allowed").0.ts_length_s, None);
        }
    }

    #[test]
    fn what_is_not_allowed_is_refused_by_name() {
        for (name, value) in [
            ("ts_length", Value::Double(0.05)),
            ("ts_length", Value::Double(-1.0)),
            ("dt", Value::Double(0.0)),
            ("max_gap", Value::Double(0.05)),
            ("sel_agent", text("bob")),
            ("postprocess", text("perhaps")),
            ("pp_script", text("none.py")),
            ("risk_model", text("v2")),
            ("features", text("h_v = speed(x)")),
            ("features_only", text("h_v = speed(x)")),
            ("feature_names", text("a, b")),
            ("id_format", text("%Q")),
            ("csv_prefix", text("../x")),
        ] {
            let error = with(&[(name, value.clone())]).expect_err(name).to_string();
            assert!(error.starts_with(&format!("parameter '{name}'")), "{error}");
        }
        assert!(matches!(
            with(&[("postprocess", text("none"))]).expect("a word").1.processing,
            Processing::None
        ));
    }
}
