//! Laws that real parts follow and the twin does not: bristles, rounded and eroded edges, mixed orifices, gas that is not isothermal, soft limits.

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
pub(crate) struct Bristles {
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
    pub(crate) fn rate_and_force(&self, velocity_m_s: f64, bend_m: f64) -> (f64, f64) {
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
pub(crate) fn edge(beyond: f64, radius: f64) -> f64 {
    0.5 * (beyond + (beyond * beyond + radius * radius).sqrt())
}

/// What an eroded edge passes at a distance beyond it, m: before it inverse to the distance (Eryilmaz & Wilson 2000), and ever less more than a
/// sharp one beyond it. Value and slope are continuous; at the edge it passes as much as a sharp one at `reach_m`.
#[inline]
pub(crate) fn eroded(beyond_m: f64, reach_m: f64) -> f64 {
    if beyond_m <= 0.0 {
        return reach_m * reach_m / (reach_m - beyond_m).max(f64::MIN_POSITIVE);
    }
    let ratio = 0.5 * beyond_m / reach_m;
    beyond_m + reach_m / (1.0 + ratio * ratio)
}

/// Pressure that a clogged return filter holds back, Pa: part laminar, and less where its bypass begins to open.
#[inline]
pub(crate) fn held_back_pa(quadratic: f64, flow_m3_s: f64) -> f64 {
    let filter_pa = quadratic * (0.85 * flow_m3_s.abs() + 0.15 * 0.02) * flow_m3_s;
    let bypass = filter_pa / 8e6;
    filter_pa / (1.0 + bypass * bypass).sqrt()
}

/// What an analogue link with a wrong span makes of a value, pu: its error grows faster than the value.
#[inline]
pub(crate) fn spanned(value_pu: f64, excess: f64) -> f64 {
    value_pu * (1.0 + excess * (0.92 + 0.15 * value_pu))
}

/// What an amplifier makes of a current that comes near its limit, pu: round corners, unequal sides, and a limit that sinks while it warms.
#[inline]
pub(crate) fn sagging(current_pu: f64, limit_pu: f64, time_s: f64) -> f64 {
    let side = if current_pu >= 0.0 { 1.03 } else { 0.97 };
    let warming = 1.0 + 0.05 * (-time_s.max(0.0) / 15.0).exp();
    let ratio = current_pu / (side * warming * limit_pu.max(1e-3));
    current_pu / (1.0 + ratio.powi(12)).powf(1.0 / 12.0)
}

/// Root of a pressure drop through a rounded orifice, √Pa: laminar below `TRANSITION_PA`, turbulent above, smooth between.
#[inline]
pub(crate) fn jet(drop_pa: f64) -> f64 {
    drop_pa / (drop_pa * drop_pa + TRANSITION_PA * TRANSITION_PA).sqrt().sqrt()
}

/// Flow through an orifice of conductance c, m³/(s √Pa), behind a filter that loses `quadratic Q² + linear Q`.
#[inline]
pub(crate) fn filtered(conductance: f64, drop_pa: f64, quadratic: f64, linear: f64) -> f64 {
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
pub(crate) fn gap(drop_pa: f64, match_pa: f64) -> f64 {
    0.5 * drop_pa + 0.5 * match_pa.sqrt() * jet(drop_pa)
}

/// What free air adds to the compressibility of oil, 1/Pa: `α P_0^(1/n)/(n P^(1 + 1/n))`, polytropic.
#[inline]
pub(crate) fn gas_compressibility_1_pa(share: f64, pressure_pa: f64) -> f64 {
    if share == 0.0 {
        return 0.0;
    }
    let ratio = ((pressure_pa + ATMOSPHERE_PA) / ATMOSPHERE_PA).max(0.1);
    share / (POLYTROPIC_EXPONENT * ATMOSPHERE_PA) * ratio.powf(-1.0 - 1.0 / POLYTROPIC_EXPONENT)
}

/// Force of an elastic, damped stop, N; it pushes and never pulls.
#[inline]
pub(crate) fn stop(at_m: f64, speed_m_s: f64, low_m: f64, high_m: f64, stiffness_n_m: f64, mass_kg: f64) -> f64 {
    let into_m = at_m - at_m.clamp(low_m, high_m);
    if into_m == 0.0 {
        return 0.0;
    }
    let force_n = -stiffness_n_m * into_m - 0.8 * (stiffness_n_m * mass_kg).sqrt() * speed_m_s;
    if force_n * into_m < 0.0 { force_n } else { 0.0 }
}

/// Widths of the plays of a rounded loop, over the loop's.
const PLAY_SHARES: [f64; 4] = [0.4, 0.8, 1.2, 1.6];

/// A rounded hysteresis loop: Prandtl and Ishlinskii's sum of plays (Visintin 1994, *Differential Models of Hysteresis*, chapter III).
///
/// Unlike Bouc and Wen's it does not creep under dither. `plays` is its memory; all in the unit of the input.
pub(crate) fn rounded_loop(input: f64, plays: &mut [f64; PLAY_SHARES.len()], width: f64) -> f64 {
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
    fn eroded_edges_are_smooth_and_meet_the_sharp_ones_far_out() {
        let reach_m = 1e-4;
        let (mut last_m, mut last_slope) = (eroded(-1e-3, reach_m), f64::NAN);
        for k in -999..=2000 {
            let next_m = eroded(f64::from(k) * 1e-6, reach_m);
            let slope = (next_m - last_m) / 1e-6;
            assert!(
                slope > 0.0 && (last_slope.is_nan() || (slope - last_slope).abs() < 0.03),
                "{k}: {slope} after {last_slope}"
            );
            (last_m, last_slope) = (next_m, slope);
        }
        assert!((eroded(0.0, reach_m) - reach_m).abs() < 1e-18);
        assert!((eroded(5e-3, reach_m) - 5e-3).abs() < 1e-6 && eroded(-5e-3, reach_m) < 3e-6);
        assert_eq!(eroded(-1e-3, 0.0), 0.0);
    }

    #[test]
    fn limits_are_soft_and_unequal_and_small_signals_pass() {
        assert!((sagging(0.2, 0.5, 100.0) - 0.2).abs() < 1e-5);
        assert!((sagging(1.0, 0.5, 1e3) - 0.515).abs() < 1e-4 && (sagging(-1.0, 0.5, 1e3) + 0.485).abs() < 1e-4);
        assert!(sagging(1.0, 0.5, 0.0) > sagging(1.0, 0.5, 30.0));
        assert!(sagging(0.5, 0.5, 1e3) < 0.5);
    }

    #[test]
    fn a_clogged_filter_holds_back_both_ways_and_its_bypass_eases_it() {
        assert_eq!(held_back_pa(0.0, 0.03), 0.0);
        assert_eq!(held_back_pa(2e9, -0.02), -held_back_pa(2e9, 0.02));
        assert!((held_back_pa(2e9, 0.02) / (2e9 * 0.02 * 0.02) - 1.0).abs() < 0.01);
        assert!(held_back_pa(2e10, 0.04) < 0.8 * 2e10 * 0.04 * 0.04);
        assert_eq!(spanned(0.7, 0.0), 0.7);
        assert!((spanned(0.5, 0.02) / 0.5 - 1.0 - 0.02).abs() < 2e-4);
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
