//! Another unit for a running twin: built by a thread that may take memory, taken over between two ticks by one that may not.

use govtwin_correction::corrector::Corrector;
use govtwin_model::parameters::Unit;
use govtwin_model::twin::Twin;

/// A unit's twin with what the node needs to know of it.
#[derive(Debug)]
pub struct Refit {
    /// The twin.
    pub twin: Twin,
    /// Spool's reference stroke and servomotor's stroke.
    pub strokes_m: [f64; 2],
    /// The sheet's tank pressure, Pa gauge.
    pub tank_pressure_pa: f64,
    /// The learned residual of the unit that was left, which ends with it.
    pub corrector: Option<Corrector>,
}

impl Refit {
    /// The twin of a unit.
    pub fn new(unit: &Unit) -> Self {
        let (parameters, twin) = (&unit.parameters, Twin::new(unit));
        let tank_pressure_pa = parameters.oil.tank_pressure_pa;
        let strokes_m = [parameters.distributing_valve.reference_stroke_m, parameters.servomotor.stroke_m];
        Self { twin, strokes_m, tank_pressure_pa, corrector: None }
    }
}

#[cfg(test)]
mod tests {
    use super::Refit;
    use govtwin_model::frame::{Estimate, EsvState, Frame, Inputs, Signals};
    use govtwin_model::parameters::EffectSetting;
    use govtwin_model::twin::Twin;

    const MS: i64 = 1_000_000;

    fn frame(step: i64, opening_command_pu: f64) -> Frame {
        let inputs = Inputs { opening_command_pu, esv: EsvState::Normal, tank_pressure_pa: 6.3e6, piston_force_n: 0.0 };
        Frame { time_ns: step * MS, inputs, measured: Signals::NONE }
    }

    fn run(twin: &mut Twin, steps: std::ops::Range<i64>, opening_command_pu: f64) -> Estimate {
        steps.map(|step| twin.step(&frame(step, opening_command_pu))).last().unwrap()
    }

    #[test]
    fn a_twin_goes_on_as_another_without_a_jump_and_as_that_one_would() {
        let unit = govtwin_model::params::reference();
        let mut leaky = unit.clone();
        leaky.effects.push(EffectSetting { id: "servo_leak".to_owned(), values: vec![2e-9] });
        let mut lagging = leaky.clone();
        lagging.effects.push(EffectSetting { id: "esv_slow".to_owned(), values: vec![0.5; 1] });
        let mut twin = Refit::new(&unit);
        run(&mut twin.twin, 0..10, 0.3);
        let before = run(&mut twin.twin, 10..400, 0.6);
        for other in [&leaky, &lagging, &unit] {
            let mut next = Refit::new(other);
            twin.twin.go_on_as(&mut next.twin);
            let after = twin.twin.step(&frame(399, 0.6));
            assert_eq!(after.signals, before.signals, "the same instant");
        }
        // Back on the first unit it moves as if nothing had been exchanged.
        let mut straight = Refit::new(&unit);
        run(&mut straight.twin, 0..10, 0.3);
        run(&mut straight.twin, 10..400, 0.6);
        assert_eq!(run(&mut twin.twin, 400..600, 0.6), run(&mut straight.twin, 400..600, 0.6));
    }
}
