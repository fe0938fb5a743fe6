//! A set point with lag: the law of a position loop that is known by its command and its position alone.
//!
//! `V = (e + I) / T + F K du/dt`, `e = K u(t − d) + c − X`, no faster than a limit each way, `dX/dt = V` or, behind a valve's lag, `τ d²X/dt² = V − dX/dt`: gain,
//! level, delay, lag, rate limit, valve lag and feed-forward of speed (a first-order lag plus dead time: Åström & Hägglund 2006, *Advanced PID Control*, section
//! 2.6; the valve: Jelali & Kroll 2003, *Hydraulic Servo-systems*, section 4.3). `dI/dt = e / Tᵢ` is the integral action of a PI regulator, which stands still at
//! a limit unless it winds up (section 3.5 of the former). Derivative action on the position is no part: it lengthens T and shortens τ, and nothing else shows it. The
//! position follows X behind play, and stops short of where X goes by half of it (the backlash operator: Tao & Kokotović 1996, *Adaptive Control of Systems with
//! Actuator and Sensor Nonlinearities*, chapter 2); a dead band of the loop does the same. Gain and level are linear at a delay and a lag; from the best of a
//! grid, and from slower limits with a shorter lag, all are fitted together to free runs.

mod coordinates;
mod motion;
mod parts;

use nalgebra::DVector;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

pub(crate) use self::coordinates::Part;
use self::coordinates::{Axis, LAG_RANGE};
use self::motion::{LoopState, stretches};
use crate::estimation::coordinate::{Judge, Residuals, square, subject_at};
use crate::estimation::fit::{Effort, Start, fit_all};
use crate::stage_alone::run::{Lag, Run, SpoolLaw, mean_spool, solved, typical_s};

/// Samples that the fit looks at, of all runs together.
const LOOKED_AT: usize = 20_000;
/// Delays on the grid, as shares of a run's length.
const DELAYS: [f64; 6] = [0.0, 0.01, 0.03, 0.06, 0.12, 0.24];
/// Lags on the grid, as shares of a run's length; a lag of several lengths is an integral of the command.
const LAGS: [f64; 10] = [0.0, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.3, 5.0];
/// Time over which speeds are looked at, as a share of a run's length, and the share of them that a limit may begin at.
const SPEED_OVER: f64 = 0.02;
const USUAL_SPEED: f64 = 0.95;
/// Where the limit begins, over the usual speed, each with the lag over that of the law without limits.
const STARTS: [(f64, f64); 4] = [(f64::INFINITY, 1.0), (1.0, 0.3), (0.7, 0.3), (1.0, 1.0)];
/// A part that makes the error no smaller than this is not there.
const LEAST_WORTH: f64 = 1e-3;
/// The same of a rate limit, which noise at the greatest speeds may look like.
const LEAST_WORTH_OF_LIMITS: f64 = 1e-2;
/// Enough for the least error.
const EFFORT: Effort = Effort { rounds: 40, refresh: 1, ..Effort::FULL };

/// The law as fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SetPoint {
    /// Position for each unit of the command.
    pub gain: f64,
    /// Position at the command 0.
    pub level: f64,
    /// How late the command acts, s.
    pub delay_s: f64,
    /// Time constant, s.
    pub lag_s: f64,
    /// Greatest speed of the position as it rises, in its unit per second; infinite where none is reached.
    pub rising_limit: f64,
    /// The same as it falls, above 0.
    pub falling_limit: f64,
    /// Half of the play or dead band, in the position's unit.
    pub half_play: f64,
    /// Integral time, s; infinite without integral action.
    pub integral_s: f64,
    /// Whether the integral goes on at a rate limit.
    pub winds_up: bool,
    /// Time constant of the valve inside the loop, s.
    pub valve_s: f64,
    /// Share of the command's speed that goes to the valve beside what the error asks for.
    pub forward: f64,
}

impl SetPoint {
    /// Nothing moves, and nothing holds what would.
    const NONE: Self = Self {
        gain: 0.0,
        level: 0.0,
        delay_s: 0.0,
        lag_s: 0.0,
        rising_limit: f64::INFINITY,
        falling_limit: f64::INFINITY,
        half_play: 0.0,
        integral_s: f64::INFINITY,
        winds_up: false,
        valve_s: 0.0,
        forward: 0.0,
    };

