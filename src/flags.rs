//! The command's flags and the nodes' parameters that mean the same: the settings that a recording carries, and errors in the names of
//! the command.

use std::sync::{LazyLock, OnceLock};

use roscausal_core::Error;
use roscausal_discovery::{
    settings::{Group, Kind, SETTINGS, Setting, setting},
    spelled_out,
};

/// A flag that is not a setting of an analysis, and the node's parameter that means the same.
pub(crate) struct Alias {
    /// Without the dashes.
    pub(crate) flag: &'static str,
    pub(crate) node: &'static str,
    pub(crate) param: &'static str,
}

const fn alias(flag: &'static str, node: &'static str, param: &'static str) -> Alias {
    Alias { flag, node, param }
}

/// All aliases beside the table of settings.
pub(crate) static ALIASES: [Alias; 8] = [
    alias("several-people", "discovery", "people"),
    alias("window-batches", "discovery", "window_batches"),
    alias("change-rows", "discovery", "change_rows"),
    alias("dt", "data", "dt"),
    alias("ts-length", "data", "ts_length"),
    alias("person", "data", "sel_agent"),
    alias("robot-odom", "robot", "odom_topic"),
    alias("human-goal", "human", "goal_topic"),
];

/// The setting that is a node's parameter.
fn setting_of(node: &str, param: &str) -> Option<&'static Setting> {
    SETTINGS.iter().find(|setting| node == "discovery" && setting.param == param)
}

/// The flag of a node's parameter that is a setting of the analysis.
pub(crate) fn of_setting(node: &str, param: &str) -> Option<&'static str> {
    setting_of(node, param).map(|setting| setting.flag)
}

/// Node and name of the parameter that a flag is.
pub(crate) fn parameter_of_flag(flag: &str) -> Option<(&'static str, &'static str)> {
    let of_table = SETTINGS.iter().find(|setting| setting.flag == flag);
    let of_alias = || ALIASES.iter().find(|alias| alias.flag == flag).map(|alias| (alias.node, alias.param));
    of_table.map(|setting| ("discovery", setting.param)).or_else(of_alias)
}

/// The flag, without dashes, that is a node's parameter.
pub(crate) fn flag_of_parameter(node: &str, param: &str) -> Option<&'static str> {
    let alias = || ALIASES.iter().find(|alias| alias.node == node && alias.param == param);
    of_setting(node, param).or_else(|| alias().map(|alias| alias.flag))
}

/// Whether a node's parameter has a value that means "not set", which its flag has no word for.
pub(crate) fn is_unset(node: &str, param: &str, value: &str) -> bool {
    match setting_of(node, param) {
        Some(setting) => is_default(setting, value),
        None => param == "change_rows" && value.parse::<f64>() == Ok(0.0),
    }
}

/// Whether a parameter is not set. Without resamples their flags are refused, and the defaults say nothing.
fn is_default(setting: &Setting, value: &str) -> bool {
    let read = setting.of_param(value);
    let may_be_left_out =
        setting.kind == Kind::Flag || matches!(setting.group, Group::Resampling | Group::Run);
    read.is_ok_and(|read| read.is_null() || (may_be_left_out && read == setting.default_value()))
}

/// Flag and value for a node's parameter; `None` if no flag means it, or it is not set.
///
/// # Example
/// `discovery.max_lag = 3` is `--tau-max 3`; `discovery.pc_alpha = 0` is `--pc-alpha auto`.
pub(crate) fn of_parameter(node: &str, param: &str, value: &str) -> Option<(&'static str, String)> {
    if value.is_empty() || is_unset(node, param, value) {
        return None;
    }
    let Some(setting) = setting_of(node, param) else {
        let alias = ALIASES.iter().find(|alias| alias.node == node && alias.param == param)?;
        return Some((alias.flag, value.to_owned()));
    };
    let value = match setting.kind {
        Kind::Flag => String::new(),
        // The flag says what is wrong with it.
        _ => setting.of_param(value).map_or_else(|_| value.to_owned(), |read| setting.written(&read)),
    };
    Some((setting.flag, value))
}

