//! The law of a tick, of one twin or of several in lanes.

use crate::frame::Frame;
use crate::plant::lanes::{Wide, apart};
use crate::plant::real::Real;
use crate::plant::regulator::SmallLoop;
use crate::plant::term::{Point, View};
use crate::plant::{Blocks, Drive, Plant};
use crate::state::State;

use super::Cut;
use super::hold::Hold;
use super::now::{Demand, Now};
use super::readings::{piston_reading_pu, spool_reading_pu, standing_in_pu};

/// Blur of the port edges per standard deviation of the spool's demand: 0.8 for the shape of the blurred edge times
/// 0.4, the share of the demand's noise that the spool follows (measured on simulated units).
const CHATTER_BLUR: f64 = 0.32;

/// What stays from tick to tick besides the plant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Setting {
    pub cut: Cut,
    /// A tick by the clock of the frames.
    pub tick_ns: i64,
    pub tick_s: f64,
    /// Seconds of the plant for each second of the frames.
    pub clock_ratio: f64,
}

/// What a tick shows to terms.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<T = f64> {
    pub time_s: f64,
    pub tick_s: f64,
    pub state: State<T>,
    pub tank_pressure_pa: T,
    pub spool_reading_pu: T,
    pub servomotor_reading_pu: T,
}

impl<T: Wide> Seen<T> {
    /// What the terms in one lane see.
    #[inline(always)]
    pub(super) fn lane(&self, lane: usize) -> Seen {
        Seen {
            time_s: self.time_s,
            tick_s: self.tick_s,
            state: self.state.lane(lane),
            tank_pressure_pa: self.tank_pressure_pa.lane(lane),
            spool_reading_pu: self.spool_reading_pu.lane(lane),
            servomotor_reading_pu: self.servomotor_reading_pu.lane(lane),
        }
    }
}

impl Seen {
    /// As terms look at it.
    #[inline(always)]
    pub(super) fn view(&self) -> View<'_> {
        View {
            time_s: self.time_s,
            tick_s: self.tick_s,
            state: &self.state,
            tank_pressure_pa: self.tank_pressure_pa,
            spool_reading_pu: self.spool_reading_pu,
            servomotor_reading_pu: self.servomotor_reading_pu,
        }
    }
}

apart! {
    /// What the large loop reads.
    #[derive(Clone, Copy, Debug)]
    pub(super) struct TickReads<T = f64> {
        pub command_pu: T,
        pub servomotor_pu: T,
        pub servomotor_velocity_m_s: T,
    }
}

/// One plant or several in lanes, with the memories of their terms and large loops.
pub(super) trait Chain<T: Real> {
    /// The continuous plant.
    fn blocks(&self) -> Blocks<'_, T>;
    /// The small loop.
    fn small_loop(&self) -> SmallLoop<T>;
    /// Passes a signal through all terms at a point.
    fn apply(&mut self, point: Point, signal: T, seen: &Seen<T>) -> T;
    /// Runs the large loop where it is due; the spool demand that holds on average over the tick, pu. `moving_s` is for how long in a tick the
    /// reading moves on.
    fn large_loop(&mut self, ticks: u64, moving_s: f64, read: &TickReads<T>, demand: &mut Demand<T>) -> T;
    /// Advances the continuous plant by a tick.
    fn advance(&self, state: &mut State<T>, drive: &Drive<T>);
    /// The same of the servomotor alone.
    fn advance_piston(&self, state: &mut State<T>, drive: &Drive<T>);
}

/// Runs the large loop of one plant where it is due; the spool demand that holds on average over the tick, pu.
#[inline(always)]
pub(super) fn large_loop(
    plant: &Plant,
    hold: &mut Hold,
    ticks: u64,
    moving_s: f64,
    read: &TickReads,
    demand: &mut Demand,
) -> f64 {
    let old_pu = demand.spool_command_pu;
    let Some(share) = plant.regulator.large_loop_share(ticks) else { return old_pu };
    let moved_pu = share * moving_s * read.servomotor_velocity_m_s / plant.servomotor.stroke_m;
    let next = plant.regulator.dithered_command_pu(read.command_pu, read.servomotor_pu + moved_pu);
    let (spool_command_pu, sd_pu) = hold.next(next);
    *demand = Demand { spool_command_pu, sd_pu };
    // Until the large loop runs within the tick, its old output holds.
    spool_command_pu + share * (old_pu - spool_command_pu)
}

