//! The pictures of a comparison, after the paper's Figures 12 to 16.

use super::{HYBRIDS, Shown, title};
use crate::comparison::Contender;
use crate::comparison::breakdown::{AROUND, Broken};
use crate::comparison::summary::{ComparisonSummary, ModelFigures, OfProcess};
use govtwin_model::number::significant;
use govtwin_model::recording::Process;
use govtwin_model::units::seconds_from_nanos;
use govtwin_pages::ink::Ink;
use govtwin_pages::picture::{Mark, MarkShape, Panel, Picture};

/// Longest stretch that a trace shows, s.
const STRETCH_S: f64 = 60.0;

/// Colour of a model.
fn ink(id: &str) -> Ink {
    match id {
        "mbm" => Ink::Command,
        "ddm" => Ink::Extra1,
        "mdhm" => Ink::Simulated,
        "gate" => Ink::Difference,
        "drawn" => Ink::Band,
        "lightgbm" | "hybrid" => Ink::Good,
        "lstm" => Ink::Measured,
        "tcn" => Ink::Extra3,
        _ => Ink::Extra2,
    }
}

/// Positions in the judging rows of the liveliest stretch of one recording of a process.
fn liveliest(shown: &Shown, process: Process) -> Vec<usize> {
    let marks: Vec<_> = shown.judging.iter().map(|&row| &shown.rows.marks[row]).collect();
    let of_process: Vec<usize> = (0..marks.len()).filter(|&at| marks[at].process == process).collect();
    let stretch = |from: usize| {
        let inside = |at: &&usize| {
            let (first, mark) = (marks[of_process[from]], marks[**at]);
            mark.recording == first.recording && seconds_from_nanos(mark.time_ns - first.time_ns) <= STRETCH_S
        };
        of_process[from..].iter().take_while(inside).copied().collect::<Vec<_>>()
    };
    let candidates = (0..of_process.len()).step_by(25).map(stretch);
    let lively = |stretch: &Vec<usize>| stretch.iter().map(|&at| marks[at].motion).sum::<f64>();
    candidates.max_by(|a, b| lively(a).total_cmp(&lively(b))).unwrap_or_default()
}

pub(crate) fn traces(shown: &Shown) -> Picture {
    let unit = shown.rows.layout.signal.unit();
    let panel = |process: Process| {
        let stretch = liveliest(shown, process);
        let start_ns = stretch.first().map_or(0, |&at| shown.rows.marks[shown.judging[at]].time_ns);
        let time_s = |at: usize| seconds_from_nanos(shown.rows.marks[shown.judging[at]].time_ns - start_ns);
        let measured = stretch.iter().map(|&at| [time_s(at), shown.rows.marks[shown.judging[at]].measured]).collect();
        let mut panel = Panel::new(format!("{}, {unit}", process.title()))
            .height(190)
            .thick_line("measured", measured)
            .x_name("time, s");
        for contender in shown.of(&["mbm", "ddm", "mdhm"]) {
            let line = stretch.iter().map(|&at| [time_s(at), contender.estimates[at]]).collect();
            panel = panel.line(ink(contender.id), contender.title, line);
        }
        panel
    };
    Picture::grid("Measured and predicted signals by process", 2, processes(shown).into_iter().map(panel).collect())
}

/// A few rows around the one of each process that costs the MDHM most against the DDM.
pub(crate) fn worst(summary: &ComparisonSummary, shown: &Shown) -> Picture {
    let panel = |one: &Broken| {
        let told = one.worst.first()?;
        let marks = &shown.rows.marks;
        let here: Vec<usize> = (0..shown.judging.len())
            .filter(|&at| {
                let row = shown.judging[at];
                marks[row].recording == told.recording && row.abs_diff(told.row) <= AROUND
            })
            .collect();
        let time_s = |at: usize| seconds_from_nanos(marks[shown.judging[at]].time_ns - marks[told.row].time_ns);
        let measured = here.iter().map(|&at| [time_s(at), marks[shown.judging[at]].measured]).collect();
        let mut panel =
            Panel::new(format!("{}, {}: {}", title(one.process), shown.rows.layout.signal.unit(), told.phase.title()))
                .height(190)
                .thick_line("measured", measured)
                .x_name("time from that row, s");
        for contender in shown.of(&["mbm", "drawn", "ddm", "mdhm", "gate"]) {
            let line = here.iter().map(|&at| [time_s(at), contender.estimates[at]]).collect();
            panel = panel.line(ink(contender.id), contender.title, line);
        }
        Some(panel)
    };
    Picture::grid(
        "Rows with the largest additional error",
        2,
        summary.breakdown.processes.iter().filter_map(panel).collect(),
    )
}

