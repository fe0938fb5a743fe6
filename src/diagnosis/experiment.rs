//! What to try next: of the tests that an operator could run, those that take most off the posterior's entropy per minute.
//!
//! Every hypothesis that is left is put through each candidate once. Its outcome is a Gaussian: the mean is its simulation, the covariance noise and
//! what the free parameters leave open, `S = I + J Σ Jᵀ`, with the leader's slopes J of the sheet's parameters for all and each set's own slopes of its
//! effects. What that is worth stands in `diagnosis::experiment::information`; nats count as the posterior counts them ([`CountedNats`]).

pub mod candidate_test;
pub(crate) mod information;
pub(crate) mod stage_experiment;
pub mod survivors;

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::decision::Decision;
use crate::decision::hyperparameters::Hyperparameters;
use crate::decision::posterior::{CountedNats, Posterior};
use crate::estimation::coordinate::Residuals;
use crate::estimation::fit::slopes;
use crate::experiment::candidate_test::{Candidate, candidates};
use crate::experiment::information::{Drop, Predicted, entropy_bits, expected_drop};
use crate::experiment::survivors::{Survivor, deviations, survivors};
use crate::hypotheses::Explored;
use crate::hypotheses::explorer::is_stage_alone;
use crate::hypotheses::table::EvidenceTable;
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::{Problem, twin_of};
use crate::model::FittedModel;
use crate::result::test_script::CANDIDATES;
use crate::result::{Experiment, NEXT_TEST};
use govtwin_model::parameters::Unit;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Twin;

/// A test that is expected to tell less settles nothing, bits.
pub const LEAST_BITS: f64 = 0.01;

/// Simulated time that all candidates together may take, s: three hundred recordings of 40 s, a twentieth of a diagnosis.
const SIMULATED_S: f64 = 12_000.0;

/// Signals that a recorder of the pilot stage adds.
const PILOT: [Signal; 2] = [Signal::PilotValvePosition, Signal::ControlPressure];

/// What a posterior leaves open and what would settle it.
#[derive(Clone, Debug, Default)]
pub struct Next {
    /// Entropy of the posterior over the hypotheses that are left, bits.
    pub entropy_bits: f64,
    /// The tests, best first; none where nothing is to be settled.
    pub experiments: Vec<Experiment>,
}

/// The best tests: of those that ask for nothing further, and with a trip, pilot signals or a faster recorder where these tell more per minute.
pub fn design(
    problem: &Problem,
    found: &Explored,
    judged: (&EvidenceTable, &Posterior, &Hyperparameters),
    decision: &Decision,
) -> Next {
    let (table, posterior, numbers) = judged;
    let left = survivors(problem, found, table, posterior, decision);
    let entropy_bits = entropy_bits(left.iter().map(|one| one.probability));
    if entropy_bits < LEAST_BITS {
        return Next { entropy_bits, experiments: Vec::new() };
    }
    let Some(leader) = left.iter().find(|one| !one.unknown).or(left.first()) else { return Next::default() };
    let candidates = if is_stage_alone(problem) {
        stage_experiment::candidates(&leader.model.unit())
    } else {
        candidates(problem, &leader.model.unit(), &CANDIDATES)
    };
    let recorded = Signal::ALL.map(|signal| problem.recordings.iter().any(|recording| recording.has[signal as usize]));
    let weighed = weigh(
        problem,
        &left,
        leader.model,
        &found.refitted().unit(),
        candidates,
        (CountedNats::new(table, numbers), recorded),
    );
    Next { entropy_bits, experiments: chosen(weighed, entropy_bits) }
}

/// A candidate with the signals that are recorded for it, and what it is expected to tell.
#[derive(Clone, Debug)]
pub struct Weighed {
    candidate: Candidate,
    /// Signals to record.
    records: Vec<Signal>,
    /// Whether these are more than the recordings hold.
    further: bool,
    /// What it tells.
    pub drop: Drop,
    /// The two that it tells apart, with their distance.
    separates: Option<([String; 2], f64)>,
}

