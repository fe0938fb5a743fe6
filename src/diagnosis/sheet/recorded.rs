//! Estimates from recordings of a unit that has neither sheet nor plate: values of a plate, each with its tolerance, and the noise of its transducers.
//!
//! Tank pressure, full-stroke times, stops and position gain can be read off recordings of command, spool and servomotor in pu. How large the unit
//! is cannot: positions are shares of strokes. [`fill`] then takes a servomotor of the reference unit's size, so that sizes of effects are those of
//! such a unit. What a plate states stays as it is.

use super::derive::{SIZED_BY, STROKES_PER_OVERLAP, spool_stroke_m};
use super::{GivenValue, Plate};
use crate::likelihood::prepared::join_spool;
use govtwin_model::frame::{EsvState, Frame};
use govtwin_model::metrics::{median, noise_of_bends};
use govtwin_model::parameters::{Sensor, Sensors, Unit};
use govtwin_model::recording::Recording;
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// Overlap of the main ports over the spool's stroke, as it is where a plate does not give it.
const OVERLAP_PU: f64 = 1.0 / STROKES_PER_OVERLAP;
/// Speeds are taken where the spool is at least so far towards its farthest position, and the servomotor is away from cushion and ends, pu.
const FAST: f64 = 0.4;
const AWAY_FROM_ENDS_PU: (f64, f64) = (0.08, 0.92);
/// Least time over which a speed is taken, s, and the fewest of them.
const OVER_S: f64 = 0.2;
const FEWEST_SPEEDS: usize = 3;
/// Rows within this share of the farthest spool position are at it.
const AT_FARTHEST: f64 = 0.02;
/// A stop holds the spool at least so long, s, while the deviation changes by this share or an emergency shutdown pushes.
const HELD_S: f64 = 0.2;
const PUSHED: f64 = 0.5;
/// Where nothing shows the stop: how far beyond the farthest position it is taken to be, with its tolerance.
const BEYOND: f64 = 1.25;
const BEYOND_TOLERANCE: f64 = 0.3;
/// Tolerance of a stop that was seen: under the force of a trip it yields by some hundredths of the stroke.
const STOP_TOLERANCE: f64 = 0.04;
/// The gain is taken where the spool is inside this share of its farthest position, as limits cut it off beyond.
const INSIDE: f64 = 0.7;
/// Share by which the spool may change over twice [`OVER_S`] and still stand: the lag behind the deviation then makes no difference.
const STANDS: f64 = 0.1;
/// Fewest rows that determine a gain; its tolerance if the spool rested, and if it never did.
const FEWEST_ROWS: usize = 8;
const GAIN_TOLERANCES: (f64, f64) = (0.15, 0.4);

/// What recordings added to a plate.
#[derive(Clone, Debug, PartialEq)]
pub struct Filled {
    /// Transducers as noisy as their signals are.
    pub sensors: Sensors,
    /// What could not be read off and was taken from the reference unit, in sentences.
    pub assumed: Vec<String>,
}

/// Why recordings make no sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NotEnough {
    /// No pressure.
    #[error(
        "no tank pressure was recorded; give it as a constant in an import map, or on a plate (`govtwin sheet new`)"
    )]
    TankPressure,
    /// No command.
    #[error("no command was recorded")]
    Command,
    /// No positions at common times.
    #[error("spool and servomotor position were not both recorded in pu; an import map gives their scale and offset")]
    Positions,
    /// Nothing moves.
    #[error("the servomotor never moves with the spool well open, so that nothing says how fast it is")]
    Speed,
    /// It moves the wrong way.
    #[error(
        "the servomotor does not open with positive and close with negative spool positions; a sign or a range in the import map is likely the \
         other way round"
    )]
    Turned,
}

/// One instant at which spool and servomotor are known.
#[derive(Clone, Copy, Debug)]
struct PositionRow {
    time_s: f64,
    spool_pu: f64,
    servomotor_pu: f64,
    deviation_pu: f64,
    esv: EsvState,
}

