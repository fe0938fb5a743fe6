//! What the posterior keeps over any table, and what it says of a few.

use proptest::prelude::*;

use super::*;
use crate::evidence::distortion::{Distortion, Place};
use crate::hypotheses::table::StageEvidence;
use govtwin_model::signal::Signal;

/// Effects of random tables, each of another stage.
const EFFECTS: [&str; 4] = ["backlash", "lvdt_bias", "viscosity", "pv_overlap"];

fn row(effects: &[&str], cost: f64) -> EvidenceRow {
    EvidenceRow {
        effects: effects.iter().map(|id| (*id).to_owned()).collect(),
        refined: true,
        cost,
        ..EvidenceRow::default()
    }
}

fn table(samples: f64, rows: Vec<EvidenceRow>) -> EvidenceTable {
    EvidenceTable { samples, rows, ..EvidenceTable::default() }
}

/// All sets of up to three of the effects, with such costs; what no fit could simulate costs infinitely much.
fn tables() -> impl Strategy<Value = EvidenceTable> {
    let cost = prop_oneof![9 => (0.1..20.0_f64).boxed(), 1 => Just(f64::INFINITY).boxed()];
    (100.0..5000.0_f64, proptest::collection::vec(cost, 15), 0.5..20.0_f64).prop_map(|(samples, costs, empty)| {
        let of = |(bits, cost): (usize, f64)| {
            let held: Vec<&str> = (0..4).filter(|k| bits >> k & 1 == 1).map(|k| EFFECTS[k]).collect();
            row(&held, cost * samples)
        };
        let costs = std::iter::once(empty).chain(costs).enumerate();
        table(samples, costs.filter(|(bits, _)| bits.count_ones() < 4).map(of).collect())
    })
}

fn numbers() -> impl Strategy<Value = Hyperparameters> {
    let moves = proptest::collection::vec(-1.0..1.0_f64, Hyperparameters::LEARNED);
    moves.prop_map(|moves| Hyperparameters::usual().moved(&std::array::from_fn(|k| moves[k])))
}

fn distortion(p_value: f64) -> Distortion {
    let place = Place::Frequency { recording: "startup".to_owned(), hz: 0.45 };
    Distortion { signal: Signal::SpoolPosition, place, deviations: 5.0, p_value }
}

fn probability(posterior: &Posterior, row: usize) -> f64 {
    posterior.sets.iter().find(|(one, _)| *one == row).map_or(0.0, |(_, p)| *p)
}

