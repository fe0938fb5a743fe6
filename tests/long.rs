//! Long recordings: memory does not grow with their length, and results are those of reading them whole.
#![cfg(feature = "cli")]

use std::fs;
#[cfg(target_os = "linux")]
use std::io::{Read as _, Seek as _};
use std::path::{Path, PathBuf};
#[cfg(target_os = "linux")]
use std::process::Command;

use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, ServoState};
use govtwin_bag::{Qos, ReadOptions, Writer, WriterOptions};
use govtwin_diagnosis::generate::streams::GeneratedStreams;
use govtwin_diagnosis::generate::{self, Scenario};
use govtwin_model::frame;
use govtwin_model::parameters::EffectSetting;
use govtwin_model::params;
use govtwin_model::recording::Process;
use govtwin_model::replay::Replayed;
use govtwin_model::replay::rows::{MOST_KEPT, Replaying};
use govtwin_model::twin::Twin;

#[path = "support/tight_sheet.rs"]
mod tight_sheet;

const BEGIN_NS: i64 = 1_700_000_000_000_000_000;

/// A bench that runs for so long at 100 Hz: command and servo state in every step, pressure in every fifth, ESV once a second.
fn write(folder: &Path, seconds: i64) -> PathBuf {
    let mut writer = Writer::create(folder, WriterOptions::default()).unwrap();
    let command = writer.topic::<GovernorCommand>("/governor/command", Qos::SENSOR).unwrap();
    let esv = writer.topic::<EsvState>("/governor/esv", Qos::DEFAULT).unwrap();
    let pressure = writer.topic::<FluidPressure>("/governor/tank_pressure", Qos::SENSOR).unwrap();
    let servo = writer.topic::<ServoState>("/plant/servo_state", Qos::SENSOR).unwrap();
    for step in 0..seconds * 100 {
        let noise = |salt: i64| noise(step, salt);
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
            spool_position: 0.08 * (step as f64 * 5e-4).cos() + 0.002 * noise(4),
            servomotor_position: opening + 0.001 * noise(5),
            pilot_valve_position: f64::NAN,
            control_pressure: f64::NAN,
        };
        writer.write(servo, log_ns, &state).unwrap();
    }
    writer.finish().unwrap()
}

