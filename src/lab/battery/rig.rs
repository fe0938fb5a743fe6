//! A plant written apart from the twin: same chain and same sheet, other equations, more states.
//!
//! It has what the twin leaves out (LuGre friction, rounded edges that differ, the inertia of the line's oil, elastic stops,
//! transducers with a lag) and its faults follow other laws than the effects of the catalogue. Steps of the classic
//! Runge–Kutta method at 200 µs.

use crate::battery::faults::Faults;
use crate::battery::laws::{Bristles, edge, eroded, filtered, gap, gas_compressibility_1_pa, jet, stop};
use crate::battery::mismatch::Mismatch;
use crate::battery::moment::Moment;
use govtwin_model::parameters::Parameters;

/// Steps of the integration in a tick of 1 ms.
const STEPS: u32 = 5;
/// Number of states.
const STATES: usize = 21;
/// Length of the cushion, pu of stroke.
const CUSHION_PU: f64 = 0.1;
/// Reach of the four worn edges, over half the radius that labels give.
const WEAR_SHARES: [f64; 4] = [1.2, 0.9, 1.1, 0.8];
/// Time in which the oil of the return line comes up to speed, s.
const RETURN_S: f64 = 3e-3;

type RigVector = [f64; STATES];

// Places of the states in the vector.
const COIL: usize = 0;
const PILOT: usize = 1;
const PILOT_RATE: usize = 2;
const CONTROL: usize = 3;
const SPOOL: usize = 4;
const SPOOL_SPEED: usize = 5;
const SPOOL_BEND: usize = 6;
const NODE: usize = 7;
const LINE: usize = 8;
const OPENING: usize = 9;
const CLOSING: usize = 10;
const PISTON: usize = 11;
const PISTON_SPEED: usize = 12;
const PISTON_BEND: usize = 13;
const ROD: usize = 14;
const LVDT: usize = 15;
const READING_1: usize = 16;
const READING_2: usize = 17;
const ESV: usize = 18;
const ESV_RATE: usize = 19;
const RETURN: usize = 20;

/// What acts on the rig during a tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hand {
    /// Time since the start of the recording, s.
    pub time_s: f64,
    /// Current to the pilot valve, pu.
    pub current_pu: f64,
    /// Whether the ESV's solenoid holds it open.
    pub esv_open: bool,
    /// Time since the solenoid let go, s; 0 while it holds.
    pub tripped_s: f64,
    /// Tank pressure, Pa.
    pub tank_pa: f64,
}

/// The rig: parameters, faults, and what is odd about it.
#[derive(Clone, Debug)]
pub(crate) struct Rig {
    p: Parameters,
    faults: Faults,
    odd: Mismatch,
    spool_friction: Bristles,
    piston_friction: Bristles,
    /// Natural frequency of the pilot valve's position loop.
    pilot_rad_s: f64,
    /// Lag of its coil.
    coil_s: f64,
    y: RigVector,
}

impl Rig {
    /// A rig at rest at an opening.
    pub(crate) fn new(p: &Parameters, faults: &Faults, odd: &Mismatch, opening_pu: f64) -> Self {
        let (dv, servo) = (&p.distributing_valve, &p.servomotor);
        let supply_pa = p.oil.tank_pressure_pa;
        let mut y = [0.0; STATES];
        y[NODE] = supply_pa;
        y[CONTROL] = (supply_pa * dv.constant_pressure_area_m2 - dv.spool_mass_kg * dv.gravity_m_s2
            + dv.spring_stiffness_n_m * dv.spring_precompression_m)
            / dv.control_area_m2;
        y[CLOSING] = 0.4 * supply_pa;
        y[OPENING] = (y[CLOSING] * servo.closing_area_m2 + servo.load_closed_n + servo.load_slope_n * opening_pu)
            / servo.opening_area_m2;
        y[PISTON] = opening_pu * servo.stroke_m;
        for place in [ROD, READING_1, READING_2] {
            y[place] = opening_pu;
        }
        y[ESV] = 1.0;
        let spool_friction = odd.spool_friction(faults.spool_friction_n);
        let piston_friction = odd.piston_friction(servo.coulomb_friction_n, faults.servo_friction_n);
        let valve = &p.proportional_valve;
        let ratio = 1.0 + faults.pv_frequency_ratio;
        let pilot_rad_s = valve.natural_frequency_rad_s * ratio.powf(0.7);
        let coil_s =
            1e-4 + 2.0 * valve.damping_ratio / valve.natural_frequency_rad_s * (1.0 / ratio - ratio.powf(-0.7));
        Self { p: *p, faults: faults.clone(), odd: *odd, spool_friction, piston_friction, pilot_rad_s, coil_s, y }
    }