impl Weighed {
    fn per_minute(&self) -> f64 {
        60.0 * self.drop.least_bits / self.candidate.length_s().max(1.0)
    }

    /// What it asks for beyond what was done already.
    fn asks(&self) -> [bool; 3] {
        [self.candidate.trips() > 0, self.further, self.candidate.faster]
    }
}

/// Puts the survivors through the candidates and weighs what each would tell, with the signals of the recordings and, where pilot signals
/// were not among them, with those too. `known` is what nats count for and which signals were recorded.
pub fn weigh(
    problem: &Problem,
    left: &[Survivor<'_>],
    leader: &FittedModel,
    refitted: &Unit,
    candidates: Vec<Candidate>,
    known: (CountedNats, [bool; Signal::ALL.len()]),
) -> Vec<Weighed> {
    let tests = problem.anew(candidates.iter().map(|one| one.recording.clone()).collect(), &leader.unit());
    let mut twins: Vec<Twin> = left.iter().map(|one| one.twin.clone()).collect();
    twins.push(twin_of(refitted));
    let outcomes = tests.residuals_of_twins(&twins);
    let sheet = leader.free_parameters.len() - own_count(leader);
    let weighing = Weighing { left, leader, candidates, known, tests, outcomes, sheet };
    weighing.close().into_par_iter().flat_map_iter(|index| weighing.weighed(index)).collect()
}

/// Parameters of a model's effects.
fn own_count(model: &FittedModel) -> usize {
    model.effects.iter().map(|spec| spec.parameters.len()).sum()
}

/// Candidates with what every survivor, and behind them the refitted sheet, answers.
struct Weighing<'a> {
    left: &'a [Survivor<'a>],
    leader: &'a FittedModel,
    candidates: Vec<Candidate>,
    known: (CountedNats, [bool; Signal::ALL.len()]),
    /// The candidates with noise, the leader's answer being what is measured.
    tests: Problem,
    outcomes: Vec<Residuals>,
    /// Number of the sheet's parameters.
    sheet: usize,
}

