//! `replay --residual`: the same recordings with a learned residual on top of the twin.

use std::path::Path;

use anyhow::Context;
use govtwin_correction::adapt::Adaptation;
use govtwin_correction::corrector::Corrector;
use govtwin_correction::guard::GuardCounts;
use govtwin_correction::model::Model;
use govtwin_correction::rate;
use govtwin_correction::row::{Opening, RateOfInputs};
use govtwin_correction::shipped;
use govtwin_diagnosis::replay_summary::{RecordingSource, ReplaySummary, Residual, summarise};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::SLOW_NS;
use govtwin_model::replay::Replayed;
use govtwin_model::replay::rows::MOST_KEPT;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Cut;

use super::{Args, Result as Outcome};
use crate::commands::bags::Bag;
use crate::commands::{model, usage};

/// Whether the residual that ships with the program corrects a replay.
#[derive(Debug, PartialEq)]
pub enum Shipped {
    /// Another was given, none is wanted, units are compared, or the sheet is of another unit.
    NotAsked,
    /// It does.
    Used,
    /// It is of this unit, and why it cannot.
    Unfit(String),
}

/// What drives the twin between rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driven {
    /// As asked for, or as a residual was trained.
    By(RateOfInputs),
    /// Inputs hold where rows are close, as live. Where they are far apart the recorder chose their rate and not the governor: inputs run straight,
    /// round sharp bends of the command, and a trip comes when the unit moved.
    AsRecorded,
}

impl Driven {
    /// The name in files and words.
    pub fn id(self) -> &'static str {
        match self {
            Self::By(rate) => rate.id(),
            Self::AsRecorded => "as_recorded",
        }
    }
}

/// The learned residuals of a replay, and what drives the twin between rows.
pub struct Choice<'a> {
    /// Each with its file.
    pub models: Vec<(&'a Path, Model)>,
    pub driven: Driven,
    pub shipped: Shipped,
    /// The shipped residual, where it is of the unit; the rows of the bags decide.
    candidate: Option<Model>,
}

impl<'a> Choice<'a> {
    /// Those that were given; the shipped one waits for [`Self::settle`] where it is of the unit.
    pub fn new(args: &'a Args, unit: &Unit) -> anyhow::Result<Self> {
        let without = args.residual.iter().any(|path| model::is_none(path));
        if without && (args.residual.len() > 1 || args.adapt) {
            return Err(usage("--residual none: leave out --adapt and further --residual"));
        }
        let given = args.residual.iter().filter(|_| !without).map(|path| Ok((path.as_path(), model::load(path)?)));
        let models = given.collect::<anyhow::Result<Vec<_>>>()?;
        let driven = rate_of_inputs(args, &models)?;
        let candidate = (args.residual.is_empty() && args.then.is_empty()).then(|| shipped::of(unit)).flatten();
        Ok(Self { models, driven, shipped: Shipped::NotAsked, candidate })
    }

    /// Whether the rows of the bags decide.
    pub fn is_open(&self) -> bool {
        self.candidate.is_some()
    }

    /// Takes the shipped residual where it can correct every bag as its rows come, or keeps the reason.
    pub fn settle<'b>(&mut self, args: &Args, unit: &Unit, bags: impl Iterator<Item = (&'b Bag, &'b Replayed)>) {
        let Some(model) = self.candidate.take() else { return };
        match shipped_drives(&model, args, unit, bags) {
            Ok(driven) => {
                self.models = vec![(Path::new(shipped::NAME), model)];
                (self.driven, self.shipped) = (Driven::By(driven), Shipped::Used);
            }
            Err(reason) => self.shipped = Shipped::Unfit(reason),
        }
    }
}

/// What drives the twin between rows: as asked for, as the residuals were trained, or as rows come.
fn rate_of_inputs(args: &Args, models: &[(&Path, Model)]) -> anyhow::Result<Driven> {
    let asked = args.rate_of_inputs;
    let Some(wanted) = asked.or_else(|| models.first().map(|(_, model)| model.rate_of_inputs)) else {
        return Ok(Driven::AsRecorded);
    };
    if let Some((path, model)) = models.iter().find(|(_, model)| model.rate_of_inputs != wanted) {
        let trained = model.rate_of_inputs.id();
        return Err(usage(if asked.is_some() {
            let path = path.display();
            format!(
                "{path} was trained with --rate-of-inputs {trained}, and knows no twin that is driven otherwise; leave the option out"
            )
        } else {
            format!(
                "{} was trained with --rate-of-inputs {trained}, {} otherwise; give residuals of one kind",
                path.display(),
                models[0].0.display()
            )
        }));
    }
    Ok(Driven::By(wanted))
}

