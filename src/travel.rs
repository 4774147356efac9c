//! What settings that come with data may say: how the data are to be understood and analysed. They never name a path, a program, a
//! pool, an address, what is written, or what an analysis may cost (docs/security.md).

use std::path::{Component, Path};

use roscausal_core::nodes;
use roscausal_discovery::{
    independence_tests::spelled,
    methods::Method,
    settings::{Group, setting},
};

use crate::{flags, nodes::RECORDING};

/// Flags that describe the data or their analysis, besides those that are a node's parameter.
const FLAGS: [&str; 39] = [
    "agent", "batch", "changes", "clock", "columns", "detrend", "difference", "drop-constant", "drop-empty",
    "encode", "feature", "frame-rate", "goal", "join", "keep", "last", "mask", "max-gap", "missing-value",
    "names", "no-header", "obstacle", "people", "position-unit", "recording", "resample", "robot",
    "robot-goal", "robot-pose", "rows", "season", "signal", "standardise", "step", "time-column",
    "time-unit", "trajectory-columns", "where", "window",
];

/// Whether a setting's value asks for no more work than data may: rows and batches without end, too.
fn is_modest(param: &str, value: &str) -> bool {
    let most = setting(param).map_or(f64::INFINITY, |setting| setting.most_of_data);
    let value = value.trim().parse::<f64>();
    match param {
        "dt" => value.is_ok_and(|step| step >= 0.001),
        "ts_length" => value.is_ok_and(|length| length.is_nan() || length == 0.0 || length >= 1.0),
        "max_gap" => value.is_ok_and(|gap| gap <= 5.0),
        _ => most == f64::INFINITY || value.is_ok_and(|value| value <= most),
    }
}

/// Whether settings that come with data may give a node's parameter this value.
pub(crate) fn may_set(node: &str, param: &str, value: &str) -> bool {
    let specs = nodes::parameters(node).unwrap_or_default();
    specs.iter().any(|spec| spec.name == param && spec.of_data)
        && is_modest(param, value)
        && match param {
            // Not a program of the user's folder of methods.
            "cd_method" => value.parse::<Method>().is_ok(),
            // It imports whatever lies in Python's path.
            "cond_ind_test" => spelled(value) != "gpdcpython",
            "postprocess" => value != "script",
            _ => true,
        }
}

/// Whether settings that come with data may give a flag these values.
pub(crate) fn may_say(flag: &str, values: &[String]) -> bool {
    match flags::parameter_of_flag(flag) {
        Some((node, param)) => values.iter().all(|value| may_set(node, param, value)),
        None if flag == "param" => values.iter().all(|value| is_parameter_of_data(value)),
        // The other formats say what is printed.
        None if flag == "format" => values.iter().all(|value| value == "trajectories"),
        None => FLAGS.contains(&flag),
    }
}

/// Flags that the file in the working folder may set, too, where the data are near it, besides what one run may take.
const NEAR: [&str; 3] = ["format", "ignore-settings", "out"];

/// Whether the file in the working folder may give a flag these values where the data are near it: results stay within the folder,
/// and go through no link, which may have come out of the same archive.
pub(crate) fn may_say_near(flag: &str, values: &[String]) -> bool {
    let is_link = |path: &Path| path.symlink_metadata().is_ok_and(|found| found.is_symlink());
    let inside = |value: &String| {
        let path = Path::new(value);
        path.components().all(|part| matches!(part, Component::Normal(_))) && !path.ancestors().any(is_link)
    };
    let is_of_run = || setting(flag).is_some_and(|setting| setting.group == Group::Run);
    (NEAR.contains(&flag) || is_of_run()) && (flag != "out" || values.iter().all(inside))
}

/// Whether `NODE.NAME=VALUE` may come with data.
fn is_parameter_of_data(text: &str) -> bool {
    let split = text.split_once('=').and_then(|(name, value)| Some((name.split_once('.')?, value)));
    split.is_some_and(|((node, param), value)| may_set(node, param, value))
}

/// A setting that was left out, and how the user would say it on purpose.
pub(crate) fn reported(node: &str, param: &str) -> String {
    match flags::flag_of_parameter(node, param) {
        Some(flag) => format!("{node}.{param} (--{flag})"),
        None if RECORDING.contains(&node) => format!("{node}.{param} (--param {node}.{param}=...)"),
        None => format!("{node}.{param}"),
    }
}

/// The sentence about what was left out of one place; `None` if nothing was.
pub(crate) fn sentence(place: &Path, left_out: &[String]) -> Option<String> {
    let what = left_out.join(", ");
    (!left_out.is_empty()).then(|| {
        format!(
            "{}: these settings came with the data, or may have, and are not used, since they are not about the data: {what}",
            place.display()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_listed_flag_exists() {
        let known = flags::all_of(&crate::cli::command());
        for flag in FLAGS {
            assert!(known.iter().any(|name| name == flag), "--{flag}");
            assert!(flags::parameter_of_flag(flag).is_none(), "--{flag} is a parameter: its table decides");
        }
    }

    #[test]
    fn no_setting_that_names_a_place_a_program_or_a_cost_may_come_with_data() {
        for node in ["robot", "human", "data", "discovery", "markers", "reasoning"] {
            for spec in nodes::parameters(node).expect("a node").iter().filter(|spec| spec.of_data) {
                let names =
                    ["dir", "path", "script", "file", "folder", "pool", "port", "thread", "memory", "budget"];
                let words: Vec<&str> = spec.name.split('_').collect();
                assert!(!names.iter().any(|name| words.contains(name)), "{node}.{}", spec.name);
            }
        }
        for flag in flags::all_of(&crate::cli::command()) {
            let commands = [
                "address", "port", "token", "web", "out", "output", "force", "record", "threads",
                "max-memory", "time-budget", "links", "null-dist", "resample-out", "latex", "tikz", "speed",
                "data", "graph", "seeds", "shard", "ignore-settings", "take-it",
            ];
            assert!(!(commands.contains(&flag.as_str()) && may_say(&flag, &["1".into()])), "--{flag}");
        }
    }

    #[test]
    fn a_method_is_one_of_the_registry_and_work_is_limited() {
        let may = |param: &str, value: &str| may_set("discovery", param, value);
        for (param, value) in [("dt", "0.0001"), ("ts_length", "0.002"), ("max_gap", "60"), ("dt", "x")] {
            assert!(!may_set("data", param, value), "{param} {value}");
        }
        assert!(may_set("data", "dt", "0.3") && may_set("data", "ts_length", "0"));
        assert!(may("cd_method", "pcmci") && !may("cd_method", "post.py") && !may("cd_method", "../x"));
        assert!(may("cond_ind_test", "gpdc") && !may("cond_ind_test", "GPDC-Python"));
        assert!(may_set("data", "postprocess", "none") && !may_set("data", "postprocess", "script"));
        assert!(may_say("param", &["data.risk_lag=1".into()]));
        for text in ["data.pp_script=a", "data.max_pool_size=1", "x.y=1", "data.risk_lag"] {
            assert!(!may_say("param", &[text.into()]), "{text}");
        }
        for (setting, few, many) in [("shuffles", "5000", "1000000"), ("gp-restarts", "5", "1000000")] {
            assert!(may_say(setting, &[few.into()]) && !may_say(setting, &[many.into()]), "{setting}");
        }
        assert!(may("max_lag", "20") && !may("max_lag", "1e9") && !may("max_lag", "many"));
        assert!(may_say("format", &["trajectories".into()]) && !may_say("format", &["json".into()]));
    }
}
