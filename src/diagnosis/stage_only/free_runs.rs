//! The models of a stage in free runs over pieces that they were not fitted to: the twin without and with the named effects, plain models beside it.
//!
//! Each half of the recordings is fitted in turn and the other predicted, piece by piece, each from its own measured start. A plain model *wins* where it
//! predicts both halves better than any twin, by more than a twentieth, and by more than twice the standard error of the differences between pieces.

use std::collections::BTreeSet;

use crate::estimation::coordinate::subject_at;
use crate::estimation::fit::{Effort, fit};
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::{Problem, twin_of};
use crate::model::FittedModel;
use crate::preparation::{Preparation, StageAlone};
use crate::result::{ComparedModel, ModelParameter, Setup};
use crate::stage_alone::command::Deviation;
use crate::stage_alone::pieces::windows;
use crate::stage_alone::plain::Plain;
use crate::stage_alone::plain_models::{DELAY, GAIN_BELOW, LAG, PlainKind, PlainModel, SATURATES};
use crate::stage_alone::plain_numbers::PlainNumbers;
use crate::stage_alone::run::{HISTORY, LEAD, Run};
use crate::stage_alone::spread::is_gain;
use crate::stage_alone::time_scale::free_run_s;
use crate::stage_only::stage_figures::PlainLaw;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Cut;

/// The twin's error over the plain model's from which on the plain one may win: by less, the twin is as good.
const CLEARLY: f64 = 1.05;
/// Share of the squared movement that a sum leaves at most.
const SUMS_UP: f64 = 0.5;
/// Share of the squared error, of what a plain model of the same law closes, that named effects must close beside it.
const NEARLY: f64 = 0.9;
/// What plain laws have of the catalogue's effects, by their parameters: speeds that differ by direction, a spool that acts late, speeds that saturate.
const HELD: [(&str, &[&str]); 4] = [
    (GAIN_BELOW, &["port_asymmetry", "load", "supply_loss", "return_loss", "port_wear"]),
    (DELAY, &["valve_lag"]),
    (LAG, &["valve_lag"]),
    (SATURATES, &["flow_saturation", "supply_loss", "return_loss"]),
];

/// The models in free runs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Compared {
    /// Length of a free run, s.
    pub free_run_s: f64,
    /// What drives the plain models.
    pub drive: &'static str,
    /// Whether that is the set point of a position loop.
    is_loop: bool,
    /// The models: twins first.
    pub models: Vec<ComparedModel>,
    /// RMS movement in a free run, pu: what a model that stands still would miss.
    moved_pu: f64,
    /// The plain law in the numbers of the recordings, where it is driven by what drives the twin.
    law: Option<(Plain, PlainNumbers)>,
}

/// Sum of squares, pu², and number of samples of each piece.
type Squares = Vec<(f64, usize)>;

impl Compared {
    /// Fits and runs the models; empty where there are no two halves.
    pub(crate) fn of(ready: &Preparation, stage: &StageAlone, twins: &[&FittedModel]) -> Self {
        let deviation = stage.deviation();
        let drive = if stage.stands_in.is_some() { "command" } else { "spool" };
        let whole: Vec<Run> = stage
            .whole
            .iter()
            .cloned()
            .map(PreparedRecording::servomotor_stage)
            .filter_map(|one| Run::of(&one))
            .collect();
        let mut compared =
            Self { free_run_s: free_run_s(&whole), drive, is_loop: deviation.is_some(), ..Self::default() };
        let of_history = |history: f64| halves(&stage.whole, compared.free_run_s, history, ready);
        let Some((halves, remembered)) = of_history(LEAD).zip(of_history(HISTORY)) else { return compared };
        for model in twins {
            let errors = [0, 1].map(|half| {
                let problem = Problem::new(halves[1 - half].clone(), &model.unit(), &ready.noise);
                let found =
                    fit(&problem, &model.base, &model.free_parameters, &model.fit.positions, Effort::FULL, None);
                let unit = subject_at(&model.base, &model.free_parameters, &found.positions);
                twin_squares(&halves[half], &unit, ready, deviation)
            });
            compared.add(model.ids().join(" + "), None, &errors);
        }
        let recorded = ready.unit.recorded;
        let runs = remembered
            .each_ref()
            .map(|half| half.iter().filter_map(|one| as_recorded(one, ready, deviation)).collect::<Vec<Run>>());
        let both: Vec<Run> = runs.iter().flatten().cloned().collect();
        let scale_pu = recorded.servomotor_position.scale_pu;
        let moved = both.iter().flat_map(|run| run.opening.iter().map(|y| (scale_pu * (y - run.opening[0])).powi(2)));
        let (square, count) = moved.fold((0.0, 0_usize), |(sum, count), one| (sum + one, count + 1));
        compared.moved_pu = (square / count.max(1) as f64).sqrt();
        for kind in PlainKind::all() {
            let fitted = [kind.fitted(&runs[0]), kind.fitted(&runs[1]), kind.fitted(&both)];
            let [Some(first), Some(second), Some(whole)] = fitted else { continue };
            let squares = |model: &PlainModel, half: usize| -> Squares {
                let of = |run: &Run| {
                    let said = model.simulated(run);
                    let squares = said.iter().zip(&run.opening).map(|(said, seen)| (scale_pu * (said - seen)).powi(2));
                    (squares.sum(), said.len())
                };
                runs[half].iter().map(of).collect()
            };
            let errors = [squares(&second, 0), squares(&first, 1)];
            let numbers = PlainNumbers::of(whole, &both);
            compared.add(kind.title().to_owned(), Some(parameters(&whole, numbers.as_ref(), drive)), &errors);
            if let (PlainModel::Sum(PlainKind::PlainLaw, law), Some(numbers), None) = (whole, numbers, deviation) {
                compared.law = Some((law, numbers));
            }
        }
        compared
    }

