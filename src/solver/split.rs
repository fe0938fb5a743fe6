//! The split linearly implicit method: the chain is a cascade within a tick, and each stage is linear in its speed.
//!
//! Within a tick the regulator's current holds, so the pilot valve is stepped exactly. The spool with its
//! chamber and the piston with its two chambers are stepped by a θ-method whose pressures are linearised
//! about the step's start. With `D = θ ΔP` and `v_θ = v + θ Δv`, chamber and force balance read
//!
//! `D = g (R − A v_θ)`, `g = (θh/C) / (1 − (θh/C) ∂Q/∂P)`; `m (v_θ − v)/(θh) = F(P + D) − B v_θ − F_f`,
//!
//! so that D drops out and one division gives `v_θ`. Coulomb friction enters exactly, as the value
//! that stops the mass if it can (Moreau 1988; Acary & Brogliato 2008, section 10.1); stops likewise. The
//! spool stage takes short steps; the piston, forty times slower, takes long ones with the mean port travel.
//!
//! θ = 1/2 is of order 2 and neither damps nor excites the oil column; the piston stage uses a θ a little
//! above so that its long steps damp an oscillation that they cannot follow.

use crate::plant::orifice::Flow;
use crate::plant::proportional_valve::Propagator;
use crate::plant::rates::VACUUM_PA;
use crate::plant::{Drive, Plant};
use crate::solver::steps;
use crate::state::State;

/// Greatest step of the spool stage, s.
pub const SPOOL_STEP_S: f64 = 5.0e-4;
/// Greatest step of the servomotor stage, s.
pub const PISTON_STEP_S: f64 = 2.0e-3;
/// θ of the spool stage.
const SPOOL_THETA: f64 = 0.5;
/// θ of the servomotor stage.
const PISTON_THETA: f64 = 0.55;

/// Step lengths, and what the servomotor stage has gathered since its last step.
#[derive(Clone, Debug)]
pub struct Split {
    count: u32,
    step_s: f64,
    propagator: Propagator,
    ticks_per_piston_step: u32,
    gathered_ticks: u32,
    gathered_travel_m: f64,
    gathered_force_n: f64,
    gathered_opening_m3_s: f64,
    gathered_closing_m3_s: f64,
    tick_s: f64,
}

impl Split {
    /// Prepares the steps for ticks of `tick_s`.
    #[must_use]
    pub fn new(plant: &Plant, tick_s: f64) -> Self {
        Self::with_steps(plant, tick_s, SPOOL_STEP_S, PISTON_STEP_S)
    }

    /// Prepares steps of at most these lengths.
    #[must_use]
    pub fn with_steps(plant: &Plant, tick_s: f64, spool_step_s: f64, piston_step_s: f64) -> Self {
        let (count, step_s) = steps(tick_s, spool_step_s);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a small count")]
        let ticks_per_piston_step = (piston_step_s / tick_s + 1e-9).floor().clamp(1.0, 1e3) as u32;
        Self {
            count,
            step_s,
            propagator: plant.proportional_valve.propagator(step_s),
            ticks_per_piston_step,
            gathered_ticks: 0,
            gathered_travel_m: 0.0,
            gathered_force_n: 0.0,
            gathered_opening_m3_s: 0.0,
            gathered_closing_m3_s: 0.0,
            tick_s,
        }
    }

    /// Advances by one tick.
    pub fn advance(&mut self, plant: &Plant, state: &mut State, drive: &Drive) {
        let viscosity = plant.supply.viscosity(drive.time_s);
        let supply_pa = supply_pressure_pa(plant, state, drive);
        let travel_m = plant.main_ports.travel_m(state.spool_position_m);
        let outside_n = drive.spool_force_n
            + plant.main_ports.flow_force_n(
                travel_m,
                state.opening_pressure_pa,
                state.closing_pressure_pa,
                supply_pa,
                plant.supply.return_pressure_pa,
            );
        for _ in 0..self.count {
            let start_m = state.spool_position_m;
            self.spool_step(plant, state, drive, supply_pa, viscosity, outside_n);
            self.gathered_travel_m += plant.main_ports.travel_m(0.5 * (start_m + state.spool_position_m));
        }
        self.gather(plant, state, drive, viscosity);
    }

