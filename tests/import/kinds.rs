//! Tables that are right and easily read wrong, made from a shipped recording, so that the right values are known: what comes out of the proposed
//! map is the recording, or a clear question.

#[path = "every_kind.rs"]
mod every_kind;
#[path = "formats.rs"]
mod formats;
#[path = "kinds_of_values.rs"]
mod values;

use std::fmt::Write as _;
use std::path::Path;
use std::sync::OnceLock;

use govtwin_bag::import::suggest::{Known, Suggestion, suggest};
use govtwin_bag::import::{ImportError, ImportOutcome, ImportedRow, Target, map_text};
use govtwin_bag::{self as bag, ReadOptions};

use super::{file, rows, shipped};

/// A row of the truth: time from the first, s, then command, servomotor and spool, %, pressure, bar, and whether the ESV is normal.
#[derive(Clone, Copy, Debug)]
struct Truth {
    time_s: f64,
    values: [f64; 4],
    normal: bool,
}

/// The recording every `step` samples.
fn recording(name: &str, step: usize) -> Vec<Truth> {
    let loaded = bag::read(&shipped(name), &ReadOptions::default()).unwrap();
    let frames = loaded.recording.frames.iter().filter(|frame| frame.measured.servomotor_position_pu.is_finite());
    let frames: Vec<_> = frames.step_by(step).take(1000).collect();
    let round = |value: f64, digits: i32| (value * 10_f64.powi(digits)).round() / 10_f64.powi(digits);
    let of = |(k, frame): (usize, &&govtwin_model::frame::Frame)| Truth {
        time_s: k as f64 * step as f64 * 0.01,
        values: [
            round(frame.inputs.opening_command_pu * 100.0, 4),
            round(frame.measured.servomotor_position_pu * 100.0, 4),
            round(frame.measured.spool_position_pu * 100.0, 4),
            round(frame.inputs.tank_pressure_pa / 1e5, 3),
        ],
        normal: frame.inputs.esv == govtwin_model::frame::EsvState::Normal,
    };
    frames.iter().enumerate().map(of).collect()
}

fn rejection() -> &'static [Truth] {
    static ROWS: OnceLock<Vec<Truth>> = OnceLock::new();
    ROWS.get_or_init(|| recording("practice/case_03/load_rejection.mcap", 4))
}

const TARGETS: [Target; 4] =
    [Target::OpeningCommand, Target::ServomotorPosition, Target::SpoolPosition, Target::TankPressure];

/// A wide table of the rows, with a text for each time and each value.
fn wide(
    header: &str,
    rows: &[Truth],
    time: impl Fn(&Truth) -> String,
    cell: impl Fn(f64, usize) -> String,
    between: &str,
) -> String {
    let mut text = format!("{header}\n");
    for row in rows {
        let cells: Vec<String> = row.values.iter().enumerate().map(|(k, value)| cell(*value, k)).collect();
        let _ = writeln!(text, "{}{between}{}", time(row), cells.join(between));
    }
    text
}

fn plain(value: f64, _: usize) -> String {
    value.to_string()
}

const HEADER: &str = "Timestamp,cmd [%],servo [%],spool [%],p tank [bar]";

fn propose(path: &Path) -> Result<Suggestion, ImportError> {
    suggest(path, &Known::default(), &mut |_| ())
}

/// The rows of a table by the map that is proposed for it.
fn by_proposal(text: &str) -> Result<(Vec<ImportedRow>, ImportOutcome, Suggestion), ImportError> {
    let (_folder, path) = file("t.csv", text);
    let proposal = propose(&path)?;
    let map = map_text(&proposal.map, &[], |_| String::new());
    let (rows, outcome) = rows(&[path], &map)?;
    Ok((rows, outcome, proposal))
}

/// The values of a signal with their times from the first row, s.
fn series(rows: &[ImportedRow], target: Target) -> Vec<(f64, f64)> {
    let first_ns = rows.first().map_or(0, |row| row.time_ns);
    let of = |row: &ImportedRow| Some(((row.time_ns - first_ns) as f64 * 1e-9, row.value(target)?));
    rows.iter().filter_map(of).collect()
}

/// Fails where rows are not those of the recording.
#[track_caller]
fn assert_right(what: &str, rows: &[ImportedRow], truth: &[Truth]) {
    for (k, target) in TARGETS.into_iter().enumerate() {
        let found = series(rows, target);
        assert_eq!(found.len(), truth.len(), "{what}: {target:?}");
        let scale = if target.is_pressure() { 1e5 } else { 0.01 };
        for ((time_s, value), truth) in found.iter().zip(truth) {
            let expected = truth.values[k] * scale;
            let near = (value - expected).abs() < 1e-4 * scale * 100.0 && (time_s - truth.time_s).abs() < 2e-3;
            assert!(near, "{what}: {target:?} at {time_s} s: {value}, expected {expected} at {}", truth.time_s);
        }
    }
}

