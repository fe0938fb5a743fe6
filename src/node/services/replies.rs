//! Callers who wait for the loop: who they are, and their answers in the order of what the loop did.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};

use super::super::control::{Answer, OrderOutcome, RunState, Ticket};
use super::super::integration::ANSWERS;

/// What a caller is told once its order is done.
type Reply<'a> = Box<dyn FnOnce(Answer) + Send + 'a>;

/// The callers who wait, and the state that the last answer left. One thread takes callers in, another one answers them.
pub(crate) struct Replies<'a> {
    waiting: Mutex<BTreeMap<Ticket, Reply<'a>>>,
    next: AtomicU64,
    state: AtomicU8,
}

impl<'a> Replies<'a> {
    /// Nobody waits.
    pub(crate) fn new(state: RunState) -> Self {
        Self { waiting: Mutex::default(), next: AtomicU64::new(1), state: AtomicU8::new(state as u8) }
    }

    /// Takes a caller in. One too many is answered at once that others are before it: `None`.
    pub(crate) fn expect(&self, reply: impl FnOnce(Answer) + Send + 'a) -> Option<Ticket> {
        let ticket = self.next.fetch_add(1, Ordering::Relaxed);
        if let Some(mut waiting) = self.waiting.lock().ok().filter(|waiting| waiting.len() < ANSWERS / 2) {
            waiting.insert(ticket, Box::new(reply));
            return Some(ticket);
        }
        reply(Answer { ticket, outcome: OrderOutcome::Busy, state: self.state(), stamps_ns: Default::default() });
        None
    }

    /// Answers the caller that waits for this.
    pub(crate) fn answer(&self, answer: Answer) {
        self.state.store(answer.state as u8, Ordering::Relaxed);
        let reply = self.waiting.lock().ok().and_then(|mut waiting| waiting.remove(&answer.ticket));
        if let Some(reply) = reply {
            reply(answer);
        }
    }

    /// The state that the last answer left.
    pub(crate) fn state(&self) -> RunState {
        let state = self.state.load(Ordering::Relaxed);
        [RunState::Stopped, RunState::Playing, RunState::Paused]
            .into_iter()
            .find(|one| *one as u8 == state)
            .unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::{ANSWERS, Answer, OrderOutcome, Replies, RunState};

    #[test]
    fn each_caller_has_its_own_answer_and_no_more_wait_than_have_room() {
        let replies = Replies::new(RunState::Playing);
        let (sender, answered) = channel();
        let mut tickets = Vec::new();
        for caller in 0..ANSWERS {
            let sender = sender.clone();
            tickets.extend(replies.expect(move |answer| {
                let _ = sender.send((caller, answer.ticket, answer.outcome));
            }));
        }
        assert_eq!(tickets.len(), ANSWERS / 2);
        assert!(answered.try_iter().all(|(caller, _, outcome)| caller >= ANSWERS / 2 && outcome == OrderOutcome::Busy));
        replies.answer(Answer {
            ticket: tickets[3],
            outcome: OrderOutcome::Done,
            state: RunState::Paused,
            stamps_ns: [0; 4],
        });
        replies.answer(Answer {
            ticket: tickets[3],
            outcome: OrderOutcome::Done,
            state: RunState::Paused,
            stamps_ns: [0; 4],
        });
        assert_eq!(answered.try_iter().collect::<Vec<_>>(), [(3, tickets[3], OrderOutcome::Done)]);
        assert_eq!(replies.state(), RunState::Paused);
    }
}
