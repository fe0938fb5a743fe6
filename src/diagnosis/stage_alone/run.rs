//! A free run as laws without physics see it: time, spool and servomotor in whatever unit, and what a law of the spool makes of them.
//!
//! A law is linear in its coefficients: shapes of the spool, some time ago, whose sum is the speed, or what the position settles to. Its best fit
//! is found at once, and so are fits that leave runs out (the output-error form: Ljung 1999, *System Identification*, section 4.2).

use nalgebra::{DMatrix, DVector};

use crate::likelihood::prepared::{PreparedRecording, is_held};
use govtwin_model::frame::Frame;
use govtwin_model::recording::Recording;
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// Lags of the spool that are tried, as shares of a run's length.
const LAG_SHARES: [f64; 8] = [0.0, 0.003, 0.006, 0.012, 0.02, 0.03, 0.05, 0.08];

/// Weight of the ridge that keeps shapes which never act from standing for anything.
const RIDGE: f64 = 1e-9;

/// How much of what drove it before a free run is looked at, as a share of the run's length: several times any lag that is usual in it.
pub(crate) const LEAD: f64 = 0.5;

/// The same where it is known, for what remembers longer: a regulator's integral.
pub(crate) const HISTORY: f64 = 2.0;

/// How what the spool does comes late: as it is but later, and then settling to that.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lag {
    /// Dead time, s.
    pub delay_s: f64,
    /// Time constant, s.
    pub constant_s: f64,
}

impl Lag {
    /// Later, and nothing else, s.
    pub fn dead(delay_s: f64) -> Self {
        Self { delay_s, constant_s: 0.0 }
    }

    /// Settling at once, s.
    pub fn settling(constant_s: f64) -> Self {
        Self { delay_s: 0.0, constant_s }
    }

    /// No lag, and the lags that are tried in runs of a length, s.
    pub fn tried(length_s: f64) -> impl Iterator<Item = Self> {
        let lags = move |kind: fn(f64) -> Self| LAG_SHARES.into_iter().map(move |share| kind(share * length_s));
        lags(Self::dead).chain(lags(Self::settling).skip(1))
    }

    /// Whether it has a dead time, if only of 0 where it has nothing else.
    pub(crate) fn has_delay(self) -> bool {
        self.delay_s > 0.0 || self.constant_s <= 0.0
    }

    /// By how much it comes late in the end, s.
    pub fn time_s(self) -> f64 {
        self.delay_s + self.constant_s
    }
}

/// One free run, in the units of its recording.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Time, below 0, and spool position before its beginning, where they are known: what comes late has a history.
    pub before: Vec<(f64, f64)>,
    /// Time since its beginning, s.
    pub time_s: Vec<f64>,
    /// Spool position at each sample.
    pub spool: Vec<f64>,
    /// Servomotor position at each sample.
    pub opening: Vec<f64>,
}

impl Run {
    /// The samples of a recording that hold both positions; none where there are fewer than three.
    pub fn of(recording: &PreparedRecording) -> Option<Self> {
        let positions = [Signal::SpoolPosition, Signal::ServomotorPosition];
        Self::read(recording, |frame| positions.map(|signal| signal.of(&frame.measured)))
    }

    /// The same of what else is read off a sample for spool and servomotor.
    pub(crate) fn read(recording: &PreparedRecording, both: impl Fn(&Frame) -> [f64; 2]) -> Option<Self> {
        let mut run = Self::default();
        let first = recording.samples.iter().map(|&row| &recording.frames[row]).find(|frame| is_whole(both(frame)))?;
        let since_s = |frame: &Frame| seconds_from_nanos(frame.time_ns - first.time_ns);
        for &row in &recording.samples {
            let frame = &recording.frames[row];
            let [spool, opening] = both(frame);
            if is_whole([spool, opening]) {
                run.time_s.push(since_s(frame));
                run.spool.push(spool);
                run.opening.push(opening);
            }
        }
        let frames = &recording.frames;
        let before = (0..frames.len()).take_while(|&row| frames[row].time_ns < first.time_ns);
        // A run is of rows as they were recorded: that they are held is half a row more of its lag.
        let before = before.filter(|&row| !is_held(frames, row)).map(|row| &frames[row]);
        let known = before.map(|frame| (since_s(frame), both(frame)[0])).filter(|(_, spool)| spool.is_finite());
        run.before.extend(known);
        (run.time_s.len() > 2).then_some(run)
    }

