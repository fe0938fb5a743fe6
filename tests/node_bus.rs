//! Two participants on this machine: the node hears, answers, tells strangers apart and leaves.
#![cfg(feature = "node")]

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use govtwin_bag::cdr;
use govtwin_bag::msg::{Clock, EsvState, FluidPressure, GovernorCommand, Header, Interface, ServoState};
use govtwin_node::arguments::Arguments;
use govtwin_node::bus::Bus;
use govtwin_node::core::NodeInput;
use govtwin_node::intake::Refusal;
use govtwin_node::live::{self, NodeResidual, RunOptions};
use govtwin_node::player::tape::Tape;
use govtwin_node::player::{PlayOptions, Player, Stamps};
use govtwin_node::realtime::wall_ns;
use govtwin_node::recorder::{Selection, record};

use super::bus::{environment, options, wait_for};

#[test]
fn the_node_hears_its_peers_tells_strangers_apart_and_leaves() {
    let environment = environment();
    let options = options(&environment, &["-r", "__ns:=/unit7", "-r", "governor/command:=/bench/y"]);
    let mut peer = Bus::open(&environment, Arguments::parse(&[], "bench").unwrap()).unwrap();
    let command = peer.publish("/bench/y", GovernorCommand::TYPE_NAME).unwrap();
    let esv = peer.publish("/unit7/governor/esv", EsvState::TYPE_NAME).unwrap();
    let pressure = peer.publish("/unit7/governor/tank_pressure", FluidPressure::TYPE_NAME).unwrap();
    let stranger = peer.publish::<FluidPressure>("/bench/y", FluidPressure::TYPE_NAME).unwrap();
    let states = peer.subscribe::<ServoState>("/unit7/sim/servo_state").unwrap();
    let there = |peer: &Bus| peer.writers().values().any(|(topic, _)| topic == "/unit7/sim/servo_state");

    let stop = AtomicBool::new(false);
    let (ended, said) = std::thread::scope(|scope| {
        let node = scope.spawn(|| {
            let mut said = Vec::new();
            let ended = live::run(&options, &stop, &mut |_, words| said.push(words.to_owned()));
            (ended, said)
        });
        wait_for("the node comes", || there(&peer) && peer.readers_of("/bench/y") > 0);
        let mut last = None;
        let mut rounds = 0;
        wait_for("states come back", || {
            let header = Header::at(wall_ns());
            command.publish(GovernorCommand { header: header.clone(), opening: 0.4 }).unwrap();
            esv.publish(EsvState { header: header.clone(), state: EsvState::NORMAL }).unwrap();
            let oil = FluidPressure { header, fluid_pressure: 6.3e6, variance: 0.0 };
            pressure.publish(oil.clone()).unwrap();
            stranger.publish(FluidPressure { fluid_pressure: 1.0, ..oil }).unwrap();
            while let Ok(Some((state, _))) = states.take() {
                last = Some(state);
            }
            rounds += 1;
            rounds > 150 && last.is_some()
        });
        let position_pu = last.unwrap().servomotor_position;
        assert!((position_pu - 0.4).abs() < 2e-3, "the stranger's 1.0 was not taken: {position_pu}");
        stop.store(true, Ordering::Relaxed);
        node.join().unwrap()
    });
    let ended = ended.unwrap();
    let counts = ended.counts[NodeInput::Command as usize];
    assert!(counts.used > 10 && counts.refused(Refusal::ForeignType) > 10, "{counts:?}");
    assert!(ended.summary.ticks > 100 && ended.summary.lost_outputs == 0);
    let stranger_told = |words: &String| words.contains("/bench/y") && words.contains("sensor_msgs/msg/FluidPressure");
    assert_eq!(said.iter().filter(|words| stranger_told(words)).count(), 1, "{said:?}");
    wait_for("the node goes", || !there(&peer));
}

