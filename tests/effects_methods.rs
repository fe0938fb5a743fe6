//! How effects sit in the numerics: default against reference method, smoothness in each parameter.

#[path = "effects/bench.rs"]
mod bench;

use bench::{farthest, recording, simulate, typical, with};
use govtwin_model::effects::CATALOGUE;
use govtwin_model::frame::Estimate;
use govtwin_model::parameters::EffectSetting;
use govtwin_model::replay;
use govtwin_model::signal::Signal;
use govtwin_model::solver::Method;
use govtwin_model::twin::{Cut, Twin};

/// Greatest root mean square of the difference to RK4 at 50 µs, with the measured servomotor position fed to the regulator.
///
/// Without an effect it is 2e-5 pu of the spool, 3e-7 pu of the servomotor; friction that falls with speed costs the most.
const BOUNDS: [(Signal, f64); 4] = [
    (Signal::SpoolPosition, 2e-4),
    (Signal::ServomotorPosition, 5e-5),
    (Signal::PilotValvePosition, 3e-4),
    (Signal::ControlPressure, 3e4),
];

/// Root mean square of the difference of two runs in a signal, in its unit.
fn rms(one: &[Estimate], other: &[Estimate], signal: Signal) -> f64 {
    let square = |(a, b): (&Estimate, &Estimate)| (signal.of(&a.signals) - signal.of(&b.signals)).powi(2);
    (one.iter().zip(other).map(square).sum::<f64>() / one.len() as f64).sqrt()
}

#[test]
fn the_default_method_agrees_with_the_reference_method() {
    let recording = recording();
    for spec in CATALOGUE {
        let setting = typical(spec);
        let fast = simulate(std::slice::from_ref(&setting), Cut::Servomotor);
        let reference = Method::Rk4 { max_step_s: 5e-5 };
        let mut twin = Twin::with_method(&with(&[setting]), reference).with_cut(Cut::Servomotor);
        let slow = replay::simulate(&mut twin, &recording);
        for (signal, bound) in BOUNDS {
            let apart = rms(&fast, &slow, signal);
            assert!(apart < bound, "{}: {} apart by {apart:.1e} {}", spec.id, signal.id(), signal.unit());
        }
    }
}

/// The regulator reads the recording here, so that no sample of its dead band flips.
#[test]
fn the_response_is_continuous_in_each_parameter_and_never_stands_still() {
    for spec in CATALOGUE {
        // What acts on a driving spool shows behind it alone.
        let cut = if ["valve_lag", "flow_saturation"].contains(&spec.id) { Cut::Spool } else { Cut::Servomotor };
        for (k, p) in spec.parameters.iter().enumerate() {
            let scale = if p.typical == p.neutral { p.typical } else { p.typical - p.neutral };
            let at = |share: f64| {
                let mut setting: EffectSetting = typical(spec);
                setting.values[k] = p.neutral + share * scale;
                simulate(&[setting], cut)
            };
            let what = format!("{}.{}", spec.id, p.name);
            let here = at(0.777);
            let hair = at(0.777 + 1e-6);
            for signal in [Signal::SpoolPosition, Signal::ServomotorPosition] {
                let moved_pu = rms(&here, &hair, signal);
                assert!(moved_pu < 3e-5, "{what}: a millionth more moves {} by {moved_pu:.1e} pu", signal.id());
            }
            assert!(farthest(&here, &at(0.777 + 1e-3)) > 1e-7, "{what}: a thousandth more moves nothing");
        }
    }
}