    /// Those of several recordings.
    pub fn all(recordings: &[PreparedRecording]) -> Vec<Self> {
        recordings.iter().filter_map(Self::of).collect()
    }

    /// Those of pieces whose every row holds a spool position.
    pub(crate) fn of_pieces(pieces: Vec<Recording>) -> Vec<Self> {
        pieces.into_iter().filter_map(|piece| Self::of(&PreparedRecording::free_run(piece))).collect()
    }

    /// Its length, s.
    pub fn length_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or(0.0)
    }

    /// The spool as it acts at each sample, behind a lag; straight between samples, and as at the beginning before it.
    pub(crate) fn lagged(&self, lag: Lag) -> Vec<f64> {
        let mut driven = self.driven();
        settle(&mut driven, lag.constant_s);
        if lag.delay_s > 0.0 {
            return self.earlier(&driven, lag.delay_s);
        }
        driven[self.before.len()..].iter().map(|(_, spool)| *spool).collect()
    }

    /// Time and spool from before the beginning to the end.
    pub(crate) fn driven(&self) -> Vec<(f64, f64)> {
        let own = self.time_s.iter().copied().zip(self.spool.iter().copied());
        self.before.iter().copied().chain(own).collect()
    }

    /// What drove it a while ago.
    fn earlier(&self, driven: &[(f64, f64)], lag_s: f64) -> Vec<f64> {
        let mut next = 0;
        let at = |time_s: &f64| {
            let time_s = time_s - lag_s;
            while next < driven.len() && driven[next].0 <= time_s {
                next += 1;
            }
            // A lag that rounds away leaves the last sample at its own time.
            if next == 0 || next == driven.len() {
                return driven[next.saturating_sub(1)].1;
            }
            let [(from_s, from), (to_s, to)] = [driven[next - 1], driven[next]];
            from + (time_s - from_s) / (to_s - from_s) * (to - from)
        };
        self.time_s.iter().map(at).collect()
    }

    /// Free runs of a length, one behind another, each from its own measured start, without what is left over at the end, s.
    pub fn windows(&self, length_s: f64) -> Vec<Self> {
        let mut all = Vec::new();
        let mut from = 0;
        for k in 0..self.time_s.len() {
            if self.time_s[k] - self.time_s[from] < length_s {
                continue;
            }
            if k - from > 1 {
                let lead = from - self.time_s[..from].partition_point(|t| self.time_s[from] - t > HISTORY * length_s);
                all.push(Self {
                    before: (from - lead..from)
                        .map(|row| (self.time_s[row] - self.time_s[from], self.spool[row]))
                        .collect(),
                    time_s: self.time_s[from..=k].iter().map(|time_s| time_s - self.time_s[from]).collect(),
                    spool: self.spool[from..=k].to_vec(),
                    opening: self.opening[from..=k].to_vec(),
                });
            }
            from = k;
        }
        all
    }

    /// Every so many samples, so that no more than about `most` are left.
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        let every = self.time_s.len().div_ceil(most.max(3)).max(1);
        let of = |all: &[f64]| all.iter().step_by(every).copied().collect();
        let mut before: Vec<(f64, f64)> = self.before.iter().rev().skip(every - 1).step_by(every).copied().collect();
        before.reverse();
        Self { before, time_s: of(&self.time_s), spool: of(&self.spool), opening: of(&self.opening) }
    }
}

fn is_whole(both: [f64; 2]) -> bool {
    both.iter().all(|value| value.is_finite())
}

