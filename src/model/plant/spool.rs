//! The main distributing valve's spool and its control chamber; x > 0 opens.
//!
//! `(V_0 + A x)(1/β) P' = Q_e − A x' − C_l (P − P_s) − C_r (P − P_t)`;
//! `m x'' = P A − P_s A_cons + m g − F_k − B x' − F_f`, `F_k = k (δ_0 + x)` for `x > −δ_0`, else 0; `x_min ≤ x ≤ x_max`.
//! Source: Liu et al. 2025, equations 14 to 18 (A = A_ctrl, P = P_ctrl, the constant-pressure chamber at P_s).
//! C_r, free air and Coulomb friction are 0 on the sheet; effects set them.

use crate::parameters;
use crate::plant::friction::Friction;
use crate::plant::lanes::abreast;
use crate::plant::real::{Real, either};

/// Standard atmosphere, Pa: gauge pressures count from it.
const ATMOSPHERE_PA: f64 = 101_325.0;

abreast! {
    /// Law and parameters of the spool and its control chamber.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Spool<T = f64> {
        /// Moving mass `m`, kg.
        pub mass_kg: T,
        /// Viscous damping `B`, N s/m.
        pub viscous_damping_n_s_m: T,
        /// Control-chamber area `A_ctrl`, m².
        pub control_area_m2: T,
        /// Constant-pressure area `A_cons`, m².
        pub constant_area_m2: T,
        /// Spring stiffness `k`, N/m.
        pub spring_stiffness_n_m: T,
        /// Spring pre-compression `δ_0`, m.
        pub spring_precompression_m: T,
        /// Leakage from supply into the chamber `C_l`, m³/(s Pa).
        pub leakage_m3_s_pa: T,
        /// Leakage from the chamber to return `C_r`, m³/(s Pa).
        pub return_leakage_m3_s_pa: T,
        /// Chamber volume at neutral `V_0`, m³.
        pub control_volume_m3: T,
        /// Inverse bulk modulus of air-free oil, 1/Pa.
        pub compressibility_1_pa: T,
        /// Volume share of free air at atmospheric pressure.
        pub free_air_share: T,
        /// Stroke of 1 pu, m.
        pub reference_stroke_m: T,
        /// Stop on the closing side, m.
        pub stroke_min_m: T,
        /// Stop on the opening side, m.
        pub stroke_max_m: T,
        /// Yield of the stops, m/N.
        pub stop_compliance_m_n: T,
        /// Weight towards opening `m g`, N.
        pub weight_n: T,
        /// Friction.
        pub friction: Friction<T>,
        /// Gain of the spool transducer.
        pub reading_gain: T,
        /// Offset of the spool transducer, pu.
        pub reading_bias_pu: T,
    }
}

impl Spool {
    /// From the sheet.
    pub fn new(p: &parameters::DistributingValve, oil: &parameters::Oil) -> Self {
        Self {
            mass_kg: p.spool_mass_kg,
            viscous_damping_n_s_m: p.viscous_damping_n_s_m,
            control_area_m2: p.control_area_m2,
            constant_area_m2: p.constant_pressure_area_m2,
            spring_stiffness_n_m: p.spring_stiffness_n_m,
            spring_precompression_m: p.spring_precompression_m,
            leakage_m3_s_pa: p.leakage_m3_s_pa,
            return_leakage_m3_s_pa: 0.0,
            control_volume_m3: p.control_volume_m3,
            compressibility_1_pa: 1.0 / oil.bulk_modulus_pa,
            free_air_share: 0.0,
            reference_stroke_m: p.reference_stroke_m,
            stroke_min_m: p.stroke_min_m,
            stroke_max_m: p.stroke_max_m,
            stop_compliance_m_n: p.stop_compliance_m_n,
            weight_n: p.spool_mass_kg * p.gravity_m_s2,
            friction: Friction { coulomb_n: 0.0, static_ratio: 1.0 },
            reading_gain: 1.0,
            reading_bias_pu: 0.0,
        }
    }
}

impl<T: Real> Spool<T> {
    /// What the transducer shows at a position, pu.
    #[inline(always)]
    pub fn reading_pu(&self, position_m: T) -> T {
        self.reading_gain * position_m / self.reference_stroke_m + self.reading_bias_pu
    }

