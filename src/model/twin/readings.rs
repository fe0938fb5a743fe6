//! The readings of the transducers between two ticks, and what replaces them at a cut.

use crate::frame::Frame;
use crate::plant::Blocks;
use crate::plant::real::Real;
use crate::state::State;
use crate::units::seconds_from_nanos;

use super::Cut;
use super::now::Now;
use super::tick::Setting;

/// What the spool's transducer shows `after_s` past the last tick, pu.
#[inline(always)]
pub(super) fn spool_reading_pu<T: Real>(
    blocks: &Blocks<'_, T>,
    state: &State<T>,
    tank_pressure_pa: T,
    after_s: f64,
) -> T {
    let spool = blocks.spool;
    let position_m =
        (state.spool_position_m + state.spool_velocity_m_s * after_s).clamp(spool.stroke_min_m, spool.stroke_max_m);
    let yield_m = spool.stop_yield_m(position_m, state.control_pressure_pa, tank_pressure_pa);
    spool.reading_pu(position_m + yield_m)
}

/// What the servomotor's transducer would show of the piston without lag or play `after_s` past the last tick, pu.
#[inline(always)]
pub(super) fn piston_reading_pu<T: Real>(blocks: &Blocks<'_, T>, state: &State<T>, after_s: f64) -> T {
    let servo = blocks.servomotor;
    let position_m = state.servomotor_position_m + state.servomotor_velocity_m_s * after_s;
    let position_m = position_m.clamp(position_m.like(0.0), servo.stroke_m);
    let yield_m = servo.stop_yield_m(position_m, state.opening_pressure_pa, state.closing_pressure_pa);
    servo.reading_pu(position_m + yield_m)
}

/// Both positions as shown at a time less than a tick after the last one, pu: spool and servomotor.
#[inline(always)]
pub(super) fn positions_pu<T: Real>(blocks: &Blocks<'_, T>, now: &Now<T>, setting: Setting, time_ns: i64) -> (T, T) {
    let since_s = setting.clock_ratio * seconds_from_nanos(time_ns - now.time_ns).max(0.0);
    let moving_s = if setting.cut == Cut::Spool { 0.0 } else { since_s };
    let moved_pu = if since_s > 0.0 {
        piston_reading_pu(blocks, &now.state, since_s) - piston_reading_pu(blocks, &now.state, 0.0)
    } else {
        now.servomotor_reading_pu.like(0.0)
    };
    let spool_pu = spool_reading_pu(blocks, &now.state, now.inputs.tank_pressure_pa, moving_s);
    (spool_pu, now.servomotor_reading_pu + moved_pu)
}

/// A measured signal at a time between its last row and the next, pu.
pub(super) fn standing_in_pu(last_pu: f64, last_ns: i64, next: &Frame, time_ns: i64) -> f64 {
    let next_pu = next.measured.spool_position_pu;
    let span_ns = next.time_ns - last_ns;
    if !last_pu.is_finite() {
        return 0.0;
    }
    // A tick may begin a little before the last row; a step between two rows close together says nothing of what was long before.
    if !next_pu.is_finite() || span_ns <= 0 || last_ns - time_ns > span_ns {
        return last_pu;
    }
    let share = seconds_from_nanos(time_ns - last_ns) / seconds_from_nanos(span_ns);
    last_pu + (next_pu - last_pu) * share
}
