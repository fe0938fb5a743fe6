//! `use_sim_time` set while nodes run: they begin anew by the other time, with what was set, and record in another bag.
#![cfg(feature = "node")]

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use govtwin_bag::msg::service::Service;
use govtwin_bag::msg::{Clock, EsvState, FluidPressure, GovernorCommand, Header, Interface, ServoState, Time};
use govtwin_node::arguments::Arguments;
use govtwin_node::bus::Bus;
use govtwin_node::core::NodeInput;
use govtwin_node::environment::Environment;
use govtwin_node::live::{self, RunOptions};
use govtwin_node::realtime::wall_ns;
use ros2_client::parameters::raw;
use ros2_client::rcl_interfaces::{SetParametersRequest, SetParametersResponse};
use ros2_client::{Client, ParameterValue, Publisher, ServiceMapping, Subscription};
use serde::{Deserialize, Serialize};

use super::bus::{environment, options, wait_for};
use super::node_replay::journal::assert_replays;

fn request(items: &[(&str, ParameterValue)]) -> SetParametersRequest {
    let item = |(name, value): &(&str, ParameterValue)| raw::Parameter {
        name: (*name).to_owned(),
        value: value.clone().into(),
    };
    SetParametersRequest { parameter: items.iter().map(item).collect() }
}

struct SetParameters;

impl Service for SetParameters {
    const TYPE_NAME: &'static str = "rcl_interfaces/srv/SetParameters";
    const TEXT: &'static str = "";
    type Request = SetParametersRequest;
    type Response = SetParametersResponse;
}

#[derive(Serialize, Deserialize)]
#[serde(transparent)]
struct ParameterEvent(raw::ParameterEvent);

impl Interface for ParameterEvent {
    const TYPE_NAME: &'static str = "rcl_interfaces/msg/ParameterEvent";

    fn stamp(&self) -> Option<Time> {
        None
    }
}

/// Sets parameters of a node and listens to what is told of them.
struct Setter {
    client: Client<SetParametersRequest, SetParametersResponse>,
    events: Subscription<ParameterEvent>,
    _peer: Bus,
}

impl Setter {
    fn new(environment: &Environment, of_node: &str) -> Self {
        let mut peer = Bus::open(environment, Arguments::parse(&[], "setter").unwrap()).unwrap();
        let service = format!("{of_node}/set_parameters");
        let client = peer.call::<SetParameters>(ServiceMapping::Enhanced, &service).unwrap();
        let events = peer.subscribe("/parameter_events").unwrap();
        Self { client, events, _peer: peer }
    }

    /// Asks until there is a response, as a call meets no server while nodes begin anew.
    fn set(&self, items: &[(&str, ParameterValue)]) -> Vec<raw::SetParametersResult> {
        let mut results = Vec::new();
        wait_for("a response", || {
            let _ = self.client.send_request(request(items));
            let until = Instant::now() + Duration::from_millis(500);
            while results.is_empty() && Instant::now() < until {
                if let Ok(Some((_, response))) = self.client.receive_response() {
                    results = response.results;
                }
                std::thread::sleep(Duration::from_millis(5));
            }
            !results.is_empty()
        });
        results
    }

    fn set_sim_time(&self, follows: bool) {
        let results = self.set(&[("use_sim_time", ParameterValue::Boolean(follows))]);
        assert!(results[0].successful, "{results:?}");
    }
}

/// The topics of one unit, from the bench's end.
struct Commanded {
    command: Publisher<GovernorCommand>,
    esv: Publisher<EsvState>,
    pressure: Publisher<FluidPressure>,
    states: Subscription<ServoState>,
}

/// A bench that commands a unit at the machine's time and publishes a clock from 1000 s on.
struct Bench {
    peer: Bus,
    units: Vec<Commanded>,
    clock: Publisher<Clock>,
    clock_ns: i64,
}

/// Whose time a stamp is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TimeOf {
    Clock,
    Machine,
}

impl Bench {
    fn new(environment: &Environment, namespaces: &[&str]) -> Self {
        let mut peer = Bus::open(environment, Arguments::parse(&[], "bench").unwrap()).unwrap();
        let unit = |space: &&str| Commanded {
            command: peer.publish(&format!("{space}/governor/command"), GovernorCommand::TYPE_NAME).unwrap(),
            esv: peer.publish(&format!("{space}/governor/esv"), EsvState::TYPE_NAME).unwrap(),
            pressure: peer.publish(&format!("{space}/governor/tank_pressure"), FluidPressure::TYPE_NAME).unwrap(),
            states: peer.subscribe(&format!("{space}/sim/servo_state")).unwrap(),
        };
        let units = namespaces.iter().map(unit).collect();
        let clock = peer.publish("/clock", Clock::TYPE_NAME).unwrap();
        Self { peer, units, clock, clock_ns: 1_000_000_000_000 }
    }

