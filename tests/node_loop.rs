//! The node's loop without its bus: pace, clocks, orders, exchanges of the twin.
#![cfg(feature = "node")]

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use govtwin_model::frame::EsvState;
use govtwin_model::parameters::EffectSetting;
use govtwin_model::params;
use govtwin_model::twin::Twin;
use govtwin_node::control::{Answer, Order, OrderOutcome, RunState};
use govtwin_node::core::{Core, InputEvent, NodeInput, Notices, OnStale, Policy};
use govtwin_node::integration::{AwaitedInputs, Ends, Integrator, LoopPace, TickOutput, TimeSource, TimedEvent, pool};
use govtwin_node::refit::Refit;

const MS: i64 = 1_000_000;

fn integrator(simulated: bool) -> (Integrator, Ends) {
    let policy = Policy { stale_after_ns: 1000 * MS, hold_ns: 1000 * MS, on_stale: OnStale::Trip };
    let core = Core::new(Twin::new(&params::reference()), policy, 6.3e6);
    let time = if simulated { TimeSource::Follow } else { TimeSource::Wall };
    Integrator::new(core, LoopPace { period_ns: MS, publish_period_ns: 10 * MS, time, paused: false }, 0)
}

fn hear(ends: &mut Ends, heard: &[InputEvent]) {
    for &heard in heard {
        ends.events.push(TimedEvent { arrived_ns: 0, heard, stamp_ns: 0 }).unwrap();
    }
}

const INPUTS: [InputEvent; 3] =
    [InputEvent::Command(0.3), InputEvent::Esv(EsvState::Normal), InputEvent::TankPressure(6.3e6)];

fn outputs(ends: &mut Ends) -> Vec<TickOutput> {
    std::iter::from_fn(|| ends.outputs.pop().ok()).collect()
}

#[test]
fn publishes_at_its_period_and_at_each_new_input() {
    let (mut integrator, mut ends) = integrator(false);
    hear(&mut ends, &INPUTS);
    for now in 0..100 {
        if now == 55 {
            hear(&mut ends, &[InputEvent::Command(0.31)]);
        }
        integrator.turn(now * MS);
    }
    let times: Vec<(i64, bool)> =
        outputs(&mut ends).iter().map(|output| (output.tick.frame.time_ns / MS, output.publish)).collect();
    let mut expected: Vec<(i64, bool)> = (0..10).map(|tenth| (tenth * 10, true)).collect();
    expected.insert(6, (55, false));
    assert_eq!(times, expected);
}

#[test]
fn a_skip_keeps_the_models_time_on_the_grid() {
    let (mut integrator, mut ends) = integrator(false);
    hear(&mut ends, &INPUTS);
    integrator.turn(0);
    integrator.skip(499);
    integrator.turn(500 * MS);
    assert_eq!(outputs(&mut ends).last().unwrap().tick.frame.time_ns, 500 * MS);
    assert_eq!(integrator.stats().skipped, 499);
}

#[test]
fn a_stall_leaves_no_simulated_time_out() {
    let (mut integrator, mut ends) = integrator(true);
    hear(&mut ends, &[InputEvent::Clock(0)]);
    integrator.turn(0);
    integrator.skip(500);
    hear(&mut ends, &[InputEvent::Clock(250 * MS)]);
    integrator.turn(500 * MS);
    assert_eq!((integrator.stats().ticks, integrator.stats().skipped), (251, 0));
}

#[test]
fn a_simulated_clock_sets_the_pace_and_a_jump_back_resets() {
    let (mut integrator, mut ends) = integrator(true);
    integrator.turn(0);
    assert!(outputs(&mut ends).is_empty(), "no tick before the clock speaks");
    hear(&mut ends, &[InputEvent::Clock(1000 * MS)]);
    hear(&mut ends, &INPUTS);
    hear(&mut ends, &[InputEvent::Clock(1050 * MS)]);
    integrator.turn(0);
    assert_eq!(integrator.stats().ticks, 51);
    let heard = outputs(&mut ends);
    assert!(heard[0].tick.frame.time_ns == 1000 * MS && !heard[0].publish, "ages are known before the first estimate");
    assert!(heard[1].tick.frame.time_ns == 1001 * MS && heard[1].publish);
    hear(&mut ends, &[InputEvent::Clock(10 * MS)]);
    integrator.turn(0);
    let back = outputs(&mut ends);
    assert!(back[0].tick.notices.has(Notices::RESET) && back[0].tick.frame.time_ns == 10 * MS);
}

