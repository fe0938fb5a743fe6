//! What the pages of a comparison and of a training answer first: the result, how sure it is, the error by process, and what to do next.

use super::title;
use crate::comparison::summary::{ComparisonSummary, Covered, ModelFigures};
use govtwin_model::number::{fixed, significant};

/// The answers, each under its question.
pub(crate) type Answers = [(&'static str, Vec<String>); 4];

/// Of a comparison whose figures have this unit.
pub(crate) fn of_comparison(summary: &ComparisonSummary, unit: &str) -> Answers {
    let of = |id: &str| summary.models.iter().find(|model| model.id == id);
    let best = summary.ranking.first().and_then(|id| of(id));
    let twin = of("mbm");
    let mut what = Vec::new();
    if let Some(best) = best {
        let beside = [(twin, "the twin alone (MBM)"), (of("ddm"), "data alone (DDM)")];
        let beside = beside.iter().filter_map(|(other, name)| Some(format!("{} {name}", less(best, (*other)?))));
        what.push(format!(
            "The best hybrid is {}: mean absolute error {} {unit}, {}.",
            best.title,
            significant(best.overall.mae, 3),
            beside.collect::<Vec<_>>().join(" and ")
        ));
    }
    let order: Vec<&str> = summary.ranking.iter().filter_map(|id| of(id)).map(|model| model.title).collect();
    what.push(format!("Hybrids by MAE on all test rows: {}.", order.join(" < ")));
    let seeds = match summary.seeds.len() {
        1 => "one seed".to_owned(),
        more => format!("{more} seeds"),
    };
    let rows = best.map_or(0, |best| best.overall.rows);
    let mut sure = vec![format!(
        "Evaluated on {rows} test rows, the last 30 % of each process, which no model was trained on, with {seeds}."
    )];
    sure.extend(summary.band.as_ref().map(banded));
    let mut far: Vec<String> = best.zip(twin).map(|(best, twin)| by_process(best, twin)).into_iter().collect();
    far.push(
        "The test with a process left out of training, below, shows how well it generalises to a new process."
            .to_owned(),
    );
    let next = "Train the chosen model with `govtwin train`; `govtwin replay --residual` shows the remaining error.";
    [("Result", what), ("How sure", sure), ("By process", far), ("What next", vec![next.to_owned()])]
}

/// Of a training: of the twin, and of the twin with the model as it runs.
pub(crate) fn of_training(
    twin: &ModelFigures,
    with: &ModelFigures,
    name: &str,
    unit: &str,
    band: Option<&Covered>,
) -> Answers {
    let [before, after] = [twin, with].map(|model| model.overall.mae);
    let what = if after < before {
        format!(
            "The learned residual removes {} % of the twin's mean absolute error of the {name}: {} {unit} of {} remain.",
            fixed(100.0 * (1.0 - after / before), 0),
            significant(after, 3),
            significant(before, 3)
        )
    } else {
        format!(
            "The learned residual removes none of the twin's mean absolute error of the {name}: {} {unit} with it, {} without.",
            significant(after, 3),
            significant(before, 3)
        )
    };
    let mut sure = vec![format!(
        "Evaluated on {} test rows, the last 30 % of each process, which were not used for training but come from the same recordings.",
        with.overall.rows
    )];
    sure.extend(band.map(banded));
    let next = "`govtwin replay --residual` with recordings of another day shows how well it generalises; `--leave-out` trains without a process.";
    [
        ("Result", vec![what]),
        ("How sure", sure),
        ("By process", vec![by_process(with, twin)]),
        ("What next", vec![next.to_owned()]),
    ]
}

/// How much smaller a model's mean absolute error is than another's.
fn less(model: &ModelFigures, other: &ModelFigures) -> String {
    change(model.overall.mae, other.overall.mae) + " than"
}

fn change(mae: f64, other: f64) -> String {
    let percent = 100.0 * (1.0 - mae / other);
    format!("{} % {}", fixed(percent.abs(), 0), if percent < 0.0 { "more" } else { "less" })
}

/// The change of the mean absolute error in each process.
fn by_process(model: &ModelFigures, twin: &ModelFigures) -> String {
    let of = |process: &str| twin.process(process).map(|score| score.mae);
    let changes = model
        .processes
        .iter()
        .filter_map(|one| Some(format!("{} {}", title(one.process), change(one.score.mae, of(one.process)?))));
    format!("Mean absolute error compared with the twin alone: {}.", changes.collect::<Vec<_>>().join(", "))
}

/// Coverage of the band beside its nominal coverage.
fn banded(band: &Covered) -> String {
    let [stated, found] = [band.coverage_share, band.overall_share].map(|share| fixed(100.0 * share, 0));
    format!("The band with a nominal coverage of {stated} % contains {found} % of the test rows.")
}
