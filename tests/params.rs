//! Parameter files as their users write them: overlays, bases, slips, and files that are something else.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use govtwin_model::effects::CATALOGUE;
use govtwin_model::parameters::{ENTRIES, EffectSetting, Tolerance, Unit};
use govtwin_model::params::{self, Overlay, ParamsError};
use proptest::prelude::{any, prop, prop_assert_eq, proptest};

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// Loads `text` from a file.
fn load(text: &str) -> Result<Unit, ParamsError> {
    let folder = tempfile::tempdir().unwrap();
    params::load(&write(folder.path(), "unit.yaml", text))
}

/// The problems of a file as `line key: message`.
fn problems(text: &str) -> Vec<String> {
    let error = load(text).unwrap_err();
    error
        .problems()
        .iter()
        .map(|problem| format!("{} {problem}", problem.line.map_or("-".to_owned(), |line| line.to_string())))
        .collect()
}

fn tolerance(unit: &Unit, key: &str) -> Option<Tolerance> {
    unit.tolerances[ENTRIES.iter().position(|entry| entry.key == key).unwrap()]
}

#[test]
fn the_shipped_sheet_says_what_the_data_sheet_says() {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("params/reference_unit.yaml"));
    let sheet: serde_yaml::Value = serde_yaml::from_str(&text.unwrap()).unwrap();
    let unit = params::reference();
    for entry in ENTRIES {
        let (section, name) = entry.key.split_once('.').unwrap();
        let row = &sheet[section][name];
        assert_eq!(row["value"].as_f64(), Some((entry.get)(&unit.parameters)), "{}", entry.key);
        assert_eq!(row["unit"].as_str(), Some(entry.unit), "{} states its unit", entry.key);
        let expected = row["tol"].as_f64().map(|spread| match (row["abs"].as_bool(), row["log"].as_bool()) {
            (Some(true), _) => Tolerance::Absolute(spread),
            (_, Some(true)) => Tolerance::LogNormal(spread),
            _ => Tolerance::Relative(spread),
        });
        assert_eq!(tolerance(&unit, entry.key), expected, "{}", entry.key);
    }
    let sources = params::reference_sheet().origins;
    assert!(sources.values().all(|origin| !origin.source.is_empty()), "every value names its source");
}

#[test]
fn an_overlay_changes_what_it_names_and_nothing_else() {
    let text = "oil:\n  density_kg_m3: 865\nregulator:\n  spool_gain: {tol: 0.1}\nsensors:\n  spool_position_pu: {noise: 0}\n\
                effects:\n  cushion: {length_pu: 0.06}\n";
    let unit = load(text).unwrap();
    let mut expected = params::reference();
    expected.parameters.oil.density_kg_m3 = 865.0;
    expected.tolerances[1] = Some(Tolerance::Relative(0.1));
    expected.sensors.spool_position_pu.noise = 0.0;
    expected.effects = vec![EffectSetting { id: "cushion".to_owned(), values: vec![0.0, 0.06] }];
    assert_eq!(unit, expected);
    assert_eq!(load("").unwrap(), params::reference());
    assert_eq!(load("# nothing differs\n").unwrap(), params::reference());
}

#[test]
fn a_tolerance_comes_in_three_kinds_and_can_go() {
    let unit = load(
        "oil:\n  density_kg_m3: {tol: 0.01}\n  bulk_modulus_pa: {tol: ~}\n  tank_pressure_pa: {tol: 2.0e4, abs: true}\n\
         esv:\n  drain_area_m2: {tol: 0.2, log: true, unit: m2}\n",
    )
    .unwrap();
    assert_eq!(tolerance(&unit, "oil.density_kg_m3"), Some(Tolerance::Relative(0.01)));
    assert_eq!(tolerance(&unit, "oil.bulk_modulus_pa"), None);
    assert_eq!(tolerance(&unit, "oil.tank_pressure_pa"), Some(Tolerance::Absolute(2.0e4)));
    assert_eq!(tolerance(&unit, "esv.drain_area_m2"), Some(Tolerance::LogNormal(0.2)));
}