#[test]
fn a_leap_of_the_clock_starts_anew_instead_of_integrating_it() {
    let (mut integrator, mut ends) = integrator(true);
    hear(&mut ends, &[InputEvent::Clock(0)]);
    hear(&mut ends, &INPUTS);
    // Ten seconds are followed tick by tick, whatever comes after only where it is another time.
    for (second, ticks) in [(10, 10_001), (21, 10_002), (1_700_000_000, 10_003)] {
        let clock_ns = second * 1000 * MS;
        hear(&mut ends, &[InputEvent::Clock(clock_ns)]);
        integrator.turn(0);
        assert_eq!(integrator.stats().ticks, ticks);
        let last = outputs(&mut ends).pop().unwrap().tick;
        assert_eq!(last.frame.time_ns, clock_ns);
        assert_eq!((last.notices.has(Notices::RESET), last.estimate.is_none()), (second > 10, second > 10));
    }
    hear(&mut ends, &INPUTS);
    hear(&mut ends, &[InputEvent::Clock(1_700_000_000_001 * MS)]);
    integrator.turn(0);
    assert!(outputs(&mut ends)[0].tick.notices.has(Notices::STARTED));
}

#[test]
fn an_input_before_the_first_clock_is_as_old_as_the_clock() {
    let (mut integrator, mut ends) = integrator(true);
    hear(&mut ends, &[InputEvent::Command(0.3), InputEvent::Clock(1_000_000 * MS)]);
    integrator.turn(0);
    hear(&mut ends, &[INPUTS[1], INPUTS[2], InputEvent::Clock(1_000_001 * MS)]);
    integrator.turn(MS);
    let heard = outputs(&mut ends);
    assert!(heard.iter().all(|output| !output.tick.notices.has(Notices::FAIL_SAFE)), "{heard:?}");
    let first = heard[1].tick;
    assert!(first.notices.has(Notices::STARTED) && first.frame.inputs.esv == EsvState::Normal, "{first:?}");
    assert_eq!(first.ages_ns[0], Some(MS));
}

fn own_time(paused: bool) -> (Integrator, Ends) {
    let policy = Policy { stale_after_ns: 1000 * MS, hold_ns: 1000 * MS, on_stale: OnStale::Trip };
    let core = Core::of_refit(Refit::new(&params::reference()), policy);
    Integrator::new(core, LoopPace { period_ns: MS, publish_period_ns: 10 * MS, time: TimeSource::Own, paused }, 0)
}

/// Gives an order and what is answered in the turns after it.
fn order(integrator: &mut Integrator, ends: &mut Ends, order: Order, now_ns: i64) -> Vec<Answer> {
    ends.events.push(TimedEvent { arrived_ns: now_ns, heard: InputEvent::Order(order, 7), stamp_ns: 0 }).unwrap();
    for _ in 0..60 {
        integrator.turn(now_ns);
    }
    std::iter::from_fn(|| ends.answers.pop().ok()).collect()
}