/// What drives the twin between rows under the shipped residual: as in its training, and held where rows come as fast as live.
fn shipped_drives<'b>(
    model: &Model,
    args: &Args,
    unit: &Unit,
    bags: impl Iterator<Item = (&'b Bag, &'b Replayed)>,
) -> Result<RateOfInputs, String> {
    ready(model, unit, args.cut.cut()).map_err(|error| error.to_string())?;
    let mut slow = false;
    for (Bag { name, .. }, replayed) in bags {
        let row_ns = replayed.row_ns();
        rate::check_spacing(model, row_ns).map_err(|error| format!("{name}: {error}"))?;
        let rows = replayed.rows;
        if rows > MOST_KEPT {
            return Err(format!(
                "{name} has {rows} rows, of which {MOST_KEPT} are kept; give its file with --residual to use it"
            ));
        }
        slow |= row_ns > SLOW_NS;
    }
    let trained = model.rate_of_inputs;
    match args.rate_of_inputs {
        Some(asked) if slow && asked != trained => {
            Err(format!("it was trained with --rate-of-inputs {}, not {}", trained.id(), asked.id()))
        }
        Some(asked) => Ok(asked),
        None => Ok(if slow { trained } else { RateOfInputs::Hold }),
    }
}

/// A model that fits the unit and the cut, ready to run.
pub fn ready(model: &Model, unit: &Unit, cut: Cut) -> anyhow::Result<Corrector> {
    let opening = match cut {
        Cut::None => Opening::Simulated,
        Cut::Servomotor => Opening::Measured,
        Cut::Spool => return Err(usage("--residual with --cut spool: the measured spool leaves nothing to correct")),
    };
    model.check(unit, opening)?;
    Ok(Corrector::new(model)?)
}

/// Refuses models whose past cannot be taken from these recordings; what the others assume becomes a warning of the recording.
pub fn check_rates(models: &[(&Path, Model)], shipped: &Shipped, results: &mut [Outcome]) -> anyhow::Result<()> {
    for (path, model) in models {
        for one in results.iter_mut() {
            let recording = &one.replayed.recording;
            let said =
                rate::check(model, recording).with_context(|| format!("{} on {}", path.display(), recording.name))?;
            // Who did not ask for a residual need not be warned of it.
            let into = if *shipped == Shipped::Used { &mut one.source.notes } else { &mut one.source.warnings };
            into.extend(said);
        }
    }
    Ok(())
}

/// A recording with corrected estimates.
pub struct Corrected {
    pub replayed: Replayed,
    /// The signal that was corrected.
    pub signal: Signal,
    /// Half the width of the band row by row, in the signal's unit.
    pub half_width: Vec<f64>,
    /// Share of the measured values that the band is to hold; none where the model has no band.
    pub coverage_share: Option<f64>,
    /// What the guard did.
    pub guard: GuardCounts,
}

/// The same recording with corrected estimates.
pub fn correct(corrector: &Corrector, replayed: &Replayed) -> Corrected {
    follow(&mut corrector.clone(), replayed)
}

/// The same for all recordings in the order of time, so that what the adaptation learned of one helps with the next.
pub fn adapt(mut corrector: Corrector, results: &mut [Outcome]) -> Option<Adaptation> {
    let mut order: Vec<usize> = (0..results.len()).collect();
    order.sort_by_key(|&at| results[at].replayed.recording.frames.first().map_or(i64::MAX, |frame| frame.time_ns));
    for at in order {
        corrector.reset();
        results[at].corrected = Some(follow(&mut corrector, &results[at].replayed));
    }
    corrector.adaptation()
}

fn follow(corrector: &mut Corrector, replayed: &Replayed) -> Corrected {
    let signal = corrector.signal();
    let mut estimates = replayed.estimates.clone();
    let mut half_width = Vec::with_capacity(estimates.len());
    for (frame, estimate) in replayed.recording.frames.iter().zip(&mut estimates) {
        let correction = corrector.step(frame, estimate);
        estimate.signals = signal.with(estimate.signals, correction.corrected);
        half_width.push(correction.half_width);
    }
    Corrected {
        replayed: replayed.with_estimates(estimates),
        signal,
        half_width,
        coverage_share: corrector.coverage_share(),
        guard: corrector.take_counts(),
    }
}

/// The summary of the corrected recordings, for the figures of the whole replay.
pub fn summary(
    path: &Path,
    corrected: &[(&Corrected, &RecordingSource)],
    plain: &ReplaySummary,
    cut: Cut,
) -> ReplaySummary {
    let together: Vec<_> = corrected.iter().map(|(one, source)| (&one.replayed, *source)).collect();
    let mut summary = summarise(plain.parameters.clone(), cut, plain.inputs_between_samples, &together);
    let mut guard = GuardCounts::default();
    for (one, _) in corrected {
        guard.add(&one.guard);
    }
    summary.residual = Some(Residual {
        model: path.display().to_string(),
        guard,
        adaptation: None,
        processes: summary.processes.clone(),
        overall: summary.overall.clone(),
    });
    summary
}
