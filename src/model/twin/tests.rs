//! The twin's first row, and its clock.

use super::*;
use crate::frame::Inputs;
use crate::parameters::EffectSetting;
use crate::params::reference;
use crate::plant::lanes::Width;
use batch::BatchRow;

/// Rows of a spool that swings, by the clock of a recording; before the first sample only the spool is known.
fn rows(before: i64, row_ns: i64) -> Vec<Frame> {
    let inputs =
        Inputs { opening_command_pu: f64::NAN, esv: EsvState::Normal, tank_pressure_pa: f64::NAN, piston_force_n: 0.0 };
    let row = |k: i64| {
        let spool_position_pu = 0.3 * (0.07 * k as f64 + 1.0).sin();
        let servomotor_position_pu = if k == 0 { 0.4 } else { f64::NAN };
        Frame {
            time_ns: k * row_ns,
            inputs,
            measured: Signals { spool_position_pu, servomotor_position_pu, ..Signals::NONE },
        }
    };
    (-before..200).map(row).collect()
}

fn positions(twin: &mut Twin, rows: &[Frame]) -> Vec<f64> {
    let all = rows.iter().map(|row| (row.time_ns, twin.step(row).signals.servomotor_position_pu));
    all.filter(|(time_ns, _)| *time_ns >= 0).map(|(_, position)| position).collect()
}

#[test]
fn a_piston_is_where_it_is_first_measured_whatever_drove_it_before() {
    // Rows between ticks as well as on them.
    for row_ns in [50_000_000, 37_300_000] {
        let mut unit = reference();
        unit.parameters.regulator.small_loop_period_s = 0.02;
        unit.parameters.regulator.large_loop_period_s = 0.2;
        let mut twin = Twin::new(&unit).with_cut(Cut::Spool);
        let [alone, with_history] = [0, 30].map(|before| positions(&mut twin.clone(), &rows(before, row_ns)));
        assert!((with_history[0] - 0.4).abs() < 1e-12, "{}", with_history[0]);
        let apart = alone.iter().zip(&with_history).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-9, "{apart}");
        let batch = |frame: &Frame| BatchRow { frame: *frame, is_sample: frame.time_ns >= 0 };
        let lanes: Vec<BatchRow> = rows(30, row_ns).iter().map(batch).collect();
        let mut twins = [twin.clone(), twin.clone()];
        let width = Width::holding(2).unwrap();
        let beside = batch::estimates(width, &mut twins, vec![lanes.into_iter()]);
        let beside: Vec<f64> = beside[1].iter().map(|estimate| estimate.signals.servomotor_position_pu).collect();
        assert_eq!(beside, with_history);
        twin.reset();
    }
}

/// What effects add behind a spool goes on from what drove it before the first position: a spool that acts late, a gap whose side is known.
#[test]
fn what_lies_behind_the_spool_has_its_history() {
    for (effect, value) in [("valve_lag", 0.4), ("backlash", 0.02)] {
        let mut unit = reference();
        unit.effects = vec![EffectSetting { id: effect.to_owned(), values: vec![value] }];
        let twin = Twin::new(&unit).with_cut(Cut::Spool);
        let moved = |positions: &[f64]| positions.iter().map(|y| y - positions[0]).collect::<Vec<f64>>();
        let behind = moved(&positions(&mut twin.clone(), &rows(60, 50_000_000)));
        let mut whole = rows(60, 50_000_000);
        (whole[0].measured.servomotor_position_pu, whole[60].measured.servomotor_position_pu) = (0.4, f64::NAN);
        let wanted = moved(&positions(&mut twin.clone(), &whole));
        let apart = behind.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Where the piston begins makes a small difference of its own; without a history it would be off by much more.
        let alone = moved(&positions(&mut twin.clone(), &rows(0, 50_000_000)));
        let without = alone.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 0.5 * without, "{effect}: {apart} of {without}");
        let lanes = rows(60, 50_000_000).into_iter().map(|frame| BatchRow { frame, is_sample: frame.time_ns >= 0 });
        let beside = batch::estimates(Width::holding(2).unwrap(), &mut [twin.clone(), twin], vec![lanes]);
        let beside: Vec<f64> = beside[1].iter().map(|estimate| estimate.signals.servomotor_position_pu).collect();
        assert_eq!(moved(&beside), behind, "{effect}");
    }
}

#[test]
fn a_unit_on_a_clock_of_its_own_moves_as_fast_as_that() {
    let mut slow = reference();
    slow.recorded.clock_ratio = 1.0 / 64.0;
    let [usual, slow] = [(reference(), 50_000_000), (slow, 64 * 50_000_000)]
        .map(|(unit, row_ns)| positions(&mut Twin::new(&unit).with_cut(Cut::Spool), &rows(0, row_ns)));
    assert_eq!(usual, slow);
}
