//! What the node says of itself: `diagnostic_msgs` and `rcl_interfaces/Log`, field for field.

use serde::{Deserialize, Serialize};

use super::ros::{Header, Time};

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue {
    /// What.
    pub key: String,
    /// How much, with its unit in the key.
    pub value: String,
}

/// `level` of a [`DiagnosticStatus`]; the order is that of severity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// As it should be.
    #[default]
    Ok = 0,
    /// Something is lost.
    Warn = 1,
    /// What the node is for does not happen.
    Error = 2,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// As [`Level`].
    pub level: u8,
    /// `<node>: <part>`.
    pub name: String,
    /// For a person.
    pub message: String,
    /// Which of several, unused.
    pub hardware_id: String,
    /// The figures.
    pub values: Vec<KeyValue>,
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// Its time.
    pub header: Header,
    /// One for each part.
    pub status: Vec<DiagnosticStatus>,
}

/// `rcl_interfaces/Log`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log {
    /// When it was written.
    pub stamp: Time,
    /// 20 for information, 30 for a warning, 40 for an error.
    pub level: u8,
    /// The logger: the node's name, with dots.
    pub name: String,
    /// The line.
    pub msg: String,
    /// Where it was written.
    pub file: String,
    /// Unused.
    pub function: String,
    /// Of the file.
    pub line: u32,
}