#[test]
fn overlays_rest_on_each_other() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("units")).unwrap();
    write(folder.path(), "station.yaml", "source: station book\noil: {density_kg_m3: 860.0, bulk_modulus_pa: 1.2e9}\n");
    let top =
        write(folder.path(), "units/two.yaml", "name: two\nbase: ../station.yaml\noil:\n  density_kg_m3: 865.0\n");
    let sheet = params::load_sheet(&top).unwrap();
    assert_eq!(sheet.name, "two");
    assert_eq!(sheet.files.len(), 2);
    assert_eq!(sheet.unit.parameters.oil.density_kg_m3, 865.0);
    assert_eq!(sheet.unit.parameters.oil.bulk_modulus_pa, 1.2e9);
    let origin = &sheet.origins["oil.density_kg_m3"];
    assert_eq!((origin.file.as_deref(), origin.line), (Some(top.as_path()), Some(4)));
    assert_eq!(sheet.origins["oil.bulk_modulus_pa"].source, "station book");
}

#[test]
fn bases_that_are_missing_circular_or_wrong_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let text = |name: &str| params::load(&folder.path().join(name)).unwrap_err().to_string();
    write(folder.path(), "lost.yaml", "name: x\nbase: nowhere.yaml\n");
    let lost = text("lost.yaml");
    assert!(lost.contains("lost.yaml:2: base: cannot read") && lost.contains("without `base`"), "{lost}");
    // The shipped unit may be named.
    write(folder.path(), "shipped.yaml", "base: reference_unit\noil:\n  density_kg_m3: 870.0\n");
    assert_eq!(params::load(&folder.path().join("shipped.yaml")).unwrap().parameters.oil.density_kg_m3, 870.0);
    write(folder.path(), "a.yaml", "base: b.yaml\n");
    write(folder.path(), "b.yaml", "base: ./a.yaml\n");
    assert!(text("a.yaml").contains("rests on itself"), "{}", text("a.yaml"));
    write(folder.path(), "wrong.yaml", "oil: {density_kg_m3: 1}\n");
    // Nobody's file is quoted because a `base` leads to it.
    for (secret, place) in
        [("root:x:0:0\n", "secret:"), ("user: root\nkey: hunter2\n", "secret:1:"), ("a: [root\nb: 2\n", "secret:")]
    {
        write(folder.path(), "secret", secret);
        write(folder.path(), "thief.yaml", "base: secret\n");
        let told = params::load(&folder.path().join("thief.yaml")).unwrap_err().to_string();
        assert!(told.contains(place) && told.contains("expected a parameter file, with sections such as"), "{told}");
        assert!(!told.contains("root") && !told.contains("user") && !told.contains("hunter2"), "{told}");
    }
    write(folder.path(), "over.yaml", "base: wrong.yaml\n");
    assert!(
        text("over.yaml").contains("wrong.yaml:1: oil.density_kg_m3: 1.0 kg/m3 is outside"),
        "{}",
        text("over.yaml")
    );
}

#[test]
fn every_slip_of_a_file_is_told_at_once_with_the_way_out() {
    let found = problems(
        "oil:\n  densty_kg_m3: 865.0\n  bulk_modulus_pa: -1.1e9\n  tank_pressure_pa: 63 bar\n  return_pressure_pa: .nan\n\
         esv:\n  drain_area_m2: {value: 2.0e-5, unit: mm2}\ndensity_kg_m3: 3\nsensor: {}\nservomotor:\n  width_m: 1\n",
    );
    let expected = [
        "2 oil.densty_kg_m3: unknown key; did you mean `oil.density_kg_m3` in kg/m3?",
        "3 oil.bulk_modulus_pa: -1.1e+9 Pa is outside the physical range, 1.0e+8 to 3.0e+9 Pa",
        "4 oil.tank_pressure_pa: expected a number in Pa, found the text \"63 bar\"; write the number alone, without quotes, \
         unit or separators",
        "5 oil.return_pressure_pa: .nan Pa is outside the physical range, 0.0 to 5.0e+6 Pa",
        "7 esv.drain_area_m2: expected the unit \"m2\", found the text \"mm2\"; nothing is converted here, so convert the \
         value and write that unit",
        "8 density_kg_m3: unknown key; write `density_kg_m3:` indented below `oil:`",
        "9 sensor: unknown key; did you mean `sensors`?",
        "11 servomotor.width_m: unknown key; did you mean `main_ports.width_m` in m?",
    ];
    assert_eq!(found, expected);
}

