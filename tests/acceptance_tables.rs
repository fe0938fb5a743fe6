//! The tables of acceptance measures in docs/benchmarks.md, on synthetic units: `cargo test --test product -- --ignored --nocapture acceptance_tables`.
#![cfg(feature = "cli")]

#[path = "support/acceptance.rs"]
mod acceptance;

use acceptance::{measured, recordings, true_measures, unit};
use govtwin_diagnosis::acceptance::counterfactual::compare;
use govtwin_diagnosis::acceptance::{Measure, Measures};
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::twin::Twin;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How often intervals hold what is so, by measure.
#[derive(Default)]
struct Coverage([(usize, usize); Measure::ALL.len()]);

impl Coverage {
    fn add(&mut self, measured: &Measures, known: &Measures) {
        for (place, one) in Measure::ALL.into_iter().enumerate() {
            if let (Some(value), Some(known)) = (measured.value(one), known.value(one)) {
                let holds = value.low <= known.value && known.value <= value.high;
                self.0[place].0 += usize::from(holds);
                self.0[place].1 += 1;
            }
        }
    }

    /// Held and counted, all measures together.
    fn all(&self) -> (usize, usize) {
        self.0.iter().fold((0, 0), |(held, count), one| (held + one.0, count + one.1))
    }

    fn words(&self, measure: Measure) -> String {
        let (held, count) = self.0[measure as usize];
        if count == 0 { "does not show".to_owned() } else { format!("{held} of {count}") }
    }
}

/// Prints tables beside each other, a row for each measure.
fn print(title: &str, columns: &[(&str, &Coverage)]) {
    println!("\n{title}");
    println!("| measure | {} |", columns.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(" | "));
    for one in Measure::ALL {
        let cells: Vec<String> = columns.iter().map(|(_, coverage)| coverage.words(one)).collect();
        println!("| {} | {} |", one.id(), cells.join(" | "));
    }
    let all: Vec<String> = columns.iter().map(|(_, coverage)| format!("{:?}", coverage.all())).collect();
    println!("| all | {} |", all.join(" | "));
}

/// Every second unit has 0.3 % of play.
fn drawn(seed: u64) -> Unit {
    unit(seed, if seed.is_multiple_of(2) { &[] } else { &[("backlash", &[0.003])] })
}

#[test]
#[ignore = "a table of docs/benchmarks.md; a minute of a core"]
fn how_often_intervals_hold() {
    let [mut same, mut other, mut slow] = [(); 3].map(|()| Coverage::default());
    for seed in 20..60 {
        let unit = drawn(seed);
        let fast = recordings(&unit, seed, 100.0);
        let known = true_measures(&unit, &fast);
        same.add(&measured(&fast), &known);
        // What is so shows at 100 Hz; measured is at 5 Hz.
        slow.add(&measured(&recordings(&unit, seed, 5.0)), &known);
        if seed < 32 {
            let another_day = recordings(&unit, seed + 1000, 100.0);
            other.add(&measured(&fast), &true_measures(&unit, &another_day));
        }
    }
    print(
        "Intervals of nine in ten hold the value of the true unit without transducers:",
        &[
            ("same movements, 40 units", &same),
            ("another day's, 12 units", &other),
            ("measured at 5 Hz, 40 units", &slow),
        ],
    );
    let (held, count) = same.all();
    assert!(held as f64 >= 0.9 * count as f64, "{held} of {count}");
}

/// Two full strokes and two trips, as a commissioning runs them, with the transducer's noise and steps.
fn commissioning(unit: &Unit, seed: u64, rate_hz: f64) -> Vec<Recording> {
    let strokes = |time_s: f64| {
        let open = (2.0..27.0).contains(&time_s) || (52.0..77.0).contains(&time_s);
        (if open { 1.0 } else { 0.0 }, EsvState::Normal)
    };
    let trip = |time_s: f64| if time_s < 2.0 { (0.8, EsvState::Normal) } else { (0.0, EsvState::Shutdown) };
    vec![
        recorded(unit, seed, (rate_hz, 100.0), 0.0, Process::LoadIncrease, &strokes),
        recorded(unit, seed + 500, (rate_hz, 30.0), 0.8, Process::Shutdown, &trip),
        recorded(unit, seed + 900, (rate_hz, 30.0), 0.8, Process::Shutdown, &trip),
    ]
}

