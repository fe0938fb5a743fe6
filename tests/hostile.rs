//! Inputs that were made to hang the program or to fill its memory: refused or counted, with what was expected and found.
#![cfg(feature = "cli")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, ServoState};
use govtwin_bag::{BagError, Interpolation, Qos, ReadOptions, Stream, Writer, WriterOptions};
use govtwin_model::params;

const S: i64 = 1_000_000_000;
const BEGIN_NS: i64 = 1_700_000_000 * S;

/// A record of MCAP.
fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

fn schema(id: u16, name: &str, definition: &str) -> Vec<u8> {
    record(3, &[&id.to_le_bytes()[..], &text(name), &text("ros2msg"), &text(definition)].concat())
}

fn channel(id: u16, schema: u16, topic: &str) -> Vec<u8> {
    let (id, schema) = (id.to_le_bytes(), schema.to_le_bytes());
    record(4, &[&id[..], &schema, &text(topic), &text("cdr"), &[0; 4]].concat())
}

fn message(channel: u16, log_ns: i64, data: &[u8]) -> Vec<u8> {
    let time = log_ns.to_le_bytes();
    record(5, &[&channel.to_le_bytes()[..], &[0; 4], &time, &time, data].concat())
}

/// An MCAP file without chunks and without summary.
fn file(dir: &Path, records: &[Vec<u8>]) -> PathBuf {
    let path = dir.join("hostile.mcap");
    let head = record(1, &[text("ros2"), text("")].concat());
    let end = [record(15, &[0; 4]), record(2, &[0; 20])].concat();
    fs::write(&path, [mcap::MAGIC, &head, &records.concat(), &end, mcap::MAGIC].concat()).unwrap();
    path
}

fn arrays_of_nothing(dir: &Path) -> PathBuf {
    let definition = "Nothing[4000000000000] a\n===\nMSG: p/Nothing\nuint8[0] x\n";
    let messages = (0..20).map(|k| message(0, BEGIN_NS + k, &[0, 1, 0, 0])).collect::<Vec<_>>().concat();
    file(dir, &[schema(1, "p/msg/A", definition), channel(0, 1, "/a"), messages])
}

#[test]
fn arrays_of_nothing_do_not_fit_their_schema() {
    let dir = tempfile::tempdir().unwrap();
    let path = arrays_of_nothing(dir.path());
    assert!(fs::metadata(&path).unwrap().len() < 1100);
    let survey = govtwin_bag::survey(&path).unwrap();
    assert_eq!((survey.topics[0].messages, survey.topics[0].undecodable), (20, 20));
}

/// 2000 topics of a type with 200 kB of text and 5000 numbers, announced again and again: 400 MB if each had its own.
fn many_topics(dir: &Path) -> PathBuf {
    let definition =
        format!("{}# {}\n", (0..5000).map(|k| format!("float64 a{k}\n")).collect::<String>(), "x".repeat(100_000));
    let mut records = vec![schema(1, "p/msg/A", &definition)];
    for round in 0..20 {
        for id in 0..2000 {
            records.push(channel(id, 1, &format!("/topic_{id}")));
            records.push(message(id, BEGIN_NS + round, &[0, 1, 0, 0, 0, 0, 0, 0]));
        }
    }
    file(dir, &records)
}

#[test]
fn many_topics_of_one_large_type_share_it() {
    let dir = tempfile::tempdir().unwrap();
    let path = many_topics(dir.path());
    let survey = govtwin_bag::survey(&path).unwrap();
    assert_eq!((survey.topics.len(), survey.messages), (2000, 40_000));
    let readable = survey.topics.iter().filter(|topic| topic.readable).count();
    assert_eq!(readable, 20, "as many as have 100,000 fields together");
    let topics: Vec<_> =
        govtwin_bag::messages(&path).unwrap().take(2000).map(|message| message.unwrap().topic).collect();
    assert!(topics.iter().all(|topic| topic.schema.as_ptr() == topics[0].schema.as_ptr()), "one text for all");
    // And they are written again as they were.
    let mut writer = Writer::create(&dir.path().join("copy"), WriterOptions::default()).unwrap();
    for message in govtwin_bag::messages(&path).unwrap() {
        writer.copy(&message.unwrap()).unwrap();
    }
    let copy = govtwin_bag::survey(&writer.finish().unwrap()).unwrap();
    assert_eq!((copy.topics.len(), copy.messages), (2000, 40_000));
}