#[test]
fn the_ends_of_every_effects_range_are_read() {
    for spec in CATALOGUE {
        for parameter in spec.parameters {
            for end in [parameter.min, parameter.max] {
                let text = format!("effects: {{{}: {{{}: {end:?}}}}}", spec.id, parameter.name);
                let unit = load(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
                assert_eq!(unit.effects.len(), 1, "{text}");
            }
        }
    }
}

#[test]
fn wrong_types_are_told() {
    for (text, expected) in [
        ("[1, 2]", "- a parameter file holds sections such as `oil:`; this is a list"),
        ("just text", "- a parameter file holds sections such as `oil:`; this is the text \"just text\""),
        ("oil: 3", "1 oil: holds keys with values, one a line and indented; this is the number 3"),
        ("oil:", "1 oil: holds keys with values, one a line and indented; this is nothing"),
        ("name: 7", "1 name: takes text, not the number 7"),
        ("base: [a]", "1 base: takes text, not a list"),
        ("oil:\n  density_kg_m3: true", "2 oil.density_kg_m3: expected a number in kg/m3, found the truth value true"),
        ("oil:\n  density_kg_m3: [870]", "2 oil.density_kg_m3: expected a number in kg/m3, found a list"),
        (
            "oil:\n  density_kg_m3:",
            "2 oil.density_kg_m3: expected a number in kg/m3, found nothing; write one, or remove the key to keep what lies \
             below this file",
        ),
        (
            "oil: {density_kg_m3: {value: 870, abs: 1}}",
            "1 oil.density_kg_m3.abs: takes true or false, not the number 1",
        ),
        ("oil: {density_kg_m3: {source: 1}}", "1 oil.density_kg_m3.source: takes text, not the number 1"),
        (
            "oil: {density_kg_m3: {tol: -0.1}}",
            "1 oil.density_kg_m3.tol: -0.1 is outside the physical range, 0.0 to 3.0",
        ),
        (
            "oil: {density_kg_m3: {abs: true}}",
            "1 oil.density_kg_m3: `abs` and `log` say how to read `tol`, which is missing; add it",
        ),
        (
            "regulator: {spool_reference_pu: {tol: 0.1}}",
            "1 regulator.spool_reference_pu: a share of 0 is 0; give `tol` in the value's own unit and add `abs: true`",
        ),
        (
            "sensors: {spool_position_pu: 1}",
            "1 sensors.spool_position_pu: expected `{noise: …, step: …}` in pu, found the number 1",
        ),
        ("effects: {backlsh: {}}", "1 effects.backlsh: unknown key; did you mean `backlash`?"),
        ("effects: {backlash: {play: 0.1}}", "1 effects.backlash.play: unknown key; did you mean `play_pu`?"),
        (
            "effects: {backlash: {play_pu: 2}}",
            "1 effects.backlash.play_pu: 2.0 pu is outside the physical range, 0.0 to 0.1 pu",
        ),
    ] {
        assert_eq!(problems(text), [expected], "{text}");
    }
}

#[test]
fn values_that_contradict_each_other_are_told() {
    for (text, expected) in [
        ("regulator: {spool_command_min_pu: 0, spool_command_max_pu: 0}", "leave the regulator nothing to command"),
        ("regulator: {large_loop_period_s: 0.0105}", "whole multiple of the small loop's 0.001 s"),
        ("regulator: {large_loop_period_s: 0.0005}", "whole multiple of the small loop's 0.001 s"),
        ("oil: {return_pressure_pa: 5.0e6, tank_pressure_pa: 4.0e6}", "must lie below the tank's"),
        ("distributing_valve: {stroke_min_m: 0.0}", "open both ways beyond the overlap of 2.0e-4 m"),
        (
            "main_ports: {overlap_m: 0.01}\ndistributing_valve: {stroke_max_m: 0.01}",
            "open both ways beyond the overlap",
        ),
        ("distributing_valve: {control_volume_m3: 5.0e-5}", "the control chamber would hold"),
        ("distributing_valve: {spring_precompression_m: 0.9}", "holding the spool at neutral would take"),
        ("servomotor: {load_closed_n: 2.0e6}", "do not overcome loads"),
    ] {
        let found = problems(text);
        assert!(found.iter().any(|problem| problem.contains(expected)), "{text}: {found:?}");
    }
}

#[test]
fn a_contradiction_over_a_refused_value_is_not_told() {
    let found = problems("regulator: {large_loop_period_s: 0.0105, small_loop_period_s: no}");
    assert_eq!(found.len(), 1, "{found:?}");
}

#[test]
fn files_that_are_something_else_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let text = |path: &Path| params::load(path).unwrap_err().to_string();
    assert!(text(&folder.path().join("missing.yaml")).contains("cannot read the parameter file"));
    assert!(text(folder.path()).contains("cannot read the parameter file"));
    let bytes = folder.path().join("bytes.yaml");
    std::fs::write(&bytes, [0x89, 0x4d, 0x43, 0x41, 0x50, 0xff, 0xfe]).unwrap();
    assert!(text(&bytes).contains("cannot read the parameter file"));
    let bag = folder.path().join("recording.mcap");
    std::fs::write(&bag, vec![b' '; 2 << 20]).unwrap();
    assert!(text(&bag).contains("expected at most 1048576 bytes, found 2097152"), "{}", text(&bag));
    assert!(problems("oil: {density_kg_m3: 870")[0].contains("this is not YAML"));
    assert!(problems("oil:\n  density_kg_m3: 870\n  density_kg_m3: 871\n")[0].contains("duplicate entry"));
    assert!(problems("a: 1\n---\nb: 2\n")[0].contains("this is not YAML"));
    assert!(problems(&"[".repeat(1000))[0].contains("this is not YAML"));
    assert!(problems(&"{a: ".repeat(100_000))[0].contains("expected at most 10000 opening brackets, found 100000"));
    let bomb: String = (1..30).map(|k| format!("a{k}: &a{k} [*a{0},*a{0}]\n", k - 1)).collect();
    assert!(problems(&bomb)[0].contains("expected at most 10 anchors and aliases"));
    let bomb = "a: &a [x,x,x,x,x,x,x,x,x]\nb: &b [*a,*a,*a,*a,*a,*a,*a,*a,*a]\nc: &c [*b,*b,*b,*b,*b,*b,*b,*b,*b]\n\
                d: &d [*c,*c,*c,*c,*c,*c,*c,*c,*c]\ne: &e [*d,*d,*d,*d,*d,*d,*d,*d,*d]\nf: [*e,*e,*e,*e,*e,*e,*e,*e,*e]\n";
    assert!(!problems(bomb).is_empty());
}

