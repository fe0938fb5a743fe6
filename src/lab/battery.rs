//! A battery of synthetic units whose faults are known: made apart from the twin, with other equations for every effect.
//!
//! A diagnosis that is tried on the twin's own effects proves little. The plants here (`rig`) share the sheet and the chain with the
//! twin and nothing else. Everything follows from seeds.

pub(crate) mod draws;
pub(crate) mod faults;
pub(crate) mod laws;
pub(crate) mod mismatch;
mod moment;
pub mod plan;
pub(crate) mod rig;
pub mod stage;
pub(crate) mod test_rig;

use rayon::prelude::{IntoParallelIterator, ParallelIterator};

use crate::battery::draws::{Draw, Question};
use crate::battery::faults::{Faults, STRANGERS};
use crate::battery::mismatch::Mismatch;
use crate::battery::test_rig::TestRig;
use govtwin_diagnosis::generate::streams::GeneratedStreams;
use govtwin_diagnosis::generate::{Scenario, spread, streams as twin_streams};
use govtwin_diagnosis::result::Experiment;
use govtwin_model::effects::scaling::UnitSize;
use govtwin_model::effects::{Stage, find};
use govtwin_model::frame::{Inputs, Signals};
use govtwin_model::parameters::{EffectSetting, Parameters, Unit};
use govtwin_model::recording::{Process, Recording};
use govtwin_model::signal::Signal;

/// Length of a recording on a bench and in a plant's archive, in ticks of 1 ms.
const LENGTHS_TICKS: (i64, i64) = (40_000, 150_000);
/// Time between two rows from which on a recorder counts as an archive, in ticks.
const ARCHIVE_TICKS: i64 = 100;
/// Smallest and largest size of an effect over its typical one.
const SIZES: (f64, f64) = (0.5, 2.5);
/// Fewest and most readings of the servomotor of which a regulator takes the mean.
const READINGS: (f64, f64) = (3.0, 12.0);
/// Added to a seed for another course of the same plant.
const ANOTHER_DAY: u64 = 0x5eed_0dd5;
/// The same for the day of a proposed test.
const DAY_OF_TEST: u64 = 0x7e57_da75;
/// What a right twin may miss of a signal, in the order of [`Signal::ALL`]: transducers, and chatter of the spool.
const FLOORS: [f64; 4] = [1.6e-4, 5.0e-3, 7.0e-2, 1.3e4];

/// What kind of unit a case is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CaseKind {
    /// Within its tolerances.
    Sound,
    /// One effect of the catalogue.
    Single(String),
    /// Two of them at once.
    Pair(String, String),
    /// Three of them at once.
    Triple(String, String, String),
    /// Something that no catalogue lists.
    Stranger(String),
    /// One effect of the catalogue, to be diagnosed without it.
    LeftOut(String),
}

impl CaseKind {
    /// The word in labels.
    pub fn id(&self) -> &'static str {
        match self {
            Self::Sound => "sound",
            Self::Single(_) => "single",
            Self::Pair(..) => "pair",
            Self::Triple(..) => "triple",
            Self::Stranger(_) => "stranger",
            Self::LeftOut(_) => "left_out",
        }
    }

    /// Ids of what is in the unit.
    pub fn ids(&self) -> Vec<&str> {
        match self {
            Self::Sound => vec![],
            Self::Single(id) | Self::Stranger(id) | Self::LeftOut(id) => vec![id],
            Self::Pair(a, b) => vec![a, b],
            Self::Triple(a, b, c) => vec![a, b, c],
        }
    }
}

/// One case, before it is made.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of its folder, which does not hint at its faults.
    pub name: String,
    /// What is in it.
    pub kind: CaseKind,
    /// Rate of command and servo state, Hz.
    pub rate_hz: f64,
    /// Whether the pilot signals are recorded.
    pub rich: bool,
    /// How far the plant's structure is from the twin's, as a multiple of the usual mismatch; at 0 the plant is the twin itself, effects included, which shows
    /// what the recordings allow.
    pub mismatch: f64,
    /// Decides all else.
    pub seed: u64,
    /// Of a servomotor stage alone, whether it is diagnosed with a data sheet; none of a whole chain.
    pub alone: Option<bool>,
}

impl Case {
    /// What is recorded of it: of a stage alone one recording, under the process that moves it most.
    pub fn processes(&self) -> &'static [Process] {
        if self.alone.is_some() { &[Process::LoadIncrease] } else { &Process::ALL }
    }
}

/// One thing that is truly in a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueFault {
    /// Its id.
    pub id: String,
    /// Where it sits.
    pub stage: Stage,
    /// Size, as the first parameter of the effect counts it.
    pub size: f64,
    /// Unit of the size.
    pub unit: String,
    /// What it is.
    pub meaning: String,
}

