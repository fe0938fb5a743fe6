//! Preparation of recordings: missing, doubled and implausible values and outliers are found, counted and reported (Liu et al. 2025, 4.1.1).
//!
//! | found | what is done |
//! |---|---|
//! | missing sample: the target skips its own period | counted; a window never reaches over more than 2.5 periods |
//! | doubled row: same or earlier stamp | left out |
//! | doubled recording: the same rows again | left out, because one of them would be tested on the training rows of the other |
//! | implausible input: outside what a governor can show | replaced by the last plausible value, as in the live node |
//! | implausible target | used neither for training nor for testing |
//! | outlier of the target: one sample far off both neighbours while the servomotor rests | used neither for training nor for testing |

use std::ops::RangeInclusive;

use serde::Serialize;

use govtwin_model::frame::{Frame, Signals};
use govtwin_model::recording::{Recording, median_spacing_ns};
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// Commands and servomotor positions that a plant can show, pu.
const OPENINGS_PU: RangeInclusive<f64> = -0.1..=1.1;
/// Spool and pilot-valve positions that a plant can show, pu.
const STROKES_PU: RangeInclusive<f64> = -2.0..=2.0;
/// Pressures that a plant can show, Pa.
const PRESSURES_PA: RangeInclusive<f64> = -1e5..=3e7;
/// An outlier lies this far off both its neighbours, as a share of the target's plausible span.
const OUTLIER_SHARE: f64 = 0.05;
/// And the servomotor moved by less than this meanwhile, pu.
const AT_REST_PU: f64 = 0.003;
/// Places that a report names for each kind.
const PLACES: usize = 3;

/// How often something was found, and where first.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Occurrences {
    /// How often.
    pub count: u64,
    /// Times of the first few, s from the recording's first row.
    pub first_s: Vec<f64>,
}

impl Occurrences {
    fn at(&mut self, count: u64, time_s: f64) {
        self.count += count;
        if self.first_s.len() < PLACES {
            self.first_s.push(time_s);
        }
    }
}

/// What was found in one recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Cleaning {
    /// Its name.
    pub name: String,
    /// Rows that carry the target, as recorded.
    pub samples: u64,
    /// Samples that the target's own period would have had.
    pub missing: Occurrences,
    /// Rows with the stamp of an earlier one.
    pub doubled: Occurrences,
    /// Inputs replaced by the last plausible value.
    pub implausible_inputs: Occurrences,
    /// Targets outside what a plant can show.
    pub implausible_targets: Occurrences,
    /// Targets alone far off their neighbours.
    pub outliers: Occurrences,
    /// The recording that this one repeats, and that was kept in its place.
    pub repeats: Option<String>,
}

impl Cleaning {
    /// Whether nothing was found.
    pub fn is_clean(&self) -> bool {
        let found = [&self.missing, &self.doubled, &self.implausible_inputs, &self.implausible_targets, &self.outliers];
        self.repeats.is_none() && found.iter().all(|found| found.count == 0)
    }

    /// What was found, in words; empty where nothing was.
    pub fn words(&self) -> String {
        let kinds = [
            (&self.missing, "missing samples"),
            (&self.doubled, "doubled rows, left out"),
            (&self.implausible_inputs, "implausible inputs, the last plausible value stands in"),
            (&self.implausible_targets, "implausible targets, left out"),
            (&self.outliers, "outliers of the target, left out"),
        ];
        let mut said: Vec<String> = kinds
            .iter()
            .filter(|(found, _)| found.count > 0)
            .map(|(found, what)| {
                let first: Vec<String> = found.first_s.iter().map(|time_s| format!("{time_s:.2}")).collect();
                format!("{} {what} (first at {} s)", found.count, first.join(", "))
            })
            .collect();
        said.extend(self.repeats.iter().map(|other| format!("the same rows as {other}: left out")));
        said.join("; ")
    }
}

/// Recordings fit for training, and what was found in all that were given.
#[derive(Clone, Debug, PartialEq)]
pub struct Prepared {
    /// The recordings, in the order given, without repeated ones.
    pub recordings: Vec<Recording>,
    /// One entry for every recording given.
    pub cleanings: Vec<Cleaning>,
}

