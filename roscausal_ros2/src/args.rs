//! The command line and the environment of a ROS 2 node, read as rcl reads them.

use std::collections::BTreeMap;

use roscausal_core::params::{Value, nearest};
use tracing::level_filters::LevelFilter;

use crate::dds;
use crate::rcl::{BadArgument, Enclave, Names, Network, ParamFile, Remap};

/// The arguments of a node, all checked.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Args {
    /// Node name, namespace and remaps.
    pub names: Names,
    /// Parameter values for this node, nested keys joined with `.`.
    pub overrides: BTreeMap<String, Value>,
    /// Messages below this level are not logged.
    pub log_level: LevelFilter,
    /// Whether log messages also go to `/rosout`.
    pub rosout: bool,
    /// The node's place on the network.
    pub network: Network,
    /// The SROS2 enclave whose files the node uses; `None`: it communicates in the clear.
    pub enclave: Option<Enclave>,
    /// Arguments that were read but have no effect, for the log.
    pub warnings: Vec<String>,
}

type Result<T> = std::result::Result<T, BadArgument>;

/// Flags within `--ros-args` that take a value.
const WITH_VALUE: [&str; 9] = [
    "-r", "--remap", "-p", "--param", "--params-file", "--log-level", "--log-config-file", "-e", "--enclave",
];
/// Flags within `--ros-args` that take no value.
const SWITCHES: [&str; 6] = [
    "--enable-rosout-logs",
    "--disable-rosout-logs",
    "--enable-stdout-logs",
    "--disable-stdout-logs",
    "--enable-external-lib-logs",
    "--disable-external-lib-logs",
];

impl Args {
    /// Reads the arguments after the program's name, and the environment through `env`. `node` is the name of the
    /// node unless `-r __node:=` gives another one.
    ///
    /// # Errors
    /// An unknown flag, an illegal rule or value, or a parameter file that is missing or malformed.
    pub fn parse(
        node: &str,
        args: impl IntoIterator<Item = String>,
        env: impl Fn(&str) -> Option<String>,
    ) -> Result<Self> {
        let mut rules = Vec::new();
        let mut params = ParamFile::default();
        let mut log_level = None;
        let mut warnings = Vec::new();
        let mut rosout = true;
        let mut enclave = None;
        let mut args = args.into_iter();
        let mut in_ros_args = false;
        while let Some(arg) = args.next() {
            match arg.as_str() {
                "--ros-args" => in_ros_args = true,
                "--" if in_ros_args => in_ros_args = false,
                _ if !in_ros_args => return Err(outside_ros_args(&arg)),
                "--enable-rosout-logs" => rosout = true,
                "--disable-rosout-logs" => rosout = false,
                switch if SWITCHES.contains(&switch) => {}
                flag if WITH_VALUE.contains(&flag) => {
                    let value =
                        args.next().ok_or_else(|| BadArgument(format!("{flag} needs a value after it")))?;
                    match flag {
                        "-r" | "--remap" => rules.push(Remap::parse(&value)?),
                        "-p" | "--param" => params.add_rule(&value)?,
                        "--params-file" => params.add_file(value.as_ref())?,
                        "--log-level" => set_level(&mut log_level, node, &value)?,
                        "-e" | "--enclave" => enclave = Some(value),
                        _ => warnings
                            .push(format!("{flag} {value} has no effect: these nodes have no log files")),
                    }
                }
                _ => return Err(unknown(&arg)),
            }
        }
        let names = Names::new(node, rules)?;
        let full_name = names.full_name();
        warnings.extend(params.missed(&full_name).into_iter().map(|key| {
            format!(
                "the parameters under '{key}' are not for {full_name}; write '/**/{node}' for any namespace"
            )
        }));
        Ok(Self {
            overrides: params.for_node(&names.full_name()),
            names,
            log_level: log_level.unwrap_or(LevelFilter::INFO),
            rosout,
            network: Network::from_env(&env, &mut warnings)?,
            enclave: Enclave::from_env(&env, enclave.as_deref(), dds::SECURITY, &mut warnings)?,
            warnings,
        })
    }
}

fn outside_ros_args(arg: &str) -> BadArgument {
    BadArgument(format!(
        "unexpected argument '{arg}': a node takes ROS arguments only, after --ros-args \
         (--ros-args -p name:=value -r from:=to --params-file FILE)"
    ))
}

fn unknown(arg: &str) -> BadArgument {
    let flags = [&WITH_VALUE[..], &SWITCHES].concat();
    let near = nearest(&flags, arg).map_or(String::new(), |flag| format!("; did you mean {flag}?"));
    BadArgument(format!("unknown ROS argument '{arg}'{near}"))
}

/// `[logger:=]level`. A level for a logger other than the node's does not concern this node.
fn set_level(level: &mut Option<LevelFilter>, node: &str, text: &str) -> Result<()> {
    let (logger, word) = text.split_once(":=").map_or((None, text), |(logger, word)| (Some(logger), word));
    let filter = match word.to_ascii_lowercase().as_str() {
        "debug" => LevelFilter::DEBUG,
        "info" | "unset" => LevelFilter::INFO,
        "warn" => LevelFilter::WARN,
        "error" | "fatal" => LevelFilter::ERROR,
        _ => {
            let words = "debug, info, warn, error or fatal";
            return Err(BadArgument(format!("--log-level {text}: '{word}' is not a level; use {words}")));
        }
    };
    if logger.is_none_or(|logger| logger.rsplit('.').next() == Some(node)) {
        *level = Some(filter);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Args> {
        Args::parse("robot", line.split_whitespace().map(str::to_owned), |_| None)
    }

    #[test]
    fn ros_arguments_may_come_in_several_sections() {
        let args =
            parse("--ros-args -r __ns:=/a -p dt:=0.5 -- --ros-args -p goal:=[1.0,2.0] --log-level debug")
                .unwrap();
        assert_eq!(args.names.full_name(), "/a/robot");
        assert_eq!(args.overrides["dt"], Value::Double(0.5));
        assert_eq!(args.log_level, LevelFilter::DEBUG);
        assert!(args.rosout && !parse("--ros-args --disable-rosout-logs").unwrap().rosout);
    }

    #[test]
    fn a_wrong_line_is_refused_with_the_way_out() {
        for (line, way_out) in [
            ("--ros-args --parms-file x", "--params-file"),
            ("--ros-args -p", "needs a value"),
            ("--ros-args -p e:=", "write"),
            ("--ros-args -p e", ":="),
            ("--ros-args --params-file /no/such.yaml", "/no/such.yaml"),
            ("--ros-args --log-level loud", "debug, info"),
            ("--ros-args -p a:=[1,2.5]", "one type"),
            ("dt:=1", "--ros-args"),
        ] {
            let error = parse(line).unwrap_err().0;
            assert!(error.contains(way_out), "{line}: {error}");
        }
    }
}