/// What is known of a unit, for the scorer alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Name of the case.
    pub name: String,
    /// What is in it.
    pub effects: Vec<TrueFault>,
    /// Whether the catalogue that the diagnosis may use holds all of it.
    pub listed: bool,
    /// How far the strongest signal moves over its noise floor, RMS; NaN if it was not measured, 0 for a fault-free unit.
    pub strength_ratio: f64,
    /// Rate of the recordings, Hz; NaN if it is not known.
    pub rate_hz: f64,
    /// Structural mismatch of the plant, as a multiple of the usual one; NaN if it is not known.
    pub mismatch: f64,
}

/// A case as made: four recordings by stream, and the label.
#[derive(Clone, Debug)]
pub struct Made {
    /// Streams by process.
    pub streams: Vec<(Process, GeneratedStreams)>,
    /// The truth.
    pub label: Label,
}

impl Made {
    /// The recordings, as a reader of their bags would align them.
    pub fn recordings(&self) -> Vec<Recording> {
        self.streams.iter().map(|(process, streams)| Recording::new(process.id(), streams.rows())).collect()
    }
}

/// Makes a case of a type of unit; its label is without strength.
pub fn make(unit: &Unit, case: &Case) -> Made {
    if case.alone.is_some() {
        let streams = case.processes().iter().map(|&process| (process, stage::record(unit, case))).collect();
        return Made { streams, label: stage::label(unit, case) };
    }
    let (bench, effects) = bench(unit, case);
    Made { streams: streams(unit, case, &bench, &effects), label: unmeasured(case, effects) }
}

/// Streams of all processes of a plant.
fn streams(unit: &Unit, case: &Case, bench: &TestRig, effects: &[TrueFault]) -> Vec<(Process, GeneratedStreams)> {
    let of = |process: Process| {
        let twin = (case.mismatch == 0.0).then(|| in_the_twins_keys(unit, bench, effects)).flatten();
        let streams = twin.map(|unit| {
            let (rate_hz, duration_s) = (case.rate_hz, bench.ticks as f64 * 1e-3);
            twin_streams(&Scenario { unit, process, rate_hz, duration_s, rich: case.rich, seed: bench.seed })
        });
        (process, streams.unwrap_or_else(|| bench.record(process).0))
    };
    Process::ALL.into_iter().map(of).collect()
}

/// The label of a case, without its strength.
pub fn label(unit: &Unit, case: &Case) -> Label {
    if case.alone.is_some() {
        return stage::label(unit, case);
    }
    unmeasured(case, bench(unit, case).1)
}

/// The true values of a case in the twin's keys, its faults in the twin's equations; none where the catalogue of its diagnosis lacks a fault, and of a
/// stage alone.
pub fn true_values(unit: &Unit, case: &Case) -> Option<Unit> {
    if case.alone.is_some() {
        return None;
    }
    let (bench, effects) = bench(unit, case);
    if !unmeasured(case, effects.clone()).listed {
        return None;
    }
    in_the_twins_keys(unit, &bench, &effects)
}

/// A plant's parameters and faults as the twin has them; none where it has no equation for a fault.
fn in_the_twins_keys(unit: &Unit, bench: &TestRig, effects: &[TrueFault]) -> Option<Unit> {
    let setting = |fault: &TrueFault| {
        find(&fault.id).map(|spec| EffectSetting { id: fault.id.clone(), values: spec.completed(&[fault.size]) })
    };
    let effects = effects.iter().map(setting).collect::<Option<_>>()?;
    Some(Unit { parameters: bench.parameters, effects, ..unit.clone() })
}

/// How far the strongest signal of a case moves over its noise floor, RMS: every process is simulated three times. Of stages alone it is not measured.
pub fn strength(unit: &Unit, case: &Case) -> f64 {
    if case.alone.is_some() {
        return f64::NAN;
    }
    let (bench, effects) = bench(unit, case);
    if effects.is_empty() {
        return 0.0;
    }
    let of = |process: Process| moved(&bench, process, &bench.record(process).1);
    Process::ALL.into_par_iter().map(of).reduce(|| 0.0, f64::max)
}

fn unmeasured(case: &Case, effects: Vec<TrueFault>) -> Label {
    let listed = matches!(case.kind, CaseKind::Sound | CaseKind::Single(_) | CaseKind::Pair(..) | CaseKind::Triple(..));
    Label {
        name: case.name.clone(),
        effects,
        listed,
        strength_ratio: f64::NAN,
        rate_hz: case.rate_hz,
        mismatch: case.mismatch,
    }
}

/// Streams of the same plant on another day, by the same recorder: what no diagnosis has seen.
pub fn fresh_recordings(unit: &Unit, case: &Case) -> Vec<(Process, GeneratedStreams)> {
    let (bench, effects) = bench(unit, case);
    let another = TestRig { seed: case.seed.wrapping_add(ANOTHER_DAY), ..bench };
    streams(unit, case, &another, &effects)
}

