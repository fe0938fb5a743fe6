//! No allocation in a step: a counting global allocator watches a twin from its first step on, bare and with everything on.

#[path = "support/rows.rs"]
mod rows;

use allocation_counter::measure;
use govtwin_model::effects::CATALOGUE;
use govtwin_model::frame::{Frame, Signals};
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::recording::Process;
use govtwin_model::solver::Method;
use govtwin_model::twin::{Cut, Twin};

use rows::{process, run};

/// Every method and cut, with measured signals on every other row.
fn watch(unit: &Unit, dither_pu: f64) {
    for method in [Method::default(), Method::Rk4 { max_step_s: 1.0e-4 }, Method::Rosenbrock { max_step_s: 2.5e-4 }] {
        for cut in [Cut::None, Cut::Servomotor, Cut::Spool] {
            let mut twin = Twin::with_method(unit, method).with_cut(cut).with_dither(dither_pu);
            for which in Process::ALL {
                let mut rows = rows::rows(4.0, 10_000_000, |time_s| process(which, time_s));
                let estimates = run(&twin, &rows);
                for (k, row) in rows.iter_mut().enumerate() {
                    row.measured = if k % 2 == 0 { estimates[k].signals } else { Signals::NONE };
                }
                let counted = measure(|| {
                    twin.reset();
                    for row in &rows {
                        let _ = twin.step(row);
                    }
                    // Rows that are of no use take no memory either.
                    let last = rows[rows.len() - 1];
                    let _ = twin.step(&Frame {
                        measured: Signals { spool_position_pu: f64::INFINITY, ..Signals::NONE },
                        ..last
                    });
                    let _ = twin.step(&rows[0]);
                });
                assert_eq!(counted.count_total, 0, "{method:?}, {cut:?}, {}", which.id());
            }
        }
    }
}

#[test]
fn a_step_does_not_allocate() {
    watch(&govtwin_model::params::reference(), 0.0);
}

#[test]
fn nor_does_it_as_a_mean_over_noise_with_every_effect() {
    let typical = |spec: &govtwin_model::effects::EffectSpec| EffectSetting {
        id: spec.id.to_owned(),
        values: spec.parameters.iter().map(|parameter| parameter.typical).collect(),
    };
    let unit = Unit { effects: CATALOGUE.iter().map(typical).collect(), ..govtwin_model::params::reference() };
    watch(&unit, unit.sensors.servomotor_position_pu.noise);
}

#[test]
fn the_counter_counts() {
    assert_eq!(measure(|| drop(std::hint::black_box(vec![0_u8; 64]))).count_total, 1);
}
