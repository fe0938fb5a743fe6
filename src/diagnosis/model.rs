//! A model: a unit with effects, its parameters fitted, and what the fit says of them.

pub mod consistency;
pub mod discrepancy;
pub mod normal_equations;
pub mod search;
pub(crate) mod support;

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::estimation::coordinate::{Coordinate, prior_square, square, subject_at};
use crate::estimation::fit::{Effort, Fit, Start, pictured};
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::problem::Problem;
use crate::model::normal_equations::{NormalEquations, covariance, parts};
use crate::model::support::{Placed, Variant, add};
use govtwin_model::effects::EffectSpec;
use govtwin_model::parameters::Unit;

/// A model with all its free parameters fitted: the sheet's tolerances, then the parameters of its effects.
#[derive(Clone, Debug)]
pub struct FittedModel {
    /// The effects beyond those of the unit itself.
    pub effects: Vec<&'static EffectSpec>,
    /// The unit with the effects in it, neutral.
    pub base: Unit,
    /// What was fitted.
    pub free_parameters: Vec<FreeParameter>,
    /// The fit; a model that was only scouted keeps neither residuals nor slopes.
    pub fit: Fit,
    /// Its normal equations.
    pub normal: NormalEquations,
    /// Covariance of the free parameters about the fit.
    pub spread: DMatrix<f64>,
}

impl FittedModel {
    /// A model as fitted.
    pub fn new(effects: Vec<&'static EffectSpec>, base: Unit, free_parameters: Vec<FreeParameter>, fit: Fit) -> Self {
        let parts = parts(&fit);
        let spread = covariance(&free_parameters, &parts);
        let normal = NormalEquations::new(&base, &free_parameters, &fit, parts);
        Self { effects, base, free_parameters, fit, normal, spread }
    }

    /// The unit without effects of ours, as the sheet has it, unfitted.
    pub fn sheet(problem: &Problem, unit: &Unit, free_parameters: &[FreeParameter]) -> Self {
        let positions = free_parameters.iter().map(|free_parameter| free_parameter.start(unit)).collect();
        Self::unfitted(problem, Vec::new(), (unit.clone(), free_parameters.to_vec(), positions))
    }

    /// The effects as they stand on the sheet as it was delivered, unfitted.
    pub(crate) fn unstretched(&self, problem: &Problem) -> Self {
        let (base, free_parameters, mut positions) = self.placed();
        let priors = free_parameters.iter().map(Coordinate::prior_centre);
        positions.iter_mut().zip(priors).for_each(|(position, prior)| *position = prior.unwrap_or(*position));
        Self::unfitted(problem, self.effects.clone(), (base, free_parameters, positions))
    }

    fn unfitted(problem: &Problem, effects: Vec<&'static EffectSpec>, placed: Placed) -> Self {
        let (base, free_parameters, positions) = placed;
        let (residuals, slopes) = pictured(problem, &base, &free_parameters, &positions);
        let prior = prior_square(&free_parameters, &positions);
        let fit = Fit { square: square(&residuals), prior, positions, residuals, slopes };
        Self::new(effects, base, free_parameters, fit)
    }

    /// Gives up residuals and slopes, which are nearly all of its memory.
    pub(crate) fn lighten(&mut self) {
        (self.fit.residuals, self.fit.slopes) = (Vec::new(), Vec::new());
    }

    /// Slopes by the parameters of the sheet alone; where they were given up, those of the refitted sheet, good enough to begin with.
    pub(crate) fn sheet_slopes(&self, refitted: &Self) -> Vec<DMatrix<f64>> {
        let known = if self.fit.slopes.is_empty() { refitted } else { self };
        let count = refitted.free_parameters.len();
        known.fit.slopes.iter().map(|slopes| slopes.columns(0, count).into_owned()).collect()
    }

    /// The same effects and free parameters, fitted otherwise, if that is better.
    pub(crate) fn or_better(&self, fit: Fit) -> Self {
        if fit.cost() <= self.fit.cost() || self.fit.slopes.is_empty() {
            Self::new(self.effects.clone(), self.base.clone(), self.free_parameters.clone(), fit)
        } else {
            self.clone()
        }
    }

