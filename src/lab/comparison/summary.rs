//! The figures of a comparison for machines; the schema is in [`crate::comparison`].

use std::collections::BTreeMap;

use serde::Serialize;

use super::Contender;
use super::breakdown::ErrorBreakdown;
use super::coverage::CoveredAt;
use govtwin_correction::band::Band;
use govtwin_correction::prepare::Cleaning;
use govtwin_correction::table::FeatureTable;
use govtwin_model::metrics::Accumulator;
use govtwin_model::recording::Process;

/// Name and version of the schema.
pub const SCHEMA: &str = "govtwin-comparison/1";

/// All figures of one comparison.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparisonSummary {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Program and version.
    pub program: &'static str,
    /// The origin that the recordings' folder states.
    pub origin: Option<String>,
    /// Everything that was chosen.
    pub settings: BTreeMap<&'static str, String>,
    /// How many rows did what.
    pub rows: BTreeMap<&'static str, u64>,
    /// What preparation found.
    pub recordings: Vec<Cleaning>,
    /// Every model.
    pub models: Vec<ModelFigures>,
    /// Ids of the hybrids, the smallest MAE over all rows first.
    pub ranking: Vec<&'static str>,
    /// The paper's claims beside what is found here.
    pub claims: Vec<PaperClaim>,
    /// The seeds; figures of `models` are those of the first.
    pub seeds: Vec<u64>,
    /// Figures over all seeds.
    pub spread: Vec<SeedSpread>,
    /// What each step from the paper's hybrid to this one brings, with the manual hyperparameters, over all seeds.
    pub ablation: Vec<SeedSpread>,
    /// Where the MDHM loses to the DDM.
    pub breakdown: ErrorBreakdown,
    /// Every process left out of training in turn.
    pub left_out_process: Vec<UnseenProcess>,
    /// Searches for hyperparameters.
    pub searches: Vec<Searched>,
    /// Features of the MDHM, the strongest first.
    pub importance: Vec<Importance>,
    /// The MDHM's band on rows that no model was trained on.
    pub band: Option<Covered>,
    /// The same under the guard by processes, by distance from the rows that taught.
    pub band_by_distance: Vec<CoveredAt>,
    /// The additive residual against the one inside the loop, in closed-loop free run; `null` where the spool is not what is learned.
    pub closed_loop: Option<FreeRunFigures>,
}

/// Figures in closed-loop free run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FreeRunFigures {
    /// Of the spool position.
    pub spool: Vec<ModelFigures>,
    /// Of the servomotor position.
    pub servomotor: Vec<ModelFigures>,
}

/// One model's figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModelFigures {
    /// Its id.
    pub id: &'static str,
    /// Its title.
    pub title: &'static str,
    /// Over all rows.
    pub overall: ErrorFigures,
    /// The processes that have rows, in their usual order.
    pub processes: Vec<OfProcess>,
}

impl ModelFigures {
    /// Compares estimates with what was measured at `rows`.
    pub fn of(table: &FeatureTable, rows: &[usize], contender: &Contender) -> Self {
        let score = |process: Option<Process>| {
            let said = rows.iter().zip(&contender.estimates).map(|(&row, estimate)| (&table.marks[row], *estimate));
            let of_process = said.filter(|(mark, _)| process.is_none_or(|process| mark.process == process));
            let found = Accumulator::of(of_process.map(|(mark, estimate)| (mark.measured, estimate))).figures();
            ErrorFigures { rows: found.count, mae: found.mae, rmse: found.rmse, r2: found.r2 }
        };
        let of_process = |process: Process| OfProcess { process: process.id(), score: score(Some(process)) };
        Self {
            id: contender.id,
            title: contender.title,
            overall: score(None),
            processes: Process::ALL.map(of_process).into_iter().filter(|one| one.score.rows > 0).collect(),
        }
    }

    /// The figures of the process with this id.
    pub(crate) fn process(&self, id: &str) -> Option<&ErrorFigures> {
        self.processes.iter().find(|one| one.process == id).map(|one| &one.score)
    }