/// Adds to a plate what recordings determine and the plate does not state; sizes that neither has are the reference unit's.
///
/// # Errors
/// Where the recordings do not hold command, tank pressure, spool and servomotor in pu, or show no movement.
pub fn fill(plate: &mut Plate, recordings: &[Recording], reference: &Unit) -> Result<Filled, NotEnough> {
    let inputs = || recordings.iter().flat_map(|recording| &recording.frames).map(|frame| frame.inputs);
    let pressures_pa: Vec<f64> = inputs().map(|inputs| inputs.tank_pressure_pa).filter(|pa| pa.is_finite()).collect();
    if pressures_pa.is_empty() && plate.get("tank_pressure").is_none() {
        return Err(NotEnough::TankPressure);
    }
    if !inputs().any(|inputs| inputs.opening_command_pu.is_finite()) {
        return Err(NotEnough::Command);
    }
    let runs: Vec<Vec<PositionRow>> = recordings.iter().map(rows).filter(|rows| !rows.is_empty()).collect();
    if runs.is_empty() {
        return Err(NotEnough::Positions);
    }
    let mut recorded = Filled { sensors: sensors(recordings, &reference.sensors), assumed: vec![] };
    if !pressures_pa.is_empty() {
        let pressure_pa = median(pressures_pa);
        put(plate, "tank_pressure", pressure_pa, 0.01, format!("{:.3} MPa, median", 1e-6 * pressure_pa));
    }
    let spool_stroke_m = sizes(plate, reference, &mut recorded);
    let farthest = [1.0, -1.0].map(|sign| farthest(&runs, sign));
    let gains = [1.0, -1.0].map(|sign| speed_gain(&runs, sign, farthest[usize::from(sign < 0.0)]));
    if gains == [None, None] {
        return Err(NotEnough::Speed);
    }
    if gains.iter().flatten().any(|gain| *gain <= 0.0) {
        return Err(NotEnough::Turned);
    }
    for (k, [stop_key, time_key]) in
        [["spool_opening_stop", "opening_time"], ["spool_closing_stop", "closing_time"]].into_iter().enumerate()
    {
        let Some(gain_1_s) = gains[k] else { continue };
        let (stop_pu, tolerance, words) = stop(&runs, [1.0, -1.0][k], farthest[k]);
        put(
            plate,
            stop_key,
            spool_stroke_m * stop_pu,
            tolerance,
            format!("{stop_pu:.3} of the spool's stroke, {words}"),
        );
        let stop_pu = plate.get(stop_key).map_or(stop_pu, |stop_m| stop_m / spool_stroke_m);
        let time_s = 1.0 / (gain_1_s * (stop_pu - OVERLAP_PU).max(OVERLAP_PU));
        put(plate, time_key, time_s, 0.1, format!("{time_s:.3} s, by its speed where the spool was well open"));
    }
    match position_gain(&runs, farthest) {
        Some((gain, tolerance)) => {
            let words = format!("{gain:.3}, spool over deviation from the command");
            put(plate, "position_gain", gain, tolerance, words);
        }
        None => recorded.assumed.push("the recordings do not show the gain of the position loop".to_owned()),
    }
    Ok(recorded)
}

/// Puts a value onto a plate that does not have it.
fn put(plate: &mut Plate, key: &'static str, value: f64, tolerance: f64, text: String) {
    let given = || GivenValue { value, tolerance_share: Some(tolerance), text, source: "recordings".to_owned() };
    plate.values.entry(key).or_insert_with(given);
}

