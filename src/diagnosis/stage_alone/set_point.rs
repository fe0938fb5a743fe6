//! A set point with lag: the law of a position loop that is known by its command and its position alone.
//!
//! `dX/dt = (K u(t − d) + c − X) / T`, no faster than a limit each way: gain, level, delay, lag and rate limits (a first-order lag plus dead time: Åström &
//! Hägglund 2006, *Advanced PID Control*, section 2.6). The position follows X behind play, and stops short of where X goes by half of it (the backlash
//! operator: Tao & Kokotović 1996, *Adaptive Control of Systems with Actuator and Sensor Nonlinearities*, chapter 2); a dead band of the loop does the same.
//! Gain and level are linear at a delay and a lag; from the best of a grid, and from slower limits with a shorter lag, all are fitted together to free runs.

mod coordinates;
mod motion;

use nalgebra::DVector;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use self::coordinates::{Axis, LAG_RANGE, MOST_PLAY};
use self::motion::stretches;
use crate::estimation::coordinate::{Judge, Residuals, square, subject_at};
use crate::estimation::fit::{Effort, Start, fit_all};
use crate::stage_alone::run::{Lag, Run, SpoolLaw, mean_spool, solved, travel, typical_s};
use crate::stage_alone::spread::is_gain;

/// Samples that the fit looks at, of all runs together.
const LOOKED_AT: usize = 20_000;
/// Delays on the grid, as shares of a run's length.
const DELAYS: [f64; 6] = [0.0, 0.01, 0.03, 0.06, 0.12, 0.24];
/// Lags on the grid, as shares of a run's length; a lag of several lengths is an integral of the command.
const LAGS: [f64; 10] = [0.0, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.3, 5.0];
/// Time over which speeds are looked at, as a share of a run's length, and the share of them that a limit may begin at.
const SPEED_OVER: f64 = 0.02;
const USUAL_SPEED: f64 = 0.95;
/// Where limits begin, over the usual speed, each with the lag over that of the law without limits.
const STARTS: [(f64, f64); 4] = [(f64::INFINITY, 1.0), (1.0, 0.3), (0.7, 0.3), (1.0, 1.0)];
/// Halves of the play that a fit may begin from, as shares of the position's travel.
const PLAYS: [f64; 5] = [0.005, 0.01, 0.02, 0.04, 0.08];
/// A part that makes the error no smaller than this is not there.
const LEAST_WORTH: f64 = 1e-3;
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
}

impl SetPoint {
    /// Position at each sample of a run from its first; the run holds the command in the spool's place.
    #[must_use]
    pub(crate) fn simulated(&self, run: &Run) -> Vec<f64> {
        let goal = |command: f64| self.gain * command + self.level;
        let mut at = run.opening[0];
        // A loop at rest has gone as near to its goal as its play allows.
        let acting = run.before.iter().rev().find(|(time_s, _)| *time_s <= -self.delay_s).or(run.before.first());
        let acting = acting.filter(|_| self.delay_s > 0.0).map_or(run.spool[0], |(_, command)| *command);
        let mut drive = goal(acting).clamp(at - self.half_play, at + self.half_play);
        let mut all = vec![at];
        stretches(run, self.delay_s, |stretch| {
            drive = self.driven(drive, stretch.ends.map(goal), stretch.length_s);
            at = at.max(drive - self.half_play).min(drive + self.half_play);
            if stretch.is_last {
                all.push(at);
            }
        });
        all
    }

    /// Fits the law with delay, rate limits and play, or as a first-order lag without; none where the command stands still.
    #[must_use]
    pub(crate) fn fitted(runs: &[Run], with_limits: bool) -> Option<Self> {
        let count: usize = runs.iter().map(|run| run.time_s.len()).sum();
        let of = |run: &Run| run.thinned((LOOKED_AT * run.time_s.len()).div_ceil(count.max(1)));
        let runs: Vec<Run> = runs.iter().map(of).filter(|run| run.time_s.len() > 2).collect();
        let linear = Self::linear(&runs, with_limits)?;
        let axes = Axis::all(&runs, &linear, with_limits);
        let data = FreeRuns { runs: &runs, size: 1.0 };
        // Squares about as many as there are samples, so that the fit ends where a sample's worth is gained no more.
        let size_of = |law: &Self| (square(&data.of(law)) / count.max(1) as f64).sqrt();
        let size = size_of(&linear);
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
        let best = data.fitted(&bases, &axes)?;
        // With limits far less may be left, of which a sample's worth is less.
        let data = FreeRuns { runs: &runs, size: size_of(&best).max(f64::MIN_POSITIVE) };
        let best = data.fitted(&[best], &axes)?;
        let best = if with_limits { best.with_play(&data, &axes) } else { best };
        Some(best.without_idle(&data))
    }

