//! The proportional (pilot) valve: a second-order spool position loop and two edges.
//!
//! `x_p'' + 2 ζ ω_n x_p' + ω_n² x_p = K ω_n² u`, `|x_p| ≤ 1`;
//! `Q_x = Q_n s √((P_s − P_ctrl)/Δp_n)` for an opening `s ≥ 0`, `Q_n s √((P_ctrl − P_t)/Δp_n)` for `s < 0`.
//! Source: Liu et al. 2025, equations 5 to 12; the rating's 3.5 is MPa. On the sheet `s = x_p`.
//!
//! The linear part is stepped exactly for a current that holds over the step: with `d = x_p − K u`,
//! `(d, d')` moves by the matrix exponential (Åström & Wittenmark 1997, *Computer-Controlled Systems*, section 2.3).

use crate::parameters;
use crate::plant::lanes::abreast;
use crate::plant::orifice::{Flow, in_series, root};
use crate::plant::real::{Real, either};

abreast! {
    /// Law and parameters of the proportional valve.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct ProportionalValve<T = f64> {
        /// Natural frequency `ω_n`, rad/s.
        pub natural_frequency_rad_s: T,
        /// Damping ratio `ζ`.
        pub damping_ratio: T,
        /// Stroke per current `K`.
        pub gain_pu: T,
        /// Flow at full stroke per root of pressure drop, m³/(s √Pa).
        pub conductance: T,
        /// Half width of the dead zone around the hydraulic null, pu.
        pub overlap_pu: T,
        /// Valve position of the hydraulic null, pu.
        pub null_shift_pu: T,
        /// Inverse conductance of a restriction before the filling edge, √Pa s/m³.
        pub filling_restriction: T,
    }
}

abreast! {
    /// The exact step of the valve's linear part over a fixed time.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Propagator<T = f64> {
        end: [[T; 2]; 2],
        mean: [T; 2],
    }
}

impl ProportionalValve {
    /// From the sheet.
    pub fn new(p: &parameters::ProportionalValve) -> Self {
        Self {
            natural_frequency_rad_s: p.natural_frequency_rad_s,
            damping_ratio: p.damping_ratio,
            gain_pu: p.gain_pu,
            conductance: p.rated_flow_m3_s / p.rated_pressure_drop_pa.sqrt(),
            overlap_pu: 0.0,
            null_shift_pu: 0.0,
            filling_restriction: 0.0,
        }
    }

    /// Rate of change of `(x_p, x_p')` while the valve is off its stops.
    #[inline]
    pub fn rates(&self, position_pu: f64, rate_pu_s: f64, current_pu: f64) -> (f64, f64) {
        let omega = self.natural_frequency_rad_s;
        let pull = omega * omega * (self.gain_pu * current_pu - position_pu);
        (rate_pu_s, pull - 2.0 * self.damping_ratio * omega * rate_pu_s)
    }

    /// The exact step over `step_s`.
    pub(crate) fn propagator(&self, step_s: f64) -> Propagator {
        let omega = self.natural_frequency_rad_s;
        let sigma = self.damping_ratio * omega;
        let square = omega * omega - sigma * sigma;
        let decay = (-sigma * step_s).exp();
        // cosine and sine of the damped oscillation, or their hyperbolic twins, or the limit between.
        let (c, s) = if square > 1e-12 * omega * omega {
            let root = square.sqrt();
            ((root * step_s).cos(), (root * step_s).sin() / root)
        } else if square < -1e-12 * omega * omega {
            let root = (-square).sqrt();
            ((root * step_s).cosh(), (root * step_s).sinh() / root)
        } else {
            (1.0, step_s)
        };
        let end = [[decay * (c + sigma * s), decay * s], [-decay * omega * omega * s, decay * (c - sigma * s)]];
        // ∫ e^{At} dt = A⁻¹ (e^{Ah} − I), with A = [[0, 1], [−ω², −2ζω]]; its first row is wanted.
        let (w2, d) = (omega * omega, 2.0 * sigma);
        let mean = [
            (-d / w2 * (end[0][0] - 1.0) - end[1][0] / w2) / step_s,
            (-d / w2 * end[0][1] - (end[1][1] - 1.0) / w2) / step_s,
        ];
        Propagator { end, mean }
    }
}

impl<T: Real> ProportionalValve<T> {
    /// Hydraulic opening `s` at a valve position, pu.
    #[inline(always)]
    pub fn opening_pu(&self, position_pu: T) -> T {
        let shifted = position_pu - self.null_shift_pu;
        shifted - shifted.clamp(-self.overlap_pu, self.overlap_pu)
    }