    /// The position at which the transducer shows a reading, m.
    #[inline(always)]
    pub fn position_m(&self, reading_pu: T) -> T {
        (reading_pu - self.reading_bias_pu) / self.reading_gain * self.reference_stroke_m
    }

    /// Volume that one Pa more compresses, m³/Pa.
    ///
    /// Free air follows the isothermal gas law (Merritt 1967, section 2.4).
    #[inline(always)]
    pub fn compliance_m3_pa(&self, position_m: T, pressure_pa: T) -> T {
        let volume_m3 = self.control_volume_m3 + self.control_area_m2 * position_m;
        volume_m3 * compressibility_1_pa(self.compressibility_1_pa, self.free_air_share, pressure_pa)
    }

    /// Force of the centring spring towards closing, N.
    #[inline(always)]
    fn spring_force_n(&self, position_m: T) -> T {
        self.spring_stiffness_n_m * (self.spring_precompression_m + position_m).max(position_m.like(0.0))
    }

    /// Net leakage into the chamber, m³/s.
    #[inline(always)]
    pub(crate) fn leakage_m3_s(&self, pressure_pa: T, supply_pa: T, return_pa: T) -> T {
        self.leakage_m3_s_pa * (supply_pa - pressure_pa) + self.return_leakage_m3_s_pa * (return_pa - pressure_pa)
    }

    /// Force of the chambers, the weight and the spring, N, + opens.
    #[inline(always)]
    pub(crate) fn static_force_n(&self, position_m: T, pressure_pa: T, supply_pa: T) -> T {
        pressure_pa * self.control_area_m2 - supply_pa * self.constant_area_m2 + self.weight_n
            - self.spring_force_n(position_m)
    }

    /// How far a force into the stop that the spool touches bends it, m; the chambers' quasi-steady force counts.
    #[inline(always)]
    pub(crate) fn stop_yield_m(&self, position_m: T, pressure_pa: T, supply_pa: T) -> T {
        let zero = position_m.like(0.0);
        let off = position_m.gt(self.stroke_min_m) & position_m.lt(self.stroke_max_m);
        either!(off | self.stop_compliance_m_n.is(0.0), zero, {
            let force_n = self.static_force_n(position_m, pressure_pa, supply_pa);
            let into = T::select(position_m.le(self.stroke_min_m), force_n.min(zero), force_n.max(zero));
            self.stop_compliance_m_n * into
        })
    }

    /// Control-chamber pressure that balances the forces at rest, Pa.
    pub(crate) fn balance_pressure_pa(&self, position_m: T, supply_pa: T) -> T {
        -self.static_force_n(position_m, position_m.like(0.0), supply_pa) / self.control_area_m2
    }
}

/// Inverse bulk modulus of oil with free air, 1/Pa.
#[inline(always)]
pub(crate) fn compressibility_1_pa<T: Real>(oil_1_pa: T, free_air_share: T, pressure_pa: T) -> T {
    either!(free_air_share.is(0.0), oil_1_pa, {
        let absolute_pa = (pressure_pa + ATMOSPHERE_PA).max(pressure_pa.like(0.1 * ATMOSPHERE_PA));
        oil_1_pa + free_air_share * ATMOSPHERE_PA / (absolute_pa * absolute_pa)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_balance_pressure_balances() {
        let unit = crate::plant::reference();
        for position_m in [-0.015, -0.004, 0.0, 0.012] {
            let pressure_pa = unit.spool.balance_pressure_pa(position_m, 6.3e6);
            assert!(unit.spool.static_force_n(position_m, pressure_pa, 6.3e6).abs() < 1e-8);
        }
    }

    #[test]
    fn the_spring_pushes_one_way_only() {
        let mut spool = crate::plant::reference().spool;
        spool.spring_precompression_m = 0.005;
        assert_eq!(spool.spring_force_n(-0.006), 0.0);
        assert!((spool.spring_force_n(0.001) - 0.006 * spool.spring_stiffness_n_m).abs() < 1e-9);
    }

    #[test]
    fn free_air_softens_low_pressures_most() {
        let at = |pressure_pa: f64| compressibility_1_pa(1e-9, 0.02, pressure_pa);
        assert!(at(0.0) > at(1e6) && at(1e6) > at(6e6) && at(6e6) > 1e-9);
        assert_eq!(compressibility_1_pa(1e-9, 0.0, 0.0), 1e-9);
    }
}
