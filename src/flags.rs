//! The command's flags and the nodes' parameters that mean the same: the table in docs/parameters.md, the settings that a
//! recording carries, and messages in the words of the command.

use roscausal_core::Error;

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

/// All twins.
pub(crate) const TWINS: [Twin; 28] = [
    twin("method", "discovery", "cd_method"),
    twin("test", "discovery", "cond_ind_test"),
    twin("alpha", "discovery", "sig_alpha"),
    Twin { flag: "pc-alpha", node: "discovery", param: "pc_alpha", unset: Some("-1") },
    optional("f-alpha", "discovery", "f_alpha"),
    twin("te-estimator", "discovery", "te_estimator"),
    twin("gp-search", "discovery", "gp_search"),
    twin("gp-restarts", "discovery", "gp_restarts"),
    twin("fdr", "discovery", "fdr_method"),
    twin("tau-min", "discovery", "min_lag"),
    twin("tau-max", "discovery", "max_lag"),
    twin("acts-on", "discovery", "acts_on"),
    twin("seed", "discovery", "seed"),
    twin("several-people", "discovery", "people"),
    optional("threads", "discovery", "threads"),
    optional("time-budget", "discovery", "time_budget"),
    optional("max-memory", "discovery", "max_memory"),
    optional("resamples", "discovery", "resamples"),
    twin("resampling", "discovery", "resampling"),
    twin("share", "discovery", "resample_share"),
    twin("block", "discovery", "resample_block"),
    twin("window-batches", "discovery", "window_batches"),
    twin("change-rows", "discovery", "change_rows"),
    twin("dt", "data", "dt"),
    twin("ts-length", "data", "ts_length"),
    twin("person", "data", "sel_agent"),
    twin("robot-odom", "robot", "odom_topic"),
    twin("human-goal", "human", "goal_topic"),
];

/// Flag and value for a node's parameter; `None` if no flag means it, or it is not set.
///
/// # Example
/// `discovery.max_lag = 3` is `--tau-max 3`; `discovery.pc_alpha = 0` is `--pc-alpha auto`.
pub(crate) fn of_parameter(node: &str, param: &str, value: &str) -> Option<(&'static str, String)> {
    let twin = TWINS.iter().find(|twin| twin.node == node && twin.param == param)?;
    match (twin.flag, value) {
        (_, value) if twin.unset == Some(value) => None,
        ("pc-alpha", "0") => Some(("pc-alpha", "auto".to_owned())),
        // A list is written [a, b].
        ("acts-on", list) => Some(("acts-on", list.trim_matches(['[', ']']).replace(", ", ","))),
        (flag, value) => Some((flag, value.to_owned())),
    }
}

/// An error in the words of the command: `--tau-max` for what a node calls `max_lag` and the library `tau_max`.
pub(crate) fn in_the_commands_words(error: &Error) -> String {
    match error {
        Error::Param { name, reason } => match flag_of(name) {
            Some(flag) => format!("{flag}: {}", translated(reason)),
            None => format!("parameter '{name}': {}", translated(reason)),
        },
        other => translated(&other.to_string()),
    }
}

/// The flag that a name means: that of the parameter, the flag itself, or its spelling with `_`.
fn flag_of(name: &str) -> Option<String> {
    let plain = name.trim_start_matches('-').replace('_', "-");
    let twin = TWINS.iter().find(|twin| twin.param == name).map(|twin| twin.flag.to_owned());
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
        assert_eq!(of_parameter("discovery", "max_lag", "3"), Some(("tau-max", "3".into())));
        assert_eq!(of_parameter("data", "risk_lag", "1"), None);
    }
}
