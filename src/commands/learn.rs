//! What `train` and `compare` share: their arguments, the recordings made ready, the searches and their journal.

pub mod journal;
#[cfg(feature = "deep")]
pub mod networks;

use std::path::PathBuf;

use anyhow::bail;
use govtwin_bag::{ReadOptions, Stream, Topics};
use govtwin_correction::booster::{Hyperparameters, Objective};
use govtwin_correction::features;
use govtwin_correction::history::{LONGEST_PERIOD_NS, SHORTEST_PERIOD_NS};
use govtwin_correction::model::Learned;
use govtwin_correction::prepare::{Cleaning, Prepared, prepare};
use govtwin_correction::row::{Opening, RateOfInputs};
use govtwin_correction::search::{Evaluation, Hyperparameter, bayesian, random, slices};
use govtwin_correction::split::{RowSplit, folds};
use govtwin_correction::table::{FeatureTable, TableLayout, slowest_period_ns, table};
use govtwin_correction::training::{self, Recipe};
use govtwin_lab::comparison::summary::Searched;
use govtwin_model::parameters::Unit;
use govtwin_model::params::Sheet;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::replay::between::simulate_between;
use govtwin_model::replay::simulate;
use govtwin_model::signal::Signal;
use govtwin_model::twin::{Cut, Twin};
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::bags::{self, Bag, TopicArgs};
use super::choice::{Choice, choice};
use super::output::{Progress, warn};
use super::replay::origin;
use super::sheet_of;
use journal::EvaluationJournal;

/// What both commands take.
#[derive(Debug, clap::Args)]
#[group(id = "learning")]
pub struct Args {
    /// Bags: files, bag folders, or folders that contain bags.
    #[arg(value_name = "BAG", required = true)]
    bags: Vec<PathBuf>,
    #[command(flatten)]
    topics: TopicArgs,
    /// Data sheet (parameter file) of the unit; without it, the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Signal to correct.
    #[arg(long, default_value = "spool", value_parser = choice(CORRECTED))]
    signal: Signal,
    /// Period of the training rows, s; without it, the longest median sample interval of the recordings.
    #[arg(long = "period", value_name = "S")]
    period_s: Option<f64>,
    /// Number of evaluations of each hyperparameter search.
    #[arg(long, value_name = "N", default_value_t = 50)]
    pub iterations: usize,
    /// Seed of all random numbers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Use a tenth of the evaluations, to check that everything works.
    #[arg(long)]
    quick: bool,
    /// Folder for the results; created if missing. Evaluations of an interrupted run are read from it.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print JSON instead of tables: all figures, as in the JSON file of the folder.
    #[arg(long)]
    pub json: bool,
}

/// Signals that may be corrected.
const CORRECTED: [Choice<Signal>; 2] = [
    ("spool", "Spool of the main distributing valve", Signal::SpoolPosition),
    ("servomotor", "Guide-vane servomotor", Signal::ServomotorPosition),
];

/// Where the guide-vane opening comes from.
pub const OPENINGS: [Choice<Cut>; 2] = [
    ("none", "Everything is simulated, as in the node", Cut::None),
    ("servomotor", "The measured servomotor position feeds the regulator, as in Liu et al. 2025", Cut::Servomotor),
];

/// Everything that training needs.
pub struct TrainingData {
    /// The unit.
    pub sheet: Sheet,
    /// Recordings, prepared.
    pub recordings: Vec<Recording>,
    /// What preparation found.
    pub cleanings: Vec<Cleaning>,
    /// The rows.
    pub table: FeatureTable,
    /// What the folders say of where the data comes from.
    pub origin: Option<String>,
    /// Where the recording stands in for the twin.
    pub cut: Cut,
}

impl TrainingData {
    /// The same rows under another unit's twin, or with other inputs between them.
    pub fn table_of(&self, unit: &Unit, rate_of_inputs: RateOfInputs) -> FeatureTable {
        let twin = Twin::new(unit).with_cut(self.cut);
        let period_ns = grid_ns(unit);
        let run = |one: &Recording| match rate_of_inputs {
            RateOfInputs::Hold => simulate(&mut twin.clone(), one),
            RateOfInputs::Linear => simulate_between(&mut twin.clone(), one, period_ns),
        };
        let estimates: Vec<_> = self.recordings.par_iter().map(run).collect();
        table(&self.recordings, &estimates, TableLayout { rate_of_inputs, ..self.table.layout.clone() })
    }
}

/// The grid on which inputs are drawn in between rows, ns: the regulator reads no faster.
pub fn grid_ns(unit: &Unit) -> i64 {
    nanos_from_seconds(unit.parameters.regulator.large_loop_period_s).max(1)
}

impl Args {
    /// Evaluations of a search, and how many of them chance chooses first.
    pub fn budget(&self) -> (usize, usize) {
        let budget = self.scaled(self.iterations);
        (budget, Self::initial(budget))
    }

    /// How many of so many evaluations chance chooses first.
    pub fn initial(budget: usize) -> usize {
        budget.div_ceil(5).max(3).min(budget)
    }

    /// So many evaluations, or a tenth.
    pub fn scaled(&self, evaluations: usize) -> usize {
        if self.quick { evaluations.div_ceil(10) } else { evaluations }.max(1)
    }

