//! The chronicle of a unit: diagnoses each process once, enters it, and writes history, page and state.

use std::path::PathBuf;

use anyhow::Context;
use govtwin_diagnosis::watch::cut::{CutProcess, Ended};
use govtwin_diagnosis::watch::history::{self, Course, ProcessEntry, SCHEMA};
use govtwin_diagnosis::{DiagnosisSettings, diagnose};
use govtwin_model::number::quantity;
use govtwin_model::parameters::Unit;
use govtwin_model::provenance::RecordingGiven;
use govtwin_pages::watch::{Watched, page};

use super::NAMES;
use crate::commands::output::{Output, Progress, print, warn_all};
use crate::commands::provenance::{self, PROGRAM};

/// Keeps the history of one unit.
pub struct Chronicle {
    /// The unit's data sheet.
    pub unit: Unit,
    /// What it is called.
    pub name: String,
    /// Folder of the history.
    pub out: PathBuf,
    /// How processes are diagnosed.
    pub settings: DiagnosisSettings,
    /// Effects that are followed from the first process on.
    pub only: Vec<String>,
    /// Processes between two false warnings of one size.
    pub between_false_alarms: f64,
    /// Lines of JSON instead of words.
    pub json: bool,
    /// The history.
    pub entries: Vec<ProcessEntry>,
    /// Something could not be read.
    pub warned: bool,
    /// Holds the folder as long as the watch lasts.
    pub _claim: Output,
}

impl Chronicle {
    /// The courses of all sizes.
    pub fn courses(&self) -> Vec<Course> {
        history::courses(&self.entries, self.between_false_alarms)
    }

    /// Diagnoses a process that is not in the history yet, and enters it; false of one that is.
    pub fn take(&mut self, given: &RecordingGiven, cut: CutProcess) -> anyhow::Result<bool> {
        if self.entries.iter().any(|entry| entry.digest == cut.digest) {
            return Ok(false);
        }
        self.entries.push(self.entry(given, cut));
        let warnings: Vec<String> = self.courses().iter().filter_map(Course::warning).collect();
        let Some(entry) = self.entries.last_mut() else { return Ok(false) };
        entry.warnings.clone_from(&warnings);
        let words = if self.json { serde_json::to_string(entry)? + "\n" } else { line(entry) };
        self.place()?;
        print(&words)?;
        warn_all(&warnings);
        Ok(true)
    }

    fn entry(&self, given: &RecordingGiven, cut: CutProcess) -> ProcessEntry {
        let CutProcess { mut recording, digest, ended } = cut;
        given.name.clone_into(&mut recording.name);
        let mut entry = ProcessEntry {
            schema: SCHEMA.to_owned(),
            digest,
            bag: given.name.clone(),
            synthetic: given.synthetic,
            origin: given.origin.clone(),
            time_ns: recording.frames.first().map_or(0, |frame| frame.time_ns),
            duration_s: recording.duration_s(),
            process: recording.process.id().to_owned(),
            verdict: "not_diagnosed".to_owned(),
            explained_fraction: None,
            sizes: vec![],
            notes: vec![],
            warnings: vec![],
            program: PROGRAM.to_owned(),
        };
        entry.notes.extend(match ended {
            Ended::AtRest => None,
            Ended::Gap => Some("Time jumped, which ended the process.".to_owned()),
            Ended::TooLong => Some("It had not ended after 300 s and goes on in the next.".to_owned()),
            Ended::OfRows => Some("The recording ended before the unit was at rest.".to_owned()),
        });
        let mut followed = history::followed(&self.entries);
        followed.extend(self.only.iter().cloned());
        let progress = Progress::new(100, "%");
        match diagnose(vec![recording], &self.unit, &self.settings, &|what, share| progress.at(share, what)) {
            Ok(diagnosis) => {
                diagnosis.verdict.id().clone_into(&mut entry.verdict);
                entry.explained_fraction = Some(diagnosis.explained_fraction.value).filter(|share| share.is_finite());
                entry.sizes = history::sizes(&diagnosis, &followed);
                entry.notes.extend(diagnosis.notes);
            }
            Err(error) => entry.notes.push(error.to_string()),
        }
        entry
    }

    /// Writes history, page and state; the history is whole at any moment.
    pub fn place(&self) -> anyhow::Result<()> {
        let courses = self.courses();
        let times: Vec<String> = self.entries.iter().map(|entry| provenance::date_of(entry.time_ns)).collect();
        let between_false_alarms = self.between_false_alarms;
        let watched = Watched {
            unit: &self.name,
            entries: &self.entries,
            courses: &courses,
            between_false_alarms,
            times: &times,
        };
        let state = serde_json::json!({
            "schema": SCHEMA, "unit": self.name, "processes": self.entries.len(),
            "between_false_alarms": between_false_alarms,
            "warnings": courses.iter().filter_map(Course::warning).collect::<Vec<_>>(),
            "sizes": courses.iter().map(state_of).collect::<Vec<_>>(),
            "newest": self.entries.last(),
        });
        let mut files = govtwin_files::Together::default();
        let texts =
            [history::write(&self.entries)?, page(&watched).to_html(), serde_json::to_string_pretty(&state)? + "\n"];
        let writing = || format!("cannot write in {}", self.out.display());
        for (name, text) in NAMES.iter().zip(texts) {
            files.add(&self.out.join(name), text.as_bytes()).with_context(writing)?;
        }
        files.place().with_context(writing)
    }

    /// What is said at the end.
    pub fn closing(&self, courses: &[Course]) -> String {
        let mut text = format!("{}: {} processes in the history\n", self.name, self.entries.len());
        for course in courses {
            let words = course.warning().unwrap_or_else(|| format!("{}: no change", course.title()));
            text += &format!("  {words}\n");
        }
        for origin in history::origins(&self.entries) {
            text += &format!("{origin}\n");
        }
        text + &format!("page: {}\n", self.out.join(NAMES[1]).display())
    }
}

/// One size for machines.
fn state_of(course: &Course) -> serde_json::Value {
    let (last, point) = (course.estimates.last(), course.points.last());
    serde_json::json!({
        "effect": course.effect, "parameter": course.parameter, "unit": course.unit, "estimates": course.estimates.len(),
        "value": last.map(|one| one.size), "process": last.map(|_| course.kind(course.estimates.len() - 1)), "ci90": last.map(|one| [one.low, one.high]), "mean_before": point.map(|point| point.mean),
        "growth": point.map(|point| point.sums.growth), "shrinkage": point.map(|point| point.sums.shrinkage), "limit": course.limit,
        "moved": point.is_some_and(|point| point.alarm),
        "since_process": point.and_then(|point| point.since).map(|since| course.entries[since]),
    })
}

/// A process in a line.
fn line(entry: &ProcessEntry) -> String {
    let named = entry.sizes.iter().filter(|size| size.named).map(|size| {
        let [low, high] = size.ci90.map(|end| quantity(end, &size.unit));
        format!(" {} {} ({low} to {high})", size.effect, quantity(size.value, &size.unit))
    });
    let sizes: Vec<String> = named.collect();
    let time = provenance::date_of(entry.time_ns);
    format!("{time} {} in {}: {}{}\n", entry.process, entry.bag, entry.verdict, sizes.join(","))
}
