//! Where a stop holds the servomotor: it rests at an end of its travel although the spool drives it on, which then says nothing of its speed.

use std::ops::RangeInclusive;

use crate::stage_alone::competing_laws::{Follows, told_apart};
use crate::stage_alone::pieces::{PIECES, pieces};
use crate::stage_alone::plain::{Plain, plain};
use crate::stage_alone::run::Run;
use govtwin_model::frame::Frame;
use govtwin_model::recording::Recording;
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// How near to an end of the travel a servomotor rests, as a share of it.
const AT_END: f64 = 0.01;
/// Share of the samples that may lie beyond an end: noise does.
const BEYOND: f64 = 0.01;
/// How far a servomotor would have gone on in a rest, as a share of the travel: one that only turns round slowly is held by nothing.
const DRIVEN_ON: f64 = 0.05;
/// Fewest samples of a stretch between two rests.
const FEWEST: usize = 5;
/// Rounds in which stops and law are found, each by the other.
const ROUNDS: usize = 2;

/// What a position makes of the spool between its stops.
#[derive(Debug)]
pub(crate) struct BetweenStops {
    /// The plain law.
    pub law: Plain,
    /// What it makes of the spool.
    pub follows: Follows,
    /// Share of the squared movement that is left on runs left out, where it sums the spool up, settles to it, or does neither.
    pub left: [f64; 3],
    /// The recordings with the spool closed where a stop holds the servomotor, and how often one does; none where none does.
    pub stopped: Option<(Vec<Recording>, usize)>,
}

/// Tells stops from set points; none where nothing moves. Every row holds a spool position.
///
/// A position that settles rests wherever it is sent, and so it does not sum up the spool between its ends either. One that does is held by stops there.
pub(crate) fn between_stops(recordings: &[Recording]) -> Option<BetweenStops> {
    let whole = plain(&Run::of_pieces(pieces(recordings, PIECES)))?;
    let (follows, left) = told_apart(recordings, &whole)?;
    let without = BetweenStops { law: whole, follows, left, stopped: None };
    // Where a stage often rests at its stops, the law of all rows is none of its: the first one is of what lies between the ends.
    let mut all = rests(recordings, None);
    let mut law = plain(&Run::of_pieces(between(recordings, &all))).unwrap_or(whole);
    for _ in 0..ROUNDS {
        all = rests(recordings, Some(&law));
        if all.iter().all(Vec::is_empty) {
            return Some(without);
        }
        let Some(next) = plain(&Run::of_pieces(between(recordings, &all))) else { return Some(without) };
        law = next;
    }
    let times: usize = all.iter().map(Vec::len).sum();
    let stopped = closed(recordings, &all, law.zero);
    Some(match told_apart(&stopped, &law) {
        Some((Follows::Sum, shares)) if follows != Follows::Sum || shares[0] < left[0] => {
            let left = shares;
            BetweenStops { law, follows: Follows::Sum, left, stopped: Some((stopped, times)) }
        }
        _ => without,
    })
}

/// The rows of each recording in which a stop holds the servomotor, rest by rest; without a law all that it stays at an end.
fn rests(recordings: &[Recording], law: Option<&Plain>) -> Vec<Vec<RangeInclusive<usize>>> {
    let position = |frame: &Frame| Signal::ServomotorPosition.of(&frame.measured);
    let positions = recordings.iter().flat_map(|one| one.frames.iter().map(position)).filter(|y| y.is_finite());
    let mut positions: Vec<f64> = positions.collect();
    positions.sort_by(f64::total_cmp);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in the list")]
    let beyond = (BEYOND * positions.len() as f64) as usize;
    let at = |place: usize| positions.get(place).copied().unwrap_or(0.0);
    let (low, high) = (at(beyond), at(positions.len().saturating_sub(1 + beyond)));
    let near = AT_END * (high - low);
    let of = |recording: &Recording| {
        let frames = &recording.frames;
        let samples: Vec<usize> = (0..frames.len()).filter(|&row| position(&frames[row]).is_finite()).collect();
        let held_at = |end: f64, way: f64| {
            let is_held = |row: usize| {
                let drives = law.is_none_or(|law| way * law.speed(frames[row].measured.spool_position_pu) > 0.0);
                drives && way * (end - position(&frames[row])) <= near
            };
            let step_s = |pair: &[usize]| seconds_from_nanos(frames[pair[1]].time_ns - frames[pair[0]].time_ns);
            let driven_on = |rest: &&[usize]| {
                let Some(law) = law else { return rest.len() > FEWEST };
                let goes = |pair: &[usize]| way * law.speed(frames[pair[0]].measured.spool_position_pu) * step_s(pair);
                rest.windows(2).map(goes).sum::<f64>() > DRIVEN_ON * (high - low)
            };
            let rests = samples.chunk_by(|&a, &b| is_held(a) && is_held(b)).filter(driven_on);
            let settled = rests.filter_map(|rest| settled(rest, |row| way * position(&frames[row])));
            settled.collect::<Vec<_>>()
        };
        let mut all = [held_at(low, -1.0), held_at(high, 1.0)].concat();
        all.sort_by_key(|rest| *rest.start());
        all
    };
    recordings.iter().map(of).collect()
}

