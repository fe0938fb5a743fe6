//! How a position moves to where its command sends it, exactly over each stretch over which that runs straight.

use std::ops::Range;

use super::SetPoint;
use crate::stage_alone::run::{Run, settled};

/// Changes between moving at a limit and settling that there can be over one stretch.
const PHASES: usize = 4;
/// Longest step of integral and valve, as a share of the lag, and most steps in a stretch.
const INTEGRAL_STEP: f64 = 0.25;
const INTEGRAL_STEPS: f64 = 16.0;

/// What the command does, some time ago, over a part of a step between two samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// Its length, s.
    pub length_s: f64,
    /// The command at both ends.
    pub ends: [f64; 2],
    /// Whether a step between samples ends here.
    pub is_last: bool,
}

/// The command as it acts, a delay later, over the steps that end at some rows of what drives a run.
///
/// Between samples it runs straight. A change between two samples with none before and after is a step at the later one: a command that is sent in steps.
pub(super) fn stretches(run: &Run, delay_s: f64, rows: Range<usize>, mut on_stretch: impl FnMut(Stretch)) {
    let (time_s, command): (Vec<f64>, Vec<f64>) = run.driven().into_iter().unzip();
    let last = time_s.len() - 1;
    let is_still = |row: usize| row >= last || command[row] == command[row + 1];
    let is_step = |row: usize| (row == 0 || is_still(row - 1)) && is_still(row + 1);
    // The command is known from the row at or before its time, and as at the beginning before that.
    let mut row = 0;
    for k in rows {
        let (mut from_s, until_s) = (time_s[k - 1] - delay_s, time_s[k] - delay_s);
        if from_s >= until_s {
            // Two samples at one time.
            on_stretch(Stretch { length_s: 0.0, ends: [command[row]; 2], is_last: true });
        }
        while from_s < until_s {
            while row < last && time_s[row + 1] <= from_s {
                row += 1;
            }
            let is_before = from_s < time_s[0];
            let next_s = if is_before { time_s[0] } else { time_s.get(row + 1).copied().unwrap_or(f64::INFINITY) };
            let end_s = until_s.min(next_s);
            let at = |at_s: f64, row: usize| {
                let share = (at_s - time_s[row]) / (time_s[row + 1] - time_s[row]);
                command[row] + share * (command[row + 1] - command[row])
            };
            let ends = if is_before || row == last || is_step(row) {
                [command[row]; 2]
            } else {
                [at(from_s, row), at(end_s, row)]
            };
            on_stretch(Stretch { length_s: end_s - from_s, ends, is_last: end_s >= until_s });
            from_s = end_s;
        }
    }
}

/// What the loop remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LoopState {
    /// Where what drives the position stands.
    pub at: f64,
    /// The regulator's integral, in the position's unit.
    pub integral: f64,
    /// How fast the valve lets it move.
    pub speed: f64,
}

impl SetPoint {
    /// The loop after a time over which the goal runs straight.
    ///
    /// In steps that are short beside the lag the integral, and what a valve is asked for, count as straight (Heun's method); the rest is exact.
    pub(super) fn regulated(&self, mut state: LoopState, [goal, end]: [f64; 2], length_s: f64) -> LoopState {
        let forward = if length_s > 0.0 { self.forward * (end - goal) / length_s } else { 0.0 };
        if (self.integral_s.is_infinite() && self.valve_s <= 0.0) || length_s <= 0.0 {
            let ends = [goal, end].map(|goal| goal + self.lag_s * forward);
            return LoopState { at: self.driven(state.at, ends, length_s), ..state };
        }
        let count = (length_s / (INTEGRAL_STEP * self.lag_s)).ceil().clamp(1.0, INTEGRAL_STEPS);
        let step_s = length_s / count;
        let wanted = |ahead: f64, integral: f64| (ahead + integral) / self.lag_s + forward;
        let limited = |speed: f64| speed.min(self.rising_limit).max(-self.falling_limit);
        let mut k = 0.0;
        while k < count {
            let ends = [k, k + 1.0].map(|k| goal + (end - goal) * k / count);
            let ahead = ends[0] - state.at;
            let speed = wanted(ahead, state.integral);
            let winds = self.winds_up || speed == limited(speed);
            let share = if winds { 0.5 * step_s / self.integral_s } else { 0.0 };
            let middle = state.integral + share * ahead;
            if self.valve_s > 0.0 {
                let asked = limited(speed);
                let there = self.behind_valve(state, [asked; 2], step_s);
                let ahead = ends[1] - there.at;
                let end = limited(wanted(ahead, middle + share * ahead));
                state = self.behind_valve(state, [asked, end], step_s);
            } else {
                state.at = self.driven(state.at, ends.map(|goal| goal + middle + self.lag_s * forward), step_s);
            }
            state.integral = middle + share * (ends[1] - state.at);
            k += 1.0;
        }
        state
    }