/// An error with the names of the command: `--tau-max` for what a node calls `max_lag` and Python `tau_max`.
pub(crate) fn sentence(error: &Error) -> String {
    match error {
        Error::Param { name, reason } => {
            let name = flag_of(name).unwrap_or_else(|| format!("parameter '{name}'"));
            format!("{name}: {}", spelled(reason))
        }
        other => spelled(&format!("{other:#}")),
    }
}

/// A sentence with its settings as flags.
pub(crate) fn spelled(sentence: &str) -> String {
    spelled_out(sentence, spelled_one)
}

/// The value of a flag that is one of some words.
pub(crate) fn word<T: std::str::FromStr<Err = roscausal_discovery::Error>>(text: &str) -> Result<T, String> {
    text.parse().map_err(|error| match error {
        roscausal_discovery::Error::Param { reason, .. } => reason,
        other => other.to_string(),
    })
}

/// A setting as a flag.
pub(crate) fn spelled_one(name: &str) -> String {
    flag_of(name).unwrap_or_else(|| name.to_owned())
}

/// The long flags of all subcommands of `command`, without dashes.
pub(crate) fn all_of(command: &clap::Command) -> Vec<String> {
    fn collect(command: &clap::Command, longs: &mut Vec<String>) {
        for sub in command.get_subcommands() {
            longs.extend(sub.get_arguments().filter_map(|arg| arg.get_long()).map(str::to_owned));
            collect(sub, longs);
        }
    }
    let mut longs = Vec::new();
    collect(command, &mut longs);
    longs.sort();
    longs.dedup();
    longs
}

/// The arguments `A` as a line of these words gives them; the first word is the command's name.
pub(crate) fn parsed<A: clap::Args>(
    words: impl IntoIterator<Item = impl Into<std::ffi::OsString> + Clone>,
) -> clap::error::Result<A> {
    A::from_arg_matches(&A::augment_args(clap::Command::new("roscausal")).try_get_matches_from(words)?)
}

/// The command, from when it reads its line, and its flags, from when a sentence names one.
static COMMAND: OnceLock<&clap::Command> = OnceLock::new();
static FLAGS: LazyLock<Vec<String>> =
    LazyLock::new(|| COMMAND.get().map(|of| all_of(of)).unwrap_or_default());

/// Makes the command's flags known to sentences that name them.
pub(crate) fn know(command: &'static clap::Command) {
    // A program that calls the command twice has it already.
    let _ = COMMAND.set(command);
}

