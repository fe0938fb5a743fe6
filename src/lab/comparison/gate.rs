//! A gate between models, learned on validation folds: the weight of each where the twin rests, and where it moves.
//!
//! `y = Σ mᵢ·yᵢ` with weights that are not negative and add up to 1, chosen by mean absolute error for each level of motion, on predictions
//! for rows that no model was trained on. A level with too few rows keeps the first model.

use govtwin_correction::table::FeatureTable;

/// Levels of motion.
const LEVELS: usize = 5;

/// A level with fewer rows keeps the first model.
const FEWEST: usize = 100;

/// Weights are whole multiples of one over this.
const STEPS: u32 = 10;

/// Weights by how far the twin moved.
#[derive(Clone, Debug, PartialEq)]
pub struct BlendGate {
    /// Motions at which the next level begins, rising; the coefficient's unit is the signal's.
    pub edges: Vec<f64>,
    /// Weights of the models in each level, shares of 1.
    pub weight_shares: Vec<Vec<f64>>,
}

impl BlendGate {
    /// Learns a gate on rows: for each the row's index and the words of all models, none of which saw it.
    pub fn learned(table: &FeatureTable, models: usize, rows: &[(usize, Vec<f64>)]) -> Self {
        let mut motions: Vec<f64> = rows.iter().map(|(row, _)| table.marks[*row].motion).collect();
        motions.sort_by(f64::total_cmp);
        let edges: Vec<f64> =
            (1..LEVELS).filter_map(|level| motions.get(motions.len() * level / LEVELS)).copied().collect();
        let mut gate = Self { edges, weight_shares: vec![] };
        let tried = weights(models, STEPS);
        let best = |level: usize| {
            let own: Vec<_> = rows.iter().filter(|(row, _)| gate.level(table.marks[*row].motion) == level).collect();
            let loss = |shares: &[f64]| -> f64 {
                own.iter().map(|(row, words)| (mixed(shares, words) - table.marks[*row].measured).abs()).sum()
            };
            let first = tried.first().cloned().unwrap_or_default();
            if own.len() < FEWEST {
                return first;
            }
            let losses = tried.iter().map(|shares| (shares, loss(shares)));
            losses.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(first, |(shares, _)| shares.clone())
        };
        gate.weight_shares = (0..LEVELS).map(best).collect();
        gate
    }

    fn level(&self, motion: f64) -> usize {
        self.edges.partition_point(|edge| *edge <= motion)
    }

    /// The combined estimate of all models for a row.
    pub fn value(&self, motion: f64, words: &[f64]) -> f64 {
        self.weight_shares.get(self.level(motion)).map_or(f64::NAN, |shares| mixed(shares, words))
    }
}

fn mixed(shares: &[f64], words: &[f64]) -> f64 {
    shares.iter().zip(words).map(|(share, word)| share * word).sum()
}

/// All weights of so many models on a grid, those of the first model alone first.
fn weights(models: usize, steps: u32) -> Vec<Vec<f64>> {
    if models <= 1 {
        return vec![vec![f64::from(steps) / f64::from(STEPS); models]];
    }
    let of = |first: u32| {
        let rest = weights(models - 1, steps - first);
        rest.into_iter().map(move |rest| [vec![f64::from(first) / f64::from(STEPS)], rest].concat())
    };
    (0..=steps).rev().flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::{BlendGate, weights};
    use crate::comparison::tests::made;

    #[test]
    fn each_level_takes_the_model_that_is_right_there() {
        let table = made(1000).1;
        let middle = {
            let mut motions: Vec<f64> = table.marks.iter().map(|mark| mark.motion).collect();
            motions.sort_by(f64::total_cmp);
            motions[600]
        };
        // The first model is right at rest, the second in motion, the third nowhere.
        let said = |row: usize| {
            let mark = &table.marks[row];
            let off = if mark.motion < middle { [0.0, 0.1, 0.3] } else { [0.1, 0.0, 0.3] };
            (row, off.map(|off| mark.measured + off).to_vec())
        };
        let words: Vec<_> = (0..1000).map(said).collect();
        let gate = BlendGate::learned(&table, 3, &words);
        let shares: Vec<f64> = gate.weight_shares.iter().map(|shares| shares[0]).collect();
        assert_eq!(shares, [1.0, 1.0, 1.0, 0.0, 0.0]);
        for (row, words) in &words {
            let mark = &table.marks[*row];
            assert!((gate.value(mark.motion, words) - mark.measured).abs() < 1e-12);
        }
        // Too few training rows give no gate.
        assert_eq!(BlendGate::learned(&table, 3, &words[..50]).weight_shares, vec![vec![1.0, 0.0, 0.0]; 5]);
    }

    #[test]
    fn weights_add_up_and_begin_with_the_first_model() {
        let all = weights(3, 10);
        assert_eq!((all.len(), &all[0][..]), (66, &[1.0, 0.0, 0.0][..]));
        assert!(all.iter().all(|shares| (shares.iter().sum::<f64>() - 1.0).abs() < 1e-12));
    }
}
