//! A unit without a data sheet: a symmetric servomotor stage of the right speed, every tolerance wide, nothing else known.
//!
//! It has the reference unit's geometry, on a clock that makes it as fast as the recordings say. Areas and load balance, so that both
//! directions are alike until an effect makes them differ; what an effect's size means in a unit of unknown size is its ratio to this one.

use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::noise::{Noise, expected};
use crate::likelihood::prepared::{PreparedRecording, hold_spool, join_spool};
use crate::stage_alone::competing_laws::Follows;
use crate::stage_alone::end_stops::{BetweenStops, between_stops};
use crate::stage_alone::flexible::{Flexible, flexible};
use crate::stage_alone::pieces::{PIECES, pieces};
use crate::stage_alone::plain::Plain;
use crate::stage_alone::run::Run;
use govtwin_model::effects::{CATALOGUE, Stage};
use govtwin_model::parameters::{ChannelReading, ChannelReadings, ENTRIES, EffectSetting, Tolerance, Unit};
use govtwin_model::recording::Recording;
use govtwin_model::signal::Signal;

/// Longest time between rows by the clock of the unit, s: some twelve rows in a travel.
const LONGEST_ROW_S: f64 = 1.0;
/// Load over the force that the tank's pressure gives: enough that its effect can speed up either direction.
const LOAD_SHARE: f64 = 0.35;
/// Coulomb friction, the same way.
const FRICTION_SHARE: f64 = 0.02;
/// Damping at full speed, as a share of the force that moves the piston.
const DAMPING_SHARE: f64 = 0.1;
/// Time to reach speed over the time for a full stroke.
const INERTIA_SHARE: f64 = 0.01;
/// Least overlap that a fit starts from, over the farthest spool position.
const OVERLAP_SHARE: f64 = 0.01;
/// Share of its stroke that the servomotor is taken to have travelled, and where that begins, pu.
const TRAVELLED: (f64, f64) = (0.9, 0.05);
/// Lag of the plain law, in times between rows, from which on the spool is taken as held: half of one, and what a fit may miss of it.
const HELD_FROM: f64 = 0.4;
/// Steps between the spool's ends to which its zero is rounded before the fit.
const ZERO_STEPS: f64 = 100.0;
/// What the wide tolerances are: a factor of e either way is two deviations or less.
///
/// Six deviations of friction, the most that a fit may take, are no more than the servomotor overcomes.
const WIDE: [(&str, f64); 5] = [
    ("main_ports.width_m", 1.5),
    ("main_ports.overlap_m", 1.5),
    ("servomotor.viscous_damping_n_s_m", 1.5),
    ("servomotor.coulomb_friction_n", 0.55),
    ("servomotor.moving_mass_kg", 1.0),
];
/// The effect that takes up where the spool's zero lies, which nobody knows without a sheet.
const SPOOL_ZERO: &str = "lvdt_bias";
/// Effects that only say in which units a signal was recorded.
const UNITS_ONLY: [&str; 3] = ["lvdt_bias", "lvdt_gain", "feedback_bias"];

/// Recordings of a stage of which no sheet is known, made ready for a fit.
#[derive(Clone, Debug)]
pub struct Sheetless {
    /// The recordings, in pu of what was travelled.
    pub whole: Vec<Recording>,
    /// The same in pieces, each to be left out in turn.
    pub pieces: Vec<PreparedRecording>,
    /// The unit to begin from, which knows how its channels are recorded.
    pub unit: Unit,
    /// What is fitted of it.
    pub free_parameters: Vec<FreeParameter>,
    /// Noise to expect: of the servomotor what the most flexible law leaves.
    pub noise: Noise,
    /// What was done, in sentences.
    pub notes: Vec<String>,
    /// The plain law.
    pub law: Plain,
    /// The most flexible law of spool and opening.
    pub seen: Flexible,
    /// What the position makes of the spool.
    pub follows: Follows,
    /// Share of the squared movement that is left on runs left out, where it sums the spool up, settles to it, or does neither.
    pub left: [f64; 3],
    /// Half of the time between rows where the spool is held from row to row, s; else 0.
    pub held_s: f64,
}

