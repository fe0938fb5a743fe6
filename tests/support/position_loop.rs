//! Synthetic recordings of a position loop that knows nothing of a servomotor: its command and its position alone.

use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::recording::Recording;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Steps of the simulation between two rows, and time between these at the usual speed, s.
const STEPS: usize = 10;
const ROW_S: f64 = 0.05;

/// A position loop: a gain, a delay, a lag, a rate limit each way, and play before the position that is measured. Its command steps.
#[derive(Clone, Copy, Debug)]
pub struct Loop {
    pub gain: f64,
    pub delay_s: f64,
    pub lag_s: f64,
    /// Greatest speed, rising and falling, pu/s.
    pub limits_s: [f64; 2],
    /// Half of the play, pu.
    pub half_play: f64,
    /// All times over those at the usual speed.
    pub slower: f64,
}

impl Loop {
    pub const USUAL: Self =
        Self { gain: 1.0, delay_s: 0.15, lag_s: 0.3, limits_s: [0.30, 0.22], half_play: 0.0, slower: 1.0 };

    /// A recording of so many rows.
    pub fn record(&self, seed: u64, rows: usize) -> Recording {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let step_s = ROW_S / STEPS as f64;
        let late = (self.delay_s / step_s).round() as usize;
        let (mut asked, mut drive, mut at, mut until) = (vec![0.5; late + 1], 0.5, 0.5, 0);
        let mut frames = Vec::new();
        for row in 0..rows {
            if row >= until {
                let last = asked.len() - 1;
                asked[last] = random.random_range(0.15..0.85);
                until = row + random.random_range(20..100);
            }
            let now = *asked.last().unwrap();
            let noise: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
            let inputs = Inputs {
                opening_command_pu: now,
                esv: EsvState::Normal,
                tank_pressure_pa: f64::NAN,
                piston_force_n: 0.0,
            };
            let measured = Signals { servomotor_position_pu: at + 3e-4 * noise, ..Signals::NONE };
            let time_ns = (row as f64 * ROW_S * self.slower * 1e9) as i64;
            frames.push(Frame { time_ns, inputs, measured });
            for _ in 0..STEPS {
                let wanted = (self.gain * asked[asked.len() - 1 - late] - drive) / self.lag_s;
                drive += step_s * wanted.clamp(-self.limits_s[1], self.limits_s[0]);
                at = at.clamp(drive - self.half_play, drive + self.half_play);
                asked.push(now);
            }
        }
        Recording::new("position loop", frames)
    }
}
