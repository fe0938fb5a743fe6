//! One thread's loops: each unit at its own deadlines, one after the other where these are the same.
//!
//! With the machine's clock the thread wakes at the next deadline of any unit; while all of them follow `/clock` or stand it sleeps until whoever
//! pushes an event unparks it. A unit that stands beside others that run is looked at whenever these wake.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Thread;
use std::time::Duration;

use super::super::control::RunState;
use super::super::realtime::{monotonic_ns, sleep_until, wall_ns};
use super::super::stats::Stats;
use super::{Integrator, TimeSource};

/// Behind by more than this, a loop leaves ticks out instead of catching up, ns.
const LARGEST_CATCH_UP_NS: i64 = 100_000_000;

/// How long a thread without a deadline sleeps where nobody wakes it.
const IDLE: Duration = Duration::from_millis(50);

/// How long it waits for room.
const BLOCKED: Duration = Duration::from_micros(200);

/// Runs these loops until `stop`, or until the fail-safe or a caller ends one of them; wakes `listener` when there are results.
/// Returns what each counted, in their order.
pub fn run(mut loops: Vec<Integrator>, stop: &AtomicBool, listener: &Thread) -> Vec<Stats> {
    for one in loops.iter_mut().filter(|one| one.pace.time == TimeSource::Wall) {
        one.restart_at(wall_ns());
    }
    while !stop.load(Ordering::Relaxed) && !loops.iter().any(Integrator::has_ended) {
        let next_ns = loops.iter_mut().filter_map(Integrator::next_deadline_ns).min();
        match next_ns {
            Some(next_ns) => sleep_until(next_ns),
            None if loops.iter().any(|one| one.has_work() && one.has_room()) => {}
            None => std::thread::park_timeout(if loops.iter().any(Integrator::has_work) { BLOCKED } else { IDLE }),
        }
        let mut have_news = false;
        for one in &mut loops {
            have_news |= one.wake(next_ns);
        }
        if have_news {
            listener.unpark();
        }
    }
    // Who waits for steps is told that they end here.
    loops.iter_mut().for_each(Integrator::interrupt);
    listener.unpark();
    loops.into_iter().map(Integrator::into_stats).collect()
}

impl Integrator {
    fn has_ended(&self) -> bool {
        self.stats.ended_by_fail_safe || self.stats.ended_by_caller
    }

    /// When it must wake next; `None` while it follows `/clock` or stands.
    fn next_deadline_ns(&mut self) -> Option<i64> {
        if self.follows() || self.state != RunState::Playing {
            self.deadline_ns = None;
        } else if self.deadline_ns.is_none() {
            // Deadlines lie on whole periods of the monotonic clock, so that loops on one machine can keep clear of each other.
            let now_ns = monotonic_ns();
            let deadline_ns = (now_ns / self.pace.period_ns + 2) * self.pace.period_ns;
            if self.stats.ticks == 0 && self.pace.time == TimeSource::Wall {
                self.restart_at(wall_ns() + (deadline_ns - now_ns));
            }
            self.deadline_ns = Some(deadline_ns);
        }
        self.deadline_ns
    }

    /// Does what is due at `due_ns`; returns whether there are results.
    fn wake(&mut self, due_ns: Option<i64>) -> bool {
        let Some(mut deadline_ns) = self.deadline_ns else { return self.turn(monotonic_ns()) };
        if due_ns.is_none_or(|due_ns| deadline_ns > due_ns) {
            return false;
        }
        let (woke_ns, period_ns) = (monotonic_ns(), self.pace.period_ns);
        let behind_ns = woke_ns - deadline_ns;
        if behind_ns > LARGEST_CATCH_UP_NS {
            let ticks = behind_ns / period_ns;
            self.skip(ticks);
            deadline_ns += ticks * period_ns;
        }
        let has_news = self.turn(woke_ns);
        self.stats.woke(deadline_ns, woke_ns, monotonic_ns(), period_ns);
        self.deadline_ns = Some(deadline_ns + period_ns);
        has_news
    }

    fn into_stats(mut self) -> Stats {
        self.stats.residual = self.core.corrector().map(|corrector| (*corrector.counts(), corrector.adaptation()));
        self.stats
    }
}
