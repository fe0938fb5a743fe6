//! Fault sets of a servomotor stage alone with their features: evidence, and what each misses on pieces left out of its fit.
//!
//! Without a loop around it a stage shows its equations' errors as they are, and whoever fits it freely finds effects in them. What was left out of the
//! fit tells the two apart.

use crate::decision::features::{FARTHEST, FREEDOM, ODDS, by_kind, oddness, score, softmax};
use crate::hypotheses::table::{EvidenceRow, EvidenceTable, StageEvidence};

/// Squares below this are taken for it, pu²: no recording is finer.
const LEAST_SQUARE: f64 = 1e-12;

/// Sets by their row of the table with their features, their probabilities, and by what nats are divided.
type FeaturedSets = (Vec<(usize, Vec<f64>)>, Vec<f64>, f64);

/// Those of a table, without sets of struck effects; none of an empty table.
pub(super) fn sets(
    table: &EvidenceTable,
    stage: &StageEvidence,
    struck: &[&str],
    set_weights: &[f64],
) -> Option<FeaturedSets> {
    let allowed = |row: &&EvidenceRow| !row.effects.iter().any(|id| struck.contains(&id.as_str()));
    let rows: Vec<(usize, &EvidenceRow)> = table.rows.iter().enumerate().filter(|(_, row)| allowed(row)).collect();
    let odds = |row: &EvidenceRow| row.evidence() - ODDS * row.effects.len() as f64;
    let leader = rows.iter().map(|(_, row)| *row).max_by(|a, b| odds(a).total_cmp(&odds(b)))?;
    let top = rows.iter().map(|(_, row)| row.evidence()).fold(f64::NEG_INFINITY, f64::max);
    let expected = table.samples.max(1.0);
    let scale = 1.0 + (leader.cost - expected).max(0.0) / FREEDOM;
    let known: Vec<f64> = rows.iter().filter_map(|(_, row)| row.left_out_square).collect();
    let least = known.iter().copied().fold(f64::INFINITY, f64::min);
    let most = known.iter().copied().fold(0.0, f64::max);
    // What nobody tried on pieces left out has little evidence, and is taken for as bad as the worst that was.
    let square = |row: &EvidenceRow| row.left_out_square.unwrap_or(most).max(LEAST_SQUARE);
    let set = |&(k, row): &(usize, &EvidenceRow)| {
        let lost = (top - row.evidence()).min(FARTHEST) / scale;
        let left_out = (0.5 * stage.pieces as f64 * (square(row) / least.max(LEAST_SQUARE)).ln()).clamp(0.0, FARTHEST);
        let features = [
            lost,
            lost.ln_1p(),
            row.effects.len() as f64,
            f64::from(u8::from(row.effects.is_empty())),
            row.prior_per_parameter.min(20.0),
            oddness(row),
            left_out,
            left_out.ln_1p(),
        ];
        (k, by_kind(table, &features))
    };
    let sets: Vec<(usize, Vec<f64>)> = rows.iter().map(set).collect();
    let of_sets = softmax(sets.iter().map(|(_, features)| score(features, set_weights)).collect());
    Some((sets, of_sets, scale))
}
