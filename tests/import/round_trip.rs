//! Round trips: a shipped recording as a table of every kind, imported into a bag, read as the same frames to the last bit.

use std::fmt::Write as _;
use std::process::Command;

use govtwin_bag::{Loaded, ReadOptions};
use govtwin_model::frame::Frame;

use super::{file, shipped};

fn bits(frames: &[Frame]) -> Vec<(i64, [u64; 6], govtwin_model::frame::EsvState)> {
    let of = |frame: &Frame| {
        let (inputs, measured) = (frame.inputs, frame.measured);
        let values = [
            inputs.opening_command_pu,
            inputs.tank_pressure_pa,
            measured.spool_position_pu,
            measured.servomotor_position_pu,
            measured.pilot_valve_position_pu,
            measured.control_pressure_pa,
        ];
        // What is not there is NaN of whatever kind.
        (frame.time_ns, values.map(|value| if value.is_nan() { 0 } else { value.to_bits() }), inputs.esv)
    };
    frames.iter().map(of).collect()
}

/// The recording's messages as lines: a time as text, then command, ESV, pressure, and the four of the servo state.
fn table(name: &str, separator: char, time: impl Fn(i64) -> String, number: impl Fn(f64) -> String) -> String {
    let mut rows: std::collections::BTreeMap<i64, [Option<f64>; 7]> = Default::default();
    for message in govtwin_bag::messages(&shipped(name)).unwrap() {
        let message = message.unwrap();
        let reader = govtwin_bag::FieldReader::new(&message.topic).unwrap();
        let row = rows.entry(reader.stamp_ns(&message.data).unwrap()).or_default();
        for (field, value) in reader.leaves(&message.data) {
            let fields = [
                "opening",
                "state",
                "fluid_pressure",
                "spool_position",
                "servomotor_position",
                "pilot_valve_position",
                "control_pressure",
            ];
            if let (Some(place), govtwin_bag::FieldValue::Number(value)) =
                (fields.iter().position(|known| *known == field), value)
            {
                row[place] = Some(value).filter(|value| !value.is_nan());
            }
        }
    }
    let mut text = ["time", "cmd", "esv", "p", "y", "Y", "pv", "pc"].join(&separator.to_string());
    text.push('\n');
    for (time_ns, values) in rows {
        text.push_str(&time(time_ns));
        for value in values {
            let _ = write!(text, "{separator}{}", value.map_or(String::new(), &number));
        }
        text.push('\n');
    }
    text
}

const SIGNALS: &str = "signals:\n  opening_command: cmd\n  esv: {column: esv, shutdown: 0}\n  tank_pressure: {column: p, unit: Pa}\n  \
                       spool_position: y\n  servomotor_position: Y\n  pilot_valve_position: pv\n  control_pressure: {column: pc, unit: Pa}\n";

/// Imports a table by the program, and reads the bag.
fn imported(text: &str, map: &str) -> Loaded {
    let (folder, path) = file("table.csv", text);
    let map_path = folder.path().join("map.yaml");
    std::fs::write(&map_path, map).unwrap();
    let out = folder.path().join("bag");
    let output = Command::new(env!("CARGO_BIN_EXE_govtwin"))
        .args([
            "import".as_ref(),
            path.as_os_str(),
            "--map".as_ref(),
            map_path.as_ref(),
            "--out".as_ref(),
            out.as_ref(),
        ])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(0) || said.contains("warning"), "{said}");
    govtwin_bag::read(&out, &ReadOptions::default()).unwrap()
}

