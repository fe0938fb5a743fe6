//! The page of a fleet: who needs a look first, what changed, units and their causes, sizes over time, and what did not run.

mod answers;

use std::collections::{BTreeMap, BTreeSet};

use crate::draw::svg;
use crate::ink::Ink;
use crate::page::{KeyFigure, Page, PageBody, Tone};
use crate::picture::{Mark, MarkShape, Panel, Picture};
use crate::table::Table;
use govtwin_diagnosis::fleet::ageing::Trend;
use govtwin_diagnosis::fleet::changes::{Change, word};
use govtwin_diagnosis::fleet::gathered::{Gathered, Row, Status};
use govtwin_diagnosis::fleet::urgency::Look;
use govtwin_diagnosis::words::{id_words, key_words, probability as probability_words, shown_unit, verdict_words};
use govtwin_model::number::{quantity, scaled_unit};

/// Rows that stand open; of more the pictures would come too far down.
const MOST_OPEN_ROWS: usize = 60;
/// Rows of a table on the page; all of them are in the CSV file.
const MOST_ROWS: usize = 2000;
/// Units in the picture of causes.
const MOST_UNITS: usize = 30;
/// Pictures of sizes over time.
const MOST_TRENDS: usize = 12;

/// What a page is made of beside the fleet.
pub struct Context<'a> {
    /// Units by how soon they need a look.
    pub looks: &'a [Look],
    /// What changed since `before`.
    pub changes: &'a [Change],
    /// When it was gathered before; none for the first time.
    pub before: Option<&'a str>,
    /// Objects in the store that are no results, in words.
    pub damaged: &'a [String],
    /// From the page to the top of the store.
    pub to_store: &'a str,
    /// Names and values of how the page was made.
    pub facts: Vec<(String, String)>,
}

/// The page.
pub fn page(gathered: &Gathered, context: &Context) -> Page {
    let units: BTreeSet<&str> = gathered.rows.iter().map(|row| row.unit.as_str()).collect();
    let mut page = Page::new(
        "Fleet: diagnoses of all units",
        format!("{} units, {} entries (one per unit and period)", units.len(), gathered.rows.len()),
    );
    let body = &mut page.body;
    body.answers(answers::answers(gathered, context, units.len()));
    body.key_figures(figures(gathered, context));
    let origins: BTreeSet<&str> = gathered.rows.iter().flat_map(|row| row.origins.iter().map(String::as_str)).collect();
    for origin in origins {
        body.note(Tone::Plain, origin);
    }
    for damaged in context.damaged {
        body.note(Tone::Warning, damaged.as_str());
    }
    look_first(body, gathered, context);
    changes(body, context);
    body.heading("Causes by unit and period");
    if let Some(picture) = causes_picture(gathered, context.looks) {
        body.figure(
            svg(&picture),
            "Probability, in %, of the causes in the last period of each unit, for the units that need attention first. Possible causes exclude each \
             other; causes found act together.",
        );
    }
    rows_table(body, gathered, context);
    trends(body, gathered);
    not_run(body, gathered);
    body.details_facts("How these figures were made", context.facts.clone());
    page
}

/// A probability as a percentage; empty where there is none.
fn probability_text(probability: Option<f64>) -> String {
    probability.map_or_else(String::new, probability_words)
}

fn figures(gathered: &Gathered, context: &Context) -> Vec<KeyFigure> {
    let count = |status: Status| gathered.count(status).to_string();
    let mut figures = vec![
        KeyFigure::new("diagnosed", count(Status::Done), "").hint(format!("of {} entries", gathered.rows.len())),
        KeyFigure::new("failed", count(Status::Failed), "").hint("recordings cannot be diagnosed"),
        KeyFigure::new("missing", count(Status::Missing), "").hint("planned, no result yet"),
        KeyFigure::new("sizes that changed", gathered.changed().count().to_string(), "").hint("beyond their intervals"),
    ];
    if context.before.is_some() {
        figures.push(KeyFigure::new("changes", context.changes.len().to_string(), "").hint("since the previous page"));
    }
    figures
}

fn look_first(body: &mut PageBody, gathered: &Gathered, context: &Context) {
    body.heading("Units that need attention first");
    if context.looks.is_empty() {
        body.paragraph("None: all units are diagnosed, none has a fault in its last period, and no size changed.");
        return;
    }
    let mut table = Table::new().words("unit").words("reasons").words("next test");
    for look in context.looks.iter().take(MOST_ROWS) {
        let last = gathered.last_found(&look.unit);
        let test = last.and_then(|row| row.found.as_ref()?.next_test.clone()).unwrap_or_default();
        let cells = [look.unit.clone(), look.reasons.join("; "), test];
        match last.and_then(|row| row.report.as_ref()) {
            Some(report) => table.linked_row(cells, link(context, report)),
            None => table.row(cells),
        }
    }
    let caption = "Order: units in which a size changed, units with a cause or possible causes, units with an unknown cause, then missing or failed \
                   diagnoses and insufficient recordings. Each unit links to the report of its last period.";
    body.table(table, caption);
    cut(body, context.looks.len());
}

