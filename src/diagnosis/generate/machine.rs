//! A simple unit: rotor, water column, grid and pressure tank, as much as commands need to look real.
//!
//! Water: `T_w q' = 1 − h`, `h = (q/G)²`; torque `m = A (h q (1.5 − 0.5 n) − q_0 n²)`, `T_a n' = m` off the grid; on it the speed is the
//! grid's, an Ornstein-Uhlenbeck walk. The rigid column and the no-load flow are those of the IEEE Working Group
//! (1992, IEEE Transactions on Power Systems 7(1), 167–179); that torque at rest is half as large again as at speed is
//! common for Francis runners. Tank: the gas expands with what the servomotor draws, and a pump restores it.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | q, q_0 | flow, flow that turns the machine without load | pu |
//! | h, G | head, guide-vane opening | pu |
//! | n, m | speed, torque | pu |
//! | T_w, T_a | starting times of water and machine | s |
//! | A | turbine gain, 1/(1 − q_0) | 1 |

use crate::generate::noise::Draws;
use crate::generate::script::ProcessScript;
use govtwin_model::parameters::Parameters;

/// Step, s: the governor's period.
const STEP_S: f64 = 0.010;
/// The opening of a closed guide-vane ring: it is never tight.
const LEAST_OPENING_PU: f64 = 0.001;
/// Head beyond which relief works, pu.
const GREATEST_HEAD_PU: f64 = 1.6;
/// Standard deviation of an ordinary grid's frequency, pu.
const GRID_DEVIATION_PU: f64 = 4.0e-4;
/// Time over which the grid's frequency forgets, s.
const GRID_TIME_S: f64 = 0.5;
/// Share of the tank's pressure that one full stroke takes.
const STROKE_DROP_SHARE: f64 = 0.06;
/// Time in which the pump restores the tank, s.
const PUMP_TIME_S: f64 = 5.0;

/// The unit around the servo system.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Speed, pu of nominal.
    pub speed_pu: f64,
    /// Pressure in the tank, Pa gauge.
    pub tank_pressure_pa: f64,
    flow_pu: f64,
    no_load_flow_pu: f64,
    mechanical_time_s: f64,
    water_time_s: f64,
    nominal_pressure_pa: f64,
    /// Fall of the tank's pressure for oil drawn, Pa/m³.
    stiffness_pa_m3: f64,
    opening_area_m2: f64,
    closing_area_m2: f64,
    unrest_ratio: f64,
    draws: Draws,
}

impl Machine {
    /// The unit of a script with the servomotor and the tank of a sheet.
    pub fn new(p: &Parameters, script: &ProcessScript, draws: Draws) -> Self {
        let servomotor = &p.servomotor;
        let nominal_pressure_pa = p.oil.tank_pressure_pa;
        Self {
            speed_pu: if script.stands_still { 0.0 } else { 1.0 },
            tank_pressure_pa: nominal_pressure_pa,
            flow_pu: script.initial_opening_pu.max(LEAST_OPENING_PU),
            no_load_flow_pu: script.no_load_opening_pu,
            mechanical_time_s: script.mechanical_time_s,
            water_time_s: script.water_time_s,
            nominal_pressure_pa,
            stiffness_pa_m3: STROKE_DROP_SHARE * nominal_pressure_pa
                / (servomotor.opening_area_m2 * servomotor.stroke_m),
            opening_area_m2: servomotor.opening_area_m2,
            closing_area_m2: servomotor.closing_area_m2,
            unrest_ratio: script.grid_unrest_ratio,
            draws,
        }
    }

    /// Advances by 10 ms at a guide-vane opening and a piston speed.
    pub fn advance(&mut self, opening_pu: f64, piston_m_s: f64, on_grid: bool) {
        let drawn_m3_s =
            if piston_m_s >= 0.0 { self.opening_area_m2 * piston_m_s } else { -self.closing_area_m2 * piston_m_s };
        let missing_pa = self.nominal_pressure_pa - self.tank_pressure_pa;
        self.tank_pressure_pa += STEP_S * (missing_pa / PUMP_TIME_S - self.stiffness_pa_m3 * drawn_m3_s);

        let opening_pu = opening_pu.max(LEAST_OPENING_PU);
        let ratio = self.flow_pu / opening_pu;
        // Linearly implicit: the column is stiff at small openings.
        let slope = 2.0 * ratio / (opening_pu * self.water_time_s);
        self.flow_pu += STEP_S * (1.0 - ratio * ratio) / self.water_time_s / (1.0 + STEP_S * slope);

        if on_grid {
            let deviation_pu = self.speed_pu - 1.0;
            let deviating_pu = GRID_DEVIATION_PU * self.unrest_ratio;
            let kick_pu = deviating_pu * (2.0 * STEP_S / GRID_TIME_S).sqrt() * self.draws.normal();
            self.speed_pu = 1.0 + deviation_pu * (1.0 - STEP_S / GRID_TIME_S) + kick_pu;
        } else {
            let head_pu = (self.flow_pu / opening_pu).powi(2).min(GREATEST_HEAD_PU);
            let n = self.speed_pu;
            let gain = 1.0 / (1.0 - self.no_load_flow_pu);
            let torque_pu = gain * (head_pu * self.flow_pu * (1.5 - 0.5 * n) - self.no_load_flow_pu * n * n);
            self.speed_pu = (n + STEP_S * torque_pu / self.mechanical_time_s).max(0.0);
        }
    }
}