/// The same through the proposed map.
#[track_caller]
fn assert_proposed(what: &str, text: &str, truth: &[Truth]) -> (ImportOutcome, Suggestion) {
    let (rows, outcome, proposal) = by_proposal(text).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_right(what, &rows, truth);
    (outcome, proposal)
}

#[test]
fn every_clock_gives_the_same_times() {
    let at = |row: &Truth, unit_s: f64, zero: i128| (zero + (row.time_s / unit_s).round() as i128).to_string();
    let counted = |header: &str, unit_s: f64, zero: i128| {
        let header = HEADER.replace("Timestamp", header);
        wide(&header, rejection(), |row| at(row, unit_s, zero), plain, ",")
    };
    for (what, header, unit_s, zero) in [
        ("FILETIME", "Timestamp", 1e-7, 134_345_759_000_000_000),
        (".NET ticks", "Timestamp", 1e-7, 639_000_000_000_000_000),
        ("microseconds since 1601", "Timestamp", 1e-6, 13_434_575_900_000_000),
        ("unix ms", "Timestamp", 1e-3, 1_790_102_300_000),
        ("unix us", "Timestamp", 1e-6, 1_790_102_300_000_000),
        ("unix ns", "Timestamp", 1e-9, 1_790_102_300_000_000_000),
        ("ms since boot", "t [ms]", 1e-3, 900_000_000),
        ("us since boot", "t [us]", 1e-6, 4_800_000_000),
        ("us since boot, micro sign", "t [µs]", 1e-6, 400_000_000),
        ("ms in the name", "time_ms", 1e-3, 350_000_000),
        ("uptime in the name", "Uptime (ms)", 1e-3, 2_000_000_000),
        ("ns since boot", "t [ns]", 1e-9, 600_000_000_000),
    ] {
        assert_proposed(what, &counted(header, unit_s, zero), rejection());
    }
    let seconds = |zero: f64| wide(HEADER, rejection(), |row| format!("{:.3}", zero + row.time_s), plain, ",");
    assert_proposed("LabVIEW", &seconds(3_873_000_000.0), rejection());
    assert_proposed("unix s", &seconds(1_790_102_300.0), rejection());
    let boot =
        wide(&HEADER.replace("Timestamp", "t [s]"), rejection(), |row| format!("{:.3}", 5e8 + row.time_s), plain, ",");
    assert_proposed("seconds since boot", &boot, rejection());
}

#[test]
fn counters_that_run_over_go_on() {
    for (what, header, unit_s, zero, range) in [
        ("16 bits of ms", "t [ms]", 1e-3, 60_000_i64, 1_i64 << 16),
        ("32 bits of ms", "t [ms]", 1e-3, (1 << 32) - 20_000, 1 << 32),
        ("32 bits of us", "t [us]", 1e-6, (1 << 32) - 20_000_000, 1 << 32),
        ("16 bits of ms, half way", "t [ms]", 1e-3, 40_000, 1 << 16),
    ] {
        let count = |row: &Truth| ((zero + (row.time_s / unit_s).round() as i64).rem_euclid(range)).to_string();
        let (outcome, _) = assert_proposed(
            what,
            &wide(&HEADER.replace("Timestamp", header), rejection(), count, plain, ","),
            rejection(),
        );
        assert!(outcome.notes.iter().any(|note| note.contains("begins anew")), "{what}: {:?}", outcome.notes);
    }
}

#[test]
fn counts_that_nobody_can_date_are_asked() {
    let counted = |unit_s: f64, zero: f64| {
        wide(HEADER, rejection(), |row| format!("{}", zero + (row.time_s / unit_s).round()), plain, ",")
    };
    for (what, text) in [
        ("ms since boot without a unit", counted(1e-3, 900_000_000.0)),
        ("us since boot without a unit", counted(1e-6, 4_800_000_000.0)),
        ("counts of a tenth of a ms", counted(1e-4, 5_000_000_000.0)),
        ("rows", counted(0.04, 0.0)),
    ] {
        let error = by_proposal(&text).map(|(rows, ..)| rows.len()).unwrap_err().to_string();
        assert!(error.contains("time: {format"), "{what}: {error}");
    }
}

