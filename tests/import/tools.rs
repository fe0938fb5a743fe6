//! Files as other tools write them, held against the recording that they were made of.

use govtwin_bag::import::{ImportedRow, Target};
use govtwin_bag::{FieldReader, FieldValue, ReadOptions};

use super::{fixture, rows, shipped};

/// Values of the recording at a time: command, tank pressure, spool, servomotor.
fn truth() -> Vec<(i64, [Option<f64>; 4])> {
    let path = shipped("practice/case_01/load_rejection.mcap");
    let mut found = std::collections::BTreeMap::new();
    let messages = govtwin_bag::messages(&path).unwrap();
    for message in messages {
        let message = message.unwrap();
        let reader = FieldReader::new(&message.topic).unwrap();
        let entry: &mut [Option<f64>; 4] = found.entry(reader.stamp_ns(&message.data).unwrap()).or_default();
        for (field, value) in reader.leaves(&message.data) {
            let place = ["opening", "fluid_pressure", "spool_position", "servomotor_position"];
            if let (Some(place), FieldValue::Number(value)) = (place.iter().position(|name| *name == field), value) {
                entry[place] = Some(value);
            }
        }
    }
    found.into_iter().collect()
}

/// Compares with the recording, row by row; `shift_ns` is added to times that count from the first row.
fn assert_true(name: &str, found: &[ImportedRow], tolerance: f64, nearest_ns: i64, targets: &[Target]) {
    let truth = truth();
    let mut compared = 0;
    for row in found {
        let at = truth.partition_point(|(time_ns, _)| *time_ns < row.time_ns - nearest_ns);
        let (time_ns, values) = truth.get(at).unwrap_or_else(|| panic!("{name}: no row at {} ns", row.time_ns));
        assert!((time_ns - row.time_ns).abs() <= nearest_ns, "{name}: {} ns, expected {time_ns} ns", row.time_ns);
        let all = [Target::OpeningCommand, Target::TankPressure, Target::SpoolPosition, Target::ServomotorPosition];
        for (target, expected) in all.into_iter().zip(values).filter(|(target, _)| targets.contains(target)) {
            let (got, expected) = (row.value(target), *expected);
            assert_eq!(got.is_some(), expected.is_some(), "{name}: {} at {} ns", target.id(), row.time_ns);
            if let (Some(got), Some(expected)) = (got, expected) {
                let off = (got - expected).abs();
                assert!(off <= tolerance * expected.abs().max(1.0), "{name}: {got}, expected {expected}");
                compared += 1;
            }
        }
    }
    assert!(
        found.len() == 300 && compared >= 300 * targets.len() / 2,
        "{name}: {} rows, {compared} values",
        found.len()
    );
}

const ALL: [Target; 4] =
    [Target::OpeningCommand, Target::TankPressure, Target::SpoolPosition, Target::ServomotorPosition];
const STAGE: [Target; 2] = [Target::SpoolPosition, Target::ServomotorPosition];

const PLAIN: &str = "signals:\n  opening_command: opening_command\n  esv: {column: esv_state, shutdown: 0}\n  tank_pressure: {column: \
                     tank_pressure, unit: Pa}\n  spool_position: spool\n  servomotor_position: servomotor\n";

#[test]
fn pandas_csv_and_parquet_are_exact() {
    for name in ["pandas_ns.csv", "pandas_iso.csv"] {
        let (found, outcome) = rows(&[fixture(name)], PLAIN).unwrap();
        assert_true(name, &found, 0.0, 0, &ALL);
        assert!(outcome.warnings.is_empty(), "{name}: {:?}", outcome.warnings);
    }
    let parquet = rows(&[fixture("pandas.parquet")], PLAIN);
    if cfg!(feature = "parquet") {
        assert_true("pandas.parquet", &parquet.unwrap().0, 0.0, 0, &ALL);
    } else {
        let error = parquet.unwrap_err().to_string();
        assert!(
            error.contains("a Parquet file, which this build cannot read; build with `--features parquet`"),
            "{error}"
        );
    }
}

const GERMAN: &str = "signals:\n  opening_command: {column: Y_soll, unit: '%'}\n  esv: {column: Notschluß, shutdown: 1}\n  \
                      tank_pressure: p_Tank\n  spool_position: {column: Hauptsteuerventil, range: [0, 15]}\n  servomotor_position: {column: \
                      Y_ist, unit: mm, range: [0, 600]}\n";