    /// The unit with these of the model's effects alone, its free parameters, and where they stand.
    pub fn keeping(&self, ids: &[&str]) -> Placed {
        let own = self.base.effects.len() - self.effects.len();
        let kept = |effect: usize| effect < own || ids.contains(&self.base.effects[effect].id.as_str());
        let place = |effect: usize| (0..effect).filter(|&before| kept(before)).count();
        let mut base = self.base.clone();
        base.effects = (0..base.effects.len()).filter(|&k| kept(k)).map(|k| self.base.effects[k].clone()).collect();
        let (free_parameters, start): (Vec<FreeParameter>, Vec<f64>) =
            self.free_parameters
                .iter()
                .zip(&self.fit.positions)
                .filter_map(|(free_parameter, position)| match *free_parameter {
                    FreeParameter::Effect { effect, parameter, spec } => kept(effect)
                        .then(|| (FreeParameter::Effect { effect: place(effect), parameter, spec }, *position)),
                    other => Some((other, *position)),
                })
                .unzip();
        (base, free_parameters, start)
    }

    /// Squares of residuals and priors together.
    pub fn cost(&self) -> f64 {
        self.fit.cost()
    }

    /// Squares and priors of some recordings by themselves, along the slopes at hand; also of a model that gave up its slopes.
    pub(crate) fn least_cost_of(&self, recordings: &[usize]) -> f64 {
        let n = self.free_parameters.len();
        let (mut cost, mut gradient) = (self.fit.prior, DVector::zeros(n));
        let mut hessian = DMatrix::identity(n, n) * 1e-9;
        for part in recordings.iter().filter_map(|&k| self.normal.parts.get(k)) {
            cost += part.cost;
            gradient += &part.gradient;
            hessian += &part.hessian;
        }
        for (k, free_parameter) in self.free_parameters.iter().enumerate() {
            if let Some(centre) = free_parameter.prior_centre().filter(|_| !self.normal.held.contains(&k)) {
                gradient[k] += self.fit.positions[k] - centre;
                hessian[(k, k)] += 1.0;
            }
        }
        Cholesky::new(hessian).map_or(cost, |cholesky| cost - gradient.dot(&cholesky.solve(&gradient)))
    }

    /// What the recordings say of a free parameter beyond the sheet: 0 where they say nothing, 1 where the sheet's tolerance does not matter.
    pub fn information(&self, free_parameter: usize) -> f64 {
        if self.free_parameters[free_parameter].has_prior() {
            (1.0 - self.spread[(free_parameter, free_parameter)].max(0.0)).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }

    /// How far the sheet is stretched: squares of the parameters' deviations in tolerances, over what the recordings say of them, which
    /// counts as three parameters at least, since one or two may lie far out by chance. About 1 where tolerances mean what they say.
    pub fn prior_per_parameter(&self) -> f64 {
        let told: f64 = (0..self.free_parameters.len())
            .filter(|&k| self.free_parameters[k].has_prior())
            .map(|k| self.information(k))
            .sum();
        self.fit.prior / told.max(3.0)
    }

    /// The parameters that stand at least so many tolerances off the sheet, the farthest two, in words.
    pub(crate) fn stretched(&self, least: f64) -> Vec<String> {
        let positions = self
            .free_parameters
            .iter()
            .zip(&self.fit.positions)
            .filter(|(free_parameter, _)| free_parameter.has_prior());
        let mut far: Vec<(&FreeParameter, f64)> =
            positions.map(|(free_parameter, &position)| (free_parameter, position)).collect();
        far.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        let words = |(free_parameter, position): (&FreeParameter, f64)| {
            let than = if position > 0.0 { "above" } else { "below" };
            format!("{} is {:.1} tolerances {than} the sheet value", free_parameter.key(&self.base).0, position.abs())
        };
        far.into_iter().filter(|(_, position)| position.abs() >= least).take(2).map(words).collect()
    }

    /// The unit as fitted without one of the model's effects.
    pub fn without(&self, own: usize) -> Unit {
        let mut unit = self.unit();
        let first = unit.effects.len() - self.effects.len();
        unit.effects.remove(first + own);
        unit
    }

    /// The unit as fitted.
    pub fn unit(&self) -> Unit {
        subject_at(&self.base, &self.free_parameters, &self.fit.positions)
    }

    /// Whether it has this effect.
    pub fn has(&self, id: &str) -> bool {
        self.effects.iter().any(|effect| effect.id == id)
    }

    /// Ids of the effects.
    pub fn ids(&self) -> Vec<&'static str> {
        self.effects.iter().map(|effect| effect.id).collect()
    }

