//! Kicks of a spool in slow recordings: rare, short, and far larger than the noise about them.

/// Least share of a regulator's decisions that leave its dead band: where in the dead band the servomotor really stands is known no better.
const LEAST_SHARE: f64 = 0.01;

/// Decisions of a regulator whose kick a sample still shows.
const DECISIONS_SHOWN: f64 = 2.2;

/// Places that split the positive half of a normal density into equal parts, each at a part's root mean square.
const QUANTILES: [f64; 12] =
    [0.0604, 0.1603, 0.2661, 0.3757, 0.4902, 0.6118, 0.7432, 0.8892, 1.0573, 1.2628, 1.5449, 2.1684];

/// What kicks may add to a sample, where samples are so far apart that each kick is over before the next one.
///
/// On its dead band a regulator mostly demands nothing, and now and then a step for one decision. The twin's mean over the noise knows the
/// variance of that demand, not that it comes in few large pieces. A sample is therefore one of two kinds (contaminated normal; Tukey 1960,
/// *A survey of sampling from contaminated distributions*): with noise alone, or with a kick as well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kick {
    /// Probability that a sample shows one.
    probability: f64,
    /// Variance that one adds, in the signal's unit squared.
    square: f64,
}

impl Kick {
    /// Of a demand's standard deviation, pu, and of the step at the edge of the dead band, pu; `gain` is what of a demand's deviation shows in
    /// the signal, its unit per pu.
    ///
    /// All kicks together have the variance of the demand. Where decisions leave the dead band often, every sample shows some.
    pub fn new(demand_sd_pu: f64, step_pu: f64, gain: f64) -> Self {
        let (demand_square, probability) = demand(demand_sd_pu, step_pu);
        Self { probability, square: gain * gain * demand_square / probability }
    }

    /// Mean variance that kicks add, in the signal's unit squared.
    pub fn mean_square(&self) -> f64 {
        self.probability * self.square
    }

    /// How innovations count whose variance without a kick is this.
    pub fn over(&self, plain_square: f64) -> Contaminated {
        let wider = 1.0 + self.square / plain_square;
        let (plain, kicked) = (1.0 - self.probability, self.probability / wider.sqrt());
        Contaminated {
            scale: 1.0 / plain_square.sqrt(),
            wider,
            share: kicked / (plain + kicked),
            density: plain + kicked,
        }
    }
}

/// Probability that a sample shows a kick, of a demand's standard deviation, pu, and of the step at the edge of the dead band, pu.
pub fn probability(demand_sd_pu: f64, step_pu: f64) -> f64 {
    demand(demand_sd_pu, step_pu).1
}

/// Variance of a demand, pu squared, and the probability that a sample shows a kick of it.
fn demand(sd_pu: f64, step_pu: f64) -> (f64, f64) {
    let step_square = step_pu * step_pu;
    let demand_square = (sd_pu * sd_pu).max(LEAST_SHARE * step_square);
    // Without a step, the demand is as noisy as it is, and that always.
    (demand_square, (DECISIONS_SHOWN * demand_square / step_square).min(1.0))
}

/// The density of an innovation that may hold a kick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contaminated {
    /// One over the standard deviation without a kick.
    scale: f64,
    /// Variance with a kick over that without.
    wider: f64,
    /// Share that kicks have of the density at nothing.
    share: f64,
    /// Density at nothing over that without a kick.
    density: f64,
}

impl Contaminated {
    /// One over the standard deviation of the normal density that is as high.
    pub fn height(&self) -> f64 {
        self.scale * self.density
    }

    /// The number whose square is twice the fall of the log density from its height, and the probability that there was no kick.
    pub fn judge(&self, innovation: f64) -> (f64, f64) {
        let narrow = (innovation * self.scale).powi(2);
        let wide = narrow / self.wider;
        let plain = (1.0 - self.share) * (-0.5 * (narrow - wide)).exp();
        let density = plain + self.share;
        ((wide - 2.0 * density.ln()).max(0.0).sqrt().copysign(innovation), plain / density)
    }

    /// Mean square of that number where the model is right: 1 where no sample shows a kick, or every one.
    pub fn mean_square(&self) -> f64 {
        let mean = |deviation: f64| {
            let squares = QUANTILES.map(|quantile| self.judge(quantile * deviation).0.powi(2));
            squares.iter().sum::<f64>() / squares.len() as f64
        };
        let kicked = self.share * self.wider.sqrt() * self.density;
        (1.0 - kicked) * mean(1.0 / self.scale) + kicked * mean(self.wider.sqrt() / self.scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_kicks_together_have_the_variance_of_the_demand() {
        for sd_pu in [0.004, 0.01, 0.02, 0.05] {
            let kick = Kick::new(sd_pu, 0.03, 0.4);
            assert!((kick.mean_square() / (0.4 * sd_pu).powi(2) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_sample_costs_what_its_density_says() {
        let (kick, plain) = (Kick::new(0.006, 0.03, 0.4), 1e-6_f64);
        let of = kick.over(plain);
        let density = |x: f64| {
            let normal = |square: f64| (-0.5 * x * x / square).exp() / square.sqrt();
            (1.0 - kick.probability) * normal(plain) + kick.probability * normal(plain + kick.square)
        };
        assert!((of.height() / density(0.0) - 1.0).abs() < 1e-12);
        for x in [-0.02, -0.003, 0.001, 0.008] {
            let (root, clean) = of.judge(x);
            assert!((root * root + 2.0 * (density(x) / density(0.0)).ln()).abs() < 1e-9, "{x}");
            assert!(root * x > 0.0 && (0.0..=1.0).contains(&clean));
        }
        assert!(of.judge(0.001).1 > 0.9 && of.judge(0.008).1 < 0.01);
    }

    #[test]
    fn the_mean_square_is_that_of_the_density() {
        let plain = 1e-6_f64;
        for sd_pu in [0.001, 0.006, 0.015] {
            let kick = Kick::new(sd_pu, 0.03, 0.4);
            let of = kick.over(plain);
            let density = |x: f64| {
                let normal = |square: f64| (-0.5 * x * x / square).exp() / (square * std::f64::consts::TAU).sqrt();
                (1.0 - kick.probability) * normal(plain) + kick.probability * normal(plain + kick.square)
            };
            let integral: f64 =
                (-60_000..60_000).map(|k| f64::from(k) * 2e-6).map(|x| of.judge(x).0.powi(2) * density(x) * 2e-6).sum();
            assert!((of.mean_square() / integral - 1.0).abs() < 0.02, "{} {integral}", of.mean_square());
        }
    }

    #[test]
    fn where_every_sample_shows_kicks_all_is_normal() {
        let of = Kick::new(0.05, 0.03, 0.4).over(1e-6);
        let square = 1e-6 + 0.02_f64 * 0.02;
        assert!((of.judge(0.03).0 - 0.03 / square.sqrt()).abs() < 1e-12);
        assert!((of.mean_square() - 1.0).abs() < 1e-3);
    }
}
