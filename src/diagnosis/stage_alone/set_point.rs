//! A set point with lag: the law of a position loop that is known by its command and its position alone.
//!
//! `dY/dt = (K u(t − d) + c − Y) / T`, no faster than a limit each way: gain, level, delay, lag and rate limits (a first-order lag plus dead time: Åström &
//! Hägglund 2006, *Advanced PID Control*, section 2.6). Gain and level are linear at a delay and a lag; from the best of a grid, and from slower limits
//! with a shorter lag, all are fitted together to free runs.

use nalgebra::DVector;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::estimation::coordinate::{Coordinate, Judge, Residuals, square, subject_at};
use crate::estimation::fit::{Effort, Start, fit_all};
use crate::stage_alone::run::{Lag, Run, SpoolLaw, mean_spool, settled, solved, typical_s};

/// Samples that the fit looks at, of all runs together.
const LOOKED_AT: usize = 20_000;
/// Delays on the grid, as shares of a run's length.
const DELAYS: [f64; 6] = [0.0, 0.01, 0.03, 0.06, 0.12, 0.24];
/// Lags on the grid, as shares of a run's length; a lag of several lengths is an integral of the command.
const LAGS: [f64; 10] = [0.0, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.3, 5.0];
/// Least and greatest lag, and greatest delay, as shares of a run's length.
const LAG_RANGE: (f64, f64) = (1e-3, 10.0);
const MOST_DELAY: f64 = 0.5;
/// Time over which speeds are looked at, as a share of a run's length, and the share of them that a limit may begin at.
const SPEED_OVER: f64 = 0.02;
const USUAL_SPEED: f64 = 0.95;
/// Where limits begin, over the usual speed, each with the lag over that of the law without limits.
const STARTS: [(f64, f64); 4] = [(f64::INFINITY, 1.0), (1.0, 0.3), (0.7, 0.3), (1.0, 1.0)];
/// A part that makes the error no smaller than this is not there.
const LEAST_WORTH: f64 = 1e-3;
/// Enough for the least error.
const EFFORT: Effort = Effort { rounds: 40, refresh: 1, temperature: 1.0 };

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
}

impl SetPoint {
    /// Position at each sample of a run from its first; the run holds the command in the spool's place.
    #[must_use]
    pub(crate) fn simulated(&self, run: &Run) -> Vec<f64> {
        let command = run.lagged(Lag::Dead(self.delay_s));
        let goal = |k: usize| self.gain * command[k] + self.level;
        let mut at = run.opening[0];
        let mut all = vec![at];
        for k in 1..run.time_s.len() {
            let step_s = run.time_s[k] - run.time_s[k - 1];
            let wanted = settled(at, [goal(k - 1), goal(k)], step_s, self.lag_s) - at;
            let most = |limit: f64| (limit * step_s).max(0.0);
            at += wanted.min(most(self.rising_limit)).max(-most(self.falling_limit));
            all.push(at);
        }
        all
    }

