//! A trained model as text: what it corrects, for which unit and rate, its features, trees, guard and band.
//!
//! Two lines of JSON: a head with schema and the SHA-256 of the second line, then the model. A file that was cut, edited
//! or made by another version is refused before anything runs.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::band::Band;
use super::features::{self, Feature};
use super::forest::{Forest, ForestError, Tree};
use super::guard::Guard;
use super::history::{LONGEST_PERIOD_NS, SHORTEST_PERIOD_NS};
use super::row::{Opening, RateOfInputs};
use govtwin_files::digest::{Digest, sha256};
use govtwin_model::parameters::{ENTRIES, Unit};
use govtwin_model::signal::Signal;

/// Name and version of the file's schema.
pub const SCHEMA: &str = "govtwin-residual/1";

/// Under this key [`Model::training`] names the processes that were left out.
pub const LEFT_OUT: &str = "left out";

/// What was learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Learned {
    /// Measured − twin: the hybrid.
    Residual,
    /// The measured signal itself, from data only.
    Signal,
}

/// A trained model with the conditions of its use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Program and version that trained it.
    pub program: String,
    /// Id of the signal that it corrects.
    pub signal: String,
    /// The signal's unit: that of corrections, range and band.
    pub unit: String,
    /// What was learned.
    pub learned: Learned,
    /// Where the opening came from in training; a model runs only where it comes from there again.
    pub opening: Opening,
    /// How inputs ran between rows in training; held if the file does not state it.
    #[serde(default, rename = "between")]
    pub rate_of_inputs: RateOfInputs,
    /// Training period, ns: the grid on which features are taken at any rate.
    pub period_ns: i64,
    /// [`fingerprint`] of the unit whose twin it corrects.
    pub twin: String,
    /// Names of the features, in the order of the trees' indices.
    pub features: Vec<String>,
    /// Where it knows its way.
    pub guard: Guard,
    /// Around its estimates, if there were enough rows.
    pub band: Option<Band>,
    /// Gain of each feature in training.
    pub importance: Vec<f64>,
    /// The booster's name and version.
    pub booster: String,
    /// Hyperparameters by the booster's names.
    pub hyperparameters: BTreeMap<String, f64>,
    /// Its provenance: names of the recordings, rows, seed and more.
    pub training: BTreeMap<String, String>,
    /// The trees.
    pub trees: Vec<Tree>,
}

/// Why a model cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The file is no model, or of another version.
    #[error("expected a residual model of schema `{SCHEMA}` that `govtwin train` wrote, found {found}")]
    Foreign {
        /// What was found.
        found: String,
    },
    /// The file was cut or changed.
    #[error("the model is damaged: {problem}; train it again or take a whole copy")]
    Damaged {
        /// What is wrong.
        problem: String,
    },
    /// The model is whole and for something else.
    #[error("the model does not fit: its {what} is {found}, needed here: {expected}")]
    Mismatch {
        /// What differs.
        what: &'static str,
        /// In the file.
        found: String,
        /// Here.
        expected: String,
    },
    /// The trees cannot be walked.
    #[error("the model is damaged: {0}; train it again or take a whole copy")]
    Trees(#[from] ForestError),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    schema: String,
    sha256: String,
}

/// What identifies a twin: all parameters and effects, to the last bit.
pub fn fingerprint(unit: &Unit) -> String {
    let mut hash = Digest::default();
    for entry in ENTRIES {
        hash.update(entry.key);
        hash.update_f64((entry.get)(&unit.parameters));
    }
    for effect in &unit.effects {
        hash.update(&effect.id);
        effect.values.iter().for_each(|&value| hash.update_f64(value));
    }
    hash.text()
}

impl Model {
    /// The text of its file; `None` where a number in it is not finite.
    pub fn to_text(&self) -> Option<String> {
        let body = serde_json::to_string(self).ok()?;
        // JSON has no word for such numbers; a text that does not read back is no model.
        serde_json::from_str::<Self>(&body).ok()?;
        let head = Head { schema: SCHEMA.to_owned(), sha256: sha256(&body) };
        Some(format!("{}\n{body}\n", serde_json::to_string(&head).ok()?))
    }