/// Sizes that no position shows; hands out the travel of the spool that counts as 1 pu, m.
fn sizes(plate: &mut Plate, reference: &Unit, recorded: &mut Filled) -> f64 {
    let assumed = "nobody knows; the reference unit's".to_owned();
    if !SIZED_BY.iter().any(|key| plate.values.contains_key(key)) {
        let servomotor = &reference.parameters.servomotor;
        let volume_m3 = servomotor.opening_area_m2 * servomotor.stroke_m;
        put(plate, "servomotor_stroke", servomotor.stroke_m, 0.0, assumed.clone());
        put(plate, "servomotor_volume", volume_m3, 0.0, assumed.clone());
        recorded.assumed.push(format!(
            "no recording shows the servomotor's size: sizes of effects are those of a servomotor of {:.0} L, and carry over as ratios",
            1e3 * volume_m3
        ));
    }
    spool_stroke_m(plate).unwrap_or_else(|| {
        let stroke_m = reference.parameters.distributing_valve.reference_stroke_m;
        put(plate, "spool_stroke", stroke_m, 0.0, assumed);
        stroke_m
    })
}

/// Rows of a recording at which spool and servomotor are known.
fn rows(recording: &Recording) -> Vec<PositionRow> {
    let mut frames = recording.frames.clone();
    join_spool(&mut frames);
    let row = |frame: &Frame| PositionRow {
        time_s: seconds_from_nanos(frame.time_ns - recording.frames[0].time_ns),
        spool_pu: frame.measured.spool_position_pu,
        servomotor_pu: frame.measured.servomotor_position_pu,
        deviation_pu: frame.inputs.opening_command_pu - frame.measured.servomotor_position_pu,
        esv: frame.inputs.esv,
    };
    frames.iter().map(row).filter(|row| row.spool_pu.is_finite() && row.servomotor_pu.is_finite()).collect()
}

/// How far the spool goes towards one side, pu.
fn farthest(runs: &[Vec<PositionRow>], sign: f64) -> f64 {
    runs.iter().flatten().map(|row| sign * row.spool_pu).fold(0.0, f64::max)
}

/// Speed of the servomotor over the spool beyond its overlap, 1/s, where the spool is well open towards one side.
fn speed_gain(runs: &[Vec<PositionRow>], sign: f64, farthest_pu: f64) -> Option<f64> {
    let least_pu = (FAST * farthest_pu).max(3.0 * OVERLAP_PU);
    let fast = |row: &PositionRow| {
        sign * row.spool_pu >= least_pu && (AWAY_FROM_ENDS_PU.0..=AWAY_FROM_ENDS_PU.1).contains(&row.servomotor_pu)
    };
    let mut gains = vec![];
    for run in runs.iter().flat_map(|run| run.chunk_by(|a, b| fast(a) && fast(b))).filter(|run| fast(&run[0])) {
        let mut from = 0;
        // Samples at 5 Hz are a rounding short of their period apart.
        while let Some(length) = run[from..].iter().position(|row| row.time_s - run[from].time_s >= 0.99 * OVER_S) {
            let part = &run[from..=from + length];
            let spool_pu = part.windows(2).map(|two| 0.5 * (two[0].spool_pu + two[1].spool_pu)).sum::<f64>();
            let beyond_pu = sign * spool_pu / length as f64 - OVERLAP_PU;
            let moved_pu = sign * (part[length].servomotor_pu - part[0].servomotor_pu);
            gains.push(moved_pu / (part[length].time_s - part[0].time_s) / beyond_pu);
            from += length;
        }
    }
    (gains.len() >= FEWEST_SPEEDS).then(|| median(gains))
}

/// Where the stop towards one side is, pu, with its tolerance and how it is known.
fn stop(runs: &[Vec<PositionRow>], sign: f64, farthest_pu: f64) -> (f64, f64, &'static str) {
    let at = |row: &PositionRow| sign * row.spool_pu >= (1.0 - AT_FARTHEST) * farthest_pu;
    let near: Vec<&[PositionRow]> =
        runs.iter().flat_map(|run| run.chunk_by(|a, b| at(a) && at(b))).filter(|run| at(&run[0])).collect();
    let held_s: f64 = near.iter().map(|run| run[run.len() - 1].time_s - run[0].time_s).sum();
    let deviations: Vec<f64> = near.iter().copied().flatten().map(|row| row.deviation_pu.abs()).collect();
    let (least, most) =
        deviations.iter().fold((f64::INFINITY, 0.0_f64), |(least, most), &d| (least.min(d), most.max(d)));
    // A spool that rests because the deviation is constant is at no stop.
    let pushed = most - least > PUSHED * most || near.iter().copied().flatten().any(|row| row.esv != EsvState::Normal);
    if held_s >= 0.99 * HELD_S && pushed {
        let middle = median(near.iter().copied().flatten().map(|row| sign * row.spool_pu).collect());
        (middle, STOP_TOLERANCE, "where it was held")
    } else {
        (BEYOND * farthest_pu, BEYOND_TOLERANCE, "a quarter beyond its farthest position, as nothing shows the stop")
    }
}

