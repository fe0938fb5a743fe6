//! How far a correction carries: its weight by the distance from the training rows, learned on folds that leave a process out.
//!
//! The distance of a row is that to the nearest of some training rows, taken evenly in time, over features of the operating point: command, its slope,
//! the regulator's error, the ESV and the twin's own output, each in training standard deviations. Models are trained without each process in turn and asked about
//! it, and on folds by time. At each level of distance the weight is the one whose worst process is best, by mean absolute error over that of the
//! twin; a level farther out never gets more than a nearer one. So no threshold is set by hand, and where corrections of one process harm another one they are shrunk.
//! At each level the band grows by what its rows missed.

use serde::{Deserialize, Serialize};

use super::band::conformal;

/// Features of the operating point; a model without one of them uses the others.
const PLACES: [&str; 6] =
    ["command_pu.mean10", "command_pu.slope5", "error_pu.mean10", "esv", "model.mean5", "model.spread5"];

/// Training rows among which the nearest is sought: a step of the node has microseconds.
pub const POINTS: usize = 256;

/// Levels of distance, with equally many rows in each.
const LEVELS: usize = 12;

/// A process with fewer rows at a level does not count there.
const FEWEST: usize = 100;

/// Weights are whole multiples of one over this.
const STEPS: u32 = 10;

/// The weight of a correction, and the growth of its band, by distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reach {
    /// Indices of the features that make the distance.
    pub features: Vec<usize>,
    /// One over the training standard deviation of each; the coefficient's unit is one over the feature's.
    pub scales: Vec<f64>,
    /// Training rows, feature by feature, in standard deviations.
    pub points: Vec<Vec<f64>>,
    /// Distances at which the next level begins, rising, in standard deviations.
    pub edges: Vec<f64>,
    /// Weight of each level, a share of 1.
    pub weight_shares: Vec<f64>,
    /// What the band's half width is multiplied by at each level; a ratio.
    pub widenings: Vec<f64>,
}

/// A word for a row by a model that did not see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unseen {
    /// The process that the model did not see, or a number behind all processes where it saw some rows of every one.
    pub group: usize,
    /// Distance of the row from the training rows of the model, in standard deviations.
    pub distance: f64,
    /// The right correction; the coefficient's unit is the signal's.
    pub target: f64,
    /// The model's correction; the coefficient's unit is the signal's.
    pub said: f64,
    /// Half width of the band at the row; the coefficient's unit is the signal's.
    pub half_width: f64,
}

impl Reach {
    /// The distance from `rows` alone, in standard deviations of `scales_of`: no weights yet. `None` where none of the features that make it is among
    /// the named ones.
    pub fn of(names: &[String], rows: &[&[f64]], scales_of: &[&[f64]]) -> Option<Self> {
        let features: Vec<usize> =
            PLACES.iter().filter_map(|place| names.iter().position(|name| name == place)).collect();
        if features.is_empty() || rows.is_empty() {
            return None;
        }
        let scales: Vec<f64> = features.iter().map(|&feature| scale(scales_of, feature)).collect();
        let count = rows.len().min(POINTS);
        let taken: Vec<&[f64]> = (0..count).map(|k| rows[k * (rows.len() - 1) / (count - 1).max(1)]).collect();
        let column = |(&feature, scale): (&usize, &f64)| taken.iter().map(|row| row[feature] * scale).collect();
        let points = features.iter().zip(&scales).map(column).collect();
        Some(Self { features, scales, points, edges: vec![], weight_shares: vec![1.0], widenings: vec![1.0] })
    }

    /// Distance of a row of features from the training rows, in standard deviations. Allocates nothing.
    pub fn distance(&self, row: &[f64]) -> f64 {
        let mut squares = [0.0; POINTS];
        let count = self.points.first().map_or(0, Vec::len).min(POINTS);
        for ((&feature, scale), column) in self.features.iter().zip(&self.scales).zip(&self.points) {
            let Some(value) = row.get(feature) else { return f64::INFINITY };
            let value = value * scale;
            for (square, point) in squares.iter_mut().zip(column) {
                *square += (value - point) * (value - point);
            }
        }
        // Several at a time: a chain of comparisons would wait for each one.
        let mut nearest = [f64::INFINITY; 8];
        for eight in squares[..count].chunks(8) {
            for (least, square) in nearest.iter_mut().zip(eight) {
                *least = if square < least { *square } else { *least };
            }
        }
        nearest.iter().copied().fold(f64::INFINITY, f64::min).sqrt()
    }

