//! Where training has been: cells of opening, slope of the command and ESV that hold training rows.
//!
//! A box of single features cannot tell a process that was never seen: its opening lies between those of others, its rates as well. Together they
//! can: no other process holds a load increase's opening at rest. In a cell with fewer than [`FEWEST`] training rows nothing is corrected.

use serde::{Deserialize, Serialize};

use super::features::Feature;

/// Training rows that a cell needs.
const FEWEST: usize = 50;

/// Width of a cell along the opening, pu.
const OPENING_PU: f64 = 0.1;

/// Slopes of the command at which the next cell begins, pu/s.
const SLOPES_PU_S: [f64; 4] = [-0.02, -0.004, 0.004, 0.02];

/// Names of the features that make a cell.
const NAMES: [&str; 3] = ["opening_pu", "command_pu.slope5", "esv"];

/// The cells that training rows fill.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cells {
    /// Indices of the features that make a cell: opening, slope of the command, ESV.
    pub features: [usize; 3],
    /// Filled cells in rising order: tenth of the opening, class of the slope, ESV.
    pub filled: Vec<[i64; 3]>,
}

impl Cells {
    /// The cells of training rows, which stand one after the other; `None` where a feature is missing or no cell is filled.
    #[must_use]
    pub fn of(values: &[f64], features: &[Feature]) -> Option<Self> {
        let place = |name: &str| features.iter().position(|feature| feature.name() == name);
        let features_of_cell = [place(NAMES[0])?, place(NAMES[1])?, place(NAMES[2])?];
        let mut cells = Self { features: features_of_cell, filled: vec![] };
        let mut all: Vec<[i64; 3]> =
            values.chunks_exact(features.len().max(1)).filter_map(|row| cells.cell(row)).collect();
        all.sort_unstable();
        let runs = all.chunk_by(|one, other| one == other).filter(|run| run.len() >= FEWEST);
        cells.filled = runs.map(|run| run[0]).collect();
        (!cells.filled.is_empty()).then_some(cells)
    }

    /// Whether training has been where a row lies. Allocates nothing.
    #[must_use]
    pub fn know(&self, row: &[f64]) -> bool {
        self.cell(row).is_some_and(|cell| self.filled.binary_search(&cell).is_ok())
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "openings and switches are a few units at most; beyond, the cast saturates"
    )]
    fn cell(&self, row: &[f64]) -> Option<[i64; 3]> {
        let [opening_pu, slope_pu_s, esv] = self.features.map(|place| row.get(place).copied());
        let class = SLOPES_PU_S.iter().filter(|edge| slope_pu_s.is_some_and(|slope| slope >= **edge)).count();
        Some([(opening_pu? / OPENING_PU).floor() as i64, i64::try_from(class).ok()?, esv? as i64])
    }
}

#[cfg(test)]
mod tests {
    use super::Cells;
    use crate::residual::features;

    #[test]
    fn a_process_between_two_others_is_told_by_what_goes_together() {
        let features = features::all();
        let place = |name: &str| features.iter().position(|feature| feature.name() == name).unwrap();
        let row = |opening: f64, slope: f64| {
            let mut row = vec![0.0; features.len()];
            row[place("opening_pu")] = opening;
            row[place("command_pu.slope5")] = slope;
            row[place("esv")] = 1.0;
            row
        };
        // At rest at 0.15, and falling fast from 0.95.
        let values: Vec<f64> = (0..100)
            .flat_map(|k| if k % 2 == 0 { row(0.15, 0.0) } else { row(0.01 * f64::from(k).min(95.0), -0.1) })
            .collect();
        let cells = Cells::of(&values, &features).unwrap();
        assert!(cells.know(&row(0.12, 0.001)) && !cells.know(&row(0.55, 0.0)) && !cells.know(&row(f64::NAN, 0.0)));
        assert_eq!(Cells::of(&values[..10 * features.len()], &features), None);
        assert_eq!(Cells::of(&values, &features[..2]), None);
    }
}