/// A rest from the first row on that is as far as half of them.
fn settled(rest: &[usize], far: impl Fn(usize) -> f64) -> Option<RangeInclusive<usize>> {
    let mut values: Vec<f64> = rest.iter().map(|row| far(*row)).collect();
    values.sort_by(f64::total_cmp);
    let usual = values[values.len() / 2];
    let first = rest.iter().find(|row| far(**row) >= usual)?;
    Some(*first..=*rest.last()?)
}

/// What lies between the rests, each stretch as a recording.
fn between(recordings: &[Recording], rests: &[Vec<RangeInclusive<usize>>]) -> Vec<Recording> {
    let mut all = Vec::new();
    for (recording, rests) in recordings.iter().zip(rests) {
        let ends = rests.iter().map(|rest| *rest.start()).chain([recording.frames.len()]);
        let starts = std::iter::once(0).chain(rests.iter().map(|rest| rest.end() + 1));
        for (from, to) in starts.zip(ends).filter(|(from, to)| from + FEWEST < *to) {
            all.push(Recording::new(&recording.name, recording.frames[from..to].to_vec()));
        }
    }
    all
}

/// The recordings with the spool closed in all rests.
fn closed(recordings: &[Recording], rests: &[Vec<RangeInclusive<usize>>], zero: f64) -> Vec<Recording> {
    let mut all = recordings.to_vec();
    for (recording, rests) in all.iter_mut().zip(rests) {
        for row in rests.iter().cloned().flatten() {
            recording.frames[row].measured.spool_position_pu = zero;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::frame::{EsvState, Inputs, Signals};

    /// A position under a drive that is held for a while and then changes, row by row.
    fn recorded(mut step: impl FnMut(f64, f64) -> f64, drives: &[f64]) -> Recording {
        let inputs = Inputs {
            opening_command_pu: f64::NAN,
            esv: EsvState::Normal,
            tank_pressure_pa: f64::NAN,
            piston_force_n: 0.0,
        };
        let mut position = 0.5;
        let row = |k: i64| {
            let drive = drives[usize::try_from(k).unwrap() / 70 % drives.len()];
            let measured = Signals { spool_position_pu: drive, servomotor_position_pu: position, ..Signals::NONE };
            position = step(position, drive);
            Frame { time_ns: k * 100_000_000, inputs, measured }
        };
        Recording::new("r", (0..2400).map(row).collect())
    }

    #[test]
    fn a_stop_is_told_from_a_set_point_at_the_end_of_the_travel() {
        let drives = [0.8, -0.6, 0.0, -0.9, 0.3, 1.0, -0.2, 0.6, -1.0, 0.5];
        let rate = |drive: f64| 0.02 * f64::signum(drive) * (drive.abs() - 0.1).max(0.0);
        let stage = recorded(|position, drive| (position + rate(drive)).clamp(0.0, 1.0), &drives);
        let found = between_stops(&[stage]).unwrap();
        let (recordings, times) = found.stopped.unwrap();
        assert!(found.follows == Follows::Sum && times > 3, "{:?} {times}", found.follows);
        assert!((found.law.half_band - 0.1).abs() < 0.02 && found.law.zero.abs() < 0.02, "{:?}", found.law);
        let closed = recordings[0].frames.iter().filter(|frame| frame.measured.spool_position_pu == found.law.zero);
        assert!(closed.count() > 200);

        let loops = recorded(|position, drive| position + 0.08 * (0.5 + 0.5 * drive - position), &drives);
        let found = between_stops(&[loops]).unwrap();
        assert!(matches!(found.follows, Follows::Spool { .. }) && found.stopped.is_none(), "{:?}", found.follows);
    }
}
