//! All signals on one grid, by straight lines between neighbours: only where the map asks for it, and said.

use std::collections::VecDeque;

use super::row::{ImportedRow, Target};
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

/// Between neighbours that lie further apart than this nothing is drawn, ns.
const WIDEST_NS: i64 = 2_000_000_000;

/// The last sample of a signal.
#[derive(Clone, Copy, Debug)]
struct LastSample {
    time_ns: i64,
    value: f64,
}

/// Puts rows of any times onto a grid of whole periods since 1970.
#[derive(Debug)]
pub(super) struct Resampler {
    period_ns: i64,
    /// Between neighbours that lie further apart nothing is drawn, ns.
    widest_ns: i64,
    last: [Option<LastSample>; Target::ALL.len()],
    /// Rows of the grid that some signal may still enter, the earliest first.
    open: VecDeque<ImportedRow>,
    newest_ns: i64,
    ended: bool,
    rows: u64,
    gaps: u64,
}

impl Resampler {
    /// With so many rows each second; `compressed` says that points are few because nothing else happened between them.
    pub(super) fn new(rate_hz: f64, compressed: bool) -> Self {
        Self {
            period_ns: nanos_from_seconds(1.0 / rate_hz).max(1),
            widest_ns: if compressed { i64::MAX } else { WIDEST_NS },
            last: [None; Target::ALL.len()],
            open: VecDeque::new(),
            newest_ns: i64::MIN,
            ended: false,
            rows: 0,
            gaps: 0,
        }
    }

    /// How many rows of the grid there would be with those between the newest row and one at this time.
    pub(super) fn rows_until(&self, time_ns: i64) -> u64 {
        let gap_ns = time_ns.saturating_sub(self.newest_ns);
        let drawn =
            if self.newest_ns > i64::MIN && gap_ns <= self.widest_ns { gap_ns.max(0) / self.period_ns } else { 0 };
        self.rows + self.open.len() as u64 + drawn.unsigned_abs()
    }

    /// Takes a row; those of one signal must rise in time, others are left out.
    pub(super) fn push(&mut self, row: &ImportedRow) {
        self.newest_ns = self.newest_ns.max(row.time_ns);
        for target in Target::ALL {
            let Some(value) = row.value(target) else { continue };
            let sample = LastSample { time_ns: row.time_ns, value };
            let place = target.place();
            match self.last[place] {
                Some(before) if before.time_ns >= sample.time_ns => continue,
                Some(before) if sample.time_ns - before.time_ns > self.widest_ns => self.gaps += 1,
                Some(before) => self.draw(target, before, sample),
                None => {}
            }
            if row.time_ns % self.period_ns == 0
                && let Some(row) = self.row(row.time_ns)
            {
                row.set(target, value);
            }
            self.last[place] = Some(sample);
        }
    }

    /// Fills the grid strictly between two samples.
    fn draw(&mut self, target: Target, from: LastSample, to: LastSample) {
        let mut time_ns = (from.time_ns.div_euclid(self.period_ns) + 1) * self.period_ns;
        while time_ns < to.time_ns {
            let share = (time_ns - from.time_ns) as f64 / (to.time_ns - from.time_ns) as f64;
            // A state holds; between two states nothing is.
            let value = if target == Target::Esv { from.value } else { from.value + share * (to.value - from.value) };
            if let Some(row) = self.row(time_ns) {
                row.set(target, value);
            }
            time_ns += self.period_ns;
        }
    }

    /// The row of a time of the grid; none where it has gone already.
    fn row(&mut self, time_ns: i64) -> Option<&mut ImportedRow> {
        let at = self.open.partition_point(|row| row.time_ns < time_ns);
        if self.open.get(at).is_none_or(|row| row.time_ns != time_ns) {
            if at == 0
                && self.rows > 0
                && self.open.is_empty()
                && time_ns <= self.newest_ns.saturating_sub(self.widest_ns.saturating_mul(2))
            {
                return None;
            }
            self.open.insert(at, ImportedRow::at(time_ns));
        }
        self.open.get_mut(at)
    }

    /// Nothing more comes.
    pub(super) fn end(&mut self) {
        self.ended = true;
    }

    /// The next row that no signal can enter any more.
    pub(super) fn pop(&mut self) -> Option<ImportedRow> {
        let first = self.open.front()?;
        let settled = self.ended || first.time_ns < self.newest_ns.saturating_sub(self.widest_ns);
        let row = if settled { self.open.pop_front() } else { None };
        self.rows += u64::from(row.is_some());
        row
    }

    /// What was done.
    pub(super) fn said(&self) -> String {
        let gaps = if self.widest_ns == i64::MAX {
            String::new()
        } else {
            format!(
                "; across {} gaps of more than {} s nothing was drawn",
                self.gaps,
                seconds_from_nanos(self.widest_ns)
            )
        };
        format!(
            "resampled, as the map asks: {} rows every {} s by straight lines between neighbours{gaps}",
            self.rows,
            seconds_from_nanos(self.period_ns)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_to_come_are_known_before_they_are_drawn() {
        let mut resampler = Resampler::new(1e9, false);
        assert_eq!(resampler.rows_until(5), 0, "nothing is drawn before the first");
        let mut row = ImportedRow::at(0);
        row.set(Target::SpoolPosition, 0.0);
        resampler.push(&row);
        assert_eq!(resampler.rows_until(40_000_000), 40_000_001);
        assert_eq!(resampler.rows_until(9_000_000_000), 1, "nothing is drawn across a gap");
    }

    #[test]
    fn signals_of_other_rates_meet_on_the_grid() {
        let mut resampler = Resampler::new(100.0, false);
        let ms = 1_000_000;
        let mut samples: Vec<(i64, Target, f64)> =
            (0..50).map(|k| (k * 7 * ms, Target::SpoolPosition, k as f64 * 7.0)).collect();
        samples.extend((0..70).map(|k| (k * 5 * ms + ms, Target::ServomotorPosition, k as f64 * 5.0 + 1.0)));
        samples.push((9000 * ms, Target::SpoolPosition, 0.0));
        samples.sort_by_key(|sample| sample.0);
        let mut rows = vec![];
        for (time_ns, target, value) in samples {
            let mut row = ImportedRow::at(time_ns);
            row.set(target, value);
            resampler.push(&row);
            rows.extend(std::iter::from_fn(|| resampler.pop()));
        }
        resampler.end();
        rows.extend(std::iter::from_fn(|| resampler.pop()));
        assert!(rows.windows(2).all(|pair| pair[0].time_ns < pair[1].time_ns));
        let both: Vec<&ImportedRow> = rows
            .iter()
            .filter(|row| row.value(Target::SpoolPosition).is_some() && row.value(Target::ServomotorPosition).is_some())
            .collect();
        assert_eq!(both.len(), 34, "every 10 ms from 10 to 340 ms");
        for row in both {
            let expected = row.time_ns as f64 / 1e6;
            for target in [Target::SpoolPosition, Target::ServomotorPosition] {
                assert!((row.value(target).unwrap() - expected).abs() < 1e-9, "{row:?}");
            }
        }
        assert!(resampler.said().contains("across 1 gaps"));
    }
}