    /// Position at each sample of a run from its first; the run holds the command in the spool's place.
    pub(crate) fn simulated(&self, run: &Run) -> Vec<f64> {
        let goal = |command: f64| self.gain * command + self.level;
        let mut at = run.opening[0];
        // A loop at rest has gone as near to its goal as its play allows.
        let acting = run.before.iter().rev().find(|(time_s, _)| *time_s <= -self.delay_s).or(run.before.first());
        let acting = acting.filter(|_| self.delay_s > 0.0).map_or(run.spool[0], |(_, command)| *command);
        let mut state = self.state_before(run);
        state.at = (goal(acting) + state.integral).clamp(at - self.half_play, at + self.half_play);
        let mut all = vec![at];
        let first = run.before.len() + 1;
        stretches(run, self.delay_s, first..first + run.time_s.len() - 1, |stretch| {
            state = self.regulated(state, stretch.ends.map(goal), stretch.length_s);
            at = at.max(state.at - self.half_play).min(state.at + self.half_play);
            if stretch.is_last {
                all.push(at);
            }
        });
        all
    }

    /// The loop at the beginning of a run, from what the command did before it: at rest at first.
    fn state_before(&self, run: &Run) -> LoopState {
        let goal = |command: f64| self.gain * command + self.level;
        let has_memory = self.integral_s.is_finite() || self.valve_s > 0.0;
        let Some((_, command)) = run.before.first().filter(|_| has_memory) else { return LoopState::default() };
        let mut state = LoopState { at: goal(*command), ..LoopState::default() };
        stretches(run, self.delay_s, 1..run.before.len() + 1, |stretch| {
            state = self.regulated(state, stretch.ends.map(goal), stretch.length_s);
        });
        state
    }

    /// Fits the law with delay, rate limits and play, or as a first-order lag without; none where the command stands still.
    pub(crate) fn fitted(runs: &[Run], with_limits: bool) -> Option<Self> {
        let count: usize = runs.iter().map(|run| run.time_s.len()).sum();
        let of = |run: &Run| run.thinned((LOOKED_AT * run.time_s.len()).div_ceil(count.max(1)));
        let runs: Vec<Run> = runs.iter().map(of).filter(|run| run.time_s.len() > 2).collect();
        let linear = Self::linear(&runs, with_limits)?;
        let axes = Axis::all(&runs, &linear, with_limits);
        let Some(data) = FreeRuns::beside(&linear, &runs) else { return Some(linear) };
        let usual = usual_speed(usual_speeds(&runs));
        let starts = &STARTS[..if with_limits { STARTS.len() } else { 1 }];
        let of = |&(limits, lags): &(f64, f64)| Self {
            lag_s: (lags * linear.lag_s).max(LAG_RANGE.0 * typical_s(&runs)),
            rising_limit: limits * usual,
            falling_limit: limits * usual,
            ..linear
        };
        let bases: Vec<Self> = starts.iter().map(of).collect();
        let law = data.fitted(&bases, &axes)?;
        let law = if with_limits { law.with_parts(&runs, &axes)? } else { law };
        let Some(data) = FreeRuns::beside(&law, &runs) else { return Some(law) };
        Some(law.without_idle(&data, &axes))
    }

    /// The best on the grid without limits.
    fn linear(runs: &[Run], with_delay: bool) -> Option<Self> {
        let length_s = typical_s(runs);
        let delays = &DELAYS[..if with_delay { DELAYS.len() } else { 1 }];
        let grid: Vec<(f64, f64)> =
            delays.iter().flat_map(|delay| LAGS.iter().map(move |lag| (delay * length_s, lag * length_s))).collect();
        let middle = mean_spool(runs);
        let of = |&(delay_s, lag_s): &(f64, f64)| {
            let shapes = |command: f64, _: f64| vec![command - middle, 1.0];
            let law = SpoolLaw { lag: Lag::dead(delay_s), settles_s: Some(lag_s), shapes: &shapes };
            let normals = law.normals(runs);
            let best = solved(normals.iter())?;
            let missed: f64 = normals.iter().map(|normal| normal.missed(&best)).sum();
            let (gain, level) = (best[0], best[1] - best[0] * middle);
            let law = Self { gain, level, delay_s, lag_s, ..Self::NONE };
            (gain.is_finite() && gain != 0.0 && level.is_finite()).then_some((missed, law))
        };
        let found: Vec<(f64, Self)> = grid.par_iter().filter_map(of).collect();
        found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, law)| law)
    }

    /// The same without the parts that make no difference: without each in turn, all else is fitted anew.
    fn without_idle(self, data: &FreeRuns<'_>, axes: &[Axis]) -> Self {
        let least = square(&data.of(&self));
        let is_no_worse = |law: &Self, worth: f64| square(&data.of(law)) <= (1.0 + worth).powi(2) * least;
        let mut law = self;
        for part in Part::OPTIONAL {
            let worth = if part.is_limit() { LEAST_WORTH_OF_LIMITS } else { LEAST_WORTH };
            let other = law.with(part, Self::NONE.value(part));
            if other == law || !law.is_own(part) {
                continue;
            }
            let others: Vec<Axis> = axes.iter().filter(|axis| axis.part != part).copied().collect();
            law = data.fitted(&[other], &others).filter(|other| is_no_worse(other, worth)).unwrap_or(law);
        }
        let at_once = Self { lag_s: 0.0, ..law };
        if is_no_worse(&at_once, LEAST_WORTH) { at_once } else { law }
    }
}

