//! Values of every spelling, unit and quality, and what columns mean.

use super::*;

#[test]
fn numbers_of_every_spelling_are_the_same() {
    let minus = |sign: &str, value: f64, digits: usize| {
        let number = format!("{:.digits$}", value.abs());
        if value < 0.0 { format!("{sign}{number}") } else { number }
    };
    let grouped = |value: f64, blank: &str| {
        let number = format!("{value:.1}");
        let (whole, part) = number.split_once('.').unwrap();
        let at = whole.len().saturating_sub(3);
        if at > 0 { format!("{}{blank}{}.{part}", &whole[..at], &whole[at..]) } else { number }
    };
    let header = "t [s];cmd [%];servo [%];spool [%];p tank [kPa]";
    for (what, sign, blank, comma) in [
        ("minus of typography, narrow blank", "\u{2212}", "\u{202f}", true),
        ("en dash, no-break blank", "\u{2013}", "\u{a0}", true),
        ("hyphen of its own, thin blank", "\u{2010}", "\u{2009}", false),
        ("wide minus, apostrophe", "\u{ff0d}", "'", false),
        ("minus, curly apostrophe", "\u{2212}", "\u{2019}", false),
        ("apostrophe before the sign, blank", "'-", " ", true),
    ] {
        let point = |text: String| if comma { text.replace('.', ",") } else { text };
        let text = wide(
            header,
            rejection(),
            |row| point(format!("{:.2}", row.time_s)),
            |value, k| point(if k == 3 { grouped(value * 100.0, blank) } else { minus(sign, value, 4) }),
            ";",
        );
        assert_proposed(what, &text, rejection());
    }
    let quoted = wide(
        "\"Time [s]\";\"cmd [%]\";\"servo [%]\";\"spool [%]\";\"p tank [bar]\"",
        rejection(),
        |row| format!("\"{:.2}\"", row.time_s),
        |value, _| format!("\"{}\"", minus("'-", value, 4)),
        ";",
    );
    assert_proposed("spreadsheet text", &quoted, rejection());
    let trailing = wide(
        &HEADER.replace("Timestamp", "t [s]"),
        rejection(),
        |row| format!("{:.2}", row.time_s),
        |value, _| {
            if value < 0.0 { format!("{}-", -value) } else { value.to_string() }
        },
        ",",
    );
    assert_proposed("minus behind the number", &trailing, rejection());
}

#[test]
fn units_may_stand_in_the_cells() {
    for (what, blank, units) in [
        ("with a blank", " ", ["s", "%", "%", "%", "bar"]),
        ("without", "", ["s", "%", "%", "%", "bar"]),
        ("other units", " ", ["ms", "%", "%", "%", "MPa"]),
    ] {
        let text = wide(
            "Time,Command,Gate servo,Spool,Oil pressure tank",
            rejection(),
            |row| format!("{}{blank}{}", if units[0] == "ms" { row.time_s * 1e3 } else { row.time_s }, units[0]),
            |value, k| format!("{}{blank}{}", if units[k + 1] == "MPa" { value / 10.0 } else { value }, units[k + 1]),
            ",",
        );
        assert_proposed(what, &text, rejection());
    }
}