    /// How far the servomotor stage lags behind the spool stage, s.
    #[inline]
    #[must_use]
    pub fn piston_lag_s(&self) -> f64 {
        f64::from(self.gathered_ticks) * self.tick_s
    }

    /// Advances the servomotor alone by one tick, the spool being where the drive's caller put it.
    pub fn advance_piston(&mut self, plant: &Plant, state: &mut State, drive: &Drive) {
        let viscosity = plant.supply.viscosity(drive.time_s);
        self.gathered_travel_m += f64::from(self.count) * plant.main_ports.travel_m(state.spool_position_m);
        self.gather(plant, state, drive, viscosity);
    }

    fn gather(&mut self, plant: &Plant, state: &mut State, drive: &Drive, viscosity: f64) {
        self.gathered_force_n += drive.servomotor_force_n;
        self.gathered_opening_m3_s += drive.opening_flow_m3_s;
        self.gathered_closing_m3_s += drive.closing_flow_m3_s;
        self.gathered_ticks += 1;
        if self.gathered_ticks == self.ticks_per_piston_step {
            self.piston_step(plant, state, drive, viscosity);
            self.gathered_ticks = 0;
            self.gathered_travel_m = 0.0;
            self.gathered_force_n = 0.0;
            self.gathered_opening_m3_s = 0.0;
            self.gathered_closing_m3_s = 0.0;
        }
    }

    #[inline]
    fn spool_step(
        &self,
        plant: &Plant,
        state: &mut State,
        drive: &Drive,
        supply_pa: f64,
        viscosity: f64,
        outside_n: f64,
    ) {
        let (spool, valve) = (&plant.spool, &plant.proportional_valve);
        let return_pa = plant.supply.return_pressure_pa;
        let (h, theta) = (self.step_s, SPOOL_THETA);

        let mean_pu = valve.advance(
            &self.propagator,
            &mut state.pilot_position_pu,
            &mut state.pilot_rate_pu_s,
            drive.valve_current_pu,
        );
        let (x, v, p) = (state.spool_position_m, state.spool_velocity_m_s, state.control_pressure_pa);
        let pilot = valve.flow(valve.opening_pu(mean_pu), p, supply_pa, return_pa);
        let entering = plant.esv.flow(drive.esv_opening_pu, pilot, p, return_pa);
        let net = Flow {
            m3_s: entering.m3_s + spool.leakage_m3_s(p, supply_pa, return_pa) + drive.chamber_flow_m3_s,
            slope_m3_s_pa: entering.slope_m3_s_pa - spool.leakage_m3_s_pa - spool.return_leakage_m3_s_pa,
        };
        let (gain, fill_pa) = chamber(net, theta * h, spool.compliance_m3_pa(x, p));

        let a = spool.control_area_m2;
        let inertia = spool.mass_kg / (theta * h);
        let force_n = spool.static_force_n(x, p + fill_pa, supply_pa) + outside_n;
        let stiffness = if x > -spool.spring_precompression_m { spool.spring_stiffness_n_m } else { 0.0 };
        let resistance = inertia + a * a * gain + theta * h * stiffness + spool.viscous_damping_n_s_m * viscosity;
        let held_n = spool.coulomb_friction_n * if v == 0.0 { spool.static_ratio } else { 1.0 };
        let free_n = rub(inertia * v + force_n, spool.coulomb_friction_n, held_n);
        let mut v_theta = free_n / resistance;

        let mut next_m = x + h * v_theta;
        let mut next_v = v + (v_theta - v) / theta;
        let stop_m = next_m.clamp(spool.stroke_min_m, spool.stroke_max_m);
        if stop_m != next_m || (spool.coulomb_friction_n > 0.0 && (v_theta == 0.0 || next_v * v_theta < 0.0)) {
            v_theta = (stop_m - x) / h;
            next_m = stop_m;
            next_v = 0.0;
        }
        state.spool_position_m = next_m;
        state.spool_velocity_m_s = next_v;
        state.control_pressure_pa = (p + (fill_pa - gain * a * v_theta) / theta).max(VACUUM_PA);
    }

