//! The thread that integrates: absolute deadlines, no lock, no wait, no allocation, no DDS.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Thread;

use rtrb::{Consumer, Producer, RingBuffer};

use super::core::{Core, Heard, Notices, Tick};
use super::realtime::{monotonic_ns, sleep_until, wall_ns};
use super::stats::Stats;

/// Behind by more than this, the loop leaves ticks out instead of catching up, ns.
const LARGEST_CATCH_UP_NS: i64 = 100_000_000;

/// A simulated clock that leaps ahead by more than this is another time, as one that jumps back is, ns.
const LARGEST_CLOCK_STEP_NS: i64 = 10_000_000_000;

/// Room for what was heard and not yet taken: seconds of the fastest traffic.
const EVENTS: usize = 16_384;

/// Room for results not yet taken.
const OUTPUTS: usize = 16_384;

/// Something heard, and when, on the monotonic clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Arrival, ns of the monotonic clock.
    pub arrived_ns: i64,
    /// What it was.
    pub heard: Heard,
}

/// What leaves the loop: every tick that is to be published, or would be if it had an estimate, that took new inputs
/// or that has news.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// The tick.
    pub tick: Tick,
    /// Whether it is to be published.
    pub publish: bool,
    /// Overruns so far.
    pub overruns: u64,
    /// Largest lateness so far, us.
    pub worst_lateness_us: f64,
}

/// The loop's ends that the other threads hold.
pub struct Ends {
    /// Takes what was heard.
    pub events: Producer<Event>,
    /// Gives results.
    pub outputs: Consumer<Output>,
}

/// How the loop runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Time between two ticks, ns.
    pub period_ns: i64,
    /// Time between two published results, ns.
    pub publish_period_ns: i64,
    /// Whether the model's time follows `/clock` instead of counting ticks.
    pub simulated: bool,
}

/// The loop's state between two wake-ups.
pub struct Integrator {
    core: Core,
    pace: Pace,
    events: Consumer<Event>,
    outputs: Producer<Output>,
    stats: Stats,
    time_ns: i64,
    next_publish_ns: i64,
    clock_ns: Option<i64>,
    news: bool,
}

impl Integrator {
    /// A loop at rest, with its two rings. `time_ns` is the model's time at the first tick; with a simulated clock
    /// the clock gives it.
    #[must_use]
    pub fn new(core: Core, pace: Pace, time_ns: i64) -> (Self, Ends) {
        let (event_in, events) = RingBuffer::new(EVENTS);
        let (outputs, output_out) = RingBuffer::new(OUTPUTS);
        let integrator = Self {
            core,
            pace,
            events,
            outputs,
            stats: Stats::default(),
            time_ns,
            next_publish_ns: time_ns,
            clock_ns: None,
            news: false,
        };
        (integrator, Ends { events: event_in, outputs: output_out })
    }

    /// Counts so far.
    #[must_use]
    pub fn stats(&self) -> &Stats {
        &self.stats
    }

    /// One wake-up: takes what was heard, advances the twin, hands the results out. Returns whether there are any.
    pub fn turn(&mut self, now_ns: i64) -> bool {
        self.news = false;
        for _ in 0..EVENTS {
            let Ok(event) = self.events.pop() else { break };
            match event.heard {
                Heard::PublishPeriod(period_ns) => {
                    self.pace.publish_period_ns = period_ns;
                    self.next_publish_ns = self.time_ns;
                }
                Heard::Clock(clock_ns) if self.pace.simulated => self.follow(clock_ns),
                // Ages are counted on the clock that the model follows; they begin with its first word.
                heard if self.pace.simulated => self.core.hear(heard, self.clock_ns.unwrap_or(0)),
                heard => self.core.hear(heard, event.arrived_ns),
            }
        }
        if !self.pace.simulated {
            self.tick(now_ns);
        }
        self.news
    }

    /// Leaves out `ticks` ticks: the next one steps over them. A simulated clock says itself how far time is; it loses none.
    pub fn skip(&mut self, ticks: i64) {
        if self.pace.simulated {
            return;
        }
        self.time_ns += ticks * self.pace.period_ns;
        self.stats.skipped += u64::try_from(ticks).unwrap_or(0);
    }

