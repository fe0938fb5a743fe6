//! Noise: what a right twin may still leave, and the filter that makes residuals independent and of unit size.

use crate::frame::Estimate;
use crate::likelihood::limit_cycle::{LimitCycles, Look, swings};
use crate::likelihood::trial::Trial;
use crate::parameters::Sensors;
use crate::signal::Signal;
use crate::twin::Cut;

/// Time over which the errors of a model's equations stay correlated, s: what a model leaves out shows in the same way for long, so that
/// samples closer together than this are no independent evidence even where the noise is white. The likelihood is raised to a power that counts
/// independent samples (a power posterior; Grünwald & van Ommen 2017).
const CORRELATION_TIME_S: f64 = 0.19;

/// Most independent samples per sample: the slower a recorder, the less is known of the inputs between its samples, whose errors last.
///
/// At 5 Hz a share of a half lets fits end at parameters of which faster recordings know better.
const MOST_INDEPENDENT: f64 = 0.05;

/// Independent samples per sample of a recording with this sampling period.
#[must_use]
pub fn independent_share(period_s: f64) -> f64 {
    (period_s / (period_s + CORRELATION_TIME_S)).min(MOST_INDEPENDENT)
}

/// The same for the power of limit cycles, of which each block gives several octaves that say much the same.
const LIMIT_CYCLE_SHARE: f64 = 0.05;

/// From so many standard deviations on, a residual counts by its size rather than by its square: sudden events that come a little early or late
/// are many deviations off, and say little (pseudo-Huber; Charbonnier et al. 1997).
const OUTLYING: f64 = 8.0;

/// Logarithm of the sum of exponentials.
#[must_use]
pub fn log_sum(values: impl IntoIterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.into_iter().collect();
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        most
    } else {
        most + values.iter().map(|value| (value - most).exp()).sum::<f64>().ln()
    }
}

/// The number whose square is what a residual costs, where a sample is this share of an independent one.
fn tamed(residual: f64, share: f64) -> f64 {
    let cost = 2.0 * OUTLYING * OUTLYING * ((1.0 + (residual / OUTLYING).powi(2)).sqrt() - 1.0);
    (cost * share).sqrt().copysign(residual)
}

/// Share of a bend that a right model may leave: it has sudden events a little early or late, and rounds them in its own way.
const SHARP: f64 = 0.25;

/// A bend counts for so many samples to either side.
const SHARP_REACH: usize = 2;

/// Longest time over which a bend says how sudden an event is, s: slow samples bend where nothing is sudden.
const SHARP_TIME_S: f64 = 0.01;

/// How far a right model may be off for the suddenness of what it tells, at each sample, in the signal's unit.
///
/// Without it a pressure that rises by 1 MPa in 50 ms costs more for a millisecond than most effects for all that they do, and the
/// cost jumps to and fro between parameters that nothing else tells apart.
fn sharpness(trial: &Trial, signal: Signal, reference: &[Estimate]) -> Vec<f64> {
    let share = SHARP * (SHARP_TIME_S / trial.period_s.max(1e-6)).min(1.0);
    let mut bends = vec![0.0_f64; reference.len()];
    for (k, three) in reference.windows(3).enumerate() {
        let [before, here, after] = [0, 1, 2].map(|i| signal.of(&three[i].signals));
        bends[k + 1] = share * (before - 2.0 * here + after).abs();
    }
    let about = |k: usize| k.saturating_sub(SHARP_REACH)..(k + SHARP_REACH + 1).min(bends.len());
    (0..bends.len()).map(|k| bends[about(k)].iter().copied().fold(0.0, f64::max)).collect()
}

/// How far a right model may be off because nobody knows to its transducer's noise where the spool's stops stand, at each sample, in the
/// signal's unit.
///
/// On a stop the regulator pushes by the little that the stop is off the demand, so that less than the transducer's noise
/// decides whether the control pressure falls by nothing or by megapascals.
fn sway(trial: &Trial, signal: Signal, reference: &[Estimate], moved: &[Vec<Estimate>]) -> Vec<f64> {
    let of = |estimate: &Estimate| signal.of(&estimate.signals);
    let off = |k: usize| moved.iter().map(|other| (of(&other[k]) - of(&reference[k])).abs()).fold(0.0, f64::max);
    (0..trial.samples.len()).map(off).collect()
}