#[test]
fn a_german_historian_is_read_with_comma_umlauts_and_local_time() {
    let (found, outcome) = rows(&[fixture("german.csv")], &format!("time: {{zone: Europe/Zurich}}\n{GERMAN}")).unwrap();
    assert_true("german.csv", &found, 1e-14, 0, &ALL);
    assert!(outcome.warnings.is_empty(), "{:?}", outcome.warnings);
    let notes = outcome.notes.join("\n");
    for words in [
        "6 columns separated by `;`, decimal `,`",
        "windows-1252",
        "%d.%m.%Y %H:%M:%S%.f",
        "tank_pressure: unit `bar` as its header",
    ] {
        assert!(notes.contains(words), "{words}: {notes}");
    }
    // Without a zone the times are two hours off, and that is said.
    let (found, outcome) = rows(&[fixture("german.csv")], GERMAN).unwrap();
    assert!(outcome.warnings.iter().any(|warning| warning.contains("taken as UTC")), "{:?}", outcome.warnings);
    assert_eq!(found[0].time_ns - 7_200_000_000_000, truth()[150].0);
}

#[test]
fn excel_by_libreoffice_is_read_with_its_serials_and_its_lost_fractions() {
    for name in ["calc.csv", "calc_semicolon.csv"] {
        // The column of days keeps the time to a tenth of a millisecond.
        let serial = format!("time: {{column: Serial, format: excel, zone: Europe/Zurich}}\n{GERMAN}");
        let (found, outcome) = rows(&[fixture(name)], &serial).unwrap();
        assert_true(name, &found, 1e-13, 0, &ALL);
        assert!(outcome.warnings.is_empty(), "{name}: {:?}", outcome.warnings);
        // The other shows whole seconds: the loss is told, and rows are spread where the map asks for it.
        let zone = format!("time: {{column: Zeit, zone: Europe/Zurich}}\n{GERMAN}");
        let (_, outcome) = rows(&[fixture(name)], &zone).unwrap();
        let told =
            outcome.warnings.iter().any(|warning| warning.contains("has the export cut the fraction of the second?"));
        assert!(told, "{name}: {:?}", outcome.warnings);
        let spread = zone.replace("zone:", "repeated: spread, zone:");
        let (found, outcome) = rows(&[fixture(name)], &spread).unwrap();
        assert!(found.windows(2).all(|pair| pair[0].time_ns < pair[1].time_ns));
        assert!(outcome.notes.iter().any(|note| note.contains("rows shared a time with others and were spread")));
    }
}

#[test]
fn plotjuggler_and_matlab_layouts_are_read() {
    let juggler = "signals:\n  opening_command: {column: /governor/command/opening}\n  esv: {column: /governor/esv/state, shutdown: 0}\n  \
                   tank_pressure: {column: /governor/tank_pressure/fluid_pressure, unit: Pa}\n  spool_position: {column: \
                   /plant/servo_state/spool_position}\n  servomotor_position: {column: /plant/servo_state/servomotor_position}\n";
    let (found, _) = rows(&[fixture("plotjuggler.csv")], juggler).unwrap();
    assert_true("plotjuggler.csv", &found, 0.0, 0, &ALL);

    let table = "signals: {opening_command: opening_command, spool_position: spool, servomotor_position: servomotor}\n";
    let (found, _) = rows(&[fixture("matlab_table.csv")], table).unwrap();
    assert_true("matlab_table.csv", &found, 1e-14, 0, &[Target::OpeningCommand, STAGE[0], STAGE[1]]);

    let first = truth()[150].0;
    let start = govtwin_bag::msg::Time::from_nanos(first);
    assert_eq!((start.sec, start.nanosec), (1_790_100_301, 500_000_000));
    for (name, tolerance) in [("matlab_matrix.csv", 1e-14), ("matlab_ascii.txt", 1e-7)] {
        let matrix = "time: {column: \"#1\", start: \"2026-09-22T18:05:01.5Z\"}\nsignals: {spool_position: \"#2\", servomotor_position: \"#3\"}\n";
        let (found, _) = rows(&[fixture(name)], matrix).unwrap();
        assert_true(name, &found, tolerance, 0, &STAGE);
    }
}

#[test]
fn bags_with_other_topics_and_types_are_read_by_field_paths() {
    let text = "signals:\n  opening_command: {field: /gate/setpoint.data, unit: '%'}\n  esv: {field: /trip.data, shutdown: true}\n  \
                tank_pressure: {field: /oil.fluid_pressure, unit: Pa}\n  spool_position: {field: '/joint_states.position[spool]', range: [0, \
                0.015]}\n  servomotor_position: {field: '/joint_states.position[0]', range: [0, 0.6]}\n";
    let (found, outcome) = rows(&[fixture("rosbags.mcap")], text).unwrap();
    assert_true("rosbags.mcap", &found, 1e-15, 0, &ALL);
    assert!(outcome.warnings.is_empty(), "{:?}", outcome.warnings);
    let states: Vec<f64> = found.iter().filter_map(|row| row.value(Target::Esv)).collect();
    assert!(!states.is_empty() && states.iter().all(|state| *state == 1.0));
}

