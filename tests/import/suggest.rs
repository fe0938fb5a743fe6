//! Maps proposed for files of other tools: which columns, which units, and what is left to the reader.

use std::path::Path;

use govtwin_bag::import::suggest::{ColumnUnit, Known, Suggestion, suggest};
use govtwin_bag::import::{Map, SignalPlace, Target, TimeMap, map_text};

use super::{file, fixture, shipped};

fn of(path: &Path) -> Suggestion {
    suggest(path, &Known::default(), &mut |_| ()).unwrap_or_else(|error| panic!("{error}"))
}

fn places(suggestion: &Suggestion) -> Vec<(Target, String)> {
    let place =
        |signal: &govtwin_bag::import::SignalMap| (signal.target, signal.place().unwrap_or("constant").to_owned());
    suggestion.map.signals.iter().map(place).collect()
}

#[test]
fn columns_are_recognised_in_files_of_many_tools() {
    let signals =
        [Target::OpeningCommand, Target::Esv, Target::TankPressure, Target::SpoolPosition, Target::ServomotorPosition];
    for (name, expected) in [
        ("pandas_iso.csv", ["opening_command", "esv_state", "tank_pressure", "spool", "servomotor"]),
        ("german.csv", ["Y_soll [%]", "Notschluß", "p_Tank [bar]", "Hauptsteuerventil [mm]", "Y_ist [mm]"]),
        ("calc.csv", ["Y_soll [%]", "Notschluß", "p_Tank [bar]", "Hauptsteuerventil [mm]", "Y_ist [mm]"]),
        (
            "rosbags.mcap",
            [
                "/gate/setpoint.data",
                "/trip.data",
                "/oil.fluid_pressure",
                "/joint_states.position[spool]",
                "/joint_states.position[servomotor]",
            ],
        ),
    ] {
        let found = of(&fixture(name));
        let expected: Vec<(Target, String)> = signals.into_iter().zip(expected.map(str::to_owned)).collect();
        assert_eq!(places(&found), expected, "{name}");
        // The map reads back, and reads the file.
        let text = map_text(&found.map, &[], |_| String::new());
        let (rows, _) = super::rows(&[fixture(name)], &text).unwrap();
        assert_eq!(rows.len(), 300, "{name}");
    }
    // What the page draws is in the units after the import.
    let german = of(&fixture("german.csv"));
    assert_eq!(german.map.signals[0].conversion.apply(50.0), 0.5);
    assert_eq!(german.map.signals[2].conversion.apply(63.0), 6.3e6);
    let own = of(&shipped("practice/case_01/load_rejection.mcap"));
    assert_eq!(places(&own)[3].1, "/plant/servo_state.spool_position");
    assert!(own.reasons.iter().all(|reason| !reason.why.is_empty()));
}

#[test]
fn what_a_spool_does_to_a_servomotor_tells_columns_without_names() {
    // A spool that the transducer shows upside down, and a force that says nothing.
    let mut text = "zeit,a,b,c\n".to_owned();
    let mut opening = 50.0;
    for k in 0..6000 {
        let time_s = k as f64 * 0.01;
        let spool = (0.7 * time_s).sin() + 0.4 * (1.9 * time_s).sin();
        opening += 0.1 * spool;
        text.push_str(&format!("{time_s},{},{opening},{}\n", -5.0 * spool, (13.0 * time_s).sin()));
    }
    let (_folder, path) = file("unnamed.csv", &text);
    let found = of(&path);
    assert_eq!(places(&found), [(Target::SpoolPosition, "a".into()), (Target::ServomotorPosition, "b".into())]);
    assert!(found.map.signals[0].conversion.turned, "{:?}", found.map.signals[0]);
    let open = found.open.join("\n");
    assert!(open.contains("turned round (`sign: -1`)") && open.contains("`range` holds what the file shows"), "{open}");
    assert!(matches!(found.map.signals[0].from, SignalPlace::Column(_)));
}

#[test]
fn a_zone_is_asked_for_once_and_only_where_times_name_none() {
    for (end, asked) in [("Z", 0), ("+01:00", 0), ("", 1)] {
        let row = |k: usize| format!("2026-09-22T18:38:{:02}.{}00{end},{}\n", k / 10, k % 10, (k as f64 * 0.1).sin());
        let text = (0..500).fold("time,spool [%]\n".to_owned(), |text, k| text + &row(k));
        let (_folder, path) = file("zones.csv", &text);
        let open = of(&path).open;
        let zones = open.iter().filter(|question| question.contains("zone")).count();
        assert_eq!(zones, asked, "{end}: {open:?}");
    }
}

