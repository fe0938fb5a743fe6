//! A residual model by hand, for tests that need one but no training.

use std::collections::BTreeMap;

use govtwin_correction::band::Band;
use govtwin_correction::features;
use govtwin_correction::forest::Tree;
use govtwin_correction::guard::Guard;
use govtwin_correction::model::{Learned, Model, fingerprint};
use govtwin_correction::row::{Opening, RateOfInputs};
use govtwin_model::parameters::Unit;

/// A model of the spool that says +0.01 where the command is above 0.4 pu and −0.01 elsewhere, with a band of ±0.02.
pub fn model(unit: &Unit) -> Model {
    let features: Vec<String> = features::all().iter().map(features::Feature::name).collect();
    let count = features.len();
    Model {
        program: "by hand".into(),
        signal: "spool_position_pu".into(),
        unit: "pu".into(),
        learned: Learned::Residual,
        opening: Opening::Simulated,
        rate_of_inputs: RateOfInputs::Hold,
        period_ns: 200_000_000,
        twin: fingerprint(unit),
        features,
        guard: Guard { support: vec![[-1e12, 1e12]; count], range: [-0.05, 0.05], reach: None },
        band: Some(Band { coverage_share: 0.9, moving_above: 0.1, at_rest: 0.02, in_motion: 0.02 }),
        importance: vec![0.0; count],
        booster: "none".into(),
        hyperparameters: BTreeMap::new(),
        training: BTreeMap::new(),
        trees: vec![Tree {
            feature: vec![0],
            threshold: vec![0.4],
            left: vec![-1],
            right: vec![-2],
            leaf: vec![-0.01, 0.01],
        }],
    }
}
