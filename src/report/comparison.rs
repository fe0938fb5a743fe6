//! The page of a comparison: the views of the paper's Figures 12 to 16, the searches, and what the paper does not show.

mod pictures;
mod searches;

use super::draw::{DrawError, svg};
use super::page::{Blocks, KeyFigure, Page, Tone};
use super::table::{Table, fixed, significant};
use crate::comparison::Contender;
use crate::comparison::summary::{Scored, Summary};
use crate::recording::Process;
use crate::residual::table::Table as Rows;

pub use searches::search_blocks;

/// What the pictures are drawn of.
pub struct Shown<'a> {
    /// All rows.
    pub rows: &'a Rows,
    /// Indices of those that judge.
    pub judging: &'a [usize],
    /// The models' words for them.
    pub contenders: &'a [Contender],
}

impl Shown<'_> {
    /// The models with these ids, in this order.
    fn of(&self, ids: &[&str]) -> Vec<&Contender> {
        ids.iter().filter_map(|id| self.contenders.iter().find(|contender| contender.id == *id)).collect()
    }
}

/// Ids of the hybrids, in the paper's ranking; those that took no part are passed over.
pub const HYBRIDS: [&str; 4] = ["mdhm", "lightgbm", "lstm", "tcn"];

/// The figures of models, process by process.
#[must_use]
pub fn models_table(models: &[Scored], unit: &str) -> Table {
    let mut table = Table::new().words("model").words("process").numbers("rows");
    for name in [format!("MAE, {unit}"), format!("RMSE, {unit}"), "R²".to_owned()] {
        table = table.numbers(name);
    }
    for model in models {
        let cells = |process: &str, score: &crate::comparison::summary::Score| {
            let figures = [fixed(score.mae, 5), fixed(score.rmse, 5), fixed(score.r2, 4)];
            [vec![model.title.to_owned(), process.to_owned(), score.rows.to_string()], figures.to_vec()].concat()
        };
        for one in &model.processes {
            table.row(cells(title(one.process), &one.score));
        }
        table.strong_row(cells("all rows", &model.overall));
    }
    table
}

/// The words for a process's id.
fn title(id: &str) -> &str {
    match Process::ALL.into_iter().find(|process| process.id() == id) {
        Some(process) => process.title(),
        None => id,
    }
}

/// The page.
///
/// # Errors
/// Where a picture cannot be drawn.
pub fn page(summary: &Summary, shown: &Shown) -> Result<Page, DrawError> {
    let unit = shown.rows.layout.signal.unit();
    let mut page = Page::new(
        "Comparison of models",
        format!("{}, on rows that no model was trained on", shown.rows.layout.signal.title()),
    );
    let body = &mut page.body;
    opening(body, summary, unit);
    body.heading("Traces");
    body.figure(
        svg(&pictures::traces(shown))?,
        "Measured, MBM, DDM and MDHM in each process, a stretch of the judging rows (after Figure 12).",
    );
    body.heading("Errors");
    let caption = format!("MAE, RMSE and R² by process (after Figure 13).{}", pictures::below_zero(summary));
    body.figure(svg(&pictures::bars(summary, unit))?, caption);
    body.table(models_table(&summary.models, unit), "Rows of the last 30 % of each process.");
    body.heading("Hybrids");
    body.figure(
        svg(&pictures::residuals(shown))?,
        "Simulated − measured of the hybrids over the judging rows (after Figure 14).",
    );
    body.figure(
        svg(&pictures::spreads(shown))?,
        "The same as histograms with kernel density estimates (after Figure 15).",
    );
    body.figure(svg(&pictures::heatmap(summary, unit))?, "Figures of the hybrids by process (after Figure 16).");
    body.heading("A process left out");
    body.paragraph("What the paper does not show: each process left out of training in turn and judged on. The hyperparameters are the manual ones, since a search would have seen the process. The guard fades corrections where rows lie outside what was trained.");
    body.figure(svg(&pictures::left_out(summary, unit))?, "MAE on the process that was left out.");
    body.table(left_out_table(summary, unit), "");
    if let Some(run) = &summary.closed_loop {
        body.heading("Inside the loop");
        body.paragraph("Closed-loop free run, nothing measured enters. The additive residual corrects what is said of the spool; the one inside the loop corrects the spool's rate in the twin itself, learned over the twin's own state, and moves the servomotor as well. Both have the manual hyperparameters and their guards.");
        body.table(models_table(&run.spool, "pu"), "Spool position.");
        body.table(
            models_table(&run.servomotor, "pu"),
            "Servomotor position, which the additive residual leaves as it is.",
        );
    }
    body.heading("Features");
    body.figure(
        svg(&pictures::importance(summary))?,
        "Share of the trees' gain in the MDHM, the strongest features, and Table 1's groups.",
    );
    body.heading("Searches");
    search_blocks(body, &summary.searches, unit)?;
    closing(body, summary);
    Ok(page)
}

