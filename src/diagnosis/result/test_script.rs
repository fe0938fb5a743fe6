//! Tests that an operator could run next: the state of the unit, the command and the ESV over time, in words and as rows.

use serde::{Deserialize, Serialize};

use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

/// Time between two commands of a script, s.
pub const PERIOD_S: f64 = 0.01;

/// How long a unit stands still before the command or the ESV acts, s.
const DWELL_S: f64 = 4.0;

/// How the command goes on from the first opening.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CommandShape {
    /// Stays where it is.
    Hold,
    /// Steps by so much and, half of the rest of the time later, back.
    Step {
        /// Height, pu.
        by_pu: f64,
    },
    /// Goes to either side at constant speed.
    Triangle {
        /// To either side, pu.
        by_pu: f64,
        /// Period, s.
        period_s: f64,
    },
    /// LimitCycles to either side, faster and faster.
    Sweep {
        /// To either side, pu.
        by_pu: f64,
        /// Frequencies at the beginning and at the end, Hz.
        between_hz: (f64, f64),
    },
    /// Runs to another opening at constant speed and back.
    Ramp {
        /// The other opening, pu.
        to_pu: f64,
    },
    /// Stays, or steps by so much one second before the emergency shutdown valve trips.
    Trip {
        /// Height of the step, pu; 0 for none.
        by_pu: f64,
    },
}

/// A test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TestScript {
    /// First opening, pu.
    pub start_pu: f64,
    /// How the command goes on.
    pub shape: CommandShape,
    /// Length, s.
    pub length_s: f64,
}

/// A change of opening that a unit may be asked for on load, pu; a larger one needs a unit at standstill.
const ON_LOAD_PU: f64 = 0.1;

/// The candidates: usual tests at several openings and sizes.
pub(crate) const CANDIDATES: [TestScript; 13] = [
    script(0.4, CommandShape::Step { by_pu: 0.02 }, 20.0),
    script(0.6, CommandShape::Step { by_pu: 0.1 }, 20.0),
    script(0.4, CommandShape::Triangle { by_pu: 0.015, period_s: 16.0 }, 36.0),
    script(0.7, CommandShape::Triangle { by_pu: 0.05, period_s: 16.0 }, 36.0),
    script(0.5, CommandShape::Sweep { by_pu: 0.01, between_hz: (0.05, 2.0) }, 34.0),
    script(0.3, CommandShape::Sweep { by_pu: 0.03, between_hz: (0.05, 0.5) }, 34.0),
    script(0.1, CommandShape::Ramp { to_pu: 0.9 }, 40.0),
    script(0.05, CommandShape::Step { by_pu: 0.9 }, 34.0),
    script(0.8, CommandShape::Step { by_pu: -0.5 }, 20.0),
    script(0.3, CommandShape::Step { by_pu: 0.3 }, 20.0),
    script(0.6, CommandShape::Trip { by_pu: 0.0 }, 12.0),
    script(0.2, CommandShape::Trip { by_pu: 0.0 }, 12.0),
    script(0.3, CommandShape::Trip { by_pu: 0.4 }, 14.0),
];

const fn script(start_pu: f64, shape: CommandShape, length_s: f64) -> TestScript {
    TestScript { start_pu, shape, length_s }
}

/// A share as a percentage, without digits that say nothing.
fn percent(share: f64) -> String {
    format!("{} %", (1000.0 * share).round() / 10.0)
}

impl TestScript {
    /// Number of trips of the emergency shutdown valve.
    pub fn trips(&self) -> u32 {
        u32::from(matches!(self.shape, CommandShape::Trip { .. }))
    }

    /// When the command first moves or the valve trips, s.
    fn acts_s(&self) -> f64 {
        DWELL_S + if matches!(self.shape, CommandShape::Trip { by_pu } if by_pu != 0.0) { 1.0 } else { 0.0 }
    }

    /// The opening command at a time in s, pu.
    pub fn command_pu(&self, time_s: f64) -> f64 {
        let since_s = time_s - DWELL_S;
        if since_s < 0.0 {
            return self.start_pu;
        }
        let rest_s = self.length_s - DWELL_S;
        self.start_pu
            + match self.shape {
                CommandShape::Hold => 0.0,
                CommandShape::Step { by_pu } => {
                    if since_s < 0.5 * rest_s {
                        by_pu
                    } else {
                        0.0
                    }
                }
                CommandShape::Triangle { by_pu, period_s } => {
                    by_pu * (1.0 - 4.0 * ((since_s / period_s + 0.25).fract() - 0.5).abs())
                }
                CommandShape::Sweep { by_pu, between_hz: (from_hz, to_hz) } => {
                    let turns = from_hz * since_s + 0.5 * (to_hz - from_hz) * since_s * since_s / rest_s;
                    by_pu * (std::f64::consts::TAU * turns).sin()
                }
                CommandShape::Ramp { to_pu } => {
                    (to_pu - self.start_pu) * (1.0 - (2.0 * (since_s / rest_s).min(1.0) - 1.0).abs())
                }
                CommandShape::Trip { by_pu } => by_pu,
            }
    }

    /// The emergency shutdown valve at a time in s.
    pub fn esv(&self, time_s: f64) -> EsvState {
        if self.trips() > 0 && time_s >= self.acts_s() { EsvState::Shutdown } else { EsvState::Normal }
    }