#[test]
fn tables_of_every_kind_come_back_to_the_last_bit() {
    let iso = |zone_s: i64| {
        move |time_ns: i64| {
            // Days by Hinnant's algorithm, so that the reader's library is not its own witness.
            let second = time_ns.div_euclid(1_000_000_000) + zone_s;
            let (days, of_day) = (second.div_euclid(86_400) + 719_468, second.rem_euclid(86_400));
            let (era, of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
            let of_400 = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
            let of_year = of_era - (365 * of_400 + of_400 / 4 - of_400 / 100);
            let from_march = (5 * of_year + 2) / 153;
            let (day, month) = (of_year - (153 * from_march + 2) / 5 + 1, (from_march + 2) % 12 + 1);
            let year = of_400 + era * 400 + i64::from(month <= 2);
            let (hour, minute, rest) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
            format!(
                "{day:02}.{month:02}.{year} {hour:02}:{minute:02}:{rest:02}.{:09}",
                time_ns.rem_euclid(1_000_000_000)
            )
        }
    };
    for name in ["practice/case_01/shutdown.mcap", "practice/case_02/startup.mcap", "reference/load_increase_01.mcap"] {
        let original = govtwin_bag::read(&shipped(name), &ReadOptions::default()).unwrap().recording;
        let plain = |value: f64| format!("{value}");
        let comma = |value: f64| format!("{value:e}").replace('.', ",");
        let seconds = |time_ns: i64| format!("{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000);
        let cases: [(&str, String, &str); 4] = [
            ("ns since 1970", table(name, ',', |time_ns| time_ns.to_string(), plain), ""),
            ("seconds since 1970", table(name, '\t', seconds, plain), ""),
            ("local time with decimal comma", table(name, ';', iso(7200), comma), "time: {zone: \"+02:00\"}\n"),
            ("half an hour", table(name, '|', iso(-12_600), plain), "time: {zone: \"-03:30\"}\n"),
        ];
        for (what, text, time) in cases {
            let frames = imported(&text, &format!("{time}{SIGNALS}")).recording.frames;
            assert_eq!(frames.len(), original.frames.len(), "{name}: {what}");
            assert!(bits(&frames) == bits(&original.frames), "{name}: {what}");
        }
    }
}

#[cfg(feature = "parquet")]
#[test]
fn parquet_comes_back_to_the_last_bit() {
    use std::sync::Arc;

    use parquet::data_type::{DoubleType, Int64Type};
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    let name = "practice/case_01/shutdown.mcap";
    let text = table(name, ',', |time_ns| time_ns.to_string(), |value| format!("{value}"));
    let schema = "message m { required int64 time (TIMESTAMP(NANOS,true)); optional double cmd; optional double esv; optional double p; \
                  optional double y; optional double Y; optional double pv; optional double pc; }";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let out = std::fs::File::create(&path).unwrap();
    let mut writer = SerializedFileWriter::new(out, schema, Arc::new(WriterProperties::default())).unwrap();
    for group in rows.chunks(1000) {
        let mut part = writer.next_row_group().unwrap();
        for column in 0..8 {
            let mut open = part.next_column().unwrap().unwrap();
            if column == 0 {
                let times: Vec<i64> = group.iter().map(|row| row[0].parse().unwrap()).collect();
                open.typed::<Int64Type>().write_batch(&times, None, None).unwrap();
            } else {
                let values: Vec<f64> = group.iter().filter_map(|row| row[column].parse().ok()).collect();
                let there: Vec<i16> = group.iter().map(|row| i16::from(!row[column].is_empty())).collect();
                open.typed::<DoubleType>().write_batch(&values, Some(&there), None).unwrap();
            }
            open.close().unwrap();
        }
        part.close().unwrap();
    }
    writer.close().unwrap();
    let (from_parquet, _) = super::rows(&[path], SIGNALS).unwrap();
    let (from_text, _) = super::rows_of(&text, SIGNALS).unwrap();
    let bits = |rows: &[govtwin_bag::import::ImportedRow]| -> Vec<(i64, [u64; 7])> {
        rows.iter()
            .map(|row| (row.time_ns, row.values.map(|value| if value.is_nan() { 0 } else { value.to_bits() })))
            .collect()
    };
    assert!(bits(&from_parquet) == bits(&from_text) && from_text.len() > 4000);
}