#[test]
fn names_longer_than_any_are_damage() {
    let dir = tempfile::tempdir().unwrap();
    let records =
        [schema(1, "p/msg/A", "uint8 a\n"), channel(0, 1, &"/a".repeat(1000)), message(0, 5, &[0, 1, 0, 0, 1])];
    let warnings = govtwin_bag::survey(&file(dir.path(), &records)).unwrap().warnings;
    assert!(warnings[0].to_string().contains("a record that does not hold what it should"), "{warnings:?}");
}

/// Heartbeats of ESV and pressure once a second, and a command and a measurement at each of these seconds.
fn heartbeats(dir: &Path, beats: i64, seconds: &[i64]) -> PathBuf {
    let mut writer =
        Writer::create(&dir.join(format!("beats_{beats}_{}", seconds.len())), WriterOptions::default()).unwrap();
    let command = writer.topic::<GovernorCommand>("/governor/command", Qos::SENSOR).unwrap();
    let esv = writer.topic::<EsvState>("/governor/esv", Qos::SENSOR).unwrap();
    let pressure = writer.topic::<FluidPressure>("/governor/tank_pressure", Qos::SENSOR).unwrap();
    let servo = writer.topic::<ServoState>("/plant/servo_state", Qos::SENSOR).unwrap();
    for beat in 0..beats {
        let time_ns = BEGIN_NS + beat * S;
        let header = Header::at(time_ns);
        writer.write(esv, time_ns, &EsvState { header: header.clone(), state: EsvState::NORMAL }).unwrap();
        let message = FluidPressure { header: header.clone(), fluid_pressure: 6.3e6, variance: 0.0 };
        writer.write(pressure, time_ns, &message).unwrap();
        if seconds.contains(&beat) {
            writer.write(command, time_ns, &GovernorCommand { header: header.clone(), opening: 0.5 }).unwrap();
            writer.write(servo, time_ns, &ServoState { header, ..ServoState::default() }).unwrap();
        }
    }
    writer.finish().unwrap()
}

#[test]
fn a_grid_is_counted_before_it_is_laid_and_ends_with_the_last_command_or_measurement() {
    let dir = tempfile::tempdir().unwrap();
    let fine = ReadOptions {
        interpolation: Interpolation::Sharp { period_ns: 1_000_000 },
        required: vec![Stream::ServoState],
        ..ReadOptions::default()
    };
    // Ten hours of heartbeats after two seconds of recording.
    let path = heartbeats(dir.path(), 36_000, &[0, 1, 2]);
    let loaded = govtwin_bag::read(&path, &fine).unwrap();
    assert_eq!(loaded.recording.frames.len(), 2001);
    assert_eq!(loaded.recording.frames.last().unwrap().time_ns, BEGIN_NS + 2 * S);
    let said = loaded.health.warnings[0].to_string();
    assert_eq!(said, "/governor/esv: goes on 35997.0 s after the last command and measurement: left out");
    // A measurement every ten minutes for ten hours: 36 million rows of a millisecond.
    let rare: Vec<i64> = (0..60).map(|k| k * 600).collect();
    let path = heartbeats(dir.path(), 36_000, &rare);
    let error = govtwin_bag::read(&path, &fine).unwrap_err();
    let BagError::TooManyRows { rows: 35_400_000, limit, .. } = error else { panic!("{error}") };
    assert!(error.to_string().contains("makes 35400000 rows, expected at most"), "{error}");
    assert!(limit < 20_000_000, "{limit}");
    // A fit makes the rows one by one, and finds no process in them.
    let output = Command::new(env!("CARGO_BIN_EXE_govtwin")).arg("fit").arg(&path).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && said.contains("there is none: expected command or position"), "{said}");
    // Without a grid there are as many rows as stamps.
    assert_eq!(govtwin_bag::read(&path, &ReadOptions::default()).unwrap().recording.frames.len(), 35_401);
}