    /// Reads, prepares and simulates the recordings but those of some processes, and makes the rows.
    pub fn prepare(
        &self,
        cut: Cut,
        rate_of_inputs: RateOfInputs,
        left_out: &[Process],
    ) -> anyhow::Result<TrainingData> {
        let sheet = sheet_of(self.params.as_deref())?;
        let signal = self.signal;
        let opening = if cut == Cut::Servomotor { Opening::Measured } else { Opening::Simulated };
        if signal == Signal::ServomotorPosition && cut == Cut::Servomotor {
            bail!(
                "--signal servomotor with --cut servomotor: the measured signal stands in for the simulated one, so nothing is left to correct; use --cut none"
            );
        }
        let bags = bags::find(&self.bags)?;
        let mut origins: Vec<String> = bags.iter().filter_map(|bag| origin::of(&bag.path)).collect();
        origins.dedup();
        let mut raw = read(&bags, self.topics.topics())?;
        raw.retain(|recording| !left_out.contains(&recording.process));
        if raw.is_empty() {
            bail!("--leave-out leaves no recording of {} to learn from", bags.len());
        }
        let Prepared { recordings, cleanings } = prepare(raw, signal);
        let period_ns = match self.period_s {
            Some(period_s) => nanos_from_seconds(period_s),
            None => slowest_period_ns(&recordings, signal),
        };
        if !(SHORTEST_PERIOD_NS..=LONGEST_PERIOD_NS).contains(&period_ns) {
            bail!(
                "the training period is {} s; 0.002 to 2 s are possible. Does every bag hold /plant/servo_state? See --period",
                seconds_from_nanos(period_ns)
            );
        }
        let layout = TableLayout { signal, opening, rate_of_inputs, period_ns, features: features::all() };
        let nothing = FeatureTable { layout, values: vec![], marks: vec![], left_out: 0 };
        let origin = (!origins.is_empty()).then(|| origins.join(" "));
        let mut ready = TrainingData { sheet, recordings, cleanings, table: nothing, origin, cut };
        ready.table = ready.table_of(&ready.sheet.unit, rate_of_inputs);
        for cleaning in ready.cleanings.iter().filter(|cleaning| !cleaning.is_clean()) {
            warn(&format!("{}: {}", cleaning.name, cleaning.words()));
        }
        if ready.table.left_out > 0 {
            let count = ready.table.left_out;
            warn(&format!("{count} samples have a feature that is not a finite number: left out"));
        }
        Ok(ready)
    }

    /// Searches for hyperparameters with the Gaussian process, or at random; evaluations in the journal are not repeated.
    pub fn search(
        &self,
        table: &FeatureTable,
        split: &RowSplit,
        learned: Learned,
        job: SearchJob,
        seed: u64,
    ) -> anyhow::Result<Searched> {
        let folds = folds(table, &split.train);
        let (budget, initial) = self.budget();
        // Evaluations by another objective are others.
        let of: &dyn std::fmt::Debug =
            if job.objective == Objective::L1 { &learned } else { &(learned, job.objective) };
        let mut journal = EvaluationJournal::open(&self.out.join("search.json"), table, &split.train, of, seed)?;
        let progress = Progress::new(budget, job.noun);
        let space = &training::SPACE;
        let trials = search(space, job.kind, [initial, budget], seed, |point| {
            let with = Hyperparameters { objective: job.objective, ..training::at(point) };
            journal
                .loss(point, || Ok(training::loss(table, &folds, Recipe { learned, with: &with, seed })?))
                .inspect(|_| progress.step())
        })?;
        Ok(searched(space, job, &trials))
    }
}

/// One search.
#[derive(Clone, Copy)]
pub struct SearchJob {
    /// Id of the model that it is for.
    pub id: &'static str,
    /// `bayesian` or `random`.
    pub kind: &'static str,
    /// What the progress bar counts.
    pub noun: &'static str,
    /// What the trees make least; trials are judged by their mean absolute error whatever it is.
    pub objective: Objective,
}

/// Runs a search of either kind.
pub fn search(
    space: &[Hyperparameter],
    kind: &str,
    [initial, budget]: [usize; 2],
    seed: u64,
    objective: impl FnMut(&[f64]) -> anyhow::Result<f64>,
) -> anyhow::Result<Vec<Evaluation>> {
    if kind == "random" {
        random(space, budget, seed, objective)
    } else {
        bayesian(space, initial, budget, seed, objective)
    }
}

/// A search as it is reported.
pub fn searched(space: &[Hyperparameter], job: SearchJob, trials: &[Evaluation]) -> Searched {
    let slices = if job.kind == "bayesian" { slices(space, trials) } else { vec![] };
    Searched {
        id: job.id,
        kind: job.kind,
        dimensions: space.iter().map(|dimension| dimension.name).collect(),
        points: trials.iter().map(|trial| trial.values.clone()).collect(),
        losses: trials.iter().map(|trial| trial.loss).collect(),
        slices: slices.into_iter().map(|slice| (slice.name, slice.points)).collect(),
    }
}

fn read(bags: &[Bag], topics: Topics) -> anyhow::Result<Vec<Recording>> {
    let options = ReadOptions { topics, required: vec![Stream::ServoState], ..ReadOptions::default() };
    let read = |bag: &Bag| -> anyhow::Result<Recording> {
        let mut loaded = govtwin_bag::read(&bag.path, &options)?;
        loaded.recording.name.clone_from(&bag.name);
        for warning in &loaded.health.warnings {
            warn(&format!("{}: {warning}", bag.name));
        }
        Ok(loaded.recording)
    };
    bags.iter().map(read).collect()
}
