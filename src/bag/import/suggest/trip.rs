//! What the states of a trip column mean, by what the servomotor does in each: a machine that is shut down closes and stays closed.

use super::column::{Bucket, SuggestedColumn};

/// A servomotor that opens by more than this share of its range is not shut down, even after an interpolated bucket.
const OPENS: f64 = 0.03;
/// It closes within some seconds; one that stands open for longer is not shut down, ns.
const CLOSES_NS: i64 = 15_000_000_000;
/// Open: more than this share of its range above its lowest value.
const OPEN: f64 = 0.1;
/// After a change of state the servomotor may still move as before, ns.
const SETTLES_NS: i64 = 2_000_000_000;

/// The states of a column in which the servomotor runs: by number, or by the number of the word.
pub(super) fn running_states(states: &SuggestedColumn, servomotor: &SuggestedColumn) -> Vec<f64> {
    let mut of_states = states.envelope.points().peekable();
    let [least, most] = servomotor.range.ends();
    let span = most.abs().max(least.abs()).max(f64::MIN_POSITIVE);
    let mut found: Vec<f64> = vec![];
    let (mut state, mut since_ns): (Option<f64>, i64) = (None, 0);
    let (mut lowest, mut rose) = (f64::INFINITY, 0.0_f64);
    for (time_ns, bucket) in servomotor.envelope.points() {
        while let Some((at_ns, next)) = of_states.next_if(|(at_ns, _)| *at_ns <= time_ns) {
            // A bucket with two states is the change between them.
            let next = if next.least.to_bits() == next.most.to_bits() { next.least } else { f64::NAN };
            if state.is_none_or(|state| state.to_bits() != next.to_bits()) {
                (state, since_ns, lowest, rose) = (Some(next), at_ns, f64::INFINITY, 0.0);
            }
        }
        let Some(state) = state.filter(|state| !state.is_nan()) else { continue };
        let passed_ns = time_ns.saturating_sub(since_ns);
        if passed_ns < SETTLES_NS {
            continue;
        }
        let value = bucket.mean();
        lowest = lowest.min(value);
        rose = rose.max(value - lowest);
        let stands_open = passed_ns > CLOSES_NS && value - least > OPEN * span;
        if (rose > OPENS * span || stands_open) && !found.contains(&state) {
            found.push(state);
        }
    }
    found
}

/// What a column of two states shows of trips beside a servomotor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TripSign {
    /// It changes, and the servomotor runs in one of its states alone.
    Trips,
    /// The same in pulses: the servomotor closes and stays closed although the state returns.
    Pulses,
    /// The servomotor runs in both states.
    Runs,
    /// It never changes, or nothing shows.
    Nothing,
}

/// What a column of two states shows beside a servomotor.
pub(super) fn sign_of_trip(states: &SuggestedColumn, servomotor: &SuggestedColumn) -> TripSign {
    let changes = if states.range.count == 0 { states.words.len() > 1 } else { states.distinct.len() > 1 };
    let running = running_states(states, servomotor);
    let [normal] = running[..] else {
        return if running.is_empty() { TripSign::Nothing } else { TripSign::Runs };
    };
    if !changes || !states.is_binary() {
        return TripSign::Nothing;
    }
    let is_normal = |bucket: &Bucket| [bucket.least, bucket.most].map(f64::to_bits) == [normal.to_bits(); 2];
    let others: Vec<i64> =
        states.envelope.points().filter(|(_, bucket)| !is_normal(bucket)).map(|(at_ns, _)| at_ns).collect();
    match (others.first(), others.last()) {
        // A state that is told where it changes lasts until the next.
        _ if states.envelope.points().last().is_some_and(|(_, bucket)| !is_normal(bucket)) => TripSign::Trips,
        (Some(first_ns), Some(last_ns)) if last_ns.saturating_sub(*first_ns) > SETTLES_NS => TripSign::Trips,
        // Moments alone.
        (Some(first_ns), Some(last_ns)) if closes_after(servomotor, *first_ns, *last_ns) => TripSign::Pulses,
        _ => TripSign::Nothing,
    }
}

/// Whether a servomotor that was open before a moment closes after it, for so long as the file goes on, and opens no more.
fn closes_after(servomotor: &SuggestedColumn, first_ns: i64, last_ns: i64) -> bool {
    let span = servomotor.range.span().max(f64::MIN_POSITIVE);
    let (mut before, mut lowest, mut rose) = (f64::NAN, f64::INFINITY, 0.0_f64);
    for (at_ns, bucket) in servomotor.envelope.points() {
        if at_ns <= first_ns {
            before = bucket.mean();
        } else if at_ns > last_ns {
            lowest = lowest.min(bucket.mean());
            rose = rose.max(bucket.mean() - lowest);
        }
    }
    let [least, _] = servomotor.range.ends();
    // Closed: a servomotor that stays where it is was not tripped.
    before - lowest > OPEN * span && rose < OPENS * span && lowest - least < OPENS * span
}
