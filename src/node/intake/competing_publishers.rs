//! Two senders on one input: told where they do not say the same.

use govtwin_model::units::NANOS_PER_SECOND;

/// A sender that is silent for so long is gone, ns.
const GONE_NS: i64 = 2 * NANOS_PER_SECOND;

/// Most senders that are looked at; of more the oldest is forgotten.
const MOST_SENDERS: usize = 8;

/// The senders of one input that spoke lately.
#[derive(Clone, Debug, Default)]
pub(crate) struct CompetingPublishers<Sender> {
    lately: Vec<Heard<Sender>>,
    told: bool,
}

#[derive(Clone, Copy, Debug)]
struct Heard<Sender> {
    sender: Sender,
    said_bits: u64,
    since_ns: i64,
    last_ns: i64,
}

impl<Sender: Copy + PartialEq> CompetingPublishers<Sender> {
    /// Whether two senders said different things, and none of them has fallen silent since.
    pub(crate) fn compete(&self) -> bool {
        self.told && self.lately.len() > 1
    }

    /// Takes a value; returns another sender with its value where that one spoke within 2 s, and since this one began, and said something else:
    /// once until all but one fall silent. One that takes over from one that ended is no rival.
    pub(crate) fn take(&mut self, sender: Sender, said: f64, now_ns: i64) -> Option<(Sender, f64)> {
        self.lately.retain(|heard| now_ns - heard.last_ns < GONE_NS);
        let own = self.lately.iter().position(|heard| heard.sender == sender);
        let since_ns = own.map_or(now_ns, |at| self.lately.remove(at).since_ns);
        self.told &= !self.lately.is_empty();
        let differs = |heard: &&Heard<Sender>| heard.last_ns >= since_ns && heard.said_bits != said.to_bits();
        let other = self.lately.iter().find(differs);
        let other = other.filter(|_| !self.told).map(|heard| (heard.sender, f64::from_bits(heard.said_bits)));
        self.told |= other.is_some();
        if self.lately.len() >= MOST_SENDERS {
            self.lately.remove(0);
        }
        self.lately.push(Heard { sender, said_bits: said.to_bits(), since_ns, last_ns: now_ns });
        other
    }
}

#[cfg(test)]
mod tests {
    use super::CompetingPublishers;

    const SECOND_NS: i64 = 1_000_000_000;

    #[test]
    fn rivals_are_told_once_and_again_after_one_was_gone() {
        let mut competing = CompetingPublishers::default();
        assert_eq!(competing.take('a', 0.3, 0), None);
        assert_eq!(competing.take('b', 0.3, 1), None, "a second sender that agrees is redundancy");
        assert_eq!(competing.take('b', 0.5, 2), None, "the first may have ended when the second began");
        assert!(!competing.compete());
        assert_eq!(competing.take('a', 0.3, 3), Some(('b', 0.5)));
        assert!(competing.compete());
        assert_eq!(competing.take('b', 0.5, 4), None);
        // b is gone, a goes on, b comes back.
        for second in 1..5 {
            assert_eq!(competing.take('a', 0.3, second * SECOND_NS), None);
        }
        assert!(!competing.compete(), "one is alone again");
        assert_eq!(competing.take('b', 0.5, 5 * SECOND_NS), None);
        assert_eq!(competing.take('a', 0.3, 5 * SECOND_NS + 1), Some(('b', 0.5)));
    }

    #[test]
    fn one_that_takes_over_from_one_that_died_is_no_rival() {
        let mut competing = CompetingPublishers::default();
        assert_eq!(competing.take('a', 0.3, 0), None);
        assert_eq!(competing.take('b', 0.7, SECOND_NS), None, "at once, too");
        assert_eq!(competing.take('b', 0.7, 3 * SECOND_NS), None);
        for sender in 0..100_u8 {
            competing.take(char::from(sender), 0.7, 3 * SECOND_NS);
        }
        assert!(competing.lately.len() <= super::MOST_SENDERS);
    }
}