/// The greater of the usual speeds each way; infinite where nothing moves.
fn usual_speed(each_way: [f64; 2]) -> f64 {
    each_way.into_iter().filter(|speed| speed.is_finite()).reduce(f64::max).unwrap_or(f64::INFINITY)
}

/// Usual speed of the position as it rises and as it falls.
fn usual_speeds(runs: &[Run]) -> [f64; 2] {
    let over_s = SPEED_OVER * typical_s(runs);
    let mut speeds: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for run in runs {
        let mut from = 0;
        for to in 1..run.time_s.len() {
            let time_s = run.time_s[to] - run.time_s[from];
            if time_s < over_s || to < from + 2 {
                continue;
            }
            let speed = (run.opening[to] - run.opening[from]) / time_s;
            speeds[usize::from(speed < 0.0)].push(speed.abs());
            from = to;
        }
    }
    speeds.map(|mut speeds| {
        speeds.sort_by(f64::total_cmp);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in the list")]
        let place = (USUAL_SPEED * speeds.len().saturating_sub(1) as f64) as usize;
        speeds.get(place).copied().filter(|speed| *speed > 0.0).unwrap_or(f64::INFINITY)
    })
}

/// Free runs that laws are held against.
struct FreeRuns<'a> {
    runs: &'a [Run],
    /// What counts as a unit of error, in the position's.
    size: f64,
}

impl<'a> FreeRuns<'a> {
    /// By what a law misses: squares about as many as there are samples, so that a fit ends where a sample's worth is gained no more. None where nothing is.
    fn beside(law: &SetPoint, runs: &'a [Run]) -> Option<Self> {
        let count: usize = runs.iter().map(|run| run.time_s.len()).sum();
        let size = (square(&Self { runs, size: 1.0 }.of(law)) / count.max(1) as f64).sqrt();
        (size > 0.0).then_some(Self { runs, size })
    }

    /// The best fit from several starts.
    fn fitted(&self, bases: &[SetPoint], axes: &[Axis]) -> Option<SetPoint> {
        let axes: Vec<Vec<Axis>> =
            bases.iter().map(|base| axes.iter().filter(|axis| axis.acts(base)).copied().collect()).collect();
        let zeros = [0.0; Axis::MOST];
        let starts: Vec<Start<'_, Axis>> = bases
            .iter()
            .zip(&axes)
            .map(|(base, axes)| Start {
                base,
                coordinates: axes,
                positions: &zeros[..axes.len()],
                effort: EFFORT,
                known: None,
            })
            .collect();
        let fits = fit_all(self, &starts);
        let best = fits.iter().zip(&starts).min_by(|a, b| a.0.square.total_cmp(&b.0.square));
        best.map(|(fit, start)| subject_at(start.base, start.coordinates, &fit.positions))
    }

    fn of(&self, law: &SetPoint) -> Residuals {
        let of = |run: &Run| {
            let said = law.simulated(run);
            DVector::from_iterator(
                said.len(),
                said.iter().zip(&run.opening).map(|(said, seen)| (said - seen) / self.size),
            )
        };
        self.runs.iter().map(of).collect()
    }
}

impl Judge<SetPoint> for FreeRuns<'_> {
    fn residuals_of(&self, subjects: &[SetPoint]) -> Vec<Residuals> {
        subjects.par_iter().map(|law| self.of(law)).collect()
    }
}

#[cfg(test)]
mod tests;