#[test]
fn units_without_a_word_are_guessed_by_size_and_left_open() {
    let mut text = "time,gate setpoint,gate feedback,oil pressure,trip\n".to_owned();
    for k in 0..2000 {
        let time_s = k as f64 * 0.02;
        let y = 50.0 + 30.0 * (0.5 * time_s).sin();
        text.push_str(&format!("{time_s},{},{y},{},0\n", y + 1.0, 62.5 + 0.3 * (0.2 * time_s).sin()));
    }
    let (_folder, path) = file("plain.csv", &text);
    let found = of(&path);
    let unit = |target: Target| {
        found.map.signals.iter().find(|signal| signal.target == target).map(|signal| signal.unit.clone())
    };
    assert_eq!(unit(Target::OpeningCommand).as_deref(), Some("%"));
    assert_eq!(unit(Target::ServomotorPosition).as_deref(), Some("%"));
    assert_eq!(unit(Target::TankPressure).as_deref(), Some("bar"));
    let open = found.open.join("\n");
    for words in ["up to 62.8 looks like bar", "spool_position: no column found"] {
        assert!(open.contains(words), "{words}: {open}");
    }
    // That the servomotor runs while the column says 0 answers what it means.
    assert!(!open.contains("esv"), "{open}");
}

#[test]
fn names_may_hold_the_unit_and_a_command_may_be_one_step() {
    let mut text = "time_s,command_pct,esv,tank_pressure_bar,spool_pct,servo_pct\n".to_owned();
    for k in 0..1500 {
        let since_s = f64::from(k) * 0.02 - 5.0;
        let command = if since_s > 0.0 { 50.0 } else { 20.0 };
        let (spool, servo) = if since_s > 0.0 {
            (30.0 * (-since_s / 3.0).exp(), 50.0 - 30.0 * (-since_s / 3.0).exp())
        } else {
            (0.0, 20.0)
        };
        text.push_str(&format!("{:.2},{command},1,{},{spool},{servo}\n", since_s + 5.0, 160.0 + 0.1 * since_s.sin()));
    }
    let (_folder, path) = file("named.csv", &text);
    let found = of(&path);
    let unit = |target: Target| {
        found.map.signals.iter().find(|signal| signal.target == target).map(|signal| signal.unit.clone())
    };
    for (target, expected) in [
        (Target::OpeningCommand, "%"),
        (Target::TankPressure, "bar"),
        (Target::SpoolPosition, "%"),
        (Target::ServomotorPosition, "%"),
    ] {
        assert_eq!(unit(target).as_deref(), Some(expected), "{target:?}: {:?}", found.open);
    }
    assert!(!found.open.join("\n").contains("states no unit"), "{:?}", found.open);
}

#[test]
fn two_columns_that_would_both_do_are_named() {
    let mut text = "t,u,force,d\n".to_owned();
    let mut d = 0.0;
    for k in 0..4000 {
        let time_s = k as f64 * 0.01;
        let u = (0.9 * time_s).sin() + 0.3 * (2.3 * time_s).sin();
        d += 0.01 * u;
        text.push_str(&format!("{time_s},{u},{},{d}\n", 2.0 * d));
    }
    let (_folder, path) = file("rig.csv", &text);
    let open = of(&path).open.join("\n");
    assert!(open.contains("moves with the spool as"), "{open}");
}

/// A stage that sums up its valve beyond a dead zone, in units that nothing states: valve, position, and something else.
fn stage(rows: usize) -> Vec<[f64; 3]> {
    let (mut valve, mut position) = (0.0_f64, 40.0);
    let row = |k: usize| {
        let level = [0.7, -0.5, 0.0, -0.9, 0.4, 0.9, -0.6][k / 40 % 7];
        valve += 0.3 * (level - valve);
        position += valve.signum() * (valve.abs() - 0.05).max(0.0);
        [5.0 * valve - 2.0, position, (0.7 * k as f64).sin()]
    };
    (0..rows).map(row).collect()
}

/// A command in steps and the position that settles to it, late.
fn position_loop(rows: usize) -> Vec<[f64; 2]> {
    let mut position = 0.0;
    let command = |k: usize| [10.0, 35.0, 20.0, 60.0, 45.0, 5.0][k / 70 % 6];
    let row = |k: usize| {
        position += 0.06 * (command(k.saturating_sub(3)) - position);
        [command(k), position]
    };
    (0..rows).map(row).collect()
}

