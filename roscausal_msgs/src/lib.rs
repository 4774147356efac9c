//! The messages of ROS-Causal and of its inputs: one Rust type each for both ROS versions.
//!
//! A type has the metadata of both wire formats ([`Message`]). Serde formats turn it into bytes: [`ros1`], and
//! [`cdr`] for recordings (the library of the ROS 2 backend has its own CDR). `Header` has no field `seq` here:
//! only the ROS 1 wire format has it, and the ROS 1 codec reads and writes it.
//!
//! Types that differ in more than that between the two ROS versions are two Rust types. [`Definition::wires`] tells
//! which wire format each belongs to.
//!
//! [`dynamic`] reads messages of any other type by the definition that travels with them.

/// Implements [`Message`] for a struct: `message!("package" Name uses [Nested, ...])`. The text is
/// `foreign/package/msg/Name.msg`. With `own` it is `msg/Name.msg`, with `as "path"` another file below `foreign/`.
/// `on` names the wire format if there is only one.
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

/// Implements [`Service`] for a type of `srv/Name.srv`, and [`Message`] for its question and its answer:
/// `service!(Name: NameRequest uses [Nested, ...], NameResponse uses [...])`.
macro_rules! service {
    ($name:ident: $request:ident uses [$($asked:ty),*], $response:ident uses [$($told:ty),*]) => {
        impl $crate::Service for $name {
            const PACKAGE: &'static str = "roscausal_msgs";
            const NAME: &'static str = stringify!($name);
            type Request = $request;
            type Response = $response;
        }
        service!(@ $name, $request, question, [$($asked),*]);
        service!(@ $name, $response, answer, [$($told),*]);
    };
    (@ $name:ident, $type:ident, $part:ident, [$($nested:ty),*]) => {
        impl $crate::Message for $type {
            const PACKAGE: &'static str = "roscausal_msgs";
            const NAME: &'static str = stringify!($type);

            fn definition() -> &'static $crate::Definition {
                static DEFINITION: $crate::Definition = $crate::Definition::new(
                    "roscausal_msgs",
                    stringify!($type),
                    $crate::service::$part(include_str!(concat!(
                        env!("CARGO_MANIFEST_DIR"),
                        "/srv/",
                        stringify!($name),
                        ".srv"
                    ))),
                    $crate::Wires::Both,
                    &[$(<$nested as $crate::Message>::definition),*],
                );
                &DEFINITION
            }
        }
    };
}

mod definition;
mod reasoning;
mod registry;
mod roscausal;
mod service;
mod time;
mod wire;

pub mod actionlib_msgs;
pub mod cdr;
pub mod diagnostic_msgs;
pub mod dynamic;
pub mod geometry_msgs;
pub mod hri_msgs;
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
pub use reasoning::{
    Action, Contribution, CostTerm, Effect, EffectRequest, EffectResponse, Explain, ExplainRequest,
    ExplainResponse, Features, Forecast, Intervention, Limit, Outlook, Prediction, Status, WhatIf,
    WhatIfRequest, WhatIfResponse,
};
pub use registry::{TypeVisitor, types, visit};
pub use roscausal::{
    CausalLink, CausalModel, CausalModelInfo, HumanState, Humans, ModelChange, ModelChanges, RobotState,
};
pub use service::Service;
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

    /// The text, its dependencies, and what is derived from them.
    fn definition() -> &'static Definition;

    /// `package/Name`, the ROS 1 spelling.
    fn type_name() -> String {
        format!("{}/{}", Self::PACKAGE, Self::NAME)
    }

    /// `package/msg/Name`, the ROS 2 spelling.
    fn ros2_type_name() -> String {
        format!("{}/msg/{}", Self::PACKAGE, Self::NAME)
    }

    /// The type's md5 in ROS 1.
    fn ros1_md5() -> &'static str {
        Self::definition().ros1_md5()
    }

    /// The full text of the type, with those of all types it uses, as in ROS 1 connections and bags.
    fn ros1_definition() -> &'static str {
        Self::definition().ros1_definition()
    }
}