    /// Advances by a millisecond.
    pub(crate) fn tick(&mut self, hand: &Hand) {
        self.tick_in(hand, STEPS);
    }

    /// Advances by a millisecond in so many steps.
    fn tick_in(&mut self, hand: &Hand, steps: u32) {
        let mut hand = *hand;
        let h = 1.0e-3 / f64::from(steps);
        for _ in 0..steps {
            let y = self.y;
            let moment = Moment::new(hand.time_s, &self.faults);
            let k_1 = self.rates(&y, &hand, &moment);
            let k_2 = self.rates(&plus(&y, 0.5 * h, &k_1), &hand, &moment);
            let k_3 = self.rates(&plus(&y, 0.5 * h, &k_2), &hand, &moment);
            let k_4 = self.rates(&plus(&y, h, &k_3), &hand, &moment);
            for i in 0..STATES {
                self.y[i] += h / 6.0 * (k_1[i] + 2.0 * (k_2[i] + k_3[i]) + k_4[i]);
            }
            self.confine();
            hand.time_s += h;
            hand.tripped_s += if hand.esv_open { 0.0 } else { h };
        }
    }

    /// The spool transducer, pu.
    pub(crate) fn spool_reading_pu(&self) -> f64 {
        self.y[LVDT]
    }

    /// The servomotor transducer, pu.
    pub(crate) fn servomotor_reading_pu(&self) -> f64 {
        self.y[READING_2]
    }

    /// Pilot-valve position, pu.
    pub(crate) fn pilot_position_pu(&self) -> f64 {
        self.y[PILOT]
    }

    /// Control pressure, Pa.
    pub(crate) fn control_pressure_pa(&self) -> f64 {
        self.y[CONTROL]
    }

    /// Piston position, pu.
    pub(crate) fn opening_pu(&self) -> f64 {
        self.y[PISTON] / self.p.servomotor.stroke_m
    }

    /// Piston speed, m/s.
    pub(crate) fn piston_m_s(&self) -> f64 {
        self.y[PISTON_SPEED]
    }

    fn confine(&mut self) {
        for (place, rate, low) in [(PILOT, PILOT_RATE, -1.0), (ESV, ESV_RATE, 0.0)] {
            if self.y[place] <= low || self.y[place] >= 1.0 {
                self.y[place] = self.y[place].clamp(low, 1.0);
                self.y[rate] = 0.0;
            }
        }
        for place in [CONTROL, OPENING, CLOSING, NODE] {
            self.y[place] = self.y[place].max(-1.0e5);
        }
    }

