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

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

/// Implements [`Message`] for a type that `build.rs` writes.
macro_rules! message {
    ($type:ident, $package:literal, $name:literal, $text:literal, $wires:ident, [$($nested:ty),* $(,)?]) => {
        impl $crate::Message for $type {
            const PACKAGE: &'static str = $package;
            const NAME: &'static str = $name;

            fn definition() -> &'static $crate::Definition {
                static DEFINITION: $crate::Definition = $crate::Definition::new(
                    $package,
                    $name,
                    $text,
                    $crate::Wires::$wires,
                    &[$(<$nested as $crate::Message>::definition),*],
                );
                &DEFINITION
            }
        }
    };
}

/// A service.
macro_rules! service {
    ($package:literal, $name:ident, $request:ident, $response:ident) => {
        #[doc = concat!("The service of [`", stringify!($request), "`] and [`", stringify!($response), "`].")]
        #[derive(Clone, Copy, Debug)]
        pub struct $name;

        impl $crate::Service for $name {
            const PACKAGE: &'static str = $package;
            const NAME: &'static str = stringify!($name);
            type Request = $request;
            type Response = $response;
        }
    };
}

/// Modules of packages that have nothing but their types.
macro_rules! packages {
    ($($(#[$about:meta])* $package:ident),* $(,)?) => {
        $($(#[$about])* pub mod $package {
            include!(concat!(env!("OUT_DIR"), "/", stringify!($package), ".rs"));
        })*
    };
}

mod definition;
mod line;
mod registry;
mod roscausal;
mod service;
mod time;
mod wire;

pub mod cdr;
pub mod dynamic;
pub mod geometry_msgs;
pub mod ros1;
pub mod visualization_msgs;

packages! {
    /// `actionlib_msgs`.
    actionlib_msgs,
    /// `dynamic_reconfigure`; only ROS 1 has it.
    dynamic_reconfigure,
    /// `diagnostic_msgs`.
    diagnostic_msgs,
    /// `hri_msgs`, from ROS4HRI (REP-155).
    hri_msgs,
    /// `move_base_msgs`; only ROS 1 has it.
    move_base_msgs,
    /// `nav2_msgs`; only ROS 2 has it.
    nav2_msgs,
    /// `nav_msgs`.
    nav_msgs,
    /// `pedsim_msgs`, from the pedestrian simulator pedsim_ros.
    pedsim_msgs,
    /// `people_msgs`.
    people_msgs,
    /// `rosgraph_msgs`.
    rosgraph_msgs,
    /// `sensor_msgs`.
    sensor_msgs,
    /// `spencer_tracking_msgs`, from the SPENCER people tracker.
    spencer_tracking_msgs,
    /// `std_msgs`.
    std_msgs,
    /// `tf2_msgs`.
    tf2_msgs,
}

pub use definition::{Definition, Wires};
pub use registry::{TypeVisitor, types, visit};
pub use roscausal::*;
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
