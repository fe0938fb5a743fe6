//! Effects of the owner's: from a file alone, and like the catalogue's in everything.

#[path = "effects/bench.rs"]
mod bench;
#[path = "support/rows.rs"]
mod rows;

use std::collections::BTreeMap;
use std::path::Path;

use allocation_counter::measure;
use govtwin_model::effects::{find_in, own};
use govtwin_model::frame::Estimate;
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::params::{self, Overlay};
use govtwin_model::recording::Process;
use govtwin_model::twin::Twin;

const STICTION: &str = "
effects:
  my_stiction:
    at: servomotor_force_n
    doc: Dry bushings that hold at low speed
    expression: -c_n*tanh(servomotor_velocity_m_s/v_m_s)
    parameters:
      c_n: {unit: N, min: 0, max: 5.0e4, typical: 5.0e3, value: 3.0e3, doc: height of the hump}
      v_m_s: {unit: m/s, neutral: 0.02, min: 1.0e-3, max: 0.1, typical: 0.01, value: 0.005}
";

fn load(text: &str) -> Result<Unit, String> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("unit.yaml");
    std::fs::write(&path, text).unwrap();
    params::load(&path).map_err(|error| error.to_string().replace(&path.display().to_string(), "unit.yaml"))
}

fn course(unit: &Unit, process: Process) -> Vec<Estimate> {
    let rows = rows::rows(20.0, 10_000_000, |time_s| rows::process(process, time_s));
    rows::run(&Twin::new(unit), &rows)
}

/// The one term of an own effect at a point, over what it would replace.
fn one_term(at: &str, expression: &str, unit: &str, max: f64, value: f64) -> Unit {
    load(&format!(
        "effects:\n  mine:\n    at: {at}\n    expression: {expression}\n    parameters:\n      \
         a: {{unit: {unit}, min: {}, max: {max}, typical: {}, value: {value}}}\n",
        -max,
        0.5 * max
    ))
    .unwrap()
}

#[test]
fn an_expression_equal_to_a_built_in_effect_gives_the_same_trajectory() {
    let built_in = |id: &str, values: &[f64]| Unit {
        effects: vec![EffectSetting { id: id.to_owned(), values: values.to_vec() }],
        ..params::reference()
    };
    // A leak from the chamber to return, and a lower load: coefficients of the blocks in the catalogue, terms here. A
    // term holds over a tick, so that they agree to the order of the step and not to the last bit.
    let leak = one_term("chamber_flow_m3_s", "-a*(control_pressure_pa - 1.0e5)", "m3/(s Pa)", 2e-10, 5e-12);
    let load = one_term("servomotor_force_n", "-a*(1.5e5 + 2.5e5*servomotor_position_m/0.6)", "1", 3.0, 0.4);
    let spring = one_term("spool_force_n", "a*4.0e4*(0.03 + spool_position_m)", "1", 0.95, 0.3);
    let pairs = [
        (leak, built_in("chamber_leak", &[5e-12])),
        (load, built_in("load", &[0.4])),
        (spring, built_in("spring", &[0.3, 0.0])),
    ];
    for (own, catalogue) in &pairs {
        for process in Process::ALL {
            let nominal = course(&params::reference(), process);
            let (one, other) = (course(own, process), course(catalogue, process));
            let (effect_pu, difference_pu) = (apart_pu(&other, &nominal), apart_pu(&one, &other));
            let which = format!("{}, {}", catalogue.effects[0].id, process.id());
            assert!(difference_pu < 0.02 * effect_pu, "{which}: {difference_pu:.1e} pu of {effect_pu:.1e} pu");
        }
    }
}

/// Root mean square difference of the two positions once the start is forgotten.
fn apart_pu(one: &[Estimate], other: &[Estimate]) -> f64 {
    let squares = one.iter().zip(other).skip(200).map(|(one, other)| {
        let (a, b) = (&one.signals, &other.signals);
        (a.spool_position_pu - b.spool_position_pu).powi(2)
            + (a.servomotor_position_pu - b.servomotor_position_pu).powi(2)
    });
    let count = one.len() - 200;
    (squares.sum::<f64>() / count as f64).sqrt()
}

#[test]
fn a_definition_reads_back_from_an_overlay() {
    let unit = load(STICTION).unwrap();
    assert_eq!(unit.effects, [EffectSetting { id: "my_stiction".to_owned(), values: vec![3e3, 0.005] }]);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("fitted.yaml");
    let comments = BTreeMap::from([("my_stiction.c_n".to_owned(), "ci90 [2e3, 4e3]".to_owned())]);
    let overlay = Overlay { unit: unit.clone(), name: String::new(), source: String::new(), head: vec![], comments };
    params::write(&path, &overlay).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("# ci90 [2e3, 4e3]"), "{text}");
    assert_eq!(params::load(&path).unwrap(), unit);
    // A file over it may change the values alone.
    let above = dir.path().join("above.yaml");
    std::fs::write(&above, "base: fitted.yaml\neffects:\n  my_stiction: {c_n: 1.0e3, v_m_s: 0.01}\n").unwrap();
    let changed = params::load(&above).unwrap();
    assert_eq!(changed.effects[0].values, [1e3, 0.01]);
    assert_eq!(changed.own_effects, unit.own_effects);
    assert_eq!(params::load_candidates(Path::new(&above)).unwrap(), unit.own_effects);
}

