//! Recordings cut into pieces of equal time, so that there is something to leave out.

use govtwin_model::recording::Recording;
use govtwin_model::units::seconds_from_nanos;

/// Fewest samples of a piece.
const FEWEST: usize = 50;

/// Cuts recordings into no more than so many pieces altogether, one of each recording at least.
#[must_use]
pub fn pieces(recordings: &[Recording], most: usize) -> Vec<Recording> {
    let most = (most / recordings.len().max(1)).max(1);
    let mut all = Vec::new();
    for recording in recordings {
        let count = (recording.frames.len() / FEWEST).clamp(1, most);
        for (k, frames) in parts(recording, count).into_iter().enumerate() {
            let name = match count {
                1 => recording.name.clone(),
                _ => format!("{}, part {} of {count}", recording.name, k + 1),
            };
            all.push(Recording { process: recording.process, ..Recording::new(name, frames) });
        }
    }
    all
}

/// Free runs of a length, one behind another, without what is left over at the end, s.
#[must_use]
pub fn windows(recording: &Recording, length_s: f64) -> Vec<Recording> {
    let whole_s = length_s_of(recording);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count")]
    let count = (whole_s / length_s * (1.0 + 1e-9)) as usize;
    if count == 0 {
        return Vec::new();
    }
    let begins_ns = recording.frames[0].time_ns;
    let row = |k: usize| {
        let until_s = k as f64 * length_s;
        recording.frames.partition_point(|frame| seconds_from_nanos(frame.time_ns - begins_ns) < until_s)
    };
    let of = |k: usize| {
        let frames = recording.frames[row(k)..row(k + 1)].to_vec();
        Recording { process: recording.process, ..Recording::new(&recording.name, frames) }
    };
    (0..count).map(of).collect()
}

/// How long a recording is, s.
#[must_use]
pub fn length_s_of(recording: &Recording) -> f64 {
    match recording.frames.as_slice() {
        [first, .., last] => seconds_from_nanos(last.time_ns - first.time_ns),
        _ => 0.0,
    }
}

/// So many parts of equal time.
fn parts(recording: &Recording, count: usize) -> Vec<Vec<govtwin_model::frame::Frame>> {
    let mut all = vec![Vec::new(); count];
    let whole_s = length_s_of(recording).max(f64::MIN_POSITIVE);
    let begins_ns = recording.frames.first().map_or(0, |frame| frame.time_ns);
    for frame in &recording.frames {
        let share = seconds_from_nanos(frame.time_ns - begins_ns) / whole_s;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count")]
        let part = ((share * count as f64) as usize).min(count - 1);
        all[part].push(*frame);
    }
    all.retain(|part| !part.is_empty());
    all
}
