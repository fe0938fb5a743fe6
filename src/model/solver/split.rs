//! The split linearly implicit method: the chain is a cascade within a tick, and each stage is linear in its speed.
//!
//! Within a tick the regulator's current holds, so the pilot valve is stepped exactly. The spool with its
//! chamber and the piston with its two chambers are stepped by a θ-method whose pressures are linearised
//! about the step's start. With `D = θ ΔP` and `v_θ = v + θ Δv`, chamber and force balance read
//!
//! `D = g (R − A v_θ)`, `g = (θh/C) / (1 − (θh/C) ∂Q/∂P)`; `m (v_θ − v)/(θh) = F(P + D) − B v_θ − F_f`,
//!
//! so that D drops out and one division gives `v_θ`. Friction enters as the
//! value that the law takes at `v_θ` (implicit friction as in Acary & Brogliato 2008, section 10.1); stops likewise.
//! The spool stage takes half a millisecond, the four times slower piston stage a tick with the mean port
//! travel. θ is 1/2 where the flow hardly depends on the pressure, which is of order 2 and neither damps nor excites the oil columns.
//! A chamber that is open to return or supply fills within a step, and would oscillate for ever between two pressures
//! about the right one; see `Chamber` below.

use crate::plant::lanes::{Abreast, Wide};
use crate::plant::orifice::Flow;
use crate::plant::proportional_valve::Propagator;
use crate::plant::rates::VACUUM_PA;
use crate::plant::real::{Real, either};
use crate::plant::{Blocks, Drive, Plant};
use crate::solver::steps;
use crate::state::State;

/// Greatest step of the spool stage, s.
pub const SPOOL_STEP_S: f64 = 5.0e-4;

/// Constants over a tick besides the drive.
#[derive(Clone, Copy, Debug)]
struct Held<T> {
    /// Pressure at the valve, Pa.
    supply_pa: T,
    /// Force on the spool beyond its own block's, N.
    outside_n: T,
    oil: Oil<T>,
}

/// How thick the oil is, relative to the sheet's.
#[derive(Clone, Copy, Debug)]
struct Oil<T> {
    viscosity_ratio: T,
    /// The inverse: how readily it leaks.
    fluidity_ratio: T,
}

impl<T: Real> Oil<T> {
    #[inline(always)]
    fn at(plant: &Blocks<'_, T>, time_s: f64) -> Self {
        let viscosity_ratio = plant.supply.viscosity(time_s);
        Self { viscosity_ratio, fluidity_ratio: viscosity_ratio.like(1.0) / viscosity_ratio }
    }
}

/// Step lengths, and the pilot valve's exact step.
#[derive(Clone, Debug)]
pub struct Split<T = f64> {
    count: u32,
    step_s: f64,
    per_step_hz: f64,
    tick_s: f64,
    per_tick_hz: f64,
    propagator: Propagator<T>,
}

impl Split {
    /// Prepares the steps for ticks of `tick_s`: whole spool steps of at most `max_step_s`, one piston step.
    pub fn new(plant: &Plant, tick_s: f64, max_step_s: f64) -> Self {
        let (count, step_s) = steps(tick_s, max_step_s);
        Self {
            count,
            step_s,
            per_step_hz: 1.0 / step_s,
            tick_s,
            per_tick_hz: 1.0 / tick_s,
            propagator: plant.proportional_valve.propagator(step_s),
        }
    }
}

impl Split {
    /// Whether the steps of another plant are as long as these.
    pub(crate) fn is_as_long_as(&self, other: &Self) -> bool {
        self.count == other.count && self.step_s == other.step_s && self.tick_s == other.tick_s
    }
}

impl<T: Wide> Split<T> {
    /// The steps of several plants in as many lanes as `zero` has; the last fills what lanes are left. `None` where they differ in length.
    pub(crate) fn abreast(splits: &[&Split], zero: T) -> Option<Self> {
        let first = splits.first()?;
        if !splits.iter().all(|other| other.is_as_long_as(first)) {
            return None;
        }
        let last = splits.len() - 1;
        Some(Self {
            count: first.count,
            step_s: first.step_s,
            per_step_hz: first.per_step_hz,
            tick_s: first.tick_s,
            per_tick_hz: first.per_tick_hz,
            propagator: Propagator::abreast(&|lane| &splits[lane.min(last)].propagator, &|of| zero.each(of)),
        })
    }
}

impl<T: Real> Split<T> {
    /// Advances by one tick.
    #[inline(always)]
    pub fn advance(&self, plant: &Blocks<'_, T>, state: &mut State<T>, drive: &Drive<T>) {
        let oil = Oil::at(plant, drive.time_s);
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
        let held = Held { supply_pa, outside_n, oil };
        let mut travel_sum_m = travel_m.like(0.0);
        for _ in 0..self.count {
            let start_m = state.spool_position_m;
            self.spool_step(plant, state, drive, &held);
            let yield_m =
                plant.spool.stop_yield_m(state.spool_position_m, state.control_pressure_pa, drive.tank_pressure_pa);
            let middle_m = (start_m + state.spool_position_m) * 0.5 + yield_m;
            travel_sum_m = travel_sum_m + plant.main_ports.blurred_travel_m(middle_m, drive.edge_blur_m);
        }
        self.piston_step(plant, state, drive, oil, travel_sum_m / f64::from(self.count));
    }

