//! By how much a search missed what could be reached, where the true values are known.

use serde::{Deserialize, Serialize};

use govtwin_model::stored::figure;

/// χ² of residuals and priors that the search found for the true fault set, beside what a fit reaches that begins at the true values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Regret {
    /// Ids of the true effects.
    pub effects: Vec<String>,
    /// Least χ² of the fitted sets that hold all true effects, or true ones alone, of which the true set is one with more.
    #[serde(deserialize_with = "figure")]
    pub found: f64,
    /// χ² reached from the true values.
    #[serde(deserialize_with = "figure")]
    pub reached: f64,
}

impl Regret {
    /// χ² found less χ² reached, as a share of the latter; below 0 where the search found better.
    pub fn share(&self) -> f64 {
        self.found / self.reached - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::Regret;

    #[test]
    fn regret_is_a_share_of_what_was_reached() {
        let of = |found| Regret { effects: vec![], found, reached: 200.0 }.share();
        assert!((of(210.0) - 0.05).abs() < 1e-12 && of(190.0) < 0.0);
    }
}