/// ros2_control's states, and a type of the plant's own that has the fields of ours under another name.
#[test]
fn names_within_names_and_types_of_a_plant_are_read_by_field_paths() {
    let path = |joint: &str| format!("/dynamic_joint_states.interface_values[{joint}].values[position]");
    let (spool, servomotor) = (path("spool"), path("servomotor"));
    let dynamic = format!(
        "signals:\n  spool_position: {{field: '{spool}', range: [0, 0.015]}}\n  servomotor_position: {{field: '{servomotor}', range: [0, 0.6]}}\n"
    );
    let own = "signals:\n  spool_position: {field: /gate.spool_position}\n  servomotor_position: {field: /gate.servomotor_position}\n";
    for (name, text) in [("control_msgs", dynamic.as_str()), ("a plant's own type", own)] {
        let (found, outcome) = rows(&[fixture("control.mcap")], text).unwrap();
        assert!(found.len() > 100, "{name}: {} rows", found.len());
        assert_true(name, &found, 1e-15, 0, &STAGE);
        assert!(outcome.warnings.iter().all(|warning| !warning.contains("gate")), "{name}: {:?}", outcome.warnings);
    }
    let (_, outcome) = rows(&[fixture("control.mcap")], &dynamic.replace("[spool]", "[spindle]")).unwrap();
    assert!(outcome.warnings.iter().any(|warning| warning.contains("[spindle]") && warning.contains("do not hold it")));
    // Read as a recording of ours it is refused, with the way out.
    let reading = ReadOptions {
        topics: govtwin_bag::Topics { servo_state: "/gate".to_owned(), ..Default::default() },
        ..Default::default()
    };
    let refused = govtwin_bag::read(&fixture("control.mcap"), &reading).unwrap_err().to_string();
    assert!(refused.contains("plant_msgs/msg/GateState") && refused.contains("govtwin import --suggest"), "{refused}");
}

#[test]
fn several_files_of_one_recording_become_one() {
    // The spool from one tool, the servomotor from another, in parts.
    let whole = std::fs::read_to_string(fixture("pandas_ns.csv")).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    let part = |range: std::ops::Range<usize>| [&[lines[0]][..], &lines[range]].concat().join("\n");
    let (_one, first) = super::file("first.csv", part(1..120));
    let (_two, second) = super::file("second.csv", part(120..301));
    let (found, _) = rows(&[first, second], PLAIN).unwrap();
    assert_true("two parts", &found, 0.0, 0, &ALL);

    let column = |name: &str| {
        let at = lines[0].split(',').position(|known| known == name).unwrap();
        let cut = |line: &&str| format!("{},{}", line.split(',').next().unwrap(), line.split(',').nth(at).unwrap());
        lines.iter().map(cut).collect::<Vec<_>>().join("\n")
    };
    let (_one, spool) = super::file("spool.csv", column("spool"));
    let (_two, servomotor) = super::file("servomotor.csv", column("servomotor"));
    let (found, _) =
        rows(&[spool, servomotor], "signals: {spool_position: spool, servomotor_position: servomotor}").unwrap();
    assert_true("one file a signal", &found, 0.0, 0, &STAGE);
}

#[test]
fn one_value_a_line_is_read_by_its_tags() {
    let mut text = "Timestamp;Tag;Value;Quality\n".to_owned();
    for (time_ns, values) in &truth()[150..450] {
        for (tag, value) in ["CMD", "PT", "SPOOL", "SERVO"].into_iter().zip(values) {
            if let Some(value) = value {
                text.push_str(&format!("{time_ns};{tag};{value};Good\n"));
            }
        }
    }
    let long = "file: {tag_column: Tag, value_column: Value}\nsignals: {opening_command: CMD, tank_pressure: {column: PT, unit: Pa}, \
                spool_position: SPOOL, servomotor_position: SERVO}\n";
    let (found, _) = super::rows_of(&text, long).unwrap();
    assert_true("one value a line", &found, 0.0, 0, &ALL);
    // A map is proposed as for any other table.
    let (_folder, path) = super::file("long.csv", &text);
    let found = govtwin_bag::import::suggest::suggest(&path, &Default::default(), &mut |_| ()).unwrap();
    let places: Vec<_> = found.map.signals.iter().filter_map(|signal| signal.place()).collect();
    assert_eq!(found.map.file.tag_column.as_deref(), Some("Tag"));
    assert!(["CMD", "SPOOL", "SERVO"].iter().all(|tag| places.contains(tag)), "{places:?}");
}

#[test]
fn reading_by_the_shipped_types_needs_no_option() {
    // The fields of this project's own messages can be mapped like any other.
    let text = "signals:\n  opening_command: /governor/command.opening\n  esv: {field: /governor/esv.state, shutdown: 0}\n  tank_pressure: \
                {field: /governor/tank_pressure.fluid_pressure}\n  spool_position: /plant/servo_state.spool_position\n  servomotor_position: \
                /plant/servo_state.servomotor_position\n";
    let path = shipped("practice/case_01/load_rejection.mcap");
    let (found, _) = rows(std::slice::from_ref(&path), text).unwrap();
    let direct = govtwin_bag::read(&path, &ReadOptions::default()).unwrap().recording;
    assert_eq!(found.len(), direct.frames.len());
}
