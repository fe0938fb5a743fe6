//! What is found in data while they pass: gaps, frozen and saturated channels, units and signs that cannot be meant.

use super::rows_of;

/// Values of command, spool, servomotor and pressure at a time, s; and a column name, which may hold a unit.
struct Table<'a> {
    header: &'a str,
    line: &'a dyn Fn(f64) -> Vec<f64>,
    /// Whether a row of this number is there.
    has: &'a dyn Fn(i64) -> bool,
}

fn text(table: &Table<'_>) -> String {
    let mut text = format!("{}\n", table.header);
    for k in (0..3000).filter(|k| (table.has)(*k)) {
        let time_s = k as f64 * 0.01;
        let values: Vec<String> = (table.line)(time_s).iter().map(f64::to_string).collect();
        text.push_str(&format!("{time_s},{}\n", values.join(",")));
    }
    text
}

/// A unit at work: command, spool, servomotor in pu, pressure in Pa, each with a little that changes from row to row.
fn unit(time_s: f64) -> [f64; 4] {
    let rough = (1e4 * time_s).sin();
    let y = 0.5 - 0.3 * time_s.cos();
    [y + 0.01 * time_s.sin() + 1e-5 * rough, 0.9 * time_s.sin() + 1e-4 * rough, y + 1e-5 * rough, 6.3e6 + 1e3 * rough]
}

const MAP: &str =
    "signals: {opening_command: c, spool_position: u, servomotor_position: y, tank_pressure: {column: p, unit: Pa}}\n";
const HEADER: &str = "t,c,u,y,p";

fn warnings(line: &dyn Fn(f64) -> Vec<f64>, map: &str) -> String {
    warnings_of(&Table { header: HEADER, line, has: &|_| true }, map)
}

fn warnings_of(table: &Table<'_>, map: &str) -> String {
    rows_of(text(table), map).unwrap().1.warnings.join("\n")
}

#[test]
fn a_sound_unit_passes_without_a_word() {
    assert_eq!(warnings(&|t| unit(t).to_vec(), MAP), "");
}

#[test]
fn frozen_dead_and_saturated_channels_are_told() {
    let frozen = warnings(
        &|t| {
            let mut values = unit(t);
            values[2] = unit(if (10.0..15.0).contains(&t) { 10.0 } else { t })[2];
            values.to_vec()
        },
        MAP,
    );
    assert!(frozen.contains("servomotor_position (`y`): frozen at 0.75") && frozen.contains("for 5.0 s"), "{frozen}");
    assert!(frozen.contains("unless the unit was at rest"), "{frozen}");
    let dead = warnings(&|t| [unit(t)[0], 0.0, unit(t)[2], unit(t)[3]].to_vec(), MAP);
    assert!(dead.contains("spool_position (`u`): stands at 0 pu throughout while the unit moves"), "{dead}");
    let saturated = warnings(&|t| [unit(t)[0], unit(t)[1].min(0.5), unit(t)[2], unit(t)[3]].to_vec(), MAP);
    assert!(saturated.contains("spool_position (`u`): stands at its most of 0.5 pu"), "{saturated}");
}

#[test]
fn gaps_are_counted_and_placed_and_nothing_is_filled_in() {
    let table = Table { header: HEADER, line: &|t| unit(t).to_vec(), has: &|k| !(1000..1150).contains(&k) };
    let said = warnings_of(&table, MAP);
    assert!(
        said.contains(
            "1 gaps of more than 5 intervals, the longest 1.510 s, 10.0 s after its beginning; nothing is filled in"
        ),
        "{said}"
    );
    assert_eq!(rows_of(text(&table), MAP).unwrap().0.len(), 2850);
}

#[test]
fn units_that_cannot_be_meant_come_with_the_likely_one() {
    let scaled = |scales: [f64; 4]| {
        move |t: f64| unit(t).iter().zip(scales).map(|(value, scale)| value * scale).collect::<Vec<f64>>()
    };
    for (scales, map, words) in [
        ([1.0, 1.0, 1.0, 1e-5], MAP, "tank_pressure (`p`): reaches 63.0100 Pa, expected 5.0e5 to 5.0e7 Pa"),
        ([1.0, 1.0, 1.0, 1e-5], MAP, "is it in bar? then give `unit: bar`"),
        ([1.0, 1.0, 1.0, 1e-6], MAP, "is it in MPa? then give `unit: MPa`"),
        ([1.0, 1.0, 100.0, 1.0], MAP, "servomotor_position (`y`): runs from 19.99"),
        ([1.0, 1.0, 100.0, 1.0], MAP, "is it in percent? then give `unit: \"%\"`"),
        ([1.0, 15.0, 600.0, 1.0], MAP, "give `range: [value when closed, value when open]` in the file's own unit"),
    ] {
        let said = warnings(&scaled(scales), map);
        assert!(said.contains(words), "{words}\n{said}");
    }
    // A share that the map takes for a percentage.
    let percent = MAP.replace("servomotor_position: y", "servomotor_position: {column: y, unit: '%'}");
    let said = warnings(&|t| unit(t).to_vec(), &percent);
    assert!(said.contains("is it in pu? then give `unit: pu`"), "{said}");
    // Pa in the file, bar in the map.
    let bar = MAP.replace("unit: Pa", "unit: bar");
    let said = warnings(&|t| unit(t).to_vec(), &bar);
    assert!(said.contains("is it in Pa? then give `unit: Pa`"), "{said}");
    // The header knows better than the map.
    let table = Table { header: "t,c,u,y,p [bar]", line: &|t| unit(t).to_vec(), has: &|_| true };
    let said = warnings_of(&table, MAP);
    assert!(said.contains("tank_pressure: its header says `bar`, the map `pa`; the map counts"), "{said}");
    // Millimetres without a range.
    let table = Table { header: "t,c,u,y [mm],p", line: &scaled([1.0, 1.0, 600.0, 1.0]), has: &|_| true };
    let said = warnings_of(&table, MAP);
    assert!(said.contains("servomotor_position: its header says `mm`, and the map neither a `unit`"), "{said}");
}

