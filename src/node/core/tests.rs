//! Waiting, silence, fail-safes and trips, tick by tick.

use super::{Core, InputEvent, InputState, NodeInput, Notices, OnStale, Policies, Policy, Rule};
use govtwin_model::frame::EsvState;
use govtwin_model::twin::Twin;

const MS: i64 = 1_000_000;

fn core(on_stale: OnStale) -> Core {
    let policy = Policy { stale_after_ns: 100 * MS, hold_ns: 50 * MS, on_stale };
    Core::new(Twin::new(&govtwin_model::params::reference()), policy, 6.3e6)
}

fn hear_all(core: &mut Core, now_ns: i64) {
    core.hear(InputEvent::Command(0.4), now_ns);
    core.hear(InputEvent::Esv(EsvState::Normal), now_ns);
    core.hear(InputEvent::TankPressure(6.2e6), now_ns);
}

#[test]
fn waits_for_all_inputs_then_starts_at_their_steady_state() {
    let mut core = core(OnStale::Trip);
    core.hear(InputEvent::Command(0.4), 0);
    assert_eq!(core.tick(0, 0).estimate, None);
    hear_all(&mut core, 0);
    let tick = core.tick(MS, MS);
    assert!(tick.notices.has(Notices::STARTED) && tick.inputs_changed);
    let position_pu = tick.estimate.unwrap().signals.servomotor_position_pu;
    assert!((position_pu - 0.4).abs() < 1e-2, "{position_pu}");
    assert!(!core.tick(2 * MS, 2 * MS).inputs_changed);
}

#[test]
fn silence_is_announced_held_tripped_and_released_once_each() {
    let mut core = core(OnStale::Trip);
    hear_all(&mut core, 0);
    let mut seen = Vec::new();
    for step in 0..400 {
        let now_ns = step * MS;
        if step >= 300 {
            hear_all(&mut core, now_ns);
        }
        let tick = core.tick(now_ns, now_ns);
        let tripped = (151..300).contains(&step);
        assert_eq!(tick.frame.inputs.esv == EsvState::Shutdown, tripped, "at {step} ms");
        if tick.notices != Notices::default() {
            seen.push((step, tick.notices));
        }
    }
    let steps: Vec<i64> = seen.iter().map(|(step, _)| *step).collect();
    assert_eq!(steps, [0, 101, 151, 300]);
    assert!(NodeInput::ALL[..3].iter().all(|&input| seen[1].1.has(Notices::stale(input))));
    assert!(seen[2].1.has(Notices::FAIL_SAFE));
    assert!(seen[3].1.has(Notices::RELEASED) && seen[3].1.has(Notices::recovered(NodeInput::Esv)));
}

#[test]
fn a_trip_that_latches_stays_when_the_inputs_are_back_until_it_is_reset() {
    let mut core = core(OnStale::Trip).latching(true);
    hear_all(&mut core, 0);
    let mut tick = |now_ns: i64, hears: bool, resets: bool| {
        if hears {
            hear_all(&mut core, now_ns);
        }
        let reset = resets.then(|| core.reset_trip());
        let tick = core.tick(now_ns, now_ns);
        (tick.frame.inputs.esv == EsvState::Shutdown, tick.latched, tick.notices.has(Notices::RELEASED), reset)
    };
    assert_eq!(tick(MS, false, true), (false, false, false, Some(false)));
    assert_eq!(tick(200 * MS, false, false), (true, true, false, None));
    assert_eq!(tick(201 * MS, true, false), (true, true, false, None));
    assert_eq!(tick(202 * MS, true, true), (false, false, true, Some(true)));
    // While the inputs are away a reset does not hold.
    assert_eq!(tick(600 * MS, false, true), (true, true, false, Some(false)));
    assert_eq!(tick(601 * MS, false, true), (true, true, false, Some(true)));
}

#[test]
fn hold_goes_on_and_stop_asks_to_end() {
    let mut holding = core(OnStale::Hold);
    let mut stopping = core(OnStale::Stop);
    hear_all(&mut holding, 0);
    hear_all(&mut stopping, 0);
    let far_ns = 10_000 * MS;
    let tick = holding.tick(far_ns, far_ns);
    assert!(tick.frame.inputs.esv == EsvState::Normal && !tick.stop);
    assert!(stopping.tick(far_ns, far_ns).stop);
}

#[test]
fn without_first_inputs_it_waits_and_says_what_for() {
    let mut core = core(OnStale::Trip);
    assert_eq!(core.tick(0, 0).estimate, None);
    core.hear(InputEvent::Command(0.4), MS);
    let tick = core.tick(151 * MS, 151 * MS);
    assert!(tick.estimate.is_none() && !tick.fail_safe && !tick.stop);
    assert!(
        tick.notices.has(Notices::missing(NodeInput::Esv))
            && tick.notices.has(Notices::missing(NodeInput::TankPressure))
    );
    assert_eq!(tick.states, [InputState::Held, InputState::Default, InputState::Default, InputState::Default]);
}

#[test]
fn an_optional_input_has_its_default_until_it_is_heard_and_its_own_limits_then() {
    let policy = Policy { stale_after_ns: 100 * MS, hold_ns: 50 * MS, on_stale: OnStale::Trip };
    let mut policies = Policies::from(policy);
    policies.rules[NodeInput::Esv as usize].required = false;
    let relaxed = Policy { stale_after_ns: 1000 * MS, hold_ns: 0, on_stale: OnStale::Default };
    policies.rules[NodeInput::TankPressure as usize] = Rule { policy: relaxed, required: false };
    policies.default_tank_pressure_pa = Some(5.9e6);
    let mut core = Core::new(Twin::new(&govtwin_model::params::reference()), policies, 6.3e6);
    let tick = |core: &mut Core, now: i64| {
        core.hear(InputEvent::Command(0.4), now * MS);
        core.tick(now * MS, now * MS)
    };
    let first = tick(&mut core, 0);
    assert!(first.estimate.is_some());
    assert_eq!((first.frame.inputs.esv, first.frame.inputs.tank_pressure_pa), (EsvState::Normal, 5.9e6));
    assert!(!tick(&mut core, 5000).fail_safe, "an optional input never heard is not missed");
    core.hear(InputEvent::TankPressure(6.1e6), 5000 * MS);
    assert_eq!(tick(&mut core, 6000).frame.inputs.tank_pressure_pa, 6.1e6);
    let late = tick(&mut core, 6001);
    assert!(late.fail_safe && late.states[2] == InputState::Failed);
    assert_eq!((late.frame.inputs.esv, late.frame.inputs.tank_pressure_pa), (EsvState::Normal, 5.9e6));
    core.hear(InputEvent::Esv(EsvState::Normal), 6001 * MS);
    let tripped = tick(&mut core, 6152);
    assert_eq!(tripped.frame.inputs.esv, EsvState::Shutdown);
    assert!(!tripped.is_clamped() && tick(&mut core, 6153).fail_safe);
}

#[test]
fn a_reset_forgets_what_was_heard() {
    let mut core = core(OnStale::Trip);
    hear_all(&mut core, 0);
    assert!(core.tick(0, 0).estimate.is_some());
    core.reset();
    let tick = core.tick(0, 0);
    assert!(tick.notices.has(Notices::RESET) && tick.estimate.is_none());
}
