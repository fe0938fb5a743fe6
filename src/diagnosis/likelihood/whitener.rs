//! The filter that makes residuals independent and of unit size.

use crate::likelihood::kick::Contaminated;
use crate::likelihood::limit_cycle::{LimitCycles, SignalSamples, limit_cycles};
use crate::likelihood::noise::{Noise, SignalNoise, Variances};
use crate::likelihood::prepared::PreparedRecording;
use govtwin_model::frame::Estimate;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Cut;

/// Time over which the errors of a model's equations stay correlated, s: what a model leaves out shows in the same way for long, so that
/// samples closer together than this are no independent evidence even where the noise is white. The likelihood is raised to a power that counts
/// independent samples (a power posterior; Grünwald & van Ommen 2017).
const CORRELATION_TIME_S: f64 = 0.19;

/// Most independent samples per sample, that of a recording at 100 Hz: no equation of an effect is exact, and the more slow samples count, the
/// more second effects are found that only correct the law of the first one.
const MOST_INDEPENDENT: f64 = 0.05;

/// Independent samples per sample of a recording with this sampling period.
pub fn independent_share(period_s: f64) -> f64 {
    (period_s / (period_s + CORRELATION_TIME_S)).min(MOST_INDEPENDENT)
}

/// The same for the power of limit cycles, of which each block gives several octaves that say much the same.
const LIMIT_CYCLE_SHARE: f64 = 0.05;

/// From so many standard deviations on, a residual counts by its size rather than by its square: sudden events that come a little early or late
/// are many deviations off, and say little (pseudo-Huber; Charbonnier et al. 1997).
const OUTLYING: f64 = 8.0;

/// The number whose square is what a residual costs, where a sample is this share of an independent one.
fn tamed(residual: f64, share: f64) -> f64 {
    let cost = 2.0 * OUTLYING * OUTLYING * ((1.0 + (residual / OUTLYING).powi(2)).sqrt() - 1.0);
    (cost * share).sqrt().copysign(residual)
}

/// The filter of one signal in one recording: gains and scales, fixed so that it is linear in the residuals.
#[derive(Clone, Debug)]
pub struct Whitener {
    /// The signal as measured at each sample; not a number where it was not.
    pub measured: Vec<f64>,
    decay: Vec<f64>,
    gain: Vec<f64>,
    scale: Vec<f64>,
    /// How each sample may hold a kick; empty where samples are close together.
    kicked: Vec<Contaminated>,
    /// Independent samples per sample.
    pub share: f64,
    /// Where the recording is in a limit cycle.
    pub limit_cycles: LimitCycles,
    /// Mean square that a right model would leave besides sudden events, in the signal's unit squared.
    pub floor_square: f64,
}

/// The filters of all signals that a recording has, in their order; the noise is laid out along a reference's estimates, `moved` are those with
/// the spool's stops a little off, and `step_pu` is the demand at the edge of the regulator's dead band.
pub fn whiteners(
    recording: &PreparedRecording,
    noise: &Noise,
    reference: &[Estimate],
    moved: &[Vec<Estimate>],
    step_pu: f64,
) -> Vec<Whitener> {
    let of = |signal: Signal| {
        let variances = Variances::new(recording, signal, &noise[signal as usize], reference, moved, step_pu);
        let measured = recording.measured(signal);
        let reference = signal.of_estimates(reference);
        (SignalSamples { measured, reference, noise_squares: variances.sums() }, variances)
    };
    let (looks, variances): (Vec<SignalSamples>, Vec<Variances>) = recording.signals().map(of).unzip();
    // A servomotor behind a recorded spool has no loop that could cycle.
    let limit_cycles = match recording.cut {
        Cut::Spool => looks.iter().map(LimitCycles::none).collect(),
        _ => limit_cycles(&looks, recording.period_s),
    };
    let each = recording.signals().zip(looks).zip(variances).zip(limit_cycles);
    each.map(|(((signal, look), variances), limit_cycles)| {
        Whitener::new(recording, &noise[signal as usize], look, &variances, limit_cycles)
    })
    .collect()
}