#[test]
fn a_recording_loses_nothing_while_it_waits_and_names_what_stayed_silent() {
    let environment = environment();
    let mut recorder = Bus::open(&environment, Arguments::parse(&[], "recorder").unwrap()).unwrap();
    let mut peer = Bus::open(&environment, Arguments::parse(&[], "source").unwrap()).unwrap();
    let command = peer.publish("/tape/command", GovernorCommand::TYPE_NAME).unwrap();
    let topics = [("/tape/command", GovernorCommand::TYPE_NAME), ("/tape/esv", EsvState::TYPE_NAME)];
    let topics = topics.map(|(topic, type_name)| (topic.to_owned(), Some(type_name.to_owned()))).to_vec();
    let selection = Selection { topics, ..Selection::default() };
    let folder = tempfile::tempdir().unwrap();
    let (bag, stop, length) = (folder.path().join("bag"), AtomicBool::new(false), Some(Duration::from_secs(3)));
    let mut speak = |words: &str| {
        assert_eq!(words, "recording");
        wait_for("the recorder comes", || peer.readers_of("/tape/command") > 0);
        // The tape does not run yet, as if it waited for the disk for a second.
        for _ in 0..1000 {
            command.publish(GovernorCommand { header: Header::at(wall_ns()), opening: 0.4 }).unwrap();
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    let recorded = record(&mut recorder, &selection, &bag, length, &stop, &mut speak).unwrap();
    // The network itself may lose a few.
    assert!((900..=1000).contains(&recorded.messages["/tape/command"]), "{recorded:?}");
    assert_eq!(recorded.messages["/tape/esv"], 0);
}

#[test]
fn units_of_one_process_are_nodes_of_their_own() {
    let environment = environment();
    let typo = ["-r", "/left/governor/comand:=/y", "-r", "/right/governor/esv:=/right/esv"];
    let unit = |namespace| options(&environment, &[&["-r", namespace][..], &typo].concat());
    let options = [unit("__ns:=/left"), unit("__ns:=/right")];
    let mut peer = Bus::open(&environment, Arguments::parse(&[], "bench").unwrap()).unwrap();
    let mut ends = Vec::new();
    for (name, esv) in [("left", "/left/governor/esv"), ("right", "/right/esv")] {
        ends.push((
            peer.publish(&format!("/{name}/governor/command"), GovernorCommand::TYPE_NAME).unwrap(),
            peer.publish(esv, EsvState::TYPE_NAME).unwrap(),
            peer.publish(&format!("/{name}/governor/tank_pressure"), FluidPressure::TYPE_NAME).unwrap(),
            peer.subscribe::<ServoState>(&format!("/{name}/sim/servo_state")).unwrap(),
        ));
    }
    let stop = AtomicBool::new(false);
    let (ended, said) = std::thread::scope(|scope| {
        let node = scope.spawn(|| {
            let mut said = Vec::new();
            let ended = live::run_together(&options, 2, &stop, &mut |_, words| said.push(words.to_owned()));
            (ended, said)
        });
        let mut last = [f64::NAN; 2];
        // The twin begins where its first command is; the second it has to follow.
        for openings in [[0.3, 0.6], [0.6, 0.3]] {
            wait_for("each unit follows its own command", || {
                for (index, (command, esv, pressure, states)) in ends.iter().enumerate() {
                    let header = Header::at(wall_ns());
                    command.publish(GovernorCommand { header: header.clone(), opening: openings[index] }).unwrap();
                    esv.publish(EsvState { header: header.clone(), state: EsvState::NORMAL }).unwrap();
                    pressure.publish(FluidPressure { header, fluid_pressure: 6.3e6, variance: 0.0 }).unwrap();
                    while let Ok(Some((state, _))) = states.take() {
                        last[index] = state.servomotor_position;
                    }
                }
                last.iter().zip(openings).all(|(position_pu, opening_pu)| (position_pu - opening_pu).abs() < 2e-3)
            });
        }
        stop.store(true, Ordering::Relaxed);
        node.join().unwrap()
    });
    let ended = ended.unwrap();
    assert_eq!(ended.len(), 2);
    for one in &ended {
        assert!(one.summary.ticks > 100 && one.counts[NodeInput::Command as usize].used > 10, "{:?}", one.counts);
    }
    let told = |what: &str| said.iter().filter(|words| words.contains(what)).count();
    assert_eq!((told("/left/governor/comand"), told("/right/governor/esv:=")), (1, 0), "{said:?}");
    assert!(told("/left/govtwin: ") > 0 && told("/right/govtwin: ") > 0, "{said:?}");
    wait_for("both go", || !peer.writers().values().any(|(topic, _)| topic.ends_with("/sim/servo_state")));
}

/// The commands of a bag that differ from those before them, with their log times.
fn commands_in(bag: &Path) -> Vec<(i64, f64)> {
    let messages = govtwin_bag::messages(bag).unwrap().map(Result::unwrap);
    let commands = messages.filter(|message| message.topic.name == "/governor/command");
    let decoded = commands.map(|message| (message.log_time_ns, cdr::decode::<GovernorCommand>(&message.data).unwrap()));
    let mut all: Vec<(i64, f64)> = decoded.map(|(time_ns, command)| (time_ns, command.opening)).collect();
    all.dedup_by_key(|(_, opening)| *opening);
    all
}

#[test]
fn a_clock_that_waits_for_what_is_played_before_it_brings_no_command_late_on_a_busy_machine() {
    let environment = environment();
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let options = RunOptions { bag: Some(bag.clone()), ..options(&environment, &["-p", "use_sim_time:=true"]) };
    let source = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("bags/reference/load_rejection_01.mcap");
    let topics = ["/governor/command", "/governor/esv", "/governor/tank_pressure"].map(str::to_owned);
    let (tape, _) = Tape::open(source.clone(), topics.to_vec(), Some(Duration::from_secs(150))).unwrap();
    let tape = tape.unwrap();
    let mut peer = Bus::open(&environment, Arguments::parse(&[], "tape").unwrap()).unwrap();
    let wait = Duration::from_secs(20);
    let play = PlayOptions { speed_ratio: 50.0, repeat: false, clock_hz: Some(100.0), wait, stamps: Stamps::Recorded };
    let player = Player::open(&mut peer, &tape, &play).unwrap();
    let (stop, is_busy) = (AtomicBool::new(false), AtomicBool::new(true));
    let (played, ended) = std::thread::scope(|scope| {
        let node = scope.spawn(|| live::run(&options, &stop, &mut |_, _| {}));
        let readers = || topics.iter().chain([&"/clock".to_owned()]).all(|topic| peer.readers_of(topic) > 0);
        wait_for("the node comes", readers);
        std::thread::sleep(Duration::from_millis(700));
        for _ in 0..12 {
            scope.spawn(|| {
                while is_busy.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let played = player.play(&tape, &play, &stop, &mut |_| {}).unwrap();
        is_busy.store(false, Ordering::Relaxed);
        std::thread::sleep(Duration::from_millis(500));
        stop.store(true, Ordering::Relaxed);
        (played, node.join().unwrap().unwrap())
    });
    assert!(played.unacknowledged.is_empty() && played.lost == 0, "{played:?}");
    assert_eq!(ended.counts[NodeInput::Command as usize].lost, 0);
    let (sent, used) = (commands_in(&source), commands_in(&bag));
    let last_ns = used.last().unwrap().0;
    let sent: Vec<(i64, f64)> = sent.into_iter().filter(|(time_ns, _)| *time_ns < last_ns).collect();
    assert!(sent.len() > 50, "{}", sent.len());
    for ((sent_ns, opening), (used_ns, taken)) in sent.iter().zip(&used) {
        let delay_ns = used_ns - sent_ns;
        assert!(
            taken == opening && (0..=2_000_000).contains(&delay_ns),
            "{opening} at {sent_ns}, {taken} at {used_ns}"
        );
    }
}

#[test]
fn clock_and_inputs_are_followed_whether_they_are_published_reliably_or_best_effort_and_so_is_the_shipped_residual() {
    for reliability in ["reliable", "best_effort"] {
        let environment = environment();
        let options =
            RunOptions { residual: NodeResidual::Shipped, ..options(&environment, &["-p", "use_sim_time:=true"]) };
        let topics = ["clock", "governor/command", "governor/esv", "governor/tank_pressure"];
        let of_topic = |topic| format!("qos_overrides./{topic}.publisher.reliability:={reliability}");
        let words: Vec<String> = topics.iter().flat_map(|topic| ["-p".to_owned(), of_topic(topic)]).collect();
        let mut peer = Bus::open(&environment, Arguments::parse(&words, "simulator").unwrap()).unwrap();
        let clock = peer.publish("/clock", Clock::TYPE_NAME).unwrap();
        let command = peer.publish("/governor/command", GovernorCommand::TYPE_NAME).unwrap();
        let esv = peer.publish("/governor/esv", EsvState::TYPE_NAME).unwrap();
        let pressure = peer.publish("/governor/tank_pressure", FluidPressure::TYPE_NAME).unwrap();
        let states = peer.subscribe::<ServoState>("/sim/servo_state").unwrap();
        let corrected = peer.subscribe::<ServoState>("/sim/corrected/servo_state").unwrap();
        let stop = AtomicBool::new(false);
        let said = std::thread::scope(|scope| {
            let node = scope.spawn(|| {
                let mut said = Vec::new();
                let ended = live::run(&options, &stop, &mut |_, words| said.push(words.to_owned())).unwrap();
                (said, ended.counts[NodeInput::Command as usize])
            });
            wait_for("the node follows the clock", || peer.readers_of("/clock") > 0);
            let (mut time_ns, mut newest, mut sent) = (1_000_000_000_000, [0, 0], 0);
            wait_for(reliability, || {
                let header = Header::at(time_ns);
                command.publish(GovernorCommand { header: header.clone(), opening: 0.4 }).unwrap();
                esv.publish(EsvState { header: header.clone(), state: EsvState::NORMAL }).unwrap();
                pressure
                    .publish(FluidPressure { header: header.clone(), fluid_pressure: 6.3e6, variance: 0.0 })
                    .unwrap();
                clock.publish(Clock { clock: header.stamp }).unwrap();
                (time_ns, sent) = (time_ns + 10_000_000, sent + 1);
                for (heard, newest) in [&states, &corrected].into_iter().zip(&mut newest) {
                    while let Ok(Some((state, _))) = heard.take() {
                        *newest = state.header.stamp.nanos().unwrap();
                    }
                }
                newest.iter().all(|newest_ns| *newest_ns > 1_001_000_000_000)
            });
            stop.store(true, Ordering::Relaxed);
            let (said, counts) = node.join().unwrap();
            assert!(counts.used <= sent, "each sample counts once: {} of {sent}", counts.used);
            said
        });
        assert!(!said.iter().any(|words| words.contains("offers less")), "{said:?}");
        let told = said.iter().filter(|words| words.contains("reference_unit.residual (shipped)")).count();
        assert_eq!(told, 1, "{said:?}");
    }
}
