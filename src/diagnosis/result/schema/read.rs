//! A diagnosis read back from its report, as far as a page shows it.

use serde_json::Value;

use super::curves::trace;
use super::values::{ReadError, count, in_order, interval, lasting, number, rows, signal, text, texts};
use super::{NEXT_TEST, SCHEMA};
use crate::diagnosis::hypotheses::table::EvidenceTable;
use crate::diagnosis::model::discrepancy::Curve;
use crate::diagnosis::result::StageFigure;
use crate::diagnosis::result::test_script::{CommandShape, TestScript};
use crate::diagnosis::result::{
    Blame, Breakdown, BreakdownPart, ChannelReport, DetectableSize, Diagnosis, DiscrepancyTerm, Experiment, Fitted,
    FreeRun, JudgedBy, Ranked, SheetLimits, SheetValue, SignalGap, StageOnly, StageTest, Transfer, Tried, Verdict,
};
use crate::effects::Stage;
use crate::parameters::{ChannelReadings, Parameters, Sensors, Unit};

/// The diagnosis of a report. What pages do not show is left empty: the units, and the innovations.
///
/// # Errors
/// Where it is no report of this schema, or a verdict, stage or signal in it is none that is known.
pub fn read(report: &Value) -> Result<Diagnosis, ReadError> {
    let schema = text(&report["schema"]);
    if schema != SCHEMA {
        return Err(ReadError::Schema(schema));
    }
    let evidence = &report["evidence"];
    let location = &report["location"];
    let empty = Unit {
        parameters: Parameters::default(),
        tolerances: vec![],
        sensors: Sensors::default(),
        effects: vec![],
        own_effects: vec![],
        recorded: ChannelReadings::default(),
    };
    let stage_of = |value: &Value| if value.is_null() { Ok(None) } else { stage(value).map(Some) };
    let stages = location["probability"].as_object().into_iter().flatten();
    Ok(Diagnosis {
        verdict: verdict(&report["verdict"])?,
        // Reports of before it was said are by a data sheet.
        judged_by: JudgedBy::ALL.into_iter().find(|one| report["judged_by"] == one.id()).unwrap_or_default(),
        stage: stage_of(&location["stage"])?,
        stages: stages
            .map(|(id, share)| Ok((stage(&Value::from(id.as_str()))?, number(share))))
            .collect::<Result<Vec<_>, ReadError>>()
            .map(in_order)?,
        blamed: rows(&report["effects"]).map(blame).collect::<Result<_, _>>()?,
        ranking: rows(&report["ranking"])
            .map(|one| Ranked { id: text(&one["id"]), probability: number(&one["probability"]) })
            .collect(),
        gap: rows(&report["gap"]["signals"]).map(gap).collect::<Result<_, _>>()?,
        explained_fraction: interval(&report["gap"]["closure"]),
        explained_fraction_widened_by: number(&evidence["closure_widened_by"]),
        experiments: rows(&report["next_experiment"]).map(experiment).collect::<Result<_, _>>()?,
        entropy_bits: number(&evidence["entropy_bits"]),
        refitted: empty.clone(),
        fitted: empty,
        parameters: rows(&evidence["parameters"]).map(of_sheet).collect(),
        channels: rows(&evidence["channels"]).map(channel).collect::<Result<_, _>>()?,
        detectable_sizes: rows(&evidence["smallest_visible"]).map(detectable_sizes).collect(),
        sheet_limits: Some(&report["sheet"]).filter(|limits| !limits.is_null()).map(sheet_limits),
        ambiguous_pairs: rows(&evidence["alike"])
            .map(|one| (text(&one["a"]), text(&one["b"]), number(&one["likeness"])))
            .collect(),
        breakdowns: rows(&evidence["ledgers"]).map(breakdown).collect::<Result<_, _>>()?,
        stage_tests: rows(&evidence["stage_tests"]).map(stage_test).collect::<Result<_, _>>()?,
        discrepancy_terms: rows(&evidence["free_terms"]).map(discrepancy_term).collect::<Result<_, _>>()?,
        tried: rows(&evidence["tried"]).map(tried).collect(),
        transfers: rows(&evidence["closure_without_recording"])
            .map(|one| Transfer { recording: text(&one["recording"]), explained_fraction: interval(&one["closure"]) })
            .collect(),
        sets: rows(&evidence["fault_sets"]).map(|one| (texts(&one["effects"]), number(&one["probability"]))).collect(),
        table: serde_json::from_value::<EvidenceTable>(evidence["table"].clone()).unwrap_or_default(),
        consistency: [Vec::new(), Vec::new()],
        samples: count(&evidence["values"]),
        traces: rows(&evidence["traces"]).map(trace).collect::<Result<_, _>>()?,
        part: Some(&evidence["servomotor_stage_only"])
            .filter(|part| !part.is_null())
            .map(|part| stage_only(part, &report["fitted_stage"])),
        notes: texts(&report["notes"]),
        simulations: count(&evidence["simulations"]),
    })
}

