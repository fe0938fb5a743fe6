//! A watch on `/clock` for a node that follows it: absent, stopped, going on, told by two.

use std::sync::atomic::{AtomicI64, Ordering};

use ros2_client::log::LogLevel;

use govtwin_model::units::{NANOS_PER_SECOND, seconds_from_nanos};

/// A clock that says nothing new for so long has stopped, or was never there, ns.
const PATIENCE_NS: i64 = 3 * NANOS_PER_SECOND;

/// What was heard of `/clock`, shared between whoever hears and whoever watches.
#[derive(Debug)]
pub(crate) struct ClockHeard {
    arrived_ns: AtomicI64,
    time_ns: AtomicI64,
}

/// No time yet.
const NEVER: i64 = i64::MIN;

impl Default for ClockHeard {
    fn default() -> Self {
        Self { arrived_ns: AtomicI64::new(NEVER), time_ns: AtomicI64::new(NEVER) }
    }
}

impl ClockHeard {
    /// Notes a time of the clock that arrived at `now_ns` of the machine's; a time that repeats itself is no news.
    pub(crate) fn note(&self, time_ns: i64, now_ns: i64) {
        if self.time_ns.swap(time_ns, Ordering::Relaxed) != time_ns {
            self.arrived_ns.store(now_ns, Ordering::Relaxed);
        }
    }

    /// The newest time of the clock, ns; `None` before its first word.
    pub(crate) fn time_ns(&self) -> Option<i64> {
        self.newest().map(|(_, time_ns)| time_ns)
    }

    fn newest(&self) -> Option<(i64, i64)> {
        let (arrived_ns, time_ns) = (self.arrived_ns.load(Ordering::Relaxed), self.time_ns.load(Ordering::Relaxed));
        (arrived_ns != NEVER).then_some((arrived_ns, time_ns))
    }
}

/// What was told of the clock last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Told {
    Nothing,
    Missing,
    Goes,
    Stopped,
}

/// The watch.
#[derive(Debug)]
pub(crate) struct Watch {
    since_ns: i64,
    told: Told,
    two_told: bool,
}

impl Watch {
    /// A watch that begins at `now_ns` of the machine's clock.
    pub(crate) fn new(now_ns: i64) -> Self {
        Self { since_ns: now_ns, told: Told::Nothing, two_told: false }
    }

    /// What is to be told at `now_ns`; `writers` is how many publish `/clock`.
    pub(crate) fn look(&mut self, heard: &ClockHeard, writers: usize, now_ns: i64) -> Option<(LogLevel, String)> {
        if writers < 2 {
            self.two_told = false;
        } else if !std::mem::replace(&mut self.two_told, true) {
            let words = format!("/clock: {writers} publishers; the twin starts anew wherever one of them jumps back");
            return Some((LogLevel::Warn, words));
        }
        let told = match heard.newest() {
            None if now_ns - self.since_ns > PATIENCE_NS => Told::Missing,
            None => Told::Nothing,
            Some((arrived_ns, _)) if now_ns - arrived_ns > PATIENCE_NS => Told::Stopped,
            Some(_) => Told::Goes,
        };
        let before = std::mem::replace(&mut self.told, told);
        if before == told {
            return None;
        }
        let time_s = heard.newest().map_or(0.0, |(_, time_ns)| seconds_from_nanos(time_ns));
        match told {
            Told::Nothing => None,
            Told::Missing => {
                let who = match writers {
                    0 => "nobody publishes it".to_owned(),
                    _ => format!("{writers} publish it, but nothing arrives"),
                };
                let words = format!(
                    "/clock: nothing heard for 3 s, {who}; the twin stands still, since use_sim_time is set \
                     (`govtwin play --clock` and simulators publish it)"
                );
                Some((LogLevel::Warn, words))
            }
            Told::Stopped => {
                let words = format!("/clock: stands at {time_s:.3} s for more than 3 s; the twin stands still with it");
                Some((LogLevel::Warn, words))
            }
            Told::Goes => Some((LogLevel::Info, format!("/clock: heard, {time_s:.3} s"))),
        }
    }

    /// The clock in a word, for diagnostics: how bad, and what.
    pub(crate) fn state(&self) -> (u8, &'static str) {
        match self.told {
            Told::Nothing => (3, "nothing heard yet"),
            Told::Missing => (2, "missing"),
            Told::Goes => (0, "heard"),
            Told::Stopped => (1, "stands still"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{ClockHeard, Watch};

    const SECOND_NS: i64 = 1_000_000_000;

    #[test]
    fn absent_heard_stopped_and_going_on_are_told_once_each() {
        let (heard, mut watch) = (ClockHeard::default(), Watch::new(0));
        let mut told = Vec::new();
        for second in 0..20 {
            if (6..9).contains(&second) || second >= 15 {
                heard.note(100 * SECOND_NS + second, second * SECOND_NS);
            } else if second >= 9 {
                heard.note(100 * SECOND_NS + 8, second * SECOND_NS);
            }
            told.extend(
                watch.look(&heard, usize::from(second > 5), second * SECOND_NS).map(|(_, words)| (second, words)),
            );
        }
        let seconds: Vec<i64> = told.iter().map(|(second, _)| *second).collect();
        assert_eq!(seconds, [4, 6, 12, 15], "{told:?}");
        assert!(told[0].1.contains("nobody publishes it") && told[2].1.contains("stands at 100.000 s"), "{told:?}");
    }

    #[test]
    fn two_clocks_are_told_and_one_that_cannot_be_heard_is_counted() {
        let (heard, mut watch) = (ClockHeard::default(), Watch::new(0));
        assert!(watch.look(&heard, 2, 0).unwrap().1.contains("2 publishers"));
        assert!(watch.look(&heard, 2, 1).is_none());
        assert!(watch.look(&heard, 1, 4 * SECOND_NS).unwrap().1.contains("1 publish it, but nothing arrives"));
        assert_eq!(watch.state().0, 2);
    }
}