/// Puts what settles to values in their place, exact where they run straight between samples.
fn settle(driven: &mut [(f64, f64)], constant_s: f64) {
    if constant_s <= 0.0 {
        return;
    }
    let (mut from_s, mut from) = driven[0];
    let mut at = from;
    for (to_s, value) in &mut driven[1..] {
        at = settled(at, [from, *value], *to_s - from_s, constant_s);
        (from_s, from) = (*to_s, std::mem::replace(value, at));
    }
}

/// Where a first-order lag stands after a step of time over which its goal runs straight from one value to another.
pub(crate) fn settled(at: f64, [from, to]: [f64; 2], step_s: f64, constant_s: f64) -> f64 {
    if constant_s <= 0.0 || step_s <= 0.0 {
        return to;
    }
    let behind = constant_s * (to - from) / step_s;
    to - behind + (-step_s / constant_s).exp() * (at - from + behind)
}

/// Mean of what drives runs.
pub(crate) fn mean_spool(runs: &[Run]) -> f64 {
    let spools = || runs.iter().flat_map(|run| run.spool.iter());
    spools().sum::<f64>() / spools().count().max(1) as f64
}

/// Greatest less least of what runs hold.
pub(crate) fn travel(runs: &[Run], of: fn(&Run) -> &Vec<f64>) -> f64 {
    let values = runs.iter().flat_map(|run| of(run).iter());
    let ends = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    ends.1 - ends.0
}

/// Typical length of runs, s.
pub(crate) fn typical_s(runs: &[Run]) -> f64 {
    let mut lengths: Vec<f64> = runs.iter().map(Run::length_s).collect();
    lengths.sort_by(f64::total_cmp);
    lengths.get(lengths.len() / 2).copied().unwrap_or(0.0)
}

/// A law of the spool.
pub struct SpoolLaw<'a> {
    /// How late the spool acts.
    pub lag: Lag,
    /// Time in which the position settles to what the shapes say, s; none where they are its speed.
    pub settles_s: Option<f64>,
    /// Shapes of spool position, and of the position at the beginning.
    pub shapes: &'a dyn Fn(f64, f64) -> Vec<f64>,
}

/// The normal equations of a law in one run.
#[derive(Clone, Debug)]
pub struct RunEquations {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Sum of squares of what the law is to explain.
    square: f64,
    /// Number of samples in it.
    pub count: usize,
}

impl SpoolLaw<'_> {
    /// Calls back with what each coefficient adds to the position by each sample but the first, and what is to be explained there.
    fn each(&self, run: &Run, on_sample: &mut dyn FnMut(&[f64], f64)) {
        let spool = run.lagged(self.lag);
        let start = run.opening[0];
        let mut sums: Vec<f64> = Vec::new();
        let mut left = start;
        for k in 1..run.time_s.len() {
            let step_s = run.time_s[k] - run.time_s[k - 1];
            let values = (self.shapes)(0.5 * (spool[k - 1] + spool[k]), start);
            sums.resize(values.len(), 0.0);
            let (decay, gain) = match self.settles_s {
                None => (1.0, step_s),
                Some(settles_s) => {
                    let decay = if settles_s > 0.0 { (-step_s / settles_s).exp() } else { 0.0 };
                    (decay, 1.0 - decay)
                }
            };
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum = decay * *sum + gain * value;
            }
            left *= decay;
            on_sample(&sums, run.opening[k] - left);
        }
    }

    /// Its normal equations in each run.
    pub(crate) fn normals(&self, runs: &[Run]) -> Vec<RunEquations> {
        let width = (self.shapes)(0.0, 0.0).len();
        let of = |run: &Run| {
            let mut normal = RunEquations {
                hessian: DMatrix::zeros(width, width),
                gradient: DVector::zeros(width),
                square: 0.0,
                count: run.time_s.len() - 1,
            };
            self.each(run, &mut |sums, goal| {
                let row = DVector::from_column_slice(sums);
                normal.gradient.axpy(goal, &row, 1.0);
                normal.hessian.ger(1.0, &row, &row, 1.0);
                normal.square += goal * goal;
            });
            normal
        };
        runs.iter().map(of).collect()
    }

    /// What it residuals in a run with these coefficients, sample by sample from the second.
    pub fn residuals(&self, run: &Run, coefficients: &DVector<f64>) -> Vec<f64> {
        let mut residuals = Vec::with_capacity(run.time_s.len());
        self.each(run, &mut |sums, goal| {
            residuals.push(goal - sums.iter().zip(coefficients.iter()).map(|(a, b)| a * b).sum::<f64>());
        });
        residuals
    }
}

