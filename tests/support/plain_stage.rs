//! Synthetic recordings of a stage with none of the twin's equations, and recordings in other units.

use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::recording::Recording;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::stage::Spool;
use std::process::Command;

/// Whether a figure is within this share of what is wanted.
pub fn near(found: f64, wanted: f64, share: f64) -> bool {
    (found / wanted - 1.0).abs() < share
}

/// Runs govtwin; standard output and errors together.
pub fn govtwin(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!([0, 3].contains(&output.status.code().unwrap()), "{arguments:?}: {text}");
    text
}

/// A stage by the plain law, with none of the twin's equations: a dead zone, a gain each way, a lag and a greatest speed.
#[derive(Clone, Copy, Debug)]
pub struct PlainStage {
    /// Half of the dead band, pu of the spool.
    pub dead_pu: f64,
    /// Speed for each pu of the spool beyond, opening and closing, pu/s.
    pub gains_pu_s: [f64; 2],
    /// Time constant of the valve behind its signal, s.
    pub lag_s: f64,
    /// Greatest speed, pu/s.
    pub most_pu_s: f64,
}

impl PlainStage {
    pub const USUAL: Self = Self { dead_pu: 0.07, gains_pu_s: [0.12, 0.08], lag_s: 0.0, most_pu_s: f64::INFINITY };

    /// A recording of so many samples at a rate.
    pub fn record(&self, spool: &Spool, rate_hz: f64, samples: i64) -> Recording {
        const STEPS: i64 = 20;
        let mut random = ChaCha8Rng::seed_from_u64(spool.seed);
        let mut noise = ChaCha8Rng::seed_from_u64(spool.seed ^ 0x5A);
        let mut normal = move || (0..12).map(|_| noise.random_range(-0.5..0.5)).sum::<f64>();
        let step_s = 1.0 / (rate_hz * STEPS as f64);
        let (mut position, mut late, mut target, mut until_s) = (0.0, 0.0, 0.0, 0.0);
        let mut opening = 0.4;
        let mut frames = Vec::new();
        for k in 0..samples {
            let time_s = k as f64 / rate_hz;
            if time_s >= until_s {
                target = spool.target(opening, &mut random);
                until_s = time_s + spool.dwell_s * random.random_range(0.4..1.6);
            }
            if (opening > 0.9 && target > 0.0) || (opening < 0.1 && target < 0.0) {
                target *= -0.5;
            }
            let inputs = Inputs {
                opening_command_pu: f64::NAN,
                esv: EsvState::Normal,
                tank_pressure_pa: f64::NAN,
                piston_force_n: 0.0,
            };
            let measured = Signals {
                spool_position_pu: position,
                servomotor_position_pu: opening + 2.0e-4 * normal(),
                ..Signals::NONE
            };
            frames.push(Frame { time_ns: (time_s * 1e9) as i64, inputs, measured });
            for _ in 0..STEPS {
                position += (target - position) * (1.0 - (-step_s / 0.3).exp());
                late += (position - late) * if self.lag_s > 0.0 { 1.0 - (-step_s / self.lag_s).exp() } else { 1.0 };
                let above = (late - self.dead_pu).max(0.0);
                let below = (late + self.dead_pu).min(0.0);
                let speed_pu_s = self.gains_pu_s[0] * above + self.gains_pu_s[1] * below;
                opening += step_s * speed_pu_s.clamp(-self.most_pu_s, self.most_pu_s);
            }
        }
        Recording::new("plain stage", frames)
    }
}

/// The same recording with both channels in other units: `value × scale + offset`.
pub fn in_units(recording: &Recording, spool: [f64; 2], servomotor: [f64; 2]) -> Recording {
    let mut other = recording.clone();
    for frame in &mut other.frames {
        let measured = &mut frame.measured;
        measured.spool_position_pu = measured.spool_position_pu * spool[0] + spool[1];
        measured.servomotor_position_pu = measured.servomotor_position_pu * servomotor[0] + servomotor[1];
    }
    other
}