#[test]
fn steps_wait_for_a_new_sample_of_each_awaited_input_or_are_refused() {
    let (integrator, mut ends) = own_time(true);
    let of = [true, false, true, false];
    let mut integrator = integrator.awaiting(AwaitedInputs { of, timeout_ns: 100 * MS });
    hear(&mut ends, &INPUTS);
    let answers = |ends: &mut Ends| std::iter::from_fn(|| ends.answers.pop().ok()).collect::<Vec<_>>();
    // What came before the order counts.
    let done = order(&mut integrator, &mut ends, Order::Step { ticks: 10 }, 0);
    assert_eq!((done[0].outcome, integrator.stats().ticks), (OrderOutcome::Done, 10));
    // The next one waits, for both, and uses what comes meanwhile.
    assert!(order(&mut integrator, &mut ends, Order::Step { ticks: 5 }, 0).is_empty());
    let sample = |heard, stamp_ns| TimedEvent { arrived_ns: 0, heard, stamp_ns };
    ends.events.push(sample(InputEvent::Command(0.4), 70)).unwrap();
    integrator.turn(50 * MS);
    assert!(answers(&mut ends).is_empty() && integrator.stats().ticks == 10);
    ends.events.push(sample(InputEvent::TankPressure(6.2e6), 71)).unwrap();
    integrator.turn(60 * MS);
    let done = answers(&mut ends);
    assert_eq!(
        (done[0].outcome, done[0].stamps_ns, integrator.stats().ticks),
        (OrderOutcome::Done, [70, 0, 71, 0], 15)
    );
    let used = outputs(&mut ends).last().unwrap().tick;
    assert_eq!((used.frame.inputs.opening_command_pu, used.stamps_ns), (0.4, [70, 0, 71, 0]));
    // One that stays away is named, and nothing is stepped.
    assert!(order(&mut integrator, &mut ends, Order::Step { ticks: 5 }, 60 * MS).is_empty());
    ends.events.push(sample(InputEvent::Command(0.4), 72)).unwrap();
    integrator.turn(159 * MS);
    assert!(answers(&mut ends).is_empty());
    integrator.turn(161 * MS);
    assert_eq!(answers(&mut ends)[0].outcome, OrderOutcome::InputsMissing([false, false, true, false]));
    assert_eq!(integrator.stats().ticks, 15);
    // A pause ends the wait.
    order(&mut integrator, &mut ends, Order::Step { ticks: 5 }, 161 * MS);
    let outcomes: Vec<_> =
        order(&mut integrator, &mut ends, Order::Pause, 161 * MS).iter().map(|one| one.outcome).collect();
    assert_eq!(outcomes, [OrderOutcome::Interrupted, OrderOutcome::Done]);
}

#[test]
fn steps_advance_exactly_so_many_ticks_and_the_last_is_shown() {
    let (mut integrator, mut ends) = own_time(true);
    hear(&mut ends, &INPUTS);
    integrator.turn(0);
    assert_eq!(integrator.stats().ticks, 0, "it stands");
    let done = |outcome, state| vec![Answer { ticket: 7, outcome, state, stamps_ns: [0; 4] }];
    assert_eq!(
        order(&mut integrator, &mut ends, Order::Step { ticks: 1 }, 0),
        done(OrderOutcome::Done, RunState::Paused)
    );
    assert_eq!(
        order(&mut integrator, &mut ends, Order::Step { ticks: 1003 }, 0),
        done(OrderOutcome::Done, RunState::Paused)
    );
    assert_eq!(integrator.stats().ticks, 1004);
    let shown = outputs(&mut ends);
    assert_eq!(shown.last().map(|output| (output.tick.frame.time_ns, output.publish)), Some((1003 * MS, true)));
    assert_eq!(shown.iter().filter(|output| output.publish).count(), 102, "every tenth, and the last");
    assert_eq!(
        order(&mut integrator, &mut ends, Order::Step { ticks: 0 }, 0),
        done(OrderOutcome::Done, RunState::Paused)
    );
    assert_eq!(order(&mut integrator, &mut ends, Order::Play, 0), done(OrderOutcome::Done, RunState::Playing));
    assert_eq!(order(&mut integrator, &mut ends, Order::Play, 0), done(OrderOutcome::Already, RunState::Playing));
    let refused = order(&mut integrator, &mut ends, Order::Step { ticks: 1 }, 0);
    assert_eq!(refused, done(OrderOutcome::NotPaused, RunState::Playing));
}

