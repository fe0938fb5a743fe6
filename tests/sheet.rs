//! Sheets from name plates: known units come back, the twin keeps the plate's times, and what is missing is named.
#![cfg(feature = "cli")]

use std::path::Path;
use std::process::Command;

use govtwin_diagnosis::sheet::matter::matter;
use govtwin_diagnosis::sheet::plate_file;
use govtwin_diagnosis::sheet::{Derived, Plate, derive};
use govtwin_model::effects::CATALOGUE;
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::{ENTRIES, Tolerance, Unit};
use govtwin_model::params;
use govtwin_model::twin::Twin;

fn plate(values: &[&str]) -> Plate {
    let values =
        values.iter().map(|text| plate_file::plate_value(text).unwrap_or_else(|error| panic!("{text}: {error}")));
    Plate { name: String::new(), values: values.collect() }
}

fn derived(values: &[&str]) -> Derived {
    derive(&plate(values), &params::reference()).unwrap_or_else(|problems| panic!("{problems:?}"))
}

const LEAST: [&str; 5] = [
    "tank_pressure=63 bar",
    "servomotor_stroke=600 mm",
    "servomotor_volume=120 L",
    "opening_time=9 s",
    "closing_time=6.5 s",
];

/// Time of a full stroke of the twin when the command jumps, s, scaled up from the middle eighty percent, which end cushions and the spool's way do not reach.
fn stroke_time_s(unit: &Unit, opens: bool) -> f64 {
    let mut twin = Twin::new(unit);
    let row = |time_ns: i64, opening_command_pu: f64| Frame {
        time_ns,
        inputs: Inputs {
            opening_command_pu,
            esv: EsvState::Normal,
            tank_pressure_pa: unit.parameters.oil.tank_pressure_pa,
            piston_force_n: 0.0,
        },
        measured: Signals::NONE,
    };
    let (from, to) = if opens { (0.0, 1.0) } else { (1.0, 0.0) };
    let _ = twin.step(&row(0, from));
    let mut passed = [None, None];
    for k in 1..400_000_i64 {
        let opening = twin.step(&row(k * 1_000_000, to)).signals.servomotor_position_pu;
        let gone = if opens { opening } else { 1.0 - opening };
        for (edge, passed) in [0.1, 0.9].into_iter().zip(&mut passed) {
            if passed.is_none() && gone > edge {
                *passed = Some(k as f64 * 1e-3);
            }
        }
        if let [Some(begin), Some(end)] = passed {
            return (end - begin) / 0.8;
        }
    }
    panic!("the servomotor does not move: {passed:?}");
}

#[test]
fn the_twin_moves_in_the_times_of_the_plate() {
    for values in [
        LEAST.to_vec(),
        // Areas halved, 160 bar.
        vec![
            "tank_pressure=160 bar",
            "servomotor_stroke=600 mm",
            "servomotor_volume=60 L",
            "opening_time=12 s",
            "closing_time=8 s",
        ],
        // 4 m3 at low pressure.
        vec![
            "tank_pressure=40 bar",
            "servomotor_stroke=1.6 m",
            "servomotor_volume=4 m3",
            "opening_time=20 s",
            "closing_time=12 s",
        ],
        // Two small ones in push and pull.
        vec![
            "tank_pressure=100 bar",
            "servomotor_stroke=250 mm",
            "piston_diameter=140 mm",
            "rod_diameter=60 mm",
            "servomotors=2",
            "closing_time=5 s",
        ],
        // Stops known, width not.
        [&LEAST[..], &["spool_opening_stop=9 mm", "spool_closing_stop=11 mm"]].concat(),
    ] {
        let found = derived(&values);
        assert_eq!(params::conflicts(&found.unit.parameters).count(), 0, "{values:?}");
        for (opens, by_formula_s) in [(true, found.times_s[0]), (false, found.times_s[1])] {
            let key = if opens { "opening_time" } else { "closing_time" };
            let simulated_s = stroke_time_s(&found.unit, opens);
            assert!(
                (simulated_s / by_formula_s - 1.0).abs() < 0.03,
                "{values:?}: {key} {simulated_s}, by formula {by_formula_s}"
            );
            let stops = values.iter().any(|value| value.starts_with("spool_opening_stop"));
            if let Some(wanted_s) = plate(&values).get(key).filter(|_| !stops) {
                assert!(
                    (by_formula_s / wanted_s - 1.0).abs() < 1e-3,
                    "{values:?}: {key} {by_formula_s}, wanted {wanted_s}"
                );
            }
        }
    }
}

