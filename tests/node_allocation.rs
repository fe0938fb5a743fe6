//! The integration thread's wake-ups take no memory and give none back.
#![cfg(feature = "node")]

#[path = "support/residual.rs"]
mod residual;

use govtwin::frame::EsvState;
use govtwin::node::core::{Core, Heard, OnStale, Policy};
use govtwin::node::integration::{Event, Integrator, Pace};
use govtwin::params;
use govtwin::residual::corrector::Corrector;
use govtwin::twin::Twin;

const MS: i64 = 1_000_000;

/// Memory taken, and memory taken less memory given back.
fn calls_of(work: impl FnOnce()) -> (u64, i64) {
    let info = allocation_counter::measure(work);
    (info.count_total, info.count_current)
}

fn run(simulated: bool, corrected: bool) -> (u64, i64) {
    let policy = Policy { stale_after_ns: 100 * MS, hold_ns: 50 * MS, on_stale: OnStale::Trip };
    let unit = params::reference();
    let corrector = corrected.then(|| Corrector::new(&residual::model(&unit)).unwrap());
    let core = Core::new(Twin::new(&unit), policy, 6.3e6).with_corrector(corrector);
    let pace = Pace { period_ns: MS, publish_period_ns: 10 * MS, simulated };
    let (mut integrator, mut ends) = Integrator::new(core, pace, 0);
    calls_of(|| {
        for step in 0..3000_i64 {
            let now_ns = step * MS;
            let mut tell = |heard| ends.events.push(Event { arrived_ns: now_ns, heard }).unwrap();
            // Inputs with a silence in between, so that start, fail-safe and recovery are all in.
            if !(1000..1500).contains(&step) {
                tell(Heard::Command(if step < 500 { 0.3 } else { 0.5 }));
                tell(Heard::Esv(EsvState::Normal));
                tell(Heard::TankPressure(6.2e6));
            }
            if step == 2000 {
                tell(Heard::Policy(policy));
                tell(Heard::PublishPeriod(5 * MS));
            }
            if simulated {
                // A jump back at the end of every second.
                tell(Heard::Clock((step % 1000) * MS));
            }
            integrator.turn(now_ns);
            while ends.outputs.pop().is_ok() {}
        }
    })
}

#[test]
fn no_wake_up_calls_the_allocator() {
    assert_eq!(calls_of(|| drop(std::hint::black_box(Box::new(1)))), (1, 0), "the counter counts");
    for corrected in [false, true] {
        assert_eq!(run(false, corrected), (0, 0));
        assert_eq!(run(true, corrected), (0, 0));
    }
}
