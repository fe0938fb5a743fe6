//! What a unit is judged by.

use govtwin_model::stored::held_by_id;

/// What a diagnosis knows of a unit beside its recordings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JudgedBy {
    /// A data sheet.
    #[default]
    DataSheet,
    /// A sheet that was made of the recordings ([`crate::sheet::recorded`]).
    AssumedSheet,
    /// Nothing: the servomotor stage alone is judged, and fitted freely.
    Nothing,
}

impl JudgedBy {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::DataSheet, Self::AssumedSheet, Self::Nothing];

    /// The word in reports.
    #[must_use]
    pub fn id(self) -> &'static str {
        match self {
            Self::DataSheet => "data_sheet",
            Self::AssumedSheet => "assumed_sheet",
            Self::Nothing => "nothing",
        }
    }

    /// What the sheet is called in sentences.
    #[must_use]
    pub fn sheet_title(self) -> &'static str {
        match self {
            Self::AssumedSheet => "assumed sheet",
            Self::DataSheet | Self::Nothing => "data sheet",
        }
    }
}

held_by_id!(JudgedBy, "what a unit is judged by");
