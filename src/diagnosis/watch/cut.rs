//! Cutting processes out of an unbroken stream of rows: start-up, load change, shutdown and load rejection by themselves.
//!
//! A process begins a little before command or position leave where they were, or the emergency shutdown valve trips, and ends when nothing has moved
//! for a while. What lies between is rest and is dropped, so that memory holds one process at most.

use std::collections::VecDeque;

use govtwin_files::digest::Digest;
use govtwin_model::frame::{EsvState, Frame};
use govtwin_model::recording::Recording;
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// A movement that begins a process, pu: more than a grid's unrest moves the command.
const BEGINS_PU: f64 = 0.03;
/// A movement that keeps it going, pu.
const GOES_ON_PU: f64 = 0.015;
/// Kept before the movement, s.
pub const LEAD_S: f64 = 4.0;
/// Nothing has moved for so long at its end, s: a starting unit holds its opening while it runs up.
const REST_S: f64 = 25.0;
/// A process that lasts longer is cut here, s.
const LONGEST_S: f64 = 300.0;
/// A gap in time that ends a process, s.
pub const GAP_S: f64 = 5.0;
/// A shorter process is not evaluated, s.
const SHORTEST_S: f64 = 5.0;

/// A process that has ended.
#[derive(Clone, Debug, PartialEq)]
pub struct CutProcess {
    /// Its rows, named by nothing yet.
    pub recording: Recording,
    /// Digest of its rows: the same process read again, of a copy or of a bag that has grown meanwhile, has the same.
    pub digest: String,
    /// Why it ended.
    pub ended: Ended,
}

/// Why a process ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// Nothing moved any more.
    AtRest,
    /// Time jumped.
    Gap,
    /// It lasted too long and goes on in the next.
    TooLong,
    /// The rows ended.
    OfRows,
}

/// Where command and position were when they last moved.
#[derive(Clone, Copy, Debug)]
struct LastMove {
    time_ns: i64,
    command_pu: f64,
    position_pu: f64,
    esv: EsvState,
}

impl LastMove {
    fn at(frame: &Frame) -> Self {
        Self {
            time_ns: frame.time_ns,
            command_pu: frame.inputs.opening_command_pu,
            position_pu: frame.measured.servomotor_position_pu,
            esv: frame.inputs.esv,
        }
    }

    /// Takes what was not known in.
    fn complete(&mut self, frame: &Frame) {
        if !self.command_pu.is_finite() {
            self.command_pu = frame.inputs.opening_command_pu;
        }
        if !self.position_pu.is_finite() {
            self.position_pu = frame.measured.servomotor_position_pu;
        }
    }

    fn is_left(&self, frame: &Frame, by_pu: f64, stroke: f64) -> bool {
        let apart = |a: f64, b: f64, by: f64| a.is_finite() && b.is_finite() && (a - b).abs() > by;
        apart(frame.inputs.opening_command_pu, self.command_pu, by_pu)
            || apart(frame.measured.servomotor_position_pu, self.position_pu, by_pu * stroke)
            || frame.inputs.esv != self.esv
    }
}

/// Cuts rows into processes.
#[derive(Clone, Debug)]
pub struct Cutter {
    /// The rows of the process, or the last few at rest.
    rows: VecDeque<Frame>,
    anchor: Option<LastMove>,
    moving: bool,
    /// The stroke in the numbers of recorded positions.
    stroke: f64,
}

impl Default for Cutter {
    fn default() -> Self {
        Self::of_stroke(1.0)
    }
}

impl Cutter {
    /// Cuts rows whose positions are no pu, but cover so much of their own unit over the stroke.
    pub(crate) fn of_stroke(stroke: f64) -> Self {
        Self { rows: VecDeque::new(), anchor: None, moving: false, stroke }
    }

    /// Takes a row, which may end a process.
    pub fn row(&mut self, frame: &Frame) -> Option<CutProcess> {
        let jumped = self.rows.back().is_some_and(|last| {
            let step_s = seconds_from_nanos(frame.time_ns - last.time_ns);
            !(0.0..=GAP_S).contains(&step_s)
        });
        let broken = if jumped { self.finish(Ended::Gap) } else { None };
        let anchor = self.anchor.get_or_insert_with(|| LastMove::at(frame));
        anchor.complete(frame);
        self.rows.push_back(*frame);
        let since_s = |time_ns: i64| seconds_from_nanos(frame.time_ns - time_ns);
        if self.moving {
            if anchor.is_left(frame, GOES_ON_PU, self.stroke) {
                *anchor = LastMove::at(frame);
                anchor.complete(frame);
            }
            let rests = since_s(anchor.time_ns) >= REST_S;
            let begun_ns = self.rows.front().map_or(frame.time_ns, |first| first.time_ns);
            let too_long = since_s(begun_ns) >= LONGEST_S;
            if rests || too_long {
                return self.finish(if rests { Ended::AtRest } else { Ended::TooLong });
            }
        } else if anchor.is_left(frame, BEGINS_PU, self.stroke) {
            self.moving = true;
            *anchor = LastMove::at(frame);
        } else {
            while self.rows.front().is_some_and(|first| since_s(first.time_ns) > LEAD_S) {
                self.rows.pop_front();
            }
            // A slow wander is no movement: the anchor follows what was a little while ago.
            if let Some(first) = self.rows.front().filter(|_| since_s(anchor.time_ns) > LEAD_S) {
                let before = *anchor;
                *anchor = LastMove::at(first);
                let known = |new: f64, old: f64| if new.is_finite() { new } else { old };
                anchor.command_pu = known(anchor.command_pu, before.command_pu);
                anchor.position_pu = known(anchor.position_pu, before.position_pu);
            }
        }
        broken
    }

