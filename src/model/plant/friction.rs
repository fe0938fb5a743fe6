//! Friction: Coulomb's, with a viscous core at rest and Stribeck's fall from a higher value.
//!
//! `F = F_c (1 + (r − 1) e^(−|v|/v_s)) sat(v/v_0)`: below v_0 the friction is linear in the speed, so that
//! every method has a finite derivative, and a body at rest creeps at less than v_0. Stribeck's term is 0 on the sheet (r = 1).
//! Source: Armstrong-Hélouvry, Dupont & Canudas de Wit 1994, Automatica 30(7), section 2.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | F_c | Coulomb friction | N |
//! | r | friction at rest over Coulomb friction | 1 |
//! | v_0 | end of the viscous core, `FRICTION_CORE_M_S` | m/s |
//! | v_s | Stribeck speed, `STRIBECK_SPEED_M_S` | m/s |

use crate::plant::lanes::abreast;
use crate::plant::real::{Real, either};
use crate::units::{FRICTION_CORE_M_S, STRIBECK_SPEED_M_S};

abreast! {
    /// A friction law.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Friction<T = f64> {
        /// Coulomb friction `F_c`, N.
        pub coulomb_n: T,
        /// Friction at rest over Coulomb friction `r`, at least 1.
        pub static_ratio: T,
    }
}

impl<T: Real> Friction<T> {
    /// Friction's size beyond the core at a speed, N.
    #[inline(always)]
    pub fn size_n(&self, velocity_m_s: T) -> T {
        let plain = self.static_ratio.is(1.0);
        either!(plain, self.coulomb_n, {
            let rest = (-velocity_m_s.abs() / STRIBECK_SPEED_M_S).exp_unless(plain);
            self.coulomb_n * ((self.static_ratio - 1.0) * rest + 1.0)
        })
    }

    /// Force against a motion, N, with the sign of the speed.
    #[inline(always)]
    pub fn force_n(&self, velocity_m_s: T) -> T {
        let one = velocity_m_s.like(1.0);
        self.size_n(velocity_m_s) * (velocity_m_s / FRICTION_CORE_M_S).clamp(-one, one)
    }

    /// The speed that solves `resistance · v + friction(v) = push`, m/s, Stribeck's term taken at `before_m_s`.
    #[inline(always)]
    pub fn speed_m_s(&self, push_n: T, resistance_n_s_m: T, before_m_s: T) -> T {
        either!(self.coulomb_n.is(0.0), push_n / resistance_n_s_m, {
            let size_n = self.size_n(before_m_s);
            let sliding = (push_n - size_n.copysign(push_n)) / resistance_n_s_m;
            let slides = (sliding * push_n).gt(push_n.like(0.0)) & sliding.abs().ge(push_n.like(FRICTION_CORE_M_S));
            either!(slides, sliding, push_n / (resistance_n_s_m + size_n / FRICTION_CORE_M_S))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_implicit_speed_solves_the_force_balance() {
        let friction = Friction { coulomb_n: 4e4, static_ratio: 1.0 };
        for push_n in [-3e5, -4.2e4, -1e4, 0.0, 3e3, 4.0e4, 4.1e4, 5e5] {
            let v = friction.speed_m_s(push_n, 6e6, 0.0);
            assert!((6e6 * v + friction.force_n(v) - push_n).abs() < 1e-6 * (1.0 + push_n.abs()), "{push_n}: {v}");
        }
    }

    #[test]
    fn rest_holds_more_than_motion() {
        let friction = Friction { coulomb_n: 100.0, static_ratio: 1.5 };
        assert!(friction.size_n(0.0) == 150.0 && friction.size_n(1.0) < 100.1);
    }
}