    /// Weight and widening of the band at a distance.
    pub fn at(&self, distance: f64) -> (f64, f64) {
        let level = self.edges.iter().filter(|edge| **edge <= distance).count();
        let of = |values: &[f64]| values.get(level).copied();
        (of(&self.weight_shares).unwrap_or(0.0), of(&self.widenings).unwrap_or(f64::INFINITY))
    }

    /// Learns weights and widenings from rows that no model saw; `coverage_share` is the band's.
    #[must_use]
    pub fn learned(mut self, unseen: &[Unseen], coverage_share: f64) -> Self {
        let mut distances: Vec<f64> = unseen.iter().map(|one| one.distance).collect();
        distances.sort_by(f64::total_cmp);
        self.edges = (1..LEVELS).filter_map(|level| distances.get(distances.len() * level / LEVELS)).copied().collect();
        (self.weight_shares, self.widenings) = (vec![], vec![]);
        let mut most: u32 = STEPS;
        for level in 0..=self.edges.len() {
            let is_own = |one: &&Unseen| self.edges.iter().filter(|edge| **edge <= one.distance).count() == level;
            let own: Vec<&Unseen> = unseen.iter().filter(is_own).collect();
            most = most.min(safest(&own));
            let weight_share = f64::from(most) / f64::from(STEPS);
            let mut ratios: Vec<f64> =
                own.iter().map(|one| (one.target - weight_share * one.said).abs() / one.half_width).collect();
            ratios.retain(|ratio| ratio.is_finite());
            ratios.sort_by(f64::total_cmp);
            self.weight_shares.push(weight_share);
            self.widenings.push(conformal(&ratios, coverage_share).unwrap_or(1.0).max(1.0));
        }
        self
    }

    /// What is wrong with one that was read, for a model of so many features.
    pub fn problem(&self, features: usize) -> Option<&'static str> {
        let width = self.features.len();
        let points = self.points.first().map_or(0, Vec::len);
        let shares = self.weight_shares.iter().all(|share| (0.0..=1.0).contains(share));
        let finite = self.scales.iter().chain(self.points.iter().flatten()).chain(&self.edges).chain(&self.widenings);
        if self.features.iter().any(|&feature| feature >= features) {
            Some("its reach looks at a feature that is not there")
        } else if self.scales.len() != width || self.points.len() != width || points == 0 || points > POINTS {
            Some("its reach needs a scale and 1 to 256 points for each of its features")
        } else if self.points.iter().any(|column| column.len() != points) {
            Some("the points of its reach differ in number from feature to feature")
        } else if !shares || !finite.into_iter().all(|value| value.is_finite()) {
            Some("its reach holds a weight outside of 0 to 1 or what is no number")
        } else if self.weight_shares.len() != self.edges.len() + 1 || self.widenings.len() != self.edges.len() + 1 {
            Some("its reach needs a weight and a widening for each of its levels")
        } else {
            None
        }
    }
}

/// Steps of the weight whose worst group is best; all of them where no group has rows enough.
fn safest(rows: &[&Unseen]) -> u32 {
    let mut groups: Vec<usize> = rows.iter().map(|one| one.group).collect();
    groups.sort_unstable();
    groups.dedup();
    groups.retain(|group| rows.iter().filter(|one| one.group == *group).count() >= FEWEST);
    let worst = |steps: u32| -> f64 {
        let share = f64::from(steps) / f64::from(STEPS);
        let of = |group: &usize| {
            let own = || rows.iter().filter(|one| one.group == *group);
            let with: f64 = own().map(|one| (one.target - share * one.said).abs()).sum();
            with / own().map(|one| one.target.abs()).sum::<f64>()
        };
        groups.iter().map(of).fold(0.0, f64::max)
    };
    if groups.is_empty() {
        return STEPS;
    }
    (0..=STEPS).map(|steps| (steps, worst(steps))).min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(steps, _)| steps)
}

