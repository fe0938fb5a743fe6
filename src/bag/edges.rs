//! Where an input begins after the recording, or ends before it: rows that are left out, and a last value that holds.

use super::topic_survey::PaceSurvey;
use super::{Stream, StreamHealth, Warning};
use govtwin_model::units::seconds_from_nanos;

/// Edges nearer than this are no news, s.
const WORTH_A_WORD_S: f64 = 1.0;

/// Edges nearer than this many intervals of the stream are none.
const PERIODS: f64 = 3.0;

/// Rows before each input's first sample, in the order of [`Stream::INPUTS`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Edges([u64; 3]);

impl Edges {
    /// Counts a row that has these inputs; true where one of them is missing, so that it is left out.
    pub(super) fn count(&mut self, in_force: [bool; 3]) -> bool {
        for (rows, in_force) in self.0.iter_mut().zip(in_force) {
            *rows += u64::from(!in_force);
        }
        in_force.contains(&false)
    }
}

/// The findings on the edges of the inputs; `healths` in the order of [`Stream::ALL`].
pub(super) fn warnings(edges: Edges, healths: &[StreamHealth]) -> Vec<Warning> {
    let heard = || healths.iter().filter(|health| health.kept > 0);
    let first_ns = heard().map(|health| health.pace.first_ns).min().unwrap_or_default();
    let ends = |streams: &[Stream]| {
        let of = Stream::ALL.iter().zip(healths).filter(|(stream, health)| health.kept > 0 && streams.contains(stream));
        of.map(|(_, health)| health.pace.last_ns).max()
    };
    let last_ns = ends(&[Stream::Command, Stream::ServoState]).or(ends(&Stream::ALL)).unwrap_or_default();
    let mut found = vec![];
    for (stream, health) in Stream::ALL.into_iter().zip(healths) {
        if health.kept == 0 || !Stream::INPUTS.contains(&stream) {
            continue;
        }
        let topic = || health.topic.clone();
        let (late_ns, early_ns) =
            (health.pace.first_ns.saturating_sub(first_ns), last_ns.saturating_sub(health.pace.last_ns));
        if is_news(late_ns, &health.pace) {
            let place = Stream::INPUTS.iter().position(|input| *input == stream);
            let rows = place.map_or(0, |place| edges.0[place]);
            found.push(Warning::BeginsLate { topic: topic(), late_s: seconds_from_nanos(late_ns), rows });
        }
        // An ESV may speak only when it changes: its last state holds by right.
        if stream != Stream::Esv && is_news(early_ns, &health.pace) {
            found.push(Warning::EndsEarly { topic: topic(), early_s: seconds_from_nanos(early_ns) });
        }
        let more_ns = health.pace.last_ns.saturating_sub(last_ns);
        if is_news(more_ns, &health.pace) {
            found.push(Warning::GoesOn { topic: topic(), more_s: seconds_from_nanos(more_ns) });
        }
    }
    found
}

fn is_news(distance_ns: i64, pace: &PaceSurvey) -> bool {
    let distance_s = seconds_from_nanos(distance_ns);
    let period_s = if pace.rate_hz > 0.0 { 1.0 / pace.rate_hz } else { 0.0 };
    distance_s > WORTH_A_WORD_S && distance_s > PERIODS * period_s
}
