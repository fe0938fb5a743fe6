//! A better parent for the hybrid: the twin refitted on the rows that teach, and on nothing behind them.

use govtwin_correction::split::RowSplit;
use govtwin_correction::table::FeatureTable;
use govtwin_diagnosis::estimation::coordinate::subject_at;
use govtwin_diagnosis::identification::calibration::calibrate;
use govtwin_diagnosis::identification::free_parameter::FreeParameter;
use govtwin_diagnosis::likelihood::noise;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_model::effects::CATALOGUE;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::replay::between::drawn;

/// Fewer rows than this of a recording are left out of a refit.
const FEWEST_ROWS: usize = 100;

/// The parts of recordings that teach: each up to its last row that does, the rows of `table` being those recordings'.
///
/// Where a process is left out, its recordings are, too.
pub fn teaching(recordings: &[Recording], table: &FeatureTable, split: &RowSplit) -> Vec<Recording> {
    let mut ends = vec![0; recordings.len()];
    for mark in split.train.iter().map(|&row| &table.marks[row]) {
        ends[mark.recording] = ends[mark.recording].max(mark.frame + 1);
    }
    let taken = recordings.iter().zip(ends).filter(|(_, end)| *end >= FEWEST_ROWS);
    taken.map(|(one, end)| Recording { frames: one.frames[..end].to_vec(), ..one.clone() }).collect()
}

/// A unit whose tolerances and, with them, the effects of these ids are fitted to recordings, inputs drawn in between their rows
/// every `period_ns`; ids that the catalogue lacks are passed over. `step` is called as each part of the work ends.
pub fn refit(recordings: &[Recording], unit: &Unit, effects: &[&str], period_ns: i64, step: &dyn Fn()) -> Unit {
    let mut base = unit.clone();
    let mut free = FreeParameter::nuisances(&base);
    for spec in effects.iter().filter_map(|id| CATALOGUE.iter().find(|spec| spec.id == *id)) {
        let effect = base.effect_at(spec);
        let of = |(parameter, spec)| FreeParameter::Effect { effect, parameter, spec };
        free.extend(spec.parameters.iter().enumerate().map(of));
    }
    if free.is_empty() {
        return base;
    }
    let recordings: Vec<PreparedRecording> =
        recordings.iter().map(|one| PreparedRecording::new(drawn(one, period_ns).0)).collect();
    let (_, found) = calibrate(recordings, &base, free.clone(), &noise::expected(&base.sensors), 1, step);
    subject_at(&base, &free, &found.fit.positions)
}
