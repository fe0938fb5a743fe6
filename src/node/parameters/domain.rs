//! What the value of a parameter may be, and values as people write them.

use ros2_client::parameters::ParameterValue;

/// What a value may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Domain {
    Bool,
    Real(f64, f64),
    Whole(i64, i64),
    Choice(&'static [&'static str]),
    Text,
}

impl Domain {
    pub(super) fn words(self) -> String {
        match self {
            Self::Bool => "true or false".to_owned(),
            Self::Real(least, largest) => format!("a number from {least} to {largest}"),
            Self::Whole(least, largest) => format!("a whole number from {least} to {largest}"),
            Self::Choice(names) => format!("one of {}", names.join(", ")),
            Self::Text => "a text".to_owned(),
        }
    }

    pub(super) fn check(self, name: &str, value: &ParameterValue) -> Result<(), String> {
        let right = match (self, value) {
            (Self::Bool, ParameterValue::Boolean(_)) | (Self::Text, ParameterValue::String(_)) => true,
            (Self::Real(least, largest), ParameterValue::Double(value)) => (least..=largest).contains(value),
            (Self::Whole(least, largest), ParameterValue::Integer(value)) => (least..=largest).contains(value),
            (Self::Choice(names), ParameterValue::String(value)) => names.contains(&value.as_str()),
            _ => false,
        };
        if right { Ok(()) } else { Err(format!("`{name}` is {}, not {}", self.words(), words_of(value))) }
    }
}

/// A value as a person would write it.
pub(crate) fn words_of(value: &ParameterValue) -> String {
    match value {
        ParameterValue::NotSet => "nothing".to_owned(),
        ParameterValue::Boolean(value) => value.to_string(),
        ParameterValue::Integer(value) => format!("the whole number {value}"),
        ParameterValue::Double(value) => value.to_string(),
        ParameterValue::String(value) => format!("`{value}`"),
        _ => "an array".to_owned(),
    }
}
