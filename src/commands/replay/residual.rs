//! `replay --residual`: the same recordings with a learned residual on top of the twin.

use std::path::Path;

use anyhow::Context;
use govtwin_bag::{Interpolation, Rows};
use govtwin_correction::adapt::Adaptation;
use govtwin_correction::corrector::Corrector;
use govtwin_correction::guard::GuardCounts;
use govtwin_correction::model::Model;
use govtwin_correction::rate;
use govtwin_correction::row::{Opening, RateOfInputs};
use govtwin_correction::shipped;
use govtwin_diagnosis::replay_summary::{RecordingSource, ReplaySummary, Residual, summarise};
use govtwin_model::frame::Frame;
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
    /// Why a bag could not be looked at; a replay that reads it after all chose by less than it has.
    pub unread: Option<String>,
}

impl<'a> Choice<'a> {
    /// Those that were given, or the shipped one where it is of the unit.
    pub fn new(args: &'a Args, unit: &Unit, bags: &[Bag]) -> anyhow::Result<Self> {
        let without = args.residual.iter().any(|path| model::is_none(path));
        if without && (args.residual.len() > 1 || args.adapt) {
            return Err(usage("--residual none: leave out --adapt and further --residual"));
        }
        let given = args.residual.iter().filter(|_| !without).map(|path| Ok((path.as_path(), model::load(path)?)));
        let models = given.collect::<anyhow::Result<Vec<_>>>()?;
        let driven = rate_of_inputs(args, &models)?;
        let of_unit = (args.residual.is_empty() && args.then.is_empty()).then(|| shipped::of(unit)).flatten();
        let mut unread = None;
        let Some(model) = of_unit else { return Ok(Self { models, driven, shipped: Shipped::NotAsked, unread }) };
        Ok(match shipped_drives(&model, args, unit, bags, &mut unread) {
            Ok(driven) => {
                let driven = Driven::By(driven);
                Self { models: vec![(Path::new(shipped::NAME), model)], driven, shipped: Shipped::Used, unread }
            }
            Err(reason) => Self { models, driven, shipped: Shipped::Unfit(reason), unread },
        })
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
fn shipped_drives(
    model: &Model,
    args: &Args,
    unit: &Unit,
    bags: &[Bag],
    unread: &mut Option<String>,
) -> Result<RateOfInputs, String> {
    ready(model, unit, args.cut.cut()).map_err(|error| error.to_string())?;
    let options = super::options(args, Interpolation::Hold, unit);
    let mut slow = false;
    for bag in bags {
        let mut pace = Pace::default();
        // What can never be read is reported by the replay.
        if let Err(error) = govtwin_bag::read_rows(&bag.path, &options, &mut pace) {
            *unread = Some(error.to_string());
            continue;
        }
        let spacing_ns = pace.spacing_ns();
        rate::check_spacing(model, spacing_ns).map_err(|error| format!("{}: {error}", bag.name))?;
        if pace.rows > MOST_KEPT {
            return Err(format!(
                "{} has {} rows, of which {MOST_KEPT} are kept; give its file with --residual to use it",
                bag.name, pace.rows
            ));
        }
        slow |= spacing_ns > SLOW_NS;
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

/// Rows of a recording, and the time between the first of them.
#[derive(Default)]
struct Pace {
    rows: usize,
    last_ns: i64,
    spacings_ns: Vec<i64>,
}

impl Pace {
    /// The usual time between two rows.
    fn spacing_ns(&mut self) -> i64 {
        self.spacings_ns.sort_unstable();
        self.spacings_ns.get(self.spacings_ns.len() / 2).copied().unwrap_or(0)
    }
}

impl Rows for Pace {
    fn restart(&mut self) {
        *self = Self::default();
    }

    fn row(&mut self, frame: &Frame) {
        if (1..=MOST_KEPT).contains(&self.rows) {
            self.spacings_ns.push(frame.time_ns - self.last_ns);
        }
        (self.rows, self.last_ns) = (self.rows + 1, frame.time_ns);
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
        let before = *corrector.counts();
        corrector.reset();
        let corrected = follow(&mut corrector, &results[at].replayed);
        results[at].corrected = Some(Corrected { guard: corrected.guard.since(&before), ..corrected });
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
        guard: *corrector.counts(),
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
