//! The integration thread's wake-ups take no memory and give none back.
#![cfg(feature = "node")]

#[path = "support/residual.rs"]
mod residual;

use govtwin_correction::corrector::Corrector;
use govtwin_model::frame::EsvState;
use govtwin_model::params;
use govtwin_model::twin::Twin;
use govtwin_node::control::Order;
use govtwin_node::core::{Core, InputEvent, NodeInput, Notices, OnStale, Policy, Rule};
use govtwin_node::integration::{Integrator, LoopPace, TimeSource, TimedEvent};
use govtwin_node::refit::Refit;

const MS: i64 = 1_000_000;
/// Long enough for an alarm of drift, at five samples a second.
const TICKS: i64 = 6600;

/// Memory taken, and memory taken less memory given back.
fn calls_of(work: impl FnOnce()) -> (u64, i64) {
    let info = allocation_counter::measure(work);
    (info.count_total, info.count_current)
}

fn run(simulated: bool, corrected: bool, adapts: bool) -> (u64, i64) {
    let policy = Policy { stale_after_ns: 100 * MS, hold_ns: 50 * MS, on_stale: OnStale::Trip };
    let unit = params::reference();
    let model = residual::model(&unit);
    let corrector = corrected.then(|| Corrector::new(&model).unwrap());
    let corrector = corrector.map(|one| if adapts { one.adapting(&model).unwrap() } else { one });
    let core = Core::new(Twin::new(&unit), policy, 6.3e6).with_corrector(corrector);
    let time = if simulated { TimeSource::Follow } else { TimeSource::Wall };
    let pace = LoopPace { period_ns: MS, publish_period_ns: 10 * MS, time, paused: false };
    let mut drifted = false;
    let (mut integrator, mut ends) = Integrator::new(core, pace, 0);
    let mut refit = Some(Box::new(Refit::new(&unit)));
    let calls = calls_of(|| {
        for step in 0..TICKS {
            let now_ns = step * MS;
            let mut tell = |heard| ends.events.push(TimedEvent { arrived_ns: now_ns, heard, stamp_ns: 0 }).unwrap();
            // Inputs with a silence in between, so that start, fail-safe and recovery are all in.
            if !(1000..1500).contains(&step) {
                tell(InputEvent::Command(if step < 500 { 0.3 } else { 0.5 }));
                tell(InputEvent::Esv(EsvState::Normal));
                tell(InputEvent::TankPressure(6.2e6));
            }
            if step == 2000 {
                for input in NodeInput::ALL {
                    tell(InputEvent::Rule(input, Rule { policy, required: input != NodeInput::Load }));
                }
                tell(InputEvent::PublishPeriod(5 * MS));
            }
            if adapts && step % 20 == 0 {
                // A unit that has drifted far away.
                tell(InputEvent::Measured { spool_pu: 0.3, servomotor_pu: 0.4 });
            }
            match (step, simulated) {
                (6000, false) => tell(InputEvent::Order(Order::Pause, 1)),
                (6100, false) => tell(InputEvent::Order(Order::Step { ticks: 50 }, 2)),
                (6200, false) => tell(InputEvent::Order(Order::Reset { time: true }, 3)),
                (6300, false) => tell(InputEvent::Order(Order::Play, 4)),
                _ => {}
            }
            if step == 6400
                && let Some(refit) = refit.take()
            {
                ends.refits.push(refit).unwrap();
                tell(InputEvent::Refit);
            }
            if simulated {
                // A jump back at the end of every second.
                tell(InputEvent::Clock((step % 1000) * MS));
            }
            integrator.turn(now_ns);
            while let Ok(output) = ends.outputs.pop() {
                drifted |= output.tick.notices.has(Notices::DRIFT);
            }
        }
    });
    assert_eq!(drifted, adapts);
    calls
}

#[test]
fn no_wake_up_calls_the_allocator() {
    assert_eq!(calls_of(|| drop(std::hint::black_box(Box::new(1)))), (1, 0), "the counter counts");
    for (corrected, adapts) in [(false, false), (true, false), (true, true)] {
        assert_eq!(run(false, corrected, adapts), (0, 0));
        assert_eq!(run(true, corrected, adapts), (0, 0));
    }
}
