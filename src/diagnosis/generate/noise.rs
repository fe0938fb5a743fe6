//! Seeded draws, transducers with noise and steps, and the noise of those that the regulator reads.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use govtwin_model::effects;
use govtwin_model::parameters::{Sensor, Unit};
use govtwin_model::plant::Plant;
use govtwin_model::plant::term::{Point, Term, View};
use govtwin_model::recording::Process;

/// What draws are for; each purpose has a stream of its own, so that one more draw for one changes no other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Parameters of the unit within their tolerances.
    Unit,
    /// What the machine is, alike in all its processes.
    Machine,
    /// When and how far the process goes.
    Script,
    /// Frequency of the grid.
    Grid,
    /// Noise of the command.
    Command,
    /// Noise of the servomotor reading that the regulator uses.
    RegulatorServomotor,
    /// Noise of the spool reading that the regulator uses.
    RegulatorSpool,
    /// Recorded spool position.
    Spool,
    /// Recorded servomotor position.
    Servomotor,
    /// Recorded pilot-valve position.
    PilotValve,
    /// Recorded control pressure.
    ControlPressure,
    /// Recorded tank pressure.
    TankPressure,
    /// Times at which messages reach a recorder.
    LogTime,
}

/// The seed of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RandomStreams {
    /// The seed.
    pub seed: u64,
    /// The process recorded.
    pub process: Process,
}

impl RandomStreams {
    /// The stream of draws for a purpose.
    pub fn of(self, purpose: Purpose) -> Draws {
        let process = match purpose {
            Purpose::Unit | Purpose::Machine => 0,
            _ => 1 + self.process as u64,
        };
        let mut generator = ChaCha8Rng::seed_from_u64(self.seed);
        generator.set_stream(purpose as u64 * 8 + process);
        Draws(generator)
    }
}

/// A stream of draws.
#[derive(Clone, Debug)]
pub struct Draws(ChaCha8Rng);

impl Draws {
    /// From the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Evenly between two values.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }
}

/// A transducer: white noise, then steps.
#[derive(Clone, Debug)]
pub struct Transducer {
    sensor: Sensor,
    draws: Draws,
}

impl Transducer {
    /// A transducer with its own stream of draws.
    pub fn new(sensor: Sensor, draws: Draws) -> Self {
        Self { sensor, draws }
    }

    /// What it shows of a value, in the value's unit.
    pub fn read(&mut self, value: f64) -> f64 {
        let noisy = value + self.sensor.noise * self.draws.normal();
        stepped(noisy, self.sensor.step)
    }
}

fn stepped(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

/// Readings of the servomotor of which a regulator takes the mean: its chatter is then as large as that of the recorded units.
pub const READINGS: u32 = 6;

/// A transducer between the plant and its regulator, which takes the mean of so many readings; with noise for `ticks_count` ticks.
///
/// The noise is drawn before the run, so that the twin that carries it can be cloned and run again.
pub fn in_loop(point: Point, sensor: Sensor, readings: u32, mut draws: Draws, ticks_count: f64) -> Arc<dyn Term> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what memory holds")]
    let count = ticks_count.ceil().clamp(1.0, 1e8) as usize;
    let noise_of_mean = sensor.noise / f64::from(readings).sqrt();
    let noise = (0..count).map(|_| noise_of_mean * draws.normal()).collect();
    let sensor = Sensor { step: sensor.step / f64::from(readings), ..sensor };
    Arc::new(InLoop { point, noise, sensor })
}

/// The plant of a unit whose regulator hears transducers with noise for so many seconds, which then begins anew.
pub fn hearing(unit: &Unit, random: &RandomStreams, duration_s: f64) -> Plant {
    let mut plant = Plant::new(&unit.parameters);
    effects::apply(unit, &mut plant);
    let ticks_count = duration_s / plant.regulator.small_loop_period_s();
    for (point, sensor, readings, purpose) in [
        (Point::RegulatorServomotor, unit.sensors.servomotor_position_pu, READINGS, Purpose::RegulatorServomotor),
        (Point::RegulatorSpool, unit.sensors.spool_position_pu, 1, Purpose::RegulatorSpool),
    ] {
        plant.terms.push(in_loop(point, sensor, readings, random.of(purpose), ticks_count));
    }
    plant
}

#[derive(Debug)]
struct InLoop {
    point: Point,
    noise: Vec<f64>,
    sensor: Sensor,
}

impl Term for InLoop {
    fn point(&self) -> Point {
        self.point
    }

    fn apply(&self, signal: f64, view: &View<'_>, _memory: &mut [f64]) -> f64 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the number of a tick")]
        let tick = (view.time_s / view.tick_s).round().max(0.0) as usize;
        stepped(signal + self.noise[tick % self.noise.len()], self.sensor.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_and_steps_are_those_of_the_sensor() {
        let sensor = Sensor { noise: 6.0e-4, step: 1.22e-4 };
        let mut transducer =
            Transducer::new(sensor, RandomStreams { seed: 3, process: Process::Startup }.of(Purpose::Spool));
        let count = 100_000;
        let readings: Vec<f64> = (0..count).map(|_| transducer.read(0.25)).collect();
        let mean = readings.iter().sum::<f64>() / f64::from(count);
        let variance = readings.iter().map(|reading| (reading - mean).powi(2)).sum::<f64>() / f64::from(count);
        // Steps add the variance of an even distribution over one of them.
        let expected = sensor.noise.powi(2) + sensor.step.powi(2) / 12.0;
        assert!((variance / expected - 1.0).abs() < 0.02, "{variance:e} {expected:e}");
        assert!((mean - 0.25).abs() < 1e-5);
        assert!(readings.iter().all(|reading| (reading / sensor.step).fract().abs() < 1e-6));
    }

    #[test]
    fn purposes_and_processes_do_not_share_draws() {
        let first = |seed, process, purpose| RandomStreams { seed, process }.of(purpose).normal();
        let one = first(1, Process::Startup, Purpose::Spool);
        assert_eq!(one, first(1, Process::Startup, Purpose::Spool));
        assert_ne!(one, first(2, Process::Startup, Purpose::Spool));
        assert_ne!(one, first(1, Process::Shutdown, Purpose::Spool));
        assert_ne!(one, first(1, Process::Startup, Purpose::Servomotor));
        // One machine goes through all processes.
        assert_eq!(first(1, Process::Startup, Purpose::Unit), first(1, Process::Shutdown, Purpose::Unit));
    }
}