#[test]
fn values_that_are_not_good_are_left_out() {
    let bad = |k: usize| (300..330).contains(&k);
    for (what, header, good, not) in [
        ("OPC DA", "Y.Value [%],Y.Quality", "192", "24"),
        ("OPC DA, uncertain", "Y.Value [%],Y.Quality", "216", "64"),
        ("OPC UA", "servo [%],servo StatusCode", "0", "2147483648"),
        ("words", "servo [%],Status", "Good", "Bad"),
        ("German words", "servo [%],Status", "gut", "ungültig"),
        ("a flag", "servo [%],servo_valid", "1", "0"),
        ("true or false", "servo [%],servo_valid", "TRUE", "FALSE"),
    ] {
        let mut text = format!("t [s],cmd [%],spool [%],{header}\n");
        for (k, row) in rejection().iter().enumerate() {
            let (value, quality) = if bad(k) { (0.0, not) } else { (row.values[1], good) };
            let _ = writeln!(text, "{:.2},{},{},{value},{quality}", row.time_s, row.values[0], row.values[2]);
        }
        let (rows, outcome, _) = by_proposal(&text).unwrap_or_else(|error| panic!("{what}: {error}"));
        let found = series(&rows, Target::ServomotorPosition);
        assert_eq!(found.len(), 970, "{what}: {:?} {:?}", outcome.notes, outcome.warnings);
        assert!(outcome.notes.iter().any(|note| note.contains("30 values left out")), "{what}: {:?}", outcome.notes);
        let truth = rejection().iter().enumerate().filter(|(k, _)| !bad(*k)).map(|(_, row)| row.values[1] * 0.01);
        assert!(found.iter().zip(truth).all(|((_, value), truth)| (value - truth).abs() < 1e-9), "{what}");
    }
    // The only column of its kind is that of whole rows, wherever it stands.
    let mut text = "t [s],Status,cmd [%],spool [%],servo [%]\n".to_owned();
    for (k, row) in rejection().iter().enumerate() {
        let (values, status) =
            if bad(k) { ([0.0; 3], "Bad") } else { ([row.values[0], row.values[2], row.values[1]], "Good") };
        let _ = writeln!(text, "{:.2},{status},{},{},{}", row.time_s, values[0], values[1], values[2]);
    }
    let (rows, ..) = by_proposal(&text).unwrap();
    for target in [Target::ServomotorPosition, Target::SpoolPosition] {
        assert_eq!(series(&rows, target).len(), 970, "{target:?}");
    }
    // A column that may be a quality, and does not say which of its states is good, is asked about.
    let mut text = "t [s],cmd [%],servo [%],servo quality\n".to_owned();
    for (k, row) in rejection().iter().enumerate() {
        let _ = writeln!(text, "{:.2},{},{},{}", row.time_s, row.values[0], row.values[1], if bad(k) { 3 } else { 7 });
    }
    let (_, outcome, _) = by_proposal(&text).unwrap();
    assert!(outcome.warnings.iter().any(|warning| warning.contains("quality:")), "{:?}", outcome.warnings);
    let map = "signals: {servomotor_position: {column: servo, quality: servo quality, good: [7]}}\n";
    let (rows, _) = super::super::rows_of(&text, map).unwrap();
    assert_eq!(series(&rows, Target::ServomotorPosition).len(), 970);
}

#[test]
fn a_broken_transmitter_of_4_to_20_ma_says_nothing() {
    let mut text = "t [s],servo [mA]\n".to_owned();
    for (k, row) in rejection().iter().enumerate() {
        let current = if k % 100 < 3 { 22.5 } else { 4.0 + 0.16 * row.values[1] };
        let _ = writeln!(text, "{:.2},{current}", row.time_s);
    }
    let map = "signals: {servomotor_position: {column: servo, unit: mA, range: [4, 20]}}\n";
    let (rows, outcome) = super::super::rows_of(&text, map).unwrap();
    let found = series(&rows, Target::ServomotorPosition);
    assert!(found.len() == 970 && found.iter().all(|(_, value)| *value < 1.0));
    assert!(outcome.warnings.iter().any(|warning| warning.contains("30 values left out") && warning.contains("NE 43")));
}

#[test]
fn all_signals_of_a_proposal_are_of_one_machine() {
    let other = recording("practice/case_05/load_rejection.mcap", 4);
    let names = |unit: &str| {
        [
            format!("{unit}Y_CMD [%]"),
            format!("{unit}Y_POS [%]"),
            format!("{unit}SPOOL [%]"),
            format!("{unit}OILP [bar]"),
        ]
    };
    for (first, second) in
        [("U3_", "U5_"), ("Unit1.", "Unit2."), ("G1 ", "G2 "), ("gov_a_", "gov_b_"), ("north ", "south ")]
    {
        let mut text = format!("Time,{},{}\n", names(first).join(","), names(second).join(","));
        for (one, two) in rejection().iter().zip(&other) {
            let cells: Vec<String> = one.values.iter().chain(&two.values).map(f64::to_string).collect();
            let _ = writeln!(text, "{},{}", iso(one), cells.join(","));
        }
        let (rows, _, proposal) = by_proposal(&text).unwrap();
        let places: Vec<&str> = proposal.map.signals.iter().filter_map(|signal| signal.place()).collect();
        let of = |unit: &str| places.iter().filter(|place| place.starts_with(unit)).count();
        assert!(places.len() == 4 && (of(first) == 4 || of(second) == 4), "{places:?}");
        assert!(proposal.open.iter().any(|open| open.starts_with("machines:")), "{:?}", proposal.open);
        assert_right(first, &rows, if of(first) == 4 { rejection() } else { &other });
    }
}

