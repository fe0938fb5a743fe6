//! The numbers of a plain model: how to turn them, how they spread between free runs, and intervals of what follows from them.

use nalgebra::{DMatrix, DVector};

use crate::acceptance::statistics::student_90;
use crate::stage_alone::plain::Plain;
use crate::stage_alone::plain_models::{PlainKind, PlainModel};
use crate::stage_alone::run::{Run, travel, typical_s};
use crate::stage_alone::set_point::SetPoint;
use crate::stage_alone::spread::{PieceSlopes, spread, with_common};

/// A step for slopes, as a share of what a number may be.
const STEP: f64 = 1e-3;

/// Numbers of a plain model, each with the ends between which its slope is taken, and their covariance between free runs.
#[derive(Clone, Debug)]
pub(crate) struct PlainNumbers {
    model: PlainModel,
    numbers: Vec<f64>,
    ends: Vec<[f64; 2]>,
    spread: DMatrix<f64>,
    /// Half-width of an interval of nine in ten, standard deviations.
    wide: f64,
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
                    all.push(positive(law.lag.time_s(), length_s));
                    // What is not there is not turned.
                    all.extend(law.saturates.is_finite().then(|| positive(law.saturates, drive)));
                }
                all
            }
            PlainModel::SetPoint(kind, law) => {
                let mut all = vec![free(law.gain, law.gain), free(law.level, opening), positive(law.lag_s, length_s)];
                if kind == PlainKind::SetPoint {
                    all.push(positive(law.delay_s, length_s));
                    // What is not there is not turned.
                    let limits = [law.rising_limit, law.falling_limit].into_iter().filter(|limit| limit.is_finite());
                    all.extend(limits.map(|limit| free(limit, limit)));
                    all.extend(
                        (law.half_play > 0.0).then(|| positive(law.half_play, opening.min(law.half_play / STEP * 0.5))),
                    );
                }
                all
            }
        };
        let (numbers, ends): (Vec<f64>, Vec<[f64; 2]>) = all.into_iter().unzip();
        let simulated = |numbers: &[f64], run: &Run| turned(model, numbers).simulated(run);
        let pieces: Vec<PieceSlopes> =
            runs.iter().map(|run| PieceSlopes::of(run, &numbers, &ends, simulated)).collect();
        let hessian = pieces.iter().map(|piece| piece.slopes.tr_mul(&piece.slopes)).sum();
        let spread = with_common(spread(&hessian, &pieces)?, pieces.len());
        Some(Self { model, numbers, ends, spread, wide: student_90(runs.len() as f64 - 1.0) })
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
            let above_1_s = numbers[1];
            PlainModel::Sum(
                kind,
                Plain {
                    zero: numbers[0],
                    above_1_s,
                    below_1_s: numbers.get(2).copied().unwrap_or(above_1_s),
                    half_band: numbers.get(3).copied().unwrap_or(law.half_band),
                    lag: numbers.get(4).map_or(law.lag, |time_s| law.lag.with_time(*time_s)),
                    saturates: numbers.get(5).copied().unwrap_or(law.saturates),
                },
            )
        }
        PlainModel::SetPoint(kind, law) => {
            let mut further = numbers[3..].iter().copied();
            let delay_s = further.next().unwrap_or(law.delay_s);
            let mut limit = |own: f64| if own.is_finite() { further.next().unwrap_or(own) } else { own };
            let (rising_limit, falling_limit) = (limit(law.rising_limit), limit(law.falling_limit));
            let half_play = further.next().unwrap_or(law.half_play);
            let [gain, level, lag_s] = [numbers[0], numbers[1], numbers[2]];
            let law = SetPoint { gain, level, delay_s, lag_s, rising_limit, falling_limit, half_play };
            PlainModel::SetPoint(kind, law)
        }
    }
}
