//! The inputs that every contender sees: rows every 10 ms, and the state at which each process starts.

use std::path::{Path, PathBuf};

use govtwin_bag::ReadOptions;
use govtwin_model::frame::{EsvState, Frame, Signals};
use govtwin_model::recording::{Process, Recording};
use govtwin_model::twin::Twin;

/// Time from row to row, ns: the large loop's period.
const ROW_NS: i64 = 10_000_000;

/// One process.
pub struct Part {
    /// Rows every 10 ms.
    pub frames: Vec<Frame>,
}

/// All processes, and the file that holds them for other programs.
pub struct Tape {
    /// In the order of [`Process::ALL`].
    pub parts: Vec<Part>,
    /// See `benches/sundials/chain.c` for what is in it.
    pub path: PathBuf,
}

impl Tape {
    /// Reads practice unit 1 and writes the tape.
    pub fn read(folder: &Path) -> Self {
        let bags = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/practice/case_01");
        let part = |process: Process| {
            let path = bags.join(process.id()).with_extension("mcap");
            let loaded = govtwin_bag::read(&path, &ReadOptions::default()).expect("a shipped recording");
            Part { frames: regular(&loaded.recording) }
        };
        let parts: Vec<Part> = Process::ALL.into_iter().map(part).collect();
        let path = folder.join("tape.f64");
        let mut numbers = Vec::new();
        for part in &parts {
            let mut twin = Twin::new(&govtwin_model::params::reference());
            twin.advance(&part.frames[0]);
            numbers.push(part.frames.len() as f64);
            numbers.extend(twin.state().to_vector().iter());
            for frame in &part.frames {
                let open = f64::from(u8::from(frame.inputs.esv == EsvState::Normal));
                let measured_pu = frame.measured.servomotor_position_pu;
                numbers.extend([frame.inputs.opening_command_pu, open, frame.inputs.tank_pressure_pa, measured_pu]);
            }
        }
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        std::fs::write(&path, bytes).expect("room for the tape");
        Self { parts, path }
    }

    /// Simulated time, s.
    pub fn duration_s(&self) -> f64 {
        self.parts.iter().map(|part| (part.frames.len() - 1) as f64 * ROW_NS as f64 * 1e-9).sum()
    }

    /// Root mean square of the difference of two runs: the largest of spool and servomotor in any process, pu.
    pub fn apart_pu(&self, one: &[[f64; 2]], other: &[[f64; 2]]) -> f64 {
        let mut largest_pu = 0.0_f64;
        let (mut one, mut other) = (one, other);
        for part in &self.parts {
            let count = part.frames.len();
            for signal in 0..2 {
                let square = |(a, b): (&[f64; 2], &[f64; 2])| (a[signal] - b[signal]).powi(2);
                let sum: f64 = one[..count].iter().zip(&other[..count]).map(square).sum();
                // Not `max`, which passes over NaN.
                let rms_pu = (sum / count as f64).sqrt();
                largest_pu = if rms_pu > largest_pu || rms_pu.is_nan() { rms_pu } else { largest_pu };
            }
            (one, other) = (&one[count..], &other[count..]);
        }
        largest_pu
    }
}

/// The newest values at or before each point of a grid from the first row on.
fn regular(recording: &Recording) -> Vec<Frame> {
    let frames = &recording.frames;
    let (first_ns, last_ns) = (frames[0].time_ns, frames[frames.len() - 1].time_ns);
    let mut newest = frames[0];
    let mut next = 0;
    let mut regular = Vec::new();
    for k in 0..=(last_ns - first_ns) / ROW_NS {
        let time_ns = first_ns + k * ROW_NS;
        while next < frames.len() && frames[next].time_ns <= time_ns {
            newest.inputs = frames[next].inputs;
            let measured = &frames[next].measured;
            if measured.servomotor_position_pu.is_finite() {
                newest.measured = *measured;
            }
            next += 1;
        }
        // A start off rest needs the measured spool; later rows do not.
        let measured = if k == 0 {
            newest.measured
        } else {
            Signals { servomotor_position_pu: newest.measured.servomotor_position_pu, ..Signals::NONE }
        };
        regular.push(Frame { time_ns, measured, ..newest });
    }
    regular
}
