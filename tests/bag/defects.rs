//! Recordings that cannot be true, made from shipped ones: each is one change of sound rows.

use govtwin_bag::{self as bag, ReadOptions, msg};
use govtwin_model::frame::{EsvState, Frame};
use govtwin_model::signal::Signal;

use super::make::{Bag, shipped};

/// What may become of a recording that is not true.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// Its rows cannot be of one machine: nothing is concluded from it.
    Impossible,
    /// It is not of the unit of the sheet: nothing is concluded from it.
    OfAnother,
    /// It is warned of, and nothing is measured on it: it may be all that there is.
    Doubtful,
}

/// A change that makes a recording untrue.
pub struct Defect {
    pub kind: &'static str,
    pub what: &'static str,
    pub fate: Fate,
    pub change: fn(&mut Vec<Frame>),
}

const fn impossible(kind: &'static str, what: &'static str, change: fn(&mut Vec<Frame>)) -> Defect {
    Defect { kind, what, fate: Fate::Impossible, change }
}

const fn of_another(kind: &'static str, what: &'static str, change: fn(&mut Vec<Frame>)) -> Defect {
    Defect { kind, what, fate: Fate::OfAnother, change }
}

const fn doubtful(kind: &'static str, what: &'static str, change: fn(&mut Vec<Frame>)) -> Defect {
    Defect { kind, what, fate: Fate::Doubtful, change }
}

