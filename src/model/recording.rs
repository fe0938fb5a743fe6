//! A recording: frames in time order, with a name and the dynamic process that they show.

use std::collections::VecDeque;

use crate::frame::{EsvState, Frame};
use crate::stored::{held_by_id, with_words};
use crate::units::seconds_from_nanos;

/// Samples farther apart than this leave open what inputs do between them, ns: the spool, which settles within it, shows none of it.
pub const SLOW_NS: i64 = 30_000_000;

/// The usual time between two rows, ns: the median; 0 where there are fewer than two.
pub fn median_spacing_ns(times_ns: impl Iterator<Item = i64>) -> i64 {
    let mut last_ns = None;
    let mut spacings_ns: Vec<i64> = times_ns.filter_map(|time_ns| Some(time_ns - last_ns.replace(time_ns)?)).collect();
    spacings_ns.sort_unstable();
    spacings_ns.get(spacings_ns.len() / 2).copied().unwrap_or(0)
}

with_words! {
    /// The four dynamic processes of a governor (Liu et al. 2025, section 4.2); there are no others.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub enum Process: id {
        /// From closed to speed-no-load.
        Startup = "startup",
        /// On load, towards a larger opening.
        LoadIncrease = "load_increase",
        /// Down to closed, with the emergency shutdown valve.
        Shutdown = "shutdown",
        /// A sudden closure from load, by command.
        LoadRejection = "load_rejection",
    }
}

impl Process {
    /// The name in words.
    pub fn title(self) -> &'static str {
        match self {
            Self::Startup => "start-up",
            Self::LoadIncrease => "load increase",
            Self::Shutdown => "shutdown",
            Self::LoadRejection => "load rejection",
        }
    }

    /// Recognises the process from the inputs alone; a file's name plays no part.
    ///
    /// An ESV trip is a shutdown; a command that starts below 2 % and rises above 5 % is a start-up;
    /// a command that falls by more than 20 % of the stroke within two seconds is a load rejection;
    /// everything else is a change of load.
    pub fn of(frames: &[Frame]) -> Self {
        let mut watch = ProcessWatch::default();
        for frame in frames {
            watch.row(frame);
        }
        watch.process()
    }
}

held_by_id!(Process, "a process");

/// Recognises a process row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProcessWatch {
    /// Whether the command starts closed, once there is one.
    starts_closed: Option<bool>,
    opens: bool,
    trips: bool,
    falls: bool,
    /// Commands of the last two seconds.
    recent: VecDeque<(i64, f64)>,
}

impl ProcessWatch {
    /// Takes a row.
    pub fn row(&mut self, frame: &Frame) {
        let command_pu = frame.inputs.opening_command_pu;
        self.trips |= frame.inputs.esv == EsvState::Shutdown;
        self.starts_closed.get_or_insert(command_pu < 0.02);
        self.opens |= command_pu > 0.05;
        while self.recent.front().is_some_and(|(time_ns, _)| seconds_from_nanos(frame.time_ns - time_ns) > 2.0) {
            self.recent.pop_front();
        }
        self.recent.push_back((frame.time_ns, command_pu));
        self.falls |= self.recent.front().is_some_and(|(_, oldest_pu)| oldest_pu - command_pu > 0.20);
    }

    /// The process that the rows so far show.
    pub fn process(&self) -> Process {
        if self.trips {
            Process::Shutdown
        } else if self.starts_closed == Some(true) && self.opens {
            Process::Startup
        } else if self.falls {
            Process::LoadRejection
        } else {
            Process::LoadIncrease
        }
    }
}

/// Frames in strictly rising time order, with a name for people.
///
/// ```
/// use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
/// use govtwin_model::recording::{Process, Recording};
///
/// let row = |time_ns, esv| Frame {
///     time_ns,
///     inputs: Inputs { opening_command_pu: 0.5, esv, tank_pressure_pa: 6.0e6, piston_force_n: 0.0 },
///     measured: Signals { servomotor_position_pu: 0.5, ..Signals::NONE },
/// };
/// let recording = Recording::new("trip", vec![row(0, EsvState::Normal), row(100_000_000, EsvState::Shutdown)]);
/// assert_eq!((recording.process, recording.duration_s()), (Process::Shutdown, 0.1));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// What people call it: the file or folder name.
    pub name: String,
    /// The process that the inputs show.
    pub process: Process,
    /// The rows.
    pub frames: Vec<Frame>,
    /// How far the command may have been from that of the rows, pu: of a historian that keeps few points; else 0.
    pub command_deviation_pu: f64,
}

impl Recording {
    /// Names the frames and recognises their process.
    pub fn new(name: impl Into<String>, frames: Vec<Frame>) -> Self {
        Self { name: name.into(), process: Process::of(&frames), frames, command_deviation_pu: 0.0 }
    }

    /// Whether an opening command was recorded; without one only the servomotor stage can be driven, by the spool.
    pub fn has_command(&self) -> bool {
        self.frames.iter().any(|frame| frame.inputs.opening_command_pu.is_finite())
    }

    /// Time from the first to the last frame, s.
    pub fn duration_s(&self) -> f64 {
        match (self.frames.first(), self.frames.last()) {
            (Some(first), Some(last)) => seconds_from_nanos(last.time_ns - first.time_ns),
            _ => 0.0,
        }
    }
}
