//! Stamps of samples: how far they are from the node's time, and whether they move.

use super::super::health::Health;
use super::Refusal;
use govtwin_model::units::NANOS_PER_SECOND;

/// A stamp farther than this from the node's time is of another clock, ns.
const FAR_NS: i64 = 10 * NANOS_PER_SECOND;

/// A stamp that stays the same for so long, over several samples, stands still, ns.
const STANDS_NS: i64 = NANOS_PER_SECOND;

/// Samples with one stamp that may be a burst.
const BURST: u32 = 5;

/// The stamps of one input.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StampWatch {
    newest_ns: i64,
    since_ns: i64,
    samples: u32,
}

impl StampWatch {
    /// Takes a sample's stamp, 0 where it has none, which arrived at `arrived_ns` of the machine's clock; `now_ns` is the node's time, where it has
    /// one that others share. Returns what is wrong with it, as flags of [`Health`].
    ///
    /// # Errors
    /// Where the sample must not be used: its stamp is older than the limit, or as far ahead, or there is none to be held against the limit.
    pub(crate) fn take(
        &mut self,
        stamp_ns: i64,
        arrived_ns: i64,
        now_ns: Option<i64>,
        max_age_ns: Option<i64>,
    ) -> Result<u8, (u8, Refusal)> {
        if stamp_ns == 0 {
            let limited = max_age_ns.is_some() && now_ns.is_some();
            return if limited { Err((0, Refusal::BadStamp)) } else { Ok(0) };
        }
        if stamp_ns != self.newest_ns {
            *self = Self { newest_ns: stamp_ns, since_ns: arrived_ns, samples: 0 };
        }
        self.samples = self.samples.saturating_add(1);
        let mut flags = 0;
        if self.samples > BURST && arrived_ns.saturating_sub(self.since_ns) > STANDS_NS {
            flags |= Health::STAMP_STANDS;
        }
        let off_ns = now_ns.map_or(0, |now_ns| now_ns.saturating_sub(stamp_ns).saturating_abs());
        if off_ns > FAR_NS {
            flags |= Health::STAMP_FAR;
        }
        match max_age_ns {
            Some(max_age_ns) if off_ns > max_age_ns => Err((flags | Health::STAMP_OLD, Refusal::Old)),
            _ => Ok(flags),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::health::Health;
    use super::{Refusal, StampWatch};

    const SECOND_NS: i64 = 1_000_000_000;

    #[test]
    fn a_stamp_that_stands_is_told_after_a_second_of_samples() {
        let mut watch = StampWatch::default();
        let mut take = |stamp_ns, arrived_ns| watch.take(stamp_ns, arrived_ns, None, None);
        for sample in 0..300 {
            let stands = take(5, sample * 10_000_000).unwrap() & Health::STAMP_STANDS != 0;
            assert_eq!(stands, sample > 100, "{sample}");
        }
        assert_eq!(take(6, 3 * SECOND_NS), Ok(0));
        // A source that speaks once in two seconds with one stamp is no proof yet.
        assert_eq!(take(6, 5 * SECOND_NS), Ok(0));
        // Without a stamp there is nothing to stand still.
        assert!((0..300).all(|sample| take(0, sample * 10_000_000) == Ok(0)));
    }

    #[test]
    fn old_stamps_and_those_of_another_clock_are_told_and_refused_where_there_is_a_limit() {
        let take = |stamp_s: i64, limit_s: Option<i64>| {
            let limit_ns = limit_s.map(|limit_s| limit_s * SECOND_NS);
            StampWatch::default().take(stamp_s * SECOND_NS, 0, Some(1000 * SECOND_NS), limit_ns)
        };
        assert_eq!((take(999, None), take(999, Some(2))), (Ok(0), Ok(0)));
        assert_eq!(take(900, None), Ok(Health::STAMP_FAR));
        assert_eq!(take(997, Some(2)), Err((Health::STAMP_OLD, Refusal::Old)));
        assert_eq!(take(1003, Some(2)), Err((Health::STAMP_OLD, Refusal::Old)), "ahead");
        assert_eq!(take(0, Some(2)), Err((0, Refusal::BadStamp)), "a limit needs a stamp");
        assert_eq!(StampWatch::default().take(0, 0, None, Some(2)), Ok(0), "no time that others share");
    }
}
