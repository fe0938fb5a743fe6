//! Whether the ESV's state and what spool and servomotor do are of one machine.

use super::ASKS_PU;
use super::impossible::Impossible;
use govtwin_model::units::seconds_from_nanos;

/// A tripped servomotor does not open by so much, pu, once so long has passed, s, and is not that far open after so long, s.
const OPENS_PU: f64 = 0.03;
const TRIPPED_S: f64 = 1.0;
const STANDS_PU: f64 = 0.1;
const STANDS_S: f64 = 20.0;
/// A spool that is more than so far towards closing, pu, for longer than so, s, while the command asks to open, is held there by a tripped ESV.
const CLOSES_PU: f64 = -0.5;
const CLOSES_S: f64 = 2.0;

/// A time in which a spool closes against the command.
#[derive(Clone, Copy, Debug)]
struct Closing {
    since_ns: i64,
    from_pu: f64,
    last_pu: f64,
    /// The greatest distance from servomotor to command meanwhile, pu.
    error_pu: f64,
    spool_pu: f64,
}

/// What is seen of trips, said and not said.
#[derive(Clone, Debug, Default)]
pub(super) struct TripWatch {
    trip: Option<(i64, f64)>,
    opens: Option<Impossible>,
    stands: Option<Impossible>,
    closing: Option<Closing>,
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
        let (since_ns, lowest) = *self.trip.get_or_insert((time_ns, f64::INFINITY));
        let duration_s = seconds_from_nanos(time_ns.saturating_sub(since_ns));
        if duration_s < TRIPPED_S {
            return;
        }
        let lowest = lowest.min(servo);
        self.trip = Some((since_ns, lowest));
        let by_pu = servo - lowest;
        if by_pu > OPENS_PU
            && self
                .opens
                .is_none_or(|known| matches!(known, Impossible::OpensTripped { by_pu: most, .. } if most < by_pu))
        {
            self.opens = Some(Impossible::OpensTripped { by_pu, time_ns });
        }
        if duration_s > STANDS_S && servo > STANDS_PU {
            self.stands = Some(Impossible::StandsTripped { position_pu: servo, time_ns, duration_s });
        }
    }

    /// Takes a row at which the ESV is said not to have tripped.
    fn closed(&mut self, time_ns: i64, error: f64, servo: f64, spool: f64) {
        let against = spool < CLOSES_PU && error > ASKS_PU;
        if !against {
            // A spool that was not measured tells nothing.
            if spool.is_finite() {
                self.closing = None;
            }
            return;
        }
        let closing = self.closing.get_or_insert(Closing {
            since_ns: time_ns,
            from_pu: servo,
            last_pu: servo,
            error_pu: error,
            spool_pu: spool,
        });
        closing.last_pu = servo;
        closing.error_pu = closing.error_pu.max(error);
        closing.spool_pu = closing.spool_pu.min(spool);
        let Closing { since_ns, from_pu, last_pu, error_pu, spool_pu } = *closing;
        let duration_s = seconds_from_nanos(time_ns.saturating_sub(since_ns));
        if duration_s > CLOSES_S {
            let seen =
                Impossible::TripsUnsaid { from_pu, to_pu: last_pu, error_pu, spool_pu, time_ns: since_ns, duration_s };
            self.unsaid = Some(seen);
        }
    }

    /// What cannot be of one machine.
    pub(super) fn found(&self) -> Option<Impossible> {
        self.opens.or(self.stands).or(self.unsaid)
    }
}
