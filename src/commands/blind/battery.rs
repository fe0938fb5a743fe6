//! A battery on disk: bags for the diagnosis, answers for the scorer alone.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use govtwin_diagnosis::result::Experiment;
use govtwin_files::digest::sha256;
use govtwin_files::{Claim, read_text, write_new};
use govtwin_lab::battery::plan::{BatteryRates, plan};
use govtwin_lab::battery::{self, Case as Plan, CaseKind, Label};
use govtwin_lab::labels;
use govtwin_model::parameters::Unit;
use govtwin_model::params::{self, Overlay};
use govtwin_model::recording::{Process, Recording};
use tempfile::TempDir;

use super::cases::UnitFolder;
use super::later;
use super::scoring::LARGEST_BYTES;
use super::shard::Shard;
use crate::commands::bags::{self, TopicArgs};
use crate::commands::generate;
use crate::commands::output::{Progress, write_atomically};
use crate::commands::report_file::text_if_there;

/// Where the answers are opened, below the battery's folder.
const LABELS: &str = "answers/labels.yaml";

/// How strong each unit's faults are, beside the answers: known only after many simulations.
const STRENGTHS: &str = "answers/strengths.yaml";

/// Which draw and sheet the battery's bags, or the reports beside it, are of, as a hash: whoever knows the seed knows the answers.
const DRAWN: &str = "drawn.sha256";

/// Whose simulator makes the bags, as they say of themselves.
const GENERATOR: &str = "blind --generate";

/// Where units come from, as pages say.
const ORIGIN: &str =
    "All units are synthetic: made by a simulator that shares the data sheet with the twin, but not its equations.";

/// The same where some of them are the twin itself.
const ORIGIN_WITH_TWINS: &str = "All units are synthetic: those of mismatch 0 are the twin itself, the others were made by a simulator that shares the \
                                 data sheet with the twin, but not its equations.";

/// A battery that was made; its labels are in no file yet.
#[derive(Debug)]
pub struct Battery {
    dir: PathBuf,
    sheet: Unit,
    /// Those of its part.
    plans: Vec<Plan>,
    /// Of all units, without strengths.
    labels: Vec<Label>,
    /// As far as they were measured before.
    strengths: BTreeMap<String, f64>,
    seed: u64,
    /// True values by unit, for as long as units are diagnosed.
    true_values: TempDir,
}

/// What the units of a battery are.
#[derive(Clone, Debug)]
pub enum BatteryOf {
    /// Whole chains.
    Chains {
        /// Rates of their recordings.
        rates: BatteryRates,
        /// Structural mismatches of the plants.
        mismatches: Vec<f64>,
    },
    /// Servomotor stages alone, with the data sheet or without.
    Stages {
        /// Whether they are judged by it.
        with_sheet: bool,
    },
}

/// Makes the bags of a part that are not there yet, and commits to the answers of all.
pub fn make(
    (dir, out): (&Path, &Path),
    unit: &Unit,
    count: usize,
    (seed, kind): (u64, &BatteryOf),
    shard: Shard,
) -> anyhow::Result<Battery> {
    let drawn = match kind {
        BatteryOf::Chains { rates, mismatches } if *mismatches == [1.0] => format!("{rates:?}"),
        BatteryOf::Chains { rates, mismatches } => format!("{rates:?}, mismatch {mismatches:?}"),
        BatteryOf::Stages { with_sheet } => format!("stages alone, {with_sheet}"),
    };
    let key = sha256(format!("seed {seed}, {drawn}, data sheet {}", params::unit_digest(unit)));
    // Where reports stand beside the bags, they are claimed with them.
    let mut claims = vec![(dir, dir.join("answers").join(DRAWN))];
    claims.extend((out != dir).then(|| (out, out.join(DRAWN))));
    for (folder, drawn) in &claims {
        check_claim(folder, drawn, &key)?;
    }
    for (folder, drawn) in &claims {
        // Of parts that begin at once one writes, and the others look again.
        let wrote = write_new(drawn, format!("{key}\n").as_bytes())
            .with_context(|| format!("cannot write {}", drawn.display()))?;
        if !wrote {
            check_claim(folder, drawn, &key)?;
        }
    }
    let all = match kind {
        BatteryOf::Chains { rates, mismatches } => plan(count, seed, rates, mismatches),
        BatteryOf::Stages { with_sheet } => battery::stage::plan(count, seed, *with_sheet),
    };
    let labels: Vec<Label> = all.iter().map(|case| battery::label(unit, case)).collect();
    let plans = shard.of(all);
    let made = Progress::each(&plans, "units generated", |case| {
        let lacking = |process: Process| !bags::is_bag_folder(&bag(dir, case, process));
        if case.processes().iter().copied().any(lacking) {
            let _unit = Claim::folder(&dir.join(&case.name))?;
            for (process, streams) in battery::make(unit, case).streams {
                if lacking(process) {
                    generate::write(made_by(case), process, case.seed, &streams, &bag(dir, case, process))?.place()?;
                }
            }
        }
        anyhow::Ok(())
    });
    made.into_iter().collect::<anyhow::Result<()>>()?;
    let known = text_if_there(&dir.join(STRENGTHS), LARGEST_BYTES)?;
    let strengths = known.and_then(|text| labels::read_strengths(&text).ok()).unwrap_or_default();
    let true_values = tempfile::tempdir().context("no temporary folder for true values")?;
    let battery = Battery { dir: dir.to_owned(), sheet: unit.clone(), plans, labels, strengths, seed, true_values };
    let key = sha256(battery.text());
    commit(&dir.join("answers/keys.sha256"), &format!("{key}  labels.yaml\n"))?;
    Ok(battery)
}

