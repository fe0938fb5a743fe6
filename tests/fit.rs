//! Fits: planted parameters come back within their intervals.

use govtwin_diagnosis::estimation::coordinate::square;
use govtwin_diagnosis::generate::{Scenario, recording, spread};
use govtwin_diagnosis::identification::calibration::{Calibration, calibrate};
use govtwin_diagnosis::identification::free_parameter::FreeParameter;
use govtwin_diagnosis::likelihood::noise;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::likelihood::problem::Problem;
use govtwin_model::frame::Estimate;
use govtwin_model::parameters::{ENTRIES, EffectSetting, Unit};
use govtwin_model::params;
use govtwin_model::recording::Process;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Twin;

/// The unit with one effect more.
fn with_effect(unit: &Unit, id: &str, value: f64) -> Unit {
    let mut unit = unit.clone();
    unit.effects.push(EffectSetting { id: id.to_owned(), values: vec![value] });
    unit
}

/// A unit within tolerance with one effect, and its recordings.
fn plant(effect: &str, value: f64, seed: u64) -> (Unit, Vec<PreparedRecording>) {
    let unit = with_effect(&spread(&params::reference(), seed), effect, value);
    let record = |process| {
        recording(&Scenario { unit: unit.clone(), process, rate_hz: 100.0, duration_s: 30.0, rich: false, seed })
    };
    let recordings = Process::ALL.into_iter().map(|process| PreparedRecording::new(record(process))).collect();
    (unit, recordings)
}

/// The shipped sheet with the effect fitted to recordings.
fn fitted(effect: &str, recordings: Vec<PreparedRecording>) -> Calibration {
    let spec = govtwin_model::effects::find(effect).unwrap();
    let base = with_effect(&params::reference(), effect, spec.parameters[0].neutral);
    let mut free_parameters = FreeParameter::nuisances(&base);
    free_parameters.push(FreeParameter::Effect { effect: 0, parameter: 0, spec: &spec.parameters[0] });
    let noise = noise::expected(&base.sensors);
    calibrate(recordings, &base, free_parameters, &noise, 1, &|| {}).1
}

#[test]
fn a_simulation_without_numbers_is_the_worst_of_all() {
    let (unit, mut recordings) = plant("backlash", 0.0, 7);
    recordings.truncate(1);
    let problem = Problem::new(recordings, &unit, &noise::expected(&unit.sensors));
    let costs: Vec<f64> =
        problem.residuals_of(&[unit.clone(), with_effect(&unit, "load", f64::NAN)]).iter().map(square).collect();
    assert!(costs[1].is_finite() && costs[1] > 1e6 * costs[0], "{costs:?}");
}

#[test]
fn planted_parameters_come_back_within_their_intervals() {
    let planted = [("backlash", 0.005, 21), ("feedback_lag", 0.04, 22), ("chamber_leak", 6e-12, 23)];
    let (mut inside, mut all) = (0, 0);
    for (effect, value, seed) in planted {
        let (truth, recordings) = plant(effect, value, seed);
        let fit = fitted(effect, recordings);
        for (row, free_parameter) in fit.rows.iter().zip(&fit.free_parameters) {
            let [low, high] = row.ci90;
            let planted = match *free_parameter {
                FreeParameter::Parameter { index, .. } | FreeParameter::Free { index, .. } => {
                    (ENTRIES[index].get)(&truth.parameters)
                }
                FreeParameter::Effect { .. } => {
                    // Twice the interval: one of three may leave the 90 %.
                    let half = 0.5 * (high - low);
                    assert!((row.fitted - value).abs() < 2.0 * half, "{row:?}, not {value}");
                    assert!(row.learned > 0.95, "{row:?}");
                    value
                }
            };
            println!("{effect} {}: {planted:.4e} in [{low:.4e}, {high:.4e}]", row.key);
            inside += usize::from((low..=high).contains(&planted));
            all += 1;
        }
        let servomotor = fit.leftover[0].unwrap();
        assert!((0.7..1.3).contains(&servomotor), "{effect}: {servomotor} times the noise left over");
        assert!(fit.identifiability().iter().any(|words| words.contains(effect)), "{:?}", fit.identifiability());
    }
    // As many as 90 % intervals hold in 95 of 100 such trials, by the normal approximation of the binomial distribution.
    let (all, inside) = (all as f64, inside as f64);
    let least = 0.9 * all - 1.645 * (all * 0.9 * 0.1).sqrt();
    assert!(inside >= least, "{inside} of {all} within 90 % intervals");
}

#[test]
fn a_free_parameter_moves_as_far_as_the_recordings_say() {
    let mut unit = params::reference();
    unit.parameters.servomotor.load_closed_n *= 2.0;
    let scenario =
        Scenario { unit, process: Process::LoadRejection, rate_hz: 50.0, duration_s: 30.0, rich: false, seed: 5 };
    let base = params::reference();
    let index = ENTRIES.iter().position(|entry| entry.key == "servomotor.load_closed_n").unwrap();
    let noise = noise::expected(&base.sensors);
    let recordings = vec![PreparedRecording::new(recording(&scenario))];
    let (_, fit) = calibrate(recordings, &base, vec![FreeParameter::free(&base, index)], &noise, 2, &|| {});
    let row = &fit.rows[0];
    assert_eq!((row.deviation, row.at_bound), (None, false));
    assert!((row.fitted / 3.0e5 - 1.0).abs() < 0.05, "{row:?}");
}