fn changes(body: &mut PageBody, context: &Context) {
    body.heading("Changes since the previous page");
    let Some(before) = context.before else {
        body.paragraph("This is the first page of the fleet; the next one will list the changes.");
        return;
    };
    if context.changes.is_empty() {
        body.paragraph(format!("Nothing changed since {before}."));
        return;
    }
    let mut table = Table::new().words("unit").words("period").words("change");
    for change in context.changes.iter().take(MOST_ROWS) {
        table.row([change.unit.clone(), change.period.clone(), change.words.clone()]);
    }
    body.table(table, format!("Differences from the page of {before}."));
    cut(body, context.changes.len());
}

fn rows_table(body: &mut PageBody, gathered: &Gathered, context: &Context) {
    let mut table = Table::new()
        .words("unit")
        .words("period")
        .words("verdict")
        .words("cause, or reason")
        .numbers("probability")
        .words("size (90 %)")
        .numbers_of("probability", "unknown")
        .numbers_of("probability", "none");
    for row in gathered.rows.iter().take(MOST_ROWS) {
        let cells = cells(row);
        match &row.report {
            Some(report) => table.linked_row(cells, link(context, report)),
            None => table.row(cells),
        }
    }
    let rows = gathered.rows.len();
    let caption = "All units in all periods, with links to their reports. fleet.csv contains all parameters.";
    if rows <= MOST_OPEN_ROWS {
        body.table(table, caption);
        return;
    }
    let mut inner = PageBody::new();
    inner.table(table, caption);
    cut(&mut inner, rows);
    body.details(format!("All units in all periods ({rows})"), inner);
}

fn cells(row: &Row) -> [String; 8] {
    let (unit, period) = (row.unit.clone(), row.period.clone());
    let Some(found) = &row.found else {
        let empty = String::new;
        return [unit, period, row.status.id().to_owned(), row.words.clone(), empty(), empty(), empty(), empty()];
    };
    let joined = |each: &dyn Fn(&govtwin_diagnosis::fleet::result::Cause) -> String| {
        found.causes.iter().map(each).collect::<Vec<_>>().join(", ")
    };
    let size = |cause: &govtwin_diagnosis::fleet::result::Cause| {
        let Some(size) = cause.sizes.first() else { return String::new() };
        let words = |value: Option<f64>| quantity(value.unwrap_or(f64::NAN), shown_unit(&size.name, &size.unit));
        format!("{} ({} to {})", words(size.value), words(size.low), words(size.high))
    };
    [
        unit,
        period,
        verdict_words(&found.verdict).to_owned(),
        joined(&|cause| id_words(&cause.id)),
        joined(&|cause| probability_text(cause.probability)),
        joined(&size),
        probability_text(found.unknown_probability),
        probability_text(found.none_probability),
    ]
}

fn link(context: &Context, report: &str) -> String {
    format!("{}{report}/report.html", context.to_store)
}

/// Says how many rows are not shown.
fn cut(body: &mut PageBody, all: usize) {
    if let Some(left) = all.checked_sub(MOST_ROWS).filter(|left| *left > 0) {
        body.note(Tone::Plain, format!("{left} more are in fleet.csv and fleet.json."));
    }
}

/// Units by causes, for those that need a look first.
fn causes_picture(gathered: &Gathered, looks: &[Look]) -> Option<Picture> {
    let rows: Vec<&Row> = looks.iter().filter_map(|look| gathered.last_found(&look.unit)).take(MOST_UNITS).collect();
    let mut weights: BTreeMap<&str, f64> = BTreeMap::new();
    for found in rows.iter().filter_map(|row| row.found.as_ref()) {
        for cause in &found.causes {
            *weights.entry(&cause.id).or_default() += cause.probability.unwrap_or(0.0);
        }
    }
    let mut causes: Vec<&str> = weights.keys().copied().collect();
    causes.sort_by(|a, b| weights[b].total_cmp(&weights[a]).then(a.cmp(b)));
    causes.truncate(10);
    if rows.is_empty() {
        return None;
    }
    causes.push("unknown");
    let value = |row: &Row, id: &str| -> f64 {
        let Some(found) = &row.found else { return f64::NAN };
        let cause = found.causes.iter().find(|cause| cause.id == id).and_then(|cause| cause.probability);
        let p = if id == "unknown" { found.unknown_probability } else { cause };
        // Nothing is certain: 99 is "over 99 %" elsewhere.
        p.map_or(f64::NAN, |p| (100.0 * p).min(99.0))
    };
    let cells = rows.iter().rev().map(|row| causes.iter().map(|id| value(row, id)).collect()).collect();
    let shape = MarkShape::Cells { rows: cells, full: 100.0, below: Ink::Muted, decimals: 0 };
    let height = 24 * u32::try_from(rows.len().max(3)).unwrap_or(3);
    let panel = Panel::new("probability, %")
        .height(height)
        .x_categories(causes.iter().map(|id| if *id == "unknown" { "unknown".to_owned() } else { id_words(id) }))
        .y_categories(rows.iter().rev().map(|row| row.unit.clone()))
        .mark(Mark::new(shape, Ink::Alarm, ""));
    Some(Picture::grid("Probability of the causes, for the units that need attention first", 1, vec![panel]))
}

