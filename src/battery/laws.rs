//! Laws that real parts follow and the twin does not: bristles, rounded edges, mixed orifices, gas that is not isothermal.

/// Absolute pressure of the atmosphere, Pa.
const ATMOSPHERE_PA: f64 = 101_325.0;
/// Polytropic exponent of bubbles that are neither isothermal nor adiabatic.
const POLYTROPIC_EXPONENT: f64 = 1.3;
/// Drop at which a rounded orifice is half laminar, Pa.
const TRANSITION_PA: f64 = 1.0e4;

/// LuGre friction (Canudas de Wit, Olsson, Åström & Lischinsky 1995, IEEE Transactions on Automatic Control 40(3)).
///
/// `d' = v − |v| d σ/g(v)`, `F = σ d + c d'`, `g = F_c (1 + (r − 1) e^(−(v/v_s)²))`, `σ = F_c/d_0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bristles {
    /// Coulomb friction `F_c`, N.
    pub coulomb_n: f64,
    /// Friction at rest over Coulomb friction `r`.
    pub static_ratio: f64,
    /// Stribeck speed `v_s`, m/s.
    pub stribeck_m_s: f64,
    /// Bend of the bristles at Coulomb friction `d_0`, m.
    pub bend_m: f64,
    /// Damping of the bristles `c`, N s/m.
    pub damping_n_s_m: f64,
}

impl Bristles {
    /// Rate of the bristles' bend at a speed, m/s, and the friction against it, N.
    #[inline]
    #[must_use]
    pub fn rate_and_force(&self, velocity_m_s: f64, bend_m: f64) -> (f64, f64) {
        if self.coulomb_n == 0.0 {
            return (0.0, 0.0);
        }
        let ratio = velocity_m_s / self.stribeck_m_s;
        let level = 1.0 + (self.static_ratio - 1.0) * (-ratio * ratio).exp();
        let rate = velocity_m_s - velocity_m_s.abs() * bend_m / (self.bend_m * level);
        // The bristles' damping fades with speed, or it would count as viscous friction (Olsson 1996, section 3.4).
        let damping = self.damping_n_s_m * (-ratio * ratio).exp();
        (rate, self.coulomb_n / self.bend_m * bend_m + damping * rate)
    }
}

/// What a rounded edge passes at a distance beyond it: a hyperbola of the given radius, in the unit of the arguments.
#[inline]
#[must_use]
pub fn edge(beyond: f64, radius: f64) -> f64 {
    0.5 * (beyond + (beyond * beyond + radius * radius).sqrt())
}

/// Root of a pressure drop through a rounded orifice, √Pa: laminar below `TRANSITION_PA`, turbulent above, smooth between.
#[inline]
#[must_use]
pub fn jet(drop_pa: f64) -> f64 {
    drop_pa / (drop_pa * drop_pa + TRANSITION_PA * TRANSITION_PA).sqrt().sqrt()
}

/// Flow through an orifice of conductance c, m³/(s √Pa), behind a filter that loses `quadratic Q² + linear Q`.
#[inline]
#[must_use]
pub fn filtered(conductance: f64, drop_pa: f64, quadratic: f64, linear: f64) -> f64 {
    if conductance <= 1e-15 {
        return 0.0;
    }
    if quadratic == 0.0 {
        return conductance * jet(drop_pa);
    }
    let a = 1.0 / (conductance * conductance) + quadratic;
    let q = ((linear * linear + 4.0 * a * drop_pa.abs()).sqrt() - linear) / (2.0 * a);
    q.copysign(drop_pa)
}

/// Leakage through a gap that is half laminar, half an orifice, over its laminar coefficient, Pa; both agree at `match_pa`.
#[inline]
#[must_use]
pub fn gap(drop_pa: f64, match_pa: f64) -> f64 {
    0.5 * drop_pa + 0.5 * match_pa.sqrt() * jet(drop_pa)
}

/// What free air adds to the compressibility of oil, 1/Pa: `α P_0^(1/n)/(n P^(1 + 1/n))`, polytropic.
#[inline]
#[must_use]
pub fn gas_compressibility_1_pa(share: f64, pressure_pa: f64) -> f64 {
    if share == 0.0 {
        return 0.0;
    }
    let ratio = ((pressure_pa + ATMOSPHERE_PA) / ATMOSPHERE_PA).max(0.1);
    share / (POLYTROPIC_EXPONENT * ATMOSPHERE_PA) * ratio.powf(-1.0 - 1.0 / POLYTROPIC_EXPONENT)
}

/// Widths of the plays of a rounded loop, over the loop's.
const PLAY_SHARES: [f64; 4] = [0.4, 0.8, 1.2, 1.6];

/// A rounded hysteresis loop: Prandtl and Ishlinskii's sum of plays (Visintin 1994, *Differential Models of Hysteresis*, chapter III).
///
/// Unlike Bouc and Wen's it does not creep under dither. `plays` is its memory; all in the unit of the input.
pub fn rounded_loop(input: f64, plays: &mut [f64; PLAY_SHARES.len()], width: f64) -> f64 {
    for (play, share) in plays.iter_mut().zip(PLAY_SHARES) {
        let half = 0.5 * share * width;
        *play = play.clamp(input - half, input + half);
    }
    plays.iter().sum::<f64>() / PLAY_SHARES.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bristles_give_way_to_the_level_of_their_speed() {
        let law =
            Bristles { coulomb_n: 100.0, static_ratio: 1.5, stribeck_m_s: 2e-3, bend_m: 2e-5, damping_n_s_m: 50.0 };
        for (speed_m_s, expected_n) in [(0.05, 100.0), (-0.05, -100.0), (1e-4, 149.9)] {
            let mut bend_m = 0.0;
            for _ in 0..2_000_000 {
                bend_m += 2e-6 * law.rate_and_force(speed_m_s, bend_m).0;
            }
            let force_n = law.rate_and_force(speed_m_s, bend_m).1;
            assert!((force_n - expected_n).abs() < 0.5, "{speed_m_s}: {force_n}");
        }
    }

    #[test]
    fn rounded_edges_meet_the_sharp_ones_far_out() {
        assert!((edge(1e-3, 1e-5) - 1e-3).abs() < 1e-7 && edge(-1e-3, 1e-5) < 1e-7);
        assert!((jet(4e6) - 2000.0).abs() < 1e-2 && (jet(-4e6) + 2000.0).abs() < 1e-2);
    }

    #[test]
    fn the_filter_and_the_orifice_share_the_drop() {
        let (c, quadratic, linear) = (3e-7, 5e13, 2e9);
        let q = filtered(c, 3e6, quadratic, linear);
        let sum_pa = q * q / (c * c) + quadratic * q * q + linear * q;
        assert!((sum_pa - 3e6).abs() < 1.0);
        assert_eq!(filtered(c, -3e6, quadratic, linear), -q);
    }

    #[test]
    fn the_loop_is_as_wide_as_it_says() {
        let mut plays = [0.0; 4];
        let mut sweep = |from: i32, to: i32| {
            let mut out = 0.0;
            for k in 0..=1000 {
                let input = f64::from(from) + f64::from(to - from) * f64::from(k) / 1000.0;
                out = input - rounded_loop(input, &mut plays, 0.1);
            }
            out
        };
        assert!((sweep(0, 1) - 0.05).abs() < 1e-3);
        assert!((sweep(1, -1) + 0.05).abs() < 1e-3);
    }
}