    /// Flow towards the control chamber at a hydraulic opening, and its slope against the chamber's pressure.
    #[inline(always)]
    pub fn flow(&self, opening_pu: T, control_pressure_pa: T, supply_pa: T, return_pa: T) -> Flow<T> {
        let zero = opening_pu.like(0.0);
        let fills = opening_pu.ge(zero);
        let restriction = T::select(fills, self.filling_restriction, zero);
        let c = in_series(self.conductance * opening_pu, restriction);
        let drop_pa = T::select(fills, supply_pa - control_pressure_pa, control_pressure_pa - return_pa);
        let (value, slope) = root(drop_pa);
        Flow { m3_s: c * value, slope_m3_s_pa: T::select(fills, -c, c) * slope }
    }

    /// Steps `(x_p, x_p')` by the propagator's time under a held current; returns the mean position over the step, pu.
    #[inline(always)]
    pub fn advance(&self, by: &Propagator<T>, position_pu: &mut T, rate_pu_s: &mut T, current_pu: T) -> T {
        let one = current_pu.like(1.0);
        let target = self.gain_pu * current_pu;
        let (d, v) = (*position_pu - target, *rate_pu_s);
        let mean = target + by.mean[0] * d + by.mean[1] * v;
        let end = target + by.end[0][0] * d + by.end[0][1] * v;
        let rate = by.end[1][0] * d + by.end[1][1] * v;
        (*position_pu, *rate_pu_s) = either!(end.abs().gt(one), (end.clamp(-one, one), one.like(0.0)), (end, rate));
        mean.clamp(-one, one)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn valve(damping_ratio: f64) -> ProportionalValve {
        ProportionalValve { damping_ratio, ..crate::plant::reference().proportional_valve }
    }

    #[test]
    fn the_exact_step_composes_and_agrees_with_small_steps() {
        for damping_ratio in [0.4, 0.75, 1.0, 1.6] {
            let valve = valve(damping_ratio);
            let (mut x, mut v) = (0.1, -5.0);
            let mean = valve.advance(&valve.propagator(1e-3), &mut x, &mut v, 0.5);
            let (mut y, mut w, mut sum) = (0.1, -5.0, 0.0);
            let n = 20_000;
            let fine = valve.propagator(1e-3 / f64::from(n));
            for _ in 0..n {
                sum += valve.advance(&fine, &mut y, &mut w, 0.5) / f64::from(n);
            }
            assert!((x - y).abs() < 1e-10 && (v - w).abs() < 1e-7, "{damping_ratio}: {x} {y} {v} {w}");
            assert!((mean - sum).abs() < 1e-9, "{damping_ratio}: {mean} {sum}");
            // The same against the differential equation itself, by small explicit steps.
            let (mut y, mut w) = (0.1, -5.0);
            let h = 1e-3 / f64::from(n);
            for _ in 0..n {
                let (_, a) = valve.rates(y, w, 0.5);
                let middle = w + 0.5 * h * a;
                y += h * middle;
                w += h * valve.rates(y - 0.5 * h * middle, middle, 0.5).1;
            }
            assert!((x - y).abs() < 1e-7 && (v - w).abs() < 1e-4, "{damping_ratio}: {x} {y} {v} {w}");
        }
    }

    #[test]
    fn the_rated_flow_passes_at_the_rated_drop() {
        let valve = valve(0.75);
        assert!((valve.flow(1.0, 2.8e6, 6.3e6, 0.1e6).m3_s - 6.67e-4).abs() < 1e-12);
        assert!((valve.flow(-1.0, 3.6e6, 6.3e6, 0.1e6).m3_s + 6.67e-4).abs() < 1e-12);
        // Against its usual direction a flow changes sign.
        assert!(valve.flow(1.0, 7.0e6, 6.3e6, 0.1e6).m3_s < 0.0);
    }

    #[test]
    fn the_slope_is_the_derivative() {
        let mut valve = valve(0.75);
        valve.filling_restriction = 2.0 / valve.conductance;
        for (s, p) in [(0.3, 3.0e6), (-0.4, 3.0e6), (0.3, 6.299e6), (-0.1, 0.101e6)] {
            let f = |p: f64| valve.flow(s, p, 6.3e6, 0.1e6);
            let numeric = (f(p + 1.0).m3_s - f(p - 1.0).m3_s) / 2.0;
            assert!((numeric - f(p).slope_m3_s_pa).abs() < 1e-6 * f(p).slope_m3_s_pa.abs());
        }
    }
}