    /// Runs until `stop`, or until the fail-safe ends the node; wakes `listener` when there are results.
    #[must_use]
    pub fn run(mut self, stop: &AtomicBool, listener: &Thread) -> Stats {
        let period_ns = self.pace.period_ns;
        // Deadlines lie on whole periods of the monotonic clock, so that loops on one machine can keep clear of each other.
        let mut deadline_ns = (monotonic_ns() / period_ns + 2) * period_ns;
        if !self.pace.simulated {
            self.time_ns = wall_ns() + (deadline_ns - monotonic_ns());
            self.next_publish_ns = self.time_ns;
        }
        while !stop.load(Ordering::Relaxed) && !self.stats.ended_by_fail_safe {
            sleep_until(deadline_ns);
            let woke_ns = monotonic_ns();
            let behind_ns = woke_ns - deadline_ns;
            if behind_ns > LARGEST_CATCH_UP_NS {
                let ticks = behind_ns / period_ns;
                self.skip(ticks);
                deadline_ns += ticks * period_ns;
            }
            if self.turn(woke_ns) {
                listener.unpark();
            }
            self.stats.woke(deadline_ns, woke_ns, monotonic_ns(), period_ns);
            deadline_ns += period_ns;
        }
        listener.unpark();
        self.stats.residual = self.core.corrector().map(|corrector| (*corrector.counts(), corrector.adaptation()));
        self.stats
    }

    /// Follows a simulated clock to `clock_ns`, tick by tick; where it jumps back or leaps far ahead, all begins anew there.
    fn follow(&mut self, clock_ns: i64) {
        match self.clock_ns {
            Some(before_ns) if clock_ns < before_ns || clock_ns - before_ns > LARGEST_CLOCK_STEP_NS => {
                self.core.reset();
                self.restart_at(clock_ns);
            }
            None => {
                self.core.begin_ages(clock_ns);
                self.restart_at(clock_ns);
            }
            Some(_) => {}
        }
        self.clock_ns = Some(clock_ns);
        while self.time_ns <= clock_ns {
            self.tick(self.time_ns);
        }
    }

    fn restart_at(&mut self, time_ns: i64) {
        self.time_ns = time_ns;
        self.next_publish_ns = time_ns;
    }

    /// One tick at the model's next time; `now_ns` is the time on which ages are counted.
    fn tick(&mut self, now_ns: i64) {
        let tick = self.core.tick(self.time_ns, now_ns);
        self.stats.ticked(&tick.ages_ns);
        self.stats.ended_by_fail_safe |= tick.stop;
        let due = self.time_ns >= self.next_publish_ns;
        if due {
            let periods = (self.time_ns - self.next_publish_ns) / self.pace.publish_period_ns + 1;
            self.next_publish_ns += periods * self.pace.publish_period_ns;
        }
        let publish = tick.estimate.is_some() && (due || tick.notices.has(Notices::STARTED));
        if due || publish || tick.inputs_changed || tick.notices != Notices::default() || tick.stop {
            let output = Output {
                tick,
                publish,
                overruns: self.stats.overruns,
                worst_lateness_us: self.stats.worst_lateness_us(),
            };
            self.stats.lost_outputs += u64::from(self.outputs.push(output).is_err());
            self.news = true;
        }
        self.time_ns += self.pace.period_ns;
    }
}

#[cfg(test)]
mod tests {
    use super::{Event, Integrator, Output, Pace};
    use crate::frame::EsvState;
    use crate::node::core::{Core, Heard, Notices, OnStale, Policy};
    use crate::twin::Twin;

    const MS: i64 = 1_000_000;

    fn integrator(simulated: bool) -> (Integrator, super::Ends) {
        let policy = Policy { stale_after_ns: 1000 * MS, hold_ns: 1000 * MS, on_stale: OnStale::Trip };
        let core = Core::new(Twin::new(&crate::params::reference()), policy, 6.3e6);
        Integrator::new(core, Pace { period_ns: MS, publish_period_ns: 10 * MS, simulated }, 0)
    }

    fn hear(ends: &mut super::Ends, heard: &[Heard]) {
        for &heard in heard {
            ends.events.push(Event { arrived_ns: 0, heard }).unwrap();
        }
    }

