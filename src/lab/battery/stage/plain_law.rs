//! A servomotor stage by the plain law: a dead zone, a gain each way, a lag, a greatest speed.

use crate::battery::TrueFault;
use crate::battery::draws::Draw;

/// Effects that the plain law has as well.
pub(super) const PLAIN: [&str; 3] = ["port_asymmetry", "valve_lag", "flow_saturation"];

/// The plain law.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlainLaw {
    dead_pu: f64,
    gains_1_s: [f64; 2],
    lag_s: f64,
    most_1_s: f64,
    late_pu: f64,
}

impl PlainLaw {
    /// The speed at a position of the spool, pu/s.
    pub(super) fn speed(&mut self, spool_pu: f64, step_s: f64) -> f64 {
        let follows = if self.lag_s > 0.0 { 1.0 - (-step_s / self.lag_s).exp() } else { 1.0 };
        self.late_pu += follows * (spool_pu - self.late_pu);
        let (above, below) = ((self.late_pu - self.dead_pu).max(0.0), (self.late_pu + self.dead_pu).min(0.0));
        (self.gains_1_s[0] * above + self.gains_1_s[1] * below).clamp(-self.most_1_s, self.most_1_s)
    }
}

/// The plain law with the effects that it knows.
pub(super) fn plain_law(effects: &[TrueFault], draw: &mut Draw) -> PlainLaw {
    let size = |id: &str| effects.iter().find(|truth| truth.id == id).map_or(0.0, |truth| truth.size);
    let gain_1_s = draw.log_between(0.05, 0.3);
    let unequal = size("port_asymmetry");
    let saturated = size("flow_saturation");
    PlainLaw {
        dead_pu: draw.log_between(0.01, 0.12),
        gains_1_s: [gain_1_s * (1.0 + unequal), gain_1_s * (1.0 - unequal)],
        lag_s: size("valve_lag"),
        most_1_s: if saturated > 0.0 { gain_1_s * (1.0 - saturated) } else { f64::INFINITY },
        late_pu: 0.0,
    }
}
