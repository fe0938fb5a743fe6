//! Adaptation to a unit that ages: a drift detector on the innovation, and a bounded on-line correction by a bias and a gain or by retrained leaves.
//!
//! The innovation is `e = measured − corrected`, at most one each training period. A two-sided CUSUM (Page 1954, "Continuous
//! inspection schemes", *Biometrika* 41; the test of Page and Hinkley with a known mean) watches `z = e/σ`, σ from the model's band:
//! `S± = max(0, S± ± z − k)`, an alarm where one passes `h`. Beside it recursive least squares with exponential forgetting (Ljung 1999,
//! *System Identification*, section 11.2), each innovation cut to σ since residuals have heavy tails, learns `e ≈ b + g·y`, y the twin's own value;
//! and the leaves of the model's trees learn e where the row falls into them (`src/residual/leaves.rs`). Before the first alarm nothing is added, to the bit.
//! After it `b + g·y`, or the output of the leaves, is added, clamped to stated bounds, as long as it reduces the error: its forgetting mean of |e| lies
//! below that without it by a margin, and below that of the other. What is added at a sample was learned before that sample.

use serde::Serialize;

use super::forest::Forest;
use super::leaves::Leaves;
use super::model::Model;
use govtwin_model::units::seconds_from_nanos;

/// Drift that the detector lets pass, in σ.
const ALLOWANCE: f64 = 1.25;

/// Sum of standardised innovations beyond the allowance that is an alarm.
const ALARM_SUM: f64 = 40.0;

/// A single innovation counts as no more than so many σ for the detector; for what is learned it is one σ, after Huber.
const FARTHEST: f64 = 4.0;

/// Time after which an innovation counts 1/e in what is learned, s.
const MEMORY_S: f64 = 60.0;

/// The same for the comparison of with and without, s.
const TRIAL_S: f64 = 60.0;

/// What is learned must lessen the mean |e| to this share before it is added, and is added until it no longer lessens it.
const CONVINCING_SHARE: f64 = 0.8;

/// Of the band's half width in motion: residuals below this share are no drift worth following, however quiet the unit is at rest.
const LEAST_SHARE: f64 = 0.0625;

/// Half widths of the band in motion, the most that is added.
const MOST_WIDTHS: f64 = 5.0;

/// Largest gain, pu of correction per pu of the twin's value.
const GAIN_LIMIT: f64 = 0.1;

/// Bias and gain, and the leaves, among the two that may be added.
const BY_GAIN: usize = 0;
const BY_LEAVES: usize = 1;

/// The share of a normal's rows that a band of 90 % lets outside lies beyond so many σ.
const BAND_IN_SIGMA: f64 = 1.645;

/// What the adaptation saw and did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Adaptation {
    /// Measured samples that were evaluated.
    pub samples: u64,
    /// Alarms of the detector.
    pub alarms: u64,
    /// Time of the first alarm since the start, ns; 0 where there was none.
    pub first_alarm_ns: i64,
    /// Rows to which something was added.
    pub adapted: u64,
    /// Of these, rows to which the retrained leaves added, and not bias and gain.
    pub by_leaves: u64,
    /// Of the adapted rows, those at which what is added was clamped.
    pub clamped: u64,
    /// Bias as learned last; the coefficient's unit is the signal's.
    pub bias: f64,
    /// Gain as learned last; a ratio.
    pub gain_ratio: f64,
}

impl Adaptation {
    /// What happened, for a person.
    pub fn words(&self) -> String {
        if self.alarms == 0 {
            return format!("no drift in {} samples; nothing was adapted", self.samples);
        }
        let noun = if self.alarms == 1 { "alarm" } else { "alarms" };
        format!(
            "{} {noun} of drift in {} samples; {} rows adapted, {} of them by retrained leaves, {} clamped; last bias {:.5}, gain {:.5}",
            self.alarms, self.samples, self.adapted, self.by_leaves, self.clamped, self.bias, self.gain_ratio
        )
    }
}

