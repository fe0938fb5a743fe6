//! Noise: what a right twin may still miss, and the filter that makes misses independent and of unit size.

use crate::frame::Estimate;
use crate::parameters::Sensors;
use crate::signal::Signal;
use crate::tuning::trial::Trial;

/// Of so many misses one counts as news: what a model leaves out shows in the same way for long, so that its errors are no independent
/// witnesses even where the noise is. The likelihood is raised to one over this power (a power posterior; Grünwald & van Ommen 2017).
pub const ALIKE: f64 = 20.0;

/// From so many standard deviations on, a miss counts by its size rather than by its square: sudden events that come a little early or late
/// are many deviations off, and say little (pseudo-Huber; Charbonnier et al. 1997).
const OUTLYING: f64 = 8.0;

/// The number whose square is what a miss costs.
fn tamed(miss: f64) -> f64 {
    let cost = 2.0 * OUTLYING * OUTLYING * ((1.0 + (miss / OUTLYING).powi(2)).sqrt() - 1.0);
    (cost / ALIKE).sqrt().copysign(miss)
}

/// Share of a bend that a right model may miss: it has sudden events a little early or late, and rounds them in its own way.
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

/// How a signal's miss behaves when the model is right: white noise, chatter, and a slow wandering.
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

/// The filter of one signal in one trial: gains and scales, fixed so that it is linear in the misses.
#[derive(Clone, Debug)]
pub struct Whitener {
    decay: Vec<f64>,
    gain: Vec<f64>,
    scale: Vec<f64>,
    /// Mean square that a right model would miss besides sudden events, in the signal's unit squared.
    pub floor_square: f64,
}

impl Whitener {
    /// The steady innovations filter of wandering seen through white noise and chatter.
    ///
    /// `d ← a d + w`, `miss = d + n`: the scalar Kalman filter (Anderson & Moore 1979, section 3.1), whose innovations over
    /// their standard deviation are independent and of unit size when the model is right. `moved` are the reference's estimates with
    /// the spool's stops a little off.
    #[must_use]
    pub fn new(
        trial: &Trial,
        signal: Signal,
        noise: &SignalNoise,
        reference: &[Estimate],
        moved: &[Vec<Estimate>],
    ) -> Self {
        let count = trial.samples.len();
        let (mut decay, mut gain, mut scale) =
            (Vec::with_capacity(count), Vec::with_capacity(count), Vec::with_capacity(count));
        let mut spread = noise.wander * noise.wander;
        let mut last_ns = None;
        // Chatter outlives the demand that set it off by the spool's settling time.
        let mut ringing: f64 = 0.0;
        let (mut floor, mut seen) = (0.0, 0_usize);
        let sharpness = sharpness(trial, signal, reference);
        let sway = sway(trial, signal, reference, moved);
        for (k, (&row, estimate)) in trial.samples.iter().zip(reference).enumerate() {
            let frame = &trial.frames[row];
            let step_s = last_ns.map_or(0.0, |last_ns| crate::units::seconds_from_nanos(frame.time_ns - last_ns));
            last_ns = Some(frame.time_ns);
            let a = (-step_s / noise.wander_time_s).exp();
            ringing = (ringing * (-step_s / 0.03).exp()).max(estimate.spool_command_sd_pu);
            let doubt = noise.doubt * trial.command_doubt_pu[k];
            let chatter = noise.chatter * ringing;
            let drift = (noise.chatter_wander * ringing).hypot(sway[k]);
            spread = a * a * spread + (1.0 - a * a) * (noise.wander * noise.wander + drift * drift + doubt * doubt);
            if signal.of(&frame.measured).is_finite() {
                floor += noise.white * noise.white + chatter * chatter + noise.wander * noise.wander + drift * drift;
                seen += 1;
                let total = spread + noise.white * noise.white + chatter * chatter + sharpness[k] * sharpness[k];
                let k_gain = spread / total;
                decay.push(a);
                gain.push(k_gain);
                scale.push(1.0 / total.sqrt());
                spread *= 1.0 - k_gain;
            } else {
                decay.push(a);
                gain.push(0.0);
                scale.push(0.0);
            }
        }
        Self { decay, gain, scale, floor_square: if seen > 0 { floor / seen as f64 } else { 0.0 } }
    }

    /// Turns misses into innovations over their standard deviation, in place; a miss that is not finite becomes 0.
    pub fn apply(&self, misses: &mut [f64]) {
        let mut state = 0.0;
        for (k, miss) in misses.iter_mut().enumerate() {
            state *= self.decay[k];
            if self.scale[k] == 0.0 || !miss.is_finite() {
                *miss = 0.0;
                continue;
            }
            let innovation = *miss - state;
            state += self.gain[k] * innovation;
            *miss = tamed(innovation * self.scale[k]);
        }
    }
}
