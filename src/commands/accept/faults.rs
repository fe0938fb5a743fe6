//! The faults of a unit and the twin that has them: of a diagnosis that is there, or of a fresh one.

use std::path::Path;

use anyhow::bail;
use govtwin_diagnosis::acceptance::counterfactual::SizeKnowledge;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::{Blame, Verdict};
use govtwin_diagnosis::{DiagnosisSettings, diagnose};
use govtwin_model::effects::find_in;
use govtwin_model::parameters::Unit;
use govtwin_model::params;
use govtwin_model::provenance::Provenance;
use govtwin_model::recording::Recording;

use crate::commands::diagnose::FITTED;
use crate::commands::output::Progress;
use crate::commands::{provenance, report_file};

/// The machine-readable report of a diagnosis.
pub const REPORT: &str = "report.json";

/// Refuses a twin that is not the one of the report beside it: by its digest, and where an older report states none by the effects that it has.
fn belongs(report: &DiagnosisReport, fitted: &Path, unit: &Unit) -> anyhow::Result<()> {
    let shown = fitted.display();
    let way_out = "take both from one run of `govtwin diagnose`";
    if let Some(stated) = report.provenance.iter().find_map(|made| made.written.get(FITTED)) {
        let found = provenance::file(fitted)?.sha256;
        if found != *stated {
            bail!(
                "{shown}: expected the twin of the report beside it (SHA-256 {stated:.12}), found another file ({found:.12}), changed or of another \
                 diagnosis; {way_out}",
            );
        }
        return Ok(());
    }
    let has = |id: &str| unit.effects.iter().any(|setting| setting.id == id);
    let named = matches!(report.verdict, Verdict::Named);
    if let Some(blame) = report.effects.iter().find(|blame| named && !has(&blame.id)) {
        bail!(
            "{shown}: expected a twin with `{}`, which the report beside it names, found one without; {way_out}",
            blame.id
        );
    }
    if let Some(other) =
        unit.effects.iter().find(|setting| named && !report.effects.iter().any(|blame| blame.id == setting.id))
    {
        bail!("{shown}: found `{}`, which the report beside it does not name; {way_out}", other.id);
    }
    Ok(())
}

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
        let fitted = folder.join(FITTED);
        let unit = params::load(&fitted)?;
        belongs(&diagnosis, &fitted, &unit)?;
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
        (there.sheet.sha256 != made.sheet.sha256).then(|| {
            format!(
                "the diagnosis of `{}` was made with another data sheet than this test; name the same with --params",
                there.unit
            )
        })
    }
}
