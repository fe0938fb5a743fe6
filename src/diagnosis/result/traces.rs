//! Curves of recordings. A report holds them as numbers of five digits in one text a curve, since a line for each would fill the file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use govtwin_model::recording::Process;
use govtwin_model::signal::Signal;

/// One recording as it was and as the twins have it, at the rows where something was measured.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(from = "TraceForm", into = "TraceForm")]
pub struct Trace {
    /// Recording.
    pub name: String,
    /// Process.
    pub process: Process,
    /// Time since the first row, s.
    pub time_s: Vec<f64>,
    /// Signals: measured, delivered, refitted, with effects.
    pub signals: Vec<(Signal, [Vec<f64>; 4])>,
}

#[derive(Serialize, Deserialize)]
struct TraceForm {
    recording: String,
    process: Process,
    time_s: String,
    signals: BTreeMap<Signal, [String; 4]>,
    #[serde(default = "curve_titles")]
    curves: [String; 4],
}

fn curve_titles() -> [String; 4] {
    ["measured", "data sheet", "recalibrated", "with faults"].map(str::to_owned)
}

impl From<Trace> for TraceForm {
    fn from(Trace { name, process, time_s, signals }: Trace) -> Self {
        let text = |values: &[f64], decimals: usize| {
            values.iter().map(|value| format!("{value:.decimals$}")).collect::<Vec<_>>().join(" ")
        };
        let of = |(signal, curves): (Signal, [Vec<f64>; 4])| {
            let decimals = if signal.unit() == "pu" { 5 } else { 0 };
            (signal, curves.map(|curve| text(&curve, decimals)))
        };
        let signals = signals.into_iter().map(of).collect();
        Self { recording: name, process, time_s: text(&time_s, 3), signals, curves: curve_titles() }
    }
}

impl From<TraceForm> for Trace {
    fn from(TraceForm { recording: name, process, time_s, signals, .. }: TraceForm) -> Self {
        let numbers = |text: &str| -> Vec<f64> {
            text.split_whitespace().map(|number| number.parse().unwrap_or(f64::NAN)).collect()
        };
        let time_s = numbers(&time_s);
        let of = |(signal, curves): (Signal, [String; 4])| {
            let curve = |text: String| {
                let mut curve = numbers(&text);
                curve.resize(time_s.len(), f64::NAN);
                curve
            };
            (signal, curves.map(curve))
        };
        let signals = signals.into_iter().map(of).collect();
        Self { name, process, time_s, signals }
    }
}
