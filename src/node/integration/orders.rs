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
                return;
            }
            Order::Reset { time } => {
                self.interrupt();
                self.set_back(time);
                OrderOutcome::Done
            }
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
    fn interrupt(&mut self) {
        if let Some(steps) = self.steps.take() {
            self.answer(steps.ticket, OrderOutcome::Interrupted);
        }
    }

    /// Does steps as far as there is room for results; the last one is published whatever the period.
    pub(super) fn step(&mut self) {
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

    fn answer(&mut self, ticket: Ticket, outcome: OrderOutcome) {
        // The hearing thread lets no more orders wait than there is room for answers.
        let _ = self.answers.push(Answer { ticket, outcome, state: self.state });
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