#[test]
fn hostile_yaml_beside_or_inside_a_bag_is_done_without() {
    let dir = tempfile::tempdir().unwrap();
    let path = heartbeats(dir.path(), 10, &[0, 9]);
    let bomb = alias_bomb(40);
    for (yaml, words) in [
        (format!("rosbag2_bagfile_information:\n  version: 9\n{bomb}"), "expected at most 10 anchors and aliases"),
        ("{a: ".repeat(50_000), "expected at most 10000 opening brackets, found 50000"),
        ("# long\n".repeat(3 << 20), "expected at most 16777216 bytes, found 22020096"),
    ] {
        fs::write(path.join("metadata.yaml"), yaml).unwrap();
        let warnings = govtwin_bag::read(&path, &ReadOptions::default()).unwrap().health.warnings;
        assert!(warnings.iter().any(|warning| warning.to_string().contains(words)), "{words}: {warnings:?}");
    }
    // Quality of service comes from the bag, too, and is written again.
    let qos: String = format!("- &a {}", bomb.replace('\n', "\n  "));
    let mut messages = govtwin_bag::messages(&path).unwrap().map(Result::unwrap).collect::<Vec<_>>();
    let mut topic = (*messages[0].topic).clone();
    topic.offered_qos_profiles = qos.clone();
    messages[0].topic = topic.into();
    let mut writer = Writer::create(&dir.path().join("copy"), WriterOptions::default()).unwrap();
    for message in &messages {
        writer.copy(message).unwrap();
    }
    let copy = writer.finish().unwrap();
    let yaml: serde_yaml::Value =
        serde_yaml::from_str(&fs::read_to_string(copy.join("metadata.yaml")).unwrap()).unwrap();
    let first = &yaml["rosbag2_bagfile_information"]["topics_with_message_count"][0];
    assert_eq!(first["topic_metadata"]["offered_qos_profiles"], serde_yaml::Value::String(qos));
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_named_and_not_read() {
    let dir = tempfile::tempdir().unwrap();
    let pipe = dir.path().join("pipe.mcap");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let (pipe, zero) = (pipe.to_str().unwrap(), "/dev/zero");
    for (path, found) in [(pipe, "found a pipe"), (zero, "found a device")] {
        let error = govtwin_bag::read(Path::new(path), &ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("expected a regular file") && error.contains(found), "{error}");
        let error = params::load(Path::new(path)).unwrap_err().to_string();
        assert!(error.contains(path) && error.contains(found), "{error}");
        for arguments in [&["info", path][..], &["replay", path], &["check", path], &["replay", path, "--params", path]]
        {
            let output = Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments).output().unwrap();
            assert_eq!(output.status.code(), Some(1), "{arguments:?}");
            assert!(String::from_utf8_lossy(&output.stderr).contains(found), "{arguments:?}");
        }
    }
    // A pipe in the place of metadata.yaml, and among the files of a folder.
    let folder = heartbeats(dir.path(), 10, &[0, 9]);
    fs::remove_file(folder.join("metadata.yaml")).unwrap();
    for name in ["metadata.yaml", "more.mcap"] {
        assert!(Command::new("mkfifo").arg(folder.join(name)).status().unwrap().success());
    }
    let warnings = govtwin_bag::read(&folder, &ReadOptions::default()).unwrap().health.warnings;
    assert!(warnings[0].to_string().contains("found a pipe"), "{warnings:?}");
}

fn alias_bomb(count: usize) -> String {
    (1..count).map(|k| format!("a{k}: &a{k} [*a{0},*a{0}]\n", k - 1)).collect()
}

