//! What changes from tick to tick: inputs in force, the demand on the spool, the state, of one twin or of several in lanes.

use crate::frame::{EsvState, Frame, Inputs, Signals};
use crate::plant::lanes::{Abreast, Wide, apart};
use crate::plant::real::Real;
use crate::state::State;

apart! {
    /// Inputs in force.
    #[derive(Clone, Copy, Debug)]
    pub(super) struct Acting<T = f64> {
        pub opening_command_pu: T,
        /// 1 in NORMAL, 0 in SHUTDOWN.
        pub esv_opening_pu: T,
        pub tank_pressure_pa: T,
        /// + opens.
        pub piston_force_n: T,
    }
}

impl Acting {
    /// Takes the finite ones of new inputs; the others keep their values.
    pub(super) fn renew(&mut self, new: &Inputs) {
        self.esv_opening_pu = esv_opening_pu(new.esv);
        for (own, new) in [
            (&mut self.opening_command_pu, new.opening_command_pu),
            (&mut self.tank_pressure_pa, new.tank_pressure_pa),
            (&mut self.piston_force_n, new.piston_force_n),
        ] {
            if new.is_finite() {
                *own = new;
            }
        }
    }
}

/// The ESV's opening in a state, pu.
pub(super) fn esv_opening_pu(esv: EsvState) -> f64 {
    f64::from(u8::from(esv == EsvState::Normal))
}

apart! {
    /// What the large loop demands of the spool, and the standard deviation of that, pu.
    #[derive(Clone, Copy, Debug)]
    pub(super) struct Demand<T = f64> {
        pub spool_command_pu: T,
        pub sd_pu: T,
    }
}

/// The state from tick to tick, besides the memories of terms and the large loop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Now<T = f64> {
    pub state: State<T>,
    pub ticks: u64,
    pub time_ns: i64,
    pub inputs: Acting<T>,
    pub coming: Acting<T>,
    pub measured: Signals,
    pub measured_ns: i64,
    pub demand: Demand<T>,
    pub valve_current_pu: T,
    pub servomotor_reading_pu: T,
    /// Where the piston is, is known: behind a spool it is so from the first row that holds its position.
    pub is_placed: bool,
}

impl<T: Wide> Now<T> {
    /// What several twins under the same rows are at, in as many lanes as `zero` has; the last fills what lanes are left.
    pub(super) fn abreast(all: &[&Now], zero: T) -> Option<Self> {
        let last = all.len().checked_sub(1)?;
        let of = |lane: usize| all[lane.min(last)];
        let Now { ticks, time_ns, measured, measured_ns, is_placed, .. } = *all[0];
        Some(Self {
            state: State::abreast(&|lane| &of(lane).state, &|of| zero.each(of)),
            ticks,
            time_ns,
            inputs: Acting::abreast(&|lane| &of(lane).inputs, &|of| zero.each(of)),
            coming: Acting::abreast(&|lane| &of(lane).coming, &|of| zero.each(of)),
            measured,
            measured_ns,
            demand: Demand::abreast(&|lane| &of(lane).demand, &|of| zero.each(of)),
            valve_current_pu: zero.each(|lane| of(lane).valve_current_pu),
            servomotor_reading_pu: zero.each(|lane| of(lane).servomotor_reading_pu),
            is_placed,
        })
    }

    /// What one of them is at.
    #[inline(always)]
    pub(super) fn lane(&self, lane: usize) -> Now {
        Now {
            state: self.state.lane(lane),
            ticks: self.ticks,
            time_ns: self.time_ns,
            inputs: self.inputs.lane(lane),
            coming: self.coming.lane(lane),
            measured: self.measured,
            measured_ns: self.measured_ns,
            demand: self.demand.lane(lane),
            valve_current_pu: self.valve_current_pu.lane(lane),
            servomotor_reading_pu: self.servomotor_reading_pu.lane(lane),
            is_placed: self.is_placed,
        }
    }
}

impl<T: Real> Now<T> {
    /// Takes what a frame measures as far as it is finite, and the inputs to come where it does not lie between two ticks.
    #[inline(always)]
    pub(super) fn take(&mut self, frame: &Frame) {
        if frame.time_ns <= self.time_ns {
            self.inputs = self.coming;
        }
        let measured = &frame.measured;
        if measured.servomotor_position_pu.is_finite() {
            self.measured.servomotor_position_pu = measured.servomotor_position_pu;
        }
        if measured.spool_position_pu.is_finite() {
            self.measured.spool_position_pu = measured.spool_position_pu;
            self.measured_ns = frame.time_ns;
        }
    }

    /// Whether a frame is the first that holds the piston's position.
    #[inline(always)]
    pub(super) fn is_placed_by(&self, frame: &Frame) -> bool {
        !self.is_placed && frame.measured.servomotor_position_pu.is_finite()
    }
}