/// Those of wiring, channels, clocks and machines.
pub const DEFECTS: [Defect; 48] = [
    impossible("copy", "the position is the command", |rows| {
        map(rows, |_, row| row.measured.servomotor_position_pu = row.inputs.opening_command_pu);
    }),
    impossible("copy", "the command is the position", |rows| {
        map(rows, |_, row| row.inputs.opening_command_pu = row.measured.servomotor_position_pu);
    }),
    impossible("copy", "the position is the command with some noise", |rows| copy(rows, 1e-4)),
    impossible("copy", "the position is the command with much noise", |rows| copy(rows, 1e-3)),
    impossible("copy", "the position is the command of 60 ms before with some noise", |rows| {
        let commands: Vec<f64> = rows.iter().map(|row| row.inputs.opening_command_pu).collect();
        servomotor(rows, |k, _| commands[k.saturating_sub(6)] + noise(k, 1e-4));
    }),
    impossible("copy", "the position is the mean of the command over half a second", |rows| averaged(rows, 0.0)),
    impossible("copy", "the position is the mean of the command with some noise", |rows| averaged(rows, 1e-4)),
    impossible("drawn", "a historian's lines of all that is measured", |rows| {
        Signal::POSITIONS.into_iter().for_each(|signal| draw(rows, signal, 2e-3));
    }),
    impossible("drawn", "a historian's lines of the position", |rows| draw(rows, Signal::ServomotorPosition, 3e-3)),
    impossible("copy", "the position is the command in coarse steps", |rows| {
        copy(rows, 0.0);
        servomotor(rows, |_, position| (position * 4096.0).round() / 4096.0);
    }),
    impossible("time", "time runs backwards", |rows| {
        let times: Vec<i64> = rows.iter().map(|row| row.time_ns).collect();
        rows.reverse();
        rows.iter_mut().zip(times).for_each(|(row, time_ns)| row.time_ns = time_ns);
    }),
    impossible("sign", "the position is turned", |rows| servomotor(rows, |_, position| 1.0 - position)),
    of_another("scale", "the position is doubled", |rows| servomotor(rows, |_, position| 2.0 * position)),
    of_another("scale", "the position is halved", |rows| servomotor(rows, |_, position| 0.5 * position)),
    of_another("scale", "the position is four fifths", |rows| servomotor(rows, |_, position| 0.8 * position)),
    of_another("scale", "the position is a quarter more", |rows| servomotor(rows, |_, position| 1.25 * position)),
    impossible("scale", "the position is off by a tenth", |rows| servomotor(rows, |_, position| position + 0.1)),
    doubtful("scale", "the command is halved", |rows| command(rows, |opening| 0.5 * opening)),
    impossible("sign", "the command is turned", |rows| command(rows, |opening| 1.0 - opening)),
    impossible("sign", "the spool is turned", |rows| spool(rows, |_, position| -position)),
    impossible("stuck or held", "the position is stuck", |rows| {
        let first = rows[0].measured.servomotor_position_pu;
        servomotor(rows, |_, _| first);
    }),
    impossible("stuck or held", "the position is stuck, with noise", |rows| {
        let first = rows[0].measured.servomotor_position_pu;
        servomotor(rows, |k, _| first + noise(k, 3e-4));
    }),
    impossible("stuck or held", "the position sticks half way, with noise", |rows| {
        let half = rows.len() / 10;
        let at = rows[half].measured.servomotor_position_pu;
        servomotor(rows, |k, position| if k > half { at + noise(k, 3e-4) } else { position });
    }),
    impossible("stuck or held", "the spool is stuck, with noise", |rows| spool(rows, |k, _| 0.01 + noise(k, 1e-3))),
    impossible("stuck or held", "the spool is noise", |rows| spool(rows, |k, _| noise(k, 0.2))),
    impossible("machines", "spool and servomotor are of another time", |rows| {
        let measured: Vec<_> = rows.iter().map(|row| row.measured).collect();
        map(rows, |k, row| row.measured = measured[(k + measured.len() / 3) % measured.len()]);
    }),
    impossible("machines", "the measured state is of another machine", |rows| {
        let other = frames(OTHER_MACHINE);
        map(rows, |k, row| row.measured = other[k % other.len()].measured);
    }),
    impossible("machines", "the spool is of another machine", |rows| {
        let other = frames(OTHER_MACHINE);
        spool(rows, |k, _| other[k % other.len()].measured.spool_position_pu);
    }),
    impossible("ESV", "the ESV is inverted", |rows| {
        map(rows, |_, row| {
            let is_normal = row.inputs.esv == EsvState::Normal;
            row.inputs.esv = if is_normal { EsvState::Shutdown } else { EsvState::Normal };
        });
    }),
    impossible("ESV", "the ESV has tripped all along", |rows| map(rows, |_, row| row.inputs.esv = EsvState::Shutdown)),
    of_another("pressure", "the pressure is ten times as high", |rows| pressure(rows, 10.0)),
    of_another("pressure", "the pressure is twice as high", |rows| pressure(rows, 2.0)),
    of_another("pressure", "the pressure is half", |rows| pressure(rows, 0.5)),
    of_another("pressure", "the pressure is in bar", |rows| pressure(rows, 1e-5)),
    of_another("scale", "the spool is doubled", |rows| spool(rows, |_, position| 2.0 * position)),
    of_another("scale", "the spool is a tenth", |rows| spool(rows, |_, position| 0.1 * position)),
    of_another("time", "time is stretched by 1.3", |rows| time(rows, 1.3)),
    of_another("time", "time is four fifths", |rows| time(rows, 0.8)),
    of_another("time", "time is stretched by a half", |rows| time(rows, 1.5)),
    of_another("time", "time is stretched ten times", |rows| time(rows, 10.0)),
    of_another("time", "time is half", |rows| time(rows, 0.5)),
    doubtful("time", "the response comes before the command", |rows| {
        let commands: Vec<f64> = rows.iter().map(|row| row.inputs.opening_command_pu).collect();
        map(rows, |k, row| row.inputs.opening_command_pu = commands[k.saturating_sub(100)]);
    }),
    doubtful("time", "the position comes before the spool", |rows| {
        let spools: Vec<f64> = rows.iter().map(|row| row.measured.spool_position_pu).collect();
        spool(rows, |k, _| spools[k.saturating_sub(12)]);
    }),
    doubtful("time", "the position comes half a second after everything else", |rows| {
        let positions: Vec<f64> = rows.iter().map(|row| row.measured.servomotor_position_pu).collect();
        servomotor(rows, |k, _| positions[k.saturating_sub(50)]);
    }),
    doubtful("stuck or held", "the position is held for half a second", |rows| {
        hold(rows, Signal::ServomotorPosition, 50)
    }),
    doubtful("stuck or held", "the position is held for a second", |rows| hold(rows, Signal::ServomotorPosition, 100)),
    doubtful("stuck or held", "the spool is held for half a second", |rows| hold(rows, Signal::SpoolPosition, 50)),
    doubtful("machines", "two senders take turns", |rows| {
        servomotor(rows, |k, position| if k % 2 == 0 { position } else { 0.9 * position + 0.07 });
    }),
];

