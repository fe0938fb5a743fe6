//! A prepared recording: one made ready to be simulated many times and compared at its samples.

use std::ops::Range;

use crate::likelihood::idle::idle_segments;
use govtwin_model::frame::{Estimate, Frame, Signals};
use govtwin_model::plant::lanes::Width;
use govtwin_model::recording::{Process, Recording, SLOW_NS, median_spacing_ns};
use govtwin_model::signal::Signal;
use govtwin_model::twin::batch::{self, BatchRow};
use govtwin_model::twin::{Cut, Twin};
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

/// Median size of the second difference of white jitter, over its standard deviation.
const MEDIAN_BEND: f64 = 1.652;

/// Simulated signals in the order of [`Signal::ALL`], at each sample.
pub type Traces = [Vec<f64>; Signal::ALL.len()];

/// One recording, its rows at which something was measured, and which signals it has.
#[derive(Clone, Debug)]
pub struct PreparedRecording {
    /// What people call it.
    pub name: String,
    /// The process that it shows.
    pub process: Process,
    /// All rows but those of long idle segments.
    pub frames: Vec<Frame>,
    /// Where a rest was left out: the row behind it, and for how long it lasted, ns.
    pub seams: Vec<(usize, i64)>,
    /// Indices of the rows at which something was measured.
    pub samples: Vec<usize>,
    /// Typical time between samples, s.
    pub period_s: f64,
    /// Seconds of the unit for each second recorded, of a stage on a clock of its own.
    pub clock_ratio: f64,
    /// Whether each of [`Signal::ALL`] was measured at all.
    pub has: [bool; Signal::ALL.len()],
    /// How far the command may stray from a straight line between samples, pu, at each sample.
    pub command_doubt_pu: Vec<f64>,
    /// How far the command jitters between samples too far apart to show it, one standard deviation, pu.
    pub command_jitter_pu: f64,
    /// Where the recording stands in for the twin; a signal that does is no evidence.
    pub cut: Cut,
}

impl PreparedRecording {
    /// Prepares a recording; of a long rest it keeps beginning and end.
    pub fn new(mut recording: Recording) -> Self {
        let idle_segments = idle_segments(&recording.frames);
        let seams = leave_out(&mut recording.frames, &idle_segments);
        Self::with_seams(recording, seams)
    }

    /// Prepares what is left of a recording.
    fn with_seams(recording: Recording, seams: Vec<(usize, i64)>) -> Self {
        let Recording { name, process, frames, command_deviation_pu } = recording;
        let samples: Vec<usize> = (0..frames.len()).filter(|&row| is_sample(&frames[row])).collect();
        let has = Signal::ALL.map(|signal| samples.iter().any(|&row| signal.of(&frames[row].measured).is_finite()));
        let period_s = period_s(&frames);
        let command = |row: usize| frames[row].inputs.opening_command_pu;
        // Anywhere within what a historian lets pass.
        let everywhere_pu = command_deviation_pu / 3.0_f64.sqrt();
        let mut command_doubt_pu = vec![everywhere_pu; samples.len()];
        let mut bends = Vec::with_capacity(samples.len());
        for k in 1..samples.len().saturating_sub(1) {
            let bend = command(samples[k - 1]) - 2.0 * command(samples[k]) + command(samples[k + 1]);
            if bend.is_finite() {
                command_doubt_pu[k] = everywhere_pu.hypot(0.25 * bend);
                bends.push(bend.abs());
            }
        }
        bends.sort_by(f64::total_cmp);
        let bend = bends.get(bends.len() / 2).copied().unwrap_or(0.0);
        let command_jitter_pu = if is_slow(period_s) { bend / MEDIAN_BEND } else { 0.0 };
        Self {
            name,
            process,
            frames,
            seams,
            samples,
            period_s,
            clock_ratio: 1.0,
            has,
            command_doubt_pu,
            command_jitter_pu,
            cut: Cut::None,
        }
    }