    /// Mean of R² over processes, as the paper averages it.
    pub(crate) fn mean_r2(&self) -> f64 {
        self.processes.iter().map(|one| one.score.r2).sum::<f64>() / self.processes.len() as f64
    }
}

/// By how much `ours` is below `theirs`, percent: lowest and highest over processes.
pub(crate) fn reduction(ours: &ModelFigures, theirs: &ModelFigures, figure: fn(&ErrorFigures) -> f64) -> [f64; 2] {
    let of =
        |own: &OfProcess| theirs.process(own.process).map(|other| 100.0 * (1.0 - figure(&own.score) / figure(other)));
    let reductions = ours.processes.iter().filter_map(of);
    reductions.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// Figures in the signal's unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorFigures {
    /// Rows.
    pub rows: u64,
    /// Mean absolute error, in the signal's unit, pu or Pa.
    pub mae: f64,
    /// Root mean square error, in the signal's unit, pu or Pa.
    pub rmse: f64,
    /// Coefficient of determination, a share of 1.
    pub r2: f64,
}

/// Figures of one process.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OfProcess {
    /// Its id.
    pub process: &'static str,
    /// The figures.
    #[serde(flatten)]
    pub score: ErrorFigures,
}

/// One model's figures over several seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeedSpread {
    /// Its id.
    pub id: &'static str,
    /// Its title.
    pub title: &'static str,
    /// Process by process; the last is all rows.
    pub parts: Vec<SpreadIn>,
}

/// Figures over several seeds, each as mean, lowest and highest, in the signal's unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpreadIn {
    /// Id of the process, or `all`.
    pub process: &'static str,
    /// Mean absolute error, in the signal's unit, pu or Pa.
    pub mae: [f64; 3],
    /// Root mean square error, in the signal's unit, pu or Pa.
    pub rmse: [f64; 3],
}

/// Figures over seeds; every seed has the same models in the same order.
pub fn spread(seeds: &[Vec<ModelFigures>]) -> Vec<SeedSpread> {
    let over = |values: Vec<f64>| {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        let (low, high) = (values.iter().copied().fold(mean, f64::min), values.iter().copied().fold(mean, f64::max));
        [mean, low, high]
    };
    let of = |place: usize, model: &ModelFigures| {
        let all: Vec<&ModelFigures> = seeds.iter().filter_map(|seed| seed.get(place)).collect();
        let part = |process: &'static str, figures: &dyn Fn(&ModelFigures) -> Option<ErrorFigures>| {
            let found: Vec<ErrorFigures> = all.iter().filter_map(|one| figures(one)).collect();
            let (mae, rmse) = (found.iter().map(|one| one.mae).collect(), found.iter().map(|one| one.rmse).collect());
            SpreadIn { process, mae: over(mae), rmse: over(rmse) }
        };
        let mut parts: Vec<SpreadIn> =
            model.processes.iter().map(|own| part(own.process, &|one| one.process(own.process).copied())).collect();
        parts.push(part("all", &|one| Some(one.overall)));
        SeedSpread { id: model.id, title: model.title, parts }
    };
    seeds.first().into_iter().flatten().enumerate().map(|(place, model)| of(place, model)).collect()
}

/// A claim of the paper, and the same figure here.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PaperClaim {
    /// What is claimed.
    pub what: String,
    /// In the paper, on another plant's data.
    pub paper: &'static str,
    /// On these recordings.
    pub here: String,
    /// The unit of both.
    pub unit: &'static str,
}

/// Figures on a process that no model has seen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnseenProcess {
    /// Its id.
    pub process: &'static str,
    /// The models.
    pub models: Vec<ModelFigures>,
    /// The band of the guarded hybrid on the better twin, by distance.
    pub band: Vec<CoveredAt>,
}

