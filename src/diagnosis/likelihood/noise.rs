//! Noise: what a right twin may still leave of each signal, sample by sample.

use crate::likelihood::kick::{Kick, probability};
use crate::likelihood::prepared::PreparedRecording;
use govtwin_model::frame::Estimate;
use govtwin_model::parameters::Sensors;
use govtwin_model::signal::Signal;

/// Deviation of a slow recording's chatter over what the jitter between its samples makes of the demand: commands wander as well.
const HIDDEN: f64 = 1.25;

/// Logarithm of the sum of exponentials.
pub(crate) fn log_sum(values: impl IntoIterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.into_iter().collect();
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        most
    } else {
        most + values.iter().map(|value| (value - most).exp()).sum::<f64>().ln()
    }
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
fn sharpness(recording: &PreparedRecording, signal: Signal, reference: &[Estimate]) -> Vec<f64> {
    let share = SHARP * (SHARP_TIME_S / recording.unit_period_s().max(1e-6)).min(1.0);
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
fn sway(recording: &PreparedRecording, signal: Signal, reference: &[Estimate], moved: &[Vec<Estimate>]) -> Vec<f64> {
    let of = |estimate: &Estimate| signal.of(&estimate.signals);
    let off = |k: usize| moved.iter().map(|other| (of(&other[k]) - of(&reference[k])).abs()).fold(0.0, f64::max);
    (0..recording.samples.len()).map(off).collect()
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

/// What a right model leaves of one signal, at each sample, in its unit squared.
#[derive(Clone, Debug)]
pub struct Variances {
    /// Transducer, quantisation, and chatter that is over with the sample.
    pub white: Vec<f64>,
    /// Chatter and what the spool's stops do, which last as long as the wandering.
    pub drift: Vec<f64>,
    /// Sudden events that come a little early or late.
    pub sharp: Vec<f64>,
    /// The wandering's own.
    pub wander: f64,
    /// Where samples are far apart, chatter that comes as rare kicks; it is then no part of the others.
    pub kicks: Vec<Kick>,
}

impl Variances {
    /// Along a reference's estimates; `moved` are those with the spool's stops a little off, and `step_pu` is the demand at the edge of the
    /// regulator's dead band.
    pub fn new(
        recording: &PreparedRecording,
        signal: Signal,
        noise: &SignalNoise,
        reference: &[Estimate],
        moved: &[Vec<Estimate>],
        step_pu: f64,
    ) -> Self {
        let sway = sway(recording, signal, reference, moved);
        // A servomotor sums kicks up; of the others they are over before the next slow sample.
        let (white, drift, kicks) = if recording.is_slow() && signal != Signal::ServomotorPosition {
            rare(noise, reference, &sway, step_pu)
        } else {
            let (white, drift) = ringing(recording, noise, reference, &sway);
            (white, drift, Vec::new())
        };
        Self {
            white,
            drift,
            sharp: sharpness(recording, signal, reference),
            wander: noise.wander * noise.wander,
            kicks,
        }
    }

    /// All together, but for sudden events.
    pub fn sums(&self) -> Vec<f64> {
        let kicks = self.kicks.iter().map(Kick::mean_square).chain(std::iter::repeat(0.0));
        let plain = self.white.iter().zip(&self.drift).map(|(white, drift)| white + drift + self.wander);
        plain.zip(kicks).map(|(plain, kicks)| plain + kicks).collect()
    }
}

/// White and drifting variances where samples are close together: chatter outlives the demand that set it off by the spool's settling time.
fn ringing(
    recording: &PreparedRecording,
    noise: &SignalNoise,
    reference: &[Estimate],
    sway: &[f64],
) -> (Vec<f64>, Vec<f64>) {
    let mut ringing: f64 = 0.0;
    let of = |((estimate, step_s), sway): ((&Estimate, &f64), &f64)| {
        ringing = (ringing * (-step_s / 0.03).exp()).max(estimate.spool_command_sd_pu);
        let (chatter, drift) = (noise.chatter * ringing, noise.chatter_wander * ringing);
        (noise.white * noise.white + chatter * chatter, drift * drift + sway * sway)
    };
    reference.iter().zip(&recording.steps_s()).zip(sway).map(of).unzip()
}

/// White and drifting variances and kicks where samples are far apart: chatter lasts only where kicks follow each other closely.
fn rare(noise: &SignalNoise, reference: &[Estimate], sway: &[f64], step_pu: f64) -> (Vec<f64>, Vec<f64>, Vec<Kick>) {
    let of = |(estimate, sway): (&Estimate, &f64)| {
        let sd_pu = HIDDEN * estimate.spool_command_sd_pu;
        let lasting = probability(sd_pu, step_pu);
        let wander_square = noise.chatter_wander * noise.chatter_wander;
        let short = (noise.chatter * noise.chatter + (1.0 - lasting) * wander_square).sqrt();
        (Kick::new(sd_pu, step_pu, short), lasting * wander_square * sd_pu * sd_pu + sway * sway)
    };
    let (kicks, drift) = reference.iter().zip(sway).map(of).unzip();
    (vec![noise.white * noise.white; reference.len()], drift, kicks)
}
