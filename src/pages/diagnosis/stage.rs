//! What was fitted of a servomotor stage alone, in words.

use govtwin_diagnosis::result::StageFigure;
use govtwin_diagnosis::result::{Diagnosis, Interval};
use govtwin_model::number::significant;

/// What was fitted of a stage alone, in a sentence.
pub fn fitted_stage(diagnosis: &Diagnosis) -> Option<String> {
    let figures = &diagnosis.part.as_ref()?.figures;
    let said: Vec<String> = figures.iter().map(|one| format!("{} {}", one.title, figure_text(one))).collect();
    (!said.is_empty()).then(|| format!("Fitted stage, in the units of the recordings: {}.", said.join("; ")))
}

/// Value, interval and unit of a figure of a fitted stage.
#[must_use]
pub fn figure_text(one: &StageFigure) -> String {
    let Interval { value, low, high } = one.value;
    let [value, low, high] = [value, low, high].map(|number| significant(number, 3));
    format!("{value} [{low}, {high}] {}", one.unit)
}