/// A search's trace.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Searched {
    /// Id of the model that it was for.
    pub id: &'static str,
    /// `bayesian` or `random`.
    pub kind: &'static str,
    /// Names of the dimensions.
    pub dimensions: Vec<&'static str>,
    /// Values of each trial.
    pub points: Vec<Vec<f64>>,
    /// Mean absolute error over the folds, in the signal's unit.
    pub losses: Vec<f64>,
    /// What the surrogate makes of them: per dimension value, middle, low and high.
    pub slices: BTreeMap<&'static str, Vec<[f64; 4]>>,
}

impl Searched {
    /// The trial with the smallest loss: its values and its loss.
    pub fn best(&self) -> Option<(&[f64], f64)> {
        let trials = self.points.iter().map(Vec::as_slice).zip(self.losses.iter().copied());
        trials.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The smallest loss after each trial.
    pub(crate) fn best_so_far(&self) -> Vec<f64> {
        let lower = |low: &mut f64, loss: &f64| {
            *low = low.min(*loss);
            Some(*low)
        };
        self.losses.iter().scan(f64::INFINITY, lower).collect()
    }
}

/// How much of the trees' gain is a feature's.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Importance {
    /// Its name.
    pub feature: String,
    /// Its group in Table 1.
    pub group: &'static str,
    /// Its share of all gain.
    pub gain_share: f64,
}

/// A band's stated coverage beside the measured one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Covered {
    /// Stated.
    pub coverage_share: f64,
    /// Measured over all rows.
    pub overall_share: f64,
    /// Measured in each process.
    pub processes: Vec<CoveredIn>,
}

/// Measured coverage of one process.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CoveredIn {
    /// Its id.
    pub process: &'static str,
    /// Share of rows inside the band.
    pub coverage_share: f64,
    /// Mean half width, in the signal's unit, pu or Pa.
    pub mean_half_width: f64,
}

/// The paper's claims for its hybrid, beside the figures here of the one that a sentence calls `of`; the models beside it are the twin alone
/// and the model of data alone.
pub fn claims(of: &str, hybrid: &ModelFigures, [mechanism, data]: [&ModelFigures; 2]) -> Vec<PaperClaim> {
    let span = |theirs: &ModelFigures, figure: fn(&ErrorFigures) -> f64| {
        let [low, high] = reduction(hybrid, theirs, figure);
        format!("{low:.1} to {high:.1}")
    };
    let claim = |what: &str, paper, here, unit| PaperClaim { what: what.replace("MDHM", of), paper, here, unit };
    vec![
        claim("R² of MDHM, mean over processes", "0.990", format!("{:.3}", hybrid.mean_r2()), ""),
        claim("MAE of MDHM below MBM", "43.9 to 68.3", span(mechanism, |figures| figures.mae), "%"),
        claim("MAE of MDHM below DDM", "38.1 to 86.9", span(data, |figures| figures.mae), "%"),
        claim("RMSE of MDHM below MBM", "32.0 to 59.1", span(mechanism, |figures| figures.rmse), "%"),
        claim("RMSE of MDHM below DDM", "30.4 to 77.0", span(data, |figures| figures.rmse), "%"),
    ]
}

/// How much of the rows a band holds.
pub fn covered(table: &FeatureTable, rows: &[usize], estimates: &[f64], band: &Band) -> Covered {
    let share = |process: Option<Process>| {
        let (mut count, mut inside, mut width) = (0_u64, 0_u64, 0.0);
        for (&row, estimate) in rows.iter().zip(estimates) {
            let mark = &table.marks[row];
            if process.is_none_or(|process| process == mark.process) {
                let half_width = band.half_width(mark.motion);
                count += 1;
                inside += u64::from((mark.measured - estimate).abs() <= half_width);
                width += half_width;
            }
        }
        (count > 0).then(|| (inside as f64 / count as f64, width / count as f64))
    };
    let of = |process: Process| {
        let (coverage_share, mean_half_width) = share(Some(process))?;
        Some(CoveredIn { process: process.id(), coverage_share, mean_half_width })
    };
    Covered {
        coverage_share: band.coverage_share,
        overall_share: share(None).map_or(f64::NAN, |(share, _)| share),
        processes: Process::ALL.into_iter().filter_map(of).collect(),
    }
}