impl RunEquations {
    /// Sum of squares that the run residuals with these coefficients.
    pub fn missed(&self, coefficients: &DVector<f64>) -> f64 {
        let said = coefficients.dot(&(&self.hessian * coefficients));
        (self.square - 2.0 * coefficients.dot(&self.gradient) + said).max(0.0)
    }
}

/// The coefficients that are best for some runs; none where nothing determines them.
pub fn solved<'a>(normals: impl Iterator<Item = &'a RunEquations>) -> Option<DVector<f64>> {
    let (hessian, gradient) = summed(normals)?;
    solution(&hessian, &gradient)
}

/// Normal equations of several runs together.
fn summed<'a>(normals: impl Iterator<Item = &'a RunEquations>) -> Option<(DMatrix<f64>, DVector<f64>)> {
    normals
        .map(|normal| (normal.hessian.clone(), normal.gradient.clone()))
        .reduce(|one, other| (one.0 + other.0, one.1 + other.1))
}

fn solution(hessian: &DMatrix<f64>, gradient: &DVector<f64>) -> Option<DVector<f64>> {
    let width = gradient.len();
    // Each shape by its own size, so that the ridge means the same in every unit.
    let sizes = DVector::from_fn(width, |k, _| hessian[(k, k)].max(0.0).sqrt().max(f64::MIN_POSITIVE.sqrt()));
    let scaled = DMatrix::from_fn(width, width, |i, j| hessian[(i, j)] / (sizes[i] * sizes[j]));
    let best = (scaled + DMatrix::identity(width, width) * RIDGE).cholesky()?.solve(&gradient.component_div(&sizes));
    Some(best.component_div(&sizes))
}

/// Sum of squares that is missed in each run by a fit to the others; a single run is judged by its own.
pub fn left_out(normals: &[RunEquations]) -> Option<f64> {
    let (hessian, gradient) = summed(normals.iter())?;
    let mut missed = 0.0;
    for normal in normals {
        let best = match normals.len() {
            1 => solution(&hessian, &gradient),
            _ => solution(&(&hessian - &normal.hessian), &(&gradient - &normal.gradient)),
        };
        missed += normal.missed(&best?);
    }
    Some(missed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fit may end at a lag of next to nothing.
    #[test]
    fn a_lag_that_rounds_away_is_none() {
        let run =
            Run { time_s: vec![0.0, 0.5, 60.0], spool: vec![0.0, 0.2, 0.7], opening: vec![0.0; 3], ..Run::default() };
        assert_eq!(run.lagged(Lag::dead(1e-18)), run.spool);
        assert_eq!(run.lagged(Lag::dead(0.5)), [0.0, 0.0, 0.2 + 0.5 * 59.0 / 59.5]);
    }

    #[test]
    fn a_dead_time_before_a_lag_is_the_lag_later() {
        let time_s: Vec<f64> = (0..40).map(|k| 0.1 * f64::from(k)).collect();
        let run =
            Run { spool: time_s.iter().map(|t| t.sin()).collect(), opening: time_s.clone(), time_s, ..Run::default() };
        let [late, both] = [Lag::settling(0.4), Lag { delay_s: 0.3, constant_s: 0.4 }].map(|lag| run.lagged(lag));
        assert!(late.iter().zip(&both[3..]).all(|(late, both)| (late - both).abs() < 1e-9), "{late:?} {both:?}");
    }
}