/// The flag that a name means: that of the setting or parameter, the flag itself, or its spelling with `_`.
fn flag_of(name: &str) -> Option<String> {
    let plain = name.trim_start_matches('-').replace('_', "-");
    let of_table = || setting(name).map(|setting| setting.flag.to_owned());
    let of_alias = || ALIASES.iter().find(|alias| alias.param == name).map(|alias| alias.flag.to_owned());
    // `topics` has a flag of the parameter's name.
    let signal = || (name == "signals").then(|| "signal".to_owned());
    let known = || FLAGS.iter().find(|flag| **flag == plain).cloned();
    let flag = of_table().or_else(of_alias).or_else(signal).or_else(known);
    flag.map(|flag| format!("--{flag}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_alias_is_a_flag_and_a_parameter() {
        let flags = all_of(&crate::cli::command());
        let of_table = SETTINGS.iter().map(|setting| (setting.flag, "discovery", setting.param));
        for (flag, node, param) in of_table.chain(ALIASES.iter().map(|one| (one.flag, one.node, one.param))) {
            assert!(flags.iter().any(|known| known == flag), "--{flag}");
            let specs = roscausal_core::nodes::parameters(node).expect("a node");
            assert!(specs.iter().any(|spec| spec.name == param), "{node}.{param}");
        }
    }

    /// `ROSCAUSAL_WRITE_DOCS=1 cargo test the_table_of_flags` rewrites the table.
    #[test]
    fn the_table_of_flags_and_parameters_is_as_they_are() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/data.md");
        let page = std::fs::read_to_string(&path).expect("the page");
        let row = |flag: &str, node: &str, param: &str| format!("| `--{flag}` | {node} | `{param}` |\n");
        let of_table = SETTINGS.iter().map(|setting| row(setting.flag, "discovery", setting.param));
        let table: String =
            of_table.chain(ALIASES.iter().map(|one| row(one.flag, one.node, one.param))).collect();
        let (head, rest) = page.split_once("| flag | node | parameter |\n|---|---|---|\n").expect("a table");
        let end = rest.split_once("\n\n").map_or("", |(_, end)| end);
        let made = format!("{head}| flag | node | parameter |\n|---|---|---|\n{table}\n{end}");
        if std::env::var_os("ROSCAUSAL_WRITE_DOCS").is_some() {
            std::fs::write(&path, &made).expect("writes");
        }
        assert!(page == made, "docs/data.md is old: run with ROSCAUSAL_WRITE_DOCS=1");
    }

    #[test]
    fn errors_name_flags_and_leave_the_users_words_alone() {
        let lag = roscausal_discovery::Named("tau_max");
        let error =
            Error::Data(format!("'tau_max.csv', {lag} = 3 needs at least 10: record longer or lower {lag}"));
        let reported = sentence(&error);
        assert_eq!(
            reported,
            "'tau_max.csv', --tau-max = 3 needs at least 10: record longer or lower --tau-max"
        );
        let node = roscausal_discovery::Named("sel_agent");
        let error = Error::param("max_lag", format!("'max_lag' in data/max_lag.csv, {node}"));
        assert_eq!(sentence(&error), "--tau-max: 'max_lag' in data/max_lag.csv, --person");
        assert_eq!(sentence(&Error::param("risk_lag", "2")), "parameter 'risk_lag': 2");
    }

    #[test]
    fn a_parameter_that_is_not_set_is_no_flag() {
        assert_eq!(of_parameter("discovery", "f_alpha", "0"), None);
        assert_eq!(of_parameter("discovery", "pc_alpha", "0"), Some(("pc-alpha", "auto".into())));
        assert_eq!(of_parameter("discovery", "pc_alpha", "-1"), None);
        let pairs = of_parameter("discovery", "acts_on", "[do_a=a, do_b=b]");
        assert_eq!(pairs, Some(("acts-on", "do_a=a,do_b=b".into())));
        let vectors = of_parameter("discovery", "vectors", "[place=x+y, force=fx+fy]");
        assert_eq!(vectors, Some(("vector", "place=x+y,force=fx+fy".into())));
        assert_eq!(of_parameter("discovery", "vectors", ""), None);
        let causes = of_parameter("discovery", "exogenous", "[weather, hour]");
        assert_eq!(causes, Some(("exogenous", "weather,hour".into())));
        let rule = |value: &str| of_parameter("discovery", "extra_conditions", value);
        assert_eq!((rule("false"), rule("true")), (Some(("no-extra-conditions", String::new())), None));
        assert_eq!(of_parameter("discovery", "max_lag", "3"), Some(("tau-max", "3".into())));
        assert_eq!(of_parameter("data", "risk_lag", "1"), None);
    }

    #[test]
    fn what_is_not_set_is_told_in_any_spelling_from_what_no_flag_means() {
        for (param, value) in [
            ("f_alpha", "0.0"),
            ("pc_alpha", "-1.0"),
            ("resamples", "0"),
            ("resample_share", "0.632"),
            ("acts_on", "[]"),
            ("extra_conditions", "true"),
        ] {
            assert!(is_unset("discovery", param, value), "{param}");
            assert_eq!(of_parameter("discovery", param, value), None, "{param}");
        }
        assert_eq!(of_parameter("discovery", "pc_alpha", "0.0"), Some(("pc-alpha", "auto".into())));
        for (node, param, value) in
            [("discovery", "resamples", "20"), ("data", "risk_lag", "0"), ("robot", "odom_topic", "")]
        {
            assert!(!is_unset(node, param, value), "{param}");
        }
        // No odometry, which is not the same as none named.
        assert_eq!(of_parameter("robot", "odom_topic", ""), None);
    }
}