    /// Advances the servomotor alone by one tick; the spool is where the caller put it.
    #[inline(always)]
    pub(crate) fn advance_piston(&self, plant: &Blocks<'_, T>, state: &mut State<T>, drive: &Drive<T>) {
        let travel_m = plant.main_ports.travel_m(state.spool_position_m);
        self.piston_step(plant, state, drive, Oil::at(plant, drive.time_s), travel_m);
    }

    #[inline(always)]
    fn spool_step(&self, plant: &Blocks<'_, T>, state: &mut State<T>, drive: &Drive<T>, held: &Held<T>) {
        let (spool, valve) = (plant.spool, plant.proportional_valve);
        let (supply_pa, leaking) = (held.supply_pa, held.oil.fluidity_ratio);
        let return_pa = plant.supply.return_pressure_pa;
        let h = self.step_s;

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
            m3_s: entering.m3_s + leaking * spool.leakage_m3_s(p, supply_pa, return_pa) + drive.chamber_flow_m3_s,
            slope_m3_s_pa: entering.slope_m3_s_pa - leaking * (spool.leakage_m3_s_pa + spool.return_leakage_m3_s_pa),
        };
        let chamber = Chamber::new(net, h, spool.compliance_m3_pa(x, p));
        let weight = chamber.weight();
        let (theta, over_theta) = weight.with_inverse();
        let gain = chamber.gain(weight, h);
        let fill_pa = gain * net.m3_s;

        let a = spool.control_area_m2;
        let inertia = spool.mass_kg * over_theta * self.per_step_hz;
        let force_n = spool.static_force_n(x, p + fill_pa, supply_pa) + held.outside_n;
        let stiffness = T::select(x.gt(-spool.spring_precompression_m), spool.spring_stiffness_n_m, x.like(0.0));
        let resistance =
            inertia + a * a * gain + theta * h * stiffness + spool.viscous_damping_n_s_m * held.oil.viscosity_ratio;
        let free = spool.friction.speed_m_s(inertia * v + force_n, resistance, v);

        let next_m = x + free * h;
        let stop_m = next_m.clamp(spool.stroke_min_m, spool.stroke_max_m);
        let (v_theta, next_v) =
            either!(stop_m.eq(next_m), (free, v + (free - v) * over_theta), ((stop_m - x) / h, x.like(0.0)));
        state.spool_position_m = stop_m;
        state.spool_velocity_m_s = next_v;
        state.control_pressure_pa = (p + (fill_pa - gain * a * v_theta) * over_theta).max(p.like(VACUUM_PA));
    }

    #[inline(always)]
    fn piston_step(&self, plant: &Blocks<'_, T>, state: &mut State<T>, drive: &Drive<T>, oil: Oil<T>, travel_m: T) {
        let servo = plant.servomotor;
        let h = self.tick_s;
        let (z, w) = (state.servomotor_position_m, state.servomotor_velocity_m_s);
        let (p_1, p_2) = (state.opening_pressure_pa, state.closing_pressure_pa);
        let flows = plant.main_ports.flows(travel_m, p_1, p_2, drive.tank_pressure_pa, plant.supply);
        let leak = oil.fluidity_ratio * servo.cross_leakage_m3_s_pa;
        let opening = Flow {
            m3_s: flows.opening.m3_s - leak * (p_1 - p_2) + drive.opening_flow_m3_s,
            slope_m3_s_pa: flows.opening.slope_m3_s_pa - leak,
        };
        let closing = Flow {
            m3_s: flows.closing.m3_s + leak * (p_1 - p_2) + drive.closing_flow_m3_s,
            slope_m3_s_pa: flows.closing.slope_m3_s_pa - leak,
        };
        let chamber_1 = Chamber::new(opening, h, servo.opening_compliance_m3_pa(z));
        let chamber_2 = Chamber::new(closing, h, servo.closing_compliance_m3_pa(z));
        let weight = Chamber::choose(chamber_1.is_stiffer_than(chamber_2), chamber_1, chamber_2).weight();
        let (theta, over_theta) = weight.with_inverse();
        let (gain_1, gain_2) = (chamber_1.gain(weight, h), chamber_2.gain(weight, h));
        let (fill_1_pa, fill_2_pa) = (gain_1 * opening.m3_s, gain_2 * closing.m3_s);

        let (a_1, a_2) = (servo.opening_area_m2, servo.closing_area_m2);
        let inertia = servo.mass_kg * over_theta * self.per_tick_hz;
        let force_n = a_1 * (p_1 + fill_1_pa) - a_2 * (p_2 + fill_2_pa) - servo.load_n(z) + drive.servomotor_force_n;
        let resistance = inertia
            + a_1 * a_1 * gain_1
            + a_2 * a_2 * gain_2
            + theta * h * servo.load_slope_n / servo.stroke_m
            + servo.damping_n_s_m(z, w, oil.viscosity_ratio);
        let free = servo.friction.speed_m_s(inertia * w + force_n, resistance, w);

        let (zero, vacuum_pa) = (z.like(0.0), z.like(VACUUM_PA));
        let next_m = z + free * h;
        let stop_m = next_m.clamp(zero, servo.stroke_m);
        let (w_theta, next_w) =
            either!(stop_m.eq(next_m), (free, w + (free - w) * over_theta), ((stop_m - z) / h, zero));
        state.servomotor_position_m = stop_m;
        state.servomotor_velocity_m_s = next_w;
        state.opening_pressure_pa = (p_1 + (fill_1_pa - gain_1 * a_1 * w_theta) * over_theta).max(vacuum_pa);
        state.closing_pressure_pa = (p_2 + (fill_2_pa + gain_2 * a_2 * w_theta) * over_theta).max(vacuum_pa);
    }
}