#[test]
fn steps_wait_for_room_and_other_orders_end_them() {
    let (mut integrator, mut ends) = own_time(true);
    hear(&mut ends, &INPUTS);
    assert!(order(&mut integrator, &mut ends, Order::Step { ticks: 10_000_000 }, 0).is_empty());
    let busy = order(&mut integrator, &mut ends, Order::Step { ticks: 5 }, 0);
    assert_eq!(busy.iter().map(|answer| answer.outcome).collect::<Vec<_>>(), [OrderOutcome::Busy]);
    for _ in 0..2000 {
        integrator.turn(0);
    }
    let before = integrator.stats().ticks;
    integrator.turn(0);
    assert_eq!((integrator.stats().ticks, integrator.stats().lost_outputs), (before, 0), "no room, no tick");
    let outcomes: Vec<OrderOutcome> =
        order(&mut integrator, &mut ends, Order::Pause, 0).iter().map(|answer| answer.outcome).collect();
    assert_eq!(outcomes, [OrderOutcome::Interrupted, OrderOutcome::Done]);
    assert_eq!(integrator.stats().ticks, before);
    let ahead = outputs(&mut ends).len();
    assert!(ahead <= 600, "whoever ends the steps waits for {ahead} results");
}

#[test]
fn a_simulation_that_stands_ages_nothing_and_trips_nothing() {
    let (mut integrator, mut ends) = own_time(false);
    hear(&mut ends, &INPUTS);
    for now in 0..100 {
        integrator.turn(now * MS);
    }
    let hour_ns = 3_600_000 * MS;
    assert_eq!(order(&mut integrator, &mut ends, Order::Pause, 100 * MS)[0].state, RunState::Paused);
    assert_eq!(order(&mut integrator, &mut ends, Order::Play, hour_ns)[0].state, RunState::Playing);
    outputs(&mut ends);
    integrator.turn(hour_ns + MS);
    let ages = integrator.stats().summary(0).command_age.max_us;
    assert!(ages < 200_000.0, "{ages}");
    assert!(outputs(&mut ends).iter().all(|output| !output.tick.fail_safe));
    // Steps age it, on the model's time: the fail-safe comes as it would with the clock.
    order(&mut integrator, &mut ends, Order::Pause, hour_ns);
    order(&mut integrator, &mut ends, Order::Step { ticks: 2500 }, hour_ns);
    assert!(outputs(&mut ends).last().unwrap().tick.fail_safe);
}

#[test]
fn reset_and_stop_set_back_twin_and_time_and_keep_what_was_heard() {
    let (mut integrator, mut ends) = own_time(false);
    hear(&mut ends, &INPUTS);
    integrator.turn(0);
    hear(&mut ends, &[InputEvent::Command(0.6)]);
    for now in 1..300 {
        integrator.turn(now * MS);
    }
    outputs(&mut ends);
    assert_eq!(order(&mut integrator, &mut ends, Order::Reset { time: true }, 300 * MS)[0].outcome, OrderOutcome::Done);
    let first = outputs(&mut ends)[0];
    assert_eq!(first.tick.frame.time_ns, 0);
    assert!(first.tick.notices.has(Notices::RESTARTED) && first.tick.notices.has(Notices::STARTED));
    assert!((first.tick.estimate.unwrap().signals.servomotor_position_pu - 0.6).abs() < 1e-2);
    let stopped = order(&mut integrator, &mut ends, Order::Stop, 400 * MS);
    assert_eq!((stopped[0].outcome, stopped[0].state), (OrderOutcome::Done, RunState::Stopped));
    let ticks = integrator.stats().ticks;
    integrator.turn(500 * MS);
    assert_eq!(integrator.stats().ticks, ticks);
    order(&mut integrator, &mut ends, Order::Quit, 500 * MS);
    assert!(integrator.stats().ended_by_caller);
}

