//! The numbers of a plain model: how to turn them, how they spread between free runs, and intervals of what follows from them.

use nalgebra::{DMatrix, DVector};

use crate::acceptance::statistics::student_90;
use crate::stage_alone::flexible::period_s;
use crate::stage_alone::plain::Plain;
use crate::stage_alone::plain_models::{DELAY, PlainKind, PlainModel};
use crate::stage_alone::run::{Lag, Run, travel, typical_s};
use crate::stage_alone::set_point::Part;
use crate::stage_alone::spread::{PieceSlopes, spread, with_common};

/// A step for slopes, as a share of what a number may be.
const STEP: f64 = 1e-3;

/// Between which shares of a loop's lag a valve's lag is turned where none is seen.
const UNSEEN: [f64; 2] = [0.05, 0.1];

/// Numbers of a plain model, each with the ends between which its slope is taken, and their covariance between free runs.
#[derive(Clone, Debug)]
pub(crate) struct PlainNumbers {
    model: PlainModel,
    numbers: Vec<f64>,
    ends: Vec<[f64; 2]>,
    spread: DMatrix<f64>,
    /// Half-width of an interval of nine in ten, standard deviations.
    wide: f64,
    /// Time between rows, s.
    row_s: f64,
}

impl PlainNumbers {
    /// Those of a model that was fitted to runs; none of a single run.
    pub(crate) fn of(model: PlainModel, runs: &[Run]) -> Option<Self> {
        let [drive, opening] = [travel(runs, |run| &run.spool), travel(runs, |run| &run.opening)];
        let length_s = typical_s(runs);
        let free = |value: f64, size: f64| (value, [value - STEP * size, value + STEP * size]);
        // Neither times nor widths are below nothing.
        let positive = |value: f64, size: f64| (value, [(value - STEP * size).max(0.0), value + STEP * size]);
        let all = match model {
            PlainModel::Sum(kind, law) => {
                let mut all = vec![free(law.zero, drive), free(law.above_1_s, law.above_1_s)];
                if kind != PlainKind::Integrator {
                    all.push(free(law.below_1_s, law.below_1_s));
                }
                if matches!(kind, PlainKind::DeadZone | PlainKind::PlainLaw) {
                    all.push(positive(law.half_band, drive));
                }
                if kind == PlainKind::PlainLaw {
                    all.extend(law.lag.has_delay().then(|| positive(law.lag.delay_s, length_s)));
                    all.extend((law.lag.constant_s > 0.0).then(|| positive(law.lag.constant_s, length_s)));
                    // What is not there is not turned.
                    all.extend(law.saturates.is_finite().then(|| positive(law.saturates, drive)));
                }
                all
            }
            PlainModel::SetPoint(kind, law) => {
                let of = |part: Part| {
                    let value = law.value(part);
                    match part {
                        Part::Level => free(value, opening),
                        Part::Play => positive(value, opening.min(value / STEP * 0.5)),
                        Part::Forward => positive(value, 1.0),
                        // One that is not there is turned from where it is, where the law is integrated in the same way.
                        Part::Valve if value <= 0.0 => (value, UNSEEN.map(|share| share * law.lag_s)),
                        Part::Gain | Part::Rising | Part::Falling | Part::Integral | Part::Valve => free(value, value),
                        Part::Lag | Part::Delay => positive(value, length_s),
                    }
                };
                kind.uncertain_parts_of(law).map(of).collect()
            }
        };
        let (numbers, ends): (Vec<f64>, Vec<[f64; 2]>) = all.into_iter().unzip();
        let simulated = |numbers: &[f64], run: &Run| turned(model, numbers).simulated(run);
        let pieces: Vec<PieceSlopes> =
            runs.iter().map(|run| PieceSlopes::of(run, &numbers, &ends, simulated)).collect();
        let hessian = pieces.iter().map(|piece| piece.slopes.tr_mul(&piece.slopes)).sum();
        let spread = with_common(spread(&hessian, &pieces)?, pieces.len());
        let wide = student_90(runs.len() as f64 - 1.0);
        Some(Self { model, numbers, ends, spread, wide, row_s: period_s(runs) })
    }

    /// Half-widths of the intervals of the model's parameters; when what drives it changed is known to half a row either way.
    pub(crate) fn of_parameters(&self, drive: &str) -> Vec<f64> {
        let all = self.model.parameters(drive);
        // What is turned but not told is left out.
        let told = |model: &PlainModel| {
            let turned = model.parameters(drive);
            let of = |name: &str| turned.iter().find(|one| one.0 == name).map_or(f64::NAN, |one| one.1);
            all.iter().map(|(name, ..)| of(name)).collect()
        };
        let halves = self.half_widths(told);
        let widened = halves.into_iter().zip(&all);
        widened.map(|(half, (name, ..))| if *name == DELAY { half + 0.5 * self.row_s } else { half }).collect()
    }

    /// Half-widths of the 90 % intervals of what follows from the model.
    pub(crate) fn half_widths(&self, of: impl Fn(&PlainModel) -> Vec<f64>) -> Vec<f64> {
        let count = of(&self.model).len();
        let mut slopes = DMatrix::zeros(count, self.numbers.len());
        for (k, ends) in self.ends.iter().enumerate() {
            let values = ends.map(|end| {
                let mut numbers = self.numbers.clone();
                numbers[k] = end;
                of(&turned(self.model, &numbers))
            });
            let column = values[1].iter().zip(&values[0]).map(|(high, low)| (high - low) / (ends[1] - ends[0]));
            slopes.set_column(k, &DVector::from_iterator(count, column));
        }
        let half = |row: usize| {
            let slopes = slopes.row(row);
            self.wide * (slopes * &self.spread * slopes.transpose())[(0, 0)].max(0.0).sqrt()
        };
        (0..count).map(half).collect()
    }
}

/// The model with other numbers, in the order of [`PlainNumbers::of`].
fn turned(model: PlainModel, numbers: &[f64]) -> PlainModel {
    match model {
        PlainModel::Sum(kind, law) => {
            let mut further = numbers[1..].iter().copied();
            let mut next = |own: f64, acts: bool| if acts { further.next().unwrap_or(own) } else { own };
            let above_1_s = next(law.above_1_s, true);
            let below_1_s = next(above_1_s, kind != PlainKind::Integrator);
            let half_band = next(law.half_band, true);
            let delay_s = next(law.lag.delay_s, law.lag.has_delay());
            let lag = Lag { delay_s, constant_s: next(law.lag.constant_s, law.lag.constant_s > 0.0) };
            let saturates = next(law.saturates, law.saturates.is_finite());
            PlainModel::Sum(kind, Plain { lag, zero: numbers[0], half_band, saturates, above_1_s, below_1_s })
        }
        PlainModel::SetPoint(kind, law) => {
            let turned =
                kind.uncertain_parts_of(law).zip(numbers).fold(law, |law, (part, number)| law.with(part, *number));
            PlainModel::SetPoint(kind, turned)
        }
    }
}
