//! A unit without a data sheet: a symmetric servomotor stage of the right speed, every tolerance wide, nothing else known.
//!
//! It has the reference unit's geometry, scaled so that it moves as fast as the recordings say. Areas and load balance, so that both
//! directions are alike until an effect makes them differ; what an effect's size means in a unit of unknown size is its ratio to this one.

use crate::effects::{CATALOGUE, Stage};
use crate::parameters::{ENTRIES, EffectSetting, Tolerance, Unit};
use crate::recording::Recording;
use crate::signal::Signal;
use crate::tuning::flexible::Flexible;
use crate::tuning::knob::Knob;

/// Load over the force that the tank's pressure gives: enough that its effect can speed up either direction.
const LOAD_SHARE: f64 = 0.35;
/// Coulomb friction, the same way.
const FRICTION_SHARE: f64 = 0.02;
/// Damping at full speed, as a share of the force that moves the piston.
const DAMPING_SHARE: f64 = 0.1;
/// Time to reach speed over the time for a full stroke.
const INERTIA_SHARE: f64 = 0.01;
/// Overlap over the farthest spool position.
const OVERLAP_SHARE: f64 = 0.01;
/// How much smaller or larger than drawn areas may be taken.
const AREA_SCALES: (f64, f64) = (1e-2, 50.0);
/// What the wide tolerances are: a factor of e either way is one and a half deviations or less.
const WIDE: [(&str, f64); 5] = [
    ("main_ports.width_m", 1.5),
    ("main_ports.overlap_m", 1.5),
    ("servomotor.viscous_damping_n_s_m", 1.5),
    ("servomotor.coulomb_friction_n", 1.0),
    ("servomotor.moving_mass_kg", 1.0),
];
/// The effect that takes up where the spool's zero lies, which nobody knows without a sheet.
const SPOOL_ZERO: &str = "lvdt_bias";
/// Effects that only say in which units a signal was recorded.
const UNITS_ONLY: [&str; 3] = ["lvdt_bias", "lvdt_gain", "feedback_bias"];
/// Spool positions that need no scaling, pu.
const USUAL_SPOOL: (f64, f64) = (0.2, 1.2);
/// Openings that need no scaling, pu.
const USUAL_OPENING: (f64, f64) = (-0.02, 1.02);

/// The unit, made to the speed of the recordings; `period_s` is the time between their samples.
#[must_use]
pub fn unit(reference: &Unit, seen: &Flexible, period_s: f64) -> Unit {
    let mut unit = reference.clone();
    let p = &mut unit.parameters;
    let (supply_pa, return_pa) = (p.oil.tank_pressure_pa, p.oil.return_pressure_pa);
    let valve = &mut p.distributing_valve;
    (valve.stroke_min_m, valve.stroke_max_m) = (-0.09, 0.09);
    let servo = &mut p.servomotor;
    let farthest_pu = seen.farthest_spool_pu;
    let speed_m_s = (seen.gain_1_s.abs() * farthest_pu * servo.stroke_m).max(1e-6);
    let travel_m = farthest_pu * valve.reference_stroke_m;
    p.main_ports.overlap_m = OVERLAP_SHARE * travel_m;

    // Areas make the speed, so that flows stay what the sizes of effects are meant for; the width makes up what areas cannot.
    let (large_m2, load_n) = (servo.opening_area_m2, LOAD_SHARE * supply_pa * servo.opening_area_m2);
    let small_m2 = large_m2 - 2.0 * load_n / (supply_pa + return_pa);
    let friction_n = FRICTION_SHARE * supply_pa * large_m2;
    let drive_n = supply_pa * large_m2 - return_pa * small_m2 - load_n - friction_n;
    let per_width = p.esv.discharge_coefficient * (2.0 / p.oil.density_kg_m3).sqrt() * travel_m * drive_n.sqrt();
    let as_drawn_m_s = per_width * p.main_ports.width_m / (large_m2.powi(3) + small_m2.powi(3)).sqrt();
    let scale = (as_drawn_m_s / speed_m_s).clamp(AREA_SCALES.0, AREA_SCALES.1);
    p.main_ports.width_m = (p.main_ports.width_m * scale * speed_m_s / as_drawn_m_s).clamp(1e-5, 5.0);
    // The load holds back the slower direction, whose area is the larger one.
    (servo.opening_area_m2, servo.closing_area_m2, servo.load_closed_n) = if seen.opens_faster {
        (scale * small_m2, scale * large_m2, -scale * load_n)
    } else {
        (scale * large_m2, scale * small_m2, scale * load_n)
    };
    servo.load_slope_n = 0.0;
    servo.coulomb_friction_n = scale * friction_n;
    servo.dead_volume_m3 *= scale;
    servo.viscous_damping_n_s_m = DAMPING_SHARE * scale * drive_n / speed_m_s;
    let mass_kg = INERTIA_SHARE * scale * drive_n * servo.stroke_m / (speed_m_s * speed_m_s);
    servo.moving_mass_kg = mass_kg.clamp(1.0, 1.0e10);
    // Ticks as long as the recording allows; the large loop does nothing here.
    p.regulator.small_loop_period_s = (0.1 * period_s).clamp(1e-4, 0.02);
    p.regulator.large_loop_period_s = 10.0 * p.regulator.small_loop_period_s;
    for (tolerance, entry) in unit.tolerances.iter_mut().zip(ENTRIES) {
        *tolerance = WIDE.iter().find(|(key, _)| *key == entry.key).map(|(_, wide)| Tolerance::LogNormal(*wide));
    }
    unit.effects = vec![EffectSetting { id: SPOOL_ZERO.to_owned(), values: vec![0.0] }];
    unit
}