#[test]
fn neutral_is_the_nominal_twin_to_the_last_bit() {
    let mut unit = load(STICTION).unwrap();
    let spec = find_in(&unit, "my_stiction").unwrap();
    unit.effects[0].values = spec.parameters.iter().map(|parameter| parameter.neutral).collect();
    let one = course(&unit, Process::LoadRejection);
    assert_eq!(format!("{one:?}"), format!("{:?}", course(&params::reference(), Process::LoadRejection)));
    unit.effects[0].values = spec.parameters.iter().map(|parameter| parameter.typical).collect();
    assert!(bench::farthest(&course(&unit, Process::LoadRejection), &one) > 1e-4);
}

#[test]
fn the_head_tells_what_the_file_says() {
    let unit = load(STICTION).unwrap();
    let spec = own::spec(&unit.own_effects[0]).unwrap();
    assert_eq!((spec.id, spec.stage.id()), ("my_stiction", "servomotor"));
    let head = spec.head();
    assert_eq!(head.summary, "Dry bushings that hold at low speed.");
    assert!(head.equation.contains("servomotor_force_n += -c_n*tanh(servomotor_velocity_m_s/v_m_s)"));
    assert_eq!(head.symbols.len(), 3);
    assert!(std::ptr::eq(spec, own::spec(&unit.own_effects[0].clone()).unwrap()), "one definition, one specification");
}

#[test]
fn a_step_with_an_own_effect_does_not_allocate() {
    let mut twin = Twin::new(&load(STICTION).unwrap());
    let rows = rows::rows(4.0, 10_000_000, |time_s| rows::process(Process::LoadIncrease, time_s));
    let counted = measure(|| {
        for row in &rows {
            let _ = twin.step(row);
        }
    });
    assert_eq!(counted.count_total, 0);
}

#[test]
fn what_gives_no_number_adds_nothing() {
    // The logarithm of a negative speed has no value; the guard of usual states does not see time beyond them.
    let unit = one_term("servomotor_force_n", "a*if(time_s > 200, ln(-time_s), 0)", "N", 1e4, 5e3);
    let estimates = course(&unit, Process::Startup);
    assert!(estimates.iter().all(|estimate| estimate.signals.servomotor_position_pu.is_finite()));
}

#[test]
fn slips_name_the_way_out() {
    let with = |from: &str, to: &str| load(&STICTION.replace(from, to)).unwrap_err();
    for (from, to, words) in [
        ("servomotor_velocity_m_s/", "servomotor_speed_m_s/", "did you mean `servomotor_velocity_m_s`?"),
        ("tanh(", "tanhh(", "did you mean `tanh`?"),
        ("at: servomotor_force_n", "at: servo_force_n", "`servo_force_n` is not known here; did you mean"),
        ("-c_n*tanh", "-c_n*(tanh", "at character"),
        ("-c_n*tanh", "1 - c_n*tanh", "must add exactly 0"),
        ("-c_n*tanh(servomotor_velocity_m_s/v_m_s)", "-c_n*ln(servomotor_velocity_m_s/v_m_s)", "guard it"),
        ("tanh(servomotor_velocity_m_s/v_m_s)", "tanh(servomotor_velocity_m_s)", "does not use this parameter"),
        ("typical: 5.0e3,", "", "needs `typical`"),
        ("typical: 5.0e3,", "typical: 0,", "must differ from `neutral`"),
        ("max: 5.0e4, typical: 5.0e3, value: 3.0e3", "max: -1, typical: 5.0e3", "min < max"),
        ("value: 3.0e3", "value: 3.0e6", "outside the physical range"),
        ("typical: 5.0e3,", "typcal: 5.0e3,", "did you mean `typical`?"),
        ("my_stiction:", "backlash:", "that the catalogue does not have"),
        ("    doc: Dry", "    docs: Dry", "did you mean `doc`?"),
        ("c_n: {", "tanh: {", "a name of its own"),
    ] {
        let error = with(from, to);
        assert!(error.contains(words), "{from} → {to}: {error}");
        assert!(error.contains("\n  unit.yaml:"), "a line is named: {error}");
    }
    let error = load("effects:\n  my_stiction: {c_n: 1}\n").unwrap_err();
    assert!(error.contains("needs `at` and `expression`"), "{error}");
}