fn opening(body: &mut Blocks, summary: &Summary, unit: &str) {
    let order: Vec<&str> = summary.ranking.iter().map(|id| model_title(summary, id)).collect();
    body.lead(format!("Hybrids by MAE over all judging rows: {}.", order.join(" < ")));
    if let Some(origin) = &summary.origin {
        body.note(Tone::Plain, origin.clone());
    }
    let of = |id: &str| summary.models.iter().find(|model| model.id == id);
    let key = ["mbm", "ddm", "mdhm"].iter().filter_map(|id| of(id)).map(|model| {
        KeyFigure::new(format!("MAE, {}", model.title), significant(model.overall.mae, 3), unit).hint(format!(
            "RMSE {} {unit}, R² {}",
            significant(model.overall.rmse, 3),
            fixed(model.overall.r2, 4)
        ))
    });
    body.key_figures(key);
    let mut table = Table::new().words("claim").numbers("paper, another plant").numbers("here").words("unit");
    for claim in &summary.claims {
        table.row([claim.what, claim.paper, &claim.here, claim.unit]);
    }
    body.table(table, "The paper's claims on its own plant's data, which is confidential, beside the figures on these recordings; spans are over processes.");
    if let Some(band) = &summary.band {
        let said: Vec<String> = band
            .processes
            .iter()
            .map(|one| format!("{} {} %", title(one.process), fixed(100.0 * one.coverage_share, 1)))
            .collect();
        body.paragraph(format!(
            "Conformal band of the MDHM: {} % stated, {} % of the judging rows inside ({}).",
            fixed(100.0 * band.coverage_share, 0),
            fixed(100.0 * band.overall_share, 1),
            said.join(", ")
        ));
    }
}

fn model_title<'a>(summary: &'a Summary, id: &'a str) -> &'a str {
    summary.models.iter().find(|model| model.id == id).map_or(id, |model| model.title)
}

fn left_out_table(summary: &Summary, unit: &str) -> Table {
    let mut table = Table::new().words("left out").words("model");
    for name in [format!("MAE, {unit}"), format!("RMSE, {unit}"), "R²".to_owned()] {
        table = table.numbers(name);
    }
    for unseen in &summary.left_out_process {
        for model in &unseen.models {
            let score = &model.overall;
            table.row([
                title(unseen.process).to_owned(),
                model.title.to_owned(),
                fixed(score.mae, 5),
                fixed(score.rmse, 5),
                fixed(score.r2, 4),
            ]);
        }
    }
    table
}

fn closing(body: &mut Blocks, summary: &Summary) {
    let mut inner = Blocks::new();
    inner.facts(summary.settings.iter().map(|(name, value)| (*name, value.clone())));
    inner.facts(summary.rows.iter().map(|(name, count)| (format!("rows: {name}"), count.to_string())));
    let found: Vec<(String, String)> = summary
        .recordings
        .iter()
        .map(|one| {
            (one.name.clone(), if one.is_clean() { format!("{} samples, clean", one.samples) } else { one.words() })
        })
        .collect();
    inner.facts(found);
    inner.paragraph(
        "Each process is cut for itself: the first 70 % of its rows in time teach, the last 30 % judge; where the cut falls inside a \
         recording, rows whose windows reach across it are left out. Searches see five folds by time inside the teaching part only.",
    );
    body.details("How these figures were made", inner);
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::comparison::summary::{Claim, OfProcess, SCHEMA, Score, Searched};

    fn model(id: &'static str, title: &'static str, r2: [f64; 2]) -> Scored {
        let score = |r2| Score { rows: 10, mae: 0.01, rmse: 0.02, r2 };
        let of = |(process, r2)| OfProcess { process, score: score(r2) };
        let processes = ["startup", "shutdown"].into_iter().zip(r2).map(of).collect();
        Scored { id, title, overall: score(0.5), processes }
    }

    fn summary(r2: [f64; 2]) -> Summary {
        let claim = Claim { what: "MAE of the MDHM", paper: "0.1", here: "0.2".to_owned(), unit: "pu" };
        Summary {
            schema: SCHEMA,
            program: "govtwin",
            origin: None,
            settings: BTreeMap::new(),
            rows: BTreeMap::new(),
            recordings: vec![],
            models: vec![model("mbm", "MBM", r2), model("mdhm", "MDHM", [0.9, 0.8])],
            ranking: vec!["mdhm"],
            claims: vec![claim],
            left_out_process: vec![],
            searches: vec![],
            importance: vec![],
            band: None,
            closed_loop: None,
        }
    }

    #[test]
    fn figures_have_their_units_and_nobody_guesses_where_data_come_from() {
        let summary = summary([0.5, 0.6]);
        let heat = svg(&pictures::heatmap(&summary, "pu")).unwrap().as_str().to_owned();
        assert!(heat.contains("MAE, pu") && heat.contains("RMSE, pu") && !heat.contains("R², pu"), "{heat}");
        let mut page = Page::new("", "");
        opening(&mut page.body, &summary, "pu");
        let html = page.to_html();
        assert!(html.contains("RMSE 0.0200 pu") && !html.contains("synthetic"), "{html}");
        let search = Searched {
            id: "hybrid",
            kind: "random",
            dimensions: vec!["trees"],
            points: vec![vec![10.0]],
            losses: vec![0.5],
            slices: BTreeMap::new(),
        };
        search_blocks(&mut page.body, &[search], "pu").unwrap();
        let html = page.to_html();
        assert!(html.contains("best MAE, pu") && html.contains("MAE over the folds, pu"), "{html}");
    }

    #[test]
    fn a_model_worse_than_the_mean_is_told() {
        assert_eq!(pictures::below_zero(&summary([0.5, 0.0])), "");
        let words = pictures::below_zero(&summary([-0.4, 0.6]));
        assert!(words.contains("MBM in start-up (−0.400)") && !words.contains("MDHM"), "{words}");
    }
}
