//! What samples and rows show of their senders, clocks and transducers, taken one by one in memory that does not grow.

use super::chain::ChainEvidence;
use super::channel::{Behaviour, Channel};
use super::clock::Clock;
use super::topic::RawView;
use super::{Positions, Qos, Stream};
use govtwin_model::frame::{EsvState, Frame};
use govtwin_model::signal::Signal;

/// Opening command: a governor computes it, so that nothing bounds its speed; 2 % of the stroke is more than any dither.
pub(crate) const COMMAND: Behaviour = Behaviour { worth: 0.02, fastest_per_s: 0.0 };
/// Tank pressure: oil and gas of an accumulator do not rise and fall by more than 0.2 MPa each second.
pub(crate) const PRESSURE: Behaviour = Behaviour { worth: 1e5, fastest_per_s: 2e5 };
/// ESV: two states, of which each may follow the other.
pub(crate) const ESV: Behaviour = Behaviour { worth: f64::INFINITY, fastest_per_s: f64::INFINITY };
/// The measured signals in the order of [`Signal::ALL`](govtwin_model::signal::Signal::ALL). No servomotor runs its stroke in less than 0.5 s, no
/// spool in less than 50 ms, no pilot valve in less than 5 ms; of the control pressure nothing is known, for oil hammers.
pub(crate) const MEASURED: [Behaviour; 4] = [
    Behaviour { worth: 0.02, fastest_per_s: 2.0 },
    Behaviour { worth: 0.02, fastest_per_s: 20.0 },
    Behaviour { worth: 0.05, fastest_per_s: 200.0 },
    Behaviour { worth: f64::INFINITY, fastest_per_s: f64::INFINITY },
];

/// The most frame names that are distinguished.
const MOST_FRAMES: usize = 4;

/// What one stream shows.
#[derive(Clone, Debug)]
pub(super) struct StreamEvidence {
    /// Different `frame_id`s, the first few.
    pub(super) frames: Vec<String>,
    frame: usize,
    /// How often the `frame_id` is another than in the message before.
    pub(super) switches: u64,
    sequence: Option<u32>,
    /// Numbers that a sender's count leaves out.
    pub(super) lost: u64,
    /// How often the count goes back.
    pub(super) counted_back: u64,
    /// Senders that the recorder saw on the topic.
    pub(super) offered: usize,
    /// Samples in use.
    pub(super) samples: u64,
    /// Stamps against the time of recording.
    pub(super) clock: Clock,
    /// A number of each sample.
    pub(super) channel: Channel,
}

impl StreamEvidence {
    pub(super) fn new(stream: Stream) -> Self {
        let behaviour = match stream {
            Stream::Command => COMMAND,
            Stream::TankPressure => PRESSURE,
            Stream::Esv | Stream::ServoState | Stream::Load => ESV,
        };
        Self {
            frames: vec![],
            frame: 0,
            switches: 0,
            sequence: None,
            lost: 0,
            counted_back: 0,
            offered: 0,
            samples: 0,
            clock: Clock::default(),
            channel: Channel::new(behaviour),
        }
    }

    /// A message as it arrives.
    pub(super) fn message(&mut self, message: RawView<'_>, frame_id: &str) {
        if self.frames.get(self.frame).is_none_or(|frame| !frame.bytes().eq(frame_id.bytes())) {
            self.switches += u64::from(!self.frames.is_empty());
            self.frame = self.frames.iter().position(|frame| frame == frame_id).unwrap_or(self.frames.len());
            if self.frame == self.frames.len() && self.frames.len() < MOST_FRAMES {
                self.frames.push(frame_id.to_owned());
            }
        }
        // 0 throughout means that the sender does not count.
        if let Some(last) = self.sequence.filter(|last| *last > 0 || message.sequence > 0) {
            match message.sequence.checked_sub(last) {
                Some(step) if step > 0 => self.lost += u64::from(step - 1),
                _ => self.counted_back += 1,
            }
        }
        if self.sequence.is_none() {
            self.offered = Qos::offered(&message.topic.offered_qos_profiles);
        }
        self.sequence = Some(message.sequence);
    }