#[test]
fn what_a_trip_column_means_its_servomotor_shows() {
    let shutdown = recording("practice/case_03/shutdown.mcap", 4);
    let trips = shutdown.iter().any(|row| !row.normal);
    assert!(trips && shutdown.iter().any(|row| row.normal), "a recording with a trip");
    for (name, normal, trip) in [
        ("ESV_TRIP", "0", "1"),
        ("ESV_CLOSED", "0", "1"),
        ("ESD_ACTIVE", "0", "1"),
        ("ESV", "1", "0"),
        ("ESV", "0", "1"),
        ("ESV_ENERGISED", "1", "0"),
        ("TRIP", "0", "1"),
        ("Notschluss", "0", "1"),
        ("SS ausgelöst", "0", "1"),
        ("Déclenchement", "0", "1"),
        ("紧急停机", "正常", "动作"),
        ("ESV", "NORMAL", "SHUTDOWN"),
        ("ESV state", "RUN", "STOP"),
    ] {
        for rows in [&shutdown[..], rejection()] {
            let mut text = format!("{HEADER},{name}\n").replace("Timestamp", "t [s]");
            for row in rows {
                let cells: Vec<String> = row.values.iter().map(f64::to_string).collect();
                let _ =
                    writeln!(text, "{:.2},{},{}", row.time_s, cells.join(","), if row.normal { normal } else { trip });
            }
            let (found, _, proposal) = by_proposal(&text).unwrap();
            let of_esv = proposal.map.signals.iter().find(|signal| signal.target == Target::Esv).unwrap();
            assert_eq!(of_esv.place(), Some(name), "{:?}", proposal.open);
            // Only a machine that was at rest all the time leaves a question.
            let mut state = f64::NAN;
            for (row, truth) in found.iter().zip(rows) {
                state = row.value(Target::Esv).unwrap_or(state);
                assert_eq!(state == 1.0, truth.normal, "{name} {normal}: at {} s {:?}", truth.time_s, of_esv.shutdown);
            }
        }
    }
}

#[test]
fn a_trip_that_no_name_states_is_asked_and_a_pulse_of_one_stays() {
    let shutdown = recording("practice/case_03/shutdown.mcap", 4);
    let first = shutdown.iter().position(|row| !row.normal).unwrap();
    let proposed = |header: &str, cells: &dyn Fn(usize, &Truth) -> String| {
        let mut text = format!("{HEADER},{header}\n").replace("Timestamp", "t [s]");
        for (k, row) in shutdown.iter().enumerate() {
            let values: Vec<String> = row.values.iter().map(f64::to_string).collect();
            let _ = writeln!(text, "{:.2},{},{}", row.time_s, values.join(","), cells(k, row));
        }
        by_proposal(&text).unwrap()
    };
    let right = |rows: &[ImportedRow]| {
        let mut state = f64::NAN;
        rows.iter().zip(&shutdown).all(|(row, truth)| {
            state = row.value(Target::Esv).unwrap_or(state);
            (state == 1.0) == truth.normal
        })
    };
    for (name, normal, trip) in [("Status word", "561", "565"), ("ZSW", "0x231", "0x235"), ("Breaker K7", "0", "1")] {
        let (.., proposal) = proposed(name, &|_, row| if row.normal { normal } else { trip }.to_owned());
        let open = proposal.open.join("\n");
        assert!(open.contains(&format!("`{name}` changes its state")), "{name}: {open}");
    }
    let (rows, _, proposal) = proposed("TRIP", &|k, _| u8::from((first..first + 12).contains(&k)).to_string());
    assert!(right(&rows) && proposal.open.iter().any(|open| open.contains("latch: true")), "{:?}", proposal.open);
    let (rows, ..) = proposed("TRIP_A,TRIP_B", &|_, row| format!("0,{}", u8::from(!row.normal)));
    assert!(right(&rows), "the one of two that trips");
    let (rows, ..) =
        proposed("Trip test,ESV", &|k, row| format!("{},{}", u8::from((50..75).contains(&k)), u8::from(row.normal)));
    assert!(right(&rows), "the one of two that is no test");
}

