//! The machine-readable report, `govtwin-diagnosis/1`: the agreed fields first, the evidence behind them below `evidence`.

pub mod curves;
pub mod read;
pub(crate) mod values;

use serde_json::{Value, json};

use crate::diagnosis::model::consistency::Consistency;
use crate::diagnosis::result::StageFigure;
use crate::diagnosis::result::{Diagnosis, Fitted, Interval, SheetLimits, StageOnly};
use crate::effects::Stage;

/// The schema's name.
pub const SCHEMA: &str = "govtwin-diagnosis/1";

/// The file beside the report that holds the best test as a script.
pub const NEXT_TEST: &str = "next_test.mcap";

fn interval(interval: Interval) -> Value {
    json!({"value": interval.value, "ci90": [interval.low, interval.high]})
}

fn parameter(fitted: &Fitted) -> Value {
    json!({
        "name": fitted.name,
        "value": fitted.value.value,
        "ci90": [fitted.value.low, fitted.value.high],
        "unit": fitted.unit,
        "at_bound": fitted.at_bound,
    })
}

/// The report of a diagnosis that took `seconds`, as JSON of the schema [`SCHEMA`]: every figure in the unit that its key names or that stands
/// beside it as `unit`. Numbers that do not exist are null.
#[must_use]
pub fn report(diagnosis: &Diagnosis, seconds: f64) -> Value {
    let stages: serde_json::Map<String, Value> =
        diagnosis.stages.iter().map(|(stage, share)| (stage.id().to_owned(), json!(share))).collect();
    let effects: Vec<Value> = diagnosis
        .blamed
        .iter()
        .map(|blame| {
            json!({
                "id": blame.id,
                "stage": blame.stage.id(),
                "probability": blame.probability,
                "parameters": blame.parameters.iter().map(parameter).collect::<Vec<_>>(),
                "closure": interval(blame.explained_fraction),
                "closure_last_in": blame.last_in,
                "closure_shapley": blame.shapley,
            })
        })
        .collect();
    let ranking: Vec<Value> =
        diagnosis.ranking.iter().map(|one| json!({"id": one.id, "probability": one.probability})).collect();
    let signals: Vec<Value> = diagnosis
        .gap
        .iter()
        .map(|gap| {
            json!({
                "name": gap.signal.id(),
                "noise_floor": gap.noise_floor,
                // A learned residual is no part of a diagnosis; `replay --residual` tells what one leaves on top of `fitted.yaml`.
                "rmse": {
                    "delivered": gap.delivered, "refitted": gap.refitted, "with_effects": gap.with_effects, "with_residual": null,
                },
            })
        })
        .collect();
    let experiments: Vec<Value> = diagnosis
        .experiments
        .iter()
        .enumerate()
        .map(|(place, one)| {
            // The first is written as a bag where a governor can be sent it.
            let bag = one.script.filter(|_| place == 0).map(|_| NEXT_TEST);
            json!({
                "separates": one.separates, "test": one.test, "separation": one.separation,
                "expected_drop_bits": one.expected_drop_bits, "expected_drop_at_most_bits": one.at_most_bits,
                "entropy_bits": one.entropy_bits, "bits_per_minute": one.bits_per_minute,
                "length_s": one.length_s, "trips": one.trips, "unit_state": one.unit_state,
                "record": one.records.iter().map(|signal| signal.id()).collect::<Vec<_>>(), "rate_hz": one.rate_hz,
                "bag": bag,
            })
        })
        .collect();
    json!({
        "schema": SCHEMA,
        "verdict": diagnosis.verdict.id(),
        "judged_by": diagnosis.judged_by.id(),
        "location": {"stage": diagnosis.stage.map(Stage::id), "probability": stages},
        "effects": effects,
        "ranking": ranking,
        "gap": {"signals": signals, "closure": interval(diagnosis.explained_fraction)},
        "fitted_stage": diagnosis.part.as_ref().map(|part| part.figures.iter().map(StageFigure::json).collect::<Vec<_>>()),
        "next_experiment": experiments,
        "sheet": diagnosis.sheet_limits.as_ref().map(SheetLimits::json),
        "seconds": seconds,
        "notes": diagnosis.notes,
        "evidence": evidence(diagnosis),
    })
}

