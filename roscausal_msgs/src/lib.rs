//! The messages of ROS-Causal and of the nodes' inputs: one Rust type each for both ROS versions.
//!
//! A type carries the metadata of both wires ([`Message`]); the bytes are made by serde formats: [`ros1`] and,
//! for recordings, [`cdr`] (the ROS 2 backend's library has its own CDR). `Header` has no `seq` field here: it
//! exists only on the ROS 1 wire, and the ROS 1 codec writes and reads it.
//!
//! Where the two ROS versions differ in more than that, there are two Rust types, and
//! [`Definition::wires`] tells which wire each is for.

/// Implements [`Message`] for a struct: `message!("package" Name uses [Nested, ...])`. The text is
/// `foreign/package/msg/Name.msg`; `own` takes `msg/Name.msg`; `as "path"` another file below `foreign/`; `on`
/// names the wire when it is only one.
macro_rules! message {
    (own $name:ident uses [$($nested:ty),*]) => {
        message!(@ $name, "roscausal_msgs", stringify!($name), concat!("/msg/", stringify!($name), ".msg"), Both, [$($nested),*]);
    };
    ($package:literal $name:ident uses [$($nested:ty),*]) => {
        message!($package $name on Both uses [$($nested),*]);
    };
    ($package:literal $name:ident on $wires:ident uses [$($nested:ty),*]) => {
        message!(@ $name, $package, stringify!($name), concat!("/foreign/", $package, "/msg/", stringify!($name), ".msg"), $wires, [$($nested),*]);
    };
    ($package:literal $name:ident as $file:literal $named:literal on $wires:ident uses [$($nested:ty),*]) => {
        message!(@ $name, $package, $named, concat!("/foreign/", $file, ".msg"), $wires, [$($nested),*]);
    };
    (@ $type:ident, $package:expr, $name:expr, $file:expr, $wires:ident, [$($nested:ty),*]) => {
        impl $crate::Message for $type {
            const PACKAGE: &'static str = $package;
            const NAME: &'static str = $name;

            fn definition() -> &'static $crate::Definition {
                static DEFINITION: $crate::Definition = $crate::Definition::new(
                    $package,
                    $name,
                    include_str!(concat!(env!("CARGO_MANIFEST_DIR"), $file)),
                    $crate::Wires::$wires,
                    &[$(<$nested as $crate::Message>::definition),*],
                );
                &DEFINITION
            }
        }
    };
}

mod definition;
mod registry;
mod roscausal;
mod time;
mod wire;

pub mod actionlib_msgs;
pub mod cdr;
pub mod diagnostic_msgs;
pub mod geometry_msgs;
pub mod move_base_msgs;
pub mod nav_msgs;
pub mod pedsim_msgs;
pub mod people_msgs;
pub mod ros1;
pub mod rosgraph_msgs;
pub mod sensor_msgs;
pub mod spencer_tracking_msgs;
pub mod std_msgs;
pub mod tf2_msgs;
pub mod visualization_msgs;

pub use definition::{Definition, Wires};
pub use registry::{TypeVisitor, types, visit};
pub use roscausal::{CausalLink, CausalModel, CausalModelInfo, HumanState, Humans, RobotState};
pub use time::{Duration, Time};
pub use wire::{Fault, WireError};

use serde::{Serialize, de::DeserializeOwned};

/// A ROS message type: its names and its text.
///
/// `serde` field order is the wire order of both ROS versions.
pub trait Message:
    Serialize + DeserializeOwned + Clone + Default + std::fmt::Debug + Send + Sync + 'static
{
    /// ROS package, such as `geometry_msgs`.
    const PACKAGE: &'static str;
    /// Type name within the package, such as `Point`.
    const NAME: &'static str;

    /// Text, dependencies and what is derived from them.
    fn definition() -> &'static Definition;

    /// `package/Name`, the ROS 1 spelling.
    fn type_name() -> String {
        format!("{}/{}", Self::PACKAGE, Self::NAME)
    }

    /// `package/msg/Name`, the ROS 2 spelling.
    fn ros2_type_name() -> String {
        format!("{}/msg/{}", Self::PACKAGE, Self::NAME)
    }

    /// The type's md5 on the ROS 1 wire.
    fn ros1_md5() -> &'static str {
        Self::definition().ros1_md5()
    }

    /// The type's full text, with that of all types it uses, as ROS 1 connections and bags carry it.
    fn ros1_definition() -> &'static str {
        Self::definition().ros1_definition()
    }
}
