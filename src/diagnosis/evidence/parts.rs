//! Parts of the chain on their own: each driven by what was recorded at its input, refitted within the sheet's tolerances, and judged by its own outputs.
//!
//! A part that follows its recorded input is not where an unknown effect acts; a part that does not may be. The closed loop spreads an effect over all
//! signals, a cut keeps it where it is (Isermann 2006, *Fault-Diagnosis Systems*, section 9.2, calls such residuals structured).

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::estimation::coordinate::{square, subject_at};
use crate::estimation::fit::{Effort, Start, fit_all};
use crate::evidence::law_error::NO_LAW_ERROR;
use crate::evidence::{KAPPAS, Shared};
use crate::generate::noise::{Purpose, RandomStreams, Transducer, hearing};
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::noise::log_sum;
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::{METHOD, Problem, SOUND_MEAN_SQUARE};
use crate::model::FittedModel;
use crate::model::discrepancy::columns;
use crate::model::support::{Placed, Variant, add};
use crate::stage_alone::sheetless::{SPOOL_ZERO, acts_behind_the_spool};
use govtwin_model::effects::{Stage, find};
use govtwin_model::signal::Signal;
use govtwin_model::twin::{Cut, Twin};
use govtwin_model::units::seconds_from_nanos;

/// A part of the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// Regulator, pilot valve and spool, fed the recorded servomotor.
    Controls,
    /// Main ports and servomotor, fed the recorded spool.
    Servomotor,
}

/// What a part leaves that was refitted on its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartFit {
    /// The part.
    pub part: Part,
    /// Squares of residuals and priors.
    pub cost: f64,
    /// Independent samples of its outputs.
    pub samples: f64,
    /// Squares that a right part leaves, each independent sample: noise of its outputs, and what the noise of its input does to them.
    #[serde(default = "sound")]
    pub sound: f64,
    /// Logarithm of the evidence of the part as the sheet has it.
    pub evidence: f64,
    /// The same of something unknown in it, by stage.
    pub unknown: BTreeMap<String, f64>,
}

fn sound() -> f64 {
    SOUND_MEAN_SQUARE
}

impl Part {
    const ALL: [Self; 2] = [Self::Controls, Self::Servomotor];

    /// The part with what it is fed, in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Controls => "regulator, pilot valve and spool, driven by the recorded servomotor position",
            Self::Servomotor => "main ports and servomotor, driven by the recorded spool position",
        }
    }

    /// Where the chain is cut for it, and the signal that is fed there.
    fn fed(self) -> (Cut, Signal) {
        match self {
            Self::Controls => (Cut::Servomotor, Signal::ServomotorPosition),
            Self::Servomotor => (Cut::Spool, Signal::SpoolPosition),
        }
    }

    /// Whether a signal is an output of the part.
    fn gives(self, signal: Signal) -> bool {
        (signal == Signal::ServomotorPosition) == (self == Self::Servomotor)
    }

    /// A recording of the part alone; none where its input or all its outputs were not recorded, too rarely to show what it does between samples, or
    /// with holes through which nothing drives the part.
    fn of(self, recording: &PreparedRecording) -> Option<PreparedRecording> {
        let (cut, fed) = self.fed();
        let mut part = PreparedRecording { cut, ..recording.clone() };
        for signal in Signal::ALL {
            part.has[signal as usize] &= self.gives(signal);
        }
        if self == Self::Controls {
            smooth(&mut part);
        }
        (recording.cut == Cut::None
            && !recording.is_slow()
            && recording.has[fed as usize]
            && longest_hole(&recording.measured(fed)) <= LONGEST_HOLE
            && part.has.contains(&true))
        .then_some(part)
    }

    /// The recordings of the part alone.
    fn of_all(self, problem: &Problem) -> Vec<PreparedRecording> {
        problem.recordings.iter().filter_map(|recording| self.of(recording)).collect()
    }

    /// Squares that a right part leaves, each independent sample: the part is driven by what the transducer shows of a model's own simulation, whose
    /// regulator hears transducers of its own, and judged by that simulation.
    fn sound(self, problem: &Problem, model: &FittedModel) -> f64 {
        let unit = model.unit();
        let (_, fed) = self.fed();
        let shown =
            problem.recordings.iter().filter(|recording| self.of(recording).is_some()).filter_map(|recording| {
                let random = RandomStreams { seed: DRAWS_SEED, process: recording.process };
                let [begin_ns, end_ns] =
                    [recording.frames.first(), recording.frames.last()].map(|one| one.map_or(0, |one| one.time_ns));
                let plant = hearing(&unit, &random, seconds_from_nanos(end_ns - begin_ns));
                let mut transducer = Transducer::new(fed.sensor(&unit.sensors), random.of(Purpose::Servomotor));
                let mut simulated = recording.clone();
                let estimates = recording.run(&mut Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, METHOD));
                for (&row, estimate) in recording.samples.iter().zip(estimates) {
                    let measured = simulated.frames[row].measured;
                    let shown = Signal::ALL.into_iter().filter(|signal| signal.of(&measured).is_finite());
                    simulated.frames[row].measured = shown.fold(measured, |shown, signal| {
                        let value = signal.of(&estimate.signals);
                        signal.with(shown, if signal == fed { transducer.read(value) } else { value })
                    });
                }
                self.of(&simulated)
            });
        let own = problem.anew(shown.collect(), &unit);
        let [(base, coordinates, positions), _] = self.starts(model);
        let left: f64 = own.residuals_of(&[subject_at(&base, &coordinates, &positions)]).iter().map(square).sum();
        SOUND_MEAN_SQUARE + left / own.independent_samples().max(1.0)
    }

    /// Unit and free parameters of the part, at the refitted sheet and at the sheet itself.
    fn starts(self, refitted: &FittedModel) -> [Placed; 2] {
        [true, false].map(|at_refitted| {
            let acts = |one: &FreeParameter| self == Self::Controls || acts_behind_the_spool(one);
            let placed = refitted.free_parameters.iter().zip(&refitted.fit.positions);
            let of = |(one, position): (&FreeParameter, &f64)| {
                (*one, if at_refitted { *position } else { one.start(&refitted.base) })
            };
            let (free_parameters, positions) = placed.filter(|(one, _)| acts(one)).map(of).unzip();
            let mut placed = (refitted.base.clone(), free_parameters, positions);
            // A servomotor sums the zero error of the fed spool up over a whole recording.
            if let Some(zero) = find(SPOOL_ZERO).filter(|_| self == Self::Servomotor) {
                add(&mut placed, zero, Variant { size: 0.0, further: 0.0 });
            }
            placed
        })
    }
}

