//! The tables of a replay, and the pictures of its figures.

use super::curves::spread;
use super::percent;
use crate::ink::Ink;
use crate::picture::{Panel, Picture};
use crate::table::Table;
use govtwin_diagnosis::replay_summary::ReplaySummary;
use govtwin_model::number::fixed;
use govtwin_model::parameters::Sensors;
use govtwin_model::recording::Process;
use govtwin_model::replay::Replayed;
use govtwin_model::replay::figures::SignalFigures;
use govtwin_model::signal::Signal;

/// Why a signal has dashes instead of figures: a cut replaces it by the recorded one.
pub fn reason_for_dashes(summary: &ReplaySummary) -> Option<String> {
    let cut = summary.overall.signals.iter().find(|figures| figures.stands_in)?;
    let signal = Signal::with_id(cut.name)?;
    Some(format!(
        "Cut at the {}: the measured {} stands in for the simulated one, so its error is not evaluated.",
        summary.cut,
        signal.title().to_lowercase(),
    ))
}

/// The figures per process and overall.
pub fn process_table(summary: &ReplaySummary) -> Table {
    let mut table = Table::new().words("process").numbers("recordings").numbers("rows");
    for name in ["servomotor", "spool"] {
        table = table.numbers_of(name, "MAE, %").numbers_of(name, "RMSE, %").numbers_of(name, "R²");
    }
    for group in summary.processes.iter().chain([&summary.overall]) {
        let process = group.process.and_then(Process::with_id);
        let rows = group.signals.iter().take(2).map(|figures| figures.rows).max().unwrap_or(0);
        let mut cells = vec![process.map_or("overall", Process::title).to_owned(), group.recordings.to_string()];
        cells.push(thousands(rows));
        for signal in Signal::POSITIONS {
            cells.extend(group.of(signal).map(figure_cells).unwrap_or_default());
        }
        match process {
            Some(_) => table.row(cells),
            None => table.strong_row(cells),
        }
    }
    table
}

pub(crate) fn recording_table(summary: &ReplaySummary) -> Table {
    let mut table = Table::new().words("recording").words("process").numbers("rows").numbers("length, s");
    for name in ["servomotor", "spool"] {
        for figure in ["MAE", "RMSE", "R²", "bias", "largest"] {
            table = table.numbers_of(name, figure);
        }
    }
    for one in &summary.recordings {
        let mut cells = vec![
            one.name.clone(),
            Process::with_id(one.process).map_or(one.process, Process::title).to_owned(),
            one.rows.to_string(),
            fixed(one.duration_s, 1),
        ];
        for figures in one.signals.iter().take(2) {
            cells.extend(figure_cells(figures));
            cells.extend([percent(figures.bias, 3), percent(figures.max_abs, 3)]);
        }
        table.row(cells);
    }
    table
}

/// The process of an id.
fn figure_cells(figures: &SignalFigures) -> Vec<String> {
    vec![percent(figures.mae, 3), percent(figures.rmse, 3), r2_words(figures.r2)]
}

/// R² cut off rather than rounded, so that only a perfect twin shows a one.
pub(crate) fn r2_words(r2: f64) -> String {
    fixed((r2 * 1e5).floor() / 1e5, 5)
}

/// A whole number with its thousands set apart.
pub fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// RMSE by process, and how the differences are spread.
pub(crate) fn errors(summary: &ReplaySummary, replayed: &[&Replayed], sensors: &Sensors) -> Picture {
    let mut panels = vec![];
    let titles =
        summary.processes.iter().filter_map(|group| group.process.and_then(Process::with_id).map(Process::title));
    let titles: Vec<&str> = titles.collect();
    for (signal, name, _) in super::answers::POSITIONS {
        let Some(overall) = summary.overall.of(signal).filter(|f| f.rmse.is_finite()) else { continue };
        let rmse: Vec<f64> =
            summary.processes.iter().filter_map(|group| group.of(signal)).map(|f| 100.0 * f.rmse).collect();
        panels.push(
            Panel::new(format!("RMSE of the {name}, %"))
                .x_categories(titles.clone())
                .bars(Ink::Difference, "", &rmse, 0, 1)
                .level(Ink::Text, "transducer noise", 100.0 * spread(signal.sensor(sensors))),
        );
        let differences: Vec<f64> = replayed
            .iter()
            .flat_map(|one| one.recording.frames.iter().zip(&one.estimates))
            .map(|(frame, estimate)| 100.0 * (signal.of(&estimate.signals) - signal.of(&frame.measured)))
            .collect();
        let reach = 100.0 * (3.0 * overall.rmse).max(4.0 * spread(signal.sensor(sensors)));
        panels.push(
            Panel::new(format!("Error of the {name}, share of rows"))
                .histogram(Ink::Difference, &differences, [-reach, reach], 61)
                .x_name("simulated − measured, %"),
        );
    }
    Picture::grid("Errors by process and their spread", 2, panels)
}