    /// Farthest from the first opening that the command asks for, pu.
    fn travel_pu(&self) -> f64 {
        match self.shape {
            CommandShape::Hold => 0.0,
            CommandShape::Step { by_pu } | CommandShape::Triangle { by_pu, .. } | CommandShape::Sweep { by_pu, .. } => {
                by_pu.abs()
            }
            CommandShape::Ramp { to_pu } => (to_pu - self.start_pu).abs(),
            CommandShape::Trip { .. } => 1.0,
        }
    }

    /// The rows that the script sends, from a start at time 0; nothing is measured but where the unit stands at first.
    pub fn frames(&self, tank_pressure_pa: f64) -> Vec<Frame> {
        let period_ns = nanos_from_seconds(PERIOD_S);
        let end_ns = nanos_from_seconds(self.length_s);
        (0..=end_ns / period_ns)
            .map(|row| row * period_ns)
            .map(|time_ns| {
                let time_s = seconds_from_nanos(time_ns);
                let inputs = Inputs {
                    opening_command_pu: self.command_pu(time_s),
                    esv: self.esv(time_s),
                    tank_pressure_pa,
                    piston_force_n: 0.0,
                };
                let at_start =
                    Signals { spool_position_pu: 0.0, servomotor_position_pu: self.start_pu, ..Signals::NONE };
                Frame { time_ns, inputs, measured: if time_ns == 0 { at_start } else { Signals::NONE } }
            })
            .collect()
    }

    /// What is done, in words.
    pub fn words(&self) -> String {
        let start = percent(self.start_pu);
        match self.shape {
            CommandShape::Hold => format!("hold {start} for {} s", self.length_s),
            CommandShape::Step { by_pu } => {
                let (to, held_s) = (percent(self.start_pu + by_pu), 0.5 * (self.length_s - DWELL_S));
                format!("step the opening command from {start} to {to}, hold {held_s} s, and step back")
            }
            CommandShape::Triangle { by_pu, period_s } => {
                let (by, rate) = (percent(by_pu), percent(4.0 * by_pu / period_s));
                format!(
                    "move the opening command in triangles of ±{by} about {start} at {rate} per second, two periods of {period_s} s"
                )
            }
            CommandShape::Sweep { by_pu, between_hz: (from_hz, to_hz) } => {
                let (by, swept_s) = (percent(by_pu), self.length_s - DWELL_S);
                format!(
                    "sweep the opening command with a sine of ±{by} about {start} from {from_hz} to {to_hz} Hz in {swept_s} s"
                )
            }
            CommandShape::Ramp { to_pu } => {
                let rate = percent(2.0 * (to_pu - self.start_pu).abs() / (self.length_s - DWELL_S));
                format!("ramp the opening command from {start} to {} and back at {rate} per second", percent(to_pu))
            }
            CommandShape::Trip { by_pu: 0.0 } => {
                format!("trip the ESV at {start} opening and record until the servomotor is closed")
            }
            CommandShape::Trip { by_pu } => {
                let to = percent(self.start_pu + by_pu);
                format!(
                    "step the opening command from {start} to {to} and trip the ESV 1 s later, while the servomotor opens"
                )
            }
        }
    }

    /// The state that the unit must be in, and what to bring it to first.
    pub fn unit_state(&self) -> String {
        let start = percent(self.start_pu);
        let state = if self.trips() > 0 {
            "Unit at standstill or prepared for a trip, oil supply on, guide vanes free to move"
        } else if self.travel_pu() > ON_LOAD_PU {
            "Unit at standstill with the intake closed, oil supply on, guide vanes free to move"
        } else {
            "Unit at standstill with guide vanes free to move, or on load if the grid tolerates the load swing"
        };
        format!(
            "{state}; governor in opening control. Bring the opening to {start} and hold it for 30 s. The prediction assumes the \
             guide-vane load of the recordings; for a test without water on the vanes, adapt `servomotor.load_closed_n` and `servomotor.load_slope_n`"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_candidate_stays_within_the_stroke_and_begins_at_rest() {
        let mut words: Vec<String> = Vec::new();
        for script in CANDIDATES {
            let frames = script.frames(4.0e6);
            assert_eq!(frames[0].measured.servomotor_position_pu, script.start_pu);
            assert!(frames.windows(2).all(|two| two[1].time_ns - two[0].time_ns == 10_000_000), "{script:?}");
            let commands = || frames.iter().map(|frame| frame.inputs.opening_command_pu);
            assert!(commands().all(|pu| (0.0..=1.0).contains(&pu)), "{script:?}");
            assert!(commands().take(400).all(|pu| pu == script.start_pu), "{script:?}");
            let moves = commands().any(|pu| (pu - script.start_pu).abs() >= 0.009);
            let trips = frames.iter().any(|frame| frame.inputs.esv == EsvState::Shutdown);
            assert!(moves || trips, "{script:?}");
            assert_eq!(trips, script.trips() == 1, "{script:?}");
            // Nothing jumps but where steps are asked for.
            let jumps =
                frames.windows(2).map(|two| two[1].inputs.opening_command_pu - two[0].inputs.opening_command_pu);
            let most = jumps.map(f64::abs).fold(0.0, f64::max);
            assert!(
                matches!(script.shape, CommandShape::Step { .. } | CommandShape::Trip { .. }) || most < 2.5e-3,
                "{most} {script:?}"
            );
            words.push(script.words());
        }
        words.sort();
        words.dedup();
        assert_eq!(words.len(), CANDIDATES.len());
        assert!(words.contains(&"step the opening command from 40 % to 42 %, hold 8 s, and step back".to_owned()));
    }
}