impl Weighing<'_> {
    /// Place of the refitted sheet among the outcomes.
    fn refitted(&self) -> usize {
        self.left.len()
    }

    /// What is answered to a candidate, one column each.
    fn answers(&self, index: usize) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = self.outcomes.iter().map(|of| of[index].clone()).collect();
        DMatrix::from_columns(&columns)
    }

    /// Bits that a candidate would tell with all signals if every parameter were known.
    fn plain_bits(&self, index: usize) -> f64 {
        let answers = self.answers(index);
        let predicted: Vec<Predicted> = (0..self.left.len())
            .map(|k| Predicted {
                probability: self.left[k].probability,
                mean: unit_vector(answers.ncols(), k),
                deviations: DMatrix::zeros(answers.ncols(), 0),
            })
            .collect();
        expected_drop(&answers.tr_mul(&answers), &predicted, self.known.0).least_bits
    }

    /// The candidates to look at closely: of each kind in turn the best if every parameter were known, as many as time allows.
    fn close(&self) -> Vec<usize> {
        let count = self.candidates.len();
        let length_s = |index: usize| self.candidates[index].length_s();
        let mut order: Vec<(usize, f64)> = (0..count)
            .into_par_iter()
            .map(|index| (index, self.plain_bits(index) / length_s(index).max(1.0)))
            .collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1));
        let kind = |index: usize| (self.candidates[index].trips() > 0, self.candidates[index].faster);
        let turn = |place: usize| order[..place].iter().filter(|(k, _)| kind(*k) == kind(order[place].0)).count();
        let mut turns: Vec<(usize, usize)> = (0..count).map(|place| (turn(place), order[place].0)).collect();
        turns.sort_by_key(|(turn, _)| *turn);
        // Every candidate was simulated by all survivors and the sheet, and to lay out its noise.
        let mut spent_s: f64 = (0..count).map(|index| (self.outcomes.len() + 3) as f64 * length_s(index)).sum();
        let own: usize = self.left.iter().filter(|one| !one.unknown).map(|one| own_count(one.model)).sum();
        let mut close = Vec::new();
        for (turn, index) in turns {
            let more_s = (self.sheet + own) as f64 * length_s(index);
            if turn == 0 || spent_s + more_s <= SIMULATED_S {
                spent_s += more_s;
                close.push(index);
            }
        }
        close
    }

    /// What a candidate tells, with each choice of signals.
    fn weighed(&self, index: usize) -> Vec<Weighed> {
        let only = self.tests.only(index);
        let slopes_at = |model: &FittedModel, first: usize, at: &DVector<f64>| {
            slopes(&only, &model.base, &model.free_parameters, &model.fit.positions, first, &vec![at.clone()]).pop()
        };
        let leads = self.left.iter().position(|one| !one.unknown && std::ptr::eq(one.model, self.leader));
        let at_leader = &self.outcomes[leads.unwrap_or(self.refitted())][index];
        let answers = self.answers(index);
        let of_leader = slopes_at(self.leader, 0, at_leader).unwrap_or_else(|| DMatrix::zeros(answers.nrows(), 0));
        let first = answers.ncols();
        let mut columns = beside(answers, &of_leader.columns(0, self.sheet.min(of_leader.ncols())).into_owned());
        let mut places: Vec<usize> = Vec::new();
        for (k, one) in self.left.iter().enumerate() {
            places.push(columns.ncols());
            let own = if one.unknown || one.model.effects.is_empty() {
                None
            } else if Some(k) == leads {
                Some(of_leader.columns(self.sheet, own_count(one.model)).into_owned())
            } else {
                slopes_at(one.model, self.sheet, &self.outcomes[k][index])
            };
            if let Some(own) = own {
                columns = beside(columns, &own);
            }
        }
        let all = columns.ncols();
        let predicted: Vec<Predicted> =
            (0..self.left.len()).map(|k| self.predicted(k, (first, places[k]), all)).collect();
        let weighed = |(records, further): (Vec<Signal>, bool)| {
            let gram = gram(&columns, &self.candidates[index].recording, &records);
            let drop = expected_drop(&gram, &predicted, self.known.0);
            let name = |k: usize| self.left[k].name.clone();
            let separates = drop.separates.map(|(i, j, apart)| ([name(i), name(j)], apart));
            Weighed { candidate: self.candidates[index].clone(), records, further, drop, separates }
        };
        variants(&self.candidates[index], self.known.1).into_iter().map(weighed).collect()
    }

    /// What one survivor predicts: `places` are those of the slopes of the sheet's parameters and of the survivor's own.
    fn predicted(&self, k: usize, places: (usize, usize), columns: usize) -> Predicted {
        let one = &self.left[k];
        let root = deviations(one.model);
        let mut all = DMatrix::zeros(columns, root.ncols() + usize::from(one.unknown));
        for row in 0..root.nrows() {
            let place = if row < self.sheet { places.0 + row } else { places.1 + row - self.sheet };
            if place < columns {
                all.row_mut(place).columns_mut(0, root.ncols()).copy_from(&root.row(row));
            }
        }
        if one.unknown {
            // Of something unknown no more is known than that: its mark may be twice as large, or none.
            all[(k, root.ncols())] = 1.0;
            all[(self.refitted(), root.ncols())] = -1.0;
        }
        Predicted { probability: one.probability, mean: unit_vector(columns, k), deviations: all }
    }
}

fn unit_vector(length: usize, place: usize) -> DVector<f64> {
    let mut vector = DVector::zeros(length);
    vector[place] = 1.0;
    vector
}