/// Work of refitting a part with the effects of a model.
const ANEW: Effort = Effort { rounds: 6, refresh: 3, temperature: 1.0 };

/// Samples in a row without a number through which a part can still be driven.
const LONGEST_HOLE: usize = 3;

/// Seed of the noise by which a part's own noise is told.
const DRAWS_SEED: u64 = 1;

/// Nats lost beyond which it does not matter how many.
const MOST_LOST: f64 = 50.0;

impl PartFit {
    /// What it leaves over what a right model would, as a ratio of squares.
    #[must_use]
    pub fn excess(&self) -> f64 {
        self.cost / (self.sound * self.samples)
    }

    /// The stage at which something unknown would gain most, and by how many nats; none where nothing would.
    #[must_use]
    pub fn likeliest(&self) -> Option<(Stage, f64)> {
        let all = Stage::ALL.into_iter().map(|stage| (stage, self.gained_at(stage.id())));
        all.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, gained)| *gained > 0.0)
    }

    /// Nats that something unknown at a stage gains over the part as the sheet has it; 0 where it has no say.
    #[must_use]
    pub fn gained_at(&self, stage: &str) -> f64 {
        self.unknown.get(stage).map_or(0.0, |evidence| (evidence - self.evidence).max(-MOST_LOST))
    }
}

/// The parts that the recordings show on their own, each with what it leaves.
#[must_use]
pub fn parts(problem: &Problem, refitted: &FittedModel) -> Vec<PartFit> {
    let fit = |part: Part| {
        let recordings = part.of_all(problem);
        if recordings.is_empty() {
            return None;
        }
        let sound = part.sound(problem, refitted);
        let problem = problem.anew(recordings, &refitted.unit());
        let places = part.starts(refitted);
        let starts: [Start<'_, FreeParameter>; 2] = places.each_ref().map(|(base, coordinates, positions)| Start {
            base,
            coordinates,
            positions,
            effort: Effort::FULL,
            known: None,
        });
        let fits = fit_all(&problem, &starts);
        let (place, fit) = places.iter().zip(fits).min_by(|a, b| a.1.cost().total_cmp(&b.1.cost()))?;
        let model = FittedModel::new(Vec::new(), place.0.clone(), place.1.clone(), fit);
        let normal = Shared::new(&problem, &Arc::new(columns(&problem, &model)), model.cost()).normal(&model);
        let of = |stage: Stage| (stage.id().to_owned(), normal.unknown_at(stage));
        Some(PartFit {
            part,
            cost: model.cost(),
            samples: problem.independent_samples(),
            sound,
            evidence: log_sum(KAPPAS.map(|kappa| normal.at(kappa, NO_LAW_ERROR))) - (KAPPAS.len() as f64).ln(),
            unknown: Stage::ALL.into_iter().map(of).filter(|(_, evidence)| evidence.is_finite()).collect(),
        })
    };
    Part::ALL.into_iter().filter_map(fit).collect()
}

