//! The page of a replay: pictures of measured, simulated and difference, then the figures.

mod answers;
mod curves;
mod ladder;
mod tables;
mod validation;

use super::draw::svg;
use super::page::{KeyFigure, Page, PageBody, Tone};
use govtwin_diagnosis::replay_summary::ReplaySummary;
use govtwin_model::number::significant;
use govtwin_model::parameters::Sensors;
use govtwin_model::provenance::Provenance;
use govtwin_model::recording::Process;
use govtwin_model::replay::Replayed;
use tables::{errors, r2_words, recording_table};

pub use curves::{Beside, Pictures, worst_stretch_of};
pub use ladder::{ladder_picture, ladder_table, reason_for_stars};
pub use tables::thousands;
pub use tables::{process_table, reason_for_dashes};

/// The page: `pictures` stand in the order of the summary's recordings, `replayed` too.
pub fn page(summary: &ReplaySummary, replayed: &[&Replayed], pictures: &[Pictures], sensors: &Sensors) -> Page {
    let mode = match summary.cut {
        "none" => "closed loop".to_owned(),
        cut => format!("cut at the {cut}"),
    };
    let unit = match summary.parameters.name.as_str() {
        "" => "the shipped reference unit",
        name => name,
    };
    let mut page = Page::new("Replay: measured and simulated", format!("{unit}, {mode}"));
    let body = &mut page.body;
    opening(body, summary, sensors);
    if let Some(validation) = &summary.validation {
        validation::show(body, validation, pictures);
    }
    for process in Process::ALL {
        let of_process = || summary.recordings.iter().zip(pictures).filter(|(one, _)| one.process == process.id());
        let count = of_process().count();
        if count == 0 {
            continue;
        }
        let mut title = process.title().to_owned();
        title[..1].make_ascii_uppercase();
        body.heading(title);
        let mut others = PageBody::new();
        for (i, (one, pictures)) in of_process().enumerate() {
            let into = if i == 0 { &mut *body } else { &mut others };
            show(into, &one.name, pictures);
        }
        if count > 1 {
            let noun = if count == 2 { "recording" } else { "recordings" };
            body.details(format!("{} more {noun} of this process", count - 1), others);
        }
    }
    body.heading("Errors by process");
    body.table(process_table(summary), "Errors over all rows of each process; MAE and RMSE in % of stroke.");
    if let Some(residual) = &summary.residual {
        let corrected = ReplaySummary {
            processes: residual.processes.clone(),
            overall: residual.overall.clone(),
            ..summary.clone()
        };
        let caption = format!(
            "The same with the learned residual of {} added. The rows include those that it was trained on.",
            residual.model
        );
        body.table(process_table(&corrected), caption);
    }
    if let Some(ladder) = &summary.ladder {
        body.heading("Comparison of units and learned residuals");
        body.figure(svg(&ladder_picture(ladder)), "Mean absolute error with each unit and each learned residual.");
        body.table(ladder_table(ladder), reason_for_stars(ladder).unwrap_or_default());
        for finding in &ladder.findings {
            body.paragraph(finding.clone());
        }
        body.heading("Distribution of the errors");
    }
    for one in replayed.iter().filter(|one| one.every > 1) {
        let Replayed { recording, rows, every, .. } = one;
        let shown = format!(
            "{}: plots and histograms show one in {every} of {rows} rows; tables and RMSE bars use all rows.",
            recording.name
        );
        body.note(Tone::Plain, shown);
    }
    body.figure(svg(&errors(summary, replayed, sensors)), "RMSE by process, with the transducer noise as a line, and histogram of the error (simulated − measured), for the first unit. The \
         outermost bars include all larger errors.");
    body.details_table(
        "Errors by recording",
        recording_table(summary),
        "MAE, RMSE, bias (mean of simulated − measured) and largest error in % of stroke.",
    );
    closing(body, summary);
    page
}