proptest! {
    #[test]
    fn probabilities_sum_to_one(table in tables(), numbers in numbers()) {
        let posterior = Posterior::new(&table, &numbers, &[]);
        let sum = posterior.sets.iter().map(|(_, p)| p).sum::<f64>() + posterior.unknown();
        prop_assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        prop_assert!(posterior.sets.iter().all(|(_, p)| (0.0..=1.0 + 1e-9).contains(p)));
        let complete: f64 = posterior.complete.iter().map(|(_, p)| p).sum();
        prop_assert!((complete + posterior.something_else - 1.0).abs() < 1e-9, "{complete}");
        prop_assert!(posterior.unknown() <= posterior.something_else + 1e-9);
    }

    /// A better fit of a set never makes it less probable.
    #[test]
    fn more_evidence_is_never_less_probable(
        table in tables(), numbers in numbers(), row in 0_usize..15, by in 0.05..1.0_f64,
    ) {
        let mut better = table.clone();
        better.rows[row].cost *= by;
        let [before, after] = [&table, &better].map(|table| probability(&Posterior::new(table, &numbers, &[]), row));
        prop_assert!(after >= before - 1e-12, "{before} {after}");
    }

    /// Of two sets with as many effects the one that leaves less is the more probable; one with more effects falls behind by the stated odds and share.
    #[test]
    fn no_set_outranks_one_that_leads_by_evidence(table in tables(), numbers in numbers(), a in 0_usize..15, b in 0_usize..15) {
        let posterior = Posterior::new(&table, &numbers, &[]);
        let (one, other) = (&table.rows[a], &table.rows[b]);
        prop_assume!(one.cost < other.cost && table.rows[0].cost.is_finite());
        let further = |row: &EvidenceRow| row.effects.len().saturating_sub(1) as f64;
        let more = (one.effects.len() as f64 - other.effects.len() as f64).max(0.0);
        let charged = one.cost + numbers.further_share * further(one) * (table.rows[0].cost - one.cost).max(0.0);
        let lead = 0.5 * numbers.tempering * table.samples * (other.cost / charged).ln();
        if lead > numbers.rarity * more {
            prop_assert!(probability(&posterior, a) >= probability(&posterior, b), "{lead} nats, {more} more effects");
        }
    }

    /// What stands out in what sets leave speaks for something else, the more the less likely it is by chance, and leaves the order of the sets.
    #[test]
    fn a_distortion_speaks_for_something_else(table in tables(), numbers in numbers(), p in 1e-12..1.0_f64, by in 1e-6..1.0_f64) {
        let with = |p_value: f64| {
            let mut table = table.clone();
            table.rows.iter_mut().take(4).for_each(|row| row.distortion = Some(distortion(p_value)));
            Posterior::new(&table, &numbers, &[])
        };
        let [untested, chance, weak, strong] = [Posterior::new(&table, &numbers, &[]), with(0.5), with(p), with(p * by)];
        prop_assert!(untested.something_else == chance.something_else);
        prop_assert!(strong.something_else >= weak.something_else - 1e-12);
        prop_assert!(weak.something_else >= chance.something_else - 1e-12);
        let shares = |posterior: &Posterior| posterior.sets.iter().map(|(_, p)| p).sum::<f64>() + posterior.unknown();
        prop_assert!((shares(&strong) - 1.0).abs() < 1e-9);
    }

    /// Nobody knows the scale of the noise: where all residuals are so many times as large, the sets keep their order.
    #[test]
    fn a_common_factor_changes_no_ranking(table in tables(), numbers in numbers(), times in 0.01..100.0_f64) {
        let mut larger = table.clone();
        larger.rows.iter_mut().for_each(|row| row.cost *= times);
        let shares = [&table, &larger].map(|table| {
            let mut all: Vec<(usize, f64)> =
                weighed(table, &numbers, &[]).into_iter().map(|one| (one.row, one.share)).collect();
            all.sort_by_key(|(row, _)| *row);
            all
        });
        for (one, other) in shares[0].iter().zip(&shares[1]) {
            prop_assert!((one.1 - other.1).abs() < 1e-9, "{one:?} {other:?}");
        }
    }
}

fn shipped(table: &EvidenceTable) -> Posterior {
    Posterior::new(table, &Hyperparameters::shipped(), &[])
}

#[test]
fn a_set_that_explains_most_of_the_gap_is_named_though_it_leaves_much() {
    let rows = vec![row(&["backlash"], 8000.0), row(&["lvdt_bias"], 20_000.0), row(&[], 26_000.0)];
    let table = table(1600.0, rows);
    let posterior = shipped(&table);
    assert!(posterior.inclusion(&table, "backlash") > 0.8, "{posterior:?}");
}

#[test]
fn a_set_that_explains_little_of_a_large_gap_is_no_cause() {
    let rows = vec![row(&["backlash"], 24_000.0), row(&[], 26_000.0)];
    assert!(shipped(&table(1600.0, rows)).unknown() > 0.9);
}

#[test]
fn equations_that_are_a_little_wrong_are_no_fault() {
    let rows = vec![row(&["backlash"], 2600.0), row(&[], 2610.0)];
    let table = table(1600.0, rows);
    assert!(shipped(&table).nothing(&table) > 0.7, "{:?}", shipped(&table));
}

/// What is small in all and stands out somewhere is something unknown.
#[test]
fn a_distortion_is_not_nothing() {
    let of = |p_value: f64| {
        let mut table = table(1600.0, vec![row(&["backlash"], 1500.0), row(&[], 1510.0)]);
        table.rows[1].distortion = Some(distortion(p_value));
        shipped(&table)
    };
    assert!(of(0.01).unknown() < 0.1, "{:?}", of(0.01));
    assert!(of(1e-7).unknown() > 0.9, "{:?}", of(1e-7));
}