/// What these parts leave that have the effects of a model, each refitted from where the model stands, over what a right model would; the noise is laid
/// out along the refitted sheet, as in [`parts`].
#[must_use]
pub fn excesses_of(problem: &Problem, refitted: &FittedModel, model: &FittedModel, parts: &[PartFit]) -> Vec<f64> {
    let excess = |PartFit { part, .. }: &PartFit| {
        let sound = part.sound(problem, model);
        let problem = problem.anew(part.of_all(problem), &refitted.unit());
        let [(base, coordinates, positions), _] = part.starts(model);
        let start = Start { base: &base, coordinates: &coordinates, positions: &positions, effort: ANEW, known: None };
        let fit = fit_all(&problem, &[start]).pop()?;
        Some(fit.cost() / (sound * problem.independent_samples()))
    };
    parts.iter().filter_map(excess).collect()
}

/// Most samples in a row without a number, between the first number and the last.
fn longest_hole(measured: &[f64]) -> usize {
    let finite = |value: &f64| value.is_finite();
    let (Some(first), Some(last)) = (measured.iter().position(finite), measured.iter().rposition(finite)) else {
        return measured.len();
    };
    measured[first..=last].split(finite).map(<[f64]>::len).max().unwrap_or(0)
}

/// Weights of the quadratic through eleven samples, at the middle one (Savitzky & Golay 1964), over [`WEIGHT`].
const WEIGHTS: [f64; 11] = [-36.0, 9.0, 44.0, 69.0, 84.0, 89.0, 84.0, 69.0, 44.0, 9.0, -36.0];
/// Their sum.
const WEIGHT: f64 = 429.0;

/// Takes noise off the recorded servomotor: the regulator heard another draw of it, over which the twin is a mean already.
fn smooth(recording: &mut PreparedRecording) {
    let measured = recording.measured(Signal::ServomotorPosition);
    for (k, around) in measured.windows(WEIGHTS.len()).enumerate() {
        let mean = around.iter().zip(WEIGHTS).map(|(value, weight)| value * weight).sum::<f64>() / WEIGHT;
        if mean.is_finite() {
            recording.frames[recording.samples[k + WEIGHTS.len() / 2]].measured.servomotor_position_pu = mean;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
    use govtwin_model::recording::Recording;

    /// A quadratic stays what it is; the noise of one sample is spread.
    #[test]
    fn smoothing_keeps_a_quadratic() {
        let position_pu = |k: i64| 0.2 + 0.01 * k as f64 + 1e-4 * (k * k) as f64;
        let frame = |k: i64| Frame {
            time_ns: k * 10_000_000,
            inputs: Inputs {
                opening_command_pu: 0.5,
                esv: EsvState::Normal,
                tank_pressure_pa: 6.3e6,
                piston_force_n: 0.0,
            },
            measured: Signals {
                servomotor_position_pu: position_pu(k) + if k == 20 { 1e-3 } else { 0.0 },
                ..Signals::NONE
            },
        };
        let mut recording = PreparedRecording::new(Recording::new("smoothed", (0..40).map(frame).collect()));
        smooth(&mut recording);
        let smoothed = recording.measured(Signal::ServomotorPosition);
        let off: Vec<f64> = smoothed.iter().zip(0..).map(|(value, k)| value - position_pu(k)).collect();
        assert!(off[..15].iter().chain(&off[26..]).all(|off| off.abs() < 1e-12), "{off:?}");
        assert!((off[20] - 1e-3 * 89.0 / WEIGHT).abs() < 1e-12);
    }

    #[test]
    fn a_hole_is_as_long_as_the_numbers_that_lack_between_others() {
        let nan = f64::NAN;
        assert_eq!(longest_hole(&[nan, nan, 1.0, nan, 2.0, nan, nan, nan, 3.0, nan]), 3);
        assert_eq!((longest_hole(&[1.0, 2.0]), longest_hole(&[nan, nan])), (0, 2));
    }
}
