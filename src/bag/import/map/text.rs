//! Writes a map as text that reads back as the same map.

use super::{Map, Repeated, SignalMap, SignalPlace, TripRule};
use crate::import::lines::Between;
use govtwin_model::params::number_text;
use govtwin_model::params::yaml::quoted;

/// The text of a map; `reason` gives each signal a comment, empty for none.
pub fn map_text(map: &Map, head: &[String], reason: impl Fn(&SignalMap) -> String) -> String {
    let mut lines: Vec<String> = head.iter().map(|line| format!("# {line}")).collect();
    for (key, value) in [("name", &map.name), ("source", &map.source)] {
        if !value.is_empty() {
            lines.push(format!("{key}: {}", quoted(value)));
        }
    }
    let file = &map.file;
    let mut found = vec![];
    if let Some(separator) = file.separator {
        let text = if separator == b'\t' { "tab".to_owned() } else { quoted(&char::from(separator).to_string()) };
        found.push(format!("separator: {text}"));
    }
    found.extend(file.decimal.map(|decimal| format!("decimal: {}", quoted(&decimal.to_string()))));
    found.extend(file.thousands.map(|thousands| format!("thousands: {}", quoted(&thousands.to_string()))));
    found.extend(file.encoding.as_ref().map(|encoding| format!("encoding: {}", quoted(encoding))));
    found.extend(file.header_line.map(|line| format!("header_line: {line}")));
    found.extend(file.unit_line.map(|line| format!("unit_line: {line}")));
    found.extend(file.first_line.map(|line| format!("first_line: {line}")));
    if !file.missing.is_empty() {
        found.push(format!("missing: {}", list(&file.missing)));
    }
    found.extend(file.tag_column.as_ref().map(|column| format!("tag_column: {}", quoted(column))));
    found.extend(file.value_column.as_ref().map(|column| format!("value_column: {}", quoted(column))));
    section(&mut lines, "file", &found);

    let time = &map.time;
    let mut found = vec![];
    match &time.columns[..] {
        [] => {}
        [column] => found.push(format!("column: {}", quoted(column))),
        columns => found.push(format!("columns: {}", list(columns))),
    }
    found.extend(time.format.as_ref().map(|format| format!("format: {}", quoted(format))));
    found.extend(time.zone.as_ref().map(|zone| format!("zone: {}", quoted(zone))));
    found.extend(time.start.as_ref().map(|start| format!("start: {}", quoted(start))));
    found.extend(time.rate_hz.map(|rate| format!("rate_hz: {}", number_text(rate))));
    if time.repeated == Repeated::Spread {
        found.push("repeated: spread".to_owned());
    }
    if time.by_log {
        found.push("stamp: log".to_owned());
    }
    section(&mut lines, "time", &found);
    if let Some(rate_hz) = map.resample_hz {
        lines.push(format!("resample: {{rate_hz: {}}}", number_text(rate_hz)));
    }
    lines.push("signals:".to_owned());
    for signal in &map.signals {
        let reason = reason(signal);
        let reason = reason.split_whitespace().collect::<Vec<_>>().join(" ");
        let comment = if reason.is_empty() { String::new() } else { format!(" # {reason}") };
        lines.push(format!("  {}: {}{comment}", signal.target.id(), value(signal)));
    }
    lines.push(String::new());
    lines.join("\n")
}

fn section(lines: &mut Vec<String>, key: &str, found: &[String]) {
    if !found.is_empty() {
        lines.push(format!("{key}:"));
        lines.extend(found.iter().map(|line| format!("  {line}")));
    }
}

fn value(signal: &SignalMap) -> String {
    let mut parts = vec![match &signal.from {
        SignalPlace::Column(column) => format!("column: {}", quoted(column)),
        SignalPlace::Field(field) => format!("field: {}", quoted(field)),
        SignalPlace::Constant(value) if signal.target == super::Target::Esv => {
            return if *value == 0.0 { "shutdown" } else { "normal" }.to_owned();
        }
        // What stands here is in the unit of the import already.
        SignalPlace::Constant(value) => return format!("{{constant: {}}}", number_text(*value)),
    }];
    if !signal.unit.is_empty() {
        parts.push(format!("unit: {}", quoted(&signal.unit)));
    }
    let conversion = &signal.conversion;
    if conversion.scale != 1.0 {
        parts.push(format!("scale: {}", number_text(conversion.scale)));
    }
    if conversion.offset != 0.0 {
        parts.push(format!("offset: {}", number_text(conversion.offset)));
    }
    let pair = |[from, to]: [f64; 2]| format!("[{}, {}]", number_text(from), number_text(to));
    if let Some(range) = conversion.range {
        parts.push(format!("range: {}", pair(range)));
        if conversion.to != [0.0, 1.0] {
            parts.push(format!("to: {}", pair(conversion.to)));
        }
    }
    if conversion.turned {
        parts.push("sign: -1".to_owned());
    }
    let events: Vec<String> = signal.shutdown.iter().map(event).collect();
    if !events.is_empty() {
        parts.push(format!("shutdown: {}", list(&events)));
    }
    if signal.latch {
        parts.push("latch: true".to_owned());
    }
    match signal.between {
        Between::Found => {}
        Between::Hold => parts.push("between: hold".to_owned()),
        Between::Line => parts.push("between: line".to_owned()),
    }
    parts.extend(signal.deviation_percent.map(|percent| format!("deviation_percent: {percent}")));
    parts.extend(signal.time.as_ref().map(|time| format!("time: {}", quoted(time))));
    parts.extend(signal.quality.as_ref().map(|quality| format!("quality: {}", quoted(quality))));
    if !signal.good.is_empty() {
        parts.push(format!("good: {}", list(&signal.good)));
    }
    format!("{{{}}}", parts.join(", "))
}

