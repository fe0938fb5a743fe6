//! The continuous state of the servo system: named quantities, and their order in a vector.

use nalgebra::SVector;

use crate::plant::lanes::apart;

/// Number of continuous states.
pub const DIMENSION: usize = 9;

/// The state as a vector, for methods that treat all components alike.
pub type Vector = SVector<f64, DIMENSION>;

apart! {
    /// The continuous state of the servo system; of one unit, or of several in lanes.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct State<T = f64> {
        /// Proportional-valve position `x_p`, pu of full stroke.
        pub pilot_position_pu: T,
        /// Its rate, pu/s.
        pub pilot_rate_pu_s: T,
        /// Control-chamber pressure `P_ctrl`, Pa gauge.
        pub control_pressure_pa: T,
        /// Spool position `x`, m, + opens.
        pub spool_position_m: T,
        /// Spool speed, m/s.
        pub spool_velocity_m_s: T,
        /// Pressure in the servomotor's opening chamber `P_1`, Pa gauge.
        pub opening_pressure_pa: T,
        /// Pressure in the servomotor's closing chamber `P_2`, Pa gauge.
        pub closing_pressure_pa: T,
        /// Servomotor piston position `z`, m, 0 closed.
        pub servomotor_position_m: T,
        /// Servomotor piston speed, m/s.
        pub servomotor_velocity_m_s: T,
    }
}

impl State {
    /// As a vector.
    pub fn to_vector(self) -> Vector {
        Vector::from([
            self.pilot_position_pu,
            self.pilot_rate_pu_s,
            self.control_pressure_pa,
            self.spool_position_m,
            self.spool_velocity_m_s,
            self.opening_pressure_pa,
            self.closing_pressure_pa,
            self.servomotor_position_m,
            self.servomotor_velocity_m_s,
        ])
    }

    /// From a vector.
    pub fn from_vector(vector: &Vector) -> Self {
        let [x_p, v_p, p, x, v, p_1, p_2, z, w] = vector.data.0[0];
        Self {
            pilot_position_pu: x_p,
            pilot_rate_pu_s: v_p,
            control_pressure_pa: p,
            spool_position_m: x,
            spool_velocity_m_s: v,
            opening_pressure_pa: p_1,
            closing_pressure_pa: p_2,
            servomotor_position_m: z,
            servomotor_velocity_m_s: w,
        }
    }
}
