//! The orifice: flow goes with the root of the pressure drop, and turns laminar at small drops.
//!
//! `root(Δp) = sign(Δp) √|Δp|` for `|Δp| ≥ Δp_0`, and the odd cubic that meets it with equal value and
//! slope below, so that the slope at zero is finite (1.25/√Δp_0). The same regularisation as
//! Modelica.Fluid's `regRoot` in purpose; the cubic needs no root in the laminar core.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | Δp | pressure drop | Pa |
//! | Δp_0 | end of the laminar core, [`LAMINAR_PRESSURE_DROP_PA`] | Pa |

use crate::units::LAMINAR_PRESSURE_DROP_PA;

/// √Δp_0, √Pa.
const CORE_ROOT: f64 = 100.0;

/// A flow and its slope against the pressure that it depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow {
    /// Flow, m³/s.
    pub m3_s: f64,
    /// Slope of the flow against the chamber pressure, m³/(s Pa).
    pub slope_m3_s_pa: f64,
}

/// The regularised root of a pressure drop, √Pa, and its slope, 1/√Pa.
#[inline]
#[must_use]
pub fn root(drop_pa: f64) -> (f64, f64) {
    let size_pa = drop_pa.abs();
    if size_pa >= LAMINAR_PRESSURE_DROP_PA {
        let value = size_pa.sqrt();
        (value.copysign(drop_pa), 0.5 / value)
    } else {
        let s = drop_pa / LAMINAR_PRESSURE_DROP_PA;
        (CORE_ROOT * s * (1.25 - 0.25 * s * s), (1.25 - 0.75 * s * s) / CORE_ROOT)
    }
}

/// Conductance of two orifices in series, of which each alone lets pass `c √Δp`.
///
/// `series` is the inverse conductance of the second, so that 0 means that it is not there.
#[inline]
#[must_use]
pub fn in_series(conductance: f64, series: f64) -> f64 {
    if series == 0.0 {
        return conductance;
    }
    let ratio = conductance * series;
    conductance / (1.0 + ratio * ratio).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_core_meets_the_root_with_equal_value_and_slope() {
        assert!((CORE_ROOT * CORE_ROOT - LAMINAR_PRESSURE_DROP_PA).abs() < 1e-9);
        let inside = root(LAMINAR_PRESSURE_DROP_PA * (1.0 - 1e-9));
        let outside = root(LAMINAR_PRESSURE_DROP_PA);
        assert!((inside.0 - outside.0).abs() < 1e-6);
        assert!((inside.1 - outside.1).abs() < 1e-9);
    }

    #[test]
    fn the_root_is_odd_and_rises() {
        let mut last = f64::NEG_INFINITY;
        for k in -2000..=2000 {
            let drop_pa = f64::from(k) * 37.0;
            let (value, slope) = root(drop_pa);
            assert_eq!(value, -root(-drop_pa).0);
            assert!(value > last && slope > 0.0);
            last = value;
        }
    }

    #[test]
    fn orifices_in_series_share_the_drop() {
        // Equal orifices halve the drop each: the flow falls by √2.
        assert!((in_series(3.0, 1.0 / 3.0) - 3.0 / 2.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(in_series(3.0, 0.0), 3.0);
    }
}
