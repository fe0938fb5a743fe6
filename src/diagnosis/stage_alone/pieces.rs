//! Recordings cut into pieces of equal time, so that there is something to leave out.

use std::ops::Range;

use crate::stage_alone::run::LEAD;
use govtwin_model::recording::Recording;
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

/// Pieces that all recordings of a stage without a data sheet are cut into, at most: each is left out in turn.
pub(crate) const PIECES: usize = 6;
/// How much of what drove it before a piece is looked at, as a share of its length.
const LEAD_OF_PIECE: f64 = 0.25;
/// Fewest samples of a piece.
const FEWEST: usize = 50;

/// Cuts recordings into no more than so many pieces altogether, one of each recording at least; each with what drove it for a while before.
pub fn pieces(recordings: &[Recording], most: usize) -> Vec<Recording> {
    let most = (most / recordings.len().max(1)).max(1);
    let mut all = Vec::new();
    for recording in recordings {
        let count = (recording.frames.len() / FEWEST).clamp(1, most);
        let length_s = length_s_of(recording) / count as f64;
        let mut edges = edges(recording, length_s, count, 0.0);
        edges[count] = recording.frames.len();
        for (k, pair) in edges.windows(2).enumerate().filter(|(_, pair)| pair[0] < pair[1]) {
            let name = match count {
                1 => recording.name.clone(),
                _ => format!("{}, part {} of {count}", recording.name, k + 1),
            };
            all.push(behind(recording, name, pair[0]..pair[1], LEAD_OF_PIECE * length_s));
        }
    }
    all
}

/// Free runs of a length, one behind another, without what is left over at the end, s; each with what drove it for so many lengths before.
///
/// What drove a recording before it began nobody knows, so that its first run begins as much later, unless it `begins_at_rest`.
pub(crate) fn windows(recording: &Recording, length_s: f64, begins_at_rest: bool, history: f64) -> Vec<Recording> {
    let lead = if begins_at_rest { 0.0 } else { LEAD };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count")]
    let count = ((length_s_of(recording) / length_s - lead).max(0.0) * (1.0 + 1e-9)) as usize;
    let edges = edges(recording, length_s, count, lead);
    let of = |pair: &[usize]| behind(recording, recording.name.clone(), pair[0]..pair[1], history * length_s);
    edges.windows(2).map(of).collect()
}

/// The rows at which so many stretches of a length begin, and where the last one ends; the first a share of the length behind the beginning.
fn edges(recording: &Recording, length_s: f64, count: usize, lead: f64) -> Vec<usize> {
    let begins_ns = recording.frames.first().map_or(0, |frame| frame.time_ns);
    let row = |k: usize| {
        let until_s = (k as f64 + lead) * length_s;
        recording.frames.partition_point(|frame| seconds_from_nanos(frame.time_ns - begins_ns) < until_s)
    };
    (0..=count).map(row).collect()
}

/// Some rows of a recording, behind those of a while before in which only the spool is known.
fn behind(recording: &Recording, name: String, rows: Range<usize>, lead_s: f64) -> Recording {
    let (from_ns, lead_ns) = (recording.frames[rows.start].time_ns, nanos_from_seconds(lead_s));
    let first = recording.frames[..rows.start].partition_point(|frame| from_ns - frame.time_ns > lead_ns);
    let mut frames = recording.frames[first..rows.end].to_vec();
    frames[..rows.start - first].iter_mut().for_each(|frame| frame.measured.servomotor_position_pu = f64::NAN);
    Recording { process: recording.process, ..Recording::new(name, frames) }
}

/// How long a recording is, s.
pub fn length_s_of(recording: &Recording) -> f64 {
    match recording.frames.as_slice() {
        [first, .., last] => seconds_from_nanos(last.time_ns - first.time_ns),
        _ => 0.0,
    }
}