/// Sizes over time: those that changed, and where none did those that are determined most often.
fn trends(body: &mut PageBody, gathered: &Gathered) {
    body.heading("Fault sizes and parameters over time");
    let mut shown: Vec<(&str, &Trend)> = gathered.changed().collect();
    shown.sort_by(|a, b| sum(b.1).total_cmp(&sum(a.1)).then((a.0, &a.1.name).cmp(&(b.0, &b.1.name))));
    let (total, changed) = (shown.len(), !shown.is_empty());
    if !changed {
        let all =
            gathered.trends.iter().flat_map(|(unit, trends)| trends.iter().map(move |trend| (unit.as_str(), trend)));
        shown = all.filter(|(_, trend)| trend.points.len() > 1).collect();
        shown.sort_by(|a, b| sum(b.1).total_cmp(&sum(a.1)).then((a.0, &a.1.name).cmp(&(b.0, &b.1.name))));
    }
    if shown.is_empty() {
        body.paragraph(
            "No unit has a size that is determined by the recordings of two periods, so changes cannot be detected.",
        );
        return;
    }
    shown.truncate(MOST_TRENDS);
    let panels = shown.iter().map(|(unit, trend)| panel(unit, trend)).collect();
    let caption = if changed {
        format!(
            "Sizes that changed beyond their intervals, {} of {total}, with 90 % intervals. Dots are filled where the cumulative sum of the changes, \
             in standard deviations, is above {:.1}. At this limit a fleet in which nothing changes gives one false alarm in ten pages.",
            shown.len(),
            gathered.limit
        )
    } else {
        format!(
            "No size changed beyond its interval: all cumulative sums are below {:.1}. Shown are the largest ones, with 90 % intervals.",
            gathered.limit
        )
    };
    body.figure(svg(&Picture::grid("Sizes over periods with their intervals", 2, panels)), caption);
    body.paragraph(
        "Only sizes that the recordings determine are compared: parameters of which at least half of the information comes from the recordings and \
         not from the sheet's tolerance, and effects that the diagnosis names as cause found. Sizes at a bound are left out.",
    );
}

fn sum(trend: &Trend) -> f64 {
    trend.points.last().map_or(0.0, |point| point.cumulative_sum.abs())
}

fn panel(unit: &str, trend: &Trend) -> Panel {
    let at = |place: usize| place as f64;
    let points = || trend.points.iter().enumerate();
    let largest = points().fold(0.0, |most: f64, (_, point)| most.max(point.value.abs()));
    let (scale, scaled) = scaled_unit(largest, shown_unit(&trend.name, &trend.unit));
    let dots = |changed: bool| {
        points().filter(|(_, point)| point.changed == changed).map(|(k, point)| [at(k), scale * point.value]).collect()
    };
    let whiskers = points().map(|(k, point)| [at(k), scale * point.low, at(k), scale * point.high]).collect();
    // So many names fit side by side; the others stay without.
    let every = trend.points.len().div_ceil(6).max(1);
    let names = points().map(|(k, point)| if k % every == 0 { point.period.clone() } else { String::new() });
    let scaled = if scaled.is_empty() { scaled } else { format!(", {scaled}") };
    Panel::new(format!("{unit}, {}{scaled}", key_words(&trend.name)))
        .height(120)
        .x_categories(names)
        .x_range(-0.5, at(trend.points.len()) - 0.5)
        .mark(Mark::new(MarkShape::Segments(whiskers), Ink::Measured, ""))
        .mark(Mark::new(MarkShape::Dots(dots(false)), Ink::Measured, "").dashed(1))
        .mark(Mark { width_px: 4.0, ..Mark::new(MarkShape::Dots(dots(true)), Ink::Alarm, "") })
}

fn not_run(body: &mut PageBody, gathered: &Gathered) {
    let rows: Vec<&Row> = gathered.rows.iter().filter(|row| row.status != Status::Done).collect();
    if rows.is_empty() {
        return;
    }
    body.heading("Failed and missing diagnoses");
    let mut table = Table::new().words("unit").words("period").words("state").words("reason");
    for row in rows.iter().take(MOST_ROWS) {
        table.row([row.unit.clone(), row.period.clone(), word(row), row.words.clone()]);
    }
    body.table(table, "Failed: the recordings cannot be diagnosed. Missing: planned, but no worker has written a result; run the plan again.");
    cut(body, rows.len());
}
