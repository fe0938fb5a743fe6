//! A unit of which neither sheet nor plate is known, but command, spool and servomotor were recorded: a plate of what the recordings say of it, and
//! the rest by a plate's formulas with wide tolerances.
//!
//! Stops are the farthest that the spool went, stroke times and dead band those of the plain law between spool and servomotor
//! ([`crate::stage_alone::plain`]), the gain of the position loop is the slope of the spool over the deviation from the command, and transducers
//! are as noisy as their signals bend from sample to sample. How large the unit is no position says: it is taken to have the reference unit's
//! servomotor, so that sizes of effects are those of such a unit.

use super::{GivenValue, Plate, derive};
use crate::frame::{EsvState, Frame};
use crate::likelihood::prepared::{PreparedRecording, join_spool};
use crate::parameters::{ENTRIES, Sensor, Tolerance, Unit};
use crate::recording::Recording;
use crate::signal::Signal;
use crate::stage_alone::pieces::pieces;
use crate::stage_alone::plain::{Plain, plain};
use crate::stage_alone::run::Run;
use crate::units::seconds_from_nanos;

/// Pieces that all recordings are cut into for the plain law, at most.
const PIECES: usize = 12;
/// Travel of the spool that counts as 1 pu, m: the reference unit's, as no position says how long it is.
const SPOOL_STROKE_M: f64 = 0.015;
/// Stroke and volume of the servomotor, m and m3: the reference unit's.
const SERVOMOTOR: (f64, f64) = (0.6, 0.12);
/// Least dead band that is measured, as a share of the spool's stroke; overlaps are no narrower.
const LEAST_BAND_PU: f64 = 0.002;
/// Share of the spool's farthest travel within which it follows the deviation, beyond which it may stand at a limit.
const FOLLOWS: f64 = 0.7;
/// A spool that stays within this share of its farthest position for so long, s, stands at a stop; where none does, the stop is so many times as far.
const AT_STOP: (f64, f64) = (0.01, 0.2);
const BEYOND: f64 = 1.25;
/// Tolerances of what the recordings say, standard deviations of logarithms: the plain law knows no load and no pressure drop.
const WIDE: [(&str, f64); 6] = [
    ("main_ports.width_m", 0.2),
    ("main_ports.overlap_m", 0.5),
    ("distributing_valve.stroke_max_m", 0.1),
    ("distributing_valve.stroke_min_m", 0.1),
    ("regulator.position_gain", 0.4),
    ("regulator.spool_gain", 0.5),
];

/// A unit made of its recordings.
#[derive(Clone, Debug)]
pub struct FromRecordings {
    /// The unit, every tolerance wide.
    pub unit: Unit,
    /// What it was made of, in sentences.
    pub notes: Vec<String>,
}

/// Makes a unit of recordings that hold command, spool, servomotor and tank pressure, positions in pu.
///
/// # Errors
/// In a sentence with the way out, where they do not hold what it takes.
pub fn from_recordings(recordings: &[Recording], reference: &Unit) -> Result<FromRecordings, String> {
    let mut joined = recordings.to_vec();
    for recording in &mut joined {
        join_spool(&mut recording.frames);
    }
    let pressure_pa = median(all(&joined, |frame| frame.inputs.tank_pressure_pa)).ok_or(
        "no tank pressure was recorded: give it as a constant in an import map, or name a sheet with --params",
    )?;
    let positions = |signal: Signal| ends(all(&joined, |frame| signal.of(&frame.measured)));
    let ((low, high), (closed, open)) =
        positions(Signal::SpoolPosition).zip(positions(Signal::ServomotorPosition)).ok_or(
            "spool or servomotor position was not recorded, so that no chain can be judged: without `=chain` --no-sheet judges the stage alone",
        )?;
    let prepared: Vec<PreparedRecording> =
        pieces(&joined, PIECES).into_iter().map(PreparedRecording::servomotor_stage).collect();
    let law =
        plain(&Run::all(&prepared)).ok_or("the spool stands still, so that nothing says how fast the servomotor is")?;
    let [opening_stop, closing_stop] = [stop(&joined, high), stop(&joined, low)];
    let speeds = [
        law.above_1_s * (opening_stop - law.zero - law.half_band),
        law.below_1_s * (closing_stop - law.zero + law.half_band),
    ];
    if !(speeds[0] > 0.0 && speeds[1] < 0.0 && open > closed) {
        return Err("the servomotor does not open with positive and close with negative spool positions: a sign or a range in the import map \
                    is likely the other way round"
            .to_owned());
    }
    let gain = position_gain(&joined, &law, (low, high));
    let plate = plate(pressure_pa, [opening_stop, -closing_stop], speeds, &law, gain);
    let derived = derive(&plate, reference).map_err(|problems| problems.join("; "))?;
    let mut unit = derived.unit;
    for (key, wide) in WIDE {
        if let Some(index) = ENTRIES.iter().position(|entry| entry.key == key) {
            unit.tolerances[index] = Some(Tolerance::LogNormal(wide));
        }
    }
    for (signal, sensor) in [
        (Signal::SpoolPosition, &mut unit.sensors.spool_position_pu),
        (Signal::ServomotorPosition, &mut unit.sensors.servomotor_position_pu),
    ] {
        if let Some(measured) = transducer(&joined, signal) {
            *sensor = measured;
        }
    }
    let notes = vec![format!(
        "No data sheet: a unit was made of the recordings. Measured: tank pressure {:.3} MPa, spool from {low:.3} to {high:.3} pu, full stroke in \
         {:.3} s opening and {:.3} s closing at the stops, taken to be at {closing_stop:.3} and {opening_stop:.3} pu, dead band {:.2} % of the spool's stroke{}. The rest follows by the formulas of a name plate with wide \
         tolerances. Positions do not say how large the unit is: sizes are those of a servomotor of {:.0} L.",
        1e-6 * pressure_pa,
        1.0 / speeds[0],
        -1.0 / speeds[1],
        200.0 * law.half_band,
        gain.map_or_else(String::new, |gain| format!(", position gain {gain:.3}")),
        1e3 * SERVOMOTOR.1
    )];
    Ok(FromRecordings { unit, notes })
}

