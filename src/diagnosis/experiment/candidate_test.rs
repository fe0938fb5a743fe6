//! Candidates for the next test: scripts as the likeliest model of a unit would answer them, at the rates that may be recorded.

use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::Problem;
use crate::result::test_script::{PERIOD_S, TestScript};
use govtwin_model::frame::{Frame, Signals};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::twin::Twin;
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

/// A test that competes.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// What is done.
    pub test: String,
    /// The state of the unit.
    pub unit_state: String,
    /// As the leader would answer it.
    pub recording: PreparedRecording,
    /// The script, where one can be sent to a governor.
    pub script: Option<TestScript>,
    /// Samples a second.
    pub rate_hz: f64,
    /// Whether that is faster than the recordings were.
    pub faster: bool,
}

impl Candidate {
    /// Length, s.
    pub fn length_s(&self) -> f64 {
        match (self.recording.frames.first(), self.recording.frames.last()) {
            (Some(first), Some(last)) => seconds_from_nanos(last.time_ns - first.time_ns),
            _ => 0.0,
        }
    }

    /// Trips of the emergency shutdown valve.
    pub fn trips(&self) -> u32 {
        self.script.as_ref().map_or(0, TestScript::trips)
    }
}

/// Scripts as a unit would answer them, at the rate of the recordings and, where that is slow, at the scripts' own.
pub fn candidates(problem: &Problem, unit: &Unit, scripts: &[TestScript]) -> Vec<Candidate> {
    let period_s = problem.recordings.iter().map(|recording| recording.period_s).fold(PERIOD_S, f64::max);
    let mut periods_s = vec![PERIOD_S];
    if problem.is_slow() {
        periods_s.push(period_s);
    }
    let of = |&script: &TestScript| {
        let answer = answer(unit, &script);
        let candidate = |&period_s: &f64| Candidate {
            test: script.words(),
            unit_state: script.unit_state(),
            recording: PreparedRecording::new(Recording::new(script.words(), sampled(&answer, period_s))),
            script: Some(script),
            rate_hz: (1.0 / period_s).round(),
            faster: problem.is_slow() && period_s <= PERIOD_S,
        };
        periods_s.iter().map(candidate).collect::<Vec<_>>()
    };
    scripts.iter().flat_map(of).collect()
}

/// A script as a unit answers it, all signals at every row.
fn answer(unit: &Unit, script: &TestScript) -> Vec<Frame> {
    let mut twin = Twin::new(unit).with_dither(unit.sensors.servomotor_position_pu.noise);
    let mut frames = script.frames(unit.parameters.oil.tank_pressure_pa);
    for frame in &mut frames {
        frame.measured = twin.step(frame).signals;
    }
    frames
}

/// The rows with signals at so many seconds' distance alone.
fn sampled(frames: &[Frame], period_s: f64) -> Vec<Frame> {
    let period_ns = nanos_from_seconds(period_s).max(1);
    let mut due_ns = i64::MIN;
    let of = |frame: &Frame| {
        let is_due = frame.time_ns >= due_ns;
        if is_due {
            due_ns = frame.time_ns + period_ns;
        }
        Frame { measured: if is_due { frame.measured } else { Signals::NONE }, ..*frame }
    };
    frames.iter().map(of).collect()
}
