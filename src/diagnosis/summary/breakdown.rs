//! Where: the gap of every signal, and its square split exactly over processes, phases, directions, spool bands, end zones and ESV states.

use crate::hypotheses::explorer::is_stage_alone;
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::Problem;
use crate::result::{Breakdown, BreakdownPart, SignalGap};
use govtwin_model::frame::{Estimate, EsvState, Frame};
use govtwin_model::signal::Signal;

/// Slower than this the servomotor stands, pu/s.
const STANDING_PU_S: f64 = 2.0e-3;

/// One row as the breakdown sees it.
struct SampleRow<'a> {
    recording: &'a PreparedRecording,
    frame: &'a Frame,
    speed_pu_s: f64,
}

/// A cut: its name, its parts, and the part of a row.
type Division = (&'static str, &'static [&'static str], fn(&SampleRow<'_>) -> usize);

const DIVISIONS: [Division; 6] = [
    ("process", &["start-up", "load increase", "shutdown", "load rejection"], |row| row.recording.process as usize),
    ("phase", &["servomotor at rest", "servomotor moves"], |row| usize::from(row.speed_pu_s.abs() > STANDING_PU_S)),
    ("direction", &["closing", "at rest", "opening"], |row| {
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

/// The breakdowns of both positions; estimates by recording of the refitted twin and of the twin with the effects.
pub fn breakdowns(problem: &Problem, refitted: &[Vec<Estimate>], with_effects: &[Vec<Estimate>]) -> Vec<Breakdown> {
    let mut all = Vec::new();
    let stage_only = is_stage_alone(problem);
    for signal in Signal::POSITIONS {
        for (by, names, part_of) in DIVISIONS {
            // Without command and ESV these say nothing.
            if stage_only && ["process", "ESV"].contains(&by) {
                continue;
            }
            let mut parts: Vec<BreakdownPart> = names
                .iter()
                .map(|name| BreakdownPart { name: (*name).to_owned(), samples: 0, refitted: 0.0, with_effects: 0.0 })
                .collect();
            for (index, recording) in problem.recordings.iter().enumerate() {
                let twins = [refitted, with_effects].map(|twin| problem.squares(index, signal, &twin[index]));
                let [Some(before), Some(after)] = twins else { continue };
                for (k, (before, after)) in before.into_iter().zip(after).enumerate() {
                    if !before.is_finite() {
                        continue;
                    }
                    let frame = &recording.frames[recording.samples[k]];
                    let part = &mut parts[part_of(&SampleRow { recording, frame, speed_pu_s: slope(recording, k) })];
                    part.samples += 1;
                    part.refitted += before;
                    part.with_effects += after;
                }
            }
            let total: f64 = parts.iter().map(|part| part.refitted).sum();
            if total > 0.0 {
                for part in &mut parts {
                    part.refitted /= total;
                    part.with_effects /= total;
                }
                all.push(Breakdown { signal, by, parts });
            }
        }
    }
    all
}

/// Speed of the measured servomotor about a sample, over a tenth of a second or the next samples, pu/s.
fn slope(recording: &PreparedRecording, k: usize) -> f64 {
    let reach = recording.samples_in(0.05);
    let (a, b) = (k.saturating_sub(reach), (k + reach).min(recording.samples.len() - 1));
    let (one, two) = (&recording.frames[recording.samples[a]], &recording.frames[recording.samples[b]]);
    let time_s = govtwin_model::units::seconds_from_nanos(two.time_ns - one.time_ns);
    let change = two.measured.servomotor_position_pu - one.measured.servomotor_position_pu;
    if time_s > 0.0 && change.is_finite() { change / time_s } else { 0.0 }
}

/// RMS errors of every signal that was measured.
pub fn gaps(
    problem: &Problem,
    delivered: &[Vec<Estimate>],
    refitted: &[Vec<Estimate>],
    with_effects: &[Vec<Estimate>],
) -> Vec<SignalGap> {
    Signal::ALL
        .into_iter()
        .filter_map(|signal| {
            let (mut sums, mut floor, mut count) = ([0.0; 3], 0.0, 0_usize);
            for index in 0..problem.recordings.len() {
                for (sum, twin) in sums.iter_mut().zip([delivered, refitted, with_effects]) {
                    let squares = problem.squares(index, signal, &twin[index]).unwrap_or_default();
                    *sum += squares.into_iter().filter(|square| square.is_finite()).sum::<f64>();
                }
                let samples =
                    problem.recordings[index].measured(signal).into_iter().filter(|value| value.is_finite()).count();
                floor += problem.floor_square(index, signal) * samples as f64;
                count += samples;
            }
            let root = |sum: f64| (sum / count as f64).sqrt();
            (count > 0).then(|| SignalGap {
                signal,
                noise_floor: root(floor),
                delivered: root(sums[0]),
                refitted: root(sums[1]),
                with_effects: root(sums[2]),
            })
        })
        .collect()
}
