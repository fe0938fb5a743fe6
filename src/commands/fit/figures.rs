//! The output of a fit: tables for a terminal, all figures as JSON.

use govtwin_diagnosis::identification::calibration::{Calibration, CalibrationRow};
use govtwin_diagnosis::likelihood::problem::Problem;
use govtwin_diagnosis::result::StageFigure;
use govtwin_model::number::{fixed, significant};
use govtwin_model::parameters::Unit;
use govtwin_model::params::{Sheet, quantity_text};
use govtwin_model::signal::Signal;
use govtwin_pages::diagnosis::figure_text;
use govtwin_pages::table::Table;
use serde_json::{Value, json};

use crate::commands::output::table_text;

/// Correlations that a terminal shows.
const SHOWN: usize = 5;

/// Tables and sentences.
pub fn text(problem: &Problem, base: &Unit, fitted: &Calibration, told: &[StageFigure]) -> String {
    let mut table =
        Table::new().words("key").words("unit").numbers("sheet").numbers("fitted").numbers("ci90 from").numbers("to");
    for name in ["sd from sheet", "learned"] {
        table = table.numbers(name);
    }
    table = table.words("");
    for row in &fitted.rows {
        let [low, high] = row.ci90.map(|end| significant(end, 4));
        let deviation = row.deviation.map_or_else(|| "free".to_owned(), |sd| format!("{sd:+.2}"));
        let cells =
            [row.key.clone(), row.unit.to_owned(), significant(row.sheet, 4), significant(row.fitted, 4), low, high];
        let last = [deviation, fixed(row.learned, 2), if row.at_bound { "at bound".to_owned() } else { String::new() }];
        table.row(cells.into_iter().chain(last));
    }
    let mut text = format!("{}\n{}", table_text(&table), table_text(&residuals(problem, base, fitted)));
    let costs: Vec<String> = fitted.starts.iter().map(|cost| significant(*cost, 5)).collect();
    text += &format!(
        "\nRemaining error, in multiples of the expected noise: {}. Cost from each start: {}.\n",
        leftover(fitted),
        costs.join(", ")
    );
    if let Some(sentence) = problem.limit_cycle_note() {
        text += &format!("{sentence}\n");
    }
    for pair in fitted.correlations.iter().take(SHOWN) {
        text += &format!("Correlated {:+.2}: {} and {}\n", pair.coefficient, pair.keys[0], pair.keys[1]);
    }
    if !told.is_empty() {
        text += "\nIn the units of the recordings:\n";
    }
    for one in told {
        text += &format!("  {}: {}\n", one.title, figure_text(one));
    }
    text += "\n";
    for sentence in fitted.identifiability() {
        text += &format!("{sentence}\n");
    }
    text
}

/// What each signal residuals over the noise to be expected.
pub fn leftover(fitted: &Calibration) -> String {
    let ratios = Signal::ALL.into_iter().zip(fitted.leftover);
    let words = ratios.filter_map(|(signal, ratio)| Some(format!("{} {:.2}", signal.id(), ratio?)));
    words.collect::<Vec<_>>().join(", ")
}

/// Root mean square residuals of the mean twin, per recording and signal, before and after; of a limit cycle those of its loudness.
struct SignalResidual {
    recording: String,
    signal: Signal,
    samples: usize,
    sheet: f64,
    fitted: f64,
}

fn all_residuals(problem: &Problem, base: &Unit, fitted: &Calibration) -> Vec<SignalResidual> {
    let mut all = vec![];
    for (index, recording) in problem.recordings.iter().enumerate() {
        let [before, after] = [base, &fitted.unit].map(|unit| problem.simulate(unit, index));
        for signal in recording.signals() {
            let squares = |estimates: &[govtwin_model::frame::Estimate]| {
                let squares = problem.squares(index, signal, estimates).unwrap_or_default();
                let finite: Vec<f64> = squares.into_iter().filter(|square| square.is_finite()).collect();
                (finite.len(), (finite.iter().sum::<f64>() / finite.len().max(1) as f64).sqrt())
            };
            let ((samples, sheet), (_, fitted)) = (squares(&before), squares(&after));
            all.push(SignalResidual { recording: recording.name.clone(), signal, samples, sheet, fitted });
        }
    }
    all
}

fn residuals(problem: &Problem, base: &Unit, fitted: &Calibration) -> Table {
    let mut table = Table::new().words("recording").words("signal").numbers("samples");
    table = table.numbers_of("RMSE", "sheet").numbers_of("RMSE", "fitted");
    for residual in all_residuals(problem, base, fitted) {
        let figures = [residual.sheet, residual.fitted].map(|rmse| quantity_text_short(rmse, residual.signal.unit()));
        let words = [residual.recording, residual.signal.id().to_owned(), residual.samples.to_string()];
        table.row(words.into_iter().chain(figures));
    }
    table
}

fn quantity_text_short(value: f64, unit: &str) -> String {
    format!("{} {unit}", significant(value, 3))
}

/// All figures.
pub fn json(
    problem: &Problem,
    sheet: &Sheet,
    fitted: &Calibration,
    told: &[StageFigure],
    warnings: &[String],
) -> Value {
    let recordings: Vec<Value> = problem
        .recordings
        .iter()
        .map(|recording| {
            json!({"name": recording.name, "process": recording.process.id(), "samples": recording.samples.len(), "period_s": recording.period_s})
        })
        .collect();
    let residuals: Vec<Value> = all_residuals(problem, &sheet.unit, fitted)
        .into_iter()
        .map(|residual| {
            json!({
                "recording": residual.recording, "signal": residual.signal.id(), "samples": residual.samples,
                "rmse": {"sheet": residual.sheet, "fitted": residual.fitted},
            })
        })
        .collect();
    let correlations: Vec<Value> =
        fitted.correlations.iter().map(|pair| json!({"keys": pair.keys, "coefficient": pair.coefficient})).collect();
    json!({
        "schema": "govtwin-fit/1",
        "name": sheet.name,
        "recordings": recordings,
        "parameters": fitted.rows.iter().map(parameter).collect::<Vec<Value>>(),
        "misses": residuals,
        "cost": {"misses": fitted.fit.square, "prior": fitted.fit.prior, "starts": fitted.starts},
        "leftover": Signal::ALL.into_iter().zip(fitted.leftover).filter_map(|(signal, ratio)| Some((signal.id(), ratio?)))
            .collect::<std::collections::BTreeMap<_, _>>(),
        "correlations": correlations,
        "fitted_stage": told,
        "identifiability": fitted.identifiability(),
        "warnings": warnings,
    })
}

fn parameter(row: &CalibrationRow) -> Value {
    json!({
        "key": row.key, "unit": row.unit, "sheet": row.sheet, "fitted": row.fitted, "ci90": row.ci90,
        "sd_from_sheet": row.deviation, "at_bound": row.at_bound, "learned": row.learned,
        "text": quantity_text(row.fitted, row.unit),
    })
}
