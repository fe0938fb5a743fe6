//! What the transducers show between two ticks, and what stands in for them at a cut.

use crate::frame::Frame;
use crate::plant::Plant;
use crate::units::seconds_from_nanos;

use super::Now;

/// What the spool's transducer shows `after_s` past the last tick, pu.
pub(super) fn spool_reading_pu(plant: &Plant, now: &Now, after_s: f64) -> f64 {
    let (spool, state) = (&plant.spool, &now.state);
    let position_m =
        (state.spool_position_m + state.spool_velocity_m_s * after_s).clamp(spool.stroke_min_m, spool.stroke_max_m);
    let yield_m = spool.stop_yield_m(position_m, state.control_pressure_pa, now.inputs.tank_pressure_pa);
    spool.reading_pu(position_m + yield_m)
}

/// Piston position `after_s` past the last tick, pu.
pub(super) fn piston_position_pu(plant: &Plant, now: &Now, after_s: f64) -> f64 {
    let servo = &plant.servomotor;
    let position_m = now.state.servomotor_position_m + now.state.servomotor_velocity_m_s * after_s;
    let position_m = position_m.clamp(0.0, servo.stroke_m);
    let yield_m = servo.stop_yield_m(position_m, now.state.opening_pressure_pa, now.state.closing_pressure_pa);
    (position_m + yield_m) / servo.stroke_m
}

/// A measured signal at a time between its last row and the next, pu.
pub(super) fn standing_in_pu(last_pu: f64, last_ns: i64, next: &Frame, time_ns: i64) -> f64 {
    let next_pu = next.measured.spool_position_pu;
    let span_ns = next.time_ns - last_ns;
    if !last_pu.is_finite() {
        return 0.0;
    }
    if !next_pu.is_finite() || span_ns <= 0 {
        return last_pu;
    }
    let share = seconds_from_nanos(time_ns - last_ns) / seconds_from_nanos(span_ns);
    last_pu + (next_pu - last_pu) * share
}
