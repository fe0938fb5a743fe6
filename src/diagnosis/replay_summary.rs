//! The figures of a replay for machines: the schema `govtwin-replay/1`.
//!
//! ```json
//! {"schema": "govtwin-replay/1",
//!  "program": "govtwin 0.1.0", "provenance": {"date": "2026-11-24T08:54:27Z", "recordings": […], "sheet": {…}, …},
//!  "parameters": {"name": "…", "files": ["unit.yaml"],
//!                 "changed": {"oil.bulk_modulus_pa": 1.1e9}, "effects": [{"id": "backlash", "parameters": {"play_pu": 0.002}}]},
//!  "cut": "none", "inputs_between_samples": "hold",
//!  "recordings": [{"name": "startup_01", "path": "bags/startup_01.mcap", "bytes": 121174, "origin": "…",
//!                  "process": "startup", "rows": 1250, "start_ns": 1780008000000000000, "duration_s": 249.8,
//!                  "warnings": ["…"], "notes": ["…"], "signals": [SIGNAL, …]}],
//!  "processes": [{"process": "startup", "recordings": 4, "signals": [SIGNAL, …]}],
//!  "overall": {"recordings": 16, "signals": [SIGNAL, …]},
//!  "residual": {"model": "model.residual", "guard": {"rows": 23293, "clamped": 0, "faded": 3, "shrunk": 0, "outside": 0, "bad": 0},
//!               "adaptation": {"samples": 23293, "alarms": 1, "first_alarm_ns": 1780008000000000000, "adapted": 9000, "by_leaves": 0, "clamped": 0, "bias": 0.003,
//!                              "gain_ratio": 0.01}, "processes": […], "overall": {…}},
//!  "ladder": {"signal": "spool_position_pu", "findings": ["…"],
//!             "rungs": [{"title": "fitted.yaml", "model": null, "unseen": [], "processes": […], "overall": {…}}]},
//!  "validation": {"passed": false, "checks": [CHECK, …]},
//!  "provenance": {"program": "govtwin 0.1.0", "command": "replay", "date": "2026-01-31T12:00:00Z", "unit": "unit 2",
//!                 "recordings": [{"name": "startup_01", "files": [{"path": "bags/startup_01.mcap", "bytes": 121174, "sha256": "…"}],
//!                                 "synthetic": true, "origin": "…", "left_out": null}],
//!                 "sheet": {"name": "unit 2", "files": […], "sha256": "…"}, "options": {"cut": "none", "rate-of-inputs": "hold"},
//!                 "seed": null, "warnings": []}}
//! ```
//!
//! A SIGNAL is `{"name": "spool_position_pu", "unit": "pu", "stands_in": false, "rows": 1250,
//! "left_out": 0, "mae": …, "rmse": …, "r2": …, "bias": …, "max_abs": …}`: figures of
//! [`govtwin_model::metrics`] in the unit, `null` where the data do not determine it or the signal replaces the simulated one at the
//! cut. `bias` is simulated − measured. Figures of processes and overall are over all their rows.
//! `residual` is there where a learned residual corrected the twin; its groups are the corrected figures;
//! `adaptation` is `null` where it did not adapt.
//! `ladder` is there where further units or residuals were given; its groups are the figures of each.
//! `validation` is there where limits or a baseline were given. A CHECK is `{"limit": "spool.rmse<=0.5%", "of": "startup_01", "signal":
//! "spool_position_pu", "measure": "rmse", "value": 0.0062, "side": "at_most", "bound": 0.005, "unit": "pu", "standing": "fails", "stretch":
//! {"from_s": 12.5, "to_s": 14.5}}`; with a residual it judges the corrected figures. `standing` is `passes`, `fails` or `not_measured`, which has a `reason`.
//! `changed` holds what differs from the shipped unit. `origin` is the origin of the data
//! that the bag's folder states, `null` if it states none. `provenance` is
//! [`govtwin_model::provenance::Provenance`]. Keys may be added to a version, and never change their meaning. The same bags and
//! parameters give the same bytes but for the date in `provenance`.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::replay_validation::Validation;
use govtwin_correction::adapt::Adaptation;
use govtwin_correction::guard::GuardCounts;
use govtwin_model::effects;
use govtwin_model::parameters::{ENTRIES, EffectSetting, Unit};
use govtwin_model::provenance::Provenance;
use govtwin_model::recording::Process;
use govtwin_model::replay::figures::{RecordingGroup, SignalFigures};
use govtwin_model::replay::ladder::Ladder;
use govtwin_model::replay::{Replayed, Scores, stands_in};
use govtwin_model::signal::Signal;
use govtwin_model::twin::Cut;

/// Name and version of the schema.
pub const SCHEMA: &str = "govtwin-replay/1";

/// All figures of one replay.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReplaySummary {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Program and version.
    pub program: &'static str,
    /// What the figures were made from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
    /// What was simulated.
    pub parameters: ParameterDifferences,
    /// Name of the cut.
    pub cut: &'static str,
    /// `hold`, `linear`, or `as_recorded`: held where rows are close, else straight with trips when the unit moved.
    pub inputs_between_samples: &'static str,
    /// Recording by recording, in the order given.
    pub recordings: Vec<RecordingFigures>,
    /// Process by process, those that occur.
    pub processes: Vec<RecordingGroup>,
    /// Everything.
    pub overall: RecordingGroup,
    /// The same with a learned residual.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual: Option<Residual>,
    /// Further units and residuals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ladder: Option<Ladder>,
    /// Limits that the figures were held against.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validation: Option<Validation>,
}

