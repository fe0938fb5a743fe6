//! A pure delay of any length; between the points of a grid of whole ticks the signal is interpolated linearly.

use crate::plant::term::{Point, Term, View};

/// Returns its input of `delay_s` ago.
///
/// Its memory is a ring of the last signals; the first number is the place of the newest.
#[derive(Clone, Debug)]
pub(crate) struct Delay {
    point: Point,
    grid_ticks: usize,
    whole_ticks: usize,
    share: f64,
}

impl Delay {
    /// A delay at a point, for ticks of `tick_s`; a time below 0 counts as 0.
    ///
    /// What is read only every `grid_ticks` needs a grid as wide, or the response does not change while the delay
    /// grows by less.
    pub(crate) fn new(point: Point, delay_s: f64, tick_s: f64, grid_ticks: usize) -> Self {
        let grid_ticks = grid_ticks.max(1);
        let points = (delay_s / (tick_s * grid_ticks as f64)).clamp(0.0, 1e5);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped above")]
        let whole_ticks = points.floor() as usize * grid_ticks;
        Self { point, grid_ticks, whole_ticks, share: points - points.floor() }
    }
}

impl Term for Delay {
    fn point(&self) -> Point {
        self.point
    }

    fn memory_len(&self) -> usize {
        self.whole_ticks + self.grid_ticks + 2
    }

    fn reset(&self, signal: f64, memory: &mut [f64]) {
        memory.fill(signal);
        memory[0] = 0.0;
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in a short ring")]
    fn apply(&self, signal: f64, _view: &View<'_>, memory: &mut [f64]) -> f64 {
        let (place, ring) = memory.split_at_mut(1);
        let length = ring.len();
        let wrapped = |at: usize| if at >= length { at - length } else { at };
        let newest = wrapped(place[0] as usize + 1);
        place[0] = newest as f64;
        ring[newest] = signal;
        let later = ring[wrapped(newest + length - self.whole_ticks)];
        let earlier = ring[wrapped(newest + length - self.whole_ticks - self.grid_ticks)];
        later + self.share * (earlier - later)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::State;

    fn ramp_after(delay_s: f64, grid_ticks: usize) -> Vec<f64> {
        let delay = Delay::new(Point::Command, delay_s, 1e-3, grid_ticks);
        let mut memory = vec![0.0; delay.memory_len()];
        delay.reset(0.0, &mut memory);
        let state = State::default();
        let view = View {
            time_s: 0.0,
            tick_s: 1e-3,
            state: &state,
            tank_pressure_pa: 6.3e6,
            spool_reading_pu: 0.0,
            servomotor_reading_pu: 0.0,
        };
        (0..60).map(|k| delay.apply(f64::from(k), &view, &mut memory)).collect()
    }

    #[test]
    fn a_ramp_comes_out_later_by_the_delay() {
        for delay_s in [0.0, 4e-4, 1e-3, 7.25e-3, 20e-3] {
            for (grid_ticks, settled) in [(1, 22), (10, 30)] {
                for (k, out) in ramp_after(delay_s, grid_ticks).iter().enumerate().skip(settled) {
                    let expected = k as f64 - delay_s * 1e3;
                    assert!((out - expected).abs() < 1e-9, "{delay_s} s, tick {k}: {out}, not {expected}");
                }
            }
        }
    }
}