#[test]
fn signals_that_go_against_each_other_are_told() {
    let said = warnings(&|t| [unit(t)[0], -unit(t)[1], unit(t)[2], unit(t)[3]].to_vec(), MAP);
    assert!(said.contains("spool_position: the servomotor moves against it") && said.contains("sign: -1"), "{said}");
    let said = warnings(&|t| [1.0 - unit(t)[0], unit(t)[1], unit(t)[2], unit(t)[3]].to_vec(), MAP);
    assert!(said.contains("servomotor_position: it moves against the command"), "{said}");
}

#[test]
fn resampling_happens_where_the_map_asks_for_it_and_is_said() {
    let table = Table { header: HEADER, line: &|t| unit(t).to_vec(), has: &|_| true };
    let plain = rows_of(text(&table), MAP).unwrap();
    assert!(plain.1.notes.iter().all(|note| !note.contains("resampled")));
    let (rows, outcome) = rows_of(text(&table), &format!("resample: {{rate_hz: 40}}\n{MAP}")).unwrap();
    assert_eq!(rows.len(), 1200);
    assert!(rows.iter().all(|row| row.time_ns % 25_000_000 == 0));
    let said = outcome.notes.join("\n");
    assert!(said.contains("resampled, as the map asks: 1200 rows every 0.025 s"), "{said}");
}

#[test]
fn constants_and_events_reach_the_rows() {
    use govtwin_bag::import::Target;
    let mut text = "t,y,Ereignis\n".to_owned();
    for k in 0..500 {
        let event = if k == 200 { "SCHNELLSCHLUSS" } else { "" };
        text.push_str(&format!("{},{},{event}\n", k as f64 * 0.01, 0.5 + 0.1 * (k as f64 * 0.05).sin()));
    }
    let map = "signals:\n  servomotor_position: y\n  tank_pressure: {constant: 63, unit: bar}\n  esv: {column: Ereignis, shutdown: Schnellschluss}\n";
    let (rows, _) = rows_of(&text, map).unwrap();
    let pressures: Vec<f64> = rows.iter().filter_map(|row| row.value(Target::TankPressure)).collect();
    assert_eq!(pressures, vec![6.3e6; 5], "at the first row and once a second");
    let trips: Vec<i64> =
        rows.iter().filter(|row| row.value(Target::Esv) == Some(0.0)).map(|row| row.time_ns).collect();
    assert_eq!(trips, [2_000_000_000]);
}

#[test]
fn states_of_which_the_map_calls_none_a_trip_are_told() {
    let told = |[normal, tripped]: [&str; 2], shutdown: &str| {
        let row = |k: i32| format!("{},{},{}\n", f64::from(k) * 0.01, 0.5, if k < 200 { normal } else { tripped });
        let text: String = std::iter::once("t,y,ESV\n".to_owned()).chain((0..500).map(row)).collect();
        let map = format!(
            "signals:\n  servomotor_position: y\n  tank_pressure: {{constant: 63, unit: bar}}\n  esv: {{column: ESV, shutdown: {shutdown}}}\n"
        );
        rows_of(&text, &map).unwrap().1.warnings.join("\n")
    };
    let words = "esv (`ESV`) changes from `OK` to `TRIPPED`, and no cell is `TRIP`: taken as never tripped";
    let said = told(["OK", "TRIPPED"], "TRIP");
    assert!(said.contains(words), "{said}");
    let said = told(["OPEN", "CLOSED"], "\"< 0.5\"");
    assert!(said.contains("no cell is a number below 0.5"), "{said}");
    for (states, shutdown) in [(["OK", "TRIP"], "TRIP"), (["7.5", "7.4"], "\"< 0.5\""), (["1", "0"], "\"< 0.5\"")] {
        assert!(!told(states, shutdown).contains("never tripped"), "{states:?} {shutdown}");
    }
}
