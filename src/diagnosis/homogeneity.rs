//! Whether the recordings are of one unit: one set of parameters fits them all, or two groups of them have parameters of their own.
//!
//! Each recording is fitted alone, and those whose fits agree best are put together until two groups are left, which are fitted once more. That these are of
//! two units is weighed against one unit by the evidence of both, with the tolerances integrated out (Laplace's method): two units fit never worse, and
//! pay for their parameters twice. Equations are in error, and differently in each process, so that what recordings of one group differ by is no
//! difference of units: residuals count for so little that no group is worth parting further.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::decision::hyperparameters::Hyperparameters;
use crate::estimation::coordinate::Coordinate;
use crate::estimation::fit::{Effort, Fit, fit};
use crate::estimation::linear::crossed;
use crate::likelihood::problem::{Problem, SOUND_MEAN_SQUARE};
use crate::model::FittedModel;

/// Work of the fit to some of the recordings.
const PART: Effort = Effort { rounds: 6, refresh: 3, temperature: 1.0 };

/// Odds of something else at work, by what two units leave, from which on they explain nothing: one sound unit in twenty leaves as much.
const RARE: f64 = 19.0;

/// The sum of squares about a fit, quadratic in the free parameters.
#[derive(Clone, Debug)]
struct Quadratic {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    square: f64,
}

impl Quadratic {
    /// About a fit, as seen from the origin.
    fn about(fit: &Fit) -> Self {
        let count = fit.positions.len();
        let hessian = fit.slopes.iter().fold(DMatrix::zeros(count, count), |sum, slopes| sum + crossed(slopes, slopes));
        let along = fit.slopes.iter().zip(&fit.residuals).map(|(slopes, residuals)| slopes.tr_mul(residuals));
        let along = along.fold(DVector::zeros(count), |sum, one| sum + one);
        let at = DVector::from_column_slice(&fit.positions);
        let bent = &hessian * &at;
        Self { gradient: &along - &bent, square: fit.square - 2.0 * along.dot(&at) + at.dot(&bent), hessian }
    }

    fn and(&self, other: &Self) -> Self {
        let Self { hessian, gradient, square } = other;
        Self { hessian: &self.hessian + hessian, gradient: &self.gradient + gradient, square: self.square + square }
    }

    /// Logarithm of the evidence of one unit, the parameters beforehand within one about their centres; squares count by one over a temperature.
    fn log_evidence(&self, centres: &DVector<f64>, temperature: f64) -> f64 {
        let count = centres.len();
        let hessian = &self.hessian / temperature + DMatrix::identity(count, count);
        let gradient = &self.gradient / temperature - centres;
        let constant = self.square / temperature + centres.norm_squared();
        let Some(cholesky) = Cholesky::new(hessian) else { return f64::NEG_INFINITY };
        let log_root = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        -0.5 * (constant - gradient.dot(&cholesky.solve(&gradient))) - log_root
    }
}

/// Recordings that are taken for those of one unit, and the two parts that differ most among them.
#[derive(Clone, Debug)]
struct Group {
    members: Vec<usize>,
    all: Quadratic,
    parts: Option<[Quadratic; 2]>,
}

impl Group {
    fn of(a: &Self, b: &Self) -> Self {
        Self {
            members: [&a.members[..], &b.members[..]].concat(),
            all: a.all.and(&b.all),
            parts: Some([a.all.clone(), b.all.clone()]),
        }
    }

    /// Logarithm of the odds that its two parts are of two units instead of one.
    fn parted(&self, centres: &DVector<f64>, temperature: f64) -> f64 {
        self.parts.as_ref().map_or(f64::NEG_INFINITY, |parts| apart(&self.all, parts, centres, temperature))
    }
}

/// Logarithm of the odds of two units against one.
fn apart(one: &Quadratic, two: &[Quadratic; 2], centres: &DVector<f64>, temperature: f64) -> f64 {
    let each = two.iter().map(|part| part.log_evidence(centres, temperature)).sum::<f64>();
    each - one.log_evidence(centres, temperature)
}

