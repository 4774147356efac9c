//! The command's flags and the nodes' parameters that mean the same: the table in docs/parameters.md, the settings that a
//! recording carries, and messages in the words of the command.

use roscausal_core::{Error, visible};

/// A flag, and the parameter of a node that means the same.
pub(crate) struct Twin {
    /// Without the dashes.
    pub(crate) flag: &'static str,
    pub(crate) node: &'static str,
    pub(crate) param: &'static str,
    /// The parameter's value that means "not set", which the flag has no word for.
    unset: Option<&'static str>,
}

const fn twin(flag: &'static str, node: &'static str, param: &'static str) -> Twin {
    Twin { flag, node, param, unset: None }
}

const fn optional(flag: &'static str, node: &'static str, param: &'static str) -> Twin {
    Twin { flag, node, param, unset: Some("0") }
}

/// Of a text or a list, which may be empty.
const fn filled(flag: &'static str, node: &'static str, param: &'static str) -> Twin {
    unless(flag, node, param, "")
}

/// Of which one value is as good as none.
const fn unless(flag: &'static str, node: &'static str, param: &'static str, unset: &'static str) -> Twin {
    Twin { flag, node, param, unset: Some(unset) }
}

impl Twin {
    /// Whether a value of the parameter means "not set", in any spelling: 0.0 is 0, and [] is nothing.
    fn is_unset(&self, value: &str) -> bool {
        let plain = value.trim_matches(['[', ']']);
        let same = |unset: &str| match (plain.parse::<f64>(), unset.parse::<f64>()) {
            (Ok(one), Ok(other)) => one == other,
            _ => plain == unset,
        };
        self.unset.is_some_and(same)
    }
}

/// All twins.
pub(crate) static TWINS: [Twin; 33] = [
    twin("method", "discovery", "cd_method"),
    twin("test", "discovery", "cond_ind_test"),
    twin("alpha", "discovery", "sig_alpha"),
    unless("pc-alpha", "discovery", "pc_alpha", "-1"),
    optional("f-alpha", "discovery", "f_alpha"),
    twin("te-estimator", "discovery", "te_estimator"),
    twin("gp-search", "discovery", "gp_search"),
    twin("gp-restarts", "discovery", "gp_restarts"),
    filled("null-dist", "discovery", "null_dist"),
    filled("vector", "discovery", "vectors"),
    twin("fdr", "discovery", "fdr_method"),
    twin("tau-min", "discovery", "min_lag"),
    twin("tau-max", "discovery", "max_lag"),
    filled("exogenous", "discovery", "exogenous"),
    filled("acts-on", "discovery", "acts_on"),
    optional("max-sets", "discovery", "max_sets"),
    unless("no-extra-conditions", "discovery", "extra_conditions", "true"),
    twin("seed", "discovery", "seed"),
    twin("several-people", "discovery", "people"),
    optional("threads", "discovery", "threads"),
    optional("time-budget", "discovery", "time_budget"),
    optional("max-memory", "discovery", "max_memory"),
    optional("resamples", "discovery", "resamples"),
    // Without resamples their flags are refused, and the defaults say nothing.
    unless("resampling", "discovery", "resampling", "subsample"),
    unless("share", "discovery", "resample_share", "0.632"),
    unless("block", "discovery", "resample_block", "1"),
    twin("window-batches", "discovery", "window_batches"),
    optional("change-rows", "discovery", "change_rows"),
    twin("dt", "data", "dt"),
    twin("ts-length", "data", "ts_length"),
    twin("person", "data", "sel_agent"),
    twin("robot-odom", "robot", "odom_topic"),
    twin("human-goal", "human", "goal_topic"),
];

/// The twin of a node's parameter.
fn twin_of(node: &str, param: &str) -> Option<&'static Twin> {
    TWINS.iter().find(|twin| twin.node == node && twin.param == param)
}

/// Node and name of the parameter that a flag is.
pub(crate) fn twin_of_flag(flag: &str) -> Option<(&'static str, &'static str)> {
    TWINS.iter().find(|twin| twin.flag == flag).map(|twin| (twin.node, twin.param))
}

/// The flag, without dashes, that is a node's parameter.
pub(crate) fn flag_of_parameter(node: &str, param: &str) -> Option<&'static str> {
    twin_of(node, param).map(|twin| twin.flag)
}

/// Whether a node's parameter has a value that means "not set", which its flag has no word for.
pub(crate) fn is_unset(node: &str, param: &str, value: &str) -> bool {
    twin_of(node, param).is_some_and(|twin| twin.is_unset(value))
}

