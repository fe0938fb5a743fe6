//! Rows of features with their targets, made from recordings and a twin's estimates for them.

use super::corrector::motion;
use super::features::{self, Feature};
use super::history::History;
use super::row::{Opening, RateOfInputs, RowChannel, RowMaker};
use govtwin_model::frame::Estimate;
use govtwin_model::recording::{Process, Recording, median_spacing_ns};
use govtwin_model::signal::Signal;

/// What a table is made for.
#[derive(Clone, Debug, PartialEq)]
pub struct TableLayout {
    /// The signal to learn.
    pub signal: Signal,
    /// Where the opening comes from.
    pub opening: Opening,
    /// What drove the twin between rows.
    pub rate_of_inputs: RateOfInputs,
    /// Training period, ns.
    pub period_ns: i64,
    /// The features, in order.
    pub features: Vec<Feature>,
}

/// One row of a table, apart from its features.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowMark {
    /// Index of its recording.
    pub recording: usize,
    /// Index of its frame there.
    pub frame: usize,
    /// Its process.
    pub process: Process,
    /// Its time, ns.
    pub time_ns: i64,
    /// What was measured; the coefficient's unit is the signal's.
    pub measured: f64,
    /// The twin's estimate; the coefficient's unit is the signal's.
    pub model: f64,
    /// How far the twin moved over the last five periods; the coefficient's unit is the signal's.
    pub motion: f64,
}

impl RowMark {
    /// Measured − twin.
    pub fn residual(&self) -> f64 {
        self.measured - self.model
    }
}

/// Rows of features, one after the other, with their marks.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureTable {
    /// What it was made for.
    pub layout: TableLayout,
    /// Values, row by row.
    pub values: Vec<f64>,
    /// What each row is.
    pub marks: Vec<RowMark>,
    /// Samples that were left out because a feature was not finite.
    pub left_out: u64,
}

impl FeatureTable {
    /// The features of one row.
    pub fn row(&self, index: usize) -> &[f64] {
        let width = self.layout.features.len();
        self.values.get(index * width..(index + 1) * width).unwrap_or_default()
    }

    /// The rows of a selection, one after the other.
    pub fn select(&self, rows: &[usize]) -> Vec<f64> {
        rows.iter().flat_map(|&index| self.row(index)).copied().collect()
    }
}

/// The slowest usual spacing of a signal's samples among recordings, ns; 0 where none has two.
pub fn slowest_period_ns(recordings: &[Recording], signal: Signal) -> i64 {
    recordings.iter().map(|recording| spacing_ns(recording, signal)).max().unwrap_or(0)
}

/// The usual spacing of a signal's samples, ns; 0 where there are fewer than two.
pub(super) fn spacing_ns(recording: &Recording, signal: Signal) -> i64 {
    let sampled = recording.frames.iter().filter(|frame| signal.of(&frame.measured).is_finite());
    median_spacing_ns(sampled.map(|frame| frame.time_ns))
}

/// One row for each sample of the signal, at most one a training period. Estimates stand frame by frame.
///
/// Every recording begins with a history of its own, so that no window reaches into another one.
pub fn table(recordings: &[Recording], estimates: &[Vec<Estimate>], layout: TableLayout) -> FeatureTable {
    let width = layout.features.len();
    let mut table = FeatureTable { values: vec![], marks: vec![], left_out: 0, layout };
    let layout = &table.layout;
    let mut values = vec![0.0; width];
    for (recording, (rows, estimates)) in recordings.iter().zip(estimates).enumerate() {
        let mut history = History::new(layout.period_ns);
        let mut channels = RowMaker::new(layout.opening, layout.signal);
        let mut next_ns = i64::MIN;
        // The row nearest to the grid counts; where rows come every period, a tenth of it is left to jitter.
        let jitter_ns = (spacing_ns(rows, layout.signal) / 2).min(layout.period_ns / 10);
        for (frame, (now, estimate)) in rows.frames.iter().zip(estimates).enumerate() {
            let row = channels.row(now, estimate);
            let measured = layout.signal.of(&now.measured);
            let taps = history.push(now.time_ns, &row);
            if !measured.is_finite() || now.time_ns < next_ns.saturating_sub(jitter_ns) {
                continue;
            }
            let late = now.time_ns.saturating_sub(next_ns) > layout.period_ns;
            next_ns = if late { now.time_ns } else { next_ns } + layout.period_ns;
            features::fill(&layout.features, taps, layout.period_ns, &mut values);
            let model = layout.signal.of(&estimate.signals);
            if !model.is_finite() || values.iter().any(|value| !value.is_finite()) {
                table.left_out += 1;
                continue;
            }
            let motion = motion(taps.iter().take(5).map(|tap| tap[RowChannel::Model as usize]));
            table.values.extend(&values);
            let (process, time_ns) = (rows.process, now.time_ns);
            table.marks.push(RowMark { recording, frame, process, time_ns, measured, model, motion });
        }
    }
    table
}