/// A chamber over a step: volume stored and outflow for each pascal more, m³/Pa both.
///
/// Their ratio, the step over the time in which the flow fills the chamber, is the chamber's stiffness s. What follows from s is written
/// with the two as they are: a quotient of polynomials costs one division, of which the chain has no more than it needs.
#[derive(Clone, Copy, Debug)]
struct Chamber<T> {
    compliance_m3_pa: T,
    outflow_m3_pa: T,
}

impl<T: Real> Chamber<T> {
    #[inline(always)]
    fn new(net: Flow<T>, step_s: f64, compliance_m3_pa: T) -> Self {
        let slope = net.slope_m3_s_pa;
        Self { compliance_m3_pa, outflow_m3_pa: (slope * -step_s).max(slope.like(0.0)) }
    }

    #[inline(always)]
    fn choose(mask: T::Mask, yes: Self, no: Self) -> Self {
        Self {
            compliance_m3_pa: T::select(mask, yes.compliance_m3_pa, no.compliance_m3_pa),
            outflow_m3_pa: T::select(mask, yes.outflow_m3_pa, no.outflow_m3_pa),
        }
    }

    #[inline(always)]
    fn is_stiffer_than(self, other: Self) -> T::Mask {
        (self.outflow_m3_pa * other.compliance_m3_pa).gt(other.outflow_m3_pa * self.compliance_m3_pa)
    }

    /// θ = (3 + s) / (6 + s).
    ///
    /// A linear chamber then decays as the (1, 2) Padé approximant of the exponential does, of order 3 and without ringing (exponential
    /// fitting; Liniger & Willoughby 1970).
    #[inline(always)]
    fn weight(self) -> Weight<T> {
        Weight {
            end_m3_pa: self.compliance_m3_pa * 3.0 + self.outflow_m3_pa,
            whole_m3_pa: self.compliance_m3_pa * 6.0 + self.outflow_m3_pa,
        }
    }

    /// g: θ times the pressure that one m³/s more over the step would add, Pa s/m³.
    ///
    /// Along the tangent of a root a stiff step lands as far beyond the point without flow as it started before it (Newton's step on a square
    /// root); the derivative passes over to the chord, which is twice as steep and ends at that point, by 1 + s² / (4 + s²).
    #[inline(always)]
    fn gain(self, weight: Weight<T>, step_s: f64) -> T {
        let (c, o) = (self.compliance_m3_pa, self.outflow_m3_pa);
        let square = o * o;
        let both = c * 4.0 * c + square;
        weight.end_m3_pa * step_s * both / (weight.whole_m3_pa * c * both + weight.end_m3_pa * o * (both + square))
    }
}

/// θ, the weight of a step's end in its mean, as a fraction: 1/2 for chambers that fill slowly, 1 for those that fill at once.
#[derive(Clone, Copy, Debug)]
struct Weight<T> {
    end_m3_pa: T,
    whole_m3_pa: T,
}

impl<T: Real> Weight<T> {
    /// θ and 1/θ.
    #[inline(always)]
    fn with_inverse(self) -> (T, T) {
        let product = self.end_m3_pa * self.whole_m3_pa;
        let inverse = product.like(1.0) / product;
        (self.end_m3_pa * self.end_m3_pa * inverse, self.whole_m3_pa * self.whole_m3_pa * inverse)
    }
}

/// Pressure at the valve while the servomotor moves as it does, Pa.
#[inline(always)]
fn supply_pressure_pa<T: Real>(plant: &Blocks<'_, T>, state: &State<T>, drive: &Drive<T>) -> T {
    either!(plant.supply.line_root.is(0.0), drive.tank_pressure_pa, {
        let servo = plant.servomotor;
        let w = state.servomotor_velocity_m_s;
        let drawn_m3_s = T::select(w.ge(w.like(0.0)), servo.opening_area_m2, -servo.closing_area_m2) * w;
        plant.supply.pressure_pa(drive.tank_pressure_pa, drawn_m3_s)
    })
}