    #[expect(clippy::too_many_lines, reason = "one system of equations")]
    fn rates(&self, y: &RigVector, hand: &Hand, moment: &Moment) -> RigVector {
        let (p, f, odd) = (&self.p, &self.faults, &self.odd);
        let mut d = [0.0; STATES];
        let return_pa = p.oil.return_pressure_pa;
        let compressibility_1_pa = 1.0 / p.oil.bulk_modulus_pa;
        let viscosity = moment.viscosity_ratio;
        let [within_10_s, within_20_s, within_30_s] = moment.fading;

        // Main ports: four edges of their own.
        let x = y[SPOOL];
        let h_0 = p.main_ports.overlap_m;
        let [e_1, e_2, e_3, e_4] = odd.overlap_shares;
        let (opens_m, closes_m) = (1.1 * f.port_overlap_m, 0.9 * f.port_overlap_m);
        let radius_m = odd.edge_radius_m + 0.1 * f.port_overlap_m.abs();
        let port = p.esv.discharge_coefficient * p.main_ports.width_m * (2.0 / p.oil.density_kg_m3).sqrt();
        let window = |beyond_m: f64, worn: f64| {
            let wear_m = 0.5 * worn * f.port_wear_m;
            port * if wear_m > 0.0 { eroded(beyond_m, wear_m) } else { edge(beyond_m, radius_m) }
        };
        let [w_1, w_2, w_3, w_4] = WEAR_SHARES;
        let behind_pa = return_pa + odd.held_back_pa(f.return_loss, y[RETURN]);
        let fed_1 = window(x - h_0 * e_1 - opens_m, w_1) * jet(y[NODE] - y[OPENING]);
        let drained_2 = window(x - h_0 * e_2 - opens_m, w_2) * jet(y[CLOSING] - behind_pa);
        let fed_2 = window(-x - h_0 * e_3 - closes_m, w_3) * jet(y[NODE] - y[CLOSING]);
        let servo = &p.servomotor;
        let opening_pu = y[PISTON] / servo.stroke_m;
        let mut outlet = window(-x - h_0 * e_4 - closes_m, w_4);
        if f.cushion > 0.0 && y[PISTON_SPEED] < 0.0 && opening_pu < CUSHION_PU {
            let narrowing = (1.0 - opening_pu.max(0.0) / CUSHION_PU).powf(1.2);
            let series = f.cushion * narrowing / servo.opening_area_m2.powi(3);
            outlet /= (1.0 + outlet * outlet * series).sqrt();
        }
        let drained_1 = outlet * jet(y[OPENING] - behind_pa);
        let drawn_m3_s = fed_1 + fed_2;
        d[RETURN] = (drained_1 + drained_2 - y[RETURN]) / RETURN_S;

        // Line: inertia of its oil, compressible node, losses part laminar.
        let surplus_m3_s = y[LINE] - drawn_m3_s;
        let at_node_pa = y[NODE] + odd.node_resistance_pa_s_m3 * surplus_m3_s;
        let loss_pa = f.supply_loss * (0.85 * y[LINE].abs() + 0.15 * 0.02 * odd.size.flow_ratio) * y[LINE];
        d[LINE] = (hand.tank_pa + moment.ripple_pa - at_node_pa - loss_pa) / odd.line_inertance;
        d[NODE] = surplus_m3_s / (odd.node_volume_m3 * compressibility_1_pa);

        // Pilot valve: coil, position loop, two rounded edges.
        let valve = &p.proportional_valve;
        let (omega, coil_s) = (self.pilot_rad_s, self.coil_s);
        d[COIL] = (hand.current_pu - y[COIL]) / coil_s;
        d[PILOT] = y[PILOT_RATE];
        d[PILOT_RATE] =
            omega * (omega * (valve.gain_pu * y[COIL] - y[PILOT]) - 2.0 * valve.damping_ratio * y[PILOT_RATE]);
        let at_pu = y[PILOT] - f.pv_null_shift_pu * (1.0 + 0.1 * within_20_s);
        let round_pu = 0.002 + 0.1 * f.pv_overlap_pu;
        let fading = 1.0 - f.gain_drift_share * (1.0 - within_10_s);
        let conductance = valve.rated_flow_m3_s / valve.rated_pressure_drop_pa.sqrt() * fading;
        let curved = |s: f64| s * (1.0 + odd.pilot_curvature_ratio * s);
        let filling = odd.filling_gain * conductance * curved(edge(at_pu - 1.1 * f.pv_overlap_pu, round_pu));
        let draining = odd.draining_gain * conductance * curved(edge(-at_pu - 0.9 * f.pv_overlap_pu, round_pu));
        let control_pa = y[CONTROL];
        let full = f.filter_ratio * valve.rated_pressure_drop_pa.sqrt() / valve.rated_flow_m3_s;
        let (quadratic, linear) = if f.filter_ratio > 0.0 {
            (
                0.8 * full * full,
                (0.2 * full * full * 0.3 * valve.rated_flow_m3_s)
                    .max(2e8 * odd.size.pressure_ratio / odd.size.pilot_flow_ratio),
            )
        } else {
            (0.0, 0.0)
        };
        let pilot_m3_s =
            filtered(filling, y[NODE] - control_pa, quadratic, linear) - draining * jet(control_pa - return_pa);

        // ESV: a slide under constant force; it may hang.
        let travel_s = odd.esv_travel_s + 0.75 * f.esv_travel_s;
        let hangs = !hand.esv_open && f.esv_hang_s > 0.0 && hand.tripped_s < f.esv_hang_s && y[ESV] <= 0.5;
        let pull_1_s = if hand.esv_open { 2.0 } else { -2.0 } / (travel_s * travel_s);
        let ends = (y[ESV] >= 1.0 && pull_1_s > 0.0) || (y[ESV] <= 0.0 && pull_1_s < 0.0);
        if !(ends || hangs) {
            d[ESV] = y[ESV_RATE];
            d[ESV_RATE] = pull_1_s;
        }
        let open = y[ESV].clamp(0.0, 1.0);
        let drain = p.esv.discharge_coefficient * p.esv.drain_area_m2 * (2.0 / p.oil.density_kg_m3).sqrt();
        let passed_m3_s = open * pilot_m3_s - (1.0 - open) * drain * jet(control_pa - return_pa);

        // Control chamber and spool.
        let dv = &p.distributing_valve;
        let share = x / dv.reference_stroke_m;
        let leaks_m3_s = (dv.leakage_m3_s_pa * (y[NODE] - control_pa)
            - f.chamber_leak_m3_s_pa
                * (1.0 + 0.3 * share)
                * gap(control_pa - return_pa, 3.2e6 * odd.size.pressure_ratio))
            / viscosity
            - f.relief_m3_s_pa * (control_pa - 3.35e6 * odd.size.pressure_ratio).max(0.0);
        let soft_1_pa = compressibility_1_pa + gas_compressibility_1_pa(f.air_share, control_pa);
        d[CONTROL] = (passed_m3_s + leaks_m3_s - dv.control_area_m2 * y[SPOOL_SPEED])
            / ((dv.control_volume_m3 + dv.control_area_m2 * x) * soft_1_pa);
        let coils_m = (dv.spring_precompression_m + x).max(0.0);
        let spring_n = dv.spring_stiffness_n_m
            * coils_m
            * (1.0 - f.spring_share * (1.1 - 0.1 * coils_m / dv.spring_precompression_m));
        let travel_m = x - x.clamp(-h_0, h_0);
        let drops_pa = if travel_m >= 0.0 {
            (y[NODE] - y[OPENING]) + (y[CLOSING] - behind_pa)
        } else {
            (y[NODE] - y[CLOSING]) + (y[OPENING] - behind_pa)
        };
        let jet_ratio = odd.flow_force_ratio + f.flow_force_ratio;
        let angle = 0.358 + 0.57 * (-travel_m.abs() / (4e-5 * odd.size.spool_stroke_ratio)).exp();
        let flow_n = jet_ratio
            * 2.0
            * p.esv.discharge_coefficient
            * p.main_ports.width_m
            * (angle * travel_m * drops_pa.max(0.0)
                + 0.02
                    * odd.size.spool_stroke_ratio
                    * y[SPOOL_SPEED]
                    * (p.oil.density_kg_m3 * 3e6 * odd.size.pressure_ratio).sqrt());
        let (bend_m_s, rub_n) = self.spool_friction.rate_and_force(y[SPOOL_SPEED], y[SPOOL_BEND]);
        let stop_n = stop(x, y[SPOOL_SPEED], dv.stroke_min_m, dv.stroke_max_m, odd.spool_stop_n_m, dv.spool_mass_kg);
        d[SPOOL] = y[SPOOL_SPEED];
        d[SPOOL_BEND] = bend_m_s;
        d[SPOOL_SPEED] = (control_pa * dv.control_area_m2 - y[NODE] * dv.constant_pressure_area_m2
            + dv.spool_mass_kg * dv.gravity_m_s2
            - spring_n
            - flow_n
            - dv.viscous_damping_n_s_m * viscosity * y[SPOOL_SPEED]
            - rub_n
            + stop_n)
            / dv.spool_mass_kg;

        // Servomotor.
        let w = y[PISTON_SPEED];
        let cross_m3_s = f.servo_leak_m3_s_pa * gap(y[OPENING] - y[CLOSING], 1e6 * odd.size.pressure_ratio) / viscosity;
        let z = y[PISTON].clamp(0.0, servo.stroke_m);
        d[OPENING] = (fed_1 - drained_1 - cross_m3_s - servo.opening_area_m2 * w)
            / ((servo.dead_volume_m3 + servo.opening_area_m2 * z) * compressibility_1_pa);
        d[CLOSING] = (fed_2 - drained_2 + cross_m3_s + servo.closing_area_m2 * w)
            / ((servo.dead_volume_m3 + servo.closing_area_m2 * (servo.stroke_m - z)) * compressibility_1_pa);
        let turn = std::f64::consts::TAU * opening_pu;
        let sheet_n = servo.load_closed_n + servo.load_slope_n * opening_pu;
        let load_n = sheet_n * (1.0 + f.load_ratio * (1.0 + 0.1 * turn.sin()))
            + odd.load_ripple_ratio * servo.load_slope_n * turn.sin()
            + moment.surge_n;
        let (bend_m_s, rub_n) = self.piston_friction.rate_and_force(w, y[PISTON_BEND]);
        let spot = (opening_pu - 0.45) / 0.02;
        let spot_n =
            if f.sticky_spot_n == 0.0 { 0.0 } else { f.sticky_spot_n * (-spot * spot).exp() * (w / 1e-3).tanh() };
        let stop_n = stop(y[PISTON], w, 0.0, servo.stroke_m, odd.piston_stop_n_m, servo.moving_mass_kg);
        d[PISTON] = w;
        d[PISTON_BEND] = bend_m_s;
        d[PISTON_SPEED] = (y[OPENING] * servo.opening_area_m2
            - y[CLOSING] * servo.closing_area_m2
            - load_n
            - servo.viscous_damping_n_s_m * viscosity * w
            - rub_n
            - spot_n
            + stop_n)
            / servo.moving_mass_kg;

        // Transducers: a rod dragged through a contact gap, lags, a straight line that is not quite straight.
        let slack_pu = opening_pu - y[ROD];
        let contact_pu = slack_pu - slack_pu.clamp(-0.5 * f.play_pu, 0.5 * f.play_pu);
        d[ROD] = contact_pu / if f.play_pu > 0.0 { 2e-3 } else { 1e-4 };
        let slipped_pu = f.feedback_bias_pu * (1.03 - 0.06 * y[ROD]) * (1.0 + 0.04 * within_30_s);
        d[READING_1] = (y[ROD] + slipped_pu - y[READING_1]) / (odd.feedback_lag_s + 0.5 * f.feedback_lag_s);
        d[READING_2] = (y[READING_1] - y[READING_2]) / (1e-4 + 0.5 * f.feedback_lag_s);
        let bias_pu = f.lvdt_bias_pu * (1.0 + 0.05 * within_20_s);
        let straight = 1.0 + f.lvdt_gain * (1.0 - 0.1 * share * share);
        let shown_pu = straight * share + bias_pu + f.lvdt_cubic_pu * share * share * share;
        d[LVDT] = (shown_pu - y[LVDT]) / odd.lvdt_lag_s;
        d
    }
}

