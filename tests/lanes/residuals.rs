//! Residuals of many units at once: those of each by itself, whoever else is asked for.

use govtwin_diagnosis::likelihood::noise;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::likelihood::problem::{Problem, twin_of};
use govtwin_model::parameters::Unit;
use govtwin_model::params;
use govtwin_model::recording::Process;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Twin;

use super::{recording, units};

fn problem() -> Problem {
    let mut recordings: Vec<PreparedRecording> =
        [Process::Startup, Process::Shutdown].into_iter().map(recording).collect();
    let mut stage = recordings[0].clone();
    stage.cut = govtwin_model::twin::Cut::Spool;
    for signal in Signal::ALL {
        stage.has[signal as usize] = signal == Signal::ServomotorPosition;
    }
    recordings.push(stage);
    let unit = params::reference();
    Problem::new(recordings, &unit, &noise::expected(&unit.sensors))
}

#[test]
fn residuals_do_not_depend_on_who_else_is_simulated() {
    let problem = problem();
    let units: Vec<Unit> = units().into_iter().step_by(4).collect();
    let before = problem.simulations();
    let all = problem.residuals_of(&units);
    assert_eq!(problem.simulations() - before, units.len() * problem.recordings.len());
    for (unit, residuals) in units.iter().zip(&all) {
        assert_eq!(residuals.len(), problem.recordings.len());
        assert_eq!(problem.residuals_of(std::slice::from_ref(unit))[0], *residuals);
        for (recording, residuals) in residuals.iter().enumerate() {
            assert_eq!(problem.residuals(unit, recording), *residuals);
        }
    }
    let twins: Vec<Twin> = units.iter().rev().map(twin_of).collect();
    let mut reversed = problem.residuals_of_twins(&twins);
    reversed.reverse();
    assert_eq!(reversed, all);
    assert!(problem.residuals_of(&[]).is_empty());
}

#[test]
fn a_lane_without_numbers_spoils_no_other() {
    let problem = problem();
    let unit = params::reference();
    let mut broken = unit.clone();
    broken.parameters.servomotor.load_closed_n = f64::NAN;
    let alone = [&unit, &broken].map(|unit| problem.residuals_of(std::slice::from_ref(unit)).remove(0));
    assert!(alone[1][0].norm() > 1e3 * alone[0][0].norm() && alone[1][0].iter().all(|residual| residual.is_finite()));
    for count in [2, 3, 6, 12] {
        let mut units = vec![unit.clone(); count];
        units[1] = broken.clone();
        for (k, residuals) in problem.residuals_of(&units).iter().enumerate() {
            assert_eq!(*residuals, alone[usize::from(k == 1)], "unit {k} of {count}");
        }
    }
}
