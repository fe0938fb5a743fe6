//! What a stage alone misses on pieces left out, with each of the likeliest fault sets: what its posterior knows beside the evidence.

use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::decision::hyperparameters::Hyperparameters;
use crate::hypotheses::Explored;
use crate::hypotheses::table::{EvidenceTable, StageEvidence};
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::result::Setup;
use crate::summary::explained_fraction::without_recordings;
use govtwin_model::frame::Estimate;
use govtwin_model::signal::Signal;

/// Sets that are tried on pieces left out, besides the stage without any effect: the likeliest by evidence and number. It costs a fit for each piece.
const TRIED: usize = 10;

/// Adds to a table of a stage alone what is missed on pieces left out.
pub(crate) fn add(table: &mut EvidenceTable, problem: &Problem, found: &Explored, setup: Setup) {
    let mut order: Vec<usize> = (0..table.rows.len()).collect();
    let rarity = Hyperparameters::shipped().rarity;
    let odds = |row: usize| -0.5 * table.rows[row].cost - rarity * table.rows[row].effects.len() as f64;
    order.sort_by(|&a, &b| odds(b).total_cmp(&odds(a)));
    let tried = |(place, row): &(usize, usize)| *place < TRIED || table.rows[*row].effects.is_empty();
    let rows: Vec<usize> = order.into_iter().enumerate().filter(tried).map(|(_, row)| row).collect();
    let squares: Vec<(usize, f64)> = rows
        .into_par_iter()
        .filter_map(|row| {
            // A set far from the leader is kept without its slopes.
            let model = found.hypotheses.get(row).map(|one| &one.model).filter(|one| !one.fit.slopes.is_empty())?;
            Some((row, square(problem, model)?))
        })
        .collect();
    for (row, square) in squares {
        table.rows[row].left_out_square = Some(square);
    }
    table.stage_alone = Some(StageEvidence { sheet: setup != Setup::StageFree, pieces: problem.recordings.len() });
}

/// Mean square that a model misses on pieces left out of its fit, pu²: geometric mean of the pieces, so that none outweighs the others.
fn square(problem: &Problem, model: &FittedModel) -> Option<f64> {
    let left_out = without_recordings(problem, model).estimates;
    let of = |(index, estimates): (usize, &Vec<Estimate>)| {
        let squares = problem.squares(index, Signal::ServomotorPosition, estimates)?;
        mean(&squares.into_iter().filter(|square| square.is_finite()).collect::<Vec<_>>())
    };
    geometric_mean(&left_out.iter().enumerate().filter_map(of).collect::<Vec<_>>())
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn geometric_mean(values: &[f64]) -> Option<f64> {
    let logarithms: Vec<f64> = values.iter().map(|value| value.max(f64::MIN_POSITIVE).ln()).collect();
    mean(&logarithms).map(f64::exp)
}