/// Makes recordings ready; none where spool or servomotor stand still.
///
/// All that follows sees positions in pu of what was travelled, about the zero of the spool that the plain law finds, so that scale, offset and sign
/// of either channel make no difference. A spool that acts half a row late or more is taken as held from row to row where it may be.
pub fn sheetless(mut whole: Vec<Recording>, reference: &Unit, may_hold: bool) -> Option<Sheetless> {
    for recording in &mut whole {
        join_spool(&mut recording.frames);
    }
    let recordings = |whole: &[Recording]| -> Vec<PreparedRecording> {
        pieces(whole, PIECES).into_iter().map(PreparedRecording::free_run).collect()
    };
    let BetweenStops { law, follows, left, stopped } = between_stops(&whole)?;
    let stopped_words = stopped.map(|(stopped, times)| {
        whole = stopped;
        format!(
            "The servomotor rests {times} times at an end of its travel although the spool drives it on: a stop holds it there, and the spool is \
             taken as closed."
        )
    });
    let period_s = recordings(&whole).first().map_or(0.1, |recording| recording.period_s);
    let held_s = if may_hold && law.lag.time_s() >= HELD_FROM * period_s { 0.5 * period_s } else { 0.0 };
    let (channels, mut notes) = into_pu(&mut whole, &law)?;
    notes.extend(stopped_words);
    if held_s > 0.0 {
        for recording in &mut whole {
            hold_spool(&mut recording.frames);
        }
        notes.push(
            "The servomotor follows the spool by half of the time between rows or more: the spool is taken as held from row to row, as a digital \
             controller sends it."
                .to_owned(),
        );
    }
    let mut pieces = recordings(&whole);
    let runs = Run::all(&pieces);
    let law = law.in_pu(channels.spool_position, channels.servomotor_position);
    let seen = flexible(&runs, &law)?;
    let unit = unit(reference, channels, &law, period_s);
    for piece in &mut pieces {
        piece.clock_ratio = unit.recorded.clock_ratio;
    }
    let mut noise = expected(&reference.sensors);
    noise[Signal::ServomotorPosition as usize] = seen.noise;
    notes.push(
        "No data sheet: speed, overlap, damping, friction, mass and the spool's zero are fitted freely, from a stage that is equal in both \
         directions. Sizes are those of a servomotor with the reference unit's geometry; only ratios carry over."
            .to_owned(),
    );
    notes.push(error_of_equations(&seen));
    Some(Sheetless {
        whole,
        pieces,
        free_parameters: free_parameters(&unit),
        unit,
        noise,
        notes,
        law,
        seen,
        follows,
        left,
        held_s,
    })
}

/// What is taken for noise where no sheet names a transducer.
fn error_of_equations(seen: &Flexible) -> String {
    format!(
        "No transducer data: from the changes between neighbouring samples, their noise causes an error of {:.2} % of the travel; effects are \
         compared with the error of the most flexible law of spool and opening, {:.2} %.",
        100.0 * seen.transducers / TRAVELLED.0,
        100.0 * seen.noise.wander.hypot(seen.noise.white) / TRAVELLED.0
    )
}

/// The unit, made to the dead band of the recordings, on a clock made to their speed; `period_s` is the time between their samples.
fn unit(reference: &Unit, channels: ChannelReadings, law: &Plain, period_s: f64) -> Unit {
    let mut unit = reference.clone();
    let p = &mut unit.parameters;
    let (supply_pa, return_pa) = (p.oil.tank_pressure_pa, p.oil.return_pressure_pa);
    let valve = &mut p.distributing_valve;
    (valve.stroke_min_m, valve.stroke_max_m) = (-0.09, 0.09);
    let servo = &mut p.servomotor;
    // The farthest position of the spool is 1 pu.
    let open_pu = (1.0 - law.half_band).clamp(0.1, 1.0);
    let travel_m = open_pu * valve.reference_stroke_m;
    p.main_ports.overlap_m = law.half_band.clamp(OVERLAP_SHARE, 0.5) * valve.reference_stroke_m;

    let (large_m2, load_n) = (servo.opening_area_m2, LOAD_SHARE * supply_pa * servo.opening_area_m2);
    let small_m2 = large_m2 - 2.0 * load_n / (supply_pa + return_pa);
    servo.coulomb_friction_n = FRICTION_SHARE * supply_pa * large_m2;
    let drive_n = supply_pa * large_m2 - return_pa * small_m2 - load_n - servo.coulomb_friction_n;
    let per_width = p.esv.discharge_coefficient * (2.0 / p.oil.density_kg_m3).sqrt() * travel_m * drive_n.sqrt();
    let speed_m_s = per_width * p.main_ports.width_m / (large_m2.powi(3) + small_m2.powi(3)).sqrt();
    // The load helps the faster direction, which is the opening one here, and whose area is the smaller.
    (servo.opening_area_m2, servo.closing_area_m2, servo.load_closed_n) = (small_m2, large_m2, -load_n);
    servo.load_slope_n = 0.0;
    servo.viscous_damping_n_s_m = DAMPING_SHARE * drive_n / speed_m_s;
    servo.moving_mass_kg = INERTIA_SHARE * drive_n * servo.stroke_m / (speed_m_s * speed_m_s);

    let recorded_m_s = 0.5 * (law.above_1_s.abs() + law.below_1_s.abs()) * open_pu.min(law.saturates) * servo.stroke_m;
    // What crosses its travel within a few rows shows nothing of a servomotor; the width of the ports makes up for it.
    let clock_ratio =
        (recorded_m_s / speed_m_s).clamp(f64::MIN_POSITIVE, LONGEST_ROW_S / period_s.max(f64::MIN_POSITIVE));
    unit.recorded = ChannelReadings { clock_ratio, ..channels };
    // Ticks as long as the recording allows; the large loop does nothing here.
    p.regulator.small_loop_period_s = (0.1 * period_s * clock_ratio).clamp(1e-4, 0.02);
    p.regulator.large_loop_period_s = 10.0 * p.regulator.small_loop_period_s;
    for (tolerance, entry) in unit.tolerances.iter_mut().zip(ENTRIES) {
        *tolerance = WIDE.iter().find(|(key, _)| *key == entry.key).map(|(_, wide)| Tolerance::LogNormal(*wide));
    }
    unit.effects = vec![EffectSetting { id: SPOOL_ZERO.to_owned(), values: vec![0.0] }];
    unit
}

