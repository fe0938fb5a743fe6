//! Twins side by side in lanes give what each gives by itself, to the last bit: every effect, cut and process, at every width.

#[path = "lanes/residuals.rs"]
mod residuals;
#[path = "support/rows.rs"]
mod rows;

use std::sync::Arc;

use govtwin_diagnosis::generate::spread;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_model::effects::{self, CATALOGUE};
use govtwin_model::frame::{Estimate, Frame, Signals};
use govtwin_model::parameters::{EffectSetting, OwnEffect, OwnParameter, Unit};
use govtwin_model::params;
use govtwin_model::plant::Plant;
use govtwin_model::plant::lanes::Width;
use govtwin_model::plant::term::{Point, Term, View};
use govtwin_model::recording::{Process, Recording};
use govtwin_model::solver::Method;
use govtwin_model::twin::batch::{self, BatchRow};
use govtwin_model::twin::{Cut, Twin};

/// A disturbance that nobody else has, at a point of the chain.
#[derive(Debug)]
struct Ripple(Point, f64);

impl Term for Ripple {
    fn point(&self) -> Point {
        self.0
    }

    fn memory_len(&self) -> usize {
        1
    }

    fn apply(&self, signal: f64, view: &View<'_>, memory: &mut [f64]) -> f64 {
        memory[0] += view.tick_s * (view.spool_reading_pu + view.servomotor_reading_pu);
        signal + self.1 * (3.0 * view.time_s + memory[0] + 10.0 * view.state.servomotor_velocity_m_s).sin()
    }
}

/// Units within tolerance and with every effect of the catalogue, each at several sizes; and some with several.
fn units() -> Vec<Unit> {
    let with = |unit: &Unit, id: &str, values: Vec<f64>| {
        let mut unit = unit.clone();
        unit.effects.push(EffectSetting { id: id.to_owned(), values });
        unit
    };
    let reference = params::reference();
    let mut units = vec![reference.clone()];
    for (k, spec) in CATALOGUE.iter().enumerate() {
        for share in [0.3, 1.0, 2.5] {
            let unit = if share == 1.0 { reference.clone() } else { spread(&reference, k as u64) };
            let value =
                |p: &effects::EffectParameter| (p.neutral + share * (p.typical - p.neutral)).clamp(p.min, p.max);
            units.push(with(&unit, spec.id, spec.parameters.iter().map(value).collect()));
        }
    }
    let typical = |id: &str| effects::find(id).unwrap().parameters.iter().map(|parameter| parameter.typical).collect();
    for pair in [["spool_friction", "viscosity"], ["supply_loss", "clock_offset"], ["cushion", "entrained_air"]] {
        units.push(pair.iter().fold(reference.clone(), |unit, id| with(&unit, id, typical(id))));
    }
    units.push(with(&reference, "clock_offset", vec![0.013]));
    units.push(with(&reference, "clock_offset", vec![-0.2]));
    units.push(with(&with(&reference, "servo_friction", vec![2e4, 2.0]), "spool_friction", vec![800.0, 1.7]));
    let mut slow = with(&reference, "regulator_cycle", vec![0.0133]);
    slow.parameters.proportional_valve.damping_ratio = 1.4;
    units.push(slow);
    let mut own = with(&reference, "hump", vec![3.0e3]);
    own.own_effects.push(OwnEffect {
        id: "hump".to_owned(),
        doc: "Dry bushings".to_owned(),
        at: "servomotor_force_n".to_owned(),
        stage: String::new(),
        expression: "-c_n*tanh(servomotor_velocity_m_s/0.005)".to_owned(),
        parameters: vec![OwnParameter {
            name: "c_n".to_owned(),
            unit: "N".to_owned(),
            neutral: 0.0,
            min: 0.0,
            max: 5e4,
            typical: 5e3,
            doc: "height".to_owned(),
        }],
    });
    units.push(own);
    units
}

/// A twin of each unit, and of plants with a term at each point.
fn twins() -> Vec<Twin> {
    let units = units();
    let mut twins: Vec<Twin> = units.iter().map(Twin::new).collect();
    for (unit, point) in units.iter().step_by(7).zip(Point::ALL) {
        let mut plant = Plant::new(&unit.parameters);
        effects::apply(unit, &mut plant);
        let size = match point {
            Point::SpoolForce => 200.0,
            Point::SupplyPressure => 2e5,
            Point::ServomotorForce => 2e4,
            Point::ChamberFlow => 1e-5,
            Point::OpeningFlow | Point::ClosingFlow => 4e-4,
            _ => 2e-3,
        };
        plant.terms.push(Arc::new(Ripple(point, size)));
        twins.push(Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, Method::default()));
    }
    twins
}

/// A process under a force on the piston, whose rows lie on and between ticks, some without a command or a force; what it has measured is another unit's.
fn recording(process: Process) -> PreparedRecording {
    let mut frames: Vec<Frame> = rows::rows(9.0, 3_700_000, |time_s| rows::process(process, time_s));
    let mut twin = Twin::new(&spread(&params::reference(), 5));
    for (k, frame) in frames.iter_mut().enumerate() {
        frame.inputs.piston_force_n = if k % 7 == 0 { f64::NAN } else { 4e4 * (0.05 * k as f64).sin() };
        let signals = twin.step(frame).signals;
        if k % 3 == 0 {
            frame.measured = signals;
        } else if k % 5 == 0 {
            frame.inputs.opening_command_pu = f64::NAN;
            frame.measured = Signals { servomotor_position_pu: signals.servomotor_position_pu, ..Signals::NONE };
        }
    }
    PreparedRecording::new(Recording::new(process.id(), frames))
}