/// Writes a commitment, unless another part has written the same.
fn commit(path: &Path, text: &str) -> anyhow::Result<()> {
    let same = || read_text(path, LARGEST_BYTES).is_ok_and(|there| there == text);
    if same() || write_new(path, text.as_bytes()).with_context(|| format!("cannot write {}", path.display()))? || same()
    {
        return Ok(());
    }
    write_atomically(path, text.as_bytes())
}

/// Refuses a folder that holds another battery's bags or reports, which would be kept and scored by answers that are not theirs.
fn check_claim(folder: &Path, drawn: &Path, key: &str) -> anyhow::Result<()> {
    let there = match read_text(drawn, LARGEST_BYTES) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        there => there.with_context(|| format!("cannot read {}", drawn.display()))?,
    };
    if there.trim() != key {
        bail!(
            "{} is of a battery of another seed, rate, mismatch or data sheet ({}); expected --seed, --rate, --mismatch and --params as before, or a folder of its own",
            folder.display(),
            drawn.display()
        );
    }
    Ok(())
}

/// Which command and whose equations make a case's bags.
fn made_by(case: &Plan) -> (&'static str, &'static str) {
    (GENERATOR, if case.mismatch == 0.0 { govtwin_bag::TWIN } else { "independent of the twin" })
}

fn bag(dir: &Path, case: &Plan, process: Process) -> PathBuf {
    dir.join(&case.name).join(process.id())
}

impl Battery {
    /// Takes from the catalogue of each unit what it is to be diagnosed without, gives each its true values where there is a sheet, and drops units of
    /// other batteries.
    pub fn restrict(&self, cases: &mut Vec<UnitFolder>, with_sheet: bool) -> anyhow::Result<()> {
        cases.retain(|case| self.plans.iter().any(|plan| plan.name == case.name));
        for case in cases {
            let plan = self.plans.iter().find(|plan| plan.name == case.name);
            case.without = plan.and_then(|plan| match &plan.kind {
                CaseKind::LeftOut(id) => Some(id.clone()),
                _ => None,
            });
            let known = plan.filter(|_| with_sheet).and_then(|plan| battery::true_values(&self.sheet, plan));
            case.true_values = known.map(|unit| self.write_true_values(&case.name, unit)).transpose()?;
        }
        Ok(())
    }

    fn write_true_values(&self, name: &str, unit: Unit) -> anyhow::Result<PathBuf> {
        let path = self.true_values.path().join(format!("{name}.yaml"));
        let (name, source) = (name.to_owned(), GENERATOR.to_owned());
        let overlay = Overlay { unit, name, source, head: Vec::new(), comments: BTreeMap::new() };
        write_atomically(&path, params::overlay_text(&path, &overlay)?.as_bytes())?;
        Ok(path)
    }

