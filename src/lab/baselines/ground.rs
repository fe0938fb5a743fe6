//! What all baselines stand on: the nominal model refitted, and the effects tried on top of it at fixed sizes.

use nalgebra::{DMatrix, DVector};

use govtwin_diagnosis::estimation::coordinate::{Coordinate, Residuals, square, subject_at};
use govtwin_diagnosis::estimation::fit::Fit;
use govtwin_diagnosis::identification::free_parameter::FreeParameter;
use govtwin_diagnosis::likelihood::noise::expected;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::likelihood::problem::Problem;
use govtwin_diagnosis::model::search::{Turned, nominal};
use govtwin_model::effects::EffectSpec;
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::recording::Recording;

/// Sizes at which effects are tried, in typical ones.
const SIZES: [f64; 4] = [0.3, 1.0, 3.0, -1.0];

/// The refit and the tries.
#[derive(Debug)]
pub struct Ground {
    /// The recordings with their noise.
    pub problem: Problem,
    /// The sheet.
    pub base: Unit,
    /// Its tolerances.
    pub free_parameters: Vec<FreeParameter>,
    /// The refit.
    pub fit: Fit,
    /// All tries.
    pub tries: Vec<Try>,
}

/// One effect at one size on top of the refit.
#[derive(Clone, Debug)]
pub struct Try {
    /// The effect.
    pub spec: &'static EffectSpec,
    /// The unit with the effect in it, neutral.
    pub base: Unit,
    /// Free parameters of tolerances, then of the effect.
    pub free_parameters: Vec<FreeParameter>,
    /// Positions of all free parameters.
    pub positions: Vec<f64>,
    /// Residuals.
    pub residuals: Residuals,
}

impl Ground {
    /// Refits the nominal model as the diagnosis does, which places trips between slow samples, and tries every effect of a catalogue.
    pub fn new(recordings: Vec<Recording>, unit: &Unit, catalogue: &[&'static EffectSpec]) -> Self {
        let turned = Turned { free_parameters: FreeParameter::nuisances(unit), starts: 1 };
        let recordings = recordings.into_iter().map(PreparedRecording::new).collect();
        let (problem, refitted, _) = nominal(recordings, unit, turned, &expected(&unit.sensors));
        let (free_parameters, fit) = (refitted.free_parameters, refitted.fit);
        let mut tries = Vec::new();
        for &spec in catalogue {
            let mut base = unit.clone();
            let effect = base.effects.len();
            base.effects.push(EffectSetting { id: spec.id.to_owned(), values: spec.completed(&[]) });
            let mut all = free_parameters.clone();
            let own = spec.parameters.iter().enumerate();
            all.extend(own.map(|(parameter, spec)| FreeParameter::Effect { effect, parameter, spec }));
            for size in SIZES {
                let mut positions = fit.positions.clone();
                for (k, free_parameter) in all[free_parameters.len()..].iter().enumerate() {
                    let (low, high) = free_parameter.range(&base);
                    positions.push(if k == 0 { size } else { 1.0 }.clamp(low, high));
                }
                if positions[free_parameters.len()] != 0.0 {
                    tries.push(Try {
                        spec,
                        base: base.clone(),
                        free_parameters: all.clone(),
                        positions,
                        residuals: Vec::new(),
                    });
                }
            }
        }
        let units: Vec<Unit> =
            tries.iter().map(|one| subject_at(&one.base, &one.free_parameters, &one.positions)).collect();
        for (one, residuals) in tries.iter_mut().zip(problem.residuals_of(&units)) {
            one.residuals = residuals;
        }
        Self { problem, base: unit.clone(), free_parameters, fit, tries }
    }

    /// Number of values compared.
    pub fn count(&self) -> f64 {
        self.fit.residuals.iter().map(DVector::len).sum::<usize>() as f64
    }

    /// Variance of the refit's residuals, 1 where the noise model is right.
    pub fn variance(&self) -> f64 {
        (square(&self.fit.residuals) / self.count()).max(1e-9)
    }

    /// For each effect the try whose residuals are smallest.
    pub(crate) fn best_tries(&self) -> Vec<&Try> {
        let mut best: Vec<&Try> = Vec::new();
        for one in &self.tries {
            match best.last_mut() {
                Some(last) if last.spec.id == one.spec.id => {
                    if square(&one.residuals) < square(&last.residuals) {
                        *last = one;
                    }
                }
                _ => best.push(one),
            }
        }
        best
    }

    /// Change of the residuals for one typical size of each effect's best try, after what the tolerances can explain is taken out:
    /// Gram matrix of the effects, and their products with the residuals.
    pub fn projected(&self, tries: &[&Try]) -> (DMatrix<f64>, DVector<f64>) {
        let (n, m) = (self.free_parameters.len(), tries.len());
        let mut gram = DMatrix::zeros(n + m, n + m);
        let mut product = DVector::zeros(n + m);
        for (recording, residuals) in self.fit.residuals.iter().enumerate() {
            let columns: Vec<DVector<f64>> =
                tries.iter().map(|one| (&one.residuals[recording] - residuals) / one.positions[n]).collect();
            let mut all = DMatrix::zeros(residuals.len(), n + m);
            all.columns_mut(0, n).copy_from(&self.fit.slopes[recording]);
            for (k, column) in columns.iter().enumerate() {
                all.set_column(n + k, column);
            }
            gram += all.tr_mul(&all);
            product += all.tr_mul(residuals);
        }
        for k in 0..n {
            gram[(k, k)] += 1.0;
            product[k] += self.fit.positions[k];
        }
        let (a, b) = (gram.view((0, 0), (n, n)).into_owned(), gram.view((0, n), (n, m)).into_owned());
        let Some(inverse) = a.try_inverse() else {
            return (gram.view((n, n), (m, m)).into_owned(), product.rows(n, m).into_owned());
        };
        let reduced = gram.view((n, n), (m, m)) - b.tr_mul(&(&inverse * &b));
        let left = product.rows(n, m) - b.tr_mul(&(&inverse * product.rows(0, n)));
        (reduced, left)
    }
}
