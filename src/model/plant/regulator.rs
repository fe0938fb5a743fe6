//! The regulator: two discrete loops that turn the opening command into a valve current.
//!
//! Every large-loop period: `e = Y_pid − Y`; `u_c = K1 e + C_p` for `e ≥ Z_u`, `K1 e + C_n` for `e ≤ Z_l`, 0 between;
//! `u_y = sat(u_c)`. Every small-loop period: `u = sat(K2 (u_y − y − y_r) + I_r)`, limits ±1 pu.
//! Effects may scale the command and lower the limit of the current.
//! Source: Liu et al. 2025, equations 1 to 4. The large loop holds its output between its instants.

use crate::parameters;
use crate::plant::lanes::abreast;
use crate::plant::real::Real;

/// Standard deviations beyond which a branch of the dead band is certain.
const FAR: f64 = 6.0;

/// Law and parameters of the regulator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regulator {
    p: parameters::Regulator,
    /// Noise of the servomotor reading inside the loop, one standard deviation, pu; 0 for a twin that is one
    /// realisation, the sheet's for one that is the mean of many.
    pub dither_pu: f64,
    /// The command as the regulator reads it, over the command; 1 on the sheet.
    pub command_gain: f64,
    /// Greatest current that reaches the proportional valve, pu; 1 on the sheet.
    pub current_limit_pu: f64,
    ticks_per_large_loop: u64,
    /// The same for a period that an effect lengthened, any number; 0 where none did.
    lengthened_ticks_count: f64,
}