#[inline]
fn plus(y: &RigVector, by: f64, k: &RigVector) -> RigVector {
    std::array::from_fn(|i| y[i] + by * k[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::draws::{Draw, Question};
    use govtwin_model::effects::of_the_chain;
    use govtwin_model::effects::scaling::UnitSize;

    /// Steps of 200 µs are as good as steps of 25 µs: they agree within a thirtieth of the transducers' noise, whatever is wrong.
    #[test]
    fn the_steps_are_short_enough() {
        let unit = govtwin_model::params::reference();
        let p = &unit.parameters;
        let mut ids: Vec<(&str, f64)> = vec![("", 0.0)];
        ids.extend(of_the_chain().map(|spec| (spec.id, spec.parameters[0].typical)));
        let cases = ids.into_iter().map(|(id, size)| (id, size, 5)).chain((10..20).map(|seed| ("", 0.0, seed)));
        for (id, size, seed) in cases {
            let odd = Mismatch::draw(p, &UnitSize::new(p), 1.0, &mut Draw::new(seed, Question::Mismatch, 0));
            let mut faults = Faults::default();
            faults.add(id, size);
            let mut rigs = [STEPS, 8 * STEPS].map(|steps| (steps, Rig::new(p, &faults, &odd, 0.3)));
            let mut squares = [0.0; 2];
            for tick in 0..8000_u32 {
                let time_s = f64::from(tick) * 1e-3;
                let readings = rigs.each_mut().map(|(steps, rig)| {
                    // A spool loop of its own, so that nothing runs away: up, down, small steps, then a trip.
                    let wanted_pu = [0.4, -0.3, 0.03, -0.02][(tick / 1500 % 4) as usize];
                    let current_pu = (8.0 * (wanted_pu - rig.spool_reading_pu())).clamp(-1.0, 1.0);
                    let tripped_s = (time_s - 6.5).max(0.0);
                    let hand = Hand { time_s, current_pu, esv_open: time_s < 6.5, tripped_s, tank_pa: 6.3e6 };
                    rig.tick_in(&hand, *steps);
                    [rig.spool_reading_pu(), rig.servomotor_reading_pu()]
                });
                for (square, (a, b)) in squares.iter_mut().zip(readings[0].iter().zip(readings[1])) {
                    *square += (a - b).powi(2) / 8000.0;
                }
            }
            let rms = squares.map(f64::sqrt);
            assert!(rms[0] < 2e-5 && rms[1] < 2e-6, "{id}, {seed}: {rms:?}");
        }
    }
}
