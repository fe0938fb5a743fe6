//! Repeatability: how rows arrive, clones and restarts change nothing, to the last bit.

use govtwin_model::effects::CATALOGUE;
use govtwin_model::frame::{Estimate, Frame, Signals};
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::recording::Process;
use govtwin_model::solver::Method;
use govtwin_model::twin::{Cut, Twin};
use proptest::prelude::{ProptestConfig, any, prop};
use proptest::sample::select;
use proptest::{prop_assert_eq, proptest};

use super::agreement::METHODS;
use super::rows::{TICK_NS, process, rows, run};

/// Rows at 20 ms with the positions of an earlier run as measured ones, so that every cut has its input.
fn recorded(which: Process) -> Vec<Frame> {
    let rows = rows(3.0, 20 * TICK_NS, |time_s| process(which, time_s));
    let estimates = run(&Twin::new(&govtwin_model::params::reference()), &rows);
    let measured = |estimate: &Estimate| Signals { control_pressure_pa: f64::NAN, ..estimate.signals };
    rows.iter().zip(&estimates).map(|(row, estimate)| Frame { measured: measured(estimate), ..*row }).collect()
}

fn twin(method: Method, cut: Cut) -> Twin {
    Twin::with_method(&govtwin_model::params::reference(), method).with_cut(cut)
}

/// The same, or one with the memory of every effect and with noise inside the loop.
fn bare_or_full(full: bool, method: Method, cut: Cut) -> Twin {
    if !full {
        return twin(method, cut);
    }
    let typical = |spec: &govtwin_model::effects::EffectSpec| EffectSetting {
        id: spec.id.to_owned(),
        values: spec.parameters.iter().map(|parameter| parameter.typical).collect(),
    };
    let unit = Unit { effects: CATALOGUE.iter().map(typical).collect(), ..govtwin_model::params::reference() };
    Twin::with_method(&unit, method).with_cut(cut).with_dither(1.5e-4)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// Rows that repeat the inputs in force may come at any time between two rows, on the grid of ticks or off it.
    #[test]
    fn chunking_changes_nothing(
        which in select(Process::ALL.to_vec()), method in select(METHODS.to_vec()),
        cut in select(vec![Cut::None, Cut::Servomotor]), offsets_ns in prop::collection::vec(1i64..20_000_000, 150),
        full in any::<bool>(),
    ) {
        let sparse = recorded(which);
        let mut twin = bare_or_full(full, method, cut);
        let alone: Vec<Estimate> = sparse.iter().map(|row| twin.step(row)).collect();
        twin.reset();
        for (k, row) in sparse.iter().enumerate() {
            prop_assert_eq!(twin.step(row), alone[k]);
            let mut offsets_ns = [offsets_ns[k % 150], offsets_ns[(k * 7 + 3) % 150]];
            offsets_ns.sort_unstable();
            for offset_ns in offsets_ns {
                let between = Frame { time_ns: row.time_ns + offset_ns, measured: Signals::NONE, ..*row };
                prop_assert_eq!(twin.step(&between).time_ns, between.time_ns);
            }
        }
    }

    /// A clone is a save: both go on alike, whatever the other does meanwhile.
    #[test]
    fn a_clone_goes_on_as_its_original_does(
        which in select(Process::ALL.to_vec()), method in select(METHODS.to_vec()),
        cut in select(vec![Cut::None, Cut::Servomotor, Cut::Spool]), at in 1usize..140, full in any::<bool>(),
    ) {
        let rows = recorded(which);
        let mut original = bare_or_full(full, method, cut);
        for row in &rows[..at] {
            let _ = original.step(row);
        }
        let saved = original.clone();
        let ahead: Vec<Estimate> = rows[at..].iter().map(|row| original.step(row)).collect();
        let mut restored = saved.clone();
        let again: Vec<Estimate> = rows[at..].iter().map(|row| restored.step(row)).collect();
        prop_assert_eq!(&ahead, &again);
        // The saved one has not moved.
        let mut once_more = saved;
        prop_assert_eq!(rows[at..].iter().map(|row| once_more.step(row)).collect::<Vec<_>>(), again);
    }
}

#[test]
fn a_reset_twin_is_a_new_one() {
    for cut in [Cut::None, Cut::Servomotor, Cut::Spool] {
        let rows = recorded(Process::LoadIncrease);
        let mut used = twin(Method::default(), cut);
        for row in recorded(Process::Shutdown) {
            let _ = used.step(&row);
        }
        used.reset();
        let anew: Vec<Estimate> = rows.iter().map(|row| used.step(row)).collect();
        assert_eq!(anew, run(&twin(Method::default(), cut), &rows));
    }
}

#[test]
fn rows_at_once_and_rows_from_the_past_advance_nothing() {
    let rows = recorded(Process::Startup);
    let mut twin = twin(Method::default(), Cut::None);
    for row in &rows[..40] {
        let _ = twin.step(row);
    }
    let state = *twin.state();
    let _ = twin.step(&rows[39]);
    let _ = twin.step(&Frame { inputs: rows[39].inputs, ..rows[10] });
    assert_eq!(*twin.state(), state);
}

/// The zero-order hold, stated: a command that changes between two ticks acts from the next tick on.
#[test]
fn an_input_acts_from_the_first_tick_after_it() {
    let unit = govtwin_model::params::reference();
    let step_at = |time_ns: i64| {
        let mut twin = Twin::new(&unit);
        let still = rows(0.0, TICK_NS, |_| super::rows::command(0.3))[0];
        let _ = twin.step(&still);
        let _ = twin.step(&Frame { time_ns, inputs: super::rows::command(0.6), ..still });
        twin.step(&Frame { time_ns: 100 * TICK_NS, inputs: super::rows::command(0.6), ..still })
    };
    // The large loop reads at 10 ms: a change at 9.2 ms or at 10 ms is read then, one at 10.2 ms ten milliseconds later.
    assert_eq!(step_at(9_200_000), step_at(10_000_000));
    assert_ne!(step_at(10_000_000), step_at(10_200_000));
    assert_eq!(step_at(10_200_000), step_at(20_000_000));
}