/// Detector and correction. A step takes constant time and no memory.
#[derive(Clone, Debug)]
pub(crate) struct Adapter {
    at_rest: f64,
    in_motion: f64,
    moving_above: f64,
    limit: f64,
    spacing_ns: i64,
    last_ns: Option<i64>,
    sums: [f64; 2],
    /// Bias and gain.
    learned: [f64; 2],
    /// Their covariance over σ²: first, mixed, second.
    spread: [f64; 3],
    leaves: Leaves,
    /// Forgetting means of |e| without what is learned, with bias and gain, and with the leaves.
    innovations: [f64; 3],
    /// Whether bias and gain, and the leaves, have proved themselves.
    trusted: [bool; 2],
    counts: Adaptation,
}

impl Adapter {
    /// For a model with a band and its trees; what is added never exceeds the largest correction that its training saw, nor five half widths of the band.
    pub(crate) fn new(model: &Model, trees: &Forest) -> Option<Self> {
        let band = model.band?;
        let largest = model.guard.range.iter().fold(0.0_f64, |most, edge| most.max(edge.abs()));
        let width = band.at_rest.max(band.in_motion);
        let limit = largest.min(MOST_WIDTHS * width);
        let least = (LEAST_SHARE * width).max(f64::MIN_POSITIVE);
        Some(Self {
            at_rest: (band.at_rest / BAND_IN_SIGMA).max(least),
            in_motion: (band.in_motion / BAND_IN_SIGMA).max(least),
            moving_above: band.moving_above,
            limit,
            spacing_ns: model.period_ns - model.period_ns / 10,
            last_ns: None,
            sums: [0.0; 2],
            learned: [0.0; 2],
            spread: [WIDEST, 0.0, WIDEST],
            leaves: Leaves::new(trees, limit),
            innovations: [0.0; 3],
            trusted: [false; 2],
            counts: Adaptation::default(),
        })
    }

    /// What it saw and did so far.
    pub(crate) fn counts(&self) -> Adaptation {
        Adaptation { bias: self.learned[0], gain_ratio: self.learned[1], ..self.counts }
    }

    /// Alarms so far.
    pub(crate) fn alarms(&self) -> u64 {
        self.counts.alarms
    }

    /// Where the leaves of the row at hand are put, before [`Self::correction`] and [`Self::hear`] are asked of it.
    pub(crate) fn leaves(&mut self) -> &mut [u32] {
        self.leaves.here()
    }

    /// The correction of the present row, whose estimate by the twin is `value`; exactly 0 before the first alarm.
    pub(crate) fn correction(&mut self, value: f64) -> f64 {
        let Some(best) = self.best().filter(|_| value.is_finite()) else { return 0.0 };
        let bounded = self.offers(value)[best];
        self.counts.adapted += 1;
        self.counts.by_leaves += u64::from(best == BY_LEAVES);
        self.counts.clamped += u64::from(bounded.abs() >= self.limit);
        bounded
    }

    /// Observes a measured sample, with the model's output there without adaptation, the twin's estimate, and its motion.
    pub(crate) fn hear(&mut self, time_ns: i64, measured: f64, corrected: f64, value: f64, motion: f64) {
        let innovation = measured - corrected;
        if !(innovation.is_finite() && value.is_finite()) {
            return;
        }
        let since_ns = self.last_ns.map(|last_ns| time_ns.saturating_sub(last_ns)).filter(|since_ns| *since_ns >= 0);
        if since_ns.is_some_and(|since_ns| since_ns < self.spacing_ns) {
            return;
        }
        self.last_ns = Some(time_ns);
        self.counts.samples += 1;
        // Across a pause one sample counts as one.
        let since_s = seconds_from_nanos(since_ns.unwrap_or(self.spacing_ns).min(2 * self.spacing_ns));
        let sigma = if motion > self.moving_above { self.in_motion } else { self.at_rest };
        let with = self.offers(value).map(|added| innovation - added);
        let published = self.best().map_or(innovation, |best| with[best]);
        self.weigh([innovation, with[BY_GAIN], with[BY_LEAVES]], since_s);
        self.watch(published / sigma, time_ns);
        self.learn(innovation, value, sigma, since_s);
        self.leaves.learn(with[BY_LEAVES].clamp(-sigma, sigma), 1.0 - (-since_s / MEMORY_S).exp());
    }

