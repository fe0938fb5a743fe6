//! Limits and stored baselines of a replay, tried.

use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::params::reference;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::replay::replay;
use govtwin_model::signal::Signal;
use govtwin_model::twin::{Cut, Twin};

use super::{Baseline, Measure, RequiredLimit, Side, Standing, Stretch, validate};
use crate::replay_summary::{ParameterDifferences, RecordingSource, ReplaySummary, summarise};

/// A replay of the twin against itself with an offset of the servomotor transducer, pu, from the second row on: the first one places the twin.
fn replayed(name: &str, offset_pu: f64) -> ReplaySummary {
    let mut twin = Twin::new(&reference());
    let frame = |row: i64| {
        let inputs =
            Inputs { opening_command_pu: 0.4, esv: EsvState::Normal, tank_pressure_pa: 6.0e6, piston_force_n: 0.0 };
        Frame { time_ns: row * 10_000_000, inputs, measured: Signals::NONE }
    };
    let mut frames: Vec<Frame> = (0..50).map(frame).collect();
    for (row, frame) in frames.iter_mut().enumerate() {
        let offset_pu = if row == 0 { 0.0 } else { offset_pu };
        frame.measured.servomotor_position_pu = twin.step(frame).signals.servomotor_position_pu + offset_pu;
    }
    let replayed = replay(&reference(), Recording::new(name, frames));
    let source = RecordingSource::default();
    summarise(ParameterDifferences::default(), Cut::None, "hold", &[(&replayed, &source)])
}

fn limit(text: &str) -> RequiredLimit {
    text.parse().unwrap()
}

fn json(summary: &ReplaySummary) -> Vec<u8> {
    serde_json::to_vec(summary).unwrap()
}

#[test]
fn a_limit_is_read_with_its_unit() {
    let read = limit("load_rejection.servomotor.max <= 1 %");
    assert_eq!(
        (read.process, read.signal, read.measure, read.side),
        (Some(Process::LoadRejection), Signal::ServomotorPosition, Measure::Max, Side::AtMost)
    );
    for (text, bound) in [
        ("spool.rmse<=0.5%", 0.005),
        ("spool_position_pu.mae<=5e-3pu", 0.005),
        ("spool.bias<=0.005", 0.005),
        ("control_pressure.rmse<=1.5 bar", 1.5e5),
        ("control_pressure.rmse<=2e-1MPa", 2e5),
        ("shutdown.spool.r2>=0.98", 0.98),
    ] {
        assert!((limit(text).bound - bound).abs() < 1e-12 * bound.max(1.0), "{text}");
    }
}

#[test]
fn a_slip_in_a_limit_is_named() {
    for (text, named) in [
        ("spool.rmse<0.5%", "<="),
        ("spol.rmse<=0.5%", "`spol`"),
        ("spool.rms<=0.5%", "`rms`"),
        ("run.spool.rmse<=0.5%", "`run`"),
        ("rmse<=0.5%", "1 names"),
        ("spool.rmse<=much%", "much%"),
        ("spool.rmse<=0.5kPa", "`kPa`"),
        ("spool.rmse<=-1%", "-1%"),
        ("spool.rmse<=NaN", "NaN"),
        ("spool.r2>=98%", "`%`"),
        ("control_pressure.rmse<=1%", "`%`"),
    ] {
        let error = text.parse::<RequiredLimit>().unwrap_err().to_string();
        assert!(error.contains(named) && error.contains(text), "{text}: {error}");
    }
}

#[test]
fn figures_are_held_against_limits_and_the_worst_stretch_of_those_that_fail_is_found() {
    let summary = replayed("offset", 0.01);
    let at = Stretch { from_s: 0.1, to_s: 0.2 };
    let judge = |text: &str| validate(&summary, &[limit(text)], None, |_, _| Some(at)).checks.remove(0);
    let kept = judge("servomotor.max<=1.1%");
    assert_eq!((kept.standing, kept.stretch, kept.of.as_str()), (Standing::Passes, None, "offset"));
    assert!((kept.value - 0.01).abs() < 1e-9);
    let broken = judge("servomotor.bias<=0.9%");
    assert_eq!((broken.standing, broken.stretch), (Standing::Fails, Some(at)));
    // What no recording shows is not taken for right.
    assert_eq!(judge("spool.rmse<=50%").standing, Standing::NotMeasured);
    assert_eq!(judge("startup.servomotor.rmse<=50%").standing, Standing::NotMeasured);
    assert!(!validate(&summary, &[limit("spool.rmse<=50%")], None, |_, _| None).passed);
}

#[test]
fn a_replay_is_no_worse_than_itself_and_worse_than_a_better_one() {
    let (good, bad) = (replayed("same", 0.010), replayed("same", 0.012));
    let baseline = |summary: &ReplaySummary| Baseline::read(&json(summary)).unwrap();
    for worse_by in [0.0, 0.01, 10.0] {
        let validation = validate(&good, &[], Some((&baseline(&good), worse_by)), |_, _| None);
        assert!(validation.passed && validation.checks.len() == 9, "{validation:?}");
    }
    assert!(validate(&good, &[], Some((&baseline(&bad), 0.0)), |_, _| None).passed, "better is no failure");
    assert!(validate(&bad, &[], Some((&baseline(&good), 0.21)), |_, _| None).passed);
    let worse = validate(&bad, &[], Some((&baseline(&good), 0.19)), |_, _| None);
    assert_eq!(worse.broken().count(), 9, "MAE, RMSE and largest error of recording, process and overall");
}

#[test]
fn a_process_that_the_baseline_has_and_the_replay_lacks_fails() {
    let good = replayed("same", 0.01);
    let mut text: serde_json::Value = serde_json::from_slice(&json(&good)).unwrap();
    let mut process = text["processes"][0].clone();
    process["process"] = "shutdown".into();
    text["processes"].as_array_mut().unwrap().push(process);
    let baseline = Baseline::read(text.to_string().as_bytes()).unwrap();
    let validation = validate(&good, &[], Some((&baseline, 1.0)), |_, _| None);
    assert!(validation.broken().all(|check| check.of == "shutdown" && check.standing == Standing::NotMeasured));
    assert!(!validation.passed);
}

#[test]
fn a_baseline_that_was_made_otherwise_is_refused() {
    let text = json(&replayed("same", 0.01));
    let refused = |cut, inputs, corrected| {
        Baseline::read(&text).unwrap().of_replay(cut, inputs, corrected).unwrap_err().to_string()
    };
    assert!(refused("spool", "hold", false).contains("--cut"));
    assert!(refused("none", "linear", false).contains("--rate-of-inputs"));
    assert!(refused("none", "hold", true).contains("--residual"));
    assert!(Baseline::read(b"{}").unwrap_err().to_string().contains("replay.json"));
}
