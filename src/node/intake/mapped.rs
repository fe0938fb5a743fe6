//! Values that a map found in messages of other types: checked as those of our own types are.

use super::{OPENING_RANGE_PU, PRESSURE_RANGE_PA, Refusal, TopicGate, in_range};
use crate::core::{InputEvent, NodeInput};
use govtwin_bag::import::{FieldState, Target};
use govtwin_model::frame::EsvState;

/// The input that a signal drives; none for what is measured.
pub(crate) fn input_of(target: Target) -> Option<NodeInput> {
    match target {
        Target::OpeningCommand => Some(NodeInput::Command),
        Target::Esv => Some(NodeInput::Esv),
        Target::TankPressure => Some(NodeInput::TankPressure),
        _ => None,
    }
}

/// Checks a value of an input against what may be; `stamp_ns` is the time that the message itself has.
///
/// # Errors
/// With the reason for which it is not used, counted already.
pub(crate) fn checked(
    target: Target,
    value: f64,
    stamp_ns: Option<i64>,
    gate: &mut TopicGate,
) -> Result<InputEvent, Refusal> {
    let heard = match target {
        Target::OpeningCommand => in_range(value, OPENING_RANGE_PU).map(InputEvent::Command),
        Target::TankPressure => in_range(value, PRESSURE_RANGE_PA).map(InputEvent::TankPressure),
        _ if value == 0.0 => Ok(InputEvent::Esv(EsvState::Shutdown)),
        _ => Ok(InputEvent::Esv(EsvState::Normal)),
    };
    gate.pass_at(stamp_ns.unwrap_or(0), heard)
}

/// Why a message gives no value of a signal; none where it does.
pub(crate) fn refusal_of(state: FieldState) -> Option<Refusal> {
    match state {
        FieldState::Value => None,
        FieldState::Absent => Some(Refusal::FieldAbsent),
        FieldState::Twice => Some(Refusal::Twice),
        FieldState::NotFinite => Some(Refusal::NotFinite),
        FieldState::Text => Some(Refusal::Text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mapped_values_pass_the_same_gate_as_those_of_our_own_types() {
        let mut gate = TopicGate::default();
        let mut check = |target, value, stamp_ns| checked(target, value, stamp_ns, &mut gate);
        assert_eq!(check(Target::OpeningCommand, 0.4, Some(2_000)), Ok(InputEvent::Command(0.4)));
        assert_eq!(check(Target::OpeningCommand, 0.5, Some(1_000)), Err(Refusal::Late));
        assert_eq!(check(Target::OpeningCommand, 0.5, None), Ok(InputEvent::Command(0.5)), "no stamp, no order");
        assert_eq!(check(Target::OpeningCommand, 40.0, None), Err(Refusal::OutOfRange), "per cent without a unit");
        assert_eq!(check(Target::TankPressure, f64::INFINITY, None), Err(Refusal::NotFinite));
        assert_eq!(check(Target::Esv, 0.0, None), Ok(InputEvent::Esv(EsvState::Shutdown)));
        assert_eq!((gate.counts().used, gate.counts().all_refused()), (3, 3));
    }
}