    /// Fits the law with delay and rate limits, or as a first-order lag without; none where the command stands still.
    #[must_use]
    pub(crate) fn fitted(runs: &[Run], with_limits: bool) -> Option<Self> {
        let count: usize = runs.iter().map(|run| run.time_s.len()).sum();
        let of = |run: &Run| run.thinned((LOOKED_AT * run.time_s.len()).div_ceil(count.max(1)));
        let runs: Vec<Run> = runs.iter().map(of).filter(|run| run.time_s.len() > 2).collect();
        let linear = Self::linear(&runs, with_limits)?;
        let axes = Axis::all(&runs, &linear, with_limits);
        let data = FreeRuns { runs: &runs, size: 1.0 };
        // Squares about as many as there are samples, so that the fit ends where a sample's worth is gained no more.
        let size = (square(&data.of(&linear)) / count.max(1) as f64).sqrt();
        if size <= 0.0 {
            return Some(linear);
        }
        let data = FreeRuns { runs: &runs, size };
        let speeds = usual_speeds(&runs);
        let starts = &STARTS[..if with_limits { STARTS.len() } else { 1 }];
        let of = |&(limits, lags): &(f64, f64)| Self {
            lag_s: (lags * linear.lag_s).max(LAG_RANGE.0 * typical_s(&runs)),
            rising_limit: limits * speeds[0],
            falling_limit: limits * speeds[1],
            ..linear
        };
        let bases: Vec<Self> = starts.iter().map(of).collect();
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
        let fits = fit_all(&data, &starts);
        let found = fits.iter().zip(&starts).min_by(|a, b| a.0.square.total_cmp(&b.0.square))?;
        let best = subject_at(found.1.base, found.1.coordinates, &found.0.positions);
        Some(best.without_idle(&data))
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
            let law = SpoolLaw { lag: Lag::Dead(delay_s), settles_s: Some(lag_s), shapes: &shapes };
            let normals = law.normals(runs);
            let best = solved(normals.iter())?;
            let missed: f64 = normals.iter().map(|normal| normal.missed(&best)).sum();
            let (gain, level) = (best[0], best[1] - best[0] * middle);
            let (rising_limit, falling_limit) = (f64::INFINITY, f64::INFINITY);
            let law = Self { gain, level, delay_s, lag_s, rising_limit, falling_limit };
            (gain.is_finite() && gain != 0.0 && level.is_finite()).then_some((missed, law))
        };
        let found: Vec<(f64, Self)> = grid.par_iter().filter_map(of).collect();
        found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, law)| law)
    }

    /// The same without limits, delay and lag that make no difference.
    fn without_idle(self, data: &FreeRuns<'_>) -> Self {
        let none: [fn(&mut Self); 4] = [
            |law| law.rising_limit = f64::INFINITY,
            |law| law.falling_limit = f64::INFINITY,
            |law| law.delay_s = 0.0,
            |law| law.lag_s = 0.0,
        ];
        let allowed = (1.0 + LEAST_WORTH).powi(2) * square(&data.of(&self));
        let mut law = self;
        for none in none {
            let mut other = law;
            none(&mut other);
            if square(&data.of(&other)) <= allowed {
                law = other;
            }
        }
        law
    }
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

impl FreeRuns<'_> {
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

/// What is turned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Gain,
    Level,
    Lag,
    Delay,
    Rising,
    Falling,
}

/// One number of the law, in steps of its own.
#[derive(Clone, Copy, Debug)]
struct Axis {
    part: Part,
    /// A step: of gain, level and delay in their unit, of the others as a logarithm.
    step: f64,
    /// Between which values, in the number's unit.
    range: (f64, f64),
    /// The command about which the gain turns.
    middle: f64,
}

impl Axis {
    const MOST: usize = 6;

    fn all(runs: &[Run], start: &SetPoint, with_limits: bool) -> Vec<Self> {
        let length_s = typical_s(runs);
        let travel = |of: fn(&Run) -> &Vec<f64>| {
            let values = runs.iter().flat_map(|run| of(run).iter());
            let ends = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
            ends.1 - ends.0
        };
        let (command, opening) = (travel(|run| &run.spool), travel(|run| &run.opening));
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let axis = |part, step, range| Self { part, step, range, middle: mean_spool(runs) };
        let speeds = usual_speeds(runs).map(|speed| (0.05 * speed, 20.0 * speed));
        let mut axes = vec![
            axis(Part::Gain, 0.05 * (opening / command).max(start.gain.abs()), all),
            axis(Part::Level, 0.05 * opening.max(command * start.gain.abs()), all),
            axis(Part::Lag, 0.2, (LAG_RANGE.0 * length_s, LAG_RANGE.1 * length_s)),
        ];
        if with_limits {
            axes.push(axis(Part::Delay, 0.02 * length_s, (0.0, MOST_DELAY * length_s)));
            axes.push(axis(Part::Rising, 0.2, speeds[0]));
            axes.push(axis(Part::Falling, 0.2, speeds[1]));
        }
        axes
    }