#[test]
fn a_file_without_names_and_times_is_told_by_its_courses() {
    let text = stage(3000)
        .iter()
        .fold(String::new(), |text, [valve, position, other]| text + &format!("{other},{position},{valve}\n"));
    let (_folder, path) = file("bare.csv", &text);
    let found = of(&path);
    assert_eq!(places(&found), [(Target::SpoolPosition, "#3".into()), (Target::ServomotorPosition, "#2".into())]);
    let strongest = &found.pairs[0];
    assert_eq!((strongest.position, strongest.what, strongest.other), (1, "sums up", 2));
    assert!(found.open[0].contains("rows are counted as if one second apart"), "{:?}", found.open);
    assert_eq!(found.map.time.rate_hz, Some(1.0));
    // With its rate and a unit nothing of both is open.
    let units = vec![ColumnUnit { column: "#2".into(), unit: "mm".into() }];
    let map = Map { time: TimeMap { rate_hz: Some(2000.0), ..TimeMap::default() }, ..Map::default() };
    let found = suggest(&path, &Known { map, units }, &mut |_| ()).unwrap();
    assert_eq!(places(&found)[1].1, "#2");
    let position = &found.map.signals[1];
    assert!(position.unit == "mm" && !found.open.iter().any(|open| open.starts_with("time")), "{:?}", found.open);
    let units = vec![ColumnUnit { column: "Y".into(), unit: "mm".into() }];
    let wrong = suggest(&path, &Known { units, ..Known::default() }, &mut |_| ()).unwrap_err().to_string();
    assert!(wrong.contains("no column `Y`"), "{wrong}");
}

#[test]
fn a_command_is_known_by_what_follows_it() {
    for (head, names) in [("t,β,α\n", ["β", "α"]), ("t,b,a\n", ["b", "a"])] {
        let text = position_loop(3000).iter().enumerate().fold(head.to_owned(), |text, (k, [command, position])| {
            text + &format!("{},{command},{position}\n", k as f64 * 0.01)
        });
        let (_folder, path) = file("loop.csv", &text);
        let found = of(&path);
        let [command, position] = names.map(str::to_owned);
        let wanted = [(Target::OpeningCommand, command), (Target::ServomotorPosition, position)];
        let places: Vec<_> = places(&found).into_iter().filter(|(target, _)| *target != Target::Esv).collect();
        assert_eq!(places, wanted, "{:?}", found.open);
        assert!(found.open.iter().any(|open| open.contains("chosen by its course alone")), "{:?}", found.open);
        let pair = &found.pairs[0];
        let settles_s = pair.settles_s.unwrap();
        assert!(pair.what == "follows" && (0.1..0.25).contains(&settles_s), "{pair:?}");
    }
}

#[test]
fn a_valve_of_two_levels_and_a_speed_are_told_apart() {
    let mut position = 50.0;
    let mut text = "t,pump,height,remark,\n".to_owned();
    for k in 0..3000_usize {
        let on = (k / 35 % 5) % 2;
        let speed = if on == 1 { 9.0 } else { -6.0 };
        position += 0.01 * speed;
        text.push_str(&format!("{},{on},{position}\n", k as f64 * 0.01));
    }
    let (_folder, path) = file("pump.csv", &text);
    assert_eq!(
        places(&of(&path)),
        [(Target::SpoolPosition, "pump".into()), (Target::ServomotorPosition, "height".into())]
    );
    let rows: Vec<f64> = (0..3000).map(|k| (0.01 * f64::from(k)).sin() + 0.3 * (0.037 * f64::from(k)).sin()).collect();
    let text = (1..2999).fold("t,x,w\n".to_owned(), |text, k| {
        text + &format!("{},{},{}\n", k as f64 * 0.01, rows[k], (rows[k + 1] - rows[k - 1]) / 0.02)
    });
    let (_folder, path) = file("speed.csv", &text);
    let found = of(&path);
    assert_eq!(found.pairs[0].what, "has as its speed");
    assert!(found.open.iter().any(|open| open.contains("is the speed of `x` itself")), "{:?}", found.open);
}

#[test]
fn figures_of_an_interval_and_set_points_are_no_other_signals() {
    let mut text = "t,Y_SP avg [%],Y_SP min [%],Y_SP max [%],P_OIL min [bar],P_OIL avg [bar]\n".to_owned();
    for k in 0..2000 {
        let time_s = k as f64 * 0.02;
        let y = 50.0 + 30.0 * (0.5 * time_s).sin();
        let p = 62.5 + 0.3 * (0.2 * time_s).sin();
        text.push_str(&format!("{time_s},{y},{},{},{},{p}\n", y - 1.0, y + 1.0, p - 0.1));
    }
    let (_folder, path) = file("figures.csv", &text);
    let found = of(&path);
    let places: Vec<_> = places(&found).into_iter().filter(|(target, _)| *target != Target::Esv).collect();
    let wanted =
        [(Target::OpeningCommand, "Y_SP avg [%]".to_owned()), (Target::TankPressure, "P_OIL avg [bar]".to_owned())];
    assert_eq!(places, wanted, "{:?}", found.open);
    assert!(found.open.iter().any(|open| open.contains("are means over an interval")), "{:?}", found.open);
}