    /// Prepares a recording whose measured spool drives the servomotor stage, which is then all that is judged.
    ///
    /// Between its samples the spool runs straight. Rests stay: inside the overlap the spool may move while command and servomotor stand still.
    pub fn servomotor_stage(mut recording: Recording) -> Self {
        join_spool(&mut recording.frames);
        Self::free_run(recording)
    }

    /// The same of a recording whose every row holds a spool position; rows before the first that holds the servomotor's are what drove it before.
    pub(crate) fn free_run(recording: Recording) -> Self {
        let mut recording = Self::with_seams(recording, Vec::new());
        recording.samples.retain(|&row| recording.frames[row].measured.servomotor_position_pu.is_finite());
        let times_ns = recording.samples.iter().map(|&row| recording.frames[row].time_ns);
        recording.period_s = seconds_from_nanos(median_spacing_ns(times_ns));
        for signal in Signal::ALL {
            recording.has[signal as usize] &= signal == Signal::ServomotorPosition;
        }
        recording.command_doubt_pu = vec![0.0; recording.samples.len()];
        recording.command_jitter_pu = 0.0;
        recording.cut = Cut::Spool;
        recording
    }

    /// The same by the clock of the unit, which what a model leaves out goes by.
    pub(crate) fn unit_period_s(&self) -> f64 {
        self.period_s * self.clock_ratio
    }

    /// Whether its samples are so far apart that nobody knows what drives the unit between them.
    pub(crate) fn is_slow(&self) -> bool {
        is_slow(self.period_s)
    }

    /// Whether its recorded spool drives all that is judged.
    pub(crate) fn is_driven(&self) -> bool {
        self.cut == Cut::Spool
    }

    /// The signals that were measured.
    pub fn signals(&self) -> impl Iterator<Item = Signal> {
        Signal::ALL.into_iter().filter(|&signal| self.has[signal as usize])
    }

    /// Place of a signal among those that were measured; none where it was not.
    pub fn place(&self, signal: Signal) -> Option<usize> {
        self.signals().position(|other| other == signal)
    }

    /// Place of a sample among the residuals: one signal behind another, then what compares limit cycles.
    pub fn residual(&self, place: usize, sample: usize) -> usize {
        place * self.samples.len() + sample
    }

    /// A signal as measured at each sample; not a number where it was not.
    pub fn measured(&self, signal: Signal) -> Vec<f64> {
        self.samples.iter().map(|&row| signal.of(&self.frames[row].measured)).collect()
    }

    /// Time of a sample since the first row, s; of a stage since its first sample, before which there is only what drove it.
    pub(crate) fn time_s(&self, sample: usize) -> f64 {
        let first = if self.is_driven() { self.samples[0] } else { 0 };
        seconds_from_nanos(self.frames[self.samples[sample]].time_ns - self.frames[first].time_ns)
    }

    /// Speed of a signal at each sample, from so long before to as long after: noise of neighbouring samples is no speed. Not a number where it was not
    /// measured.
    pub(crate) fn speeds(&self, signal: Signal, reach_s: f64) -> Vec<f64> {
        let measured = self.measured(signal);
        let (reach, last) = (self.samples_in(reach_s), measured.len().saturating_sub(1));
        let of = |sample: usize| {
            let (before, after) = (sample.saturating_sub(reach), (sample + reach).min(last));
            let elapsed_s = (self.time_s(after) - self.time_s(before)).max(1e-3);
            (measured[after] - measured[before]) / elapsed_s
        };
        (0..measured.len()).map(of).collect()
    }

    /// Time since the sample before, s; 0 for the first.
    pub fn steps_s(&self) -> Vec<f64> {
        let times_ns = self.samples.iter().map(|&row| self.frames[row].time_ns);
        let before_ns = times_ns.clone().take(1).chain(times_ns.clone());
        times_ns.zip(before_ns).map(|(here, before)| seconds_from_nanos(here - before)).collect()
    }