/// Flag and value for a node's parameter; `None` if no flag means it, or it is not set.
///
/// # Example
/// `discovery.max_lag = 3` is `--tau-max 3`; `discovery.pc_alpha = 0` is `--pc-alpha auto`.
pub(crate) fn of_parameter(node: &str, param: &str, value: &str) -> Option<(&'static str, String)> {
    let twin = twin_of(node, param)?;
    match (twin.flag, value) {
        (_, value) if twin.is_unset(value) => None,
        // A flag takes no empty value: what that means, the parameter says.
        (_, "") => None,
        // A flag without a value.
        ("no-extra-conditions", value) => (value == "false").then(|| ("no-extra-conditions", String::new())),
        ("pc-alpha", value) if value.parse::<f64>() == Ok(0.0) => Some(("pc-alpha", "auto".to_owned())),
        // A list is written [a, b].
        (flag @ ("acts-on" | "exogenous" | "vector"), list) => {
            Some((flag, list.trim_matches(['[', ']']).replace(", ", ",")))
        }
        (flag, value) => Some((flag, value.to_owned())),
    }
}

/// An error in the words of the command: `--tau-max` for what a node calls `max_lag` and the library `tau_max`.
pub(crate) fn in_the_commands_words(error: &Error) -> String {
    // Cut first: each word is looked up.
    match error {
        Error::Param { name, reason } => match flag_of(name) {
            Some(flag) => format!("{flag}: {}", translated(&visible::message(reason))),
            None => format!("parameter '{name}': {}", translated(&visible::message(reason))),
        },
        other => translated(&visible::message(&other.to_string())),
    }
}

/// The flag that a name means: that of the parameter, the flag itself, or its spelling with `_`.
fn flag_of(name: &str) -> Option<String> {
    let plain = name.trim_start_matches('-').replace('_', "-");
    let is_it = |twin: &&Twin| twin.param.replace('_', "-") == plain;
    let twin = TWINS.iter().find(is_it).map(|twin| twin.flag.to_owned());
    let known = || crate::cli::long_flags().into_iter().find(|flag| *flag == plain);
    // `topics` has a flag of the parameter's name.
    let signal = (name == "signals").then(|| "signal".to_owned());
    twin.or(signal).or_else(known).map(|flag| format!("--{flag}"))
}

/// The names with an underscore that are a node's parameter, or a setting of the library, as flags. What stands in quotes is the
/// user's.
fn translated(text: &str) -> String {
    let is_name = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    let (mut out, mut rest) = (String::new(), text);
    while let Some(letter) = rest.chars().next() {
        let length = rest.find(|letter| !is_name(letter)).unwrap_or(rest.len());
        let (word, after) = rest.split_at(if length == 0 { letter.len_utf8() } else { length });
        let before = out.chars().last();
        let quoted = before.is_some_and(|letter| matches!(letter, '\'' | '.' | '/' | '`'))
            || after.starts_with(['.', '/']);
        match flag_of(word).filter(|_| word.contains('_') && !quoted) {
            Some(flag) => out += &flag,
            None => out += word,
        }
        rest = after;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_twin_is_a_flag_and_a_parameter() {
        let flags = crate::cli::long_flags();
        for twin in &TWINS {
            assert!(flags.iter().any(|flag| flag == twin.flag), "--{}", twin.flag);
            let specs = roscausal_core::nodes::parameters(twin.node).expect("a node");
            assert!(specs.iter().any(|spec| spec.name == twin.param), "{}.{}", twin.node, twin.param);
        }
    }

    #[test]
    fn the_table_of_flags_and_parameters_names_every_twin() {
        let page = include_str!("../docs/data.md");
        for Twin { flag, node, param, .. } in &TWINS {
            let row = format!("| `--{flag}` | {node} | `{param}` |");
            assert!(page.contains(&row), "docs/data.md lacks: {row}");
        }
    }

    #[test]
    fn messages_name_flags_and_leave_the_users_words_alone() {
        let error = Error::Data("tau_max = 3 needs at least 10: record longer or lower tau_max".into());
        let told = in_the_commands_words(&error);
        assert_eq!(told, "--tau-max = 3 needs at least 10: record longer or lower --tau-max");
        let error = Error::param("max_lag", "'max_lag' in data/max_lag.csv, sel_agent");
        assert_eq!(in_the_commands_words(&error), "--tau-max: 'max_lag' in data/max_lag.csv, --person");
        assert_eq!(in_the_commands_words(&Error::param("risk_lag", "2")), "parameter 'risk_lag': 2");
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

    #[test]
    fn what_a_twin_calls_unset_is_the_default_of_the_node() {
        for twin in TWINS.iter().filter(|twin| twin.flag != "acts-on") {
            let Some(unset) = twin.unset else { continue };
            let specs = roscausal_core::nodes::parameters(twin.node).expect("a node");
            let default = &specs.iter().find(|spec| spec.name == twin.param).expect("a parameter").default;
            assert!(twin.is_unset(&default.to_string()), "--{}: {unset} is not {default}", twin.flag);
        }
    }
}
