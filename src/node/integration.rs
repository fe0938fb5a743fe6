//! The thread that integrates: absolute deadlines, no lock, no wait, no allocation, no DDS.

mod orders;
pub mod pool;

use rtrb::{Consumer, Producer, RingBuffer};

use super::control::{AgeClock, Answer, RunState, Steps};
use super::core::{Core, InputEvent, NodeInput, Notices, Tick};
use super::refit::Refit;
use super::stats::Stats;

/// A simulated clock that leaps ahead by more than this is another time, as one that jumps back is, ns.
const LARGEST_CLOCK_STEP_NS: i64 = 10_000_000_000;

/// Room for what was heard and not yet taken: seconds of the fastest traffic.
const EVENTS: usize = 16_384;

/// Room for results not yet taken.
const OUTPUTS: usize = 16_384;

/// Most orders that wait for their answers.
pub(crate) const ANSWERS: usize = 64;

/// Most exchanges of the twin that wait.
pub(crate) const REFITS: usize = 4;

/// Without so much room for results a simulation that is ahead of them waits.
const ROOM_TO_STEP: usize = 256;

/// Steps that a caller ordered run no farther ahead of what is published than so many results: who ends them early is answered behind these.
const MOST_AHEAD: usize = 512;

/// Something heard, and when, on the monotonic clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedEvent {
    /// Arrival, ns of the monotonic clock.
    pub arrived_ns: i64,
    /// What it was.
    pub heard: InputEvent,
    /// Stamp of the sample, ns; 0 where it has none.
    pub stamp_ns: i64,
}

/// What leaves the loop: every tick that is to be published, or would be if it had an estimate, that took new inputs
/// or that has news.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickOutput {
    /// The tick.
    pub tick: Tick,
    /// Whether it is to be published.
    pub publish: bool,
    /// Steps that a caller ordered and that are still to come after this tick.
    pub steps_left: u64,
    /// Whether the loop waits for room, so that whoever publishes may wait for a reader.
    pub patient: bool,
    /// Overruns so far.
    pub overruns: u64,
    /// Largest lateness so far, us.
    pub worst_lateness_us: f64,
}

/// The loop's ends that the other threads hold.
pub struct Ends {
    /// Takes what was heard.
    pub events: Producer<TimedEvent>,
    /// Takes twins of changed parameters, each announced by [`InputEvent::Refit`].
    pub refits: Producer<Box<Refit>>,
    /// Gives back what was exchanged, for whoever may give back memory.
    pub retired: Consumer<Box<Refit>>,
    /// Gives results.
    pub outputs: Consumer<TickOutput>,
    /// Gives answers to orders; what led to an answer is among the results before it.
    pub answers: Consumer<Answer>,
}

/// Whose time the model's is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TimeSource {
    /// The machine's.
    #[default]
    Wall,
    /// That of `/clock`, tick by tick as it comes.
    Follow,
    /// Its own from 0 on, which others follow.
    Own,
}

/// How the loop runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopPace {
    /// Time between two ticks, ns.
    pub period_ns: i64,
    /// Time between two published results, ns.
    pub publish_period_ns: i64,
    /// Whose time the model's is.
    pub time: TimeSource,
    /// Whether it stands at first.
    pub paused: bool,
}

/// Inputs of which each order to step waits for a new sample: in lock-step a sample that is lost and sent again comes after the order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AwaitedInputs {
    /// Which.
    pub of: [bool; NodeInput::COUNT],
    /// How long, ns; an order whose inputs stay away longer is refused, and nothing is stepped.
    pub timeout_ns: i64,
}

/// The loop's state between two wake-ups.
pub struct Integrator {
    core: Core,
    pace: LoopPace,
    events: Consumer<TimedEvent>,
    refits: Consumer<Box<Refit>>,
    retired: Producer<Box<Refit>>,
    outputs: Producer<TickOutput>,
    answers: Producer<Answer>,
    stats: Stats,
    state: RunState,
    steps: Option<Steps>,
    awaited: AwaitedInputs,
    /// Until when the steps ordered last wait for their inputs, on the monotonic clock, ns.
    waits_until_ns: Option<i64>,
    ages: AgeClock,
    start_ns: i64,
    time_ns: i64,
    next_publish_ns: i64,
    clock_ns: Option<i64>,
    /// The next wake-up, while it runs with the machine's clock.
    deadline_ns: Option<i64>,
    node_events: bool,
}

impl Integrator {
    /// A loop at rest, with its rings. `time_ns` is the model's time at the first tick; with a simulated clock
    /// the clock gives it.
    pub fn new(core: Core, pace: LoopPace, time_ns: i64) -> (Self, Ends) {
        let (event_in, events) = RingBuffer::new(EVENTS);
        let (outputs, output_out) = RingBuffer::new(OUTPUTS);
        let (answers, answer_out) = RingBuffer::new(ANSWERS);
        let (refit_in, refits) = RingBuffer::new(REFITS);
        let (retired, retired_out) = RingBuffer::new(2 * REFITS);
        let mut ages = AgeClock::default();
        if pace.paused {
            ages.stop(0);
        }
        let integrator = Self {
            core,
            pace,
            events,
            refits,
            retired,
            outputs,
            answers,
            stats: Stats::default(),
            state: if pace.paused { RunState::Paused } else { RunState::Playing },
            steps: None,
            awaited: AwaitedInputs::default(),
            waits_until_ns: None,
            ages,
            start_ns: time_ns,
            time_ns,
            next_publish_ns: time_ns,
            clock_ns: None,
            deadline_ns: None,
            node_events: false,
        };
        let ends =
            Ends { events: event_in, refits: refit_in, retired: retired_out, outputs: output_out, answers: answer_out };
        (integrator, ends)
    }