/// Advances one period of the small loop.
#[inline(always)]
pub(super) fn tick<T: Real>(chain: &mut impl Chain<T>, setting: Setting, now: &mut Now<T>, next: &Frame) {
    let Setting { cut, tick_ns, tick_s, .. } = setting;
    let zero = now.servomotor_reading_pu.like(0.0);
    let time_s = now.ticks as f64 * tick_s;
    let spool_reading_pu = match cut {
        Cut::Spool => zero.like(standing_in_pu(now.measured.spool_position_pu, now.measured_ns, next, now.time_ns)),
        Cut::None | Cut::Servomotor => spool_reading_pu(&chain.blocks(), &now.state, now.inputs.tank_pressure_pa, 0.0),
    };
    let servomotor_reading_pu = if cut == Cut::Servomotor && now.measured.servomotor_position_pu.is_finite() {
        zero.like(now.measured.servomotor_position_pu)
    } else {
        now.servomotor_reading_pu
    };
    let seen = Seen {
        time_s,
        tick_s,
        state: now.state,
        tank_pressure_pa: now.inputs.tank_pressure_pa,
        spool_reading_pu,
        servomotor_reading_pu,
    };
    let esv_opening_pu = chain.apply(Point::EsvOpening, now.inputs.esv_opening_pu, &seen);
    let command_pu = chain.apply(Point::Command, now.inputs.opening_command_pu, &seen);
    let servomotor_pu = chain.apply(Point::RegulatorServomotor, servomotor_reading_pu, &seen);
    let spool_read_pu = chain.apply(Point::RegulatorSpool, spool_reading_pu, &seen);
    let read = TickReads { command_pu, servomotor_pu, servomotor_velocity_m_s: seen.state.servomotor_velocity_m_s };
    let moving_s = if cut == Cut::None { tick_s } else { 0.0 };
    let spool_command_pu = chain.large_loop(now.ticks, moving_s, &read, &mut now.demand);
    now.valve_current_pu = chain.small_loop().valve_current_pu(spool_command_pu, spool_read_pu);
    let reference_m = chain.blocks().spool.reference_stroke_m;
    let drive = Drive {
        time_s,
        valve_current_pu: chain.apply(Point::ValveCurrent, now.valve_current_pu, &seen),
        esv_opening_pu,
        tank_pressure_pa: chain.apply(Point::SupplyPressure, now.inputs.tank_pressure_pa, &seen),
        edge_blur_m: now.demand.sd_pu * CHATTER_BLUR * reference_m,
        spool_force_n: chain.apply(Point::SpoolForce, zero, &seen),
        chamber_flow_m3_s: chain.apply(Point::ChamberFlow, zero, &seen),
        servomotor_force_n: chain.apply(Point::ServomotorForce, now.inputs.piston_force_n, &seen),
        opening_flow_m3_s: chain.apply(Point::OpeningFlow, zero, &seen),
        closing_flow_m3_s: chain.apply(Point::ClosingFlow, zero, &seen),
    };
    if cut == Cut::Spool {
        let spool = chain.blocks().spool;
        let (least_m, most_m) = (spool.stroke_min_m, spool.stroke_max_m);
        let position_m = spool.position_m(spool_reading_pu);
        let position_m = chain.apply(Point::DrivingSpool, position_m, &seen);
        now.state.spool_position_m = position_m.clamp(least_m, most_m);
        chain.advance_piston(&mut now.state, &drive);
    } else {
        chain.advance(&mut now.state, &drive);
    }
    now.ticks += 1;
    now.time_ns += tick_ns;
    now.inputs = now.coming;
    let reading_pu = piston_reading_pu(&chain.blocks(), &now.state, 0.0);
    now.servomotor_reading_pu = chain.apply(Point::ServomotorReading, reading_pu, &seen);
}
