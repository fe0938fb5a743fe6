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

use crate::plant::real::{Lanewise, Real, either};
use crate::units::LAMINAR_PRESSURE_DROP_PA;

/// √Δp_0, √Pa.
const CORE_ROOT: f64 = 100.0;

/// A flow and its slope against the pressure that it depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow<T = f64> {
    /// Flow, m³/s.
    pub m3_s: T,
    /// Slope of the flow against the chamber pressure, m³/(s Pa).
    pub slope_m3_s_pa: T,
}

impl<T: Real> Lanewise<T> for Flow<T> {
    #[inline(always)]
    fn choose(mask: T::Mask, yes: Self, no: Self) -> Self {
        Self {
            m3_s: T::select(mask, yes.m3_s, no.m3_s),
            slope_m3_s_pa: T::select(mask, yes.slope_m3_s_pa, no.slope_m3_s_pa),
        }
    }
}

/// The regularised root of a pressure drop, √Pa, and its slope, 1/√Pa.
#[inline(always)]
pub(crate) fn root<T: Real>(drop_pa: T) -> (T, T) {
    let size_pa = drop_pa.abs();
    either!(
        size_pa.ge(size_pa.like(LAMINAR_PRESSURE_DROP_PA)),
        {
            let value = size_pa.sqrt();
            (value.copysign(drop_pa), value.like(0.5) / value)
        },
        {
            let s = drop_pa / LAMINAR_PRESSURE_DROP_PA;
            let steep = s.like(1.25);
            (s * CORE_ROOT * (steep - s * 0.25 * s), (steep - s * 0.75 * s) / CORE_ROOT)
        },
    )
}

/// Conductance of two orifices in series, of which each alone lets pass `c √Δp`.
///
/// `series` is the inverse conductance of the second, so that 0 means that it is not there.
#[inline(always)]
pub(crate) fn in_series<T: Real>(conductance: T, series: T) -> T {
    either!(series.is(0.0), conductance, {
        let ratio = conductance * series;
        conductance / (ratio * ratio + 1.0).sqrt()
    })
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
