//! Whether one of command and position is the other of some time before: to the bit, or the position but for noise.

use govtwin_model::units::seconds_from_nanos;

use super::impossible::Impossible;
use super::{MOVES_PU_S, STILL_PU};

/// Rows that are compared, from the first change of the command on: 80 s at 100 Hz.
const COMPARED: usize = 8192;
/// Rows back: 0.6 s at 100 Hz, more at less.
const MOST_ROWS: usize = 64;
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

/// Command and position at a time, ns, and whether the ESV has not tripped.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) time_ns: i64,
    pub(super) command: f64,
    pub(super) position: f64,
    pub(super) normal: bool,
}

/// The rows that are compared.
#[derive(Clone, Debug, Default)]
pub(super) struct CopyWatch(Vec<Pair>);

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

    pub(super) fn found(&self) -> Option<Impossible> {
        let of_command = || self.equal(false, |pair| pair.position, |pair| pair.command);
        let of_position = || self.equal(true, |pair| pair.command, |pair| pair.position);
        of_command().or_else(of_position).or_else(|| self.delayed())
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

    /// A position that is the command of some rows before but for noise.
    fn delayed(&self) -> Option<Impossible> {
        let best = |all: &mut dyn Iterator<Item = usize>| {
            let all = all.filter_map(|rows| Some((rows, self.between(rows)?)));
            all.min_by(|a, b| a.1.all.total_cmp(&b.1.all))
        };
        let (near, _) = best(&mut (LEAST_ROWS..=MOST_ROWS).step_by(LEAST_ROWS))?;
        let (rows, between) = best(&mut (near.saturating_sub(LEAST_ROWS).max(LEAST_ROWS)..near + LEAST_ROWS))?;
        let Between { all, noise, lag, rows: moving } = between;
        let delayed =
            moving >= COPY_CHANGES && noise > NOISE_SHARE * all && lag > DIFFERS * noise && all.sqrt() < STILL_PU;
        delayed.then(|| Impossible::Delayed { lag_s: rows as f64 * self.row_s(), apart_pu: all.sqrt(), moving })
    }

    /// The mean time between rows, s.
    fn row_s(&self) -> f64 {
        let [first, .., last] = &self.0[..] else { return 0.0 };
        seconds_from_nanos(last.time_ns.saturating_sub(first.time_ns)) / (self.0.len() - 1) as f64
    }

    /// What is between the position and the command of so many rows before, while that moves.
    fn between(&self, rows: usize) -> Option<Between> {
        let delayed = self.0.iter().zip(self.0.get(rows..)?);
        let (mut all, mut noise, mut lag, mut count) = (0.0, 0.0, 0.0, 0_u64);
        let moves_pu = MOVES_PU_S * self.row_s();
        let share = 1.0 / (1.0 + rows as f64);
        // A lag of first order follows the command of now.
        let follows = |from: f64, pair: &Pair| from + share * (pair.command - from);
        let mut filtered = self.0[..rows].iter().fold(self.0[0].command, follows);
        let mut last: Option<(f64, f64)> = None;
        for (before, here) in delayed {
            filtered = follows(filtered, here);
            let error = here.position - before.command;
            if let Some((command, error_before)) =
                last.filter(|(command, _)| (before.command - command).abs() > moves_pu)
                && here.normal
                && (error * error_before * command).is_finite()
            {
                all += error * error;
                noise += 0.5 * (error - error_before).powi(2);
                lag += (filtered - before.command).powi(2);
                count += 1;
            }
            last = Some((before.command, error));
        }
        let mean = |sum: f64| sum / count as f64;
        (count > 0).then(|| Between { all: mean(all), noise: mean(noise), lag: mean(lag), rows: count })
    }
}

fn is_rounded(value: f64) -> bool {
    let steps = value / ROUNDED_PU;
    !steps.is_finite() || (steps - steps.round()).abs() < 1e-6
}