    fn piston_step(&self, plant: &Plant, state: &mut State, drive: &Drive, viscosity: f64) {
        let servo = &plant.servomotor;
        let ticks = f64::from(self.gathered_ticks);
        let (h, theta) = (self.tick_s * ticks, PISTON_THETA);
        let (z, w) = (state.servomotor_position_m, state.servomotor_velocity_m_s);
        let (p_1, p_2) = (state.opening_pressure_pa, state.closing_pressure_pa);
        let travel_m = self.gathered_travel_m / (ticks * f64::from(self.count));
        let flows = plant.main_ports.flows(travel_m, p_1, p_2, drive.tank_pressure_pa, &plant.supply);
        let leak = servo.cross_leakage_m3_s_pa;
        let opening = Flow {
            m3_s: flows.opening.m3_s - leak * (p_1 - p_2) + self.gathered_opening_m3_s / ticks,
            slope_m3_s_pa: flows.opening.slope_m3_s_pa - leak,
        };
        let closing = Flow {
            m3_s: flows.closing.m3_s + leak * (p_1 - p_2) + self.gathered_closing_m3_s / ticks,
            slope_m3_s_pa: flows.closing.slope_m3_s_pa - leak,
        };
        let (gain_1, fill_1_pa) = chamber(opening, theta * h, servo.opening_compliance_m3_pa(z));
        let (gain_2, fill_2_pa) = chamber(closing, theta * h, servo.closing_compliance_m3_pa(z));

        let (a_1, a_2) = (servo.opening_area_m2, servo.closing_area_m2);
        let inertia = servo.mass_kg / (theta * h);
        let force_n =
            a_1 * (p_1 + fill_1_pa) - a_2 * (p_2 + fill_2_pa) - servo.load_n(z) + self.gathered_force_n / ticks;
        let resistance = inertia
            + a_1 * a_1 * gain_1
            + a_2 * a_2 * gain_2
            + theta * h * servo.load_slope_n / servo.stroke_m
            + servo.damping_n_s_m(z, w, viscosity);
        let held_n = servo.coulomb_friction_n * if w == 0.0 { servo.static_ratio } else { 1.0 };
        let free_n = rub(inertia * w + force_n, servo.coulomb_friction_n, held_n);
        let mut w_theta = free_n / resistance;

        let mut next_m = z + h * w_theta;
        let mut next_w = w + (w_theta - w) / theta;
        let stop_m = next_m.clamp(0.0, servo.stroke_m);
        if stop_m != next_m || w_theta == 0.0 || next_w * w_theta < 0.0 {
            w_theta = (stop_m - z) / h;
            next_m = stop_m;
            next_w = 0.0;
        }
        state.servomotor_position_m = next_m;
        state.servomotor_velocity_m_s = next_w;
        state.opening_pressure_pa = (p_1 + (fill_1_pa - gain_1 * a_1 * w_theta) / theta).max(VACUUM_PA);
        state.closing_pressure_pa = (p_2 + (fill_2_pa + gain_2 * a_2 * w_theta) / theta).max(VACUUM_PA);
    }
}

/// Pressure that one m³/s more over the step would add, and what the net flow adds, both times θ.
#[inline]
fn chamber(net: Flow, theta_h_s: f64, compliance_m3_pa: f64) -> (f64, f64) {
    let gain = theta_h_s / (compliance_m3_pa - theta_h_s * net.slope_m3_s_pa);
    (gain, gain * net.m3_s)
}

/// What friction leaves of a force: nothing up to `held_n`, the rest less `sliding_n` beyond.
#[inline]
fn rub(force_n: f64, sliding_n: f64, held_n: f64) -> f64 {
    if force_n.abs() <= held_n { 0.0 } else { force_n - sliding_n.copysign(force_n) }
}

/// Pressure at the valve while the servomotor moves as it does, Pa.
#[inline]
fn supply_pressure_pa(plant: &Plant, state: &State, drive: &Drive) -> f64 {
    if plant.supply.line_root == 0.0 {
        return drive.tank_pressure_pa;
    }
    let servo = &plant.servomotor;
    let w = state.servomotor_velocity_m_s;
    let drawn_m3_s = if w >= 0.0 { servo.opening_area_m2 * w } else { -servo.closing_area_m2 * w };
    plant.supply.pressure_pa(drive.tank_pressure_pa, drawn_m3_s)
}