    /// How many samples a time holds, one at least.
    pub(crate) fn samples_in(&self, time_s: f64) -> usize {
        let period_ns = nanos_from_seconds(self.period_s).max(1);
        usize::try_from((nanos_from_seconds(time_s) + period_ns / 2) / period_ns).unwrap_or(1).max(1)
    }

    /// Simulates the recording; one estimate for each sample.
    pub fn run(&self, twin: &mut Twin) -> Vec<Estimate> {
        twin.reset();
        let mut estimates = Vec::with_capacity(self.samples.len());
        for BatchRow { frame, is_sample } in self.rows(twin) {
            if is_sample {
                estimates.push(twin.step(&frame));
            } else {
                twin.advance(&frame);
            }
        }
        estimates
    }

    /// Simulates it by several twins, side by side where they fit; for each the same as by itself.
    pub fn run_batch(&self, twins: &mut [Twin]) -> Vec<Vec<Estimate>> {
        in_batches(twins, |width, twins| self.run_batch_of(width, twins), |twin| self.run(twin))
    }

    /// The same in lanes of a width, of no more twins than it has lanes, which must fit side by side.
    pub fn run_batch_of(&self, width: Width, twins: &mut [Twin]) -> Vec<Vec<Estimate>> {
        batch::estimates(width, twins, self.rows_of(twins))
    }

    /// The same without all but the signals that were measured: for each twin those of [`Signal::ALL`] at each sample, empty where unwanted.
    pub fn traces(&self, twins: &mut [Twin]) -> Vec<Traces> {
        let side_by_side =
            |width: Width, twins: &mut [Twin]| batch::signals(width, twins, self.rows_of(twins), self.has);
        let alone = |twin: &mut Twin| {
            let estimates = self.run(twin);
            Signal::ALL
                .map(|signal| if self.has[signal as usize] { signal.of_estimates(&estimates) } else { Vec::new() })
        };
        in_batches(twins, side_by_side, alone)
    }

    /// Rows as a twin sees them.
    ///
    /// A plant whose inputs have a clock of their own reads commands and ESV ahead of their rows. The twin's clock stands
    /// still over the idle segments that are left out.
    fn rows(&self, twin: &Twin) -> impl Iterator<Item = BatchRow> + use<'_> {
        let lookahead_ns = nanos_from_seconds(twin.plant().lookahead_s);
        let mut samples = self.samples.iter().peekable();
        let mut source = 0;
        let (mut seams, mut rested_ns) = (self.seams.iter().peekable(), 0);
        self.frames.iter().enumerate().map(move |(row, frame)| {
            let mut frame = *frame;
            if lookahead_ns > 0 {
                while self.frames.get(source + 1).is_some_and(|next| next.time_ns <= frame.time_ns + lookahead_ns) {
                    source += 1;
                }
                let inputs = &self.frames[source].inputs;
                frame.inputs.opening_command_pu = inputs.opening_command_pu;
                frame.inputs.esv = inputs.esv;
            }
            while let Some((_, rest_ns)) = seams.next_if(|(behind, _)| *behind == row) {
                rested_ns += rest_ns;
            }
            frame.time_ns -= rested_ns;
            BatchRow { frame, is_sample: samples.next_if(|&&sample| sample == row).is_some() }
        })
    }

    /// The same of several twins: once where all see the same.
    fn rows_of(&self, twins: &[Twin]) -> Vec<impl Iterator<Item = BatchRow> + use<'_>> {
        let alike = twins.windows(2).all(|two| two[0].plant().lookahead_s == two[1].plant().lookahead_s);
        twins[..if alike { 1 } else { twins.len() }].iter().map(|twin| self.rows(twin)).collect()
    }
}

/// Whether anything was measured at a row.
fn is_sample(frame: &Frame) -> bool {
    Signal::ALL.iter().any(|signal| signal.of(&frame.measured).is_finite())
}