/// How a signal's residual behaves when the model is right: white noise, chatter, and a slow wandering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalNoise {
    /// White noise of transducer and quantisation, one standard deviation, in the signal's unit.
    pub white: f64,
    /// Chatter per standard deviation of the regulator's demand, signal unit per pu.
    pub chatter: f64,
    /// Slow part of the chatter, signal unit per pu.
    pub chatter_wander: f64,
    /// Share of the command's doubt between samples that reaches the signal, signal unit per pu.
    pub doubt: f64,
    /// Wandering, one standard deviation, in the signal's unit.
    pub wander: f64,
    /// Correlation time of the wandering, s.
    pub wander_time_s: f64,
}

impl SignalNoise {
    /// The same noise, so many times as large.
    #[must_use]
    pub fn scaled(self, ratio: f64) -> Self {
        Self {
            white: self.white * ratio,
            chatter: self.chatter * ratio,
            chatter_wander: self.chatter_wander * ratio,
            doubt: self.doubt * ratio,
            wander: self.wander * ratio,
            wander_time_s: self.wander_time_s,
        }
    }
}

/// The noise of all of [`Signal::ALL`].
pub type Noise = [SignalNoise; Signal::ALL.len()];

/// The noise to expect of a unit with these transducers.
#[must_use]
pub fn expected(sensors: &Sensors) -> Noise {
    Signal::ALL.map(|signal| {
        let sensor = signal.sensor(sensors);
        let white = (sensor.noise * sensor.noise + sensor.step * sensor.step / 12.0).sqrt();
        match signal {
            Signal::ServomotorPosition => {
                SignalNoise { white, chatter: 0.01, chatter_wander: 0.01, doubt: 1.0, wander: 5e-5, wander_time_s: 1.0 }
            }
            Signal::SpoolPosition => {
                SignalNoise { white, chatter: 0.3, chatter_wander: 0.3, doubt: 10.0, wander: 6e-4, wander_time_s: 0.3 }
            }
            Signal::PilotValvePosition => SignalNoise {
                white: (white * white + 25.0e-6_f64).sqrt(),
                chatter: 5.0,
                chatter_wander: 0.5,
                doubt: 50.0,
                wander: 2.0e-3,
                wander_time_s: 0.05,
            },
            Signal::ControlPressure => SignalNoise {
                white,
                chatter: 1.0e6,
                chatter_wander: 3e5,
                doubt: 1e6,
                wander: 2.0e3,
                wander_time_s: 0.5,
            },
        }
    })
}

/// Time since the sample before, s; 0 for the first.
fn steps_s(trial: &Trial) -> Vec<f64> {
    let times_ns = trial.samples.iter().map(|&row| trial.frames[row].time_ns);
    let before_ns = times_ns.clone().take(1).chain(times_ns.clone());
    times_ns.zip(before_ns).map(|(here, before)| crate::units::seconds_from_nanos(here - before)).collect()
}

/// The filter of one signal in one trial: gains and scales, fixed so that it is linear in the residuals.
#[derive(Clone, Debug)]
pub struct Whitener {
    decay: Vec<f64>,
    gain: Vec<f64>,
    scale: Vec<f64>,
    /// Independent samples per sample.
    pub share: f64,
    /// Where the recording swings.
    pub swings: LimitCycles,
    /// Mean square that a right model would leave besides sudden events, in the signal's unit squared.
    pub floor_square: f64,
}

/// Variances of what a right model leaves of one signal, at each sample, in its unit squared.
struct Variances {
    white: Vec<f64>,
    drift: Vec<f64>,
    wander: f64,
}

impl Variances {
    fn new(trial: &Trial, noise: &SignalNoise, reference: &[Estimate], sway: &[f64]) -> Self {
        // Chatter outlives the demand that set it off by the spool's settling time.
        let mut ringing: f64 = 0.0;
        let of = |((estimate, step_s), sway): ((&Estimate, &f64), &f64)| {
            ringing = (ringing * (-step_s / 0.03).exp()).max(estimate.spool_command_sd_pu);
            let (chatter, drift) = (noise.chatter * ringing, noise.chatter_wander * ringing);
            (noise.white * noise.white + chatter * chatter, drift * drift + sway * sway)
        };
        let (white, drift) = reference.iter().zip(&steps_s(trial)).zip(sway).map(of).unzip();
        Self { white, drift, wander: noise.wander * noise.wander }
    }

