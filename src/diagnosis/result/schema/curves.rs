//! Curves of recordings in a report: numbers of five digits in one text a curve, since a line for each would fill the file.

use serde_json::{Value, json};

use super::values::{ReadError, signal, text};
use crate::diagnosis::result::Trace;
use crate::recording::Process;

/// Traces as a report keeps them.
#[must_use]
pub fn traces(traces: &[Trace]) -> Value {
    let numbers = |values: &[f64], decimals: usize| {
        values.iter().map(|value| format!("{value:.decimals$}")).collect::<Vec<_>>().join(" ")
    };
    let one = |trace: &Trace| {
        let signals: serde_json::Map<String, Value> = trace
            .signals
            .iter()
            .map(|(signal, curves)| {
                let decimals = if signal.unit() == "pu" { 5 } else { 0 };
                (signal.id().to_owned(), curves.iter().map(|curve| numbers(curve, decimals)).collect())
            })
            .collect();
        json!({
            "recording": trace.name, "process": trace.process.id(), "time_s": numbers(&trace.time_s, 3), "signals": signals,
            "curves": ["measured", "data sheet", "recalibrated", "with faults"],
        })
    };
    traces.iter().map(one).collect()
}

/// A trace of a report.
///
/// # Errors
/// On a signal that is not known.
pub fn trace(value: &Value) -> Result<Trace, ReadError> {
    let numbers = |value: &Value| -> Vec<f64> {
        let text = value.as_str().unwrap_or_default();
        text.split_whitespace().map(|number| number.parse().unwrap_or(f64::NAN)).collect()
    };
    let found = text(&value["process"]);
    let process = Process::ALL.into_iter().find(|process| process.id() == found);
    let process =
        process.ok_or(ReadError::Word { place: "evidence.traces.process", expected: "a process".into(), found })?;
    let time_s = numbers(&value["time_s"]);
    let mut signals = Vec::new();
    for (id, curves) in value["signals"].as_object().into_iter().flatten() {
        let mut all: [Vec<f64>; 4] = std::array::from_fn(|which| numbers(&curves[which]));
        for curve in &mut all {
            curve.resize(time_s.len(), f64::NAN);
        }
        signals.push((signal(&Value::from(id.as_str()))?, all));
    }
    signals.sort_by_key(|(signal, _)| *signal as usize);
    Ok(Trace { name: text(&value["recording"]), process, time_s, signals })
}
