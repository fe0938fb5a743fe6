//! The next test of a diagnosis: it tells more than standing idle, settles what it promises to, and asks for nothing where nothing is open.
#![cfg(feature = "cli")]

use std::process::Command;

use govtwin_bag::Topics;
use govtwin_bag::msg;
use govtwin_diagnosis::decision::Decision;
use govtwin_diagnosis::decision::hyperparameters::Hyperparameters;
use govtwin_diagnosis::decision::posterior::{CountedNats, Posterior};
use govtwin_diagnosis::experiment::candidate_test::candidates;
use govtwin_diagnosis::experiment::survivors::survivors;
use govtwin_diagnosis::experiment::{design, weigh};
use govtwin_diagnosis::generate::noise::{Purpose, READINGS, RandomStreams, Transducer, in_loop};
use govtwin_diagnosis::generate::{Scenario, recording, spread};
use govtwin_diagnosis::hypotheses::table::EvidenceTable;
use govtwin_diagnosis::hypotheses::{Explored, explore};
use govtwin_diagnosis::identification::free_parameter::FreeParameter;
use govtwin_diagnosis::likelihood::noise::expected;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::likelihood::problem::Problem;
use govtwin_diagnosis::model::FittedModel;
use govtwin_diagnosis::result::Diagnosis;
use govtwin_diagnosis::result::test_script::{CommandShape, TestScript};
use govtwin_diagnosis::{DiagnosisSettings, diagnose};
use govtwin_model::effects::{self, CATALOGUE, EffectSpec, find};
use govtwin_model::frame::Signals;
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::params::reference;
use govtwin_model::plant::Plant;
use govtwin_model::plant::term::Point;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::signal::Signal;
use govtwin_model::solver::Method;
use govtwin_model::twin::Twin;

/// Effects that one load increase hardly tells apart.
const TRIED: [&str; 3] = ["supply_loss", "viscosity", "load"];

fn catalogue() -> Vec<&'static EffectSpec> {
    TRIED.iter().filter_map(|id| find(id)).collect()
}

fn unit() -> Unit {
    let mut unit = spread(&reference(), 3);
    unit.effects.push(EffectSetting { id: "supply_loss".to_owned(), values: vec![2.0e10] });
    unit
}

fn load_increase(unit: &Unit) -> Recording {
    let process = Process::LoadIncrease;
    recording(&Scenario { unit: unit.clone(), process, rate_hz: 100.0, duration_s: 40.0, rich: false, seed: 3 })
}

/// What a recorder would have of a unit under a script, positions alone.
fn answered(unit: &Unit, script: &TestScript) -> Recording {
    let random = RandomStreams { seed: 5, process: Process::LoadIncrease };
    let mut servomotor = Transducer::new(unit.sensors.servomotor_position_pu, random.of(Purpose::Servomotor));
    let mut spool = Transducer::new(unit.sensors.spool_position_pu, random.of(Purpose::Spool));
    let mut plant = Plant::new(&unit.parameters);
    effects::apply(unit, &mut plant);
    // The regulator hears its transducer's noise, as in every recording.
    let heard = unit.sensors.servomotor_position_pu;
    plant.terms.push(in_loop(
        Point::RegulatorServomotor,
        heard,
        READINGS,
        random.of(Purpose::RegulatorServomotor),
        1e6,
    ));
    let mut twin = Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, Method::default());
    let mut frames = script.frames(unit.parameters.oil.tank_pressure_pa);
    for frame in &mut frames {
        let signals = twin.step(frame).signals;
        frame.measured = Signals {
            servomotor_position_pu: servomotor.read(signals.servomotor_position_pu),
            spool_position_pu: spool.read(signals.spool_position_pu),
            ..Signals::NONE
        };
    }
    Recording::new("the test", frames)
}

fn judged(recordings: Vec<Recording>) -> Diagnosis {
    let settings = DiagnosisSettings { catalogue: catalogue(), ..DiagnosisSettings::default() };
    diagnose(recordings, &reference(), &settings, &|_, _| ()).unwrap()
}

fn shown(said: &Diagnosis) -> String {
    let ranking: Vec<_> = said.ranking.iter().map(|one| (one.id.as_str(), one.probability)).collect();
    format!("{:?}, {} bits open, {ranking:?}, {:#?}", said.verdict, said.entropy_bits, said.experiments)
}

#[test]
fn the_proposed_test_settles_what_one_recording_leaves_open() {
    let old = load_increase(&unit());
    let before = judged(vec![old.clone()]);
    let best = before.experiments.first().unwrap_or_else(|| panic!("a test is proposed: {}", shown(&before)));
    assert!(before.entropy_bits > 0.2, "{}", shown(&before));
    assert!(best.expected_drop_bits <= best.at_most_bits && best.at_most_bits <= best.entropy_bits + 1e-9);
    assert!(best.trips == 0 && best.separates.len() == 2, "{}", shown(&before));
    let after = judged(vec![old, answered(&unit(), &best.script.unwrap())]);
    let of = |said: &Diagnosis, id: &str| said.ranking.iter().find(|one| one.id == id).unwrap().probability;
    let right = |said: &Diagnosis| of(said, "supply_loss");
    println!("before {}\nafter {}", shown(&before), shown(&after));
    assert!(after.entropy_bits < before.entropy_bits, "before {}\nafter {}", shown(&before), shown(&after));
    assert!(right(&after) > right(&before), "before {}\nafter {}", shown(&before), shown(&after));
    assert_eq!(after.blamed.iter().map(|blame| blame.id.as_str()).collect::<Vec<_>>(), ["supply_loss"]);
}