    /// A sample in the order of stamps.
    pub(super) fn sample(&mut self, stamp_ns: i64, log_time_ns: i64, number: f64) {
        self.samples += 1;
        self.clock.push(stamp_ns, log_time_ns);
        self.channel.push(stamp_ns, number);
    }
}

/// A run in which a measured signal stays the same to the last bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Still {
    /// The value.
    pub(super) value: f64,
    /// When it begins, ns.
    pub(super) from_ns: i64,
    /// When it ends, ns.
    pub(super) to_ns: i64,
    /// Samples in it.
    pub(super) samples: u64,
    /// How far command or servomotor moved meanwhile, pu.
    pub(super) moved_pu: f64,
    least: [f64; 2],
    most: [f64; 2],
}

/// What one measured signal shows.
#[derive(Clone, Debug)]
pub(super) struct MeasuredEvidence {
    pub(super) signal: Signal,
    pub(super) channel: Channel,
    still: Option<Still>,
    /// The run during which most moved.
    pub(super) frozen: Option<Still>,
}

impl MeasuredEvidence {
    fn row(&mut self, frame: &Frame) {
        let value = self.signal.of(&frame.measured);
        if !value.is_finite() {
            return;
        }
        self.channel.push(frame.time_ns, value);
        let servomotor = Signal::ServomotorPosition;
        let movers = [
            frame.inputs.opening_command_pu,
            if self.signal == servomotor { f64::NAN } else { servomotor.of(&frame.measured) },
        ];
        let normal = frame.inputs.esv == EsvState::Normal;
        match &mut self.still {
            // A servo system that has been shut down rests, whatever its command.
            Some(still) if still.value.to_bits() == value.to_bits() && normal => {
                still.to_ns = frame.time_ns;
                still.samples += 1;
                for (k, mover) in movers.into_iter().enumerate() {
                    // NaN leaves both as they are.
                    still.least[k] = still.least[k].min(mover);
                    still.most[k] = still.most[k].max(mover);
                    still.moved_pu = still.moved_pu.max(still.most[k] - still.least[k]);
                }
                if self.frozen.is_none_or(|frozen| frozen.moved_pu <= still.moved_pu) {
                    self.frozen = Some(*still);
                }
            }
            still => {
                *still = normal.then_some(Still {
                    value,
                    from_ns: frame.time_ns,
                    to_ns: frame.time_ns,
                    samples: 1,
                    moved_pu: 0.0,
                    least: movers,
                    most: movers,
                });
            }
        }
    }
}

/// What the measured signals show, row by row.
#[derive(Clone, Debug)]
pub(super) struct RowEvidence {
    pub(super) signals: [MeasuredEvidence; Signal::ALL.len()],
    /// How the signals hang together; none where positions are in a unit that nobody knows.
    pub(super) chain: Option<ChainEvidence>,
}

impl RowEvidence {
    pub(super) fn new(positions: Positions) -> Self {
        let behaviour = |signal: Signal| -> Behaviour { MEASURED[signal as usize] };
        Self {
            signals: Signal::ALL.map(|signal| MeasuredEvidence {
                signal,
                channel: Channel::new(behaviour(signal)),
                still: None,
                frozen: None,
            }),
            chain: (positions != Positions::AnyUnit).then(ChainEvidence::default),
        }
    }

    /// Whether positions and commands are in pu, and not in a unit that nobody states.
    pub(super) fn is_in_pu(&self) -> bool {
        self.chain.is_some()
    }

    /// Takes a row.
    pub(super) fn row(&mut self, frame: &Frame) {
        for signal in &mut self.signals {
            signal.row(frame);
        }
        if let Some(chain) = &mut self.chain {
            chain.row(frame);
        }
    }
}
