//! Whether the tank pressure of a recording can be that of the unit of a sheet.

use govtwin_bag::{Stream, TANK_PA, Topics, unit_of_pressure};
use govtwin_model::parameters::Unit;
use govtwin_model::params::quantity_text;
use govtwin_model::recording::Recording;

/// A median pressure outside of this share of the sheet's is worth a word: an accumulator gives a tenth of its pressure at most.
const LIKE_SHEET: std::ops::RangeInclusive<f64> = 0.8..=1.25;
/// And outside of this one the recording is of another unit, or another channel's.
const OF_UNIT: std::ops::RangeInclusive<f64> = 0.55..=1.8;

/// The median tank pressure of a recording, Pa, as a share of the sheet's, and in words.
fn pressure_of(recording: &Recording, topics: &Topics, unit: &Unit) -> Option<(f64, f64, String)> {
    let pressures_pa = recording.frames.iter().map(|frame| frame.inputs.tank_pressure_pa);
    let mut pressures_pa: Vec<f64> = pressures_pa.filter(|pressure_pa| pressure_pa.is_finite()).collect();
    let middle = pressures_pa.len() / 2;
    if pressures_pa.is_empty() {
        return None;
    }
    let median_pa = *pressures_pa.select_nth_unstable_by(middle, f64::total_cmp).1;
    let sheet_pa = unit.parameters.oil.tank_pressure_pa;
    let topic = topics.of(Stream::TankPressure);
    let (found, expected) = (quantity_text(median_pa, "Pa"), quantity_text(sheet_pa, "Pa"));
    Some((median_pa, median_pa / sheet_pa, format!("{topic}: the median is {found}, the sheet says {expected}")))
}

/// What is to be said of a tank pressure that may be of another machine; of one that is no machine's the reader has said it.
pub fn doubt_of_pressure(recording: &Recording, topics: &Topics, unit: &Unit) -> Option<String> {
    let (median_pa, share, words) = pressure_of(recording, topics, unit)?;
    (TANK_PA.contains(&median_pa) && !LIKE_SHEET.contains(&share)).then_some(words)
}

/// Why a recording cannot be of the unit of a sheet.
pub(super) fn other_unit(recording: &Recording, topics: &Topics, unit: &Unit) -> Option<String> {
    let (median_pa, share, words) = pressure_of(recording, topics, unit)?;
    let meant = unit_of_pressure(median_pa)
        .filter(|name| *name != "Pa")
        .map_or(String::new(), |name| format!(", it was sent in {name}"));
    (!OF_UNIT.contains(&share)).then(|| {
        format!("{words}: the recording is not of this unit{meant}, or the pressure is another channel's; name the sheet of its unit with --params")
    })
}
