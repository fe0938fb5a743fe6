//! What callers want of the loop, done between two ticks.

use rtrb::PushError;

use super::super::control::{Answer, Order, OrderOutcome, RunState, Steps, Ticket};
use super::{Integrator, TimeSource};

/// Most steps between two looks at what was heard, and at the other units of the thread.
const MOST_STEPS: usize = 64;

impl Integrator {
    /// Does what a caller asks for, or says why not; steps are answered once they are done.
    pub(super) fn obey(&mut self, order: Order, ticket: Ticket, now_ns: i64) {
        let outcome = match order {
            Order::Play => self.enter(RunState::Playing, now_ns),
            Order::Pause => self.enter(RunState::Paused, now_ns),
            Order::Stop => self.enter(RunState::Stopped, now_ns),
            Order::Step { .. } if self.state == RunState::Playing => OrderOutcome::NotPaused,
            Order::Step { .. } if self.steps.is_some() => OrderOutcome::Busy,
            Order::Step { ticks: 0 } => OrderOutcome::Done,
            Order::Step { ticks } => {
                self.state = RunState::Paused;
                self.steps = Some(Steps { ticket, left_count: ticks });
                let waits = self.awaited.of.contains(&true);
                self.waits_until_ns = waits.then(|| now_ns.saturating_add(self.awaited.timeout_ns));
                return;
            }
            Order::Reset { time } => {
                self.interrupt();
                self.set_back(time);
                OrderOutcome::Done
            }
            Order::ResetTrip if self.core.reset_trip() => OrderOutcome::Done,
            Order::ResetTrip => OrderOutcome::Already,
            Order::Quit => {
                self.stats.ended_by_caller = true;
                self.interrupt();
                OrderOutcome::Done
            }
        };
        self.answer(ticket, outcome);
    }

    /// Goes into a state.
    fn enter(&mut self, state: RunState, now_ns: i64) -> OrderOutcome {
        if self.state == state && self.steps.is_none() {
            return OrderOutcome::Already;
        }
        self.interrupt();
        self.state = state;
        match state {
            RunState::Playing => self.ages.go_on(now_ns),
            RunState::Paused => self.ages.stop(now_ns),
            RunState::Stopped => {
                self.ages.stop(now_ns);
                self.set_back(true);
            }
        }
        OrderOutcome::Done
    }

    /// Back to the start; the machine's time stays what it is.
    fn set_back(&mut self, time: bool) {
        self.core.restart();
        if time && self.pace.time == TimeSource::Own {
            self.restart_at(self.start_ns);
        }
    }

    /// Ends steps that are under way.
    pub(super) fn interrupt(&mut self) {
        self.waits_until_ns = None;
        if let Some(steps) = self.steps.take() {
            self.answer(steps.ticket, OrderOutcome::Interrupted);
        }
    }

    /// Does steps as far as there is room for results, once their inputs are there; the last one is published whatever the period.
    pub(super) fn step(&mut self, now_ns: i64) {
        if !self.has_inputs(now_ns) {
            return;
        }
        for _ in 0..MOST_STEPS {
            let Some(Steps { ticket, left_count }) = self.steps else { return };
            if !self.has_room() {
                return;
            }
            self.ages.step(self.pace.period_ns);
            self.tick(self.ages.at(0), left_count == 1);
            self.steps = (left_count > 1).then_some(Steps { ticket, left_count: left_count - 1 });
            if left_count == 1 {
                self.answer(ticket, OrderOutcome::Done);
            }
        }
    }

    /// Whether steps that wait for inputs may begin; those whose inputs stay away are refused.
    fn has_inputs(&mut self, now_ns: i64) -> bool {
        let Some(until_ns) = self.waits_until_ns else { return true };
        let missing = self.core.missing(self.awaited.of);
        if missing.contains(&true) && now_ns < until_ns {
            return false;
        }
        self.waits_until_ns = None;
        if missing.contains(&true)
            && let Some(steps) = self.steps.take()
        {
            self.answer(steps.ticket, OrderOutcome::InputsMissing(missing));
        }
        true
    }

    fn answer(&mut self, ticket: Ticket, outcome: OrderOutcome) {
        // The hearing thread lets no more orders wait than there is room for answers.
        let _ = self.answers.push(Answer { ticket, outcome, state: self.state, stamps_ns: self.core.stamps_ns() });
        self.node_events = true;
    }

    /// Takes over a twin that waits.
    pub(super) fn refit(&mut self) {
        if let Ok(mut refit) = self.refits.pop() {
            self.core.refit(&mut refit);
            if let Err(PushError::Full(refit)) = self.retired.push(refit) {
                // Whoever sends twins takes back those before; were it not so, a leak would be better than a stall.
                std::mem::forget(refit);
            }
        }
    }
}