    /// The same with inputs of which each order to step waits for a new sample.
    #[must_use]
    pub fn awaiting(mut self, awaited: AwaitedInputs) -> Self {
        self.awaited = awaited;
        self
    }

    /// Counts so far.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }

    /// One wake-up: takes what was heard, advances the twin, hands the results out. Returns whether there are any.
    pub fn turn(&mut self, now_ns: i64) -> bool {
        self.node_events = false;
        for _ in 0..EVENTS {
            // What comes after a time of the clock counts from then on.
            if !self.catch_up() {
                break;
            }
            let Ok(event) = self.events.pop() else { break };
            match event.heard {
                InputEvent::PublishPeriod(period_ns) => {
                    self.pace.publish_period_ns = period_ns;
                    self.next_publish_ns = self.time_ns;
                }
                InputEvent::Clock(clock_ns) if self.follows() => self.follow(clock_ns),
                InputEvent::Order(order, ticket) => self.obey(order, ticket, now_ns),
                InputEvent::Refit => self.refit(),
                // Ages are counted on the clock that the model follows; they begin with its first word.
                heard if self.follows() => self.core.take(heard, self.clock_ns.unwrap_or(0), event.stamp_ns),
                heard => self.core.take(heard, self.ages.at(event.arrived_ns), event.stamp_ns),
            }
        }
        if self.follows() {
            self.catch_up();
        } else if self.state == RunState::Playing {
            self.tick(self.ages.at(now_ns), false);
        } else {
            self.step(now_ns);
        }
        self.node_events
    }

    /// Leaves out `ticks` ticks: the next one steps over them. A simulated clock says itself how far time is; it loses none.
    pub fn skip(&mut self, ticks: i64) {
        if self.follows() {
            return;
        }
        self.time_ns += ticks * self.pace.period_ns;
        self.stats.skipped += u64::try_from(ticks).unwrap_or(0);
    }

    fn follows(&self) -> bool {
        self.pace.time == TimeSource::Follow
    }

    /// Whether there is something to do before the next event.
    fn has_work(&self) -> bool {
        (self.steps.is_some() && self.waits_until_ns.is_none()) || self.is_behind() || !self.events.is_empty()
    }

    /// Whether there is room for the results of what is to be done.
    fn has_room(&self) -> bool {
        let room = if self.steps.is_some() { OUTPUTS - MOST_AHEAD } else { ROOM_TO_STEP };
        self.outputs.slots() >= room
    }

    fn is_behind(&self) -> bool {
        self.follows() && self.clock_ns.is_some_and(|clock_ns| self.time_ns <= clock_ns)
    }

    /// Follows a simulated clock to `clock_ns`; where it jumps back or leaps far ahead, all begins anew there.
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
    }

    /// Ticks up to the clock as far as there is room for results. Returns whether it is there.
    fn catch_up(&mut self) -> bool {
        while self.is_behind() && self.has_room() {
            self.tick(self.time_ns, false);
        }
        !self.is_behind()
    }

    fn restart_at(&mut self, time_ns: i64) {
        self.time_ns = time_ns;
        self.next_publish_ns = time_ns;
    }

    /// One tick at the model's next time; `now_ns` is the time on which ages are counted. It is published where that is due,
    /// or `shown` asks for it.
    fn tick(&mut self, now_ns: i64, shown: bool) {
        let tick = self.core.tick(self.time_ns, now_ns);
        self.stats.ticked(&tick.ages_ns);
        self.stats.ended_by_fail_safe |= tick.stop;
        let due = self.time_ns >= self.next_publish_ns;
        if due {
            let periods = (self.time_ns - self.next_publish_ns) / self.pace.publish_period_ns + 1;
            self.next_publish_ns += periods * self.pace.publish_period_ns;
        }
        let due = due || shown;
        let publish = tick.estimate.is_some() && (due || tick.notices.has(Notices::STARTED));
        if due || publish || tick.inputs_changed || tick.notices != Notices::default() || tick.stop {
            let output = TickOutput {
                tick,
                publish,
                steps_left: self.steps.map_or(0, |steps| steps.left_count.saturating_sub(1)),
                patient: self.steps.is_some(),
                overruns: self.stats.overruns,
                worst_lateness_us: self.stats.worst_lateness_us(),
            };
            self.stats.lost_outputs += u64::from(self.outputs.push(output).is_err());
            self.node_events = true;
        }
        self.time_ns += self.pace.period_ns;
    }
}