fn processes(shown: &Shown) -> Vec<Process> {
    let has = |process: &Process| shown.judging.iter().any(|&row| shown.rows.marks[row].process == *process);
    Process::ALL.into_iter().filter(has).collect()
}

type FigureOf = fn(&OfProcess) -> f64;

const FIGURES: [(&str, FigureOf); 3] =
    [("MAE", |one| one.score.mae), ("RMSE", |one| one.score.rmse), ("R²", |one| one.score.r2)];

/// The name of a figure with its unit; R² has none.
fn with_unit(name: &str, unit: &str) -> String {
    if name == "R²" { name.to_owned() } else { format!("{name}, {unit}") }
}

/// The models of [`bars`].
fn barred(summary: &ComparisonSummary) -> impl Iterator<Item = &ModelFigures> {
    ["mbm", "ddm", "mdhm"].into_iter().filter_map(|id| summary.models.iter().find(|model| model.id == id))
}

/// What of R² lies below the picture of [`bars`], as words for its caption; empty where nothing does.
pub(crate) fn below_zero(summary: &ComparisonSummary) -> String {
    let below: Vec<String> = barred(summary)
        .flat_map(|model| model.processes.iter().filter(|one| one.score.r2 < 0.0).map(move |one| (model, one)))
        .map(|(model, one)| {
            let process = title(one.process).to_lowercase();
            format!("{} in {process} ({})", model.title, significant(one.score.r2, 3))
        })
        .collect();
    if below.is_empty() {
        return String::new();
    }
    format!(" R² below 0 (worse than the mean of the measured signal) has no bar: {}.", below.join(", "))
}

fn titles(models: &[ModelFigures]) -> Vec<&str> {
    models.first().into_iter().flat_map(|model| &model.processes).map(|one| title(one.process)).collect()
}

pub(crate) fn bars(summary: &ComparisonSummary, unit: &str) -> Picture {
    let models: Vec<&ModelFigures> = barred(summary).collect();
    let panel = |(name, figure): &(&str, FigureOf)| {
        let mut panel = Panel::new(with_unit(name, unit)).x_categories(titles(&summary.models));
        if *name == "R²" {
            panel = panel.y_range(0.0, 1.0);
        }
        for (k, model) in models.iter().enumerate() {
            let values: Vec<f64> = model.processes.iter().map(figure).map(|value| value.max(0.0)).collect();
            panel = panel.bars(ink(model.id), model.title, &values, k, models.len());
        }
        panel
    };
    Picture::grid("MAE, RMSE and R² by process", 1, FIGURES.iter().map(panel).collect())
}

/// Estimated − measured of one process.
fn residuals_of(shown: &Shown, contender: &Contender, process: Process) -> Vec<f64> {
    let rows = shown.judging.iter().map(|&row| &shown.rows.marks[row]).zip(&contender.estimates);
    rows.filter(|(mark, _)| mark.process == process).map(|(mark, estimate)| estimate - mark.measured).collect()
}

pub(crate) fn residuals(shown: &Shown) -> Picture {
    let panel = |process: Process| {
        let mut panel = Panel::new(format!("{}: error, {}", process.title(), shown.rows.layout.signal.unit()));
        for contender in shown.of(&HYBRIDS).into_iter().rev() {
            let values = residuals_of(shown, contender, process);
            let line = values.iter().enumerate().map(|(k, value)| [k as f64, *value]).collect();
            panel = panel.line(ink(contender.id), contender.title, line);
        }
        panel.x_name("test row")
    };
    Picture::grid("Errors of the hybrids", 1, processes(shown).into_iter().map(panel).collect())
}

