//! The faults of a unit and the twin that has them: of a diagnosis that is there, or of a fresh one.

use std::path::Path;

use anyhow::bail;
use govtwin_diagnosis::acceptance::counterfactual::SizeKnowledge;
use govtwin_diagnosis::result::{Blame, Verdict};
use govtwin_diagnosis::{DiagnosisSettings, diagnose};
use govtwin_model::effects::find_in;
use govtwin_model::parameters::Unit;
use govtwin_model::params;
use govtwin_model::provenance::{Provenance, RecordingGiven};
use govtwin_model::recording::Recording;

use crate::commands::diagnose::FITTED;
pub use crate::commands::diagnose::REPORT;
use crate::commands::output::Progress;
use crate::commands::report_file;

/// What a diagnosis found.
#[derive(Debug)]
pub struct FoundFaults {
    /// The verdict's word.
    pub verdict: String,
    /// The effects that it names, as far as the twin has them.
    pub named: Vec<String>,
    /// How far their sizes are known.
    pub sizes: Vec<SizeKnowledge>,
    /// The twin with them.
    pub unit: Unit,
    /// What a reader must know.
    pub notes: Vec<String>,
    /// What the diagnosis was made from, where it is not of this very run.
    made: Option<Provenance>,
}

impl FoundFaults {
    /// Of the folder that `govtwin diagnose` wrote.
    pub fn load(folder: &Path) -> anyhow::Result<Self> {
        let report = folder.join(REPORT);
        if !report_file::is_there(&report)? {
            bail!(
                "--diagnosis: expected the folder of a diagnosis, found no {}; `govtwin diagnose BAG… --out DIR` makes one",
                report.display()
            );
        }
        let diagnosis = report_file::diagnosis(&report)?;
        if !diagnosis.provenance.iter().any(|made| made.written.contains_key(FITTED)) {
            bail!(
                "{}: provenance.written: expected the digest of {FITTED}, found none; take both from one run of `govtwin diagnose`",
                report.display()
            );
        }
        let unit = params::load(&folder.join(FITTED))?;
        Ok(Self::of(diagnosis.verdict, &diagnosis.effects, unit, vec![], diagnosis.provenance))
    }

    /// Of a fresh diagnosis.
    pub fn diagnose(recordings: &[Recording], sheet: &Unit) -> anyhow::Result<Self> {
        let progress = Progress::new(100, "%");
        let settings = DiagnosisSettings::default();
        let diagnosis = diagnose(recordings.to_vec(), sheet, &settings, &|what, share| progress.at(share, what))?;
        drop(progress);
        Ok(Self::of(diagnosis.verdict, &diagnosis.blamed, diagnosis.fitted, diagnosis.notes, None))
    }

    fn of(verdict: Verdict, blamed: &[Blame], unit: Unit, notes: Vec<String>, made: Option<Provenance>) -> Self {
        let has = |id: &str| unit.effects.iter().any(|setting| setting.id == id);
        let named: Vec<String> = blamed.iter().map(|blame| blame.id.clone()).filter(|id| has(id)).collect();
        let mut sizes = vec![];
        for blame in blamed.iter().filter(|blame| has(&blame.id)) {
            let Some(spec) = find_in(&unit, &blame.id) else { continue };
            for (parameter, known) in spec.parameters.iter().enumerate() {
                let is_it = |name: &str| name == known.name || name.ends_with(&format!(".{}", known.name));
                let fitted = blame.parameters.iter().find(|fitted| is_it(&fitted.name));
                let Some(value) = fitted.map(|fitted| fitted.value) else { continue };
                let ends = [value.low, value.high].map(|end| end.clamp(known.min, known.max));
                if ends.iter().all(|end| end.is_finite()) {
                    sizes.push(SizeKnowledge { effect: blame.id.clone(), parameter, ends });
                }
            }
        }
        Self { verdict: verdict.id().to_owned(), named, sizes, unit, notes, made }
    }

    /// What to say where the diagnosis is of other recordings than these.
    pub fn doubt(&self, made: &Provenance) -> Option<String> {
        let there = self.made.as_ref()?;
        let (old, new) = (there.digests(), made.digests());
        let shared = old.iter().any(|digest| new.contains(digest));
        if !shared {
            return Some(format!(
                "the diagnosis is of `{}`, of other recordings than these; is it of the same unit?",
                there.unit
            ));
        }
        let unknown = |one: &&RecordingGiven| !one.files.iter().all(|file| old.contains(&file.sha256.as_str()));
        let of_name = |one: &&RecordingGiven| there.recordings.iter().any(|known| known.name == one.name);
        if let Some(changed) = made.recordings.iter().filter(unknown).find(of_name) {
            return Some(format!(
                "{}: the diagnosis of `{}` is of another recording of that name; was it changed since?",
                changed.name, there.unit
            ));
        }
        (there.sheet.sha256 != made.sheet.sha256).then(|| {
            format!(
                "the diagnosis of `{}` was made with another data sheet than this test; name the same with --params",
                there.unit
            )
        })
    }
}
