//! What these recordings could show at all: the smallest effect that stands out, and effects that look alike.

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::diagnosis::decide::SEEN;
use crate::diagnosis::model::Model;
use crate::diagnosis::outcome::Visible;
use crate::diagnosis::search::with_effect;
use crate::effects::EffectSpec;
use crate::tuning::bench::Bench;
use crate::tuning::knob::unit_at;
use crate::tuning::linear::normal;

/// From this likeness on two effects cannot be told apart here.
pub const ALIKE: f64 = 0.97;

/// Size of the trial effects, in typical ones.
const SIZE: f64 = 0.5;

/// The mark of one effect.
struct Mark {
    spec: &'static EffectSpec,
    /// Change of the misses, by trial.
    change: Vec<DVector<f64>>,
    /// How much of it lies along each knob of the model.
    along: DVector<f64>,
}

/// The mark that each effect leaves in the misses, what refitting takes back taken off.
pub struct Marks {
    marks: Vec<Mark>,
    inverse: DMatrix<f64>,
}

impl Marks {
    /// Simulates each effect at half its typical size on top of a model.
    #[must_use]
    pub fn new(bench: &Bench, model: &Model, catalogue: &[&'static EffectSpec]) -> Self {
        let (hessian, _) = normal(&model.knobs, &model.fit.positions, &model.fit.misses, &model.fit.slopes, 1.0);
        let n = hessian.nrows();
        let inverse = (hessian + DMatrix::identity(n, n) * 1e-9).try_inverse().unwrap_or_else(|| DMatrix::zeros(n, n));
        let marks = catalogue
            .par_iter()
            .filter_map(|&spec| {
                let (base, knobs, positions) = with_effect(model, spec, SIZE, 1.0)?;
                let misses = bench.misses_of(&[unit_at(&base, &knobs, &positions)]).pop()?;
                let change: Vec<DVector<f64>> =
                    misses.iter().zip(&model.fit.misses).map(|(with, without)| with - without).collect();
                let mut along = DVector::zeros(n);
                for (slope, change) in model.fit.slopes.iter().zip(&change) {
                    along += slope.tr_mul(change);
                }
                Some(Mark { spec, change, along })
            })
            .collect();
        Self { marks, inverse }
    }

    fn product(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (&self.marks[a], &self.marks[b]);
        let plain: f64 = a.change.iter().zip(&b.change).map(|(a, b)| a.dot(b)).sum();
        plain - a.along.dot(&(&self.inverse * &b.along))
    }

    /// The smallest size of each effect that stands out.
    #[must_use]
    pub fn visible(&self) -> Vec<Visible> {
        (0..self.marks.len())
            .map(|k| {
                let spec = self.marks[k].spec;
                let parameter = &spec.parameters[0];
                let typical = (parameter.typical - parameter.neutral).abs();
                let strength = self.product(k, k);
                let smallest = if strength > 1e-6 { typical * SIZE * (SEEN / strength).sqrt() } else { f64::INFINITY };
                Visible { id: spec.id, parameter: parameter.name, unit: parameter.unit, smallest, typical }
            })
            .collect()
    }

    /// Pairs that look alike, either way round, most alike first.
    #[must_use]
    pub fn alike(&self) -> Vec<(String, String, f64)> {
        let mut pairs = Vec::new();
        for a in 0..self.marks.len() {
            for b in a + 1..self.marks.len() {
                let lengths = self.product(a, a) * self.product(b, b);
                if lengths <= 1e-9 {
                    continue;
                }
                let likeness = (self.product(a, b) / lengths.sqrt()).abs().min(1.0);
                if likeness > ALIKE {
                    pairs.push((self.marks[a].spec.id.to_owned(), self.marks[b].spec.id.to_owned(), likeness));
                }
            }
        }
        pairs.sort_by(|a, b| b.2.total_cmp(&a.2));
        pairs
    }
}