impl Regulator {
    /// From the sheet.
    pub fn new(p: &parameters::Regulator) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1, and a cast saturates")]
        let ticks_per_large_loop = (p.large_loop_period_s / p.small_loop_period_s).round().max(1.0) as u64;
        Self {
            p: *p,
            dither_pu: 0.0,
            command_gain: 1.0,
            current_limit_pu: 1.0,
            ticks_per_large_loop,
            lengthened_ticks_count: 0.0,
        }
    }

    /// Period of the small loop, s.
    pub fn small_loop_period_s(&self) -> f64 {
        self.p.small_loop_period_s
    }

    /// Period of the large loop on the sheet, s.
    pub fn large_loop_period_s(&self) -> f64 {
        self.p.large_loop_period_s
    }

    /// Whole ticks between two runs of the large loop on the sheet.
    pub(crate) fn ticks_per_large_loop(&self) -> usize {
        usize::try_from(self.ticks_per_large_loop).unwrap_or(usize::MAX)
    }

    /// After how many ticks the large loop runs again, each time; `None` where its instants lie between ticks.
    pub(crate) fn whole_ticks(&self) -> Option<u64> {
        (self.lengthened_ticks_count == 0.0 || self.dither_pu > 0.0).then_some(self.ticks_per_large_loop)
    }

    /// Lengthens the large loop's period, which then need not be a whole number of ticks.
    pub(crate) fn lengthen_large_loop(&mut self, by_s: f64) {
        let ticks = self.lengthened_ticks_count.max(self.ticks_per_large_loop as f64);
        self.lengthened_ticks_count = ticks + (by_s / self.p.small_loop_period_s).max(0.0);
    }

    /// How often the large loop would run on the sheet while it runs once; above 1 where the twin is a mean and the loop slowed, which then
    /// keeps the sheet's instants, and what it demands is a mean over these runs.
    pub(crate) fn runs_per_hold_count(&self) -> f64 {
        let mean = if self.dither_pu > 0.0 { self.lengthened_ticks_count } else { 0.0 };
        (mean / self.ticks_per_large_loop as f64).max(1.0)
    }

    /// Share of a tick that passes before the large loop runs in it; `None` where it does not run.
    #[inline]
    pub(crate) fn large_loop_share(&self, tick: u64) -> Option<f64> {
        if self.lengthened_ticks_count == 0.0 || self.dither_pu > 0.0 {
            return tick.is_multiple_of(self.ticks_per_large_loop).then_some(0.0);
        }
        let (tick, period) = (tick as f64, self.lengthened_ticks_count);
        // Rounding may put one instant into two neighbouring ticks, which does no harm, but never into none.
        let share = ((tick / period - 1e-9).ceil() * period - tick).max(0.0);
        (share < 1.0).then_some(share)
    }

    /// The dead band on the servomotor error, pu: lower and upper edge.
    pub(crate) fn deadband_pu(&self) -> (f64, f64) {
        (self.p.deadband_lower_pu, self.p.deadband_upper_pu)
    }

    /// What the large loop demands at the edge of the dead band, mean of both sides, pu.
    pub fn deadband_step_pu(&self) -> f64 {
        let p = &self.p;
        let (up, down) = (
            p.position_gain * p.deadband_upper_pu + p.compensation_positive_pu,
            p.position_gain * p.deadband_lower_pu + p.compensation_negative_pu,
        );
        0.5 * (up - down)
    }

    /// The large loop: spool demand `u_y`, pu.
    #[inline]
    pub fn spool_command_pu(&self, command_pu: f64, servomotor_reading_pu: f64) -> f64 {
        let e = self.command_gain * command_pu - servomotor_reading_pu;
        let u_c = if e >= self.p.deadband_upper_pu {
            self.p.position_gain * e + self.p.compensation_positive_pu
        } else if e <= self.p.deadband_lower_pu {
            self.p.position_gain * e + self.p.compensation_negative_pu
        } else {
            0.0
        };
        u_c.clamp(self.p.spool_command_min_pu, self.p.spool_command_max_pu)
    }

    /// Mean and standard deviation of the large loop's demand over the noise of the reading, pu.
    ///
    /// With `n ~ N(0, σ²)` on the error, `a = (e − Z_u)/σ`, `b = (Z_l − e)/σ`: each branch of the law contributes
    /// `(K1 e + C) Φ ± K1 σ φ` to the mean, and its square likewise. Noise smooths the dead band as dither does
    /// (Gelb & Vander Velde 1968, *Multiple-Input Describing Functions*, section 7.2); the limits act on the mean.
    pub(crate) fn dithered_command_pu(&self, command_pu: f64, servomotor_reading_pu: f64) -> (f64, f64) {
        let sigma = self.dither_pu;
        let e = self.command_gain * command_pu - servomotor_reading_pu;
        let gain = self.p.position_gain;
        let a = (e - self.p.deadband_upper_pu) / sigma;
        let b = (self.p.deadband_lower_pu - e) / sigma;
        if sigma <= 0.0 || a > FAR || b > FAR {
            let sd_pu = if sigma > 0.0 { gain * sigma } else { 0.0 };
            return (self.spool_command_pu(command_pu, servomotor_reading_pu), sd_pu);
        }
        if a < -FAR && b < -FAR {
            return (0.0, 0.0);
        }
        let spread = gain * sigma;
        // A band is many deviations wide: near one of its edges the other branch is out of reach.
        let branch = |level: f64, z: f64, side: f64| {
            if z < -FAR {
                return (0.0, 0.0);
            }
            let (phi, density) = (normal_cdf(z), normal_density(z));
            let mean = level * phi + side * spread * density;
            let square =
                level * level * phi + 2.0 * side * level * spread * density + spread * spread * (phi - z * density);
            (mean, square)
        };
        let (up, up_square) = branch(gain * e + self.p.compensation_positive_pu, a, 1.0);
        let (down, down_square) = branch(gain * e + self.p.compensation_negative_pu, b, -1.0);
        let mean = up + down;
        let sd_pu = (up_square + down_square - mean * mean).max(0.0).sqrt();
        (mean.clamp(self.p.spool_command_min_pu, self.p.spool_command_max_pu), sd_pu)
    }

    /// The small loop.
    #[inline(always)]
    pub(crate) fn small_loop(&self) -> SmallLoop {
        SmallLoop {
            gain: self.p.spool_gain,
            spool_reference_pu: self.p.spool_reference_pu,
            current_reference_pu: self.p.current_reference_pu,
            current_limit_pu: self.current_limit_pu,
        }
    }

    /// The small loop: valve current `u`, pu.
    #[inline]
    pub fn valve_current_pu(&self, spool_command_pu: f64, spool_reading_pu: f64) -> f64 {
        self.small_loop().valve_current_pu(spool_command_pu, spool_reading_pu)
    }

    /// The spool reading at which the small loop rests with this current, pu.
    pub(crate) fn resting_reading_pu(&self, spool_command_pu: f64, valve_current_pu: f64) -> f64 {
        spool_command_pu - self.p.spool_reference_pu
            + (self.p.current_reference_pu - valve_current_pu) / self.p.spool_gain
    }
}

