//! Structural mismatch of every plant of the battery, with or without faults: small, in properties that no sheet states.

use crate::battery::draws::Draw;
use crate::battery::laws::{Bristles, held_back_pa};
use govtwin_model::effects::scaling::{Scaling, UnitSize};
use govtwin_model::parameters::Parameters;

/// Small deviations from the nominal model's structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mismatch {
    /// Overlap of each of the four edges over the sheet's.
    pub(super) overlap_shares: [f64; 4],
    pub(super) edge_radius_m: f64,
    /// Inertance of the oil in the line, Pa s²/m³.
    pub(super) line_inertance: f64,
    pub(super) node_volume_m3: f64,
    /// Damping of the node, Pa s/m³.
    pub(super) node_resistance_pa_s_m3: f64,
    pub(super) pilot_curvature_ratio: f64,
    pub(super) filling_gain: f64,
    pub(super) draining_gain: f64,
    pub(super) esv_travel_s: f64,
    pub(super) spool_friction_n: f64,
    pub(super) piston_bend_m: f64,
    pub(super) flow_force_ratio: f64,
    pub(super) load_ripple_ratio: f64,
    pub(super) spool_stop_n_m: f64,
    pub(super) piston_stop_n_m: f64,
    pub(super) lvdt_lag_s: f64,
    pub(super) feedback_lag_s: f64,
    /// How large the unit is.
    pub(super) size: UnitSize,
}

impl Mismatch {
    /// Draws them for a unit of this size, `level` times as far from the nominal structure as usual; the stops yield by the unit's parameters.
    ///
    /// One seed draws the same deviations at every level. The travel of the ESV stays as usual: a longer one is `esv_slow`.
    #[must_use]
    pub(crate) fn draw(p: &Parameters, size: &UnitSize, level: f64, draw: &mut Draw) -> Self {
        // Lines of the same length in time: what they hold back goes with pressure over flow, what they hold with the inverse.
        let line_inertance = level * draw.between(5e4, 1.2e5) / Scaling::MainLeak.factor(size);
        let node_volume_m3 = draw.between(0.04, 0.08) * Scaling::MainLeak.factor(size);
        let spool_stop_m_n = 1e-9 * size.spool_stroke_ratio / size.spool_force_ratio;
        let piston_stop_m_n = 3e-11 / size.servomotor_force_ratio;
        let wave = (line_inertance * p.oil.bulk_modulus_pa / node_volume_m3).sqrt();
        Self {
            overlap_shares: std::array::from_fn(|_| 1.0 + 0.02 * level * draw.normal()),
            edge_radius_m: level * draw.between(4e-6, 1e-5) * size.spool_stroke_ratio,
            line_inertance,
            node_volume_m3,
            node_resistance_pa_s_m3: draw.between(0.6, 1.0) * wave,
            pilot_curvature_ratio: 0.01 * level * draw.normal(),
            filling_gain: 1.0 + 0.005 * level * draw.normal(),
            draining_gain: 1.0 + 0.005 * level * draw.normal(),
            esv_travel_s: draw.between(1.5e-3, 3e-3),
            spool_friction_n: level * draw.between(3.0, 15.0) * size.spool_force_ratio,
            piston_bend_m: level * draw.between(3e-5, 8e-5),
            flow_force_ratio: level * draw.between(0.0, 0.05),
            load_ripple_ratio: 0.01 * level * draw.normal(),
            spool_stop_n_m: 1.0 / p.distributing_valve.stop_compliance_m_n.max(spool_stop_m_n),
            piston_stop_n_m: 1.0 / p.servomotor.stop_compliance_m_n.max(piston_stop_m_n),
            lvdt_lag_s: level * draw.between(1e-4, 3e-4),
            feedback_lag_s: level * draw.between(1e-4, 3e-4),
            size: *size,
        }
    }

    /// Friction of the spool with so much of a fault.
    pub(crate) fn spool_friction(&self, fault_n: f64) -> Bristles {
        Bristles {
            coulomb_n: self.spool_friction_n + fault_n,
            static_ratio: 1.3,
            stribeck_m_s: 3e-3,
            bend_m: 2e-5 * self.size.spool_speed_ratio,
            damping_n_s_m: 300.0 * self.size.spool_force_ratio / self.size.spool_speed_ratio,
        }
    }

    /// Friction of the servomotor with so much of a fault.
    pub(crate) fn piston_friction(&self, coulomb_n: f64, fault_n: f64) -> Bristles {
        Bristles {
            coulomb_n: coulomb_n + fault_n,
            static_ratio: if fault_n > 0.0 { 1.4 } else { 1.05 },
            stribeck_m_s: 3e-3,
            bend_m: self.piston_bend_m,
            damping_n_s_m: 1e6 * self.size.servomotor_force_ratio / self.size.servomotor_speed_ratio,
        }
    }

    /// Pressure that a return line of this loss holds back at a flow.
    pub(crate) fn held_back_pa(&self, loss_pa_s2_m6: f64, flow_m3_s: f64) -> f64 {
        let UnitSize { flow_ratio, pressure_ratio, .. } = self.size;
        held_back_pa(loss_pa_s2_m6 * flow_ratio * flow_ratio / pressure_ratio, flow_m3_s / flow_ratio) * pressure_ratio
    }
}
