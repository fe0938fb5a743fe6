//! What the sheet of a unit says against a recording, and what follows from it.

use govtwin_bag::Severity;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;

use super::position_scale::PositionScale;
use super::spool_scale::doubt_of_spool;
use super::time_scale::TimeScale;

/// What a sheet says against a recording.
#[derive(Clone, Debug)]
pub struct Doubt {
    severity: Severity,
    pub(super) words: String,
}

impl Doubt {
    pub(super) fn note(words: String) -> Self {
        Self { severity: Severity::Note, words }
    }

    pub(super) fn warned(words: String) -> Self {
        Self { severity: Severity::Warning, words }
    }

    /// Nothing is concluded from the recording.
    pub(super) fn refused(words: String) -> Self {
        Self { severity: Severity::Disqualified, words }
    }

    pub(super) fn refuses(&self) -> bool {
        self.severity == Severity::Disqualified
    }

    /// It does not speak against the recording.
    pub(super) fn is_note(&self) -> bool {
        self.severity == Severity::Note
    }
}

/// What a sheet says against a recording that is looked at alone: warnings, and notes.
pub fn doubts(recording: &Recording, unit: &Unit) -> [Vec<String>; 2] {
    let mut all: Vec<Doubt> = doubt_of_spool(recording, unit).into_iter().collect();
    all.extend(TimeScale::of(recording, unit).and_then(|scale| scale.doubt()));
    let (notes, warnings): (Vec<_>, Vec<_>) = all.into_iter().partition(Doubt::is_note);
    let [mut warnings, notes] = [warnings, notes].map(|all| all.into_iter().map(|one| one.words).collect::<Vec<_>>());
    warnings.extend(PositionScale::of(recording, unit).map(|scale| scale.words()));
    [warnings, notes]
}