/// Figures with a learned residual on top of the twin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Residual {
    /// The model's file as given.
    pub model: String,
    /// What its guard did.
    pub guard: GuardCounts,
    /// What its adaptation to drift did, `null` where it did not adapt.
    pub adaptation: Option<Adaptation>,
    /// Process by process, those that occur.
    pub processes: Vec<RecordingGroup>,
    /// Everything.
    pub overall: RecordingGroup,
}

/// The unit that was simulated, as its difference from the shipped one.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ParameterDifferences {
    /// What its file calls it.
    pub name: String,
    /// The files that it was merged from; none for the shipped unit.
    pub files: Vec<String>,
    /// Values that differ from the shipped unit, by dotted key.
    pub changed: BTreeMap<&'static str, f64>,
    /// Effects beyond the nominal model.
    pub effects: Vec<Effect>,
}

impl ParameterDifferences {
    /// Compares a unit with the shipped one.
    pub fn new(name: String, files: Vec<String>, unit: &Unit, shipped: &Unit) -> Self {
        let changed = ENTRIES
            .iter()
            .map(|entry| (entry.key, (entry.get)(&unit.parameters), (entry.get)(&shipped.parameters)))
            .filter(|(_, own, other)| own.to_bits() != other.to_bits())
            .map(|(key, own, _)| (key, own))
            .collect();
        let effect = |effect: &EffectSetting| {
            let names = effects::find_in(unit, &effect.id).map(|spec| spec.parameters).unwrap_or_default();
            let named = names.iter().map(|parameter| parameter.name).zip(effect.values.iter().copied());
            Effect { id: effect.id.clone(), parameters: named.collect() }
        };
        Self { name, files, changed, effects: unit.effects.iter().map(effect).collect() }
    }
}

/// An effect that was switched on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Effect {
    /// Its id in the catalogue.
    pub id: String,
    /// Its parameters by name, with their units in it.
    pub parameters: BTreeMap<&'static str, f64>,
}

/// The source of a recording, and the warnings of its reader.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordingSource {
    /// The path as given.
    pub path: String,
    /// Size of its files.
    pub bytes: u64,
    /// What its folder says of where the data comes from.
    pub origin: Option<String>,
    /// What a user should read.
    pub warnings: Vec<String>,
    /// What a reader of results should know besides.
    pub notes: Vec<String>,
}

/// Figures of one recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordingFigures {
    /// Its name.
    pub name: String,
    /// The path as given.
    pub path: String,
    /// Size of its files.
    pub bytes: u64,
    /// What its folder says of where the data comes from.
    pub origin: Option<String>,
    /// Id of its process.
    pub process: &'static str,
    /// Frames.
    pub rows: usize,
    /// Time of the first frame, ns.
    pub start_ns: i64,
    /// From the first to the last frame, s.
    pub duration_s: f64,
    /// What a user should read.
    pub warnings: Vec<String>,
    /// What a reader of results should know besides; none of it speaks against them.
    pub notes: Vec<String>,
    /// Figures, signal by signal.
    pub signals: Vec<SignalFigures>,
}

/// Pools recordings into groups.
pub fn summarise(
    parameters: ParameterDifferences,
    cut: Cut,
    inputs_between_samples: &'static str,
    replayed: &[(&Replayed, &RecordingSource)],
) -> ReplaySummary {
    let group = |process: Option<Process>| {
        let mut scores = Scores::default();
        let mut recordings = 0;
        for (one, _) in replayed {
            if process.is_none_or(|process| one.recording.process == process) {
                scores.merge(&one.scores);
                recordings += 1;
            }
        }
        RecordingGroup { process: process.map(Process::id), recordings, signals: signals(&scores, cut) }
    };
    let recorded = |(one, from): &(&Replayed, &RecordingSource)| RecordingFigures {
        name: one.recording.name.clone(),
        path: from.path.clone(),
        bytes: from.bytes,
        origin: from.origin.clone(),
        process: one.recording.process.id(),
        rows: one.rows,
        start_ns: one.recording.frames.first().map_or(0, |frame| frame.time_ns),
        duration_s: one.recording.duration_s(),
        warnings: from.warnings.clone(),
        notes: from.notes.clone(),
        signals: signals(&one.scores, cut),
    };
    ReplaySummary {
        schema: SCHEMA,
        program: concat!("govtwin ", env!("CARGO_PKG_VERSION")),
        provenance: None,
        parameters,
        cut: cut_id(cut),
        inputs_between_samples,
        recordings: replayed.iter().map(recorded).collect(),
        processes: Process::ALL.into_iter().map(|p| group(Some(p))).filter(|group| group.recordings > 0).collect(),
        overall: group(None),
        residual: None,
        ladder: None,
        validation: None,
    }
}

/// The name of a cut on the command line and in figures.
pub fn cut_id(cut: Cut) -> &'static str {
    match cut {
        Cut::None => "none",
        Cut::Servomotor => "servomotor",
        Cut::Spool => "spool",
    }
}

fn signals(scores: &Scores, cut: Cut) -> Vec<SignalFigures> {
    let one = |signal: Signal| {
        let figures = scores.figures(signal);
        let stands_in = stands_in(cut) == Some(signal);
        let judged = |value: f64| if stands_in { f64::NAN } else { value };
        SignalFigures {
            name: signal.id(),
            unit: signal.unit(),
            stands_in,
            rows: figures.count,
            left_out: figures.skipped,
            mae: judged(figures.mae),
            rmse: judged(figures.rmse),
            r2: judged(figures.r2),
            bias: judged(figures.bias),
            max_abs: judged(figures.max_abs),
        }
    };
    Signal::ALL.into_iter().map(one).collect()
}