/// One over the standard deviation of a feature over rows; 1 where it does not move.
fn scale(rows: &[&[f64]], feature: usize) -> f64 {
    let count = rows.len().max(1) as f64;
    let values = || rows.iter().map(|row| row[feature]);
    let mean = values().sum::<f64>() / count;
    let spread = (values().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count).sqrt();
    if spread < 1e-9 * (1.0 + mean.abs()) { 1.0 } else { 1.0 / spread }
}

#[cfg(test)]
mod tests {
    use super::{Reach, Unseen};
    use crate::features::Feature;
    use crate::table::FeatureTable;
    use crate::table::tests::{of, recording};

    /// The distance from all rows of a table.
    fn all(table: &FeatureTable) -> Reach {
        let names: Vec<String> = table.layout.features.iter().map(Feature::name).collect();
        let rows: Vec<&[f64]> = (0..table.marks.len()).map(|row| table.row(row)).collect();
        Reach::of(&names, &rows, &rows).unwrap()
    }

    fn blank() -> Reach {
        all(&of(&[recording("a", 0, 300, |_, _| 0.01)]))
    }

    /// A near row is right; a far one of process 0 is right too, one of process 1 has the opposite sign.
    fn unseen(k: usize) -> Unseen {
        let far = !k.is_multiple_of(3);
        let target = 0.01 + 1e-5 * (k % 7) as f64;
        let said = if k % 3 == 2 { -target } else { target };
        let group = if far { k % 3 - 1 } else { 9 };
        Unseen { group, distance: if far { 5.0 } else { 0.1 } + 1e-6 * k as f64, target, said, half_width: 0.001 }
    }

    #[test]
    fn what_harms_one_process_is_shrunk_where_it_is_far_and_kept_where_it_is_near() {
        let rows: Vec<Unseen> = (0..9000).map(unseen).collect();
        let reach = blank().learned(&rows, 0.9);
        assert_eq!(reach.problem(200), None);
        assert_eq!((reach.at(0.1), reach.at(50.0).0), ((1.0, 1.0), 0.0));
        assert!(reach.weight_shares.windows(2).all(|pair| pair[1] <= pair[0]), "{:?}", reach.weight_shares);
        assert!(reach.at(50.0).1 > 9.0, "the twin alone misses by ten half widths");
    }

    #[test]
    fn no_group_with_its_weights_is_worse_than_its_twin_on_the_rows_that_taught_them() {
        let rows: Vec<Unseen> =
            (0..9000).map(|k| Unseen { said: 0.02 - 0.004 * (k % 11) as f64, ..unseen(k) }).collect();
        let reach = blank().learned(&rows, 0.9);
        for group in [0, 1, 9] {
            let own = || rows.iter().filter(|one| one.group == group);
            let with: f64 = own().map(|one| (one.target - reach.at(one.distance).0 * one.said).abs()).sum();
            assert!(with <= own().map(|one| one.target.abs()).sum::<f64>() + 1e-12);
        }
    }

    #[test]
    fn a_training_row_is_near_and_a_strange_one_far() {
        let table = of(&[recording("a", 0, 300, |_, _| 0.01)]);
        let reach = all(&table);
        let mut row = table.row(0).to_vec();
        assert!(reach.distance(&row) < 1e-12);
        row[reach.features[0]] += 3.0 / reach.scales[0];
        assert!(reach.distance(&row) > 0.5 && reach.distance(&row) <= 3.0 + 1e-9);
        assert_eq!(reach.distance(&[]), f64::INFINITY);
    }

    #[test]
    fn damage_is_said() {
        let breaks: [fn(&mut Reach); 4] = [
            |reach| reach.features[0] = 200,
            |reach| reach.points[0].truncate(3),
            |reach| reach.weight_shares[0] = 1.5,
            |reach| reach.edges.push(1.0),
        ];
        for damage in breaks {
            let mut broken = blank();
            damage(&mut broken);
            assert!(broken.problem(200).is_some());
        }
    }
}