#[test]
fn an_overlay_is_written_with_its_comments_and_only_with_what_differs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fits/unit.yaml");
    let mut unit = params::reference();
    unit.parameters.oil.bulk_modulus_pa = 1.0625e9;
    unit.parameters.main_ports.width_m = 0.031;
    unit.tolerances[1] = Some(Tolerance::Absolute(0.5));
    unit.sensors.control_pressure_pa.noise = 2.0e4;
    let overlay = Overlay {
        unit: unit.clone(),
        name: "unit: \"two\"".to_owned(),
        source: String::new(),
        head: vec!["fitted to four recordings".to_owned()],
        comments: BTreeMap::from([
            ("oil.bulk_modulus_pa".to_owned(), "90 %: 1.01e9\nto 1.11e9".to_owned()),
            ("esv.drain_area_m2".to_owned(), "at the prior".to_owned()),
        ]),
    };
    params::write(&path, &overlay).unwrap();
    assert_eq!(
        std::fs::read_to_string(&path).unwrap(),
        "# fitted to four recordings\nname: \"unit: \\\"two\\\"\"\n\
         regulator:\n  spool_gain: {value: 8.0, unit: \"1\", tol: 0.5, abs: true}\n\
         oil:\n  bulk_modulus_pa: 1.0625e+9 # 90 %: 1.01e9 to 1.11e9\n\
         esv:\n  drain_area_m2: 2.0e-5 # at the prior\n\
         main_ports:\n  width_m: 0.031\n\
         sensors:\n  control_pressure_pa: {noise: 20000.0, step: 500.0}\n"
    );
    let sheet = params::load_sheet(&path).unwrap();
    assert_eq!(sheet.unit, unit);
    assert_eq!(sheet.name, "unit: \"two\"");
}