/// Prepares recordings for learning a signal.
pub fn prepare(recordings: Vec<Recording>, signal: Signal) -> Prepared {
    let mut prepared = Prepared { recordings: vec![], cleanings: vec![] };
    for recording in recordings {
        let mut cleaning = Cleaning { name: recording.name.clone(), ..Cleaning::default() };
        let twin = prepared.recordings.iter().find(|other| same_rows(&other.frames, &recording.frames));
        if let Some(other) = twin {
            cleaning.repeats = Some(other.name.clone());
        } else {
            let frames = clean(&recording.frames, signal, &mut cleaning);
            prepared.recordings.push(Recording { frames, ..recording });
        }
        prepared.cleanings.push(cleaning);
    }
    prepared
}

/// Whether two recordings show the same, however their stamps are shifted.
fn same_rows(one: &[Frame], other: &[Frame]) -> bool {
    let words = |frame: &Frame| {
        let (inputs, measured) = (&frame.inputs, &frame.measured);
        [
            inputs.opening_command_pu,
            inputs.tank_pressure_pa,
            measured.spool_position_pu,
            measured.servomotor_position_pu,
        ]
        .map(f64::to_bits)
    };
    one.len() > 1 && one.len() == other.len() && one.iter().map(words).eq(other.iter().map(words))
}

fn clean(rows: &[Frame], signal: Signal, cleaning: &mut Cleaning) -> Vec<Frame> {
    let start_ns = rows.first().map_or(0, |frame| frame.time_ns);
    let since_s = |time_ns: i64| seconds_from_nanos(time_ns - start_ns);
    let mut frames: Vec<Frame> = Vec::with_capacity(rows.len());
    let (mut command_pu, mut pressure_pa, mut opening_pu) = (f64::NAN, f64::NAN, f64::NAN);
    for row in rows {
        let mut frame = *row;
        if frames.last().is_some_and(|last| frame.time_ns <= last.time_ns) {
            cleaning.doubled.at(1, since_s(frame.time_ns));
            continue;
        }
        let mut replaced = hold(&mut frame.inputs.opening_command_pu, &mut command_pu, &OPENINGS_PU);
        replaced += hold(&mut frame.inputs.tank_pressure_pa, &mut pressure_pa, &PRESSURES_PA);
        // A servomotor position that was not sampled here is no fault.
        if !frame.measured.servomotor_position_pu.is_nan() && signal != Signal::ServomotorPosition {
            replaced += hold(&mut frame.measured.servomotor_position_pu, &mut opening_pu, &OPENINGS_PU);
        }
        if replaced > 0 {
            cleaning.implausible_inputs.at(replaced, since_s(frame.time_ns));
        }
        let target = signal.of(&frame.measured);
        cleaning.samples += u64::from(!target.is_nan());
        if !target.is_nan() && !plausible(signal).contains(&target) {
            cleaning.implausible_targets.at(1, since_s(frame.time_ns));
            forget(&mut frame.measured, signal);
        }
        frames.push(frame);
    }
    let sampled: Vec<usize> = (0..frames.len()).filter(|&at| signal.of(&frames[at].measured).is_finite()).collect();
    count_missing(&frames, &sampled, cleaning);
    let span = plausible(signal).end() - plausible(signal).start();
    for near in sampled.windows(3) {
        let [before, at, after] = [near[0], near[1], near[2]].map(|at| signal.of(&frames[at].measured));
        let (one, other) = (at - before, at - after);
        let off = one.abs().min(other.abs()) > OUTLIER_SHARE * span && one.signum() == other.signum();
        let moved_pu =
            |to: usize| frames[to].measured.servomotor_position_pu - frames[near[0]].measured.servomotor_position_pu;
        if off && moved_pu(near[1]).abs() < AT_REST_PU && moved_pu(near[2]).abs() < AT_REST_PU {
            cleaning.outliers.at(1, since_s(frames[near[1]].time_ns));
            forget(&mut frames[near[1]].measured, signal);
        }
    }
    frames
}

/// Puts the last plausible value in the place of one that is not; how many were replaced.
fn hold(value: &mut f64, last: &mut f64, plausible: &RangeInclusive<f64>) -> u64 {
    if plausible.contains(value) {
        *last = *value;
        return 0;
    }
    *value = *last;
    1
}

fn plausible(signal: Signal) -> RangeInclusive<f64> {
    match signal {
        Signal::ServomotorPosition => OPENINGS_PU,
        Signal::SpoolPosition | Signal::PilotValvePosition => STROKES_PU,
        Signal::ControlPressure => PRESSURES_PA,
    }
}

fn forget(measured: &mut Signals, signal: Signal) {
    *measured = signal.with(*measured, f64::NAN);
}