#[expect(clippy::cast_possible_truncation, reason = "times of a minute and a half in nanoseconds")]
fn recorded(
    unit: &Unit,
    seed: u64,
    (rate_hz, length_s): (f64, f64),
    start_pu: f64,
    process: Process,
    inputs: &dyn Fn(f64) -> (f64, EsvState),
) -> Recording {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let sensor = unit.sensors.servomotor_position_pu;
    let mut twin = Twin::new(unit);
    let every = (100.0 / rate_hz).round() as i64;
    let mut frames = vec![];
    for row in 0..(100.0 * length_s) as i64 {
        let time_ns = row * 10_000_000;
        let (opening_command_pu, esv) = inputs(row as f64 * 0.01);
        let inputs = Inputs {
            opening_command_pu,
            esv,
            tank_pressure_pa: unit.parameters.oil.tank_pressure_pa,
            piston_force_n: 0.0,
        };
        let first = if row == 0 { start_pu } else { f64::NAN };
        let measured = Signals { servomotor_position_pu: first, ..Signals::NONE };
        let true_pu = twin.step(&Frame { time_ns, inputs, measured }).signals.servomotor_position_pu;
        let normal: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
        let read_pu = ((true_pu + sensor.noise * normal) / sensor.step).round() * sensor.step;
        if row % every == 0 {
            let measured = Signals { servomotor_position_pu: read_pu, ..Signals::NONE };
            frames.push(Frame { time_ns, inputs, measured });
        }
    }
    Recording { process, ..Recording::new("commissioning", frames) }
}

#[test]
#[ignore = "a table of docs/benchmarks.md; a minute of a core"]
fn how_often_intervals_of_stroke_times_hold() {
    let [mut fast, mut slow] = [(); 2].map(|()| Coverage::default());
    for seed in 20..60 {
        let unit = drawn(seed);
        let recordings = commissioning(&unit, seed, 100.0);
        let known = true_measures(&unit, &recordings);
        fast.add(&measured(&recordings), &known);
        slow.add(&measured(&commissioning(&unit, seed, 5.0)), &known);
    }
    print("Full strokes and trips, 40 units:", &[("at 100 Hz", &fast), ("at 5 Hz", &slow)]);
    for one in [Measure::OpeningTime, Measure::ClosingTime, Measure::TripClosingTime] {
        let (held, count) = fast.0[one as usize];
        assert!(count == 40 && held >= 34, "{one:?}: {held} of {count}");
    }
}

#[test]
#[ignore = "a table of docs/benchmarks.md; a minute of a core"]
fn what_is_foretold_without_a_fault_is_what_the_unit_without_it_measures() {
    let bare = measured(&recordings(&unit(3, &[]), 3, 100.0));
    println!("\n| fault | measure | measured | foretold without it | true without it |");
    let (mut held, mut count) = (0, 0);
    for (id, values, measures) in [
        ("port_overlap", vec![3e-4], vec![Measure::DeadBand, Measure::Bandwidth]),
        ("backlash", vec![0.004], vec![Measure::DeadTime, Measure::DeadBand]),
        ("command_delay", vec![0.15], vec![Measure::DeadTime, Measure::TrackingError]),
        ("cushion", vec![], vec![Measure::CushionTime]),
        ("regulator_cycle", vec![], vec![Measure::DeadBand]),
        ("servo_friction", vec![60e3], vec![Measure::ClosingTime]),
    ] {
        let spec = govtwin_model::effects::find(id).unwrap();
        let typical = || spec.parameters.iter().map(|parameter| parameter.typical).collect();
        let values: Vec<f64> = if values.is_empty() { typical() } else { values };
        let faulty = unit(3, &[(id, &values)]);
        let compared = compare(&recordings(&faulty, 3, 100.0), &faulty, &[id.to_owned()], &[], &|| {});
        for one in measures {
            let before = compared.measured.value(one).unwrap().value;
            let foretold = compared.without[0].expected[one as usize].unwrap().value;
            let truly = bare.value(one).unwrap().value;
            let [before, value, low, high, true_value] =
                [before, foretold.value, foretold.low, foretold.high, truly].map(|value| format!("{value:.3e}"));
            println!("| {id} {values:?} | {} | {before} | {value} ({low} to {high}) | {true_value} |", one.id());
            held += usize::from(foretold.low <= truly && truly <= foretold.high);
            count += 1;
        }
    }
    println!("{held} of {count} hold");
    assert!(held * 10 >= count * 8, "{held} of {count}");
}