fn verdict(value: &Value) -> Result<Verdict, ReadError> {
    let found = text(value);
    let known = Verdict::ALL.into_iter().find(|one| one.id() == found);
    known.ok_or_else(|| ReadError::Word { place: "verdict", expected: Verdict::all_words().into(), found })
}

fn stage(value: &Value) -> Result<Stage, ReadError> {
    let found = text(value);
    Stage::with_id(&found).ok_or(ReadError::Word { place: "stage", expected: "a stage of the chain".into(), found })
}

fn parameter(value: &Value) -> Fitted {
    Fitted {
        name: text(&value["name"]),
        unit: lasting(&value["unit"]),
        value: interval(value),
        sheet: f64::NAN,
        position: f64::NAN,
        information: f64::NAN,
        at_bound: value["at_bound"].as_bool().unwrap_or_default(),
    }
}

fn of_sheet(value: &Value) -> Fitted {
    Fitted {
        name: text(&value["key"]),
        sheet: number(&value["sheet"]),
        position: number(&value["deviations_from_sheet"]),
        information: number(&value["information"]),
        ..parameter(value)
    }
}

fn blame(value: &Value) -> Result<Blame, ReadError> {
    Ok(Blame {
        id: text(&value["id"]),
        stage: stage(&value["stage"])?,
        probability: number(&value["probability"]),
        parameters: rows(&value["parameters"]).map(parameter).collect(),
        explained_fraction: interval(&value["closure"]),
        last_in: value["closure_last_in"].as_f64(),
        shapley: value["closure_shapley"].as_f64(),
    })
}

fn gap(value: &Value) -> Result<SignalGap, ReadError> {
    let rmse = &value["rmse"];
    Ok(SignalGap {
        signal: signal(&value["name"])?,
        noise_floor: number(&value["noise_floor"]),
        delivered: number(&rmse["delivered"]),
        refitted: number(&rmse["refitted"]),
        with_effects: number(&rmse["with_effects"]),
    })
}

fn experiment(value: &Value) -> Result<Experiment, ReadError> {
    // Of the script a page says only that there is one; it stands beside the report.
    let script = (value["bag"] == NEXT_TEST).then(|| TestScript {
        start_pu: f64::NAN,
        shape: CommandShape::Trip { by_pu: 0.0 },
        length_s: number(&value["length_s"]),
    });
    Ok(Experiment {
        separates: texts(&value["separates"]),
        test: text(&value["test"]),
        separation: number(&value["separation"]),
        expected_drop_bits: number(&value["expected_drop_bits"]),
        at_most_bits: number(&value["expected_drop_at_most_bits"]),
        entropy_bits: number(&value["entropy_bits"]),
        bits_per_minute: number(&value["bits_per_minute"]),
        length_s: number(&value["length_s"]),
        trips: u32::try_from(count(&value["trips"])).unwrap_or_default(),
        unit_state: text(&value["unit_state"]),
        records: rows(&value["record"]).map(signal).collect::<Result<_, _>>()?,
        rate_hz: number(&value["rate_hz"]),
        script,
    })
}

fn channel(value: &Value) -> Result<ChannelReport, ReadError> {
    Ok(ChannelReport {
        recording: text(&value["recording"]),
        signal: signal(&value["signal"])?,
        samples: count(&value["samples"]),
        rate_hz: number(&value["rate_hz"]),
        step: number(&value["step"]),
        noise: number(&value["noise"]),
        troubles: texts(&value["troubles"]),
    })
}

