//! Tables that are right and easily read wrong, made from a shipped recording, so that the right values are known: what comes out of the proposed
//! map is the recording, or a clear question.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::OnceLock;

use govtwin_bag::import::suggest::{Suggestion, suggest};
use govtwin_bag::import::{ImportError, ImportOutcome, ImportedRow, Map, Target, map_text};
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
    suggest(path, &Map::default(), &mut |_| ())
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
    // A column that may be a quality, and does not say which of its states is good, is asked about.
    let mut text = "t [s],cmd [%],servo [%],servo quality\n".to_owned();
    for (k, row) in rejection().iter().enumerate() {
        let _ = writeln!(text, "{:.2},{},{},{}", row.time_s, row.values[0], row.values[1], if bad(k) { 3 } else { 7 });
    }
    let (_, outcome, _) = by_proposal(&text).unwrap();
    assert!(outcome.warnings.iter().any(|warning| warning.contains("quality:")), "{:?}", outcome.warnings);
    let map = "signals: {servomotor_position: {column: servo, quality: servo quality, good: [7]}}\n";
    let (rows, _) = super::rows_of(&text, map).unwrap();
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
    let (rows, outcome) = super::rows_of(&text, map).unwrap();
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
    let (rows, outcome) = super::rows_of(&text, map).unwrap();
    let found = series(&rows, Target::OpeningCommand);
    assert!(found.len() > 1000, "{:?}", outcome.notes);
    assert!(found.iter().all(|(time_s, value)| (value * 100.0 - command(*time_s)).abs() < 0.1));
    assert_eq!(series(&rows, Target::ServomotorPosition).len(), 10, "what is measured stays where it was");
    // Resampled, as a map may ask for, it runs straight as well.
    let (rows, _) = super::rows_of(&text, &format!("resample: {{rate_hz: 50}}\n{map}")).unwrap();
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
    let (rows, _) = super::rows_of(&format!("{steps}{servo}"), map).unwrap();
    assert_eq!(series(&rows, Target::OpeningCommand).len(), 4);
    // Where nothing shows it, it is asked.
    let (_, outcome) = super::rows_of(
        &steps,
        "file: {tag_column: Tag, value_column: Value}\nsignals:\n  opening_command: {column: U3.Y_CMD, unit: \"%\"}\n",
    )
    .unwrap();
    assert!(outcome.warnings.iter().any(|warning| warning.contains("between: line")), "{:?}", outcome.warnings);
}

#[test]
fn two_levels_are_no_saturation() {
    let mut text = "t [s],cmd [%],servo [%]\n".to_owned();
    for k in 0..2000 {
        let level = if k / 400 % 2 == 0 { 30.0 } else { 60.0 };
        let _ = writeln!(text, "{:.2},{level},{level}", f64::from(k) * 0.01);
    }
    let map = "signals: {servomotor_position: {column: servo}}\n";
    let (_, outcome) = super::rows_of(&text, map).unwrap();
    assert!(!outcome.warnings.iter().any(|warning| warning.contains("saturated")), "{:?}", outcome.warnings);
}

#[test]
fn formats_that_are_not_read_are_named_with_the_way_out() {
    for (bytes, words) in
        [(&b"MDF     4.10    asammdf "[..], "MDF"), (b"--- file type: CFG ---\r\nSTATION,1,1999\r\n", "COMTRADE")]
    {
        let (_folder, path) = file("t.dat", bytes);
        let error = propose(&path).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("CSV"), "{error}");
    }
}