/// What the verdict rests on.
fn evidence(diagnosis: &Diagnosis) -> Value {
    let parameters: Vec<Value> = diagnosis
        .parameters
        .iter()
        .map(|one| {
            json!({
                "key": one.name, "unit": one.unit, "sheet": one.sheet, "value": one.value.value,
                "ci90": [one.value.low, one.value.high], "deviations_from_sheet": one.position,
                "information": one.information, "at_bound": one.at_bound,
            })
        })
        .collect();
    let tried: Vec<Value> = diagnosis
        .tried
        .iter()
        .map(|one| {
            json!({
                "effects": one.ids, "gain": one.gain, "held_out_gain": one.held_out_gain,
                "parameters": one.parameters.iter().map(parameter).collect::<Vec<_>>(),
            })
        })
        .collect();
    let channels: Vec<Value> = diagnosis
        .channels
        .iter()
        .map(|one| {
            json!({
                "recording": one.recording, "signal": one.signal.id(), "samples": one.samples,
                "rate_hz": one.rate_hz, "step": one.step, "noise": one.noise, "troubles": one.troubles,
            })
        })
        .collect();
    let detectable_sizes: Vec<Value> = diagnosis
        .detectable_sizes
        .iter()
        .map(|one| {
            json!({
                "id": one.id, "parameter": one.parameter, "unit": one.unit,
                "smallest": one.smallest, "smallest_with_known_sheet": one.with_known_sheet, "typical": one.typical,
            })
        })
        .collect();
    let breakdowns: Vec<Value> = diagnosis
        .breakdowns
        .iter()
        .map(|breakdown| {
            let parts: Vec<Value> = breakdown
                .parts
                .iter()
                .map(|part| {
                    json!({
                        "name": part.name, "samples": part.samples,
                        "refitted": part.refitted, "with_effects": part.with_effects,
                    })
                })
                .collect();
            json!({"signal": breakdown.signal.id(), "by": breakdown.by, "parts": parts})
        })
        .collect();
    let tests: Vec<Value> = diagnosis
        .stage_tests
        .iter()
        .map(|one| json!({"stage": one.stage, "signal": one.signal.id(), "zero_error_pu": one.zero_error_pu, "rmse": one.rmse, "excess": one.excess}))
        .collect();
    let discrepancy_terms: Vec<Value> = diagnosis
        .discrepancy_terms
        .iter()
        .map(|one| {
            let curves: Vec<Value> = one
                .curves
                .iter()
                .map(|curve| json!({"against": curve.against, "points": curve.points, "named": curve.named}))
                .collect();
            json!({
                "place": one.place, "stage": one.stage.id(), "unit": one.unit,
                "explains": one.explains, "curves": curves,
            })
        })
        .collect();
    let ambiguous_pairs: Vec<Value> = diagnosis
        .ambiguous_pairs
        .iter()
        .map(|(a, b, likeness)| json!({"a": a, "b": b, "likeness": likeness}))
        .collect();
    let transfers: Vec<Value> = diagnosis
        .transfers
        .iter()
        .map(|one| json!({"recording": one.recording, "closure": interval(one.explained_fraction)}))
        .collect();
    let sets: Vec<Value> =
        diagnosis.sets.iter().map(|(effects, p)| json!({"effects": effects, "probability": p})).collect();
    json!({
        "innovations": innovations(diagnosis),
        "values": diagnosis.samples, "entropy_bits": diagnosis.entropy_bits, "fault_sets": sets, "table": diagnosis.table, "closure_without_recording": transfers,
        "closure_widened_by": diagnosis.explained_fraction_widened_by,
        "parameters": parameters, "tried": tried, "channels": channels, "smallest_visible": detectable_sizes,
        "alike": ambiguous_pairs, "ledgers": breakdowns, "stage_tests": tests, "free_terms": discrepancy_terms,
        "simulations": diagnosis.simulations,
        "servomotor_stage_only": diagnosis.part.as_ref().map(stage_only),
    })
}

/// How the innovations look, of the refitted sheet and of the likeliest fault set.
fn innovations(diagnosis: &Diagnosis) -> Value {
    let of = |one: &Consistency| {
        json!({
            "signal": one.signal.id(), "samples": one.samples,
            "mean_square": one.mean_square, "lag1_correlation": one.correlation,
        })
    };
    let [refitted, likeliest] = diagnosis.consistency.each_ref().map(|all| all.iter().map(of).collect::<Vec<_>>());
    json!({"refitted": refitted, "likeliest": likeliest})
}

/// What to know where the servomotor stage alone was judged.
fn stage_only(part: &StageOnly) -> Value {
    let runs: Vec<Value> = part
        .free_runs
        .iter()
        .map(|run| {
            json!({
                "effects": run.model, "fitted_on": run.fitted_on, "rmse_pu": run.seen, "held_out_rmse_pu": run.held_out,
            })
        })
        .collect();
    json!({
        "data_sheet": part.sheet, "pieces": part.pieces, "piece_s": part.piece_s,
        "transducers_rmse_pu": part.transducers_pu, "of_no_such_stage": part.foreign,
        "free_run_s": part.free_run_s, "free_runs": runs,
    })
}
