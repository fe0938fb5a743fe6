//! Whether one of command and position is the other of some time before: to the bit, or the position but for noise; or the position is the command's mean.

use govtwin_model::units::seconds_from_nanos;

use super::impossible::Impossible;
use super::{MOVES_PU_S, STILL_PU};

/// Rows that are compared, from the first change of the command on: 80 s at 100 Hz.
const COMPARED: usize = 8192;
/// Rows back: 0.6 s at 100 Hz, more at less; and rows of a mean.
const MOST_ROWS: usize = 64;
const MEAN_ROWS: usize = 200;
/// The share of changes, and the least number of them, that make a copy.
const COPY_SHARE: f64 = 0.95;
const COPY_CHANGES: u64 = 50;
/// Values that are whole multiples of this, pu, may be equal because they were rounded.
const ROUNDED_PU: f64 = 1e-4;
/// A delay of so many rows at least is told from the lag of a servomotor, which sums up its flow: what is left is noise by so much, where a lag of first
/// order of that time would leave so many times as much, squared.
const LEAST_ROWS: usize = 4;
const NOISE_SHARE: f64 = 0.75;
const DIFFERS: f64 = 3.0;
/// No servomotor follows so near to anything but itself, pu, root mean square.
const EXACT_PU: f64 = 1e-5;

/// Command, position and spool at a time, ns, and whether the ESV has not tripped.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) time_ns: i64,
    pub(super) command: f64,
    pub(super) position: f64,
    pub(super) spool: f64,
    pub(super) normal: bool,
}

/// The rows that are compared.
#[derive(Clone, Debug, Default)]
pub(super) struct CopyWatch(Vec<Pair>);

/// What a position may be of the command of some rows before and of now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Filter {
    Delay,
    Mean,
}

/// Mean squares of what is between a position and a command of before: all of it, its noise, and what a lag of first order would add; of so many rows.
#[derive(Clone, Copy, Debug)]
struct Between {
    all: f64,
    noise: f64,
    lag: f64,
    rows: u64,
}

impl CopyWatch {
    pub(super) fn take(&mut self, pair: Pair) {
        if matches!(&self.0[..], [only] if only.command.to_bits() == pair.command.to_bits()) {
            self.0.clear();
        }
        if self.0.len() < COMPARED {
            self.0.push(pair);
        }
    }

    pub(super) fn rows(&self) -> &[Pair] {
        &self.0
    }

    pub(super) fn found(&self) -> Option<Impossible> {
        let of_command = || self.equal(false, |pair| pair.position, |pair| pair.command);
        let of_position = || self.equal(true, |pair| pair.command, |pair| pair.position);
        let filtered = || self.filtered(Filter::Delay).or_else(|| self.filtered(Filter::Mean));
        of_command().or_else(of_position).or_else(filtered)
    }

    /// A signal that is the other of some rows before to the bit; `of_position` where the signal is the command.
    fn equal(&self, of_position: bool, signal: fn(&Pair) -> f64, other: fn(&Pair) -> f64) -> Option<Impossible> {
        let (mut changes, mut hits) = (0, [(0_u64, 0.0); MOST_ROWS]);
        for (last, pair) in self.0.windows(2).enumerate() {
            let value = signal(&pair[1]);
            if value.to_bits() == signal(&pair[0]).to_bits() || is_rounded(value) {
                continue;
            }
            changes += 1;
            let before = self.0[..=last].iter().rev().take(MOST_ROWS);
            let found = before.enumerate().find(|(_, before)| other(before).to_bits() == value.to_bits());
            if let Some((rows, before)) = found {
                hits[rows].0 += 1;
                hits[rows].1 += seconds_from_nanos(pair[1].time_ns.saturating_sub(before.time_ns));
            }
        }
        let equal: u64 = hits.iter().map(|(count, _)| count).sum();
        // A value that stayed is found too near: the commonest distance is the lag.
        let (count, lags_s) = hits.into_iter().max_by_key(|(count, _)| *count)?;
        let copied = changes >= COPY_CHANGES && equal as f64 > COPY_SHARE * changes as f64;
        copied.then_some(Impossible::LateCopy { of_position, lag_s: lags_s / count.max(1) as f64, equal, changes })
    }

    /// A position that is the command of some rows before, or its mean over them, but for noise.
    fn filtered(&self, filter: Filter) -> Option<Impossible> {
        let best = |all: &mut dyn Iterator<Item = usize>| {
            let all = all.filter_map(|rows| Some((rows, self.between(rows, filter)?)));
            all.min_by(|a, b| a.1.all.total_cmp(&b.1.all))
        };
        let most = if filter == Filter::Mean { MEAN_ROWS } else { MOST_ROWS };
        let (near, _) = best(&mut (LEAST_ROWS..=most).step_by(LEAST_ROWS))?;
        let (rows, between) = best(&mut (near.saturating_sub(LEAST_ROWS).max(LEAST_ROWS)..near + LEAST_ROWS))?;
        let Between { all, noise, lag, rows: moving } = between;
        let is_noise = noise > NOISE_SHARE * all || all.sqrt() < EXACT_PU;
        let is_filtered = moving >= COPY_CHANGES && is_noise && lag > DIFFERS * noise && all.sqrt() < STILL_PU;
        let (over_s, apart_pu) = (rows as f64 * self.row_s(), all.sqrt());
        is_filtered.then_some(Impossible::Filtered { filter, over_s, apart_pu, moving })
    }

    /// The mean time between rows, s.
    fn row_s(&self) -> f64 {
        let [first, .., last] = &self.0[..] else { return 0.0 };
        seconds_from_nanos(last.time_ns.saturating_sub(first.time_ns)) / (self.0.len() - 1) as f64
    }

    /// What is between the position and a filter of the command over so many rows, while that moves.
    fn between(&self, rows: usize, filter: Filter) -> Option<Between> {
        let delayed = self.0.iter().zip(self.0.get(rows..)?);
        let (mut all, mut noise, mut lag, mut count) = (0.0, 0.0, 0.0, 0_u64);
        let moves_pu = MOVES_PU_S * self.row_s();
        // A lag of first order, as late as the filter, follows the command of now.
        let late_rows = if filter == Filter::Mean { 0.5 * rows as f64 } else { rows as f64 };
        let share = 1.0 / (1.0 + late_rows);
        let follows = |from: f64, pair: &Pair| from + share * (pair.command - from);
        let mut lagged = self.0[..rows].iter().fold(self.0[0].command, follows);
        let mut sum: f64 = self.0[..rows].iter().map(|pair| pair.command).sum();
        let mut last: Option<(f64, f64)> = None;
        for (before, here) in delayed {
            lagged = follows(lagged, here);
            sum += here.command - before.command;
            let filtered = if filter == Filter::Mean { sum / rows as f64 } else { before.command };
            let error = here.position - filtered;
            if let Some((_, error_before)) = last.filter(|(before, _)| (filtered - before).abs() > moves_pu)
                && here.normal
                && (error * error_before).is_finite()
            {
                all += error * error;
                noise += 0.5 * (error - error_before).powi(2);
                lag += (lagged - filtered).powi(2);
                count += 1;
            }
            last = Some((filtered, error));
        }
        let mean = |sum: f64| sum / count as f64;
        (count > 0).then(|| Between { all: mean(all), noise: mean(noise), lag: mean(lag), rows: count })
    }
}

fn is_rounded(value: f64) -> bool {
    let steps = value / ROUNDED_PU;
    !steps.is_finite() || (steps - steps.round()).abs() < 1e-6
}
