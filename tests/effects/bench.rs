//! The bench on which effects are tried: one manoeuvre through all four processes, the unit, and how far runs differ.

use govtwin_model::effects::EffectSpec;
use govtwin_model::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::recording::Recording;
use govtwin_model::replay;
use govtwin_model::twin::{Cut, Twin};

/// Time in s, command in pu and ESV where a straight line ends.
type Corner = (f64, f64, EsvState);

/// The corners process by process.
const PROCESSES: [(&str, &[Corner]); 4] = [
    (
        "startup",
        &[(0.0, 0.0, NORMAL), (0.5, 0.0, NORMAL), (2.0, 0.2, NORMAL), (3.5, 0.13, NORMAL), (5.0, 0.15, NORMAL)],
    ),
    ("load_increase", &[(5.0, 0.15, NORMAL), (5.2, 0.2, NORMAL), (8.0, 0.6, NORMAL), (9.0, 0.58, NORMAL)]),
    ("load_rejection", &[(9.0, 0.58, NORMAL), (9.01, 0.58, NORMAL), (9.5, 0.2, NORMAL), (13.0, 0.25, NORMAL)]),
    (
        "shutdown",
        &[(13.0, 0.25, NORMAL), (15.0, 0.12, NORMAL), (15.4, 0.12, SHUT), (16.0, 0.0, SHUT), (18.0, 0.0, SHUT)],
    ),
];
const NORMAL: EsvState = EsvState::Normal;
const SHUT: EsvState = EsvState::Shutdown;

/// The rows of each process, at 100 Hz, without measured signals.
pub fn manoeuvre() -> Vec<(&'static str, Vec<Frame>)> {
    PROCESSES.iter().map(|(name, corners)| (*name, rows(corners))).collect()
}

fn rows(corners: &[(f64, f64, EsvState)]) -> Vec<Frame> {
    let (first_s, last_s) = (corners[0].0, corners[corners.len() - 1].0);
    let count = ((last_s - first_s) * 100.0).round() as i64;
    (0..count)
        .map(|i| {
            let at_s = first_s + i as f64 * 0.01;
            let passed = corners.iter().rposition(|corner| corner.0 <= at_s + 1e-9).unwrap();
            let (from, to) = (corners[passed], corners[(passed + 1).min(corners.len() - 1)]);
            let share = if to.0 > from.0 { (at_s - from.0) / (to.0 - from.0) } else { 0.0 };
            let inputs = Inputs {
                opening_command_pu: from.1 + share * (to.1 - from.1),
                esv: from.2,
                tank_pressure_pa: 6.3e6 - 1e5 * (0.7 * at_s).sin(),
                piston_force_n: 0.0,
            };
            Frame { time_ns: (at_s * 1e9).round() as i64, inputs, measured: Signals::NONE }
        })
        .collect()
}

/// The whole manoeuvre; what it has measured is what the nominal twin says.
pub fn recording() -> Recording {
    let mut frames: Vec<Frame> = manoeuvre().into_iter().flat_map(|(_, frames)| frames).collect();
    let mut twin = Twin::new(&with(&[]));
    for frame in &mut frames {
        frame.measured = twin.step(frame).signals;
    }
    Recording::new("manoeuvre", frames)
}

/// The shipped unit with effects.
pub fn with(effects: &[EffectSetting]) -> Unit {
    Unit { effects: effects.to_vec(), ..govtwin_model::params::reference() }
}

/// The manoeuvre through a unit with effects.
pub fn simulate(effects: &[EffectSetting], cut: Cut) -> Vec<Estimate> {
    replay::simulate(&mut Twin::new(&with(effects)).with_cut(cut), &recording())
}

/// An effect at its typical size.
pub fn typical(spec: &EffectSpec) -> EffectSetting {
    let values = spec.parameters.iter().map(|parameter| parameter.typical).collect();
    EffectSetting { id: spec.id.to_owned(), values }
}

/// The greatest difference of two runs, each signal as a share of its span.
pub fn farthest(one: &[Estimate], other: &[Estimate]) -> f64 {
    let differences = one.iter().zip(other).map(|(one, other)| {
        let (a, b) = (&one.signals, &other.signals);
        [
            a.spool_position_pu - b.spool_position_pu,
            a.servomotor_position_pu - b.servomotor_position_pu,
            a.pilot_valve_position_pu - b.pilot_valve_position_pu,
            (a.control_pressure_pa - b.control_pressure_pa) / 6.3e6,
        ]
        .map(f64::abs)
        .into_iter()
        .fold(0.0, f64::max)
    });
    differences.fold(0.0, f64::max)
}
