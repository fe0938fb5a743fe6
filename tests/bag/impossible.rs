//! Recordings that cannot be of one machine and its time are named, and sound ones are not: made from shipped recordings.

use std::path::PathBuf;

use govtwin_bag::msg;
use govtwin_bag::{self as bag, Finding, Kind, ReadOptions, Severity, Warning};
use govtwin_model::frame::{EsvState, Frame};
use govtwin_model::signal::Signal;
use mcap::WriteOptions;

use super::make::{Bag, MS, read_both_ways, shipped};

fn frames(name: &str) -> Vec<Frame> {
    let loaded = bag::read(&shipped(name), &ReadOptions::default()).unwrap();
    let measured = |frame: &Frame| frame.measured.servomotor_position_pu.is_finite();
    loaded.recording.frames.into_iter().filter(measured).collect()
}

/// A bag of rows, with all four streams at each.
fn write(rows: &[Frame]) -> (tempfile::TempDir, PathBuf) {
    let mut bag = Bag::default();
    for row in rows {
        let state = if row.inputs.esv == EsvState::Normal { msg::EsvState::NORMAL } else { msg::EsvState::SHUTDOWN };
        bag.esv(row.time_ns, state);
        bag.command(row.time_ns, row.inputs.opening_command_pu);
        bag.pressure(row.time_ns, row.inputs.tank_pressure_pa);
        let [servomotor, spool] = Signal::POSITIONS.map(|signal| signal.of(&row.measured));
        bag.servo(row.time_ns, spool, servomotor);
    }
    bag.file(WriteOptions::new())
}

