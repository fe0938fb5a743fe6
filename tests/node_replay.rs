//! Live equals replay: what the node recorded gives its estimates again, to the last bit.
#![cfg(feature = "node")]

#[path = "support/journal.rs"]
pub mod journal;

use govtwin_model::frame::EsvState;
use govtwin_model::params;
use govtwin_model::twin::Twin;
use govtwin_node::control::Order;
use govtwin_node::core::{Core, InputEvent, OnStale, Policy};
use govtwin_node::integration::{Ends, Integrator, LoopPace, TickOutput, TimeSource, TimedEvent};
use govtwin_node::journal::{Journal, Names};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use journal::assert_replays;

const MS: i64 = 1_000_000;
const START_NS: i64 = 1_790_100_100_123_456_789;

fn names() -> Names {
    Names {
        inputs: ["/governor/command", "/governor/esv", "/governor/tank_pressure", "/sim/joint_commands"]
            .map(str::to_owned),
        servo_state: "/sim/servo_state".to_owned(),
        joint_states: "/sim/joint_states".to_owned(),
    }
}

fn integrator(pace: LoopPace, start_ns: i64) -> (Integrator, Ends) {
    let policy = Policy { stale_after_ns: 400 * MS, hold_ns: 200 * MS, on_stale: OnStale::Trip };
    let core = Core::new(Twin::new(&params::reference()), policy, 6.3e6);
    Integrator::new(core, pace, start_ns)
}

fn tell(ends: &mut Ends, arrived_ns: i64, heard: InputEvent) {
    ends.events.push(TimedEvent { arrived_ns, heard, stamp_ns: 0 }).unwrap();
}

/// Twelve seconds of a bench: steps and a ramp at a ragged rate, pressure dips, an ESV trip, a silence that
/// trips the fail-safe, a force on the piston, ticks left out after a stall.
fn scripted(publish_period_ns: i64, record: &mut dyn FnMut(&TickOutput)) -> u64 {
    let pace = LoopPace { period_ns: MS, publish_period_ns, time: TimeSource::Wall, paused: false };
    let (mut integrator, mut ends) = integrator(pace, START_NS);
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut recorded = 0;
    let mut step = 0;
    while step < 12_000_i64 {
        let now_ns = step * MS;
        let silent = (9000..10_000).contains(&step);
        if step > 20 && !silent && random.random_bool(0.11) {
            let opening = match step {
                ..2000 => 0.3,
                2000..5000 => 0.3 + 1e-4 * (step - 2000) as f64,
                _ => 0.45,
            };
            tell(&mut ends, now_ns, InputEvent::Command(opening));
        }
        if step > 35 && !silent && step % 50 == 0 {
            tell(&mut ends, now_ns, InputEvent::TankPressure(6.3e6 - random.random_range(0.0..4.0e5)));
        }
        if !silent && step % 250 == 0 {
            let trip = (6000..7500).contains(&step);
            tell(&mut ends, now_ns, InputEvent::Esv(if trip { EsvState::Shutdown } else { EsvState::Normal }));
        }
        // A coupled water column: it comes after the first ticks, and falls away for a while.
        if (500..11_000).contains(&step) && !silent && step % 5 == 0 {
            tell(&mut ends, now_ns, InputEvent::Load(8e4 * (1e-3 * step as f64).sin()));
        }
        if step == 3333 {
            integrator.skip(120);
            step += 120;
        }
        integrator.turn(step * MS);
        while let Ok(output) = ends.outputs.pop() {
            record(&output);
            recorded += 1;
        }
        step += 1;
    }
    assert_eq!(integrator.stats().lost_outputs, 0);
    recorded
}

#[test]
fn what_the_node_recorded_replays_to_the_last_bit() {
    for publish_ms in [1, 7, 10] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live");
        let mut journal = Journal::create(&path, &names()).unwrap();
        let mut tripped = false;
        let recorded = scripted(publish_ms * MS, &mut |output| {
            tripped |= output.tick.frame.inputs.esv == EsvState::Shutdown;
            journal.write(&output.tick).unwrap();
        });
        journal.finish().unwrap();
        assert!(tripped && recorded > 1300);
        assert_replays(&path, 1300);
    }
}