/// A recording of a unit that the others are not of.
const OTHER_MACHINE: &str = "practice/case_05/shutdown.mcap";

fn copy(rows: &mut [Frame], size: f64) {
    map(rows, |k, row| row.measured.servomotor_position_pu = row.inputs.opening_command_pu + noise(k, size));
}

fn averaged(rows: &mut [Frame], size: f64) {
    let commands: Vec<f64> = rows.iter().map(|row| row.inputs.opening_command_pu).collect();
    let mean = |k: usize| (0..50).map(|back| commands[k.saturating_sub(back)]).sum::<f64>() / 50.0;
    servomotor(rows, |k, _| mean(k) + noise(k, size));
}

/// Keeps the points of a swinging door of half a width, and draws lines between them.
fn draw(rows: &mut [Frame], signal: Signal, half_width: f64) {
    let values: Vec<f64> = rows.iter().map(|row| signal.of(&row.measured)).collect();
    let mut from = 0;
    while from + 1 < values.len() {
        let is_near = |to: &usize| {
            let line = |k: usize| values[from] + (k - from) as f64 / (to - from) as f64 * (values[*to] - values[from]);
            (from..*to).all(|k| (values[k] - line(k)).abs() < half_width)
        };
        let to = (from + 1..values.len()).take_while(is_near).last().unwrap_or(from + 1);
        for (k, row) in rows[from..to].iter_mut().enumerate() {
            let value = values[from] + k as f64 / (to - from) as f64 * (values[to] - values[from]);
            row.measured = signal.with(row.measured, value);
        }
        from = to;
    }
}

fn command(rows: &mut [Frame], change: impl Fn(f64) -> f64) {
    map(rows, |_, row| row.inputs.opening_command_pu = change(row.inputs.opening_command_pu));
}

fn pressure(rows: &mut [Frame], times: f64) {
    map(rows, |_, row| row.inputs.tank_pressure_pa *= times);
}

pub fn time(rows: &mut [Frame], times: f64) {
    let begin_ns = rows[0].time_ns;
    map(rows, |_, row| row.time_ns = begin_ns + ((row.time_ns - begin_ns) as f64 * times) as i64);
}

fn spool(rows: &mut [Frame], change: impl Fn(usize, f64) -> f64) {
    map(rows, |k, row| row.measured.spool_position_pu = change(k, row.measured.spool_position_pu));
}

fn servomotor(rows: &mut [Frame], change: impl Fn(usize, f64) -> f64) {
    map(rows, |k, row| row.measured.servomotor_position_pu = change(k, row.measured.servomotor_position_pu));
}

fn hold(rows: &mut [Frame], signal: Signal, samples: usize) {
    let held: Vec<f64> = (0..rows.len()).map(|k| signal.of(&rows[k - k % samples].measured)).collect();
    rows.iter_mut().zip(held).for_each(|(row, held)| row.measured = signal.with(row.measured, held));
}

fn map(rows: &mut [Frame], change: impl Fn(usize, &mut Frame)) {
    rows.iter_mut().enumerate().for_each(|(k, row)| change(k, row));
}

/// Noise of a transducer, the same each time.
fn noise(k: usize, size: f64) -> f64 {
    let mut state = (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(0x1234_5678);
    let mut sum = 0.0;
    for _ in 0..4 {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        sum += (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
    }
    sum * size
}

/// The rows of a shipped recording in which the servomotor is measured.
pub fn frames(name: &str) -> Vec<Frame> {
    let loaded = bag::read(&shipped(name), &ReadOptions::default()).unwrap();
    let measured = |frame: &Frame| frame.measured.servomotor_position_pu.is_finite();
    loaded.recording.frames.into_iter().filter(measured).collect()
}

/// A bag of rows, with all four streams at each.
pub fn bag_of(rows: &[Frame]) -> Bag {
    let mut bag = Bag::default();
    for row in rows {
        let state = if row.inputs.esv == EsvState::Normal { msg::EsvState::NORMAL } else { msg::EsvState::SHUTDOWN };
        bag.esv(row.time_ns, state);
        bag.command(row.time_ns, row.inputs.opening_command_pu);
        bag.pressure(row.time_ns, row.inputs.tank_pressure_pa);
        let [servomotor, spool] = Signal::POSITIONS.map(|signal| signal.of(&row.measured));
        bag.servo(row.time_ns, spool, servomotor);
    }
    bag
}