/// Seconds of processor that a run of the program took, all its threads together; a shell measures them.
#[cfg(unix)]
fn processor_s(arguments: &[&str]) -> f64 {
    let mut shell = Command::new("sh");
    shell.args(["-c", "\"$0\" \"$@\" >/dev/null 2>&1; times", env!("CARGO_BIN_EXE_govtwin")]).args(arguments);
    let said = String::from_utf8(shell.output().unwrap().stdout).unwrap();
    let seconds = |text: &str| {
        let (minutes, seconds) = text.trim_end_matches('s').split_once('m')?;
        Some(60.0 * minutes.parse::<f64>().ok()? + seconds.parse::<f64>().ok()?)
    };
    let of_children = said.lines().nth(1).unwrap_or_else(|| panic!("no times in {said:?}"));
    of_children.split(' ').map(|text| seconds(text).unwrap_or_else(|| panic!("no time: {text:?}"))).sum()
}

#[cfg(unix)]
#[test]
fn nothing_takes_more_than_two_seconds_for_each_megabyte() {
    // Of the processor, since other tests run beside; the least that is measured is a megabyte.
    const S_FOR_EACH_MB: f64 = 2.0;
    type Make = fn(&Path) -> PathBuf;
    let chunk_of_nothing: Make = |dir| {
        let chunk = [&[6][..], &40_u64.to_le_bytes(), &[0; 40]].concat();
        let beyond = [&[5][..], &(1_u64 << 40).to_le_bytes(), &chunk].concat();
        file(dir, &vec![beyond; 30_000])
    };
    let packed_zeros: Make = |dir| {
        let packed = zstd::bulk::compress(&vec![0; 240 << 20], 1).unwrap();
        let head = [&[0; 16][..], &(240_u64 << 20).to_le_bytes(), &[0; 4], &text("zstd")].concat();
        let chunk = [&head[..], &(packed.len() as u64).to_le_bytes(), &packed].concat();
        file(dir, &vec![record(6, &chunk); 20])
    };
    let packed_as_a_whole: Make = |dir| {
        let path = dir.join("zeros.mcap.zstd");
        let zeros = [mcap::MAGIC, &vec![0; 1 << 28]].concat();
        fs::write(&path, zstd::encode_all(&zeros[..], 1).unwrap()).unwrap();
        path
    };
    let beats: Make = |dir| heartbeats(dir, 36_000, &[0, 1, 2]);
    let dir = tempfile::tempdir().unwrap();
    let mut tried = 0;
    for (number, (commands, make)) in [
        (&["info", "replay", "doctor"][..], arrays_of_nothing as Make),
        (&["info", "replay", "doctor"], many_topics),
        (&["info", "replay", "doctor"], chunk_of_nothing),
        (&["info", "replay", "doctor"], packed_zeros),
        (&["info", "replay", "doctor"], packed_as_a_whole),
        (&["info", "replay", "fit"], beats),
    ]
    .into_iter()
    .enumerate()
    {
        let folder = dir.path().join(number.to_string());
        fs::create_dir(&folder).unwrap();
        let path = make(&folder);
        for command in commands {
            tried += check_time(&[command, path.to_str().unwrap()], bytes_below(&path), S_FOR_EACH_MB);
        }
    }
    for yaml in [alias_bomb(20_000), "{a: ".repeat(60_000), "[".repeat(500_000), "a:\n ".repeat(100_000)] {
        let path = dir.path().join("sheet.yaml");
        fs::write(&path, &yaml).unwrap();
        tried += check_time(&["check", path.to_str().unwrap()], yaml.len() as u64, S_FOR_EACH_MB);
    }
    assert_eq!(tried, 22);
}

/// Bytes of a file, or of all files of a folder.
#[cfg(unix)]
fn bytes_below(path: &Path) -> u64 {
    let entries = fs::read_dir(path).into_iter().flatten().map(|entry| bytes_below(&entry.unwrap().path()));
    if path.is_dir() { entries.sum() } else { fs::metadata(path).unwrap().len() }
}

#[cfg(unix)]
#[track_caller]
fn check_time(arguments: &[&str], bytes: u64, s_for_each_mb: f64) -> usize {
    let (took_s, megabytes) = (processor_s(arguments), bytes as f64 / 1e6);
    println!("{arguments:?}: {took_s:.2} s for {megabytes:.2} MB");
    assert!(took_s <= s_for_each_mb * megabytes.max(1.0), "{arguments:?}: {took_s} s for {megabytes} MB");
    1
}