fn count_missing(frames: &[Frame], sampled: &[usize], cleaning: &mut Cleaning) {
    let period_ns = median_spacing_ns(sampled.iter().map(|&at| frames[at].time_ns));
    if period_ns == 0 {
        return;
    }
    for pair in sampled.windows(2) {
        let (from_ns, to_ns) = (frames[pair[0]].time_ns, frames[pair[1]].time_ns);
        let absent = (to_ns - from_ns + period_ns / 2) / period_ns - 1;
        if absent > 0 {
            cleaning.missing.at(u64::try_from(absent).unwrap_or(0), seconds_from_nanos(from_ns - frames[0].time_ns));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::prepare;
    use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
    use govtwin_model::recording::Recording;
    use govtwin_model::signal::Signal;

    fn frames(count: i64) -> Vec<Frame> {
        let frame = |k: i64| Frame {
            time_ns: k * 200_000_000,
            inputs: Inputs {
                opening_command_pu: 0.4 + 1e-4 * k as f64,
                esv: EsvState::Normal,
                tank_pressure_pa: 6.3e6,
                piston_force_n: 0.0,
            },
            measured: Signals {
                spool_position_pu: 0.01 * (k % 3) as f64,
                servomotor_position_pu: 0.4,
                ..Signals::NONE
            },
        };
        (0..count).map(frame).collect()
    }

    fn one(frames: Vec<Frame>) -> (Recording, super::Cleaning) {
        let mut prepared = prepare(vec![Recording::new("a", frames)], Signal::SpoolPosition);
        (prepared.recordings.remove(0), prepared.cleanings.remove(0))
    }

    #[test]
    fn a_clean_recording_stays_as_it_is() {
        let (recording, cleaning) = one(frames(100));
        assert_eq!(format!("{:?}", recording.frames), format!("{:?}", frames(100)));
        assert!(cleaning.is_clean() && cleaning.words().is_empty());
        assert_eq!(cleaning.samples, 100);
    }

    #[test]
    fn every_fault_is_found_counted_and_placed() {
        let mut rows = frames(100);
        rows[20].measured.spool_position_pu = 0.8; // alone, at rest
        rows[30].measured.spool_position_pu = 7.0;
        rows[40].inputs.tank_pressure_pa = f64::NAN;
        rows[41].inputs.opening_command_pu = 3.0;
        rows[50].measured.servomotor_position_pu = -4.0;
        rows.insert(61, rows[60]);
        rows.drain(80..83);
        let (recording, cleaning) = one(rows);
        assert_eq!(cleaning.outliers.first_s, [4.0]);
        assert_eq!(cleaning.implausible_targets.first_s, [6.0]);
        assert_eq!((cleaning.implausible_inputs.count, cleaning.implausible_inputs.first_s[0]), (3, 8.0));
        assert_eq!(cleaning.doubled.first_s, [12.0]);
        // The row dropped at 6 s and the three at 15.8 s.
        assert_eq!(cleaning.missing.count, 4);
        assert!(
            cleaning.missing.first_s.iter().zip([5.8, 15.6]).all(|(found, expected)| (found - expected).abs() < 1e-9)
        );
        assert_eq!(recording.frames.len(), 97);
        assert!(recording.frames[20].measured.spool_position_pu.is_nan());
        assert_eq!(recording.frames[40].inputs.tank_pressure_pa, 6.3e6);
        assert_eq!(recording.frames[50].measured.servomotor_position_pu, 0.4);
        assert!(cleaning.words().contains("1 outliers of the target, left out (first at 4.00 s)"));
    }

    #[test]
    fn a_step_and_a_moving_servomotor_are_no_outliers() {
        let mut rows = frames(60);
        for row in &mut rows[30..] {
            row.measured.spool_position_pu += 0.9;
        }
        rows[10].measured.spool_position_pu = 0.8;
        for (k, row) in rows.iter_mut().enumerate().take(20) {
            row.measured.servomotor_position_pu = 0.4 + 0.01 * k as f64;
        }
        assert!(one(rows).1.is_clean());
    }

    #[test]
    fn the_same_recording_twice_is_kept_once() {
        let mut later = frames(50);
        for row in &mut later {
            row.time_ns += 3_600_000_000_000;
        }
        let both = vec![Recording::new("a", frames(50)), Recording::new("b", later)];
        let prepared = prepare(both, Signal::SpoolPosition);
        assert_eq!(prepared.recordings.len(), 1);
        assert_eq!(prepared.cleanings[1].repeats.as_deref(), Some("a"));
    }
}
