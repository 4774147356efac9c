//! `diagnostic_msgs`.

use serde::{Deserialize, Serialize};

use crate::std_msgs::Header;

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue {
    /// Name of the value.
    pub key: String,
    /// The value as text.
    pub value: String,
}
message!("diagnostic_msgs" KeyValue uses []);

/// `diagnostic_msgs/DiagnosticStatus`: the health of one part.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// One of the constants of this type.
    pub level: u8,
    /// The part's name.
    pub name: String,
    /// Its health in words.
    pub message: String,
    /// The hardware's name.
    pub hardware_id: String,
    /// Values, such as counters.
    pub values: Vec<KeyValue>,
}
message!("diagnostic_msgs" DiagnosticStatus uses [KeyValue]);

impl DiagnosticStatus {
    /// It works.
    pub const OK: u8 = 0;
    /// It works, but not as intended.
    pub const WARN: u8 = 1;
    /// It does not work.
    pub const ERROR: u8 = 2;
    /// It has not reported.
    pub const STALE: u8 = 3;
}

/// `diagnostic_msgs/DiagnosticArray`: the messages on `/diagnostics`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// Time of the report.
    pub header: Header,
    /// One entry per part.
    pub status: Vec<DiagnosticStatus>,
}
message!("diagnostic_msgs" DiagnosticArray uses [Header, DiagnosticStatus]);