/// Something unknown is looked for where the known effects act that come nearest to it, and elsewhere with a small probability.
#[test]
fn the_unknown_is_placed_beside_the_nearest_effects() {
    let table = table(1600.0, vec![row(&["spool_friction"], 20_000.0), row(&["load"], 21_000.0), row(&[], 22_000.0)]);
    let posterior = shipped(&table);
    let at = |stage: &str| posterior.unknown.iter().find(|(id, _)| id == stage).unwrap().1 / posterior.unknown();
    assert!(posterior.unknown() > 0.9 && at("spool") > 0.9 && at("esv") > 0.005, "{:?}", posterior.unknown);
}

/// Of a stage alone with a data sheet what fits better and predicts worse what was left out of the fit is not the likelier.
#[test]
fn pieces_left_out_count() {
    let of = |square: f64| {
        let left_out = |square, row| EvidenceRow { left_out_square: Some(square), ..row };
        let rows = vec![left_out(square, row(&["load"], 100.0)), left_out(1e-6, row(&[], 118.0))];
        let stage_alone = Some(StageEvidence { sheet: true, pieces: 6 });
        let table = EvidenceTable { stage_alone, ..table(100.0, rows) };
        let posterior = shipped(&table);
        posterior.nothing(&table) / posterior.inclusion(&table, "load")
    };
    assert!(of(2e-5) > 10.0 * of(1e-6), "{} {}", of(1e-6), of(2e-5));
}

/// What fits as well with a sheet far off is not all, the more the farther; a sheet within its tolerances is.
#[test]
fn a_stretched_sheet_is_doubted() {
    let of = |strain: f64| {
        let named = EvidenceRow { prior_per_parameter: strain, ..row(&["backlash"], 1600.0) };
        shipped(&table(1600.0, vec![named, row(&[], 9000.0)])).something_else
    };
    assert!(
        of(1.0) < 0.01 && of(1.0) < of(3.0) && of(3.0) < of(13.0) && of(13.0) > 0.8,
        "{} {} {}",
        of(1.0),
        of(3.0),
        of(13.0)
    );
}

/// Where something else is at work, a set that explains most of the gap is a cause beside it, one that explains little is not, and nothing is no cause.
#[test]
fn something_else_acts_beside_what_explains_most() {
    let of = |cost: f64| {
        let named = EvidenceRow { prior_per_parameter: 12.0, ..row(&["backlash"], cost) };
        shipped(&table(1600.0, vec![named, row(&[], 21_500.0)]))
    };
    let [most, half, little] = [4500.0, 11_500.0, 18_000.0].map(of);
    assert!(most.something_else > 0.8 && most.unknown() < 0.05, "{most:?}");
    assert!((0.3..0.6).contains(&half.unknown()), "{half:?}");
    assert!(little.unknown() > 0.8, "{little:?}");
    let nothing = shipped(&table(1600.0, vec![row(&[], 21_500.0)]));
    assert!((nothing.unknown() - nothing.something_else).abs() < 1e-12 && nothing.unknown() > 0.9, "{nothing:?}");
}

#[test]
fn what_is_struck_is_gone() {
    let table = table(1600.0, vec![row(&["backlash"], 1700.0), row(&["load"], 2000.0), row(&[], 3000.0)]);
    let posterior = Posterior::new(&table, &Hyperparameters::shipped(), &["backlash"]);
    assert_eq!((posterior.sets.len(), posterior.inclusion(&table, "backlash")), (2, 0.0));
}

#[test]
fn nats_count_for_less_where_much_is_left() {
    let counted = |cost: f64| CountedNats::new(&table(1600.0, vec![row(&[], cost)]), &Hyperparameters::shipped());
    assert!(counted(1600.0).of(10.0) > counted(16_000.0).of(10.0) && counted(16_000.0).of(10.0) > 0.0);
    assert!((CountedNats::FULL.of(7.0) - 7.0).abs() < 1e-12);
}