    /// The same with play, where that pays for itself between pieces: fitted to every second run, it must predict the others better.
    fn with_play(self, data: &FreeRuns<'_>, axes: &[Axis]) -> Self {
        let travel = travel(data.runs, |run| &run.opening);
        let starts = PLAYS.map(|share| Self { half_play: share * travel, ..self });
        let squares = starts.iter().map(|start| square(&data.of(start)));
        let Some((_, start)) = squares.zip(starts).min_by(|a, b| a.0.total_cmp(&b.0)) else { return self };
        let parts: [Vec<Run>; 2] =
            [0, 1].map(|which| data.runs.iter().skip(which).step_by(2).cloned().collect::<Vec<Run>>());
        let mut gained = Vec::new();
        for which in [0, 1] {
            let [own, other] = [which, 1 - which].map(|part| FreeRuns { runs: &parts[part], size: data.size });
            let Some((without, with)) = own.fitted(&[self], axes).zip(own.fitted(&[start], axes)) else { return self };
            let errors = [without, with].map(|law| other.of(&law).iter().map(DVector::norm).collect::<Vec<f64>>());
            let gain = |(without, with): (&f64, &f64)| (without / with.max(f64::MIN_POSITIVE)).ln();
            gained.push(errors[0].iter().zip(&errors[1]).map(gain).collect());
        }
        match data.fitted(&[start], axes) {
            // Play that is as large as it may be stands for something else.
            Some(law) if pays(&gained) && law.half_play < 0.99 * MOST_PLAY * travel => law,
            _ => self,
        }
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
            let law = Self { gain, level, delay_s, lag_s, rising_limit, falling_limit, half_play: 0.0 };
            (gain.is_finite() && gain != 0.0 && level.is_finite()).then_some((missed, law))
        };
        let found: Vec<(f64, Self)> = grid.par_iter().filter_map(of).collect();
        found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, law)| law)
    }

    /// The same without play, limits, delay and lag that make no difference.
    fn without_idle(self, data: &FreeRuns<'_>) -> Self {
        let none: [fn(&mut Self); 5] = [
            |law| law.half_play = 0.0,
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

/// Whether what is gained in the pieces of two parts, as logarithms of errors, is a gain in both, and beyond the spread between pieces.
fn pays(gained: &[Vec<f64>]) -> bool {
    gained.iter().all(|part| part.iter().sum::<f64>() > 0.0) && is_gain(&gained.concat())
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
mod tests {
    use super::*;

    const LOOP: SetPoint = SetPoint {
        gain: 1.0,
        level: 0.02,
        delay_s: 0.12,
        lag_s: 0.35,
        rising_limit: 0.25,
        falling_limit: 0.18,
        half_play: 0.0,
    };

    /// Free runs of a law under steps of its command, with a little noise.
    fn recorded(law: SetPoint, seed: u64) -> Vec<Run> {
        let mut state = seed;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut command, mut until_s) = (0.5, 0.0);
        let mut run = Run { opening: vec![0.5], ..Run::default() };
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
        assert!(found.half_play == 0.0, "{found:?}");
        let lag = SetPoint::fitted(&recorded(free, 3), false).unwrap();
        assert!(lag.delay_s == 0.0 && near(lag.lag_s, 0.35, 0.05) && near(lag.gain, 1.0, 0.005), "{lag:?}");
    }

    /// The same run in other units of command and position, and by another clock.
    fn in_units(run: &Run, slower: f64, command: f64, position: f64) -> Run {
        Run {
            before: run.before.iter().map(|(t, u)| (slower * t, command * u - 3.0)).collect(),
            time_s: run.time_s.iter().map(|t| slower * t).collect(),
            spool: run.spool.iter().map(|u| command * u - 3.0).collect(),
            opening: run.opening.iter().map(|y| position * y + 20.0).collect(),
        }
    }

    #[test]
    fn play_is_found_where_it_is_in_any_unit_and_clock() {
        for half_play in [0.01, 0.03] {
            let runs = recorded(SetPoint { half_play, ..LOOP }, 5);
            let first = SetPoint::fitted(&runs, true).unwrap();
            // A run begins somewhere in the play, which nobody measured.
            assert!((first.half_play / half_play - 1.0).abs() < 0.1, "{half_play}: {first:?}");
            assert!((first.lag_s / 0.35 - 1.0).abs() < 0.15, "{half_play}: {first:?}");
            for (slower, command, position) in [(10.0, -40.0, 0.02), (0.1, 0.03, -500.0)] {
                let runs: Vec<Run> = runs.iter().map(|run| in_units(run, slower, command, position)).collect();
                let found = SetPoint::fitted(&runs, true).unwrap();
                let same = |found: f64, wanted: f64| (found / wanted - 1.0).abs() < 0.02;
                assert!(same(found.half_play, first.half_play * position.abs()), "{first:?} {found:?}");
                assert!(same(found.lag_s, first.lag_s * slower), "{first:?} {found:?}");
            }
        }
    }
}