fn opening(body: &mut PageBody, summary: &ReplaySummary, sensors: &Sensors) {
    body.answers(answers::answers(summary, sensors));
    let mut key = vec![];
    for (signal, name, _) in answers::POSITIONS {
        if let Some(f) = summary.overall.of(signal) {
            let largest = format!("MAE {} %, largest {} %", percent(f.mae, 2), percent(f.max_abs, 2));
            key.push(KeyFigure::new(format!("RMSE, {name}"), percent(f.rmse, 3), "%").hint(largest));
            key.push(KeyFigure::new(format!("R², {name}"), r2_words(f.r2), ""));
        }
    }
    let seconds: f64 = summary.recordings.iter().map(|one| one.duration_s).sum();
    let rows: usize = summary.recordings.iter().map(|one| one.rows).sum();
    let hint = format!("{} rows, {} min", thousands(rows as u64), significant(seconds / 60.0, 2));
    key.push(KeyFigure::new("recordings", summary.recordings.len().to_string(), "").hint(hint));
    body.key_figures(key);
    if let Some(validation) = &summary.validation {
        let (broken, all) = (validation.broken().count(), validation.checks.len());
        if validation.passed {
            body.note(Tone::Good, format!("Validation: all {all} checks pass."));
        } else {
            body.note(Tone::Warning, format!("Validation: {broken} of {all} checks fail; see Limits."));
        }
    }
    for origin in summary.provenance.iter().flat_map(Provenance::origins) {
        body.note(Tone::Plain, origin);
    }
    if let Some(reason) = reason_for_dashes(summary) {
        body.note(Tone::Plain, reason);
    }
    let warned: Vec<_> = summary.recordings.iter().filter(|one| !one.warnings.is_empty()).collect();
    for one in warned.iter().take(5) {
        body.note(Tone::Warning, format!("{}: {}", one.name, one.warnings.join("; ")));
    }
    // What is noted of several recordings is noted once.
    let mut noted: Vec<(String, Vec<&str>)> = Vec::new();
    for one in summary.recordings.iter().filter(|one| !one.notes.is_empty()) {
        let words = one.notes.join("; ");
        match noted.iter_mut().find(|(known, _)| *known == words) {
            Some((_, names)) => names.push(&one.name),
            None => noted.push((words, vec![&one.name])),
        }
    }
    for (words, names) in noted.iter().take(5) {
        let names = if names.len() > 6 { format!("{} recordings", names.len()) } else { names.join(", ") };
        body.note(Tone::Plain, format!("{names}: {words}"));
    }
    if warned.len() > 5 {
        body.note(Tone::Warning, format!("{} more recordings have warnings; see the JSON.", warned.len() - 5));
    }
}

/// A share of a stroke in percent.
fn percent(share: f64, digits: u32) -> String {
    significant(100.0 * share, digits)
}

fn show(body: &mut PageBody, name: &str, pictures: &Pictures) {
    let band = "Grey band: ±2 standard deviations of transducer noise and resolution.";
    body.figure(pictures.whole.clone(), format!("{name}: signals, and below them simulated − measured. {band}"));
    if let Some(close_up) = &pictures.close_up {
        body.figure(close_up.clone(), format!("{name}: 20 s around the ESV trip or the largest movement. {band}"));
    }
    if let Some(worst) = &pictures.worst {
        body.figure(worst.clone(), format!("{name}: the 2 s with the largest error. {band}"));
    }
    if let Some(pilot) = &pictures.pilot {
        let mut inner = PageBody::new();
        inner.figure(pilot.clone(), format!("{name}: pilot signals. {band}"));
        body.details(format!("Pilot signals of {name}"), inner);
    }
}

fn closing(body: &mut PageBody, summary: &ReplaySummary) {
    let mut inner = PageBody::new();
    let files = summary.parameters.files.join(", ");
    let mut facts = vec![
        ("program".to_owned(), summary.program.to_owned()),
        (
            "parameter files".to_owned(),
            if files.is_empty() { "none: the shipped reference unit".into() } else { files },
        ),
    ];
    facts.extend(summary.parameters.changed.iter().map(|(key, value)| ((*key).to_owned(), value.to_string())));
    for effect in &summary.parameters.effects {
        let named = effect.parameters.iter().map(|(name, value)| format!("{name} {value}"));
        facts.push((format!("effect {}", effect.id), named.collect::<Vec<_>>().join(", ")));
    }
    let made = summary.provenance.iter().flat_map(Provenance::facts);
    inner.facts(facts.into_iter().chain(made.filter(|(name, _)| name != "program")));
    inner.paragraph(
        "MAE = mean |y − ŷ|, RMSE = √ mean (y − ŷ)², R² = 1 − Σ(y − ŷ)² / Σ(y − ȳ)², with y measured and ŷ simulated \
         (Liu et al. 2025, section 4.2). Rows without a measured value of a signal are ignored for that signal.",
    );
    body.details("How these figures were made", inner);
}
