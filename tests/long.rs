//! Long recordings: memory does not grow with their length, and results are those of reading them whole.
#![cfg(feature = "cli")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use govtwin::bag::{self, Qos, ReadOptions, Writer, WriterOptions};
use govtwin::msg::{EsvState, FluidPressure, GovernorCommand, Header, ServoState};
use govtwin::params;
use govtwin::replay::Replayed;
use govtwin::replay::rows::{MOST_KEPT, Replaying};
use govtwin::twin::Twin;

const BEGIN_NS: i64 = 1_700_000_000_000_000_000;

/// A bench that runs for so long at 100 Hz: command and servo state in every step, pressure in every fifth, ESV once a second.
fn write(folder: &Path, seconds: i64) -> PathBuf {
    let mut writer = Writer::create(folder, WriterOptions::default()).unwrap();
    let command = writer.topic::<GovernorCommand>("/governor/command", Qos::SENSOR).unwrap();
    let esv = writer.topic::<EsvState>("/governor/esv", Qos::DEFAULT).unwrap();
    let pressure = writer.topic::<FluidPressure>("/governor/tank_pressure", Qos::SENSOR).unwrap();
    let servo = writer.topic::<ServoState>("/plant/servo_state", Qos::SENSOR).unwrap();
    for step in 0..seconds * 100 {
        let noise = |salt: i64| {
            let mixed = ((step * 31 + salt) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
            (mixed.wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
        };
        let time_ns = BEGIN_NS + step * 10_000_000 + (noise(1) * 2e5) as i64;
        let log_ns = time_ns + 400_000 + (noise(2) * 4e5) as i64;
        let header = Header::at(time_ns);
        let opening = 0.5 + 0.3 * (step as f64 * 5e-4).sin();
        if step % 100 == 0 {
            writer.write(esv, log_ns, &EsvState { header: header.clone(), state: EsvState::NORMAL }).unwrap();
        }
        if step % 5 == 0 {
            let fluid_pressure = 6.3e6 + 2e4 * noise(3);
            let message = FluidPressure { header: header.clone(), fluid_pressure, variance: 0.0 };
            writer.write(pressure, log_ns, &message).unwrap();
        }
        writer.write(command, log_ns, &GovernorCommand { header: header.clone(), opening }).unwrap();
        let state = ServoState {
            header,
            spool_position: 0.01 * (step as f64 * 5e-4).cos() + 0.002 * noise(4),
            servomotor_position: opening + 0.001 * noise(5),
            pilot_valve_position: f64::NAN,
            control_pressure: f64::NAN,
        };
        writer.write(servo, log_ns, &state).unwrap();
    }
    writer.finish().unwrap()
}

/// For `scripts/sizes`: writes `LONG_BAG`, a recording of `LONG_SECONDS`.
#[test]
#[ignore = "writes as much as it is told; scripts/sizes runs it"]
fn writes_a_bag_of_a_size() {
    let (Ok(path), Ok(seconds)) = (std::env::var("LONG_BAG"), std::env::var("LONG_SECONDS")) else { return };
    write(Path::new(&path), seconds.parse().unwrap());
}

/// Runs the program; its output, and the most memory that it held, MB.
#[cfg(target_os = "linux")]
fn run(arguments: &[&str]) -> (String, u64) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_govtwin"))
        .args(arguments)
        .env("RAYON_NUM_THREADS", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let status = PathBuf::from(format!("/proc/{}/status", child.id()));
    let mut peak_kb = 0;
    while child.try_wait().unwrap().is_none() {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let peak = text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
        peak_kb = peak.unwrap_or(0).max(peak_kb);
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    (String::from_utf8_lossy(&output.stdout).into_owned(), peak_kb / 1000)
}

#[cfg(target_os = "linux")]
#[test]
fn memory_does_not_grow_with_length() {
    let dir = tempfile::tempdir().unwrap();
    let peaks = [600, 3600].map(|seconds| {
        let path = write(&dir.path().join(format!("run_{seconds}")), seconds);
        let path = path.to_str().unwrap();
        let out = dir.path().join(format!("out_{seconds}"));
        let (said, info_mb) = run(&["info", path]);
        assert!(said.contains(&format!("{} rows", seconds * 100)), "{said}");
        let (_, replay_mb) = run(&["replay", path, "--out", out.to_str().unwrap()]);
        let simulated = bag::survey(&out.join(format!("run_{seconds}"))).unwrap();
        let topic = simulated.topics.iter().find(|topic| topic.name == "/sim/servo_state").unwrap();
        assert_eq!((topic.messages as i64, topic.log.backwards, simulated.warnings.len()), (seconds * 100, 0, 0));
        [info_mb, replay_mb]
    });
    for (what, [short, long]) in ["info", "replay"].into_iter().zip([0, 1].map(|k| peaks.map(|peak| peak[k]))) {
        assert!(long < 80 && long < short + 16, "{what}: {short} MB for ten minutes, {long} MB for an hour");
    }
}

#[test]
fn figures_count_all_rows_and_pictures_get_enough() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(&dir.path().join("run"), 1000);
    let recording = bag::read(&path, &ReadOptions::default()).unwrap().recording;
    assert!(recording.frames.len() > MOST_KEPT);
    let unit = params::reference();
    let mut twin = Twin::new(&unit);
    let mut replaying = Replaying::new(&mut twin);
    recording.frames.iter().for_each(|frame| replaying.row(frame));
    let thinned = replaying.finish("run");
    let whole = Replayed::new(&mut Twin::new(&unit), recording);
    assert_eq!((thinned.scores, thinned.rows, thinned.every), (whole.scores, 100_000, 2));
    assert_eq!(thinned.recording.process, whole.recording.process);
    assert!(thinned.recording.frames.len() > MOST_KEPT / 2 && thinned.recording.frames.len() <= MOST_KEPT + 1);
    assert_eq!(thinned.recording.duration_s(), whole.recording.duration_s());
}

/// For measurements: `LONG_BAG=DIR LONG_S=28800 cargo test --test long -- --ignored`.
#[test]
#[ignore = "writes a bag of any length for measurements"]
fn write_a_bag_to_measure() {
    let seconds = std::env::var("LONG_S").unwrap().parse().unwrap();
    write(Path::new(&std::env::var("LONG_BAG").unwrap()), seconds);
}