#[test]
fn with_a_simulated_clock_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("simulated");
    let mut journal = Journal::create(&path, &names()).unwrap();
    let (mut integrator, mut ends) =
        integrator(LoopPace { period_ns: MS, publish_period_ns: 10 * MS, time: TimeSource::Follow, paused: false }, 0);
    for step in 0..800_i64 {
        // Half-way the clock jumps back to the beginning, as a recording that is played again.
        let clock_ns = START_NS + step % 400 * 10 * MS;
        tell(&mut ends, 0, InputEvent::Clock(clock_ns));
        tell(&mut ends, 0, InputEvent::Command(if step % 400 < 100 { 0.2 } else { 0.6 }));
        tell(&mut ends, 0, InputEvent::TankPressure(6.3e6));
        tell(&mut ends, 0, InputEvent::Esv(EsvState::Normal));
        if step % 3 == 0 {
            integrator.turn(0);
        }
    }
    while let Ok(output) = ends.outputs.pop() {
        journal.write(&output.tick).unwrap();
    }
    let bags = journal.finish().unwrap();
    assert_eq!(bags, [path.clone(), folder.path().join("simulated_2")]);
    for bag in bags {
        assert_replays(&bag, 390);
    }
}

#[test]
fn a_twin_that_was_set_back_begins_another_bag_and_both_replay() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("reset");
    let mut journal = Journal::create(&path, &names()).unwrap();
    let (mut integrator, mut ends) =
        integrator(LoopPace { period_ns: MS, publish_period_ns: 10 * MS, time: TimeSource::Own, paused: false }, 0);
    for step in 0..4000_i64 {
        if step % 100 == 0 {
            tell(&mut ends, step * MS, InputEvent::Command(if step % 2000 < 1000 { 0.2 } else { 0.6 }));
            tell(&mut ends, step * MS, InputEvent::TankPressure(6.3e6));
            tell(&mut ends, step * MS, InputEvent::Esv(EsvState::Normal));
        }
        if step == 1777 {
            tell(&mut ends, step * MS, InputEvent::Order(Order::Reset { time: true }, 1));
        }
        integrator.turn(step * MS);
    }
    while let Ok(output) = ends.outputs.pop() {
        journal.write(&output.tick).unwrap();
    }
    let bags = journal.finish().unwrap();
    assert_eq!(bags, [path.clone(), folder.path().join("reset_2")]);
    for (bag, rows) in bags.iter().zip([170, 220]) {
        assert_replays(bag, rows);
    }
}

#[test]
fn inputs_that_repeat_themselves_change_nothing() {
    let mut estimates = [Vec::new(), Vec::new()];
    for (repeat, estimates) in [1, 5].into_iter().zip(&mut estimates) {
        let (mut integrator, mut ends) = integrator(
            LoopPace { period_ns: MS, publish_period_ns: MS, time: TimeSource::Wall, paused: false },
            START_NS,
        );
        for step in 0..2000_i64 {
            if step % 100 == 0 {
                for _ in 0..repeat {
                    tell(&mut ends, step * MS, InputEvent::Command(0.3 + 0.1 * f64::from(u8::from(step >= 1000))));
                    tell(&mut ends, step * MS, InputEvent::TankPressure(6.3e6));
                    tell(&mut ends, step * MS, InputEvent::Esv(EsvState::Normal));
                }
            }
            integrator.turn(step * MS);
            while let Ok(output) = ends.outputs.pop() {
                estimates.push(output.tick.estimate.unwrap().signals.servomotor_position_pu.to_bits());
            }
        }
    }
    assert_eq!(estimates[0], estimates[1]);
    assert_eq!(estimates[0].len(), 2000);
}