abreast! {
    /// The regulator's small loop, of one unit or of several in lanes.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub(crate) struct SmallLoop<T = f64> {
        gain: T,
        spool_reference_pu: T,
        current_reference_pu: T,
        current_limit_pu: T,
    }
}

impl<T: Real> SmallLoop<T> {
    /// Valve current `u`, pu.
    #[inline(always)]
    pub(crate) fn valve_current_pu(&self, spool_command_pu: T, spool_reading_pu: T) -> T {
        let off_pu = spool_command_pu - spool_reading_pu - self.spool_reference_pu;
        (self.gain * off_pu + self.current_reference_pu).clamp(-self.current_limit_pu, self.current_limit_pu)
    }
}

fn normal_cdf(z: f64) -> f64 {
    0.5 * statrs::function::erf::erfc(-z * std::f64::consts::FRAC_1_SQRT_2)
}

fn normal_density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dead_band_is_closed_at_its_edges() {
        let regulator = crate::plant::reference().regulator;
        assert_eq!(regulator.spool_command_pu(0.0004, 0.0), 0.0);
        assert_eq!(regulator.spool_command_pu(0.0005, 0.0), 0.03);
        assert_eq!(regulator.spool_command_pu(-0.0005, 0.0), -0.03);
    }

    #[test]
    fn both_loops_saturate() {
        let regulator = crate::plant::reference().regulator;
        assert_eq!(regulator.spool_command_pu(1.0, 0.0), 1.0);
        assert_eq!(regulator.spool_command_pu(0.0, 1.0), -1.0);
        assert_eq!(regulator.valve_current_pu(1.0, 0.0), 1.0);
        assert_eq!(regulator.valve_current_pu(-1.0, 0.0), -1.0);
    }

    #[test]
    fn the_large_loop_keeps_its_period() {
        let mut regulator = crate::plant::reference().regulator;
        let runs = |regulator: &Regulator| -> Vec<f64> {
            (0..2000).filter_map(|tick| regulator.large_loop_share(tick).map(|share| tick as f64 + share)).collect()
        };
        let nominal = runs(&regulator);
        assert!(nominal.len() == 200 && nominal.windows(2).all(|pair| pair[1] - pair[0] == 10.0));
        regulator.lengthen_large_loop(0.0133);
        let mut slow = runs(&regulator);
        slow.dedup_by(|b, a| (*b - *a).abs() < 1e-6);
        assert_eq!(slow.len(), 86);
        assert!(slow.windows(2).all(|pair| (pair[1] - pair[0] - 23.3).abs() < 1e-6));
    }

    #[test]
    fn the_resting_reading_inverts_the_small_loop() {
        let regulator = crate::plant::reference().regulator;
        let reading_pu = regulator.resting_reading_pu(0.1, 0.02);
        assert!((regulator.valve_current_pu(0.1, reading_pu) - 0.02).abs() < 1e-15);
    }

    #[test]
    fn the_dithered_command_is_the_mean_over_the_noise() {
        let mut regulator = crate::plant::reference().regulator;
        regulator.dither_pu = 1.5e-4;
        for e in [-9e-4, -5e-4, -3e-4, 0.0, 2e-4, 5e-4, 6e-4, 2e-3] {
            // A midpoint sum over ±8 standard deviations.
            let (n, mut mean, mut square) = (200_000, 0.0, 0.0);
            for k in 0..n {
                let z = -8.0 + 16.0 * (f64::from(k) + 0.5) / f64::from(n);
                let u = regulator.spool_command_pu(e + z * regulator.dither_pu, 0.0);
                let weight = normal_density(z) * 16.0 / f64::from(n);
                mean += weight * u;
                square += weight * u * u;
            }
            let (got, sd) = regulator.dithered_command_pu(e, 0.0);
            assert!((got - mean).abs() < 1e-6, "{e}: {got} {mean}");
            assert!((sd - (square - mean * mean).max(0.0).sqrt()).abs() < 1e-5, "{e}: {sd}");
        }
    }
}