fn event(event: &TripRule) -> String {
    match event {
        TripRule::Is(text) => text.clone(),
        TripRule::Above(level) => format!("> {}", number_text(*level)),
        TripRule::Below(level) => format!("< {}", number_text(*level)),
    }
}

fn list(texts: &[String]) -> String {
    let texts: Vec<String> = texts.iter().map(|text| quoted(text)).collect();
    format!("[{}]", texts.join(", "))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::map_text;
    use crate::import::Map;

    #[test]
    fn a_written_map_reads_back_as_it_was() {
        let text = r#"
name: "unit 3: rejection"
source: historian
file: {separator: tab, decimal: ",", thousands: ".", encoding: windows-1252, header_line: 3, unit_line: 4, first_line: 5, missing: [Bad, "-"]}
time: {columns: [Datum, "Zeit #2"], format: "%d.%m.%Y %H:%M:%S%.f", zone: Europe/Zurich, repeated: spread, start: "2024-05-02"}
resample: {rate_hz: 100}
signals:
  opening_command: {column: "Y soll, \"%\"", unit: "%", between: line, deviation_percent: 0.3}
  esv: {column: TRIP, shutdown: [1, "> 0.5", AUS], latch: true}
  tank_pressure: {column: p, range: [4, 20], to: [0, 100], unit: bar}
  spool_position: {field: "/joint_states.position[spool]", range: [0, 0.015], sign: -1}
  servomotor_position: {column: y, scale: 2, offset: -0.5}
  pilot_valve_position: {column: "u [V]", time: t2, quality: "u.Quality", good: ["192", Good]}
  control_pressure: {constant: 33, unit: bar}
"#;
        let read =
            |text: &str| Map::parse(text, Path::new("map.yaml")).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let map = read(text);
        let written = map_text(&map, &["made".to_owned()], |_| "because\nof # it".to_owned());
        let mut again = read(&written);
        for (signal, other) in again.signals.iter_mut().zip(&map.signals) {
            signal.line = other.line;
            if signal.place().is_none() {
                // A constant is written in the unit of the import.
                signal.unit.clone_from(&other.unit);
                signal.conversion = other.conversion;
            }
        }
        assert_eq!(again, map, "{written}");
    }

    #[test]
    fn everything_wrong_comes_at_once_with_its_line() {
        let text = "file: {separator: ';;'}\ntime:\n  colum: t\n  rate_hz: -1\nsignals:\n  spool: y\n  tank_pressure: {column: p, unit: \
                    mm}\n  servomotor_position: {column: Y, unit: mm}\n  esv: {column: TRIP}\n  opening_command: {unit: '%'}\n  \
                    control_pressure: {column: c, range: [4, 20], unit: bar}\n";
        let error = Map::parse(text, Path::new("m.yaml")).unwrap_err().to_string();
        for words in [
            "9 problems in the map m.yaml",
            "m.yaml:1: file.separator: expected one character, `tab` or `space`, found `;;`",
            "m.yaml:3: time.colum: there is no such key; did you mean `column`?",
            "m.yaml:4: time.rate_hz: expected a number above 0, found -1",
            "m.yaml:6: signals.spool: there is no such key; did you mean `spool_position`?",
            "m.yaml:7: signals.tank_pressure.unit: `mm` is no unit of it that is known; expected one of Pa, kPa",
            "m.yaml:8: signals.servomotor_position.unit: `mm` is no unit of it that is known; expected one of pu, %",
            "together with `range: [value when closed, value when open]`",
            "m.yaml:9: signals.esv: expected `shutdown`",
            "m.yaml:10: signals.opening_command: expected one of `column`, `field`, `constant`",
            "m.yaml:11: signals.control_pressure.range: say with `to: [0, 100]`",
        ] {
            assert!(error.contains(words), "{words}\n{error}");
        }
    }
}
