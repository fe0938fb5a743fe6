//! A table by kind of what is easily read wrong: each case is made here, and is read right, asked about, or refused; none is wrong without a word.

#[path = "every_kind_of_time.rs"]
mod of_time;
#[path = "every_kind_of_value.rs"]
mod of_value;

use std::collections::BTreeMap;

use super::formats::influx;
use super::*;

/// What must become of a case.
#[derive(Clone, Copy, Debug)]
enum Expected {
    /// The right values.
    Right,
    /// The right values but of those that are not good, which are left out.
    Rest,
    /// The right values, of some signals half as many.
    Half,
    /// A question or warning with these words.
    Asked(&'static str),
    /// An error with these words.
    Refused(&'static str),
}
use Expected::{Asked, Half, Refused, Rest, Right};

struct Case {
    kind: &'static str,
    name: String,
    text: String,
    /// Of tables for which a map is not proposed.
    map: Option<&'static str>,
    expected: Expected,
}

#[derive(Default)]
struct Cases(Vec<Case>);

impl Cases {
    fn add(&mut self, kind: &'static str, name: impl Into<String>, text: String, expected: Expected) {
        self.0.push(Case { kind, name: name.into(), text, map: None, expected });
    }

    fn by_map(&mut self, kind: &'static str, name: &str, text: String, map: &'static str, expected: Expected) {
        self.0.push(Case { kind, name: name.to_owned(), text, map: Some(map), expected });
    }
}

/// Rows, and everything that was said.
fn outcome(case: &Case) -> Result<(Vec<ImportedRow>, String), ImportError> {
    match case.map {
        None => by_proposal(&case.text)
            .map(|(rows, outcome, proposal)| (rows, [proposal.open, outcome.warnings].concat().join("\n"))),
        Some(map) => {
            let (_folder, path) = file("t.csv", &case.text);
            rows(&[path], map).map(|(rows, outcome)| (rows, outcome.warnings.join("\n")))
        }
    }
}

/// Whether each value is that of the recording at its time, and hardly one is missing.
fn is_right(rows: &[ImportedRow], fewest: usize) -> Result<(), String> {
    for (k, target) in TARGETS.into_iter().enumerate() {
        let found = series(rows, target);
        let scale = if target.is_pressure() { 1e5 } else { 0.01 };
        if found.len() < fewest || found.len() > rejection().len() {
            return Err(format!("{target:?}: {} samples", found.len()));
        }
        for (time_s, value) in found {
            let truth = rejection().get((time_s / 0.04).round() as usize).ok_or(format!("a row at {time_s} s"))?;
            let expected = truth.values[k] * scale;
            if (value - expected).abs() > 0.02 * scale || (time_s - truth.time_s).abs() > 4e-3 {
                return Err(format!("{target:?} at {time_s} s: {value}, expected {expected}"));
            }
        }
    }
    Ok(())
}

const NAMES: [&str; 4] = ["Y_CMD", "Y_POS", "SPOOL", "OILP"];
const UNITS: [&str; 4] = ["%", "%", "%", "bar"];

fn seconds(row: &Truth) -> String {
    format!("{:.2}", row.time_s)
}

/// A table with seconds in the first column.
fn timed(header: &str, cell: impl Fn(f64, usize) -> String, between: &str) -> String {
    let header = if header.contains(';') { header.to_owned() } else { header.replace(',', between) };
    wide(&header, rejection(), seconds, cell, between)
}

fn senders(cases: &mut Cases) {
    const KIND: &str = "sender or machine";
    let other = recording("practice/case_05/load_rejection.mcap", 4);
    let two = |one: &dyn Fn(&str) -> String, two: &dyn Fn(&str) -> String| {
        let names = |name: &dyn Fn(&str) -> String| {
            NAMES.iter().zip(UNITS).map(|(of, unit)| format!("{} [{unit}]", name(of))).collect::<Vec<_>>().join(",")
        };
        let mut text = format!("Time,{},{}\n", names(one), names(two));
        for (one, two) in rejection().iter().zip(&other) {
            let cells: Vec<String> = one.values.iter().chain(&two.values).map(f64::to_string).collect();
            let _ = writeln!(text, "{},{}", iso(one), cells.join(","));
        }
        text
    };
    cases.add(KIND, "numbers before", two(&|name| format!("U3_{name}"), &|name| format!("U5_{name}")), Right);
    cases.add(KIND, "numbers behind", two(&|name| format!("{name}_3"), &|name| format!("{name}_5")), Right);
    cases.add(KIND, "a number of the second alone", two(&str::to_owned, &|name| format!("{name}_2")), Right);
    cases.add(KIND, "paths", two(&|name| format!("/P/U3/GOV/{name}"), &|name| format!("/P/U5/GOV/{name}")), Right);
    cases.add(KIND, "words", two(&|name| format!("{name} north"), &|name| format!("{name} south")), Right);
    cases.add(KIND, "nameless others", two(&str::to_owned, &|name| format!("AI{}", name.len() + 12)), Right);
    let mut tall = "Tag,Timestamp,Value,Unit\n".to_owned();
    let (mut numbered, mut unit_column) = (
        "Unit_No,Tag,Timestamp,Value\n".to_owned(),
        "Unit,Timestamp,Y_CMD [%],Y_POS [%],SPOOL [%],OILP [bar]\n".to_owned(),
    );
    let mut by_turns = String::from("Machine,t [s],Y_CMD [%],Y_POS [%],SPOOL [%],OILP [bar]\n");
    for (unit, rows, shift_s) in [(3, rejection(), 0.0), (5, &other[..], 300.0)] {
        for row in rows {
            for (k, name) in NAMES.iter().enumerate() {
                let _ = writeln!(tall, "U{unit}.{name},{},{},{}", iso(row), row.values[k], UNITS[k]);
                let _ = writeln!(numbered, "{unit},{name} [{}],{},{}", UNITS[k], iso(row), row.values[k]);
            }
            let cells = row.values.map(|value| value.to_string()).join(",");
            let _ = writeln!(unit_column, "U{unit},{},{cells}", iso(row));
            let _ = writeln!(by_turns, "{unit},{:.2},{cells}", row.time_s + shift_s);
        }
    }
    cases.add(KIND, "tags", tall, Right);
    cases.add(KIND, "a column of machines beside tags", numbered, Refused("`Unit_No` says `3`, `5`"));
    cases.add(KIND, "a column of machines beside rows", unit_column, Refused("`Unit` says `U3`, `U5`"));
    cases.add(KIND, "one machine after the other", by_turns, Refused("`Machine` says `3`, `5`"));
    let mut by_station = String::from("Station,Time,Y_CMD [%],Y_POS [%],SPOOL [%],OILP [bar]\n");
    let mut one_name = String::from("name,time,Y_CMD [%],Y_POS [%],SPOOL [%],OILP [bar]\n");
    let mut two_names = String::from("Time,U5_Y_CMD [%],U3_Y_POS [%],U3_SPOOL [%],U3_OILP [bar]\n");
    for (one, two) in rejection().iter().zip(&other) {
        for (station, row) in [("Ybbs", one), ("Melk", two)] {
            let _ =
                writeln!(by_station, "{station},{},{}", iso(row), row.values.map(|value| value.to_string()).join(","));
        }
        let cells = one.values.map(|value| value.to_string());
        let _ = writeln!(one_name, "governor,{},{}", iso(one), cells.join(","));
        let _ = writeln!(two_names, "{},{},{}", iso(one), two.values[0], cells[1..].join(","));
    }
    cases.add(KIND, "a column of stations beside rows", by_station, Refused("`Station` says `Ybbs`, `Melk`"));
    for (name, states, expected) in [
        ("Nr", ["1", "2"], Refused("`Nr` says `1`, `2` by turns")),
        ("No.", ["0", "1"], Refused("`No.` says `0`, `1` by turns")),
        ("Anlage", ["nord", "süd"], Refused("`Anlage` says `nord`, `süd` by turns")),
        ("Nr", ["", ""], Right),
    ] {
        let mut text = format!("{name},Time,Y_CMD [%],Y_POS [%],SPOOL [%],OILP [bar]\n");
        for (k, (one, two)) in rejection().iter().zip(&other).enumerate() {
            for (state, row) in states.iter().zip([one, two]).take(if states[0].is_empty() { 1 } else { 2 }) {
                let number = if state.is_empty() { (k + 1).to_string() } else { (*state).to_owned() };
                let _ = writeln!(text, "{number},{},{}", iso(row), row.values.map(|value| value.to_string()).join(","));
            }
        }
        cases.add(KIND, format!("{name} {states:?} beside rows"), text, expected);
    }
    for (name, states, expected) in [
        ("Nr", ["MS1", "MS2"], Refused("`Nr` says `MS1`, `MS2`")),
        ("Einheit", ["A", "B"], Refused("`Einheit` says `A`, `B`")),
        ("Gruppe", ["1", "2"], Refused("`Gruppe` says `1`, `2`")),
        ("Unit", ["U3", "u03"], Right),
    ] {
        let mut text = format!("{name},Time,Y_CMD [%],Y_POS [%],SPOOL [%],OILP [bar]\n");
        let half = rejection().len() / 2;
        for (k, row) in rejection().iter().enumerate() {
            let state = states[usize::from(k >= half)];
            let _ = writeln!(text, "{state},{},{}", iso(row), row.values.map(|value| value.to_string()).join(","));
        }
        cases.add(KIND, format!("{name} {states:?} one after the other"), text, expected);
    }
    let mut again = String::from("Time,Y_CMD [%],Y_POS [%],SPOOL [%],OILP [bar]\n");
    let mut other_units = again.clone();
    for (k, row) in rejection().iter().enumerate() {
        if k == rejection().len() / 2 {
            again.push_str("Time,Y_CMD [%],Y_POS [%],SPOOL [%],OILP [bar]\n");
            other_units.push_str("Time,Y_CMD [%],Y_POS [%],SPOOL [%],OILP [MPa]\n");
        }
        for text in [&mut again, &mut other_units] {
            let _ = writeln!(text, "{},{}", iso(row), row.values.map(|value| value.to_string()).join(","));
        }
    }
    cases.add(KIND, "the header once more", again, Right);
    cases.add(KIND, "a second header of other units", other_units, Refused("a second header names column 5"));
    cases.add(KIND, "a column of one name beside rows", one_name, Right);
    cases.add(KIND, "a command of another number", two_names, Asked("of two machines"));
    // Tags whose last part says what of a signal they are.
    let no_command = Asked("opening_command: no column found");
    for (name, tags, expected) in [
        ("set point and process value", ["Y.SP", "Y.PV", "HSV.PV", "P_OIL.PV"], Right),
        ("output and process value", ["GATE.OP", "GATE.PV", "MDV.PV", "TANKP.PV"], no_command),
        ("three parts", ["U3.Y.SP", "U3.Y.PV", "U3.SPOOL.PV", "U3.OILP.PV"], Right),
        ("demand and position", ["U1:GV:DMD", "U1:GV:POS", "U1:MDV:POS", "U1:HPU:PRES"], Right),
    ] {
        let mut text = "Tag,Timestamp,Value\n".to_owned();
        for row in rejection() {
            for (tag, value) in tags.iter().zip(row.values) {
                let _ = writeln!(text, "{tag},{},{value}", iso(row));
            }
        }
        cases.add(KIND, format!("tags of {name}"), text, expected);
    }
    let columns = NAMES.map(|name| format!("{name}_NUMERICID,{name}_VALUE,{name}_TIMESTAMP,{name}_QUALITY")).join(",");
    let values = |row: &Truth| {
        let cell = |(k, value): (usize, &f64)| format!("{k},{value},{},192", iso(row));
        row.values.iter().enumerate().map(cell).collect::<Vec<_>>().join(",")
    };
    let logged: Vec<String> = rejection().iter().map(values).collect();
    cases.add(KIND, "number, value, time and quality of each", format!("{columns}\n{}\n", logged.join("\n")), Right);
    // One value a line, of a signal that has a number beside its name, or nothing else.
    for (name, header, tag, expected) in [
        (
            "name and number",
            "_NAME,_NUMERICID,_VALUE,_TIMESTAMP,_QUALITY",
            &|k: usize| format!("{},{k}", NAMES[k]),
            Right,
        ),
        (
            "number alone",
            "id,value,time,quality",
            &|k: usize| (k + 101).to_string(),
            Asked("opening_command: no column found"),
        ),
        (
            "index alone",
            "TagIndex,Val,DateAndTime,Status",
            &|k: usize| k.to_string(),
            Asked("opening_command: no column found"),
        ),
    ] as [(&str, &str, &dyn Fn(usize) -> String, Expected); 3]
    {
        let line = |row: &Truth| {
            let of = |k: usize| format!("{},{},{},192\n", tag(k), row.values[k], iso(row));
            (0..row.values.len()).map(of).collect::<String>()
        };
        let lines: String = rejection().iter().map(line).collect();
        cases.add(KIND, format!("lines of {name}"), format!("{header}\n{lines}"), expected);
    }
    cases.add(KIND, "series of a database", influx(&[("U3", rejection()), ("U5", &other)], true), Right);
}

fn numbers(cases: &mut Cases) {
    const KIND: &str = "number or unit";
    let header = HEADER.replace("Timestamp", "t [s]");
    for sign in
        ["\u{2212}", "\u{2013}", "\u{2014}", "\u{2012}", "\u{2010}", "\u{ff0d}", "\u{fe63}", "\u{2796}", "\u{ad}"]
    {
        let cell = |value: f64, _: usize| format!("{}{:.4}", if value < 0.0 { sign } else { "" }, value.abs());
        cases.add(
            KIND,
            format!("minus U+{:04X}", sign.chars().next().unwrap() as u32),
            timed(&header, cell, ","),
            Right,
        );
    }
    let kpa = header.replace("bar", "kPa");
    let grouped = |value: f64, k: usize, group: &str, decimal: &str| {
        if k < 3 {
            return format!("{value:.4}").replace('.', decimal);
        }
        let text = format!("{:.1}", value * 100.0);
        format!("{}{group}{}", &text[..1], &text[1..])
            .replace('.', if group == "." { "#" } else { "." })
            .replace('#', ".")
    };
    for (name, group, decimal) in [
        ("narrow blanks", "\u{202f}", "."),
        ("apostrophes", "'", "."),
        ("curly apostrophes", "\u{2019}", "."),
        ("commas", ",", "."),
    ] {
        cases.add(KIND, name, timed(&kpa, |value, k| grouped(value, k, group, decimal), ";"), Right);
    }
    let german = |value: f64, k: usize| {
        let text = format!("{:.1}", value * 100.0);
        if k < 3 {
            format!("{value:.4}").replace('.', ",")
        } else {
            format!("{}.{}", &text[..1], text[1..].replace('.', ","))
        }
    };
    let comma_times = timed(&kpa, german, ";");
    let comma_times = comma_times
        .lines()
        .map(|line| line.split_once(';').unwrap())
        .map(|(time, rest)| format!("{};{rest}\n", time.replace('.', ",")));
    cases.add(KIND, "points between groups", comma_times.collect(), Right);
    let whole = |value: f64, k: usize| {
        if k < 3 {
            value.to_string()
        } else {
            format!("{},{:03}", (value * 100.0) as u32 / 1000, (value * 100.0) as u32 % 1000)
        }
    };
    cases.add(KIND, "groups that may be decimals", timed(&kpa, whole, ";"), Asked("thousands"));
    for (name, header) in [
        ("units behind blanks", "t s;cmd %;servo %;spool %;p tank bar"),
        ("units behind commas", "t, s;cmd, %;servo, %;spool, %;p tank, bar"),
        ("units behind a word", "t in s;cmd in %;servo in %;spool in %;p tank in bar"),
        ("units behind strokes", "t / s;cmd / %;servo / %;spool / %;p tank / bar"),
        ("units in names", "t_s;cmd_pct;servo_pct;spool_pct;tank_bar"),
    ] {
        cases.add(KIND, name, timed(header, plain, ";"), Right);
    }
    for (name, header) in [
        ("kPa behind a blank", "t [s];cmd %;servo %;spool %;p kPa"),
        ("kPa behind a line", "t_s;SP_pct;FB_pct;DV_pct;P_kPa"),
    ] {
        let cell = |value: f64, k: usize| if k < 3 { value.to_string() } else { format!("{:.1}", value * 100.0) };
        cases.add(KIND, name, timed(header, cell, ";"), Right);
    }
    for (unit, in_bar) in
        [("kp/cm²", 0.980_665), ("N/mm²", 10.0), ("psi(g)", 0.068_947_572_93), ("bar(ü)", 1.0), ("mH2O", 0.098_066_5)]
    {
        let cell = |value: f64, k: usize| if k < 3 { value.to_string() } else { format!("{:.4}", value / in_bar) };
        cases.add(KIND, format!("pressure in {unit}"), timed(&header.replace("bar", unit), cell, ","), Right);
    }
    cases.add(
        KIND,
        "absolute pressure",
        timed(
            &header.replace("bar", "bar abs."),
            |value, k| (value + if k < 3 { 0.0 } else { 1.01325 }).to_string(),
            ",",
        ),
        Right,
    );
    cases.add(
        KIND,
        "pressure in no known unit",
        timed(&header.replace("bar", "Torrs"), plain, ","),
        Asked("its unit `Torrs` is not known"),
    );
    let quoted = timed(&header, |value, _| format!("\"{value:.4}\"").replace('.', ","), ",");
    cases.add(
        KIND,
        "decimal commas in quotes",
        quoted
            .lines()
            .map(|line| line.replacen('.', "", usize::from(line.starts_with(char::is_alphabetic))) + "\n")
            .map(|line| {
                let (time, rest) = line.split_once(',').unwrap();
                if time.contains('.') { format!("\"{}\",{rest}", time.replace('.', ",")) } else { line.clone() }
            })
            .collect(),
        Right,
    );
    cases.add(
        KIND,
        "formulas of a spreadsheet",
        timed(&header, |value, _| format!("\"=\"\"{value}\"\"\""), ","),
        Right,
    );
    cases.add(KIND, "exponents of Fortran", timed(&header, |value, _| format!("{:.8}D+02", value / 100.0), ","), Right);
    cases.add(KIND, "lines that end with a return", timed(&header, plain, ",").replace('\n', "\r"), Right);
    cases.add(
        KIND,
        "marks behind numbers",
        timed(&header, |value, k| if k == 3 { format!("{value}*") } else { value.to_string() }, ","),
        Asked("are no numbers"),
    );
    cases.add(
        KIND,
        "units in cells",
        wide(
            "Time,Command,Gate servo,Spool,Oil pressure tank",
            rejection(),
            |row| format!("{:.2}s", row.time_s),
            |value, k| format!("{value} {}", UNITS[k]),
            ",",
        ),
        Right,
    );
    cases.add(
        KIND,
        "other digits",
        timed(
            &header,
            |value, k| {
                let text = value.to_string();
                if k < 2 || k == 3 {
                    text
                } else {
                    text.chars()
                        .map(|letter| {
                            letter.to_digit(10).and_then(|digit| char::from_u32(0x660 + digit)).unwrap_or(letter)
                        })
                        .collect()
                }
            },
            ",",
        ),
        Asked("are no numbers"),
    );
}

#[test]
fn nothing_is_read_wrong_without_a_word() {
    let mut cases = Cases::default();
    for add in [
        senders,
        of_time::times,
        of_time::units_and_zones,
        numbers,
        of_value::meanings,
        of_value::qualities,
        of_value::currents,
        of_value::units,
        of_value::several_units,
        of_value::formats,
        of_value::impossible,
    ] {
        add(&mut cases);
    }
    let mut table: BTreeMap<&str, [usize; 4]> = BTreeMap::new();
    let mut wrong = vec![];
    for case in &cases.0 {
        let found = outcome(case);
        // What is right is so, whatever is said; other values without the words that were expected are silent.
        let verdict = match (&found, case.expected) {
            (Ok((rows, _)), Right | Rest | Half) => {
                let fewest = match case.expected {
                    Right => rejection().len(),
                    Rest => rejection().len() - 50,
                    _ => rejection().len() / 2,
                };
                is_right(rows, fewest).map(|()| 0)
            }
            (Ok((_, said)), Asked(words)) if said.contains(words) => Ok(1),
            (Ok((_, said)), expected) => Err(format!("expected {expected:?}, said: {said}")),
            (Err(error), Refused(words)) if error.to_string().contains(words) => Ok(2),
            (Err(error), expected) => Err(format!("expected {expected:?}, refused: {error}")),
        };
        table.entry(case.kind).or_default()[*verdict.as_ref().unwrap_or(&3)] += 1;
        wrong.extend(verdict.err().map(|problem| format!("{}, {}: {problem}", case.kind, case.name)));
    }
    println!("{:<20} {:>6} {:>6} {:>8} {:>7}", "kind", "right", "asked", "refused", "silent");
    for (kind, counts) in &table {
        println!("{kind:<20} {:>6} {:>6} {:>8} {:>7}", counts[0], counts[1], counts[2], counts[3]);
    }
    assert!(wrong.is_empty(), "{} of {} cases:\n{}", wrong.len(), cases.0.len(), wrong.join("\n"));
}