/// What an exploration of one recording holds.
struct Held {
    problem: Problem,
    found: Explored,
    table: EvidenceTable,
}

fn held() -> Held {
    let recordings = vec![PreparedRecording::new(load_increase(&unit()))];
    let problem = Problem::new(recordings, &reference(), &expected(&reference().sensors));
    let sheet = FittedModel::sheet(&problem, &reference(), &FreeParameter::nuisances(&reference()));
    let found = explore(&problem, &sheet, &sheet, &catalogue(), &|_, _| ());
    let table = EvidenceTable::new(&problem, &found, &catalogue());
    Held { problem, found, table }
}

#[test]
fn a_test_tells_more_than_standing_idle_and_nothing_is_asked_where_one_hypothesis_is_left() {
    let Held { problem, found, table } = held();
    // Two competing hypotheses, as likely as each other.
    let row = |id: &str| table.rows.iter().position(|row| row.effects == [id]).unwrap();
    let [one, other] = ["supply_loss", "load"].map(row);
    let of = |sets: Vec<(usize, f64)>| Posterior { sets, ..Posterior::default() };
    let open = of(vec![(one, 0.5), (other, 0.5)]);
    let decision = Decision::new(&table, &open, &catalogue());
    let left = survivors(&problem, &found, &table, &open, &decision);
    assert_eq!(left.iter().map(|one| one.probability).collect::<Vec<_>>(), [0.5, 0.5]);
    let before = problem.simulations();
    let proposed = design(&problem, &found, (&table, &open, &Hyperparameters::shipped()), &decision);
    let spent = problem.simulations() - before;
    assert!(spent < 600, "{spent} short simulations");
    assert!((proposed.entropy_bits - 1.0).abs() < 1e-9);
    let best = &proposed.experiments[0];
    println!("{spent} simulations, {proposed:#?}");
    let idle = TestScript { start_pu: 0.5, shape: CommandShape::Hold, length_s: best.length_s };
    let recorded = Signal::ALL.map(|signal| Signal::POSITIONS.contains(&signal));
    let leader = left[0].model;
    let idle = candidates(&problem, &leader.unit(), &[idle]);
    let idle = weigh(&problem, &left, leader, &found.refitted().unit(), idle, (CountedNats::FULL, recorded));
    let most = idle.iter().map(|one| one.drop.least_bits).fold(0.0, f64::max);
    assert!(best.expected_drop_bits > 2.0 * most, "{} and idle {most}", best.expected_drop_bits);

    let settled = of(vec![(one, 0.9999), (other, 0.0001)]);
    let decision = Decision::new(&table, &settled, &catalogue());
    let proposed = design(&problem, &found, (&table, &settled, &Hyperparameters::shipped()), &decision);
    assert!(proposed.experiments.is_empty() && proposed.entropy_bits == 0.0, "{proposed:?}");
}

/// Runs the program; its exit code, standard output and standard error.
fn govtwin(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn the_best_test_stands_beside_the_report_as_a_bag_to_play() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (unit, out) = (path("unit"), path("out"));
    let generated = govtwin(&[
        "generate",
        "--process",
        "load_increase",
        "--effect",
        "supply_loss=1.0e10",
        "--seed",
        "3",
        "--out",
        &unit,
    ]);
    assert_eq!(generated.0, Some(0), "{}", generated.2);
    let mut arguments = vec!["diagnose", &unit, "--out", &out];
    for spec in CATALOGUE.iter().filter(|spec| !TRIED.contains(&spec.id)) {
        arguments.extend(["--without", spec.id]);
    }
    let (code, stdout, stderr) = govtwin(&arguments);
    assert!(matches!(code, Some(0 | 3)), "{stderr}");
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(dir.path().join("out/report.json")).unwrap()).unwrap();
    let best = &json["next_experiment"][0];
    assert_eq!(best["bag"], "next_test.mcap", "{json:#}");
    assert!(stdout.contains(best["test"].as_str().unwrap()), "{stdout}");
    let file = dir.path().join("out/next_test.mcap");
    let messages: Vec<_> = govtwin_bag::messages(&file).unwrap().map(Result::unwrap).collect();
    assert!(messages.is_sorted_by_key(|message| message.log_time_ns) && messages[0].log_time_ns == 0);
    let of = |topic: &str| messages.iter().filter(|message| message.topic.name.ends_with(topic)).count();
    let topics = Topics::default();
    let counts = [&topics.command, &topics.esv, &topics.tank_pressure].map(|topic| of(topic));
    let length_s = best["length_s"].as_f64().unwrap();
    let rows = (100.0 * length_s).round() as usize + 1;
    assert_eq!(counts[0], rows, "{counts:?}");
    assert!(counts[1] > rows / 20 && counts[2] > rows / 20 && counts.iter().sum::<usize>() == messages.len());
    let command: msg::GovernorCommand =
        govtwin_bag::cdr::decode(&messages.iter().find(|message| message.topic.name == topics.command).unwrap().data)
            .unwrap();
    assert!((0.0..=1.0).contains(&command.opening) && command.header == msg::Header::at(0));
    // A script holds no servo state, and no stamps: `info` warns of both.
    let (code, text, stderr) = govtwin(&["info", file.to_str().unwrap()]);
    assert!(code == Some(3) && text.contains("/governor/command"), "{code:?} {text} {stderr}");
}