    /// What bias and gain, and the leaves, would add to the row at hand.
    fn offers(&self, value: f64) -> [f64; 2] {
        [self.raw(value).clamp(-self.limit, self.limit), self.leaves.value()]
    }

    /// Which of the two is added: of those that have proved themselves the one that leaves less; none before the first alarm.
    fn best(&self) -> Option<usize> {
        let proven = [BY_GAIN, BY_LEAVES].into_iter().filter(|one| self.counts.alarms > 0 && self.trusted[*one]);
        proven.min_by(|a, b| self.innovations[1 + a].total_cmp(&self.innovations[1 + b]))
    }

    fn raw(&self, value: f64) -> f64 {
        self.learned[0] + self.learned[1] * value
    }

    /// Compares what was learned so far with nothing, on a sample that it has not seen: |e| without, with bias and gain, with the leaves.
    fn weigh(&mut self, left: [f64; 3], since_s: f64) {
        let keep = (-since_s / TRIAL_S).exp();
        for (mean, innovation_left) in self.innovations.iter_mut().zip(left) {
            *mean = keep * *mean + (1.0 - keep) * innovation_left.abs();
        }
        for (trusted, with) in self.trusted.iter_mut().zip(&self.innovations[1..]) {
            let share = if *trusted { 1.0 } else { CONVINCING_SHARE };
            *trusted = *with < share * self.innovations[0];
        }
    }

    fn watch(&mut self, standardised: f64, time_ns: i64) {
        let z = standardised.clamp(-FARTHEST, FARTHEST);
        for (sum, side) in self.sums.iter_mut().zip([z, -z]) {
            *sum = (*sum + side - ALLOWANCE).max(0.0);
        }
        if self.sums.iter().any(|sum| *sum > ALARM_SUM) {
            self.sums = [0.0; 2];
            if self.counts.alarms == 0 {
                self.counts.first_alarm_ns = time_ns;
            }
            self.counts.alarms += 1;
        }
    }

    /// One step of recursive least squares on `innovation = bias + gain·value`, the noise being σ.
    fn learn(&mut self, innovation: f64, value: f64, sigma: f64, since_s: f64) {
        let forget = (-since_s / MEMORY_S).exp();
        let [first, mixed, second] = self.spread;
        let [toward_bias, toward_gain] = [first + mixed * value, mixed + second * value];
        let weight = forget * sigma * sigma / (self.limit * self.limit) + toward_bias + toward_gain * value;
        if weight <= 0.0 {
            return;
        }
        let innovation_left = (innovation - self.raw(value)).clamp(-sigma, sigma);
        self.learned[0] = (self.learned[0] + toward_bias / weight * innovation_left).clamp(-self.limit, self.limit);
        self.learned[1] = (self.learned[1] + toward_gain / weight * innovation_left).clamp(-GAIN_LIMIT, GAIN_LIMIT);
        let narrowed = [
            (first - toward_bias * toward_bias / weight) / forget,
            (mixed - toward_bias * toward_gain / weight) / forget,
            (second - toward_gain * toward_gain / weight) / forget,
        ];
        // Where nothing moves, forgetting alone would widen the spread without end.
        if narrowed[0] <= WIDEST && narrowed[2] <= WIDEST && narrowed.iter().all(|one| one.is_finite()) {
            self.spread = narrowed;
        }
    }
}