impl Whitener {
    /// The steady innovations filter of wandering seen through white noise and chatter.
    ///
    /// `d ← a d + w`, `residual = d + n`: the scalar Kalman filter (Anderson & Moore 1979, section 3.1), whose innovations over
    /// their standard deviation are independent and of unit size when the model is right.
    fn new(
        recording: &PreparedRecording,
        noise: &SignalNoise,
        look: SignalSamples,
        variances: &Variances,
        limit_cycles: LimitCycles,
    ) -> Self {
        let count = recording.samples.len();
        let (mut decay, mut gain, mut scale) =
            (Vec::with_capacity(count), Vec::with_capacity(count), Vec::with_capacity(count));
        let mut kicked = Vec::with_capacity(variances.kicks.len());
        let mut spread = variances.wander;
        for (k, step_s) in recording.steps_s().into_iter().enumerate() {
            let a = (-step_s / noise.wander_time_s).exp();
            let doubt = noise.doubt * recording.command_doubt_pu[k];
            spread = a * a * spread + (1.0 - a * a) * (variances.wander + variances.drift[k] + doubt * doubt);
            decay.push(a);
            if look.measured[k].is_finite() {
                let total = spread
                    + variances.white[k]
                    + variances.sharp[k] * variances.sharp[k]
                    + limit_cycles.ignored_squares[k];
                let k_gain = spread / total;
                gain.push(k_gain);
                let contaminated = variances.kicks.get(k).map(|kick| kick.over(total));
                scale.push(contaminated.map_or_else(|| 1.0 / total.sqrt(), |one| one.height()));
                kicked.extend(contaminated);
                spread *= 1.0 - k_gain;
            } else {
                gain.push(0.0);
                scale.push(0.0);
                kicked.extend(variances.kicks.get(k).map(|kick| kick.over(1.0)));
            }
        }
        let seen = look.noise_squares.iter().zip(&look.measured).filter(|(_, measured)| measured.is_finite());
        let seen: Vec<f64> = seen.map(|(square, _)| *square).collect();
        let floor_square = seen.iter().sum::<f64>() / seen.len().max(1) as f64;
        let share = independent_share(recording.unit_period_s());
        Self { measured: look.measured, decay, gain, scale, kicked, share, limit_cycles, floor_square }
    }

    /// Twice the logarithm of the standard deviation, over all samples, raised as the likelihood is.
    pub fn width(&self) -> f64 {
        self.scale.iter().filter(|scale| **scale > 0.0).map(|scale| -2.0 * scale.ln() * self.share).sum()
    }

    /// One over the standard deviation of each innovation, where there was a sample.
    pub fn scales(&self) -> Vec<f64> {
        self.scale.iter().copied().filter(|scale| *scale > 0.0).collect()
    }

    /// By how much a simulated limit cycle differs from the recorded one, where there is one.
    pub fn limit_cycles<'a>(&'a self, simulated: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.limit_cycles.residuals(simulated).map(|residual| tamed(residual, LIMIT_CYCLE_SHARE))
    }

    /// Mean square of the innovations over their standard deviation where the model is right, summed over all samples.
    pub fn expected_square(&self) -> f64 {
        let seen = |&(_, scale): &(usize, &f64)| *scale > 0.0;
        let of = |(k, _): (usize, &f64)| self.kicked.get(k).map_or(1.0, Contaminated::mean_square);
        self.scale.iter().enumerate().filter(seen).map(of).sum()
    }

    /// Turns residuals into innovations over their standard deviation, in place; a residual that is not finite becomes 0.
    pub fn apply(&self, residuals: &mut [f64]) {
        let mut state = 0.0;
        for (k, residual) in residuals.iter_mut().enumerate() {
            state *= self.decay[k];
            if self.scale[k] == 0.0 || !residual.is_finite() {
                *residual = 0.0;
                continue;
            }
            let innovation = *residual - state;
            let (root, plain) =
                self.kicked.get(k).map_or((innovation * self.scale[k], 1.0), |kicked| kicked.judge(innovation));
            // What a kick adds is gone before the next sample.
            state += self.gain[k] * plain * innovation;
            *residual = tamed(root, self.share);
        }
    }
}
