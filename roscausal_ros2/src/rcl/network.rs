//! A node's place on the network, from the environment.

use super::BadArgument;
use crate::distribution;

/// A node's place on the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Network {
    /// `ROS_DOMAIN_ID`, 0 to 232.
    pub domain_id: u16,
    /// Nothing leaves this machine (`ROS_LOCALHOST_ONLY`, `ROS_AUTOMATIC_DISCOVERY_RANGE`).
    pub localhost_only: bool,
}

impl Network {
    /// Reads `ROS_DOMAIN_ID`, `ROS_LOCALHOST_ONLY` (which takes precedence if it is 1, as in rcl) and
    /// `ROS_AUTOMATIC_DISCOVERY_RANGE`.
    ///
    /// # Errors
    /// A domain that is above 232 or not a number, or a range that ROS 2 does not have.
    pub fn from_env(
        env: impl Fn(&str) -> Option<String>,
        warnings: &mut Vec<String>,
    ) -> Result<Self, BadArgument> {
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
        if text("RMW_IMPLEMENTATION").as_deref() == Some("rmw_zenoh_cpp") {
            warnings.push(
                "RMW_IMPLEMENTATION is rmw_zenoh_cpp, another wire: this node speaks DDS and hears nothing of nodes that use it. \
                 Run those with rmw_fastrtps_cpp or rmw_cyclonedds_cpp, or start a zenoh-bridge-ros2dds between the two"
                    .into(),
            );
        }
        warnings.extend(text("ROS_DISTRO").and_then(|distro| distribution::mismatch(&distro)));
        Ok(Self { domain_id, localhost_only })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_among_zenoh_nodes_says_that_it_hears_nothing_and_what_to_do() {
        let mut warnings = Vec::new();
        let find = |name: &str| (name == "RMW_IMPLEMENTATION").then(|| "rmw_zenoh_cpp".to_owned());
        Network::from_env(find, &mut warnings).unwrap();
        assert!(
            warnings[0].contains("rmw_zenoh_cpp") && warnings[0].contains("zenoh-bridge-ros2dds"),
            "{warnings:?}"
        );
        warnings.clear();
        Network::from_env(|_| None, &mut warnings).unwrap();
        assert!(warnings.is_empty());
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