/// Gain of the position loop, and its tolerance: the spool beyond the jump over its overlap, over the deviation from the command.
fn position_gain(runs: &[Vec<PositionRow>], farthest: [f64; 2]) -> Option<(f64, f64)> {
    let (mut standing, mut moving) = (vec![], vec![]);
    for run in runs {
        for (k, row) in run.iter().enumerate() {
            let spool_pu = row.spool_pu.abs();
            let limit_pu = INSIDE * farthest[usize::from(row.spool_pu < 0.0)];
            if row.esv != EsvState::Normal || spool_pu < 3.0 * OVERLAP_PU || spool_pu > limit_pu {
                continue;
            }
            let gain = (spool_pu - OVERLAP_PU) * row.spool_pu.signum() / row.deviation_pu;
            if !(gain.is_finite() && gain > 0.0) {
                continue;
            }
            let before = run[..k].iter().rev().find(|other| row.time_s - other.time_s >= 0.99 * OVER_S);
            let behind = run[k..].iter().find(|other| other.time_s - row.time_s >= 0.99 * OVER_S);
            let stands = |other: &PositionRow| (other.spool_pu - row.spool_pu).abs() <= STANDS * spool_pu;
            let both = before.zip(behind).is_some_and(|(before, behind)| stands(before) && stands(behind));
            if both { standing.push(gain) } else { moving.push(gain) }
        }
    }
    let known = if standing.len() >= FEWEST_ROWS { Some((standing, GAIN_TOLERANCES.0)) } else { None };
    let (gains, tolerance) = known.or_else(|| (moving.len() >= FEWEST_ROWS).then_some((moving, GAIN_TOLERANCES.1)))?;
    Some((median(gains), tolerance))
}

/// Transducers as noisy as their signals bend from sample to sample in the quietest recording, with the least step that occurs.
fn sensors(recordings: &[Recording], reference: &Sensors) -> Sensors {
    let mut sensors = *reference;
    for (signal, sensor) in [
        (Signal::SpoolPosition, &mut sensors.spool_position_pu),
        (Signal::ServomotorPosition, &mut sensors.servomotor_position_pu),
        (Signal::PilotValvePosition, &mut sensors.pilot_valve_position_pu),
        (Signal::ControlPressure, &mut sensors.control_pressure_pa),
    ] {
        let of = |recording: &Recording| transducer(recording, signal);
        let quietest = recordings.iter().filter_map(of).min_by(|a, b| a.noise.total_cmp(&b.noise));
        *sensor = quietest.unwrap_or(*sensor);
    }
    sensors
}

fn transducer(recording: &Recording, signal: Signal) -> Option<Sensor> {
    let values = recording.frames.iter().map(|frame| signal.of(&frame.measured)).filter(|value| value.is_finite());
    let values: Vec<f64> = values.collect();
    let noise = noise_of_bends(values.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs()).collect());
    let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    // What rounding in the file makes of equal values is no step.
    let steps = values.windows(2).map(|two| (two[1] - two[0]).abs()).filter(|step| *step > 1e-7 * largest);
    let step = steps.fold(f64::INFINITY, f64::min);
    // A signal that mostly stays within one step is no noisier than a part of that.
    (noise.is_finite() && step.is_finite()).then(|| Sensor { noise: noise.max(0.25 * step), step })
}