/// A number from -0.5 to 0.5 that looks drawn.
fn noise(step: i64, salt: i64) -> f64 {
    let mixed = ((step * 31 + salt) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    (mixed.wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
}

/// Writes streams as a bag, each message at the time of its stamp.
fn write_streams(folder: &Path, streams: &GeneratedStreams) -> PathBuf {
    let mut writer = Writer::create(folder, WriterOptions::default()).unwrap();
    let command = writer.topic::<GovernorCommand>("/governor/command", Qos::SENSOR).unwrap();
    let esv = writer.topic::<EsvState>("/governor/esv", Qos::DEFAULT).unwrap();
    let pressure = writer.topic::<FluidPressure>("/governor/tank_pressure", Qos::SENSOR).unwrap();
    let servo = writer.topic::<ServoState>("/plant/servo_state", Qos::SENSOR).unwrap();
    let stamps =
        |stream: usize, of: Vec<i64>| of.into_iter().enumerate().map(move |(k, stamp_ns)| (stamp_ns, stream, k));
    let mut order: Vec<(i64, usize, usize)> = stamps(0, streams.command.iter().map(|one| one.0).collect())
        .chain(stamps(1, streams.esv.iter().map(|one| one.0).collect()))
        .chain(stamps(2, streams.tank_pressure.iter().map(|one| one.0).collect()))
        .chain(stamps(3, streams.servo_state.iter().map(|one| one.0).collect()))
        .collect();
    order.sort_unstable();
    for (stamp_ns, stream, k) in order {
        let header = Header::at(stamp_ns);
        match stream {
            0 => writer.write(command, stamp_ns, &GovernorCommand { header, opening: streams.command[k].1 }).unwrap(),
            1 => {
                let state =
                    if streams.esv[k].1 == frame::EsvState::Normal { EsvState::NORMAL } else { EsvState::SHUTDOWN };
                writer.write(esv, stamp_ns, &EsvState { header, state }).unwrap();
            }
            2 => {
                let message = FluidPressure { header, fluid_pressure: streams.tank_pressure[k].1, variance: 0.0 };
                writer.write(pressure, stamp_ns, &message).unwrap();
            }
            _ => {
                let signals = streams.servo_state[k].1;
                let message = ServoState {
                    header,
                    spool_position: signals.spool_position_pu,
                    servomotor_position: signals.servomotor_position_pu,
                    pilot_valve_position: f64::NAN,
                    control_pressure: f64::NAN,
                };
                writer.write(servo, stamp_ns, &message).unwrap();
            }
        }
    }
    writer.finish().unwrap()
}

/// The four processes of a unit with backlash, the shutdown last.
fn processes(rate_hz: f64) -> [GeneratedStreams; 4] {
    let mut unit = params::reference();
    unit.effects.push(EffectSetting { id: "backlash".to_owned(), values: vec![0.004] });
    [Process::Startup, Process::LoadIncrease, Process::LoadRejection, Process::Shutdown].map(|process| {
        generate::streams(&Scenario { unit: unit.clone(), process, rate_hz, duration_s: 40.0, rich: false, seed: 1 })
    })
}

/// Command, spool and servomotor at one end of a process: means of a second.
fn end_of(streams: &GeneratedStreams, first: bool) -> [f64; 3] {
    let count = streams.servo_state.len().min(5);
    let signals = &streams.servo_state;
    let signals = if first { &signals[..count] } else { &signals[signals.len() - count..] };
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / count as f64;
    let command = if first { streams.command.first() } else { streams.command.last() };
    let spool = mean(signals.iter().map(|one| one.1.spool_position_pu).collect());
    [command.unwrap().1, spool, mean(signals.iter().map(|one| one.1.servomotor_position_pu).collect())]
}

/// Hours of operation: the processes parted evenly, and between them rest, in which the unit goes slowly to where the next one begins.
fn operation(seconds: i64, rate_hz: f64, processes: &[GeneratedStreams]) -> GeneratedStreams {
    let mut all = GeneratedStreams::default();
    let step_ns = (1e9 / rate_hz) as i64;
    let rest = |from_ns: i64, to_ns: i64, from: [f64; 3], to: [f64; 3], all: &mut GeneratedStreams| {
        let still_ns = 60_000_000_000;
        for (k, time_ns) in (from_ns..to_ns).step_by(step_ns as usize).enumerate() {
            let share = (time_ns - from_ns - still_ns) as f64 / (to_ns - from_ns - 2 * still_ns).max(1) as f64;
            let at = |k: usize| from[k] + share.clamp(0.0, 1.0) * (to[k] - from[k]);
            let step = time_ns / step_ns;
            let mut signals = frame::Signals::NONE;
            signals.spool_position_pu = at(1) + 1e-3 * noise(step, 4);
            signals.servomotor_position_pu = at(2) + 1e-3 * noise(step, 5);
            all.command.push((time_ns, at(0)));
            all.servo_state.push((time_ns, signals));
            if k % (rate_hz / 5.0).ceil() as usize == 0 {
                all.tank_pressure.push((time_ns, 6.3e6 + 2e4 * noise(step, 3)));
                all.esv.push((time_ns, frame::EsvState::Normal));
            }
        }
    };
    let gap_ns = seconds * 1_000_000_000 / (processes.len() as i64 + 1);
    let (mut done_ns, mut last) = (BEGIN_NS, processes.first().map_or([0.5, 0.0, 0.5], |first| end_of(first, true)));
    for (number, process) in processes.iter().enumerate() {
        let begin_ns = BEGIN_NS + gap_ns * (number as i64 + 1);
        rest(done_ns, begin_ns, last, end_of(process, true), &mut all);
        let first_ns = process.servo_state[0].0;
        let moved = process.clone().later(begin_ns - first_ns);
        last = end_of(&moved, false);
        done_ns = moved.servo_state.last().unwrap().0.max(moved.command.last().unwrap().0) + step_ns;
        all.command.extend(moved.command);
        all.esv.extend(moved.esv);
        all.tank_pressure.extend(moved.tank_pressure);
        all.servo_state.extend(moved.servo_state);
    }
    // What was shut down stays so.
    let closed = all.esv.last().is_some_and(|one| one.1 == frame::EsvState::Shutdown);
    rest(done_ns, BEGIN_NS + seconds * 1_000_000_000, last, last, &mut all);
    if closed {
        all.esv.retain(|one| one.0 < done_ns);
    }
    all
}

/// For `scripts/sizes`: writes `LONG_BAG`, a recording of `LONG_SECONDS`.
#[test]
#[ignore = "writes as much as it is told; scripts/sizes runs it"]
fn writes_a_bag_of_a_size() {
    let (Ok(path), Ok(seconds)) = (std::env::var("LONG_BAG"), std::env::var("LONG_SECONDS")) else { return };
    write(Path::new(&path), seconds.parse().unwrap());
}

/// For measurements: writes `LONG_BAG`, four processes in `LONG_S` of operation at `LONG_HZ`.
#[test]
#[ignore = "writes a bag of any length for measurements"]
fn write_operation_to_measure() {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse::<f64>().unwrap());
    let (Some(seconds), Some(rate_hz)) = (number("LONG_S"), number("LONG_HZ")) else { return };
    let (seconds, bag) = (seconds as i64, std::env::var("LONG_BAG").unwrap());
    write_streams(Path::new(&bag), &operation(seconds, rate_hz, &processes(rate_hz)));
}

/// Runs the program; its output, and the most memory that it held, MB.
#[cfg(target_os = "linux")]
fn run(arguments: &[&str]) -> (String, u64) {
    let (code, said, errors, peak_mb) = ended(arguments);
    assert_eq!(code, 0, "{arguments:?}: {errors}");
    (said, peak_mb)
}

/// Runs the program: exit code, output, errors, and the most memory that it held, MB.
#[cfg(target_os = "linux")]
fn ended(arguments: &[&str]) -> (i32, String, String, u64) {
    // Into files: a pipe that nobody reads would hold the program up once it is full.
    let files = [tempfile::tempfile().unwrap(), tempfile::tempfile().unwrap()];
    let mut child = Command::new(env!("CARGO_BIN_EXE_govtwin"))
        .args(arguments)
        .env("RAYON_NUM_THREADS", "1")
        .stdout(files[0].try_clone().unwrap())
        .stderr(files[1].try_clone().unwrap())
        .spawn()
        .unwrap();
    let status = PathBuf::from(format!("/proc/{}/status", child.id()));
    let mut peak_kb = 0;
    let ended = loop {
        if let Some(ended) = child.try_wait().unwrap() {
            break ended;
        }
        let text = fs::read_to_string(&status).unwrap_or_default();
        let peak = text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
        peak_kb = peak.unwrap_or(0).max(peak_kb);
        std::thread::sleep(std::time::Duration::from_millis(1));
    };
    let [said, errors] = files.map(|mut file| {
        file.rewind().unwrap();
        let mut bytes = vec![];
        file.read_to_end(&mut bytes).unwrap();
        String::from_utf8_lossy(&bytes).into_owned()
    });
    (ended.code().unwrap(), said, errors, peak_kb / 1000)
}

/// A folder with a sheet without tolerances, an hour of operation, and its four processes as bags of their own.
#[cfg(target_os = "linux")]
fn hour_and_four(rate_hz: f64) -> (tempfile::TempDir, [String; 3]) {
    let dir = tempfile::tempdir().unwrap();
    tight_sheet::write(dir.path());
    let four = processes(rate_hz);
    for (number, process) in four.iter().enumerate() {
        write_streams(&dir.path().join(format!("four/{number}")), process);
    }
    write_streams(&dir.path().join("hour"), &operation(3600, rate_hz, &four));
    let text = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let paths = ["sheet.yaml", "hour", "four"].map(text);
    (dir, paths)
}

#[cfg(target_os = "linux")]
#[test]
fn an_hour_of_operation_is_fitted_as_its_four_processes_are() {
    for rate_hz in [50.0, 5.0] {
        let (_dir, [sheet, hour, four]) = hour_and_four(rate_hz);
        let fit = |bags: &str| {
            let (code, said, errors, _) =
                ended(&["fit", "--params", &sheet, "--effect", "backlash", "--starts", "1", "--json", bags]);
            assert!([0, 3].contains(&code), "{errors}");
            (serde_json::from_str::<serde_json::Value>(&said).unwrap(), errors)
        };
        let ((of_hour, told), (of_four, _)) = (fit(&hour), fit(&four));
        let play = |figures: &serde_json::Value| {
            let rows = figures["parameters"].as_array().unwrap();
            let row = rows.iter().find(|row| row["key"] == "backlash.play_pu").unwrap();
            [&row["fitted"], &row["ci90"][0], &row["ci90"][1]].map(|value| value.as_f64().unwrap())
        };
        let ([one, low, high], [other, ..]) = (play(&of_hour), play(&of_four));
        assert!((one - other).abs() < 2e-4 && (one - 0.004).abs() < 5e-4, "{one} {low} {high} {other}");
        assert!(told.contains("lasts 3600 s, of which 4 processes were cut out"), "{told}");
        let input = &of_hour["provenance"]["recordings"][0];
        assert!(
            input["excerpt"]
                .as_str()
                .unwrap()
                .contains("#1 start-up, #2 load increase, #3 load rejection, #4 shutdown")
        );
        assert!(of_four["provenance"]["recordings"][0].get("excerpt").is_none());
        assert_eq!(of_hour["recordings"].as_array().unwrap().len(), 4);
    }
}

#[cfg(target_os = "linux")]
#[test]
#[ignore = "two diagnoses by the whole catalogue, minutes of a processor"]
fn an_hour_of_operation_is_diagnosed_as_its_four_processes_are() {
    let (dir, [sheet, hour, four]) = hour_and_four(50.0);
    let diagnose = |bags: &str, out: &str| {
        let out = dir.path().join(out);
        let (code, said, errors, _) =
            ended(&["diagnose", "--params", &sheet, "--json", "--out", out.to_str().unwrap(), bags]);
        assert!([0, 3].contains(&code), "{errors}");
        serde_json::from_str::<serde_json::Value>(&said).unwrap()
    };
    let (of_hour, of_four) = (diagnose(&hour, "one"), diagnose(&four, "other"));
    assert_eq!((&of_hour["verdict"], &of_four["verdict"]), (&"named".into(), &"named".into()));
    let blamed = |report: &serde_json::Value| {
        report["effects"].as_array().unwrap().iter().map(|one| one["id"].clone()).collect::<Vec<_>>()
    };
    assert_eq!((blamed(&of_hour), blamed(&of_four)), (vec!["backlash".into()], vec!["backlash".into()]));
}

#[cfg(target_os = "linux")]
#[test]
fn memory_of_a_fit_follows_the_processes_and_not_the_length() {
    let dir = tempfile::tempdir().unwrap();
    tight_sheet::write(dir.path());
    let sheet = dir.path().join("sheet.yaml");
    let four = processes(50.0);
    let peaks = [1800, 3 * 3600].map(|seconds| {
        let bag = write_streams(&dir.path().join(format!("run_{seconds}")), &operation(seconds, 50.0, &four));
        let fit = ["fit", "--params", sheet.to_str().unwrap(), "--effect", "backlash", "--starts", "1"];
        let (code, _, errors, peak_mb) = ended(&[&fit[..], &[bag.to_str().unwrap()]].concat());
        assert!([0, 3].contains(&code) && errors.contains("4 processes"), "{errors}");
        peak_mb
    });
    assert!(peaks[0] < 300 && peaks[1] < peaks[0] + 32, "{peaks:?} MB");
}

#[cfg(target_os = "linux")]
#[test]
fn of_more_processes_than_there_is_room_for_some_are_left_out_and_told() {
    let dir = tempfile::tempdir().unwrap();
    // It never rests: pieces of 300 s.
    let bag = write(&dir.path().join("run"), 3600);
    let out = dir.path().join("out");
    let (code, _, errors, peak_mb) =
        ended(&["accept", "--measure-only", "--out", out.to_str().unwrap(), bag.to_str().unwrap()]);
    assert!([0, 3].contains(&code) && peak_mb < 400, "{peak_mb} MB {errors}");
    assert!(errors.contains("of them are left out for want of room"), "{errors}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_long_recording_without_a_process_is_refused_with_the_way_out() {
    let dir = tempfile::tempdir().unwrap();
    let bag = write_streams(&dir.path().join("still"), &operation(1000, 20.0, &[]));
    let (code, _, errors, _) = ended(&["fit", bag.to_str().unwrap()]);
    assert_eq!(code, 1, "{errors}");
    for words in [
        "lasts 1000 s",
        "there is none: expected command or position to move by more than 3 %",
        "cut out at most 600 s",
    ] {
        assert!(errors.contains(words), "{words}: {errors}");
    }
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
        let simulated = govtwin_bag::survey(&out.join(format!("run_{seconds}"))).unwrap();
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
    let recording = govtwin_bag::read(&path, &ReadOptions::default()).unwrap().recording;
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