    fn text(&self) -> String {
        format!("# Seed {}.\n{}", self.seed, labels::write(&self.labels))
    }

    /// Removes what opens the answers, so that no diagnosis finds it; all of it is written again at the end.
    pub fn close(&self, out: &Path) -> anyhow::Result<()> {
        let opened = [self.dir.join(LABELS), self.dir.join(STRENGTHS), out.join("score.json"), out.join("score.html")];
        for file in opened {
            match std::fs::remove_file(&file) {
                // None of them was written yet, or another part was here first.
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                other => other.with_context(|| format!("cannot remove {}", file.display()))?,
            }
        }
        Ok(())
    }

    /// Where its units come from, as pages say.
    pub fn origin(&self) -> &'static str {
        if self.labels.iter().any(|label| label.mismatch == 0.0) { ORIGIN_WITH_TWINS } else { ORIGIN }
    }

    /// The bag that a recorder would have of a unit's plant under a proposed test; none where its plant cannot be tried.
    pub fn answer(&self, name: &str, proposed: &Experiment, dir: &Path) -> anyhow::Result<Option<PathBuf>> {
        let Some(plan) = self.plans.iter().find(|plan| plan.name == name) else { return Ok(None) };
        let Some(streams) = battery::answer(&self.sheet, plan, proposed) else { return Ok(None) };
        let bag = dir.join("next_test");
        generate::write(made_by(plan), Process::LoadIncrease, plan.seed, &streams, &bag)?.place()?;
        Ok(Some(bag))
    }

    /// Writes the answers, now that nobody diagnoses any more, measures the strengths that are not known, and hands all out.
    pub fn answers(&self) -> anyhow::Result<Vec<Label>> {
        write_atomically(&self.dir.join(LABELS), self.text().as_bytes())?;
        let unknown: Vec<&Plan> = self.plans.iter().filter(|plan| !self.strengths.contains_key(&plan.name)).collect();
        let mut strengths = self.strengths.clone();
        // Nobody measures those of stages alone.
        let measured = Progress::each(unknown, "strengths measured", |plan| {
            (plan.name.clone(), battery::strength(&self.sheet, plan))
        });
        strengths.extend(measured.into_iter().filter(|(_, strength)| strength.is_finite()));
        if !strengths.is_empty() {
            let text = labels::write_strengths(&strengths);
            write_atomically(&self.dir.join(STRENGTHS), text.as_bytes())?;
            // As the file has them, so that a second score is the same.
            strengths = labels::read_strengths(&text)?;
        }
        let of = |label: &Label| strengths.get(&label.name).copied().unwrap_or(f64::NAN);
        Ok(self.labels.iter().map(|label| Label { strength_ratio: of(label), ..label.clone() }).collect())
    }

    /// Explained fraction that came true on recordings that are made now, and why units have none.
    pub fn validations(&self, out: &Path, sheet: &Unit) -> (BTreeMap<String, f64>, Vec<String>) {
        let made = |plan: &Plan| -> anyhow::Result<Option<Vec<Recording>>> {
            if plan.alone.is_some() {
                return Ok(None);
            }
            let bags = tempfile::tempdir().context("no temporary folder for its recordings")?;
            for (process, streams) in battery::fresh_recordings(sheet, plan) {
                generate::write(made_by(plan), process, plan.seed, &streams, &bags.path().join(process.id()))?
                    .place()?;
            }
            later::read(bags.path(), &TopicArgs::default(), sheet).map(Some)
        };
        later::fractions(&self.plans, |plan| &plan.name, made, out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_opens_the_answers_is_gone_before_a_diagnosis() {
        let (dir, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let unit = params::reference();
        let kind = BatteryOf::Chains { rates: BatteryRates::Both, mismatches: vec![1.0] };
        let battery = make((dir.path(), out.path()), &unit, 0, (3, &kind), Shard::default()).unwrap();
        let opened = [dir.path().join(LABELS), dir.path().join(STRENGTHS), out.path().join("score.html")];
        for file in &opened {
            std::fs::write(file, "").unwrap();
        }
        battery.close(out.path()).unwrap();
        assert!(opened.iter().all(|file| !file.exists()));
        assert!(dir.path().join("answers/keys.sha256").is_file(), "the commitment stays");
    }
}
