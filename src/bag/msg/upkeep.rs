//! What every ROS 2 node is asked besides its parameters: levels of its loggers, and descriptions of its types.

use serde::{Deserialize, Serialize};

use super::service::{carried, services};

/// `rcl_interfaces/msg/LoggerLevel`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoggerLevel {
    /// The logger.
    pub name: String,
    /// 0 unknown, 10 debug, 20 info, 30 warning, 40 error, 50 fatal.
    pub level: u32,
}

/// `rcl_interfaces/msg/SetLoggerLevelsResult`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetLoggerLevelsResult {
    /// Whether it was set.
    pub successful: bool,
    /// Why not.
    pub reason: String,
}

/// Request of [`GetLoggerLevels`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetLevelsRequest {
    /// Loggers.
    pub names: Vec<String>,
}

/// Response of [`GetLoggerLevels`], request of [`SetLoggerLevels`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Levels {
    /// Loggers with their levels.
    pub levels: Vec<LoggerLevel>,
}

/// Response of [`SetLoggerLevels`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetLevelsResponse {
    /// What became of each.
    pub results: Vec<SetLoggerLevelsResult>,
}

/// `type_description_interfaces/msg/FieldType`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FieldType {
    /// Number of the type.
    pub type_id: u8,
    /// Length of an array or bound of a sequence.
    pub capacity: u64,
    /// Bound of a string.
    pub string_capacity: u64,
    /// Name of a nested type.
    pub nested_type_name: String,
}

/// `type_description_interfaces/msg/Field`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DescribedField {
    /// Its name.
    pub name: String,
    /// Its type.
    pub r#type: FieldType,
    /// Its default as text.
    pub default_value: String,
}

/// `type_description_interfaces/msg/IndividualTypeDescription`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IndividualTypeDescription {
    /// Its full name.
    pub type_name: String,
    /// Its fields in wire order.
    pub fields: Vec<DescribedField>,
}

/// `type_description_interfaces/msg/TypeDescription`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TypeDescription {
    /// The type.
    pub type_description: IndividualTypeDescription,
    /// All that it is made of, by name.
    pub referenced_type_descriptions: Vec<IndividualTypeDescription>,
}

/// `type_description_interfaces/msg/TypeSource`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TypeSource {
    /// Of which type.
    pub type_name: String,
    /// `msg`.
    pub encoding: String,
    /// The definition's text.
    pub raw_file_contents: String,
}

/// `type_description_interfaces/msg/KeyValue`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TypeKeyValue {
    /// What.
    pub key: String,
    /// Which.
    pub value: String,
}

/// Request of [`GetTypeDescription`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TypeRequest {
    /// Full name of a type.
    pub type_name: String,
    /// Its hash, `RIHS01_` and 64 digits; empty for any.
    pub type_hash: String,
    /// Whether the texts are wanted too.
    pub include_type_sources: bool,
}

/// Response of [`GetTypeDescription`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TypeResponse {
    /// Whether the type is known.
    pub successful: bool,
    /// Why not.
    pub failure_reason: String,
    /// The description.
    pub type_description: TypeDescription,
    /// The texts.
    pub type_sources: Vec<TypeSource>,
    /// More.
    pub extra_information: Vec<TypeKeyValue>,
}

services! {
    GetLoggerLevels(GetLevelsRequest, Levels) = "rcl_interfaces/srv/GetLoggerLevels",
    SetLoggerLevels(Levels, SetLevelsResponse) = "rcl_interfaces/srv/SetLoggerLevels",
    GetTypeDescription(TypeRequest, TypeResponse) = "type_description_interfaces/srv/GetTypeDescription",
}

carried!(GetLevelsRequest, Levels, SetLevelsResponse, TypeRequest, TypeResponse);