    /// All together.
    fn sums(&self) -> Vec<f64> {
        self.white.iter().zip(&self.drift).map(|(white, drift)| white + drift + self.wander).collect()
    }
}

/// The filters of all signals that a trial has, in their order; the noise is laid out along a reference's estimates, `moved` are those with
/// the spool's stops a little off.
#[must_use]
pub fn whiteners(trial: &Trial, noise: &Noise, reference: &[Estimate], moved: &[Vec<Estimate>]) -> Vec<Whitener> {
    let of = |signal: Signal| {
        let sway = sway(trial, signal, reference, moved);
        let variances = Variances::new(trial, &noise[signal as usize], reference, &sway);
        let measured = trial.measured(signal);
        let reference = signal.of_estimates(reference);
        (Look { measured, reference, noise_squares: variances.sums() }, variances)
    };
    let (looks, variances): (Vec<Look>, Vec<Variances>) = trial.signals().map(of).unzip();
    // A servomotor behind a recorded spool cannot swing of itself.
    let swings = match trial.cut {
        Cut::Spool => looks.iter().map(LimitCycles::none).collect(),
        _ => swings(&looks, trial.period_s),
    };
    let each = trial.signals().zip(looks).zip(variances).zip(swings);
    each.map(|(((signal, look), variances), swings)| {
        let sharpness = sharpness(trial, signal, reference);
        Whitener::new(trial, &noise[signal as usize], &look, &variances, &sharpness, swings)
    })
    .collect()
}

impl Whitener {
    /// The steady innovations filter of wandering seen through white noise and chatter.
    ///
    /// `d ← a d + w`, `residual = d + n`: the scalar Kalman filter (Anderson & Moore 1979, section 3.1), whose innovations over
    /// their standard deviation are independent and of unit size when the model is right.
    fn new(
        trial: &Trial,
        noise: &SignalNoise,
        look: &Look,
        variances: &Variances,
        sharpness: &[f64],
        swings: LimitCycles,
    ) -> Self {
        let count = trial.samples.len();
        let (mut decay, mut gain, mut scale) =
            (Vec::with_capacity(count), Vec::with_capacity(count), Vec::with_capacity(count));
        let mut spread = variances.wander;
        for (k, step_s) in steps_s(trial).into_iter().enumerate() {
            let a = (-step_s / noise.wander_time_s).exp();
            let doubt = noise.doubt * trial.command_doubt_pu[k];
            spread = a * a * spread + (1.0 - a * a) * (variances.wander + variances.drift[k] + doubt * doubt);
            decay.push(a);
            if look.measured[k].is_finite() {
                let total = spread + variances.white[k] + sharpness[k] * sharpness[k] + swings.ignored_squares[k];
                let k_gain = spread / total;
                gain.push(k_gain);
                scale.push(1.0 / total.sqrt());
                spread *= 1.0 - k_gain;
            } else {
                gain.push(0.0);
                scale.push(0.0);
            }
        }
        let seen = look.noise_squares.iter().zip(&look.measured).filter(|(_, measured)| measured.is_finite());
        let seen: Vec<f64> = seen.map(|(square, _)| *square).collect();
        let floor_square = seen.iter().sum::<f64>() / seen.len().max(1) as f64;
        Self { decay, gain, scale, share: independent_share(trial.period_s), swings, floor_square }
    }

    /// Twice the logarithm of the standard deviation, over all samples, raised as the likelihood is.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.scale.iter().filter(|scale| **scale > 0.0).map(|scale| -2.0 * scale.ln() * self.share).sum()
    }

    /// One over the standard deviation of each innovation, where there was a sample.
    #[must_use]
    pub fn scales(&self) -> Vec<f64> {
        self.scale.iter().copied().filter(|scale| *scale > 0.0).collect()
    }

    /// By how much a simulated signal swings otherwise than the recorded one, where that swings of itself.
    pub fn swings<'a>(&'a self, simulated: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.swings.residuals(simulated).map(|residual| tamed(residual, LIMIT_CYCLE_SHARE))
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
            state += self.gain[k] * innovation;
            *residual = tamed(innovation * self.scale[k], self.share);
        }
    }
}
