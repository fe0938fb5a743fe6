//! Whether recordings are of a servomotor stage at all: laws that would make something else of the spool, judged on runs left out of their fit.
//!
//! A servomotor sums up the flow that its spool lets through. A position that settles to what the spool says within the time of one travel is no
//! servomotor behind that spool, but a follower (a closed loop behind its set point, a spring-loaded cylinder, a tank), and one of which no law of the
//! spool knows more than its own level or drift is driven by something else. No limit is set: the law that predicts best has it.

use crate::stage_alone::flexible::{broken_line, corners};
use crate::stage_alone::pieces::{PIECES, pieces};
use crate::stage_alone::plain::Plain;
use crate::stage_alone::run::{Lag, Run, SpoolLaw, left_out, typical_s};
use govtwin_model::recording::Recording;

/// Samples of a run that are looked at.
const LOOKED_AT: usize = 1500;
/// Settling times that are tried, as shares of the time for one travel.
const SETTLES: [f64; 6] = [0.0, 0.0625, 0.125, 0.25, 0.5, 1.0];
/// Windows in which speed is looked at, in a run.
const WINDOWS: usize = 40;

/// What the position makes of the spool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Follows {
    /// It sums it up, as a servomotor does.
    Sum,
    /// It settles to what the spool says, in this time, s.
    Spool {
        /// Time in which it settles, s.
        settles_s: f64,
    },
    /// Nothing: the spool says nothing of it.
    Nothing,
}

/// What the position makes of the spool in recordings, as [`follows`].
pub(crate) fn told_apart(recordings: &[Recording], law: &Plain) -> Option<(Follows, [f64; 3])> {
    follows(&Run::of_pieces(pieces(recordings, PIECES)), law)
}

/// The law that predicts best, and the share of the squared movement that each leaves: sum, spool, nothing.
///
/// Over a long run the sum of small errors drifts away, which a position that settles never does: another law than the sum must predict better over
/// the time of one travel as well.
pub fn follows(runs: &[Run], law: &Plain) -> Option<(Follows, [f64; 3])> {
    let runs: Vec<Run> = runs.iter().map(|run| run.thinned(LOOKED_AT)).collect();
    let travel_s = travel_s(&runs);
    let (long, left) = best(&runs, law, travel_s)?;
    if long == Follows::Sum {
        return Some((long, left));
    }
    let windows: Vec<Run> = runs.iter().flat_map(|run| run.windows(travel_s)).collect();
    match best(&windows, law, travel_s) {
        Some((Follows::Sum, left)) => Some((Follows::Sum, left)),
        _ => Some((long, left)),
    }
}

/// The same over the runs as they are.
fn best(runs: &[Run], law: &Plain, travel_s: f64) -> Option<(Follows, [f64; 3])> {
    let moved: f64 = runs.iter().flat_map(|run| run.opening.iter().map(|y| (y - run.opening[0]).powi(2))).sum();
    let corners = corners(runs, law);
    let line = |spool, _| broken_line(&corners)(spool, 0.0);
    let length_s = typical_s(runs);
    let missed = |law: &SpoolLaw<'_>| left_out(&law.normals(runs));
    let least = |laws: &mut dyn Iterator<Item = Option<f64>>| laws.flatten().min_by(f64::total_cmp);

    let sum = least(&mut Lag::tried(length_s).map(|lag| missed(&SpoolLaw { lag, settles_s: None, shapes: &line })))?;
    let level =
        |settles_s: Option<f64>| missed(&SpoolLaw { lag: Lag::default(), settles_s, shapes: &|_, _| vec![1.0] });
    let nothing = least(&mut [Some(moved), level(None), level(Some(0.0))].into_iter())?;
    let settled = SETTLES.into_iter().filter_map(|share| {
        let settles_s = share * travel_s;
        let of = |lag| missed(&SpoolLaw { lag, settles_s: Some(settles_s), shapes: &line });
        Some((settles_s, least(&mut Lag::tried(length_s).map(of))?))
    });
    let (settles_s, spool) = settled.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let follows = if nothing <= sum.min(spool) {
        Follows::Nothing
    } else if spool < sum {
        Follows::Spool { settles_s }
    } else {
        Follows::Sum
    };
    Some((follows, [sum, spool, nothing].map(|missed| missed / moved)))
}

/// Time for one travel over all that was recorded, at the usual speed, s.
fn travel_s(runs: &[Run]) -> f64 {
    let ends = |pick: fn(f64, f64) -> f64, from: f64| {
        runs.iter().flat_map(|run| run.opening.iter()).fold(from, |a, b| pick(a, *b))
    };
    let travel = ends(f64::max, f64::NEG_INFINITY) - ends(f64::min, f64::INFINITY);
    let speeds = runs.iter().flat_map(|run| {
        let width = (run.time_s.len() / WINDOWS).max(1);
        (width..run.time_s.len())
            .step_by(width)
            .map(move |k| ((run.opening[k] - run.opening[k - width]) / (run.time_s[k] - run.time_s[k - width])).powi(2))
    });
    let (squares, count) = speeds.fold((0.0, 0_usize), |(sum, count), square| (sum + square, count + 1));
    travel / (squares / count.max(1) as f64).sqrt().max(f64::MIN_POSITIVE)
}