/// Columns, and further ones to their right.
fn beside(left: DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let (first, more) = (left.ncols(), right.ncols());
    let mut both = left.resize_horizontally(first + more, 0.0);
    both.columns_mut(first, more).copy_from(right);
    both
}

/// Signals to record in a candidate: those that were recorded, and these with the pilot signals where they were not.
fn variants(candidate: &Candidate, recorded: [bool; Signal::ALL.len()]) -> Vec<(Vec<Signal>, bool)> {
    let has: Vec<Signal> = candidate.recording.signals().collect();
    let usual: Vec<Signal> = has.iter().copied().filter(|&signal| recorded[signal as usize]).collect();
    let more = has.iter().any(|&signal| PILOT.contains(&signal) && !recorded[signal as usize]);
    let with_pilot =
        has.into_iter().filter(|signal| recorded[*signal as usize] || PILOT.contains(signal)).collect::<Vec<_>>();
    let mut all = vec![(usual, false)];
    if more {
        all.push((with_pilot, true));
    }
    all
}

/// Products of columns over the samples of some signals.
fn gram(columns: &DMatrix<f64>, recording: &PreparedRecording, signals: &[Signal]) -> DMatrix<f64> {
    let n = columns.ncols();
    let count = recording.samples.len();
    signals.iter().filter_map(|&signal| recording.place(signal)).fold(DMatrix::zeros(n, n), |sum, place| {
        let rows = columns.rows(recording.residual(place, 0), count);
        sum + rows.transpose() * rows
    })
}

/// The best of each kind that tells more per minute than every kind that asks for less: those without a trip first.
fn chosen(mut weighed: Vec<Weighed>, entropy_bits: f64) -> Vec<Experiment> {
    weighed.retain(|one| one.drop.least_bits >= LEAST_BITS);
    weighed.sort_by(|a, b| b.per_minute().total_cmp(&a.per_minute()));
    let mut best: Vec<Weighed> = Vec::new();
    for one in weighed {
        // All that stand there already tell more per minute.
        let asks = one.asks();
        let asks_no_less = |other: &Weighed| other.asks().iter().zip(asks).all(|(other, own)| !other || own);
        if !best.iter().any(asks_no_less) {
            best.push(one);
        }
    }
    best.sort_by_key(|one| one.candidate.trips());
    let mut all: Vec<Experiment> = best.into_iter().map(|one| experiment(one, entropy_bits)).collect();
    if let Some(first) = all.first_mut() {
        first.bag = first.script.map(|_| NEXT_TEST.to_owned());
    }
    all
}

fn experiment(one: Weighed, entropy_bits: f64) -> Experiment {
    let bits_per_minute = one.per_minute();
    let [signals, further] = [
        one.records.iter().copied().filter(|signal| !PILOT.contains(signal)).collect::<Vec<_>>(),
        one.records.iter().copied().filter(|signal| PILOT.contains(signal)).collect(),
    ]
    .map(|signals| signals.into_iter().map(|signal| signal.title().to_lowercase()).collect::<Vec<_>>().join(" and "));
    let Weighed { candidate, records, separates, drop, .. } = one;
    let (length_s, trips) = (candidate.length_s(), candidate.trips());
    let mut test = candidate.test;
    if one.further {
        test = format!("{test}; record {further} in addition to {signals}");
    }
    if candidate.faster {
        test = format!("{test}; record at {} Hz", candidate.rate_hz);
    }
    let (separates, separation) = separates.map_or((Vec::new(), 0.0), |(names, apart)| (names.to_vec(), apart));
    Experiment {
        separates,
        test,
        separation,
        expected_drop_bits: drop.least_bits,
        at_most_bits: drop.most_bits,
        entropy_bits,
        bits_per_minute,
        length_s,
        trips,
        unit_state: candidate.unit_state,
        records,
        rate_hz: candidate.rate_hz,
        script: candidate.script,
        bag: None,
    }
}