    /// The unit, its free parameters, and where they stand.
    pub fn placed(&self) -> Placed {
        (self.base.clone(), self.free_parameters.clone(), self.fit.positions.clone())
    }

    /// The same with one more effect; none where the size is out of its range.
    pub fn with_effect(&self, spec: &'static EffectSpec, variant: Variant) -> Option<Placed> {
        let mut placed = self.placed();
        add(&mut placed, spec, variant).then_some(placed)
    }

    /// What a fit from here on begins with.
    pub(crate) fn onwards(&self, effort: Effort) -> Start<'_, FreeParameter> {
        let known = (!self.fit.slopes.is_empty()).then_some(self.fit.slopes.as_slice());
        Start { base: &self.base, coordinates: &self.free_parameters, positions: &self.fit.positions, effort, known }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::linear::least_cost;
    use crate::generate::{Scenario, recording};
    use crate::likelihood::noise::expected;
    use crate::likelihood::prepared::PreparedRecording;
    use govtwin_model::effects::find;
    use govtwin_model::params::reference;
    use govtwin_model::recording::Process;

    #[test]
    fn the_least_cost_of_some_recordings_is_that_along_their_slopes() {
        let unit = reference();
        let scenario = |process, seed| Scenario {
            unit: unit.clone(),
            process,
            rate_hz: 100.0,
            duration_s: 10.0,
            rich: false,
            seed,
        };
        let prepared = [(Process::Shutdown, 1), (Process::LoadIncrease, 2)]
            .map(|(process, seed)| PreparedRecording::new(recording(&scenario(process, seed))));
        let problem = Problem::new(prepared.into(), &unit, &expected(&unit.sensors));
        let mut model = FittedModel::sheet(&problem, &unit, &FreeParameter::nuisances(&unit));
        for recordings in [&[0][..], &[1], &[0, 1]] {
            let slopes: Vec<DMatrix<f64>> = recordings.iter().map(|&k| model.fit.slopes[k].clone()).collect();
            let residuals = recordings.iter().map(|&k| model.fit.residuals[k].clone()).collect();
            let along = least_cost(&model.free_parameters, &model.fit.positions, &residuals, &slopes);
            let least = model.least_cost_of(recordings);
            assert!((least - along).abs() < 1e-6 * along, "{recordings:?}: {least} for {along}");
        }
        let both = model.least_cost_of(&[0, 1]);
        assert!(model.least_cost_of(&[0]) + model.least_cost_of(&[1]) < both, "each by itself fits at least as well");
        model.lighten();
        assert_eq!(model.least_cost_of(&[0, 1]), both);
    }

    #[test]
    fn what_is_unstretched_stands_on_the_sheet_and_keeps_its_effects() {
        let unit = reference();
        let process = Process::Shutdown;
        let scenario = Scenario { unit: unit.clone(), process, rate_hz: 100.0, duration_s: 10.0, rich: false, seed: 1 };
        let prepared = vec![PreparedRecording::new(recording(&scenario))];
        let problem = Problem::new(prepared, &unit, &expected(&unit.sensors));
        let sheet = FittedModel::sheet(&problem, &unit, &FreeParameter::nuisances(&unit));
        let count = sheet.free_parameters.len();
        let spring = find("spring").unwrap();
        let (base, free_parameters, mut positions) =
            sheet.with_effect(spring, Variant { size: 1.0, further: 1.0 }).unwrap();
        positions[..count].fill(-2.0);
        let stretched = FittedModel::unfitted(&problem, vec![spring], (base, free_parameters, positions));
        let unstretched = stretched.unstretched(&problem);
        assert_eq!(unstretched.fit.positions[..count], vec![0.0; count]);
        assert_eq!(unstretched.fit.positions[count..], stretched.fit.positions[count..]);
        assert!(unstretched.fit.prior == 0.0 && stretched.fit.prior > 4.0 && unstretched.has("spring"));
        assert!(unstretched.cost() != sheet.cost() && unstretched.cost() != stretched.cost());
    }
}
