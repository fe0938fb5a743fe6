//! A pure delay between the opening command and the regulator: a slow bus, a queue, a scan.
//!
//! The regulator sees `Y_pid(t − T)` (Åström & Wittenmark 1997, section 2.3).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | T | delay `delay_s` | s |
//!
//! Without it the simulated servomotor leads the real one by T in every ramp, while the response to the ESV is on time.
//! Limits: constant; between ticks the command is interpolated linearly.

use std::sync::Arc;

use crate::effects::{EffectParameter, EffectSpec, Stage};
use crate::plant::Plant;
use crate::plant::term::{Point, Term, View};

/// Longest delay, s.
const MAX_DELAY_S: f64 = 1.0;

/// The effect.
pub const SPEC: EffectSpec = EffectSpec {
    id: "command_delay",
    stage: Stage::Regulator,
    source: include_str!("command_delay.rs"),
    parameters: &[EffectParameter {
        name: "delay_s",
        unit: "s",
        neutral: 0.0,
        min: 0.0,
        max: MAX_DELAY_S,
        typical: 0.05,
        doc: "delay between the issue of the command and its use by the regulator",
    }],
    apply,
};

fn apply(values: &[f64], plant: &mut Plant) {
    if values[0] > 0.0 {
        let ticks = values[0] / plant.regulator.small_loop_period_s();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the range of the spec")]
        let whole = ticks.floor().clamp(0.0, 1e5) as usize;
        plant.terms.push(Arc::new(Delay { whole, share: ticks - ticks.floor() }));
    }
}

/// A ring of the last commands; its first number is the place of the newest.
#[derive(Debug)]
struct Delay {
    whole: usize,
    share: f64,
}

impl Term for Delay {
    fn point(&self) -> Point {
        Point::Command
    }

    fn memory_len(&self) -> usize {
        self.whole + 3
    }

    fn reset(&self, signal: f64, memory: &mut [f64]) {
        memory.fill(signal);
        memory[0] = 0.0;
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "a place in a short ring, kept as a whole float"
    )]
    fn apply(&self, signal: f64, _view: &View<'_>, memory: &mut [f64]) -> f64 {
        let (place, ring) = memory.split_at_mut(1);
        let length = ring.len();
        let newest = (place[0] as usize + 1) % length;
        place[0] = newest as f64;
        ring[newest] = signal;
        let later = ring[(newest + length - self.whole) % length];
        let earlier = ring[(newest + length - self.whole - 1) % length];
        later + self.share * (earlier - later)
    }
}