/// Median time between the rows at which something was measured, s; 0 where there are fewer than two.
fn period_s(frames: &[Frame]) -> f64 {
    seconds_from_nanos(median_spacing_ns(frames.iter().filter(|frame| is_sample(frame)).map(|frame| frame.time_ns)))
}

/// Leaves the rows that hold spool or servomotor, with a straight line where the spool has no sample of its own; rows before its first and behind
/// its last are of no use.
pub(crate) fn join_spool(frames: &mut Vec<Frame>) {
    frames.retain(|frame| {
        frame.measured.spool_position_pu.is_finite() || frame.measured.servomotor_position_pu.is_finite()
    });
    let seen: Vec<usize> =
        (0..frames.len()).filter(|&row| frames[row].measured.spool_position_pu.is_finite()).collect();
    let (Some(&first), Some(&last)) = (seen.first(), seen.last()) else { return frames.clear() };
    for pair in seen.windows(2).filter(|pair| pair[1] > pair[0] + 1) {
        let [(from_ns, from), (to_ns, to)] =
            [pair[0], pair[1]].map(|row| (frames[row].time_ns, frames[row].measured.spool_position_pu));
        for frame in &mut frames[pair[0] + 1..pair[1]] {
            let share = (frame.time_ns - from_ns) as f64 / (to_ns - from_ns).max(1) as f64;
            frame.measured.spool_position_pu = from + share * (to - from);
        }
    }
    frames.truncate(last + 1);
    // A free run starts where the servomotor was measured.
    let starts = |frame: &Frame| frame.measured.servomotor_position_pu.is_finite();
    let start = frames.iter().skip(first).position(starts).map_or(frames.len(), |behind| first + behind);
    frames.drain(..start);
}

/// How long before the next row the one stands that holds its spool, ns.
const HELD_NS: i64 = 1;

/// Whether a row only holds the spool of the one before it.
pub(crate) fn is_held(rows: &[Frame], row: usize) -> bool {
    rows.get(row + 1).is_some_and(|next| next.time_ns - rows[row].time_ns == HELD_NS)
}

/// Holds the spool of each row until the next: a row right before that one says so.
pub(crate) fn hold_spool(frames: &mut Vec<Frame>) {
    let held = |pair: &[Frame]| {
        let spool_position_pu = pair[0].measured.spool_position_pu;
        let before = Frame {
            time_ns: pair[1].time_ns - HELD_NS,
            measured: Signals { spool_position_pu, ..Signals::NONE },
            ..pair[0]
        };
        [before, pair[1]]
    };
    *frames = frames.first().copied().into_iter().chain(frames.windows(2).flat_map(held)).collect();
}

/// Goes through twins as many at a time as there are lanes, and one by one where they do not fit side by side.
fn in_batches<R>(
    twins: &mut [Twin],
    side_by_side: impl Fn(Width, &mut [Twin]) -> Vec<R>,
    alone: impl Fn(&mut Twin) -> R,
) -> Vec<R> {
    let batch = |twins: &mut [Twin]| {
        let width = if twins.len() > 1 && batch::fit(twins) { Width::holding(twins.len()) } else { None };
        match width {
            Some(width) => side_by_side(width, twins),
            None => twins.iter_mut().map(&alone).collect(),
        }
    };
    twins.chunks_mut(Width::most_lanes()).flat_map(batch).collect()
}

/// Takes ranges of rows out, in their order; for each the row that now stands there, and the time that is left out, ns.
fn leave_out(frames: &mut Vec<Frame>, ranges: &[Range<usize>]) -> Vec<(usize, i64)> {
    let mut seams = Vec::with_capacity(ranges.len());
    let mut gone = 0;
    for range in ranges {
        seams.push((range.start - gone, frames[range.end - gone].time_ns - frames[range.start - gone].time_ns));
        frames.drain(range.start - gone..range.end - gone);
        gone += range.len();
    }
    seams
}

/// Whether samples so far apart leave open what inputs do between them.
fn is_slow(period_s: f64) -> bool {
    period_s > seconds_from_nanos(SLOW_NS)
}