#[test]
fn a_full_plate_of_the_reference_unit_gives_the_reference_unit_back() {
    let template = plate_file::plate_template();
    let values: Vec<String> = template
        .lines()
        .filter_map(|line| line.strip_prefix("# ")?.split_once(": "))
        .filter(|(key, _)| govtwin_diagnosis::sheet::item::item(key).is_some())
        .filter(|(key, _)| {
            !["servomotor_volume", "piston_diameter", "rod_diameter", "opening_time", "closing_time"].contains(key)
        })
        .map(|(key, rest)| format!("{key}={}", rest.split('#').next().unwrap().trim()))
        .collect();
    let found = derived(&values.iter().map(String::as_str).collect::<Vec<_>>());
    let reference = params::reference();
    for entry in ENTRIES {
        let (value, expected) = ((entry.get)(&found.unit.parameters), (entry.get)(&reference.parameters));
        // What no plate says is guessed within its own tolerance.
        let index = ENTRIES.iter().position(|other| other.key == entry.key).unwrap();
        let given = found.sources[entry.key].given;
        let near = match found.unit.tolerances[index] {
            _ if given => (value - expected).abs() <= 0.01 * expected.abs(),
            None => (value - expected).abs() <= 1e-9 * expected.abs().max(1e-12),
            Some(Tolerance::Relative(share)) => (value - expected).abs() <= share * expected.abs(),
            Some(Tolerance::Absolute(size)) => (value - expected).abs() <= size,
            Some(Tolerance::LogNormal(spread)) => (value / expected).ln().abs() <= spread,
        };
        assert!(near, "{}: {value}, the reference unit has {expected} ({:?})", entry.key, found.sources[entry.key]);
    }
}

#[test]
fn every_value_has_a_source_and_what_is_derived_a_tolerance() {
    let found = derived(&LEAST);
    assert_eq!(found.sources.len(), ENTRIES.len());
    assert!(found.sources.values().all(|sourced| !sourced.source.is_empty()));
    for key in ["main_ports.width_m", "servomotor.load_closed_n", "regulator.position_gain", "oil.bulk_modulus_pa"] {
        let index = ENTRIES.iter().position(|entry| entry.key == key).unwrap();
        assert!(found.unit.tolerances[index].is_some() && !found.sources[key].given, "{key}");
    }
    assert!(found.sources["oil.tank_pressure_pa"].source.contains("tank_pressure 63 bar"));
    assert!(found.assumed.iter().any(|assumed| assumed.contains("position_gain is not given")), "{:?}", found.assumed);
}

#[test]
fn plates_that_say_too_little_or_contradict_themselves_are_refused_in_words() {
    for (values, words) in [
        (vec![], "tank_pressure is missing"),
        (vec!["tank_pressure=63 bar"], "the servomotor's size is missing"),
        (vec!["tank_pressure=63 bar", "opening_area=0.2 m2"], "servomotor_stroke is missing"),
        (vec!["tank_pressure=63 bar", "servomotor_volume=120 L", "rod_diameter=1 m"], "rod_diameter stands alone"),
        (
            vec!["tank_pressure=63 bar", "servomotor_stroke=1", "piston_diameter=0.1", "rod_diameter=0.2"],
            "rod_diameter of 0.2 m is no less than piston_diameter of 0.1 m",
        ),
    ] {
        let problems = derive(&plate(&values), &params::reference()).unwrap_err().join("; ");
        assert!(problems.contains(words), "{words}: {problems}");
    }
    for (text, words) in [
        ("tank_presure=63 bar", "did you mean `tank_pressure`?"),
        ("tank_pressure=63", "63 Pa makes no sense of tank_pressure; expected 500000 to 50000000 Pa"),
        ("closing_time", "expected KEY=VALUE"),
    ] {
        assert!(plate_file::plate_value(text).unwrap_err().contains(words), "{text}");
    }
}