    /// Takes a model's squares in the pieces of either half, held out by the fit to the other.
    fn add(&mut self, name: String, plain: Option<Vec<ModelParameter>>, halves: &[Squares; 2]) {
        let rmse = |squares: &[(f64, usize)]| {
            let (sum, count) = squares.iter().fold((0.0, 0), |(sum, count), one| (sum + one.0, count + one.1));
            (sum / f64::max(count as f64, 1.0)).sqrt()
        };
        let held_out = halves.concat();
        self.models.push(ComparedModel {
            model: name,
            is_plain: plain.is_some(),
            parameters: plain.unwrap_or_default(),
            held_out: rmse(&held_out),
            halves: halves.each_ref().map(|half| rmse(half)),
            pieces: held_out.iter().map(|one| rmse(std::slice::from_ref(one))).collect(),
        });
    }

    /// What the plain law says of the figures of a stage, and whether it or the twin with these effects predicts better.
    pub(crate) fn plain_law(&self, effects: &str) -> Option<PlainLaw<'_>> {
        let (law, numbers) = self.law.as_ref()?;
        let of = |name: &str| self.models.iter().find(|model| model.model == name);
        let (twin, plain) = of(effects).zip(of(PlainKind::PlainLaw.title()))?;
        let is_better = if wins(plain, twin) { Some(true) } else { wins(twin, plain).then_some(false) };
        Some(PlainLaw { law: *law, numbers, is_better })
    }

    /// Whether a plain model that sums up what drives it predicts most of the movement, and better than all that settle within a run.
    pub(crate) fn sums_up(&self) -> bool {
        let least = |settles: bool| {
            let plain = self.models.iter().filter(|model| {
                let kind = PlainKind::titled(&model.model).filter(|kind| model.is_plain && kind.settles() == settles);
                kind.is_some() && self.settles_in_time(model)
            });
            plain.map(|model| model.held_out).fold(f64::INFINITY, f64::min)
        };
        let most = SUMS_UP.sqrt() * self.moved_pu;
        least(false) < least(true).min(most)
    }

    /// Whether a model settles within a run: one that would only long after it is a sum with a leak, and its set point means nothing.
    fn settles_in_time(&self, model: &ComparedModel) -> bool {
        let lag_s = model.parameters.iter().find(|parameter| parameter.name == LAG).map_or(0.0, |lag| lag.value);
        PlainKind::titled(&model.model).is_none_or(|kind| !kind.settles() || lag_s <= self.free_run_s)
    }

    /// The plain model that wins.
    pub(crate) fn winner(&self) -> Option<&ComparedModel> {
        let best = |plain: bool| {
            let models = self.models.iter().filter(|model| model.is_plain == plain && model.held_out.is_finite());
            let models = models.filter(|model| self.settles_in_time(model));
            models.min_by(|a, b| a.held_out.total_cmp(&b.held_out))
        };
        let plain = best(true)?;
        let twins = || self.models.iter().filter(|model| !model.is_plain);
        twins().all(|twin| wins(plain, twin)).then_some(plain).filter(|_| best(false).is_some())
    }

    /// The plain model of the stage's own law that errs less than the twin with these effects, where none wins: what differs between pieces may be chance.
    /// Of a position loop a law of its set point that errs no more: that needs no stage to be believed. All held-out pieces count together: a twin whose fit
    /// fails in one half is none to believe for the other.
    pub(crate) fn as_good(&self, effects: &str) -> Option<&ComparedModel> {
        if self.winner().is_some() {
            return None;
        }
        let twin = self.models.iter().find(|model| !model.is_plain && model.model == effects)?;
        let most = twin.held_out * if self.is_loop { CLEARLY } else { CLEARLY.recip() };
        self.own_plain().filter(|plain| plain.held_out < most)
    }

    /// The plain model of a loop's or a stage's own kind that errs least.
    fn own_plain(&self) -> Option<&ComparedModel> {
        let own = |model: &&ComparedModel| {
            let settles = PlainKind::titled(&model.model).is_some_and(PlainKind::settles);
            model.is_plain && settles == self.is_loop && self.settles_in_time(model)
        };
        self.models.iter().filter(own).min_by(|a, b| a.held_out.total_cmp(&b.held_out))
    }

    /// Whether a model wins whose position settles, which a servomotor's does not.
    pub(crate) fn settles(&self) -> bool {
        self.winner().and_then(|plain| PlainKind::titled(&plain.model)).is_some_and(PlainKind::settles)
    }

    /// Of several effects the one that predicts some half of the pieces at least as well alone as all of them do; none where the others are needed too,
    /// or the free runs were not made.
    pub(crate) fn enough_alone(&self, effects: &[&'static str]) -> Option<&'static str> {
        let together = self.twin(&effects.join(" + "))?;
        let singles = effects.iter().filter_map(|id| Some((*id, self.twin(id)?)));
        let (id, alone) = singles.min_by(|a, b| a.1.held_out.total_cmp(&b.1.held_out))?;
        (effects.len() > 1 && (0..2).any(|half| together.halves[half] >= alone.halves[half])).then_some(id)
    }

    /// The twin with just these effects.
    fn twin(&self, effects: &str) -> Option<&ComparedModel> {
        let ids = |name: &str| name.split(" + ").map(str::to_owned).collect::<BTreeSet<String>>();
        self.models.iter().find(|model| !model.is_plain && ids(&model.model) == ids(effects))
    }

    /// Why effects are not named, in words; none where the free runs bear them out, or were not made.
    ///
    /// The twin with them must predict both halves better than the one without, and than every plain model that has not what they do. One that has it may
    /// win: then they must close nearly as much of the error as it does. In a loop, of which a law of the set point says all
    /// without a valve, the twin must predict both halves better than that.
    pub(crate) fn against(&self, effects: &str) -> Option<String> {
        let (without, with) = self.twin("").zip(self.twin(effects))?;
        if (0..2).any(|half| with.halves[half] >= without.halves[half]) {
            return Some("the stage with it does not predict both halves better than without".to_owned());
        }
        let as_well = |plain: &ComparedModel| (0..2).any(|half| plain.halves[half] < CLEARLY * with.halves[half]);
        if self.is_loop && self.own_plain().is_some_and(as_well) {
            return Some("the loop with it does not predict both halves better than a law of the set point".to_owned());
        }
        let lacks = |plain: &&ComparedModel| effects.split(" + ").any(|id| !holds(plain, id));
        let mut all = self.models.iter().filter(|model| model.is_plain && self.settles_in_time(model));
        let better = |plain: &ComparedModel| (0..2).all(|half| plain.halves[half] <= with.halves[half]);
        let refuting = all.find(|plain| lacks(plain) && better(plain));
        let closes = |model: &ComparedModel| without.held_out.powi(2) - model.held_out.powi(2);
        let plain = refuting.or_else(|| self.winner().filter(|plain| closes(with) < NEARLY * closes(plain)))?;
        Some(format!("the plain model \"{}\" predicts both halves better than the stage with it", plain.model))
    }
}

/// Whether a plain model has what an effect does to a stage.
fn holds(plain: &ComparedModel, effect: &str) -> bool {
    let has = |name: &str| plain.parameters.iter().any(|one| one.name == name && one.value != 0.0);
    let settles = PlainKind::titled(&plain.model).is_none_or(PlainKind::settles);
    !settles && HELD.iter().any(|(name, effects)| effects.contains(&effect) && has(name))
}

/// The parameters of a plain model, with their intervals.
fn parameters(model: &PlainModel, numbers: Option<&PlainNumbers>, drive: &str) -> Vec<ModelParameter> {
    let halves = numbers.map(|numbers| numbers.of_parameters(drive));
    let of = |(k, (name, value, unit)): (usize, (&'static str, f64, String))| {
        let half = halves.as_ref().map_or(f64::NAN, |halves| halves[k]);
        ModelParameter { name, value, ends: (value - half, value + half), unit }
    };
    model.parameters(drive).into_iter().enumerate().map(of).collect()
}

/// Whether a model predicts better than another, in both halves and beyond the spread between pieces.
fn wins(one: &ComparedModel, other: &ComparedModel) -> bool {
    if other.pieces.len() != one.pieces.len() {
        return false;
    }
    // Of logarithms, so that a piece in which everything errs more weighs no more.
    let difference = |(other, one): (&f64, &f64)| (other.max(f64::MIN_POSITIVE) / one.max(f64::MIN_POSITIVE)).ln();
    let differences: Vec<f64> = other.pieces.iter().zip(&one.pieces).map(difference).collect();
    let in_both = (0..2).all(|half| one.halves[half] < other.halves[half]);
    in_both && CLEARLY * one.held_out < other.held_out && is_gain(&differences)
}

/// Free runs of the recordings, by half: of several recordings the first ones and the others, of one its quarters in turn, so that what drives it may
/// change over it, as in a sweep, each with what drove it for so many lengths before; none where a half has none.
fn halves(
    whole: &[Recording],
    length_s: f64,
    history: f64,
    ready: &Preparation,
) -> Option<[Vec<PreparedRecording>; 2]> {
    // Processes of a unit with a sheet begin at rest.
    let at_rest = ready.setup != Setup::StageFree;
    let by_clock = |piece| PreparedRecording {
        clock_ratio: ready.unit.recorded.clock_ratio,
        ..PreparedRecording::free_run(piece)
    };
    let of = |half: &[Recording]| -> Vec<PreparedRecording> {
        let runs = half.iter().flat_map(|recording| windows(recording, length_s, at_rest, history)).map(by_clock);
        runs.filter(|recording| recording.samples.len() > 2).collect()
    };
    let halves = match whole {
        [_] => {
            let all = of(whole);
            let quarter = all.len().div_ceil(4).max(1);
            let (first, second): (Vec<_>, Vec<_>) =
                all.into_iter().enumerate().partition(|(place, _)| place / quarter % 2 == 0);
            [first, second].map(|half| half.into_iter().map(|(_, run)| run).collect())
        }
        several => {
            let (first, second) = several.split_at(several.len() / 2);
            [of(first), of(second)]
        }
    };
    halves.iter().all(|half| !half.is_empty()).then_some(halves)
}

/// A run as recorded: driven by the command where its deviation stands in for the spool.
fn as_recorded(recording: &PreparedRecording, ready: &Preparation, deviation: Option<Deviation>) -> Option<Run> {
    let recorded = ready.unit.recorded;
    Run::read(recording, |frame| {
        let drive = match deviation {
            Some(_) => frame.inputs.opening_command_pu,
            None => recorded.spool_position.recorded(frame.measured.spool_position_pu),
        };
        [drive, recorded.servomotor_position.recorded(frame.measured.servomotor_position_pu)]
    })
}

/// Squares of the servomotor position that a unit's twin misses in each piece.
fn twin_squares(
    pieces: &[PreparedRecording],
    unit: &Unit,
    ready: &Preparation,
    deviation: Option<Deviation>,
) -> Squares {
    let problem = Problem::new(pieces.to_vec(), unit, &ready.noise);
    let of = |(index, piece): (usize, &PreparedRecording)| {
        let positions = match deviation {
            Some(deviation) => looped(piece, unit, deviation),
            None => Signal::ServomotorPosition.of_estimates(&problem.simulate(unit, index)),
        };
        let residuals = piece.measured(Signal::ServomotorPosition).into_iter().zip(positions);
        let squares = residuals.map(|(seen, said)| (seen - said).powi(2)).filter(|square| square.is_finite());
        squares.fold((0.0, 0), |(sum, count), square| (sum + square, count + 1))
    };
    pieces.iter().enumerate().map(of).collect()
}

/// Position at each sample where the deviation that drives the twin is that from its own position: a recorded one would hold what is to be predicted.
fn looped(piece: &PreparedRecording, unit: &Unit, deviation: Deviation) -> Vec<f64> {
    let recorded = unit.recorded;
    let mut twin = twin_of(unit).with_cut(Cut::Spool);
    let mut positions = Vec::with_capacity(piece.samples.len());
    let mut samples = piece.samples.iter().peekable();
    // Time and position of the last two rows, from which the position of the next is foreseen.
    let mut known: Option<[(i64, f64); 2]> = None;
    for (row, frame) in piece.frames.iter().enumerate() {
        let mut frame = *frame;
        if piece.samples.first().is_some_and(|first| row < *first) {
            twin.advance(&frame);
            continue;
        }
        if let Some([(before_ns, before), (last_ns, last)]) = known {
            let steps = (frame.time_ns - last_ns) as f64 / (last_ns - before_ns).max(1) as f64;
            let foreseen = last + (last - before) * steps.min(1.0);
            let position = recorded.servomotor_position.recorded(foreseen);
            let spool = deviation.of(frame.inputs.opening_command_pu, position);
            if spool.is_finite() {
                frame.measured.spool_position_pu = recorded.spool_position.position_pu(spool);
            }
        }
        let said = twin.step(&frame).signals.servomotor_position_pu;
        known = Some([known.map_or((frame.time_ns - 1, said), |[_, last]| last), (frame.time_ns, said)]);
        if samples.next_if(|&&sample| sample == row).is_some() {
            positions.push(said);
        }
    }
    positions
}

#[cfg(test)]
mod tests;