    const INPUTS: [Heard; 3] = [Heard::Command(0.3), Heard::Esv(EsvState::Normal), Heard::TankPressure(6.3e6)];

    fn outputs(ends: &mut super::Ends) -> Vec<Output> {
        std::iter::from_fn(|| ends.outputs.pop().ok()).collect()
    }

    #[test]
    fn publishes_at_its_period_and_at_each_new_input() {
        let (mut integrator, mut ends) = integrator(false);
        hear(&mut ends, &INPUTS);
        for now in 0..100 {
            if now == 55 {
                hear(&mut ends, &[Heard::Command(0.31)]);
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
        hear(&mut ends, &[Heard::Clock(0)]);
        integrator.turn(0);
        integrator.skip(500);
        hear(&mut ends, &[Heard::Clock(250 * MS)]);
        integrator.turn(500 * MS);
        assert_eq!((integrator.stats().ticks, integrator.stats().skipped), (251, 0));
    }

    #[test]
    fn a_simulated_clock_sets_the_pace_and_a_jump_back_resets() {
        let (mut integrator, mut ends) = integrator(true);
        integrator.turn(0);
        assert!(outputs(&mut ends).is_empty(), "no tick before the clock speaks");
        hear(&mut ends, &[Heard::Clock(1000 * MS)]);
        hear(&mut ends, &INPUTS);
        hear(&mut ends, &[Heard::Clock(1050 * MS)]);
        integrator.turn(0);
        assert_eq!(integrator.stats().ticks, 51);
        let heard = outputs(&mut ends);
        assert!(
            heard[0].tick.frame.time_ns == 1000 * MS && !heard[0].publish,
            "ages are known before the first estimate"
        );
        assert!(heard[1].tick.frame.time_ns == 1001 * MS && heard[1].publish);
        hear(&mut ends, &[Heard::Clock(10 * MS)]);
        integrator.turn(0);
        let back = outputs(&mut ends);
        assert!(back[0].tick.notices.has(Notices::RESET) && back[0].tick.frame.time_ns == 10 * MS);
    }

    #[test]
    fn a_leap_of_the_clock_starts_anew_instead_of_integrating_it() {
        let (mut integrator, mut ends) = integrator(true);
        hear(&mut ends, &[Heard::Clock(0)]);
        hear(&mut ends, &INPUTS);
        // Ten seconds are followed tick by tick, whatever comes after only where it is another time.
        for (second, ticks) in [(10, 10_001), (21, 10_002), (1_700_000_000, 10_003)] {
            let clock_ns = second * 1000 * MS;
            hear(&mut ends, &[Heard::Clock(clock_ns)]);
            integrator.turn(0);
            assert_eq!(integrator.stats().ticks, ticks);
            let last = outputs(&mut ends).pop().unwrap().tick;
            assert_eq!(last.frame.time_ns, clock_ns);
            assert_eq!((last.notices.has(Notices::RESET), last.estimate.is_none()), (second > 10, second > 10));
        }
        hear(&mut ends, &INPUTS);
        hear(&mut ends, &[Heard::Clock(1_700_000_000_001 * MS)]);
        integrator.turn(0);
        assert!(outputs(&mut ends)[0].tick.notices.has(Notices::STARTED));
    }

    #[test]
    fn an_input_before_the_first_clock_is_as_old_as_the_clock() {
        let (mut integrator, mut ends) = integrator(true);
        hear(&mut ends, &[Heard::Command(0.3), Heard::Clock(1_000_000 * MS)]);
        integrator.turn(0);
        hear(&mut ends, &[INPUTS[1], INPUTS[2], Heard::Clock(1_000_001 * MS)]);
        integrator.turn(MS);
        let heard = outputs(&mut ends);
        assert!(heard.iter().all(|output| !output.tick.notices.has(Notices::FAIL_SAFE)), "{heard:?}");
        let first = heard[1].tick;
        assert!(first.notices.has(Notices::STARTED) && first.frame.inputs.esv == EsvState::Normal, "{first:?}");
        assert_eq!(first.ages_ns[0], Some(MS));
    }
}
