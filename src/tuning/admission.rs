//! Admission: what of a recording a fit may use, and what it must not believe.

use crate::frame::{EsvState, Signals};
use crate::recording::Recording;
use crate::signal::Signal;
use crate::tuning::trial::Trial;

/// Fewer samples than this say nothing about a servo system.
const FEWEST_SAMPLES: usize = 50;
/// A shorter recording shows no movement from beginning to end, s.
const SHORTEST_S: f64 = 5.0;
/// A command that moves less asks nothing of the unit, pu.
const LEAST_MOVE_PU: f64 = 0.01;
/// A command that moves more must move spool and servomotor, pu.
const CLEAR_MOVE_PU: f64 = 0.03;
/// Gaps of a channel worth a word, as a share of its samples.
const GAPS_SHARE: f64 = 0.05;

/// A recording ready for a fit, and what there is to say of it.
#[derive(Clone, Debug)]
pub struct Admitted {
    /// The trial, without the channels that cannot be believed.
    pub trial: Trial,
    /// Warnings, each a sentence.
    pub notes: Vec<String>,
}

/// Takes a recording in, or says in a sentence why it cannot be used.
///
/// # Errors
/// When it is too short, or holds no command or nothing measured.
pub fn admit(mut recording: Recording) -> Result<Admitted, String> {
    let mut notes = Vec::new();
    let commands = || recording.frames.iter().map(|frame| frame.inputs.opening_command_pu);
    let Some(command_span_pu) = span(commands()) else {
        return Err("holds no opening command; a fit needs what was asked of the unit".to_owned());
    };
    let tripped = recording.frames.iter().any(|frame| frame.inputs.esv == EsvState::Shutdown);
    if command_span_pu < LEAST_MOVE_PU && !tripped {
        notes.push(format!(
            "the command moves by {command_span_pu:.4} pu only and the emergency valve rests: too little excitation to tell \
             much; a start-up, a load change or a trip would"
        ));
    }
    for signal in Signal::ALL {
        let values = || recording.frames.iter().map(|frame| signal.of(&frame.measured)).filter(|v| v.is_finite());
        let count = values().count();
        if count > 1 && span(values()) == Some(0.0) && (command_span_pu > CLEAR_MOVE_PU || tripped) {
            notes.push(format!("{} is constant while the unit moves: left out, its transducer is stuck", signal.id()));
            recording.frames.iter_mut().for_each(|frame| forget(signal, &mut frame.measured));
        }
    }
    let trial = Trial::new(recording);
    let samples = trial.samples.len();
    let length_s = trial.period_s * samples as f64;
    if samples == 0 {
        return Err("holds no measured signal that can be used".to_owned());
    }
    if samples < FEWEST_SAMPLES || length_s < SHORTEST_S {
        return Err(format!(
            "{samples} samples over {length_s:.1} s; a fit needs at least {FEWEST_SAMPLES} over {SHORTEST_S} s"
        ));
    }
    for signal in Signal::ALL.into_iter().filter(|&signal| trial.has[signal as usize]) {
        let there = trial.samples.iter().filter(|&&row| signal.of(&trial.frames[row].measured).is_finite()).count();
        let missing = 1.0 - there as f64 / samples as f64;
        if missing > GAPS_SHARE {
            notes.push(format!(
                "{} is missing in {:.0} % of the samples; they are passed over",
                signal.id(),
                missing * 100.0
            ));
        }
    }
    Ok(Admitted { trial, notes })
}

/// Greatest less least of the finite values.
fn span(values: impl Iterator<Item = f64>) -> Option<f64> {
    let finite = values.filter(|value| value.is_finite());
    let ends = finite.fold(None, |ends: Option<(f64, f64)>, value| {
        Some(ends.map_or((value, value), |(low, high)| (low.min(value), high.max(value))))
    });
    ends.map(|(low, high)| high - low)
}

fn forget(signal: Signal, measured: &mut Signals) {
    match signal {
        Signal::ServomotorPosition => measured.servomotor_position_pu = f64::NAN,
        Signal::SpoolPosition => measured.spool_position_pu = f64::NAN,
        Signal::PilotValvePosition => measured.pilot_valve_position_pu = f64::NAN,
        Signal::ControlPressure => measured.control_pressure_pa = f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Frame, Inputs};

    fn recording(rows: i64, command_pu: impl Fn(i64) -> f64, servomotor_pu: impl Fn(i64) -> f64) -> Recording {
        let row = |k: i64| Frame {
            time_ns: k * 20_000_000,
            inputs: Inputs { opening_command_pu: command_pu(k), esv: EsvState::Normal, tank_pressure_pa: 6.3e6 },
            measured: Signals { servomotor_position_pu: servomotor_pu(k), ..Signals::NONE },
        };
        Recording::new("r", (0..rows).map(row).collect())
    }

    fn ramp(k: i64) -> f64 {
        k as f64 * 1e-3
    }

    #[test]
    fn a_sound_recording_passes_without_a_word() {
        let admitted = admit(recording(500, ramp, ramp)).unwrap();
        assert!(admitted.notes.is_empty() && admitted.trial.samples.len() == 500);
    }

    #[test]
    fn what_cannot_be_used_is_refused_in_a_sentence() {
        for (recording, words) in [
            (recording(10, ramp, ramp), "10 samples over 0.2 s"),
            (recording(500, |_| f64::NAN, ramp), "no opening command"),
            (recording(500, ramp, |_| f64::NAN), "no measured signal"),
            (recording(500, ramp, |_| 0.3), "no measured signal"),
        ] {
            let refused = admit(recording).unwrap_err();
            assert!(refused.contains(words), "{refused}");
        }
    }

    #[test]
    fn what_is_doubtful_is_said() {
        let notes = admit(recording(500, |_| 0.5, |k| 0.5 + 1e-4 * ramp(k))).unwrap().notes;
        assert!(notes[0].contains("too little excitation"), "{notes:?}");
        let notes = admit(recording(500, ramp, |k| if k % 4 == 0 { f64::NAN } else { ramp(k) })).unwrap().notes;
        assert!(notes.is_empty(), "rows without a sample are no samples: {notes:?}");
        let mut holed = recording(500, ramp, ramp);
        for (k, frame) in holed.frames.iter_mut().enumerate() {
            frame.measured.spool_position_pu = if k < 400 { ramp(3) * k as f64 } else { f64::NAN };
        }
        let notes = admit(holed).unwrap().notes;
        assert!(notes[0].contains("spool_position_pu is missing in 20 %"), "{notes:?}");
    }
}
