//! The page of a comparison: the views of the paper's Figures 12 to 16, the searches, and what the paper does not show.

mod answers;
mod pictures;
mod searches;
mod training;

use super::draw::{DrawError, svg};
use super::page::{KeyFigure, Page, PageBody, Tone};
use super::table::{Table, fixed, significant};
use crate::comparison::Contender;
use crate::comparison::breakdown::ErrorBreakdown;
use crate::comparison::coverage::CoveredAt;
use crate::comparison::summary::{ComparisonSummary, ModelFigures, SeedSpread};
use crate::recording::Process;
use crate::residual::table::FeatureTable as Rows;

pub use searches::search_blocks;
pub use training::{Training, training_page};

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
pub const HYBRIDS: [&str; 7] = ["gate", "hybrid", "mdhm", "random", "lightgbm", "lstm", "tcn"];

/// The figures of models, process by process.
#[must_use]
pub fn models_table(models: &[ModelFigures], unit: &str) -> Table {
    let mut table = Table::new().words("model").words("process").numbers("rows");
    for name in [format!("MAE, {unit}"), format!("RMSE, {unit}"), "R²".to_owned()] {
        table = table.numbers(name);
    }
    for model in models {
        let cells = |process: &str, score: &crate::comparison::summary::ErrorFigures| {
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

/// Figures over seeds, process by process: the mean, and the spread behind it where there are several.
#[must_use]
pub fn spread_table(models: &[SeedSpread], unit: &str) -> Table {
    let mut table = Table::new().words("model");
    let parts = models.first().map_or(&[][..], |model| &model.parts);
    for part in parts {
        table = table.numbers(format!("{}, MAE, {unit}", title(part.process))).numbers("RMSE");
    }
    let words = |[mean, low, high]: [f64; 3]| {
        if high - low < 5e-6 {
            fixed(mean, 5)
        } else {
            format!("{} ({}–{})", fixed(mean, 5), fixed(low, 5), fixed(high, 5))
        }
    };
    for model in models {
        let cells = model.parts.iter().flat_map(|part| [words(part.mae), words(part.rmse)]);
        table.row(std::iter::once(model.title.to_owned()).chain(cells));
    }
    table
}

/// Errors by process and phase.
#[must_use]
pub fn breakdown_table(broken: &ErrorBreakdown, unit: &str) -> Table {
    let mut table = Table::new().words("process").words("phase").numbers("rows");
    for model in &broken.models {
        table = table.numbers(format!("{model}, MAE, {unit}")).numbers("squares, %");
    }
    for one in &broken.processes {
        for part in &one.parts {
            let cells = part.mae.iter().zip(&part.square_shares);
            let cells = cells.flat_map(|(mae, share)| [fixed(*mae, 5), fixed(100.0 * share, 1)]);
            let first = [title(one.process).to_owned(), part.phase.title().to_owned(), part.rows.to_string()];
            table.row(first.into_iter().chain(cells));
        }
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
pub fn page(summary: &ComparisonSummary, shown: &Shown) -> Result<Page, DrawError> {
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
    why(body, summary, shown)?;
    body.heading("A process left out");
    body.paragraph("What the paper does not show: each process left out of training in turn and judged on. The hyperparameters are the manual ones, since a search would have seen the process. The guard fades corrections where rows lie outside what was trained.");
    body.figure(svg(&pictures::left_out(summary, unit))?, "MAE on the process that was left out.");
    body.table(left_out_table(summary, unit), "");
    let bands = summary.left_out_process.iter().flat_map(|one| &one.band);
    body.table(
        band_table(bands, unit),
        "The band of the guarded hybrid on the process that was left out: near, with its full correction; far, shrunk; outside, where there is no band.",
    );
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

/// Why the paper's hybrid loses to data alone, and what each step against it brings.
fn why(body: &mut PageBody, summary: &ComparisonSummary, shown: &Shown) -> Result<(), DrawError> {
    let unit = shown.rows.layout.signal.unit();
    body.heading("Where the MDHM loses to the DDM");
    for one in &summary.breakdown.processes {
        let shifts: Vec<String> =
            one.shift_s.iter().map(|(id, shift_s)| format!("{id} {} s", fixed(*shift_s, 2))).collect();
        let decided = one.decided_share.map_or("it loses nothing in squared error".to_owned(), |share| {
            format!("{} % of what it loses in squared error lies in {} rows", fixed(100.0 * share, 0), one.worst.len())
        });
        let guard = &one.guard;
        body.paragraph(format!(
            "{}: {decided}; the twin's trace comes too late by: {}; of {} rows the guard would clamp {}, fade {}, shrink {} and refuse {}.",
            title(one.process),
            shifts.join(", "),
            guard.rows,
            guard.clamped,
            guard.faded,
            guard.shrunk,
            guard.outside + guard.bad
        ));
    }
    body.figure(svg(&pictures::worst(summary, shown))?, "Around the row of each process on which the MDHM loses most.");
    body.table(
        breakdown_table(&summary.breakdown, unit),
        "Errors by process and phase, and the share of each model's squared error in a process.",
    );
    body.heading("What each step brings");
    body.table(
        spread_table(&summary.ablation, unit),
        "The manual hyperparameters throughout; mean over the seeds, lowest and highest in brackets.",
    );
    if summary.seeds.len() > 1 {
        body.heading("Seeds");
        body.table(spread_table(&summary.spread, unit), "Every seed with its own searches; mean, lowest and highest.");
    }
    Ok(())
}

fn opening(body: &mut PageBody, summary: &ComparisonSummary, unit: &str) {
    body.answers(answers::of_comparison(summary, unit));
    if let Some(origin) = &summary.origin {
        body.note(Tone::Plain, origin.clone());
    }
    let of = |id: &str| summary.models.iter().find(|model| model.id == id);
    let key = ["mbm", "ddm", "mdhm", "gate"].iter().filter_map(|id| of(id)).map(|model| {
        KeyFigure::new(format!("MAE, {}", model.title), significant(model.overall.mae, 3), unit).hint(format!(
            "RMSE {} {unit}, R² {}",
            significant(model.overall.rmse, 3),
            fixed(model.overall.r2, 4)
        ))
    });
    body.key_figures(key);
    let mut table = Table::new().words("claim").numbers("paper, another plant").numbers("here").words("unit");
    for claim in &summary.claims {
        table.row([&*claim.what, claim.paper, &claim.here, claim.unit]);
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
        let caption = "The same band under the guard by processes, by distance from the rows that taught.";
        body.table(band_table(summary.band_by_distance.iter(), unit), caption);
    }
}

fn left_out_table(summary: &ComparisonSummary, unit: &str) -> Table {
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

/// What bands hold, by process and by distance.
fn band_table<'a>(bands: impl Iterator<Item = &'a CoveredAt>, unit: &str) -> Table {
    let mut table = Table::new().words("process").words("distance").numbers("rows").numbers("inside, %");
    table = table.numbers(format!("mean half width, {unit}"));
    for at in bands {
        table.row([
            title(at.process).to_owned(),
            at.distance.to_owned(),
            at.rows.to_string(),
            fixed(100.0 * at.coverage_share, 1),
            fixed(at.mean_half_width, 4),
        ]);
    }
    table
}

fn closing(body: &mut PageBody, summary: &ComparisonSummary) {
    let mut inner = PageBody::new();
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
    use crate::comparison::summary::{ErrorFigures, OfProcess, PaperClaim, SCHEMA, Searched};

    fn model(id: &'static str, title: &'static str, r2: [f64; 2]) -> ModelFigures {
        let score = |r2| ErrorFigures { rows: 10, mae: 0.01, rmse: 0.02, r2 };
        let of = |(process, r2)| OfProcess { process, score: score(r2) };
        let processes = ["startup", "shutdown"].into_iter().zip(r2).map(of).collect();
        ModelFigures { id, title, overall: score(0.5), processes }
    }

    fn summary(r2: [f64; 2]) -> ComparisonSummary {
        let claim = PaperClaim { what: "MAE of the MDHM".to_owned(), paper: "0.1", here: "0.2".to_owned(), unit: "pu" };
        ComparisonSummary {
            schema: SCHEMA,
            program: "govtwin",
            origin: None,
            settings: BTreeMap::new(),
            rows: BTreeMap::new(),
            recordings: vec![],
            models: vec![model("mbm", "MBM", r2), model("mdhm", "MDHM", [0.9, 0.8])],
            ranking: vec!["mdhm"],
            claims: vec![claim],
            seeds: vec![1],
            spread: vec![],
            ablation: vec![],
            breakdown: ErrorBreakdown { models: vec![], processes: vec![] },
            left_out_process: vec![],
            searches: vec![],
            importance: vec![],
            band: None,
            band_by_distance: vec![],
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
        assert!(html.contains("Of the hybrids MDHM is closest") && html.contains("0\u{a0}% less than the twin alone"));
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
    fn a_training_answers_first_and_says_where_its_data_come_from() {
        let halved = |mut model: ModelFigures| {
            model.overall.mae *= 0.5;
            model.processes.iter_mut().for_each(|one| one.score.mae *= 0.5);
            model
        };
        let twin = model("mbm", "MBM", [0.5, 0.6]);
        let of = |models: &[ModelFigures]| {
            let training = Training {
                signal: crate::signal::Signal::SpoolPosition,
                rows: [16_305, 20],
                origin: Some("Synthetic data: made up."),
                models,
                searches: &[],
                band: None,
            };
            training_page(&training).unwrap().to_html().replace('\u{a0}', " ")
        };
        let html = of(&[twin.clone(), halved(model("guarded", "hybrid, guarded", [0.5, 0.6]))]);
        let at = |words: &str| html.find(words).unwrap_or_else(|| panic!("{words}: {html}"));
        let order = [
            "takes 50 % of the twin",
            "Judged on 10 rows",
            "start-up 50 % less",
            "replay <span>--residual",
            "Synthetic data",
        ];
        assert!(order.map(at).is_sorted() && html.contains("16,305 rows teach"), "{html}");
        assert!(of(&[twin.clone(), twin]).contains("takes nothing of the twin"));
    }

    #[test]
    fn a_band_is_told_by_process_and_distance() {
        let at = CoveredAt {
            process: "shutdown",
            distance: "far",
            rows: 2612,
            coverage_share: 0.922,
            mean_half_width: 0.0196,
        };
        let outside = CoveredAt { distance: "outside", coverage_share: f64::NAN, mean_half_width: f64::NAN, ..at };
        let mut page = Page::new("", "");
        page.body.table(band_table([at, outside].iter(), "pu"), "");
        let html = page.to_html();
        assert!(html.contains("92.2") && html.contains("0.0196") && html.contains("outside"), "{html}");
        assert!(!html.contains("NaN"), "{html}");
    }

    #[test]
    fn a_model_worse_than_the_mean_is_told() {
        assert_eq!(pictures::below_zero(&summary([0.5, 0.0])), "");
        let words = pictures::below_zero(&summary([-0.4, 0.6]));
        assert!(words.contains("MBM in start-up (−0.400)") && !words.contains("MDHM"), "{words}");
    }
}
