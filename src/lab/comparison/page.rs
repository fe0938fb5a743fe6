//! The page of a comparison: the views of the paper's Figures 12 to 16, the searches, and what the paper does not show.

mod answers;
mod pictures;
mod searches;
mod training;

use crate::comparison::Contender;
use crate::comparison::breakdown::ErrorBreakdown;
use crate::comparison::coverage::CoveredAt;
use crate::comparison::summary::{ComparisonSummary, ModelFigures, SeedSpread};
use govtwin_correction::table::FeatureTable as Rows;
use govtwin_model::number::{fixed, significant};
use govtwin_model::recording::Process;
use govtwin_pages::draw::svg;
use govtwin_pages::page::{KeyFigure, Page, PageBody, Tone};
use govtwin_pages::table::Table;

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
pub fn breakdown_table(broken: &ErrorBreakdown, unit: &str) -> Table {
    let mut table = Table::new().words("process").words("phase").numbers("rows");
    for model in &broken.models {
        table = table.numbers(format!("{model}, MAE, {unit}")).numbers("squared error, %");
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
    Process::with_id(id).map_or(id, |process| process.title())
}

/// The page.
pub fn page(summary: &ComparisonSummary, shown: &Shown) -> Page {
    let unit = shown.rows.layout.signal.unit();
    let mut page = Page::new(
        "Comparison of models",
        format!("{}, on test rows that no model was trained on", shown.rows.layout.signal.title()),
    );
    let body = &mut page.body;
    opening(body, summary, unit);
    body.heading("Measured and predicted signals");
    body.figure(
        svg(&pictures::traces(shown)),
        "Measured signal, twin alone (MBM), data alone (DDM) and hybrid (MDHM) on part of the test rows of each process (as Figure 12 of the paper).",
    );
    body.heading("Errors by process");
    let caption =
        format!("MAE, RMSE and R² on the test rows of each process (as Figure 13).{}", pictures::below_zero(summary));
    body.figure(svg(&pictures::bars(summary, unit)), caption);
    body.table(models_table(&summary.models, unit), "Errors on the test rows, the last 30 % of each process.");
    body.heading("Errors of the hybrids");
    body.figure(
        svg(&pictures::residuals(shown)),
        "Error of each hybrid (predicted − measured) on the test rows (as Figure 14).",
    );
    body.figure(
        svg(&pictures::spreads(shown)),
        "Distribution of these errors: kernel density estimates, and a histogram of the first model (as Figure 15).",
    );
    body.figure(svg(&pictures::heatmap(summary, unit)), "MAE, RMSE and R² of the hybrids by process (as Figure 16).");
    why(body, summary, shown);
    body.heading("Test with a process left out of training");
    body.paragraph("Each process is left out of training in turn and used as the test set; the paper does not show this. The hyperparameters are the \
         manual ones, because a search would have seen the process. The guard reduces corrections for rows outside the training range.");
    body.figure(svg(&pictures::left_out(summary, unit)), "MAE of each model on the process that was left out.");
    body.table(left_out_table(summary, unit), "Errors on the process that was left out.");
    let bands = summary.left_out_process.iter().flat_map(|one| &one.band);
    body.table(
        band_table(bands, unit),
        "Prediction band of the guarded hybrid on the process that was left out, by distance from the training rows: near (full \
         correction), far (reduced correction) and outside (no band).",
    );
    if let Some(run) = &summary.closed_loop {
        body.heading("Correction inside the loop");
        body.paragraph("Closed-loop free run without measured positions. The additive residual corrects only the predicted spool position. The residual \
             inside the loop corrects the spool's rate in the twin, from the twin's own state, and therefore changes the servomotor as well. \
             Both have the manual hyperparameters and their guards.");
        body.table(models_table(&run.spool, "pu"), "Spool position.");
        body.table(
            models_table(&run.servomotor, "pu"),
            "Servomotor position, which the additive residual does not change.",
        );
    }
    body.heading("Feature importance");
    body.figure(
        svg(&pictures::importance(summary)),
        "Share of the total gain of the trees in the MDHM: the most important features, and the feature groups of Table 1.",
    );
    body.heading("Hyperparameter searches");
    search_blocks(body, &summary.searches, unit);
    closing(body, summary);
    page
}

/// Why the paper's hybrid is worse than data alone, and the gain of each remedy.
fn why(body: &mut PageBody, summary: &ComparisonSummary, shown: &Shown) {
    let unit = shown.rows.layout.signal.unit();
    body.heading("Where the MDHM is worse than the DDM");
    for one in &summary.breakdown.processes {
        let shifts: Vec<String> =
            one.shift_s.iter().map(|(id, shift_s)| format!("{id} {} s", fixed(*shift_s, 2))).collect();
        let decided = one.decided_share.map_or("the MDHM has no larger squared error".to_owned(), |share| {
            format!(
                "{} % of the additional squared error of the MDHM is in {} rows",
                fixed(100.0 * share, 0),
                one.worst.len()
            )
        });
        let guard = &one.guard;
        body.paragraph(format!(
            "{}: {decided}. Delay of the simulated signal: {}. Of {} rows the guard would clamp {}, fade {}, shrink {} and refuse {}.",
            title(one.process),
            shifts.join(", "),
            guard.rows,
            guard.clamped,
            guard.faded,
            guard.shrunk,
            guard.outside + guard.bad
        ));
    }
    body.figure(
        svg(&pictures::worst(summary, shown)),
        "Signals around the row of each process where the squared error of the MDHM exceeds that of the DDM most.",
    );
    body.table(
        breakdown_table(&summary.breakdown, unit),
        "MAE by process and phase, and the share of the squared error of each model within the process.",
    );
    body.heading("Ablation: the effect of each step");
    body.table(
        spread_table(&summary.ablation, unit),
        "All models with manual hyperparameters. Mean over the seeds, with the lowest and the highest value in brackets.",
    );
    if summary.seeds.len() > 1 {
        body.heading("Spread over seeds");
        body.table(
            spread_table(&summary.spread, unit),
            "Each seed with its own searches. Mean, with the lowest and the highest value in brackets.",
        );
    }
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
    body.table(table, "Results of the paper on its own plant data, which is confidential, and on these recordings. Ranges are over processes.");
    if let Some(band) = &summary.band {
        let said: Vec<String> = band
            .processes
            .iter()
            .map(|one| format!("{} {} %", title(one.process), fixed(100.0 * one.coverage_share, 1)))
            .collect();
        body.paragraph(format!(
            "Conformal prediction band of the MDHM: nominal coverage {} %; {} % of the test rows are inside ({}).",
            fixed(100.0 * band.coverage_share, 0),
            fixed(100.0 * band.overall_share, 1),
            said.join(", ")
        ));
        let caption = "Coverage of this band with the guard, by process and by distance from the training rows.";
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
        "Each process is split separately: the first 70 % of its rows in time are training rows, the last 30 % test rows. Where the split falls \
         inside a recording, rows whose windows cross it are left out. Searches use five folds by time within the training rows only.",
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
        let heat = svg(&pictures::heatmap(&summary, "pu")).as_str().to_owned();
        assert!(heat.contains("MAE, pu") && heat.contains("RMSE, pu") && !heat.contains("R², pu"), "{heat}");
        let mut page = Page::new("", "");
        opening(&mut page.body, &summary, "pu");
        let html = page.to_html();
        assert!(html.contains("RMSE 0.0200 pu") && !html.contains("synthetic"), "{html}");
        assert!(
            html.contains("The best hybrid is MDHM: mean absolute error ")
                && html.contains("0\u{a0}% less than the twin alone")
        );
        let search = Searched {
            id: "hybrid",
            kind: "random",
            dimensions: vec!["trees"],
            points: vec![vec![10.0]],
            losses: vec![0.5],
            slices: BTreeMap::new(),
        };
        search_blocks(&mut page.body, &[search], "pu");
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
                signal: govtwin_model::signal::Signal::SpoolPosition,
                rows: [16_305, 20],
                origin: Some("Synthetic data: made up."),
                models,
                searches: &[],
                band: None,
            };
            training_page(&training).to_html().replace('\u{a0}', " ")
        };
        let html = of(&[twin.clone(), halved(model("guarded", "hybrid, guarded", [0.5, 0.6]))]);
        let at = |words: &str| html.find(words).unwrap_or_else(|| panic!("{words}: {html}"));
        let order = [
            "removes 50 % of the twin",
            "Evaluated on 10 test rows",
            "start-up 50 % less",
            "replay <span>--residual",
            "Synthetic data",
        ];
        assert!(order.map(at).is_sorted() && html.contains("16,305 training rows, 20 test rows"), "{html}");
        assert!(of(&[twin.clone(), twin]).contains("removes none of the twin"));
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
