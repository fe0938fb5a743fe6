//! The regulator: two discrete loops that turn the opening command into a valve current.
//!
//! Every large-loop period: `e = Y_pid − Y`; `u_c = K1 e + C_p` for `e ≥ Z_u`, `K1 e + C_n` for `e ≤ Z_l`, 0 between;
//! `u_y = sat(u_c)`. Every small-loop period: `u = sat(K2 (u_y − y − y_r) + I_r)`, limits ±1 pu.
//! Source: Liu et al. 2025, equations 1 to 4. The large loop holds its output between its instants.

use crate::parameters;

/// Law and parameters of the regulator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regulator {
    p: parameters::Regulator,
    ticks_per_large_loop: u64,
    /// The same for a period that an effect lengthened, any number; 0 where none did.
    lengthened_ticks_count: f64,
}

impl Regulator {
    /// From the sheet.
    #[must_use]
    pub fn new(p: &parameters::Regulator) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1, and a cast saturates")]
        let ticks_per_large_loop = (p.large_loop_period_s / p.small_loop_period_s).round().max(1.0) as u64;
        Self { p: *p, ticks_per_large_loop, lengthened_ticks_count: 0.0 }
    }

    /// Period of the small loop, s.
    #[must_use]
    pub fn small_loop_period_s(&self) -> f64 {
        self.p.small_loop_period_s
    }

    /// Whole ticks between two runs of the large loop on the sheet.
    #[must_use]
    pub fn ticks_per_large_loop(&self) -> usize {
        usize::try_from(self.ticks_per_large_loop).unwrap_or(usize::MAX)
    }

    /// Lengthens the large loop's period, which then need not be a whole number of ticks.
    pub fn lengthen_large_loop(&mut self, by_s: f64) {
        let ticks = self.lengthened_ticks_count.max(self.ticks_per_large_loop as f64);
        self.lengthened_ticks_count = ticks + (by_s / self.p.small_loop_period_s).max(0.0);
    }

    /// Share of a tick that passes before the large loop runs in it; `None` where it does not run.
    #[inline]
    #[must_use]
    pub fn large_loop_share(&self, tick: u64) -> Option<f64> {
        if self.lengthened_ticks_count == 0.0 {
            return tick.is_multiple_of(self.ticks_per_large_loop).then_some(0.0);
        }
        let (tick, period) = (tick as f64, self.lengthened_ticks_count);
        // Rounding may put one instant into two neighbouring ticks, which does no harm, but never into none.
        let share = ((tick / period - 1e-9).ceil() * period - tick).max(0.0);
        (share < 1.0).then_some(share)
    }

    /// The dead band on the servomotor error, pu: lower and upper edge.
    #[must_use]
    pub fn deadband_pu(&self) -> (f64, f64) {
        (self.p.deadband_lower_pu, self.p.deadband_upper_pu)
    }

    /// The large loop: spool demand `u_y`, pu.
    #[inline]
    #[must_use]
    pub fn spool_command_pu(&self, command_pu: f64, servomotor_reading_pu: f64) -> f64 {
        let e = command_pu - servomotor_reading_pu;
        let u_c = if e >= self.p.deadband_upper_pu {
            self.p.position_gain * e + self.p.compensation_positive_pu
        } else if e <= self.p.deadband_lower_pu {
            self.p.position_gain * e + self.p.compensation_negative_pu
        } else {
            0.0
        };
        u_c.clamp(self.p.spool_command_min_pu, self.p.spool_command_max_pu)
    }

    /// The small loop: valve current `u`, pu.
    #[inline]
    #[must_use]
    pub fn valve_current_pu(&self, spool_command_pu: f64, spool_reading_pu: f64) -> f64 {
        let u = self.p.spool_gain * (spool_command_pu - spool_reading_pu - self.p.spool_reference_pu)
            + self.p.current_reference_pu;
        u.clamp(-1.0, 1.0)
    }

    /// The spool reading at which the small loop rests with this current, pu.
    #[must_use]
    pub fn resting_reading_pu(&self, spool_command_pu: f64, valve_current_pu: f64) -> f64 {
        spool_command_pu - self.p.spool_reference_pu
            + (self.p.current_reference_pu - valve_current_pu) / self.p.spool_gain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet() -> Regulator {
        Regulator::new(&parameters::Regulator {
            position_gain: 30.0,
            spool_gain: 8.0,
            deadband_upper_pu: 0.0005,
            deadband_lower_pu: -0.0005,
            compensation_positive_pu: 0.015,
            compensation_negative_pu: -0.015,
            spool_command_min_pu: -1.0,
            spool_command_max_pu: 1.0,
            spool_reference_pu: 0.0,
            current_reference_pu: 0.0,
            large_loop_period_s: 0.010,
            small_loop_period_s: 0.001,
        })
    }

    #[test]
    fn the_dead_band_is_closed_at_its_edges() {
        let regulator = sheet();
        assert_eq!(regulator.spool_command_pu(0.0004, 0.0), 0.0);
        assert_eq!(regulator.spool_command_pu(0.0005, 0.0), 0.03);
        assert_eq!(regulator.spool_command_pu(-0.0005, 0.0), -0.03);
    }

    #[test]
    fn both_loops_saturate() {
        let regulator = sheet();
        assert_eq!(regulator.spool_command_pu(1.0, 0.0), 1.0);
        assert_eq!(regulator.spool_command_pu(0.0, 1.0), -1.0);
        assert_eq!(regulator.valve_current_pu(1.0, 0.0), 1.0);
        assert_eq!(regulator.valve_current_pu(-1.0, 0.0), -1.0);
    }

    #[test]
    fn the_large_loop_keeps_its_period() {
        let mut regulator = sheet();
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
        let regulator = sheet();
        let reading_pu = regulator.resting_reading_pu(0.1, 0.02);
        assert!((regulator.valve_current_pu(0.1, reading_pu) - 0.02).abs() < 1e-15);
    }
}
