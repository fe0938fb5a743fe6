//! Data qualification: what of a recording a fit may use, and what it must not believe.

use govtwin_model::frame::{EsvState, Frame, Signals};
use govtwin_model::recording::Recording;
use govtwin_model::signal::{Signal, span};
use govtwin_model::twin::Cut;
use govtwin_model::units::seconds_from_nanos;

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

/// A longer stretch without a sample is worth a word, s.
const SILENCE_S: f64 = 2.0;
/// Equal neighbours at an end of a channel's range, as a share of its samples, from which on it is taken for saturated.
const SATURATED_SHARE: f64 = 0.02;
/// Samples one behind another that stand at the very end of the range while saturated.
const SATURATED_RUN: usize = 10;
/// Equal neighbours elsewhere, as a share, up to which a channel is lively enough for standing still to mean something.
const LIVELY_SHARE: f64 = 0.2;

/// A recording ready for a fit, and what there is to say of it.
#[derive(Debug)]
struct Qualified {
    /// The recording, without the samples that cannot be believed.
    recording: Recording,
    /// Warnings, each a sentence without its full stop.
    notes: Vec<String>,
}

/// Recordings taken in, and what there is to say of them and of the others.
#[derive(Clone, Debug, Default)]
pub struct QualifiedRecordings {
    /// Those that can be used, in their order, each with its cut.
    pub qualified: Vec<(Recording, Cut)>,
    /// Warnings, each with the name of its recording, without full stop.
    pub notes: Vec<String>,
    /// Why the others cannot be used, each with its name, without full stop.
    pub refused: Vec<String>,
}

/// Takes recordings in, each cut as the law says.
pub fn qualify_all(recordings: Vec<Recording>, cut: impl Fn(&Recording) -> Cut) -> QualifiedRecordings {
    let mut intake = QualifiedRecordings::default();
    for recording in recordings {
        let (name, cut) = (recording.name.clone(), cut(&recording));
        match qualify(recording, cut) {
            Ok(Qualified { recording, notes }) => {
                intake.notes.extend(notes.into_iter().map(|note| format!("{name}: {note}")));
                intake.qualified.push((recording, cut));
            }
            Err(reason) => intake.refused.push(format!("{name}: {reason}")),
        }
    }
    intake
}

/// Takes a recording in, or says in a sentence why it cannot be used.
///
/// The cut says what drives the twin: at [`Cut::Spool`] the measured spool stands in for the command, and both positions are
/// needed; time then has no scale of its own. A spool or servomotor that rests at an end of its range is then taken for one at its stop: a valve that is
/// switched does nothing else.
///
/// # Errors
/// When it is too short, or holds nothing that drives a twin, or nothing measured.
fn qualify(mut recording: Recording, cut: Cut) -> Result<Qualified, String> {
    let mut notes = Vec::new();
    notes.extend(keep_longest_rise(&mut recording));
    let commands = || recording.frames.iter().map(|frame| frame.inputs.opening_command_pu);
    let tripped = recording.frames.iter().any(|frame| frame.inputs.esv == EsvState::Shutdown);
    let mut moved = tripped;
    if cut == Cut::Spool {
        for signal in [Signal::SpoolPosition, Signal::ServomotorPosition] {
            let values = || recording.frames.iter().map(|frame| signal.of(&frame.measured));
            match span(values()) {
                None => return Err(format!("holds neither an opening command nor {}", signal.id())),
                Some(0.0) => return Err(format!("holds no opening command, and {} is constant", signal.id())),
                Some(_) => {}
            }
        }
    } else {
        let Some(command_span_pu) = span(commands()) else {
            return Err(
                "holds no opening command; a fit of the whole chain needs what was asked of the unit".to_owned()
            );
        };
        moved |= command_span_pu > CLEAR_MOVE_PU;
        if command_span_pu < LEAST_MOVE_PU && !tripped {
            notes.push(format!(
                "the command moves by only {command_span_pu:.4} pu and the ESV does not trip: too little excitation for a reliable result; \
                 record a start-up, a load change or a trip"
            ));
        }
    }
    for signal in Signal::ALL {
        let values: Vec<f64> =
            recording.frames.iter().map(|frame| signal.of(&frame.measured)).filter(|v| v.is_finite()).collect();
        if moved && values.len() > 1 && span(values.iter().copied()) == Some(0.0) {
            notes.push(format!(
                "{} is constant while the unit moves: left out, as its transducer is stuck",
                signal.id()
            ));
            recording.frames.iter_mut().for_each(|frame| forget(signal, &mut frame.measured));
        } else if let Some((end, count)) = saturated(&values).filter(|_| cut != Cut::Spool) {
            notes.push(format!(
                "{} stands at {end:.4} {} in {count} of {} samples, equal to the last digit: saturated, so these samples are ignored",
                signal.id(),
                signal.unit(),
                values.len()
            ));
            let at_end = |frame: &&mut Frame| signal.of(&frame.measured) == end;
            recording.frames.iter_mut().filter(at_end).for_each(|frame| forget(signal, &mut frame.measured));
        }
    }
    check_samples(&recording, cut, &mut notes)?;
    Ok(Qualified { recording, notes })
}