pub(crate) fn spreads(shown: &Shown) -> Picture {
    let panel = |process: Process| {
        let all: Vec<(&Contender, Vec<f64>)> = shown
            .of(&HYBRIDS)
            .into_iter()
            .map(|contender| (contender, residuals_of(shown, contender, process)))
            .collect();
        let mut sizes: Vec<f64> = all.iter().flat_map(|(_, values)| values).map(|value| value.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        // 97 % of the rows; the outermost bars hold the rest.
        let reach = sizes.get(sizes.len() * 97 / 100).copied().unwrap_or(1.0).max(1e-9);
        let (bins, range) = (41, [-reach, reach]);
        let mut panel = Panel::new(format!("{}: share of rows", process.title())).height(170);
        for (k, (contender, values)) in all.iter().enumerate() {
            if k == 0 {
                panel = panel.histogram(Ink::Band, values, range, bins);
            }
            panel = panel.line(
                ink(contender.id),
                contender.title,
                density(values, range, 2.0 * reach / f64::from(bins_u32(bins))),
            );
        }
        panel.x_name(format!("predicted − measured, {}", shown.rows.layout.signal.unit()))
    };
    Picture::grid("Distribution of the errors of the hybrids", 2, processes(shown).into_iter().map(panel).collect())
}

fn bins_u32(bins: usize) -> u32 {
    u32::try_from(bins).unwrap_or(u32::MAX)
}

/// Gaussian kernel density times the width of a bar, with Silverman's bandwidth from the spread of the inner half.
fn density(values: &[f64], [from, to]: [f64; 2], bar: f64) -> Vec<[f64; 2]> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let count = sorted.len().max(1) as f64;
    let quartile = |share: usize| sorted.get(sorted.len() * share / 4).copied().unwrap_or(0.0);
    let spread = ((quartile(3) - quartile(1)) / 1.34).max(0.005 * (to - from));
    let bandwidth = 0.9 * spread * count.powf(-0.2);
    let scale = bar / (count * bandwidth * (2.0 * std::f64::consts::PI).sqrt());
    let at = |x: f64| {
        let near = sorted.partition_point(|value| *value < x - 5.0 * bandwidth);
        let kernels = sorted[near..].iter().take_while(|value| **value <= x + 5.0 * bandwidth);
        scale * kernels.map(|value| (-0.5 * ((x - value) / bandwidth).powi(2)).exp()).sum::<f64>()
    };
    (0..=200).map(|k| from + (to - from) * f64::from(k) / 200.0).map(|x| [x, at(x)]).collect()
}

pub(crate) fn heatmap(summary: &ComparisonSummary, unit: &str) -> Picture {
    let hybrids: Vec<&ModelFigures> =
        HYBRIDS.iter().rev().filter_map(|id| summary.models.iter().find(|model| model.id == *id)).collect();
    let panel = |(name, figure): &(&str, FigureOf)| {
        let rows: Vec<Vec<f64>> = hybrids.iter().map(|model| model.processes.iter().map(figure).collect()).collect();
        let full = rows.iter().flatten().fold(1e-12_f64, |most, value| most.max(value.abs()));
        let decimals = if *name == "R²" { 3 } else { 4 };
        let shape = MarkShape::Cells { rows, full, below: Ink::Alarm, decimals };
        Panel::new(with_unit(name, unit))
            .height(45 + 34 * bins_u32(hybrids.len()))
            .x_categories(titles(&summary.models))
            .y_categories(hybrids.iter().map(|model| model.title))
            .mark(Mark::new(shape, Ink::Simulated, ""))
    };
    Picture::grid("MAE, RMSE and R² of the hybrids by process", 1, FIGURES.iter().map(panel).collect())
}

pub(crate) fn left_out(summary: &ComparisonSummary, unit: &str) -> Picture {
    let unseen = &summary.left_out_process;
    let mut panel = Panel::new(format!("MAE on the process left out, {unit}"))
        .x_categories(unseen.iter().map(|one| title(one.process)))
        .height(190);
    let models = unseen.first().map_or(&[][..], |one| &one.models);
    for (k, model) in models.iter().enumerate() {
        let of = |unseen: &crate::comparison::summary::UnseenProcess| unseen.models[k].overall.mae;
        let values: Vec<f64> = unseen.iter().map(of).collect();
        panel = panel.bars(ink(model.id), model.title, &values, k, models.len());
    }
    Picture::grid("A process left out of training", 1, vec![panel])
}

pub(crate) fn importance(summary: &ComparisonSummary) -> Picture {
    let strongest: Vec<_> = summary.importance.iter().take(20).rev().collect();
    let shares: Vec<f64> = strongest.iter().map(|one| one.gain_share).collect();
    let mut groups: Vec<(&str, f64)> = vec![];
    for one in &summary.importance {
        match groups.iter_mut().find(|(name, _)| *name == one.group) {
            Some((_, share)) => *share += one.gain_share,
            None => groups.push((one.group, one.gain_share)),
        }
    }
    groups.sort_by(|a, b| a.1.total_cmp(&b.1));
    let group_shares: Vec<f64> = groups.iter().map(|(_, share)| *share).collect();
    let panels = vec![
        Panel::new("share of gain, most important features")
            .height(380)
            .y_categories(strongest.iter().map(|one| one.feature.clone()))
            .lying_bars(Ink::Simulated, "", &shares),
        Panel::new("share of gain, feature groups")
            .height(380)
            .y_categories(groups.iter().map(|(name, _)| (*name).to_owned()))
            .lying_bars(Ink::Good, "", &group_shares),
    ];
    Picture::grid("Feature importance", 2, panels)
}