#[test]
fn compressed_commands_run_straight_where_the_servomotor_does() {
    // A slow ramp of which a historian keeps the corners, and points of the servomotor that follows it.
    let command = |t: f64| (0.3 + 0.04 * (t - 5.0).clamp(0.0, 12.0)) * 100.0;
    let mut text = "Tag,Timestamp,Value,Status\n".to_owned();
    let at = |time_s: f64| iso(&Truth { time_s, values: [0.0; 4], normal: true });
    for time_s in [0.0, 5.0, 17.0, 38.0] {
        let _ = writeln!(text, "U3.Y_CMD,{},{},Good", at(time_s), command(time_s));
    }
    for time_s in [0.0, 5.2, 7.0, 9.5, 12.0, 15.0, 17.1, 17.5, 25.0, 38.0] {
        let _ = writeln!(text, "U3.SERVO,{},{},Good", at(time_s), command(time_s - 0.2));
    }
    let map = "file: {tag_column: Tag, value_column: Value}\nsignals:\n  opening_command: {column: U3.Y_CMD, unit: \"%\"}\n  \
               servomotor_position: {column: U3.SERVO, unit: \"%\"}\n";
    let (rows, outcome) = super::super::rows_of(&text, map).unwrap();
    let found = series(&rows, Target::OpeningCommand);
    assert!(found.len() > 1000, "{:?}", outcome.notes);
    assert!(found.iter().all(|(time_s, value)| (value * 100.0 - command(*time_s)).abs() < 0.1));
    assert_eq!(series(&rows, Target::ServomotorPosition).len(), 10, "what is measured stays where it was");
    // Resampled, as a map may ask for, it runs straight as well.
    let (rows, _) = super::super::rows_of(&text, &format!("resample: {{rate_hz: 50}}\n{map}")).unwrap();
    assert!(
        series(&rows, Target::OpeningCommand)
            .iter()
            .all(|(time_s, value)| (value * 100.0 - command(*time_s)).abs() < 0.1)
    );
    // A command that is recorded when it changes holds.
    let steps: String = text.lines().filter(|line| !line.contains("SERVO")).map(|line| format!("{line}\n")).collect();
    let held = |t: f64| if t < 17.0 { 30.0 } else { 78.0 };
    let servo: String =
        (0..38).map(|k| format!("U3.SERVO,{},{},Good\n", at(f64::from(k)), held(f64::from(k) - 0.5))).collect();
    let (rows, _) = super::super::rows_of(format!("{steps}{servo}"), map).unwrap();
    assert_eq!(series(&rows, Target::OpeningCommand).len(), 4);
    // Where nothing shows it, it is asked, and may be anywhere between the two.
    let (_, outcome) = super::super::rows_of(
        &steps,
        "file: {tag_column: Tag, value_column: Value}\nsignals:\n  opening_command: {column: U3.Y_CMD, unit: \"%\"}\n",
    )
    .unwrap();
    assert!(outcome.warnings.iter().any(|warning| warning.contains("between: line")), "{:?}", outcome.warnings);
    assert!((outcome.command_deviation_pu - 0.48).abs() < 0.01, "{}", outcome.command_deviation_pu);
}

/// The points that a swinging door keeps of a course: each line between two passes all others within a deviation (Bristol 1990).
fn swinging_door(course: &[(f64, f64)], deviation: f64) -> Vec<(f64, f64)> {
    let mut kept = vec![course[0]];
    let (mut lower, mut upper) = (f64::NEG_INFINITY, f64::INFINITY);
    for pair in course.windows(2) {
        let doors = |from: (f64, f64)| {
            let [low, here, high] =
                [-deviation, 0.0, deviation].map(|by| (pair[1].1 + by - from.1) / (pair[1].0 - from.0));
            (low, here, high)
        };
        let (low, here, high) = doors(kept[kept.len() - 1]);
        if here < lower || here > upper {
            kept.push(pair[0]);
            (lower, _, upper) = doors(pair[0]);
        } else {
            (lower, upper) = (lower.max(low), upper.min(high));
        }
    }
    kept.extend(course.last());
    kept
}

/// A load increase of a unit with 0.21 % of play, of which a historian kept command and servomotor to 0.2 % of the stroke; and how far its command is
/// from its lines at most, pu.
fn compressed() -> (String, f64) {
    let truth = recording("practice/case_03/load_increase.mcap", 4);
    let mut lines = vec![];
    let mut farthest = 0.0_f64;
    for (signal, name, deviation) in [(0, "cmd", 0.2), (1, "servo", 0.2), (2, "spool", 0.0), (3, "tank", 0.1)] {
        let course: Vec<(f64, f64)> = truth.iter().map(|row| (row.time_s, row.values[signal])).collect();
        let kept = swinging_door(&course, deviation);
        lines.extend(kept.iter().map(|(time_s, value)| format!("{name},{time_s:.2},{value}\n")));
        for (time_s, value) in course.iter().filter(|_| signal == 0) {
            let next = kept.partition_point(|point| point.0 <= *time_s).clamp(1, kept.len() - 1);
            let (from, to) = (kept[next - 1], kept[next]);
            let line = from.1 + (to.1 - from.1) * (time_s - from.0) / (to.0 - from.0);
            farthest = farthest.max((line - value).abs() / 100.0);
        }
    }
    (format!("Tag,t [s],Value\n{}", lines.concat()), farthest)
}