/// Whether there are samples enough, and what is missing among them.
fn check_samples(recording: &Recording, cut: Cut, notes: &mut Vec<String>) -> Result<(), String> {
    let has = |frame: &Frame, signal: Signal| signal.of(&frame.measured).is_finite();
    let seen = |frame: &&Frame| match cut {
        Cut::Spool => has(frame, Signal::SpoolPosition) && has(frame, Signal::ServomotorPosition),
        _ => Signal::ALL.iter().any(|&signal| has(frame, signal)),
    };
    let rows: Vec<&Frame> = recording.frames.iter().filter(seen).collect();
    let samples = rows.len();
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
        return Err("holds no measured signal that can be used".to_owned());
    };
    let length_s = seconds_from_nanos(last.time_ns - first.time_ns);
    if samples < FEWEST_SAMPLES || (length_s < SHORTEST_S && cut != Cut::Spool) {
        return Err(format!(
            "{samples} samples over {length_s:.1} s; at least {FEWEST_SAMPLES} over {SHORTEST_S} s are needed"
        ));
    }
    let silence = |pair: &[&Frame]| seconds_from_nanos(pair[1].time_ns - pair[0].time_ns);
    let longest_s = rows.windows(2).map(silence).fold(0.0, f64::max);
    if longest_s > SILENCE_S.max(20.0 * length_s / samples as f64) {
        notes.push(format!("nothing was measured for {longest_s:.1} s: this gap is ignored"));
    }
    for signal in Signal::ALL {
        let there = rows.iter().filter(|frame| has(frame, signal)).count();
        let missing = 1.0 - there as f64 / samples as f64;
        if there == 0 && Signal::POSITIONS.contains(&signal) {
            notes.push(format!(
                "{} was not recorded or cannot be used: faults that only it shows cannot be found",
                signal.id()
            ));
        } else if there > 0 && missing > GAPS_SHARE {
            let percent = missing * 100.0;
            notes.push(format!("{} is missing in {percent:.0} % of the samples, which are ignored", signal.id()));
        }
    }
    Ok(())
}

/// Leaves the longest stretch in which time rises; a clock that jumps back makes two recordings of one.
fn keep_longest_rise(recording: &mut Recording) -> Option<String> {
    let frames = &recording.frames;
    let breaks = (1..frames.len()).filter(|&k| frames[k].time_ns <= frames[k - 1].time_ns);
    let mut edges: Vec<usize> = std::iter::once(0).chain(breaks).collect();
    edges.push(frames.len());
    if edges.len() == 2 {
        return None;
    }
    let longest = edges.windows(2).max_by_key(|pair| pair[1] - pair[0]).map(|pair| (pair[0], pair[1]))?;
    let left_out = frames.len() - (longest.1 - longest.0);
    recording.frames = frames[longest.0..longest.1].to_vec();
    Some(format!(
        "its clock jumps back {} times: {left_out} rows outside the longest stretch left out",
        edges.len() - 2
    ))
}