fn bits(estimates: &[Estimate]) -> Vec<[u64; 11]> {
    let one = |e: &Estimate| {
        [
            e.signals.spool_position_pu,
            e.signals.servomotor_position_pu,
            e.signals.pilot_valve_position_pu,
            e.signals.control_pressure_pa,
            e.spool_velocity_m_s,
            e.servomotor_velocity_m_s,
            e.opening_chamber_pressure_pa,
            e.closing_chamber_pressure_pa,
            e.spool_command_pu,
            e.spool_command_sd_pu,
            e.valve_current_pu,
        ]
        // No sign of zero.
        .map(|value| (value + 0.0).to_bits())
    };
    estimates.iter().map(one).collect()
}

/// The estimates of all twins in lanes of a width.
fn in_lanes(width: Width, recording: &PreparedRecording, twins: &[Twin]) -> Vec<Vec<Estimate>> {
    let mut all = Vec::new();
    for chunk in twins.chunks(width.lanes()) {
        let mut chunk = chunk.to_vec();
        assert!(batch::fit(&chunk));
        all.extend(recording.run_batch_of(width, &mut chunk));
    }
    all
}

fn assert_equal(process: Process, prepare: impl Fn(Twin) -> Twin) {
    let recording = recording(process);
    let twins: Vec<Twin> = twins().into_iter().map(prepare).collect();
    let alone: Vec<Vec<Estimate>> = twins.iter().map(|twin| recording.run(&mut twin.clone())).collect();
    assert!(alone.iter().all(|estimates| estimates.len() == recording.samples.len()));
    for width in Width::all() {
        for (k, (one, other)) in in_lanes(width, &recording, &twins).iter().zip(&alone).enumerate() {
            assert!(other.iter().all(|e| e.signals.spool_position_pu.is_finite()), "{process:?} twin {k}");
            let apart = bits(one).iter().zip(&bits(other)).position(|(one, other)| one != other);
            if let Some(at) = apart {
                panic!(
                    "{process:?}, {} lanes, twin {k}, sample {at}: {:?}\nnot {:?}",
                    width.lanes(),
                    one[at],
                    other[at]
                );
            }
            assert_eq!(one.len(), other.len());
        }
    }
}

#[test]
fn one_realisation_is_equal_in_lanes() {
    for process in Process::ALL {
        assert_equal(process, |twin| twin);
    }
}

#[test]
fn the_mean_over_noise_is_equal_in_lanes() {
    for process in Process::ALL {
        assert_equal(process, |twin| twin.with_dither(1.5e-4));
    }
}

#[test]
fn a_twin_that_is_fed_the_servomotor_is_equal_in_lanes() {
    for process in Process::ALL {
        assert_equal(process, |twin| twin.with_cut(Cut::Servomotor));
    }
}

#[test]
fn a_twin_that_is_fed_the_spool_is_equal_in_lanes() {
    for process in Process::ALL {
        assert_equal(process, |twin| twin.with_cut(Cut::Spool));
    }
}

#[test]
fn twins_of_other_methods_or_cuts_do_not_fit() {
    let unit = params::reference();
    let twin = Twin::new(&unit);
    assert!(batch::fit(&[twin.clone(), twin.clone().with_dither(1e-4)]));
    assert!(!batch::fit(&[]));
    assert!(!batch::fit(&[twin.clone(), twin.clone().with_cut(Cut::Spool)]));
    let rk4 = Twin::with_method(&unit, Method::Rk4 { max_step_s: 2e-4 });
    assert!(!batch::fit(&[rk4.clone(), rk4.clone()]) && !batch::fit(&[twin.clone(), rk4.clone()]));
    let mut other = unit.clone();
    other.parameters.regulator.small_loop_period_s = 2e-3;
    assert!(!batch::fit(&[twin.clone(), Twin::new(&other)]));
    // They are simulated one by one.
    let recording = recording(Process::LoadIncrease);
    let mut mixed = [twin, Twin::new(&other), rk4];
    let alone: Vec<_> = mixed.iter().map(|twin| recording.run(&mut twin.clone())).collect();
    assert_eq!(recording.run_batch(&mut mixed), alone);
}

#[test]
fn no_rows_and_one_row_are_rows_too() {
    let twins = [Twin::new(&params::reference()), Twin::new(&spread(&params::reference(), 1))];
    let row = rows::rows(0.0, rows::TICK_NS, |_| rows::command(0.3));
    for frames in [vec![], row] {
        let rows = || frames.iter().map(|&frame| BatchRow { frame, is_sample: true });
        let alone: Vec<_> = twins.iter().map(|twin| rows::run(twin, &frames)).collect();
        for width in Width::all() {
            assert_eq!(batch::estimates(width, &mut twins.clone(), vec![rows()]), alone);
        }
    }
}
