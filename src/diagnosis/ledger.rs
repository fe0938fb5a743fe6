//! Where: the squared gap split exactly over processes, phases, directions, spool bands, end zones and ESV states.

use crate::diagnosis::outcome::{Ledger, Part};
use crate::frame::{Estimate, EsvState, Frame};
use crate::signal::Signal;
use crate::tuning::fit::Bench;
use crate::tuning::trial::Trial;

/// Slower than this the servomotor stands, pu/s.
const STANDING_PU_S: f64 = 2.0e-3;

/// One row as the ledger sees it.
struct Row<'a> {
    trial: &'a Trial,
    frame: &'a Frame,
    speed_pu_s: f64,
}

/// A cut: its name, its parts, and the part of a row.
type Cut = (&'static str, &'static [&'static str], fn(&Row<'_>) -> usize);

const CUTS: [Cut; 6] = [
    ("process", &["start-up", "load increase", "shutdown", "load rejection"], |row| row.trial.process as usize),
    ("phase", &["servomotor stands", "servomotor moves"], |row| usize::from(row.speed_pu_s.abs() > STANDING_PU_S)),
    ("direction", &["closing", "standing", "opening"], |row| {
        if row.speed_pu_s.abs() <= STANDING_PU_S { 1 } else { 2 * usize::from(row.speed_pu_s > 0.0) }
    }),
    ("spool band", &["below −3.5 %", "−3.5 to 2 %", "above 2 %"], |row| {
        // The band of the paper in which the spool works at rest (Liu et al. 2025, section 4.3).
        let spool = row.frame.measured.spool_position_pu;
        if spool < -0.035 { 0 } else { 1 + usize::from(spool > 0.02) }
    }),
    ("end zone", &["closed end, below 5 %", "between", "open end, above 95 %"], |row| {
        let opening = row.frame.measured.servomotor_position_pu;
        if opening < 0.05 { 0 } else { 1 + usize::from(opening > 0.95) }
    }),
    ("ESV", &["normal", "shutdown"], |row| usize::from(row.frame.inputs.esv == EsvState::Shutdown)),
];

/// The ledgers of both positions; estimates by trial of the refitted twin and of the twin with the effects.
#[must_use]
pub fn ledgers(bench: &Bench, refitted: &[Vec<Estimate>], with_effects: &[Vec<Estimate>]) -> Vec<Ledger> {
    let mut all = Vec::new();
    let stage_only = bench.trials.iter().all(|trial| trial.cut == crate::twin::Cut::Spool);
    for signal in [Signal::ServomotorPosition, Signal::SpoolPosition] {
        for (by, names, part_of) in CUTS {
            // Without command and ESV these say nothing.
            if stage_only && ["process", "ESV"].contains(&by) {
                continue;
            }
            let mut parts: Vec<Part> = names
                .iter()
                .map(|name| Part { name: (*name).to_owned(), samples: 0, refitted: 0.0, with_effects: 0.0 })
                .collect();
            for (index, trial) in bench.trials.iter().enumerate() {
                for (k, &row) in trial.samples.iter().enumerate() {
                    let frame = &trial.frames[row];
                    let measured = signal.of(&frame.measured);
                    if !measured.is_finite() || !trial.has[signal as usize] {
                        continue;
                    }
                    let before = &refitted[index][k];
                    let speed_pu_s = slope(trial, k);
                    let part = &mut parts[part_of(&Row { trial, frame, speed_pu_s })];
                    part.samples += 1;
                    part.refitted += (measured - signal.of(&before.signals)).powi(2);
                    part.with_effects += (measured - signal.of(&with_effects[index][k].signals)).powi(2);
                }
            }
            let total: f64 = parts.iter().map(|part| part.refitted).sum();
            if total > 0.0 {
                for part in &mut parts {
                    part.refitted /= total;
                    part.with_effects /= total;
                }
                all.push(Ledger { signal, by, parts });
            }
        }
    }
    all
}

/// Speed of the measured servomotor about a sample, over a tenth of a second or the next samples, pu/s.
fn slope(trial: &Trial, k: usize) -> f64 {
    let reach = trial.samples_in(0.05);
    let (a, b) = (k.saturating_sub(reach), (k + reach).min(trial.samples.len() - 1));
    let (one, two) = (&trial.frames[trial.samples[a]], &trial.frames[trial.samples[b]]);
    let time_s = crate::units::seconds_from_nanos(two.time_ns - one.time_ns);
    let change = two.measured.servomotor_position_pu - one.measured.servomotor_position_pu;
    if time_s > 0.0 && change.is_finite() { change / time_s } else { 0.0 }
}