    /// Drives all units until each has sent 100 states in a row that are stamped by this time; returns how many commands each was sent.
    fn drive_until(&mut self, times: &[TimeOf]) -> u64 {
        let (mut in_row, mut commands) = (vec![0; times.len()], 0);
        wait_for(&format!("states by {times:?}"), || {
            commands += 1;
            self.clock_ns += 10_000_000;
            for Commanded { command, esv, pressure, .. } in &self.units {
                let header = Header::at(wall_ns());
                command.publish(GovernorCommand { header: header.clone(), opening: 0.4 }).unwrap();
                esv.publish(EsvState { header: header.clone(), state: EsvState::NORMAL }).unwrap();
                pressure.publish(FluidPressure { header, fluid_pressure: 6.3e6, variance: 0.0 }).unwrap();
            }
            self.clock.publish(Clock { clock: Header::at(self.clock_ns).stamp }).unwrap();
            for ((unit, time), in_row) in self.units.iter().zip(times).zip(&mut in_row) {
                while let Ok(Some((state, _))) = unit.states.take() {
                    let stamp_ns = state.header.stamp.nanos().unwrap();
                    let of = if stamp_ns < wall_ns() / 2 { TimeOf::Clock } else { TimeOf::Machine };
                    *in_row = if of == *time { *in_row + 1 } else { 0 };
                }
            }
            in_row.iter().all(|in_row| *in_row > 100)
        });
        commands
    }
}

#[test]
fn use_sim_time_is_set_both_ways_while_the_node_runs_and_each_time_has_its_bag() {
    let environment = environment();
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let options = RunOptions { bag: Some(bag.clone()), ..options(&environment, &[]) };
    let (setter, mut bench) = (Setter::new(&environment, "/govtwin"), Bench::new(&environment, &[""]));
    let stop = AtomicBool::new(false);
    let (ended, said, last_commands) = std::thread::scope(|scope| {
        let node = scope.spawn(|| {
            let mut said = Vec::new();
            let ended = live::run(&options, &stop, &mut |_, words| said.push(words.to_owned()));
            (ended.unwrap(), said)
        });
        bench.drive_until(&[TimeOf::Machine]);
        assert_eq!(bench.peer.readers_of("/clock"), 0);
        assert!(setter.set(&[("hold", ParameterValue::Double(3.0))])[0].successful);
        setter.set_sim_time(true);
        bench.drive_until(&[TimeOf::Clock]);
        let told = std::iter::from_fn(|| setter.events.take().ok().flatten());
        let mut told: Vec<String> =
            told.flat_map(|(event, _)| event.0.changed_parameters).map(|parameter| parameter.name).collect();
        // A call that is repeated on a busy machine is told again.
        told.dedup();
        assert_eq!(told, ["hold", "use_sim_time"]);
        setter.set_sim_time(false);
        let last_commands = bench.drive_until(&[TimeOf::Machine]);
        wait_for("the clock is left", || bench.peer.readers_of("/clock") == 0);
        stop.store(true, Ordering::Relaxed);
        let (ended, said) = node.join().unwrap();
        (ended, said, last_commands)
    });
    let bags = ["bag", "bag_2", "bag_3"].map(|name| folder.path().join(name));
    assert_eq!(ended.bags, bags, "{said:?}");
    bags.iter().for_each(|bag| assert_replays(bag, 100));
    // Three bags of 100 states and more, ten ticks apart, and commands of all three.
    assert!(ended.summary.ticks > 3000, "{ended:?}");
    assert!(ended.counts[NodeInput::Command as usize].used > last_commands, "{ended:?} {last_commands}");
    assert_eq!(said.iter().filter(|words| words.contains("begin anew")).count(), 2, "{said:?}");
    let held = "hears /governor/command: governor_msgs/msg/GovernorCommand [pu], required, stale after 2.5 s, held 3 s";
    assert!(said.iter().any(|words| words.starts_with(held)), "what was set is kept: {said:?}");
}

#[test]
fn the_other_units_of_the_process_begin_anew_by_their_own_time() {
    let environment = environment();
    let options = ["/left", "/right"].map(|space| options(&environment, &["-r", &format!("__ns:={space}")]));
    let (setter, mut bench) =
        (Setter::new(&environment, "/left/govtwin"), Bench::new(&environment, &["/left", "/right"]));
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let node = scope.spawn(|| live::run_together(&options, 1, &stop, &mut |_, _| {}).unwrap());
        bench.drive_until(&[TimeOf::Machine, TimeOf::Machine]);
        setter.set_sim_time(true);
        bench.drive_until(&[TimeOf::Clock, TimeOf::Machine]);
        stop.store(true, Ordering::Relaxed);
        assert_eq!(node.join().unwrap().len(), 2);
    });
}

#[test]
fn the_length_of_a_run_counts_from_its_first_start() {
    let environment = environment();
    let length = Duration::from_secs(6);
    let options = RunOptions { duration: Some(length), ..options(&environment, &[]) };
    let setter = Setter::new(&environment, "/govtwin");
    let (stop, is_running, begin) = (AtomicBool::new(false), AtomicBool::new(true), Instant::now());
    let said = std::thread::scope(|scope| {
        scope.spawn(|| {
            // A call has no response once the run has ended.
            let mut follows = false;
            while is_running.load(Ordering::Relaxed) && begin.elapsed() < 3 * length {
                follows = !follows;
                let _ = setter.client.send_request(request(&[("use_sim_time", ParameterValue::Boolean(follows))]));
                std::thread::sleep(Duration::from_millis(300));
            }
        });
        let mut said = Vec::new();
        live::run(&options, &stop, &mut |_, words| said.push(words.to_owned())).unwrap();
        is_running.store(false, Ordering::Relaxed);
        said
    });
    assert!((length..3 * length).contains(&begin.elapsed()), "{:?}", begin.elapsed());
    let anew = said.iter().filter(|words| words.contains("begin anew")).count();
    assert!(anew > 1, "{said:?}");
}