    /// Reads a file's text and checks that it is whole and makes sense.
    ///
    /// # Errors
    /// Where it is something else, damaged, or contradicts itself.
    pub fn from_text(text: &str) -> Result<Self, ModelError> {
        let damaged = |problem: String| ModelError::Damaged { problem };
        let (head, body) = text.split_once('\n').unwrap_or((text, ""));
        let head: Head = serde_json::from_str(head).map_err(|_| ModelError::Foreign {
            found: if head.is_empty() { "an empty file".to_owned() } else { "something else".to_owned() },
        })?;
        if head.schema != SCHEMA {
            return Err(ModelError::Foreign { found: format!("schema `{}`", head.schema) });
        }
        let body = body.strip_suffix('\n').unwrap_or(body);
        let found = sha256(body);
        if found != head.sha256 {
            return Err(damaged(format!("its checksum is {found}, its head says {}", head.sha256)));
        }
        let model: Self = serde_json::from_str(body).map_err(|error| damaged(error.to_string()))?;
        model.signal()?;
        model.forest()?;
        let features = model.features()?.len();
        // Every feature costs time in every row; more than there are would be no more than a way to take it.
        if let Some(twice) = model.features.iter().enumerate().find(|(at, name)| model.features[..*at].contains(name)) {
            return Err(damaged(format!("its feature `{}` stands twice", twice.1)));
        }
        for (what, len) in [("support", model.guard.support.len()), ("importance", model.importance.len())] {
            if len != features {
                return Err(damaged(format!("`{what}` has {len} entries for {features} features")));
            }
        }
        if let Some(problem) = model.guard.reach.as_ref().and_then(|reach| reach.problem(features)) {
            return Err(damaged(problem.to_owned()));
        }
        if model.guard.support.iter().chain([&model.guard.range]).any(|[low, high]| low > high) {
            return Err(damaged("a range ends before it begins".to_owned()));
        }
        if !(SHORTEST_PERIOD_NS..=LONGEST_PERIOD_NS).contains(&model.period_ns) {
            return Err(damaged(format!("its training period is {} ns; a twin needs 2 ms to 2 s", model.period_ns)));
        }
        Ok(model)
    }

    /// The signal that it corrects.
    ///
    /// # Errors
    /// Where no signal has that id, or its unit is another.
    pub fn signal(&self) -> Result<Signal, ModelError> {
        let signal = Signal::with_id(&self.signal).filter(|signal| signal.unit() == self.unit);
        signal.ok_or_else(|| ModelError::Mismatch {
            what: "signal",
            found: format!("`{}` in {}", self.signal, self.unit),
            expected: Signal::ALL.map(|signal| format!("`{}` in {}", signal.id(), signal.unit())).join(" or "),
        })
    }

    /// Its features.
    ///
    /// # Errors
    /// Where this version does not know one.
    pub fn features(&self) -> Result<Vec<Feature>, ModelError> {
        let find = |name: &String| {
            features::named(name).ok_or_else(|| ModelError::Mismatch {
                what: "list of features",
                found: format!("one with `{name}`"),
                expected: format!("features that {} knows", concat!("govtwin ", env!("CARGO_PKG_VERSION"))),
            })
        };
        self.features.iter().map(find).collect()
    }

    /// Ids of the processes that were left out of its training.
    pub fn left_out(&self) -> impl Iterator<Item = &str> {
        self.training.get(LEFT_OUT).into_iter().flat_map(|ids| ids.split(", "))
    }

    /// Its trees, ready to walk.
    ///
    /// # Errors
    /// Where they cannot be walked.
    pub fn forest(&self) -> Result<Forest, ModelError> {
        Ok(Forest::new(&self.trees, self.features.len())?)
    }