#[cfg(test)]
pub(super) mod tests {
    use super::{FeatureTable, TableLayout, slowest_period_ns, table};
    use crate::features;
    use crate::row::{Opening, RateOfInputs};
    use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
    use govtwin_model::recording::Recording;
    use govtwin_model::signal::Signal;
    use govtwin_model::twin::Twin;

    /// A recording of a wavy command in which the spool shows what `gap` adds to the twin.
    pub fn recording(name: &str, start_s: i64, rows: i64, gap: impl Fn(&Frame, f64) -> f64) -> Recording {
        let mut twin = Twin::new(&govtwin_model::params::reference());
        let mut frames = vec![];
        for k in 0..rows {
            let time_s = 0.2 * k as f64;
            let command_pu = 0.4 + 0.1 * (0.7 * time_s).sin() + 0.05 * (0.13 * time_s + start_s as f64).sin();
            let inputs = Inputs {
                opening_command_pu: command_pu,
                esv: EsvState::Normal,
                tank_pressure_pa: 6.3e6,
                piston_force_n: 0.0,
            };
            let mut frame =
                Frame { time_ns: start_s * 1_000_000_000 + k * 200_000_000, inputs, measured: Signals::NONE };
            let signals = twin.step(&frame).signals;
            frame.measured = Signals {
                spool_position_pu: signals.spool_position_pu + gap(&frame, signals.spool_position_pu),
                servomotor_position_pu: signals.servomotor_position_pu,
                ..Signals::NONE
            };
            frames.push(frame);
        }
        Recording::new(name, frames)
    }

    pub fn layout() -> TableLayout {
        let period_ns = 200_000_000;
        let (signal, opening, rate_of_inputs) = (Signal::SpoolPosition, Opening::Simulated, RateOfInputs::Hold);
        TableLayout { signal, opening, rate_of_inputs, period_ns, features: features::all() }
    }

    pub fn of(recordings: &[Recording]) -> FeatureTable {
        let twin = Twin::new(&govtwin_model::params::reference());
        let estimates: Vec<_> =
            recordings.iter().map(|recording| govtwin_model::replay::simulate(&mut twin.clone(), recording)).collect();
        table(recordings, &estimates, layout())
    }

    #[test]
    fn no_window_reaches_into_another_recording() {
        // The second begins one period after the first ends, as if they were one: a window across both would not break off.
        let (first, second) = (recording("a", 0, 50, |_, _| 0.0), recording("b", 10, 50, |_, _| 0.0));
        let alone = of(std::slice::from_ref(&second));
        let both = of(&[first, second]);
        assert_eq!(both.marks.len(), 100);
        assert_eq!(both.values[both.values.len() / 2..], alone.values[..]);
    }

    #[test]
    fn fast_recordings_are_taken_at_the_training_period() {
        let slow = recording("a", 0, 50, |_, _| 0.0);
        assert_eq!(slowest_period_ns(std::slice::from_ref(&slow), Signal::SpoolPosition), 200_000_000);
        let mut fast = slow.clone();
        fast.frames = fast
            .frames
            .iter()
            .flat_map(|frame| (0..20).map(|k| Frame { time_ns: frame.time_ns + k * 10_000_000, ..*frame }))
            .collect();
        let both = of(&[fast.clone(), slow.clone()]);
        assert_eq!(both.marks.iter().filter(|mark| mark.recording == 0).count(), 50);
        assert_eq!(slowest_period_ns(&[fast, slow], Signal::SpoolPosition), 200_000_000);
    }

    #[test]
    fn samples_that_cannot_be_used_are_counted() {
        let mut broken = recording("a", 0, 50, |_, _| 0.01);
        broken.frames[20].measured.spool_position_pu = f64::NAN;
        broken.frames[30].inputs.opening_command_pu = f64::NAN;
        let table = of(&[broken]);
        // The command of one row is in the windows of the next nine.
        assert_eq!((table.marks.len(), table.left_out), (39, 10));
        assert!(table.marks[..29].iter().all(|mark| (mark.residual() - 0.01).abs() < 1e-12));
        assert_eq!(table.row(3).len(), table.layout.features.len());
        assert_eq!(table.select(&[3, 5])[table.layout.features.len()..], *table.row(5));
    }
}