#[test]
fn what_could_not_be_read_back_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("unit.yaml");
    let overlay = |unit| Overlay {
        unit,
        name: String::new(),
        source: String::new(),
        head: Vec::new(),
        comments: BTreeMap::new(),
    };
    let mut negative = params::reference();
    negative.parameters.esv.drain_area_m2 = -1.0;
    assert!(params::write(&path, &overlay(negative)).unwrap_err().to_string().contains("outside the physical range"));
    let mut stranger = overlay(params::reference());
    stranger.comments.insert("oil.colour".to_owned(), "amber".to_owned());
    assert!(params::write(&path, &stranger).is_err());
    assert!(!path.exists());
}

/// The text between a line and the next line that closes the block, of a file of the project.
fn block(file: &str, opening: &str) -> String {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).unwrap();
    let (_, rest) = text.split_once(&format!("{opening}\n")).unwrap_or_else(|| panic!("{file} has {opening}"));
    rest.split_once("```").unwrap().0.to_owned()
}

#[test]
fn what_the_readme_shows_is_so() {
    let unit = load(&block("README.md", "```yaml")).unwrap();
    assert_eq!(unit.parameters.oil.bulk_modulus_pa, 1.1e9);
    assert_eq!(unit.effects.len(), 1);

    let told = block("README.md", "with suggested fixes:\n```text");
    let slips = "name: x\noil:\n  bulk_modulus: 1.1e9\n  density_kg_m3: {value: 8650.0}\neffects:\n  backlsh: {play_pu: 0.004}\n";
    for problem in problems(slips) {
        let (line, problem) = problem.split_once(' ').unwrap();
        assert!(told.contains(&format!("unit2.yaml:{line}: {problem}\n")), "{problem} in\n{told}");
    }
}

proptest! {
    /// Any valid unit survives writing and reading to the last bit.
    #[test]
    fn what_is_written_reads_back(
        shares in prop::collection::vec(-0.05_f64..0.05, ENTRIES.len()),
        chosen in prop::collection::vec(any::<bool>(), ENTRIES.len()),
    ) {
        let mut unit = params::reference();
        for ((entry, share), chosen) in ENTRIES.iter().zip(shares).zip(chosen) {
            let value = (entry.get)(&unit.parameters);
            // The loop periods must stay multiples of each other.
            if chosen && !entry.key.ends_with("_period_s") {
                (entry.set)(&mut unit.parameters, (value * (1.0 + share)).clamp(entry.min, entry.max));
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("unit.yaml");
        let (name, source, head, comments) = Default::default();
        params::write(&path, &Overlay { unit: unit.clone(), name, source, head, comments }).unwrap();
        prop_assert_eq!(params::load(&path).unwrap(), unit);
    }

    /// Text of any kind is a unit or an error, never a panic.
    #[test]
    fn any_text_is_answered(text in "(oil|esv|sensors|effects|base|name|regulator)?(: |:\n  |: \\{|\n|- |&a |\\*a |\\PC){0,12}\\PC{0,20}") {
        let _ = load(&text);
    }

    /// Text near a real file is a unit or an error, never a panic.
    #[test]
    fn a_damaged_sheet_is_answered(cut in 0_usize..6000, length in 0_usize..40, with in "\\PC{0,8}") {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/reference_unit.yaml");
        let text: Vec<char> = std::fs::read_to_string(path).unwrap().chars().collect();
        let start = cut.min(text.len());
        let end = (start + length).min(text.len());
        let damaged: String = text[..start].iter().copied().chain(with.chars()).chain(text[end..].iter().copied()).collect();
        let _ = load(&damaged);
    }
}

#[test]
fn a_clock_of_its_own_is_read_back_and_never_runs_backwards() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("unit.yaml");
    let mut unit = params::reference();
    unit.recorded.clock_ratio = 0.03125;
    let overlay = Overlay {
        unit: unit.clone(),
        name: String::new(),
        source: String::new(),
        head: vec![],
        comments: BTreeMap::new(),
    };
    params::write(&path, &overlay).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("time: {scale: 0.03125}"), "{text}");
    assert_eq!(params::load_sheet(&path).unwrap().unit, unit);
    for (text, words) in [
        ("recorded: {time: {scale: -2}}", "turns time round"),
        ("recorded: {time: {scale: 2, offset: 1}}", "offset"),
        ("recorded: {time: 2}", "seconds of the unit"),
    ] {
        let said = problems(text).join("; ");
        assert!(said.contains(words), "{text}: {said}");
    }
}
