//! The demand of a slowed large loop whose instants are unknown: a mean over all values that it may still hold.

/// Time constant of the spool towards its demand, s: it follows 0.4 of a demand held for 10 ms, as measured on simulated units.
const SETTLING_S: f64 = 0.031;

/// The last demands that a loop with the sheet's period would have made.
///
/// A slow loop whose period jitters may be anywhere in its hold: the age of what it holds is uniform up to its period. Of a
/// loop that runs `n` times while the slow one runs once, that is the mean of the last `n` demands, `n` any number from 1 on.
#[derive(Clone, Debug)]
pub(super) struct Hold {
    runs_count: f64,
    /// How much farther the spool follows a demand held so long.
    followed_ratio: f64,
    /// Newest first.
    demands_pu: Vec<f64>,
}

impl Default for Hold {
    /// A loop that runs as on the sheet holds what it demanded last.
    fn default() -> Self {
        Self { runs_count: 1.0, followed_ratio: 1.0, demands_pu: vec![0.0] }
    }
}

impl Hold {
    /// A hold of so many runs, which would have this period, at rest.
    ///
    /// Of values that are held for `T` each, independent of one another, a lag `τ` passes the root of `tanh(T/2τ)`.
    pub(super) fn new(runs_count: f64, period_s: f64) -> Self {
        let runs_count = runs_count.clamp(1.0, 1e4);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped above")]
        let whole = runs_count.ceil() as usize;
        let passed = |held_s: f64| (0.5 * held_s / SETTLING_S).tanh();
        let followed_ratio = (passed(runs_count * period_s) / passed(period_s)).sqrt();
        Self { runs_count, followed_ratio, demands_pu: vec![0.0; whole] }
    }

    /// Back to rest.
    pub(super) fn reset(&mut self) {
        self.demands_pu.fill(0.0);
    }

    /// Takes the next demand and how far it may be off; mean and standard deviation of what is held from then on, pu, the latter as that of a
    /// demand with the sheet's period would be to move the spool as much.
    pub(super) fn next(&mut self, (demand_pu, sd_pu): (f64, f64)) -> (f64, f64) {
        if self.runs_count == 1.0 {
            // The mean of one, to the last bit what follows gives.
            return (demand_pu, sd_pu);
        }
        self.demands_pu.rotate_right(1);
        self.demands_pu[0] = demand_pu;
        let (mut sum, mut squares) = (0.0, 0.0);
        for (k, demand_pu) in self.demands_pu.iter().enumerate() {
            let weight = (self.runs_count - k as f64).min(1.0);
            sum += weight * demand_pu;
            squares += weight * demand_pu * demand_pu;
        }
        let mean = sum / self.runs_count;
        let held_sd_pu = (squares / self.runs_count - mean * mean).max(0.0).sqrt();
        (mean, self.followed_ratio * held_sd_pu.hypot(sd_pu))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(runs: f64) -> (f64, f64) {
        let mut hold = Hold::new(runs, 0.01);
        (0..60).map(|k| hold.next((f64::from(k), 0.0))).last().unwrap_or_default()
    }

    /// Of a ramp the mean is older by half of what the period is longer, and spreads as ages do that are all as likely.
    #[test]
    fn a_ramp_is_held_for_half_of_the_longer_period() {
        assert_eq!(ramp(1.0), (59.0, 0.0));
        for runs in [2.0, 3.0, 17.0] {
            let (mean, sd) = ramp(runs);
            assert!((59.0 - mean - 0.5 * (runs - 1.0)).abs() < 1e-9, "{runs}: {mean}");
            let held_sd = sd / Hold::new(runs, 0.01).followed_ratio;
            assert!((held_sd * held_sd - (runs * runs - 1.0) / 12.0).abs() < 1e-9, "{runs}: {sd}");
        }
        // Between whole numbers it follows closely, and without a step.
        let means: Vec<f64> = (10..=40).map(|tenths| ramp(f64::from(tenths) / 10.0).0).collect();
        assert!(means.windows(2).all(|two| (0.02..0.1).contains(&(two[0] - two[1]))), "{means:?}");
    }

    /// A lag that a held noise goes through, against the closed form.
    #[test]
    fn what_is_held_longer_is_followed_farther() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut sd = |held_s: f64| {
            let (mut state, mut squares) = (0.0_f64, 0.0);
            let keeps = (-held_s / SETTLING_S).exp();
            for _ in 0..200_000 {
                state = keeps * state + (1.0 - keeps) * random.random_range(-1.0..1.0_f64);
                squares += state * state;
            }
            (squares / 200_000.0 * 3.0).sqrt()
        };
        let short = sd(0.01);
        assert!((short - 0.4).abs() < 0.01, "{short}");
        for runs in [2.0, 5.0] {
            let (followed, measured) = (Hold::new(runs, 0.01).followed_ratio, sd(0.01 * runs) / short);
            assert!((followed - measured).abs() < 0.02, "{runs}: {followed}, {measured}");
        }
        assert_eq!(Hold::new(1.0, 0.01).next((0.3, 0.1)), (0.3, 0.1));
    }

    #[test]
    fn at_rest_it_holds_nothing() {
        let mut hold = Hold::new(3.3, 0.01);
        hold.next((0.5, 0.1));
        hold.reset();
        assert_eq!(hold.next((0.0, 0.0)), (0.0, 0.0));
    }
}
