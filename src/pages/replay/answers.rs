//! The four answers at the head of a replay: where the error is largest, how sure that is, how large the error is, and what to do next.

use super::curves::spread;
use super::{percent, r2_words};
use govtwin_diagnosis::replay_summary::ReplaySummary;
use govtwin_model::parameters::Sensors;
use govtwin_model::recording::Process;
use govtwin_model::replay::figures::RecordingGroup;
use govtwin_model::signal::Signal;

/// The evaluated positions by their usual names, with the reference of their percentages.
pub(crate) const POSITIONS: [(Signal, &str, &str); 2] = [
    (Signal::ServomotorPosition, "servomotor", "its stroke"),
    (Signal::SpoolPosition, "spool", "its reference stroke"),
];

/// The answers, each under its question.
pub(crate) fn answers(summary: &ReplaySummary, sensors: &Sensors) -> Vec<(&'static str, Vec<String>)> {
    let far =
        said(|signal, name, of| Some(format!("{name} {} % of {of}", percent(rmse(&summary.overall, signal)?, 2))));
    if far.is_empty() {
        let nothing = "Nothing to compare: no position was both measured and simulated.";
        let next = "`govtwin info BAG` lists the signals of a recording.";
        return vec![("Result", vec![nothing.to_owned()]), ("What next", vec![next.to_owned()])];
    }
    let noise = said(|signal, name, _| {
        let share = rmse(&summary.overall, signal).map(|_| spread(signal.sensor(sensors)))?;
        (share > 0.0).then(|| format!("{name} {} %", percent(share, 2)))
    });
    let r2 = said(|signal, name, _| summary.overall.of(signal).map(|f| format!("{name} {}", r2_words(f.r2))));
    let mut sure = vec![format!("R²: {}.", r2.join(", "))];
    if !noise.is_empty() {
        sure.push(format!("RMS error from noise and resolution of the transducers alone: {}.", noise.join(", ")));
    }
    let how_far = match after(summary) {
        Some(after) => format!("RMS error over all rows: {}; {after}.", far.join(", ")),
        None => format!("RMS error over all rows: {}.", far.join(", ")),
    };
    vec![
        ("Result", vec![farthest(summary)]),
        ("How sure", sure),
        ("Error", vec![how_far]),
        ("What next", vec![next(summary)]),
    ]
}

/// One text for each position that has one.
fn said(of: impl Fn(Signal, &'static str, &'static str) -> Option<String>) -> Vec<String> {
    POSITIONS.into_iter().filter_map(|(signal, name, stroke)| of(signal, name, stroke)).collect()
}

fn rmse(group: &RecordingGroup, signal: Signal) -> Option<f64> {
    group.of(signal).map(|figures| figures.rmse).filter(|rmse| rmse.is_finite())
}

/// In which process the twin is farthest off.
fn farthest(summary: &ReplaySummary) -> String {
    let not_why = "A replay shows how much twin and unit differ, not why";
    let judged = POSITIONS.into_iter().find(|(signal, ..)| rmse(&summary.overall, *signal).is_some());
    let known = summary.processes.iter().filter_map(|group| {
        let process = Process::with_id(group.process?)?;
        Some((process, group, rmse(group, judged?.0)?))
    });
    let Some((process, group, _)) = known.max_by(|a, b| a.2.total_cmp(&b.2)) else { return format!("{not_why}.") };
    let there = said(|signal, name, _| Some(format!("{name} {} %", percent(rmse(group, signal)?, 2))));
    let judged = judged.map_or("", |(_, name, _)| name);
    let most = if summary.processes.len() > 1 { format!("The {judged} error is largest") } else { "Error".to_owned() };
    format!("{most} in the {}: {} (RMS). {not_why}.", process.title(), there.join(", "))
}

/// The remaining error with the learned residual, or of the last unit of a ladder, in half a sentence.
fn after(summary: &ReplaySummary) -> Option<String> {
    let left = |group: &RecordingGroup| {
        said(|signal, name, _| Some(format!("{name} {} %", percent(rmse(group, signal)?, 2)))).join(", ")
    };
    if let Some(residual) = &summary.residual {
        return Some(format!("with the learned residual {}", left(&residual.overall)));
    }
    let rungs = summary.ladder.iter().flat_map(|ladder| ladder.rungs.iter().skip(1));
    let last = rungs.rev().find(|rung| rung.model.is_none())?;
    Some(format!("with {} {}", last.title, left(&last.overall)))
}

fn next(summary: &ReplaySummary) -> String {
    if summary.ladder.is_some() {
        return "Compare the units by process below: a change that reflects the real unit lowers the error in all of them."
            .to_owned();
    }
    "`govtwin diagnose` with the same recordings finds out why.".to_owned()
}