/// Largest variance of bias and gain, over the square of the limit.
const WIDEST: f64 = 1.0;

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{Adapter, GAIN_LIMIT};
    use crate::band::Band;
    use crate::model::tests::model;

    const PERIOD_NS: i64 = 200_000_000;
    const SIGMA: f64 = 0.002;

    fn adapter() -> Adapter {
        let mut model = model();
        model.guard.range = [-0.03, 0.05];
        let half_width = 1.645 * SIGMA;
        model.band = Some(Band { coverage_share: 0.9, moving_above: 0.1, at_rest: half_width, in_motion: half_width });
        Adapter::new(&model, &model.forest().unwrap()).unwrap()
    }

    /// Mean absolute error without and with, over so many samples from `from`.
    fn run(adapter: &mut Adapter, samples: i64, from: i64, seed: u64, drift: impl Fn(i64, f64) -> f64) -> [f64; 2] {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut without, mut with) = (0.0, 0.0);
        for k in from..from + samples {
            let value = 0.1 * (0.05 * k as f64).sin();
            let noise: f64 = (0..12).map(|_| random.random_range(-0.5..0.5_f64)).sum::<f64>() * SIGMA;
            let measured = value + drift(k, value) + noise;
            let added = adapter.correction(value);
            without += (measured - value).abs();
            with += (measured - value - added).abs();
            adapter.hear(k * PERIOD_NS, measured, value, value, 0.0);
        }
        [without / samples as f64, with / samples as f64]
    }

    #[test]
    fn a_clean_unit_is_left_alone_to_the_bit() {
        for seed in 0..5 {
            let mut adapter = adapter();
            let [without, with] = run(&mut adapter, 50_000, 0, seed, |_, _| 0.0);
            assert_eq!(without.to_bits(), with.to_bits());
            assert_eq!((adapter.counts().alarms, adapter.counts().adapted), (0, 0));
            assert!(adapter.counts().words().contains("no drift in 50000"));
        }
    }

    #[test]
    fn a_bias_and_a_gain_are_found_and_taken_off() {
        for (bias, gain) in [(0.01, 0.0), (-0.012, 0.0), (0.004, 0.09), (0.01, -0.05)] {
            let mut adapter = adapter();
            let drift = |_, value: f64| bias + gain * value;
            run(&mut adapter, 1500, 0, 1, drift);
            let [without, with] = run(&mut adapter, 3000, 1500, 2, drift);
            // The noise's own mean absolute value is 0.8 σ.
            assert!(with < 0.85 * SIGMA && with < 0.5 * without, "{with} against {without}");
            let counts = adapter.counts();
            assert!(
                counts.alarms >= 1 && (counts.bias - bias).abs() < 0.0005 && (counts.gain_ratio - gain).abs() < 0.01
            );
        }
    }

    #[test]
    fn what_it_adds_stays_in_bounds_and_goes_when_the_drift_goes() {
        let mut adapter = adapter();
        run(&mut adapter, 3000, 0, 1, |_, value| 0.02 + 0.3 * value);
        for value in [-1e9, -0.3, 0.0, 0.3, 1e9] {
            assert!(adapter.correction(value).abs() <= 5.0 * 1.645 * SIGMA);
        }
        assert!(adapter.counts().clamped > 0 && adapter.counts().gain_ratio <= GAIN_LIMIT);
        assert_eq!(adapter.correction(f64::NAN), 0.0);
        run(&mut adapter, 1500, 3000, 1, |_, _| 0.0);
        let [without, with] = run(&mut adapter, 3000, 4500, 2, |_, _| 0.0);
        assert!(with < 1.01 * without, "{with} against {without}");
    }

    #[test]
    fn samples_that_are_no_numbers_or_come_too_fast_teach_nothing() {
        let mut adapter = adapter();
        adapter.hear(0, f64::NAN, 0.0, 0.0, 0.0);
        adapter.hear(0, 0.5, f64::INFINITY, 0.0, 0.0);
        assert_eq!(adapter.counts().samples, 0);
        for k in 0..2000 {
            adapter.hear(k * 1_000_000, 0.0, 0.0, 0.0, 0.0);
        }
        assert_eq!(adapter.counts().samples, 12);
    }
}