#[test]
fn knowing_more_shows_faults_sharper_and_the_missing_items_say_so() {
    let values = plate(&LEAST);
    let unit = derive(&values, &params::reference()).unwrap().unit;
    let found = matter(&unit, &values, 1, &|| ());
    assert_eq!(found.faults.len(), CATALOGUE.len());
    assert!(
        found.faults.iter().all(|fault| fault.with_sheet_ratio <= fault.at_best_ratio * 1.000_001),
        "{:?}",
        found.faults
    );
    assert!(found.missing.windows(2).all(|pair| pair[0].gain >= pair[1].gain));
    // Governor settings and load are guessed widely here: to know one of them shows some fault sharper.
    let first = &found.missing[0];
    assert!(first.gain > 0.1 && !first.effects.is_empty(), "{first:?}");
    assert!(found.missing.iter().all(|help| help.item.key != "closing_time"), "what is given is not missing");
    // The full sheet of the reference unit hides less: of what shows at best, more is left.
    let reference = matter(&params::reference(), &Plate::default(), 1, &|| ());
    let left = |matter: &govtwin_diagnosis::sheet::matter::Matter| {
        let share =
            |fault: &govtwin_diagnosis::sheet::matter::Shows| fault.with_sheet_ratio / fault.at_best_ratio.max(1e-9);
        matter.faults.iter().map(share).sum::<f64>() / matter.faults.len() as f64
    };
    assert!(left(&found) < left(&reference), "{} {}", left(&found), left(&reference));
    assert!(reference.hidden().count() <= found.hidden().count());
}

fn govtwin(args: &[&str], folder: &Path) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_govtwin")).args(args).current_dir(folder).output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    (output.status.code(), said)
}

#[test]
fn the_command_writes_a_sheet_that_every_command_takes() {
    let folder = tempfile::tempdir().unwrap();
    let text = "name: unit 3\nsource: plate of 1998\ntank_pressure: 63 bar\nservomotor_stroke: 600 mm\nservomotor_volume: 120 L\nopening_time: 9 \
                s\nclosing_time: {value: 6.5 s, tol: 0.05, source: rejection test}\n";
    std::fs::write(folder.path().join("plate.yaml"), text).unwrap();
    let (code, said) = govtwin(
        &["sheet", "new", "plate.yaml", "--quick", "--out", "unit.yaml", "--set", "position_gain=25"],
        folder.path(),
    );
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("Full stroke through the ports: 9.00 s opening, 6.50 s closing"), "{said}");
    let sheet = params::load_sheet(&folder.path().join("unit.yaml")).unwrap();
    assert_eq!((sheet.name.as_str(), sheet.unit.parameters.regulator.position_gain), ("unit 3", 25.0));
    assert_eq!(sheet.origins["oil.tank_pressure_pa"].source, "plate of 1998: tank_pressure 63 bar");
    assert_eq!(sheet.unit, {
        let mut plate = plate_file::load_plate(&folder.path().join("plate.yaml")).unwrap();
        plate.values.extend([plate_file::plate_value("position_gain=25").unwrap()]);
        derive(&plate, &params::reference()).unwrap().unit
    });
    let (code, said) = govtwin(&["check", "unit.yaml"], folder.path());
    assert_eq!(code, Some(0), "{said}");
    // The governor's settings are not all given: negative ends of dead bands get a tolerance by their logarithm.
    let bag = concat!(env!("CARGO_MANIFEST_DIR"), "/bags/practice/case_01/load_increase.mcap");
    for args in [
        vec!["replay", bag, "--params", "unit.yaml", "--out", "replayed"],
        vec!["fit", bag, "--params", "unit.yaml", "--out", "fitted.yaml"],
        vec!["diagnose", bag, "--params", "unit.yaml", "--out", "diagnosed"],
    ] {
        let (code, said) = govtwin(&args, folder.path());
        assert!(matches!(code, Some(0 | 3)), "{args:?}: {code:?} {said}");
    }
    let (code, said) = govtwin(&["sheet", "new", "--template"], folder.path());
    assert!(code == Some(0) && said.contains("# closing_time: 4.7 s"), "{said}");
    for (args, code, words) in [
        (vec!["sheet", "new"], 2, "PLATE"),
        (vec!["sheet", "new", "--set", "closing_time=6.5 bar"], 2, "expected a number and one of the units s, ms, min"),
        (vec!["sheet", "new", "--set", "closing_time=6.5 s"], 1, "tank_pressure is missing"),
        (vec!["sheet", "new", "nowhere.yaml"], 1, "cannot read the plate file nowhere.yaml"),
    ] {
        let (found, said) = govtwin(&args, folder.path());
        assert_eq!(found, Some(code), "{args:?}: {said}");
        assert!(said.contains(words), "{args:?}: {said}");
    }
}
