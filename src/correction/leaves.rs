//! Leaves that are retrained while a unit runs: what is added to the leaves of a model's trees, learned from its errors.
//!
//! The trees keep their splits. A row falls into one leaf of each of T trees; what is added to it is the sum of what these leaves have learned. An
//! error e of a row is shared out among its leaves, each `+= g e / T`: normalised least mean squares (Widrow and Hoff 1960; Haykin 2002, *Adaptive
//! Filter Theory*, chapter 6) whose regressor, one for each tree, has the norm √T. The gain g of a leaf is 1/n at its nth row, a mean, and never below that of
//! the stated memory. Unlike a bias and a gain they follow an error that depends on position and direction of motion.

use super::forest::Forest;

/// What each leaf has learned, and the leaves of the row at hand. A step takes constant time and no memory.
#[derive(Clone, Debug)]
pub(crate) struct Leaves {
    /// Of each node and leaf of the forest; the coefficient's unit is the signal's.
    added: Vec<f64>,
    /// Rows from which each learned.
    rows: Vec<u32>,
    /// The leaves of the row at hand, one of each tree.
    here: Vec<u32>,
    /// The most that is added, in the unit of the signal; the coefficient's unit is the signal's.
    limit: f64,
}

impl Leaves {
    /// For a forest, with the most that may be added to a row.
    pub(crate) fn new(forest: &Forest, limit: f64) -> Self {
        let places = forest.places();
        Self { added: vec![0.0; places], rows: vec![0; places], here: vec![0; forest.len()], limit }
    }

    /// Where the leaves of the row at hand are put.
    pub(crate) fn here(&mut self) -> &mut [u32] {
        &mut self.here
    }

    /// What is to be added to the row at hand, in bounds.
    pub(crate) fn value(&self) -> f64 {
        self.here.iter().map(|leaf| self.added[*leaf as usize]).sum::<f64>().clamp(-self.limit, self.limit)
    }

    /// Takes what was missed at the row at hand, with the gain of a leaf that has learned for long.
    pub(crate) fn learn(&mut self, missed: f64, least_gain: f64) {
        let share = missed / self.here.len() as f64;
        for leaf in &self.here {
            let leaf = *leaf as usize;
            self.rows[leaf] = self.rows[leaf].saturating_add(1);
            let gain = (1.0 / f64::from(self.rows[leaf])).max(least_gain);
            self.added[leaf] = (self.added[leaf] + gain * share).clamp(-self.limit, self.limit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Leaves;
    use crate::forest::{Forest, Tree};

    fn stump(threshold: f64) -> Tree {
        Tree { feature: vec![0], threshold: vec![threshold], left: vec![-1], right: vec![-2], leaf: vec![0.5, -0.5] }
    }

    #[test]
    fn an_error_that_depends_on_the_row_is_learned_where_it_is() {
        let forest = Forest::new(&[stump(0.0), stump(0.5)], 1).unwrap();
        let mut leaves = Leaves::new(&forest, 1.0);
        let wanted = |x: f64| if x <= 0.5 { 0.2 } else { -0.1 };
        for k in 0..3000 {
            let x = f64::from(k % 20) / 10.0 - 1.0;
            let _ = forest.value_and_leaves(&[x], leaves.here());
            leaves.learn(wanted(x) - leaves.value(), 0.01);
        }
        for x in [-0.9, 0.1, 0.9] {
            let _ = forest.value_and_leaves(&[x], leaves.here());
            assert!((leaves.value() - wanted(x)).abs() < 0.005, "{x}: {}", leaves.value());
        }
    }

    #[test]
    fn what_is_added_stays_in_bounds() {
        let forest = Forest::new(&[stump(0.0), stump(0.5)], 1).unwrap();
        let mut leaves = Leaves::new(&forest, 0.1);
        assert_eq!(leaves.value(), 0.0);
        let _ = forest.value_and_leaves(&[0.2], leaves.here());
        for _ in 0..100 {
            leaves.learn(5.0, 0.01);
        }
        assert_eq!(leaves.value(), 0.1);
    }
}
