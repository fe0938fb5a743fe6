//! What is judged, and by what.

use govtwin_model::recording::Recording;
use govtwin_model::stored::held_by_id;

/// What a diagnosis judges, and what it knows of the unit beside its recordings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Setup {
    /// The whole chain, by a data sheet.
    #[default]
    Chain,
    /// The whole chain, by a sheet that was made of the recordings ([`crate::sheet::recorded`]).
    AssumedSheet,
    /// The servomotor stage alone, driven by the recorded spool, by a data sheet.
    Stage,
    /// The servomotor stage alone, without a sheet: all of it is fitted freely.
    StageFree,
}

impl Setup {
    /// All of them; of two with the same word in reports the first is read.
    pub const ALL: [Self; 4] = [Self::Chain, Self::AssumedSheet, Self::Stage, Self::StageFree];

    /// The same, or the stage alone where no recording holds the command that a chain needs.
    #[must_use]
    pub fn for_recordings(self, recordings: &[Recording]) -> Self {
        match self {
            Self::Chain | Self::AssumedSheet if !recordings.iter().any(Recording::has_command) => Self::Stage,
            other => other,
        }
    }

    /// By what the unit is judged: the word in reports.
    pub fn id(self) -> &'static str {
        match self {
            Self::Chain | Self::Stage => "data_sheet",
            Self::AssumedSheet => "assumed_sheet",
            Self::StageFree => "nothing",
        }
    }

    /// What the sheet is called in sentences.
    pub fn sheet_title(self) -> &'static str {
        match self {
            Self::AssumedSheet => "assumed sheet",
            Self::Chain | Self::Stage | Self::StageFree => "data sheet",
        }
    }
}

held_by_id!(Setup, "what a unit is judged by");
