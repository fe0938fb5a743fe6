//! A battery on disk: bags for the diagnosis, answers for the scorer alone.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use govtwin::battery::plan::{Rates, plan};
use govtwin::battery::{self, Case as Plan, Kind, Label};
use govtwin::blind::exam;
use govtwin::digest::sha256;
use govtwin::parameters::Unit;
use govtwin::params::{self, labels};
use govtwin::recording::Process;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

use super::cases::Case;
use crate::commands::output::{Progress, write_atomically};
use crate::commands::{bags, generate};

/// Where the answers are opened, below the battery's folder.
const LABELS: &str = "answers/labels.yaml";

/// Which draw and sheet the battery's bags, or the reports beside it, are of, as a hash: whoever knows the seed knows the answers.
const DRAWN: &str = "drawn.sha256";

/// A battery that was made; its labels are in no file yet.
#[derive(Debug)]
pub struct Battery {
    dir: PathBuf,
    plans: Vec<Plan>,
    labels: Vec<Label>,
    seed: u64,
}

/// Makes the bags that are not there yet, and commits to the answers; units whose answers were opened before are not simulated again.
pub fn make(dir: &Path, out: &Path, unit: &Unit, count: usize, seed: u64, rates: Rates) -> anyhow::Result<Battery> {
    let key = sha256(format!("seed {seed}, {rates:?}, {unit:?}"));
    claim(dir, &dir.join("answers").join(DRAWN), &key)?;
    if out != dir {
        claim(out, &out.join(DRAWN), &key)?;
    }
    let plans = plan(count, seed, rates);
    let opened = super::scoring::read_labels(&dir.join(LABELS)).unwrap_or_default();
    let progress = Progress::new(plans.len(), "units made");
    let labels: anyhow::Result<Vec<Label>> = plans
        .par_iter()
        .map(|case| {
            let label = match known(&opened, &battery::label(unit, case)) {
                Some(label)
                    if Process::ALL.into_iter().all(|process| bags::is_bag_folder(&bag(dir, case, process))) =>
                {
                    label
                }
                _ => {
                    let made = battery::make(unit, case);
                    for (process, streams) in &made.streams {
                        let bag = bag(dir, case, *process);
                        if !bags::is_bag_folder(&bag) {
                            generate::write(*process, case.seed, streams, &bag)?;
                        }
                    }
                    made.label
                }
            };
            progress.step();
            Ok(label)
        })
        .collect();
    let battery = Battery { dir: dir.to_owned(), plans, labels: labels?, seed };
    let key = sha256(battery.text());
    write_atomically(&dir.join("answers/keys.sha256"), format!("{key}  labels.yaml\n").as_bytes())?;
    Ok(battery)
}

/// Takes a folder for the battery of a key; one that holds another's is refused, since what is there would be kept and scored by answers that
/// are not its own.
fn claim(folder: &Path, drawn: &Path, key: &str) -> anyhow::Result<()> {
    if std::fs::read_to_string(drawn).is_ok_and(|there| there.trim() != key) {
        bail!(
            "{} is of a battery of another seed, rate or data sheet ({}); expected --seed, --rate and --params as before, or a folder of its own",
            folder.display(),
            drawn.display()
        );
    }
    write_atomically(drawn, format!("{key}\n").as_bytes())
}

fn bag(dir: &Path, case: &Plan, process: Process) -> PathBuf {
    dir.join(&case.name).join(process.id())
}

/// The label with its strength, if it was opened before.
fn known(opened: &[Label], label: &Label) -> Option<Label> {
    let known = opened.iter().find(|known| known.name == label.name)?;
    (Label { strength_ratio: known.strength_ratio, ..label.clone() } == *known).then(|| known.clone())
}

impl Battery {
    /// Takes from the catalogue of each unit what it is to be diagnosed without, and drops units of other batteries.
    pub fn restrict(&self, cases: &mut Vec<Case>) {
        cases.retain(|case| self.plans.iter().any(|plan| plan.name == case.name));
        for case in cases {
            let plan = self.plans.iter().find(|plan| plan.name == case.name);
            case.without = plan.and_then(|plan| match &plan.kind {
                Kind::LeftOut(id) => Some(id.clone()),
                _ => None,
            });
        }
    }

    fn text(&self) -> String {
        format!("# Seed {}.\n{}", self.seed, labels::write(&self.labels))
    }

    /// Writes the answers, now that nobody diagnoses any more, and hands them out.
    pub fn answers(&self) -> anyhow::Result<Vec<Label>> {
        let path = self.dir.join(LABELS);
        write_atomically(&path, self.text().as_bytes())?;
        super::scoring::read_labels(&path)
    }

    /// Closure that came true, for every unit whose reports say what to try; and why others have none.
    pub fn exams(&self, out: &Path, sheet: &Unit) -> (BTreeMap<String, f64>, Vec<String>) {
        let progress = Progress::new(self.plans.len(), "exams");
        let realised: Vec<anyhow::Result<Option<f64>>> = self
            .plans
            .par_iter()
            .map(|plan| {
                let closure = realised(out, sheet, plan);
                progress.step();
                closure
            })
            .collect();
        drop(progress);
        let (mut closures, mut failed) = (BTreeMap::new(), Vec::new());
        for (plan, closure) in self.plans.iter().zip(realised) {
            match closure {
                Ok(closure) => closures.extend(closure.map(|closure| (plan.name.clone(), closure))),
                Err(error) => failed.push(format!("{}: closure not examined: {error:#}", plan.name)),
            }
        }
        (closures, failed)
    }
}

/// Closure on recordings that are made now and read as any others; none where the reports name nothing.
fn realised(out: &Path, sheet: &Unit, plan: &Plan) -> anyhow::Result<Option<f64>> {
    let at = |file: &str| -> anyhow::Result<Option<Unit>> {
        let path = out.join(&plan.name).join(file);
        Ok(if path.is_file() { Some(params::load(&path)?) } else { None })
    };
    let (Some(refitted), Some(improved)) = (at("refitted.yaml")?, at("fitted.yaml")?) else { return Ok(None) };
    if improved.effects.is_empty() {
        return Ok(None);
    }
    let bags = tempfile::tempdir().context("no temporary folder for its recordings")?;
    for (process, streams) in battery::exam(sheet, plan) {
        generate::write(process, plan.seed, &streams, &bags.path().join(process.id()))?;
    }
    let fresh = bags::read(&[bags.path().to_owned()])?;
    Ok(exam::closure(fresh.recordings, &refitted, &improved))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_that_were_opened_are_known_again_and_no_others() {
        let unit = params::reference();
        let labels: Vec<Label> = plan(12, 3, Rates::Both)
            .iter()
            .map(|case| Label { strength_ratio: 2.5, ..battery::label(&unit, case) })
            .collect();
        let opened = labels::read(&labels::write(&labels)).unwrap();
        for (case, label) in plan(12, 3, Rates::Both).iter().zip(labels) {
            assert_eq!(known(&opened, &battery::label(&unit, case)), Some(label));
        }
        let others = plan(20, 4, Rates::Both);
        let mixed = others.iter().filter_map(|case| known(&opened, &battery::label(&unit, case)));
        assert!(mixed.into_iter().all(|label| label.effects.is_empty()), "only what is sound is alike");
    }
}