    /// Whether it turns anything from there.
    fn acts(&self, base: &SetPoint) -> bool {
        self.value(base).is_finite()
    }

    fn value(&self, law: &SetPoint) -> f64 {
        match self.part {
            Part::Gain => law.gain,
            Part::Level => law.level,
            Part::Lag => law.lag_s,
            Part::Delay => law.delay_s,
            Part::Rising => law.rising_limit,
            Part::Falling => law.falling_limit,
        }
    }

    fn is_logarithmic(&self) -> bool {
        matches!(self.part, Part::Lag | Part::Rising | Part::Falling)
    }
}

impl Coordinate for Axis {
    type Subject = SetPoint;

    fn range(&self, base: &SetPoint) -> (f64, f64) {
        let value = self.value(base);
        let place =
            |end: f64| if self.is_logarithmic() { (end / value).ln() / self.step } else { (end - value) / self.step };
        (place(self.range.0).min(0.0), place(self.range.1).max(0.0))
    }

    fn prior_centre(&self) -> Option<f64> {
        None
    }

    fn turn(&self, base: &SetPoint, law: &mut SetPoint, position: f64) {
        let by = self.step * position;
        match self.part {
            Part::Gain => {
                law.gain = base.gain + by;
                law.level -= by * self.middle;
            }
            Part::Level => law.level += by,
            Part::Lag => law.lag_s = base.lag_s * by.exp(),
            Part::Delay => law.delay_s = (base.delay_s + by).max(0.0),
            Part::Rising => law.rising_limit = base.rising_limit * by.exp(),
            Part::Falling => law.falling_limit = base.falling_limit * by.exp(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOP: SetPoint =
        SetPoint { gain: 1.0, level: 0.02, delay_s: 0.12, lag_s: 0.35, rising_limit: 0.25, falling_limit: 0.18 };

    /// Free runs of a law under steps of its command, with a little noise.
    fn recorded(law: SetPoint, seed: u64) -> Vec<Run> {
        let mut state = seed;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut command, mut until_s) = (0.5, 0.0);
        let mut run = Run { time_s: vec![], spool: vec![], opening: vec![0.5] };
        for k in 0..6000 {
            let time_s = f64::from(k) * 0.02;
            if time_s >= until_s {
                (command, until_s) = (0.2 + 0.6 * random(), time_s + 1.0 + 4.0 * random());
            }
            run.time_s.push(time_s);
            run.spool.push(command);
        }
        run.opening = law.simulated(&run);
        run.opening.iter_mut().for_each(|y| *y += 1e-3 * (random() - 0.5));
        run.windows(10.0)
    }

    #[test]
    fn gain_delay_lag_and_limits_of_a_loop_are_found() {
        let near = |found: f64, wanted: f64, share: f64| (found / wanted - 1.0).abs() < share;
        let found = SetPoint::fitted(&recorded(LOOP, 1), true).unwrap();
        assert!(near(found.gain, 1.0, 0.01) && (found.level - 0.02).abs() < 0.01, "{found:?}");
        assert!(near(found.delay_s, 0.12, 0.15) && near(found.lag_s, 0.35, 0.1), "{found:?}");
        assert!(near(found.rising_limit, 0.25, 0.05) && near(found.falling_limit, 0.18, 0.05), "{found:?}");
        // What is not there is not found.
        let free = SetPoint { delay_s: 0.0, rising_limit: f64::INFINITY, falling_limit: f64::INFINITY, ..LOOP };
        let found = SetPoint::fitted(&recorded(free, 2), true).unwrap();
        assert!(found.rising_limit.is_infinite() && found.falling_limit.is_infinite(), "{found:?}");
        assert!(found.delay_s < 0.03 && near(found.lag_s, 0.35, 0.05) && near(found.gain, 1.0, 0.005), "{found:?}");
        let lag = SetPoint::fitted(&recorded(free, 3), false).unwrap();
        assert!(lag.delay_s == 0.0 && near(lag.lag_s, 0.35, 0.05) && near(lag.gain, 1.0, 0.005), "{lag:?}");
    }
}