    /// The same after a time over which what the valve is asked for runs straight: `τ dv/dt = u − v`, and so `∫ v = ∫ u − τ Δv`.
    fn behind_valve(&self, state: LoopState, asked: [f64; 2], length_s: f64) -> LoopState {
        let speed = settled(state.speed, asked, length_s, self.valve_s);
        let moved = 0.5 * length_s * (asked[0] + asked[1]) - self.valve_s * (speed - state.speed);
        LoopState { at: state.at + moved, speed, ..state }
    }

    /// Where what drives the position stands after a time over which its goal runs straight: at a limit as far as that binds, else settling.
    pub(super) fn driven(&self, mut at: f64, [mut goal, end]: [f64; 2], length_s: f64) -> f64 {
        let (lag_s, mut left_s) = (self.lag_s, length_s);
        if length_s <= 0.0 {
            return at;
        }
        if lag_s <= 0.0 {
            return at + (end - at).min(self.rising_limit * left_s).max(-self.falling_limit * left_s);
        }
        let slope = (end - goal) / length_s;
        let edges =
            [(self.rising_limit * lag_s, self.rising_limit), (-self.falling_limit * lag_s, -self.falling_limit)];
        let beyond = |ahead: f64| edges.into_iter().find(|(edge, _)| ahead.abs() > edge.abs() && ahead * edge > 0.0);
        let mut limit = beyond(goal - at);
        for _ in 0..PHASES {
            let ahead = goal - at;
            let (time_s, next) = if let Some((edge, speed)) = limit {
                // It leaves the limit where the deviation has shrunk to the edge.
                let until_s = (edge - ahead) / (slope - speed);
                let time_s = if until_s > 0.0 { until_s.min(left_s) } else { left_s };
                at += speed * time_s;
                (time_s, None)
            } else {
                // The deviation tends to that of a ramp, which may lie beyond an edge.
                let tends = slope * lag_s;
                let reached = beyond(tends).map(|(edge, speed)| {
                    let until_s = lag_s * ((ahead - tends) / (edge - tends)).ln();
                    (until_s.max(0.0), (edge, speed))
                });
                let (time_s, next) = match reached.filter(|(until_s, _)| *until_s < left_s) {
                    Some((until_s, limit)) => (until_s, Some(limit)),
                    None => (left_s, None),
                };
                at = if time_s > 0.0 { settled(at, [goal, goal + slope * time_s], time_s, lag_s) } else { at };
                (time_s, next)
            };
            (goal, left_s, limit) = (goal + slope * time_s, left_s - time_s, next);
            if left_s <= 0.0 {
                break;
            }
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: SetPoint = SetPoint { gain: 1.0, lag_s: 0.3, rising_limit: 0.25, falling_limit: 0.4, ..SetPoint::NONE };

    /// The same by many small steps.
    fn slowly(mut at: f64, [from, to]: [f64; 2], length_s: f64) -> f64 {
        let steps = 20_000;
        for k in 0..steps {
            let goal = from + (to - from) * (f64::from(k) + 0.5) / f64::from(steps);
            let speed = ((goal - at) / LAW.lag_s).clamp(-LAW.falling_limit, LAW.rising_limit);
            at += speed * length_s / f64::from(steps);
        }
        at
    }

    #[test]
    fn a_stretch_is_exact_at_a_limit_settling_and_between() {
        let ends =
            [[0.5, 0.5], [0.05, 0.05], [-0.6, -0.6], [0.0, 0.9], [0.0, -0.9], [0.5, -0.5], [0.08, 0.1], [0.3, 0.0]];
        for ends in ends {
            for length_s in [0.01, 0.1, 1.0, 3.0] {
                let [fast, slow] = [LAW.driven(0.0, ends, length_s), slowly(0.0, ends, length_s)];
                assert!((fast - slow).abs() < 1e-4, "{ends:?} {length_s}: {fast} {slow}");
            }
        }
    }

    #[test]
    fn what_changes_in_one_step_is_sent_then_and_what_wanders_runs_straight() {
        let run = Run {
            time_s: vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
            spool: vec![0.0, 0.0, 1.0, 1.0, 2.0, 4.0],
            opening: vec![0.0; 6],
            ..Run::default()
        };
        let mut all = Vec::new();
        stretches(&run, 0.5, 1..6, |stretch| all.push(stretch));
        assert_eq!(all.iter().map(|one| one.length_s).sum::<f64>(), 5.0);
        assert_eq!(all.iter().filter(|one| one.is_last).count(), 5);
        let ends: Vec<[f64; 2]> = all.iter().map(|one| one.ends).collect();
        let straight = [[1.0, 1.0], [1.0, 1.5], [1.5, 2.0], [2.0, 3.0]];
        assert_eq!(ends[ends.len() - 5..ends.len() - 4], [[1.0, 1.0]], "the step is at its row: {ends:?}");
        assert_eq!(ends[ends.len() - 4..], straight, "{ends:?}");
        assert!(ends[..ends.len() - 5].iter().all(|ends| ends == &[0.0, 0.0]), "{ends:?}");
    }
}
