//! A unit that nobody has a sheet of, made of recordings of its command, spool and servomotor. Synthetic recordings.

use govtwin::frame::Frame;
use govtwin::generate::{self, Scenario};
use govtwin::parameters::{ENTRIES, Unit};
use govtwin::params::reference;
use govtwin::recording::{Process, Recording};
use govtwin::replay::simulate;
use govtwin::sheet::from_recordings::from_recordings;
use govtwin::twin::Twin;

fn recordings(unit: &Unit, seed: u64) -> Vec<Recording> {
    let of = |process| Scenario { unit: unit.clone(), process, rate_hz: 50.0, duration_s: 40.0, rich: false, seed };
    Process::ALL.into_iter().map(|process| generate::recording(&of(process))).collect()
}

fn value(unit: &Unit, key: &str) -> f64 {
    let entry = ENTRIES.iter().find(|entry| entry.key == key).unwrap();
    (entry.get)(&unit.parameters)
}

/// A unit unlike the reference unit in what the recordings can say.
fn other(seed: u64) -> Unit {
    let mut unit = generate::spread(&reference(), seed);
    unit.parameters.regulator.position_gain = 18.0;
    unit.parameters.main_ports.width_m *= 0.6;
    unit.parameters.distributing_valve.stroke_min_m = -0.011;
    unit.parameters.oil.tank_pressure_pa = 5.0e6;
    unit
}

/// RMS of the servomotor's error, pu.
fn error_pu(unit: &Unit, recordings: &[Recording]) -> f64 {
    let squares = recordings.iter().flat_map(|recording| {
        let estimates = simulate(&mut Twin::new(unit), recording);
        let off = |(frame, estimate): (&Frame, &govtwin::frame::Estimate)| {
            frame.measured.servomotor_position_pu - estimate.signals.servomotor_position_pu
        };
        recording
            .frames
            .iter()
            .zip(&estimates)
            .map(off)
            .filter(|off| off.is_finite())
            .map(|off| off * off)
            .collect::<Vec<_>>()
    });
    let squares: Vec<f64> = squares.collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn strokes_times_dead_band_and_gain_come_from_the_recordings() {
    for seed in [1, 2, 3] {
        let unit = other(seed);
        let recordings = recordings(&unit, seed);
        let made = from_recordings(&recordings, &reference()).unwrap();
        let pu = |unit: &Unit, key: &str| value(unit, key) / value(unit, "distributing_valve.reference_stroke_m");
        let gain = value(&made.unit, "regulator.position_gain");
        assert!((gain / 18.0 - 1.0).abs() < 0.25, "{gain}");
        let [found, truly] = [&made.unit, &unit].map(|unit| pu(unit, "main_ports.overlap_m"));
        assert!((found / truly).ln().abs() < 0.5, "{found} {truly}");
        let pressure_pa = value(&made.unit, "oil.tank_pressure_pa");
        assert!((pressure_pa / 5.0e6 - 1.0).abs() < 0.05, "{pressure_pa}");
        // As made, before anything was fitted, it follows better than the reference unit's sheet does.
        let [by_made, by_reference] = [&made.unit, &reference()].map(|unit| error_pu(unit, &recordings));
        println!(
            "{seed}: gain {gain:.1}, overlap {found:.4} for {truly:.4}, error {by_made:.4} and {by_reference:.4} pu"
        );
        assert!(by_made < 0.5 * by_reference, "{by_made} {by_reference}");
        assert!(made.notes[0].contains("No data sheet") && made.notes[0].contains("position gain"), "{:?}", made.notes);
        let wide = ENTRIES.iter().zip(&made.unit.tolerances).filter(|(_, tolerance)| tolerance.is_some()).count();
        let sheet = reference().tolerances.iter().flatten().count();
        assert!(wide > sheet, "{wide} values with a tolerance, {sheet} on a sheet");
    }
}

#[test]
fn what_cannot_make_a_unit_is_refused_with_a_way_out() {
    let recordings = recordings(&reference(), 4);
    let refused = |change: &dyn Fn(&mut Frame)| {
        let mut changed = recordings.clone();
        changed.iter_mut().flat_map(|recording| &mut recording.frames).for_each(change);
        from_recordings(&changed, &reference()).unwrap_err()
    };
    let without_pressure = refused(&|frame| frame.inputs.tank_pressure_pa = f64::NAN);
    assert!(without_pressure.contains("constant in an import map"), "{without_pressure}");
    let without_spool = refused(&|frame| frame.measured.spool_position_pu = f64::NAN);
    assert!(without_spool.contains("judges the stage alone"), "{without_spool}");
    let turned = refused(&|frame| frame.measured.spool_position_pu *= -1.0);
    assert!(turned.contains("other way round"), "{turned}");
    let still = refused(&|frame| frame.measured.spool_position_pu = 0.1);
    assert!(still.contains("stands still") || still.contains("other way round"), "{still}");
}
