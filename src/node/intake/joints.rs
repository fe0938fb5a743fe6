//! Joint commands: what they ask of the servomotor, as `ros2_control`'s topic based hardware sends them.

use super::super::messages::JOINTS;
use super::{OPENING_RANGE_PU, Refusal, TopicGate, in_range};
use govtwin_bag::msg::JointState;

/// Forces beyond this are none, N.
const LARGEST_FORCE_N: f64 = 1.0e8;

/// What a message asks for; what it leaves out, or gives as NaN, it does not ask for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointTarget {
    /// Opening command, pu of the stroke.
    pub opening_command_pu: Option<f64>,
    /// Force on the piston besides the sheet's load, N, + opens.
    pub load_n: Option<f64>,
}

/// Checks a joint command: `position` of the servomotor in metres, `effort` in newtons.
///
/// # Errors
/// With the reason for which it is not used.
pub(crate) fn asked(message: &JointState, stroke_m: f64, gate: &mut TopicGate) -> Result<JointTarget, Refusal> {
    gate.pass(&message.header, read(message, stroke_m))
}

fn read(message: &JointState, stroke_m: f64) -> Result<JointTarget, Refusal> {
    let index = message.joint(JOINTS[1]).map_err(|_| Refusal::Twice)?.ok_or(Refusal::NothingAsked)?;
    let at = |values: &[f64]| values.get(index).copied().filter(|value| !value.is_nan());
    let opening_command_pu = at(&message.position).map(|position_m| in_range(position_m / stroke_m, OPENING_RANGE_PU));
    let load_n = at(&message.effort).map(|force_n| in_range(force_n, (-LARGEST_FORCE_N, LARGEST_FORCE_N)));
    match (opening_command_pu.transpose()?, load_n.transpose()?) {
        (None, None) => Err(Refusal::NothingAsked),
        (opening_command_pu, load_n) => Ok(JointTarget { opening_command_pu, load_n }),
    }
}

#[cfg(test)]
mod tests {
    use super::{JointState, JointTarget, Refusal, TopicGate, asked};

    fn command(name: &str, position: &[f64], effort: &[f64]) -> JointState {
        JointState {
            name: vec!["spool".to_owned(), name.to_owned()],
            position: position.to_vec(),
            effort: effort.to_vec(),
            ..JointState::default()
        }
    }

    #[test]
    fn position_and_effort_of_the_servomotor_each_ask_for_something() {
        let ask = |position: &[f64], effort: &[f64]| {
            asked(&command("servomotor", position, effort), 0.6, &mut TopicGate::default())
        };
        let both = JointTarget { opening_command_pu: Some(0.5), load_n: Some(-2e5) };
        assert_eq!(ask(&[0.0, 0.3], &[0.0, -2e5]), Ok(both));
        assert_eq!(ask(&[0.0, f64::NAN], &[0.0, -2e5]), Ok(JointTarget { opening_command_pu: None, ..both }));
        assert_eq!(ask(&[0.0, 0.3], &[]), Ok(JointTarget { load_n: None, ..both }));
        for (position, effort, refusal) in [
            (vec![], vec![], Refusal::NothingAsked),
            (vec![0.3], vec![1.0], Refusal::NothingAsked),
            (vec![0.0, 3.0], vec![], Refusal::OutOfRange),
            (vec![0.0, f64::INFINITY], vec![], Refusal::NotFinite),
            (vec![0.0, 0.3], vec![0.0, 1e9], Refusal::OutOfRange),
        ] {
            assert_eq!(ask(&position, &effort), Err(refusal), "{position:?} {effort:?}");
        }
        let other = asked(&command("gate", &[0.0, 0.3], &[]), 0.6, &mut TopicGate::default());
        assert_eq!(other, Err(Refusal::NothingAsked));
        let mut twice = command("servomotor", &[0.3, 0.5], &[]);
        twice.name[0] = "servomotor".to_owned();
        assert_eq!(asked(&twice, 0.6, &mut TopicGate::default()), Err(Refusal::Twice));
    }
}
