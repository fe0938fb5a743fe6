//! The guide-vane servomotor: two chambers, a piston, friction and the guide-vane load.
//!
//! `P_1' = β/(V_d + A_o z) (Q_1 − A_o z')`, `P_2' = β/(V_d + A_c (S − z)) (A_c z' − Q_2)`;
//! `m_s z'' = P_1 A_o − P_2 A_c − (F_0 + F_1 Y) − F_c sgn(z') − B_s z'`, `0 ≤ z ≤ S`, `Y = z/S`
//! (Merritt 1967, section 6.6; Liu et al. 2025 stop at the spool). Leakage across the piston, a cushion at the
//! closed end and stiction beyond Coulomb's are 0 on the sheet; effects set them.

use crate::parameters;
use crate::plant::friction::Friction;
use crate::plant::lanes::abreast;
use crate::plant::real::{Real, either};

abreast! {
    /// Law and parameters of the servomotor.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Servomotor<T = f64> {
        /// Piston area on the opening side `A_o`, m².
        pub opening_area_m2: T,
        /// Piston area on the closing side `A_c`, m².
        pub closing_area_m2: T,
        /// Full stroke `S`, m.
        pub stroke_m: T,
        /// Dead volume, each side, m³.
        pub dead_volume_m3: T,
        /// Inverse bulk modulus, 1/Pa.
        pub compressibility_1_pa: T,
        /// Moving mass, kg.
        pub mass_kg: T,
        /// Viscous damping `B_s`, N s/m.
        pub viscous_damping_n_s_m: T,
        /// Friction.
        pub friction: Friction<T>,
        /// Load towards closing at Y = 0, N.
        pub load_closed_n: T,
        /// Load added at Y = 1, N.
        pub load_slope_n: T,
        /// Yield of the end stops, m/N.
        pub stop_compliance_m_n: T,
        /// Laminar leakage from the opening into the closing chamber, m³/(s Pa).
        pub cross_leakage_m3_s_pa: T,
        /// Cushion force per speed squared at the closed end, N s²/m².
        pub cushion_n_s2_m2: T,
        /// Length of the cushion from the closed end, m.
        pub cushion_length_m: T,
        /// Offset of the servomotor's transducer, pu.
        pub reading_bias_pu: T,
    }
}

impl Servomotor {
    /// From the sheet.
    pub fn new(p: &parameters::Servomotor, oil: &parameters::Oil) -> Self {
        Self {
            opening_area_m2: p.opening_area_m2,
            closing_area_m2: p.closing_area_m2,
            stroke_m: p.stroke_m,
            dead_volume_m3: p.dead_volume_m3,
            compressibility_1_pa: 1.0 / oil.bulk_modulus_pa,
            mass_kg: p.moving_mass_kg,
            viscous_damping_n_s_m: p.viscous_damping_n_s_m,
            friction: Friction { coulomb_n: p.coulomb_friction_n, static_ratio: 1.0 },
            load_closed_n: p.load_closed_n,
            load_slope_n: p.load_slope_n,
            stop_compliance_m_n: p.stop_compliance_m_n,
            cross_leakage_m3_s_pa: 0.0,
            cushion_n_s2_m2: 0.0,
            cushion_length_m: 0.0,
            reading_bias_pu: 0.0,
        }
    }
}

impl<T: Real> Servomotor<T> {
    /// What the transducer shows at a position, pu.
    #[inline(always)]
    pub fn reading_pu(&self, position_m: T) -> T {
        position_m / self.stroke_m + self.reading_bias_pu
    }

    /// Guide-vane load towards closing, N.
    #[inline(always)]
    pub fn load_n(&self, position_m: T) -> T {
        self.load_closed_n + self.load_slope_n * position_m / self.stroke_m
    }

    /// Volume that one Pa more compresses in the opening chamber, m³/Pa.
    #[inline(always)]
    pub(crate) fn opening_compliance_m3_pa(&self, position_m: T) -> T {
        (self.dead_volume_m3 + self.opening_area_m2 * position_m) * self.compressibility_1_pa
    }

    /// Volume that one Pa more compresses in the closing chamber, m³/Pa.
    #[inline(always)]
    pub(crate) fn closing_compliance_m3_pa(&self, position_m: T) -> T {
        (self.dead_volume_m3 + self.closing_area_m2 * (self.stroke_m - position_m)) * self.compressibility_1_pa
    }

    /// How far a force into the end stop that the piston touches bends it, m.
    #[inline(always)]
    pub(crate) fn stop_yield_m(&self, position_m: T, opening_pa: T, closing_pa: T) -> T {
        let zero = position_m.like(0.0);
        let off = position_m.gt(zero) & position_m.lt(self.stroke_m);
        either!(off | self.stop_compliance_m_n.is(0.0), zero, {
            let force_n =
                opening_pa * self.opening_area_m2 - closing_pa * self.closing_area_m2 - self.load_n(position_m);
            let into = T::select(position_m.le(zero), force_n.min(zero), force_n.max(zero));
            self.stop_compliance_m_n * into
        })
    }

    /// Damping at a position and speed, the cushion's included, N s/m.
    #[inline(always)]
    pub fn damping_n_s_m(&self, position_m: T, velocity_m_s: T, viscosity: T) -> T {
        let viscous = self.viscous_damping_n_s_m * viscosity;
        let outside = velocity_m_s.ge(viscosity.like(0.0)) | position_m.ge(self.cushion_length_m);
        either!(outside | self.cushion_n_s2_m2.is(0.0), viscous, {
            let share = viscosity.like(1.0) - position_m / self.cushion_length_m;
            viscous - self.cushion_n_s2_m2 * share * velocity_m_s
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::plant::reference;

    #[test]
    fn load_and_volumes_run_linearly_over_the_stroke() {
        let s = reference().servomotor;
        assert_eq!(s.load_n(0.0), 1.5e5);
        assert_eq!(s.load_n(0.6), 4.0e5);
        assert!((s.opening_compliance_m3_pa(0.6) - 0.14e-9).abs() < 1e-18);
        assert!((s.closing_compliance_m3_pa(0.0) - 0.128e-9).abs() < 1e-18);
    }

    #[test]
    fn the_cushion_brakes_only_the_end_of_closing() {
        let mut s = reference().servomotor;
        s.cushion_n_s2_m2 = 1e8;
        s.cushion_length_m = 0.06;
        assert_eq!(s.damping_n_s_m(0.07, -0.1, 1.0), s.viscous_damping_n_s_m);
        assert_eq!(s.damping_n_s_m(0.03, 0.1, 1.0), s.viscous_damping_n_s_m);
        assert!((s.damping_n_s_m(0.03, -0.1, 1.0) - s.viscous_damping_n_s_m - 5e6).abs() < 1e-6);
    }
}