/// On its stop the spool's control pressure hangs on tenths of a per mille of stroke, which nobody knows.
#[test]
fn a_stop_off_by_less_than_the_transducer_sees_costs_little() {
    let mut unit = params::reference();
    unit.parameters.regulator.current_reference_pu = -0.005;
    unit.parameters.distributing_valve.stop_compliance_m_n = 2e-9;
    let mut truth = unit.clone();
    let valve = &mut truth.parameters.distributing_valve;
    valve.stroke_min_m -= 0.5 * unit.sensors.spool_position_pu.noise * valve.reference_stroke_m;
    let process = Process::LoadRejection;
    let scenario = Scenario { unit: truth, process, rate_hz: 100.0, duration_s: 20.0, rich: true, seed: 7 };
    let recording = PreparedRecording::new(recording(&scenario));
    let problem = Problem::new(vec![recording], &unit, &noise::expected(&unit.sensors));
    let costs: Vec<f64> = problem.residuals_of(&[unit.clone(), scenario.unit.clone()]).iter().map(square).collect();
    let pressures = [&unit, &scenario.unit].map(|unit| {
        let pressure_pa = |estimate: &Estimate| estimate.signals.control_pressure_pa;
        problem.simulate(unit, 0).iter().map(pressure_pa).fold(f64::INFINITY, f64::min)
    });
    assert!((pressures[0] - pressures[1]).abs() > 2e5, "the stop makes no difference to begin with: {pressures:?}");
    assert!((costs[0] - costs[1]).abs() < 25.0, "{costs:?} at least pressures of {pressures:?} Pa");
}

/// Two units that swing of themselves, and differ by less than a sheet's tolerance, cannot keep step; the right effect is the better for all that.
#[test]
fn a_swing_is_compared_by_its_loudness() {
    let unit = params::reference();
    let slow = |ratio: f64| with_effect(&unit, "pv_bandwidth", ratio);
    let scenario = Scenario {
        unit: slow(0.1),
        process: Process::LoadIncrease,
        rate_hz: 100.0,
        duration_s: 40.0,
        rich: false,
        seed: 11,
    };
    let problem =
        Problem::new(vec![PreparedRecording::new(recording(&scenario))], &unit, &noise::expected(&unit.sensors));
    assert!(problem.limit_cycles_s(0) > 10.0, "{} s", problem.limit_cycles_s(0));
    let costs: Vec<f64> = problem.residuals_of(&[unit.clone(), slow(0.1), slow(0.102)]).iter().map(square).collect();
    assert!(costs[1] < 0.5 * costs[0] && costs[2] < 0.5 * costs[0], "{costs:?}");
    let gap = |unit: &Unit| {
        let squares = problem.squares(0, Signal::SpoolPosition, &problem.simulate(unit, 0)).unwrap();
        squares.iter().sum::<f64>()
    };
    let explained_fraction = 1.0 - gap(&slow(0.102)) / gap(&unit);
    assert!(explained_fraction > 0.7, "{explained_fraction}");
}

/// No recording tells when a slowed loop runs: the twin is the mean over that, and the noise that it expects is part of what it says.
#[test]
fn a_slowed_loop_is_likeliest_at_its_period() {
    let sheet = params::reference();
    let slow = |extra_s: f64| with_effect(&sheet, "regulator_cycle", extra_s);
    let recordings = [Process::Startup, Process::LoadRejection].map(|process| {
        let scenario = Scenario { unit: slow(0.03), process, rate_hz: 100.0, duration_s: 30.0, rich: false, seed: 13 };
        PreparedRecording::new(recording(&scenario))
    });
    let problem = Problem::new(recordings.to_vec(), &sheet, &noise::expected(&sheet.sensors));
    let sizes_s = [0.0, 0.01, 0.02, 0.03, 0.04, 0.05];
    let costs = sizes_s.map(|extra_s| {
        let own = problem.laid_along(&slow(extra_s));
        let residuals: f64 = own.residuals_of(&[slow(extra_s)]).iter().map(square).sum();
        (residuals + own.width() - problem.width(), own.width() - problem.width())
    });
    assert!(costs.windows(2).all(|two| two[0].1 < two[1].1), "a slower loop chatters no louder: {costs:?}");
    let least = (0..costs.len()).min_by(|&a, &b| costs[a].0.total_cmp(&costs[b].0)).unwrap();
    assert!((2..=4).contains(&least), "{costs:?}");
    assert!(costs[0].0 - costs[3].0 > 100.0, "{costs:?}");
}

#[test]
fn a_long_rest_left_out_changes_only_the_time_it_takes() {
    let scenario = Scenario {
        unit: params::reference(),
        process: Process::LoadRejection,
        rate_hz: 5.0,
        duration_s: 150.0,
        rich: false,
        seed: 5,
    };
    let whole = recording(&scenario);
    let recording = PreparedRecording::new(whole.clone());
    assert!(!recording.seams.is_empty() && 2 * recording.frames.len() < whole.frames.len(), "{:?}", recording.seams);
    let mut twin = Twin::new(&scenario.unit);
    let estimates: Vec<(i64, Estimate)> = whole.frames.iter().map(|frame| (frame.time_ns, twin.step(frame))).collect();
    let short = recording.run(&mut Twin::new(&scenario.unit));
    let mut worst_pu = 0.0_f64;
    for (&row, estimate) in recording.samples.iter().zip(&short) {
        let (_, same) = estimates.iter().find(|(time_ns, _)| *time_ns == recording.frames[row].time_ns).unwrap();
        let apart = same.signals.servomotor_position_pu - estimate.signals.servomotor_position_pu;
        worst_pu = worst_pu.max(apart.abs());
    }
    // Half a dead band: decisions in it may fall otherwise.
    assert!(worst_pu < 2.5e-4, "{worst_pu}");
}