/// The end of the range at which a lively channel stands still again and again, and in how many samples.
fn saturated(values: &[f64]) -> Option<(f64, usize)> {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let equal = |inside: bool| {
        values.windows(2).filter(|pair| pair[0] == pair[1] && (pair[0] == low || pair[0] == high) != inside).count()
    };
    let count = values.len().max(1) as f64;
    if equal(true) as f64 > LIVELY_SHARE * count {
        return None;
    }
    [high, low].into_iter().find_map(|end| {
        let at_end = values.iter().filter(|value| **value == end).count();
        let run = values.split(|value| *value != end).map(<[f64]>::len).max().unwrap_or(0);
        (run >= SATURATED_RUN && at_end as f64 > SATURATED_SHARE * count).then_some((end, at_end))
    })
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
    use govtwin_model::frame::{Frame, Inputs};

    fn recording(rows: i64, command_pu: impl Fn(i64) -> f64, servomotor_pu: impl Fn(i64) -> f64) -> Recording {
        let row = |k: i64| Frame {
            time_ns: k * 20_000_000,
            inputs: Inputs {
                opening_command_pu: command_pu(k),
                esv: EsvState::Normal,
                tank_pressure_pa: 6.3e6,
                piston_force_n: 0.0,
            },
            measured: Signals { servomotor_position_pu: servomotor_pu(k), ..Signals::NONE },
        };
        Recording::new("r", (0..rows).map(row).collect())
    }

    fn ramp(k: i64) -> f64 {
        k as f64 * 1e-3
    }

    fn chain(recording: Recording) -> Result<Qualified, String> {
        qualify(recording, Cut::None)
    }

    #[test]
    fn a_sound_recording_passes_without_a_word() {
        let qualified = chain(recording(500, ramp, ramp)).unwrap();
        assert!(qualified.recording.frames.len() == 500);
        let said = qualified.notes.join(" ");
        assert!(qualified.notes.len() == 1 && said.contains("spool_position_pu was not recorded"), "{said}");
    }

    #[test]
    fn what_cannot_be_used_is_refused_in_a_sentence() {
        for (recording, words) in [
            (recording(10, ramp, ramp), "10 samples over 0.2 s"),
            (recording(500, |_| f64::NAN, ramp), "no opening command"),
            (recording(500, ramp, |_| f64::NAN), "no measured signal"),
            (recording(500, ramp, |_| 0.3), "no measured signal"),
        ] {
            let refused = chain(recording).unwrap_err();
            assert!(refused.contains(words), "{refused}");
        }
        let refused = qualify(recording(500, |_| f64::NAN, ramp), Cut::Spool).unwrap_err();
        assert!(refused.contains("neither an opening command nor spool_position_pu"), "{refused}");
    }

    #[test]
    fn what_is_doubtful_is_said() {
        let notes = chain(recording(500, |_| 0.5, |k| 0.5 + 1e-4 * ramp(k))).unwrap().notes;
        assert!(notes[0].contains("too little excitation"), "{notes:?}");
        let mut holed = recording(500, ramp, ramp);
        for (k, frame) in holed.frames.iter_mut().enumerate() {
            frame.measured.spool_position_pu = if k < 400 { ramp(3) * k as f64 } else { f64::NAN };
        }
        let notes = chain(holed).unwrap().notes;
        assert!(notes[0].contains("spool_position_pu is missing in 20 %"), "{notes:?}");
    }

    #[test]
    fn a_transducer_at_its_end_is_passed_over_there() {
        let wave = |k: i64| 0.3 * (k as f64 * 0.02).sin();
        let notes = chain(recording(900, ramp, move |k| wave(k).min(0.2))).unwrap();
        assert!(notes.notes[0].contains("saturated"), "{:?}", notes.notes);
        let left = notes.recording.frames.iter().filter(|f| f.measured.servomotor_position_pu == 0.2).count();
        assert_eq!(left, 0);
        let coarse = move |k: i64| (wave(k) * 20.0).round() / 20.0;
        let said = chain(recording(900, ramp, coarse)).unwrap().notes.join(" ");
        assert!(!said.contains("saturated"), "coarse steps are no saturation: {said}");
    }

    #[test]
    fn of_a_clock_that_jumps_the_longest_stretch_stays() {
        let mut jumped = recording(600, ramp, ramp);
        jumped.frames[400..].iter_mut().for_each(|frame| frame.time_ns -= 5_000_000_000);
        let qualified = chain(jumped).unwrap();
        assert_eq!(qualified.recording.frames.len(), 400);
        assert!(qualified.notes[0].contains("jumps back 1 times: 200 rows"), "{:?}", qualified.notes);
    }
}