const COMPRESSED: &str = "file: {tag_column: Tag, value_column: Value}\nsignals:\n  spool_position: {column: spool, unit: \"%\"}\n  \
                          servomotor_position: {column: servo, unit: \"%\"}\n  tank_pressure: {column: tank, unit: bar}\n  esv: normal\n  \
                          opening_command: {column: cmd, unit: \"%\"";

#[test]
fn what_a_historian_lets_pass_is_asked_and_counts_as_uncertainty_of_the_command() {
    let (text, farthest_pu) = compressed();
    let (_, outcome) = super::super::rows_of(&text, &format!("{COMPRESSED}}}\n")).unwrap();
    assert!(outcome.warnings.iter().any(|warning| warning.contains("`deviation_percent`")), "{:?}", outcome.warnings);
    assert_eq!(outcome.command_deviation_pu, f64::INFINITY);
    assert!(farthest_pu > 0.001 && farthest_pu < 0.003, "{farthest_pu}");
    let stated = format!("{COMPRESSED}, deviation_percent: 0.2}}\n");
    let (_, outcome) = super::super::rows_of(&text, &stated).unwrap();
    assert!(!outcome.warnings.iter().any(|warning| warning.contains("deviation")), "{:?}", outcome.warnings);
    assert_eq!(outcome.command_deviation_pu, 0.002);
    let (_, outcome) =
        super::super::rows_of("t [s],cmd [%]\n0,10\n1,20\n", "signals: {opening_command: {column: cmd}}\n").unwrap();
    assert_eq!(outcome.command_deviation_pu, 0.0);

    let (folder, path) = super::super::file("t.csv", &text);
    let run = |command: &[&str], keys: &str| {
        let map = folder.path().join("map.yaml");
        std::fs::write(&map, keys).unwrap();
        let out = folder.path().join(command[0]);
        let mut program = std::process::Command::new(env!("CARGO_BIN_EXE_govtwin"));
        let output = program
            .args(command)
            .arg(&path)
            .arg("--map")
            .arg(map)
            .arg("--json")
            .arg("--out")
            .arg(out)
            .output()
            .unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let unsaid = format!("{COMPRESSED}}}\n");
    for command in ["diagnose", "fit"] {
        let (code, _, told) = run(&[command], &unsaid);
        assert!(code == Some(1) && told.contains("give `deviation_percent` of `opening_command`"), "{code:?} {told}");
    }
    let (code, _, told) = run(&["replay"], &unsaid);
    assert!(code == Some(3) && told.contains("give `deviation_percent` of `opening_command`"), "{code:?} {told}");
    // Nothing else is named for what the compression has made, and nothing unknown is sure.
    let (code, report, told) = run(&["diagnose"], &stated);
    assert!(code == Some(3) && told.contains("may have been off by 0.20 % of the stroke"), "{code:?} {told}");
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert!(report["effects"].as_array().unwrap().iter().all(|effect| effect["id"] == "backlash"), "{report:#}");
    let unknown = report["ranking"].as_array().unwrap().iter().find(|one| one["id"] == "unknown");
    assert!(unknown.is_none_or(|one| one["probability"].as_f64().unwrap() < 0.9), "{report:#}");
    let (code, _, told) = run(&["accept", "--measure-only"], &stated);
    assert!(code == Some(1) && told.contains("historian"), "{code:?} {told}");
}

#[test]
fn two_levels_are_no_saturation() {
    let mut text = "t [s],cmd [%],servo [%]\n".to_owned();
    for k in 0..2000 {
        let level = if k / 400 % 2 == 0 { 30.0 } else { 60.0 };
        let _ = writeln!(text, "{:.2},{level},{level}", f64::from(k) * 0.01);
    }
    let map = "signals: {servomotor_position: {column: servo}}\n";
    let (_, outcome) = super::super::rows_of(&text, map).unwrap();
    assert!(!outcome.warnings.iter().any(|warning| warning.contains("saturated")), "{:?}", outcome.warnings);
}
