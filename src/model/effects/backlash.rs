//! Play between the servomotor's piston and its position transducer.
//!
//! `Y_r` stays while `|Y − Y_r| ≤ b/2` and is dragged at the edge of the gap otherwise: the play operator
//! (Krasnosel'skii & Pokrovskii 1989, *Systems with Hysteresis*, section 2; Tao & Kokotović 1996, *Adaptive Control of Systems with
//! Actuator and Sensor Nonlinearities*, section 2.2). The regulator reads `Y_r`, and so does the recording.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | b | width of the gap `play_pu` | pu of stroke |
//! | Y, Y_r | piston position, reading | pu |
//!
//! Without it the real reading starts late after each reversal and stays behind by b until the next. Limits:
//! a gap without mass or friction of its own; it starts in mid-gap, or where what drove the servomotor before the first position left it.

use std::sync::Arc;

use crate::effects::EffectSpec;
use crate::plant::Plant;
use crate::plant::term::Point;
use crate::plant::term::play::Play;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "backlash", Servomotor, apply;
    "play_pu" ["pu"] 0.0 ..= 0.1, neutral 0.0, typical 2.0e-3: "play between piston and transducer, pu of stroke";
};

fn apply([play_pu]: [f64; 1], plant: &mut Plant) {
    if play_pu > 0.0 {
        plant.terms.push(Arc::new(Play::new(Point::ServomotorReading, play_pu)));
    }
}