fn plate(pressure_pa: f64, stops_pu: [f64; 2], speeds: [f64; 2], law: &Plain, gain: Option<f64>) -> Plate {
    let mut plate = Plate { name: "unit made of its recordings".to_owned(), ..Plate::default() };
    let band_pu = law.half_band.clamp(LEAST_BAND_PU, 0.3 * stops_pu[0].min(stops_pu[1]));
    let values = [
        ("tank_pressure", Some(pressure_pa)),
        ("servomotor_stroke", Some(SERVOMOTOR.0)),
        ("servomotor_volume", Some(SERVOMOTOR.1)),
        ("spool_stroke", Some(SPOOL_STROKE_M)),
        ("spool_opening_stop", Some(SPOOL_STROKE_M * stops_pu[0])),
        ("spool_closing_stop", Some(SPOOL_STROKE_M * stops_pu[1])),
        ("opening_time", Some(1.0 / speeds[0])),
        ("closing_time", Some(-1.0 / speeds[1])),
        ("port_overlap", Some(SPOOL_STROKE_M * band_pu)),
        ("position_gain", gain),
    ];
    let given = |value: f64| GivenValue {
        value,
        tolerance_share: None,
        text: format!("{value:.4}"),
        source: "recordings".to_owned(),
    };
    plate.values = values.into_iter().filter_map(|(key, value)| Some((key, given(value?)))).collect();
    plate
}

/// Where the stop is towards which the spool went farthest: there, where it stayed; else somewhat beyond.
fn stop(recordings: &[Recording], farthest_pu: f64) -> f64 {
    let near = |frame: &Frame| (frame.measured.spool_position_pu / farthest_pu - 1.0).abs() < AT_STOP.0;
    let stayed_ns: i64 = recordings
        .iter()
        .flat_map(|recording| recording.frames.windows(2))
        .filter(|two| two.iter().all(near))
        .map(|two| two[1].time_ns - two[0].time_ns)
        .sum();
    if seconds_from_nanos(stayed_ns) >= AT_STOP.1 { farthest_pu } else { BEYOND * farthest_pu }
}

/// Slope of the spool beyond its dead band over the deviation of the servomotor from the command, where neither valve nor regulator stand at a limit;
/// none where too little moves.
fn position_gain(recordings: &[Recording], law: &Plain, (low, high): (f64, f64)) -> Option<f64> {
    let (mut cross, mut square) = (0.0, 0.0);
    for frame in recordings.iter().flat_map(|recording| &recording.frames) {
        let (spool, servomotor) = (frame.measured.spool_position_pu, frame.measured.servomotor_position_pu);
        let deviation = frame.inputs.opening_command_pu - servomotor;
        let inside = spool > FOLLOWS * low && spool < FOLLOWS * high;
        if frame.inputs.esv == EsvState::Normal && inside && deviation.is_finite() {
            let off = spool - law.zero;
            let beyond = (off.abs() - law.half_band).max(0.0).copysign(off);
            cross += beyond * deviation;
            square += beyond * beyond;
        }
    }
    // The spool is what is exact here: its noise is far below its travel, that of the deviation is not.
    let gain = square / cross;
    (gain.is_finite() && (0.5..200.0).contains(&gain)).then_some(gain)
}

/// Noise and step of a transducer, by the quietest recording.
fn transducer(recordings: &[Recording], signal: Signal) -> Option<Sensor> {
    let of = |recording: &Recording| {
        let values: Vec<f64> =
            recording.frames.iter().map(|frame| signal.of(&frame.measured)).filter(|value| value.is_finite()).collect();
        let bends = values.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs()).collect();
        let step = values.windows(2).map(|two| (two[1] - two[0]).abs()).filter(|step| *step > 0.0);
        // Second differences of white noise have six times its variance.
        Some((median(bends)? / (0.6745 * 6.0_f64.sqrt()), step.fold(f64::INFINITY, f64::min)))
    };
    let all = recordings.iter().filter_map(of).filter(|(noise, step)| *noise > 0.0 && step.is_finite());
    let (noise, step) = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Sensor { noise, step })
}

fn all(recordings: &[Recording], of: impl Fn(&Frame) -> f64) -> Vec<f64> {
    recordings.iter().flat_map(|recording| recording.frames.iter().map(&of)).filter(|value| value.is_finite()).collect()
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn ends(values: Vec<f64>) -> Option<(f64, f64)> {
    let first = *values.first()?;
    Some(values.into_iter().fold((first, first), |(low, high), value| (low.min(value), high.max(value))))
}
