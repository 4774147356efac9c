//! The command line and the environment of a ROS 2 node, read as rcl reads them.

use std::collections::BTreeMap;

use roscausal_core::{batch::header::nearest, params::Value};
use tracing::level_filters::LevelFilter;

use crate::{
    names::{Names, Remap},
    param_file::{ParamFile, scalar_or_list},
    security::Enclave,
};

/// What a node was started with, all of it checked.
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
    /// Where on the network the node lives.
    pub network: Network,
    /// The SROS2 enclave whose files the node uses; `None`: it talks in the clear.
    pub enclave: Option<Enclave>,
    /// What was read but has no effect, for the log.
    pub warnings: Vec<String>,
}

/// Where on the network a node lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Network {
    /// `ROS_DOMAIN_ID`, 0 to 232.
    pub domain_id: u16,
    /// Nothing leaves this machine (`ROS_LOCALHOST_ONLY`, `ROS_AUTOMATIC_DISCOVERY_RANGE`).
    pub localhost_only: bool,
}

/// A command line or environment that a node cannot start with: one sentence for the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadArgument(pub String);

impl std::fmt::Display for BadArgument {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BadArgument {}

type Result<T> = std::result::Result<T, BadArgument>;

/// The flags within `--ros-args` that take a value.
const WITH_VALUE: [&str; 9] = [
    "-r",
    "--remap",
    "-p",
    "--param",
    "--params-file",
    "--log-level",
    "--log-config-file",
    "-e",
    "--enclave",
];
/// The flags within `--ros-args` that stand alone.
const SWITCHES: [&str; 6] = [
    "--enable-rosout-logs",
    "--disable-rosout-logs",
    "--enable-stdout-logs",
    "--disable-stdout-logs",
    "--enable-external-lib-logs",
    "--disable-external-lib-logs",
];

impl Args {
    /// Reads the arguments after the program's name, and the environment through `env`.
    /// `node` is the node's name unless `-r __node:=` gives another.
    ///
    /// # Errors
    /// An unknown flag, an illegal rule or value, a parameter file that is missing or not understood.
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
                        "-p" | "--param" => add_param(&mut params, &value)?,
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
        Ok(Self {
            overrides: params.for_node(&names.full_name()),
            names,
            log_level: log_level.unwrap_or(LevelFilter::INFO),
            rosout,
            network: Network::from_env(&env, &mut warnings)?,
            enclave: Enclave::from_env(&env, enclave.as_deref(), &mut warnings)?,
            warnings,
        })
    }
}

impl Network {
    /// Reads `ROS_DOMAIN_ID`, `ROS_LOCALHOST_ONLY` (which wins when it is 1, as in rcl) and
    /// `ROS_AUTOMATIC_DISCOVERY_RANGE`.
    ///
    /// # Errors
    /// A domain above 232 or not a number; a range that is none of ROS 2's words.
    pub fn from_env(env: impl Fn(&str) -> Option<String>, warnings: &mut Vec<String>) -> Result<Self> {
        let text = |name| env(name).filter(|value: &String| !value.is_empty());
        let domain_id = match text("ROS_DOMAIN_ID") {
            None => 0,
            Some(value) => value.parse().ok().filter(|id| *id <= 232).ok_or_else(|| {
                BadArgument(format!("ROS_DOMAIN_ID is '{value}'; use a whole number from 0 to 232"))
            })?,
        };
        let range = text("ROS_AUTOMATIC_DISCOVERY_RANGE").unwrap_or_else(|| "SUBNET".into());
        let localhost_only = match range.as_str() {
            _ if text("ROS_LOCALHOST_ONLY").as_deref() == Some("1") => true,
            "SUBNET" | "SYSTEM_DEFAULT" => false,
            "LOCALHOST" => true,
            "OFF" => {
                warnings
                    .push("ROS_AUTOMATIC_DISCOVERY_RANGE=OFF is not supported and read as LOCALHOST".into());
                true
            }
            other => {
                return Err(BadArgument(format!(
                    "ROS_AUTOMATIC_DISCOVERY_RANGE is '{other}'; use SUBNET, LOCALHOST, OFF or SYSTEM_DEFAULT"
                )));
            }
        };
        if text("ROS_STATIC_PEERS").is_some() {
            warnings.push("ROS_STATIC_PEERS has no effect: these nodes find others by multicast only".into());
        }
        if let Some(old @ ("humble" | "galactic" | "foxy")) = text("ROS_DISTRO").as_deref() {
            warnings.push(format!(
                "ROS_DISTRO is {old}, whose discovery differs: topics work, but this node is not listed by name"
            ));
        }
        Ok(Self { domain_id, localhost_only })
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

/// `[node:]name:=value`, the value in YAML.
fn add_param(params: &mut ParamFile, rule: &str) -> Result<()> {
    let wrong = |why: &str| BadArgument(format!("-p {rule}: {why}; write name:=value, such as dt:=0.1"));
    let (name, text) = rule.split_once(":=").ok_or_else(|| wrong("there is no ':='"))?;
    let (node, name) = name.split_once(':').unwrap_or(("/**", name));
    if name.is_empty() || name.contains(':') {
        return Err(wrong("the name is not a parameter's name"));
    }
    let value =
        serde_norway::from_str(text).map_err(|error| wrong(&format!("the value is not YAML ({error})")))?;
    let value = scalar_or_list(&value).map_err(|why| wrong(&why))?;
    params.insert(node, name, value);
    Ok(())
}

/// `[logger:=]level`; a level for another logger than the node's is not ours.
fn set_level(level: &mut Option<LevelFilter>, node: &str, text: &str) -> Result<()> {
    let (logger, word) = text.split_once(":=").map_or((None, text), |(logger, word)| (Some(logger), word));
    let filter = match word.to_ascii_lowercase().as_str() {
        "debug" => LevelFilter::DEBUG,
        "info" | "unset" => LevelFilter::INFO,
        "warn" => LevelFilter::WARN,
        "error" | "fatal" => LevelFilter::ERROR,
        _ => {
            let words = "debug, info, warn, error or fatal";
            return Err(BadArgument(format!("--log-level {text}: '{word}' is no level; use {words}")));
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

    #[test]
    fn the_environment_places_the_node_on_the_network() {
        let network = |pairs: &[(&str, &str)]| {
            let find = |name: &str| Some(pairs.iter().find(|(key, _)| *key == name)?.1.to_owned());
            Network::from_env(find, &mut Vec::new())
        };
        assert_eq!(network(&[]).unwrap(), Network { domain_id: 0, localhost_only: false });
        assert_eq!(network(&[("ROS_DOMAIN_ID", "42")]).unwrap().domain_id, 42);
        assert!(network(&[("ROS_LOCALHOST_ONLY", "1")]).unwrap().localhost_only);
        assert!(network(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")]).unwrap().localhost_only);
        for (name, value) in
            [("ROS_DOMAIN_ID", "233"), ("ROS_DOMAIN_ID", "x"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "NEAR")]
        {
            assert!(network(&[(name, value)]).unwrap_err().0.contains(value));
        }
    }
}
