//! Whether what a model leaves is noise: size and whiteness of its innovations, signal by signal.

use serde::{Deserialize, Serialize};

use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use govtwin_model::signal::Signal;
use govtwin_model::stored::figure;

/// Innovations of one signal over all recordings (Bar-Shalom, Li & Kirubarajan 2001, *Estimation with Applications to Tracking and Navigation*,
/// section 5.4).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Consistency {
    /// Which signal.
    pub signal: Signal,
    /// How many samples.
    pub samples: usize,
    /// Mean square of the normalised innovations over what a right model has: 1 where the noise is as expected, far above where the model
    /// lacks something.
    #[serde(deserialize_with = "figure")]
    pub mean_square: f64,
    /// Correlation of each innovation with the next: 0 but for some 2/√samples where they are white.
    #[serde(rename = "lag1_correlation", deserialize_with = "figure")]
    pub correlation: f64,
}

/// Of each signal that was measured, for a model that has its residuals.
pub fn consistency(problem: &Problem, model: &FittedModel) -> Vec<Consistency> {
    let of = |signal: Signal| {
        let innovations: Vec<Vec<f64>> = (model.fit.residuals.iter().enumerate())
            .map(|(recording, residuals)| problem.innovations(recording, signal, residuals))
            .filter(|innovations| !innovations.is_empty())
            .collect();
        let samples: usize = innovations.iter().map(Vec::len).sum();
        let square: f64 = innovations.iter().flatten().map(|one| one * one).sum();
        let product: f64 = innovations.iter().flat_map(|all| all.windows(2)).map(|two| two[0] * two[1]).sum();
        let expected: f64 =
            (0..problem.recordings.len()).map(|recording| problem.expected_square(recording, signal)).sum();
        (samples > 0).then(|| Consistency {
            signal,
            samples,
            mean_square: square / expected,
            correlation: if square > 0.0 { product / square } else { 0.0 },
        })
    };
    Signal::ALL.into_iter().filter_map(of).collect()
}