    /// The process that the rows break off in, where they end.
    pub fn end(&mut self) -> Option<CutProcess> {
        self.finish(Ended::OfRows)
    }

    /// Whether a process has begun and not ended.
    pub fn is_moving(&self) -> bool {
        self.moving
    }

    fn finish(&mut self, ended: Ended) -> Option<CutProcess> {
        let moving = std::mem::take(&mut self.moving);
        self.anchor = None;
        let rows: Vec<Frame> = std::mem::take(&mut self.rows).into();
        let recording = Recording::new("", rows);
        if !moving || recording.duration_s() < SHORTEST_S {
            return None;
        }
        let digest = digest(&recording.frames);
        Some(CutProcess { recording, digest, ended })
    }
}

fn digest(frames: &[Frame]) -> String {
    let mut digest = Digest::default();
    for frame in frames {
        digest.update(frame.time_ns.to_le_bytes());
        digest.update_f64(frame.inputs.opening_command_pu);
        digest.update([u8::from(frame.inputs.esv == EsvState::Shutdown)]);
        for signal in Signal::ALL {
            digest.update_f64(signal.of(&frame.measured));
        }
    }
    digest.text()
}

#[cfg(test)]
mod tests {
    use super::{CutProcess, Cutter, Ended};
    use crate::generate::{self, Scenario};
    use govtwin_model::frame::Frame;
    use govtwin_model::params;
    use govtwin_model::recording::Process;
    use govtwin_model::units::nanos_from_seconds;

    fn rows(process: Process, offset_s: f64, seed: u64) -> Vec<Frame> {
        let scenario =
            Scenario { unit: params::reference(), process, rate_hz: 50.0, duration_s: 60.0, rich: false, seed };
        let mut frames = generate::recording(&scenario).frames;
        let start_ns = frames[0].time_ns;
        frames.iter_mut().for_each(|frame| frame.time_ns += nanos_from_seconds(offset_s) - start_ns);
        frames
    }

    fn cuts(frames: &[Frame]) -> Vec<CutProcess> {
        let mut cutter = Cutter::default();
        let mut cuts: Vec<CutProcess> = frames.iter().filter_map(|frame| cutter.row(frame)).collect();
        cuts.extend(cutter.end());
        cuts
    }

    /// The last row again and again: a unit at rest.
    fn rest(frames: &mut Vec<Frame>, length_s: f64) {
        let last = *frames.last().unwrap();
        for i in 1..=((length_s * 20.0) as i64) {
            frames.push(Frame { time_ns: last.time_ns + i * 50_000_000, ..last });
        }
    }

    #[test]
    fn each_process_of_a_day_is_cut_out_once_and_known() {
        for process in Process::ALL {
            let mut frames = rows(process, 0.0, 3);
            let first = frames[0];
            let mut day: Vec<Frame> =
                (1..4000).rev().map(|i| Frame { time_ns: first.time_ns - i * 50_000_000, ..first }).collect();
            rest(&mut frames, 200.0);
            day.extend(frames);
            let cuts = cuts(&day);
            assert!(!cuts.is_empty() && cuts.len() <= 3, "{process:?}: {}", cuts.len());
            assert!(cuts.iter().any(|cut| cut.recording.process == process), "{process:?}");
            assert!(
                cuts.iter().all(|cut| cut.recording.duration_s() < 90.0 && cut.ended == Ended::AtRest),
                "{process:?}"
            );
        }
    }

    #[test]
    fn rest_and_a_wandering_grid_are_no_process() {
        let mut still = rows(Process::Startup, 0.0, 1)[..50].to_vec();
        rest(&mut still, 600.0);
        assert!(cuts(&still).is_empty());
        let wander: Vec<Frame> = (0..20_000)
            .map(|i| {
                let mut frame = still[0];
                frame.time_ns += i * 50_000_000;
                frame.inputs.opening_command_pu = 0.5 + 0.01 * (i as f64 * 0.02).sin() + 1e-5 * i as f64;
                frame.measured.servomotor_position_pu = frame.inputs.opening_command_pu;
                frame
            })
            .collect();
        assert!(cuts(&wander).is_empty());
    }

    #[test]
    fn a_stream_that_grows_gives_the_same_cuts_and_a_gap_ends_a_process() {
        let mut frames = rows(Process::LoadRejection, 0.0, 2);
        rest(&mut frames, 60.0);
        let whole = cuts(&frames);
        let mut grown = frames.clone();
        grown.extend(rows(Process::LoadIncrease, 1000.0, 2));
        let more = cuts(&grown);
        assert!(more.len() > whole.len());
        assert_eq!(
            more[..whole.len()].iter().map(|cut| &cut.digest).collect::<Vec<_>>(),
            whole.iter().map(|cut| &cut.digest).collect::<Vec<_>>()
        );
        let mut broken = rows(Process::LoadRejection, 0.0, 2)[..800].to_vec();
        broken.extend(rows(Process::Startup, 500.0, 2));
        assert_eq!(cuts(&broken)[0].ended, Ended::Gap);
    }
}