fn iso(row: &Truth) -> String {
    let ms = (row.time_s * 1000.0).round() as i64 + 38 * 60_000 + 20_000;
    format!("2026-09-22T18:{:02}:{:02}.{:03}Z", ms / 60_000 % 60, ms / 1000 % 60, ms % 1000)
}

#[test]
fn rows_of_every_order_are_put_in_the_order_of_time() {
    let mut newest = rejection().to_vec();
    newest.reverse();
    let swapped = [&rejection()[600..], &rejection()[..600]].concat();
    let thirds = [&rejection()[300..600], &rejection()[600..], &rejection()[..300]].concat();
    for (what, order) in [("newest first", &newest), ("two parts", &swapped), ("three parts", &thirds)] {
        assert_proposed(what, &wide(HEADER, order, iso, plain, ","), rejection());
        let relative =
            wide(&HEADER.replace("Timestamp", "t [s]"), order, |row| format!("{:.2}", row.time_s), plain, ",");
        assert_proposed(what, &relative, rejection());
    }
    // Whole seconds of a list whose newest row stands first.
    let cut = |row: &Truth| iso(row)[..19].to_owned() + "Z";
    let (rows, ..) = by_proposal(&wide(HEADER, &newest, cut, plain, ",")).unwrap();
    let found = series(&rows, Target::ServomotorPosition);
    assert!(found.iter().zip(rejection()).all(|(found, truth)| (found.1 - truth.values[1] * 0.01).abs() < 1e-9));
}

/// At its closed stop a servomotor stands still, however far its spool is held closing by a trip: that says nothing of the spool's sign.
#[test]
fn the_spool_of_a_trip_is_not_turned_round() {
    let truth = recording("practice/case_05/shutdown.mcap", 4);
    let header = HEADER.replace("Timestamp", "t [s]") + ",ESV";
    // The state of the ESV stands where it changes.
    let mut last = None;
    let mut text = format!("{header}\n");
    for row in &truth {
        let esv =
            if last.replace(row.normal) == Some(row.normal) { "" } else { ["TRIP", "NORMAL"][usize::from(row.normal)] };
        let values = row.values.map(|value| value.to_string()).join(",");
        let _ = writeln!(text, "{:.2},{values},{esv}", row.time_s);
    }
    let (_folder, path) = file("t.csv", &text);
    let proposal = propose(&path).unwrap();
    assert!(proposal.open.is_empty(), "{:?}", proposal.open);
    let (rows, outcome) = rows(&[path], &map_text(&proposal.map, &[], |_| String::new())).unwrap();
    assert_right("shutdown", &rows, &truth);
    assert!(outcome.warnings.is_empty(), "{:?}", outcome.warnings);
    let normal = |row: &ImportedRow| row.value(Target::Esv).map(|state| state > 0.5);
    let told: Vec<(i64, bool)> = rows.iter().filter_map(|row| Some((row.time_ns, normal(row)?))).collect();
    let trip = truth.iter().find(|row| !row.normal).unwrap();
    let first = told.iter().find(|(_, normal)| !normal).unwrap();
    assert!(((first.0 - rows[0].time_ns) as f64 * 1e-9 - trip.time_s).abs() < 2e-3, "{told:?}");
}

#[test]
fn a_trip_that_stays_stays_from_its_own_time_on() {
    let mut text = "t [s],cmd [%],servo [%],TRIP\n".to_owned();
    let line = |k: i64| format!("{}.0,50,{},{}\n", k, 50 - k, i64::from((10..12).contains(&k)));
    (0..30).rev().for_each(|k| text.push_str(&line(k)));
    let map = "signals: {opening_command: {column: cmd}, servomotor_position: {column: servo}, esv: {column: TRIP, shutdown: 1, latch: true}}\n";
    let (rows, _) = super::rows_of(&text, map).unwrap();
    let first = rows.iter().find(|row| row.value(Target::Esv) == Some(0.0)).unwrap();
    assert_eq!(first.time_ns, 10_000_000_000);
    assert!(rows.iter().filter(|row| row.time_ns >= 10_000_000_000).all(|row| row.value(Target::Esv) != Some(1.0)));
}

#[test]
fn times_that_would_be_mixed_up_are_asked() {
    let twice = [&rejection()[..700], &rejection()[200..]].concat();
    let at = |minute: &'static str| move |row: &Truth| iso(row).replace("T18:38", minute).replace("T18:39", minute);
    let hour = |rows: &[Truth], minute: &'static str| wide("", rows, at(minute), plain, ",").trim_start().to_owned();
    for (what, text) in [
        (
            "a counter that was reset",
            wide(&HEADER.replace("Timestamp", "t [s]"), &twice, |row| format!("{:.2}", row.time_s), plain, ","),
        ),
        ("two recordings", wide(HEADER, &twice, iso, plain, ",")),
        ("the end of summer time", {
            let head = HEADER.to_owned() + "\n";
            head + &hour(&rejection()[..500], "T02:00")
                + &hour(&rejection()[..500], "T02:59")
                + &hour(&rejection()[..500], "T02:00")
        }),
    ] {
        let error = by_proposal(&text).map(|(rows, ..)| rows.len()).unwrap_err().to_string();
        assert!(error.contains("time goes back") && error.contains("split the file"), "{what}: {error}");
    }
}

