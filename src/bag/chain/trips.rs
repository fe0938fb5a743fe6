//! Whether the ESV's state and what spool and servomotor do are of one machine.

use super::ASKS_PU;
use super::impossible::Impossible;
use super::stay::Stay;
use govtwin_model::units::seconds_from_nanos;

/// A tripped servomotor does not open by so much, pu, once so long has passed, s, and is not that far open after so long, s.
const OPENS_PU: f64 = 0.03;
const TRIPPED_S: f64 = 1.0;
const STANDS_PU: f64 = 0.1;
const STANDS_S: f64 = 20.0;
/// One that has not closed at all after so long, s, does not close: an ESV acts 3 s late at most.
const STAYS_S: f64 = 8.0;
/// A spool that is more than so far towards closing, pu, for longer than so, s, while the command asks to open, is held there by a tripped ESV: a clogged
/// pilot holds it for half as long.
const CLOSES_PU: f64 = -0.5;
/// Where it has not been off there for so long before, s, its oil may never have come.
const CLOSES_S: f64 = 4.0;
const REGULATED_S: f64 = 2.0;

/// Rows in which a spool closes against the command.
#[derive(Clone, Copy, Debug)]
struct Closing {
    servo: Stay,
    /// From servomotor to command.
    error: Stay,
    spool: Stay,
}

/// What is seen of trips, said and not said.
#[derive(Clone, Debug, Default)]
pub(super) struct TripWatch {
    /// Positions since a second after the trip, from its first row on, whose own position is the second.
    trip: Option<(Stay, f64)>,
    opens: Option<Impossible>,
    stands: Option<Impossible>,
    closing: Option<Closing>,
    /// Spools that were not closing.
    regulated: Option<Stay>,
    unsaid: Option<Impossible>,
}

impl TripWatch {
    pub(super) fn take(&mut self, time_ns: i64, error: f64, servo: f64, spool: f64, normal: bool) {
        if normal {
            self.trip = None;
            self.closed(time_ns, error, servo, spool);
            return;
        }
        self.closing = None;
        let (trip, at_trip) = self.trip.unwrap_or((Stay::new(time_ns, f64::INFINITY), servo));
        let is_early = seconds_from_nanos(time_ns.saturating_sub(trip.since_ns)) < TRIPPED_S;
        let trip = trip.with(time_ns, if is_early { f64::INFINITY } else { servo });
        self.trip = Some((trip, at_trip));
        if is_early {
            return;
        }
        let duration_s = trip.lasted_s();
        let by_pu = servo - trip.least;
        if by_pu > OPENS_PU
            && self
                .opens
                .is_none_or(|known| matches!(known, Impossible::OpensTripped { by_pu: most, .. } if most < by_pu))
        {
            self.opens = Some(Impossible::OpensTripped { by_pu, time_ns });
        }
        let stays = duration_s > STAYS_S && trip.least > at_trip - OPENS_PU;
        if (duration_s > STANDS_S || stays) && servo > STANDS_PU {
            self.stands = Some(Impossible::StandsTripped { position_pu: servo, time_ns, duration_s });
        }
    }

    /// Takes a row at which the ESV is said not to have tripped.
    fn closed(&mut self, time_ns: i64, error: f64, servo: f64, spool: f64) {
        if spool >= CLOSES_PU {
            let here = Stay::new(time_ns, spool);
            self.regulated = Some(self.regulated.map_or(here, |regulated| regulated.with(time_ns, spool)));
        }
        let against = spool < CLOSES_PU && error > ASKS_PU;
        if !against {
            // A spool that was not measured tells nothing.
            if spool.is_finite() {
                self.closing = None;
            }
            return;
        }
        let start = Closing {
            servo: Stay::new(time_ns, servo),
            error: Stay::new(time_ns, error),
            spool: Stay::new(time_ns, spool),
        };
        let Closing { servo: was, error: asked, spool: stood } = self.closing.unwrap_or(start);
        let closing = Closing {
            servo: was.with(time_ns, servo),
            error: asked.with(time_ns, error),
            spool: stood.with(time_ns, spool),
        };
        self.closing = Some(closing);
        let Closing { servo, error, spool } = closing;
        if servo.lasted_s() > CLOSES_S {
            self.unsaid = Some(Impossible::TripsUnsaid {
                from_pu: servo.first,
                to_pu: servo.last,
                error_pu: error.most,
                spool_pu: spool.least,
                time_ns: servo.since_ns,
                duration_s: servo.lasted_s(),
                regulated: !self.is_closed(),
            });
        }
    }

    /// Whether the spool was closing all along, as where no pilot oil comes.
    pub(super) fn is_closed(&self) -> bool {
        (self.closing.is_some() || self.unsaid.is_some())
            && self.regulated.is_none_or(|regulated| regulated.lasted_s() < REGULATED_S)
    }

    /// What cannot be of one machine.
    pub(super) fn found(&self) -> Option<Impossible> {
        self.opens.or(self.stands).or(self.unsaid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is found of a servomotor that stands at 0.876 before the trip, and so after it, by seconds.
    fn found(after: impl Fn(f64) -> f64) -> Option<Impossible> {
        let mut watch = TripWatch::default();
        for k in 0..1600_i64 {
            let (time_ns, time_s) = (k * 10_000_000, k as f64 * 0.01 - 1.0);
            let servo = if time_s < 0.0 { 0.876 } else { after(time_s) };
            watch.take(time_ns, 0.0, servo, 0.0, time_s < 0.0);
        }
        watch.found()
    }

    #[test]
    fn a_servomotor_that_does_not_close_has_not_tripped() {
        let opens = |time_s: f64| (0.876 + 0.1 * time_s).min(1.0);
        assert!(matches!(found(opens), Some(Impossible::StandsTripped { position_pu, .. }) if position_pu == 1.0));
        assert!(matches!(found(|_| 0.876), Some(Impossible::StandsTripped { .. })));
        for late_s in [0.0, 0.5, 3.0] {
            assert!(found(|time_s| (0.876 - 0.1 * (time_s - late_s).max(0.0)).max(0.0)).is_none(), "{late_s}");
        }
    }
}