    /// Refuses a model that was trained for another twin, or for an opening from elsewhere.
    ///
    /// # Errors
    /// What differs.
    pub fn check(&self, unit: &Unit, opening: Opening) -> Result<(), ModelError> {
        let here = fingerprint(unit);
        if self.twin != here {
            return Err(ModelError::Mismatch {
                what: "twin (a digest of all parameters and effects)",
                found: format!("{}…", self.twin.get(..12).unwrap_or(&self.twin)),
                expected: format!("{}…; pass the parameters it was trained with, or train anew", &here[..12]),
            });
        }
        if self.opening != opening {
            return Err(ModelError::Mismatch {
                what: "guide-vane opening",
                found: self.opening.id().to_owned(),
                expected: format!("{} (see --cut)", opening.id()),
            });
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::any;
    use proptest::{prop_assert, proptest};

    use super::{Learned, Model, ModelError, fingerprint};
    use crate::features;
    use crate::forest::Tree;
    use crate::guard::Guard;
    use crate::row::{Opening, RateOfInputs};

    /// A model whose output is 0.01 if the command is above a half and −0.01 otherwise.
    pub fn model() -> Model {
        let features: Vec<String> = features::all().iter().map(features::Feature::name).collect();
        let count = features.len();
        Model {
            program: "govtwin test".into(),
            signal: "spool_position_pu".into(),
            unit: "pu".into(),
            learned: Learned::Residual,
            opening: Opening::Simulated,
            rate_of_inputs: RateOfInputs::Hold,
            period_ns: 200_000_000,
            twin: fingerprint(&govtwin_model::params::reference()),
            features,
            guard: Guard { support: vec![[-1e9, 1e9]; count], range: [-0.02, 0.02], reach: None },
            band: None,
            importance: vec![0.0; count],
            booster: "by hand".into(),
            hyperparameters: BTreeMap::new(),
            training: BTreeMap::new(),
            trees: vec![Tree {
                feature: vec![0],
                threshold: vec![0.5],
                left: vec![-1],
                right: vec![-2],
                leaf: vec![-0.01, 0.01],
            }],
        }
    }

    #[test]
    fn text_reads_back_whole() {
        let model = model();
        assert_eq!(Model::from_text(&model.to_text().unwrap()).unwrap(), model);
        let mut infinite = model;
        infinite.guard.range[1] = f64::INFINITY;
        assert_eq!(infinite.to_text(), None);
    }

    #[test]
    fn what_is_foreign_damaged_or_does_not_fit_is_refused_with_its_reason() {
        let model = model();
        let text = model.to_text().unwrap();
        let said = |text: &str| Model::from_text(text).unwrap_err().to_string();
        assert!(said("").contains("an empty file"));
        assert!(said("tree\nversion=v4\n").contains("something else"));
        assert!(said(&text.replace("residual/1", "residual/9")).contains("schema `govtwin-residual/9`"));
        assert!(said(&text[..text.len() / 2]).contains("checksum"));
        assert!(said(&text.replacen("-0.01", "-0.02", 1)).contains("checksum"));
        // A whole file whose content makes no sense.
        let changed = |change: fn(&mut Model)| {
            let mut other = super::tests::model();
            change(&mut other);
            said(&other.to_text().unwrap())
        };
        assert!(changed(|model| model.features[3] = "tomorrow_pu".into()).contains("`tomorrow_pu`"));
        assert!(changed(|model| model.unit = "mm".into()).contains("`spool_position_pu` in mm"));
        assert!(changed(|model| model.guard.support.truncate(2)).contains("`support`"));
        assert!(changed(|model| model.trees[0].right[0] = 7).contains("tree 0"));
        assert!(changed(|model| model.period_ns = 5).contains("training period is 5 ns"));
    }

    #[test]
    fn another_twin_or_mode_is_refused() {
        let mut unit = govtwin_model::params::reference();
        assert_eq!(model().check(&unit, Opening::Simulated), Ok(()));
        let error = model().check(&unit, Opening::Measured).unwrap_err();
        assert!(matches!(error, ModelError::Mismatch { what: "guide-vane opening", .. }));
        unit.parameters.oil.tank_pressure_pa += 1.0;
        assert!(model().check(&unit, Opening::Simulated).unwrap_err().to_string().contains("twin"));
    }

    proptest! {
        #[test]
        fn no_damage_goes_unseen(at in any::<proptest::sample::Index>(), byte in any::<u8>()) {
            let text = model().to_text().unwrap();
            let mut bytes = text.clone().into_bytes();
            let at = at.index(bytes.len());
            bytes[at] = byte;
            if let Ok(changed) = String::from_utf8(bytes) {
                let same = changed == text || changed.trim_end() == text.trim_end();
                prop_assert!(Model::from_text(&changed).is_err() || same);
            }
        }
    }
}