/// What a recorder would have of a case's plant under a proposed test; none of a stage alone, and where the plant is the twin itself.
pub fn answer(unit: &Unit, case: &Case, proposed: &Experiment) -> Option<GeneratedStreams> {
    let test = proposed.script.filter(|_| case.alone.is_none() && case.mismatch > 0.0)?;
    let (bench, _) = bench(unit, case);
    #[expect(clippy::cast_possible_truncation, reason = "ticks of a test and between its rows")]
    let ticks = |seconds: f64| (1000.0 * seconds).round().max(1.0) as i64;
    let bench = TestRig {
        rich: case.rich || proposed.records.contains(&Signal::ControlPressure),
        row_ticks: ticks(1.0 / proposed.rate_hz),
        ticks: ticks(test.length_s),
        seed: case.seed.wrapping_add(DAY_OF_TEST),
        ..bench
    };
    Some(bench.answer(&test))
}

/// The plant of a case on its bench, and what is in it.
fn bench(unit: &Unit, case: &Case) -> (TestRig, Vec<TrueFault>) {
    let mut sound = unit.clone();
    sound.effects.clear();
    let parameters = spread(&sound, case.seed).parameters;
    let mut sizes = Draw::new(case.seed, Question::Size, 0);
    let mut faults = Faults::default();
    let mut effects = Vec::new();
    for id in case.kind.ids() {
        let truth = truth(id, &mut sizes, &sound.parameters);
        if let Some(truth) = truth.filter(|truth| faults.add(id, truth.size)) {
            effects.push(truth);
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "a period in ticks")]
    let row_ticks = (1000.0 / case.rate_hz).round().max(1.0) as i64;
    let bench = TestRig {
        parameters,
        sensors: unit.sensors,
        faults,
        odd: Mismatch::draw(
            &parameters,
            &UnitSize::new(&sound.parameters),
            // Where the plant is the twin itself only the strength of its faults is measured on the bench, of a usual plant.
            if case.mismatch > 0.0 { case.mismatch } else { 1.0 },
            &mut Draw::new(case.seed, Question::Mismatch, 0),
        ),
        readings: readings(case.seed),
        row_ticks,
        rich: case.rich,
        ticks: if row_ticks < ARCHIVE_TICKS { LENGTHS_TICKS.0 } else { LENGTHS_TICKS.1 },
        seed: case.seed,
    };
    (bench, effects)
}

/// Of how many readings of the servomotor the regulator of a case takes the mean.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between the bounds")]
pub fn readings(seed: u64) -> u32 {
    Draw::new(seed, Question::Regulator, 0).log_between(READINGS.0, READINGS.1).round() as u32
}

/// Draws how much of an effect or a stranger there is on a unit of the sheet's size.
fn truth(id: &str, draw: &mut Draw, sheet: &Parameters) -> Option<TrueFault> {
    let factor = draw.log_between(SIZES.0, SIZES.1);
    let negative = draw.chance(0.5);
    let of = |stage, size, unit: &str, meaning: &str| {
        Some(TrueFault { id: id.to_owned(), stage, size, unit: unit.to_owned(), meaning: meaning.to_owned() })
    };
    if let Some(stranger) = STRANGERS.iter().find(|stranger| stranger.id == id) {
        let typical = stranger.typical * stranger.scaling.factor(&UnitSize::new(sheet));
        return of(stranger.stage, typical * factor, stranger.unit, stranger.meaning);
    }
    let spec = find(id)?;
    let first = spec.parameters.first()?.on(sheet);
    // A ratio below 1 goes on by powers, so that it never reaches 0.
    let size = if first.neutral > 0.0 && first.typical < first.neutral {
        first.neutral * (first.typical / first.neutral).powf(factor)
    } else {
        let mirrored = 2.0 * first.neutral - first.typical;
        let both = mirrored >= first.min && mirrored - first.min > 0.5 * (first.typical - first.neutral);
        let sign = if negative && both { -1.0 } else { 1.0 };
        first.neutral + sign * factor * (first.typical - first.neutral)
    };
    of(spec.stage, size.clamp(first.min, first.max), first.unit, first.doc)
}

/// RMS by which the faults move the strongest recorded signal under the same inputs, over its noise floor.
fn moved(bench: &TestRig, process: Process, inputs: &[Inputs]) -> f64 {
    let sound = TestRig { faults: Faults::default(), ..bench.clone() };
    let mut with = bench.readings(process, inputs);
    let without = sound.readings(process, inputs);
    // A clock that is off moves the stamps, not the plant: what was shown under an input is shown that much later.
    #[expect(clippy::cast_possible_truncation, reason = "a shift in command periods")]
    let shift = (bench.faults.clock_offset_s * 100.0).round() as isize;
    if shift != 0 && !with.is_empty() {
        let last = with.len() - 1;
        let at = |k: usize| k.saturating_add_signed(shift).min(last);
        with = (0..=last).map(|k| with[at(k)]).collect();
    }
    let recorded = if bench.rich { &Signal::ALL[..] } else { &Signal::ALL[..2] };
    let rms = |signal: Signal| {
        let square = |(a, b): (&Signals, &Signals)| (signal.of(a) - signal.of(b)).powi(2);
        (with.iter().zip(&without).map(square).sum::<f64>() / with.len().max(1) as f64).sqrt()
    };
    recorded.iter().map(|&signal| rms(signal) / FLOORS[signal as usize]).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