/// What is fitted of such a unit: the wide tolerances and the spool's zero.
fn free_parameters(unit: &Unit) -> Vec<FreeParameter> {
    let zero = CATALOGUE.iter().filter(|spec| spec.id == SPOOL_ZERO).flat_map(|spec| spec.parameters);
    let zero = zero.take(unit.effects.len()).map(|spec| FreeParameter::Effect { effect: 0, parameter: 0, spec });
    FreeParameter::nuisances(unit).into_iter().chain(zero).collect()
}

/// True for an effect that means something in a unit of unknown size.
pub(crate) fn means_something(id: &str) -> bool {
    !UNITS_ONLY.contains(&id)
}

/// True for a parameter that acts behind the spool.
pub(crate) fn acts_behind_the_spool(free_parameter: &FreeParameter) -> bool {
    let FreeParameter::Parameter { index, .. } = free_parameter else { return true };
    let key = ENTRIES[*index].key;
    let sections = ["oil.", "main_ports.", Stage::Servomotor.id()];
    sections.iter().any(|section| key.starts_with(section)) || key == "esv.discharge_coefficient"
}

/// Turns and scales recordings so that the spool opens upwards from its zero to 1 pu at its farthest, and the servomotor travels the middle nine
/// tenths of its stroke; says what was done.
fn into_pu(recordings: &mut [Recording], law: &Plain) -> Option<(ChannelReadings, Vec<String>)> {
    let ends = |signal: Signal| {
        let values = recordings.iter().flat_map(|r| r.frames.iter().map(|frame| signal.of(&frame.measured)));
        values.filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let (spool, opening) = (ends(Signal::SpoolPosition), ends(Signal::ServomotorPosition));
    // The fit finds it closer; what the search ends at must not make a difference.
    let zero =
        spool.0 + (spool.1 - spool.0) * ((law.zero - spool.0) / (spool.1 - spool.0) * ZERO_STEPS).round() / ZERO_STEPS;
    let farthest = (spool.1 - zero).abs().max((zero - spool.0).abs());
    if !(farthest.is_finite() && farthest > 0.0 && opening.1 > opening.0) {
        return None;
    }
    let turned = law.above_1_s + law.below_1_s < 0.0;
    // Which way is opening nobody knows: the faster one counts as it, so that the sign of neither channel makes a difference.
    let faster_above = law.above_1_s.abs() > law.below_1_s.abs();
    let full = if faster_above { zero + farthest } else { zero - farthest };
    let rises = faster_above != turned;
    let mut notes = vec![format!(
        "The spool position is recorded from {:.4} to {:.4}: {zero:.4} is taken as its zero, from the speed of the servomotor, and {full:.4} is \
         taken as full stroke, on the side where the servomotor is faster.",
        spool.0, spool.1
    )];
    if turned {
        notes.push(
            "The servomotor moves against the sign of the spool: the sign of the spool position was reversed."
                .to_owned(),
        );
    }
    notes.push(format!(
        "The servomotor position runs from {:.4} to {:.4}: taken as 5 % to 95 % of its stroke; opening is where it {}.",
        opening.0,
        opening.1,
        if rises { "rises" } else { "falls" }
    ));
    let scale_pu = TRAVELLED.0 / (opening.1 - opening.0) * if rises { 1.0 } else { -1.0 };
    let begins = if rises { opening.0 } else { opening.1 };
    let channels = ChannelReadings {
        spool_position: ChannelReading::between(zero, full),
        servomotor_position: ChannelReading { scale_pu, offset_pu: TRAVELLED.1 - begins * scale_pu },
        clock_ratio: 1.0,
    };
    for frame in recordings.iter_mut().flat_map(|recording| &mut recording.frames) {
        let measured = &mut frame.measured;
        measured.spool_position_pu = channels.spool_position.position_pu(measured.spool_position_pu);
        measured.servomotor_position_pu = channels.servomotor_position.position_pu(measured.servomotor_position_pu);
    }
    Some((channels, notes))
}