fn found(rows: &[Frame]) -> Vec<Finding> {
    let (_folder, path) = write(rows);
    let health = bag::read(&path, &ReadOptions::default()).unwrap().health;
    let of = |warning: &Warning| match warning {
        Warning::Doubtful(finding) if finding.what == Kind::Impossible => Some(finding.clone()),
        _ => None,
    };
    health.warnings.iter().filter_map(of).collect()
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

type Change = fn(&mut Vec<Frame>);

fn map(rows: &mut [Frame], change: impl Fn(usize, &mut Frame)) {
    rows.iter_mut().enumerate().for_each(|(k, row)| change(k, row));
}

#[test]
fn recordings_that_cannot_be_are_named() {
    let changes: [(&str, Change); 14] = [
        ("the position is the command", |rows| {
            map(rows, |_, row| row.measured.servomotor_position_pu = row.inputs.opening_command_pu)
        }),
        ("the command is the position", |rows| {
            map(rows, |_, row| row.inputs.opening_command_pu = row.measured.servomotor_position_pu)
        }),
        ("the position is the command with noise", |rows| {
            map(rows, |k, row| row.measured.servomotor_position_pu = row.inputs.opening_command_pu + noise(k, 1e-4));
        }),
        ("time runs backwards", |rows| {
            let times: Vec<i64> = rows.iter().map(|row| row.time_ns).collect();
            rows.reverse();
            rows.iter_mut().zip(times).for_each(|(row, time_ns)| row.time_ns = time_ns);
        }),
        ("the response comes a second before the command", |rows| {
            let later: Vec<f64> = rows.iter().map(|row| row.inputs.opening_command_pu).collect();
            map(rows, |k, row| row.inputs.opening_command_pu = later[k.saturating_sub(100)]);
        }),
        ("the position is turned", |rows| {
            map(rows, |_, row| row.measured.servomotor_position_pu = 1.0 - row.measured.servomotor_position_pu);
        }),
        ("the position is doubled", |rows| map(rows, |_, row| row.measured.servomotor_position_pu *= 2.0)),
        ("the position is halved", |rows| map(rows, |_, row| row.measured.servomotor_position_pu *= 0.5)),
        ("the spool is turned", |rows| map(rows, |_, row| row.measured.spool_position_pu *= -1.0)),
        ("the position is stuck, with noise", |rows| {
            let first = rows[0].measured.servomotor_position_pu;
            map(rows, |k, row| row.measured.servomotor_position_pu = first + noise(k, 3e-4));
        }),
        ("the position sticks half way", |rows| {
            let half = rows.len() / 10;
            let at = rows[half].measured.servomotor_position_pu;
            map(rows, |k, row| {
                if k > half {
                    row.measured.servomotor_position_pu = at + noise(k, 3e-4)
                }
            });
        }),
        ("the spool is noise", |rows| map(rows, |k, row| row.measured.spool_position_pu = noise(k, 0.2))),
        ("spool and servomotor are of another time", |rows| {
            let len = rows.len();
            let measured: Vec<_> = rows.iter().map(|row| row.measured).collect();
            map(rows, |k, row| row.measured = measured[(k + len / 3) % len]);
        }),
        ("time is too fast by a hundred", |rows| {
            let first_ns = rows[0].time_ns;
            map(rows, |_, row| row.time_ns = first_ns + (row.time_ns - first_ns) / 100);
        }),
    ];
    for name in [
        "practice/case_01/load_rejection.mcap",
        "practice/case_03/load_rejection.mcap",
        "practice/case_05/startup.mcap",
    ] {
        let rows = frames(name);
        assert!(found(&rows).is_empty(), "{name}: {:?}", found(&rows));
        for (what, change) in &changes {
            let mut changed = rows.clone();
            change(&mut changed);
            let named = found(&changed);
            assert!(!named.is_empty(), "{name}: {what}");
            // A lead of the response is what a diagnosis calls the offset of two clocks; nothing else can be concluded from.
            // Too little of a slow process is left of a recording that runs a hundred times too fast to refuse it.
            let leads = what.contains("before the command") || what.contains("too fast");
            let refused = named.iter().any(|finding| finding.severity == Severity::Disqualified);
            assert!(refused || leads, "{name}: {what}: {named:?}");
        }
    }
}

#[test]
fn held_values_are_named() {
    for (signal, every) in
        [(Signal::ServomotorPosition, 50), (Signal::SpoolPosition, 40), (Signal::ServomotorPosition, 100)]
    {
        let mut rows = frames("practice/case_03/startup.mcap");
        let held: Vec<f64> = (0..rows.len()).map(|k| signal.of(&rows[k - k % every].measured)).collect();
        for (row, held) in rows.iter_mut().zip(held) {
            row.measured = signal.with(row.measured, held);
        }
        assert!(found(&rows).iter().any(|finding| finding.words.contains("held")), "{signal:?}");
    }
}

#[test]
fn an_esv_the_wrong_way_round_is_named() {
    for name in
        ["practice/case_03/load_rejection.mcap", "practice/case_01/load_increase.mcap", "practice/case_05/startup.mcap"]
    {
        let mut rows = frames(name);
        map(&mut rows, |_, row| {
            row.inputs.esv = if row.inputs.esv == EsvState::Normal { EsvState::Shutdown } else { EsvState::Normal };
        });
        let named = found(&rows);
        assert!(named.iter().any(|finding| finding.words.contains("wrong way round")), "{name}: {named:?}");
    }
}

#[test]
fn nothing_shipped_is_impossible() {
    for case in 1..=8 {
        for process in ["startup", "load_increase", "load_rejection", "shutdown"] {
            let path = shipped(&format!("practice/case_{case:02}/{process}.mcap"));
            let health = bag::read(&path, &ReadOptions::default()).unwrap().health;
            assert_eq!(health.disqualified(), None, "{}", path.display());
        }
    }
}

#[test]
fn streams_of_two_clocks_are_refused_and_aligned_if_asked() {
    let rows = frames("practice/case_03/load_rejection.mcap");
    for (shift_s, refused) in [(-7200, true), (37, true), (5, true), (-2, true), (0, false)] {
        let mut bag = Bag::default();
        for (k, row) in rows.iter().enumerate() {
            if k % 100 == 0 {
                bag.esv(row.time_ns, msg::EsvState::NORMAL);
            }
            bag.command(row.time_ns, row.inputs.opening_command_pu);
            bag.pressure(row.time_ns, row.inputs.tank_pressure_pa);
            let [servomotor, spool] = Signal::POSITIONS.map(|signal| signal.of(&row.measured));
            bag.servo(row.time_ns + shift_s * 1000 * MS, spool, servomotor);
            bag.entries.last_mut().unwrap().log_ns = row.time_ns + MS;
        }
        let (_folder, path) = bag.file(WriteOptions::new());
        let read = read_both_ways(&path, &ReadOptions::default());
        assert_eq!(read.is_err(), refused, "{shift_s}");
        if let Err(error) = read {
            assert!(error.to_string().contains("--stamp log"), "{error}");
        }
        let mut options = ReadOptions::default();
        options.topics.by_log = true;
        let aligned = read_both_ways(&path, &options).unwrap().recording.frames;
        let measured: Vec<&Frame> =
            aligned.iter().filter(|row| row.measured.servomotor_position_pu.is_finite()).collect();
        assert_eq!(measured.len(), rows.len(), "{shift_s}");
        for (found, row) in measured.iter().zip(&rows) {
            assert_eq!(found.measured.servomotor_position_pu, row.measured.servomotor_position_pu);
            assert_eq!(found.inputs.opening_command_pu, row.inputs.opening_command_pu);
        }
    }
}