fn detectable_sizes(value: &Value) -> DetectableSize {
    DetectableSize {
        id: lasting(&value["id"]),
        parameter: lasting(&value["parameter"]),
        unit: lasting(&value["unit"]),
        // JSON knows no infinity.
        smallest: value["smallest"].as_f64().unwrap_or(f64::INFINITY),
        with_known_sheet: value["smallest_with_known_sheet"].as_f64().unwrap_or(f64::INFINITY),
        typical: number(&value["typical"]),
    }
}

fn sheet_limits(value: &Value) -> SheetLimits {
    let hides = |one: &Value| (text(&one["id"]), number(&one["sharper"]));
    let of = |one: &Value| SheetValue {
        key: text(&one["key"]),
        unit: lasting(&one["unit"]),
        sheet: number(&one["sheet"]),
        tolerance: (number(&one["tolerance"][0]), number(&one["tolerance"][1])),
        information: number(&one["information"]),
        bits: number(&one["bits"]),
        hides: rows(&one["hides"]).map(hides).collect(),
    };
    let look_up = value["look_up"].as_str().map(str::to_owned);
    SheetLimits { open_bits: number(&value["open_bits"]), look_up, values: rows(&value["values"]).map(of).collect() }
}

fn breakdown(value: &Value) -> Result<Breakdown, ReadError> {
    let part = |part: &Value| BreakdownPart {
        name: text(&part["name"]),
        samples: count(&part["samples"]),
        refitted: number(&part["refitted"]),
        with_effects: number(&part["with_effects"]),
    };
    let parts = rows(&value["parts"]).map(part).collect();
    Ok(Breakdown { signal: signal(&value["signal"])?, by: lasting(&value["by"]), parts })
}

fn stage_test(value: &Value) -> Result<StageTest, ReadError> {
    Ok(StageTest {
        stage: lasting(&value["stage"]),
        signal: signal(&value["signal"])?,
        zero_error_pu: number(&value["zero_error_pu"]),
        rmse: number(&value["rmse"]),
        excess: number(&value["excess"]),
    })
}

fn discrepancy_term(value: &Value) -> Result<DiscrepancyTerm, ReadError> {
    let points = |value: &Value| rows(value).map(|point| (number(&point[0]), number(&point[1]))).collect();
    let curve = |curve: &Value| Curve {
        against: lasting(&curve["against"]),
        points: points(&curve["points"]),
        named: points(&curve["named"]),
    };
    Ok(DiscrepancyTerm {
        place: lasting(&value["place"]),
        stage: stage(&value["stage"])?,
        unit: lasting(&value["unit"]),
        explains: number(&value["explains"]),
        curves: rows(&value["curves"]).map(curve).collect(),
    })
}

fn tried(value: &Value) -> Tried {
    Tried {
        ids: texts(&value["effects"]),
        gain: number(&value["gain"]),
        held_out_gain: number(&value["held_out_gain"]),
        parameters: rows(&value["parameters"]).map(parameter).collect(),
    }
}

fn stage_figure(value: &Value) -> StageFigure {
    StageFigure {
        id: lasting(&value["id"]),
        title: lasting(&value["words"]),
        unit: lasting(&value["unit"]),
        value: interval(value),
    }
}

fn stage_only(value: &Value, fitted: &Value) -> StageOnly {
    let run = |run: &Value| FreeRun {
        model: text(&run["effects"]),
        fitted_on: lasting(&run["fitted_on"]),
        seen: number(&run["rmse_pu"]),
        held_out: number(&run["held_out_rmse_pu"]),
    };
    StageOnly {
        sheet: value["data_sheet"].as_bool().unwrap_or_default(),
        pieces: count(&value["pieces"]),
        piece_s: number(&value["piece_s"]),
        figures: rows(fitted).map(stage_figure).collect(),
        transducers_pu: number(&value["transducers_rmse_pu"]),
        foreign: value["of_no_such_stage"].as_str().map(str::to_owned),
        free_run_s: number(&value["free_run_s"]),
        free_runs: rows(&value["free_runs"]).map(run).collect(),
    }
}