/// What is fitted of such a unit: the wide tolerances and the spool's zero.
#[must_use]
pub fn knobs(unit: &Unit) -> Vec<Knob> {
    let zero = CATALOGUE.iter().filter(|spec| spec.id == SPOOL_ZERO).flat_map(|spec| spec.parameters);
    let zero = zero.take(unit.effects.len()).map(|spec| Knob::Effect { effect: 0, parameter: 0, spec });
    Knob::nuisances(unit).into_iter().chain(zero).collect()
}

/// True for an effect that means something in a unit of unknown size.
#[must_use]
pub fn means_something(id: &str) -> bool {
    !UNITS_ONLY.contains(&id)
}

/// True for a parameter that acts behind the spool.
#[must_use]
pub fn acts_behind_the_spool(knob: &Knob) -> bool {
    let Knob::Parameter { index, .. } = knob else { return true };
    let key = ENTRIES[*index].key;
    let sections = ["oil.", "main_ports.", Stage::Servomotor.id()];
    sections.iter().any(|section| key.starts_with(section)) || key == "esv.discharge_coefficient"
}

/// Turns and scales recordings of unknown units so that the spool opens upwards and both positions are in pu; says what was done.
pub fn into_pu(recordings: &mut [Recording], gain_1_s: f64) -> Vec<String> {
    let mut notes = Vec::new();
    let ends = |signal: Signal| {
        let values = recordings.iter().flat_map(|r| r.frames.iter().map(|frame| signal.of(&frame.measured)));
        values.filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let (spool, opening) = (ends(Signal::SpoolPosition), ends(Signal::ServomotorPosition));
    let farthest = spool.0.abs().max(spool.1.abs());
    let mut spool_scale = 1.0;
    if farthest > 0.0 && !(USUAL_SPOOL.0..=USUAL_SPOOL.1).contains(&farthest) {
        spool_scale = 1.0 / farthest;
        notes.push(format!("The spool position reaches {farthest:.4}: taken as full stroke."));
    }
    if gain_1_s < 0.0 {
        spool_scale = -spool_scale;
        notes.push("The servomotor moves against the spool's sign: the spool position was turned round.".to_owned());
    }
    let (mut low, mut span) = (0.0, 1.0);
    let usual = opening.0 >= USUAL_OPENING.0 && opening.1 <= USUAL_OPENING.1 && opening.1 - opening.0 > 0.02;
    if !usual && opening.1 > opening.0 {
        span = (opening.1 - opening.0) / 0.9;
        low = opening.0 - 0.05 * span;
        notes.push(format!(
            "The servomotor position runs from {:.4} to {:.4}: taken as 5 % to 95 % of its stroke.",
            opening.0, opening.1
        ));
    }
    for frame in recordings.iter_mut().flat_map(|recording| &mut recording.frames) {
        frame.measured.spool_position_pu *= spool_scale;
        frame.measured.servomotor_position_pu = (frame.measured.servomotor_position_pu - low) / span;
    }
    notes
}
