//! What is wrong with a servomotor stage and in no catalogue.

use crate::battery::draws::Draw;

/// What no catalogue lists, with the range of its size, its unit and what it is.
pub(super) const STRANGERS: [(&str, [f64; 2], &str, &str); 6] = [
    ("odd_law", [0.06, 0.25], "1", "a law of the spool's opening of its own, by its share of the speed"),
    ("tide", [0.01, 0.05], "pu", "a position that sways by itself"),
    ("wandering_pressure", [0.2, 0.5], "1", "a pressure that wanders, by its share of the speed"),
    ("spool_play", [0.05, 0.2], "pu", "play between the spool and its transducer"),
    ("speed_by_place", [0.2, 0.4], "1", "a speed that goes up and down with the position, by its share"),
    ("sticking", [0.5, 2.0], "s", "a piston that stands still now and then, for so long"),
];
/// What no catalogue lists, as it goes on.
pub(super) struct Strange {
    what: (String, f64),
    /// Phase in radians and period in s.
    wave: [f64; 2],
    state_pu: f64,
    until_s: f64,
}

impl Strange {
    pub(super) fn new(of: Option<&(String, f64)>, draw: &mut Draw) -> Self {
        let what = of.cloned().unwrap_or_default();
        let wave = [draw.between(0.0, std::f64::consts::TAU), draw.log_between(5.0, 20.0)];
        Self { what, wave, state_pu: 0.0, until_s: 0.0 }
    }

    /// The spool behind its transducer's play.
    pub(super) fn spool_of(&mut self, recorded: f64) -> f64 {
        if self.what.0 != "spool_play" {
            return recorded;
        }
        self.state_pu = self.state_pu.clamp(recorded - 0.5 * self.what.1, recorded + 0.5 * self.what.1);
        self.state_pu
    }

    /// What is added to the position.
    pub(super) fn sway(&self, time_s: f64) -> f64 {
        if self.what.0 == "tide" {
            self.what.1 * (std::f64::consts::TAU * time_s / self.wave[1] + self.wave[0]).sin()
        } else {
            0.0
        }
    }

    /// What the speed is multiplied by.
    pub(super) fn factor(&mut self, opening: f64, time_s: f64, step_s: f64, draw: &mut Draw) -> f64 {
        match self.what.0.as_str() {
            "wandering_pressure" => {
                let keeps = (-step_s / self.wave[1]).exp();
                self.state_pu = keeps * self.state_pu + (1.0 - keeps * keeps).sqrt() * self.what.1 * draw.normal();
                1.0 + self.state_pu
            }
            "speed_by_place" => 1.0 + self.what.1 * (3.0 * std::f64::consts::TAU * opening + self.wave[0]).sin(),
            "sticking" => {
                if time_s >= self.until_s + self.what.1 {
                    self.until_s = time_s + draw.log_between(0.5, 1.5) * self.wave[1];
                }
                f64::from(u8::from(time_s < self.until_s))
            }
            _ => 1.0,
        }
    }
}