const TAGS: [&str; 4] = ["U3.GOV.Y_CMD.PV", "U3.GOV.Y_SERVO.PV", "U3.GOV.SPOOL.PV", "U3.GOV.P_TANK.PV"];

/// One value a line: tags that stand in `order`, each with all its rows or row by row.
fn tall(header: &str, by_tag: bool, line: impl Fn(&str, &Truth, f64) -> String) -> String {
    let mut text = format!("{header}\n");
    let mut add = |tag: usize, row: &Truth| {
        let _ = writeln!(text, "{}", line(TAGS[tag], row, row.values[tag]));
    };
    if by_tag {
        (0..4).for_each(|tag| rejection().iter().for_each(|row| add(tag, row)));
    } else {
        rejection().iter().for_each(|row| (0..4).for_each(|tag| add(tag, row)));
    }
    text
}

#[test]
fn tables_with_one_value_a_line_are_read_in_any_order() {
    let units = ["%", "%", "%", "bar"];
    let unit = |tag: &str| units[TAGS.iter().position(|known| *known == tag).unwrap()];
    for by_tag in [true, false] {
        let historian = tall("Tag,Timestamp,Value,Unit", by_tag, |tag, row, value| {
            format!("{tag},{},{value},{}", iso(row), unit(tag))
        });
        assert_proposed("historian", &historian, rejection());
        let series = tall("Series;Time;Value;Unit", by_tag, |tag, row, value| {
            format!("{tag};{};{value};{}", iso(row), unit(tag))
        });
        assert_proposed("series", &series, rejection());
        let quality = tall("TagName,Time,Value,Quality,Unit", by_tag, |tag, row, value| {
            format!("{tag},{},{value},Good,{}", iso(row), unit(tag))
        });
        assert_proposed("with quality", &quality, rejection());
    }
}

#[test]
fn each_column_has_the_times_beside_it() {
    // Each pair has its own times: every signal is shifted by another part of a sample, and the last pairs are shorter.
    let shifts = [0.0, 0.003, 0.007, 0.011];
    for (header, twice) in [
        ("Time [s],cmd [%],Time [s],servo [%],Time [s],spool [%],Time [s],p tank [bar]", false),
        ("Time,cmd [%],Time,servo [%],Time,spool [%],Time,p tank [bar]", false),
        ("Timestamp,cmd [%],Timestamp,servo [%],Timestamp,spool [%],Timestamp,p tank [bar]", true),
    ] {
        let mut text = format!("{header}\n");
        for (k, row) in rejection().iter().enumerate() {
            let pair = |signal: usize| {
                let time_s = row.time_s + shifts[signal];
                let time = if twice { iso(&Truth { time_s, ..*row }) } else { format!("{time_s:.3}") };
                if signal == 3 && k >= 900 { ",".to_owned() } else { format!("{time},{}", row.values[signal]) }
            };
            let _ = writeln!(text, "{}", (0..4).map(pair).collect::<Vec<_>>().join(","));
        }
        let (rows, ..) = by_proposal(&text).unwrap_or_else(|error| panic!("{header}: {error}"));
        for (k, target) in TARGETS.into_iter().enumerate() {
            let found = series(&rows, target);
            let scale = if target.is_pressure() { 1e5 } else { 0.01 };
            assert_eq!(found.len(), if k == 3 { 900 } else { 1000 }, "{header}: {target:?}");
            for ((time_s, value), truth) in found.iter().zip(rejection()) {
                assert!((time_s - truth.time_s - shifts[k]).abs() < 2e-3, "{header}: {target:?}: {time_s} {truth:?}");
                assert!((value - truth.values[k] * scale).abs() < 1e-6 * scale, "{header}: {target:?}");
            }
        }
        // A map that gives one column of times for all is not believed.
        let (_folder, path) = file("t.csv", &text);
        let error = super::rows(&[path], "time: {column: \"#1\"}\nsignals: {servomotor_position: {column: \"#4\"}}\n")
            .unwrap_err();
        assert!(error.to_string().contains("time: \"#3\""), "{error}");
    }
}