/// Puts together what agrees best until two groups are left.
fn grouped(mut groups: Vec<Group>, centres: &DVector<f64>) -> Option<[Group; 2]> {
    while groups.len() > 2 {
        let pairs = (0..groups.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
        let joined = pairs.map(|(a, b)| {
            let both = Group::of(&groups[a], &groups[b]);
            (both.parted(centres, 1.0), a, b, both)
        });
        let (_, a, b, both) = joined.min_by(|one, other| one.0.total_cmp(&other.0))?;
        groups.remove(b);
        groups[a] = both;
    }
    groups.try_into().ok()
}

/// Says in a sentence that the recordings are not of one unit, where they are not by the model that fits them all best.
#[must_use]
pub fn disagreement(problem: &Problem, model: &FittedModel, numbers: &Hyperparameters) -> Option<String> {
    let expected = problem.expected_cost();
    // What fits to noise is of one unit; so much at least two would have to gain.
    let is_needed = model.cost() > expected + 2.0 * numbers.rarity / numbers.tempering;
    if problem.recordings.len() < 2 || model.fit.slopes.len() < problem.recordings.len() || !is_needed {
        return None;
    }
    let fitted = |members: &[usize]| {
        let known: Vec<DMatrix<f64>> = members.iter().map(|&k| model.fit.slopes[k].clone()).collect();
        let own = problem.of_recordings(members);
        fit(&own, &model.base, &model.free_parameters, &model.fit.positions, PART, Some(&known))
    };
    let places = model.free_parameters.iter().zip(&model.fit.positions);
    let centres: Vec<f64> = places.map(|(one, position)| one.prior_centre().unwrap_or(*position)).collect();
    let centres = DVector::from_vec(centres);
    let alone = (0..problem.recordings.len())
        .map(|k| Group { members: vec![k], all: Quadratic::about(&fitted(&[k])), parts: None })
        .collect();
    let groups = grouped(alone, &centres)?;
    let models = groups.each_ref().map(|group| {
        let (effects, base) = (model.effects.clone(), model.base.clone());
        FittedModel::new(effects, base, model.free_parameters.clone(), fitted(&group.members))
    });
    // Two units must explain the recordings themselves: what they leave, and how far their sheets are off, must be no rarity of sound units.
    let left = models.iter().map(|model| model.fit.square).sum::<f64>() / problem.independent_samples();
    let stretched = models.iter().map(FittedModel::prior_per_parameter).fold(0.0, f64::max);
    let beyond = ((left - SOUND_MEAN_SQUARE) / numbers.equation_error).max((stretched - 1.0) / numbers.sheet_error);
    if beyond.max(0.0).powf(1.0 / numbers.error_spread) > RARE {
        return None;
    }
    let mut temperature = (left / SOUND_MEAN_SQUARE).max(1.0) / numbers.tempering;
    let (one, two) = (Quadratic::about(&model.fit), models.each_ref().map(|model| Quadratic::about(&model.fit)));
    let is_two = |temperature| apart(&one, &two, &centres, temperature) > numbers.rarity;
    while is_two(temperature) && groups.iter().any(|group| group.parted(&centres, temperature) > 0.0) {
        temperature *= 2.0;
    }
    if !is_two(temperature) {
        return None;
    }
    let names = groups.each_ref().map(|group| {
        let mut members = group.members.clone();
        members.sort_unstable();
        members.iter().map(|&k| problem.recordings[k].name.as_str()).collect::<Vec<_>>().join(", ")
    });
    Some(format!(
        "The recordings are of different units, or of one before and after a change: one set of parameters does not fit them all, and two do, one for {} and one \
         for {}{}. No effect is named for such recordings.",
        names[0],
        names[1],
        differs(&models)
    ))
}

/// The parameter in which two units lie farthest apart, in its deviations.
fn differs(units: &[FittedModel; 2]) -> String {
    let [a, b] = units;
    let size = |k: usize| {
        let distance = a.fit.positions[k] - b.fit.positions[k];
        distance.abs() / (a.spread[(k, k)] + b.spread[(k, k)]).sqrt().max(1e-9)
    };
    let Some(k) = (0..a.free_parameters.len()).max_by(|&k, &other| size(k).total_cmp(&size(other))) else {
        return String::new();
    };
    let (key, unit) = a.free_parameters[k].key(&a.base);
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let [one, other] = [a, b].map(|model| model.free_parameters[k].value(&model.base, model.fit.positions[k]));
    format!(": {key} would be {one:.4e}{unit} and {other:.4e}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A recording that says that each of two parameters stands somewhere, with this precision.
    fn recording(number: usize, at: [f64; 2], precision: f64) -> Group {
        let root = precision.sqrt();
        let slopes = vec![DMatrix::from_diagonal_element(2, 2, root)];
        let residuals = vec![DVector::zeros(2)];
        let all = Quadratic::about(&Fit { positions: at.to_vec(), square: 0.0, prior: 0.0, residuals, slopes });
        Group { members: vec![number], all, parts: None }
    }

    fn sorted(groups: &[Group; 2]) -> Vec<Vec<usize>> {
        let mut all: Vec<Vec<usize>> = groups.iter().map(|group| group.members.clone()).collect();
        all.iter_mut().for_each(|members| members.sort_unstable());
        all.sort();
        all
    }

    #[test]
    fn recordings_that_agree_stand_together_and_the_groups_are_two_units() {
        let centres = DVector::zeros(2);
        let places = [[0.5, -0.3], [-1.0, 0.8], [0.52, -0.31], [-0.97, 0.79]];
        let alone = (0..4).map(|k| recording(k, places[k], 400.0)).collect();
        let groups = grouped(alone, &centres).unwrap();
        assert_eq!(sorted(&groups), [vec![0, 2], vec![1, 3]]);
        let both = Group::of(&groups[0], &groups[1]);
        assert!(both.parted(&centres, 1.0) > 50.0, "{}", both.parted(&centres, 1.0));
        assert!(groups.iter().all(|group| group.parted(&centres, 1.0) < 0.0));
        // Where residuals count for little, they tell nothing.
        assert!(both.parted(&centres, 400.0) < 1.0, "{}", both.parted(&centres, 400.0));
    }

    #[test]
    fn two_units_pay_for_their_parameters_twice() {
        let centres = DVector::zeros(2);
        let both = Group::of(&recording(0, [0.5, -0.3], 100.0), &recording(1, [0.52, -0.33], 100.0));
        assert!(both.parted(&centres, 1.0) < -1.0, "{}", both.parted(&centres, 1.0));
        assert_eq!(recording(0, [0.0, 0.0], 1.0).parted(&centres, 1.0), f64::NEG_INFINITY);
    }

    /// What a recording says does not depend on where it was expanded: with the parameters free the evidence peaks where they stand.
    #[test]
    fn a_quadratic_is_that_of_its_fit() {
        let one = recording(0, [0.7, 0.2], 50.0).all;
        let at = DVector::from_vec(vec![0.7, 0.2]);
        let here = one.log_evidence(&at, 1.0);
        assert!((here + 51.0_f64.ln()).abs() < 1e-9, "{here}");
        assert!(one.log_evidence(&DVector::zeros(2), 1.0) < here);
    }
}