#[test]
fn a_refit_takes_hold_between_two_ticks_and_gives_the_old_twin_back() {
    let (mut integrator, mut ends) = own_time(false);
    hear(&mut ends, &INPUTS);
    for now in 0..50 {
        integrator.turn(now * MS);
    }
    let before = outputs(&mut ends).last().unwrap().tick.estimate.unwrap();
    let mut unit = params::reference();
    unit.effects.push(EffectSetting { id: "servo_leak".to_owned(), values: vec![2e-8] });
    unit.parameters.servomotor.load_closed_n += 1e5;
    ends.refits.push(Box::new(Refit::new(&unit))).unwrap();
    hear(&mut ends, &[InputEvent::Refit]);
    integrator.turn(50 * MS);
    let after = outputs(&mut ends);
    assert!(after[0].tick.notices.has(Notices::REFITTED));
    let moved = after[0].tick.estimate.unwrap().signals.servomotor_position_pu - before.signals.servomotor_position_pu;
    assert!(moved.abs() < 1e-3, "no jump: {moved}");
    assert!(ends.retired.pop().is_ok());
}

#[test]
fn a_load_force_moves_the_piston_and_falls_away_with_its_source() {
    let (mut integrator, mut ends) = own_time(false);
    hear(&mut ends, &INPUTS);
    hear(&mut ends, &[InputEvent::Load(3.0e5)]);
    let mut farthest_pu: f64 = 0.0;
    let mut last = None;
    for now in 0..4000 {
        let keep = [InputEvent::Command(0.3), InputEvent::Esv(EsvState::Normal), InputEvent::TankPressure(6.3e6)];
        for heard in keep {
            ends.events.push(TimedEvent { arrived_ns: now * MS, heard, stamp_ns: 0 }).unwrap();
        }
        integrator.turn(now * MS);
        for output in outputs(&mut ends) {
            farthest_pu = farthest_pu.max(output.tick.estimate.unwrap().opening_chamber_pressure_pa);
            last = Some(output.tick);
        }
    }
    let last = last.unwrap();
    // On_stale is `trip` for all here: a coupling that dies must not go unseen.
    assert!(last.fail_safe && last.frame.inputs.piston_force_n.abs() < 1e-9, "{last:?}");
    assert_eq!(last.frame.inputs.esv, EsvState::Shutdown);
    assert!(last.ages_ns[NodeInput::Load as usize].is_some());
}

#[test]
fn units_of_one_thread_keep_their_own_rates_and_one_that_ends_ends_all() {
    let (one, mut one_ends) = own_time(false);
    let policy = Policy { stale_after_ns: 10_000 * MS, hold_ns: 1000 * MS, on_stale: OnStale::Trip };
    let core = Core::of_refit(Refit::new(&params::reference()), policy);
    let pace = LoopPace { period_ns: 5 * MS, publish_period_ns: 10 * MS, time: TimeSource::Own, paused: false };
    let (slow, mut slow_ends) = Integrator::new(core, pace, 0);
    let (standing, mut standing_ends) = own_time(true);
    for ends in [&mut one_ends, &mut slow_ends, &mut standing_ends] {
        hear(ends, &INPUTS);
    }
    let stop = AtomicBool::new(false);
    let stats = std::thread::scope(|scope| {
        let listener = std::thread::current();
        let thread = scope.spawn(move || pool::run(vec![one, slow, standing], &stop, &listener));
        std::thread::sleep(Duration::from_millis(300));
        let steps = InputEvent::Order(Order::Step { ticks: 7 }, 1);
        standing_ends.events.push(TimedEvent { arrived_ns: 0, heard: steps, stamp_ns: 0 }).unwrap();
        std::thread::sleep(Duration::from_millis(100));
        assert!(!thread.is_finished());
        slow_ends
            .events
            .push(TimedEvent { arrived_ns: 0, heard: InputEvent::Order(Order::Quit, 2), stamp_ns: 0 })
            .unwrap();
        thread.join().unwrap()
    });
    let [one, slow, standing] = &stats[..] else { panic!("{} of 3", stats.len()) };
    // A busy machine may take the thread away; ticks left out are told.
    let fast = one.ticks + one.skipped;
    assert!(fast > 300 && fast.abs_diff(5 * (slow.ticks + slow.skipped)) < 50, "{fast}, {}", slow.ticks);
    assert!(slow.ended_by_caller && !one.ended_by_caller);
    assert_eq!(standing.ticks, 7);
    assert!(outputs(&mut one_ends).len() > 20 && outputs(&mut slow_ends).len() > 20);
}
